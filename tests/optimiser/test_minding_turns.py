"""What a search keeps in mind and is led by, and its turns, with descents and judgements that are told."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import shellform as sf
from shellform.errors import NotConverged
from shellform.gridshell.gridshell import Design
from shellform.optimiser import minding
from shellform.problem.evaluation import OffBranch
from shellform.reliability.drawing import PERFECT
from shellform.reliability.scenarios import FactorsAsBuilt, Scenario
from tests.optimiser.told import accepted_one, iterate, told_search


def mind_of(least):
    case = sf.LoadCase("wet", np.zeros((1, 6)))
    return FactorsAsBuilt(case, tuple(Scenario(k, None, factor) for k, factor in least.items()), None, 1.0)


@pytest.fixture
def search(monkeypatch):
    return told_search(monkeypatch, minding)


@pytest.fixture
def kept(monkeypatch):
    """What is kept in mind, and which stiffness is asked for beside."""
    told = SimpleNamespace(minds=[], stiffness=[], error=None)

    def kept_in_mind(search, design, least):
        told.minds.append((design, dict(least)))
        if told.error:
            raise told.error
        return mind_of(least)

    def restiffened(search, it, least):
        told.stiffness.append(least)
        search.evaluator.problem = "problem now"
        return replace(it, stiffness=least, window=9.0)

    monkeypatch.setattr(minding, "kept_in_mind", kept_in_mind)
    monkeypatch.setattr(minding, "restiffened", restiffened)
    return told


def test_structures_that_fall_now_are_kept_in_mind_before_those_that_fell_and_twelve_at_the_most(
    search, kept
):
    it = iterate(mind=mind_of({4: 0.9, 5: 1.1}))
    found = minding.minding(search, it, "here", {3: 1.0, 4: 0.8})
    assert kept.minds == [("here", {3: 1.0, 4: 0.8, 5: 1.1})]
    assert list(kept.minds[0][1]) == [3, 4, 5]
    assert (found.remembered, found.stiffness) == ("here", 0.5), "the solver's own: a quarter of 2 N/m"
    minding.minding(search, iterate(stiffness=0.3), "here", {number: 1.0 for number in range(14)})
    assert list(kept.minds[1][1]) == list(range(12))
    assert kept.stiffness == [0.5, 0.3]
    alone = iterate()
    assert minding.minding(search, alone, "here", {}) is alone


def test_in_agreeing_the_perfect_one_and_those_that_fall_under_the_smallest_load_are_kept_first(search, kept):
    least = {8: 1.0, 9: 0.8, PERFECT: 1.3, **{20 + k: 0.9 for k in range(10)}}
    minding.minding(search, iterate(phase="agree"), "here", least)
    assert list(kept.minds[0][1]) == [PERFECT, 9, *range(20, 30)], (
        "and the thirteenth, at the whole load, isn't"
    )


@pytest.mark.parametrize("error", [NotConverged("lost"), OffBranch()])
def test_where_a_structure_cannot_be_followed_nothing_changes(search, kept, error):
    kept.error = error
    for it in (iterate(), iterate(mind=mind_of({1: 1.0}))):
        assert minding.minding(search, it, "here", {3: 1.0}) is it
        assert minding.as_borne(search, it, {3: 1.0}) is it
        assert search.evaluator.problem == "problem before"


def test_a_little_more_is_aimed_for_than_structures_are_to_bear(search, kept):
    minding.lead_by(search, iterate(), "here", {3: 1.0, 4: 0.5})
    assert kept.minds == [("here", {3: 1.03, 4: 0.515})]


def test_structures_are_to_bear_what_they_bear_less_a_hundredth_as_far_as_they_have_to(
    search, kept, monkeypatch
):
    """One bears a fifth more than it is to, one a tenth less: 1.03 / 1.03, and 1.03 times 0.9 times 0.99."""
    aims = []
    monkeypatch.setattr(minding, "aimed", lambda inner, least, mind: aims.append((inner, least)) or "aimed")
    constraints = np.array([9.0, -0.2, 0.1])
    search.evaluator.seed = lambda design, states, stage: SimpleNamespace(constraints=constraints)
    found = minding.as_borne(search, iterate(), {3: 1.03, 4: 1.03})
    assert [each.least for each in found.mind.scenarios] == pytest.approx([1.0, 0.91773])
    assert aims == [("inner", 0.7)]
    assert (found.remembered, kept.stiffness) == ("design 1.0", [0.7])
    begun = iterate()
    assert minding.as_borne(search, begun, {}) is begun


def test_structures_are_remembered_anew_with_the_window_as_it_was(search, kept):
    begun = iterate()
    assert minding.remembering(search, begun) is begun
    found = minding.remembering(search, iterate(mind=mind_of({3: 1.03})))
    assert kept.minds == [("built 1.0", {3: 1.03})]
    assert found.window == 0.2


def test_a_cable_counts_for_the_most_that_a_structure_misses_without_it_as_a_share_of_all():
    """Three of four cables are present, whose variables follow the radius'; the first row is a limit's."""
    rows = np.array(
        [
            [5.0, 90.0, 90.0, 90.0, 90.0],
            [5.0, 2.0, 70.0, -3.0, 1.0],
            [5.0, 0.5, 70.0, 4.0, 0.0],
        ]
    )
    design = Design(np.array([1.0, 1.0, 2.0, 4.0]), np.array([True, False, True, True]), 0.1)
    blocks = SimpleNamespace(each_cable=slice(1, 5), unit=np.array([7.0, 2.0, 1.0, 4.0, 5.0]))
    search = SimpleNamespace(evaluator=SimpleNamespace(blocks=blocks))
    model = SimpleNamespace(
        point=SimpleNamespace(constraints_by_variables=rows), length=np.array([1.2, 3.2, 4.25])
    )
    it = SimpleNamespace(mind=mind_of({3: 1.0, 4: 1.0}), point=SimpleNamespace(design=design))
    longer = np.array([0.1, 0.3, 0.05])
    misses = np.array([2.0, 4.0, 1.0]) * longer
    assert minding.missed_without(search, it, model) == pytest.approx(misses / misses.sum())
    model.point.constraints_by_variables = -np.abs(rows)
    assert minding.missed_without(search, it, model).tolist() == [0.0, 0.0, 0.0]


def test_a_turn_goes_in_fine_steps_and_no_further_than_the_search(search):
    fine = minding.finely(search, 30)
    assert (fine.evaluations, fine.solver.window, fine.solver.smallest) == (30, 0.05, 0.004)
    assert minding.finely(search, 130).evaluations == 100
    search.solver = sf.SequentialConvex(smallest=0.001)
    assert minding.finely(search, 30).solver.smallest == 0.001
    search.evaluator.evaluations = 7
    begun = minding.begin_turn(search, iterate(before=0.1))
    assert (begun.until, begun.before, begun.guarded, begun.window) == (17, np.inf, True, 0.2)
    search.evaluations = 35
    assert minding.begin_turn(search, iterate()).until == 11


def test_what_falls_is_tried_with_what_fell_first_and_a_design_without_equilibrium_has_nothing_to_follow(
    search, monkeypatch
):
    asked = []

    def to_bear(shell, design, trial, **how):
        asked.append((shell, design, trial, how))
        return {3: 1.0}

    monkeypatch.setattr(minding, "to_bear", to_bear)
    assert minding.falling(search, iterate(fallen=(5, 2), rested={"wet": "there"}), "here") == {3: 1.0}
    how = {"first": (5, 2), "judging": "judging", "before": {"wet": "there"}}
    assert asked == [("shell", "here", "trial", how)]

    def none(*_, **__):
        raise NotConverged("no unloaded equilibrium")

    monkeypatch.setattr(minding, "to_bear", none)
    assert minding.falling(search, iterate(), "here") == {}


def test_a_search_is_led_from_the_design_that_stands_by_what_falls_in_the_other_one(
    search, kept, monkeypatch
):
    monkeypatch.setattr(minding, "looking_closer", lambda search: search)
    monkeypatch.setattr(minding, "falling", lambda search, it, design: {3: 1.0} if design == "fell" else {})
    found = minding.ready_to_lead(search, iterate(), "fell")
    assert kept.minds == [("built 1.0", {3: 1.03})]
    assert (found.phase, found.stood, found.until) == ("lead", 1, 10)
    more = iterate(accepted=(accepted_one(1.0), accepted_one(0.9), accepted_one(0.8)))
    assert minding.ready_to_lead(search, more, "fell").stood == 3
    assert kept.minds[-1] == ("built 0.8", {3: 1.03}), "the last one that stands"
    assert minding.ready_to_lead(search, iterate(), "stands") is None


@pytest.fixture
def turns(search, monkeypatch):
    """Turns of ten evaluations, each of which ends at a design of a told objective that stands or doesn't."""
    told = SimpleNamespace(ends=[], log=[], judged=[])

    def descend(fine, it):
        assert fine.solver.window == 0.05
        search.evaluator.evaluations += 10
        objective, told.stands, told.sound = told.ends.pop(0)
        if objective is None:
            return replace(it, until=0)
        return replace(
            iterate(objective),
            accepted=(*it.accepted, accepted_one(objective)),
            mind=it.mind,
            stood=it.stood,
            led_to=it.led_to,
        )

    def sound(search, last):
        return SimpleNamespace(objective=last.objective) if told.sound else None

    monkeypatch.setattr(minding, "sound", sound)
    monkeypatch.setattr(minding, "accepted_design", lambda search, found: accepted_one(found.objective))
    monkeypatch.setattr(
        minding, "standing", lambda search, it, built: told.judged.append(built) or (told.stands, it)
    )
    monkeypatch.setattr(
        minding, "add_fallen", lambda search, it, built: told.log.append(("joined", built)) or it
    )
    monkeypatch.setattr(minding, "remembering", lambda search, it: told.log.append("remembering") or it)
    monkeypatch.setattr(minding, "last_sound", lambda search, it: it)
    monkeypatch.setattr(
        minding, "restiffened", lambda search, it, least: told.log.append(("as before", least, it.mind)) or it
    )
    monkeypatch.setattr(minding, "descend", descend)
    told.led = lambda **changes: minding.lead(search, iterate(1.0, mind="some", stood=1, until=10, **changes))
    return told


