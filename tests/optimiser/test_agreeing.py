"""A search that is led on until a fresh sample agrees with it."""

import json
from dataclasses import replace

import numpy as np
import pytest

import shellform as sf
from shellform.optimiser import agreeing, phases
from shellform.optimiser.descent import descend
from shellform.optimiser.optimise import begin
from shellform.optimiser.optimum import Checkpoint
from shellform.optimiser.resuming import resumed
from shellform.optimiser.search_state import accepted_design
from shellform.reliability.requirements import FRESH, Demand, Required
from shellform.reliability.trial_structures import JudgedTrial
from tests.problems import misfit_and_force

ROUGH = sf.Tolerances(cable_length=2e-4, supports=1e-4, marks=2e-4, load_each=0.1, load_all=0.05)
ASKED = sf.Safety(ROUGH, critical_factor=None, drawn=4, tried=3, enlarged=1.5, seed=5)
FALLS = JudgedTrial({"wet": (FRESH + 1,)}, True, False, 0)
OTHER = JudgedTrial({"wet": (FRESH + 2,)}, True, False, 0)
STANDS = JudgedTrial({"wet": ()}, True, True, 0)


@pytest.fixture
def searching(stout):
    """A search of a problem, its start, ready to be drawn afresh, and all checkpoints that it handed out."""
    one = Required(ASKED, {"wet": stout.point_load(4.5, every=2)}, "wet", {"wet": 0})
    kept: list[Checkpoint] = []
    search, it = begin(
        misfit_and_force(stout, 4.5),
        stout.design(),
        sf.SequentialConvex(),
        lambda softest: 0.08 * softest,
        20,
        keep=kept.append,
        asked=Demand(one, replace(one, first=FRESH)),
    )
    return search, replace(it, phase="agree"), kept


@pytest.fixture
def samples(monkeypatch):
    """What fresh samples say, one after the other; those whose design was judged are kept in `judged`."""
    told: list[JudgedTrial] = []
    judged: list[float] = []

    def fresh(search, it):
        judged.append(it.accepted[-1].objective)
        found = told.pop(0)
        fallen = tuple(dict.fromkeys([*found.fallen["wet"], *it.fallen]))
        return found, replace(it, samples=it.samples + 1, fallen=fallen)

    monkeypatch.setattr(agreeing, "fresh", fresh)
    return told, judged


def test_a_design_that_a_sample_agrees_with_is_left_as_it_is(searching, samples):
    search, it, _ = searching
    samples[0][:] = [STANDS]
    agrees, after = agreeing.agreed(search, it)
    assert agrees
    assert after.samples == 1
    np.testing.assert_array_equal(after.point.design.rest_length, it.point.design.rest_length)
    assert search.evaluator.evaluations == 0


def test_a_search_keeps_its_designs_whatever_is_found_of_their_paths_afterwards(
    searching, samples, monkeypatch
):
    search, it, _ = searching
    told, _ = samples
    monkeypatch.setattr(agreeing, "last_sound", lambda search, it: replace(it, accepted=()))
    told[:] = [STANDS]
    assert agreeing.agreed(search, it)[1].accepted
    told[:] = [FALLS, STANDS, *[FALLS] * 20]
    agrees, after = agreeing.agreed(search, it)
    assert not agrees
    assert after.accepted


def test_what_falls_in_a_sample_leads_the_search_on_until_another_one_agrees(searching, samples):
    search, it, _ = searching
    told, judged = samples
    told[:] = [FALLS, *[STANDS] * 20]
    agrees, after = agreeing.agreed(search, it)
    assert agrees
    assert [each.number for each in after.mind.scenarios] == [FRESH + 1]
    assert after.fallen[0] == FRESH + 1, "it is among what trials have to bear"
    assert after.led_to == min(judged[1:]) < judged[0]
    assert after.point.objective == pytest.approx(after.led_to)
    assert len(judged) == after.samples
    assert search.evaluator.evaluations <= 24, "a fifth more"


def test_a_better_design_with_which_no_sample_agrees_isnt_taken(searching, samples):
    search, it, _ = searching
    told, judged = samples
    told[:] = [FALLS, STANDS, *[FALLS] * 20]
    agrees, after = agreeing.agreed(search, it)
    assert agrees
    assert len(judged) > 2
    assert after.point.objective == pytest.approx(judged[1])


def test_of_designs_with_which_samples_agree_the_better_one_is_taken(searching, samples, monkeypatch):
    search, it, _ = searching
    told, judged = samples
    told[:] = [FALLS, *[STANDS] * 20]
    start = it.point
    turns = []

    def to_another(search, it):
        turns.append(it)
        if len(turns) == 1:
            return descend(search, it)
        point = search.evaluator.seed(start.design, start.states, 1.0)
        return replace(it, point=point, accepted=(*it.accepted, accepted_design(search, point)))

    monkeypatch.setattr(agreeing, "descend", to_another)
    agrees, after = agreeing.agreed(search, it)
    assert agrees
    assert len(judged) == 3
    assert judged[2] > judged[1]
    assert after.point.objective == pytest.approx(judged[1])


