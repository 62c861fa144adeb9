"""The target surface: triangles with a normal at every vertex.

Triangles are only the skeleton: between them the surface is taken as smooth (locate.py), so that what matters about the mesh are its
vertices and their normals. Where a CAD kernel doesn't give these, they come from local jets: each vertex's neighbourhood of
two rings is fitted by a cubic height function over the plane of a first, angle-weighted normal, in the sense of least squares
(Cazals and Pouget 2005); its slope corrects the normal to third order in the mesh size, its second derivatives give the curvature.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike
from scipy.sparse.csgraph import breadth_first_order, connected_components

from shellform.arrays import Indices, Reals, indices, reals
from shellform.compiled import njit
from shellform.errors import InputError

_SAME = 1e-9  # of the size: vertices nearer than that are one
_FLAT = 1e-12  # of the squared size: triangles smaller than that have no area


@dataclass(frozen=True)
class Surface:
    """`vertices` (v, 3), m; `triangles` (t, 3), all turned the same way; unit `normals` (v, 3) to the upper side, on which the concrete
    is poured; `source`, the file or script it came from; `mended`, a sentence for each defect that was mended."""

    vertices: Reals
    triangles: Indices
    normals: Reals
    source: str = ""
    mended: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "vertices", reals("vertices", self.vertices, (None, 3)))
        count = len(self.vertices)
        put(self, "triangles", indices("triangles", self.triangles, (None, 3), below=count))
        put(self, "normals", reals("normals", self.normals, (count, 3)))

    @property
    def area(self) -> float:
        """m², of the triangles."""
        return float(np.linalg.norm(_area_vectors(self.vertices, self.triangles), axis=1).sum())

    @property
    def size(self) -> Reals:
        """Extents (3,), m, along x, y and z."""
        return np.asarray(np.ptp(self.vertices, axis=0))

    @property
    def boundary(self) -> list[Indices]:
        """The closed loops of vertices round the surface and round its holes, the longest first."""
        edges = _directed_edges(self.triangles)
        key = edges[:, 0] * len(self.vertices) + edges[:, 1]
        back = edges[:, 1] * len(self.vertices) + edges[:, 0]
        rim = edges[~np.isin(key, back)]
        following = dict(zip(rim[:, 0].tolist(), rim[:, 1].tolist(), strict=True))
        loops = []
        while following:
            start, here = following.popitem()
            loop = [start]
            while here != start:
                loop.append(here)
                here = following.pop(here)
            loops.append(np.array(loop))
        return sorted(loops, key=len, reverse=True)

    @property
    def holes(self) -> int:
        """The number of openings inside the edge."""
        return len(self.boundary) - 1


def make_surface(
    vertices: ArrayLike, triangles: ArrayLike, *, normals: ArrayLike | None = None, source: str = ""
) -> Surface:
    """The surface of a triangle mesh, `vertices` (v, 3), m, and `triangles` (t, 3), cleaned and turned upwards.

    Vertices at one place are merged, unused ones and triangles without area or given twice are dropped (`mended` says so).
    `normals` (v, 3) where the source knows them; else they are estimated. Raises InputError for an empty mesh, edges with more than
    two triangles, several separate pieces, a closed surface, and one with a single side.
    """
    points = reals("vertices", vertices, (None, 3))
    faces = indices("triangles", triangles, (None, 3), below=max(len(points), 1))
    where = source or "surface"
    given = None if normals is None else reals("normals", normals, (len(points), 3))
    points, faces, given, mended = _cleaned(points, faces, given)
    if not len(faces):
        raise InputError("the mesh has no triangle with an area", where=where, remedy="Export the surface as a mesh.")
    _refuse_pieces(points, faces, where)
    faces = _oriented(faces, len(points), where)
    up = _area_vectors(points, faces).sum(axis=0)
    if up[2] < 0.0:
        faces = faces[:, ::-1].copy()
    rough = _rough_normals(points, faces)
    if given is None:
        unit = jets(points, faces, rough)[0]
    else:
        unit = given / np.linalg.norm(given, axis=1, keepdims=True)
        unit = unit * np.where(np.sum(unit * rough, axis=1, keepdims=True) < 0.0, -1.0, 1.0)
    return Surface(points, faces, unit, source, tuple(mended))


def curvature(surface: Surface) -> Reals:
    """Principal curvatures (v, 2), 1/m, positive where the surface bends away from its upper side."""
    return jets(surface.vertices, surface.triangles, surface.normals)[1]


def largest_curvature(surface: Surface) -> float:
    """The largest principal curvature, 1/m, but for the two hundredth of the inner vertices where it is largest: mesh noise.

    Vertices at the edge don't count, where jets know one side only.
    """
    bent = np.abs(curvature(surface)).max(axis=1)
    inner = np.ones(len(bent), dtype=bool)
    inner[np.concatenate(surface.boundary)] = False
    return float(np.percentile(bent[inner], 99.5)) if inner.any() else 0.0


def jets(points: Reals, faces: Indices, normals: Reals) -> tuple[Reals, Reals]:
    """Unit normals (v, 3) and principal curvatures (v, 2), 1/m, by cubic jets over two rings, from first `normals`."""
    one = _adjacency(faces, len(points))
    two = sp.csr_array((one @ one + one) > 0)
    two.setdiag(False)
    two.eliminate_zeros()
    return _jets(points, normals, two.indptr.astype(np.int64), two.indices.astype(np.int64))


@njit(cache=True)
def _jets(points, normals, indptr, neighbours):  # type: ignore[no-untyped-def]
    count = points.shape[0]
    unit = np.empty((count, 3))
    bent = np.empty((count, 2))
    for v in range(count):
        n = normals[v]
        k = 0 if abs(n[0]) < abs(n[1]) and abs(n[0]) < abs(n[2]) else (1 if abs(n[1]) < abs(n[2]) else 2)
        a = np.zeros(3)
        a[k] = 1.0
        e1 = np.cross(a, n)
        e1 /= np.sqrt(np.dot(e1, e1))
        e2 = np.cross(n, e1)
        first, last = indptr[v], indptr[v + 1]
        near = last - first
        # Nine unknowns of a cubic through the vertex, five of a quadratic, two of a plane: as many as there are points for.
        unknowns = 9 if near >= 11 else (5 if near >= 6 else 2)
        rows = np.empty((near, unknowns))
        height = np.empty(near)
        size = 0.0
        for r in range(near):
            d = points[neighbours[first + r]] - points[v]
            size = max(size, np.sqrt(np.dot(d, d)))
        for r in range(near):
            d = (points[neighbours[first + r]] - points[v]) / size
            x, y = np.dot(d, e1), np.dot(d, e2)
            height[r] = np.dot(d, n)
            rows[r, 0], rows[r, 1] = x, y
            if unknowns >= 5:
                rows[r, 2], rows[r, 3], rows[r, 4] = 0.5 * x * x, x * y, 0.5 * y * y
            if unknowns >= 9:
                rows[r, 5], rows[r, 6], rows[r, 7], rows[r, 8] = x * x * x, x * x * y, x * y * y, y * y * y
        fit = np.linalg.lstsq(rows, height)[0]
        p, q = fit[0], fit[1]
        slope = np.sqrt(1.0 + p * p + q * q)
        for i in range(3):
            unit[v, i] = (n[i] - p * e1[i] - q * e2[i]) / slope
        bent[v] = 0.0
        if unknowns >= 5:
            # Shape operator of a graph: second form over first form; a crown (z down) counts positive.
            L, M, N = -fit[2] / slope / size, -fit[3] / slope / size, -fit[4] / slope / size
            E, F, G = 1.0 + p * p, p * q, 1.0 + q * q
            det = E * G - F * F
            mean = 0.5 * (E * N - 2.0 * F * M + G * L) / det
            gauss = (L * N - M * M) / det
            root = np.sqrt(max(mean * mean - gauss, 0.0))
            bent[v, 0], bent[v, 1] = mean + root, mean - root
    return unit, bent


def _cleaned(
    points: Reals, faces: Indices, normals: Reals | None
) -> tuple[Reals, Indices, Reals | None, list[str]]:
    """Merged vertices, triangles with an area, each once; and what was done."""
    mended = []
    size = float(np.ptp(points, axis=0).max()) if len(points) else 0.0
    if size > 0.0:
        grid = np.round(points / (_SAME * size)).astype(np.int64)
        _, first, same = np.unique(grid, axis=0, return_index=True, return_inverse=True)
        same = same.ravel()
        order = np.argsort(first)
        rank = np.empty_like(order)
        rank[order] = np.arange(len(order))
        if len(first) < len(points):
            mended.append(f"{len(points) - len(first)} vertices lay on others and were merged")
        points, faces = points[first[order]], rank[same][faces]
        normals = None if normals is None else normals[first[order]]
    area = np.linalg.norm(_area_vectors(points, faces), axis=1)
    thin = area <= _FLAT * size * size
    if thin.any():
        mended.append(f"{int(thin.sum())} triangles without area were dropped")
        faces = faces[~thin]
    _, once = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)
    if len(once) < len(faces):
        mended.append(f"{len(faces) - len(once)} triangles given twice were dropped")
        faces = faces[np.sort(once)]
    used = np.zeros(len(points), dtype=bool)
    used[faces.ravel()] = True
    if not used.all():
        mended.append(f"{int((~used).sum())} vertices without triangle were dropped")
        faces = (np.cumsum(used) - 1)[faces]
        points = points[used]
        normals = None if normals is None else normals[used]
    return points, faces, normals, mended


def _refuse_pieces(points: Reals, faces: Indices, where: str) -> None:
    edges = np.sort(_directed_edges(faces), axis=1)
    pairs, counts = np.unique(edges, axis=0, return_counts=True)
    if (counts > 2).any():
        a = pairs[np.argmax(counts > 2), 0]
        raise InputError(
            f"{int((counts > 2).sum())} edges belong to more than two triangles, the first at {points[a].round(4).tolist()}",
            where=where,
            remedy="Remove the faces inside or behind the surface and export it again.",
        )
    adjacency = _adjacency(faces, len(points))
    pieces, label = connected_components(adjacency, directed=False)
    if pieces > 1:
        sizes = np.sort(np.bincount(label[faces[:, 0]], minlength=pieces))[::-1]
        raise InputError(
            f"the mesh has {pieces} separate pieces of {', '.join(str(s) for s in sizes[:5])} triangles",
            where=where,
            remedy="Export one connected surface, or join its edges first.",
        )
    if (counts == 2).all():
        raise InputError(
            "the surface is closed, like a solid's skin: it has no edge at which rods could end",
            where=where,
            remedy="Export its upper face only.",
        )


def _oriented(faces: Indices, count: int, where: str) -> Indices:
    """Faces turned so that neighbours pass their common edge in opposite directions, from the first face outwards."""
    edges = _directed_edges(faces)
    owner = np.tile(np.arange(len(faces)), 3)
    low, high = edges.min(axis=1), edges.max(axis=1)
    order = np.lexsort((high, low))
    same = (low[order][1:] == low[order][:-1]) & (high[order][1:] == high[order][:-1])
    first, second = order[:-1][same], order[1:][same]
    clash = edges[first, 0] == edges[second, 0]
    if not clash.any():
        return faces
    ends = np.concatenate([owner[first], owner[second]]), np.concatenate([owner[second], owner[first]])
    graph = sp.csr_array((np.where(np.tile(clash, 2), 2.0, 1.0), ends), shape=(len(faces), len(faces)))
    visited, parent = breadth_first_order(graph, 0, directed=False)
    turned = np.zeros(len(faces), dtype=bool)
    link = graph.tolil()
    for face in visited[1:]:
        turned[face] = turned[parent[face]] ^ (link[parent[face], face] == 2.0)
    if (turned[owner[first]] ^ turned[owner[second]] ^ clash).any():
        raise InputError("the surface has one side only, like a Möbius strip", where=where, remedy="Check the faces.")
    result = faces.copy()
    result[turned] = result[turned][:, ::-1]
    return result


def _rough_normals(points: Reals, faces: Indices) -> Reals:
    """Unit vertex normals (v, 3): triangle normals weighted by the angle at the vertex."""
    corner = points[faces]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    total = np.zeros_like(points)
    for k in range(3):
        a, b = corner[:, (k + 1) % 3] - corner[:, k], corner[:, (k + 2) % 3] - corner[:, k]
        cosine = np.sum(a * b, axis=1) / (np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1))
        np.add.at(total, faces[:, k], np.arccos(np.clip(cosine, -1.0, 1.0))[:, None] * normal)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return total / np.maximum(length, 1e-300)


def _area_vectors(points: Reals, faces: Indices) -> Reals:
    corner = points[faces]
    return np.asarray(0.5 * np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]))


def _directed_edges(faces: Indices) -> Indices:
    """Edges (3 t, 2): of all triangles their first, then their second, then their third."""
    return np.vstack([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])


def _adjacency(faces: Indices, count: int) -> sp.csr_array:
    edges = _directed_edges(faces)
    graph = sp.csr_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(count, count))
    return sp.csr_array((graph + graph.T) > 0).astype(float)
