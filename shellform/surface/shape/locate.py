"""Closest points on the smooth surface over a triangle mesh.

Between its vertices the surface is a smooth patch over each triangle (patch.py). The foot p of a point x is
where x - p is normal to it: Newton's method on |x - p|² finds it from the closest point on the facets, which
a tree of boxes gives (tree.py), and goes over to the neighbour where it comes to an edge of its triangle. The
surface has a continuous normal n, so that the signed distance d = (x - p)·n has the gradient n, exactly and
continuously, and with the principal curvatures k (positive towards n) and directions e of the surface at p
the Hessian - sum k / (1 - d k) e e'.

Past the edge it goes on as extension.py makes it, beyond that in the tangent plane at the closest edge point.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shellform.arrays import Flags, Indices, Reals, Record, read_only
from shellform.compiled import njit, prange
from shellform.surface.shape.extension import extended
from shellform.surface.shape.patch import controls, edge_cubic, evaluate
from shellform.surface.shape.target import Surface, across_edges
from shellform.surface.shape.tree import FEW, Tree, along_curve

_PIECES = 8  # of an edge curve, taken as straight for the distance from the edge
_CHUNK = 64  # feet in a row on one processor
_STEPS = 120  # of Newton's method and from triangle to triangle
_DONE = 1e-13  # of a triangle: a step that counts as none


@dataclass(frozen=True, eq=False)
class Foot(Record):
    """Feet of k points: `point` (k, 3), m; unit `normal` (k, 3), upwards; signed `distance` (k,), m, along
    it, its gradient the normal and its `hessian` (k, 6), 1/m, packed lower; the `triangle` (k,) on which the
    foot lies; whether it lies `past` (k,) the surface's edge."""

    point: Reals
    normal: Reals
    distance: Reals
    hessian: Reals
    triangle: Indices
    past: Flags


class Locator:
    """Closest-point queries on one surface and, up to `reach` m past its edge, on its extension: its tree and
    its neighbourhoods, built once."""

    def __init__(self, surface: Surface, reach: float = 0.0) -> None:
        self._own = len(surface.triangles)
        whole, self._closed = extended(surface, reach) if reach > 0.0 else (surface, self._own)
        self._vertices, self._normals, self._triangles = whole.vertices, whole.normals, whole.triangles
        self._tree = Tree(whole.vertices[whole.triangles])
        self._across, self._rim = _joined(across_edges(whole.triangles, len(whole.vertices)), whole.triangles)
        loops = surface.boundary
        self._edge = Tree(_edge_pieces(surface, loops))
        self._outline = Tree(_edge_pieces(surface, loops[:1]))

    def facet(self, points: Reals) -> tuple[Indices, Reals, Reals]:
        """The triangle (k,), the exact closest point (k, 3) on the flat facets and its distance (k,) of
        points (k, 3).
        """
        return self._tree.nearest(points)

    def foot(self, points: Reals) -> Foot:
        """The feet of points (k, 3) on the smooth surface and its extension."""
        query = read_only(np.ascontiguousarray(points, dtype=float))
        triangle, closest, _ = self.facet(query)
        count = len(query)
        point, normal, distance, hessian = (
            np.empty((count, 3)),
            np.empty((count, 3)),
            np.empty(count),
            np.empty((count, 6)),
        )
        outside = np.zeros(count, dtype=bool)
        mesh = self._vertices, self._normals, self._triangles, self._across, self._rim
        feet = _feet if count > FEW else _feet_run
        feet(along_curve(query), query, closest, mesh, triangle, point, normal, distance, hessian, outside)
        return Foot(point, normal, distance, hessian, triangle, outside | (triangle >= self._own))

    def past_edge(self, foot: Foot) -> Reals:
        """Signed distance (k,), m, of the feet from the surface's edge: positive past it, negative on the
        surface.
        """
        return np.where(foot.past, 1.0, -1.0) * self._edge.nearest(foot.point)[2]

    def past_outline(self, foot: Foot) -> Reals:
        """The same as if the surface had no openings."""
        over = foot.past & ((foot.triangle < self._own) | (foot.triangle >= self._closed))
        return np.where(over, 1.0, -1.0) * self._outline.nearest(foot.point)[2]


