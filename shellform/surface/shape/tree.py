"""Exact closest points on triangles, by a tree of bounding boxes.

The tree halves its triangles at the median of their middles along the longest side of the box of the middles.
A query goes down to the nearer child first and leaves out boxes farther away than the best triangle found.
Queries are sorted along Morton's curve, so that each begins with the triangle of one nearby: most boxes are
then left out at once. Of triangles equally near the one with the lowest number counts, whatever the order of
the queries.
"""

from __future__ import annotations

import numpy as np

from shellform.arrays import Indices, Reals, read_only
from shellform.compiled import njit, prange

_LEAF = 4  # triangles in a leaf
FEW = 1000  # queries, which are sooner answered than divided among processors
_CHUNK = 128  # queries in a row on one processor
_ROUNDING = 1.0 + 1e-12  # distances to a box and to a triangle in its face differ in the last bits


class Tree:
    """Of triangles `corner` (t, 3, 3), m. A segment is a triangle whose last corner is its second."""

    def __init__(self, corner: Reals) -> None:
        self._order, self._boxes, self._links = _build(np.ascontiguousarray(corner))
        self._sorted = np.ascontiguousarray(corner[self._order])

    def nearest(self, points: Reals) -> tuple[Indices, Reals, Reals]:
        """The triangle (k,), the closest point (k, 3) on it and the distance (k,) of each of points (k,
        3).
        """
        query = read_only(np.ascontiguousarray(points, dtype=float))
        triangle, closest, gap = (
            np.empty(len(query), dtype=np.int64),
            np.empty_like(query),
            np.empty(len(query)),
        )
        search = _search if len(query) > FEW else _search_run
        search(
            query,
            along_curve(query),
            self._sorted,
            self._order,
            self._boxes,
            self._links,
            triangle,
            closest,
            gap,
        )
        return triangle, closest, np.sqrt(gap)


def along_curve(points: Reals) -> Indices:
    """The order (k,) of points (k, 3) along Morton's curve through their box."""
    if len(points) < 3:
        return np.arange(len(points))
    low, extent = points.min(axis=0), float(np.ptp(points, axis=0).max())
    return np.asarray(np.argsort(_morton(points, low, 1023.0 / max(extent, 1e-300)), kind="stable"))


@njit(cache=True)
def _morton(points, low, scale):  # type: ignore[no-untyped-def]
    code = np.empty(points.shape[0], dtype=np.int64)
    for k in range(points.shape[0]):
        total = 0
        for i in range(3):
            x = int((points[k, i] - low[i]) * scale)
            for bit in range(10):
                total |= ((x >> bit) & 1) << (3 * bit + i)
        code[k] = total
    return code


