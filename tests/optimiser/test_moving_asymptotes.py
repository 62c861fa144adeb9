"""The paper's own method: MMA directly in the rest lengths, on a coarse vault and beside a problem of
Svanberg's."""

from contextlib import suppress
from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.sparse as sp

import shellform as sf
from shellform.errors import InputError, NotConverged
from shellform.gridshell.gridshell import Design
from shellform.optimiser import moving_asymptotes
from shellform.problem.terms import Measurement, Term
from shellform.structure.elements.state import extended, moved
from tests.optimiser.told import loaded

SHARE = np.array([61.0, 37.0, 19.0, 7.0, 1.0])  # of Svanberg's cantilever


def problem(shell, force=1.0, more=1.2, radius=False):
    wet = shell.point_load(force)
    shares = [sf.Share(0.6, sf.Misfit("wet")), sf.Share(0.2, sf.CableForce("wet"))]
    shares.append(sf.Share(0.2, sf.RodRadius() if radius else sf.CableForce("wet")))
    return sf.Problem(
        shell,
        sf.LoadCase("wet", wet),
        shares,
        [sf.AtMost(20.0, sf.CableForces("wet")), sf.AtMost(0.005, sf.RmsMisfit("wetter"))],
        [sf.LoadCase("wetter", more * wet)],
        [sf.RestLengths(0.01, 1.1), *([sf.FreeRadius(0.0008, 0.0012)] if radius else [])],
    )


def told(history):
    return [
        (step.evaluation, step.objective, step.constraints, step.cables, step.stage, step.accepted)
        for step in history
    ]


@dataclass(frozen=True)
class Boxes(Term):
    """Of five cables, with x = 1000 (1 - rest length over the start's): the weight 0.0624 sum(x) of
    Svanberg's cantilever of five boxes, or its displacement sum(c / x³)."""

    weight: bool
    name = "boxes"
    load = ""

    def measure(self, at):
        first = at.shell.design().rest_length[:5]
        x = 1e3 * (1.0 - at.design.rest_length[:5] / first)
        value = 0.0624 * x.sum() if self.weight else (SHARE / x**3).sum()
        by_x = np.full(5, 0.0624) if self.weight else -3.0 * SHARE / x**4
        rest = np.zeros((1, len(at.design.rest_length)))
        rest[0, :5] = by_x * -1e3 / first
        return Measurement(np.array([value]), by_rest_length=sp.csr_array(rest))


def test_svanberg_s_cantilever_of_1987_has_its_optimum_through_the_public_door(coarse):
    """x = (6.016, 5.309, 4.494, 3.502, 2.153), f = 1.340, from x = 5 as printed there. The limit may be
    broken by a thousandth, and f is flat along it: x is as good as the root of that. Bounds of 1 and 10 as
    rest lengths."""
    start = coarse.design()
    lengths = start.rest_length.copy()
    lengths[:5] *= 1.0 - 5e-3
    from_five = sf.Design(lengths, start.present, start.radius)
    asked = sf.Problem(
        coarse,
        sf.LoadCase("wet", coarse.point_load(1.0)),
        [sf.Share(1.0, Boxes(True))],
        [sf.AtMost(1.0, Boxes(False))],
        variables=[sf.RestLengths(0.01, (1.0 - 1e-3) / (1.0 - 5e-3))],
    )
    best = sf.optimise(asked, from_five, solver=sf.MovingAsymptotes(tolerance=1e-10), evaluations=200)
    x = 1e3 * (1.0 - best.design.rest_length[:5] / start.rest_length[:5])
    np.testing.assert_allclose(x, [6.016, 5.309, 4.494, 3.502, 2.153], rtol=0.03)
    assert 0.0624 * x.sum() == pytest.approx(1.340, abs=5e-4)
    assert best.constraints["boxes"] < 1e-3


