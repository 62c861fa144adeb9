"""Closest points on the smooth surface over a triangle mesh.

Between its vertices the surface is a cubic patch over each triangle that interpolates vertices and normals (Vlachos et al. 2001,
"curved PN triangles"), with the normals N interpolated linearly. The foot of a point x solves

    x = p(u, v) + δ N(u, v)

(Kobbelt's Phong projection): unlike the closest point on facets it moves continuously as x crosses from one triangle to the
next, since N does. Newton's method finds it from the closest point on the facets, which a bounding-volume tree gives, going over
to the neighbouring triangle where (u, v) leaves its own.

Past the edge the surface goes on as extend.py makes it, as far as was asked for; beyond that, in the tangent plane at the nearest
point of the outermost edge.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shellform.arrays import Flags, Indices, Reals
from shellform.compiled import njit, prange
from shellform.surface.extend import extended
from shellform.surface.target import Surface

_LEAF = 4  # triangles in a leaf of the tree


@dataclass(frozen=True)
class Foot:
    """Feet of k points: `point` (k, 3), m; unit `normal` (k, 3), upwards; signed `distance` (k,), m, along it; the `triangle` (k,)
    on which the foot lies; whether it lies `past` (k,) the surface's edge."""

    point: Reals
    normal: Reals
    distance: Reals
    triangle: Indices
    past: Flags


class Locator:
    """Closest-point queries on one surface and, up to `reach` m past its edge, on its extension: its tree, its patches and its
    neighbourhoods, built once."""

    def __init__(self, surface: Surface, reach: float = 0.0) -> None:
        self._own = len(surface.triangles)
        rim = np.argwhere(_neighbours(surface.triangles, len(surface.vertices)) < 0)
        ends = [surface.triangles[rim[:, 0], (rim[:, 1] + k) % 3] for k in (0, 1)]
        self._rim = np.ascontiguousarray(np.stack([surface.vertices[each] for each in ends], axis=1))
        whole = extended(surface, reach) if reach > 0.0 else surface
        self._corner = np.ascontiguousarray(whole.vertices[whole.triangles])
        self._boxes, self._links, self._order = _tree(self._corner)
        self._control = _patches(whole)
        self._normal = np.ascontiguousarray(whole.normals[whole.triangles])
        self._across = _neighbours(whole.triangles, len(whole.vertices))

    def facet(self, points: Reals) -> tuple[Indices, Reals, Reals]:
        """The triangle (k,), the exact closest point (k, 3) on the flat facets and its distance (k,) of points (k, 3)."""
        query = np.ascontiguousarray(points, dtype=float)
        triangle = np.zeros(len(query), dtype=np.int64)
        closest = np.empty((len(query), 3))
        _nearest(query, self._corner, self._boxes, self._links, self._order, triangle, closest)
        return triangle, closest, np.linalg.norm(query - closest, axis=1)

    def foot(self, points: Reals) -> Foot:
        """The feet of points (k, 3) on the smooth surface and its extension."""
        query = np.ascontiguousarray(points, dtype=float)
        triangle, closest, _ = self.facet(query)
        point, normal, distance = np.empty_like(query), np.empty_like(query), np.empty(len(query))
        mesh = self._corner, self._control, self._normal, self._across
        _feet(query, triangle, closest, *mesh, point, normal, distance)
        return Foot(point, normal, distance, triangle, triangle >= self._own)

    def past_edge(self, foot: Foot) -> Reals:
        """Signed distance (k,), m, of the feet from the surface's edge: positive past it, negative on the surface."""
        return np.where(foot.past, 1.0, -1.0) * _to_segments(foot.point, self._rim)


