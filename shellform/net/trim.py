"""Trimming the pulled grid at the surface's edge, at the ground and at a curve.

Each rod is cut where it leaves what is to be built; its parts inside become rods whose ends are supports. The
cuts are found on the bent rod by the Illinois method, so that supports lie on the edge. A joint nearer to an
end than a set fraction of the spacing is left out, so that no end piece is so short that its support and the
joint fight. A rod that runs beside the edge is left out with its joints, where most of it keeps none: it
would bend out there as it likes; so is one on which fewer than two joints remain, unless one is to do.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from shellform.arrays import Indices, Reals, Record
from shellform.errors import how_many
from shellform.net.compass import Finder
from shellform.net.grid import Grid, GridRod
from shellform.net.limits import NetLimits
from shellform.net.notes import NetNote, NoteKind
from shellform.net.refusal import NoNet, Reason
from shellform.structure.elements.rotation import between, matrices
from shellform.structure.elements.state import State
from shellform.structure.network import connected

_SHORTEST_ELEMENT = 0.35  # of the ordinary element's length; a shorter last one is joined to its neighbour
FEWEST = 2  # joints on a rod
# spacings², of the product of both parts of a rod that stays with one joint: what its supports are off by
# bends it by three times that over the product
_SINGLE = 0.75
# a rod that has no joint over more than so many spacings, and over more than this share of it, runs beside
# the edge
_FREE, _FREE_SHARE = 2.5, 0.4
_CUT = 1e-9  # of the spacing: how near to the edge rods are cut
_CUTTINGS = 30  # steps of the Illinois method


class Uncovered(Exception):
    """The grid doesn't reach past the edge everywhere; `rods` counts those that end on the surface."""

    def __init__(self, rods: int) -> None:
        super().__init__(f"{rods} rods end on the surface")
        self.rods = rods


@dataclass(frozen=True, eq=False)
class _Piece:
    """Part of a rod of the oversized grid on the surface: its inner nodes `first` to `last` (places on the
    rod) and the arc lengths `start`, `end` at which it is cut."""

    rod: GridRod
    first: int
    last: int
    start: float
    end: float

    def joints(self) -> list[tuple[int, float]]:
        """Crossing number and arc length of each joint."""
        on = (self.rod.at >= self.first) & (self.rod.at <= self.last)
        return [
            (int(c), float(self.rod.arc[k]))
            for c, k in zip(self.rod.crossings[on], self.rod.at[on], strict=True)
        ]


@dataclass(frozen=True, eq=False)
class Trimmed(Record):
    """`grid` and its `state`; `supports` (s,) end nodes; `origin` (n,) the node of the oversized grid that
    each node was (-1 for cut ends); `notes`."""

    grid: Grid
    state: State
    supports: Indices
    origin: Indices
    notes: tuple[NetNote, ...]


def trim(
    grid: Grid, state: State, finder: Finder, *, merge: float, limits: NetLimits, fewest: int = FEWEST
) -> Trimmed:
    """The part of the pulled `grid` inside the surface's edge and the `limits`; joints nearer to them than
    `merge` spacings are left out, and so are rods with less than the `fewest` joints.

    Raises Uncovered where the grid isn't large enough, InputError where nothing useful remains.
    """
    past = _past(finder, limits, state.positions)
    pieces = _cut(grid, state, past, lambda points: _past(finder, limits, points))
    bare = sum(piece.start < 0.0 or piece.end < 0.0 for piece in pieces)
    if bare:
        raise Uncovered(bare)
    kept, notes = _keep(grid, pieces, merge, fewest)
    return _rebuild(grid, state, kept, notes)


def bare_rods(grid: Grid, state: State, finder: Finder, limits: NetLimits) -> int:
    """How many pieces of rods end on the surface, short of any limit."""
    return sum(
        (first == 0) + (last + 1 == len(rod.nodes)) > 0
        for rod, first, last in _runs(grid, _past(finder, limits, state.positions))
    )


def _past(finder: Finder, limits: NetLimits, points: Reals) -> Reals:
    """How far (k,), m, points on the net lie past the edge or the nearest limit; negative inside."""
    return np.maximum(finder.past_edge(finder.foot(points)), limits.beyond(points))


def _runs(grid: Grid, past: Reals) -> list[tuple[GridRod, int, int]]:
    """Each run of nodes inside: its rod, first and last place."""
    runs: list[tuple[GridRod, int, int]] = []
    for rod in grid.rods:
        inside = np.concatenate([[False], past[rod.nodes] < 0.0, [False]])
        starts, stops = (
            np.flatnonzero(inside[1:] & ~inside[:-1]),
            np.flatnonzero(~inside[1:] & inside[:-1]) - 1,
        )
        runs += [(rod, first, last) for first, last in zip(starts.tolist(), stops.tolist(), strict=True)]
    return runs