def test_direct_mma_keeps_the_bounds_and_ends_on_the_stable_branch_without_slack_cables(coarse):
    start = coarse.design()
    asked = problem(coarse, radius=True)
    seen = []
    best = sf.optimise(asked, start, solver=sf.MovingAsymptotes(), evaluations=15, progress=seen.append)
    assert best.objective < 0.6 * best.objective_start
    assert best.loaded["wet"].on_branch
    there = best.design.present
    assert (best.design.rest_length[there] <= 1.1 * start.rest_length[there] * (1.0 + 1e-12)).all()
    assert (best.design.rest_length[there] >= 0.01).all()
    assert 0.0008 <= best.design.radius <= 0.0012
    assert (coarse.cables(best.design).tension(best.states["wet"]) > 0.0).all()
    assert max(best.constraints.values()) <= sf.FEASIBLE
    assert best.evaluations <= 15
    assert len(best.history) == best.evaluations + 1
    assert told(seen) == told(best.history)
    accepted = [step.objective for step in best.history if step.accepted]
    assert accepted == sorted(accepted, reverse=True)
    assert best.stiffness == 0.0


def test_trials_off_the_branch_are_rejected_and_mma_goes_on(coarse):
    """4 N on every crossing, of which the unbraced grid bears half."""
    best = sf.optimise(problem(coarse, 4.0), coarse.design(), solver=sf.MovingAsymptotes(), evaluations=25)
    assert best.rejected > 0
    lost = [k for k, step in enumerate(best.history) if not step.accepted]
    assert any(step.accepted for step in best.history[lost[0] :])
    assert best.loaded["wet"].on_branch
    assert best.objective < 0.5


def test_a_search_goes_on_from_no_checkpoint_of_the_other_solver(coarse):
    asked, start, solvers = (
        problem(coarse, 2.0),
        coarse.design(),
        (sf.MovingAsymptotes(), sf.SequentialConvex()),
    )
    for one, other in (solvers, solvers[::-1]):
        kept = []
        sf.optimise(asked, start, solver=one, evaluations=2, keep=kept.append)
        with pytest.raises(InputError, match="resume: was written by a search with another solver"):
            sf.optimise(asked, start, solver=other, evaluations=2, resume=kept[0])


