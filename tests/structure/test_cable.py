"""Tension-only cables."""

import numpy as np
import pytest

from shellform.errors import InputError
from shellform.structure.elements.cable import make_cables
from shellform.structure.elements.eased_cables import EasedCables
from shellform.structure.elements.state import at_rest, extended, moved
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


def test_a_cable_pulls_by_its_stretch_over_its_rest_length_from_where_it_is_taut():
    nodes = np.array([[1.0, 2.0, 3.0], [4.0, 2.0, 7.0], [4.0, 2.5, 7.0]])  # 5 m, and half a metre
    cables = make_cables([[0, 1], [1, 0], [0, 1], [2, 1]], rest_length=[4.0, 5.0, 6.0, 0.4], stiffness=[80.0, 1e3, 1e3, 20.0])  # fmt: skip
    state = at_rest(nodes)
    assert cables.lengths(state) == pytest.approx([5.0, 5.0, 5.0, 0.5])
    assert cables.tension(state) == pytest.approx([20.0, 0.0, 0.0, 5.0])
    assert cables.stiffest() == pytest.approx([20.0, 200.0, 1e3 / 6.0, 50.0])
    assert cables.tension_by_rest_length(state) == pytest.approx([-25.0, 0.0, 0.0, -62.5])
    by_position = cables.tension_by_position(state)
    assert by_position[0] == pytest.approx([-12.0, 0.0, -16.0, 12.0, 0.0, 16.0])
    assert not by_position[1:3].any()
    assert by_position[3] == pytest.approx([0.0, 50.0, 0.0, 0.0, -50.0, 0.0])
    by_rest = cables.force_by_rest_length(state)
    assert by_rest[0] == pytest.approx([15.0, 0.0, 20.0, -15.0, 0.0, -20.0])
    assert not by_rest[1:3].any()
    evaluated = cables.evaluate(state, tangent=False)
    assert evaluated.energy == pytest.approx([10.0, 0.0, 0.0, 0.25])
    assert evaluated.force[0] == pytest.approx([-12.0, 0.0, -16.0, 12.0, 0.0, 16.0])
    unit, _ = cables.directions(state)
    assert unit[1] == pytest.approx([-0.6, 0.0, -0.8])
    assert cables.dofs()[3].tolist() == [12, 13, 14, 6, 7, 8]


def test_tensions_with_twice_the_digits_are_those_of_double_precision():
    nodes = np.array([[1.0, 2.0, 3.0], [4.0, 2.0, 7.0]])
    cables = make_cables([[0, 1], [1, 0]], rest_length=[4.0, 5.5], stiffness=80.0)
    state = extended(at_rest(nodes))
    assert cables.tension(state) == pytest.approx([20.0, 0.0])
    assert cables.evaluate(state, tangent=False).energy == pytest.approx([10.0, 0.0])
    assert cables.evaluate(state, tangent=True).tangent.shape == (2, 21), "a plain one where it is asked for"


def test_the_cable_that_joins_a_node_to_itself_is_named_with_the_node():
    with pytest.raises(InputError) as told:
        make_cables([[0, 1], [2, 2]], rest_length=1.0, stiffness=1.0)
    assert (told.value.where, told.value.value) == ("cables[1]", 2)


def test_cables_at_given_tensions_have_their_forces_but_no_stiffness_along_them():
    nodes = np.array([[1.0, 2.0, 3.0], [4.0, 2.0, 7.0]])
    cables = make_cables([[0, 1], [0, 1]], rest_length=[4.0, 6.0], stiffness=80.0)
    eased, state = EasedCables(cables), at_rest(nodes)
    found = eased.evaluate(state, tangent=True)
    packed = np.zeros((6, 6))
    packed[np.tril_indices(6)] = found.tangent[0]
    whole = packed + np.tril(packed, -1).T
    along = np.array([0.6, 0.0, 0.8])
    geometric = 20.0 / 5.0 * (np.eye(3) - np.outer(along, along))
    np.testing.assert_allclose(
        whole, np.block([[geometric, -geometric], [-geometric, geometric]]), atol=1e-12
    )
    assert not found.tangent[1].any(), "the slack one"
    np.testing.assert_array_equal(found.force, cables.evaluate(state, tangent=False).force)
    assert eased.evaluate(state, tangent=False).tangent is None
    assert eased.dofs().tolist() == cables.dofs().tolist()
