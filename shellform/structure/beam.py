"""Co-rotational Euler-Bernoulli beams (section 3.1, equations 12 to 21).

Letters, all of one element: a, b the two ends; a_x, a_y, a_z and b_x, b_y, b_z the nodal triads (columns of `A`, `B` in
the kernel, in element axes); e_x, e_y, e_z the element triad (`E`); d = x_b - x_a, l = |d|, l0 the rest length;
theta the six local rotations (12), M their moments, N the axial force (15, 18); phi the spin of the element triad.

The element triad has e_x along the chord and e_z along e_x × (a_y + b_y). Crisfield's mean triad has the same limit for
small local rotations but is not exactly conservative (findings: 8e-3 relative at 0.5 rad); with this one the local
deformations (12) are smooth functions of the ends' positions and rotations, so that

    U = 1/2 u' K u,   u = (l - l0, theta)                                          energy (18)
    f = dU/dx                                                                       end forces (19, 20)

hold exactly. With c_k = M_k / (2 cos theta_k) the moments on the triads are g = sum c_k h_k, where 2 sin theta_k = s_k and
h_k is the gradient of s_k with respect to the spin of its end at fixed E. The triad turns by phi = G (dd, w_a, w_b), and
since U doesn't change when everything turns together,

    f = (N e_x on d, g_a on w_a, g_b on w_b) - G' (g_a + g_b).

The tangent is the derivative of that line, term by term. Rotations don't commute, so the derivative of the end forces by
spins has the skew part -S(m)/2 in the block of each end's moment m; the kernel returns the symmetric rest, which is the
exact Hessian of U. At a node without applied moment the skew parts cancel in equilibrium.

Sign: theta_y and M_y follow the paper's (12), which counts turns about the local y axis negative (left-handed);
theta_x and theta_z are right-handed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from shellform.arrays import Flags, Indices, Reals, indices, reals
from shellform.errors import InputError
from shellform.structure.parts import Evaluation
from shellform.structure.rotation import matrix
from shellform.structure.state import State

_PARALLEL_TO_Z = 1e-6  # rad; nearer to global z than this, the default z axis is global x (model-file.md)


@dataclass(frozen=True)
class Beams:
    """Beams of a network of `nodes` nodes.

    `ends` (m, 2) node numbers; `axial` EA, N; `torsion` GJ, `bending_y` EI_y, `bending_z` EI_z, N·m²; `rest_length`, m; all
    (m,); `frames` (m, 3, 3) with the local axes x, y, z in the stress-free state as columns; `kind` (m,) index into `kinds`.
    """

    ends: Indices
    axial: Reals
    torsion: Reals
    bending_y: Reals
    bending_z: Reals
    rest_length: Reals
    frames: Reals
    kind: Indices
    kinds: tuple[str, ...] = ("rod",)

    def __post_init__(self) -> None:
        count = len(self.ends)
        put = object.__setattr__
        put(self, "ends", indices("beams.ends", self.ends, (count, 2), below=np.iinfo(np.int64).max))
        for name in ("axial", "torsion", "bending_y", "bending_z"):
            put(self, name, reals(f"beams.{name}", getattr(self, name), (count,)))
        put(self, "rest_length", reals("beams.rest_length", self.rest_length, (count,), positive=True))
        put(self, "frames", reals("beams.frames", self.frames, (count, 3, 3)))
        put(self, "kind", indices("beams.kind", self.kind, (count,), below=len(self.kinds)))

    def freedoms(self) -> Indices:
        """Freedoms (m, 12) of each element in the order of x^e below equation (20)."""
        return (6 * self.ends[:, :, None] + np.arange(6)).reshape(-1, 12)

    def evaluate(self, state: State, *, tangent: bool) -> Evaluation:
        """Energy (m,) J, end forces (m, 12) N and N·m, packed lower tangents (m, 78) if asked for (19, 21)."""
        count = len(self.ends)
        energy, force = np.empty(count), np.empty((count, 12))
        blocks = np.empty((count if tangent else 0, 78))
        _evaluate(*self._kernel_input(state), energy, force, blocks, np.empty((0, 7)), np.empty((0, 7)))
        return Evaluation(energy, force, blocks if tangent else None)

    def local_forces(self, state: State) -> Reals:
        """Equation (16): N, Mx_a, My_a, Mz_a, Mx_b, My_b, Mz_b of each beam, (m, 7), N and N·m."""
        return self._local(state)[0]

    def local_deformations(self, state: State) -> Reals:
        """Equation (17): l - l0, m, and the six local rotations, rad, of each beam, (m, 7)."""
        return self._local(state)[1]

    def _local(self, state: State) -> tuple[Reals, Reals]:
        count = len(self.ends)
        forces, deformations = np.empty((count, 7)), np.empty((count, 7))
        inputs = self._kernel_input(state)
        _evaluate(*inputs, np.empty(count), np.empty((count, 12)), np.empty((0, 78)), forces, deformations)
        return forces, deformations

    def _kernel_input(self, state: State) -> tuple[Reals | Indices, ...]:
        stiffness = np.column_stack([self.axial, self.torsion, self.bending_y, self.bending_z])
        return state.positions, state.quaternions, self.ends, self.frames, self.rest_length, stiffness


def make_beams(
    nodes: ArrayLike,
    ends: ArrayLike,
    *,
    axial: ArrayLike,
    torsion: ArrayLike,
    bending_y: ArrayLike,
    bending_z: ArrayLike,
    z_axis: ArrayLike | None = None,
    rest_length: ArrayLike | None = None,
    kind: ArrayLike | None = None,
    kinds: tuple[str, ...] = ("rod",),
) -> Beams:
    """Beams between stress-free `nodes` (n, 3), m; scalars hold for all beams.

    `z_axis` (m, 3): any vector in the local x-z plane; rows of NaN, or None, mean the global z axis, or global x where the
    beam is within 1e-6 rad of it. `rest_length` (m,), None or NaN entries: the distance between the nodes.
    Raises InputError for zero-length beams, non-positive stiffness and a z axis along the beam.
    """
    nodes = reals("nodes", nodes, (None, 3))
    ends = indices("beams.nodes", ends, (None, 2), below=len(nodes))
    count = len(ends)
    chord = nodes[ends[:, 1]] - nodes[ends[:, 0]]
    length = np.linalg.norm(chord, axis=1)
    if (length == 0.0).any():
        beam = int(np.argmin(length))
        raise InputError(
            "the two nodes of the beam coincide",
            where=f"beams[{beam}]",
            value=[int(i) for i in ends[beam]],
            remedy="Remove the beam or move a node.",
        )
    asked = np.full((count, 3), np.nan) if z_axis is None else np.asarray(z_axis, dtype=float)
    frames = _frames(chord / length[:, None], asked)
    rest = np.full(count, np.nan) if rest_length is None else np.asarray(rest_length, dtype=float)
    numbers = {
        name: reals(f"beams.{name}", np.broadcast_to(np.asarray(value, dtype=float), (count,)), (count,), positive=True)
        for name, value in [("EA", axial), ("GJ", torsion), ("EIy", bending_y), ("EIz", bending_z)]
    }
    return Beams(
        ends,
        numbers["EA"],
        numbers["GJ"],
        numbers["EIy"],
        numbers["EIz"],
        np.where(np.isnan(rest), length, rest),
        frames,
        np.zeros(count, dtype=np.int64) if kind is None else np.asarray(kind),
        kinds,
    )


def _frames(x_axis: Reals, z_axis: Reals) -> Reals:
    default: Flags = np.asarray(np.isnan(z_axis).any(axis=1))
    upright: Flags = np.linalg.norm(x_axis[:, :2], axis=1) < _PARALLEL_TO_Z
    ordinary = np.where(upright[:, None], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0])
    z: Reals = np.where(default[:, None], ordinary, z_axis)
    y_axis = np.cross(z, x_axis)
    size = np.linalg.norm(y_axis, axis=1)
    along: Flags = size <= 1e-9 * np.linalg.norm(z, axis=1)
    if along.any():
        beam = int(np.argmax(along))
        remedy = "Give any vector that is not along the beam."
        raise InputError("z_axis is zero or along the beam", where=f"beams[{beam}]", value=z[beam].tolist(), remedy=remedy)
    y_axis /= size[:, None]
    return np.stack([x_axis, y_axis, np.cross(x_axis, y_axis)], axis=2)


@njit(cache=True, error_model="numpy")
def _evaluate(  # type: ignore[no-untyped-def]
    positions, quaternions, ends, frames, rest_length, stiffness, energy, force, blocks, local_force, local_deformation
):
    """One pass over the beams; `blocks`, `local_force`, `local_deformation` are filled where they have rows."""
    E = np.empty((3, 3))
    R = np.empty((3, 3))
    A = np.empty((3, 3))
    B = np.empty((3, 3))
    P = np.empty((3, 3))
    h = np.empty((6, 3))  # gradients of s_k by the spin of their end, E fixed
    c = np.empty(6)
    theta = np.empty(6)
    cosine = np.empty(6)
    moment = np.empty(6)
    g = np.empty((2, 3))
    Ma = np.empty((3, 3))
    Mb = np.empty((3, 3))
    G = np.zeros((3, 9))
    dg = np.empty((2, 3, 9))
    K = np.empty((9, 9))
    W = np.empty((6, 6))
    for e in range(ends.shape[0]):
        a, b = ends[e, 0], ends[e, 1]
        l0 = rest_length[e]
        EA, GJ, EIy, EIz = stiffness[e, 0], stiffness[e, 1], stiffness[e, 2], stiffness[e, 3]
        dx = positions[b, 0] - positions[a, 0]
        dy = positions[b, 1] - positions[a, 1]
        dz = positions[b, 2] - positions[a, 2]
        l = np.sqrt(dx * dx + dy * dy + dz * dz)
        E[0, 0], E[1, 0], E[2, 0] = dx / l, dy / l, dz / l

        # Nodal triads in global axes, kept in A and B until E is known.
        matrix(quaternions[a], R)
        for i in range(3):
            for j in range(3):
                A[i, j] = R[i, 0] * frames[e, 0, j] + R[i, 1] * frames[e, 1, j] + R[i, 2] * frames[e, 2, j]
        matrix(quaternions[b], R)
        for i in range(3):
            for j in range(3):
                B[i, j] = R[i, 0] * frames[e, 0, j] + R[i, 1] * frames[e, 1, j] + R[i, 2] * frames[e, 2, j]
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

        # Local rotations (12) and moments (15, 18); order xa, ya, za, xb, yb, zb.
        theta[0], theta[1], theta[2] = 0.5 * (A[2, 1] - A[1, 2]), 0.5 * (A[2, 0] - A[0, 2]), 0.5 * (A[1, 0] - A[0, 1])
        theta[3], theta[4], theta[5] = 0.5 * (B[2, 1] - B[1, 2]), 0.5 * (B[2, 0] - B[0, 2]), 0.5 * (B[1, 0] - B[0, 1])
        for k in range(6):
            cosine[k] = np.sqrt(1.0 - theta[k] * theta[k])
            theta[k] = np.arcsin(theta[k])
        N = EA * (l - l0) / l0
        moment[0] = GJ * (theta[0] - theta[3]) / l0
        moment[1] = EIy * (4.0 * theta[1] + 2.0 * theta[4]) / l0
        moment[2] = EIz * (4.0 * theta[2] + 2.0 * theta[5]) / l0
        moment[3] = -moment[0]
        moment[4] = EIy * (2.0 * theta[1] + 4.0 * theta[4]) / l0
        moment[5] = EIz * (2.0 * theta[2] + 4.0 * theta[5]) / l0
        U = N * (l - l0)
        for k in range(6):
            U += moment[k] * theta[k]
            c[k] = 0.5 * moment[k] / cosine[k]
        energy[e] = 0.5 * U
        if local_force.shape[0] > 0:
            local_force[e, 0], local_deformation[e, 0] = N, l - l0
            for k in range(6):
                local_force[e, 1 + k], local_deformation[e, 1 + k] = moment[k], theta[k]

        # g = sum c_k h_k on each end is the axial vector of P = sum +-c_k (triad vector)(element axis)'; M = P - tr(P) I.
        for end in range(2):
            T = A if end == 0 else B
            M = Ma if end == 0 else Mb
            cx, cy, cz = c[3 * end], c[3 * end + 1], c[3 * end + 2]
            for i in range(3):
                P[i, 0] = -cy * T[i, 2] - cz * T[i, 1]
                P[i, 1] = cz * T[i, 0] - cx * T[i, 2]
                P[i, 2] = cx * T[i, 1] + cy * T[i, 0]
            g[end, 0], g[end, 1], g[end, 2] = P[1, 2] - P[2, 1], P[2, 0] - P[0, 2], P[0, 1] - P[1, 0]
            trace = P[0, 0] + P[1, 1] + P[2, 2]
            for i in range(3):
                for j in range(3):
                    M[i, j] = P[i, j]
                M[i, i] -= trace
        gx, gy, gz = g[0, 0] + g[1, 0], g[0, 1] + g[1, 1], g[0, 2] + g[1, 2]

        # Spin of the element triad: phi = G (dd, w_a, w_b) keeps e_x on the chord and e_z normal to v = a_y + b_y.
        v0, v1 = A[0, 1] + B[0, 1], A[1, 1] + B[1, 1]
        nu = 1.0 / v1
        eta = v0 * nu
        G[0, 2], G[1, 2], G[2, 1] = -eta / l, -1.0 / l, 1.0 / l
        G[0, 3], G[0, 4] = nu * A[1, 1], -nu * A[0, 1]
        G[0, 6], G[0, 7] = nu * B[1, 1], -nu * B[0, 1]

        # End forces in element axes: on d, then on the two ends' spins.
        fd1 = -(gz / l)
        fd2 = (gy + eta * gx) / l
        ma0, ma1, ma2 = g[0, 0] - G[0, 3] * gx, g[0, 1] - G[0, 4] * gx, g[0, 2]
        mb0, mb1, mb2 = g[1, 0] - G[0, 6] * gx, g[1, 1] - G[0, 7] * gx, g[1, 2]
        for i in range(3):
            along = E[i, 0] * N + E[i, 1] * fd1 + E[i, 2] * fd2
            force[e, i] = -along
            force[e, 6 + i] = along
            force[e, 3 + i] = E[i, 0] * ma0 + E[i, 1] * ma1 + E[i, 2] * ma2
            force[e, 9 + i] = E[i, 0] * mb0 + E[i, 1] * mb1 + E[i, 2] * mb2
        if blocks.shape[0] == 0:
            continue

        # h_k / (2 cos theta_k): gradients of the local rotations by the spin of their end.
        for end in range(2):
            T = A if end == 0 else B
            k = 3 * end
            s = 0.5 / cosine[k]
            h[k, 0], h[k, 1], h[k, 2] = s * (T[1, 1] + T[2, 2]), -s * T[0, 1], -s * T[0, 2]
            s = 0.5 / cosine[k + 1]
            h[k + 1, 0], h[k + 1, 1], h[k + 1, 2] = s * T[1, 0], s * (-T[0, 0] - T[2, 2]), s * T[1, 2]
            s = 0.5 / cosine[k + 2]
            h[k + 2, 0], h[k + 2, 1], h[k + 2, 2] = -s * T[2, 0], -s * T[2, 1], s * (T[0, 0] + T[1, 1])
        # Derivatives of the moments by the local rotations, with the arcsine's own curvature on the diagonal.
        W[:] = 0.0
        W[0, 0] = W[3, 3] = GJ / l0
        W[0, 3] = W[3, 0] = -GJ / l0
        W[1, 1] = W[4, 4] = 4.0 * EIy / l0
        W[1, 4] = W[4, 1] = 2.0 * EIy / l0
        W[2, 2] = W[5, 5] = 4.0 * EIz / l0
        W[2, 5] = W[5, 2] = 2.0 * EIz / l0
        for k in range(6):
            W[k, k] += moment[k] * np.sin(theta[k]) / cosine[k]

        # Derivative of g on each end by (dd, w_a, w_b): Q (w - phi) + M w - M' phi.
        for end in range(2):
            M = Ma if end == 0 else Mb
            for i in range(3):
                qa0 = qa1 = qa2 = qb0 = qb1 = qb2 = 0.0
                for k in range(3 * end, 3 * end + 3):
                    kk = k - 3 * end  # the same axis at the ends a and b
                    wa, wb = h[k, i] * W[k, kk], h[k, i] * W[k, kk + 3]
                    qa0 += wa * h[kk, 0]
                    qa1 += wa * h[kk, 1]
                    qa2 += wa * h[kk, 2]
                    qb0 += wb * h[kk + 3, 0]
                    qb1 += wb * h[kk + 3, 1]
                    qb2 += wb * h[kk + 3, 2]
                t0, t1, t2 = qa0 + qb0 + M[0, i], qa1 + qb1 + M[1, i], qa2 + qb2 + M[2, i]
                for j in range(9):
                    dg[end, i, j] = -(t0 * G[0, j] + t1 * G[1, j] + t2 * G[2, j])
                dg[end, i, 3] += qa0
                dg[end, i, 4] += qa1
                dg[end, i, 5] += qa2
                dg[end, i, 6] += qb0
                dg[end, i, 7] += qb1
                dg[end, i, 8] += qb2
                for j in range(3):
                    dg[end, i, 3 + 3 * end + j] += M[i, j]

        # K = d(force)/d(d, w_a, w_b): axial part, then the triads' moments, then -G' dg, then -(dG)' g column by column.
        for i in range(9):
            for j in range(9):
                total = 0.0
                if i >= 3:
                    total = dg[(i - 3) // 3, (i - 3) % 3, j]
                for r in range(3):
                    total -= G[r, i] * (dg[0, r, j] + dg[1, r, j])
                K[i, j] = total
        K[0, 0] += EA / l0
        K[1, 1] += N / l
        K[2, 2] += N / l
        gd1, gd2 = gz / l, -(gy + eta * gx) / l  # G' g on d
        for j in range(9):
            p0, p1, p2 = G[0, j], G[1, j], G[2, j]  # phi of a unit in column j
            w0, w1, w2 = 1.0 if j == 3 else 0.0, 1.0 if j == 4 else 0.0, 1.0 if j == 5 else 0.0
            u0, u1, u2 = 1.0 if j == 6 else 0.0, 1.0 if j == 7 else 0.0, 1.0 if j == 8 else 0.0
            dv0 = w1 * A[2, 1] - w2 * A[1, 1] + u1 * B[2, 1] - u2 * B[1, 1]
            dv1 = w2 * A[0, 1] - w0 * A[2, 1] + u2 * B[0, 1] - u0 * B[2, 1]
            d_ev0 = v1 * p2 + dv0
            d_ev1 = -v0 * p2 + dv1
            d_eta = nu * (d_ev0 - eta * d_ev1)
            d_nu = -nu * nu * d_ev1
            d_gx = gy * p2 - gz * p1
            d_gy = gz * p0 - gx * p2
            d_gz = gx * p1 - gy * p0
            stretch = 1.0 / l if j == 0 else 0.0
            s = gy + eta * gx
            ds = d_gy + d_eta * gx + eta * d_gx
            K[0, j] -= (-s * p1 - gz * p2) / l
            K[1, j] -= (s * p0 + d_gz) / l - gd1 * stretch
            K[2, j] -= (-ds + gz * p0) / l - gd2 * stretch
            k = d_nu * gx + nu * d_gx
            n = nu * gx
            dot = A[0, 1] * p0 + A[1, 1] * p1 + A[2, 1] * p2
            K[3, j] -= k * A[1, 1] + n * (A[0, 1] * w2 - w0 * A[2, 1] + p0 * A[2, 1])
            K[4, j] -= -k * A[0, 1] + n * (A[1, 1] * w2 - w1 * A[2, 1] + p1 * A[2, 1])
            K[5, j] -= n * (A[2, 1] * w2 - w2 * A[2, 1] + p2 * A[2, 1] - dot)
            dot = B[0, 1] * p0 + B[1, 1] * p1 + B[2, 1] * p2
            K[6, j] -= k * B[1, 1] + n * (B[0, 1] * u2 - u0 * B[2, 1] + p0 * B[2, 1])
            K[7, j] -= -k * B[0, 1] + n * (B[1, 1] * u2 - u1 * B[2, 1] + p1 * B[2, 1])
            K[8, j] -= n * (B[2, 1] * u2 - u2 * B[2, 1] + p2 * B[2, 1] - dot)
        _pack(E, K, blocks[e])


@njit(cache=True)
def _pack(E, K, out):  # type: ignore[no-untyped-def]
    """The symmetric part of K (9, 9), element axes, as the packed lower triangle (78,) over 12 freedoms, global axes."""
    S = np.empty((9, 9))
    T = np.empty((9, 9))
    for i in range(9):
        for j in range(9):
            S[i, j] = 0.5 * (K[i, j] + K[j, i])
    for i in range(9):  # S times E' from the right
        for q in range(3):
            for j in range(3):
                T[i, 3 * q + j] = S[i, 3 * q] * E[j, 0] + S[i, 3 * q + 1] * E[j, 1] + S[i, 3 * q + 2] * E[j, 2]
    for p in range(3):  # E from the left
        for j in range(9):
            for i in range(3):
                S[3 * p + i, j] = E[i, 0] * T[3 * p, j] + E[i, 1] * T[3 * p + 1, j] + E[i, 2] * T[3 * p + 2, j]
    at = 0
    for r in range(12):
        # Rows and columns of x_a are minus those of d, those of x_b are d itself.
        p, sp = (r, -1.0) if r < 3 else ((r, 1.0) if r < 6 else ((r - 6, 1.0) if r < 9 else (r - 3, 1.0)))
        for s in range(r + 1):
            q, sq = (s, -1.0) if s < 3 else ((s, 1.0) if s < 6 else ((s - 6, 1.0) if s < 9 else (s - 3, 1.0)))
            out[at] = sp * sq * S[p, q]
            at += 1
