"""The optimiser's settings, and the doors to other methods: what is refused, what counts as the best, what is handed out."""

from dataclasses import fields
from types import SimpleNamespace

import numpy as np
import pytest

import shellform as sf
from shellform.errors import InputError, NotConverged
from shellform.gridshell.gridshell import Design
from shellform.optimiser import comparison, convex, moving_asymptotes, solver
from shellform.optimiser.comparison import Plain
from shellform.optimiser.solver import SequentialConvex
from shellform.problem.evaluation import OffBranch

MAY_BE_ZERO = {
    "thin", "stiffness", "most_cables", "guards", "many", "recovery", "repairs", "idle", "kept", "least_tension",
    "stiffenings",
}  # fmt: skip


@pytest.mark.parametrize("name", [each.name for each in fields(SequentialConvex)])
def test_settings_are_positive_but_those_that_may_be_nothing(name):
    with pytest.raises(InputError, match=rf"solver\.{name}"):
        SequentialConvex(**{name: -1.0})
    if name in MAY_BE_ZERO:
        assert getattr(SequentialConvex(**{name: 0}), name) == 0
    else:
        with pytest.raises(InputError, match=rf"solver\.{name}"):
            SequentialConvex(**{name: 0.0})


def test_windows_shrink_and_grow():
    for shrink, grow in ((1.0, 1.6), (0.4, 0.99), (1.2, 1.6)):
        with pytest.raises(InputError, match="must shrink"):
            SequentialConvex(shrink=shrink, grow=grow)
    assert SequentialConvex(shrink=0.99, grow=1.0).grow == 1.0


def test_polishing_thins_nothing_in_steps_a_tenth_as_small_and_uses_up_a_fifth_of_the_stiffness():
    assert (solver.POLISHING.thin, solver.POLISHING.stiffness) == (False, 0.8)
    assert solver.POLISHING.smallest == pytest.approx(0.1 * SequentialConvex().smallest)


def test_a_start_beyond_its_bounds_is_refused_with_the_variable_s_number_and_one_on_them_is_not():
    def line(x):
        return float(x.sum()), np.ones(3), np.zeros(0), np.zeros((0, 3))

    lower, upper = np.zeros(3), np.array([1.0, 2.0, 3.0])
    for start, number in (([0.5, 2.1, 3.5], 1), ([0.5, 2.0, -0.1], 2)):
        with pytest.raises(InputError, match="outside the bounds") as told:
            convex.minimise(line, np.array(start), lower, upper, constraints=0, evaluations=9)
        assert told.value.value == number
    best, reason = convex.minimise(line, upper, lower, upper, constraints=0, evaluations=40)
    assert best == pytest.approx(lower, abs=1e-6)
    assert reason in ("the objective stopped improving", "the design stopped changing", "converged")
    assert convex.minimise(line, upper, lower, upper, constraints=0, evaluations=1)[1].endswith("was reached")


def test_with_caution_the_first_steps_are_short():
    def parabola(x):
        return float((x - 0.7) @ (x - 0.7)), 2.0 * (x - 0.7), np.zeros(0), np.zeros((0, 2))

    def went(**how):
        asked = []

        def noted(x):
            asked.append(np.array(x))
            return parabola(x)

        convex.minimise(noted, np.zeros(2), -np.ones(2), np.ones(2), constraints=0, evaluations=2, **how)
        return np.linalg.norm(asked[1] - asked[0])

    assert went() == went(caution=1.0)
    assert went(caution=1e3) < 0.1 * went()


def test_each_point_is_evaluated_once_though_objective_and_limits_are_asked_for_by_themselves():
    asked = []

    def disc(x):
        asked.append(tuple(x))
        return float(x[0] + 2.0 * x[1]), np.array([1.0, 2.0]), np.array([x @ x - 1.0]), 2.0 * x[None]

    best, _ = convex.minimise(
        disc, np.zeros(2), -2.0 * np.ones(2), np.ones(2), constraints=1, evaluations=60, tolerance=1e-10
    )
    assert best == pytest.approx(-np.array([1.0, 2.0]) / np.sqrt(5.0), abs=1e-4)
    assert len(asked) == len(set(asked))


def point(place, objective, violation=0.0):
    return SimpleNamespace(
        variables=np.array([float(place)]),
        objective=objective,
        violation=violation,
        rank=(violation, objective),
        design=SimpleNamespace(present=f"present {place}"),
        states=f"states {place}",
        constraints=np.array([violation - 0.5]),
        objective_by_variables=np.array([objective + 1.0]),
        constraints_by_variables=np.array([[violation + 2.0]]),
    )


