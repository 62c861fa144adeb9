"""The compiled loops over co-rotational beams; the letters and equations are those at the head of beam.py.

The tangent, term by term. Let w stand for the rotation increments of both ends and phi = G y for that of the
element triad, y = (dd, w). The second variation of the energy at given triads is a quadratic form in the
ends' rotation increments relative to the element, w - phi, to which the turning of the triads' moments
themselves adds M = Q - tr(Q) I at each end, with Q the sum of c_k (triad vector)(element axis)'. Altogether

    P w·w - 2 R w·phi + S phi·phi - y·(dG)' g,

of which only the first row of G has more than one entry: (0, 0, -eta/l, alpha); the others turn d2 and d1
over l. The last term, the change of the lever arms of g, is written out with its symmetric part. Rotations
don't commute, so the derivative of the end forces has a skew part besides, -S(m)/2 for each end's moment m,
which cancels at a node in equilibrium.
"""

from __future__ import annotations

import numpy as np

from shellform.compiled import njit
from shellform.structure.elements.local_rotation import NEAR, turned_far
from shellform.structure.elements.rotation import matrix

# The least (a_y + b_y)·e_y, 2 at rest, from which the roll of the element triad is taken; below, where the
# chord has turned about z until it lies nearly along them, it is taken from the z axes in the same way.
_UPRIGHT = 0.25


