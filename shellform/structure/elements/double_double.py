"""Numbers of twice the digits, and what elements need of them where stiffnesses lie far apart.

A number is held as the sum of two doubles, hi + lo, which don't overlap: 32 digits (Dekker 1971; Knuth, The
Art of Computer Programming 2, section 4.2.2). An element's stretch and local rotations are differences of
coordinates of order 1; where the element is 1e12 times as stiff as its neighbours they matter to the 28th
digit, and rounding the coordinates to the 16th is a force. Here the coordinates have a tail (`State.tail`),
the differences are taken with all digits, and what is left of them, rounded only then, goes into the ordinary
kernels: a force computed from a stretch that is right to 16 digits is so too.

The tangent has to keep digits as well: turned as a rigid body a stiff element must resist by nothing, not by
what rounding leaves of its stiffness, which would be more than all the rest of the structure. So its material
part, the sum of w u u' over the six ways in which an element deforms, is formed with all digits; the part due
to the forces that it carries isn't large and is added in double precision.
"""

from __future__ import annotations

import numpy as np

from shellform.compiled import njit

_SPLIT = 134217729.0  # 2^27 + 1


@njit(cache=True)
def two_sum(a, b):  # type: ignore[no-untyped-def]
    """a + b of two doubles, exactly."""
    s = a + b
    t = s - a
    return s, (a - (s - t)) + (b - t)


@njit(cache=True)
def two_product(a, b):  # type: ignore[no-untyped-def]
    """a b of two doubles, exactly."""
    p = a * b
    t = _SPLIT * a
    ah = t - (t - a)
    t = _SPLIT * b
    bh = t - (t - b)
    al, bl = a - ah, b - bh
    return p, ((ah * bh - p) + ah * bl + al * bh) + al * bl


@njit(cache=True)
def plus(a, b):  # type: ignore[no-untyped-def]
    """a + b."""
    s, e = two_sum(a[0], b[0])
    t, f = two_sum(a[1], b[1])
    e += t
    s, e = _ordered(s, e)
    return _ordered(s, e + f)


@njit(cache=True)
def _ordered(a, b):  # type: ignore[no-untyped-def]
    s = a + b
    return s, b - (s - a)


@njit(cache=True)
def minus(a, b):  # type: ignore[no-untyped-def]
    """a - b."""
    return plus(a, (-b[0], -b[1]))


@njit(cache=True)
def times(a, b):  # type: ignore[no-untyped-def]
    """a b."""
    p, e = two_product(a[0], b[0])
    return _ordered(p, e + (a[0] * b[1] + a[1] * b[0]))


@njit(cache=True, error_model="numpy")
def over(a, b):  # type: ignore[no-untyped-def]
    """a / b."""
    q = a[0] / b[0]
    rest = minus(a, times(b, (q, 0.0)))
    r = rest[0] / b[0]
    rest = minus(rest, times(b, (r, 0.0)))
    q, r = _ordered(q, r)
    return plus((q, r), (rest[0] / b[0], 0.0))


@njit(cache=True, error_model="numpy")
def root(a):  # type: ignore[no-untyped-def]
    """The square root of a >= 0."""
    if a[0] <= 0.0:
        return 0.0, 0.0
    x = np.sqrt(a[0])
    rest = minus(a, two_product(x, x))
    return _ordered(x, rest[0] / (2.0 * x))


@njit(cache=True)
def _dot(a, b):  # type: ignore[no-untyped-def]
    """The inner product of two vectors (3, 2)."""
    total = times((a[0, 0], a[0, 1]), (b[0, 0], b[0, 1]))
    for i in range(1, 3):
        total = plus(total, times((a[i, 0], a[i, 1]), (b[i, 0], b[i, 1])))
    return total


@njit(cache=True)
def _cross(a, b, out):  # type: ignore[no-untyped-def]
    """Writes a × b of vectors (3, 2) into out."""
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        out[i, 0], out[i, 1] = minus(
            times((a[j, 0], a[j, 1]), (b[k, 0], b[k, 1])), times((a[k, 0], a[k, 1]), (b[j, 0], b[j, 1]))
        )


@njit(cache=True, error_model="numpy")
def _scaled(a, size):  # type: ignore[no-untyped-def]
    """Divides the vector a (3, 2) by the number."""
    for i in range(3):
        a[i, 0], a[i, 1] = over((a[i, 0], a[i, 1]), size)


