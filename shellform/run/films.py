"""Films of a run: the load coming on (`pour`), stage after stage where it is poured in stages, and the grid
rising from the ground (`erection`).

The frames are equilibria. A pour goes from the state before along the documented path (loading.py) and its
frames lie evenly over the load, states in between on straight lines; erection shows the steps of
erection.py, few of those stages in which the grid hardly moves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from shellform.errors import require_known
from shellform.records.progress import Event, Report, unheard
from shellform.run.figures import Wish, look_of, titled
from shellform.run.folder import Run, figures_folder
from shellform.site.erection import erect
from shellform.site.erection_steps import ErectionStep
from shellform.structure.elements import rotation
from shellform.structure.elements.state import State
from shellform.structure.network import assemble
from shellform.structure.solve.equilibrium import Equilibrium
from shellform.structure.solve.loading import apply_load

_FRAMES = 24  # of a stage
_BRIEF = 6  # steps to a frame where little moves
_LONG = ("raising", "moving supports", "tightening", "loading")  # stages in which much does
_SIZE = (960, 600)  # pixels


def draw_film(run: Run, kind: str, wish: Wish, *, report: Report = unheard) -> list[Path]:
    """Writes figures/pour-DESIGN-LOAD or figures/erection-DESIGN in the wish's formats; the design is the
    best one unless it is named.

    Raises InputError for unknown names and where VTK can't draw, NotConverged where there is no path.
    """
    from shellform.output.pictures import images, painter, render

    painter.require()  # before minutes are spent on states
    images.require(wish.endings)
    name = wish.design or run.best
    require_known(name, run.designs, where="--design", what="isn't there")
    require_known(wish.load or "design", run.loads, where="--load", what="isn't there")
    if kind == "pour":
        stages = _stages(run, wish.load)
        panels = _pour(run, name, stages, wish.quantity, report)
        stem = f"pour-{name}-{stages[-1]}"
    else:
        panels = _erection(run, name, wish, report)
        stem = f"erection-{name}"
    look = look_of(run, replace(wish, size=wish.size or _SIZE), panels)
    folder = figures_folder(run, wish.folder)
    files = [folder / f"{stem}{ending}" for ending in wish.endings]
    report(Event("film", f"drawing {len(panels)} frames"))
    render.film(files, [titled(run, panel) for panel in panels], look)
    return files


def _stages(run: Run, load: str | None) -> list[str]:
    """The load cases that follow one another: all stages of a poured case up to the one that is meant, or
    that case alone.
    """
    wanted = load or "design"
    entries = run.case.load if isinstance(run.case.load, list) else []
    for entry in entries:
        names = [f"{entry.name} {k}" for k in range(1, len(entry.stages) + 1)]
        if load is None and names:
            return names
        if wanted in names:
            return names[: names.index(wanted) + 1]
    return [wanted]


def _pour(run: Run, name: str, stages: Sequence[str], quantity: str, report: Report) -> list[Any]:
    from shellform.output.pictures import maps

    design, shell = run.designs[name], run.shell_of(name)
    assembly = assemble(shell.network(design))
    state, before = run.states[name]["none"], run.loads["none"]
    panels: list[Any] = []
    for stage in stages:
        after, found = run.loads[stage], [(0.0, state)]

        def note(share: float, reached: Equilibrium, found: list[tuple[float, State]] = found) -> None:
            found.append((share, reached.state))
            report(Event("film", f"at {100.0 * share:.0f} %", fraction=share))

        reached = apply_load(assembly, state, before, after, step=1.0 / _FRAMES, report=note)
        first = 1 if panels else 0
        for share in np.linspace(0.0, 1.0, _FRAMES + 1)[first:]:
            load = before + share * (after - before)
            shown = f"{name} design, {stage} load, {100.0 * share:.0f} %" + (
                "" if reached.on_branch or share < reached.share else ": snapped"
            )
            panels.append(
                maps.panel_of(
                    shell, design, _between(found, float(share)), load=load, quantity=quantity, title=shown
                )
            )
        state, before = reached.equilibrium.state, after
    return panels


def _between(found: Sequence[tuple[float, State]], share: float) -> State:
    """The state at a share of the load, on the straight line between the two that are known."""
    at = [each[0] for each in found]
    after = min(int(np.searchsorted(at, share)), len(at) - 1)
    if after == 0 or at[after] == share:
        return found[after][1]
    (low, a), (high, b) = found[after - 1], found[after]
    t = (share - low) / (high - low)
    place = (1.0 - t) * a.positions + t * b.positions
    return State(place, rotation.between(a.quaternions, b.quaternions, t))


def _erection(run: Run, name: str, wish: Wish, report: Report) -> list[Any]:
    from shellform.output.pictures import maps

    report(Event("film", "following the grid from the ground"))
    design, shell = run.designs[name], run.shell_of(name)
    load = run.loads[wish.load] if wish.load else None
    found = erect(shell, design, by=wish.by, tighten_first=wish.tighten_first, load=load, step=1.0 / _FRAMES)
    steps = _shown(found.steps)
    braced = (k for k, step in enumerate(steps) if step.stage in ("tightening", "loading"))
    first = next(braced, len(steps))  # step with cables
    pairs = steps[first - 1].state.positions[shell.cable_ends]
    # As erection.py begins to tighten them.
    slack = np.maximum(np.linalg.norm(pairs[:, 1] - pairs[:, 0], axis=1), design.rest_length)
    none = design.unbraced()
    panels: list[Any] = []
    for number, step in enumerate(steps):
        tightened = step.share if step.stage == "tightening" else 1.0
        shown = replace(design, rest_length=slack + tightened * (design.rest_length - slack))
        acting = step.share * load if load is not None and step.stage == "loading" else None
        title = f"{name} design, {step.stage}, {100.0 * step.share:.0f} %"
        panels.append(
            maps.panel_of(
                shell,
                none if number < first else shown,
                step.state,
                load=acting,
                quantity=wish.quantity,
                title=title,
            )
        )
    return panels


def _shown(steps: Sequence[ErectionStep]) -> list[ErectionStep]:
    """Steps that are frames: all of the long stages, and the last of each few of the others."""
    shown = list[ErectionStep]()
    for stage in dict.fromkeys(step.stage for step in steps):
        own = [step for step in steps if step.stage == stage]
        shown += own if stage in _LONG else own[::-_BRIEF][::-1]
    return shown