@njit(cache=True, error_model="numpy", nogil=True, fastmath={"contract"})
def evaluate(  # type: ignore[no-untyped-def]
    start,
    stop,
    positions,
    quaternions,
    ends,
    frames,
    rest_length,
    stiffness,
    given,
    material,
    energy,
    force,
    blocks,
    local_force,
    local_deformation,
    turn,
):
    """One pass over the beams from `start` to `stop`; `blocks`, `local_force`, `local_deformation` are filled
    where they have rows, `turn` (m,) with the largest of the ends' local rotations and the twist from one to
    the other, rad, where an end is turned farther than equation (12) measures (local_rotation.py), else 0.

    `given` (m, 7): stretch and sines of the local rotations where they are known better than from double
    precision, else no rows (double_double.py); `material`: 1, or 0 to leave the material part out of the
    tangent. Positions and quaternions may be complex, for derivatives by complex steps
    (third_derivatives.py).
    """
    dtype = positions.dtype
    E = np.empty((3, 3), dtype)
    A = np.empty((3, 3), dtype)
    B = np.empty((3, 3), dtype)
    Q = np.empty((3, 3), dtype)  # of a node, then of a quaternion's matrix
    h = np.empty((6, 3), dtype)  # gradients of s_k by the rotation increment of their end, E fixed
    c = np.empty(6, dtype)
    theta = np.empty(6, dtype)
    sine, cosine = np.empty(6, dtype), np.empty(6, dtype)
    moment = np.empty(6, dtype)
    g = np.empty((2, 3), dtype)
    Ma = np.empty((3, 3), dtype)
    Mb = np.empty((3, 3), dtype)
    # Derivatives of the moments by the local rotations: at the same end (a, b), at the other end.
    near_a, near_b, far = np.empty(3, dtype), np.empty(3, dtype), np.empty(3, dtype)
    P = np.empty((6, 6), dtype)
    R = np.empty((3, 6), dtype)
    S = np.empty((3, 3), dtype)
    alpha = np.zeros(6, dtype)
    K = np.empty((9, 9), dtype)
    curvature = np.empty((2, 3, 3), dtype)  # of the local rotations at an end that is turned far
    for e in range(start, stop):
        a, b = ends[e, 0], ends[e, 1]
        l0 = rest_length[e]
        EA, GJ, EIy, EIz = stiffness[e, 0], stiffness[e, 1], stiffness[e, 2], stiffness[e, 3]
        l = triads(positions, quaternions, frames[e], a, b, E, A, B, Q)
        by_z = _rolled_by_z(A, B)
        if by_z:  # the same element by the other pair of axes, its y axis along z
            l = triads(positions, quaternions, _by_z(frames[e]), a, b, E, A, B, Q)
            EIy, EIz = EIz, EIy

        # Local rotations (12) and moments (15, 18); order xa, ya, za, xb, yb, zb.
        theta[0], theta[1], theta[2] = (
            0.5 * (A[2, 1] - A[1, 2]),
            0.5 * (A[2, 0] - A[0, 2]),
            0.5 * (A[1, 0] - A[0, 1]),
        )
        theta[3], theta[4], theta[5] = (
            0.5 * (B[2, 1] - B[1, 2]),
            0.5 * (B[2, 0] - B[0, 2]),
            0.5 * (B[1, 0] - B[0, 1]),
        )
        stretch = l - l0
        if given.shape[0] > 0:
            stretch = given[e, 0] + 0.0 * stretch
            for k in range(6):
                theta[k] = given[e, 1 + k]
        for k in range(6):
            sine[k] = theta[k]
            cosine[k] = np.sqrt(1.0 - sine[k] * sine[k])
            theta[k] = np.arcsin(sine[k])
        far_a = (A[0, 0] + A[1, 1] + A[2, 2]).real < NEAR
        far_b = (B[0, 0] + B[1, 1] + B[2, 2]).real < NEAR
        turn[e] = 0.0
        if far_a:
            turn[e] = turned_far(A, moment[:3], theta[:3], h[:3], curvature[0])
        if far_b:
            turn[e] = max(turn[e], turned_far(B, moment[3:], theta[3:], h[3:], curvature[1]))
        if far_a or far_b:
            turn[e] = max(turn[e], abs((theta[0] - theta[3]).real))
        if by_z and (A[1, 1] + B[1, 1]).real < _UPRIGHT:
            turn[e] = np.pi  # neither pair of axes tells how the element is rolled
        N = EA * stretch / l0
        moment[0] = GJ * (theta[0] - theta[3]) / l0
        moment[1] = EIy * (4.0 * theta[1] + 2.0 * theta[4]) / l0
        moment[2] = EIz * (4.0 * theta[2] + 2.0 * theta[5]) / l0
        moment[3] = -moment[0]
        moment[4] = EIy * (2.0 * theta[1] + 4.0 * theta[4]) / l0
        moment[5] = EIz * (2.0 * theta[2] + 4.0 * theta[5]) / l0
        U = N * stretch
        for k in range(6):
            U += moment[k] * theta[k]
            c[k] = 0.5 * moment[k] / cosine[k]
        energy[e] = 0.5 * U
        if local_force.shape[0] > 0:
            local_force[e, 0], local_deformation[e, 0] = N, stretch
            for k in range(6):
                local_force[e, 1 + k], local_deformation[e, 1 + k] = moment[k], theta[k]
            if by_z:
                _back(local_force[e])
                _back(local_deformation[e])

        # g = sum c_k h_k on each end is the axial vector of Q = sum +-c_k (triad vector)(element axis)'; M =
        # Q - tr(Q) I.
        for end in range(2):
            T = A if end == 0 else B
            M = Ma if end == 0 else Mb
            k = 3 * end
            if far_b if end else far_a:
                turned_far(T, moment[k : k + 3], theta[k : k + 3], h[k : k + 3], curvature[end])
                for i in range(3):
                    g[end, i] = (
                        moment[k] * h[k, i] + moment[k + 1] * h[k + 1, i] + moment[k + 2] * h[k + 2, i]
                    )
                for i in range(3):
                    for j in range(3):
                        M[i, j] = curvature[end, i, j]
                M[0, 1] += 0.5 * g[end, 2]
                M[1, 0] -= 0.5 * g[end, 2]
                M[1, 2] += 0.5 * g[end, 0]
                M[2, 1] -= 0.5 * g[end, 0]
                M[2, 0] += 0.5 * g[end, 1]
                M[0, 2] -= 0.5 * g[end, 1]
                continue
            cx, cy, cz = c[3 * end], c[3 * end + 1], c[3 * end + 2]
            for i in range(3):
                Q[i, 0] = -cy * T[i, 2] - cz * T[i, 1]
                Q[i, 1] = cz * T[i, 0] - cx * T[i, 2]
                Q[i, 2] = cx * T[i, 1] + cy * T[i, 0]
            g[end, 0], g[end, 1], g[end, 2] = Q[1, 2] - Q[2, 1], Q[2, 0] - Q[0, 2], Q[0, 1] - Q[1, 0]
            trace = Q[0, 0] + Q[1, 1] + Q[2, 2]
            for i in range(3):
                for j in range(3):
                    M[i, j] = Q[i, j]
                M[i, i] -= trace
        gx, gy, gz = g[0, 0] + g[1, 0], g[0, 1] + g[1, 1], g[0, 2] + g[1, 2]

        # Spin of the element triad: phi = G (dd, w_a, w_b) keeps e_x on the chord and e_z normal to v = a_y +
        # b_y.
        v0, v1 = A[0, 1] + B[0, 1], A[1, 1] + B[1, 1]
        nu = 1.0 / v1
        eta = v0 * nu
        # G's first row is (0, 0, -eta / l, alpha), its others turn d2 and d1 over l.
        alpha[0], alpha[1], alpha[3], alpha[4] = nu * A[1, 1], -nu * A[0, 1], nu * B[1, 1], -nu * B[0, 1]

        # End forces in element axes: on d, then on the two ends' rotation increments.
        fd1 = -(gz / l)
        fd2 = (gy + eta * gx) / l
        ma0, ma1, ma2 = g[0, 0] - alpha[0] * gx, g[0, 1] - alpha[1] * gx, g[0, 2]
        mb0, mb1, mb2 = g[1, 0] - alpha[3] * gx, g[1, 1] - alpha[4] * gx, g[1, 2]
        for i in range(3):
            along = E[i, 0] * N + E[i, 1] * fd1 + E[i, 2] * fd2
            force[e, i] = -along
            force[e, 6 + i] = along
            force[e, 3 + i] = E[i, 0] * ma0 + E[i, 1] * ma1 + E[i, 2] * ma2
            force[e, 9 + i] = E[i, 0] * mb0 + E[i, 1] * mb1 + E[i, 2] * mb2
        if blocks.shape[0] == 0:
            continue

        # h_k / (2 cos theta_k): gradients of the local rotations by the rotation increment of their end.
        for end in range(2):
            if far_b if end else far_a:
                continue  # filled by then
            T = A if end == 0 else B
            k = 3 * end
            s = 0.5 / cosine[k]
            h[k, 0], h[k, 1], h[k, 2] = s * (T[1, 1] + T[2, 2]), -s * T[0, 1], -s * T[0, 2]
            s = 0.5 / cosine[k + 1]
            h[k + 1, 0], h[k + 1, 1], h[k + 1, 2] = s * T[1, 0], s * (-T[0, 0] - T[2, 2]), s * T[1, 2]
            s = 0.5 / cosine[k + 2]
            h[k + 2, 0], h[k + 2, 1], h[k + 2, 2] = -s * T[2, 0], -s * T[2, 1], s * (T[0, 0] + T[1, 1])

        if material == 0.0 and turn[e] == 0.0:
            EA, GJ, EIy, EIz = 0.0, 0.0, 0.0, 0.0
        near_a[0], near_a[1], near_a[2] = GJ / l0, 4.0 * EIy / l0, 4.0 * EIz / l0
        far[0], far[1], far[2] = -GJ / l0, 2.0 * EIy / l0, 2.0 * EIz / l0
        for k in range(3):
            near_b[k] = near_a[k]
            if not far_b:
                near_b[k] += moment[k + 3] * sine[k + 3] / cosine[k + 3]
            if not far_a:
                near_a[k] += moment[k] * sine[k] / cosine[k]

        # P: the quadratic form of the two ends' rotation increments with the element triad at rest, from the
        # derivatives of the moments by the local rotations, the arcsine's own curvature with them, and from
        # the triads' moments' own turning M.
        for i in range(3):
            a0, a1, a2 = near_a[0] * h[0, i], near_a[1] * h[1, i], near_a[2] * h[2, i]
            b0, b1, b2 = near_b[0] * h[3, i], near_b[1] * h[4, i], near_b[2] * h[5, i]
            f0, f1, f2 = far[0] * h[0, i], far[1] * h[1, i], far[2] * h[2, i]
            for j in range(3):
                P[i, j] = a0 * h[0, j] + a1 * h[1, j] + a2 * h[2, j]
                P[3 + i, 3 + j] = b0 * h[3, j] + b1 * h[4, j] + b2 * h[5, j]
                ab = f0 * h[3, j] + f1 * h[4, j] + f2 * h[5, j]
                P[i, 3 + j] = ab
                P[3 + j, i] = ab
        # R, S: how rotation increments of the element triad (phi, the same at both ends) couple with the
        # ends' rotation increments and with themselves.
        for r in range(3):
            for i in range(3):
                R[r, i] = P[i, r] + P[i, 3 + r] + Ma[r, i]
                R[r, 3 + i] = P[r, 3 + i] + P[3 + i, 3 + r] + Mb[r, i]
        for r in range(3):
            for i in range(3):
                S[r, i] = (
                    P[r, i] + P[r, 3 + i] + P[i, 3 + r] + P[3 + r, 3 + i]
                    + 0.5 * (Ma[r, i] + Ma[i, r] + Mb[r, i] + Mb[i, r])
                )  # fmt: skip
        for i in range(3):
            for j in range(3):
                P[i, j] += 0.5 * (Ma[i, j] + Ma[j, i])
                P[3 + i, 3 + j] += 0.5 * (Mb[i, j] + Mb[j, i])

        # With phi = G (dd, w_a, w_b) the form is P w·w - 2 R w·phi + S phi·phi.
        il = 1.0 / l
        d2 = -eta * il
        along_1, along_2 = S[0, 2] * il, S[0, 0] * d2 - S[0, 1] * il
        for i in range(6):
            for j in range(i + 1):
                K[3 + i, 3 + j] = (
                    P[i, j] - alpha[i] * R[0, j] - R[0, i] * alpha[j] + S[0, 0] * alpha[i] * alpha[j]
                )
            K[3 + i, 0] = 0.0
            K[3 + i, 1] = alpha[i] * along_1 - R[2, i] * il
            K[3 + i, 2] = alpha[i] * along_2 - R[0, i] * d2 + R[1, i] * il
        K[0, 0] = EA / l0
        K[1, 1] = N * il + S[2, 2] * il * il
        K[2, 2] = N * il + S[0, 0] * d2 * d2 - 2.0 * S[0, 1] * d2 * il + S[1, 1] * il * il
        K[2, 1] = (S[0, 2] * d2 - S[1, 2] * il) * il

        # Minus the symmetric part of (dG)' g: the lever arms of the ends' moments change with the chord and
        # with v.
        s = gy + eta * gx
        n = nu * gx
        K[1, 0] = gz * il * il
        K[2, 0] = -s * il * il
        K[2, 1] += 0.5 * (eta * s + gx * (1.0 + eta * eta)) * il * il
        K[2, 2] += eta * gz * il * il
        for end in range(2):
            T = A if end == 0 else B
            a0, a1, a2 = T[0, 1], T[1, 1], T[2, 1]  # the end's y axis
            o = 3 + 3 * end
            m0, m1 = alpha[o - 3], alpha[o - 2]
            # d1 and d2 against this end's rotation increments; each term and its transpose have a half.
            K[o, 1] -= 0.5 * (a1 * nu * s + eta * gx * m0) * il
            K[o + 1, 1] -= 0.5 * (-a0 * nu * s + eta * gx * m1) * il
            K[o, 2] -= 0.5 * (a1 * nu * gz - n * eta * a2 - eta * nu * gx * a2) * il
            K[o + 1, 2] -= 0.5 * (-a0 * nu * gz - n * a2 - nu * gx * a2) * il
            K[o + 2, 2] -= 0.5 * (n * (a0 * eta + a1) + nu * gx * (a1 + eta * a0)) * il
            # This end's rotation increments against themselves.
            nn = nu * n
            K[o, o] -= nn * a2 * a1 + n * a2 * (m0 - 1.0)
            K[o + 1, o] -= 0.5 * (-nn * a2 * a0 + n * m1 * a2)
            K[o + 2, o] -= 0.5 * (n * a0 - nn * a0 * a1 - n * a0 * m0)
            K[o + 1, o + 1] += n * a2
            K[o + 2, o + 1] -= 0.5 * (n * a1 + nn * a0 * a0 - n * a0 * m1)
        # The two ends' rotation increments against each other.
        a0, a1, a2, b0, b1, b2 = A[0, 1], A[1, 1], A[2, 1], B[0, 1], B[1, 1], B[2, 1]
        nn = nu * n
        K[6, 3] -= 0.5 * (nn * a2 * b1 + n * alpha[0] * b2 + nn * b2 * a1 + n * alpha[3] * a2)
        K[7, 3] -= 0.5 * (-nn * a2 * b0 + n * alpha[4] * a2)
        K[8, 3] -= 0.5 * (-n * b0 * alpha[0] - nn * b0 * a1)
        K[6, 4] -= 0.5 * (n * alpha[1] * b2 - nn * b2 * a0)
        K[8, 4] -= 0.5 * (-n * b0 * alpha[1] + nn * b0 * a0)
        K[6, 5] -= 0.5 * (-nn * a0 * b1 - n * a0 * alpha[3])
        K[7, 5] -= 0.5 * (nn * a0 * b0 - n * a0 * alpha[4])
        _pack(E, K, blocks[e])


