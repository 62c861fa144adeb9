"""Co-rotational Euler-Bernoulli beams (section 3.1, equations 12 to 21).

Letters, all of one element: a, b the two ends; a_x, a_y, a_z and b_x, b_y, b_z the nodal triads (columns of
`A`, `B` in the kernel, in element axes); e_x, e_y, e_z the element triad (`E`); d = x_b - x_a, l = |d|, l0
the rest length; theta the six local rotations (12), M their moments, N the axial force (15, 18); phi the
rotation increment of the element triad.

The element triad has e_x along the chord and e_z along e_x × (a_y + b_y). Crisfield's mean triad has the same
limit for small local rotations but is not exactly conservative; with
this one the local deformations (12) are smooth functions of the ends' positions and rotations, so that

    U = 1/2 u' K u,   u = (l - l0, theta)                                          energy (18)
    f = dU/dx                                                                       end forces (19, 20)

hold exactly. With c_k = M_k / (2 cos theta_k) the moments on the triads are g = sum c_k h_k, where 2 sin
theta_k = s_k and h_k is the gradient of s_k with respect to the rotation increment of its end at fixed E. The
triad turns by phi = G (dd, w_a, w_b), and since U doesn't change when everything turns together,

    f = (N e_x on d, g_a on w_a, g_b on w_b) - G' (g_a + g_b).

The symmetric tangent that goes with it is the exact Hessian of U (beam_kernels.py).

An element's axes are given at each end, as that end's node sees them when it isn't turned. In an element that
is straight and without stress between its unturned nodes both are the element's own triad. An element built
into a bent structure, an edge beam or a lath locked to another, has its stress-free state there instead: with
the node turned by R in that state, and the element's triad E in it, the axes at that end are R' E
(`built_in`).

Equation (12) turns back at 90 degrees; ends that are turned farther than 45 degrees against the chord go over
to the rotation vector (local_rotation.py), which holds up to 180.

Sign: theta_y and M_y follow the paper's (12), which counts turns about the local y axis negative
(left-handed); theta_x and theta_z are right-handed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from shellform.arrays import Flags, Indices, Reals, Record, indices, reals
from shellform.errors import InputError
from shellform.structure.elements.beam_foreseen import foreseen
from shellform.structure.elements.beam_kernels import evaluate, local_by_dof
from shellform.structure.elements.beam_thirds import contracted
from shellform.structure.elements.double_double import beam_deformations, beam_tangents
from shellform.structure.elements.parts import Evaluation
from shellform.structure.elements.rotation import matrices
from shellform.structure.elements.state import State
from shellform.structure.elements.threads import share

STIFFNESSES: Final = ("axial", "torsion", "bending_y", "bending_z")
_NOTHING = np.empty((0, 78))
_NO_MODES = np.empty((0, 6, 9, 2))
_PARALLEL_TO_Z = 1e-6  # rad; nearer to global z than this, the default z axis is global x (model file)


@dataclass(frozen=True, eq=False)
class Beams(Record):
    """Beams of a network of `nodes` nodes.

    `ends` (m, 2) node numbers; `axial` EA, N; `torsion` GJ, `bending_y` EI_y, `bending_z` EI_z, N·m²;
    `rest_length`, m; all (m,); `frames` (m, 2, 3, 3) with the local axes x, y, z in the stress-free state as
    columns, at each end as seen from its unturned node; `kind` (m,) index into `kinds`.
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
        for name in STIFFNESSES:
            put(self, name, reals(f"beams.{name}", getattr(self, name), (count,)))
        put(self, "rest_length", reals("beams.rest_length", self.rest_length, (count,), positive=True))
        put(self, "frames", reals("beams.frames", self.frames, (count, 2, 3, 3)))
        put(self, "kind", indices("beams.kind", self.kind, (count,), below=len(self.kinds)))

    @property
    def built_in(self) -> Flags:
        """Which beams (m,) have other axes at one end than at the other: built into a bent state."""
        return np.asarray((self.frames[:, 0] != self.frames[:, 1]).any(axis=(1, 2)))

    def dofs(self) -> Indices:
        """Degrees of freedom (m, 12) of each element in the order of x^e below equation (20)."""
        return (6 * self.ends[:, :, None] + np.arange(6)).reshape(-1, 12)

    def stiffest(self) -> Reals:
        """The largest stiffness (m,), N/m, of each beam against a displacement of one end."""
        length = self.rest_length
        bending = 12.0 * np.maximum(self.bending_y, self.bending_z) / length**3
        return np.maximum(self.axial / length, bending)

    def of_kind(self, kind: str) -> Flags:
        """Which beams (m,) are of a kind; none where there is no such kind."""
        if kind not in self.kinds:
            return np.zeros(len(self.ends), dtype=bool)
        return np.asarray(self.kind == self.kinds.index(kind))

    def chosen(self, numbers: Indices) -> Beams:
        """The beams with these numbers, in their order, of the same kinds."""
        names = ("ends", *STIFFNESSES, "rest_length", "frames", "kind")
        return replace(self, **{name: getattr(self, name)[numbers] for name in names})

    def evaluate(self, state: State, *, tangent: bool, into: Reals | None = None) -> Evaluation:
        """Energy (m,) J, end forces (m, 12) N and N·m, packed lower tangents (m, 78) if asked for (19, 21),
        filled `into`.
        """
        count = len(self.ends)
        energy, force = np.empty(count), np.empty((count, 12))
        blocks = _NOTHING if not tangent else np.empty((count, 78)) if into is None else into
        turn, given = np.empty(count), self._given(state)
        inputs = self._kernel_input(state)
        share(evaluate, count, *inputs, given, 1.0, energy, force, blocks, _NOTHING, _NOTHING, turn)
        return Evaluation(energy, force, blocks if tangent else None, float(turn.max(initial=0.0)))

    def foreseen(self, state: State, motion: Reals) -> Reals:
        """Deformations (m, 7) to which a `motion` (n, 6) leads to first order: stretch, m, and the sines of
        the six local rotations. No end may be turned farther than 45 degrees at the state
        (`Evaluation.turned` is 0).
        """
        result = np.empty((len(self.ends), 7))
        inputs = self._kernel_input(state)[:5]
        share(foreseen, len(result), *inputs, np.ascontiguousarray(motion), result)
        return result

    def tangent_of(self, state: State, deformations: Reals, into: Reals) -> None:
        """Fills packed lower tangents (m, 78) at the state of elements that have other `deformations`, as of
        `foreseen`, and the forces that belong to those."""
        count = len(self.ends)
        energy, force, turn = np.empty(count), np.empty((count, 12)), np.empty(count)
        inputs = self._kernel_input(state)
        share(evaluate, count, *inputs, deformations, 1.0, energy, force, into, _NOTHING, _NOTHING, turn)

    def evaluate_extended(self, state: State, *, tangent: bool) -> Evaluation:
        """As `evaluate` at a state with a tail, tangents (m, 78, 2) with all their digits."""
        assert state.tail is not None
        count = len(self.ends)
        energy, force, turn = np.empty(count), np.empty((count, 12)), np.empty(count)
        given, modes = np.empty((count, 7)), np.empty((count if tangent else 0, 6, 9, 2))
        blocks = np.empty((count, 78)) if tangent else _NOTHING
        inputs = self._kernel_input(state)
        share(beam_deformations, count, *inputs[:2], state.tail, *inputs[2:5], given, modes)
        share(evaluate, count, *inputs, given, 0.0, energy, force, blocks, _NOTHING, _NOTHING, turn)
        result = np.empty((len(blocks), 78, 2))
        if tangent:
            share(beam_tangents, count, modes, *inputs[4:], turn, blocks, result)
        return Evaluation(energy, force, result if tangent else None, float(turn.max(initial=0.0)))

    def local_forces(self, state: State) -> Reals:
        """Equation (16): N, Mx_a, My_a, Mz_a, Mx_b, My_b, Mz_b of each beam, (m, 7), N and N·m."""
        return self._local(state)[0]

    def local_deformations(self, state: State) -> Reals:
        """Equation (17): l - l0, m, and the six local rotations, rad, of each beam, (m, 7)."""
        return self._local(state)[1]

    def local_forces_by_dof(self, state: State) -> Reals:
        """Derivatives (m, 7, 12) of equation (16) by the degrees of freedom of both ends, translations and
        rotation increments.
        """
        count = len(self.ends)
        result = np.empty((count, 7, 12))
        share(local_by_dof, count, *self._kernel_input(state), result)
        return result

    def tangent_by_dof(self, state: State, weights: Reals) -> Reals:
        """Derivatives (m, 12) of the sum of each beam's packed tangent times `weights` (m, 78), by the
        translations and rotation increments of both ends."""
        count = len(self.ends)
        result = np.empty((count, 12))
        share(contracted, count, *self._kernel_input(state), np.ascontiguousarray(weights), result)
        return result

    def _local(self, state: State) -> tuple[Reals, Reals]:
        count = len(self.ends)
        forces, deformations = np.empty((count, 7)), np.empty((count, 7))
        inputs = self._kernel_input(state)
        energy, force, turn = np.empty(count), np.empty((count, 12)), np.empty(count)
        given = self._given(state)
        share(evaluate, count, *inputs, given, 1.0, energy, force, _NOTHING, forces, deformations, turn)
        return forces, deformations

    def _given(self, state: State) -> Reals:
        """Deformations for the kernel where they are known better than double coordinates tell them."""
        if state.tail is None:
            return _NOTHING
        given = np.empty((len(self.ends), 7))
        inputs = self._kernel_input(state)
        share(beam_deformations, len(given), *inputs[:2], state.tail, *inputs[2:5], given, _NO_MODES)
        return given

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

    `z_axis` (m, 3): any vector in the local x-z plane; rows of NaN, or None, mean the global z axis, or
    global x where the beam is within 1e-6 rad of it. `rest_length` (m,), None or NaN entries: the distance
    between the nodes. Raises InputError for zero-length beams, non-positive stiffness and a z axis along the
    beam.
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
        ends=ends,
        axial=numbers["EA"],
        torsion=numbers["GJ"],
        bending_y=numbers["EIy"],
        bending_z=numbers["EIz"],
        rest_length=np.where(np.isnan(rest), length, rest),
        frames=np.repeat(frames[:, None], 2, axis=1),
        kind=np.zeros(count, dtype=np.int64) if kind is None else np.asarray(kind),
        kinds=kinds,
    )


