"""A surface cut off at a level: what lies lower is left to plinths, walls or footings that reach up to there.

Triangles across the level are divided where their edges cross it. A vertex nearer to such a crossing than a
fraction of the edge is moved there, along the edge, so that no slivers are left on which normals can't be
told. Normals are told anew: beside a crease that is cut off they aren't what they were.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from scipy.sparse.csgraph import connected_components

from shellform.arrays import Indices, Reals
from shellform.errors import InputError
from shellform.surface.shape.target import Surface, make_surface
from shellform.surface.shape.triangles import adjacency, counted_edges, triangle_areas, used_points

_NEAR = 0.2  # of an edge: nearer to where it crosses the level its end is moved there
_LEFT = 0.7  # of the surface's area above the level in one piece, at the least


def cut_off(surface: Surface, above: float) -> Surface:
    """The part of the surface that lies higher than `above`, m; the surface itself where all of it does.

    Raises InputError where too little is left, or where it falls into pieces of like size.
    """
    if not np.isfinite(above):
        raise InputError("must be a height", where="surface.above", value=above, remedy="Give metres.")
    lowest, highest = float(surface.vertices[:, 2].min()), float(surface.vertices[:, 2].max())
    if above <= lowest:
        return surface
    if above >= highest:
        raise InputError(
            f"is higher than all of the surface, which reaches from {lowest:.4g} to {highest:.4g} m",
            where="surface.above",
            value=above,
            remedy="Give a height between them.",
        )
    points, side = _snapped(surface, above)
    points, faces = _divided(points, surface.triangles, side, above)
    whole = triangle_areas(points, faces).sum()
    faces = _largest(points, faces)
    if triangle_areas(points, faces).sum() < _LEFT * whole:
        raise InputError(
            "falls into pieces of like size above that height",
            where="surface.above",
            value=above,
            remedy="Give a lower height, or bring the pieces one by one.",
        )
    used, faces = used_points(faces, len(points))
    result = make_surface(points[used], faces, source=surface.source)
    told = f"cut off {above - lowest:.3g} m above its lowest point"
    return Surface(
        result.vertices,
        result.triangles,
        result.normals,
        surface.source,
        (*surface.mended, told, *result.mended),
    )


def _snapped(surface: Surface, above: float) -> tuple[Reals, Reals]:
    """The vertices (v, 3), those near a crossing moved onto it, and on which side (v,) they are: 1 above, 0
    on the level, -1 below."""
    points, faces = surface.vertices.copy(), surface.triangles
    height = points[:, 2] - above
    size = float(np.ptp(points[:, 2]))
    side = np.where(np.abs(height) <= 1e-9 * size, 0.0, np.sign(height))
    pairs, times = counted_edges(faces)
    rim = np.isin(np.arange(len(points)), pairs[times == 1])
    crossed = side[pairs[:, 0]] * side[pairs[:, 1]] < 0.0
    across, along_rim = pairs[crossed], times[crossed] == 1
    share = height[across[:, 0]] / (height[across[:, 0]] - height[across[:, 1]])
    ends = surface.vertices[across]
    place = (1.0 - share)[:, None] * ends[:, 0] + share[:, None] * ends[:, 1]
    for end, near in ((0, share), (1, 1.0 - share)):
        movable = (near < _NEAR) & (along_rim | ~rim[across[:, end]])  # the rim stays where it is
        order = np.flatnonzero(movable)
        order = order[np.argsort(-near[order])]  # the nearest last, which stays
        points[across[order, end]] = place[order]
        side[across[order, end]] = 0.0
    points[side == 0.0, 2] = above
    return points, side


def _divided(points: Reals, faces: Indices, side: Reals, above: float) -> tuple[Reals, Indices]:
    """The vertices, with those of the crossings after them, and the triangles above the level."""
    sides = side[faces]
    whole = (sides >= 0.0).all(axis=1) & (sides > 0.0).any(axis=1)
    kept, more = faces[whole].tolist(), list[Reals]()
    crossings: dict[tuple[int, int], int] = {}

    def crossing(a: int, b: int) -> int:
        """The vertex where the edge from `a`, above, to `b`, below, crosses the level."""
        if (a, b) not in crossings:
            high, low = points[a, 2] - above, above - points[b, 2]
            more.append((low * points[a] + high * points[b]) / (high + low))
            crossings[a, b] = len(points) + len(more) - 1
        return crossings[a, b]

    for face in faces[(sides > 0.0).any(axis=1) & (sides < 0.0).any(axis=1)].tolist():
        corners: list[int] = []
        for a, b in pairwise((*face, face[0])):
            if side[a] >= 0.0:
                corners.append(a)
            if side[a] * side[b] < 0.0:
                corners.append(crossing(a, b) if side[a] > 0.0 else crossing(b, a))
        kept += [[corners[0], *two] for two in pairwise(corners[1:])]
    return np.vstack([points, *more]), np.array(kept)


def _largest(points: Reals, faces: Indices) -> Indices:
    """The triangles of the piece with the largest area."""
    _, label = connected_components(adjacency(faces, len(points)), directed=False)
    area = np.bincount(label[faces[:, 0]], weights=triangle_areas(points, faces))
    return faces[label[faces[:, 0]] == int(np.argmax(area))]
