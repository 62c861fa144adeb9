"""How the stiffness of a mode changes as the nodes move and cables are let out: the derivative of the tangent
along its own modes.

An eigenvalue w of the tangent K at an equilibrium, K v = w M v with v'Mv = 1 and a constant mass M, changes
with the design s by

    dw/ds = v' (∂K/∂s) v + t' dx/ds,   t_j = v' (∂K/∂x_j) v,

so that the stiffness of the softest mode is a measure like any other (sensitivity.py): where it comes to 0,
stability ends. t holds third derivatives of the energy. For beams they come from the compiled tangent itself,
evaluated at complex positions x + i h e_j: the imaginary part over h is the derivative to the last digit,
since nothing is subtracted (Squire and Trapp 1998). The degrees of freedom of an element are taken one after
the other, all elements at once, so that it costs twelve assemblies. A cable with its ends' relative motion d,
a = e·d, has

    v'Kv = EA/l0 (d·d - (l0/l) (d·d - a²)).
"""

from __future__ import annotations

import numpy as np

from shellform.arrays import Reals
from shellform.structure.elements.beam import Beams
from shellform.structure.elements.beam_kernels import evaluate
from shellform.structure.elements.cable import Cables
from shellform.structure.elements.state import State
from shellform.structure.elements.threads import share
from shellform.structure.solve.assembly import Assembly

_STEP = 1e-30  # of the complex shift: its square vanishes beside 1


def stiffness_by_dof(assembly: Assembly, state: State, mode: Reals) -> Reals:
    """t (6 n,), N/m² and N/m a radian, of a mode (n, 6) at the state: the derivative of v'Kv by every node's
    translations and spins.
    """
    total = np.zeros(6 * assembly.count)
    flat = mode.ravel()
    for part in assembly.parts:
        if isinstance(part, Beams) and len(part.ends):
            _add_beams(part, state, flat, total)
        elif isinstance(part, Cables) and len(part.ends):
            _add_cables(part, state, flat, total)
    return total


def stiffness_by_rest_length(cables: Cables, state: State, mode: Reals) -> Reals:
    """Derivative (c,), N/m², of v'Kv by each cable's rest length at the state: -EA d·d / l0², 0 in slack
    cables.
    """
    chord, motion = _relative(cables, state, mode)
    taut = np.linalg.norm(chord, axis=1) > cables.rest_length
    return np.where(taut, -cables.stiffness * (motion**2).sum(axis=1) / cables.rest_length**2, 0.0)


def quadratic(part: Beams, state: State, mode: Reals) -> float:
    """v'Kv, N/m, of beams alone: with a rate of their stiffness in its place, the derivative of the mode's
    stiffness by what it depends on.
    """
    tangent = part.evaluate(state, tangent=True).tangent
    assert tangent is not None
    own = mode.ravel()[part.dofs()]
    return float((tangent * _weights(own)).sum())


def _add_beams(beams: Beams, state: State, flat: Reals, total: Reals) -> None:
    """One complex pass for each of the twelve degrees of freedom, every element with ends of its own."""
    count = len(beams.ends)
    dofs = beams.dofs()
    weights = _weights(flat[dofs])
    ends = np.arange(2 * count).reshape(-1, 2)
    place = state.positions[beams.ends].reshape(-1, 3)
    turn = state.quaternions[beams.ends].reshape(-1, 4)
    stiffness = np.column_stack([beams.axial, beams.torsion, beams.bending_y, beams.bending_z])
    energy, force = np.empty(count, complex), np.empty((count, 12), complex)
    blocks, none = np.empty((count, 78), complex), np.empty((0, 7), complex)
    for dof in range(12):
        node, axis = divmod(dof, 6)
        positions, quaternions = place.astype(complex), turn.astype(complex)
        if axis < 3:
            positions[node::2, axis] += 1j * _STEP
        else:
            quaternions[node::2] += 0.5j * _STEP * _spun(axis - 3, turn[node::2])
        share(
            evaluate,
            count,
            positions,
            quaternions,
            ends,
            beams.frames,
            beams.rest_length,
            stiffness,
            energy,
            force,
            blocks,
            none,
            none,
        )
        np.add.at(total, dofs[:, dof], (blocks.imag * weights).sum(axis=1) / _STEP)


def _add_cables(cables: Cables, state: State, flat: Reals, total: Reals) -> None:
    chord, motion = _relative(cables, state, flat.reshape(-1, 6))
    length = np.linalg.norm(chord, axis=1)
    unit = chord / length[:, None]
    along, whole = (unit * motion).sum(axis=1), (motion**2).sum(axis=1)
    stiffness = np.where(length > cables.rest_length, cables.stiffness / cables.rest_length, 0.0)
    share_left = cables.rest_length / length
    slope = (stiffness * share_left / length)[:, None] * (
        (whole - along**2)[:, None] * unit + 2.0 * along[:, None] * (motion - along[:, None] * unit)
    )
    np.add.at(total, cables.dofs(), np.hstack([-slope, slope]))


def _relative(cables: Cables, state: State, mode: Reals) -> tuple[Reals, Reals]:
    a, b = cables.ends.T
    return state.positions[b] - state.positions[a], mode[b, :3] - mode[a, :3]


def _weights(own: Reals) -> Reals:
    """What packed lower entries (m, k (k + 1) / 2) count in the quadratic form of `own` (m, k)."""
    row, column = np.tril_indices(own.shape[1])
    return own[:, row] * own[:, column] * np.where(row == column, 1.0, 2.0)


def _spun(axis: int, quaternions: Reals) -> Reals:
    """The product of the unit imaginary quaternion about an axis and each quaternion (k, 4)."""
    w, x, y, z = quaternions.T
    rows = {0: (-x, w, -z, y), 1: (-y, z, w, -x), 2: (-z, -y, x, w)}
    return np.column_stack(rows[axis])
