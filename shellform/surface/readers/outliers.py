"""Single vertices far out of the surface that those around them lie on, as stray points of a scan, put back.

Along the normal of its neighbourhood a vertex is told from the quadratic height function that fits those two
to four edges away, without the few that lie far from it themselves. It is an outlier where it lies off by

- more than _FAR standard deviations of that fit's prediction, which grow with the surface's noise, with what
  a quadratic can't follow, and beyond the edge of what is fitted, and
- more than a share of the sides there, and where
- its neighbours lie on the fit: at the tip of a cone, on a crease and below a mast they are off with it.

It is put onto the fit along its normal, or, where it is off along the surface too, at the middle of its
neighbours, on the edge where that goes on to from either side. Where many vertices are off, that is the
surface, and it is left as it is.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from shellform.arrays import Flags, Indices, Reals, Record
from shellform.errors import how_many
from shellform.quantities import number
from shellform.surface.readers.draft import Draft, noted
from shellform.surface.shape.target import rough_normals
from shellform.surface.shape.triangles import adjacency, open_edges

_FEWEST = 200  # vertices of a surface: of fewer, each is likely to be meant
_SUSPECT = 5.0  # times the median, that a vertex is off the mean of its neighbours
_TRIED = 0.05  # of the vertices, the most suspect: each takes a millisecond or two
_MOST_TRIED = 5000
_FAR = 8.0  # standard deviations of the prediction
_LEAST = 0.1  # of a side
_NEIGHBOURS = 0.15  # of an outlier's height: as far off may its neighbours be
_NEAR, _WIDE = 2, 4  # edges away: those that are fitted
_ENOUGH = 12  # vertices to fit six numbers to
_STRAY = 4.0  # median heights: vertices farther off aren't fitted
_TRIMMINGS = 3
_MOST = 0.01  # of the vertices may be outliers


@dataclass(frozen=True, eq=False)
class _Rings(Record):
    """Which vertices are neighbours, `first` (v + 1,) and `others`, row after row, as in a sparse array."""

    first: Indices
    others: Indices

    def at(self, vertex: int) -> Indices:
        """The neighbours of a vertex."""
        return self.others[self.first[vertex] : self.first[vertex + 1]]

    def around(self, vertex: int) -> list[Indices]:
        """The vertices (…,) one, two, … edges away, _WIDE of such rings."""
        seen, rings = {vertex}, list[Indices]()
        ring = [vertex]
        for _ in range(_WIDE):
            ring = sorted({int(k) for at in ring for k in self.at(at)} - seen)
            seen.update(ring)
            rings.append(np.array(ring, dtype=np.int64))
        return rings


def without_outliers(draft: Draft) -> Draft:
    """The draft, in one piece and turned alike, with its single outlying vertices put onto the surface of
    those around them, and a note of how far they were off; as it is where there are none."""
    points, faces = draft.points.copy(), draft.triangles
    if len(points) < _FEWEST:
        return draft
    graph = adjacency(faces, len(points))
    graph.sort_indices()
    rings = _Rings(graph.indptr.astype(np.int64), graph.indices.astype(np.int64))
    off = _off_neighbours(points, faces, rings)
    most = min(_MOST_TRIED, int(_TRIED * len(points)))
    first = np.argsort(-off, kind="stable")[:most]
    suspects = first[off[first] > _SUSPECT * np.median(off)].tolist()
    along = _along_edge(faces)
    for vertex in suspects:
        place = _place(points, vertex, rings.around(vertex), along.get(vertex))
        if place is not None:
            points[vertex] = place
    moved = np.flatnonzero((points != draft.points).any(axis=1))
    if not 0 < len(moved) <= _MOST * len(points):
        return draft
    told = how_many(
        len(moved),
        "vertex lay out of the surface of those around it and was put onto it, as a stray point of a scan",
        "vertices lay out of the surface of those around them and were put onto it, as stray points of a scan",
    )
    by = number(float(np.linalg.norm(points - draft.points, axis=1).max()), 2)
    normals = draft.normals
    if normals is not None:
        normals = normals.copy()
        normals[np.unique(np.concatenate([moved, *(rings.at(int(k)) for k in moved)]))] = 0.0
    return noted(replace(draft, points=points, normals=normals), f"{told}, by {by} m at most")


def _off_neighbours(points: Reals, faces: Indices, rings: _Rings) -> Reals:
    """How far (v,), m, each vertex lies from the mean of its neighbours along the mean of their
    normals: of a vertex with one face alone its own is square to that."""
    count = np.diff(rings.first)
    normals = rough_normals(points, faces)
    mean, normal = (
        np.add.reduceat(each[rings.others], rings.first[:-1], axis=0) / count[:, None]
        for each in (points, normals)
    )
    return np.asarray(np.abs(np.sum((points - mean) * normal, axis=1)))


def _along_edge(faces: Indices) -> dict[int, Indices]:
    """Of each vertex on the edge the second and the first before it, and the first and the second after."""
    edges = open_edges(faces)
    after = dict(edges.tolist())
    before = {b: a for a, b in edges.tolist()}
    return {at: np.array([before[before[at]], before[at], after[at], after[after[at]]]) for at in after}


def _place(points: Reals, vertex: int, rings: list[Indices], along: Indices | None) -> Reals | None:
    """Where the vertex belongs, x, y, z in m; None where it is no outlier. `rings` are the vertices one, two,
    … edges away, `along` the two before and the two after it where it lies on the edge."""
    fitted = np.concatenate(rings[_NEAR - 1 :])
    if len(fitted) < _ENOUGH:
        return None
    if along is None:
        middle = points[rings[0]].mean(axis=0)
    else:
        middle = np.array([-0.5, 1.0, 1.0, -0.5]) @ points[along]
    offset = points[fitted] - middle
    kept = np.ones(len(fitted), dtype=bool)
    for _ in range(_TRIMMINGS):
        centre = offset[kept].mean(axis=0)
        axes = np.linalg.svd(offset[kept] - centre, full_matrices=False)[2]
        columns = _columns(offset, axes)
        answer, left = _fit(columns, offset @ axes[2], kept)
        within = np.abs(left) <= _STRAY * max(float(np.median(np.abs(left))), 1e-300)
        if within.sum() < _ENOUGH or (within == kept).all():
            break
        kept = within
    side = float(np.median(np.linalg.norm(points[rings[1]] - middle, axis=1))) / _NEAR
    aside = axes[:2] @ (points[vertex] - middle)
    place = middle + (aside if np.linalg.norm(aside) <= side else np.zeros(2)) @ axes[:2]
    here = _columns((place - middle)[None], axes)[0]
    off = float((points[vertex] - place) @ axes[2] - here @ answer)
    deviation = np.sqrt(float(left[kept] @ left[kept]) / max(int(kept.sum()) - columns.shape[1], 1))
    inverse = np.linalg.pinv(columns[kept].T @ columns[kept])
    predicted = deviation * np.sqrt(1.0 + float(here @ inverse @ here))
    if abs(off) <= max(_FAR * predicted, _LEAST * side):
        return None
    near = points[rings[0] if along is None else along[1:3]] - middle
    with_it = np.abs(near @ axes[2] - _columns(near, axes) @ answer)
    if float(np.median(with_it) if along is None else with_it.max()) > _NEIGHBOURS * abs(off):
        return None
    return np.asarray(place + (here @ answer) * axes[2])


def _columns(offset: Reals, axes: Reals) -> Reals:
    """1, a, b, a², ab, b² (n, 6) of offsets (n, 3), m, along the first two of the `axes` (3, 3)."""
    a, b = (offset @ axes[:2].T).T
    return np.column_stack([np.ones(len(a)), a, b, a * a, a * b, b * b])


def _fit(columns: Reals, heights: Reals, kept: Flags) -> tuple[Reals, Reals]:
    """The quadratic's six numbers, the smallest ones where several fit, fitted to the heights (n,), m, that
    are `kept`, and what is left of all (n,), m."""
    answer = np.asarray(np.linalg.lstsq(columns[kept], heights[kept], rcond=None)[0])
    return answer, heights - columns @ answer