def _joined(across: Indices, triangles: Indices) -> tuple[Indices, Indices]:
    """`across` (t, 3) with -1 - r in place of -1 for the r-th piece of the edge; and of those pieces (r, 4)
    the triangle, its edge, and the pieces before and after it."""
    pieces = np.argwhere(across < 0)
    start = triangles[pieces[:, 0], pieces[:, 1]]
    stop = triangles[pieces[:, 0], (pieces[:, 1] + 1) % 3]
    begins = np.argsort(start, kind="stable")
    after = begins[np.searchsorted(start[begins], stop)]
    before = np.empty(len(pieces), dtype=np.int64)
    before[after] = np.arange(len(pieces))
    coded = across.copy()
    coded[pieces[:, 0], pieces[:, 1]] = -1 - np.arange(len(pieces))
    return coded, np.ascontiguousarray(np.column_stack([pieces, before, after]))


def _edge_pieces(surface: Surface, loops: tuple[Indices, ...]) -> Reals:
    """Straight pieces (m, 3, 3) of the smooth curves over edge loops, as triangles without width."""
    a, b = np.concatenate(loops), np.concatenate([np.roll(loop, -1) for loop in loops])
    points = np.empty((len(a), _PIECES + 1, 3))
    _along_edges(surface.vertices[a], surface.vertices[b], surface.normals[a], surface.normals[b], points)
    pieces = np.stack([points[:, :-1], points[:, 1:], points[:, 1:]], axis=2)
    return np.asarray(pieces.reshape(-1, 3, 3))


@njit(cache=True)
def _along_edges(a, b, m, n, points):  # type: ignore[no-untyped-def]
    W = np.empty((3, 3))
    pieces = points.shape[1] - 1
    for k in range(len(a)):
        edge_cubic(a[k], b[k], m[k], n[k], W)
        for j in range(pieces + 1):
            s = j / pieces
            # Bernstein sums of the differences: c(s) = a + W0 (...) + W1 (...) + W2 s³
            second = s * s * (3.0 - 2.0 * s)
            for i in range(3):
                points[k, j, i] = (
                    a[k, i] + W[0, i] * (1.0 - (1.0 - s) ** 3) + W[1, i] * second + W[2, i] * s**3
                )


