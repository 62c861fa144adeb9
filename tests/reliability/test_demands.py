"""What is asked of designs by what a start shows, and of the structures that fall in one."""

from dataclasses import replace

import pytest

from shellform.reliability import demands
from shellform.reliability.demands import aims, to_bear
from shellform.reliability.requirements import FRESH, SEED, Required
from shellform.reliability.safety import Safety
from shellform.reliability.trial_structures import JudgedTrial
from tests.reliability.asked import DOWN, LOADS, ROUGH, asked_of


def test_as_many_are_aimed_for_as_have_to_stand_and_three_beside_those_that_bear_most(nominal):
    asked = Required(
        Safety(ROUGH, critical_factor=None, drawn=10, tried=10),
        {"design": nominal.load, "additional": 1.25 * nominal.load},
        "design",
        {"design": 0, "additional": 4},
    )
    factors = {number: 0.1 + 0.1 * number for number in range(10)}
    fallen = {"design": (1, 0), "additional": (8, 0, 7, 1, 6, 2, 5, 3, 4)}
    found = JudgedTrial(fallen, True, False, 0, factors)
    assert aims(asked, found) == pytest.approx({0: 0.8, 1: 0.8, **dict.fromkeys(range(2, 9), 1.0)})
    assert list(aims(asked, found)) == list(range(9)), (
        "few may fall under the smaller load; what bears least first"
    )
    enough = JudgedTrial({"design": (), "additional": (1, 2, 3, 4)}, True, True, 0, factors)
    assert aims(asked, enough) == {}


def test_before_thinning_all_that_fall_are_aimed_for_where_more_do_than_may(dome, nominal, monkeypatch):
    asked = Required(
        Safety(ROUGH, critical_factor=None, drawn=10, tried=10),
        {"design": nominal.load, "additional": 1.25 * nominal.load},
        "design",
        {"design": 0, "additional": 4},
    )
    factors = {number: 0.1 + 0.1 * number for number in range(10)}
    found = JudgedTrial({"design": (), "additional": tuple(range(9))}, True, False, 0, factors)
    monkeypatch.setattr(demands, "try_structures", lambda *_, **__: found)
    assert to_bear(dome, dome.design(), asked) == dict.fromkeys(range(9), 1.0)
    may = JudgedTrial({"design": (), "additional": (1, 2, 3, 4)}, True, True, 0, factors)
    monkeypatch.setattr(demands, "try_structures", lambda *_, **__: may)
    assert to_bear(dome, dome.design(), asked) == {}


def test_where_the_start_shows_more_falls_than_the_probability_allows_as_many_may(monkeypatch):
    safety = Safety(ROUGH, critical_factor=None, tried=40)
    for shown, additional, may in (
        ((5, 9), None, {"wet": 5, "wetter": 9}),
        ((1, 0), None, {"wet": 2, "wetter": 2}),
        ((5, 9), 0.9, {"wet": 5, "wetter": 7}),
    ):
        fell = {name: tuple(range(count)) for name, count in zip(LOADS, shown, strict=True)}
        heard = []
        monkeypatch.setattr(
            demands,
            "try_structures",
            lambda _shell, _start, asked, heard=heard, fell=fell, **how: (
                heard.append((asked, how)) or JudgedTrial(fell, True, True, 0)
            ),
        )
        given = replace(safety, probability_additional=additional)
        loads = {**LOADS, "none": 0.0 * DOWN}
        found = demands.required(None, None, loads, given, design_load="wet")
        assert found.fallen == may
        (asked, how), *_ = heard
        assert asked.fallen == {"wet": 40, "wetter": 40}, "none is refused"
        assert not how["critical"]


class Bearing:
    """A start that bears its loads with errors enlarged so many times and no more, of which so many fall
    else."""

    def __init__(self, monkeypatch, times, fallen=(0, 0)):
        self.times, self.fell, self.heard = times, dict(zip(LOADS, map(range, fallen), strict=True)), []
        monkeypatch.setattr(demands, "try_structures", self)

    def __call__(self, _shell, _start, asked, **_how):
        self.heard.append((asked.safety.enlarged, asked.safety.tried, asked.safety.seed, dict(asked.fallen)))
        fallen = {name: tuple(own) for name, own in self.fell.items()}
        return JudgedTrial(fallen, True, asked.safety.enlarged <= self.times, 0)


