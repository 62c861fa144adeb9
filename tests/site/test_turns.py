"""Whole turns of turnbuckles, by hand: cables that don't act on one another, and two that do."""

import numpy as np
import pytest

from shellform.errors import InputError
from shellform.site import turns
from shellform.site.turns import Crew, whole_turns


def apart(curvatures, slopes, *, step=0.5, weight=1.0):
    """J and `away` of cables each of which moves a node of its own: the sum of squares changes by twice
    slope k + curvature k² / 2 where one is turned by k steps, the weight counted in."""
    moves = np.sqrt(np.asarray(curvatures) / step**2 - weight)
    return np.diag(moves), np.asarray(slopes) / (step * moves)


def test_every_cable_gets_the_turns_that_its_own_node_wants_rounded_and_within_the_largest_change():
    jacobian, away = apart([1.0, 2.0, 0.5, 4.0, 1.0], [-2.4, 3.2, -9.0, -0.8, 9.0])
    found = whole_turns(jacobian, away, Crew(step=0.5, largest=1.7, cables=5), weight=1.0)
    assert found.tolist() == [2, -2, 3, 0, -3]
    assert found.dtype == np.int64


def test_a_largest_change_of_so_many_steps_allows_that_many_whatever_rounding_makes_of_their_quotient():
    """0.3 mm over 0.1 mm is a little less than 3."""
    jacobian, away = np.eye(1), np.array([1.0])
    for largest, most in ((0.0003, 3), (0.00039, 3), (0.00041, 4)):
        assert whole_turns(jacobian, away, Crew(0.0001, largest, 1), weight=0.0).tolist() == [-most]


def test_a_crew_of_few_turns_the_cables_that_bring_most_within_their_bounds():
    """Alone, and at most 3 steps: 3 · 4 - 0.5 · 3² / 2 = 9.75 of the first and 7² / 6 = 8.2 of the second;
    without bounds the third would bring most, 5² / (2 · 0.25) = 50, which are 3 · 5 - 0.25 · 3² / 2 = 13.9
    with them."""
    jacobian, away = apart([0.5, 3.0, 0.25 + 1e-9], [-4.0, -7.0, 5.0], weight=0.0)
    wanted = {1: [0, 0, -3], 2: [3, 0, -3], 3: [3, 2, -3]}
    for cables, steps in wanted.items():
        assert whole_turns(jacobian, away, Crew(0.5, 1.5, cables), weight=0.0).tolist() == steps


def test_cables_are_chosen_one_by_one_by_what_each_brings_beside_those_chosen_before():
    """The second alone would bring nearly as much as the first, 15.0 of 18.0, and nothing beside it; the
    third 1.0."""
    jacobian = np.array([[3.0, 1.0, 0.0], [0.0, 0.45, 0.0], [0.0, 0.0, 1.0]])
    away = np.array([-6.0, 0.0, 1.4])
    for cables, steps in ((1, [2, 0, 0]), (2, [2, 0, -1])):
        assert whole_turns(jacobian, away, Crew(1.0, 9.0, cables), weight=0.0).tolist() == steps


def test_a_turn_that_the_survey_cannot_see_is_not_taken_for_the_weight_of_turning():
    jacobian, away = np.array([[1.0]]), np.array([-2.0])
    crew = Crew(step=1.0, largest=5.0, cables=1)
    assert whole_turns(jacobian, away, crew, weight=0.0).tolist() == [2]
    assert whole_turns(jacobian, away, crew, weight=0.5).tolist() == [1], "2 / 1.5"
    assert whole_turns(jacobian, away, crew, weight=4.0).tolist() == [0], "2 / 5"


def test_of_sixty_cables_a_crew_for_fifty_one_turns_those_that_bring_most():
    """More than fifty are chosen by twos: not one too many. The k-th wants k / 8 steps."""
    wish = np.arange(1, 61) / 8.0
    wish[::2] *= -1.0
    found = whole_turns(np.eye(60), -wish, Crew(step=1.0, largest=20.0, cables=51), weight=0.0)
    assert found.tolist() == [0] * 9 + np.rint(wish[9:]).astype(int).tolist()