def _neighbours(faces: Indices, count: int) -> Indices:
    """The triangle (t, 3) across the edge from corner k to corner k + 1, -1 at the surface's edge."""
    a, b = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    key, back = a * count + b, b * count + a
    order = np.argsort(key)
    place = np.minimum(np.searchsorted(key[order], back), len(key) - 1)
    found = key[order][place] == back
    return np.where(found, order[place] // 3, -1).reshape(-1, 3)


def _patches(surface: Surface) -> Reals:
    """Control points (t, 10, 3) of the cubic patches: the corners 300, 030, 003, then 210, 120, 021, 012, 102, 201, and 111."""
    corner, normal = surface.vertices[surface.triangles], surface.normals[surface.triangles]

    def toward(i: int, j: int) -> Reals:
        step = corner[:, j] - corner[:, i]
        return np.asarray(corner[:, i] + (step - np.sum(step * normal[:, i], axis=1, keepdims=True) * normal[:, i]) / 3.0)

    edge = [toward(0, 1), toward(1, 0), toward(1, 2), toward(2, 1), toward(2, 0), toward(0, 2)]
    middle = sum(edge) / 6.0
    centre = middle + 0.5 * (middle - corner.mean(axis=1))
    return np.ascontiguousarray(np.stack([corner[:, 0], corner[:, 1], corner[:, 2], *edge, centre], axis=1))


def _tree(corner: Reals) -> tuple[Reals, Indices, Indices]:
    """A bounding-volume tree by median splits: boxes (b, 2, 3); links (b, 2), the two children, or for a leaf minus one less its
    first place in the order and the place after its last; the order (t,) of the triangles."""
    low, high = corner.min(axis=1), corner.max(axis=1)
    middle = 0.5 * (low + high)
    order = np.arange(len(corner))
    boxes: list[Reals] = []
    links: list[tuple[int, int]] = []
    work = [(0, len(corner), -1, 0)]
    while work:
        first, last, parent, side = work.pop()
        mine = order[first:last]
        index = len(boxes)
        boxes.append(np.stack([low[mine].min(axis=0), high[mine].max(axis=0)]))
        links.append((-1 - first, last))
        if parent >= 0:
            pair = list(links[parent])
            pair[side] = index
            links[parent] = (pair[0], pair[1])
        if last - first > _LEAF:
            axis = int(np.argmax(np.ptp(middle[mine], axis=0)))
            half = (last - first) // 2
            order[first:last] = mine[np.argpartition(middle[mine, axis], half)]
            links[index] = (0, 0)
            work += [(first, first + half, index, 0), (first + half, last, index, 1)]
    return np.array(boxes), np.array(links), order


@njit(cache=True, inline="always")
def _dot(a, b):  # type: ignore[no-untyped-def]
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True)
def _on_triangle(p, a, b, c, out):  # type: ignore[no-untyped-def]
    """Writes the closest point of triangle abc to p into out and returns the squared distance (Ericson 2005, 5.1.5)."""
    ab, ac, ap = b - a, c - a, p - a
    d1, d2 = _dot(ab, ap), _dot(ac, ap)
    bp = p - b
    d3, d4 = _dot(ab, bp), _dot(ac, bp)
    cp = p - c
    d5, d6 = _dot(ab, cp), _dot(ac, cp)
    vc, vb, va = d1 * d4 - d3 * d2, d5 * d2 - d1 * d6, d3 * d6 - d5 * d4
    if d1 <= 0.0 and d2 <= 0.0:
        v, w = 0.0, 0.0
    elif d3 >= 0.0 and d4 <= d3:
        v, w = 1.0, 0.0
    elif vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        v, w = d1 / (d1 - d3), 0.0
    elif d6 >= 0.0 and d5 <= d6:
        v, w = 0.0, 1.0
    elif vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        v, w = 0.0, d2 / (d2 - d6)
    elif va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        w = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        v = 1.0 - w
    else:
        scale = 1.0 / (va + vb + vc)
        v, w = vb * scale, vc * scale
    total = 0.0
    for i in range(3):
        out[i] = a[i] + v * ab[i] + w * ac[i]
        total += (p[i] - out[i]) ** 2
    return total


@njit(cache=True)
def _box_distance(p, box):  # type: ignore[no-untyped-def]
    total = 0.0
    for i in range(3):
        gap = max(box[0, i] - p[i], p[i] - box[1, i], 0.0)
        total += gap * gap
    return total


