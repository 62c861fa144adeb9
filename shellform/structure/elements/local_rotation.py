"""Local rotations of a beam's ends that are too large for the arcsines of equation (12).

With R a triad in element axes, s its axial part sin(t) n, and v = t n its rotation vector, t up to 180
degrees, equation (12) reads a_k = arcsin(s_k). That is exact about one axis up to 90 degrees, where it turns
back: a reversed element would cost nothing. The rotation vector is exact about any axis up to 180 degrees.
The two agree about one axis, and to the third order about several; from 45 to 75 degrees one goes over into
the other,

    theta = v + q (a - v),   q(cos t) from 1 to 0 with three continuous derivatives,

so that below 45 degrees the paper's measure holds as it is printed.

Derivatives are by a rotation increment w of the end, R <- exp(S(w)) R, at fixed element axes, to the second
order in w. With J = I - S(v)/2 + c S(v)², c = (1 - t/2 cot(t/2))/t²,

    dv = J w,
    m·d²v = sym[J'S(m)/2 + c (S(v)'S(m)J - J'S(m × v)) + c'/t v (S(v)²m)'],

and for T = tr R: dT = -2 s·w, d²T = sym(R) - T I.
"""

from __future__ import annotations

import numpy as np

from shellform.compiled import njit

NEAR = 1.0 + 2.0 * np.cos(np.radians(45.0))  # trace of a triad above which equation (12) holds as printed
_FAR = 1.0 + 2.0 * np.cos(np.radians(75.0))  # and below which the rotation vector does


@njit(cache=True, error_model="numpy")
def turned_far(T, moment, theta, h, curvature):  # type: ignore[no-untyped-def]
    """For an end whose triad T (3, 3), element axes, has a trace below NEAR: fills its local rotations
    `theta` (3,), their gradients `h` (3, 3) by the end's rotation increment, and `curvature` (3, 3), the
    symmetric second derivatives times the `moment` (3,). Signs as in (12). Returns the angle, rad.
    """
    sign = np.array([1.0, -1.0, 1.0])
    v, angle = _vector(T)
    trace = T[0, 0] + T[1, 1] + T[2, 2]
    half = 0.5 * angle
    cot = np.cos(half) / np.sin(half)
    c = (1.0 - half * cot) / angle**2
    # c' = (half / sin² - cot) / (2 t²) - 2 c / t
    slope = (half / np.sin(half) ** 2 - cot) / (2.0 * angle**2) - 2.0 * c / angle
    S = _skew(v)
    SS = S @ S
    J = np.eye(3) - 0.5 * S + c * SS
    m = sign * moment
    mS = _skew(m)
    mv = np.array([m[1] * v[2] - m[2] * v[1], m[2] * v[0] - m[0] * v[2], m[0] * v[1] - m[1] * v[0]])
    JT, ST = np.ascontiguousarray(J.T), np.ascontiguousarray(S.T)
    second = 0.5 * (JT @ mS) + c * (ST @ (mS @ J) - JT @ _skew(mv))
    bent = SS @ m
    for i in range(3):
        for j in range(3):
            second[i, j] += slope / angle * v[i] * bent[j]
    for k in range(3):
        theta[k] = sign[k] * v[k]
        for i in range(3):
            h[k, i] = sign[k] * J[k, i]
            curvature[k, i] = 0.5 * (second[k, i] + second[i, k])
    if trace.real > _FAR:
        _blend(T, trace, moment, theta, h, curvature)
    return angle.real


