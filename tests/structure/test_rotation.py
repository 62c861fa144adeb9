"""Finite rotations as quaternions, vectors and matrices, by turns that are known."""

import numpy as np
import pytest

from shellform.structure.elements.rotation import (
    between,
    from_matrices,
    from_vectors,
    identity,
    matrices,
    product,
    to_vectors,
)
from shellform.structure.elements.state import from_vectors as state_of
from shellform.structure.elements.state import motion, moved


def about(axis, degrees):
    vector = np.asarray(axis, dtype=float)
    return np.radians(degrees) * vector / np.linalg.norm(vector)


def test_a_quaternion_is_the_cosine_of_half_the_angle_and_its_sine_along_the_axis():
    found = from_vectors(np.array([about([0, 0, 2], 60.0), about([0, -3, 4], 90.0), [0.0, 0.0, 0.0]]))
    half = np.sqrt(0.5)
    np.testing.assert_allclose(
        found, [[np.sqrt(0.75), 0, 0, 0.5], [half, 0, -0.6 * half, 0.8 * half], [1, 0, 0, 0]], atol=1e-15
    )
    np.testing.assert_array_equal(found[2:], identity(1))


@pytest.mark.parametrize("degrees", [0.0, 1e-6, 37.0, 179.0])
def test_vectors_come_back_with_the_shorter_turn_whichever_sign_the_quaternion_has(degrees):
    vectors = np.array([about([1, -2, 0.5], degrees), about([0, 3, 1], -degrees)])
    quaternions = from_vectors(vectors)
    np.testing.assert_allclose(to_vectors(quaternions), vectors, atol=1e-12)
    np.testing.assert_allclose(to_vectors(-quaternions), vectors, atol=1e-12)


def test_a_turn_of_more_than_180_degrees_is_the_rest_of_a_whole_one_the_other_way():
    found = to_vectors(from_vectors(np.array([about([0, 0, 1], 200.0)])))
    np.testing.assert_allclose(found, [about([0, 0, -1], 160.0)], atol=1e-12)


def test_a_product_turns_by_the_right_one_first_and_is_made_unit():
    """x goes to y about z, and from there to z about x."""
    first, then = from_vectors(np.array([about([0, 0, 1], 90.0), about([1, 0, 0], 90.0)]))
    both = product(3.0 * then[None], 0.5 * first[None])
    np.testing.assert_allclose(both, [[0.5, 0.5, -0.5, 0.5]], atol=1e-15)
    np.testing.assert_allclose(matrices(both)[0] @ [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], atol=1e-15)
    np.testing.assert_allclose(matrices(both)[0] @ [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], atol=1e-15)


@pytest.mark.parametrize(
    "vector",
    [
        about([1, 2, -3], 40.0),  # the trace is the largest
        about([5, 1, -1], 170.0),
        about([-1, 5, 1], 170.0),
        about([1, -1, 5], 170.0),
        about([1, 5, 2], -175.0),
        about([0, 1, 0], 180.0),
    ],
)
def test_a_matrix_s_quaternion_has_no_negative_first_part_and_turns_as_the_matrix_does(vector):
    angle = np.linalg.norm(vector)
    axis = vector / angle
    spin = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    turn = np.eye(3) + np.sin(angle) * spin + (1.0 - np.cos(angle)) * spin @ spin  # Rodrigues
    found = from_matrices(turn[None])
    assert found[0, 0] >= 0.0
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0, rtol=1e-14)
    np.testing.assert_allclose(matrices(found)[0], turn, atol=1e-14)
    np.testing.assert_allclose(matrices(from_vectors(vector[None]))[0], turn, atol=1e-14)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_between_two_quaternions_the_shorter_way_round_is_gone(sign):
    first, second, middle = (from_vectors(np.array([about([0, 0, 1], each)])) for each in (10.0, 50.0, 30.0))
    np.testing.assert_allclose(between(first, sign * second, 0.5), middle, atol=1e-15)
    both = between(np.vstack([first, first]), sign * np.vstack([second, second]), np.array([[0.0], [1.0]]))
    np.testing.assert_allclose(both, np.vstack([first, second]), atol=1e-15)


def test_the_motion_from_one_state_to_another_leads_there():
    rng = np.random.default_rng(3)
    before = state_of(rng.normal(size=(5, 3)), rng.normal(size=(5, 3)))
    after = state_of(rng.normal(size=(5, 3)), rng.normal(size=(5, 3)))
    there = moved(before, motion(before, after))
    np.testing.assert_allclose(there.positions, after.positions, atol=1e-15)
    np.testing.assert_allclose(there.rotations, after.rotations, atol=1e-14)
    assert not motion(after, after).any()
