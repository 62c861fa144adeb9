"""Rods in two layers: the schedule of the shear blocks that lock their laths, and their marks on the drawing.

Between two neighbouring crossings the laths' axial forces F and -F, which bear the moment F a of what locks
them (gridshell/layers.py), change by what the blocks between carry from one lath to the other; before a rod's
first crossing and after its last one they rise from nothing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from shellform.gridshell.gridshell import Design, Gridshell
from shellform.gridshell.layers import LOCK, TwoLayers, layers_of
from shellform.output.workshop.marks import MM, Mark, Stroke
from shellform.structure.elements.state import State
from shellform.tables import Table, Value

_SIZE = 0.02  # of the spacing: half the length of a block's mark


def block_table(shell: Gridshell, design: Design, states: Mapping[str, State], rods: Sequence[str]) -> Table:
    """A line a stretch of a rod between neighbouring crossings, and to its ends: which force, N, the shear
    blocks there carry from one lath to the other in each of the `states`. `rods` are the rods' names.
    """
    section = shell.rod.resized(design.radius).section
    if not isinstance(section, TwoLayers):
        return Table("shear_blocks", ("rod",), (), ("Rods have one layer.",))
    beams = shell.beams(design.radius)
    pulls = {}
    for name, state in states.items():
        locked = beams.local_forces(state)[beams.of_kind(LOCK)]
        # As they turn the ends: a constant moment has opposite signs there.
        pulls[name] = np.column_stack([locked[:, 2], -locked[:, 5]]) / section.apart
    rows: list[tuple[Value, ...]] = []
    first = 0
    for name, rod in zip(rods, shell.net.grid.rods, strict=True):
        count = len(rod.nodes) - 1
        stops = [0, *rod.at.tolist(), count]
        for k in range(len(stops) - 1):
            begin, end = stops[k], stops[k + 1]
            if begin == end:
                continue
            carried = []
            for pull in pulls.values():
                own = pull[first : first + count] if len(pull) else np.zeros((count, 2))
                before = 0.0 if begin == 0 else own[begin, 0]
                after = 0.0 if end == count else own[end - 1, 1]
                carried.append(abs(float(after - before)))
            rows.append((name, k, float(rod.arc[begin]), float(rod.arc[end]), *carried))
        first += count
    heads = ("rod", "stretch", "from [m]", "to [m]", *(f"{name}: carried [N]" for name in states))
    notes = (
        f"Laths are bent one by one, {MM * section.apart:g} mm between their axes once both lie; blocks as deep "
        "as a lath lock them while the scaffold still holds the shell in its shape, before cables are tightened, a "
        "stretch at least one, and one at each end of a rod. Locked later the shell is another one than was designed.",
        f"They are taken to lock the laths to {section.composite:.0%} of what glue would (rod.composite): "
        "test it with the blocks and bolts that are meant.",
        "Holes for the bolts of crossings must let laths slide on one another while they are bent.",
    )
    return Table("shear_blocks", heads, tuple(rows), notes)


def block_marks(shell: Gridshell) -> list[Mark]:
    """A short thick stroke along the rod in the middle of each segment of rods in two layers."""
    if layers_of(shell.rod.section) == 1:
        return []
    grid = shell.net.grid
    size = MM * _SIZE * min(grid.spacing, grid.spacing_v)
    marks: list[Mark] = []
    for rod in grid.rods:
        ends = MM * grid.flat[rod.nodes[[0, -1]], :2]
        along = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
        for middle in MM * 0.5 * (rod.marks[:-1] + rod.marks[1:]):
            a, b = (ends[0] + (middle + step) * along for step in (-size, size))
            marks.append(Stroke("SHEAR_BLOCKS", ((float(a[0]), float(a[1])), (float(b[0]), float(b[1])))))
    return marks
