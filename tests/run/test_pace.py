"""How long is left is told by the pace of the steps themselves."""

import pytest

from shellform.run import pace
from shellform.run.pace import Pace


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


def test_a_search_that_slows_down_is_told_by_its_last_steps_and_one_that_speeds_up_by_all(at):
    slow, fast = Pace(40), Pace(40)
    for step in range(21):
        at(float(step) if step <= 10 else 10.0 + 4.0 * (step - 10))
        left = slow.left(step)
    assert left == pytest.approx(4.0 * 20)
    for step in range(21):
        at(4.0 * step if step <= 10 else 40.0 + step - 10)
        left = fast.left(step)
    assert left == pytest.approx(2.5 * 20)


def test_more_steps_than_planned_leave_nothing(at):
    search = Pace(2)
    for step in range(4):
        at(float(step))
        left = search.left(step)
    assert left == 0.0
