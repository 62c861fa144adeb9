"""A smooth patch over one triangle, which meets its neighbours with one tangent plane all along their common
edge.

The patch is a quartic Bézier triangle with Gregory's rational inner points (Walton and Meek 1996, "A
triangular G1 patch from boundary curves"), made of the triangle's three corners and their normals alone:

- an edge is the cubic that leaves both ends in the direction of the chord seen in the tangent plane there;
  with arms of 2/3 c / (1 + cos a), c the chord and a the angle between it and the tangent, it follows a
  circle to the sixth power of the angle;
- along an edge the tangent plane is spanned by the edge's derivative W(s) and a quadratic field A(s) between
  the binormals at its two ends, which both neighbours share; the row of control points next to the edge is
  M = (L + L') / 2 + lambda W + mu A with lambda and mu linear in s, found from its two ends.

Each inner control point so has two values, one for each of the edges beside it, weighted y/(y + z) and z/(y +
z) in the barycentric coordinates y, z of the edges' other ends. The surface of all patches is G1: its normal
is continuous, and where the normal is, the distance of a point from its foot has a continuous gradient, the
normal.
"""

from __future__ import annotations

import numpy as np

from shellform.compiled import njit

# Exponents of u, v, w and binomial factors of the twelve control points on the boundary, from corner 0 round
# to it again.
_RIM = np.array(
    [
        (4, 0, 0),
        (3, 1, 0),
        (2, 2, 0),
        (1, 3, 0),
        (0, 4, 0),
        (0, 3, 1),
        (0, 2, 2),
        (0, 1, 3),
        (0, 0, 4),
        (1, 0, 3),
        (2, 0, 2),
        (3, 0, 1),
    ]
)
_TIMES = np.array([1.0, 4.0, 6.0, 4.0, 1.0, 4.0, 6.0, 4.0, 1.0, 4.0, 6.0, 4.0])
_FLAT = 1e-6  # of a chord: less of it in the tangent plane gives no direction


@njit(cache=True)
def edge_cubic(a, b, m, n, W):  # type: ignore[no-untyped-def]
    """Writes to W (3, 3) the differences of the control points of the edge from a to b with the unit normals
    m and n.
    """
    length, am, an = 0.0, 0.0, 0.0
    for i in range(3):
        d = b[i] - a[i]
        length += d * d
        am += d * m[i]
        an += d * n[i]
    length = np.sqrt(length)
    first = np.sqrt(max(length * length - am * am, 0.0))
    last = np.sqrt(max(length * length - an * an, 0.0))
    if first < _FLAT * length or last < _FLAT * length:
        first, last, am, an = length, length, 0.0, 0.0
    # cos a is the share of the chord that lies in the tangent plane
    start = (2.0 / 3.0) * length / (1.0 + first / length) / first
    stop = (2.0 / 3.0) * length / (1.0 + last / length) / last
    for i in range(3):
        d = b[i] - a[i]
        W[0, i] = start * (d - am * m[i])
        W[2, i] = stop * (d - an * n[i])
        W[1, i] = d - W[0, i] - W[2, i]


@njit(cache=True)
def controls(corner, normal, C, W, A):  # type: ignore[no-untyped-def]
    """Writes the control points to C (18, 3): twelve on the boundary, then two beside each edge; W (3, 3), A
    (3, 3) are scratch.
    """
    for e in range(3):
        a, b = corner[e], corner[(e + 1) % 3]
        edge_cubic(a, b, normal[e], normal[(e + 1) % 3], W)
        for i in range(3):
            C[4 * e, i] = a[i]
            C[4 * e + 1, i] = a[i] + 0.75 * W[0, i]
            C[4 * e + 2, i] = a[i] + W[0, i] + 0.5 * W[1, i]
            C[4 * e + 3, i] = b[i] - 0.75 * W[2, i]
    for e in range(3):
        f = (e + 1) % 3
        edge_cubic(corner[e], corner[f], normal[e], normal[f], W)
        for end in range(0, 3, 2):
            n = normal[e] if end == 0 else normal[f]
            A[end, 0] = n[1] * W[end, 2] - n[2] * W[end, 1]
            A[end, 1] = n[2] * W[end, 0] - n[0] * W[end, 2]
            A[end, 2] = n[0] * W[end, 1] - n[1] * W[end, 0]
            size = np.sqrt(A[end, 0] ** 2 + A[end, 1] ** 2 + A[end, 2] ** 2)
            for i in range(3):
                A[end, i] /= size
        size = 0.0
        for i in range(3):
            A[1, i] = A[0, i] + A[2, i]
            size += A[1, i] ** 2
        size = np.sqrt(size) if size > 1e-12 else 1.0
        l0, l1, m0, m1, w0, w2 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(3):
            A[1, i] /= size
            first = C[(4 * e + 11) % 12, i] - 0.5 * (C[4 * e, i] + C[4 * e + 1, i])
            last = C[(4 * e + 5) % 12, i] - 0.5 * (C[4 * e + 3, i] + C[(4 * e + 4) % 12, i])
            l0 += first * W[0, i]
            l1 += last * W[2, i]
            m0 += first * A[0, i]
            m1 += last * A[2, i]
            w0 += W[0, i] ** 2
            w2 += W[2, i] ** 2
        l0 /= w0
        l1 /= w2
        for i in range(3):
            near, middle, far = C[4 * e + 1, i], C[4 * e + 2, i], C[4 * e + 3, i]
            C[12 + 2 * e, i] = (
                0.5 * (near + middle)
                + (2 * l0 * W[1, i] + l1 * W[0, i] + 2 * m0 * A[1, i] + m1 * A[0, i]) / 3.0
            )
            C[13 + 2 * e, i] = (
                0.5 * (middle + far)
                + (l0 * W[2, i] + 2 * l1 * W[1, i] + m0 * A[2, i] + 2 * m1 * A[1, i]) / 3.0
            )