def built_in(
    state: State,
    ends: ArrayLike,
    *,
    axial: ArrayLike,
    torsion: ArrayLike,
    bending_y: ArrayLike,
    bending_z: ArrayLike,
    z_axis: ArrayLike,
    kind: str,
) -> Beams:
    """Beams without stress in the `state` of their nodes, clamped to these as they are turned there: what is
    built into a bent structure. `ends` (m, 2); stiffness as in `make_beams`, where 0 is allowed: the beam
    adds none of it; `z_axis` (m, 3) any vector in the local x-z plane in that state; all of one `kind`.

    Raises InputError for beams without length and a z axis along the beam.
    """
    place, pairs = state.positions, np.asarray(ends, dtype=np.int64).reshape(-1, 2)
    straight = make_beams(
        place, pairs, axial=1.0, torsion=1.0, bending_y=1.0, bending_z=1.0, z_axis=z_axis, kinds=(kind,)
    )
    turned = matrices(state.quaternions[pairs.ravel()]).reshape(-1, 2, 3, 3)
    ea, gj, eiy, eiz = (
        np.broadcast_to(np.asarray(value, dtype=float), (len(pairs),))
        for value in (axial, torsion, bending_y, bending_z)
    )
    frames = turned.swapaxes(2, 3) @ straight.frames
    return replace(straight, axial=ea, torsion=gj, bending_y=eiy, bending_z=eiz, frames=frames)


def joined(first: Beams, second: Beams) -> Beams:
    """The beams of both, the `first` before the `second`, kinds of one name being one."""
    kinds = (*first.kinds, *(each for each in second.kinds if each not in first.kinds))
    number = np.array([kinds.index(each) for each in second.kinds], dtype=np.int64)
    both = {
        name: np.concatenate([getattr(first, name), getattr(second, name)])
        for name in ("ends", *STIFFNESSES, "rest_length", "frames")
    }
    return replace(first, **both, kind=np.concatenate([first.kind, number[second.kind]]), kinds=kinds)


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