@njit(cache=True, error_model="numpy")
def moved_on(positions, quaternions, tail, step, vectors):  # type: ignore[no-untyped-def]
    """Coordinates (n, 7) and their tails (n, 7) after translations `step` (n, 3) and turns by the unit
    quaternions `vectors` (n, 4) with tails (n, 4): (n, 4, 2).
    """
    place, rest = np.empty((len(positions), 7)), np.empty((len(positions), 7))
    for n in range(len(positions)):
        for i in range(3):
            place[n, i], rest[n, i] = plus((positions[n, i], tail[n, i]), (step[n, i], 0.0))
        w, x, y, z = (
            (vectors[n, 0, 0], vectors[n, 0, 1]),
            (vectors[n, 1, 0], vectors[n, 1, 1]),
            (vectors[n, 2, 0], vectors[n, 2, 1]),
            (vectors[n, 3, 0], vectors[n, 3, 1]),
        )
        u, p, q, r = (
            (quaternions[n, 0], tail[n, 3]),
            (quaternions[n, 1], tail[n, 4]),
            (quaternions[n, 2], tail[n, 5]),
            (quaternions[n, 3], tail[n, 6]),
        )
        a = minus(times(w, u), plus(plus(times(x, p), times(y, q)), times(z, r)))
        b = plus(plus(times(w, p), times(u, x)), minus(times(y, r), times(z, q)))
        c = plus(plus(times(w, q), times(u, y)), minus(times(z, p), times(x, r)))
        d = plus(plus(times(w, r), times(u, z)), minus(times(x, q), times(y, p)))
        size = root(plus(plus(times(a, a), times(b, b)), plus(times(c, c), times(d, d))))
        place[n, 3], rest[n, 3] = over(a, size)
        place[n, 4], rest[n, 4] = over(b, size)
        place[n, 5], rest[n, 5] = over(c, size)
        place[n, 6], rest[n, 6] = over(d, size)
    return place, rest


@njit(cache=True, error_model="numpy")
def quaternions_of(vectors):  # type: ignore[no-untyped-def]
    """Unit quaternions (n, 4, 2) of rotation vectors (n, 3) of less than a turn, by the series of sine and
    cosine of half their angle.
    """
    result = np.empty((len(vectors), 4, 2))
    for n in range(len(vectors)):
        square = (0.0, 0.0)
        for i in range(3):
            square = plus(square, two_product(0.5 * vectors[n, i], 0.5 * vectors[n, i]))
        cosine, ratio, term = (1.0, 0.0), (1.0, 0.0), (1.0, 0.0)
        for k in range(1, 30):
            term = over(times(term, (-square[0], -square[1])), (2.0 * k - 1.0, 0.0))
            term = over(term, (2.0 * k, 0.0))
            cosine = plus(cosine, term)
            ratio = plus(ratio, over(term, (2.0 * k + 1.0, 0.0)))
            if abs(term[0]) < 1e-34:
                break
        result[n, 0, 0], result[n, 0, 1] = cosine
        for i in range(3):
            result[n, 1 + i, 0], result[n, 1 + i, 1] = times(ratio, (0.5 * vectors[n, i], 0.0))
    return result


@njit(cache=True, error_model="numpy")
def _triad(quaternion, tail, frame, T):  # type: ignore[no-untyped-def]
    """Writes a node's rotation times the axes `frame` (3, 3) into T (3, 3, 2), columns first: T[j] is axis
    j."""
    w, x, y, z = (
        (quaternion[0], tail[3]),
        (quaternion[1], tail[4]),
        (quaternion[2], tail[5]),
        (quaternion[3], tail[6]),
    )
    xx, yy, zz = times(x, x), times(y, y), times(z, z)
    xy, xz, yz = times(x, y), times(x, z), times(y, z)
    wx, wy, wz = times(w, x), times(w, y), times(w, z)
    two, one = (2.0, 0.0), (1.0, 0.0)
    rows = (
        (minus(one, times(two, plus(yy, zz))), times(two, minus(xy, wz)), times(two, plus(xz, wy))),
        (times(two, plus(xy, wz)), minus(one, times(two, plus(xx, zz))), times(two, minus(yz, wx))),
        (times(two, minus(xz, wy)), times(two, plus(yz, wx)), minus(one, times(two, plus(xx, yy)))),
    )
    for i in range(3):
        for j in range(3):
            T[j, i, 0], T[j, i, 1] = plus(
                plus(times(rows[i][0], (frame[0, j], 0.0)), times(rows[i][1], (frame[1, j], 0.0))),
                times(rows[i][2], (frame[2, j], 0.0)),
            )