def test_a_search_without_an_evaluation_left_says_that_no_sample_agrees(searching, samples, monkeypatch):
    search, it, _ = searching
    told, _ = samples
    told[:] = [FALLS] * 2
    assert not agreeing.agreed(replace(search, evaluations=0), it)[0]
    monkeypatch.setattr(agreeing, "descend", lambda search, it: it)
    assert not agreeing.agreed(search, it)[0], "a turn that leads nowhere"
    assert not told, "no design is drawn twice until it stands by luck"


def test_after_a_turn_without_a_step_another_sample_leads_on_and_cant_agree(searching, samples, monkeypatch):
    search, it, _ = searching
    told, judged = samples
    turns = []

    def stuck_once(search, it):
        turns.append(it)
        if len(turns) > 1:
            return descend(search, it)
        search.evaluator.evaluations += 3  # trials, none of which is accepted
        return it

    told[:] = [FALLS, OTHER, *[STANDS] * 20]
    monkeypatch.setattr(agreeing, "descend", stuck_once)
    agrees, after = agreeing.agreed(search, it)
    assert agrees
    assert judged[0] == judged[1] > after.led_to
    assert {each.number for each in turns[1].mind.scenarios} == {FRESH + 1, FRESH + 2}

    turns.clear()
    told[:] = [FALLS, STANDS]
    assert not agreeing.agreed(search, it)[0]
    assert not told


def test_a_turn_taken_up_in_its_middle_ends_as_if_nothing_had_been(searching, samples):
    search, it, kept = searching
    told, _ = samples
    told[:] = [FALLS, *[STANDS] * 20]
    _, whole = agreeing.agreed(search, it)
    begun = kept[len(kept) // 2]
    numbers = json.loads(json.dumps(begun.numbers))  # as a run folder keeps them
    assert numbers["until"] > numbers["evaluations"] > 0
    told[:] = [STANDS] * 20
    search, again = resumed(search, Checkpoint(numbers, begun.arrays, begun.history))
    _, again = agreeing.agreed(search, again)
    np.testing.assert_array_equal(again.point.design.rest_length, whole.point.design.rest_length)
    assert (again.samples, again.stood, again.led_to) == (whole.samples, whole.stood, whole.led_to)


def test_thinning_leaves_evaluations_to_turns_where_trials_arent_trusted(searching):
    search, _, _ = searching
    assert agreeing.leaving_some(search).evaluations == 20
    fragile = replace(search, asked=replace(search.asked, trusted=False))
    assert agreeing.leaving_some(fragile).evaluations == 12
    assert agreeing.leaving_some(replace(fragile, asked=None)).evaluations == 20


def untrusted(search):
    return replace(search, asked=replace(search.asked, trusted=False))


@pytest.mark.parametrize(("cables", "asks"), [(75, False), (74, True)])
def test_thinning_asks_a_sample_where_a_quarter_of_the_cables_has_gone_since_the_last_one(
    searching, cables, asks, monkeypatch
):
    search, it, _ = searching
    it = replace(it, counted=100)
    monkeypatch.setattr(agreeing, "taut_count", lambda search, point: cables)
    assert agreeing.pausing(untrusted(search), it) is asks
    assert not agreeing.pausing(search, it), "trials with enlarged errors are trusted"
    assert not agreeing.pausing(replace(search, asked=None), it)
    unasked = replace(untrusted(search), asked=replace(search.asked, trusted=False, confirmed=None))
    assert not agreeing.pausing(unasked, it)


def test_a_paused_search_is_thinned_on_with_what_is_left_to_spend_once_a_sample_agrees(
    searching, monkeypatch
):
    search, it, _ = searching
    search = untrusted(search)
    begun = phases._ready_to_thin(search, it)
    assert begun.counted == phases.taut_count(search, it.point)
    paused = phases._thin(search, replace(begun, counted=2 * begun.counted))
    assert paused.paused
    assert search.evaluator.evaluations == 0, "nothing was tried"
    ways = []
    needed = np.ones(len(it.tensioned), dtype=bool)

    def thin(search, it):
        ways.append(("thin", it.counted, it.thrifty, it.needed.all()))
        return replace(it, paused=len(ways) == 1)

    def agreed(search, it):
        ways.append(("agree", it.paused))
        return answers.pop(0), it

    def back(search, it):
        ways.append("back")
        return it

    monkeypatch.setattr(phases, "_thin", thin)
    monkeypatch.setattr(phases, "agreed", agreed)
    monkeypatch.setattr(phases, "last_confirmed", back)
    start = replace(begun, counted=500, thrifty=0.77, needed=needed)
    answers = [True, True]
    phases.run(search, start)
    assert ways == [
        ("thin", 500, 0.77, True),
        ("agree", True),
        ("thin", begun.counted, 0.77, True),
        ("agree", False),
    ]
    ways.clear()
    answers = [False]
    phases.run(search, start)
    assert ways == [("thin", 500, 0.77, True), ("agree", True), "back"]


def test_a_paused_search_takes_the_first_design_with_which_a_sample_agrees(searching, samples):
    """Others follow once thinning has ended: what a better shape takes now, thinning spends."""
    search, it, _ = searching
    told, judged = samples
    told[:] = [FALLS, *[STANDS] * 20]
    agrees, _ = agreeing.agreed(search, replace(it, paused=True))
    assert agrees
    assert len(judged) == 2
