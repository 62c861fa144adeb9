"""What is on the drawings: marks (marks.py) of the flat grid, the cables, the supports and the rods, mm at
real scale, y upwards.

Sizes of words follow the spacing s of the grid, so that a drawing is legible at any scale at which a cell is:
numbers of crossings stand to the upper right of them, names of rods in the middle of a segment, numbers of
supports and distances of the first marks at the rods' ends, and lengths in lanes around the grid, led to by
thin lines. Where two rods end in one place, numbers give way to each other: none lies on another.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from shellform.arrays import Reals
from shellform.errors import how_many
from shellform.gridshell.catalogue import label
from shellform.gridshell.layers import layers_of
from shellform.net.grid import GridRod, rod_names
from shellform.net.notes import NoteKind
from shellform.output.workshop.block_schedule import block_marks
from shellform.output.workshop.cable_forces import tightening_notes
from shellform.output.workshop.marks import (
    MM,
    Box,
    Mark,
    Ring,
    Sheet,
    Span,
    Stroke,
    Words,
    box_of,
    free,
    point_of,
    square,
)
from shellform.output.workshop.nesting import Cutting
from shellform.output.workshop.schedules import Built, cable_crossings, rounds

STRIP = 0.75  # from one rod to the next on their own sheet, over the spacing


def flat_grid(built: Built) -> Sheet:
    """The grid as it is laid out flat and straight: rods, crossings, their numbers, cut lengths, first marks,
    dimensions.
    """
    grid = built.grid
    s = MM * min(grid.spacing, grid.spacing_v)
    marks: list[Mark] = [*_crossings(built, s)]
    names = rod_names(grid)
    for name, rod in zip(names, grid.rods, strict=True):
        marks += _rod(built, name, rod, s)
    marks += block_marks(built.shell)
    marks += _ends(built, s, marks)
    # edge beams aren't laid out flat
    of_rods = MM * grid.flat[np.concatenate([rod.nodes for rod in grid.rods]), :2]
    low, high = of_rods.min(axis=0), of_rods.max(axis=0)
    for direction in "uv":
        marks += _lanes(built, direction, names, low, high, s)
    marks += _spans(built, low, high, s)
    notes = (
        "Rods are drawn by their axes. Their first end is the left one of U rods and the lower one of V "
        "rods.",
        "Violet: distance of the first and of the last crossing from the rod's end. All other marks: "
        "schedules/marks.csv.",
        f"U rods lie below, V rods above; {MM * grid.gap:g} mm between their axes at the connectors.",
        f"{len(grid.rods)} rods, {sum(rod.length for rod in grid.rods):.2f} m in all, "
        f"{label(built.shell.rod.resized(built.design.radius).section, 2)}; "
        f"{len(grid.lattice)} connectors.",
        *(
            f"{note.text[:1].upper()}{note.text[1:]}: rods cross there without a connector."
            for note in built.shell.net.notes
            if note.kind is NoteKind.JOINTS
        ),
    )
    rows = tuple(
        (name, f"{MM * rod.length:.1f}", str(len(rod.marks)))
        for name, rod in zip(names, grid.rods, strict=True)
    )
    return Sheet("Flat grid", tuple(marks), 0.085 * s, notes, ("rod", "length", "marks"), rows)


def _crossings(built: Built, s: float) -> list[Mark]:
    grid = built.grid
    place = MM * grid.flat[grid.crossing_nodes[:, 0], :2]
    marks: list[Mark] = []
    for number, (x, y) in enumerate(place.tolist()):
        marks.append(Ring("CROSSINGS", (x, y), 0.03 * s))
        marks.append(Words("CROSSING_NUMBERS", (x + 0.05 * s, y + 0.04 * s), 0.085 * s, str(number)))
    return marks


def _rod(built: Built, name: str, rod: GridRod, s: float) -> list[Mark]:
    """The rod, squares at its ends that are supports, and its name in the segment nearest to its middle."""
    stand = [end for end in (0, -1) if rod.nodes[end] in built.shell.net.supports]
    ends = MM * built.grid.flat[rod.nodes[[0, -1]], :2]
    angle, along, left = _directions(rod)
    places = MM * rod.marks
    middles = 0.5 * (places[:-1] + places[1:]) if len(places) > 1 else np.array([0.5 * MM * rod.length])
    at = float(middles[np.argmin(np.abs(middles - 0.5 * MM * rod.length))])
    return [
        Stroke(f"RODS_{rod.direction.upper()}", (point_of(ends[0]), point_of(ends[1]))),
        *(square(ends[end], 0.03 * s) for end in stand),
        Words(
            "ROD_NAMES",
            point_of(ends[0] + at * along + 0.03 * s * left),
            0.1 * s,
            name,
            angle,
            "middle",
            "bottom",
        ),
    ]


def _ends(built: Built, s: float, marks: Sequence[Mark]) -> list[Mark]:
    """At both ends of each rod the distance to the first mark, beside the rod, and the support's number,
    beyond the rod.
    """
    supports = {int(node): number for number, node in enumerate(built.shell.net.supports)}
    boxes = [box_of(mark) for mark in marks if isinstance(mark, Words) or mark.layer == "SUPPORTS"]
    taken = np.array(boxes).reshape(-1, 4)
    found: list[Mark] = []
    height, gap = 0.085 * s, 0.03 * s
    sides = [(1.0, "bottom"), (-1.0, "top")]
    for layer in ("FIRST_MARKS", "SUPPORT_NUMBERS"):
        for rod in built.grid.rods:
            angle, along, left = _directions(rod)
            for end, first in ((0, float(rod.marks[0])), (-1, rod.length - float(rod.marks[-1]))):
                sign, side = (-1.0, "right") if end == 0 else (1.0, "left")
                tip = MM * built.grid.flat[rod.nodes[end], :2]
                if layer == "FIRST_MARKS":
                    text, begin = f"{MM * first:.1f}", tip - (MM * first - 0.07 * s) * sign * along
                elif int(rod.nodes[end]) in supports:
                    text, begin = f"S{supports[int(rod.nodes[end])]}", tip + 0.07 * s * sign * along
                else:
                    continue
                choices = [
                    Words(
                        layer,
                        point_of(begin + 0.08 * s * step * sign * along + turn * gap * left),
                        height,
                        text,
                        angle,
                        side,
                        foot,
                    )
                    for step in range(12)
                    for turn, foot in (sides if layer == "SUPPORT_NUMBERS" else sides[::-1])
                ]
                chosen = next((words for words in choices if free(words, taken)), choices[0])
                taken = np.vstack([taken, chosen.box])
                found.append(chosen)
    return found


def _directions(rod: GridRod) -> tuple[float, Reals, Reals]:
    """The angle of words along the rod, degrees, and unit vectors along it and to its left."""
    if rod.direction == "u":
        return 0.0, np.array([1.0, 0.0]), np.array([0.0, 1.0])
    return 90.0, np.array([0.0, 1.0]), np.array([-1.0, 0.0])


def _lanes(built: Built, direction: str, names: list[str], low: Reals, high: Reals, s: float) -> list[Mark]:
    """Names and lengths of the rods of one direction in lanes on both sides of the grid; of several in one
    row, each has its own side, and what is between the first and the last is told by the list."""
    flat = MM * built.grid.flat[:, :2]
    axis = 0 if direction == "u" else 1
    angle = 0.0 if axis == 0 else 90.0
    rows: dict[int, list[int]] = {}
    for number, rod in enumerate(built.grid.rods):
        if rod.direction == direction:
            rows.setdefault(rod.index, []).append(number)
    marks: list[Mark] = []
    for several in rows.values():
        for number, end, sign, side in ((several[0], 0, -1.0, "right"), (several[-1], -1, 1.0, "left")):
            rod = built.grid.rods[number]
            tip = flat[rod.nodes[end]]
            lane = tip.copy()
            lane[axis] = (low if end == 0 else high)[axis] + sign * 0.75 * s
            begin = tip.copy()
            begin[axis] += sign * 0.42 * s
            marks.append(Stroke("LEADERS", (point_of(begin), point_of(lane))))
            spot = lane.copy()
            spot[axis] += sign * 0.06 * s
            text = (
                f"{names[number]}   {MM * rod.length:.1f}"
                if end == 0
                else f"{MM * rod.length:.1f}   {names[number]}"
            )
            text = text if end == 0 or len(several) > 1 else names[number]
            marks.append(Words("CUT_LENGTHS", point_of(spot), 0.12 * s, text, angle, side, "middle"))
    return marks


def _spans(built: Built, low: Reals, high: Reals, s: float) -> list[Mark]:
    """Dimensions: from the first row of crossings to the last in both directions, and from the outermost rod
    ends.
    """
    grid = built.grid
    marks: list[Mark] = []
    place = MM * grid.flat[grid.crossing_nodes[:, 0], :2]
    for axis, step in enumerate((grid.spacing, grid.spacing_v)):
        inner = float(place[:, axis].min()), float(place[:, axis].max())
        count = round((inner[1] - inner[0]) / (MM * step))
        outer = float(low[axis]), float(high[axis])
        texts = (f"{count} × {MM * step:g} = {MM * step * count:g}", f"{outer[1] - outer[0]:.1f}")
        for (a, b), text, away in zip((inner, outer), texts, (2.35, 2.75), strict=True):
            base = float(low[1 - axis]) - away * s
            marks.append(
                Span("DIMENSIONS", (a, base), (b, base), (a, base), 0.12 * s, text)
                if axis == 0
                else Span("DIMENSIONS", (base, a), (base, b), (base, a), 0.12 * s, text)
            )
    return marks


def cable_plan(built: Built) -> Sheet:
    """The cables on the flat grid, where they are told apart best: names, and the crossings that they
    join.
    """
    grid = built.grid
    s = MM * min(grid.spacing, grid.spacing_v)
    flat = MM * grid.flat[:, :2]
    bubble, height = 0.13 * s, 0.075 * s
    joints = flat[grid.crossing_nodes[:, 0]]
    marks: list[Mark] = []
    for rod in grid.rods:
        _, along, _ = _directions(rod)
        stops = [flat[rod.nodes[0]], *(flat[rod.nodes[at]] for at in rod.at), flat[rod.nodes[-1]]]
        for k, (a, b) in enumerate(pairwise(stops)):
            begin, end = (
                (a if k == 0 else a + bubble * along),
                (b if k == len(stops) - 2 else b - bubble * along),
            )
            if float((end - begin) @ along) > 0.0:
                marks.append(Stroke("BACKGROUND", (point_of(begin), point_of(end))))
    for number, joint in enumerate(joints):
        marks.append(Ring("CROSSINGS", point_of(joint), bubble))
        marks.append(Words("CROSSING_NUMBERS", point_of(joint), height, str(number), 0.0, "middle", "middle"))
    pairs = cable_crossings(built.shell, built.design)
    turns = rounds(built.shell, built.design)
    for number, ((a, b), turn) in enumerate(zip(joints[pairs], turns.tolist(), strict=True)):
        along = (b - a) / np.linalg.norm(b - a)
        marks.append(Stroke("CABLES", (point_of(a + bubble * along), point_of(b - bubble * along))))
        # Both diagonals of a cell cross in its middle: the names stand in the upper and in the lower of the
        # triangles between them.
        sign, foot = (1.0, "bottom") if along[0] * along[1] > 0.0 else (-1.0, "top")
        spot = 0.5 * (a + b) + np.array([0.0, sign * 0.27 * MM * grid.spacing_v])
        marks.append(Words("CABLE_NAMES", point_of(spot), height, f"C{number}·{turn}", 0.0, "middle", foot))
    before = built.shell.cables(built.design).tension(built.states["none"])
    notes = (
        "Drawn on the flat grid; the erected grid's cells are skewed. C12·3: cable 12, tightened in round 3.",
        "Where a cell has two cables, the upper name is that of the rising one.",
        "Rounds go from the supports to the crown; within a round tighten on opposite sides at a time "
        "(schedules/cables.csv).",
        *tightening_notes(before),
        f"{how_many(len(pairs), 'cable', 'cables')}, joined to the lower rods; lengths and forces at each stage: "
        "schedules/cables.csv.",
    )
    return Sheet("Cables", tuple(marks), height, notes)


def rod_strips(built: Built, cutting: Cutting, first: int = 0, last: int | None = None) -> Sheet:
    """Rods from number `first` to before `last`, one under the other: marks with their distances from the
    first end above the rod, and the crossings' numbers below; splices where a rod is longer than the
    stock."""
    grid, names = built.grid, rod_names(built.grid)
    s = MM * min(grid.spacing, grid.spacing_v)
    cuts: dict[int, list[float]] = {}
    for bar in cutting.bars:
        for piece in bar.pieces:
            if piece.start > 0.0:
                cuts.setdefault(piece.rod, []).append(MM * piece.start)
    marks: list[Mark] = []
    height = 0.11 * s
    for row, number in enumerate(range(first, len(grid.rods) if last is None else min(last, len(grid.rods)))):
        rod, y = grid.rods[number], -STRIP * s * row
        layer = f"RODS_{rod.direction.upper()}"
        length = MM * rod.length
        marks.append(Stroke(layer, ((0.0, y), (length, y))))
        marks += [Stroke(layer, ((x, y - 0.1 * s), (x, y + 0.1 * s))) for x in (0.0, length)]
        marks.append(Words("ROD_NAMES", (-0.15 * s, y), 0.16 * s, names[number], 0.0, "right", "middle"))
        marks.append(
            Words("CUT_LENGTHS", (length + 0.15 * s, y), 0.16 * s, f"L = {length:.1f}", 0.0, "left", "middle")
        )
        for mark, crossing in zip((MM * rod.marks).tolist(), rod.crossings.tolist(), strict=True):
            marks.append(Stroke("CROSSINGS", ((mark, y - 0.06 * s), (mark, y + 0.06 * s))))
            above = Words("FIRST_MARKS", (mark, y + 0.09 * s), height, f"{mark:.1f}", 0.0, "middle", "bottom")
            below = Words(
                "CROSSING_NUMBERS", (mark, y - 0.09 * s), height, str(crossing), 0.0, "middle", "top"
            )
            marks += [above, below]
        marks += _splices(sorted(set(cuts.get(number, []))), y, s, height)
    notes = (
        "Above each rod: distance of the mark from its first end (left). Below: number of the crossing.",
        f"Cut from bars of {MM * cutting.stock:g} mm as schedules/bars.csv says.",
        *(["Red: splices of rods that are longer than the stock."] if cuts else []),
        *(
            ["Each rod is two laths, marked alike; from which pieces each is made: schedules/bars.csv."]
            if layers_of(built.shell.rod.section) == 2
            else []
        ),
    )
    return Sheet("Rods", tuple(marks), height, notes)


def _splices(places: Sequence[float], y: float, s: float, height: float) -> list[Mark]:
    """A stroke through the rod at each of the places, and below it where it is; of two near each other one a
    line lower."""
    marks: list[Mark] = []
    taken: list[Box] = []
    for place in places:
        lines = [
            Words(
                "SPLICES",
                (place, y - 0.24 * s - 0.14 * s * line),
                height,
                f"splice {place:.1f}",
                0.0,
                "middle",
                "top",
            )
            for line in range(2)
        ]
        words = next((each for each in lines if free(each, taken)), lines[0])
        taken.append(words.box)
        marks.append(Stroke("SPLICES", ((place - 0.08 * s, y - 0.08 * s), (place + 0.08 * s, y + 0.08 * s))))
        marks.append(words)
    return marks
