"""The pictures of a run: deviation maps of its designs under its loads, maps of its net, histories, and states as .vtp files."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from shellform.arrays import Reals
from shellform.design.gridshell import Design, Gridshell
from shellform.design.problem import deviations
from shellform.errors import InputError
from shellform.structure.state import State
from shellform.study.folder import Report, Run, read_run

_MARKED = 0.2  # of the largest load on a node: smaller ones, such as of the rods' own weight, would hide the shell behind arrows


def draw_everything(run: Run, *, report: Report = lambda stage, text: None) -> None:
    """All pictures of a run. Without OpenGL the histories alone, and a line that says why."""
    from shellform.output import plots
    from shellform.output.nets import draw_net

    try:
        draw_designs(run, report=report)
        draw_net(run.net, run.folder / "figures")
    except InputError as error:  # no OpenGL: everything but the pictures is still made
        report("figures", f"no pictures: {error}")
    with (run.folder / "history.csv").open(encoding="utf-8", newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["accepted"] == "1"]
    at = [int(row["evaluation"]) for row in rows]

    def columns(prefix: str) -> dict[str, list[float]]:
        return {
            name.removeprefix(prefix): [float(row[name]) for row in rows] for name in rows[0] if name.startswith(prefix)
        }

    plots.objective_history(run.folder / "figures/objective.png", at, columns("term."))
    plots.constraint_history(run.folder / "figures/constraints.png", at, columns("constraint."))


def draw_run(folder: str | Path, *, design: str | None = None, load: str | None = None, limit: float | None = None) -> list[Path]:
    """Draws the deviation maps of a run's designs and loads (all, or those named) and returns their files."""
    return draw_designs(read_run(folder), design=design, load=load, limit=limit)


def draw_designs(
    run: Run,
    *,
    design: str | None = None,
    load: str | None = None,
    limit: float | None = None,
    report: Report = lambda stage, text: None,
) -> list[Path]:
    """As `draw_run`, of a run that is read already."""
    from shellform.output import render

    for what, name, known in [("--design", design, list(run.designs)), ("--load", load, list(run.loads))]:
        if name is not None and name not in known:
            raise InputError("isn't there", where=what, value=name, remedy=f"Known: {', '.join(known)}.")
    scale = limit or run.case.figures.limit
    rows, files = [], []
    for name in [design] if design else run.designs:
        row = []
        for each in [load] if load else run.loads:
            report("figures", f"{name}, {each}")
            title = f"{name} design, load: {each}"
            panel = _panel(render, run.shell, title, run.designs[name], run.states[name][each], run.loads[each])
            file = run.folder / f"figures/{name}-{each}.png"
            render.picture(file, panel, limit=scale)
            files.append(file)
            row.append(panel)
        rows.append(row)
    if len(rows) * len(rows[0]) > 1:
        file = run.folder / "figures/deviations.png"
        render.sheet(file, rows, limit=scale)
        files.append(file)
    return files


def write_states(
    folder: Path,
    shell: Gridshell,
    name: str,
    design: Design,
    states: Mapping[str, State],
    loads: Mapping[str, Reals],
) -> None:
    """states/NAME-LOAD.vtp: the loaded geometry with deviations, m, and the rods' end forces. Raises InputError without OpenGL."""
    from shellform.output import render

    labels = ("N", "Mx_a", "My_a", "Mz_a", "Mx_b", "My_b", "Mz_b")
    for each, state in states.items():
        forces = shell.beams(design.radius).local_forces(state)[: len(shell.net.grid.rod_ends)]
        panel = _panel(render, shell, name, design, state, loads[each])
        columns = {label: forces[:, k] for k, label in enumerate(labels)}
        render.write_vtp(folder / f"states/{name}-{each}.vtp", panel, columns)


def _panel(render: Any, shell: Gridshell, title: str, design: Design, state: State, load: Reals) -> Any:
    cables = shell.cables(design)
    weight = np.linalg.norm(load[:, :3], axis=1)
    return render.Panel(
        title,
        state.positions,
        shell.net.grid.rod_ends,
        deviations(shell, state),
        cables.ends,
        cables.tension(state),
        shell.net.supports,
        np.flatnonzero(weight > _MARKED * weight.max()),
        design.radius,
    )
