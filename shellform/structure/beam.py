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
from shellform.structure.threads import share

_NOTHING = np.empty((0, 78))
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

    def evaluate(self, state: State, *, tangent: bool, into: Reals | None = None) -> Evaluation:
        """Energy (m,) J, end forces (m, 12) N and N·m, packed lower tangents (m, 78) if asked for (19, 21), filled `into`."""
        count = len(self.ends)
        energy, force = np.empty(count), np.empty((count, 12))
        blocks = _NOTHING if not tangent else np.empty((count, 78)) if into is None else into
        share(_evaluate, count, *self._kernel_input(state), energy, force, blocks, _NOTHING, _NOTHING)
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
        share(
            _evaluate, count, *inputs, np.empty(count), np.empty((count, 12)), _NOTHING, forces, deformations
        )
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
        name: reals(
            f"beams.{name}",
            np.broadcast_to(np.asarray(value, dtype=float), (count,)),
            (count,),
            positive=True,
        )
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
        raise InputError(
            "z_axis is zero or along the beam", where=f"beams[{beam}]", value=z[beam].tolist(), remedy=remedy
        )
    y_axis /= size[:, None]
    return np.stack([x_axis, y_axis, np.cross(x_axis, y_axis)], axis=2)


@njit(cache=True, error_model="numpy", nogil=True)
def _evaluate(  # type: ignore[no-untyped-def]
    start,
    stop,
    positions,
    quaternions,
    ends,
    frames,
    rest_length,
    stiffness,
    energy,
    force,
    blocks,
    local_force,
    local_deformation,
):
    """One pass over the beams from `start` to `stop`; `blocks`, `local_force`, `local_deformation` are filled where they have rows."""
    E = np.empty((3, 3))
    A = np.empty((3, 3))
    B = np.empty((3, 3))
    Q = np.empty((3, 3))  # of a node, then of a quaternion's matrix
    h = np.empty((6, 3))  # gradients of s_k by the spin of their end, E fixed
    c = np.empty(6)
    theta = np.empty(6)
    sine, cosine = np.empty(6), np.empty(6)
    moment = np.empty(6)
    g = np.empty((2, 3))
    Ma = np.empty((3, 3))
    Mb = np.empty((3, 3))
    near_a, near_b, far = (
        np.empty(3),
        np.empty(3),
        np.empty(3),
    )  # derivatives of moments by rotations: same end, other end
    P = np.empty((6, 6))
    R = np.empty((3, 6))
    S = np.empty((3, 3))
    alpha = np.zeros(6)
    K = np.empty((9, 9))
    for e in range(start, stop):
        a, b = ends[e, 0], ends[e, 1]
        l0 = rest_length[e]
        EA, GJ, EIy, EIz = stiffness[e, 0], stiffness[e, 1], stiffness[e, 2], stiffness[e, 3]
        dx = positions[b, 0] - positions[a, 0]
        dy = positions[b, 1] - positions[a, 1]
        dz = positions[b, 2] - positions[a, 2]
        l = np.sqrt(dx * dx + dy * dy + dz * dz)
        E[0, 0], E[1, 0], E[2, 0] = dx / l, dy / l, dz / l

        # Nodal triads in global axes, kept in A and B until E is known.
        matrix(quaternions[a], Q)
        for i in range(3):
            for j in range(3):
                A[i, j] = Q[i, 0] * frames[e, 0, j] + Q[i, 1] * frames[e, 1, j] + Q[i, 2] * frames[e, 2, j]
        matrix(quaternions[b], Q)
        for i in range(3):
            for j in range(3):
                B[i, j] = Q[i, 0] * frames[e, 0, j] + Q[i, 1] * frames[e, 1, j] + Q[i, 2] * frames[e, 2, j]
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
        for k in range(6):
            sine[k] = theta[k]
            cosine[k] = np.sqrt(1.0 - sine[k] * sine[k])
            theta[k] = np.arcsin(sine[k])
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

        # g = sum c_k h_k on each end is the axial vector of Q = sum +-c_k (triad vector)(element axis)'; M = Q - tr(Q) I.
        for end in range(2):
            T = A if end == 0 else B
            M = Ma if end == 0 else Mb
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

        # Spin of the element triad: phi = G (dd, w_a, w_b) keeps e_x on the chord and e_z normal to v = a_y + b_y.
        v0, v1 = A[0, 1] + B[0, 1], A[1, 1] + B[1, 1]
        nu = 1.0 / v1
        eta = v0 * nu
        # G's first row is (0, 0, -eta / l, alpha), its others turn d2 and d1 over l.
        alpha[0], alpha[1], alpha[3], alpha[4] = nu * A[1, 1], -nu * A[0, 1], nu * B[1, 1], -nu * B[0, 1]

        # End forces in element axes: on d, then on the two ends' spins.
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

        near_a[0], near_a[1], near_a[2] = GJ / l0, 4.0 * EIy / l0, 4.0 * EIz / l0
        far[0], far[1], far[2] = -GJ / l0, 2.0 * EIy / l0, 2.0 * EIz / l0
        for k in range(3):
            near_b[k] = near_a[k] + moment[k + 3] * sine[k + 3] / cosine[k + 3]
            near_a[k] += moment[k] * sine[k] / cosine[k]

        # P: the quadratic form of the two ends' spins with the element triad at rest, from the derivatives of the moments by
        # the local rotations, the arcsine's own curvature with them, and from the triads' moments' own turning M.
        for i in range(3):
            for j in range(3):
                aa = bb = ab = 0.0
                for k in range(3):
                    aa += near_a[k] * h[k, i] * h[k, j]
                    bb += near_b[k] * h[k + 3, i] * h[k + 3, j]
                    ab += far[k] * h[k, i] * h[k + 3, j]
                P[i, j] = aa
                P[3 + i, 3 + j] = bb
                P[i, 3 + j] = ab
                P[3 + j, i] = ab
        # R, S: how spins of the element triad (phi, the same at both ends) couple with the ends' spins and with themselves.
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

        # Minus the symmetric part of (dG)' g: the lever arms of the ends' moments change with the chord and with v.
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
            # d1 and d2 against this end's spins; each term and its transpose have a half.
            K[o, 1] -= 0.5 * (a1 * nu * s + eta * gx * m0) * il
            K[o + 1, 1] -= 0.5 * (-a0 * nu * s + eta * gx * m1) * il
            K[o, 2] -= 0.5 * (a1 * nu * gz - n * eta * a2 - eta * nu * gx * a2) * il
            K[o + 1, 2] -= 0.5 * (-a0 * nu * gz - n * a2 - nu * gx * a2) * il
            K[o + 2, 2] -= 0.5 * (n * (a0 * eta + a1) + nu * gx * (a1 + eta * a0)) * il
            # This end's spins against themselves.
            nn = nu * n
            K[o, o] -= nn * a2 * a1 + n * a2 * (m0 - 1.0)
            K[o + 1, o] -= 0.5 * (-nn * a2 * a0 + n * m1 * a2)
            K[o + 2, o] -= 0.5 * (n * a0 - nn * a0 * a1 - n * a0 * m0)
            K[o + 1, o + 1] += n * a2
            K[o + 2, o + 1] -= 0.5 * (n * a1 + nn * a0 * a0 - n * a0 * m1)
        # The two ends' spins against each other.
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


