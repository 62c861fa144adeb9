"""Deformations that a motion leads to, and tangents of elements that have them."""

from itertools import pairwise

import numpy as np
import pytest

from shellform.structure.elements.state import moved
from shellform.structure.network import assemble


def bent(shell, seed):
    """The target shape, disturbed."""
    step = np.random.default_rng(seed).normal(size=(shell.node_count, 6)) * ([1e-4] * 3 + [0.1] * 3)
    return moved(shell.target, step)


def sines(beams, state):
    """Stretch and sines of the local rotations (m, 7)."""
    found = beams.local_deformations(state).copy()
    found[:, 1:] = np.sin(found[:, 1:])
    return found


def test_foreseen_deformations_are_right_to_first_order(shell):
    beams, state = shell.beams(shell.rod.radius), bent(shell, 0)
    way = np.random.default_rng(1).normal(size=(shell.node_count, 6)) * ([1e-3] * 3 + [1e-1] * 3)
    errors = []
    for h in (1e-2, 5e-3, 2.5e-3):
        errors.append(
            np.abs(sines(beams, moved(state, h * way)) - beams.foreseen(state, h * way)).max(axis=0)
        )
    assert (errors[0] > 0.0).all()
    for one, half in pairwise(errors):
        assert half / one == pytest.approx(np.full(7, 0.25), rel=0.1)


@pytest.mark.parametrize("braced", [True, False])
def test_the_tangent_of_the_state_s_own_deformations_is_the_state_s_tangent(shell, braced):
    design = shell.design(rest_ratio=0.95) if braced else shell.unbraced()
    assembly, state = assemble(shell.network(design)), bent(shell, 0)
    still = assembly.foreseen(state, np.zeros((shell.node_count, 6)))
    expected = assembly.evaluate(state).tangent
    assert assembly.tangent_of(state, still) == pytest.approx(expected, rel=1e-9, abs=1e-9 * expected.max())


def test_the_tangent_of_other_deformations_differs_by_the_forces_that_go_with_them(shell):
    assembly, state = assemble(shell.network(shell.design(rest_ratio=0.95))), bent(shell, 0)
    (given,) = assembly.foreseen(state, np.zeros((shell.node_count, 6)))
    longer = given.copy()
    longer[:, 0] += 1e-6
    (beams,) = assembly.beams
    change = assembly.tangent_of(state, (longer,)) - assembly.tangent_of(state, (given,))
    a, b = beams.ends.T
    chord = state.positions[b] - state.positions[a]
    length = np.linalg.norm(chord, axis=1)
    # More axial force EA / l0 times the stretch over the length is the stiffness that it gives across.
    across = 2.0 * beams.axial / beams.rest_length * 1e-6 / length
    diagonal = np.zeros(6 * shell.node_count)
    diagonal[assembly.free] = change[assembly.matrix.diagonal]
    expected = np.zeros(shell.node_count)
    np.add.at(expected, a, across)
    np.add.at(expected, b, across)
    inner = (assembly.number.reshape(-1, 6)[:, :3] >= 0).all(axis=1)
    assert diagonal.reshape(-1, 6)[inner, :3].sum(axis=1) == pytest.approx(expected[inner], rel=1e-6)
