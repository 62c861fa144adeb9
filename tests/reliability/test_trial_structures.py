"""The judge within a search: which structures it draws, and how many may fall."""

from dataclasses import replace

import pytest

from shellform.gridshell.tolerances import Tolerances
from shellform.reliability import trial_structures
from shellform.reliability.safety import Safety
from shellform.reliability.trial_structures import (
    SEED,
    Demand,
    JudgedTrial,
    Required,
    aims,
    enlarged,
    to_bear,
    tried,
)

ROUGH = Tolerances(supports=1e-4, load_each=0.1, load_all=0.4)


def test_a_search_draws_other_structures_than_those_by_which_its_result_is_judged_and_with_larger_errors(
    dome, nominal, monkeypatch
):
    asked_for, own = [], trial_structures.drawn

    def perfect(members, tolerances, seed, number):
        asked_for.append((tolerances, seed, number))
        return own(members, Tolerances(), seed, number)

    monkeypatch.setattr(trial_structures, "drawn", perfect)
    safety = Safety(ROUGH, critical_factor=None, drawn=10, tried=3, seed=5, enlarged=1.5)
    asked = Required(safety, {"design": nominal.load}, "design", {"design": 0})
    found = tried(dome, dome.design(), asked, first=(2,))
    assert found.stands
    assert [number for *_, number in asked_for] == [2, 0, 1], "those that fell before come first"
    assert {seed for _, seed, _ in asked_for} == {5 + SEED} != {safety.seed}
    assert {each for each, *_ in asked_for} == {
        Tolerances(supports=1.5 * 1e-4, load_each=1.5 * 0.1, load_all=0.5)
    }


def test_a_judgement_tells_how_many_structures_were_loaded_and_how_many_there_are_at_the_most(dome, nominal):
    safety = Safety(ROUGH, critical_factor=None, drawn=10, tried=6)
    heard = []
    asked = Required(safety, {"design": nominal.load}, "design", {"design": 6})
    tried(dome, dome.design(), asked, judging=lambda done, most: heard.append((done, most)))
    assert heard == [(4, 6), (6, 6)]


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
    monkeypatch.setattr(trial_structures, "tried", lambda *_, **__: found)
    assert to_bear(dome, dome.design(), asked) == dict.fromkeys(range(9), 1.0)
    may = JudgedTrial({"design": (), "additional": (1, 2, 3, 4)}, True, True, 0, factors)
    monkeypatch.setattr(trial_structures, "tried", lambda *_, **__: may)
    assert to_bear(dome, dome.design(), asked) == {}


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


def test_a_judgement_knows_what_each_structure_bears(dome, nominal):
    loads = {"design": nominal.load, "additional": 1.25 * nominal.load}
    asked = Required(
        Safety(ROUGH, critical_factor=None, drawn=10, tried=3), loads, "design", dict.fromkeys(loads, 3)
    )
    found = tried(dome, dome.design(), asked)
    assert set(found.factors) == {0, 1, 2}
    assert max(found.factors.values()) <= 1.0, "none is followed beyond the largest load"
    light = replace(asked, loads={"design": 0.2 * nominal.load}, fallen={"design": 3})
    assert set(tried(dome, dome.design(), light).factors.values()) == {1.0}
    for name, share in (("design", 0.8), ("additional", 1.0)):
        assert set(found.fallen[name]) == {
            number for number, factor in found.factors.items() if factor < share - 1e-9
        }


def test_enlarged_errors_are_larger_by_the_factor_as_far_as_shares_go():
    found = enlarged(Tolerances(cable_length=1e-3, supports=2e-3, marks=0.4, rod_bow=1e-3, load_all=0.4), 1.5)
    assert (found.cable_length, found.supports, found.marks) == pytest.approx((1.5e-3, 3e-3, 0.6))
    assert (found.rod_bow, found.load_all, found.shape) == (pytest.approx(1.5e-3), 0.5, 0.0)