@njit(cache=True)
def _split(key, order, first, last, half):  # type: ignore[no-untyped-def]
    """Hoare's selection: rearranges order[first:last] so that places before `half` hold the smaller keys."""
    low, high = first, last - 1
    while low < high:
        pivot = key[order[(low + high) // 2]]
        i, j = low, high
        while i <= j:
            while key[order[i]] < pivot:
                i += 1
            while key[order[j]] > pivot:
                j -= 1
            if i <= j:
                order[i], order[j] = order[j], order[i]
                i += 1
                j -= 1
        if half <= j:
            high = j
        elif half >= i:
            low = i
        else:
            return


@njit(cache=True)
def _build(corner):  # type: ignore[no-untyped-def]
    """The order (t,) of the triangles, boxes (b, 6) as low and high, and links (b, 2): the two children, or
    for a leaf minus one less its first place in the order and the place after its last."""
    count = corner.shape[0]
    low, high, middle = np.empty((count, 3)), np.empty((count, 3)), np.empty((3, count))
    for t in range(count):
        for i in range(3):
            low[t, i] = min(corner[t, 0, i], corner[t, 1, i], corner[t, 2, i])
            high[t, i] = max(corner[t, 0, i], corner[t, 1, i], corner[t, 2, i])
            middle[i, t] = 0.5 * (low[t, i] + high[t, i])
    order = np.arange(count)
    boxes, links = np.empty((2 * count + 1, 6)), np.empty((2 * count + 1, 2), dtype=np.int64)
    work = np.empty((128, 4), dtype=np.int64)
    work[0] = 0, count, -1, 0
    depth, made = 1, 0
    while depth > 0:
        depth -= 1
        first, last, parent, side = work[depth]
        node = made
        made += 1
        if parent >= 0:
            links[parent, side] = node
        widest, axis = -1.0, 0
        for i in range(3):
            a, b, c, d = np.inf, -np.inf, np.inf, -np.inf
            for k in range(first, last):
                t = order[k]
                a, b = min(a, low[t, i]), max(b, high[t, i])
                c, d = min(c, middle[i, t]), max(d, middle[i, t])
            boxes[node, i], boxes[node, 3 + i] = a, b
            if d - c > widest:
                widest, axis = d - c, i
        if last - first <= _LEAF:
            links[node] = -1 - first, last
            continue
        half = (first + last) // 2
        _split(middle[axis], order, first, last, half)
        work[depth] = half, last, node, 1
        work[depth + 1] = first, half, node, 0
        depth += 2
    return order, boxes[:made].copy(), links[:made].copy()


@njit(cache=True, inline="always")
def _to_box(x, y, z, box):  # type: ignore[no-untyped-def]
    a = max(box[0] - x, x - box[3], 0.0)
    b = max(box[1] - y, y - box[4], 0.0)
    c = max(box[2] - z, z - box[5], 0.0)
    return a * a + b * b + c * c


@njit(cache=True)
def _to_triangle(x, y, z, T):  # type: ignore[no-untyped-def]
    """The squared distance of (x, y, z) from the triangle T (3, 3) and the shares v, w of its closest point's
    second and third corner (Ericson 2005, 5.1.5)."""
    abx, aby, abz = T[1, 0] - T[0, 0], T[1, 1] - T[0, 1], T[1, 2] - T[0, 2]
    acx, acy, acz = T[2, 0] - T[0, 0], T[2, 1] - T[0, 1], T[2, 2] - T[0, 2]
    apx, apy, apz = x - T[0, 0], y - T[0, 1], z - T[0, 2]
    d1, d2 = abx * apx + aby * apy + abz * apz, acx * apx + acy * apy + acz * apz
    bpx, bpy, bpz = x - T[1, 0], y - T[1, 1], z - T[1, 2]
    d3, d4 = abx * bpx + aby * bpy + abz * bpz, acx * bpx + acy * bpy + acz * bpz
    cpx, cpy, cpz = x - T[2, 0], y - T[2, 1], z - T[2, 2]
    d5, d6 = abx * cpx + aby * cpy + abz * cpz, acx * cpx + acy * cpy + acz * cpz
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
    ex, ey, ez = apx - v * abx - w * acx, apy - v * aby - w * acy, apz - v * abz - w * acz
    return ex * ex + ey * ey + ez * ez, v, w


@njit(cache=True, parallel=True)
def _search(points, queue, corner, order, boxes, links, triangle, closest, gap):  # type: ignore[no-untyped-def]
    for chunk in prange((len(queue) + _CHUNK - 1) // _CHUNK):
        end = min((chunk + 1) * _CHUNK, len(queue))
        _search_run(points, queue[chunk * _CHUNK : end], corner, order, boxes, links, triangle, closest, gap)


@njit(cache=True)
def _search_run(points, queue, corner, order, boxes, links, triangle, closest, gap):  # type: ignore[no-untyped-def]
    stack, bound = np.empty(128, dtype=np.int64), np.empty(128)
    place = 0  # in the order, of the triangle found last
    for k in queue:
        x, y, z = points[k, 0], points[k, 1], points[k, 2]
        best, bv, bw = _to_triangle(x, y, z, corner[place])
        found = place
        stack[0], bound[0] = 0, _to_box(x, y, z, boxes[0])
        depth = 1
        while depth > 0:
            depth -= 1
            if bound[depth] > best * _ROUNDING:
                continue
            node = stack[depth]
            if links[node, 0] < 0:
                for here in range(-1 - links[node, 0], links[node, 1]):
                    near, v, w = _to_triangle(x, y, z, corner[here])
                    if near < best or (near == best and order[here] < order[found]):
                        best, bv, bw, found = near, v, w, here
                continue
            left, right = links[node, 0], links[node, 1]
            to_left, to_right = _to_box(x, y, z, boxes[left]), _to_box(x, y, z, boxes[right])
            if to_left <= to_right:
                stack[depth], bound[depth] = right, to_right
                stack[depth + 1], bound[depth + 1] = left, to_left
            else:
                stack[depth], bound[depth] = left, to_left
                stack[depth + 1], bound[depth + 1] = right, to_right
            depth += 2
        T = corner[found]
        for i in range(3):
            closest[k, i] = T[0, i] + bv * (T[1, i] - T[0, i]) + bw * (T[2, i] - T[0, i])
        triangle[k], gap[k], place = order[found], best, found
