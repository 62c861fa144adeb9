"""What is spliced from stock: notes for who buys and cuts, and the schedule of splices."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from shellform.errors import how_many
from shellform.gridshell.gridshell import Design, Gridshell
from shellform.gridshell.layers import LOCK, TwoLayers
from shellform.net.grid import ROD
from shellform.output.workshop.nesting import Cutting
from shellform.structure.elements.state import State
from shellform.tables import Table, Value


def cutting_notes(cutting: Cutting, names: list[str]) -> tuple[str, ...]:
    """What the buyer and the carpenter must know, a sentence each."""
    count = len(cutting.bars)
    fewer = "fewer" if count == cutting.least else f"fewer than {cutting.least}"
    said = [
        f"{how_many(count, 'bar', 'bars')} of {cutting.stock:g} m, saw cuts of {1e3 * cutting.kerf:g} mm, "
        f"{100 * cutting.waste:.0f} % waste; {fewer} can't do."
    ]
    if cutting.spliced:
        which = _listed(names, cutting.spliced)
        said.append(
            f"{how_many(len(cutting.spliced), 'rod is', 'rods are')} longer than the stock and must be SPLICED; the analysis takes "
            "a splice for as stiff and as "
            f"strong as the rod: {which}."
        )
    if cutting.spliced_through:
        which = _listed(names, cutting.spliced_through)
        said.append(
            f"Both laths are spliced in one place, where only splices hold the rod: {which}. Longer stock leaves room to part them."
        )
    return tuple(said)


def _listed(names: Sequence[str], rods: Sequence[int]) -> str:
    """The names of rods, their numbers in order; of three or more neighbours that have one direction's letter
    the first and the last."""
    runs: list[list[int]] = []
    for rod in rods:
        if runs and rod == runs[-1][-1] + 1 and names[rod][0] == names[runs[-1][-1]][0]:
            runs[-1].append(rod)
        else:
            runs.append([rod])
    return ", ".join(
        f"{names[run[0]]} to {names[run[-1]]}" if len(run) > 2 else ", ".join(names[rod] for rod in run)
        for run in runs
    )


def lath_names(cutting: Cutting) -> dict[int, str]:
    """What is said before a part by the number of its lath: the parts of both laths of a rod are of other
    lengths; nothing where rods are of one."""
    laths = sorted({piece.lath for bar in cutting.bars for piece in bar.pieces})
    return {lath: f"lath {lath}, " if len(laths) > 1 else "" for lath in laths}


def splice_table(
    shell: Gridshell, design: Design, states: Mapping[str, State], rods: Sequence[str], cutting: Cutting
) -> Table:
    """Where rods longer than the stock are spliced, and what the splices bear in each of the `states`:
    tension N and bending moment, interpolated between the nodes; in two layers, what the lath does that is
    pulled more. `rods` are the rods' names."""
    grid, beams = shell.net.grid, shell.beams(design.radius)
    section = shell.rod.resized(design.radius).section
    first = np.concatenate([[0], np.cumsum([len(rod.nodes) - 1 for rod in grid.rods])])  # element of each rod
    rod_elements, locks = beams.of_kind(ROD), beams.of_kind(LOCK)
    forces = {name: beams.local_forces(state) for name, state in states.items()}
    of_rods = {name: own[rod_elements] for name, own in forces.items()}
    of_locks = {name: own[locks] for name, own in forces.items()}
    places = sorted(
        {(piece.rod, piece.start) for bar in cutting.bars for piece in bar.pieces if piece.part > 1}
    )
    rows = []
    for number, at in places:
        rod = grid.rods[number]
        inside = int(np.clip(np.searchsorted(rod.arc, at) - 1, 0, len(rod.arc) - 2))
        share = (at - rod.arc[inside]) / (rod.arc[inside + 1] - rod.arc[inside])
        before = int(np.searchsorted(rod.marks, at)) - 1
        row: list[Value] = [
            rods[number],
            float(at),
            int(rod.crossings[before]),
            int(rod.crossings[before + 1]),
        ]
        for name, own in of_rods.items():
            axial, _, y_a, z_a, _, y_b, z_b = own[first[number] + inside]
            # Both ends' moments are counted as they turn the ends, so that a constant bending moment has
            # opposite signs there.
            bent = (1.0 - share) * np.array([y_a, z_a]) - share * np.array([y_b, z_b])
            if isinstance(section, TwoLayers):
                axial, bent = 0.5 * axial, 0.5 * bent
                if locks.any():
                    couple = of_locks[name][first[number] + inside]
                    axial += abs((1.0 - share) * couple[2] - share * couple[5]) / section.apart
            row += [float(axial), float(np.linalg.norm(bent))]
        rows.append(tuple(row))
    heads = ["rod", "from the first end [m]", "after crossing", "before crossing"]
    for name in forces:
        heads += [f"{name}: tension [N]", f"{name}: bending moment [N m]"]
    notes = cutting_notes(cutting, list(rods))[1:] or ("No rod is spliced.",)
    return Table("splices", tuple(heads), tuple(rows), notes)