@pytest.mark.parametrize(
    ("times", "enlarged_by", "tried_", "trusted"),
    [(1.5, 1.5, 12, True), (1.25, 1.25, 40, False), (1.0, 1.0, 40, False)],
)
def test_errors_are_enlarged_as_far_as_the_start_bears_them_and_numbers_make_up_for_what_they_are_not(
    monkeypatch, times, enlarged_by, tried_, trusted
):
    start = Bearing(monkeypatch, times)
    safety = Safety(ROUGH, critical_factor=None, tried=12, drawn=150, seed=3, enlarged=1.5)
    found = demands.demand(None, None, LOADS, safety, design_load="wet")
    assert (found.trial.safety.enlarged, found.trial.safety.tried, found.trusted) == (
        enlarged_by,
        tried_,
        trusted,
    )
    expected = [(1.5, 12, 3, {"wet": 0, "wetter": 12}), (1.25, 40, 3, {"wet": 1, "wetter": 40})]
    expected += [(1.0, 40, 3, {"wet": 40, "wetter": 40})]
    assert start.heard == expected[: [1.5, 1.25, 1.0].index(times) + 1]
    fresh = found.confirmed
    assert (fresh.safety.enlarged, fresh.safety.tried, fresh.safety.seed, fresh.first) == (1.0, 150, 3, FRESH)
    assert fresh.fallen == {"wet": 1, "wetter": 1}


def test_trials_without_enlarged_errors_are_not_trusted_though_the_start_bears_them(monkeypatch):
    Bearing(monkeypatch, 3.0)
    safety = Safety(ROUGH, critical_factor=None, tried=12, drawn=60, enlarged=1.0)
    assert not demands.demand(None, None, LOADS, safety, design_load="wet").trusted


def test_where_as_many_may_fall_as_of_the_start_those_are_counted_that_a_finished_design_is_judged_by(
    monkeypatch,
):
    start = Bearing(monkeypatch, 1.5, fallen=(0, 7))
    safety = Safety(ROUGH, critical_factor=None, tried=12, drawn=60, seed=3)
    found = demands.demand(None, None, LOADS, safety, design_load="wet")
    assert found.trial.fallen == {"wet": 0, "wetter": 7}
    assert start.heard[-1] == (1.0, 60, 3 - SEED, {"wet": 60, "wetter": 60})
    fresh = found.confirmed
    assert (fresh.fallen, fresh.first, fresh.safety.seed) == ({"wet": 0, "wetter": 7}, FRESH, 3)
    assert found.trusted


def test_what_falls_under_several_loads_is_to_bear_the_largest_before_thinning_and_the_smallest_at_the_end(
    monkeypatch,
):
    asked = asked_of({"wet": 0, "wetter": 0})
    found = JudgedTrial({"wet": (4,), "wetter": (4, 2)}, True, False, 0, {4: 0.3, 2: 0.9})
    monkeypatch.setattr(demands, "try_structures", lambda *_, **__: found)
    assert to_bear(None, None, asked) == {4: 1.0, 2: 1.0}
    assert aims(asked, found) == {4: pytest.approx(0.8), 2: 1.0}


def test_of_those_that_fall_the_ones_that_bear_most_are_aimed_for_and_of_unknown_factors_nothing_is_expected():
    fell = JudgedTrial({"wet": (1, 2, 3, 4, 5, 6)}, True, False, 0, {1: 0.5, 2: 0.1, 3: 0.9, 4: 0.7, 5: 0.3})
    for may, nearest in ((0, (6, 2, 5, 1, 4, 3)), (3, (6, 2, 5, 1, 4, 3)), (4, (2, 5, 1, 4, 3)), (8, (3,))):
        assert demands._nearest(fell, "wet", may) == nearest
