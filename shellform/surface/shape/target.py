"""The target surface: triangles with a normal at every vertex.

Triangles are only the skeleton: between them the surface is taken as smooth (locate.py), so that what matters
about the mesh are its vertices and their normals. Where a CAD kernel doesn't give these, they come from local
jets (jets.py).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse.csgraph import connected_components

from shellform.arrays import Indices, Reals, Record, indices, reals
from shellform.compiled import njit
from shellform.errors import InputError, how_many
from shellform.plan_rectangle import sides_in_plan
from shellform.quantities import extents, rounded
from shellform.surface.shape.jets import jets
from shellform.surface.shape.triangles import (
    adjacency,
    area_vectors,
    counted_edges,
    triangle_areas,
    used_points,
)

_SAME = 1e-9  # of the size: vertices nearer than that are one
ON_GROUND = 0.02  # of the rise: an edge within it of the lowest level stands on the ground
_FLAT = 1e-12  # of the squared size: triangles smaller than that have no area


@dataclass(frozen=True, eq=False)
class Surface(Record):
    """`vertices` (v, 3), m; `triangles` (t, 3), all turned the same way; unit `normals` (v, 3) to the upper
    side, on which the concrete is poured; `source`, the file or script it came from; `mended`, a sentence for
    each defect that was mended."""

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

    def __repr__(self) -> str:
        size = " × ".join(f"{each:.3g}" for each in extents(self.size))
        return (
            f"Surface({len(self.triangles)} triangles, {size} m{f', {self.source}' if self.source else ''})"
        )

    @cached_property
    def area(self) -> float:
        """m², of the triangles."""
        return float(triangle_areas(self.vertices, self.triangles).sum())

    @property
    def size(self) -> Reals:
        """Extents (3,), m, along x, y and z."""
        return np.asarray(np.ptp(self.vertices, axis=0))

    @cached_property
    def plan_sides(self) -> Reals:
        """The sides (2,), m, of the smallest rectangle round its plan, nearest to x first."""
        return reals("plan_sides", sides_in_plan(self.vertices), (2,))

    @property
    def longer_side(self) -> float:
        """The longer side, m, of its plan, however that is turned."""
        return float(self.plan_sides.max())

    @cached_property
    def boundary(self) -> tuple[Indices, ...]:
        """The closed loops of vertices round the surface and round its holes, the longest, in metres,
        first.
        """
        across = across_edges(self.triangles, len(self.vertices))
        at = np.argwhere(across < 0)
        rim = np.column_stack([self.triangles[at[:, 0], (at[:, 1] + k) % 3] for k in (0, 1)])
        loops = sorted(closed_loops(rim), key=lambda loop: -length_round(self.vertices[loop]))
        return tuple(indices("boundary", loop, (None,), below=len(self.vertices)) for loop in loops)

    @cached_property
    def _curvature(self) -> Reals:
        return reals("curvature", jets(self.vertices, self.triangles, self.normals)[1], (None, 2))

    @cached_property
    def _width(self) -> float:
        turns = np.linspace(0.0, np.pi, 180, endpoint=False)
        along = self.vertices[:, :2] @ np.vstack([np.cos(turns), np.sin(turns)])
        return float(np.ptp(along, axis=0).min())

    @property
    def holes(self) -> int:
        """The number of openings inside the edge."""
        return len(self.boundary) - 1


def make_surface(
    vertices: ArrayLike, triangles: ArrayLike, *, normals: ArrayLike | None = None, source: str = ""
) -> Surface:
    """The surface of a triangle mesh, `vertices` (v, 3), m, and `triangles` (t, 3), cleaned and turned
    upwards.

    Vertices at one place are merged, unused ones and triangles without area or given twice are dropped
    (`mended` says so). `normals` (v, 3) where the source knows them; else, and where they are zero, they are
    estimated. Raises InputError for an empty mesh, edges with more than two triangles, several separate
    pieces, a closed surface, and one with a single side.
    """
    points = reals("vertices", vertices, (None, 3))
    faces = indices("triangles", triangles, (None, 3), below=max(len(points), 1))
    where = source or "surface"
    given = None if normals is None else reals("normals", normals, (len(points), 3))
    points, faces, given, mended = _cleaned(points, faces, given)
    if not len(faces):
        raise InputError(
            "the mesh has no triangle with an area", where=where, remedy="Export the surface as a mesh."
        )
    _refuse_pieces(points, faces, where)
    faces = _oriented(faces, len(points), where)
    up = area_vectors(points, faces).sum(axis=0)
    if up[2] < 0.0:
        faces = faces[:, ::-1].copy()
    rough = rough_normals(points, faces)
    if given is None:
        unit = jets(points, faces, rough)[0]
    else:
        length = np.linalg.norm(given, axis=1, keepdims=True)
        unit = given / np.where(length > 0.0, length, 1.0)
        unit = unit * np.where(np.sum(unit * rough, axis=1, keepdims=True) < 0.0, -1.0, 1.0)
        if not length.all():
            unit = np.where(length > 0.0, unit, jets(points, faces, rough)[0])
    return Surface(points, faces, unit, source, tuple(mended))


def curvature(surface: Surface) -> Reals:
    """Principal curvatures (v, 2), 1/m, positive where the surface bends away from its upper side."""
    return surface._curvature


def largest_curvature(surface: Surface) -> float:
    """The largest principal curvature, 1/m, but for the two hundredth of the inner vertices where it is
    largest: mesh noise.

    Vertices at the edge don't count, where jets know one side only.
    """
    bent = np.abs(curvature(surface)).max(axis=1)
    inner = np.ones(len(bent), dtype=bool)
    inner[np.concatenate(surface.boundary)] = False
    return float(np.percentile(bent[inner], 99.5)) if inner.any() else 0.0


def sharpest_bend(surface: Surface) -> tuple[int, float]:
    """The vertex inside its edge at which the surface is bent most, mesh noise included, and to what radius,
    m."""
    bent = np.abs(curvature(surface)).max(axis=1)
    bent[np.concatenate(surface.boundary)] = 0.0
    most = int(np.argmax(bent))
    return most, 1.0 / max(float(bent[most]), 1e-12)


def width(surface: Surface) -> float:
    """The least extent, m, of its plan in any direction, to within a hundredth of the largest: what a shell
    spans."""
    return surface._width


def _cleaned(
    points: Reals, faces: Indices, normals: Reals | None
) -> tuple[Reals, Indices, Reals | None, list[str]]:
    """Merged vertices, triangles with an area, each once; and what was done."""
    mended = []
    size = float(np.ptp(points, axis=0).max()) if len(points) else 0.0
    if size > 0.0:
        grid = np.round(points / (_SAME * size)).astype(np.int64)
        first, same = _distinct(grid)
        order = np.argsort(first)
        rank = np.empty_like(order)
        rank[order] = np.arange(len(order))
        if len(first) < len(points):
            mended.append(
                how_many(
                    len(points) - len(first),
                    "vertex lay on another and was merged",
                    "vertices lay on others and were merged",
                )
            )
        points, faces = points[first[order]], rank[same][faces]
        normals = None if normals is None else normals[first[order]]
    area = triangle_areas(points, faces)
    thin = area <= _FLAT * size * size
    if thin.any():
        mended.append(
            how_many(
                int(thin.sum()), "triangle without area was dropped", "triangles without area were dropped"
            )
        )
        faces = faces[~thin]
    once, _ = _distinct(np.sort(faces, axis=1))
    if len(once) < len(faces):
        mended.append(
            how_many(
                len(faces) - len(once),
                "triangle given twice was dropped",
                "triangles given twice were dropped",
            )
        )
        faces = faces[np.sort(once)]
    used, among_used = used_points(faces, len(points))
    if not used.all():
        mended.append(
            how_many(
                int((~used).sum()),
                "vertex without triangle was dropped",
                "vertices without triangle were dropped",
            )
        )
        points, faces = points[used], among_used
        normals = None if normals is None else normals[used]
    return points, faces, normals, mended


def _refuse_pieces(points: Reals, faces: Indices, where: str) -> None:
    edges, counts = counted_edges(faces)
    if (counts > 2).any():
        a = edges[np.argmax(counts > 2), 0]
        raise InputError(
            f"{how_many(int((counts > 2).sum()), 'edge belongs', 'edges belong')} to more than two triangles, the first at "
            f"{rounded(points[a], 4)}",
            where=where,
            remedy="Remove the faces inside or behind the surface and export it again.",
        )
    pieces, label = connected_components(adjacency(faces, len(points)), directed=False)
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
    """Faces turned so that neighbours pass their common edge in opposite directions, from the first face
    outwards.
    """
    turned = np.zeros(len(faces), dtype=np.bool_)
    if not _turn(faces, across_edges(faces, count), turned):
        raise InputError(
            "the surface has one side only, like a Möbius strip", where=where, remedy="Check the faces."
        )
    if not turned.any():
        return faces
    result = faces.copy()
    result[turned] = result[turned][:, ::-1]
    return result


@njit(cache=True)
def _turn(faces, across, turned):  # type: ignore[no-untyped-def]
    """Writes which faces (t,) are to be turned over; False where that can't be done."""
    seen = np.zeros(len(faces), dtype=np.bool_)
    queue = np.empty(len(faces), dtype=np.int64)
    queue[0], head, tail = 0, 0, 1
    seen[0] = True
    while head < tail:
        t = queue[head]
        head += 1
        for k in range(3):
            other = across[t, k]
            if other < 0:
                continue
            a, b = faces[t, k], faces[t, (k + 1) % 3]
            clash = False
            for j in range(3):
                if faces[other, j] == a and faces[other, (j + 1) % 3] == b:
                    clash = True
            wanted = turned[t] != clash
            if not seen[other]:
                seen[other], turned[other] = True, wanted
                queue[tail] = other
                tail += 1
            elif turned[other] != wanted:
                return False
    return True


