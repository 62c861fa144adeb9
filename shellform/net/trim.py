"""Trimming the pulled grid at the surface's edge, at the ground and at a curve.

Each rod is cut where it leaves what is to be built; its parts inside become rods whose ends are supports. The cuts are found on the
bent rod by the Illinois method, so that supports lie on the edge. A joint nearer to an end than a set fraction of the spacing is left
out, so that no end piece is so short that its support and the joint fight; a rod on which fewer than two joints remain is left out
too, with its joints.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from shellform.arrays import Indices, Reals
from shellform.errors import InputError
from shellform.net.compass import Finder
from shellform.net.grid import Grid, GridRod
from shellform.structure.network import connected
from shellform.structure.rotation import matrices
from shellform.structure.state import State

_SHORTEST_ELEMENT = 0.35  # of the ordinary element's length; a shorter last one is joined to its neighbour
_FEWEST = 2  # joints on a rod
_CUT = 1e-9  # of the spacing: how near to the edge rods are cut
_CUTTINGS = 30  # steps of the Illinois method


class Uncovered(Exception):
    """The grid doesn't reach past the edge everywhere; `rods` counts those that end on the surface."""

    def __init__(self, rods: int) -> None:
        super().__init__(f"{rods} rods end on the surface")
        self.rods = rods


@dataclass(frozen=True)
class _Piece:
    """Part of a rod of the oversized grid on the surface: its inner nodes `first` to `last` (places on the rod) and the arc
    lengths `start`, `end` at which it is cut."""

    rod: GridRod
    first: int
    last: int
    start: float
    end: float

    def joints(self) -> list[tuple[int, float]]:
        """Crossing number and arc length of each joint."""
        on = (self.rod.at >= self.first) & (self.rod.at <= self.last)
        return [(int(c), float(self.rod.arc[k])) for c, k in zip(self.rod.crossings[on], self.rod.at[on], strict=True)]


@dataclass(frozen=True)
class Trimmed:
    """`grid` and its `state`; `supports` (s,) end nodes; `origin` (n,) the node of the oversized grid that each node was (-1 for
    cut ends); `notes`."""

    grid: Grid
    state: State
    supports: Indices
    origin: Indices
    notes: tuple[str, ...]


@dataclass(frozen=True)
class Limits:
    """Where rods end besides the surface's edge: the `ground`, m, below which nothing is built, and the corners of a closed curve
    in `plan` (k, 2), m, outside which nothing is."""

    ground: float | None = None
    plan: Reals | None = None

    def past(self, finder: Finder, points: Reals) -> Reals:
        """How far (k,), m, points on the net lie past the nearest limit; negative inside."""
        result = finder.past_edge(finder.foot(points))
        if self.ground is not None:
            result = np.maximum(result, self.ground - points[:, 2])
        if self.plan is not None:
            result = np.maximum(result, _outside(self.plan, points[:, :2]))
        return np.asarray(result)


def _outside(plan: Reals, points: Reals) -> Reals:
    """Signed distance (k,), m, of plan points from a closed polygon, positive outside."""
    start, stop = plan, np.roll(plan, -1, axis=0)
    best, inside = np.full(len(points), np.inf), np.zeros(len(points), dtype=bool)
    for a, b in zip(start, stop, strict=True):
        side = b - a
        share = np.clip((points - a) @ side / max(float(side @ side), 1e-300), 0.0, 1.0)
        best = np.minimum(best, np.linalg.norm(points - a - share[:, None] * side, axis=1))
        if a[1] != b[1]:
            at = a[0] + (points[:, 1] - a[1]) * side[0] / side[1]
            inside ^= ((a[1] > points[:, 1]) != (b[1] > points[:, 1])) & (points[:, 0] < at)
    return np.where(inside, -best, best)


def trim(grid: Grid, state: State, finder: Finder, *, merge: float, limits: Limits) -> Trimmed:
    """The part of the pulled `grid` inside the surface's edge and the `limits`; joints nearer to them than `merge` spacings are
    left out.

    Raises Uncovered where the grid isn't large enough, InputError where nothing useful remains.
    """
    past = limits.past(finder, state.positions)
    pieces = _cut(grid, state, past, lambda points: limits.past(finder, points))
    bare = sum(piece.start < 0.0 or piece.end < 0.0 for piece in pieces)
    if bare:
        raise Uncovered(bare)
    kept, notes = _keep(grid, pieces, merge)
    return _rebuild(grid, state, kept, notes)


