"""A search led by the drawn structures that fall."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import shellform as sf
from shellform.optimiser import minding, phases, search_state, trials
from shellform.optimiser.minding import add_fallen, ready_to_lead
from shellform.optimiser.optimise import begin
from shellform.optimiser.optimum import Checkpoint
from shellform.optimiser.resuming import resumed, tell
from shellform.optimiser.search_state import accepted_design, merit, missed, violation
from shellform.problem.evaluation import OffBranch
from shellform.problem.terms import LoadedDesign
from shellform.reliability.demands import to_bear
from shellform.reliability.drawing import PERFECT
from shellform.reliability.requirements import Demand, Required, closer
from shellform.reliability.scenarios import FactorsAsBuilt, Scenario
from shellform.reliability.trial_structures import JudgedTrial
from tests.problems import misfit_and_force

ROUGH = sf.Tolerances(cable_length=2e-4, supports=1e-4, marks=2e-4, load_each=0.1, load_all=0.05)
ASKED = sf.Safety(ROUGH, critical_factor=None, tried=3, enlarged=1.0, seed=5)


@pytest.fixture
def searching(stout):
    """A search of a problem, its start, and all checkpoints that it handed out."""
    wet = stout.point_load(4.5, every=2)
    one = Required(ASKED, {"wet": wet}, "wet", {"wet": 0})
    problem = misfit_and_force(stout, 4.5)
    kept: list[Checkpoint] = []
    search, it = begin(
        problem,
        stout.design(),
        sf.SequentialConvex(),
        lambda softest: 0.5 * softest,
        12,
        keep=kept.append,
        asked=Demand(one, one),
    )
    return search, it, kept


def test_structures_that_fall_too_often_are_to_bear_their_loads_and_the_perfect_one_its_factor(stout):
    load = stout.point_load(4.5, every=2)
    heavy = {"wet": 10.0 * load, "wetter": 12.0 * load}  # nothing bears as much
    asked = Required(replace(ASKED, critical_factor=1.25), heavy, "wet", {"wet": 0, "wetter": 0})
    found = to_bear(stout, stout.design(), asked)
    assert found.pop(PERFECT) == pytest.approx(1.25 * 1.01 / 1.2)
    assert found == pytest.approx(dict.fromkeys(range(3), 1.0))
    # what is allowed to fall under the larger load is to bear the design load
    allowed = replace(asked, fallen={"wet": 0, "wetter": 3})
    assert to_bear(stout, stout.design(), allowed)[0] == pytest.approx(1.0 / 1.2)
    assert not to_bear(stout, stout.design(), replace(asked, loads={"wet": load}, fallen={"wet": 0}))


def test_what_structures_in_mind_bear_is_an_aim_and_no_limit(searching, monkeypatch):
    search, it, _ = searching
    monkeypatch.setattr(
        minding, "to_bear", lambda *_, **__: {0: 1.0, 1: 9.0}
    )  # no structure bears nine times the load
    led = ready_to_lead(search, it, it.point.design)
    assert led is not None
    assert [each.number for each in led.mind.scenarios] == [0, 1]
    assert led.phase == "lead"
    assert violation(search, led.point) <= 0.0
    assert missed(search, led.point) > 0.5
    assert merit(search, led.point) > led.point.objective + 1.5
    # those that fall later come first
    monkeypatch.setattr(minding, "to_bear", lambda *_, **__: {2: 1.0})
    assert [each.number for each in add_fallen(search, led, led.accepted[-1].built).mind.scenarios] == [
        2,
        0,
        1,
    ]


def test_led_by_fresh_samples_those_that_fall_under_the_smallest_load_are_kept_in_mind(
    searching, monkeypatch
):
    search, it, _ = searching
    kept = []
    monkeypatch.setattr(minding, "kept_in_mind", lambda _, __, least: kept.append(least))
    monkeypatch.setattr(minding, "restiffened", lambda _, it, __: it)
    known = [Scenario(number, None, 0.8) for number in (1, 2)]
    it = replace(it, mind=SimpleNamespace(scenarios=tuple(known)))
    least = {3: 0.8, PERFECT: 1.1, **dict.fromkeys(range(10, 30), 1.0)}
    minding.minding(search, it, it.point.design, least)
    assert [*kept.pop()][:3] == [3, PERFECT, 10], "the latest first"
    minding.minding(search, replace(it, phase="agree"), it.point.design, least)
    assert [*kept.pop()] == [PERFECT, 3, 1, 2, *range(10, 18)]


def test_without_a_structure_that_falls_there_is_nothing_to_be_led_by(searching, monkeypatch):
    search, it, _ = searching
    monkeypatch.setattr(minding, "to_bear", lambda *_, **__: {})
    assert ready_to_lead(search, it, it.point.design) is None


def test_structures_kept_as_they_bear_ask_for_nothing_that_the_design_misses(searching):
    search, it, _ = searching
    aims = {0: 1.03, 1: 1.03 * 50.0}  # one bears more than it has to, the other can't
    kept = minding.as_borne(search, it, aims)
    missed = kept.point.constraints[-2:]
    assert (missed < 0.0).all()
    assert missed[1] == pytest.approx(-1.0 / 99.0, rel=1e-3), "of what it bears a hundredth may be lost"
    least = {each.number: each.least for each in kept.mind.scenarios}
    assert least[0] == pytest.approx(1.0)
    assert least[1] < 50.0
    assert kept.stiffness == it.stiffness
    assert minding.as_borne(search, it, {}) is it


@pytest.mark.parametrize(
    "mind", [minding.minding, lambda search, it, _, least: minding.as_borne(search, it, least)]
)
def test_where_what_a_structure_bears_is_not_found_a_search_goes_on_as_it_was(searching, monkeypatch, mind):
    search, it, _ = searching

    def lost(*_, **__):
        raise OffBranch("the load that structure 17 as built bears was not found")

    before = search.evaluator.problem
    monkeypatch.setattr(search.evaluator, "seed", lost)
    assert mind(search, it, it.point.design, {0: 1.03}) is it
    assert search.evaluator.problem is before


def test_a_search_resumed_while_it_is_led_knows_the_same_structures_and_point(searching, monkeypatch):
    search, it, kept = searching
    monkeypatch.setattr(minding, "to_bear", lambda *_, **__: {0: 2.0, 2: 2.5})
    led = ready_to_lead(search, it, it.point.design)
    tell(search, led)
    numbers = json.loads(json.dumps(kept[-1].numbers))  # as a run folder keeps them
    _, again = resumed(search, Checkpoint(numbers, kept[-1].arrays, kept[-1].history))
    np.testing.assert_array_equal(again.point.constraints, led.point.constraints)
    rows, before = (search.models.at(each.point).point.constraints_by_variables for each in (again, led))
    np.testing.assert_array_equal(rows, before)
    assert (again.phase, again.led_to, again.until, again.stood) == ("lead", np.inf, led.until, led.stood)


def test_a_search_resumed_with_structures_that_are_to_bear_what_they_do_follows_them_as_far_as_before(
    searching,
):
    search, it, kept = searching
    led = minding.as_borne(search, it, {0: 1.03, 1: 1.03 * 50.0})
    tell(search, led)
    numbers = json.loads(json.dumps(kept[-1].numbers))
    _, again = resumed(search, Checkpoint(numbers, kept[-1].arrays, kept[-1].history))
    assert again.mind.most == led.mind.most
    np.testing.assert_array_equal(again.point.constraints, led.point.constraints)


def test_where_structures_lead_to_no_design_that_stands_the_search_goes_back_to_what_stood(
    searching, monkeypatch
):
    search, it, _ = searching
    monkeypatch.setattr(minding, "to_bear", lambda *_, **__: {0: 1.0})
    led = ready_to_lead(search, it, it.point.design)
    monkeypatch.setattr(trials, "judge_trial", lambda *_, **__: JudgedTrial({"wet": (0,)}, True, False, 0))
    after = phases._led(search, led)
    assert after.phase == "thin"
    assert after.mind is None
    assert len(after.accepted) == led.stood
    assert not any(isinstance(part.term, FactorsAsBuilt) for part in search.evaluator.problem.constraints)
    np.testing.assert_array_equal(after.point.design.rest_length, it.point.design.rest_length)


def test_where_another_turn_leads_to_a_worse_design_the_search_goes_back_to_the_better_one(
    searching, monkeypatch
):
    search, it, _ = searching
    monkeypatch.setattr(minding, "to_bear", lambda *_, **__: {0: 1.0})
    led = ready_to_lead(search, it, it.point.design)
    monkeypatch.setattr(trials, "judge_trial", lambda *_, **__: JudgedTrial({"wet": ()}, True, True, 0))
    start, found = it.point, []

    def descend(search, it):
        if found:
            point = search.evaluator.seed(start.design, start.states, 1.0)
            it = replace(it, point=point, accepted=(*it.accepted, accepted_design(search, point)))
        else:
            it = one_descent(search, it)
        found.append(it.accepted[-1].objective)
        return it

    one_descent = minding.descend
    monkeypatch.setattr(minding, "descend", descend)
    after = minding.lead(search, led)
    assert len(found) == 2
    assert found[1] > found[0]
    assert after.accepted[-1].objective == pytest.approx(found[0])


def test_where_structures_lead_to_a_better_design_that_stands_thinning_begins_there(searching, monkeypatch):
    search, it, _ = searching
    monkeypatch.setattr(minding, "to_bear", lambda *_, **__: {0: 1.0})
    led = ready_to_lead(search, it, it.point.design)
    monkeypatch.setattr(trials, "judge_trial", lambda *_, **__: JudgedTrial({"wet": ()}, True, True, 0))
    after = phases._led(search, led)
    assert after.phase == "thin"
    assert [each.number for each in after.mind.scenarios] == [0]
    assert after.point.objective == pytest.approx(after.led_to)
    assert after.led_to < it.point.objective
    assert len(after.accepted) == after.stood > led.stood
    assert search.evaluator.evaluations <= 12


def test_a_cable_counts_for_what_structures_in_mind_would_lose_without_it(searching, monkeypatch):
    search, it, _ = searching
    monkeypatch.setattr(minding, "to_bear", lambda *_, **__: {0: 2.0, 2: 2.5})
    monkeypatch.setattr(search_state, "_NEARLY", 1e-8)
    led = ready_to_lead(search, it, it.point.design)
    model = search.models.at(led.point)
    found = minding.missed_without(search, led, model)
    assert found.shape == (int(led.point.design.present.sum()),)
    assert found.min() >= 0.0
    assert found.sum() == pytest.approx(1.0)
    # the cable that counts most: a ten-thousandth of the way to slack costs as much as is told
    cable = int(np.argmax(found))
    present = np.flatnonzero(led.point.design.present)
    step = 1e-4 * (model.length[cable] - led.point.design.rest_length[present[cable]])
    rest = led.point.design.rest_length.copy()
    rest[present[cable]] += step
    other = replace(led.point.design, rest_length=rest)
    state = led.point.states["wet"]
    at = [
        led.mind.measure(LoadedDesign(search.problem.shell, design, state, None)).value
        for design in (led.point.design, other)
    ]
    rows = model.point.constraints_by_variables[-2:, : len(rest)] / search.evaluator.blocks.unit[: len(rest)]
    assert at[0] - at[1] == pytest.approx(step * rows[:, present[cable]], rel=1e-2)


@pytest.mark.parametrize(("evaluations", "turn"), [(12, 4), (40, 4), (100, 10)])
def test_a_turn_takes_a_tenth_of_all_evaluations_and_four_at_the_least(searching, evaluations, turn):
    search, it, _ = searching
    spent = search.evaluator.evaluations
    begun = minding.begin_turn(replace(search, evaluations=evaluations), replace(it, window=7.0, before=0.1))
    assert begun.until == spent + turn
    assert begun.before == np.inf
    assert begun.window == pytest.approx(0.05 * search.tension)
    assert minding.finely(replace(search, evaluations=evaluations), begun.until).evaluations == min(
        evaluations, begun.until
    )


def test_a_search_that_is_led_is_judged_by_more_structures(stout):
    load = stout.point_load(4.5, every=2)
    loads = {"wet": load, "wetter": 1.2 * load}
    one = Required(ASKED, loads, "wet", {"wet": 0, "wetter": 2})
    found = closer(Demand(one, one)).trial
    assert found.safety.tried == 40
    assert found.fallen == {"wet": 0, "wetter": 26}  # two of three of the start's fell under more load
    assert found.safety.seed == ASKED.seed
    bounded = replace(one, safety=replace(ASKED, probability_additional=0.9))
    assert closer(Demand(bounded, one)).trial.fallen == {"wet": 0, "wetter": 4}
