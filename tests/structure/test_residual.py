"""What counts as equilibrium and what is refused for rounding or for turning too far, by hand-computed
numbers."""

from types import SimpleNamespace

import numpy as np
import pytest

from shellform.errors import NotConverged
from shellform.structure.elements.rotation import from_vectors
from shellform.structure.solve.residual import (
    ResidualNorm,
    Turning,
    check_turned,
    drowned,
    held,
    overturned,
)

EPS = 2.0**-52
FREE = np.array([0, 2, 4, 7, 9, 11])  # of two nodes with arms of 0.5 and 2 m


def measuring():
    reach = np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0, 1.0, 1.0, 1.0, 0.5, 0.5, 0.5])
    return ResidualNorm(SimpleNamespace(free=FREE, arms=np.array([0.5, 2.0]), reach=reach, last_digit=EPS))


def rows(*values):
    """A force (2, 6) from places and values."""
    found = np.zeros(12)
    for place, value in values:
        found[place] = value
    return found.reshape(2, 6)


def balance(force, largest=0.0, tangent=(3.0, -9.0, 7.0)):
    return SimpleNamespace(force=force, largest=largest, tangent=np.array(tangent))


def test_a_rotation_weighs_as_a_translation_does_over_its_node_s_arm():
    assert measuring().mass_shape.tolist() == [1.0, 1.0, 0.25, 1.0, 4.0, 4.0]


@pytest.mark.parametrize(
    ("load", "force", "largest", "residual"),
    [
        ([(2, -8.0)], [(2, -6.5)], 0.0, 1.5 / 8.0),
        ([(2, -8.0)], [(2, -6.5)], 20.0, 1.5 / 20.0),
        ([(4, 3.0)], [(4, 4.0)], 0.0, 2.0 / 6.0),  # moments over an arm of 0.5 m
        ([(11, 3.0)], [(11, 4.0), (7, 0.25)], 0.0, 0.5 / 1.5),  # and of 2 m
        ([(1, -8.0), (0, 2.0)], [(1, 99.0), (0, 1.0)], 0.0, 1.0 / 8.0),  # what is held bears anything
        ([], [(0, 0.5)], 0.0, 0.0),  # nothing to measure it by
        ([(0, 2.0)], [(0, np.nan)], 0.0, np.inf),
        ([(0, 2.0)], [(9, np.inf)], 5.0, np.inf),
    ],
)
def test_the_residual_is_the_largest_unbalanced_force_over_the_largest_there_is(
    load, force, largest, residual
):
    found = measuring().residual(balance(rows(*force), largest), rows(*load))
    assert found == pytest.approx(residual)


def test_rounding_leaves_four_last_digits_of_the_farthest_coordinate_times_the_stiffest_entry():
    state = SimpleNamespace(positions=np.array([[1.0, -40.0, 2.0], [3.0, 0.0, 10.0]]))
    found = measuring().rounding(balance(rows(), 20.0, (3e6, -9e6, 7e6)), state, rows((2, -8.0)))
    assert found == pytest.approx(7e6 * 4.0 * EPS * 40.0 / 20.0)
    assert measuring().rounding(balance(rows()), state, rows()) == 0.0


def test_most_is_a_millionth_of_the_load_or_the_looser_tolerance_and_without_load_1e_5_of_the_stress():
    measure, load = measuring(), rows((2, -8.0))
    assert measure.most(balance(rows(), 20.0), load, 1e-8) == pytest.approx(1e-6 * 8.0 / 20.0)
    assert measure.most(balance(rows(), 20.0), load, 1e-4) == pytest.approx(1e-4 * 8.0 / 20.0)
    assert measure.most(balance(rows(), 2.0), load, 1e-8) == pytest.approx(1e-6)
    assert measure.most(balance(rows(), 20.0), rows(), 1e-8) == 1e-5
    assert measure.most(balance(rows(), 20.0), rows(), 1e-3) == 1e-3


LOAD, NONE = rows((2, -8.0)), rows()


@pytest.mark.parametrize(
    ("noise", "most", "tolerance", "load", "within", "beyond"),
    [
        (0.0, 1e-6, 1e-8, LOAD, 0.99e-8, 1.01e-8),
        (0.0, 1e-6, 1e-3, LOAD, 0.99e-6, 1.01e-6),
        (8e-6, 1e-6, 1e-3, LOAD, 0.49e-6, 0.51e-6),  # less a sixteenth of what rounding may hide
        (14e-6, 1e-6, 1e-3, LOAD, 0.24e-6, 0.26e-6),  # but a quarter is left
        (14e-6, 1e-5, 1e-3, NONE, 0.99e-5, 1.01e-5),
    ],
)
def test_a_residual_within_the_tolerance_and_what_may_be_told_to_be_none_is_none(
    noise, most, tolerance, load, within, beyond
):
    measure = measuring()
    measure.most, measure.rounding = lambda *_: most, lambda *_: noise
    for residual, known in ((within, True), (beyond, False)):
        assert measure.balanced(residual, None, None, load, tolerance, stagnant=False) == known