def _cut(grid: Grid, state: State, past: Reals, measure: Callable[[Reals], Reals]) -> list[_Piece]:
    """Runs of nodes inside. An end where the rod doesn't reach a limit gets the arc length -1."""
    runs: list[tuple[GridRod, int, int]] = []
    for rod in grid.rods:
        inside = np.concatenate([[False], past[rod.nodes] < 0.0, [False]])
        starts, stops = np.flatnonzero(inside[1:] & ~inside[:-1]), np.flatnonzero(~inside[1:] & inside[:-1]) - 1
        runs += [(rod, first, last) for first, last in zip(starts.tolist(), stops.tolist(), strict=True)]
    crossings = [  # rod, the node within and the node beyond
        (rod, within, beyond)
        for rod, first, last in runs
        for within, beyond in ((first, first - 1), (last, last + 1))
        if 0 <= beyond < len(rod.nodes)
    ]
    arcs = iter(_where_zero(state, crossings, past, measure, _CUT * grid.scale))
    return [
        _Piece(
            rod,
            first,
            last,
            next(arcs) if first > 0 else -1.0,
            next(arcs) if last + 1 < len(rod.nodes) else -1.0,
        )
        for rod, first, last in runs
    ]


def _where_zero(
    state: State,
    crossings: list[tuple[GridRod, int, int]],
    past: Reals,
    measure: Callable[[Reals], Reals],
    close: float,
) -> list[float]:
    """Arc lengths at which bent rods pass from inside to past the limit, all of them at once."""
    if not crossings:
        return []
    a = np.array([rod.arc[within] for rod, within, _ in crossings])
    b = np.array([rod.arc[beyond] for rod, _, beyond in crossings])
    f = np.array([past[rod.nodes[within]] for rod, within, _ in crossings])
    g = np.array([past[rod.nodes[beyond]] for rod, _, beyond in crossings])
    side = np.zeros(len(a))
    for _ in range(_CUTTINGS):
        arc = (a * g - b * f) / (g - f)
        points = np.array([_curved(rod, state, s) for (rod, _, _), s in zip(crossings, arc, strict=True)])
        value = measure(points)
        if np.abs(value).max() < close:
            break
        low = value < 0.0
        # The end that stays counts half from the second time on (Dowell and Jarratt 1971).
        f = np.where(low, value, np.where(side > 0, 0.5 * f, f))
        g = np.where(low, np.where(side < 0, 0.5 * g, g), value)
        a, b = np.where(low, arc, a), np.where(low, b, arc)
        side = np.where(low, -1.0, 1.0)
    return [float(s) for s in arc]


def _keep(grid: Grid, pieces: list[_Piece], merge: float) -> tuple[list[tuple[_Piece, list[int]]], list[str]]:
    """The pieces that remain, each with its joints, and what is to be said about the others."""
    joints = [dict(piece.joints()) for piece in pieces]
    on: dict[int, int] = {}
    for each in joints:
        for crossing in each:
            on[crossing] = on.get(crossing, 0) + 1
    remaining = {crossing for crossing, rods in on.items() if rods == 2}
    close = {
        crossing
        for piece, each in zip(pieces, joints, strict=True)
        for crossing, arc in each.items()
        if min(arc - piece.start, piece.end - arc) < merge * grid.step(piece.rod.direction)
    }
    remaining -= close
    while True:
        poor = [each for each in joints if 0 < len(remaining & each.keys()) < _FEWEST]
        if not poor:
            break
        for each in poor:
            remaining -= each.keys()
    remaining = _largest(pieces, joints, remaining)
    if not remaining:
        raise InputError(
            "no grid fits the surface at this spacing: no rod keeps two joints",
            where="net.spacing",
            value=grid.spacing,
            remedy="Choose a smaller spacing.",
        )
    kept = [
        (piece, sorted(remaining & each.keys(), key=lambda c, arcs=each: arcs[c]))  # type: ignore[misc]
        for piece, each in zip(pieces, joints, strict=True)
        if remaining & each.keys()
    ]
    notes = []
    if close:
        notes.append(f"{len(close)} joints nearer to the edge than {merge * grid.scale:.3g} m were left out")
    if len(kept) < len(pieces):
        notes.append(f"{len(pieces) - len(kept)} rods with fewer than {_FEWEST} joints were left out")
    return kept, notes


def _largest(pieces: list[_Piece], joints: list[dict[int, float]], remaining: set[int]) -> set[int]:
    """The crossings of the largest connected part of the grid."""
    if not remaining:
        return remaining
    numbers = {crossing: k for k, crossing in enumerate(sorted(remaining))}
    links = []
    for each in joints:
        along = [numbers[c] for c in each if c in remaining]
        links += list(pairwise(along))
    parts, label = connected(len(numbers), np.array(links).reshape(-1, 2))
    if parts == 1:
        return remaining
    largest = int(np.argmax(np.bincount(label)))
    return {crossing for crossing, k in numbers.items() if label[k] == largest}


