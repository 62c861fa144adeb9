"""Models with their beams cut in two: what stands for a curve is cut on it, what is straight stays
straight."""

from dataclasses import replace

import numpy as np
import pytest

from shellform.structure.answers.analysis import analyse
from shellform.structure.answers.halved import halved
from shellform.structure.elements.state import at_rest, from_vectors
from shellform.structure.model import Model
from shellform.structure.network import assemble
from shellform.verification.models import CLAMP, PIN, chain, in_plane, line, load_at, polyline


def model(points, held):
    network = chain(points, (1e6, 0.8, 1.0, 2.0), held)
    return Model(network, {"down": load_at(network, 1, [0.0, 0.0, -1.0])}, None, tuple(held))


def circle(count):
    angle = np.linspace(0.0, np.pi, count + 1)
    return np.column_stack([np.cos(angle), np.zeros_like(angle), np.sin(angle)])


def test_new_nodes_of_a_circle_s_chords_lie_on_the_circle_ends_included():
    finer = halved(model(circle(12), {0: PIN, 12: PIN})).network.nodes[13:]
    assert len(finer) == 12
    sagitta = 1.0 - np.cos(np.pi / 24.0)
    np.testing.assert_allclose(np.linalg.norm(finer, axis=1), 1.0, atol=0.02 * sagitta)


def test_a_corner_among_straight_beams_stays_one():
    points = polyline([[-1.0, 0.0, 0.0], [0.0, 0.0, 0.05], [1.0, 0.0, 0.0]], 2)
    finer = halved(model(points, {0: PIN, 4: PIN})).network.nodes[5:]
    np.testing.assert_allclose(finer, 0.5 * (points[1:] + points[:-1]), atol=1e-15)


@pytest.mark.parametrize("points", [circle(12), polyline([[0, 0, 0], [0, 0, 1], [1, 1, 1]], 2)])
def test_a_halved_model_is_without_stress_as_the_whole_one_is(points):
    finer = halved(model(points, {0: CLAMP})).network
    balance = assemble(finer).evaluate(at_rest(finer.nodes))
    assert np.abs(balance.force).max() < 1e-8 * 1e6
    assert balance.energy < 1e-12


def test_each_half_keeps_its_beam_s_axes_and_stiffness_and_half_of_a_stretched_rest_length():
    points = line(2)
    whole = model(points, {0: CLAMP})
    finer = halved(whole).network.beams
    np.testing.assert_allclose(finer.rest_length, 0.25)
    np.testing.assert_array_equal(finer.bending_z, 2.0)
    np.testing.assert_allclose(finer.frames[2:], whole.network.beams.frames, atol=1e-15)
    assert finer.ends.tolist() == [[0, 3], [1, 4], [3, 1], [4, 2]]


def test_new_nodes_are_held_only_as_all_others_are():
    network = in_plane(chain(line(2), (1e6, 0.8, 1.0, 1.0), {0: CLAMP, 2: CLAMP}))
    finer = halved(Model(network, {}, None, (0, 2))).network
    assert finer.fixed[3:].tolist() == [[False, True, False, True, False, True]] * 2


def test_a_bent_start_is_cut_on_the_cubic_through_its_ends():
    network = chain(line(8), (1e6, 0.8, 1.0, 1.0), {0: CLAMP})
    load = load_at(network, 8, [0.0, 0.0, 0.0, 0.0, 2.0, 0.0])
    bent = analyse(Model(network, {"moment": load}, None, (0,))).equilibrium.state
    finer = halved(Model(network, {"moment": load}, bent, (0,)))
    assert finer.start is not None
    radius = 0.125 / (2.0 * np.sin(0.125))
    away = np.linalg.norm(finer.start.positions - [0.0, 0.0, -radius], axis=1)
    np.testing.assert_allclose(away, radius, atol=0.02 * radius * (1.0 - np.cos(0.125)))


@pytest.mark.parametrize("turns", [(0.02, 0.10), (-0.10, 0.10), (0.05, 0.05), (0.0, 0.12)])
def test_halves_of_a_bent_beam_go_on_with_its_moments_though_its_ends_are_bent_differently(turns):
    """Two halves of the cubic bear m(s) = m_a (1 - s) + m_b s of the whole beam, so the same at the new node:
    to small angles, with 1 % of the largest."""
    points = line(1)
    whole = model(points, {0: PIN, 1: PIN})
    state = from_vectors(points, [[0.0, turn, 0.0] for turn in turns])
    finer = halved(replace(whole, start=state))
    one = whole.network.beams.local_forces(state)[0, [2, 5]]
    first, second = finer.network.beams.local_forces(finer.start)[:, [2, 5]]
    largest = np.abs(one).max()
    assert first == pytest.approx([one[0], 0.5 * (one[1] - one[0])], abs=0.01 * largest)
    assert second == pytest.approx([0.5 * (one[0] - one[1]), one[1]], abs=0.01 * largest)


