"""What a search asks of a step and what a trial shows, with models and equilibria that are told."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import shellform as sf
from shellform.gridshell.gridshell import Design
from shellform.optimiser import trials
from shellform.optimiser.optimise import begin
from shellform.optimiser.search_state import Accepted, Iterate
from shellform.problem.evaluation import OffBranch
from shellform.reliability.requirements import FRESH
from shellform.reliability.trial_structures import JudgedTrial
from tests.problems import misfit_and_force

NONE = np.zeros(0)


def iterate(**changes):
    given = Iterate(
        "point", (), (), 0.0, 0.5, 0.2, 0.15, False, np.zeros(3, dtype=bool), np.array([0.5, 2.0])
    )
    return replace(given, **changes)


def searching(**changes):
    given = {
        "solver": sf.SequentialConvex(),
        "evaluator": SimpleNamespace(factorisations=100),
        "tension": 4.0,
        "bounded": ("bound",),
        "models": SimpleNamespace(guards=lambda point: [f"guards at {point}"]),
        "groups": None,
        "least": 0.3,
        "base": "wet",
        "judging": "judging",
        "problem": SimpleNamespace(shell="shell"),
    }
    return SimpleNamespace(**{**given, **changes})


@pytest.mark.parametrize(
    ("phase", "least", "asked"),
    # a twentieth of 4 N is 0.2 N; what errors don't use up is asked for in thinning alone
    [("thin", 0.3, 0.3), ("thin", 0.1, 0.2), ("descend", 0.3, 0.2), ("agree", 0.3, 0.2)],
)
def test_cables_keep_a_share_of_the_mean_tension_and_in_thinning_what_errors_do_not_use_up(
    monkeypatch, phase, least, asked
):
    monkeypatch.setattr(trials, "in_mind", lambda _: 7)
    it = iterate(phase=phase, guarded=True, climbing=True)
    found = trials.task(searching(least=least), it, "model")
    assert found.least == pytest.approx(asked)
    assert found.guards == ["guards at point"]
    assert found.excess == pytest.approx([0.5 * 0.04, 2.0 * 0.04]), "of the window's square"
    assert (found.window, found.tension, found.bounded, found.climbing, found.aims) == (
        0.2,
        4.0,
        ("bound",),
        True,
        7,
    )
    assert trials.task(searching(), replace(it, guarded=False), "model").guards == []


class Tries:
    """An evaluator whose trials have these constraints."""

    base = "wet"

    def __init__(self, *constraints):
        self.constraints, self.asked = constraints, []

    def predicted(self, point, design, *, but):
        assert (point, but) == ("point", "wet")
        return {"wetter": "predicted under more"}

    def rounded(self, design):
        return replace(design, radius=0.002)

    def evaluate(self, design, near, stage, *, lead):
        self.asked.append((design, near, stage, lead))
        if not self.constraints:
            raise OffBranch
        return SimpleNamespace(constraints=np.array(self.constraints))


class Model:
    def __init__(self, rest=(1.0, 2.0, 3.0, 4.0), present=(True, True, False, True)):
        self.made = Design(np.array(rest), np.array(present), 0.001)
        self.longest = np.array([1.5, 2.5, 4.5])

    def design(self, y):
        return self.made

    def predicted(self, y):
        return "predicted by the model"

    def constraints_at(self, y):
        return np.array([0.1, -0.9, -0.1])


def test_a_trial_shows_by_how_much_constraints_near_their_limits_exceed_their_model():
    """Of the square of a window of 0.2: 0.1 over the model are 2.5; a constraint farther than half of its
    limit off and one below its model show nothing."""
    search = searching(evaluator=Tries(0.2, -0.6, -0.3))
    trial, it = trials.attempt(search, iterate(), Model(), NONE)
    assert trial.constraints.tolist() == [0.2, -0.6, -0.3]
    assert it.excess == pytest.approx([2.5, 0.0, 0.0])
    ((design, near, stage, lead),) = search.evaluator.asked
    assert near == {"wet": "predicted by the model", "wetter": "predicted under more"}
    assert (design.radius, stage, lead) == (0.002, 0.5, True)
    nearer = searching(evaluator=Tries(0.2, -0.49, -0.3))
    assert trials.attempt(nearer, iterate(), Model(), NONE)[1].excess == pytest.approx([2.5, 10.25, 0.0])


def test_a_trial_that_is_off_the_branch_shows_nothing():
    search, it = searching(evaluator=Tries()), iterate(guarded=True)
    assert trials.attempt(search, it, Model(), NONE) == (None, it)


@pytest.mark.parametrize(
    ("changes", "led"),
    [
        ({"phase": "descend"}, True),
        ({"phase": "descend", "guarded": True}, False),
        ({"phase": "thin", "guarded": True}, True),
        ({"phase": "thin", "guarded": True, "mind": "structures"}, False),
    ],
)
def test_trials_are_led_to_further_loads_while_thinning_and_without_guards_but_not_by_structures(
    changes, led
):
    search = searching(evaluator=Tries(0.0, 0.0, 0.0))
    trials.attempt(search, iterate(**changes), Model(), NONE)
    assert search.evaluator.asked[0][-1] is led


def test_cables_of_a_group_are_tried_with_one_length():
    search = searching(evaluator=Tries(0.0, 0.0, 0.0), groups=np.array([0, 1, 0]))
    trials.attempt(search, iterate(), Model(), NONE)
    assert search.evaluator.asked[0][0].rest_length == pytest.approx([2.5, 2.0, 3.0, 2.5])


def test_cables_that_leave_are_as_long_as_may_be_and_the_others_as_they_are():
    search = searching(evaluator=Tries(0.0))
    it = iterate(point=SimpleNamespace(design=Model().made, states="states"))
    assert trials.attempt_without(search, it, Model(), np.array([0, 2])) is not None
    design, near, stage, _ = search.evaluator.asked[0]
    assert design.rest_length.tolist() == [1.5, 2.0, 3.0, 4.5]
    assert (near, stage) == ("states", 0.5)
    assert it.point.design.rest_length.tolist() == [1.0, 2.0, 3.0, 4.0]
    assert trials.attempt_without(searching(evaluator=Tries()), it, Model(), np.array([1])) is None


def judged(fallen, stands=False):
    return JudgedTrial(fallen, True, stands, 11)


def test_structures_that_have_fallen_last_are_tried_first(monkeypatch):
    asked = []

    def stands(shell, built, trial, **how):
        asked.append((shell, built, trial, how))
        return replace(judged({"wet": (3, 1), "wetter": (1, 5)}), rested={"wetter": "elsewhere"})

    monkeypatch.setattr(trials, "judge_trial", stands)
    search = searching(asked=SimpleNamespace(trial="trial"))
    begun = iterate(fallen=(5, 8, 3), rested={"wetter": "before"})
    holds, it = trials.standing(search, begun, "built")
    assert not holds
    assert (it.fallen, it.fell) == ((3, 1, 5, 8), True)
    how = {"first": (5, 8, 3), "judging": "judging", "before": begun.rested}
    assert asked == [("shell", "built", "trial", how)]
    assert it.rested == begun.rested, "a design that falls leaves what is known of the last one that stood"
    assert search.evaluator.factorisations == 111
    rested = replace(judged({"wet": ()}, stands=True), rested={"wetter": "here"})
    monkeypatch.setattr(trials, "judge_trial", lambda *_, **__: rested)
    holds, after = trials.standing(search, it, "built")
    assert holds
    assert (after.fallen, after.fell, after.rested) == (it.fallen, False, {"wetter": "here"})
    begun = iterate()
    assert trials.standing(searching(asked=None), begun, "built") == (True, begun)


def test_a_fresh_sample_is_drawn_beside_structures_of_earlier_ones_and_known_by_those_under_the_design_load(
    monkeypatch,
):
    asked = []

    def confirm(shell, built, sample, **how):
        asked.append((built, sample.name, how))
        return judged({"wet": (FRESH + 9, 4), "wetter": (FRESH + 10,)})

    monkeypatch.setattr(trials, "confirm", confirm)
    sample = SimpleNamespace(
        sample=lambda number: SimpleNamespace(name=f"sample {number}", design_load="wet")
    )
    design = Design(np.ones(2), np.ones(2, dtype=bool), 0.1)
    last = Accepted(design, np.array([True, False]), 0.0)
    search = searching(asked=sample)
    found, it = trials.fresh(
        search, iterate(samples=3, fallen=(4, FRESH, FRESH - 1, FRESH + 2), accepted=(last,))
    )
    assert found.fallen["wet"] == (FRESH + 9, 4)
    ((built, name, how),) = asked
    assert built.present.tolist() == [True, False], "without slack cables"
    assert (name, how) == (
        "sample 3",
        {"first": [FRESH, FRESH + 2], "whole": True, "judging": "judging"},
    )
    assert (it.samples, it.fallen) == (4, (FRESH + 9, 4, FRESH, FRESH - 1, FRESH + 2))
    assert search.evaluator.factorisations == 111
    trials.confirmed(search, SimpleNamespace(name="again", design_load="wet"), built, (7,))
    assert asked[-1] == (built, "again", {"first": (7,), "judging": "judging"})
    assert search.evaluator.factorisations == 122


@pytest.mark.parametrize("margin", [0.15, 0.3])
def test_a_stage_is_looked_for_from_half_the_load_on_and_as_finely_as_the_margin_asks(monkeypatch, margin):
    given = []

    def apply_load(assembly, state, before, after, **how):
        given.append((before, after, how))
        return SimpleNamespace(on_branch=False, share=0.9, factorisations=2)

    monkeypatch.setattr(trials, "apply_load", apply_load)
    problem = SimpleNamespace(used=lambda: ["wet", "wetter"], loads={"wetter": "all of it"})
    evaluator = SimpleNamespace(
        base="wet",
        problem=problem,
        load=lambda name, stage: (name, stage),
        assembly=lambda design: None,
        factorisations=0,
    )
    assert trials.reach(evaluator, None, None, 0.0, margin, 0.2) == pytest.approx(0.9 - margin)
    assert given == [(("wet", 1.0), "all of it", {"step": 0.5, "smallest": min(0.2, margin), "stay": True})]


def test_without_further_loads_the_whole_of_them_is_borne():
    alone = SimpleNamespace(base="wet", problem=SimpleNamespace(used=lambda: ["wet"]))
    assert trials.reach(alone, None, None, 0.0, 0.15) == 1.0


def test_a_design_is_sound_in_the_states_of_its_whole_loads(monkeypatch):
    def follow(shell, design, loads, *, stay):
        return {
            name: SimpleNamespace(
                on_branch=True, factorisations=2, equilibrium=SimpleNamespace(state=f"under {name}")
            )
            for name in loads
        }

    monkeypatch.setattr(trials, "loaded_states", lambda *_: (None, 4))
    monkeypatch.setattr(trials, "follow", follow)
    monkeypatch.setattr(trials, "violation", lambda *_: 0.0)
    design = Design(np.ones(2), np.ones(2, dtype=bool), 0.1)
    evaluator = SimpleNamespace(
        factorisations=0,
        problem=SimpleNamespace(used=lambda: ["wet", "wetter"]),
        seed=lambda design, states, stage: SimpleNamespace(objective=0.4, given=(design, states, stage)),
    )
    problem = SimpleNamespace(shell=None, loads={"wet": 1, "wetter": 2, "idle": 3})
    search = searching(evaluator=evaluator, problem=problem)
    found = trials.sound(search, Accepted(design, np.array([True, False]), 0.0, 0.5))
    assert found.given == (design, {"wet": "under wet", "wetter": "under wetter"}, 1.0)
    assert evaluator.factorisations == 10


def test_states_at_a_stage_are_reached_from_the_design_load_s(monkeypatch):
    given = []

    def apply_load(assembly, state, before, after):
        given.append((assembly, state, before, after))
        return SimpleNamespace(equilibrium=SimpleNamespace(state=f"under {after}"), factorisations=3)

    monkeypatch.setattr(trials, "apply_load", apply_load)
    evaluator = SimpleNamespace(
        base="wet",
        problem=SimpleNamespace(used=lambda: ["wet", "wetter", "wind"]),
        load=lambda name, stage: f"{stage} of {name}",
        assembly=lambda design: f"of {design}",
        factorisations=1,
    )
    found = trials.staged(evaluator, "design", "known", 0.4)
    assert found == {"wet": "known", "wetter": "under 0.4 of wetter", "wind": "under 0.4 of wind"}
    assert {each[:3] for each in given} == {("of design", "known", "1.0 of wet")}
    assert evaluator.factorisations == 7


def test_an_accepted_trial_is_kept_at_the_stage_that_it_reaches(monkeypatch):
    monkeypatch.setattr(
        trials, "_raised", lambda search, it: replace(it, point=f"{it.point}, raised", stage=0.75)
    )
    monkeypatch.setattr(trials, "accepted_design", lambda search, point: f"design of {point}")
    monkeypatch.setattr(trials, "noted", lambda search, it, point, kept: (it, point, kept))
    it, point, kept = trials.accepted(None, iterate(accepted=("first",)), "trial")
    assert it.accepted == ("first", "design of trial, raised")
    assert (point, kept, it.stage) == ("trial, raised", True, 0.75)


def test_a_trial_towards_another_design_lies_on_the_straight_way_to_it(dome):
    problem = misfit_and_force(dome, 2.0, most=200.0, rms=None)
    start = dome.design()
    search, it = begin(problem, start, sf.SequentialConvex(), lambda softest: 0.0, 10)
    other = replace(start, rest_length=0.996 * start.rest_length)
    found = trials.attempt_towards(search, it, other, 0.25)
    np.testing.assert_allclose(found.design.rest_length, 0.999 * start.rest_length)
    assert found.objective != it.point.objective
    np.testing.assert_array_equal(
        trials.attempt_towards(search, it, other, 0.0).design.rest_length, it.point.design.rest_length
    )


def test_a_trial_towards_another_design_that_leaves_the_branch_is_none(monkeypatch):
    def leaves(*_, **__):
        raise OffBranch

    own = Design(np.ones(3), np.ones(3, dtype=bool), 0.01)
    evaluator = SimpleNamespace(rounded=lambda design: design, predicted=lambda *_: {}, evaluate=leaves)
    it = iterate(point=SimpleNamespace(design=own))
    assert trials.attempt_towards(searching(evaluator=evaluator), it, own, 0.5) is None
