"""The upper or the lower face of a closed skin, such as a solid shell's: what lies between its sharp edges.

Triangles that meet at less than 35° belong together; of the regions so found, the one with the largest area
in plan on the side asked for is the face, and with it those of the same side that have at least a quarter of
its plan area: a skin with a few folds.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from shellform.arrays import Flags, Indices, Reals
from shellform.errors import InputError
from shellform.surface.shape.triangles import area_vectors, directed_edges

_SHARP = np.cos(np.deg2rad(35.0))  # of the angle between normals: beyond, an edge sets two faces apart
_ALSO = 0.25  # of the largest face's area in plan: others as large belong to that side too
_BOTH = 0.75  # of a face's area that has to point to its side


def side_of(points: Reals, triangles: Indices, face: str, where: str) -> Flags:
    """Which triangles (t,) of a closed skin, turned consistently, are its "upper" or "lower" `face`.

    Raises InputError where no sharp edge sets it off from the rest.
    """
    area = area_vectors(points, triangles)
    if np.sum(area * (points[triangles[:, 0]] - points.mean(axis=0))) < 0.0:
        area = -area  # turned inwards
    size = np.linalg.norm(area, axis=1)
    unit = area / np.maximum(size, 1e-300)[:, None]
    first, second, _ = shared_edges(triangles)
    smooth = np.sum(unit[first] * unit[second], axis=1) > _SHARP
    label = _linked(first[smooth], second[smooth], len(triangles))
    up = 1.0 if face == "upper" else -1.0
    plan = np.bincount(label, weights=up * area[:, 2])
    best = float(plan.max())
    chosen = plan >= _ALSO * best
    kept = np.asarray(chosen[label])
    pointing = float(size[kept & (up * area[:, 2] > 0.0)].sum())
    if best <= 0.0 or kept.all() or pointing < _BOTH * float(size[kept].sum()):
        raise InputError(
            f"its {face} face isn't set off from the rest by an edge",
            where=where,
            remedy=f"Export the {face} face alone, as a surface.",
        )
    return kept


def shared_edges(triangles: Indices) -> tuple[Indices, Indices, Flags]:
    """The triangles on the two sides of each edge that two share, (e,) and (e,), and whether both pass it in
    the same direction (e,).
    """
    edges = directed_edges(triangles)
    owner = np.tile(np.arange(len(triangles)), 3)
    low, high = edges.min(axis=1), edges.max(axis=1)
    order = np.lexsort((high, low))
    same = (low[order][1:] == low[order][:-1]) & (high[order][1:] == high[order][:-1])
    first, second = order[:-1][same], order[1:][same]
    return owner[first], owner[second], np.asarray(edges[first, 0] == edges[second, 0])


def pieces_of(triangles: Indices) -> Indices:
    """The piece of each triangle (t,), numbered from 0: what hangs together by edges."""
    first, second, _ = shared_edges(triangles)
    return _linked(first, second, len(triangles))


def _linked(first: Indices, second: Indices, count: int) -> Indices:
    """Of `count` triangles the group of each (t,), the `first` (e,) being in one with the `second` (e,)."""
    links = sp.csr_array((np.ones(len(first)), (first, second)), shape=(count, count))
    return np.asarray(connected_components(links, directed=False)[1], dtype=np.int64)