@pytest.mark.parametrize(
    ("noise", "most", "load", "within", "beyond"),
    [
        (4e-7, 1e-6, LOAD, 3.9e-7, 4.1e-7),  # within what rounding leaves
        (8e-6, 1e-6, LOAD, 4.9e-7, 5.1e-7),  # and within what may be told to be none
        (0.9e-3, 1e-5, NONE, 0.99e-5, 1.01e-5),
        (1.1e-3, 1e-5, NONE, 1.09e-3, 1.11e-3),  # all that there is of stress is rounding
        (1.1e-3, 1e-5, LOAD, 0.24e-5, 0.26e-5),
    ],
)
def test_where_steps_bring_nothing_any_more_what_rounding_leaves_is_none(noise, most, load, within, beyond):
    measure = measuring()
    measure.most, measure.rounding = lambda *_: most, lambda *_: noise
    for residual, known in ((within, True), (beyond, False)):
        assert measure.balanced(residual, None, None, load, 1e-8, stagnant=True) == known
        assert not measure.balanced(residual, None, None, load, 1e-8, stagnant=False)


def test_on_the_way_to_a_load_the_whole_of_it_is_what_counts():
    measure, asked = measuring(), []
    measure.rounding = lambda _balance, _state, load: asked.append(("rounding", load is NONE)) or 8e-6
    measure.most = lambda _balance, load, tolerance: asked.append((load is LOAD, tolerance)) or 1e-6
    assert measure.balanced(0.49e-6, None, None, NONE, 1e-3, False, whole=LOAD)
    assert not measure.balanced(0.51e-6, None, None, NONE, 1e-3, False, whole=LOAD)
    assert asked[:2] == [(True, 1e-3), ("rounding", True)]


@pytest.mark.parametrize(
    ("noise", "load", "may", "surely"),
    [
        (0.9e-6, LOAD, False, False),
        (1.1e-6, LOAD, True, False),
        (15e-6, LOAD, True, False),
        (17e-6, LOAD, True, True),
        (0.5, LOAD, True, True),
        (0.9e-3, NONE, True, True),
        (1.1e-3, NONE, False, True),  # a sixteenth of it is no more than 1e-3
        (17e-3, NONE, False, False),
    ],
)
def test_rounding_drowns_the_load_where_it_leaves_more_than_may_be_told_to_be_none(noise, load, may, surely):
    measure = measuring()
    measure.most, measure.rounding = lambda *_: 1e-6, lambda *_: noise
    assert measure.drowns(None, None, load, 1e-8) == may
    assert measure.drowns(None, None, load, 1e-8, surely=True) == surely


@pytest.mark.parametrize(
    ("was", "turned", "chord", "too_far"),
    [
        (0.0, 171.0, 0.0, True),
        (0.0, 169.0, 0.0, False),
        (0.0, 50.0, 49.0, False),  # 90 untold, twice the 20 degrees of a node, and the chord
        (0.0, 50.0, 51.0, True),
        (100.0, 50.0, 39.0, False),
        (100.0, 50.0, 41.0, True),
        (100.0, 0.0, 180.0, False),
    ],
)
def test_an_element_may_turn_over_where_it_its_nodes_and_its_chord_together_pass_half_a_turn(
    was, turned, chord, too_far
):
    before = from_vectors(np.radians([[5.0, 0.0, 0.0], [0.0, 0.0, 10.0]]))
    after = from_vectors(np.radians([[25.0, 0.0, 0.0], [0.0, 0.0, 12.0]]))
    assembly = SimpleNamespace(chords=SimpleNamespace(largest_turn=lambda *_: np.radians(chord)))
    states = [SimpleNamespace(quaternions=each) for each in (before, -after)]
    assert overturned(assembly, states[0], np.radians(was), states[1], np.radians(turned)) == too_far


def test_a_node_that_is_not_turned_counts_for_nothing_though_its_quaternion_is_a_last_digit_too_long():
    same = SimpleNamespace(quaternions=np.array([[1.0 + EPS, 0.0, 0.0, 0.0]]))
    for chord, too_far in ((91.0, True), (89.0, False)):
        assembly = SimpleNamespace(chords=SimpleNamespace(largest_turn=lambda *_, by=chord: np.radians(by)))
        assert overturned(assembly, same, 0.0, same, 1.0) == too_far


