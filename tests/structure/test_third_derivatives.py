"""The derivatives of the elements' stiffness by the state and by rest lengths."""

from dataclasses import replace

import numpy as np
import pytest

from shellform.structure.answers.third_derivatives import bilinear, bilinear_by_dof, bilinear_by_rest_length
from shellform.structure.elements.state import State, moved
from shellform.structure.network import assemble


def bent(shell, seed):
    """The target shape, disturbed."""
    step = np.random.default_rng(seed).normal(size=(shell.node_count, 6)) * ([1e-4] * 3 + [0.2] * 3)
    return moved(shell.target, step)


def motions(shell, seed, count=3):
    return np.random.default_rng(seed).normal(size=(6 * shell.node_count, count))


@pytest.mark.parametrize("kind", ["beams", "cables"])
def test_derivatives_by_the_state_are_those_of_the_elements_tangents(shell, kind):
    design = shell.design(rest_ratio=0.95)
    part = shell.beams(design.radius) if kind == "beams" else shell.cables(design)
    assembly = assemble(shell.network(design)).with_parts((part,))
    state, left, right = bent(shell, 0), motions(shell, 1), motions(shell, 2)
    way = np.random.default_rng(3).normal(size=(shell.node_count, 6)) * ([1e-3] * 3 + [1.0] * 3)
    found = bilinear_by_dof(assembly, state, left, right) @ way.ravel()
    differences = []
    for h in (1e-5, 5e-6):
        ahead, back = (bilinear(part, moved(state, sign * h * way), left, right) for sign in (1.0, -1.0))
        differences.append((ahead - back) / (2.0 * h))
    # Central differences err by h²: without that term they agree to what rounding leaves of them.
    expected = (4.0 * differences[1] - differences[0]) / 3.0
    assert found == pytest.approx(expected, rel=1e-6)


def test_the_sum_is_that_over_the_assembled_tangent_and_is_linear_in_each_motion(shell):
    design = shell.design(rest_ratio=0.95)
    assembly, state = assemble(shell.network(design)), bent(shell, 0)
    left, right = motions(shell, 1), motions(shell, 2)
    held = np.setdiff1d(np.arange(6 * shell.node_count), assembly.free)
    left[held] = right[held] = 0.0
    whole = assembly.matrix.full(assembly.evaluate(state, tangent=True).tangent)
    expected = float((left[assembly.free] * (whole @ right[assembly.free])).sum())
    parts = sum(bilinear(part, state, left, right) for part in assembly.parts)
    assert parts == pytest.approx(expected, rel=1e-10)


def test_the_derivative_by_rest_lengths_is_that_of_the_cables_tangents(shell):
    cables, state = shell.cables(shell.design(rest_ratio=0.95)), bent(shell, 0)
    left, right = motions(shell, 1), motions(shell, 2)
    way = np.random.default_rng(3).normal(size=len(cables.ends)) * cables.rest_length
    found = float(bilinear_by_rest_length(cables, state, left, right) @ way)
    h = 1e-6
    ahead, back = (
        bilinear(replace(cables, rest_length=cables.rest_length + sign * h * way), state, left, right)
        for sign in (1.0, -1.0)
    )
    assert found == pytest.approx((ahead - back) / (2.0 * h), rel=1e-8)


def test_slack_cables_have_no_stiffness_to_change(shell):
    design = shell.design()
    cables = shell.cables(design)
    slack = State(0.5 * shell.target.positions, shell.target.quaternions)
    assembly = assemble(shell.network(design)).with_parts((cables,))
    left, right = motions(shell, 1), motions(shell, 2)
    assert not bilinear_by_dof(assembly, slack, left, right).any()
    assert not bilinear_by_rest_length(cables, slack, left, right).any()