@njit(cache=True, error_model="numpy")
def _blend(T, trace, moment, theta, h, curvature):  # type: ignore[no-untyped-def]
    """Leads the rotation vector's values over to those of equation (12)."""
    s = np.empty_like(theta)
    s[0], s[1], s[2] = 0.5 * (T[2, 1] - T[1, 2]), 0.5 * (T[2, 0] - T[0, 2]), 0.5 * (T[1, 0] - T[0, 1])
    own = np.empty_like(h)  # gradients of s, then of the arcsines
    own[0, 0], own[0, 1], own[0, 2] = T[1, 1] + T[2, 2], -T[0, 1], -T[0, 2]
    own[1, 0], own[1, 1], own[1, 2] = T[1, 0], -T[0, 0] - T[2, 2], T[1, 2]
    own[2, 0], own[2, 1], own[2, 2] = -T[2, 0], -T[2, 1], T[0, 0] + T[1, 1]
    # The arcsines' second derivatives: those of s, sym(Q) - tr(Q) I, and the arcsine's own.
    Q = np.empty_like(h)
    cosine = np.sqrt(1.0 - s * s)
    w = 0.5 * moment / cosine
    for i in range(3):
        Q[i, 0] = -w[1] * T[i, 2] - w[2] * T[i, 1]
        Q[i, 1] = w[2] * T[i, 0] - w[0] * T[i, 2]
        Q[i, 2] = w[0] * T[i, 1] + w[1] * T[i, 0]
    second = 0.5 * (Q + Q.T) - (Q[0, 0] + Q[1, 1] + Q[2, 2]) * np.eye(3)
    gap = np.empty_like(theta)
    for k in range(3):
        gap[k] = np.arcsin(s[k]) - theta[k]
        for i in range(3):
            own[k, i] *= 0.5 / cosine[k]
        for i in range(3):
            for j in range(3):
                second[i, j] += moment[k] * s[k] / cosine[k] * own[k, i] * own[k, j]
    # q = x⁴ (35 - 84 x + 70 x² - 20 x³) and its derivatives by the trace.
    width = NEAR - _FAR
    x = (trace - _FAR) / width
    q = x**4 * (35.0 + x * (-84.0 + x * (70.0 - 20.0 * x)))
    dq = 140.0 * (x * (1.0 - x)) ** 3 / width
    ddq = 420.0 * (x * (1.0 - x)) ** 2 * (1.0 - 2.0 * x) / width**2
    dt = np.empty_like(theta)  # of the trace: -2 s, the axial part with its right-handed signs
    dt[0], dt[1], dt[2] = -2.0 * s[0], 2.0 * s[1], -2.0 * s[2]
    work = moment[0] * gap[0] + moment[1] * gap[1] + moment[2] * gap[2]
    lead = np.zeros_like(theta)
    for i in range(3):
        for k in range(3):
            lead[i] += moment[k] * (own[k, i] - h[k, i])
    for i in range(3):
        for j in range(3):
            turning = 0.5 * (T[i, j] + T[j, i]) - (trace if i == j else 0.0)
            curvature[i, j] += (
                q * (second[i, j] - curvature[i, j])
                + dq * (dt[i] * lead[j] + lead[i] * dt[j])
                + work * (ddq * dt[i] * dt[j] + dq * turning)
            )
    for k in range(3):
        theta[k] += q * gap[k]
        for i in range(3):
            h[k, i] += q * (own[k, i] - h[k, i]) + dq * gap[k] * dt[i]


@njit(cache=True, error_model="numpy")
def _vector(R):  # type: ignore[no-untyped-def]
    """The rotation vector (3,) of a rotation matrix by more than a few degrees, and its angle, up to pi, by
    Shepperd's quaternion; complex matrices for complex steps.
    """
    trace = R[0, 0] + R[1, 1] + R[2, 2]
    p, most = -1, trace.real
    for i in range(3):
        if R[i, i].real > most:
            p, most = i, R[i, i].real
    axis = np.empty(3, R.dtype)
    if p < 0:
        w = 1.0 + trace
        axis[0], axis[1], axis[2] = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]
    else:
        j, k = (p + 1) % 3, (p + 2) % 3
        w = R[k, j] - R[j, k]
        axis[p] = 1.0 + 2.0 * R[p, p] - trace
        axis[j], axis[k] = R[j, p] + R[p, j], R[k, p] + R[p, k]
    if w.real < 0.0:
        w = -w
        axis = -axis
    size = np.sqrt(axis[0] ** 2 + axis[1] ** 2 + axis[2] ** 2)
    whole = np.sqrt(size * size + w * w)
    sine, cosine = size / whole, w / whole
    # The arcsine of the smaller one loses no digits.
    angle = 2.0 * np.arcsin(sine) if sine.real < cosine.real else np.pi - 2.0 * np.arcsin(cosine)
    return angle / size * axis, angle


@njit(cache=True)
def _skew(v):  # type: ignore[no-untyped-def]
    S = np.zeros((3, 3), v.dtype)
    S[0, 1], S[0, 2], S[1, 2] = -v[2], v[1], -v[0]
    S[1, 0], S[2, 0], S[2, 1] = v[2], -v[1], v[0]
    return S