@njit(cache=True, error_model="numpy", nogil=True)
def beam_deformations(start, stop, positions, quaternions, tail, ends, frames, rest_length, given, modes):  # type: ignore[no-untyped-def]
    """Of the beams from `start` to `stop`: into `given` (m, 7) stretch and sines of the local rotations (12),
    right to the last digit, and where it has rows, into `modes` (m, 6, 9, 2) the gradients, by chord and both
    ends' rotation increments in global axes, of stretch, twist, and sum and difference of the bending angles
    about y and about z.
    """
    d, v = np.empty((3, 2)), np.empty((3, 2))
    E, A, B = np.empty((3, 3, 2)), np.empty((3, 3, 2)), np.empty((3, 3, 2))
    T = np.empty((3, 3, 2))  # of one end, in element axes
    V = np.empty((2, 3, 2))  # the y axes of both ends in element axes
    rate = np.empty((6, 9, 2))
    for e in range(start, stop):
        a, b = ends[e, 0], ends[e, 1]
        for i in range(3):
            d[i, 0], d[i, 1] = minus((positions[b, i], tail[b, i]), (positions[a, i], tail[a, i]))
        square = _dot(d, d)
        l = root(square)
        l0 = (rest_length[e], 0.0)
        given[e, 0] = over(minus(square, times(l0, l0)), plus(l, l0))[0]
        _triad(quaternions[a], tail[a], frames[e, 0], A)
        _triad(quaternions[b], tail[b], frames[e, 1], B)
        for i in range(3):
            E[0, i, 0], E[0, i, 1] = over((d[i, 0], d[i, 1]), l)
            v[i, 0], v[i, 1] = plus((A[1, i, 0], A[1, i, 1]), (B[1, i, 0], B[1, i, 1]))
        _cross(E[0], v, E[2])
        _scaled(E[2], root(_dot(E[2], E[2])))
        _cross(E[2], E[0], E[1])
        for i in range(3):
            V[0, i, 0], V[0, i, 1] = _dot(E[i], A[1])
            V[1, i, 0], V[1, i, 1] = _dot(E[i], B[1])
        v0 = plus((V[0, 0, 0], V[0, 0, 1]), (V[1, 0, 0], V[1, 0, 1]))
        v1 = plus((V[0, 1, 0], V[0, 1, 1]), (V[1, 1, 0], V[1, 1, 1]))
        for end in range(2):
            for i in range(3):
                for j in range(3):
                    T[i, j, 0], T[i, j, 1] = _dot(E[i], A[j] if end == 0 else B[j])
            _end(T, V, v0, v1, l, end, given[e], rate, len(modes) > 0)
        if len(modes) > 0:
            _modes(E, rate, modes[e])


@njit(cache=True, error_model="numpy")
def _end(T, V, v0, v1, l, end, given, rate, wanted):  # type: ignore[no-untyped-def]
    """One end's sines and, where wanted, the gradients of its angles by (d, w_a, w_b) in element axes, as
    `local_by_dof` has them.
    """
    half = (0.5, 0.0)
    for k in range(3):
        i, j = (2, 1) if k == 0 else (2, 0) if k == 1 else (1, 0)
        s = times(half, minus((T[i, j, 0], T[i, j, 1]), (T[j, i, 0], T[j, i, 1])))
        given[1 + 3 * end + k] = s[0]
        if not wanted:
            continue
        if k == 0:
            h0 = plus((T[1, 1, 0], T[1, 1, 1]), (T[2, 2, 0], T[2, 2, 1]))
            h1, h2 = (-T[0, 1, 0], -T[0, 1, 1]), (-T[0, 2, 0], -T[0, 2, 1])
        elif k == 1:
            h0, h2 = (T[1, 0, 0], T[1, 0, 1]), (T[1, 2, 0], T[1, 2, 1])
            h1 = minus((-T[0, 0, 0], -T[0, 0, 1]), (T[2, 2, 0], T[2, 2, 1]))
        else:
            h0, h1 = (-T[2, 0, 0], -T[2, 0, 1]), (-T[2, 1, 0], -T[2, 1, 1])
            h2 = plus((T[0, 0, 0], T[0, 0, 1]), (T[1, 1, 0], T[1, 1, 1]))
        scale = over(half, root(minus((1.0, 0.0), times(s, s))))
        h0, h1, h2 = times(scale, h0), times(scale, h1), times(scale, h2)
        row = rate[3 * end + k]
        row[:] = 0.0
        own = 3 + 3 * end
        row[own, 0], row[own, 1] = h0
        row[own + 1, 0], row[own + 1, 1] = h1
        row[own + 2, 0], row[own + 2, 1] = h2
        along = over(h2, l)
        row[1, 0], row[1, 1] = -along[0], -along[1]
        row[2, 0], row[2, 1] = over(plus(times(h0, over(v0, v1)), h1), l)
        share = over(h0, v1)
        for other in range(2):
            at = 3 + 3 * other
            row[at, 0], row[at, 1] = minus(
                (row[at, 0], row[at, 1]), times(share, (V[other, 1, 0], V[other, 1, 1]))
            )
            row[at + 1, 0], row[at + 1, 1] = plus(
                (row[at + 1, 0], row[at + 1, 1]), times(share, (V[other, 0, 0], V[other, 0, 1]))
            )