@njit(cache=True, parallel=True)
def _nearest(points, corner, boxes, links, order, triangle, closest):  # type: ignore[no-untyped-def]
    for k in prange(points.shape[0]):
        p = points[k]
        best = np.inf
        here = np.empty(3)
        stack = np.empty(128, dtype=np.int64)
        bound = np.empty(128)
        stack[0], bound[0] = 0, _box_distance(p, boxes[0])
        depth = 1
        while depth > 0:
            depth -= 1
            if bound[depth] >= best:
                continue
            node = stack[depth]
            if links[node, 0] < 0:
                for place in range(-1 - links[node, 0], links[node, 1]):
                    t = order[place]
                    gap = _on_triangle(p, corner[t, 0], corner[t, 1], corner[t, 2], here)
                    if gap < best or (gap == best and t < triangle[k]):
                        best = gap
                        triangle[k] = t
                        closest[k] = here
                continue
            left, right = links[node, 0], links[node, 1]
            to_left, to_right = _box_distance(p, boxes[left]), _box_distance(p, boxes[right])
            near, far = (left, right) if to_left <= to_right else (right, left)
            stack[depth], bound[depth] = far, max(to_left, to_right)
            stack[depth + 1], bound[depth + 1] = near, min(to_left, to_right)
            depth += 2


@njit(cache=True)
def _patch(C, u, v, p, pu, pv):  # type: ignore[no-untyped-def]
    """The cubic at barycentric (w = 1 - u - v, u, v) of the corners 0, 1, 2, and its derivatives by u and v."""
    w = 1.0 - u - v
    for i in range(3):
        # Quadratic coefficients towards each corner (de Casteljau's first two steps, written out).
        a = w * w * C[0, i] + 2 * w * u * C[3, i] + 2 * w * v * C[8, i] + u * u * C[4, i] + 2 * u * v * C[9, i] + v * v * C[7, i]
        b = w * w * C[3, i] + 2 * w * u * C[4, i] + 2 * w * v * C[9, i] + u * u * C[1, i] + 2 * u * v * C[5, i] + v * v * C[6, i]
        c = w * w * C[8, i] + 2 * w * u * C[9, i] + 2 * w * v * C[7, i] + u * u * C[5, i] + 2 * u * v * C[6, i] + v * v * C[2, i]
        p[i] = w * a + u * b + v * c
        pu[i] = 3.0 * (b - a)
        pv[i] = 3.0 * (c - a)


@njit(cache=True)
def _solve3(A, b, x):  # type: ignore[no-untyped-def]
    """Cramer's rule for columns A (3, 3); False where they are nearly dependent."""
    c0, c1, c2 = A[:, 0], A[:, 1], A[:, 2]
    n12 = np.cross(c1, c2)
    det = _dot(c0, n12)
    size = np.sqrt(_dot(c0, c0) * _dot(c1, c1) * _dot(c2, c2))
    if not abs(det) > 1e-9 * size:
        return False
    x[0] = _dot(b, n12) / det
    x[1] = _dot(c0, np.cross(b, c2)) / det
    x[2] = _dot(c0, np.cross(c1, b)) / det
    return True


@njit(cache=True)
def _flat_coordinates(p, corner):  # type: ignore[no-untyped-def]
    """(u, v) of the projection of p to the plane of the triangle."""
    e1, e2, d = corner[1] - corner[0], corner[2] - corner[0], p - corner[0]
    a, b, c = _dot(e1, e1), _dot(e1, e2), _dot(e2, e2)
    f, g = _dot(d, e1), _dot(d, e2)
    det = a * c - b * b
    return (f * c - g * b) / det, (g * a - f * b) / det


