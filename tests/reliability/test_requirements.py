"""How many structures may fall, in trials and in fresh samples."""

from dataclasses import replace

import pytest

from shellform.reliability import requirements
from shellform.reliability.requirements import FRESH, Demand, Required
from shellform.reliability.safety import Safety
from tests.reliability.asked import ROUGH, asked_of


def test_fresh_samples_spare_one_fall_or_what_two_designs_that_fall_as_often_differ_by(nominal):
    loads = {"design": nominal.load, "additional": 1.2 * nominal.load}
    safety = Safety(ROUGH, critical_factor=None, drawn=200, tried=200, enlarged=1.0, probability_design=0.99)
    for may, spared in (
        ({"design": 2, "additional": 100}, (1, 90)),
        ({"design": 5, "additional": 2}, (5, 1)),
    ):
        asked = Required(safety, loads, "design", may)
        demand = Demand(asked, asked)
        assert tuple(demand.sample(3).fallen.values()) == spared
        assert demand.sample(3).first == 600
        assert demand.unspared().sample(3).fallen == may


def test_larger_errors_let_as_many_fall_as_their_share_of_a_normal_distribution_says():
    """P(P⁻¹(0.99) / 1.5) = 0.93952, P(P⁻¹(0.9) / 1.5) = 0.80355."""
    for tried_, times, may in (
        (100, 1.5, (6, 19)),
        (40, 1.5, (2, 7)),
        (12, 1.5, (0, 2)),
        (100, 1.0, (1, 10)),
    ):
        safety = Safety(ROUGH, probability_additional=0.9, tried=tried_, enlarged=times)
        known = tuple(requirements.may_fall(safety, name, "wet") for name in ("wet", "wetter"))
        assert known == may
        alike = replace(safety, probability_additional=None)
        assert requirements.may_fall(alike, "wetter", "wet") == may[0]


def test_a_closer_trial_takes_at_least_forty_structures_and_lets_as_large_a_share_fall():
    for tried_, additional, may, closer_may in (
        (12, None, {"wet": 1, "wetter": 5}, {"wet": 2, "wetter": 16}),
        (12, 0.9, {"wet": 1, "wetter": 5}, {"wet": 2, "wetter": 7}),
        (12, None, {"wet": 0, "wetter": 0}, {"wet": 2, "wetter": 2}),
        (100, None, {"wet": 9, "wetter": 9}, {"wet": 6, "wetter": 9}),
    ):
        trial = asked_of(may, tried=tried_, probability_additional=additional)
        found = requirements.closer(Demand(trial, None, trusted=False))
        assert found.trial.fallen == closer_may
        assert found.trial.safety.tried == max(40, tried_)
        assert not found.trusted
        assert found.confirmed is None


def test_samples_follow_one_another_without_a_structure_in_two_of_them():
    fresh = asked_of({"wet": 3, "wetter": 4}, first=FRESH, tried=6, enlarged=1.5)
    demand = Demand(fresh, fresh)
    assert demand.sample(0).numbers == range(FRESH, FRESH + 6)
    assert demand.sample(2).numbers == range(FRESH + 12, FRESH + 18)
    assert demand.after(3).sample(1).numbers == range(FRESH + 24, FRESH + 30)
    lone = Demand(fresh, None)
    assert lone.after(3) is lone
    assert fresh.tolerances(FRESH - 1).supports == pytest.approx(1.5e-4)
    assert fresh.tolerances(FRESH) == ROUGH, "whose errors are as they are"


def test_a_fresh_sample_spares_nothing_below_none_and_no_further_than_the_probability(monkeypatch):
    for may, spared in (
        ({"wet": 0, "wetter": 0}, (0, 0)),
        ({"wet": 3, "wetter": 3}, (3, 2)),
        ({"wet": 2, "wetter": 10}, (1, 6)),
    ):
        fresh = asked_of(may, tried=40, enlarged=1.0, probability_design=0.95)
        assert tuple(Demand(fresh, fresh).sample(0).fallen.values()) == spared


def test_surer_samples_are_twice_a_finished_designs_and_spare_a_standard_deviation(nominal):
    """Of 400 four may fall at 99 %, two of them by luck; under 1.2 times the load as many as of the start:
    twice 100 of 400, less by a standard deviation of 14 of the difference. Surer than surer is as sure."""
    loads = {"design": nominal.load, "additional": 1.2 * nominal.load}
    safety = Safety(ROUGH, critical_factor=None, drawn=200, tried=200, enlarged=1.0, probability_design=0.99)
    fresh = Required(safety, loads, "design", {"design": 2, "additional": 100}, FRESH)
    surer = Demand(fresh, fresh).surer()
    for each in (surer, surer.surer()):
        assert each.sample(0).numbers == range(FRESH, FRESH + 400)
        assert each.sample(0).fallen == {"design": 2, "additional": 185}
        assert each.after(2).sample(0).first == FRESH + 800
    assert surer.unspared().sample(0).fallen == {"design": 4, "additional": 200}
    alone = Demand(fresh, None)
    assert alone.surer() is alone
