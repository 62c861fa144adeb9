"""Elements put together: what the ground bears, by which arm moments count, and steps that turn chords."""

import numpy as np
import pytest

from shellform.structure.answers.sensitivity import by_load, element_columns, reaction_rows
from shellform.structure.answers.third_derivatives import bilinear
from shellform.structure.elements.beam import make_beams
from shellform.structure.elements.cable import make_cables
from shellform.structure.elements.state import State, at_rest, moved
from shellform.structure.solve.assembly import Assembly
from shellform.structure.solve.chords import ChordKeeper

NODES = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 3.0, 0.0], [2.0, 3.0, 4.0]])


def built():
    """Beams of 2 and 3 m, and a taut cable up from their end to a node of its own."""
    beams = make_beams(NODES, [[0, 1], [1, 2]], axial=900.0, torsion=2.0, bending_y=3.0, bending_z=5.0)
    cables = make_cables([[2, 3]], rest_length=3.2, stiffness=80.0)  # pulls with 20 N
    fixed = np.zeros((4, 6), dtype=bool)
    fixed[0], fixed[3, :3] = True, [True, False, True]
    return Assembly(4, (beams, cables), fixed)


def test_what_is_free_is_what_elements_touch_and_supports_do_not_hold():
    assembly = built()
    assert assembly.free.tolist() == [*range(6, 18), 19]
    assert assembly.number[19] == 12
    assert (assembly.number[[0, 5, 18, 20, 21]] == -1).all()
    assert assembly.turns.tolist() == assembly.matrix.diagonal[[3, 4, 5, 9, 10, 11]].tolist()


def test_values_of_the_free_degrees_of_freedom_stand_at_their_nodes_and_held_ones_have_none():
    found = built().by_node(np.arange(1.0, 14.0))
    assert found.tolist() == [[0.0] * 6, [*range(1, 7)], [*range(7, 13)], [0.0, 13.0, 0.0, 0.0, 0.0, 0.0]]


def test_a_node_s_arm_is_the_mean_of_its_beams_lengths_and_1_m_without():
    assembly = built()
    assert assembly.arms.tolist() == [2.0, 2.5, 3.0, 1.0]
    assert assembly.reach.reshape(4, 6)[1].tolist() == [1.0, 1.0, 1.0, 0.4, 0.4, 0.4]


def test_what_the_ground_bears_is_the_internal_forces_less_the_load():
    assembly, load = built(), np.zeros((4, 6))
    load[3, 2], load[0, 0], load[2, 1] = -7.0, 4.0, 5.0
    found = assembly.unbalanced(at_rest(NODES), load)
    assert found[3, :3] == pytest.approx([0.0, 0.0, 20.0 + 7.0])
    assert found[0, :3] == pytest.approx([-4.0, 0.0, 0.0], abs=1e-9)
    assert found[2, :3] == pytest.approx([0.0, -5.0, -20.0], abs=1e-9)
    balance = assembly.evaluate(at_rest(NODES))
    assert (balance.largest, balance.energy) == (pytest.approx(20.0), pytest.approx(0.5 * 20.0 * 0.8))
    assert built().evaluate(at_rest(NODES), tangent=False).tangent is None


def disturbed():
    return moved(at_rest(NODES), 0.1 * np.random.default_rng(4).normal(size=(4, 6)))


def test_how_far_a_beam_is_turned_is_told_from_45_degrees_on_beside_cables():
    assembly, turned = built(), []
    for angle in (0.7, 1.2):
        step = np.zeros((4, 6))
        step[1, 5] = -angle
        turned.append(assembly.evaluate(moved(at_rest(NODES), step), tangent=False).turned)
    assert turned == [0.0, pytest.approx(1.2)]


def test_nothing_to_put_together_is_no_error():
    assembly = Assembly(2, (), np.ones((2, 6), dtype=bool))
    assert (len(assembly.free), assembly.matrix.size) == (0, 0)