@njit(cache=True, parallel=True)
def _feet(points, triangle, closest, corner, control, normals, across, point, normal, distance):  # type: ignore[no-untyped-def]
    for k in prange(points.shape[0]):
        x = points[k]
        t = triangle[k]
        found = _inside(x, t, closest[k], corner, control, normals, across, point[k], normal[k])
        if found >= 0:
            triangle[k] = found
        else:
            # -1 - (3 t + edge): past that piece of the surface's edge
            code = -1 - found
            _beyond(x, code // 3, code % 3, corner, control, normals, point[k], normal[k])
            triangle[k] = code // 3
        distance[k] = _dot(x - point[k], normal[k])


@njit(cache=True)
def _inside(x, t, start, corner, control, normals, across, point, normal):  # type: ignore[no-untyped-def]
    """The foot on the surface; returns its triangle, or -1 - (3 t + edge) where it lies past that edge piece."""
    p, pu, pv, step = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    A = np.empty((3, 3))
    u, v = _flat_coordinates(start, corner[t])
    for _walk in range(40):
        n0, n1, n2 = normals[t, 0], normals[t, 1], normals[t, 2]
        N = (1.0 - u - v) * n0 + u * n1 + v * n2
        _patch(control[t], u, v, p, pu, pv)
        delta = _dot(x - p, N) / _dot(N, N)
        good = True
        for _ in range(12):
            residual = x - p - delta * N
            A[:, 0] = pu + delta * (n1 - n0)
            A[:, 1] = pv + delta * (n2 - n0)
            A[:, 2] = N
            if not _solve3(A, residual, step):
                good = False
                break
            longest = max(abs(step[0]), abs(step[1]))
            share = min(1.0, 0.5 / longest) if longest > 0.0 else 1.0
            u += share * step[0]
            v += share * step[1]
            delta += share * step[2]
            # A patch makes no sense far outside its triangle: go over to the neighbour first.
            if min(u, v, 1.0 - u - v) < -0.6:
                break
            N = (1.0 - u - v) * n0 + u * n1 + v * n2
            _patch(control[t], u, v, p, pu, pv)
            if longest < 1e-13:
                break
        w = 1.0 - u - v
        least = min(u, v, w)
        if not good or not np.isfinite(least):
            # Beyond the centre of curvature there is no unique foot: the closest point of the facets stands in.
            u, v = _flat_coordinates(start, corner[t])
            u, v = min(max(u, 0.0), 1.0), min(max(v, 0.0), 1.0)
            N = (1.0 - u - v) * n0 + u * n1 + v * n2
            _patch(control[t], u, v, p, pu, pv)
            least = 0.0
        if least >= -1e-9:
            size = np.sqrt(_dot(N, N))
            point[:] = p
            normal[:] = N / size
            return t
        # The edge opposite the corner with the most negative coordinate: w -> edge 1 (1-2), u -> edge 2 (2-0), v -> edge 0.
        edge = 1 if least == w else (2 if least == u else 0)
        if across[t, edge] < 0:
            # Past another edge too? Then the neighbour across that one may hold the foot.
            other = -1
            second = -1e-6
            if edge != 1 and w < second and across[t, 1] >= 0:
                other, second = 1, w
            if edge != 2 and u < second and across[t, 2] >= 0:
                other, second = 2, u
            if edge != 0 and v < second and across[t, 0] >= 0:
                other, second = 0, v
            if other < 0 or _walk > 20:
                return -1 - (3 * t + edge)
            edge = other
        here = p.copy()
        t = across[t, edge]
        u, v = _flat_coordinates(here, corner[t])
        u, v = min(max(u, 0.0), 1.0), min(max(v, 0.0), 1.0)
        if u + v > 1.0:
            u, v = u / (u + v), v / (u + v)
    # Going in circles at a vertex: the last triangle's nearest corner of parameters serves.
    N = (1.0 - u - v) * normals[t, 0] + u * normals[t, 1] + v * normals[t, 2]
    _patch(control[t], u, v, p, pu, pv)
    point[:] = p
    normal[:] = N / np.sqrt(_dot(N, N))
    return t


@njit(cache=True)
def _beyond(x, t, edge, corner, control, normals, point, normal):  # type: ignore[no-untyped-def]
    """The foot in the tangent plane at the point of the edge piece nearest to x."""
    a, b = corner[t, edge], corner[t, (edge + 1) % 3]
    s = min(max(_dot(x - a, b - a) / _dot(b - a, b - a), 0.0), 1.0)
    weight = np.zeros(3)
    weight[edge], weight[(edge + 1) % 3] = 1.0 - s, s
    p, pu, pv = np.empty(3), np.empty(3), np.empty(3)
    _patch(control[t], weight[1], weight[2], p, pu, pv)
    N = weight[0] * normals[t, 0] + weight[1] * normals[t, 1] + weight[2] * normals[t, 2]
    N /= np.sqrt(_dot(N, N))
    height = _dot(x - p, N)
    for i in range(3):
        normal[i] = N[i]
        point[i] = x[i] - height * N[i]


@njit(cache=True, parallel=True)
def _to_segments(points, ends):  # type: ignore[no-untyped-def]
    result = np.empty(points.shape[0])
    for k in prange(points.shape[0]):
        best = np.inf
        for e in range(ends.shape[0]):
            a, d = ends[e, 0], ends[e, 1] - ends[e, 0]
            s = min(max(_dot(points[k] - a, d) / _dot(d, d), 0.0), 1.0)
            gap = points[k] - a - s * d
            best = min(best, _dot(gap, gap))
        result[k] = np.sqrt(best)
    return result