@njit(cache=True, error_model="numpy", inline="always", fastmath={"contract"})
def _pack(E, K, out):  # type: ignore[no-untyped-def]
    """The symmetric matrix with lower triangle K (9, 9), element axes, as packed lower triangle (78,) of 12
    degrees of freedom, global axes.

    The six blocks of three rows and columns are written out, so that the compiler knows every place.
    """
    X = np.empty((3, 3), E.dtype)
    for p in (0, 3, 6):
        K[p, p + 1], K[p, p + 2], K[p + 1, p + 2] = K[p + 1, p], K[p + 2, p], K[p + 2, p + 1]
    # Rows and columns of x_a are minus those of d, those of x_b are d itself.
    _turn(E, K, 0, 0, X)
    for i in range(3):
        for j in range(i + 1):
            out[_row(i) + j] = X[i, j]
            out[_row(6 + i) + 6 + j] = X[i, j]
        for j in range(3):
            out[_row(6 + i) + j] = -X[i, j]
    _turn(E, K, 3, 0, X)
    for i in range(3):
        for j in range(3):
            out[_row(3 + i) + j] = -X[i, j]
            out[_row(6 + j) + 3 + i] = X[i, j]
    _turn(E, K, 6, 0, X)
    for i in range(3):
        for j in range(3):
            out[_row(9 + i) + j] = -X[i, j]
            out[_row(9 + i) + 6 + j] = X[i, j]
    _turn(E, K, 3, 3, X)
    for i in range(3):
        for j in range(i + 1):
            out[_row(3 + i) + 3 + j] = X[i, j]
    _turn(E, K, 6, 3, X)
    for i in range(3):
        for j in range(3):
            out[_row(9 + i) + 3 + j] = X[i, j]
    _turn(E, K, 6, 6, X)
    for i in range(3):
        for j in range(i + 1):
            out[_row(9 + i) + 9 + j] = X[i, j]