@njit(cache=True)
def _modes(E, rate, modes):  # type: ignore[no-untyped-def]
    """The six ways of deforming in global axes: stretch; twist; sums and differences of the bending
    angles."""
    for r in range(6):
        for block in range(3):
            for i in range(3):
                total = (0.0, 0.0)
                for j in range(3):
                    at = 3 * block + j
                    if r == 0:
                        value = (1.0, 0.0) if at == 0 else (0.0, 0.0)
                    else:
                        k = 0 if r == 1 else 1 if r < 4 else 2
                        one, two = (rate[k, at, 0], rate[k, at, 1]), (rate[3 + k, at, 0], rate[3 + k, at, 1])
                        value = plus(one, two) if r == 2 or r == 4 else minus(one, two)
                    total = plus(total, times((E[j, i, 0], E[j, i, 1]), value))
                modes[r, 3 * block + i, 0], modes[r, 3 * block + i, 1] = total


@njit(cache=True, error_model="numpy", nogil=True)
def beam_tangents(start, stop, modes, rest_length, stiffness, turn, blocks, result):  # type: ignore[no-untyped-def]
    """Packed lower tangents (m, 78, 2) of the beams from `start` to `stop` into `result`: the material part
    from the `modes` (18), and `blocks` (m, 78), what the forces add to it or, where an end is turned far, the
    whole.
    """
    weight = np.empty((6, 2))
    for e in range(start, stop):
        l0 = (rest_length[e], 0.0)
        EA, GJ, EIy, EIz = stiffness[e, 0], stiffness[e, 1], stiffness[e, 2], stiffness[e, 3]
        weight[0, 0], weight[0, 1] = over((EA, 0.0), l0)
        weight[1, 0], weight[1, 1] = over((GJ, 0.0), l0)
        for k, bending in ((2, EIy), (4, EIz)):
            # 4 a² + 4 a b + 4 b² = 3 (a + b)² + (a - b)²
            weight[k, 0], weight[k, 1] = over(two_product(3.0, bending), l0)
            weight[k + 1, 0], weight[k + 1, 1] = over((bending, 0.0), l0)
        at = 0
        for row in range(12):
            for column in range(row + 1):
                total = (blocks[e, at], 0.0)
                if turn[e] == 0.0:
                    # The first end's translations come with minus the chord's sign.
                    sign = -1.0 if (row < 3) != (column < 3) else 1.0
                    i = row if 3 <= row < 6 else row - 3 if row >= 9 else row % 3
                    j = column if 3 <= column < 6 else column - 3 if column >= 9 else column % 3
                    for r in range(6):
                        term = times(
                            (weight[r, 0], weight[r, 1]),
                            times(
                                (modes[e, r, i, 0], modes[e, r, i, 1]), (modes[e, r, j, 0], modes[e, r, j, 1])
                            ),
                        )
                        total = plus(total, (sign * term[0], sign * term[1]))
                result[e, at, 0], result[e, at, 1] = total
                at += 1


@njit(cache=True, error_model="numpy", nogil=True)
def cable_evaluation(start, stop, positions, tail, ends, rest_length, stiffness, energy, force, blocks):  # type: ignore[no-untyped-def]
    """The cables from `start` to `stop` as `cable._evaluate` has them; `blocks` (c, 21, 2) filled where it
    has rows.
    """
    d = np.empty((3, 2))
    for c in range(start, stop):
        a, b = ends[c, 0], ends[c, 1]
        for i in range(3):
            d[i, 0], d[i, 1] = minus((positions[b, i], tail[b, i]), (positions[a, i], tail[a, i]))
        square = _dot(d, d)
        l, l0 = root(square), (rest_length[c], 0.0)
        stretch = max(over(minus(square, times(l0, l0)), plus(l, l0))[0], 0.0)
        N = stiffness[c] / rest_length[c] * stretch
        energy[c] = 0.5 * N * stretch
        if stretch > 0.0:
            _scaled(d, l)
        for i in range(3):
            force[c, i], force[c, 3 + i] = -N * d[i, 0], N * d[i, 0]
        if len(blocks) == 0:
            continue
        slope = over((stiffness[c], 0.0), l0) if stretch > 0.0 else (0.0, 0.0)
        lateral = N / l[0] if stretch > 0.0 else 0.0
        at = 0
        for row in range(6):
            for column in range(row + 1):
                i, j = row % 3, column % 3
                value = times(slope, times((d[i, 0], d[i, 1]), (d[j, 0], d[j, 1])))
                value = plus(value, (lateral * ((1.0 if i == j else 0.0) - d[i, 0] * d[j, 0]), 0.0))
                sign = 1.0 if row // 3 == column // 3 else -1.0
                blocks[c, at, 0], blocks[c, at, 1] = sign * value[0], sign * value[1]
                at += 1
