"""How long is left is told by the pace of each phase, with what comes after the search."""

import pytest

from shellform.run import pace
from shellform.run.pace import Pace, time_words


@pytest.fixture
def at(monkeypatch):
    """Sets the clock."""
    now = [0.0]
    monkeypatch.setattr(pace, "clock_without_compiling", lambda: now[0])
    return lambda seconds: now.__setitem__(0, seconds)


def test_what_came_before_the_first_step_is_not_taken_for_its_pace(at):
    search = Pace(60)
    at(9.0)  # to the start's equilibria
    assert search.left(0) is None
    at(10.0)
    assert search.left(1) == pytest.approx(59.0)


def test_the_phases_after_the_first_have_a_pace_of_their_own(at):
    search = Pace(1000)
    for step in range(21):
        at(float(step))
        search.left(step, "descend")
    for step in range(21, 121):
        at(20.0 + 4.0 * (step - 20))
        left = search.left(step, "thin")
    assert left == pytest.approx(4.0 * 880, rel=0.05)


def test_a_phase_that_has_just_begun_is_taken_to_go_on_as_the_one_before(at):
    search = Pace(40)
    for step in range(21):
        at(float(step))
        search.left(step, "descend")
    at(30.0)  # one structure after the other was drawn
    assert 20.0 < search.left(20, "thin") < 100.0


def test_the_judgement_at_the_end_and_what_follows_the_search_are_counted(at):
    search = Pace(30, afterwards=35)
    for step in range(11):
        at(2.0 * step)
        search.left(step, "descend")
    for step in range(11, 31):
        at(20.0 + 8.0 * (step - 10))
        left = search.left(step, "thin")
    assert left == pytest.approx(2.0 * 35 + 8.0, rel=0.05)


def test_a_search_that_is_gone_on_with_is_told_by_what_it_takes_now(at):
    search = Pace(100)
    at(3.0)
    assert search.left(60, "thin") is None
    at(5.0)
    assert search.left(61, "thin") == pytest.approx(78.0)


def test_more_steps_than_planned_leave_nothing(at):
    search = Pace(2)
    for step in range(4):
        at(float(step))
        left = search.left(step)
    assert left == 0.0


def test_times_are_told_no_finer_than_they_are_known():
    assert [time_words(each) for each in (4.2, 99.0, 130.0, 5400.0, 9000.0)] == [
        "4 s",
        "99 s",
        "2 min",
        "90 min",
        "2 h",
    ]


def test_phases_after_the_first_count_for_what_they_took_and_for_five_evaluations_at_its_pace(at):
    """Two evaluations in 6 s, then one note without and three with an evaluation, in 20 s."""
    search = Pace(20, afterwards=10)
    at(1.0)
    search.left(1, "descend")
    at(7.0)
    assert search.left(3, "descend") == pytest.approx(3.0 * 17 + 3.0 * 10)
    for seconds, done in ((9.0, 3), (15.0, 4), (21.0, 5), (27.0, 6)):
        at(seconds)
        left = search.left(done, "thin")
    pace_now, between = (20.0 + 15.0) / (3 + 5), (20.0 + 15.0) / (4 + 5)
    assert left == pytest.approx(pace_now * 14 + between + 3.0 * 10)
    at(37.0)
    third = search.left(8, "agree")
    pace_now, between = (30.0 + 15.0) / (5 + 5), (30.0 + 15.0) / (5 + 5)
    assert third == pytest.approx(pace_now * 12 + between + 3.0 * 10), "with the phase before"


def test_where_time_has_passed_without_an_evaluation_nothing_is_known_of_what_is_left(at):
    search = Pace(20)
    at(1.0)
    assert search.left(0, "descend") is None
    at(4.0)
    assert search.left(0, "descend") is None
    at(5.0)
    assert search.left(0, "thin") is None


@pytest.mark.parametrize(
    ("seconds", "words"),
    [(99.4, "99 s"), (100.0, "2 min"), (5999.0, "100 min"), (6000.0, "2 h"), (36000.0, "10 h"), (0.0, "0 s")],
)
def test_times_are_told_in_seconds_and_minutes_up_to_a_hundred_of_them(seconds, words):
    assert time_words(seconds) == words


def test_evaluations_that_took_no_time_leave_none(at):
    search = Pace(20)
    at(3.0)
    search.left(1)
    assert search.left(2) == 0.0