@njit(cache=True, error_model="numpy", inline="always", fastmath={"contract"})
def _turn(E, K, row, column, X):  # type: ignore[no-untyped-def]
    """X = E B E' for the block B (3, 3) of K that begins at the row and the column."""
    for j in range(3):
        y0 = K[row, column] * E[j, 0] + K[row, column + 1] * E[j, 1] + K[row, column + 2] * E[j, 2]
        y1 = (
            K[row + 1, column] * E[j, 0] + K[row + 1, column + 1] * E[j, 1] + K[row + 1, column + 2] * E[j, 2]
        )
        y2 = (
            K[row + 2, column] * E[j, 0] + K[row + 2, column + 1] * E[j, 1] + K[row + 2, column + 2] * E[j, 2]
        )
        for i in range(3):
            X[i, j] = E[i, 0] * y0 + E[i, 1] * y1 + E[i, 2] * y2


@njit(cache=True, inline="always")
def _rolled_by_z(A, B):  # type: ignore[no-untyped-def]
    """Whether the roll of the element has to be taken from the ends' z axes instead of their y axes: the
    chord has turned about z so far that it lies along the y axes, or beyond them.
    """
    upright, along = (A[1, 1] + B[1, 1]).real, (A[2, 2] + B[2, 2]).real
    if upright < _UPRIGHT:
        return True
    return along < 0.0 and along**2 + (A[1, 2] + B[1, 2]).real ** 2 > upright**2


