"""Triangles between points, of whatever they are the skin: how large they are, their edges, and which points
they have.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from shellform.arrays import Flags, Indices, Reals

if TYPE_CHECKING:
    import scipy.sparse as sp


def area_vectors(points: Reals, triangles: Indices) -> Reals:
    """Vectors (…, 3), m², square to the triangles (…, 3) between the points (v, 3) and as long as these are
    large, to the side from which their corners run anticlockwise."""
    corner = points[triangles]
    a, b, c = corner[..., 0, :], corner[..., 1, :], corner[..., 2, :]
    return np.asarray(0.5 * np.cross(b - a, c - a))


def triangle_areas(points: Reals, triangles: Indices) -> Reals:
    """The areas (t,), m², of the triangles (t, 3) between the points (v, 3)."""
    return np.asarray(np.linalg.norm(area_vectors(points, triangles), axis=1))


def vertex_areas(points: Reals, triangles: Indices) -> Reals:
    """A third (v,), m², of the triangles (t, 3) at each of the points (v, 3)."""
    area = triangle_areas(points, triangles)
    result = np.zeros(len(points))
    np.add.at(result, triangles, (area / 3.0)[:, None])
    return result


def directed_edges(triangles: Indices) -> Indices:
    """Edges (3 t, 2): of all triangles their first, then their second, then their third."""
    return np.vstack([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])


def counted_edges(triangles: Indices) -> tuple[Indices, Indices]:
    """The edges (e, 2), the lower vertex first, and how many triangles have each (e,)."""
    return np.unique(np.sort(directed_edges(triangles), axis=1), axis=0, return_counts=True)


def open_edges(triangles: Indices) -> Indices:
    """The edges (e, 2) that only one triangle has, in its direction."""
    edges = directed_edges(triangles)
    _, at, counts = np.unique(np.sort(edges, axis=1), axis=0, return_index=True, return_counts=True)
    return np.asarray(edges[at[counts == 1]])


def adjacency(triangles: Indices, count: int) -> sp.csr_array:
    """1 (v, v) for each two of `count` points that an edge joins."""
    import scipy.sparse as sp  # half of what a reader's process would load, which asks for none

    edges = directed_edges(triangles)
    graph = sp.csr_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(count, count))
    return sp.csr_array((graph + graph.T) > 0).astype(float)


def used_points(triangles: Indices, count: int) -> tuple[Flags, Indices]:
    """Which of `count` points (v,) triangles (t, 3) have, and the triangles numbered among those alone."""
    used = np.zeros(count, dtype=bool)
    used[triangles.ravel()] = True
    return used, (np.cumsum(used) - 1)[triangles]