@pytest.fixture
def plain(monkeypatch):
    """Designs of one variable, whose objective is it plus 1; beyond 10 it isn't on the branch."""
    made = object.__new__(Plain)
    begun, tried = point(0, 1.0), []

    def evaluate(design, states, stage, *, lead):
        tried.append((design, states, stage, lead))
        evaluator.evaluations += 1
        if design[0] > 10.0:
            raise OffBranch
        return design[0]

    evaluator = SimpleNamespace(
        evaluations=0,
        blocks=SimpleNamespace(design=lambda x, present: (float(x[0]), present)),
        evaluate=evaluate,
        linearised=lambda place: (
            point(place, 1.0 + abs(place - 3.0)) if place <= 7.0 else point(place, 0.1, 0.3)
        ),
    )
    made.evaluator, made.points, made.best = evaluator, [begun], begun
    made.history, made._at = [(0, 1.0, 0.0)], (begun.variables.tobytes(), begun, True)
    made.tried = tried
    return made


def test_a_trial_starts_from_the_nearest_design_known_and_off_the_branch_is_infinitely_bad(plain):
    assert plain.value(np.array([0.0])) == 1.0
    assert plain.tried == [], "which is known"
    assert plain.value(np.array([5.0])) == 3.0
    assert plain.value(np.array([11.0])) == np.inf
    assert plain.gradient(np.array([11.0])).tolist() == [4.0], "that of the nearest on the branch"
    assert plain.constraints(np.array([11.0])).tolist() == [-0.5]
    assert plain.jacobian(np.array([11.0])).tolist() == [[2.0]]
    assert plain.tried == [
        ((5.0, "present 0"), "states 0", 1.0, True),
        ((11.0, "present 5.0"), "states 5.0", 1.0, True),
    ], "each once"
    assert plain.history == [(0, 1.0, 0.0), (1, 3.0, 0.0)]


def test_the_best_design_is_remembered_beside_the_last_eleven(plain):
    plain.best = plain.points[0] = point(0, 9.0)
    plain.value(np.array([3.0]))
    assert plain.best.objective == 1.0
    best = plain.best
    for k in range(20):
        plain.value(np.array([4.0 + 0.01 * k]))
    assert plain.best is best
    places = [float(each.variables[0]) for each in plain.points]
    assert places[-2:] == [3.0, pytest.approx(4.19)]
    assert sorted(places)[0] == 3.0
    assert len(places) == 12
    plain.value(np.array([8.0]))
    assert plain.best is best, "a lower objective that breaks a limit is no better"


@pytest.mark.parametrize(("on_branch", "refused"), [(True, False), (False, True)])
def test_a_start_is_compared_that_bears_all_its_loads(monkeypatch, on_branch, refused):
    class Begun:
        def __init__(self, problem, start):
            pass

        def begin(self):
            return {
                name: SimpleNamespace(
                    on_branch=on_branch or name != "wetter",
                    equilibrium=SimpleNamespace(state=name),
                    share=0.4,
                )
                for name in ("wet", "wetter", "idle")
            }

        def seed(self, start, states, stage):
            assert (states, stage) == ({"wet": "wet", "wetter": "wetter"}, 1.0)
            return point(0, 1.0)

        def linearised(self, found):
            return found

    monkeypatch.setattr(comparison, "Evaluator", Begun)
    problem = SimpleNamespace(used=lambda: ["wet", "wetter"])
    if refused:
        with pytest.raises(NotConverged, match=r"'wetter': it loses stability at 0\.40") as told:
            Plain(problem, "start")
        assert "by stages" in told.value.remedy
    else:
        assert Plain(problem, "start").history == [(0, 1.0, 0.0)]


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


@pytest.fixture
def direct(monkeypatch):
    """A direct search whose runs spend what is told and whose stages rise as told."""
    told = SimpleNamespace(spends=[], stages=[], log=[], stage=0.5)

    def run(search):
        told.log.append(("run", search.stage))
        search.evaluator.evaluations += told.spends.pop(0)

    def raised(search):
        told.log.append("raised")
        search.stage = told.stages.pop(0)

    def begun(*given):
        evaluator = SimpleNamespace(evaluations=0)
        return SimpleNamespace(
            evaluator=evaluator, stage=told.stage, left=lambda: given[3] - evaluator.evaluations
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


def test_runs_follow_stage_by_stage_until_the_whole_load_the_evaluations_end_or_none_is_spent(direct):
    direct.spends, direct.stages = [8, 8, 5, 9], [0.7, 1.0]
    assert direct.ends(40, resume="there") == 21
    assert direct.log == [("resume", "there"), ("run", 0.5), "raised", ("run", 0.7), "raised", ("run", 1.0)]
    direct.log.clear()
    direct.spends, direct.stages = [8, 0, 5], [0.7]
    assert direct.ends(40) == 8
    assert direct.log == [("run", 0.5), "raised", ("run", 0.7)]
    direct.spends, direct.stages = [8, 8, 5], [0.7, 0.8]
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

        def begin(self):
            return {
                name: SimpleNamespace(
                    on_branch=on_branch or name != "wetter", equilibrium=SimpleNamespace(state=name)
                )
                for name in ("wet", "wetter")
            }

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
    search = moving_asymptotes._begun(problem, "start", sf.MovingAsymptotes(), 40, None, None)
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
