"""Scans of a built grid: points laid onto the model and named after its nodes.

A scanner gives points in its own axes and in no order; some markers are hidden, some points are reflections.
The points are laid onto the predicted nodes by a rigid motion (no scaling), found by iterating closest points
(Besl and McKay 1992): each marker takes its nearest point, one point to one marker and none beyond a reach,
the best motion for the pairs follows in closed form (Kabsch 1976), and so on until the pairs stay the same.
The iteration finds the motion nearest to its start only, so that it starts from many: the principal axes of
both sets laid over each other, turned about their common normal and flipped. Where markers at one side are
hidden, middles lie more than half a cell of the grid apart, and points come to rest beside the markers that
they are: so from the best of some that are turned otherwise each neighbouring marker is tried, as long as
that fits better. The best of all wins; a second pairing that fits nearly as well makes the match doubtful,
which is said and not guessed. Scans that a scanner took in the same axes are laid alike: on a symmetric shell
noise would else decide for each how it is turned. Of the motions that fit one of them the one wins by which
all together fit best.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from shellform.arrays import Indices, Reals, Record, indices, reals
from shellform.errors import InputError
from shellform.site import measurements
from shellform.structure.elements.state import State

_OTHERWISE = 4  # ways that points are turned, from which neighbours are tried
_BESIDE = 8  # nearest markers onto which all are moved on from where they came to rest
_TURNS = 24  # starts about the common normal, each also flipped
_ROUNDS = 60  # of closest points from one start
# times the median distance from the middle: such points don't take part in the axes of the start
_STRAY = 3.0
_RIVAL = 1.5  # a second pairing whose cost is below this much times the best one's makes the match doubtful
_TURNED = 5.0  # degrees: two motions that differ by less are shifted
_PAIRS = 4  # three points and one to check them
_THIN = 0.02  # second principal size over the first, below which points lie on a line


@dataclass(frozen=True, eq=False)
class Scan(Record):
    """What was measured in one load state: `points` (k, 3), m, in any order; the dead `load` (n, 6), N, at
    the time; and the `frame` in which the scanner measured: scans of one number share their axes, None means
    the model's own."""

    points: Reals
    load: Reals
    frame: int | None = 0

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", reals("scan.points", self.points, (None, 3)))
        object.__setattr__(self, "load", reals("scan.load", self.load, (None, 6)))


@dataclass(frozen=True, eq=False)
class Motion(Record):
    """A rigid motion x -> `turn` (3, 3) x + `shift` (3,), m."""

    turn: Reals
    shift: Reals

    def __call__(self, points: Reals) -> Reals:
        """The points (k, 3) moved."""
        return np.asarray(points @ self.turn.T + self.shift)


@dataclass(frozen=True, eq=False)
class Match(Record):
    """Which point is which marker: `point` (m,) the number of each marker's point, -1 where it is missing;
    `outliers` the points that belong to no marker; the `motion` that lays the points onto the model;
    `distance` (m,), m, that remains, NaN where missing; and in `doubts` what may be wrong, a sentence
    each."""

    point: Indices
    outliers: Indices
    motion: Motion
    distance: Reals
    doubts: tuple[str, ...]

    @property
    def missing(self) -> Indices:
        """Markers without a point."""
        return np.flatnonzero(self.point < 0)

    def places(self, points: Reals) -> Reals:
        """The points in the order of the markers and in the model's axes (m, 3), m; NaN where missing."""
        result = np.full((len(self.point), 3), np.nan)
        found = self.point >= 0
        result[found] = self.motion(points[self.point[found]])
        return result


_Fitted = tuple[float, Indices, Motion]
"""What closest points came to: the cost, the marker (k,) of each point or -1, and the motion."""


def counted_alike(
    scans: Sequence[Scan], target: Reals, origin: Sequence[float] | None
) -> tuple[list[Scan], tuple[str, ...]]:
    """The scans, those in the model's own axes with coordinates that count as its `target` (n, 3), m, does,
    from `origin` (3,), m, in a survey's; and what was done for that, in words."""
    reach = float(np.ptp(target, axis=0).max())
    alike, told = list(scans), dict[str, None]()
    for k, scan in enumerate(scans):
        if scan.frame is None:
            points, words = measurements.counted_alike(scan.points, target, origin, reach=reach)
            alike[k] = replace(scan, points=points)
            told |= dict.fromkeys(words)
    return alike, tuple(told)


