"""How a search climbs and descends: its windows and turns, with trials that are told."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import shellform as sf
from shellform.optimiser import descent
from tests.optimiser.test_phases import iterate, point, searching


@pytest.fixture(autouse=True)
def kept(monkeypatch):
    """Designs whose limits aren't looked at when a descent ends; what it ends with is kept."""
    ends = []
    monkeypatch.setattr(descent, "within_limits", lambda search, it: ends.append(it) or it)
    return ends


def test_a_climb_ends_with_its_window_or_its_evaluations(monkeypatch):
    """Refused each time, it shrinks from 0.2 N by 0.4 to 0.128 of 4 N times 0.01."""
    search = searching(
        solver=sf.SequentialConvex(smallest=0.004), first_window=0.8, always_guarded=True, base="wet"
    )
    search.evaluator.problem.constraints = [
        SimpleNamespace(term=SimpleNamespace(stabilises=each)) for each in (False, True)
    ]
    tries = []
    monkeypatch.setattr(descent, "tell", lambda *_: None)
    monkeypatch.setattr(
        descent, "task", lambda search, it, model: tries.append((it.window, it.guarded, it.climbing))
    )
    monkeypatch.setattr(descent, "propose", lambda *_: (None, 0.0))
    monkeypatch.setattr(descent, "attempt", lambda search, it, model, y: (None, it))
    monkeypatch.setattr(descent, "noted", lambda search, it, point, kept: it)
    begun = iterate("start", stage=0.5)
    end = descent.climb(search, begun)
    assert [window for window, *_ in tries] == pytest.approx([0.2, 0.08, 0.032])
    assert {each[1:] for each in tries} == {(True, True)}
    assert (end.window, end.guarded, end.climbing, end.stage) == (0.8, True, False, 0.5)
    tries.clear()
    search.left = lambda: 2 - len(tries)
    descent.climb(search, begun)
    assert len(tries) == 2


@pytest.mark.parametrize(
    ("changes", "begun", "ends"),
    [
        # with cables that may go slack, then with none that may, then nothing new is left to try
        ({}, {"guarded": False}, [(False, np.inf), (True, np.inf), (False, 0.96)]),
        # a turn has gained 4 % since it began: enough without structures as built, with them it isn't
        ({}, {"guarded": True, "before": 1.0}, [(True, 1.0), (False, 0.96)]),
        ({"asked": "asked"}, {"guarded": True, "before": 1.0}, [(True, 1.0)]),
        ({"asked": "asked"}, {"guarded": True, "before": 1.02}, [(True, 1.02), (False, 0.96)]),
        ({}, {"guarded": True, "before": 0.9605}, [(True, 0.9605)]),
        ({}, {"guarded": True, "before": 0.9615}, [(True, 0.9615), (False, 0.96)]),
        ({"always_guarded": True}, {"guarded": True}, [(True, np.inf)]),
        ({"used": ["wet"]}, {"guarded": False}, [(False, np.inf)]),
    ],
)
def test_a_descent_turns_between_cables_that_may_go_slack_and_none_that_may_while_that_gains_something(
    monkeypatch, changes, begun, ends
):
    turns = []

    def settled(search, it, predicted):
        turns.append((it.guarded, it.before))
        assert len(turns) == 1 or it.window == 0.8, "each turn begins with the first window"
        return "settled"

    monkeypatch.setattr(descent, "violation", lambda *_: 0.0)
    monkeypatch.setattr(descent, "tell", lambda *_: None)
    monkeypatch.setattr(descent, "task", lambda *_: None)
    monkeypatch.setattr(descent, "propose", lambda *_: (None, 0.0))
    monkeypatch.setattr(descent, "_settled", settled)
    given = {"always_guarded": False, "first_window": 0.8, **changes}
    used = given.pop("used", ["wet", "wetter"])
    search = searching(**given)
    search.evaluator.problem.used = lambda: used
    end = descent.descend(search, iterate(point(0.96), **begun))
    assert turns == ends
    assert (end.status, end.point.objective) == ("settled", 0.96)


def test_half_of_the_evaluations_left_to_thinning_are_kept_only_under_the_whole_loads(monkeypatch):
    """A search that hasn't reached them, or breaks a limit, spends all."""
    monkeypatch.setattr(descent, "violation", lambda search, point: point)
    for stage, broken, spent in ((1.0, 0.0, 2), (0.9, 0.0, 5), (1.0, 0.1, 5)):
        search = searching(5)

        def tried(search, it, model, y):
            search.evaluator.evaluations += 1
            return None, it

        monkeypatch.setattr(descent, "tell", lambda *_: None)
        monkeypatch.setattr(descent, "task", lambda *_: None)
        monkeypatch.setattr(descent, "propose", lambda *_: (None, 0.0))
        monkeypatch.setattr(descent, "_settled", lambda *_: "")
        monkeypatch.setattr(descent, "attempt", tried)
        monkeypatch.setattr(descent, "noted", lambda search, it, point, kept: it)
        descent.descend(search, iterate(broken, stage=stage, accepted=()), least=3)
        assert search.evaluator.evaluations == spent