def test_forces_begin_to_change_along_a_motion_as_differences_say():
    assembly, state = built(), disturbed()
    motion = np.random.default_rng(5).normal(size=(4, 6))
    ahead, behind = (assembly.evaluate(moved(state, s * 1e-6 * motion)).force for s in (1.0, -1.0))
    slope = (ahead - behind) / 2e-6
    np.testing.assert_allclose(assembly.force_along(state, motion)[:, :3], slope[:, :3], rtol=1e-6, atol=1e-5)


def test_stiffness_along_two_sets_of_motions_is_that_of_the_forces_they_change():
    assembly, state = built(), disturbed()
    left, right = np.random.default_rng(6).normal(size=(2, 24, 3))
    found = sum(bilinear(part, state, left, right) for part in assembly.parts)
    by_hand = sum(
        float(left[:, k] @ assembly.force_along(state, right[:, k].reshape(4, 6)).ravel()) for k in range(3)
    )
    assert found == pytest.approx(by_hand, rel=1e-10)


def test_reactions_change_with_the_free_degrees_of_freedom_as_differences_say():
    assembly, state = built(), disturbed()
    held = np.array([20, 0, 2, 4, 18])
    found = reaction_rows(assembly, state, held).toarray()
    free = assembly.free % 6 < 3
    for column in np.flatnonzero(free):
        step = np.zeros(24)
        step[assembly.free[column]] = 1e-6
        ahead, behind = (
            assembly.evaluate(moved(state, s * step.reshape(4, 6))).force.ravel()[held] for s in (1.0, -1.0)
        )
        np.testing.assert_allclose(found[:, column], (ahead - behind) / 2e-6, rtol=1e-6, atol=1e-5)
    assert np.abs(found[:, free]).max(axis=1).min() > 0.1
    assert reaction_rows(assembly, state, np.zeros(0, dtype=int)).shape == (0, 13)


def test_a_column_has_an_element_s_values_where_they_are_free_and_a_load_counts_against_forces():
    assembly = built()
    dofs, values = np.array([[0, 6, 19], [17, 18, 7]]), np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
    found = element_columns(assembly, dofs, values).toarray()
    assert found.shape == (13, 2)
    assert {(int(i), int(j)): float(found[i, j]) for i, j in np.argwhere(found)} == {
        (0, 0): 2.0,
        (12, 0): 3.0,
        (11, 1): 4.0,
        (1, 1): 6.0,
    }
    load = np.zeros((4, 6))
    load[1, 2], load[0, 2] = 5.0, 9.0
    column = by_load(assembly, load).toarray()
    assert (column[2, 0], np.abs(column).sum()) == (-5.0, 5.0)


def test_the_tangent_of_the_deformations_that_a_state_has_is_the_state_s_and_of_others_theirs():
    assembly, state = built(), disturbed()
    whole = assembly.evaluate(state).tangent.copy()
    own = assembly.foreseen(state, np.zeros((4, 6)))
    np.testing.assert_allclose(assembly.tangent_of(state, own), whole, rtol=1e-9, atol=1e-9 * whole.max())
    loose = assembly.tangent_of(state, [np.zeros_like(each) for each in own])
    assert np.abs(loose - whole).max() > 1e-3 * whole.max()
    assert loose[-1] == pytest.approx(whole[-1]), "the cable's is its own"
    assert 0.0 < assembly.clock["assembly"] < 60.0


def test_the_time_of_an_assembly_is_what_it_took():
    assembly = built()
    assembly.evaluate(at_rest(NODES))
    assert 0.0 < assembly.clock["assembly"] < 60.0


def keeper(nodes, ends, *, axial=900.0, held=()):
    """Of beams; degrees of freedom in `held` are not free."""
    place = np.array(nodes, dtype=float)
    beams = make_beams(place, ends, axial=axial, torsion=2.0, bending_y=3.0, bending_z=5.0)
    return ChordKeeper(len(place), [beams], np.setdiff1d(np.arange(6 * len(place)), held)), at_rest(place)


