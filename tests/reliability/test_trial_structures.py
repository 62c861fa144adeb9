"""The judge within a search: which structures it draws, and how many may fall."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from shellform.errors import NotConverged
from shellform.gridshell.tolerances import Tolerances
from shellform.reliability import trial_structures
from shellform.reliability.drawing import PERFECT
from shellform.reliability.safety import Safety
from shellform.reliability.trial_structures import (
    FRESH,
    SEED,
    Demand,
    JudgedTrial,
    Required,
    aims,
    to_bear,
    try_structures,
)

ROUGH = Tolerances(supports=1e-4, load_each=0.1, load_all=0.4)


def test_a_search_draws_other_structures_than_those_by_which_its_result_is_judged_and_with_larger_errors(
    dome, nominal, monkeypatch
):
    asked_for, own = [], trial_structures.draw_errors

    def perfect(members, tolerances, seed, number):
        asked_for.append((tolerances, seed, number))
        return own(members, Tolerances(), seed, number)

    monkeypatch.setattr(trial_structures, "draw_errors", perfect)
    safety = Safety(ROUGH, critical_factor=None, drawn=10, tried=3, seed=5, enlarged=1.5)
    asked = Required(safety, {"design": nominal.load}, "design", {"design": 0})
    found = try_structures(dome, dome.design(), asked, first=(2,))
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
    try_structures(dome, dome.design(), asked, judging=lambda done, most: heard.append((done, most)))
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
    monkeypatch.setattr(trial_structures, "try_structures", lambda *_, **__: found)
    assert to_bear(dome, dome.design(), asked) == dict.fromkeys(range(9), 1.0)
    may = JudgedTrial({"design": (), "additional": (1, 2, 3, 4)}, True, True, 0, factors)
    monkeypatch.setattr(trial_structures, "try_structures", lambda *_, **__: may)
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
    found = try_structures(dome, dome.design(), asked)
    assert set(found.factors) == {0, 1, 2}
    assert max(found.factors.values()) <= 1.0, "none is followed beyond the largest load"
    light = replace(asked, loads={"design": 0.2 * nominal.load}, fallen={"design": 3})
    assert set(try_structures(dome, dome.design(), light).factors.values()) == {1.0}
    for name, share in (("design", 0.8), ("additional", 1.0)):
        assert set(found.fallen[name]) == {
            number for number, factor in found.factors.items() if factor < share - 1e-9
        }


def asked_of(may, *, first=0, loads=None, **entries):
    safety = Safety(ROUGH, **{"critical_factor": None, "tried": 6, "drawn": 20, "seed": 3, **entries})
    return Required(safety, LOADS if loads is None else loads, "wet", may, first)


DOWN = np.array([[0.0, 0.0, -6.0, 0.0, 0.0, 0.0]] * 2)
ASIDE = np.array([[-1.0, 0.0, 0.0, 0.0, 0.0, 0.0]] * 2)
LOADS = {"wet": DOWN, "wetter": 1.25 * DOWN}


class Tried:
    """Structures that bear factors of the largest load on a path, by number; each takes ten factorisations
    and one for each of its number."""

    def __init__(self, factors, monkeypatch):
        self.factors, self.loaded, self.looked = factors, [], []
        for name, fake in [
            (
                "perfect",
                lambda *given, step, heeding: SimpleNamespace(
                    members=given[2].sum(), known_to=lambda f: ("to", f)
                ),
            ),
            ("Workshop", self),
            ("draw_errors", lambda members, tolerances, seed, number: (number, members)),
        ]:
            monkeypatch.setattr(trial_structures, name, fake)

    def __call__(self, _nominal):
        return self

    def rests(self, errors, *, resolution, marks):
        number, load = errors
        self.loaded.append((load, number, resolution, marks))
        return SimpleNamespace(factor=self.factors[number], factorisations=10 + number)

    def limit(self, errors, **how):
        self.looked.append((errors, how))
        return SimpleNamespace(factor=self.factors[PERFECT], factorisations=100)

    def judged(self, asked, **how):
        return try_structures(None, None, asked, **how)


def test_structures_fall_under_the_loads_that_they_do_not_bear_and_refuse_where_more_do_than_may(monkeypatch):
    factors = {0: 1.0, 1: 0.9, 2: 0.8, 3: 0.7999, 4: 1.0, 5: 0.2}
    made = Tried(factors, monkeypatch)
    found = made.judged(asked_of({"wet": 2, "wetter": 4}))
    assert found.fallen == {"wet": (3, 5), "wetter": (1, 2, 3, 5)}
    assert (found.stands, found.critical, found.factorisations) == (True, True, 75)
    assert found.factors == factors
    assert {each[::2] for each in made.loaded} == {(-15.0, 1 / 32)}
    assert made.loaded[0][3] == (1.0, pytest.approx(0.8))
    for may in ({"wet": 1, "wetter": 4}, {"wet": 2, "wetter": 3}):
        assert not made.judged(asked_of(may)).stands


def test_no_more_structures_are_loaded_than_it_takes_to_refuse_but_where_the_whole_sample_is_asked_for(
    monkeypatch,
):
    made, heard = Tried({0: 0.9, 1: 0.9, **dict.fromkeys(range(2, 10), 1.0)}, monkeypatch), []
    asked = asked_of({"wet": 0, "wetter": 1}, tried=10)
    found = made.judged(asked, judging=lambda *told: heard.append(told))
    assert (found.fallen, found.stands, found.factorisations) == ({"wet": (), "wetter": (0, 1)}, False, 46)
    assert heard == [(4, 10)]
    assert set(found.factors) == {0, 1, 2, 3}
    whole = made.judged(asked, whole=True)
    assert (set(whole.factors), whole.stands, whole.factorisations) == (set(range(10)), False, 145)
    late = Tried({**dict.fromkeys(range(8), 1.0), 8: 0.9, 9: 0.9}, monkeypatch)
    found = late.judged(asked, first=(9, 8))
    assert (found.fallen["wetter"], set(found.factors)) == ((9, 8), {9, 8, 0, 1})


def test_structures_of_other_samples_count_under_the_design_load_alone(monkeypatch):
    made = Tried({**dict.fromkeys(range(6), 1.0), 900: 0.9, 901: 0.1}, monkeypatch)
    loads = {**LOADS, "wind": ASIDE}
    asked = asked_of({"wet": 1, "wetter": 0, "wind": 0}, loads=loads)
    found = made.judged(asked, first=(900, 2, 901))
    assert found.fallen == {"wet": (901,), "wetter": (), "wind": ()}
    assert found.stands
    assert found.factors[900] == 0.9
    assert [number for load, number, *_ in made.loaded if load == -15.0] == [900, 2, 901, 0, 1, 3, 4, 5]
    assert [number for load, number, *_ in made.loaded if load == -2.0] == [2, 0, 1, 3, 4, 5]
    assert not made.judged(asked_of({"wet": 0, "wetter": 0}), first=(901,)).stands


@pytest.mark.parametrize(("bears", "kept"), [(1.01, True), (1.0099, False)])
def test_the_perfect_structure_is_to_bear_a_hundredth_more_than_its_critical_factor(monkeypatch, bears, kept):
    """Of the load of which the design load is 0.8 the factor 1.25 is one time the largest load."""
    made = Tried({PERFECT: bears, **dict.fromkeys(range(6), 1.0)}, monkeypatch)
    asked = asked_of({"wet": 0, "wetter": 0}, critical_factor=1.25)
    found = made.judged(asked)
    assert (found.critical, found.stands) == (kept, kept)
    assert found.factorisations == (175 if kept else 100 + 10 + 11 + 12)
    assert PERFECT not in found.factors
    (errors, how) = made.looked[0]
    assert errors == (PERFECT, -15.0)
    assert how["most"] == pytest.approx(1.01)
    assert (how["begin"], how["tell"], how["resolution"]) == (("to", how["most"]), False, 1 / 32)
    assert not how["heeding"], "which takes a fifth of a trial, and the design to build is judged so"
    aimed = aims(asked, found)
    assert aimed == ({} if kept else {PERFECT: pytest.approx(1.01)})
    assert made.judged(asked, critical=False).stands, "where it isn't asked for"
    assert len(made.looked) == 1


def test_larger_errors_let_as_many_fall_as_their_share_of_a_normal_distribution_says():
    """P(P⁻¹(0.99) / 1.5) = 0.93952, P(P⁻¹(0.9) / 1.5) = 0.80355."""
    for tried_, times, may in (
        (100, 1.5, (6, 19)),
        (40, 1.5, (2, 7)),
        (12, 1.5, (0, 2)),
        (100, 1.0, (1, 10)),
    ):
        safety = Safety(ROUGH, probability_additional=0.9, tried=tried_, enlarged=times)
        known = tuple(trial_structures._known(safety, name, "wet") for name in ("wet", "wetter"))
        assert known == may
        alike = replace(safety, probability_additional=None)
        assert trial_structures._known(alike, "wetter", "wet") == may[0]


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
            trial_structures,
            "try_structures",
            lambda _shell, _start, asked, heard=heard, fell=fell, **how: (
                heard.append((asked, how)) or JudgedTrial(fell, True, True, 0)
            ),
        )
        given = replace(safety, probability_additional=additional)
        loads = {**LOADS, "none": 0.0 * DOWN}
        found = trial_structures.required(None, None, loads, given, design_load="wet")
        assert found.fallen == may
        (asked, how), *_ = heard
        assert asked.fallen == {"wet": 40, "wetter": 40}, "none is refused"
        assert not how["critical"]


def test_a_closer_trial_takes_at_least_forty_structures_and_lets_as_large_a_share_fall():
    for tried_, additional, may, closer_may in (
        (12, None, {"wet": 1, "wetter": 5}, {"wet": 2, "wetter": 16}),
        (12, 0.9, {"wet": 1, "wetter": 5}, {"wet": 2, "wetter": 7}),
        (12, None, {"wet": 0, "wetter": 0}, {"wet": 2, "wetter": 2}),
        (100, None, {"wet": 9, "wetter": 9}, {"wet": 6, "wetter": 9}),
    ):
        trial = asked_of(may, tried=tried_, probability_additional=additional)
        found = trial_structures.closer(Demand(trial, None, trusted=False))
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


class Bearing:
    """A start that bears its loads with errors enlarged so many times and no more, of which so many fall
    else."""

    def __init__(self, monkeypatch, times, fallen=(0, 0)):
        self.times, self.fell, self.heard = times, dict(zip(LOADS, map(range, fallen), strict=True)), []
        monkeypatch.setattr(trial_structures, "try_structures", self)

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
    found = trial_structures.demand(None, None, LOADS, safety, design_load="wet")
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
    assert not trial_structures.demand(None, None, LOADS, safety, design_load="wet").trusted


def test_where_as_many_may_fall_as_of_the_start_those_are_counted_that_a_finished_design_is_judged_by(
    monkeypatch,
):
    start = Bearing(monkeypatch, 1.5, fallen=(0, 7))
    safety = Safety(ROUGH, critical_factor=None, tried=12, drawn=60, seed=3)
    found = trial_structures.demand(None, None, LOADS, safety, design_load="wet")
    assert found.trial.fallen == {"wet": 0, "wetter": 7}
    assert start.heard[-1] == (1.0, 60, 3 - SEED, {"wet": 60, "wetter": 60})
    fresh = found.confirmed
    assert (fresh.fallen, fresh.first, fresh.safety.seed) == ({"wet": 0, "wetter": 7}, FRESH, 3)
    assert found.trusted


def test_a_design_without_unloaded_equilibrium_does_not_stand_and_tells_what_was_spent(monkeypatch):
    def none(*_, **__):
        raise NotConverged("no equilibrium", iterations=17)

    monkeypatch.setattr(trial_structures, "try_structures", none)
    found = trial_structures.judge_trial(None, None, asked_of({"wet": 1, "wetter": 1}))
    assert found == JudgedTrial({"wet": (), "wetter": ()}, False, False, 17)


@pytest.mark.parametrize(("bears", "kept"), [(1.25, True), (1.2499, False)])
def test_a_design_is_confirmed_where_its_critical_factor_is_kept_on_the_halved_mesh_too(
    monkeypatch, bears, kept
):
    asked, sought = asked_of({"wet": 1, "wetter": 1}, critical_factor=1.25), []

    def halved(_shell, _design, load, factor):
        sought.append((load.sum(), factor))
        return SimpleNamespace(factor=bears, factorisations=30)

    monkeypatch.setattr(trial_structures, "critical_on_halved", halved)
    trial = JudgedTrial({"wet": ()}, True, True, 12)
    monkeypatch.setattr(trial_structures, "try_structures", lambda *_, **__: trial)
    found = trial_structures.confirm(None, None, asked)
    assert (found.critical, found.stands, found.factorisations) == (kept, kept, 42)
    assert sought == [(-12.0, 1.25)]
    assert trial_structures.confirm(None, None, asked_of({"wet": 1})) == trial, "where no factor is asked for"
    monkeypatch.setattr(trial_structures, "try_structures", lambda *_, **__: replace(trial, stands=False))
    assert trial_structures.confirm(None, None, asked).factorisations == 12, (
        "what falls is looked at no further"
    )
    assert len(sought) == 1


def test_what_falls_under_several_loads_is_to_bear_the_largest_before_thinning_and_the_smallest_at_the_end(
    monkeypatch,
):
    asked = asked_of({"wet": 0, "wetter": 0})
    found = JudgedTrial({"wet": (4,), "wetter": (4, 2)}, True, False, 0, {4: 0.3, 2: 0.9})
    monkeypatch.setattr(trial_structures, "try_structures", lambda *_, **__: found)
    assert to_bear(None, None, asked) == {4: 1.0, 2: 1.0}
    assert aims(asked, found) == {4: pytest.approx(0.8), 2: 1.0}


def test_of_those_that_fall_the_ones_that_bear_most_are_aimed_for_and_of_unknown_factors_nothing_is_expected():
    fell = JudgedTrial({"wet": (1, 2, 3, 4, 5, 6)}, True, False, 0, {1: 0.5, 2: 0.1, 3: 0.9, 4: 0.7, 5: 0.3})
    for may, nearest in ((0, (6, 2, 5, 1, 4, 3)), (3, (6, 2, 5, 1, 4, 3)), (4, (2, 5, 1, 4, 3)), (8, (3,))):
        assert trial_structures._nearest(fell, "wet", may) == nearest
