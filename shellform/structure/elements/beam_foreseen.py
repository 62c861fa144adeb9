"""Deformations of co-rotational beams that a motion leads to, to first order: the independent ones of a mixed
formulation (Assembly.tangent_of).

With a motion y = (dd, w_a, w_b) in element axes the element triad turns by phi = G y (beam_kernels.py), the
stretch grows by d_0 and the sine of a local rotation of equation (12), s_k / 2, by h_k·(w - phi) / 2, h_k the
gradient of s_k by the rotation increment of its end.
"""

from __future__ import annotations

import numpy as np

from shellform.compiled import njit
from shellform.structure.elements.beam_kernels import triads

_MOST = 0.9  # of a sine: the tangent is that of a local rotation of less than 90 degrees


@njit(cache=True, error_model="numpy", nogil=True)
def foreseen(start, stop, positions, quaternions, ends, frames, rest_length, motion, result):  # type: ignore[no-untyped-def]
    """Fills stretch, m, and the sines of the six local rotations (m, 7) to which the `motion` (n, 6) leads
    from a state in which no end is turned farther than equation (12) measures."""
    E, A, B, Q = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    d, w, v, phi, h = np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for e in range(start, stop):
        a, b = ends[e, 0], ends[e, 1]
        l = triads(positions, quaternions, frames[e], a, b, E, A, B, Q)
        for i in range(3):
            d[i], w[i], v[i] = 0.0, 0.0, 0.0
            for j in range(3):
                d[i] += E[j, i] * (motion[b, j] - motion[a, j])
                w[i] += E[j, i] * motion[a, 3 + j]
                v[i] += E[j, i] * motion[b, 3 + j]
        v0, v1 = A[0, 1] + B[0, 1], A[1, 1] + B[1, 1]
        along = A[1, 1] * w[0] - A[0, 1] * w[1] + B[1, 1] * v[0] - B[0, 1] * v[1]
        phi[0] = (along - v0 * d[2] / l) / v1
        phi[1], phi[2] = -d[2] / l, d[1] / l
        result[e, 0] = l - rest_length[e] + d[0]
        for end in range(2):
            T = B if end else A
            for i in range(3):
                h[i] = (v[i] if end else w[i]) - phi[i]
            sx = T[2, 1] - T[1, 2] + (T[1, 1] + T[2, 2]) * h[0] - T[0, 1] * h[1] - T[0, 2] * h[2]
            sy = T[2, 0] - T[0, 2] + T[1, 0] * h[0] - (T[0, 0] + T[2, 2]) * h[1] + T[1, 2] * h[2]
            sz = T[1, 0] - T[0, 1] - T[2, 0] * h[0] - T[2, 1] * h[1] + (T[0, 0] + T[1, 1]) * h[2]
            result[e, 1 + 3 * end] = min(max(0.5 * sx, -_MOST), _MOST)
            result[e, 2 + 3 * end] = min(max(0.5 * sy, -_MOST), _MOST)
            result[e, 3 + 3 * end] = min(max(0.5 * sz, -_MOST), _MOST)
