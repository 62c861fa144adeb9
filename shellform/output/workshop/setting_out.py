"""What is set out on site: the supports in plan, and the shell in elevation with its levels; marks (marks.py)
in mm at real scale.

**Clashing supports.** The ends of two rods may come to stand so near to each other that their shoes don't fit
side by side. A shoe is taken to be three rod diameters wide, the rod between two walls of its own thickness:
supports whose axes are nearer than that are listed, on the drawing and in the schedule.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from shellform.arrays import Reals
from shellform.net.grid import rod_names
from shellform.output.workshop.directions import fixing_note
from shellform.output.workshop.edge_schedule import edge_names
from shellform.output.workshop.marks import (
    MM,
    Box,
    Mark,
    Sheet,
    Span,
    Stroke,
    Words,
    box_of,
    free,
    point_of,
    square,
)
from shellform.output.workshop.schedules import Built, clashing_supports, shoe_width


def support_plan(built: Built) -> Sheet:
    """The supports in plan with the rods as they stand on the target, and the supports' coordinates."""
    grid, place = built.grid, MM * built.shell.target.positions
    s = MM * min(grid.spacing, grid.spacing_v)
    names = rod_names(grid)
    marks: list[Mark] = []
    for rod in grid.rods:
        points = tuple(point_of(p) for p in place[rod.nodes, :2])
        marks.append(Stroke(f"RODS_{rod.direction.upper()}", points))
    ends = {int(rod.nodes[k]): name for name, rod in zip(names, grid.rods, strict=True) for k in (0, -1)}
    for name, line in zip(edge_names(built.shell.net), built.shell.net.edges, strict=True):
        path = place[np.append(line.ends[:, 0], line.ends[-1, 1]), :2]
        marks.append(Stroke("EDGE_BEAMS", tuple(point_of(p) for p in path)))
        for foot in dict.fromkeys(line.nodes[[0, -1]].tolist()):
            ends[foot] = f"{ends[foot]}, {name}" if foot in ends else name
    supports = built.shell.net.supports
    middle, rows = place[supports, :2].mean(axis=0), []
    height = 0.13 * s
    taken = [box_of(square(place[node, :2], 0.05 * s)) for node in supports]
    for name, line in zip(edge_names(built.shell.net), built.shell.net.edges, strict=True):
        here = place[line.nodes[len(line.nodes) // 2], :2]
        words = _clear(name, here, here - middle, height, taken, "EDGE_BEAMS")
        taken.append(words.box)
        marks.append(words)
    for number, node in enumerate(supports.tolist()):
        here = place[node]
        marks.append(square(here[:2], 0.05 * s))
        words = _clear(f"S{number}", here[:2], here[:2] - middle, height, taken)
        taken.append(words.box)
        marks.append(words)
        rows.append((f"S{number}", ends[node], *(f"{value:.1f}" for value in here.tolist())))
    low, high = place[:, :2].min(axis=0), place[:, :2].max(axis=0)
    for axis in range(2):
        a, b, base = float(low[axis]), float(high[axis]), float(low[1 - axis]) - 1.2 * s
        text = f"{b - a:.1f}"
        marks.append(
            Span("DIMENSIONS", (a, base), (b, base), (a, base), 0.14 * s, text)
            if axis == 0
            else Span("DIMENSIONS", (base, a), (base, b), (base, a), 0.14 * s, text)
        )
    zero = (("0", (0.0, 0.0)),) if (low < 0.0).all() and (high > 0.0).all() else ()
    for text, (x, y) in zero:
        marks += [
            Stroke("DIMENSIONS", ((x - 0.3 * s, y), (x + 0.3 * s, y))),
            Stroke("DIMENSIONS", ((x, y - 0.3 * s), (x, y + 0.3 * s))),
            Words("DIMENSIONS", (x + 0.1 * s, y + 0.1 * s), 0.14 * s, f"x, y = {text}"),
        ]
    notes = (
        "Supports are where the axes of rods and edge beams end; z is the axis' level, not the ground's under it. Rods stand as on the target.",
        "Directions of the rods at the supports: schedules/supports.csv. Survey targets: "
        "schedules/survey.csv.",
        *fixing_note(built.shell.net),
        *built.origin_notes,
        *clash_notes(built),
    )
    return Sheet(
        "Setting-out of the supports",
        tuple(marks),
        height,
        notes,
        ("support", "rod", "x", "y", "z"),
        tuple(rows),
    )


def _clear(
    text: str, here: Reals, away: Reals, height: float, taken: Sequence[Box], layer: str = "SUPPORT_NUMBERS"
) -> Words:
    """A support's number beside it, outwards, as far off as it takes to lie on no other; or an edge beam's
    name."""
    out = away / (np.linalg.norm(away) or 1.0)
    side = "left" if out[0] > 0.3 else "right" if out[0] < -0.3 else "middle"
    foot = "bottom" if out[1] > 0.3 else "top" if out[1] < -0.3 else "middle"
    words = Words(layer, point_of(here + height * out), height, text, 0.0, side, foot)
    for step in range(1, 40):
        if free(words, taken):
            break
        words = Words(
            layer,
            point_of(here + (1.0 + 0.5 * step) * height * out),
            height,
            text,
            0.0,
            side,
            foot,
        )
    return words


def clash_notes(built: Built) -> tuple[str, ...]:
    """Which supports stand too near to each other, in words; nothing where none do."""
    found = clashing_supports(built)
    if not found:
        return ()
    pairs = ", ".join(f"S{a} and S{b} ({MM * apart:.1f})" for a, b, apart in found)
    return (f"Nearer to each other than {MM * shoe_width(built):.1f} mm, the width of a shoe: {pairs}.",)


def elevations(built: Built) -> Sheet:
    """The shell on its target from the front (along y) and, above it, from the side (along -x), with the
    levels of the ground, the lowest and the highest support, and the crown."""
    grid, place = built.grid, MM * built.shell.target.positions
    low, high = place.min(axis=0), place.max(axis=0)
    tall, wide = float(high[2] - low[2]), max(float(high[0] - low[0]), float(high[1] - low[1]))
    height, gap = 0.016 * wide, 0.30 * wide
    feet = place[built.shell.net.supports, 2]
    crown = float(place[:, 2].max())
    levels = {f"crown {crown:+.1f}": crown}
    if len(feet) and f"{feet.min():+.1f}" == f"{feet.max():+.1f}":
        levels[f"supports {feet.min():+.1f}"] = float(feet.min())
    elif len(feet):
        levels[f"highest support {feet.max():+.1f}"] = float(feet.max())
        levels[f"lowest support {feet.min():+.1f}"] = float(feet.min())
    marks: list[Mark] = []
    for row, (axis, sign, title) in enumerate(
        [(0, 1.0, "From the front, along y"), (1, 1.0, "From the side, against x")]
    ):
        up = row * (tall + gap) - float(low[2])
        flat = np.column_stack([sign * place[:, axis], place[:, 2] + up])
        left, right = float(flat[:, 0].min()), float(flat[:, 0].max())
        for rod in grid.rods:
            marks.append(Stroke(f"RODS_{rod.direction.upper()}", tuple(point_of(p) for p in flat[rod.nodes])))
        for line in built.shell.net.edges:
            path = flat[np.append(line.ends[:, 0], line.ends[-1, 1])]
            marks.append(Stroke("EDGE_BEAMS", tuple(point_of(p) for p in path)))
        ground = float(low[2]) + up
        marks.append(Stroke("GROUND", ((left - 0.04 * wide, ground), (right + 0.04 * wide, ground))))
        marks += _levels(levels, right, up, height, wide)
        below = ground - 5.0 * height
        marks.append(
            Span("DIMENSIONS", (left, below), (right, below), (left, below), height, f"{right - left:.1f}")
        )
        aside = left - 6.0 * height
        marks.append(
            Span("DIMENSIONS", (aside, ground), (aside, crown + up), (aside, ground), height, f"{tall:.1f}")
        )
        marks.append(Words("DIMENSIONS", (left, crown + up + 3.0 * height), 1.3 * height, title))
    notes = (
        "The shell as it is to stand (the target), by the rods' axes. Levels are z in mm of the surface's file."
        if built.origin is None
        else "The shell as it is to stand (the target), by the rods' axes. Levels are z in mm.",
        "Where it is expected at each stage: schedules/survey.csv.",
        *built.origin_notes,
    )
    return Sheet("Elevations", tuple(marks), height, notes)


def _levels(levels: dict[str, float], right: float, up: float, height: float, wide: float) -> list[Mark]:
    """A short line at each level on the right, with its words; where levels lie near each other, words give
    way upwards."""
    marks: list[Mark] = []
    start, end = right + 0.06 * wide, right + 0.10 * wide
    least = -np.inf
    for text, level in sorted(levels.items(), key=lambda each: each[1]):
        at = level + up
        words = max(at, least)
        least = words + 1.8 * height
        marks.append(Stroke("LEVELS", ((start, at), (end, at), (end + 2.0 * height, words))))
        marks.append(Words("LEVELS", (end + 2.5 * height, words), height, text, foot="middle"))
    return marks