def test_the_element_that_is_turned_the_farthest_at_either_end_is_named():
    def part(*turns):
        values = np.array([[9.0, *turn] for turn in turns], dtype=float)
        return SimpleNamespace(local_deformations=lambda _: values)

    first = part([1.0, 0.5, 0, 0, 0, 0], [0, 0, 0, 1.0, 1.0, 1.0])
    second = part([0, 1.5, 0, 0, 0, 0], [0, 0.1, 0, 0, -2.0, 2.2], [2.0, 2.0, 0, 0.5, 0, 0])
    assembly = SimpleNamespace(beams=[first, second])
    check_turned(assembly, "state", SimpleNamespace(turned=np.radians(170.0)), 7)
    with pytest.raises(NotConverged, match=r"beams\[3\] is turned against its ends by 171 degrees") as told:
        check_turned(assembly, "state", SimpleNamespace(turned=np.radians(171.0)), 7)
    assert (told.value.state, told.value.iterations) == ("state", 7)


def stiff(*values):
    return SimpleNamespace(stiffest=lambda: np.array(values))


def test_a_drowned_load_is_told_with_the_stiffest_elements_and_how_many_more_there_are():
    assembly = SimpleNamespace(beams=[stiff(1e3, 3e9, 5e9)], cables=[stiff(0.8e8, 1e8, 4e9, 9e9)])
    told = drowned(assembly, "state", 2.5e-3, 4)
    assert str(told).startswith(
        "Rounding hides the load beside the stiffness of cables[3], beams[2], cables[2] and 2 more, up to "
        "9.0e+09 N/m (residual 2.5e-03)"
    )
    assert (told.state, told.residual, told.iterations) == ("state", 2.5e-3, 4)
    few = drowned(SimpleNamespace(beams=[stiff(2e9, 1e9, 1.9e7)], cables=[stiff(5.0)]), None, 1.0, 0)
    assert "stiffness of beams[0], beams[1], up to 2.0e+09" in str(few)


def test_rotations_are_held_by_a_ten_billionth_of_their_own_stiffness():
    values = np.array([3.0, -2.0, 5.0, -7.0])
    assembly = SimpleNamespace(turns=np.array([1, 2]))
    found = held(assembly, SimpleNamespace(tangent=values)) - values
    assert found == pytest.approx([0.0, 2e-10, 5e-10, 0.0], rel=1e-4, abs=0.0)
    assert values[1] == -2.0, "the tangent itself stays"
    assembly.matrix = SimpleNamespace(raised=lambda values, places, by: (values, places.tolist(), by))
    both = np.array([[3.0, 1e-17], [-2.0, 1e-17], [5.0, 0.0]])
    kept, places, by = held(assembly, SimpleNamespace(tangent=both))
    assert kept is both
    assert places == [1, 2]
    assert by == pytest.approx([2e-22, 5e-22], rel=1e-9, abs=0.0)


def turning(moments):
    """Of three nodes: one with two free turns, one with all three, one with one."""
    number = np.full(18, -1)
    free = [0, 3, 5, 6, 9, 10, 11, 16]
    number[free] = np.arange(len(free))
    load = np.zeros((3, 6))
    load[:, 3:] = moments
    return Turning(SimpleNamespace(number=number), load)


def test_moments_turn_nodes_in_space_where_more_than_one_rotation_is_free():
    every = [[0.0, 0.0, 3.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0]]
    assert turning(every).nodes.tolist() == [0, 1]
    assert turning([[0.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 2.0, 0.0]]).nodes.tolist() == [1]
    assert turning(np.zeros((3, 3))).nodes.tolist() == []


def test_a_step_under_dead_moments_is_that_of_the_tangent_with_half_their_turning():
    chance = np.random.default_rng(2)
    tangent = 4.0 * np.eye(8) + 0.3 * (lambda a: a + a.T)(chance.normal(size=(8, 8)))
    right = chance.normal(size=8)
    inner = np.array([[0.0, 0.0, 0.0], [2.0, -1.0, 3.0], [-1.5, 2.5, 0.5]])[[1, 2, 0]]
    force = np.zeros((3, 6))
    force[:, 3:] = inner
    factor = SimpleNamespace(solve=lambda side: np.linalg.solve(tangent, side))
    block = np.zeros((8, 8))
    for rows_of, axes, m in (([1, 2], [0, 2], inner[0]), ([4, 5, 6], [0, 1, 2], inner[1])):
        spin = np.array([[0.0, -m[2], m[1]], [m[2], 0.0, -m[0]], [-m[1], m[0], 0.0]])
        block[np.ix_(rows_of, rows_of)] = -0.5 * spin[np.ix_(axes, axes)]
    found = turning(inner).solve(factor, SimpleNamespace(force=force), right)
    np.testing.assert_allclose(found, np.linalg.solve(tangent + block, right), rtol=1e-8)
    plain = turning(np.zeros((3, 3))).solve(factor, SimpleNamespace(force=force), right)
    np.testing.assert_allclose(plain, np.linalg.solve(tangent, right), rtol=1e-14)