def bend(*turns, lengths=(1.0, 1.5, 1.2, 2.0)):
    """Nodes of a polygon in the x-z plane with these lengths and turns, degrees, between them."""
    heading = np.radians(np.concatenate([[10.0], 10.0 + np.cumsum(turns)]))
    steps = np.array(lengths)[:, None] * np.column_stack([np.cos(heading), 0.0 * heading, np.sin(heading)])
    return np.vstack([np.zeros(3), np.cumsum(steps, axis=0)]), heading


def test_a_new_node_lies_off_its_chord_by_the_smaller_curvature_of_both_ends_times_an_eighth_of_its_length_squared():
    points, heading = bend(20.0, 28.0, 10.0)
    finer = halved(model(points, {0: PIN, 4: PIN})).network.nodes[5:]
    off = finer - 0.5 * (points[1:] + points[:-1])
    outward = np.column_stack([np.sin(heading), 0.0 * heading, -np.cos(heading)])
    first, last = (
        np.sin(np.radians(20.0)) / 1.25,
        np.sin(np.radians(10.0)) / 1.6,
    )  # over the mean lengths there
    by = np.array([1.0, 1.5, 1.2, 2.0]) ** 2 / 8.0 * [first, first, last, last]
    np.testing.assert_allclose(off, by[:, None] * outward, atol=1e-12)


@pytest.mark.parametrize(("corner", "straight"), [(29.0, False), (31.0, True)])
def test_beams_that_meet_at_more_than_30_degrees_stand_for_no_curve(corner, straight):
    points, _ = bend(20.0, corner, 10.0)
    finer = halved(model(points, {0: PIN, 4: PIN})).network.nodes[5:]
    off = np.linalg.norm(finer - 0.5 * (points[1:] + points[:-1]), axis=1)
    assert (off < 1e-12).all() if straight else (off > 1e-3).all()


def test_beams_that_bend_to_both_sides_are_cut_on_their_chords():
    points, _ = bend(10.0, -15.0, 10.0)
    finer = halved(model(points, {0: PIN, 4: PIN})).network.nodes[5:]
    np.testing.assert_allclose(finer, 0.5 * (points[1:] + points[:-1]), atol=1e-12)


def test_new_nodes_aren_t_held_where_any_node_is_moved():
    network = in_plane(chain(line(2), (1e6, 0.8, 1.0, 1.0), {0: CLAMP, 2: CLAMP}))
    imposed = np.zeros((3, 6))
    imposed[1, 1] = 0.01
    finer = halved(Model(replace(network, imposed=imposed), {}, None, (0, 2))).network
    assert finer.fixed[3:].tolist() == [[False, False, False, True, False, True]] * 2
    assert not finer.imposed[3:].any()
    assert finer.imposed[:3].tolist() == imposed.tolist()


def test_the_middle_of_a_bent_beam_is_turned_halfway_whichever_sign_its_quaternions_have():
    points = line(1)
    whole = model(points, {0: PIN, 1: PIN})
    state = from_vectors(points, [[0.4, 0.0, 0.0], [0.7, 0.0, 0.0]])
    for sign in (1.0, -1.0):
        quaternions = state.quaternions * [[1.0], [sign]]
        start = replace(state, quaternions=quaternions)
        middle = halved(replace(whole, start=start)).start
        assert np.abs(middle.rotations[2]) == pytest.approx([0.55, 0.0, 0.0], abs=1e-12)
        assert middle.positions[2] == pytest.approx([0.5, 0.0, 0.0])


def test_the_middle_of_a_beam_bent_to_an_s_lies_on_its_chord_and_turns_back_against_its_ends():
    """The cubic's tangent there is 3/2 of the chord less a quarter of both ends' directions times its
    length."""
    points, turn = np.add(line(1, 2.5), [3.0, 1.0, 2.0]), 0.3
    state = from_vectors(points, [[0.0, turn, 0.0]] * 2)
    middle = halved(replace(model(points, {0: PIN, 1: PIN}), start=state)).start
    back = np.arctan2(0.5 * np.sin(turn), 1.5 - 0.5 * np.cos(turn))
    assert middle.rotations[2] == pytest.approx([0.0, -back, 0.0])
    assert middle.positions[2] == pytest.approx([4.25, 1.0, 2.0])