def _cut(grid: Grid, state: State, past: Reals, measure: Callable[[Reals], Reals]) -> list[_Piece]:
    """Runs of nodes inside. An end where the rod doesn't reach a limit gets the arc length -1."""
    runs = _runs(grid, past)
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
    start = np.array([rod.arc[within] for rod, within, _ in crossings])
    stop = np.array([rod.arc[beyond] for rod, _, beyond in crossings])
    inner = np.array([rod.nodes[within] for rod, within, _ in crossings])
    outer = np.array([rod.nodes[beyond] for rod, _, beyond in crossings])
    axis = np.array([0 if rod.direction == "u" else 1 for rod, _, _ in crossings])
    a, b = np.zeros(len(start)), np.ones(len(start))
    f, g = past[inner], past[outer]
    side = np.zeros(len(start))
    # The rod runs from its lower to its higher arc length, whichever of the two is inside.
    back = stop < start
    first, second = np.where(back, outer, inner), np.where(back, inner, outer)
    for _ in range(_CUTTINGS):
        share = (a * g - b * f) / (g - f)
        value = measure(_curved(state, first, second, np.where(back, 1.0 - share, share), axis))
        if np.abs(value).max() < close:
            break
        low = value < 0.0
        # The end that stays counts half from the second time on (Dowell and Jarratt 1971).
        f, g = (
            np.where(low, value, np.where(side > 0, 0.5 * f, f)),
            np.where(low, np.where(side < 0, 0.5 * g, g), value),
        )
        a, b = np.where(low, share, a), np.where(low, b, share)
        side = np.where(low, -1.0, 1.0)
    return [float(s) for s in start + share * (stop - start)]