@njit(cache=True, error_model="numpy", inline="always")
def _pack(E, K, out):  # type: ignore[no-untyped-def]
    """The symmetric matrix with lower triangle K (9, 9), element axes, as packed lower triangle (78,) of 12 freedoms, global axes."""
    X = np.empty((3, 3))
    Y = np.empty((3, 3))
    for p in range(3):
        for q in range(p + 1):
            for i in range(3):
                for j in range(3):
                    X[i, j] = K[3 * p + i, 3 * q + j] if p > q or i >= j else K[3 * p + j, 3 * q + i]
            for i in range(3):
                for j in range(3):
                    Y[i, j] = X[i, 0] * E[j, 0] + X[i, 1] * E[j, 1] + X[i, 2] * E[j, 2]
            for i in range(3):
                for j in range(3):
                    X[i, j] = E[i, 0] * Y[0, j] + E[i, 1] * Y[1, j] + E[i, 2] * Y[2, j]
            # Rows and columns of x_a are minus those of d, those of x_b are d itself.
            if p == 0:
                for i in range(3):
                    for j in range(i + 1):
                        out[_row(i) + j] = X[i, j]
                        out[_row(6 + i) + 6 + j] = X[i, j]
                    for j in range(3):
                        out[_row(6 + i) + j] = -X[i, j]
            elif q == 0:
                own = 3 if p == 1 else 9
                for i in range(3):
                    for j in range(3):
                        out[_row(own + i) + j] = -X[i, j]
                        if p == 1:
                            out[_row(6 + j) + own + i] = X[i, j]
                        else:
                            out[_row(own + i) + 6 + j] = X[i, j]
            else:
                r, c = (3 if p == 1 else 9), (3 if q == 1 else 9)
                for i in range(3):
                    for j in range(3 if p > q else i + 1):
                        out[_row(r + i) + c + j] = X[i, j]


@njit(cache=True, inline="always")
def _row(r):  # type: ignore[no-untyped-def]
    """Where row r of a packed lower triangle begins."""
    return r * (r + 1) // 2