ALL = range(6)


def test_a_step_across_a_beam_turns_it_and_one_along_it_stretches_it():
    chords, state = keeper([[1, 1, 0], [3, 1, 0]], [[0, 1]], held=ALL)
    step = np.zeros((2, 6))
    step[1] = [0.1, 0.6, 0.0, 0.2, 0.3, 0.4]
    found = chords.corrected(state, step)
    there = np.array([2.1 * np.cos(0.3) - 2.0, 2.1 * np.sin(0.3), 0.0])
    assert found[1, :3] == pytest.approx(there, abs=1e-8)
    assert found[1, 3:] == pytest.approx([0.2, 0.3, 0.4])
    assert not found[0].any()
    assert step[1, 0] == 0.1, "the step that was given stays"


@pytest.mark.parametrize("axial", [1e8, 900.0, 1e-8])
def test_a_rod_that_nothing_holds_keeps_its_middle_and_its_length(axial):
    chords, state = keeper([[1, 1, 0], [3, 1, 0]], [[0, 1]], axial=axial)
    step = np.zeros((2, 6))
    step[:, 1] = [-0.3, 0.3]
    found = moved(state, chords.corrected(state, step)).positions
    assert np.linalg.norm(found[1] - found[0]) == pytest.approx(2.0, abs=1e-6)
    assert found.mean(axis=0) == pytest.approx([2.0, 1.0, 0.0], abs=1e-6)


def test_between_two_beams_the_stiffer_one_decides_and_what_is_held_stays():
    """A node between ends that are held moves across by 0.2: each chord would have it back by its own
    turn."""
    nodes, ends = [[0, 0, 0], [2, 0, 0], [3, 0, 0]], [[0, 1], [1, 2]]
    held = [*range(6), *range(12, 18)]
    chords, state = keeper(nodes, ends, axial=[600.0, 100.0], held=held)
    step = np.zeros((3, 6))
    step[1, 1] = 0.2
    first = 2.0 * np.array([np.cos(0.1) - 1.0, np.sin(0.1) - 0.1])
    second = np.array([1.0 - np.cos(0.2), np.sin(0.2) - 0.2])
    both = (300.0 * first + 100.0 * second) / 400.0  # weighted by EA/l
    found = chords.corrected(state, step)
    assert found[1, :2] - step[1, :2] == pytest.approx(both, abs=1e-8)
    chords, state = keeper(nodes, ends, axial=[600.0, 100.0], held=[*held, 7])
    found = chords.corrected(state, step)
    assert found[1, :2] == pytest.approx([both[0], 0.2], abs=1e-8)


def test_without_beams_a_step_is_as_it_is():
    step = np.ones((2, 6))
    assert ChordKeeper(2, [], np.arange(12)).corrected(at_rest(NODES[:2]), step) is step


def test_the_largest_turn_is_of_the_chord_that_turns_most_and_a_beam_is_halved_below_half_its_length():
    chords, state = keeper([[0, 0, 0], [2, 0, 0], [2, 1, 0]], [[0, 1], [1, 2]])

    def to(*last):
        return State(
            np.array([[5.0, 0, 0], [7.0, 0.2, 0], [7.0 + last[0], 0.2 + last[1], 0]]), state.quaternions
        )

    assert chords.largest_turn(state, to(-1.0, 1.0)) == pytest.approx(np.pi / 4)
    assert chords.largest_turn(state, to(-1.0, -1.0)) == pytest.approx(0.75 * np.pi)
    assert chords.largest_turn(state, to(0.0, 1.0)) == pytest.approx(np.arctan(0.1))
    for along, halved in ((0.51, False), (0.49, True), (-1.0, True)):
        assert chords.halved(state, to(0.3, along)) == halved
    assert not chords.halved(state, to(0.0, 3.0))