@njit(cache=True, inline="always")
def _add(J, c, f, fu, fv, fw, fuu, fvv, fww, fuv, fuw, fvw):  # type: ignore[no-untyped-def]
    """Adds control point c times a basis function, given with its barycentric derivatives, to J (6, 3)."""
    s, t = fv - fu, fw - fu
    ss, st, tt = fvv - 2.0 * fuv + fuu, fvw - fuv - fuw + fuu, fww - 2.0 * fuw + fuu
    for i in range(3):
        J[0, i] += c[i] * f
        J[1, i] += c[i] * s
        J[2, i] += c[i] * t
        J[3, i] += c[i] * ss
        J[4, i] += c[i] * st
        J[5, i] += c[i] * tt


@njit(cache=True)
def evaluate(C, v, w, J):  # type: ignore[no-untyped-def]
    """Writes to J (6, 3) the point at (u = 1 - v - w, v, w) and its derivatives by v, w, vv, vw, ww."""
    power = np.empty((3, 5))
    power[0, 1], power[1, 1], power[2, 1] = 1.0 - v - w, v, w
    for i in range(3):
        power[i, 0] = 1.0
        for k in range(2, 5):
            power[i, k] = power[i, k - 1] * power[i, 1]
    for k in range(6):
        for i in range(3):
            J[k, i] = 0.0
    for k in range(12):
        a, b, c = _RIM[k, 0], _RIM[k, 1], _RIM[k, 2]
        u0, v0, w0 = power[0, a], power[1, b], power[2, c]
        u1 = a * power[0, a - 1] if a > 0 else 0.0
        v1 = b * power[1, b - 1] if b > 0 else 0.0
        w1 = c * power[2, c - 1] if c > 0 else 0.0
        u2 = a * (a - 1) * power[0, a - 2] if a > 1 else 0.0
        v2 = b * (b - 1) * power[1, b - 2] if b > 1 else 0.0
        w2 = c * (c - 1) * power[2, c - 2] if c > 1 else 0.0
        m = _TIMES[k]
        _add(
            J, C[k], m * u0 * v0 * w0, m * u1 * v0 * w0, m * u0 * v1 * w0, m * u0 * v0 * w1,
            m * u2 * v0 * w0, m * u0 * v2 * w0, m * u0 * v0 * w2, m * u1 * v1 * w0, m * u1 * v0 * w1,
            m * u0 * v1 * w1,
        )  # fmt: skip
    for e in range(3):
        x, y, z = power[e, 1], power[(e + 1) % 3, 1], power[(e + 2) % 3, 1]
        total = y + z
        q = y / total if total > 1e-300 else 0.5
        r = 1.0 - q
        # R = y² z / (y + z) and S = y z - R with their derivatives; both times 12 x²
        R, Ry, Rz, Ryy, Rzz, Ryz = (
            y * q * z,
            z * q * (1.0 + r),
            y * q * q,
            2.0 * r**3,
            -2.0 * q**3,
            q * q * (3.0 - 2.0 * q),
        )
        for side in range(2):
            if side == 1:
                R, Ry, Rz, Ryy, Rzz, Ryz = y * z - R, z - Ry, y - Rz, -Ryy, -Rzz, 1.0 - Ryz
            point = C[12 + 2 * e] if side == 0 else C[13 + 2 * ((e + 2) % 3)]
            f, x1, x2 = 12.0 * x * x, 24.0 * x, 24.0
            dx, dy, dz = x1 * R, f * Ry, f * Rz
            xx, yy, zz, xy, xz, yz = x2 * R, f * Ryy, f * Rzz, x1 * Ry, x1 * Rz, f * Ryz
            if e == 0:
                _add(J, point, f * R, dx, dy, dz, xx, yy, zz, xy, xz, yz)
            elif e == 1:  # x is v, y is w, z is u
                _add(J, point, f * R, dz, dx, dy, zz, xx, yy, xz, yz, xy)
            else:  # x is w, y is u, z is v
                _add(J, point, f * R, dy, dz, dx, yy, zz, xx, yz, xy, xz)
