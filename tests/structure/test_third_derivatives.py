"""The derivatives of the elements' stiffness by the state."""

import numpy as np
import pytest

from shellform.structure.answers.third_derivatives import beam_rates, cable_rates
from shellform.structure.elements.state import State, moved


def bent(shell, seed):
    """The target shape, disturbed."""
    rng = np.random.default_rng(seed)
    step = rng.normal(size=(len(shell.net.grid.flat), 6)) * ([1e-4] * 3 + [0.2] * 3)
    return moved(shell.target, step)


def full(packed, size):
    rows, columns = np.tril_indices(size)
    result = np.zeros((len(packed), size, size))
    result[:, rows, columns] = result[:, columns, rows] = packed
    return result


@pytest.mark.parametrize("kind", ["beams", "cables"])
def test_rates_of_stiffness_are_those_of_the_elements_tangents(shell, kind):
    design = shell.design(rest_ratio=0.95)
    part = shell.beams(design.radius) if kind == "beams" else shell.cables(design)
    rates, size = (beam_rates, 12) if kind == "beams" else (cable_rates, 6)
    rng = np.random.default_rng(1)
    weights = rng.normal(size=(len(part.ends), size, size))
    weights += weights.transpose(0, 2, 1)
    state = bent(shell, 0)
    found = rates(part, state, weights)
    motion = rng.normal(size=(len(state.positions), 6)) * ([1e-3] * 3 + [1.0] * 3)
    expected = []
    for h in (1e-5, -1e-5):
        tangent = full(part.evaluate(moved(state, h * motion), tangent=True).tangent, size)
        expected.append(np.einsum("eij,eij->e", tangent, weights))
    slope = (expected[0] - expected[1]) / 2e-5
    along = np.einsum("ec,ec->e", found, motion.ravel()[part.dofs()])
    np.testing.assert_allclose(along, slope, rtol=1e-5, atol=1e-6 * np.abs(slope).max())


def test_slack_cables_have_no_stiffness_to_change(shell):
    cables = shell.cables(shell.design())
    slack = State(0.5 * shell.target.positions, shell.target.quaternions)
    assert not cable_rates(cables, slack, np.ones((len(cables.ends), 6, 6))).any()