@njit(cache=True)
def _by_z(frame):  # type: ignore[no-untyped-def]
    """The axes (2, 3, 3) at both ends turned by 90 degrees about x: y along z, z along -y."""
    result = np.empty_like(frame)
    for end in range(2):
        for i in range(3):
            result[end, i, 0], result[end, i, 1] = frame[end, i, 0], frame[end, i, 2]
            result[end, i, 2] = -frame[end, i, 1]
    return result


@njit(cache=True)
def _back(local):  # type: ignore[no-untyped-def]
    """Puts rows in the order of (16) or (17), about axes turned by `_by_z`, back about the element's own."""
    for y in (2, 5):
        about_y = local[y : y + 1].copy()
        local[y] = local[y + 1]
        local[y + 1] = -about_y[0]


@njit(cache=True, inline="always")
def _row(r):  # type: ignore[no-untyped-def]
    """Where row r of a packed lower triangle begins."""
    return r * (r + 1) // 2


@njit(cache=True, error_model="numpy", nogil=True)
def local_by_dof(start, stop, positions, quaternions, ends, frames, rest_length, stiffness, result):  # type: ignore[no-untyped-def]
    """The gradients of (12), h_k on the own rotation increment less G' h_k, times the local stiffness (18),
    in global axes.
    """
    dtype = positions.dtype
    E, A, B, Q = (
        np.empty((3, 3), dtype),
        np.empty((3, 3), dtype),
        np.empty((3, 3), dtype),
        np.empty((3, 3), dtype),
    )
    rate = np.zeros((7, 9), dtype)
    turned = np.empty(9, dtype)
    theta, none = np.empty(3, dtype), np.zeros(3, dtype)
    h, curvature = np.empty((6, 3), dtype), np.empty((3, 3), dtype)
    for e in range(start, stop):
        a, b = ends[e, 0], ends[e, 1]
        l = triads(positions, quaternions, frames[e], a, b, E, A, B, Q)
        by_z = _rolled_by_z(A, B)
        if by_z:
            l = triads(positions, quaternions, _by_z(frames[e]), a, b, E, A, B, Q)
        v0, v1 = A[0, 1] + B[0, 1], A[1, 1] + B[1, 1]
        eta = v0 / v1
        rate[:] = 0.0
        rate[0, 0] = 1.0
        far_a = (A[0, 0] + A[1, 1] + A[2, 2]).real < NEAR
        far_b = (B[0, 0] + B[1, 1] + B[2, 2]).real < NEAR
        if far_a:
            turned_far(A, none, theta, h[:3], curvature)
        if far_b:
            turned_far(B, none, theta, h[3:], curvature)
        for k in range(6):
            T = A if k < 3 else B
            axis = k % 3
            if axis == 0:
                s = 0.5 * (T[2, 1] - T[1, 2])
                h0, h1, h2 = T[1, 1] + T[2, 2], -T[0, 1], -T[0, 2]
            elif axis == 1:
                s = 0.5 * (T[2, 0] - T[0, 2])
                h0, h1, h2 = T[1, 0], -T[0, 0] - T[2, 2], T[1, 2]
            else:
                s = 0.5 * (T[1, 0] - T[0, 1])
                h0, h1, h2 = -T[2, 0], -T[2, 1], T[0, 0] + T[1, 1]
            scale = 0.5 / np.sqrt(1.0 - s * s)
            h0, h1, h2 = scale * h0, scale * h1, scale * h2
            if far_a if k < 3 else far_b:
                h0, h1, h2 = h[k, 0], h[k, 1], h[k, 2]
            row = rate[1 + k]
            own = 3 if k < 3 else 6
            row[own], row[own + 1], row[own + 2] = h0, h1, h2
            row[1] = -h2 / l
            row[2] = (h0 * eta + h1) / l
            row[3] -= h0 * A[1, 1] / v1
            row[4] += h0 * A[0, 1] / v1
            row[6] -= h0 * B[1, 1] / v1
            row[7] += h0 * B[0, 1] / v1
        l0 = rest_length[e]
        EA, GJ, EIy, EIz = stiffness[e, 0], stiffness[e, 1], stiffness[e, 2], stiffness[e, 3]
        if by_z:
            EIy, EIz = EIz, EIy
        for k in range(7):
            for j in range(9):
                if k == 0:
                    turned[j] = EA / l0 * rate[0, j]
                elif k == 1 or k == 4:
                    turned[j] = (GJ if k == 1 else -GJ) / l0 * (rate[1, j] - rate[4, j])
                else:
                    other = k + 3 if k < 4 else k - 3
                    bending = EIy if k == 2 or k == 5 else EIz
                    turned[j] = bending / l0 * (4.0 * rate[k, j] + 2.0 * rate[other, j])
            for i in range(3):
                along = E[i, 0] * turned[0] + E[i, 1] * turned[1] + E[i, 2] * turned[2]
                result[e, k, i] = -along
                result[e, k, 6 + i] = along
                result[e, k, 3 + i] = E[i, 0] * turned[3] + E[i, 1] * turned[4] + E[i, 2] * turned[5]
                result[e, k, 9 + i] = E[i, 0] * turned[6] + E[i, 1] * turned[7] + E[i, 2] * turned[8]
        if by_z:
            _back(result[e])