def _keep(
    grid: Grid, pieces: list[_Piece], merge: float, fewest: int
) -> tuple[list[tuple[_Piece, list[int]]], list[NetNote]]:
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
    kept_at = [[each[crossing] for crossing in remaining & each.keys()] for each in joints]
    loose = [
        each
        for piece, each, arcs in zip(pieces, joints, kept_at, strict=True)
        if _loose(piece, arcs, grid.step(piece.rod.direction))
    ]
    for each in loose:
        remaining -= each.keys()
    while True:
        poor = [
            each
            for piece, each in zip(pieces, joints, strict=True)
            if _poor(
                piece, [each[c] for c in remaining & each.keys()], grid.step(piece.rod.direction), fewest
            )
        ]
        if not poor:
            break
        for each in poor:
            remaining -= each.keys()
    joined, remaining = remaining, _largest(joints, remaining)
    if not remaining:
        raise NoNet(
            Reason.EMPTY,
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
    apart = sum(bool(joined & each.keys()) and not remaining & each.keys() for each in joints)
    few = len(pieces) - len(kept) - len(loose) - apart
    single = sum(len(own) < FEWEST for _, own in kept)
    notes = [
        *([_joints_told(len(close), merge * grid.scale)] if close else []),
        *_rods_told(fewest, loose=len(loose), apart=apart, few=few, single=single),
    ]
    return kept, notes


def _joints_told(close: int, near: float) -> NetNote:
    """That so many joints were left out which are as `near`, m, to the edge."""
    within = f"nearer to the edge than {near:.3g} m"
    return NetNote(
        NoteKind.JOINTS,
        how_many(close, f"joint {within} was left out", f"joints {within} were left out"),
    )


def _rods_told(fewest: int, *, loose: int, apart: int, few: int, single: int) -> Iterator[NetNote]:
    """Why how many rods were left out, or stay with a single joint."""
    which = (
        (loose, f"that run{{}} beside the edge, with no joint over {_FREE:g} spacings or more,"),
        (apart, "of parts of the grid that no rod joins to the largest"),
        (few, f"with fewer than {fewest} joints" if fewest > 1 else "without a joint"),
    )
    for count, what in which:
        if count:
            one, many = what.format("s"), what.format("")
            told = how_many(count, f"rod {one} was left out", f"rods {many} were left out")
            yield NetNote(NoteKind.RODS, told)
    if single:
        stay = how_many(single, "rod of a single joint stays", "rods of a single joint stay")
        yield NetNote(NoteKind.RODS, f"{stay}: without, more of the surface would lie beyond the rods")


def _loose(piece: _Piece, arcs: list[float], step: float) -> bool:
    """Whether with joints at the `arcs` too long a part of the rod is free: over so many steps, m, and so
    much of it. Beside an opening rods that go on far beyond it stay."""
    free = float(np.diff(np.sort([piece.start, *arcs, piece.end])).max())
    return len(arcs) > 0 and free > max(_FREE * step, _FREE_SHARE * (piece.end - piece.start))


def _poor(piece: _Piece, arcs: list[float], step: float, fewest: int) -> bool:
    """Whether joints at the `arcs` are too few, fewer than the `fewest`, or one on a rod so short that what
    its supports are off by would bend it too much."""
    if len(arcs) != 1 or fewest > 1:
        return 0 < len(arcs) < fewest
    return (arcs[0] - piece.start) * (piece.end - arcs[0]) < _SINGLE * step**2


def _largest(joints: list[dict[int, float]], remaining: set[int]) -> set[int]:
    """Of the `remaining` crossings those of the largest connected part of the grid; `joints` are those of
    each piece of rod."""
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


def _rebuild(grid: Grid, state: State, kept: list[tuple[_Piece, list[int]]], notes: list[NetNote]) -> Trimmed:
    """The trimmed grid: nodes renumbered, end pieces cut to length."""
    crossings = sorted({c for _, joints in kept for c in joints})
    number = {crossing: k for k, crossing in enumerate(crossings)}
    nodes = np.full((len(crossings), 2), -1)
    flat: list[Reals] = []
    positions: list[Reals] = []
    turns: list[Reals] = []
    origin: list[int] = []
    rods, supports = [], []
    count = 0
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
        first, count = count, count + len(arcs)
        a, b, share = _locate(rod, arcs)
        flat.append(_between(grid.flat, a, b, share))
        positions.append(_curved(state, a, b, share, np.full(len(a), layer)))
        turns.append(between(state.quaternions[a], state.quaternions[b], share[:, None]))
        origin += [-1, *(int(n) for n in rod.nodes[places]), -1]
        numbers = first + np.arange(len(arcs))
        supports += [first, first + len(arcs) - 1]
        where = {int(rod.nodes[place]): k + 1 for k, place in enumerate(places)}
        at = np.array([where[int(grid.crossing_nodes[c, layer])] for c in joints])
        for crossing, k in zip(joints, at, strict=True):
            nodes[number[crossing], layer] = numbers[k]
        along = np.array([number[c] for c in joints])
        rods.append(GridRod(rod.direction, rod.index, numbers, arcs - arcs[0], along, at))
    trimmed = Grid(
        np.vstack(flat), tuple(rods), grid.lattice[crossings], nodes, grid.spacing, grid.gap, grid.spacing_v
    )
    return Trimmed(
        trimmed,
        State(np.vstack(positions), np.vstack(turns)),
        np.array(supports),
        np.array(origin),
        tuple(notes),
    )


def _locate(rod: GridRod, arcs: Reals) -> tuple[Indices, Indices, Reals]:
    """The nodes (k,) of the elements at arc lengths (k,), and where on them (0 to 1)."""
    k = np.clip(np.searchsorted(rod.arc, arcs, side="right") - 1, 0, len(rod.arc) - 2)
    return rod.nodes[k], rod.nodes[k + 1], (arcs - rod.arc[k]) / (rod.arc[k + 1] - rod.arc[k])


def _between(points: Reals, a: Indices, b: Indices, share: Reals) -> Reals:
    """Points (k, 3) on the straight lines from nodes a to nodes b."""
    return np.asarray((1.0 - share[:, None]) * points[a] + share[:, None] * points[b])


def _curved(state: State, a: Indices, b: Indices, share: Reals, axis: Indices) -> Reals:
    """Positions (k, 3) on bent elements from nodes a to nodes b: Hermite's cubic between their ends, its
    tangents the rods' axes there, which are the nodes' x axis (0) or y axis (1)."""
    p, q, t = state.positions[a], state.positions[b], share[:, None]
    length = np.linalg.norm(q - p, axis=1, keepdims=True)
    which = np.arange(len(a))
    m, n = (length * matrices(state.quaternions[each])[which, :, axis] for each in (a, b))
    cubic = (
        (1 + 2 * t) * (1 - t) ** 2 * p + t * t * (3 - 2 * t) * q + t * (1 - t) ** 2 * m + t * t * (t - 1) * n
    )
    return np.asarray(np.where(t == 0.0, p, np.where(t == 1.0, q, cubic)))