@pytest.mark.parametrize("more", [1.2, 1.5])
def test_a_direct_search_resumed_anywhere_ends_with_the_same_design_and_history_to_the_bit(coarse, more):
    """Of 1.5 times the load the start bears 1.45, so that it is raised in stages."""
    asked, start = problem(coarse, 4.0, more), coarse.design()
    solver = sf.MovingAsymptotes(stage=3)
    kept = []
    whole = sf.optimise(asked, start, solver=solver, evaluations=22, keep=kept.append)
    assert (whole.history[0].stage < 1.0) == (more == 1.5)
    assert whole.history[-1].stage == 1.0
    for place in (0, len(kept) // 2, len(kept) - 1):
        again = sf.optimise(asked, start, solver=solver, evaluations=22, resume=kept[place])
        np.testing.assert_array_equal(again.design.rest_length, whole.design.rest_length)
        np.testing.assert_array_equal(again.design.present, whole.design.present)
        assert told(again.history) == told(whole.history)
        assert (again.factorisations, again.evaluations, again.status) == (
            whole.factorisations,
            whole.evaluations,
            whole.status,
        )


def test_a_direct_search_resumed_with_states_of_twice_the_digits_has_all_of_them(coarse):
    kept, asked = [], (problem(coarse), coarse.design(), sf.MovingAsymptotes(), 3, None)
    search = moving_asymptotes._begun(*asked, kept.append, None)
    step = np.full((coarse.node_count, 6), 1e-17)
    states = {name: moved(extended(state), step) for name, state in search.best.states.items()}
    search.near = [replace(search.best, states=states)]
    moving_asymptotes._tell(search)
    again = moving_asymptotes._begun(*asked, None, None)
    moving_asymptotes._resume(again, kept[0])
    for name, state in states.items():
        assert state.tail.any()
        np.testing.assert_array_equal(again.best.states[name].tail, state.tail)


def test_a_stage_at_which_mma_has_converged_is_left_for_one_nearer_to_the_end_of_its_branch(coarse):
    """A tolerance that ends each run at its first steps."""
    asked, seen = problem(coarse, 4.0, 1.5), []
    solver = sf.MovingAsymptotes(tolerance=0.3)
    with suppress(NotConverged):  # whether the whole load is borne in the end isn't asked here
        sf.optimise(asked, coarse.design(), solver=solver, evaluations=30, progress=seen.append)
    assert seen[0].stage < 1.0
    assert seen[-1].stage > seen[0].stage + 0.05


def test_settings_and_starts_that_can_t_be_are_refused(coarse):
    with pytest.raises(InputError, match=r"solver\.rows"):
        sf.MovingAsymptotes(rows=0)
    with pytest.raises(NotConverged, match="doesn't carry the load case 'wet'"):
        sf.optimise(problem(coarse, 40.0), coarse.design(), solver=sf.MovingAsymptotes(), evaluations=3)
    with pytest.raises(NotConverged, match="No design was found that carries all loads"):
        sf.optimise(problem(coarse, 4.0, 9.0), coarse.design(), solver=sf.MovingAsymptotes(), evaluations=3)


def test_trials_begin_at_the_nearest_of_the_last_points_and_of_the_best_one(monkeypatch):
    """A worse point takes the place of the oldest, and the best one stays the last."""
    for name in ("_tell", "_note"):
        monkeypatch.setattr(moving_asymptotes, name, lambda *_: None)
    monkeypatch.setattr(moving_asymptotes, "_as_told", lambda search, x, point, objective: point)

    def point(place, objective):
        design = SimpleNamespace(present=None)
        return SimpleNamespace(
            variables=np.array([place]),
            rank=(0.0, objective),
            objective=objective,
            design=design,
            states=place,
        )

    begun = []

    def evaluated(design, states, stage, lead):
        begun.append(states)
        return point(design[0], abs(design[0] - 5.0))

    best = point(4.0, 1.0)
    search = SimpleNamespace(
        evaluator=SimpleNamespace(
            blocks=SimpleNamespace(design=lambda x, present: x),
            evaluate=evaluated,
            linearised=lambda each: each,
        ),
        near=[point(1.0, 4.0), point(2.0, 3.0), best],
        best=best,
        accepted=[],
        taut=lambda each: each,
        solver=SimpleNamespace(starts=3),
        stage=1.0,
    )
    for place, nearest, left in (
        (9.0, 4.0, [2.0, 9.0, 4.0]),  # worse: the best stays last
        (8.0, 9.0, [9.0, 8.0, 4.0]),
        (4.5, 4.0, [8.0, 4.0, 4.5]),  # better
    ):
        found = moving_asymptotes._tried(search, np.array([place]))
        assert begun[-1] == nearest
        assert [each.variables[0] for each in search.near] == left
        search.best = min(search.best, found, key=lambda each: each.rank)
    assert [each.variables[0] for each in search.accepted] == [4.5]


def test_of_limits_on_many_values_mma_is_told_those_nearest_to_theirs_the_worst_first():
    search = SimpleNamespace(
        solver=sf.MovingAsymptotes(rows=2),
        problem=SimpleNamespace(places=lambda: [slice(0, 1), slice(1, 5), slice(5, 5)]),
    )
    values = np.array([-0.9, -0.5, 0.3, -0.1, 0.4])
    assert moving_asymptotes._rows(search, values).tolist() == [0, 4, 2]
    found = moving_asymptotes._as_told(
        search,
        np.array([7.0]),
        SimpleNamespace(
            constraints=values,
            constraints_by_variables=10.0 * values[:, None],
            objective_by_variables="slope",
        ),
        np.inf,
    )
    assert (found.variables.tolist(), found.objective, found.slope) == ([7.0], np.inf, "slope")
    assert found.rows.tolist() == [-0.9, 0.4, 0.3]
    assert found.row_slopes.tolist() == [[-9.0], [4.0], [3.0]]


@pytest.mark.parametrize(
    ("reached", "margin", "after"),
    [
        (0.7, 0.15, (0.7, 0.15, 1e3, 9)),  # the next stage, anew and more carefully
        (
            0.5,
            0.15,
            (0.5, 0.075, 1.0, 5 + 8),
        ),  # it bears no more: nearer to its end, for eight evaluations more
        (0.5, 0.015, (0.5, 0.01, 1.0, 5 + 8)),
    ],
)
def test_further_loads_are_raised_as_far_as_the_best_design_bears_them(monkeypatch, reached, margin, after):
    def reach(evaluator, design, state, least, given, smallest):
        assert (design, state, least, given, smallest) == ("best", "rest", 0.5, margin, 0.125)
        return reached

    monkeypatch.setattr(moving_asymptotes, "reach", reach)
    monkeypatch.setattr(moving_asymptotes, "staged", lambda evaluator, design, state, stage: f"at {stage}")
    begun = []

    class Raised(moving_asymptotes._Search):
        best = SimpleNamespace(design="best", states={"wet": "rest"})

        def begin(self, seeded):
            begun.append(seeded)
            self.until = 9

    search = Raised(
        SimpleNamespace(design_load=SimpleNamespace(name="wet")),
        sf.MovingAsymptotes(),
        SimpleNamespace(seed=lambda design, states, stage: (design, states, stage)),
        40,
        None,
        None,
        0.0,
        stage=0.5,
        margin=margin,
        told=[None] * 5,
    )
    moving_asymptotes._raise_stage(search)
    assert (search.stage, search.margin, search.caution, search.until) == pytest.approx(after)
    assert begun == ([("best", "at 0.7", 0.7)] if reached > 0.5 else [])


def finished(monkeypatch, bears, **changes):
    designs = [Design(np.full(2, k + 1.0), np.ones(2, dtype=bool), 0.1) for k in range(3)]
    followed = []

    def follow(shell, design, loads):
        number = int(design.rest_length[0]) - 1
        followed.append((number, list(loads)))
        return {
            name: SimpleNamespace(
                on_branch=number in bears, equilibrium=SimpleNamespace(state=f"{name} {number}")
            )
            for name in loads
        }

    monkeypatch.setattr(moving_asymptotes, "follow", follow)
    monkeypatch.setattr(
        moving_asymptotes,
        "_step",
        lambda search, point, kept: SimpleNamespace(objective=point, constraints={"kept": kept}),
    )
    work = {"evaluations": 9, "rejected": 2, "equilibria": 40, "factorisations": 99, "wasted": 11}
    given = {
        "problem": SimpleNamespace(
            shell=SimpleNamespace(node_count=2), loads={"wet": 1.0, "wetter": 2.0}, used=lambda: ["wet"]
        ),
        "evaluator": SimpleNamespace(**work, seed=lambda design, states, stage: (states, stage)),
        "stage": 1.0,
        "base": "wet",
        "accepted": designs,
        "best": SimpleNamespace(design="best"),
        "left": lambda: 0,
        "history": [SimpleNamespace(objective=1.0), SimpleNamespace(objective=0.4)],
        "status": "ended",
        **changes,
    }
    found = moving_asymptotes._finished(SimpleNamespace(**given))
    assert {name: getattr(found, name) for name in work} == work
    return found, followed


def test_the_last_accepted_design_comes_back_whose_path_bears_the_design_load(monkeypatch):
    found, followed = finished(monkeypatch, {0, 1})
    assert followed == [(2, ["none", "wet", "wetter"]), (1, ["none", "wet", "wetter"])]
    assert found.design.rest_length[0] == 2.0
    assert (found.objective, found.objective_start) == (({"wet": "wet 1"}, 1.0), 1.0)
    assert (found.constraints, found.stiffness, found.status) == ({"kept": True}, 0.0, "ended")
    with pytest.raises(NotConverged, match="carries all loads") as told:
        finished(monkeypatch, {0}, stage=0.99)
    assert (told.value.state, told.value.iterations) == ("best", 99)
    assert told.value.remedy.endswith("stiffer cables, or more evaluations.")
    with pytest.raises(NotConverged) as told:
        finished(monkeypatch, {0}, stage=0.99, left=lambda: 3)
    assert told.value.remedy.endswith("thicker rods, stiffer cables.")


@pytest.fixture
def direct(monkeypatch):
    """A direct search whose runs spend what is told and whose stages rise, or margins fall, as told."""
    told = SimpleNamespace(spends=[], stages=[], log=[], stage=0.5)

    def run(search):
        told.log.append(("run", search.stage))
        search.evaluator.evaluations += told.spends.pop(0)

    def raised(search):
        told.log.append("raised")
        search.stage, search.margin = told.stages.pop(0)

    def begun(*given):
        evaluator = SimpleNamespace(evaluations=0)
        return SimpleNamespace(
            evaluator=evaluator,
            stage=told.stage,
            margin=0.2,
            left=lambda: given[3] - evaluator.evaluations,
        )

    monkeypatch.setattr(moving_asymptotes, "_begun", begun)
    monkeypatch.setattr(
        moving_asymptotes, "_resume", lambda search, point: told.log.append(("resume", point))
    )
    monkeypatch.setattr(moving_asymptotes, "_run", run)
    monkeypatch.setattr(moving_asymptotes, "_raise_stage", raised)
    monkeypatch.setattr(moving_asymptotes, "_finished", lambda search: search.evaluator.evaluations)
    told.ends = lambda evaluations, resume=None: moving_asymptotes.minimise_directly(
        None, None, None, evaluations=evaluations, resume=resume
    )
    return told


def test_runs_follow_stage_by_stage_until_the_whole_load_the_evaluations_end_or_nothing_changes(direct):
    direct.spends, direct.stages = [8, 8, 5, 9], [(0.7, 0.2), (1.0, 0.2)]
    assert direct.ends(40, resume="there") == 21
    assert direct.log == [("resume", "there"), ("run", 0.5), "raised", ("run", 0.7), "raised", ("run", 1.0)]
    direct.log.clear()
    # MMA has converged: nearer to the branch's end as far as that leads anywhere
    direct.spends, direct.stages = [8, 0, 0, 5], [(0.7, 0.2), (0.7, 0.1), (0.7, 0.1)]
    assert direct.ends(40) == 8
    assert direct.log == [("run", 0.5), *["raised", ("run", 0.7)] * 2, "raised"]
    direct.spends, direct.stages = [8, 8, 5], [(0.7, 0.2), (0.8, 0.2)]
    assert direct.ends(16) == 16
    direct.log.clear()
    direct.stage, direct.spends = 1.0, [8, 8]
    assert direct.ends(40) == 8, "at the whole load MMA ends by itself"


@pytest.mark.parametrize(("stage", "asked"), [(1.0, 3 + 20), (0.5, 9), (0.9, 9)])
def test_a_run_is_told_again_what_it_was_told_and_goes_on_as_far_as_its_stage_may(monkeypatch, stage, asked):
    given = []

    def minimise(evaluate, first, lower, upper, **how):
        given.append((first, lower, upper, how, [evaluate(k)[0] for k in range(5)]))
        return None, "converged"

    def told(value):
        return SimpleNamespace(variables=f"x {value}", objective=value, slope=0, rows=[1, 2], row_slopes=0)

    monkeypatch.setattr(moving_asymptotes, "minimise", minimise)
    monkeypatch.setattr(moving_asymptotes, "_tried", lambda search, x: told(100 + x))
    search = SimpleNamespace(
        told=[told(0), told(1), told(2)],
        evaluator=SimpleNamespace(blocks=SimpleNamespace(bounds=lambda: ("lower", "upper"))),
        left=lambda: 20,
        stage=stage,
        until=9,
        solver=sf.MovingAsymptotes(tolerance=1e-3),
        caution=7.0,
        status="so far",
    )
    moving_asymptotes._run(search)
    first, lower, upper, how, values = given[0]
    assert (first, lower, upper) == ("x 0", "lower", "upper")
    assert how == {"constraints": 2, "evaluations": asked, "tolerance": 1e-3, "caution": 7.0}
    assert values == [0, 1, 2, 103, 104]
    assert len(search.told) == 5
    assert search.status == ("converged" if stage == 1.0 else "so far")
    search.left = lambda: 2
    moving_asymptotes._run(search)
    assert given[1][3]["evaluations"] == 7, "no more than are left"


@pytest.mark.parametrize("on_branch", [True, False])
def test_a_direct_search_begins_as_far_as_its_start_bears_the_further_loads(monkeypatch, on_branch):
    seeded = []

    class Begun:
        def __init__(self, problem, start):
            pass

        def begin(self, followed):
            assert followed == "known"
            return loaded("wet", "wetter", falling=() if on_branch else ["wetter"])

        def seed(self, start, states, stage):
            return states, stage

    def reach(evaluator, start, state, least, margin, smallest):
        assert (state, least, margin, smallest) == ("wet", 0.0, 0.15, 0.125)
        return 0.6

    monkeypatch.setattr(moving_asymptotes, "Evaluator", Begun)
    monkeypatch.setattr(moving_asymptotes, "reach", reach)
    monkeypatch.setattr(
        moving_asymptotes, "staged", lambda evaluator, start, state, stage: f"{state} at {stage}"
    )
    monkeypatch.setattr(moving_asymptotes._Search, "begin", lambda search, point: seeded.append(point))
    problem = SimpleNamespace(used=lambda: ["wet", "wetter"], design_load=SimpleNamespace(name="wet"))
    search = moving_asymptotes._begun(problem, "start", sf.MovingAsymptotes(), 40, None, None, "known")
    assert seeded == [({"wet": "wet", "wetter": "wetter"}, 1.0) if on_branch else ("wet at 0.6", 0.6)]
    assert (search.stage, search.margin, search.evaluations) == (1.0 if on_branch else 0.6, 0.15, 40)


def test_a_direct_search_s_trial_is_told_with_its_pulling_cables(monkeypatch):
    parts = [SimpleNamespace(term=name) for name in ("misfit", "cable_force")]
    pull = np.array([2.0, 0.0, 1.0])
    search = SimpleNamespace(
        problem=SimpleNamespace(
            shell=SimpleNamespace(cables=lambda design: SimpleNamespace(tension=lambda state: pull)),
            minimise=parts,
            constraints=parts,
            column=lambda term: term,
            places=lambda: [slice(0, 2), slice(2, 2)],
        ),
        evaluator=SimpleNamespace(evaluations=6),
        base="wet",
        stage=0.5,
        began=1.5,
    )
    monkeypatch.setattr(moving_asymptotes.time, "perf_counter", lambda: 4.0)
    given = SimpleNamespace(
        design=None,
        states={"wet": None},
        objective=0.9,
        terms=np.array([0.6, 0.3]),
        constraints=np.array([-0.5, 0.25]),
    )
    step = moving_asymptotes._step(search, given, True)
    assert (step.evaluation, step.objective, step.cables, step.stage) == (6, 0.9, 2, 0.5)
    assert (step.accepted, step.seconds) == (True, 2.5)
    assert step.terms == {"misfit": 0.6, "cable_force": 0.3}
    assert step.constraints == {"misfit": 0.25, "cable_force": -np.inf}
