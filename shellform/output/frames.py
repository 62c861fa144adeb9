"""What an optimum, or any design in its states, comes to as tables: one row a cable, rod, node or step.

`pandas.DataFrame(table.records())` makes a data frame of one; `table_text` its CSV. Names and numbers are
those of the drawings. SI units, said in the columns' heads.
"""

from __future__ import annotations

from collections.abc import Mapping

from shellform.gridshell.gridshell import Design, Gridshell
from shellform.net.grid import rod_names
from shellform.optimiser.optimum import Optimum
from shellform.output.pictures.maps import worst_at_nodes
from shellform.output.workshop.schedules import cable_crossings
from shellform.problem.paths import deviations
from shellform.structure.elements.state import State
from shellform.tables import Table, Value


def history(optimum: Optimum) -> Table:
    """A row a trial: objective, its terms, constraints, cables in tension, whether it was accepted, s."""
    steps = optimum.history
    terms = list(dict.fromkeys(name for step in steps for name in step.terms))
    limits = list(dict.fromkeys(name for step in steps for name in step.constraints))
    heads = ("evaluation", "accepted", "objective", *(f"term {name}" for name in terms))
    heads += (*(f"constraint {name}" for name in limits), "cables", "time [s]")
    rows = tuple(
        (
            step.evaluation,
            int(step.accepted),
            step.objective,
            *(step.terms.get(name) for name in terms),
            *(step.constraints.get(name) for name in limits),
            step.cables,
            step.seconds,
        )
        for step in steps
    )
    return Table("history", heads, rows)


def cables(shell: Gridshell, design: Design, states: Mapping[str, State]) -> Table:
    """A row a cable: its crossings, rest length, and length and force in each state."""
    ties, pairs = shell.cables(design), cable_crossings(shell, design)
    lengths = {name: ties.lengths(state) for name, state in states.items()}
    pulls = {name: ties.tension(state) for name, state in states.items()}
    heads = ["cable", "from crossing", "to crossing", "rest length [m]"]
    for name in states:
        heads += [f"{name}: length [m]", f"{name}: force [N]"]
    rows: tuple[tuple[Value, ...], ...] = tuple(
        (
            f"C{k}", int(pairs[k, 0]), int(pairs[k, 1]), float(ties.rest_length[k]),
            *(float(each) for name in states for each in (lengths[name][k], pulls[name][k])),
        )
        for k in range(len(ties.ends))
    )  # fmt: skip
    return Table("cables", tuple(heads), rows)


def rods(shell: Gridshell, design: Design, states: Mapping[str, State]) -> Table:
    """A row a rod: its length, and in each state how far it is off the target at most and how much of its
    strength bending takes."""
    grid = shell.net.grid
    off = {name: deviations(shell, state) for name, state in states.items()}
    used = {
        name: worst_at_nodes(shell.net, shell.bending_utilisation(design, state))
        for name, state in states.items()
    }
    heads = ["rod", "length [m]", "crossings"]
    for name in states:
        heads += [f"{name}: off the target [m]", f"{name}: stress over strength"]
    rows: tuple[tuple[Value, ...], ...] = tuple(
        (
            label, rod.length, len(rod.crossings),
            *(float(each[rod.nodes].max()) for name in states for each in (off[name], used[name])),
        )
        for label, rod in zip(rod_names(grid), grid.rods, strict=True)
    )  # fmt: skip
    return Table("rods", tuple(heads), rows)


def nodes(shell: Gridshell, states: Mapping[str, State]) -> Table:
    """A row a node: where it is wanted, and in each state where it is and how far off."""
    heads = ["node", *(f"target: {axis} [m]" for axis in "xyz")]
    for name in states:
        heads += [*(f"{name}: {axis} [m]" for axis in "xyz"), f"{name}: off the target [m]"]
    off = {name: deviations(shell, state) for name, state in states.items()}
    rows = []
    for k, wanted in enumerate(shell.target.positions.tolist()):
        row: list[float | int] = [k, *wanted]
        for name, state in states.items():
            row += [*state.positions[k].tolist(), float(off[name][k])]
        rows.append(tuple(row))
    return Table("nodes", tuple(heads), tuple(rows))