@pytest.fixture
def descending(monkeypatch):
    """Descents of one trial, whose objective is told."""
    told = SimpleNamespace(predicted=-0.5, trial=None, broken=0.0, missed=0.0)
    monkeypatch.setattr(descent, "violation", lambda *_: told.broken)
    monkeypatch.setattr(descent, "missed", lambda *_: told.missed)
    monkeypatch.setattr(descent, "tell", lambda *_: None)
    monkeypatch.setattr(descent, "task", lambda *_: None)
    monkeypatch.setattr(descent, "merit", lambda search, point: point.objective)
    monkeypatch.setattr(descent, "noted", lambda search, it, point, kept: it)
    monkeypatch.setattr(descent, "accepted", lambda search, it, trial: replace(it, point=trial))

    def attempt(search, it, model, y):
        search.evaluator.evaluations += 1
        return told.trial, it

    monkeypatch.setattr(descent, "propose", lambda *_: (None, told.predicted))
    monkeypatch.setattr(descent, "attempt", attempt)
    return told


def test_a_descent_ends_where_its_last_design_that_keeps_every_limit_is(descending, monkeypatch, kept):
    descending.trial = point(1.5)
    assert descent.descend(searching(1), iterate(point(2.0))) is kept[0]
    assert kept[0].point is descending.trial
    monkeypatch.setattr(descent, "within_limits", lambda search, it: replace(it, point="before"))
    assert descent.descend(searching(1), iterate(point(2.0))).point == "before"


@pytest.fixture
def broken(monkeypatch):
    """A descent that has ended where a limit is broken by 1 %, after a design that keeps all, and what trials
    a share of the way back come to: (violation, objective), None where they leave the branch."""
    cables = SimpleNamespace(present=np.ones(5, dtype=bool))
    kept = SimpleNamespace(violation=0.0, objective=0.9, design=cables)
    point = SimpleNamespace(violation=0.01, objective=0.2, design=cables)
    told = SimpleNamespace(it=iterate(point, accepted=(kept, point)), outcomes={}, asked=[], noted=[])

    def towards(search, it, other, share):
        assert other is kept.design
        told.asked.append(share)
        outcome = told.outcomes[share]
        return outcome and SimpleNamespace(violation=outcome[0], objective=outcome[1], design=cables)

    monkeypatch.setattr(descent, "violation", lambda search, point: point.violation)
    monkeypatch.setattr(descent, "_rounds", lambda search, it, least: it)
    monkeypatch.setattr(descent, "attempt_towards", towards)
    monkeypatch.setattr(descent, "noted", lambda search, it, point, kept: told.noted.append(point) or it)
    monkeypatch.setattr(
        descent, "accepted", lambda search, it, point: replace(it, accepted=(*it.accepted, point))
    )
    return told


@pytest.mark.parametrize(
    ("outcomes", "asked", "objective"),
    [
        ({1 / 16: (0.0, 0.21)}, [1 / 16], 0.21),
        ({1 / 16: (0.002, 0.21), 1 / 4: (0.0, 0.3)}, [1 / 16, 1 / 4], 0.3),
        ({1 / 16: None, 1 / 4: (0.0, 0.3)}, [1 / 16, 1 / 4], 0.3),
        ({1 / 16: (0.002, 0.21), 1 / 4: (0.001, 0.3)}, [1 / 16, 1 / 4], 0.2),
        ({1 / 16: (0.0, 0.95), 1 / 4: (0.0, 0.9)}, [1 / 16, 1 / 4], 0.2),
    ],
)
def test_a_descent_that_ends_beyond_a_limit_goes_back_as_little_as_keeps_it(
    broken, outcomes, asked, objective
):
    broken.outcomes.update(outcomes)
    found = descent.descend("search", replace(broken.it, status="no design breaks its limits less"))
    assert broken.asked == asked
    assert found.status.endswith("within its limits") == (objective != 0.2)
    assert found.accepted[-1].objective == objective
    assert len(broken.noted) == len(asked) - (objective != 0.2), "what leads nowhere is told, too"


def test_a_descent_goes_back_from_no_design_that_keeps_its_limits_nor_to_one_of_other_cables(broken):
    before, last = broken.it.accepted
    others = SimpleNamespace(present=np.array([1, 1, 1, 1, 0], dtype=bool))
    sound = SimpleNamespace(violation=0.0, objective=0.2, design=last.design)
    for changes in (
        {"point": sound},
        {"accepted": (last,)},
        {"accepted": (before, SimpleNamespace(violation=0.0, objective=0.5, design=others), last)},
    ):
        it = replace(broken.it, **changes)
        assert descent.descend("search", it) is it
    assert broken.asked == []