@njit(cache=True, parallel=True)
def _feet(queue, points, closest, mesh, triangle, point, normal, distance, hessian, outside):  # type: ignore[no-untyped-def]
    for chunk in prange((len(queue) + _CHUNK - 1) // _CHUNK):
        end = min((chunk + 1) * _CHUNK, len(queue))
        _feet_run(
            queue[chunk * _CHUNK : end],
            points,
            closest,
            mesh,
            triangle,
            point,
            normal,
            distance,
            hessian,
            outside,
        )


@njit(cache=True)
def _feet_run(queue, points, closest, mesh, triangle, point, normal, distance, hessian, outside):  # type: ignore[no-untyped-def]
    vertices, normals, triangles, across, rim = mesh
    corner, unit = np.empty((3, 3)), np.empty((3, 3))
    C, W, A, J = np.empty((18, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((6, 3))
    at = np.empty(2)
    for k in queue:
        x = points[k]
        t = triangle[k]
        _load(t, vertices, normals, triangles, corner, unit)
        _flat_coordinates(closest[k], corner, at)
        found = -1
        for _ in range(8):
            found = _inside(x, t, at, vertices, normals, triangles, across, corner, unit, C, W, A, J)
            if found >= 0:
                break
            piece, s, past = _beyond(x, -1 - found, vertices, normals, triangles, rim, corner, unit, W)
            t, e = rim[piece, 0], rim[piece, 1]
            at[0], at[1] = _on_edge(e, s)
            if past:
                break
        if found >= 0:
            triangle[k] = found
            _measure(x, J, point[k], normal[k], hessian[k], True)
        else:
            triangle[k] = t
            _load(t, vertices, normals, triangles, corner, unit)
            controls(corner, unit, C, W, A)
            evaluate(C, at[0], at[1], J)
            _measure(x, J, point[k], normal[k], hessian[k], False)
            outside[k] = True
        n = normal[k]
        p = J[0]
        distance[k] = (x[0] - p[0]) * n[0] + (x[1] - p[1]) * n[1] + (x[2] - p[2]) * n[2]
        for i in range(3):
            point[k, i] = p[i] if found >= 0 else x[i] - distance[k] * n[i]


@njit(cache=True, inline="always")
def _on_edge(e, s):  # type: ignore[no-untyped-def]
    """(v, w) at the share s of edge e."""
    if e == 0:
        return s, 0.0
    if e == 1:
        return 1.0 - s, s
    return 0.0, 1.0 - s


@njit(cache=True)
def _load(t, vertices, normals, triangles, corner, unit):  # type: ignore[no-untyped-def]
    for j in range(3):
        for i in range(3):
            corner[j, i] = vertices[triangles[t, j], i]
            unit[j, i] = normals[triangles[t, j], i]


@njit(cache=True)
def _flat_coordinates(p, corner, at):  # type: ignore[no-untyped-def]
    """Writes the barycentric (v, w) of the point p in the triangle to `at`, inside it whatever the
    rounding.
    """
    a, b, c, f, g = 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(3):
        e1, e2, d = corner[1, i] - corner[0, i], corner[2, i] - corner[0, i], p[i] - corner[0, i]
        a += e1 * e1
        b += e1 * e2
        c += e2 * e2
        f += d * e1
        g += d * e2
    det = a * c - b * b
    v = min(max((f * c - g * b) / det, 0.0), 1.0)
    w = min(max((g * a - f * b) / det, 0.0), 1.0)
    at[0], at[1] = v / max(1.0, v + w), w / max(1.0, v + w)


@njit(cache=True)
def _inside(x, t, at, vertices, normals, triangles, across, corner, unit, C, W, A, J):  # type: ignore[no-untyped-def]
    """The foot from the place `at` of triangle t on; returns its triangle, `at` and J being those of the
    foot, or -1 - r where it lies past the piece r of the edge."""
    _load(t, vertices, normals, triangles, corner, unit)
    controls(corner, unit, C, W, A)
    v, w = at[0], at[1]
    came, back = -1, False  # the edge just crossed; whether the last step led back over it at once
    still = 0  # crossings since the last move
    for _ in range(_STEPS):
        evaluate(C, v, w, J)
        g, h, a, b, c, ra, rb, rc = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(3):
            r = x[i] - J[0, i]
            g += r * J[1, i]
            h += r * J[2, i]
            a += J[1, i] * J[1, i]
            b += J[1, i] * J[2, i]
            c += J[2, i] * J[2, i]
            ra += r * J[3, i]
            rb += r * J[4, i]
            rc += r * J[5, i]
        # Next to a vertex the second derivatives depend on the side: going round it, the first ones decide.
        if still < 4 and a - ra > 0.0 and (a - ra) * (c - rc) - (b - rb) ** 2 > 0.01 * (a * c - b * b):
            a, b, c = a - ra, b - rb, c - rc
        det = a * c - b * b
        dv, dw = (c * g - b * h) / det, (a * h - b * g) / det
        du = -dv - dw
        if max(abs(dv), abs(dw), abs(du)) < _DONE:
            break
        if back:  # the foot lies on the edge crossed: go along it
            e = came
            sv, sw = (1.0, 0.0) if e == 0 else ((-1.0, 1.0) if e == 1 else (0.0, -1.0))
            along = (g * sv + h * sw) / (a * sv * sv + 2.0 * b * sv * sw + c * sw * sw)
            dv, dw = along * sv, along * sw
            du = -dv - dw
            if abs(along) < 1e-9:
                # Not the foot, though: second derivatives of the two patches disagree, the first ones don't.
                if still >= 4:
                    break
                still, back, came = 4, False, -1
                continue
        # How far the step stays inside, and over which edge it leaves: edge 0 lies where w = 0, 1 where u =
        # 0, 2 where v = 0.
        u = 1.0 - v - w
        share, leaves = 1.0, -1
        if dw < 0.0 and w + dw < 0.0 and not (back and came == 0) and -w / dw < share:
            share, leaves = -w / dw, 0
        if du < 0.0 and u + du < 0.0 and not (back and came == 1) and -u / du < share:
            share, leaves = -u / du, 1
        if dv < 0.0 and v + dv < 0.0 and not (back and came == 2) and -v / dv < share:
            share, leaves = -v / dv, 2
        share = max(share, 0.0)
        moved = share * max(abs(dv), abs(dw), abs(du))
        if leaves >= 0 and leaves == came and moved < 1e-9 and not back:
            back = True
            continue
        v = min(max(v + share * dv, 0.0), 1.0)
        w = min(max(w + share * dw, 0.0), 1.0)
        if v + w > 1.0:
            v, w = v / (v + w), w / (v + w)
        if moved > 1e-9:
            still = 0
            came = -1 if not back else came
        back = False
        if leaves < 0:
            continue
        still += 1
        s = v if leaves == 0 else (w if leaves == 1 else 1.0 - w)
        beyond = across[t, leaves]
        if beyond < 0:
            at[0], at[1] = v, w
            return beyond
        # The neighbour passes the common edge the other way.
        start = triangles[t, (leaves + 1) % 3]
        t = beyond
        came = 0
        while triangles[t, came] != start:
            came += 1
        v, w = _on_edge(came, 1.0 - s)
        _load(t, vertices, normals, triangles, corner, unit)
        controls(corner, unit, C, W, A)
    evaluate(C, v, w, J)
    at[0], at[1] = v, w
    return t


@njit(cache=True)
def _beyond(x, piece, vertices, normals, triangles, rim, corner, unit, W):  # type: ignore[no-untyped-def]
    """The closest point of the edge near the piece: its piece and share s, and whether x lies past the edge
    there.
    """
    s, turned = 0.5, 0
    c, d, dd, n = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for _ in range(_STEPS):
        t, e = rim[piece, 0], rim[piece, 1]
        f = (e + 1) % 3
        _load(t, vertices, normals, triangles, corner, unit)
        edge_cubic(corner[e], corner[f], unit[e], unit[f], W)
        for _newton in range(20):
            g, h, hh = 0.0, 0.0, 0.0
            for i in range(3):
                second = s * s * (3.0 - 2.0 * s)
                c[i] = corner[e, i] + W[0, i] * (1.0 - (1.0 - s) ** 3) + W[1, i] * second + W[2, i] * s**3
                d[i] = 3.0 * (W[0, i] * (1.0 - s) ** 2 + 2.0 * W[1, i] * s * (1.0 - s) + W[2, i] * s * s)
                dd[i] = 6.0 * ((W[1, i] - W[0, i]) * (1.0 - s) + (W[2, i] - W[1, i]) * s)
                g += (x[i] - c[i]) * d[i]
                h += d[i] * d[i]
                hh += (x[i] - c[i]) * dd[i]
            if h - hh > 0.01 * h:
                h -= hh
            then = min(max(s + g / h, 0.0), 1.0)
            step = abs(then - s)
            s = then
            if step < _DONE:
                break
        # At the end of a piece, on to the next; at a corner that both leave, there it is.
        if s >= 1.0 and g > 0.0 and turned != -1:
            piece, s, turned = rim[piece, 3], 0.0, 1
        elif s <= 0.0 and g < 0.0 and turned != 1:
            piece, s, turned = rim[piece, 2], 1.0, -1
        else:
            break
    for i in range(3):
        n[i] = (1.0 - s) * unit[e, i] + s * unit[f, i]
    out = 0.0
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        out += (x[i] - c[i]) * (d[j] * n[k] - d[k] * n[j])
    corner_between = (s >= 1.0 and g > 0.0) or (s <= 0.0 and g < 0.0)
    return piece, s, out >= 0.0 or corner_between


@njit(cache=True)
def _measure(x, J, point, normal, hessian, curved):  # type: ignore[no-untyped-def]
    """Writes the unit normal at the foot of x, whose derivatives are J, and the Hessian of the distance."""
    size = 0.0
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        normal[i] = J[1, j] * J[2, k] - J[1, k] * J[2, j]
        size += normal[i] ** 2
    size = np.sqrt(size)
    d, e, f, g, l, m, n = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(3):
        normal[i] /= size
        point[i] = J[0, i]
        d += (x[i] - J[0, i]) * normal[i]
        e += J[1, i] * J[1, i]
        f += J[1, i] * J[2, i]
        g += J[2, i] * J[2, i]
        l += J[3, i] * normal[i]
        m += J[4, i] * normal[i]
        n += J[5, i] * normal[i]
    # - J I^-1 h (I - d h)^-1 J' with the first and second forms I and h: M = (I - d h)^-1, S = I^-1 h M
    a, b, c = e - d * l, f - d * m, g - d * n
    det = a * c - b * b
    first = e * g - f * f
    curved = curved and det > 1e-6 * first
    slot = 0
    ma, mb, mc = c / det, -b / det, a / det
    pa, pb, pc, pd = l * ma + m * mb, l * mb + m * mc, m * ma + n * mb, m * mb + n * mc  # h M
    sa, sb = (g * pa - f * pc) / first, (g * pb - f * pd) / first
    sc, sd = (e * pc - f * pa) / first, (e * pd - f * pb) / first
    for i in range(3):
        for j in range(i + 1):
            value = (
                sa * J[1, i] * J[1, j]
                + sb * J[1, i] * J[2, j]
                + sc * J[2, i] * J[1, j]
                + sd * J[2, i] * J[2, j]
            )
            hessian[slot] = -value if curved else 0.0
            slot += 1