@njit(cache=True, error_model="numpy", inline="always", fastmath={"contract"})
def triads(positions, quaternions, frame, a, b, E, A, B, Q):  # type: ignore[no-untyped-def]
    """Fills the element triad E in global axes and the ends' triads A and B in element axes; returns the
    length.
    """
    dx = positions[b, 0] - positions[a, 0]
    dy = positions[b, 1] - positions[a, 1]
    dz = positions[b, 2] - positions[a, 2]
    l = np.sqrt(dx * dx + dy * dy + dz * dz)
    E[0, 0], E[1, 0], E[2, 0] = dx / l, dy / l, dz / l
    matrix(quaternions[a], Q)
    for i in range(3):
        for j in range(3):
            A[i, j] = Q[i, 0] * frame[0, 0, j] + Q[i, 1] * frame[0, 1, j] + Q[i, 2] * frame[0, 2, j]
    matrix(quaternions[b], Q)
    for i in range(3):
        for j in range(3):
            B[i, j] = Q[i, 0] * frame[1, 0, j] + Q[i, 1] * frame[1, 1, j] + Q[i, 2] * frame[1, 2, j]
    vx, vy, vz = A[0, 1] + B[0, 1], A[1, 1] + B[1, 1], A[2, 1] + B[2, 1]
    zx = E[1, 0] * vz - E[2, 0] * vy
    zy = E[2, 0] * vx - E[0, 0] * vz
    zz = E[0, 0] * vy - E[1, 0] * vx
    size = np.sqrt(zx * zx + zy * zy + zz * zz)
    E[0, 2], E[1, 2], E[2, 2] = zx / size, zy / size, zz / size
    E[0, 1] = E[1, 2] * E[2, 0] - E[2, 2] * E[1, 0]
    E[1, 1] = E[2, 2] * E[0, 0] - E[0, 2] * E[2, 0]
    E[2, 1] = E[0, 2] * E[1, 0] - E[1, 2] * E[0, 0]
    for j in range(3):  # into element axes, column by column
        p, q, r = A[0, j], A[1, j], A[2, j]
        A[0, j] = E[0, 0] * p + E[1, 0] * q + E[2, 0] * r
        A[1, j] = E[0, 1] * p + E[1, 1] * q + E[2, 1] * r
        A[2, j] = E[0, 2] * p + E[1, 2] * q + E[2, 2] * r
        p, q, r = B[0, j], B[1, j], B[2, j]
        B[0, j] = E[0, 0] * p + E[1, 0] * q + E[2, 0] * r
        B[1, j] = E[0, 1] * p + E[1, 1] * q + E[2, 1] * r
        B[2, j] = E[0, 2] * p + E[1, 2] * q + E[2, 2] * r
    return l