def test_no_cable_is_turned_where_none_brings_anything():
    assert whole_turns(np.eye(3), np.zeros(3), Crew(1.0, 2.0, 2), weight=0.0).tolist() == [0, 0, 0]


def test_what_would_go_too_far_is_held_at_its_bound_and_the_rest_is_solved_for_again():
    """Without bounds 19/3 and -8/3; with the first at 3 the second is (1 - 3) / 2. Beside a third, fixed at
    0.4, that acts on the second, it is (1 - 3 - 0.4) / 2."""
    gram = np.array([[2.0, 1.0, 0.0], [1.0, 2.0, 1.0], [0.0, 1.0, 2.0]])
    slope = np.array([-10.0, -1.0, 0.0])
    for third, second in ((0.0, -1.0), (0.4, -1.2)):
        found = turns._bounded(gram, slope, [0, 1], np.array([7.0, 7.0, third]), 3)
        assert found == pytest.approx([3.0, second])
    assert turns._bounded(gram, -slope, [0, 1], np.zeros(3), 3) == pytest.approx([-3.0, 1.0])
    assert turns._bounded(gram, slope, [0, 1], np.zeros(3), 10) == pytest.approx([19 / 3, -8 / 3])


@pytest.mark.parametrize(("second", "whole"), [(0.55, [2.0, 0.0]), (0.65, [2.0, 1.0])])
def test_the_surest_turn_is_rounded_first_and_the_other_solved_for_again(monkeypatch, second, whole):
    """1.9 is nearer to a whole number than 0.55, of which 0.55 - 0.9 (2 - 1.9) is left; the other way round
    they would be 1 and 1.9 - 0.9 · 0.45, which is 1 too."""
    monkeypatch.setattr(turns, "_polished", lambda _gram, _slope, whole, _chosen, _most: whole)
    jacobian = np.linalg.cholesky([[1.0, 0.9], [0.9, 1.0]]).T
    away = -jacobian @ [1.9, second]
    assert whole_turns(jacobian, away, Crew(1.0, 9.0, 2), weight=0.0).tolist() == whole


def test_single_turns_are_tried_on_the_chosen_cables_one_after_the_other_within_their_bounds():
    """The first wants 9.2 / 2 = 4.6, at most 4; then the second (7.2 - 4) / 2 = 1.6, and the first stays."""
    gram = np.array([[2.0, 1.0, 0.0], [1.0, 2.0, 0.0], [0.0, 0.0, 1.0]])
    slope = np.array([-9.2, -7.2, -5.0])
    assert turns._polished(gram, slope, np.zeros(3), [0, 1], 4).tolist() == [4, 2, 0]
    assert turns._polished(gram, -slope, np.zeros(3), [0, 1], 4).tolist() == [-4, -2, 0]
    # from too many turns of the second: (9.2 - 4) / 2 = 2.6, then (7.2 - 3) / 2 = 2.1, then (9.2 - 2) / 2 =
    # 3.6
    assert turns._polished(gram, slope, np.array([0.0, 4.0, 1.0]), [0, 1], 4).tolist() == [4, 2, 1]


def test_what_a_crew_is_told_to_give_is_a_crew_that_can_be():
    with pytest.raises(InputError, match=r"crew\.step.*metres of rest length, such as 0\.0001"):
        Crew(step=-1.0, largest=0.002, cables=1)
    with pytest.raises(InputError, match=r"crew\.largest.*metres of rest length, such as 0\.002"):
        Crew(step=0.0001, largest=0.0, cables=1)
    with pytest.raises(InputError, match=r"crew\.step: must not be more.*Give metres up to 0\.002"):
        Crew(step=0.0021, largest=0.002, cables=1)
    assert Crew(step=0.002, largest=0.002, cables=1).step == 0.002
