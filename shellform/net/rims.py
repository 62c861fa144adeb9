"""The curves on which a net's rods end: the surface's edges, and where a level or an outline cuts the rods
off."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shellform.arrays import Indices, Reals, Record
from shellform.net.ground import LOW
from shellform.net.net import Net
from shellform.net.polylines import closed, nearest
from shellform.structure.elements.rotation import matrices
from shellform.surface.shape.target import Surface
from shellform.surface.shape.tree import Tree

OFF = 0.5  # of the spacing: an end farther from the surface's edge was cut off by a level or an outline
_BACK = 0.5  # of its length: what comes nearer to its beginning goes round
_APART = 2.5  # of the spacing: where a net was cut off, ends farther from one another are on two edges


@dataclass(eq=False)
class Rim:
    """A closed curve on which rods end.

    - `points` (k, 3), m; `along` (k + 1,), m: its arc lengths.
    - `opening`: whether it goes round one.
    - `cut`: whether the net was cut off along it, from its first point, which is on the surface's edge, to
      its last; else it goes round.
    - `kinds` and `names` (k,) of its points; `found` (k,): whether the geometry decided these.
    """

    points: Reals
    opening: bool
    cut: bool
    kinds: list[str]
    names: list[str]
    found: list[bool]
    along: Reals


@dataclass(frozen=True, eq=False)
class End(Record):
    """A rod's end: its `node`, the `rim` that it lies on, its arc length `at` on it, m, the `vertex` of the
    rim that is nearest, and its `middle` (3,) on the edge, m."""

    node: int
    rim: int
    at: float
    vertex: int
    middle: Reals


def ends_of(net: Net, surface: Surface) -> tuple[list[End], list[Rim]]:
    """The rods' ends on the curves that they lie on: the surface's edges, then the curve along which a level
    or an outline cut the rods off."""
    nodes, place = net.rod_ends, net.target.positions
    upwards = matrices(net.target.quaternions[nodes])[:, :, 2]
    middle = place[nodes] - net.grid.layer[nodes, None] * upwards
    rims = edges_of(surface)
    curves = [rim.points for rim in rims]
    starts = np.cumsum([0, *(len(each) for each in curves)])
    a = np.vstack(curves)
    b = np.vstack([np.roll(each, -1, axis=0) for each in curves])
    piece, closest, away = Tree(np.stack([a, b, b], axis=1)).nearest(middle)
    cut = np.flatnonzero(away > OFF * net.grid.scale)
    found = []
    order: dict[int, tuple[int, int]] = {}
    if len(cut):
        inner = middle[cut, :2] - middle[cut, :2].mean(axis=0)
        key = (
            np.arctan2(inner[:, 1], inner[:, 0])
            if net.limits.plan is None
            else nearest(middle[cut, :2], closed(net.limits.plan))[1]
        )
        apart = _APART * net.grid.scale
        for chain in _chains(cut[np.argsort(key, kind="stable")], middle, apart):
            points, cut_off = middle[chain], not _goes_round(middle[chain], apart)
            order |= {int(end): (len(rims), k) for k, end in enumerate(chain, int(cut_off))}
            if cut_off:
                feet = _reached(points[[0, -1]], rims, apart)
                points = np.vstack([feet[:1], points, feet[1:]])
            rims.append(rim_of(points, False, cut=cut_off))
    for k, node in enumerate(nodes.tolist()):
        if k in order:
            number, vertex = order[k]
            found.append(End(node, number, float(rims[number].along[vertex]), vertex, middle[k]))
            continue
        number = int(np.searchsorted(starts, piece[k], side="right")) - 1
        rim, first = rims[number], int(piece[k] - starts[number])
        part = float(np.linalg.norm(closest[k] - a[piece[k]]))
        near = first if 2.0 * part < rim.along[first + 1] - rim.along[first] else first + 1
        found.append(End(node, number, float(rim.along[first] + part), near % len(rim.points), middle[k]))
    return found, rims


def edges_of(surface: Surface) -> list[Rim]:
    """The surface's edges, the outer one first. Where its mesh is coarse they have points between vertices,
    which lie no farther apart than what counts as low over the ground is high: of a long side of a triangle
    that comes down to a foot, half would stand on the ground."""
    step = LOW * surface.longer_side
    return [
        rim_of(_divided(surface.vertices[loop], step), number > 0)
        for number, loop in enumerate(surface.boundary)
    ]


def _divided(points: Reals, step: float) -> Reals:
    """The points (k, 3), m, of a closed curve with others evenly between those that lie farther apart than
    `step`, m."""
    away = np.roll(points, -1, axis=0) - points
    parts = np.maximum(np.ceil(np.linalg.norm(away, axis=1) / step - 1e-9).astype(np.int64), 1)
    at = np.arange(parts.sum()) - np.repeat(np.cumsum(parts) - parts, parts)
    return np.asarray(
        np.repeat(points, parts, axis=0)
        + (at / np.repeat(parts, parts))[:, None] * np.repeat(away, parts, axis=0)
    )


def rim_of(points: Reals, opening: bool, *, cut: bool = False) -> Rim:
    """The rim through `points` (k, 3), m, whose kinds and names aren't decided yet."""
    step = np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1)
    return Rim(points, opening, cut, [], [], [], np.append(0.0, np.cumsum(step)))


def _chains(ends: Indices, middle: Reals, apart: float) -> list[Indices]:
    """The ends, in order round a plan curve, in pieces between gaps wider than `apart`, m."""
    step = np.linalg.norm(middle[np.roll(ends, -1)] - middle[ends], axis=1)
    gaps = np.flatnonzero(step > apart)
    if not len(gaps):
        return [ends]
    turned = np.roll(ends, -(int(gaps[0]) + 1))
    return np.split(turned, np.flatnonzero(np.roll(step, -(int(gaps[0]) + 1))[:-1] > apart) + 1)


def _goes_round(points: Reals, apart: float) -> bool:
    """Whether points (k, 3), m, in order come back to where they begin, to within `apart`, m: those of a few
    rods that were cut off at a corner lie as near to each other."""
    between = float(np.linalg.norm(points[-1] - points[0]))
    length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    return between <= min(apart, _BACK * length)


def _reached(points: Reals, rims: Sequence[Rim], apart: float) -> Reals:
    """Where the curve along which a net was cut off comes to the surface's edge next to its first and last
    points (2, 3); the points themselves where that is farther than `apart`, m."""
    edge = np.vstack([rim.points for rim in rims if not rim.cut])
    away = np.linalg.norm(points[:, None] - edge, axis=2)
    near = np.argmin(away, axis=1)
    return np.where((away[[0, 1], near] < apart)[:, None], edge[near], points)
