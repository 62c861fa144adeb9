"""Designs of a run that is being made: followed under every load, kept in its folder, and forgotten when they
are outdated.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from shellform.arrays import Reals
from shellform.case.build_problem import edge_utilisation
from shellform.errors import NotConverged
from shellform.gridshell.gridshell import Design, Gridshell
from shellform.net.grid import CONNECTOR
from shellform.problem.paths import deviations, follow
from shellform.records.summary import DesignRecord, LoadRecord, Summary, write_summary
from shellform.reliability.safety import paths
from shellform.run.design_files import design_file, write_design_file
from shellform.run.figures import write_states
from shellform.run.workspace import Workspace
from shellform.structure.answers import results
from shellform.structure.elements.state import State, extended
from shellform.structure.model import Model, write_model
from shellform.structure.network import assemble
from shellform.structure.solve.equilibrium import Equilibrium, find_equilibrium
from shellform.structure.solve.extended import with_twice_the_digits
from shellform.structure.solve.loading import Loaded
from shellform.structure.solve.residual import OF_LOAD


def followed(shell: Gridshell, design: Design, loads: Mapping[str, Reals]) -> dict[str, Loaded]:
    """As `follow`; where a snap-through doesn't settle, the last state stands for it, and is marked by its
    residual.
    """
    try:
        return follow(shell, design, loads)
    except NotConverged as error:
        if not isinstance(error.state, State):
            raise
        lost = Loaded(
            Equilibrium(error.state, float("nan"), error.residual, error.iterations, False, 1), 0.0, 0
        )
        return {name: lost for name in loads}


def keep(
    workspace: Workspace,
    shell: Gridshell,
    name: str,
    design: Design,
    loaded: Mapping[str, Loaded],
    loads: Mapping[str, Reals],
    summary: Summary,
) -> Summary:
    """Writes a design's model file, its states, and the summary with it, which is returned. Raises
    NotConverged."""
    loaded = {each: _settled(shell, design, loaded[each], loads[each]) for each in loads}
    record = write_design(workspace.folder, shell, name, design, loaded, loads)
    states = {each: loaded[each].equilibrium.state for each in loads}
    write_states(workspace.folder, shell, name, design, states)
    summary = summary.with_design(name, record)
    write_summary(workspace.folder, summary)
    return summary


def _settled(shell: Gridshell, design: Design, loaded: Loaded, load: Reals) -> Loaded:
    """The same; without load with twice the digits where double precision leaves more than 1e-6 of the
    stress, as it does of bent rods beside stiff edge beams. On the way that is good enough, and a hundred
    times as fast."""
    found = loaded.equilibrium
    if load.any() or not found.stable or found.residual <= OF_LOAD:
        return loaded
    precise = with_twice_the_digits(assemble(shell.network(design)))
    assert precise is not None  # of beams and cables alone
    return replace(loaded, equilibrium=find_equilibrium(precise, extended(found.state), load))


def forget(folder: Path, names: Sequence[str], summary: Summary) -> Summary:
    """Takes designs of an earlier run away, some of which this one may not make, with every picture and film
    of them; returns the summary without them.
    """
    for name in names:
        for part in (design_file(name), f"designs/{name}.json", f"designs/{name}-drawn.json"):
            (folder / part).unlink(missing_ok=True)
        pictures = [file for file in folder.glob("figures/*") if name in file.stem.split("-")]
        for file in [*folder.glob(f"states/{name}-*.vtp"), *pictures]:
            file.unlink()
    for table in ("sections", "robust"):
        (folder / f"schedules/{table}.csv").unlink(missing_ok=True)
    return summary.without_designs(names)


def write_design(
    folder: Path,
    shell: Gridshell,
    name: str,
    design: Design,
    loaded: Mapping[str, Loaded],
    loads: Mapping[str, Reals],
) -> DesignRecord:
    """Writes a design's model file and states; returns its record."""
    supports = tuple(int(node) for node in shell.net.supports)
    network = shell.network(design)
    model = Model(network, {each: loads[each] for each in loads if loads[each].any()}, shell.target, supports)
    write_model(folder / f"designs/{name}.json", model)
    states = {each: loaded[each].equilibrium.state for each in loads}
    write_design_file(folder, name, design, states)
    pull = shell.cables(design).tension(states["design"])
    weight = loads["design"][:, 2].sum()
    return DesignRecord(
        cables=int(design.present.sum()),
        rod_radius=design.radius,
        cable_force_sum=float(pull.sum()),
        cable_force_max=float(pull.max(initial=0.0)),
        loads={
            each: load_record(
                shell,
                design,
                loaded[each],
                load,
                float(load[:, 2].sum() / weight),
                multiple=_is_multiple(load, loads["design"]),
            )
            for each, load in loads.items()
        },
    )


def _is_multiple(load: Reals, design_load: Reals) -> bool:
    """Whether a load (n, 6) is so many times the design load, or nothing of it: one of other shares of the
    parts may weigh as much and lies on another path."""
    return len(paths({"load": load, "design": design_load})) == 1


def load_record(
    shell: Gridshell, design: Design, loaded: Loaded, load: Reals, factor: float, *, multiple: bool = True
) -> LoadRecord:
    """The record of a design under a `load` (n, 6), which weighs so many times as much as the design load and
    may be a `multiple` of it."""
    state = loaded.equilibrium.state
    away, pull = deviations(shell, state), shell.cables(design).tension(state)
    beams = shell.beams(design.radius)
    turn = results.twist(beams.local_deformations(state))[beams.of_kind(CONNECTOR)]
    push = assemble(shell.network(design)).unbalanced(state, load)[shell.net.supports]
    return LoadRecord(
        factor=round(factor, 12) + 0.0,  # no -0
        deviation_max=float(away.max()),
        deviation_mean=float(away.mean()),
        deviation_rms=float(np.sqrt((away**2).mean())),
        stable=loaded.equilibrium.stable,
        on_branch=loaded.on_branch,
        residual=loaded.equilibrium.residual,
        rod_utilisation_max=float(shell.bending_utilisation(design, state).max()),
        stress_utilisation_max=float(shell.utilisation(design, state).max()),
        connector_turn_max=float(np.abs(turn).max(initial=0.0)),
        uplift_max=max(0.0, -float(push[:, 2].min())),
        thrust_max=float(np.hypot(*push[:, :2].T).max()),
        edge_utilisation_max=edge_utilisation(shell, beams, beams.local_forces(state)),
        cable_force_max=float(pull.max(initial=0.0)),
        cable_force_min=float(pull.min()) if len(pull) else None,
        cables_slack=int((pull <= 0.0).sum()),
        slack=slack_names(pull),
        multiple=multiple,
    )


def slack_names(tension: Reals) -> tuple[str, ...]:
    """The names, as in the schedules, of those of a design's cables that pull with nothing."""
    return tuple(f"C{k}" for k in np.flatnonzero(tension <= 0.0))