def _rebuild(grid: Grid, state: State, kept: list[tuple[_Piece, list[int]]], notes: list[str]) -> Trimmed:
    """The trimmed grid: nodes renumbered, end pieces cut to length."""
    crossings = sorted({c for _, joints in kept for c in joints})
    number = {crossing: k for k, crossing in enumerate(crossings)}
    nodes = np.full((len(crossings), 2), -1)
    flat: list[Reals] = []
    positions: list[Reals] = []
    turns: list[Reals] = []
    origin: list[int] = []
    rods, supports = [], []
    for piece, joints in kept:
        rod = piece.rod
        layer = 0 if rod.direction == "u" else 1
        element = float(np.diff(rod.arc).max())
        places = list(range(piece.first, piece.last + 1))
        at_joint = {int(k) for c, k in zip(rod.crossings, rod.at, strict=True) if c in number and c in joints}
        if rod.arc[places[0]] - piece.start < _SHORTEST_ELEMENT * element and places[0] not in at_joint:
            places = places[1:]
        if piece.end - rod.arc[places[-1]] < _SHORTEST_ELEMENT * element and places[-1] not in at_joint:
            places = places[:-1]
        arcs = np.concatenate([[piece.start], rod.arc[places], [piece.end]])
        first = len(flat)
        for arc in arcs:
            flat.append(_between(rod, grid.flat, arc))
            positions.append(_curved(rod, state, arc))
            turns.append(_turned(rod, state, arc))
        origin += [-1, *(int(n) for n in rod.nodes[places]), -1]
        numbers = first + np.arange(len(arcs))
        supports += [first, first + len(arcs) - 1]
        where = {int(rod.nodes[place]): k + 1 for k, place in enumerate(places)}
        at = np.array([where[int(grid.crossing_nodes[c, layer])] for c in joints])
        for crossing, k in zip(joints, at, strict=True):
            nodes[number[crossing], layer] = numbers[k]
        along = np.array([number[c] for c in joints])
        rods.append(GridRod(rod.direction, rod.index, numbers, arcs - arcs[0], along, at))
    trimmed = Grid(np.array(flat), tuple(rods), grid.lattice[crossings], nodes, grid.spacing, grid.gap, grid.spacing_v)
    return Trimmed(
        trimmed, State(np.array(positions), np.array(turns)), np.array(supports), np.array(origin), tuple(notes)
    )


def _locate(rod: GridRod, arc: float) -> tuple[int, int, float]:
    """The nodes of the element at the arc length, and where on it (0 to 1)."""
    k = int(np.clip(np.searchsorted(rod.arc, arc, side="right") - 1, 0, len(rod.arc) - 2))
    return int(rod.nodes[k]), int(rod.nodes[k + 1]), float((arc - rod.arc[k]) / (rod.arc[k + 1] - rod.arc[k]))


def _between(rod: GridRod, points: Reals, arc: float) -> Reals:
    a, b, share = _locate(rod, arc)
    return np.asarray((1.0 - share) * points[a] + share * points[b])


def _curved(rod: GridRod, state: State, arc: float) -> Reals:
    """Position (3,) at the arc length: Hermite's cubic between the element's ends, its tangents the rod's axis at the nodes."""
    a, b, t = _locate(rod, arc)
    pair = state.positions[[a, b]]
    if t in (0.0, 1.0):
        return np.asarray(pair[int(t)])
    length = float(np.linalg.norm(pair[1] - pair[0]))
    axis = np.array([1.0, 0.0, 0.0]) if rod.direction == "u" else np.array([0.0, 1.0, 0.0])
    tangent = length * (matrices(state.quaternions[[a, b]]) @ axis)
    blend = np.array([(1 + 2 * t) * (1 - t) ** 2, t * t * (3 - 2 * t), t * (1 - t) ** 2, t * t * (t - 1)])
    return np.asarray(blend[:2] @ pair + blend[2:] @ tangent)


def _turned(rod: GridRod, state: State, arc: float) -> Reals:
    """Quaternion (4,) at the arc length, between those of the element's ends."""
    a, b, t = _locate(rod, arc)
    first, second = state.quaternions[a], state.quaternions[b]
    mixed = (1.0 - t) * first + t * (second if first @ second >= 0.0 else -second)
    return np.asarray(mixed / np.linalg.norm(mixed))
