"""Tension-only cables."""

import numpy as np
import pytest

from shellform.errors import InputError
from shellform.structure.elements.cable import make_cables
from shellform.structure.elements.state import at_rest, moved
from shellform.verification import slack_pair
from shellform.verification.models import line, ropes, solved

NODES = np.array([[0.0, 0.0, 0.0], [1.0, 0.3, -0.2]])
LENGTH = float(np.linalg.norm(NODES[1]))


def cable(ratio=0.9):
    return make_cables([[0, 1]], rest_length=ratio * LENGTH, stiffness=187.0)


def test_a_slack_cable_carries_exactly_nothing():
    assert cable(1.01).tension(at_rest(NODES))[0] == 0.0
    assert slack_pair() == (pytest.approx(1.0), 0.0)


def test_tension_by_rest_length_is_minus_ea_l_over_l0_squared():
    rate = cable().tension_by_rest_length(at_rest(NODES))[0]
    assert rate == pytest.approx(-187.0 * LENGTH / (0.9 * LENGTH) ** 2)
    h = 1e-6
    ends = [make_cables([[0, 1]], rest_length=0.9 * LENGTH + s * h, stiffness=187.0) for s in (1, -1)]
    found = np.subtract(*[each.tension(at_rest(NODES))[0] for each in ends]) / (2 * h)
    assert rate == pytest.approx(found, rel=1e-8)
    force = np.subtract(*[each.evaluate(at_rest(NODES), tangent=False).force[0] for each in ends]) / (2 * h)
    np.testing.assert_allclose(cable().force_by_rest_length(at_rest(NODES))[0], force, rtol=1e-7)


def test_forces_and_tangents_are_derivatives_of_the_energy():
    state, h = at_rest(NODES), 1e-5
    result = cable().evaluate(state, tangent=True)
    tangent = np.zeros((6, 6))
    tangent[np.tril_indices(6)] = result.tangent[0]
    tangent += np.tril(tangent, -1).T
    for k in range(6):
        step = np.zeros((2, 6))
        step[k // 3, k % 3] = h
        plus, minus = (cable().evaluate(moved(state, s * step), tangent=False) for s in (1, -1))
        assert (plus.energy - minus.energy)[0] / (2 * h) == pytest.approx(result.force[0, k], abs=1e-7)
        np.testing.assert_allclose((plus.force - minus.force)[0] / (2 * h), tangent[:, k], atol=1e-6)
        tension = (cable().tension(moved(state, step)) - cable().tension(moved(state, -step)))[0] / (2 * h)
        assert tension == pytest.approx(cable().tension_by_position(state)[0, k], rel=1e-6)


def test_cables_to_themselves_or_without_stiffness_are_refused():
    with pytest.raises(InputError, match="itself"):
        make_cables([[1, 1]], rest_length=1.0, stiffness=1.0)
    with pytest.raises(InputError, match="above zero"):
        make_cables([[0, 1]], rest_length=1.0, stiffness=-1.0)


@pytest.mark.parametrize("rest", [1.01, 1.05, 1.2])
def test_a_straight_loose_rope_finds_its_sag_under_load(rest):
    rope = make_cables([[k, k + 1] for k in range(8)], rest_length=rest, stiffness=500.0)
    load = np.zeros((9, 6))
    load[:, 2] = -1.0
    found = solved(ropes(line(8, 8.0), rope, [0, 8]), load)
    tension = rope.tension(found)
    # Statics: half of seven loads goes up at each end.
    first = found.positions[1] - found.positions[0]
    assert -tension[0] * first[2] / np.linalg.norm(first) == pytest.approx(3.5, rel=1e-6)
