"""The doors of a search: what is asked of it and of polishing, what polishing serves, when another round
follows and what comes back; searches themselves are told.
"""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import shellform as sf
from shellform.gridshell.gridshell import Design
from shellform.optimiser import optimise as module
from shellform.optimiser.moving_asymptotes import MovingAsymptotes
from shellform.optimiser.optimum import Optimum, Step
from shellform.optimiser.solver import POLISHING
from shellform.problem.engineering import LeastTension
from shellform.problem.problem import LoadCase, Problem
from shellform.reliability.requirements import Demand
from shellform.reliability.safety import Safety
from tests.reliability.asked import asked_of

LOAD = np.full((2, 6), -1.0)


def problem_of(**changes):
    given = {
        "minimise": [sf.Share(0.7, sf.Misfit("wet")), sf.Share(0.3, sf.CableForce("wet"))],
        "further": [LoadCase("wetter", 1.2 * LOAD), LoadCase("wind", 0.5 * LOAD)],
    }
    return Problem(SimpleNamespace(cable_ends=[0] * 3), LoadCase("wet", LOAD), **{**given, **changes})


def optimum_of(problem=None, **changes):
    given = {
        "problem": problem or problem_of(),
        "design": Design(np.array([1.0, 2.0, 4.0]), np.array([True, True, True]), 0.1),
        "loaded": {},
        "objective_start": 1.0,
        "objective": 0.8,
        "constraints": {},
        "history": (),
        "status": "ended",
        "evaluations": 4,
        "rejected": 0,
        "equilibria": 0,
        "factorisations": 0,
        "wasted": 0,
        "stiffness": 0.5,
    }
    return Optimum(**{**given, **changes})


@pytest.fixture
def begun(monkeypatch):
    """What searches are begun with; each runs as told and finishes so."""
    told = SimpleNamespace(asked=[], demanded=[], run=[])

    def begin(problem, start, solver, kept, evaluations, *rest, **named):
        told.asked.append((problem, start, solver, kept(2.0), evaluations, rest, named))
        return "search", "iterate"

    def demand(shell, start, loads, safety, **how):
        told.demanded.append((start, list(loads), how))
        return "asked"

    monkeypatch.setattr(module, "begin", begin)
    monkeypatch.setattr(module, "demand", demand)
    monkeypatch.setattr(
        module, "resumed", lambda search, checkpoint: (f"{search} resumed at {checkpoint}", "there")
    )
    monkeypatch.setattr(module, "run", lambda search, it: ("run", search, it))
    monkeypatch.setattr(module, "finish", lambda search, it: (search, it))
    monkeypatch.setattr(module, "minimise_directly", lambda problem, start, solver, **how: ("directly", how))
    return told


def test_a_search_keeps_the_larger_share_of_stiffness_that_solver_or_safety_asks_for(begun):
    problem, safety = problem_of(), Safety(sf.Tolerances(), stiffness=0.5)
    sf.optimise(problem, "start", solver=sf.SequentialConvex(stiffness=0.3), evaluations=9)
    sf.optimise(problem, "start", solver=sf.SequentialConvex(stiffness=0.3), safety=safety)
    sf.optimise(problem, "start", solver=sf.SequentialConvex(stiffness=0.7), safety=safety)
    assert [kept for *_, kept, _, _, _ in begun.asked] == pytest.approx([0.6, 1.0, 1.4])
    assert [evaluations for *_, evaluations, _, _ in begun.asked] == [9, 100, 100]
    assert [named["asked"] for *_, named in begun.asked] == [None, "asked", "asked"]


def test_a_design_is_to_stand_as_built_under_the_named_loads_or_all_no_less_than_the_initial_one(begun):
    safety = Safety(sf.Tolerances())
    sf.optimise(problem_of(), "start", safety=safety)
    sf.optimise(
        problem_of(built_under=["wetter"]), "start", safety=safety, initial="initial", judging="judging"
    )
    assert begun.demanded == [
        ("start", ["wet", "wetter", "wind"], {"design_load": "wet", "judging": None}),
        ("initial", ["wetter"], {"design_load": "wet", "judging": "judging"}),
    ]


