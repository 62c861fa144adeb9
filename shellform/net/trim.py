"""Trimming the pulled grid at the surface's edge.

Each rod is cut where it passes over the edge; its parts on the surface become rods whose ends are supports. A joint nearer to
the edge than a set fraction of the spacing is left out, so that no end piece is so short that its support and the joint fight;
a rod on which fewer than two joints remain is left out too, with its joints.
"""

from __future__ import annotations

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


def trim(grid: Grid, state: State, finder: Finder, *, merge: float) -> Trimmed:
    """The part of the pulled `grid` on the surface; joints nearer to the edge than `merge` spacings are left out.

    Raises Uncovered where the grid isn't large enough, InputError where nothing useful remains.
    """
    overshoot = finder.past_edge(finder.foot(state.positions))
    pieces = [piece for rod in grid.rods for piece in _pieces(rod, overshoot)]
    bare = sum(piece.start < 0.0 or piece.end < 0.0 for piece in pieces)
    if bare:
        raise Uncovered(bare)
    kept, notes = _keep(grid, pieces, merge * grid.spacing)
    return _rebuild(grid, state, kept, notes)


def _pieces(rod: GridRod, overshoot: Reals) -> list[_Piece]:
    """Runs of nodes on the surface. An end where the rod doesn't reach the edge gets the arc length -1."""
    past = overshoot[rod.nodes]
    inside = np.concatenate([[False], past < 0.0, [False]])
    starts, stops = np.flatnonzero(inside[1:] & ~inside[:-1]), np.flatnonzero(~inside[1:] & inside[:-1]) - 1

    def cut(within: int, beyond: int) -> float:
        if not 0 <= beyond < len(past):
            return -1.0
        share = past[within] / (past[within] - past[beyond])
        return float(rod.arc[within] + share * (rod.arc[beyond] - rod.arc[within]))

    return [
        _Piece(rod, first, last, cut(first, first - 1), cut(last, last + 1))
        for first, last in zip(starts.tolist(), stops.tolist(), strict=True)
    ]


def _keep(grid: Grid, pieces: list[_Piece], nearest: float) -> tuple[list[tuple[_Piece, list[int]]], list[str]]:
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
        if min(arc - piece.start, piece.end - arc) < nearest
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
        notes.append(f"{len(close)} joints nearer to the edge than {nearest:.3g} m were left out")
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
    trimmed = Grid(np.array(flat), tuple(rods), grid.lattice[crossings], nodes, grid.spacing, grid.gap)
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