def rigid_fit(points: Reals, places: Reals) -> Motion:
    """The rigid motion that brings the points (k, 3) nearest to the places (k, 3) in the sense of least
    squares (Kabsch).
    """
    middle, goal = points.mean(axis=0), places.mean(axis=0)
    left, _, right = np.linalg.svd((points - middle).T @ (places - goal))
    proper = np.array([1.0, 1.0, np.sign(np.linalg.det(left @ right))])
    turn = right.T @ (proper[:, None] * left.T)
    return Motion(turn, goal - turn @ middle)


def match(points: Reals, markers: Reals, *, reach: float, placed: bool = False) -> Match:
    """Names the points (k, 3) after the predicted `markers` (m, 3), none farther than `reach`, m, from its
    own. `placed`: the points are in the model's axes already. Raises InputError where fewer than half of the
    markers are found, or they lie on a line."""
    cloud = _checked(points, markers)
    if placed:
        pairs = _pairs(cKDTree(markers), cloud, reach)
        return _named(cloud, markers, pairs, Motion(np.eye(3), np.zeros(3)), ())
    return _matched_alike([cloud], [markers], reach)[0]


def _checked(points: Reals, markers: Reals) -> Reals:
    """The points (k, 3), where they and the markers suffice."""
    cloud = reals("scan.points", points, (None, 3))
    if len(markers) < _PAIRS or len(cloud) < _PAIRS:
        raise InputError(
            f"needs at least {_PAIRS} points and as many markers",
            where="scan",
            value=(len(cloud), len(markers)),
            remedy="Mark and scan more crossings.",
        )
    spread = np.linalg.svd(markers - markers.mean(axis=0), compute_uv=False)
    if spread[1] < _THIN * spread[0]:
        raise InputError("the markers lie on a line", where="scan", remedy="Spread them over the grid.")
    return cloud


def _matched_alike(clouds: Sequence[Reals], markers: Sequence[Reals], reach: float) -> list[Match]:
    """The points (k, 3) of scans in one frame, each named after its own markers (m, 3)."""
    trees = [cKDTree(each) for each in markers]
    parts = list(zip(trees, clouds, markers, strict=True))
    alone = [_fits(*part, reach) for part in parts]
    found: list[tuple[_Fitted, ...]] = [(each,) for each in alone[0]]
    if len(parts) > 1:
        found = [
            tuple(_closest(*part, start, reach) for part in parts)
            for fits in alone
            for _, _, start in _worth_trying(fits)
        ]
    best = min(found, key=_cost)
    rivals = [
        other
        for other in found
        if any(not np.array_equal(one[1], two[1]) for one, two in zip(best, other, strict=True))
    ]
    rival = min(rivals, key=_cost, default=None)
    doubts: tuple[str, ...] = ()
    if rival is not None and _cost(rival) < _RIVAL * _cost(best):
        doubts = (
            f"{_from_one_to_other(best[0][2], rival[0][2], clouds[0], reach)} the points fit nearly as well "
            f"({_cost(rival) / _cost(best):.2f} times the cost): "
            "mark the grid less symmetrically, or give the points in the model's axes.",
        )
    return [
        _named(cloud, goal, pairs, motion, doubts)
        for cloud, goal, (_, pairs, motion) in zip(clouds, markers, best, strict=True)
    ]


def _cost(fits: Sequence[_Fitted]) -> float:
    """Of scans that are laid alike."""
    return sum(each[0] for each in fits)


def _fits(tree: cKDTree, cloud: Reals, markers: Reals, reach: float) -> list[_Fitted]:
    """What closest points come to from all starts, and from the best that are turned otherwise beside."""
    found = [_closest(tree, cloud, markers, start, reach) for start in _starts(cloud, markers)]
    found.sort(key=lambda each: each[0])
    for begun in _turned_otherwise(found):
        found += _beside(tree, cloud, markers, begun, reach)
    return found


def _worth_trying(fits: Sequence[_Fitted]) -> list[_Fitted]:
    """The best of these, some that are turned otherwise, and the best with other pairs."""
    by_cost = sorted(fits, key=lambda each: each[0])
    others = [each for each in by_cost if not np.array_equal(each[1], by_cost[0][1])]
    return _turned_otherwise(by_cost) + others[:1]