def test_a_search_goes_on_from_a_checkpoint_and_the_paper_s_method_goes_its_own_way(begun):
    assert sf.optimise(problem_of(), "start") == ("search", ("run", "search", "iterate"))
    assert sf.optimise(problem_of(), "start", resume="half") == (
        "search resumed at half",
        ("run", "search resumed at half", "there"),
    )
    way, how = sf.optimise(problem_of(), "start", solver=MovingAsymptotes(), evaluations=7, resume="half")
    assert (way, how["evaluations"], how["resume"]) == ("directly", 7, "half")


def far(monkeypatch, **states):
    monkeypatch.setattr(module, "_farthest", lambda best: states.get(best.status, 0.0))


def served(shares):
    return [(part.share, part.term.name) for part in shares]


def test_polishing_serves_the_shape_and_by_half_the_farthest_nodes_where_they_are_too_far_off(monkeypatch):
    far(monkeypatch, ended=0.01)
    both = [
        sf.Share(0.2, sf.Misfit("wet")),
        sf.Share(0.6, sf.RmsMisfit("wet")),
        sf.Share(0.2, sf.CableForce("wet")),
    ]
    best = optimum_of(problem_of(minimise=both))
    for deviation, expected in (
        (None, [0.25, 0.75]),
        (0.01, [0.25, 0.75]),
        (0.0099, [0.125, 0.375, 0.5]),
    ):
        found = module._shape(best, replace(POLISHING, deviation=deviation))
        assert [part.share for part in found] == pytest.approx(expected)
    assert found[-1].term == sf.Bulges("wet")
    flat = optimum_of(problem_of(minimise=[sf.Share(1.0, sf.RodRadius())]))
    assert served(module._shape(flat, POLISHING)) == [(1.0, "misfit")]
    assert module._shape(flat, POLISHING)[0].term == sf.Misfit("wet")


def step(evaluation):
    return Step(evaluation, 0.5, {}, {}, 3, 1.0, True, 0.1)


@pytest.fixture
def rounds(monkeypatch):
    """Rounds of polishing with told ends; how each was begun is kept."""
    told = SimpleNamespace(ends=[], asked=[], least=[])

    def polished(best, solver, least, evaluations, groups, progress, judging):
        told.asked.append((best.status, evaluations))
        told.least.append(least)
        if progress is not None:
            progress(step(2))
        return told.ends.pop(0)

    monkeypatch.setattr(module, "_polished", polished)
    far(monkeypatch, first=0.004, second=0.006, farther=0.011)
    return told


def ended(status, objective, evaluations=5, design=None, mind=True):
    design = design or Design(np.array([1.0, 2.0, objective]), np.ones(3, dtype=bool), 0.1)
    return optimum_of(
        status=status,
        objective=objective,
        evaluations=evaluations,
        design=design,
        history=(step(1), step(evaluations)),
        mind={3: 1.0} if mind else {},
        stiffness=0.5,
        rejected=1,
        equilibria=10,
        factorisations=100,
        wasted=20,
    )


def test_polishing_goes_on_from_where_it_ended_while_a_round_gains_a_hundredth(rounds):
    rounds.ends = [ended("one", 0.9, 8), ended("two", 0.985, 7), ended("three", 0.995, 3), None]
    heard = []
    found = sf.polish(optimum_of(), evaluations=20, progress=heard.append)
    assert rounds.asked == [("ended", 20), ("one", 12), ("two", 5)]
    assert (found.status, found.objective, found.evaluations) == ("three", 0.995, 18)
    assert [each.evaluation for each in found.history] == [1, 8, 9, 15, 16, 18]
    assert [each.evaluation for each in heard] == [2, 10, 17]
    assert (found.rejected, found.equilibria, found.factorisations, found.wasted) == (3, 30, 300, 60)


def test_what_one_round_of_polishing_uses_up_of_the_stiffness_no_other_may_use_up_again(rounds):
    rounds.ends = [ended("one", 0.9), ended("two", 0.7), ended("three", 0.6)]
    sf.polish(optimum_of(stiffness=2.0), solver=replace(POLISHING, stiffness=0.8), evaluations=15)
    assert rounds.least == [1.6, 1.6, 1.6]


