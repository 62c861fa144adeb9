"""Ropes that draw nodes to places in plan."""

import numpy as np
import pytest

from shellform.errors import InputError
from shellform.structure.elements.ropes import Ropes
from shellform.structure.elements.state import State, at_rest, extended

PLACE = np.array([[0.0, 0.0, 5.0], [1.0, 2.0, -3.0], [4.0, 4.0, 4.0]])
ROPES = Ropes([2, 0], [[1.0, 0.0], [0.0, 0.5]], 8.0)


def test_a_rope_pulls_its_node_in_plan_with_its_stiffness_times_the_distance():
    found = ROPES.evaluate(at_rest(PLACE), tangent=True)
    np.testing.assert_allclose(found.force, [[24.0, 32.0], [0.0, -4.0]])
    np.testing.assert_allclose(found.energy, [0.5 * 8.0 * 25.0, 0.5 * 8.0 * 0.25])
    np.testing.assert_array_equal(ROPES.dofs(), [[12, 13], [0, 1]])
    assert ROPES.evaluate(at_rest(PLACE), tangent=False).tangent is None


def test_forces_and_tangents_of_ropes_are_derivatives_of_their_energy_and_forces():
    step = 1e-5
    tangent = ROPES.evaluate(at_rest(PLACE), tangent=True, into=np.empty((2, 3))).tangent
    for rope, node in enumerate(ROPES.nodes):
        full = np.array([[tangent[rope, 0], tangent[rope, 1]], [tangent[rope, 1], tangent[rope, 2]]])
        for axis in range(2):
            ends = []
            for way in (step, -step):
                place = PLACE.copy()
                place[node, axis] += way
                ends.append(ROPES.evaluate(at_rest(place), tangent=False))
            force = ROPES.force(at_rest(PLACE))[rope, axis]
            assert (ends[0].energy - ends[1].energy)[rope] / (2.0 * step) == pytest.approx(force)
            change = (ends[0].force - ends[1].force)[rope] / (2.0 * step)
            np.testing.assert_allclose(change, full[:, axis], atol=1e-8)


def test_ropes_know_what_coordinates_have_beyond_double_precision():
    place = extended(at_rest(PLACE))
    tail = place.tail.copy()
    tail[2, 0] = 0.25  # far more than a tail is, to be seen
    found = ROPES.evaluate_extended(State(place.positions, place.quaternions, tail), tangent=True)
    np.testing.assert_allclose(found.force, [[26.0, 32.0], [0.0, -4.0]])
    np.testing.assert_array_equal(found.tangent[..., 0], [[8.0, 0.0, 8.0]] * 2)
    np.testing.assert_array_equal(found.tangent[..., 1], 0.0)
    assert ROPES.evaluate_extended(place, tangent=False).tangent is None


def test_ropes_have_a_place_each():
    with pytest.raises(InputError, match=r"ropes\.places"):
        Ropes([2, 0], [[1.0, 0.0]], 8.0)