def test_turns_follow_as_long_as_each_gains_three_hundredths_and_its_design_stands(turns):
    turns.ends = [(0.9, True, True), (0.85, True, True), (0.83, True, True), (0.5, True, True)]
    found = turns.led()
    assert [each.objective for each in found.accepted] == [1.0, 0.9, 0.85, 0.83]
    assert (found.stood, found.led_to, found.mind) == (4, 0.83, "some")
    assert turns.log == ["remembering"] * 3
    assert turns.judged == ["built 0.9", "built 0.85", "built 0.83"]
    assert len(turns.ends) == 1


def test_a_turn_without_a_step_is_judged_by_the_design_before_it_and_is_the_last(turns):
    turns.ends = [(0.9, True, True), (None, True, True), (0.5, True, True)]
    found = turns.led()
    assert turns.judged == ["built 0.9", "built 0.9"]
    assert [each.objective for each in found.accepted] == [1.0, 0.9]
    assert len(turns.ends) == 1


def test_a_turn_that_leads_to_a_worse_design_is_the_last_and_the_better_one_is_taken(turns):
    turns.ends = [(0.9, True, True), (0.95, True, True), (0.5, True, True)]
    found = turns.led()
    assert [each.objective for each in found.accepted] == [1.0, 0.9]
    assert (found.led_to, len(turns.ends)) == (0.9, 1)


def test_those_that_fall_after_a_turn_join_until_half_of_the_evaluations_are_spent(turns):
    turns.ends = [(0.9 - 0.1 * k, False, True) for k in range(8)]
    found = turns.led()
    assert len(turns.ends) == 3, "five turns of ten of a hundred"
    assert turns.log[:-1] == [("joined", f"built {0.9 - 0.1 * k}") for k in range(4)]
    assert turns.log[-1] == ("as before", 0.7, None), "as it was before it was led"
    assert [each.objective for each in found.accepted] == [1.0]


def test_a_turn_whose_design_its_own_path_does_not_lead_to_ends_the_leading(turns):
    turns.ends = [(0.9, True, True), (0.5, True, False), (0.1, True, True)]
    found = turns.led()
    assert ([each.objective for each in found.accepted], len(turns.ends)) == ([1.0, 0.9], 1)