def _from_one_to_other(one: Motion, other: Motion, cloud: Reals, reach: float) -> str:
    """By what two motions differ: "Turned by 180°", or "Shifted by 0.5 m" where they differ by that alone."""
    swing = _swing(one, other)
    far = np.linalg.norm(np.median(other(cloud) - one(cloud), axis=0))
    return f"Turned by {swing:.0f}°" if swing >= _TURNED or far < reach else f"Shifted by {far:.2g} m"


def _swing(one: Motion, other: Motion) -> float:
    """The angle between two motions, degrees."""
    return float(np.degrees(np.arccos(np.clip(0.5 * (np.trace(other.turn @ one.turn.T) - 1.0), -1.0, 1.0))))


def _turned_otherwise(found: Sequence[_Fitted]) -> list[_Fitted]:
    """The first of these, and after it the first that are turned against those before; a few."""
    chosen: list[_Fitted] = []
    for each in found:
        if len(chosen) < _OTHERWISE and all(_swing(other[2], each[2]) >= _TURNED for other in chosen):
            chosen.append(each)
    return chosen


def _beside(tree: cKDTree, cloud: Reals, markers: Reals, begun: _Fitted, reach: float) -> list[_Fitted]:
    """What is found when all are moved on to markers beside theirs, and from the best again, as long as it
    fits better."""
    best, found = begun, list[_Fitted]()
    while True:
        starts = _one_marker_on(tree, markers, best[1], best[2])
        beside = [_closest(tree, cloud, markers, start, reach) for start in starts]
        found += beside
        nearer = min(beside, key=lambda each: each[0], default=best)
        if nearer[0] >= best[0]:
            return found
        best = nearer


def _one_marker_on(tree: cKDTree, markers: Reals, pairs: Indices, motion: Motion) -> list[Motion]:
    """The motion, and after it what brings all markers to those beside them, as far as there are any: as the
    middle one of the pairs comes to each of the nearest beside it."""
    named = pairs[pairs >= 0]
    if len(named) < _PAIRS:
        return []
    middle = np.median(markers[named], axis=0)
    near = tree.query(middle, k=min(_BESIDE + 1, len(markers)))[1]
    found = []
    for step in markers[near[1:]] - markers[near[0]]:
        far, onto = tree.query(markers + step)
        kept = far < 0.5 * np.linalg.norm(step)
        if kept.sum() >= _PAIRS:
            on = rigid_fit(markers[kept], markers[onto[kept]])
            found.append(Motion(on.turn @ motion.turn, on(motion.shift[None])[0]))
    return found