def rough_normals(points: Reals, faces: Indices) -> Reals:
    """Unit vertex normals (v, 3): triangle normals weighted by the angle at the vertex."""
    corner, normal = points[faces], area_vectors(points, faces)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    total = np.zeros_like(points)
    for k in range(3):
        a, b = corner[:, (k + 1) % 3] - corner[:, k], corner[:, (k + 2) % 3] - corner[:, k]
        cosine = np.sum(a * b, axis=1) / (np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1))
        share = np.arccos(np.clip(cosine, -1.0, 1.0))[:, None] * normal
        for i in range(3):
            total[:, i] += np.bincount(faces[:, k], share[:, i], len(points))
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return total / np.maximum(length, 1e-300)


def _distinct(rows: Indices) -> tuple[Indices, Indices]:
    """The places of the first of each kind of rows (k, 3), and for each row the number of its kind."""
    order = np.lexsort(rows.T[::-1])
    new = np.ones(len(rows), dtype=bool)
    new[1:] = (np.diff(rows[order], axis=0) != 0).any(axis=1)
    kind = np.empty(len(rows), dtype=np.int64)
    kind[order] = np.cumsum(new) - 1
    return order[new], kind


def length_round(loop: Reals) -> float:
    """How long a closed line through points (n, 3) is, m."""
    return float(np.linalg.norm(np.roll(loop, -1, axis=0) - loop, axis=1).sum())


def closed_loops(edges: Indices) -> list[Indices]:
    """The closed loops of vertices along directed edges (e, 2), one of which leaves every vertex on them."""
    following = dict(zip(edges[:, 0].tolist(), edges[:, 1].tolist(), strict=True))
    loops = []
    while following:
        start, here = following.popitem()
        loop = [start]
        while here != start:
            loop.append(here)
            here = following.pop(here)
        loops.append(np.array(loop))
    return loops


def across_edges(faces: Indices, count: int) -> Indices:
    """The triangle (t, 3) across the edge from corner k to corner k + 1, -1 at the surface's edge; of `count`
    vertices.
    """
    a, b = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    low, high = np.minimum(a, b), np.maximum(a, b)
    key = low * count + high
    order = np.argsort(key, kind="stable")
    pair = np.flatnonzero(key[order][1:] == key[order][:-1])
    first, second = order[pair], order[pair + 1]
    result = np.full(len(key), -1)
    result[first], result[second] = second // 3, first // 3
    return result.reshape(-1, 3)