@pytest.mark.parametrize(
    ("predicted", "gained", "factor"),
    [(-0.5, 0.36, 1.6), (-0.5, 0.34, 1.0), (-0.5, 0.16, 1.0), (-0.5, 0.14, 0.4), (-1e-300, 0.01, 1.6)],
)
def test_what_came_true_of_a_prediction_decides_on_the_next_window(
    descending, monkeypatch, predicted, gained, factor
):
    """More than seven tenths of a half, or less than three; of nothing that was predicted any gain is
    more."""
    monkeypatch.setattr(descent, "_settled", lambda *_: "")
    descending.predicted, descending.trial = predicted, point(2.0 - gained)
    found = descent.descend(searching(1), iterate(point(2.0), window=0.5))
    assert found.window == pytest.approx(factor * 0.5)


def test_a_search_settles_by_shares_of_its_objective_and_of_mean_tensions(descending):
    """A thousandth of 0.4 in a window of 4 N, half as much in half of it; the smallest one is 0.03 of it."""

    def settled(predicted, **changes):
        return descent._settled(searching(), iterate(point(0.4), **changes), predicted)

    assert "less than 0.1% improvement" in settled(-0.39e-3, window=4.0)
    assert "less than 0.1% improvement" in settled(-0.19e-3, window=2.0)
    assert (
        settled(-0.41e-3, window=4.0) == settled(-0.21e-3, window=2.0) == settled(-0.41e-3, window=8.0) == ""
    )
    assert "no better design within the smallest" in settled(-1.0, window=0.119)
    assert settled(-1.0, window=0.121) == ""
    curved = np.array([0.0, 0.1])
    assert settled(-0.19e-3, window=2.0, excess=curved) == "", "a smaller window may gain more"
    assert "less than 0.1% improvement" in settled(-0.39e-3, window=4.0, excess=curved)
    descending.missed = 0.1
    assert settled(-0.39e-3, window=4.0) == "", "steps serve what structures are to bear"
    descending.broken = 0.1
    assert "breaks its limits less" in settled(-0.39e-3, window=0.119)


def test_only_constraints_that_hold_a_step_back_by_their_curvature_keep_a_search_from_settling():
    """In a window of 0.5 their excess counts for a quarter."""
    model = SimpleNamespace(constraints_at=lambda y: y)
    it = iterate(window=0.5, excess=np.array([0.4, 0.4, 0.0]))
    values = np.array([-0.1, -0.102, -1e-9])
    assert descent._binding(it, model, values).tolist() == [0.4, 0.0, 0.0]
    none = iterate()
    assert descent._binding(none, None, values) is none.excess


@pytest.mark.parametrize(("least", "spent"), [(1, 6), (0, 9)])
def test_a_descent_that_leaves_evaluations_ends_once_two_steps_in_a_row_gain_next_to_nothing(
    descending, monkeypatch, least, spent
):
    """A thousandth of 2 is a gain; the same steps go on where nobody waits for the evaluations."""
    objectives = iter([1.9985, 1.5, 1.4989, 1.4, 1.3995, 1.3994, 1.39, 1.3, 1.2, 1.1])
    fine = sf.SequentialConvex(smallest=1e-9)
    search = searching(9 + least, solver=fine, always_guarded=True, first_window=0.8)

    def attempt(search, it, model, y):
        search.evaluator.evaluations += 1
        return point(next(objectives)), it

    monkeypatch.setattr(descent, "attempt", attempt)
    end = descent._rounds(search, iterate(point(2.0)), least)
    assert search.evaluator.evaluations == spent
    assert ("2 steps in a row" in end.status) == bool(least)


def test_a_climb_ends_where_the_further_loads_are_borne_whole(monkeypatch):
    search = searching(first_window=0.8, always_guarded=False, base="wet")
    search.evaluator.problem.constraints = [SimpleNamespace(term=SimpleNamespace(stabilises=True))]
    search.evaluator.seed = lambda design, states, stage: f"{design} at {stage}"
    noted, reached = [], [0.5, 0.75, 1.0, 1.0]

    def attempt(search, it, model, y):
        return SimpleNamespace(design="design", states={"wet": "rest"}), it

    monkeypatch.setattr(descent, "tell", lambda *_: None)
    monkeypatch.setattr(descent, "task", lambda *_: None)
    monkeypatch.setattr(descent, "propose", lambda *_: (None, 0.0))
    monkeypatch.setattr(descent, "attempt", attempt)
    monkeypatch.setattr(
        descent, "reach", lambda *given: reached.pop(0) if given[2:] == ("rest", 0.0, 0.15) else None
    )
    monkeypatch.setattr(descent, "staged", lambda *_: {})
    monkeypatch.setattr(descent, "accepted_design", lambda search, point: point)
    monkeypatch.setattr(descent, "noted", lambda search, it, point, kept: noted.append((point, kept)) or it)
    end = descent.climb(search, iterate("start", stage=0.5, window=0.8))
    assert (end.stage, reached) == (1.0, [1.0])
    assert noted[0][0].design == "design", "the trial that was refused"
    assert noted[1:] == [("design at 0.75", True), ("design at 1.0", True)]
    assert end.accepted == ("first", "design at 0.75", "design at 1.0")
    assert (end.window, end.guarded) == (0.8, False)
    whole = iterate("start", stage=1.0)
    assert descent.climb(search, whole) is whole
