"""The judge within a search: which structures it draws, and how many fall."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from shellform.errors import NotConverged
from shellform.gridshell.tolerances import Tolerances
from shellform.reliability import trial_structures
from shellform.reliability.demands import aims
from shellform.reliability.drawing import PERFECT
from shellform.reliability.requirements import SEED, Required
from shellform.reliability.resting import Resting
from shellform.reliability.safety import Safety
from shellform.reliability.trial_structures import JudgedTrial, try_structures
from tests.reliability.asked import LOADS, ROUGH, asked_of


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
    assert list(found.factors) == [2, 0, 1], "those that fell before come first"
    assert sorted(number for *_, number in asked_for) == [0, 1, 2]
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


ASIDE = np.array([[-1.0, 0.0, 0.0, 0.0, 0.0, 0.0]] * 2)


class Tried:
    """Structures that bear factors of the largest load on a path, by number; each takes ten factorisations
    and one for each of its number."""

    def __init__(self, factors, monkeypatch, *, bears=True, far=()):
        self.bears = bears
        self.factors, self.loaded, self.looked, self.before = factors, [], [], []
        for name, fake in [
            (
                "perfect",
                lambda *given, step, heeding: SimpleNamespace(
                    members=given[2].sum(),
                    known_to=lambda f: ("to", f),
                    states=("none", "loaded"),
                    bears=self.bears,
                    lies_beside=lambda state: self.bears and state not in far,
                ),
            ),
            ("Workshop", self),
            ("draw_errors", lambda members, tolerances, seed, number: (number, members)),
        ]:
            monkeypatch.setattr(trial_structures, name, fake)

    def __call__(self, _nominal):
        return self

    def rests(self, errors, *, resolution, marks, number, before):
        assert number == errors[0]
        _, load = errors
        self.loaded.append((load, number, resolution, marks))
        self.before.append(before)
        return SimpleNamespace(
            factor=self.factors[number], factorisations=10 + number, state=f"rest {number}"
        )

    def limit(self, errors, **how):
        self.looked.append((errors, how))
        return SimpleNamespace(factor=self.factors[PERFECT], factorisations=100, state="perfect")

    def judged(self, asked, **how):
        return try_structures(None, None, asked, **how)


def test_where_structures_rest_is_told_and_where_they_did_is_where_they_are_sought(monkeypatch):
    made = Tried({0: 1.0, 1: 0.9, 2: 1.0}, monkeypatch)
    asked = asked_of({"wet": 3, "wetter": 3}, tried=3)
    before = {"wetter": Resting("before", {0: "there"}), "wet": Resting("of no path", {})}
    found = made.judged(asked, before=before)
    assert made.before == [before["wetter"]] * 3
    assert set(found.rested) == {"wetter"}
    assert found.rested["wetter"].perfect == "loaded"
    assert found.rested["wetter"].drawn == {0: "rest 0", 2: "rest 2"}


def test_where_structures_rest_is_not_kept_unasked_nor_beside_a_perfect_one_that_falls(monkeypatch):
    asked = asked_of({"wet": 3, "wetter": 3}, tried=3)
    assert Tried({0: 1.0, 1: 1.0, 2: 1.0}, monkeypatch).judged(asked).rested == {}
    falling = Tried({0: 1.0, 1: 1.0, 2: 1.0}, monkeypatch, bears=False)
    assert falling.judged(asked, before={}).rested == {}


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


def test_a_structure_that_rests_far_from_the_perfect_one_falls_under_the_largest_load_of_its_path(
    monkeypatch,
):
    made = Tried(dict.fromkeys(range(3), 1.0), monkeypatch, far=("rest 1",))
    found = made.judged(asked_of({"wet": 0, "wetter": 0}, tried=3), whole=True)
    assert found.fallen == {"wet": (), "wetter": (1,)}
    assert not found.stands


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
    assert list(found.factors) == [900, 2, 901, 0, 1, 3, 4, 5]
    loaded = {
        load: sorted(number for own, number, *_ in made.loaded if own == load) for load in (-15.0, -2.0)
    }
    assert loaded == {-15.0: [0, 1, 2, 3, 4, 5, 900, 901], -2.0: [0, 1, 2, 3, 4, 5]}
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


def test_a_design_without_unloaded_equilibrium_does_not_stand_and_tells_what_was_spent(monkeypatch):
    def none(*_, **__):
        raise NotConverged("no equilibrium", iterations=17)

    monkeypatch.setattr(trial_structures, "try_structures", none)
    found = trial_structures.judge_trial(None, None, asked_of({"wet": 1, "wetter": 1}))
    assert vars(found) == vars(JudgedTrial({"wet": (), "wetter": ()}, False, False, 17))


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
