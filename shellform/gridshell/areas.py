"""True areas of the surface that the net's nodes carry: facets cut by planes, and shared out to the nearest
node.

A part of the surface (a half, a strip, a ring, what lies outside the openings) is the triangles that are left
when its facets are cut along planes, so that parts that fit together have exactly the whole's area. Each
point of the surface belongs to the nearest joint or support: within a facet these are the cells of Voronoi's
diagram, convex polygons, which are cut out of the facet along the planes half-way between two nodes. Their
areas add up to the surface's but for rounding. What is next to a support is carried by the ground without
going through the grid.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from shellform.arrays import Reals, reals
from shellform.errors import InputError
from shellform.net.net import Net
from shellform.surface.shape.target import Surface

_COARSE = 0.75  # spacings: facets with a longer edge are halved first, so that few nodes compete for each


def facets(surface: Surface) -> Reals:
    """The corners (t, 3, 3), m, of its triangles."""
    return surface.vertices[surface.triangles]


def areas(triangles: Reals) -> Reals:
    """Areas (t,), m², of triangles (t, 3, 3)."""
    return 0.5 * np.linalg.norm(
        np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1
    )


def cut(triangles: Reals, height: Reals) -> tuple[Reals, Reals, Reals, Reals]:
    """Triangles (t, 3, 3) cut where a linear function with the values `height` (t, 3) at their corners is
    zero.

    Gives the pieces below (b, 3, 3), the numbers (b,) of the triangles that they come from, and the same
    above.
    """
    below = (height < 0.0).sum(axis=1)
    number = np.arange(len(triangles))
    kept: dict[bool, list[tuple[Reals, Reals]]] = {
        True: [(triangles[below == 3], number[below == 3])],
        False: [(triangles[below == 0], number[below == 0])],
    }
    for count in (1, 2):  # corners below: one corner lies alone on its side
        some = number[below == count]
        alone = np.argmax((height[some] < 0.0) == (count == 1), axis=1)
        turn = (alone[:, None] + np.arange(3)) % 3
        corner = np.take_along_axis(triangles[some], turn[:, :, None], axis=1)
        value = np.take_along_axis(height[some], turn, axis=1)
        share = (value[:, :1] / (value[:, :1] - value[:, 1:]))[:, :, None]
        a, b, c = corner[:, 0], corner[:, 1], corner[:, 2]
        ab, ac = a + share[:, 0] * (b - a), a + share[:, 1] * (c - a)
        tip, rest = (
            np.stack([a, ab, ac], axis=1),
            np.concatenate([np.stack([ab, b, c], axis=1), np.stack([ab, c, ac], axis=1)]),
        )
        kept[count == 1].append((tip, some))
        kept[count != 1].append((rest, np.concatenate([some, some])))
    result = []
    for side in (True, False):
        result += [np.concatenate([part[k] for part in kept[side]]) for k in (0, 1)]
    return result[0], result[1], result[2], result[3]


def between(triangles: Reals, direction: Reals, low: float, high: float) -> Reals:
    """The part (s, 3, 3) of triangles (t, 3, 3) where `direction`·x lies between `low` and `high`, m
    (infinite: no limit).
    """
    along = np.asarray(direction, dtype=float)
    if np.isfinite(low):
        triangles = cut(triangles, triangles @ along - low)[2]
    if np.isfinite(high):
        triangles = cut(triangles, triangles @ along - high)[0]
    return triangles


def within(triangles: Reals, polygon: Reals) -> tuple[Reals, Reals]:
    """The parts of triangles (t, 3, 3) inside and outside a simple polygon (p, 2), m, in plan.

    Raises InputError for a polygon that crosses itself or has no area.
    """
    inside = []
    for a, b, c in _ears(polygon):
        here = triangles
        outside = []
        for start, end in ((a, b), (b, c), (c, a)):
            across = np.array([end[1] - start[1], start[0] - end[0]])  # to the right of the edge: outside
            here, _, beyond, _ = cut(here, (here[:, :, :2] - start) @ across)
            outside.append(beyond)
        inside.append(here)
        triangles = np.concatenate(outside)
    return np.concatenate(inside), triangles


def _ears(polygon: Reals) -> list[tuple[Reals, Reals, Reals]]:
    """Triangles, anticlockwise, that together are the polygon: an ear is cut off until none is left."""
    corners = list(reals("polygon", polygon, (None, 2)))
    x, y = np.transpose(corners) if corners else (np.zeros(0), np.zeros(0))
    area = 0.5 * float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum())
    if len(corners) < 3 or area == 0.0:
        raise InputError(
            "needs at least three corners round an area",
            where="polygon",
            value=len(corners),
            remedy="Give the corners' x and y in order, m, as [[0, 0], [1, 0], [0, 1]].",
        )
    if area < 0.0:
        corners.reverse()
    found, crossed = [], _crosses_itself(corners)
    while len(corners) > 2 and not crossed:
        ear = next((k for k in range(len(corners)) if _is_ear(corners, k)), None)
        crossed = ear is None
        if ear is not None:
            a, b, c = corners[ear - 1], corners[ear], corners[(ear + 1) % len(corners)]
            if _turn(a, b, c) > 0.0:
                found.append((a, b, c))
            del corners[ear]
    if crossed:
        raise InputError(
            "the polygon crosses itself", where="polygon", remedy="List its corners in order round it."
        )
    return found


def _is_ear(corners: list[Reals], k: int) -> bool:
    """Whether the corner sticks out with no other in its triangle; a corner on a straight line does too."""
    a, b, c = corners[k - 1], corners[k], corners[(k + 1) % len(corners)]
    turn = _turn(a, b, c)
    others = [p for p in corners if p is not a and p is not b and p is not c]
    return turn == 0.0 or (
        turn > 0.0 and not any(min(_turn(a, b, p), _turn(b, c, p), _turn(c, a, p)) >= 0.0 for p in others)
    )


def _crosses_itself(corners: list[Reals]) -> bool:
    """Whether two sides pass through each other."""
    sides = list(zip(corners, [*corners[1:], corners[0]], strict=True))
    return any(
        _turn(a, b, p) * _turn(a, b, q) < 0.0 and _turn(p, q, a) * _turn(p, q, b) < 0.0
        for k, (a, b) in enumerate(sides)
        for p, q in sides[k + 1 :]
    )


def _turn(a: Reals, b: Reals, c: Reals) -> float:
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))


def tributary(net: Net, triangles: Reals) -> Reals:
    """The area (n,), m², of triangles (t, 3, 3) on the surface that each node of the net carries.

    A joint's area is at its upper node, that of a rod's end at its own; other nodes have none. The sum is the
    triangles' area.
    """
    ends = net.rod_ends[~np.isin(net.rod_ends, net.grid.crossing_nodes)]
    nodes = np.concatenate([net.grid.crossing_nodes[:, 1], ends])
    place = np.vstack([net.crossings, net.target.positions[ends]])
    result = np.zeros(net.node_count)
    result[nodes] = _nearest(triangles, place, _COARSE * net.grid.scale)
    return result


def _nearest(triangles: Reals, places: Reals, longest: float) -> Reals:
    """The area (p,) of triangles (t, 3, 3) nearest each of places (p, 3)."""
    pieces = _halved(triangles, longest)
    middle = pieces.mean(axis=1)
    reach = np.linalg.norm(pieces - middle[:, None], axis=2).max(axis=1)
    tree = cKDTree(places)
    # A place that is nearest somewhere in the triangle is at the most 2 reach farther from its middle than
    # the nearest one.
    near = tree.query_ball_point(middle, tree.query(middle)[0] + 2.0 * reach + 1e-12)
    rivals = np.array([len(each) for each in near])
    result = np.zeros(len(places))
    sole = rivals == 1
    np.add.at(
        result, np.array([near[k][0] for k in np.flatnonzero(sole)], dtype=np.int64), areas(pieces[sole])
    )
    for count in np.unique(rivals[~sole]):
        group = np.flatnonzero(rivals == count)
        candidates = np.array([near[k] for k in group])
        for own in range(count):
            here, origin = pieces[group], np.arange(len(group))
            for other in range(count):
                if other != own and len(here):
                    p, q = places[candidates[origin, own]], places[candidates[origin, other]]
                    away = q - p
                    height = np.einsum("tcx,tx->tc", here - (0.5 * (p + q))[:, None], away)
                    here, of = cut(here, height)[:2] if own < other else _not_above(here, height)
                    origin = origin[of]
            np.add.at(result, candidates[origin, own], areas(here))
    return result


def _not_above(triangles: Reals, height: Reals) -> tuple[Reals, Reals]:
    """The pieces where `height` is at most zero: of two places equally far the first has what lies on the
    border.
    """
    _, _, here, of = cut(triangles, -height)
    return here, of


def _halved(triangles: Reals, longest: float) -> Reals:
    """Triangles (t, 3, 3) halved across their longest edge until none is longer than `longest`, m."""
    done = []
    while len(triangles):
        edge = np.linalg.norm(np.roll(triangles, -1, axis=1) - triangles, axis=2)
        long = edge.max(axis=1) > longest
        done.append(triangles[~long])
        turn = (np.argmax(edge[long], axis=1)[:, None] + np.arange(3)) % 3
        corner = np.take_along_axis(triangles[long], turn[:, :, None], axis=1)
        half = 0.5 * (corner[:, 0] + corner[:, 1])
        triangles = np.concatenate(
            [np.stack([corner[:, 0], half, corner[:, 2]], 1), np.stack([half, corner[:, 1], corner[:, 2]], 1)]
        )
    return np.concatenate([np.zeros((0, 3, 3)), *done])