def test_another_round_follows_only_with_structures_in_mind_evaluations_left_and_no_groups(rounds):
    for first, how in (
        (ended("first", 0.9, mind=False), {}),
        (ended("first", 0.9, 20), {}),
        (ended("first", 0.991), {}),
        (ended("first", 0.9), {"groups": np.zeros(3, dtype=int)}),
    ):
        rounds.ends, rounds.asked = [first, None], []
        assert sf.polish(optimum_of(), evaluations=20, **how) is first
        assert len(rounds.asked) == 1
    best = optimum_of()
    rounds.ends = [ended("first", 0.9, design=best.design), None]
    sf.polish(best, evaluations=20)
    assert len(rounds.ends) == 1, "what came back is what there was"


def test_a_round_that_brings_a_node_too_far_off_or_finds_nothing_is_not_taken(rounds):
    first = ended("first", 0.9)
    for second, deviation, taken in (
        (ended("second", 0.8, mind=False), 0.006, True),
        (ended("second", 0.8, mind=False), 0.0059, False),
        (ended("second", 0.8, mind=False), None, False),  # farther than before
        (ended("zeroth", 0.8, mind=False), None, True),
        (ended("zeroth", 0.8, design=first.design, mind=False), None, False),
    ):
        rounds.ends = [first, second]
        found = sf.polish(optimum_of(), solver=replace(POLISHING, deviation=deviation), evaluations=20)
        assert (found.objective == 0.8) == taken


@pytest.fixture
def polishing(monkeypatch):
    """One round, whose search ends as told."""
    told = SimpleNamespace(asked=[], followed=[], end=None, fell=False, mind=None, ran=[])

    def begin(problem, start, solver, kept, evaluations, progress, *, asked, judging, followed):
        told.followed.append(followed)
        told.asked.append((problem, start, kept(123.0), evaluations, asked))
        search = Held(
            models=SimpleNamespace(reach=0.3),
            evaluator="evaluator",
            solver=solver,
            first_window=0.7,
            asked=asked,
        )
        return search, Held(tensioned=np.zeros(3, dtype=bool), window=0.1, fell=told.fell, mind=None)

    def run(search, it):
        told.ran.append((search, it))
        return it

    monkeypatch.setattr(module, "begin", begin)
    monkeypatch.setattr(
        module, "replace", lambda of, **new: of.with_(**new) if isinstance(of, Held) else replace(of, **new)
    )
    monkeypatch.setattr(module, "Models", lambda *given, whole: (*given, whole))
    monkeypatch.setattr(module, "as_borne", lambda search, it, mind: it.with_(mind=told.mind))
    monkeypatch.setattr(module, "finely", lambda search, evaluations: search.with_(first_window=0.01))
    monkeypatch.setattr(module, "run", run)
    monkeypatch.setattr(module, "finish", lambda search, it: told.end)
    monkeypatch.setattr(module, "_shape", lambda best, solver: [sf.Share(1.0, sf.Misfit("wet"))])
    return told


class Held(SimpleNamespace):
    def with_(self, **changes):
        return Held(**{**vars(self), **changes})


def polished_once(polishing, best, **how):
    return module._polished(best, POLISHING, 0.4, 6, how.get("groups"), None, None)


@pytest.mark.parametrize(
    ("end", "fell", "better"),
    [
        (optimum_of(objective=0.9), False, True),
        (optimum_of(objective=1.0), False, False),
        (optimum_of(objective=0.9), True, False),
        (
            optimum_of(objective=0.9, design=Design(np.ones(3), np.array([True, True, False]), 0.1)),
            False,
            False,
        ),
    ],
)
def test_a_polished_design_is_taken_that_stands_is_better_and_has_all_its_cables(
    polishing, end, fell, better
):
    polishing.end, polishing.fell = replace(end, history=(step(3),)), fell
    best = optimum_of(objective=0.4)
    found = polished_once(polishing, best)
    if better:
        assert found is polishing.end
        return
    assert found.status == "no design with less misfit was found"
    assert (found.design, found.objective, found.history) == (best.design, 0.4, (step(3),))
    grouped = polished_once(polishing, best, groups=np.array([0, 1, 0]))
    assert grouped is polishing.end, "of averaged lengths"


