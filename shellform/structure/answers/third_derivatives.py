"""How the stiffness along given motions changes as the nodes move and cables are let out: third derivatives
of the elements' energies, exact.

For motions l_k, r_k of the nodes at fixed l, r the tangent K gives B = sum of l_k'K r_k; l = r = a mode is
that mode's stiffness, l the multipliers of linear answers r what a misfit as built derives. B is linear in
the sum of l_k r_k', so that any number of motions costs what one does. Of beams it is derived in one compiled
pass (beam_thirds.py). A cable with its ends' relative motions p_k, q_k along l_k, r_k, a = e·p, b = e·q, has

    B = EA/l0 (p·q - (l0/l) (p·q - a b)),
    dB/d(x_b - x_a) = EA/l² ((p·q - a b) e + a (q - b e) + b (p - a e)).
"""

from __future__ import annotations

import numpy as np

from shellform.arrays import Indices, Reals
from shellform.structure.elements.beam import Beams
from shellform.structure.elements.cable import Cables
from shellform.structure.elements.parts import Part
from shellform.structure.elements.state import State
from shellform.structure.solve.assembly import Assembly

_CHUNK = 200  # elements whose products of motions are summed at a time


def bilinear(part: Part, state: State, left: Reals, right: Reals) -> float:
    """Sum of l_k'K r_k over the motions `left`, `right` (6 n, k), m and rad, with the tangent K of one part.

    With a rate of the part's stiffness in its place it is the derivative by what the stiffness depends on.
    """
    tangent = part.evaluate(state, tangent=True).tangent
    assert tangent is not None
    return float((tangent * _packed_products(part.dofs(), left, right)).sum())


def bilinear_by_dof(assembly: Assembly, state: State, left: Reals, right: Reals) -> Reals:
    """Derivative (6 n,), N and N·m, of the sum of l_k'K r_k by every node's translations and rotation
    increments, for beams and cables.
    """
    total = np.zeros(6 * assembly.count)
    for part in assembly.parts:
        if isinstance(part, Cables):
            _add_cables(part, state, left, right, total)
        elif isinstance(part, Beams):
            dofs = part.dofs()
            slope = part.tangent_by_dof(state, _packed_products(dofs, left, right))
            np.add.at(total, dofs, slope)
    return total


def bilinear_by_rest_length(cables: Cables, state: State, left: Reals, right: Reals) -> Reals:
    """Derivative (c,), N, of the sum of l_k'K r_k by each cable's rest length at the state: -EA p·q / l0², 0
    in slack cables.
    """
    taut = cables.lengths(state) > cables.rest_length
    whole = np.empty(len(cables.ends))
    for first in range(0, len(whole), _CHUNK):
        chosen = slice(first, first + _CHUNK)
        p, q = (_relative(cables.ends[chosen], each) for each in (left, right))
        whole[chosen] = (p * q).sum(axis=2).sum(axis=1)
    return np.where(taut, -cables.stiffness * whole / cables.rest_length**2, 0.0)


def _add_cables(cables: Cables, state: State, left: Reals, right: Reals, total: Reals) -> None:
    dofs = cables.dofs()
    unit, length = cables.directions(state)
    taut = np.where(length > cables.rest_length, cables.stiffness / cables.rest_length, 0.0)
    scale = taut * (cables.rest_length / length) / length
    for first in range(0, len(length), _CHUNK):
        chosen = slice(first, first + _CHUNK)
        p, q = (_relative(cables.ends[chosen], each) for each in (left, right))
        e = unit[chosen, None]
        a, b = (e * p).sum(axis=2), (e * q).sum(axis=2)
        across = ((p * q).sum(axis=2) - a * b).sum(axis=1)
        swung = (a[..., None] * (q - b[..., None] * e) + b[..., None] * (p - a[..., None] * e)).sum(axis=1)
        slope = scale[chosen, None] * (across[:, None] * unit[chosen] + swung)
        np.add.at(total, dofs[chosen], np.hstack([-slope, slope]))


def _relative(ends: Indices, motions: Reals) -> Reals:
    """How second ends move against first ones (c, k, 3), by motions (6 n, k)."""
    place = motions.reshape(-1, 6, motions.shape[1])[:, :3]
    return np.ascontiguousarray((place[ends[:, 1]] - place[ends[:, 0]]).transpose(0, 2, 1))


def _packed_products(dofs: Indices, left: Reals, right: Reals) -> Reals:
    """What packed lower entries (m, d (d + 1) / 2) of symmetric blocks on `dofs` (m, d) count in the sum over
    k of l_k'K r_k.
    """
    row, column = np.tril_indices(dofs.shape[1])
    times = np.where(row == column, 1.0, 2.0)
    result = np.empty((len(dofs), len(row)), order="F")
    for first in range(0, len(dofs), _CHUNK):
        own = dofs[first : first + _CHUNK]
        whole = left[own] @ right[own].transpose(0, 2, 1)
        result[first : first + _CHUNK] = 0.5 * (whole + whole.transpose(0, 2, 1))[:, row, column] * times
    return result