def _named(cloud: Reals, markers: Reals, pairs: Indices, motion: Motion, doubts: tuple[str, ...]) -> Match:
    """The match of pairs (k,), the marker of each point or -1."""
    taken = np.flatnonzero(pairs >= 0)
    if len(taken) < max(_PAIRS, (len(markers) + 1) // 2):
        raise InputError(
            f"only {len(taken)} of {len(markers)} markers are found among {len(cloud)} points",
            where="scan",
            remedy="Check the unit and the handedness of the axes, and that the load case and the markers "
            "are the right ones.",
        )
    point = np.full(len(markers), -1)
    point[pairs[taken]] = taken
    distance = np.full(len(markers), np.nan)
    distance[pairs[taken]] = np.linalg.norm(motion(cloud[taken]) - markers[pairs[taken]], axis=1)
    every = indices("match.point", point + 1, (len(markers),), below=len(cloud) + 1) - 1
    return Match(every, np.flatnonzero(pairs < 0), motion, distance, doubts)


def _pairs(tree: cKDTree, cloud: Reals, reach: float) -> Indices:
    """The nearest marker (k,) of each point where the point is also the marker's nearest; -1 elsewhere and
    beyond the reach.
    """
    distance, marker = tree.query(cloud, distance_upper_bound=reach)
    order = np.argsort(distance, kind="stable")
    near = order[np.isfinite(distance[order])]
    _, first = np.unique(marker[near], return_index=True)
    result = np.full(len(cloud), -1)
    result[near[first]] = marker[near[first]]
    return result


def _closest(tree: cKDTree, cloud: Reals, markers: Reals, start: Motion, reach: float) -> _Fitted:
    """Iterates closest points from a start; the cost is the sum of squares with every lost marker or point at
    the reach.
    """
    motion, before = start, np.full(len(cloud), -2)
    for _ in range(_ROUNDS):
        pairs = _pairs(tree, motion(cloud), reach)
        if np.array_equal(pairs, before) or (pairs >= 0).sum() < _PAIRS:
            break
        motion, before = rigid_fit(cloud[pairs >= 0], markers[pairs[pairs >= 0]]), pairs
    kept = pairs >= 0
    away = motion(cloud[kept]) - markers[pairs[kept]]
    lost = len(markers) - int(kept.sum())
    return float((away**2).sum()) + lost * reach**2, pairs, motion


def _starts(cloud: Reals, markers: Reals) -> list[Motion]:
    """The principal axes of the points on those of the markers, turned about the normal and flipped."""
    middle, axes = _axes(cloud)
    goal, onto = _axes(markers)
    result = []
    for angle in np.arange(_TURNS) * (2.0 * np.pi / _TURNS):
        c, s = np.cos(angle), np.sin(angle)
        about = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        for flip in (np.eye(3), np.diag([1.0, -1.0, -1.0])):
            turn = onto @ about @ flip @ axes.T
            result.append(Motion(turn, goal - turn @ middle))
    return result


def _axes(points: Reals) -> tuple[Reals, Reals]:
    """Middle (3,) and right-handed principal axes (3, 3), the normal last, of the points without strays."""
    away = np.linalg.norm(points - np.median(points, axis=0), axis=1)
    near = points[away <= _STRAY * np.median(away)]
    middle = near.mean(axis=0)
    axes = np.linalg.svd(near - middle)[2].T
    return middle, axes * np.array([1.0, 1.0, np.sign(np.linalg.det(axes))])


def laid(scans: Sequence[Scan], states: Sequence[State], markers: Indices, reach: float) -> list[Match]:
    """The scans' points named and laid onto the states; scans of one frame alike, by one motion."""
    goals = [state.positions[markers] for state in states]
    found: dict[int, Match] = {}
    for frame in dict.fromkeys(scan.frame for scan in scans):
        own = [k for k, scan in enumerate(scans) if scan.frame == frame]
        if frame is None:
            found |= {k: match(scans[k].points, goals[k], reach=reach, placed=True) for k in own}
            continue
        clouds = [_checked(scans[k].points, goals[k]) for k in own]
        alike = dict(zip(own, _matched_alike(clouds, [goals[k] for k in own], reach), strict=True))
        points = np.vstack([scans[k].points[each.point[each.point >= 0]] for k, each in alike.items()])
        places = np.vstack([goals[k][each.point >= 0] for k, each in alike.items()])
        motion = rigid_fit(points, places)
        for k, each in alike.items():
            moved = replace(each, motion=motion)
            distance = np.linalg.norm(moved.places(scans[k].points) - goals[k], axis=1)
            found[k] = replace(moved, distance=distance)
    return [found[k] for k in range(len(scans))]


def distances(
    scans: Sequence[Scan], matches: Sequence[Match], states: Sequence[State], markers: Indices
) -> Reals:
    """Distances (m, s), m, of each scan's points from the states."""
    away = [
        each.places(scan.points) - state.positions[markers]
        for each, scan, state in zip(matches, scans, states, strict=True)
    ]
    return np.linalg.norm(np.array(away).reshape(-1, len(markers), 3), axis=2).T


def refuse_unlike(away: Reals, reach: float) -> None:
    """Raises InputError where distances (m, s), m, of scans from the model, each frame's laid by one motion,
    are more than the `reach`, m."""
    farthest = np.nanmax(away, axis=0)
    if farthest.max() > reach:
        raise InputError(
            "doesn't lie on the model as the others do, by one motion for all",
            where=f"scan {int(np.argmax(farthest)) + 1}",
            value=f"{1e3 * farthest.max():.3g} mm off",
            remedy="Give scans that were taken from one place, or all points in the model's axes.",
        )


def apart(one: Motion, other: Motion, place: Reals) -> float:
    """How far two motions lay the same points apart, m, at most, over the size of `place`."""
    back = (place - one.shift) @ one.turn
    return float(np.linalg.norm(other(back) - place, axis=1).max())