def test_polishing_varies_lengths_alone_where_they_are_variables_and_keeps_the_stiffness_asked_for(
    polishing,
):
    polishing.end = optimum_of(objective=0.9)
    both = [sf.FreeRadius(), sf.RestLengths(0.02)]
    polished_once(polishing, optimum_of(problem_of(variables=both), fallen=(7,)))
    problem, start, kept, evaluations, _ = polishing.asked[0]
    assert polishing.followed == [optimum_of().loaded], "as the search before left it"
    assert problem.variables == [sf.RestLengths(0.02)]
    assert [part.term for part in problem.minimise] == [sf.Misfit("wet")]
    assert (start.rest_length.tolist(), kept, evaluations) == ([1.0, 2.0, 4.0], pytest.approx(0.4), 6)
    search, it = polishing.ran[0]
    assert (search.always_guarded, search.groups, search.models[-1], search.models[2]) == (
        True,
        None,
        False,
        0.3,
    )
    assert (it.guarded, it.tensioned.all(), it.fallen, it.window) == (True, True, (7,), 0.1)
    polished_once(polishing, optimum_of(problem_of(variables=[sf.FreeRadius()])))
    assert polishing.asked[1][0].variables == [sf.FreeRadius()]


def test_cables_of_a_group_are_polished_from_their_mean_length(polishing):
    polishing.end = optimum_of(objective=0.9)
    polished_once(polishing, optimum_of(), groups=np.array([5, 2, 5]))
    assert polishing.asked[0][1].rest_length.tolist() == [2.5, 2.0, 2.5]
    assert polishing.followed == [None], "which nobody followed"
    search, _ = polishing.ran[0]
    assert (search.groups.tolist(), search.models[-1]) == ([1, 0, 1], True)


@pytest.mark.parametrize("trusted", [True, False])
def test_a_fresh_sample_judges_what_is_polished_with_structures_in_mind_or_where_trials_are_not_trusted(
    polishing, trusted
):
    polishing.end = optimum_of(objective=0.9)
    fresh = asked_of({"wet": 2, "wetter": 2}, tried=200, drawn=200, enlarged=1.0, probability_design=0.99)
    best = optimum_of(asked=Demand("trial", fresh, trusted))
    polished_once(polishing, best)
    found = polishing.asked[0][-1]
    assert (found.trial, found.trusted) == ("trial", trusted)
    assert found.confirmed is None if trusted else found.confirmed.safety.tried == 400
    assert polishing.ran[0][0].asked is found
    polishing.mind = "some"
    polished_once(polishing, best)
    search, it = polishing.ran[1]
    assert (search.asked.confirmed.safety.tried, it.window) == (400, 0.01), "in fine steps"
    polished_once(polishing, replace(best, asked=None))
    assert polishing.ran[2][0].asked is None


def test_limits_on_the_most_that_cables_pull_under_the_design_load_are_bounds_of_single_cables():
    lengths, radius = problem_of(), problem_of(variables=[sf.FreeRadius()])
    own = sf.AtMost(9.0, sf.CableForces("wet"))
    assert module._is_bound(own, lengths)
    assert module._is_bound(own, problem_of(variables=[sf.FreeRadius(), sf.RestLengths()]))
    assert not module._is_bound(own, radius)
    assert not module._is_bound(sf.AtMost(9.0, sf.CableForces("wetter")), lengths)
    assert not module._is_bound(sf.AtMost(9.0, sf.CableForces("wet", (0, 2))), lengths)
    assert not module._is_bound(sf.AtLeast(1.0, LeastTension("wet", 1.0)), lengths)
    assert not module._is_bound(sf.Between(1.0, 9.0, sf.CableForces("wet")), lengths)
    assert not module._is_bound(sf.AtLeast(1.0, sf.CableForces("wet")), lengths)


def test_cables_keep_half_a_deviation_of_what_the_median_one_is_off_by(monkeypatch):
    """Of stiffnesses over lengths of 100, 200 and 400 N/m, off by 3, 1 and 1 mm: 0.3, 0.2 and 0.4 N."""
    cables = SimpleNamespace(stiffness=np.full(3, 400.0), rest_length=np.array([4.0, 2.0, 1.0]))
    seen = []
    monkeypatch.setattr(
        module, "perfect", lambda *given, shapes: SimpleNamespace(network=SimpleNamespace(cables=cables))
    )
    monkeypatch.setattr(module, "assemble", lambda network: "assembly")

    def stretch(nominal, tolerances, assembly, *, seed):
        seen.append((tolerances, seed))
        return np.array([0.003, 0.001, 0.001])

    monkeypatch.setattr(module, "stretch_deviation", stretch)

    some = replace(optimum_of().design, present=np.array([True, False, True]))

    def least(start=some, **changes):
        safety = Safety(sf.Tolerances(marks=1e-3), seed=4, **changes)
        asked = SimpleNamespace(trial=SimpleNamespace(safety=safety))
        return module._least_tension(problem_of(), start, asked)

    assert least() == pytest.approx(0.5 * 0.3)
    assert least(margin=1.2) == pytest.approx(1.2 * 0.3)
    assert seen[0] == (sf.Tolerances(marks=1e-3), 5), "of structures that judge nothing"
    assert least(margin=0.0) == 0.0
    assert least(replace(optimum_of().design, present=np.zeros(3, dtype=bool))) == 0.0
    assert module._least_tension(problem_of(), optimum_of().design, None) == 0.0
    assert len(seen) == 2


@pytest.mark.parametrize(
    ("pull", "mean", "on_branch"),
    [([2.0, 0.0, 4.0], 2.0, True), ([0.0, 0.0, 0.0], 1.0, True), ([], 1.0, False)],
)
def test_a_search_begins_at_its_start_as_far_as_that_bears_the_further_loads(
    monkeypatch, pull, mean, on_branch
):
    bound, soft = sf.AtMost(9.0, sf.CableForces("wet")), sf.AtMost(0.01, sf.RmsMisfit("wetter"))
    problem = problem_of(constraints=[bound, soft])
    problem.shell.cables = lambda design: SimpleNamespace(tension=lambda state: np.array(pull))
    asked = []

    class Begun:
        base = "wet"
        blocks = SimpleNamespace(check_start=lambda: None)

        def __init__(self, inner, start):
            self.problem = inner

        def begin(self, followed):
            state = {"wet": "rest", "wetter": "under more", "wind": "under wind"}
            return {
                name: SimpleNamespace(
                    on_branch=on_branch or name != "wetter", equilibrium=SimpleNamespace(state=each)
                )
                for name, each in state.items()
            }

        def assembly(self, design):
            return "assembly"

        def seed(self, design, states, stage):
            asked.append((states, stage))
            return SimpleNamespace(objective=1.0, constraints=np.zeros(4), states=states, design=design)

    def reach(evaluator, design, state, least, margin):
        assert (state, least, margin) == ("rest", 0.0, 0.15)
        return 0.6

    monkeypatch.setattr(module, "Evaluator", Begun)
    monkeypatch.setattr(module, "reach", reach)
    monkeypatch.setattr(
        module, "staged", lambda evaluator, design, state, stage: {"wet": state, "stage": stage}
    )
    monkeypatch.setattr(module, "modes", lambda *given: SimpleNamespace(stiffness=np.array([5.0, 9.0])))
    monkeypatch.setattr(module, "accepted_design", lambda search, point: "first")
    monkeypatch.setattr(module, "record", lambda search, point, stage, kept, phase: (stage, kept, phase))
    start = optimum_of().design
    search, it = module.begin(problem, start, sf.SequentialConvex(), lambda softest: 0.5 * softest, 30)
    if on_branch:
        assert asked == [({"wet": "rest", "wetter": "under more"}, 1.0)]
    else:
        assert asked == [({"wet": "rest", "stage": 0.6}, 0.6)]
    assert (search.bounded, list(search.inner.constraints)) == ((bound,), [soft])
    assert (search.tension, search.softest, search.evaluations, search.least) == (mean, 5.0, 30, 0.0)
    assert (it.stiffness, it.stage, it.margin, it.window) == (2.5, it.stage, 0.15, 0.2 * mean)
    assert it.history == ((it.stage, True, "climb"),)
    assert (len(it.tensioned), it.tensioned.any(), len(it.excess)) == (3, False, 4)
    search, it = module.begin(problem, start, sf.SequentialConvex(), lambda _: 0.0, 30)
    assert it.stiffness == 0.0
