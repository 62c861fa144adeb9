"""The convex problem of a step comes to its optimum, in windows however wide."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import minimize

from shellform.optimiser import proposal
from shellform.optimiser.guards import WholeGuard
from shellform.optimiser.optimise import begin
from shellform.optimiser.proposal import propose
from shellform.optimiser.quadratic import LowRank, minimise_quadratic
from shellform.optimiser.solver import SequentialConvex
from shellform.optimiser.trials import task
from tests.problems import misfit_and_force

WIDE = 5.0  # mean tensions


@pytest.fixture(scope="module")
def searching(dome):
    problem = misfit_and_force(dome, 2.0, most=200.0, rms=None)
    return begin(problem, dome.design(), SequentialConvex(window=WIDE), lambda softest: 0.0, 10)


def asked(monkeypatch, searching):
    """What a step's problem is, and the proposed step with the change of the objective that it predicts."""
    told = []
    from_there = proposal._from_there

    def noted(evaluate, start, low, high, evaluations):
        told.append((evaluate, start, low, high))
        return from_there(evaluate, start, low, high, evaluations)

    monkeypatch.setattr(proposal, "_from_there", noted)
    search, it = searching
    found = propose(task(search, it, search.models.at(it.point)))
    return told[0], found


def test_a_wide_window_s_problem_is_solved_to_its_optimum(monkeypatch, searching):
    (evaluate, start, low, high), (_, predicted) = asked(monkeypatch, searching)
    other = minimize(
        lambda u: evaluate(u)[:2],
        np.zeros(len(start)),
        jac=True,
        method="L-BFGS-B",
        bounds=np.column_stack([low, high]),
        options={"maxiter": 20_000, "maxfun": 40_000, "ftol": 1e-15, "gtol": 1e-12},
    )
    assert (evaluate(other.x)[2] <= 0.0).all()  # no constraint holds it back, as no bound on it says
    assert predicted <= other.fun + 1e-6
    count = len(evaluate(start)[2])
    middle, _ = proposal.minimise(
        evaluate, np.zeros(len(start)), low, high, constraints=count, evaluations=2000, tolerance=1e-9
    )
    assert evaluate(middle)[0] > 0.95 * predicted  # which MMA alone doesn't come to


def test_mma_s_answer_counts_only_where_it_is_lower_and_keeps_the_constraints(monkeypatch, searching):
    (evaluate, start, low, high), _ = asked(monkeypatch, searching)
    worse = np.clip(start + 0.01, low, high)
    assert evaluate(worse)[0] > evaluate(start)[0]
    monkeypatch.setattr(proposal, "minimise", lambda *_, **__: (worse, "told"))
    np.testing.assert_array_equal(proposal._from_there(evaluate, start, low, high, 10), start)

    def one(u):
        return float(u[0]), np.array([1.0]), np.array([0.5 - u[0]]), np.array([[-1.0]])

    here, bounds = np.array([0.8]), (np.zeros(1), np.ones(1))
    for there, kept in ((0.5, True), (0.4, False), (0.9, False)):
        monkeypatch.setattr(proposal, "minimise", lambda *_, u=there, **__: (np.array([u]), "told"))
        assert proposal._from_there(one, here, *bounds, 10)[0] == (there if kept else 0.8)

    def two(u):
        return float(u[0]), np.array([1.0]), np.array([0.5 - u[0], -1.0]), np.array([[-1.0], [0.0]])

    monkeypatch.setattr(proposal, "minimise", lambda *_, **__: (np.array([0.4]), "told"))
    assert proposal._from_there(two, here, *bounds, 10)[0] == 0.8, "each of them"


def test_a_dual_problem_is_left_after_the_evaluations_that_it_may_take():
    rows = np.array([[1.0, 2.0, 0.5], [-3.0, 1.0, 1.0]])

    def evaluate(u):
        return float(u @ u - u.sum()), 2.0 * u - 1.0, rows @ u - 0.3, rows

    def broken(**given):
        asked = {"constraints": 2, "evaluations": 1 + 1, "tolerance": 1e-9, **given}
        found, _ = proposal.minimise(evaluate, np.zeros(3), -np.ones(3), np.ones(3), **asked)
        return found

    np.testing.assert_array_equal(broken(dual_evaluations=100_000), broken())
    np.testing.assert_array_equal(broken(dual_evaluations=100), broken())
    assert np.abs(broken(dual_evaluations=2) - broken()).max() > 1e-3


def test_a_step_meets_an_aim_as_far_as_that_is_worth_its_price_where_trials_are_judged_by_it(dome):
    problem = misfit_and_force(dome, 2.0, most=200.0, rms=1e-4)
    search, it = begin(problem, dome.design(), SequentialConvex(window=0.05), lambda softest: 0.0, 10)
    model = search.models.at(it.point)
    missed = it.point.constraints
    assert len(missed) == 1  # taken for an aim
    assert missed[0] > 0.1

    def step(aims, price):
        solver = replace(search.solver, aim=price)
        y, predicted = propose(replace(task(search, it, model), aims=aims, solver=solver))
        return predicted, float(model.constraints_at(y)[0] - missed[0])

    free, rising = step(1, 1e-9)
    dear, falling = step(1, 1e3)
    assert free < dear  # of the objective, which alone decides where missing an aim costs nothing
    assert falling < min(rising, 0.0)
    for price in (0.03, 0.3):  # the sum by which trials are judged is the least at its own price
        predicted, change = step(1, price)
        for other, of_other in ((free, rising), (dear, falling)):
            worth = search.solver.penalty * price
            assert predicted + worth * change <= other + worth * of_other + 1e-9


def test_a_dead_cable_s_slope_is_that_of_its_tension_under_the_design_load():
    """Terms at other loads say nothing of it, and a live cable keeps the slope by its rest length."""

    def summand(load, *by_tension):
        part = SimpleNamespace(term=SimpleNamespace(load=load))
        return part, SimpleNamespace(by_tension=np.array([by_tension]))

    parts, measured = zip(summand("wet", 3.0, 5.0, 7.0), summand("wetter", 11.0, 13.0, 17.0), strict=True)
    model = SimpleNamespace(
        tensions=2,
        origin=np.array([1.0, 0.0, 0.0]),
        evaluator=SimpleNamespace(
            base="wet", weights=np.array([2.0, 4.0]), problem=SimpleNamespace(minimise=parts)
        ),
        point=SimpleNamespace(
            design=SimpleNamespace(present=np.array([True, False, True])), summands=measured
        ),
        quadratics=(None, None),
    )
    slope = proposal._exact_in_tension(np.array([0.1, 0.2, 0.3]), model)
    assert slope.tolist() == [0.1, 2.0 * 7.0, 0.3]
    model.quadratics = (SimpleNamespace(slope=np.array([9.0, -4.0, 9.0])), None)
    slope = proposal._exact_in_tension(np.array([0.1, 0.2, 0.3]), model)
    assert slope.tolist() == [0.1, 2.0 * -4.0, 0.3], "that of a sum of squares is the model's"
    model.origin = np.array([1.0, 0.1, 0.0])
    assert proposal._exact_in_tension(np.array([0.1, 0.2, 0.3]), model).tolist() == [0.1, 0.2, 0.3]


def model_of(**changes):
    """Of two tensions and a radius, to which its parameters answer by A = [[1, 2, 0], [0, -1, 3]]."""
    answers = SimpleNamespace(
        by_parameters=lambda rows: rows @ np.array([[1.0, 2.0, 0.0], [0.0, -1.0, 3.0]]),
        parameters_changed=lambda change: np.array([[1.0, 2.0, 0.0], [0.0, -1.0, 3.0]]) @ change,
        by_variables=lambda rows: 10.0 * rows,
    )
    given = {
        "tensions": 2,
        "origin": np.array([2.0, 0.5, 0.1]),
        "lower": np.array([0.0, 0.0, 0.05]),
        "upper": np.array([9.0, 6.0, 0.2]),
        "step": np.array([0.04]),
        "answers": answers,
        "evaluator": SimpleNamespace(problem=SimpleNamespace(constraints=[], loads={}, places=list)),
    }
    return SimpleNamespace(**{**given, **changes})


def task_of(**changes):
    given = {
        "solver": SequentialConvex(),
        "model": model_of(),
        "window": 0.5,
        "tension": 2.0,
        "bounded": (),
        "tensioned": np.array([True, False]),
        "guards": [],
        "climbing": False,
        "groups": None,
        "excess": np.zeros(1),
        "least": 0.3,
        "aims": 0,
        "reviving": True,
        "lifting": True,
    }
    return SimpleNamespace(**{**given, **changes})


def test_tensions_are_bounded_by_the_least_that_cables_keep_and_the_most_that_each_limit_lets_them_have():
    limits = [SimpleNamespace(upper=7.0), SimpleNamespace(upper=8.0)]
    lower, upper = proposal._box(task_of(bounded=limits))
    assert (lower.tolist(), upper.tolist()) == ([0.3, 0.0, 0.05], [7.0, 6.0, 0.2])
    lower, upper = proposal._box(task_of())
    assert upper.tolist() == [9.0, 6.0, 0.2]
    assert proposal._box(task_of(reviving=False))[1].tolist() == [9.0, 0.0, 0.2]
    both = np.array([True, True])
    assert proposal._box(task_of(tensioned=both, least=0.7))[0].tolist() == [0.7, 0.7, 0.05]
    kept = proposal._box(task_of(tensioned=both, least=0.7, lifting=False))
    assert kept[0].tolist() == [0.7, 0.5, 0.05], "what is below it keeps what it has"
    none = model_of(tensions=0)
    assert proposal._box(task_of(model=none))[0].tolist() == [0.0, 0.0, 0.05]
    assert none.lower.tolist() == [0.0, 0.0, 0.05], "the model's own stay"


GUARD = WholeGuard(np.array([0.25, 0.9, 4.0]), np.array([[1.0, 0.0], [1.0, 2.0], [0.5, 0.0]]))
WIDTH = np.array([0.5, 0.5, 0.01])


def test_a_guarded_cable_s_fall_is_told_in_what_a_whole_window_can_change_of_its_tension():
    """Of the first 1.5 N and of the second 0.5 + 0 + 0.06: below its 0.3 N it regains 0.05 N, no more than a
    tenth."""
    falls, scale, asked = proposal._falls(task_of(), GUARD, np.array([0, 1]), WIDTH)
    assert falls == pytest.approx(-np.array([[0.5, 1.0, 0.0], [0.5, 0.0, 0.06]]))
    assert scale == pytest.approx([1.5, 0.56])
    assert asked == pytest.approx([0.05 / 1.5, -0.6 / 0.56])
    assert proposal._falls(task_of(least=1.0), GUARD, np.array([0]), WIDTH)[2].tolist() == [0.1]
    assert proposal._falls(task_of(least=1.0, lifting=False), GUARD, np.array([0]), WIDTH)[2].tolist() == [
        0.0
    ]


def test_the_nearest_cables_are_guarded_that_a_step_could_let_go_slack():
    """The second could fall by 0.56 N to 0.34, not to 0.3; with 0.35 N it is guarded, too, and the third
    never."""
    rows, values = proposal._guarding(task_of(guards=[GUARD]), WIDTH)
    assert rows == pytest.approx(-np.array([[0.5, 1.0, 0.0]]) / 1.5)
    assert values == pytest.approx([0.05 / 1.5])
    task = task_of(guards=[GUARD, GUARD], least=0.35)
    rows, values = proposal._guarding(task, WIDTH)
    assert values == pytest.approx([0.1 / 1.5, -0.55 / 0.56] * 2)
    assert rows[1] == pytest.approx(-np.array([0.5, 0.0, 0.06]) / 0.56)
    task.solver = SequentialConvex(guards=1)
    assert proposal._guarding(task, WIDTH)[1] == pytest.approx([0.1 / 1.5] * 2)
    rows, values = proposal._guarding(task_of(), WIDTH)
    assert (rows.shape, values.shape) == ((0, 3), (0,))


def test_cables_join_the_guarded_ones_that_a_step_lets_fall_the_farthest_first():
    """The least may be missed by a thousandth."""
    held = SimpleNamespace(
        tension=np.array([1.0, 1.0, 1.0, 1.0, 1.0]),
        changed=lambda change: np.array([-0.9, -0.7, -0.8, -0.7004, -0.7002]),
    )
    none = np.zeros(0, dtype=np.int64)
    assert proposal._let_fall(task_of(), held, none, None).tolist() == [0, 2, 3]
    assert proposal._let_fall(task_of(), held, np.array([0]), None).tolist() == [2, 3]
    few = task_of(solver=SequentialConvex(guards=2))
    assert proposal._let_fall(few, held, none, None).tolist() == [0, 2]
    assert proposal._let_fall(few, held, np.array([4]), None).tolist() == [0]


def test_steps_are_solved_for_with_more_guarded_cables_until_none_falls():
    """The first step takes the first cable to nothing; the second one leaves it."""
    steps, asked = [np.array([-0.5, 0.0, 0.0]), np.array([0.1, 0.0, 0.0])], []

    def solved(rows, values):
        asked.append((rows, values))
        return steps[len(asked) - 1]

    u = proposal._guarded_in_turn(task_of(guards=[GUARD]), WIDTH, solved)
    assert u is steps[1]
    assert asked[0][0].shape == (0, 3)
    assert asked[1][0] == pytest.approx(-np.array([[0.5, 1.0, 0.0]]) / 1.5)
    assert asked[1][1] == pytest.approx([0.05 / 1.5])
    asked.clear()
    high = WholeGuard(np.array([9.0]), np.array([[1.0, 0.0]]))
    assert proposal._guarded_in_turn(task_of(guards=[high, GUARD]), WIDTH, solved) is steps[1]
    assert len(asked) == 2, "under one of two loads is enough"


def test_curvatures_are_summed_by_their_weights_in_windows():
    def model(*hessians):
        quadratics = [None if each is None else SimpleNamespace(hessian=each) for each in hessians]
        return SimpleNamespace(
            evaluator=SimpleNamespace(weights=np.array([2.0, 4.0, 5.0])[: len(hessians)]),
            quadratics=quadratics,
        )

    one, other = np.array([[1.0, 2.0], [2.0, 5.0]]), np.array([[3.0, 0.0], [0.0, 1.0]])
    width = np.array([0.5, 0.1])
    found = proposal._curvature(model(one, None, other), width)
    assert found == pytest.approx((2.0 * one + 5.0 * other) * np.outer(width, width))
    few = LowRank(np.array([[1.0], [3.0]])), LowRank(np.array([[0.5], [-1.0]]))
    found = proposal._curvature(model(*few), width)
    u = np.array([7.0, -2.0])
    whole = 2.0 * few[0].columns @ few[0].columns.T + 4.0 * few[1].columns @ few[1].columns.T
    assert found @ u == pytest.approx((whole * np.outer(width, width)) @ u)
    assert (proposal._curvature(model(None), width) @ u).tolist() == [0.0, 0.0]


def test_a_climb_goes_along_each_constraint_on_stability_by_its_own_size():
    parts = [SimpleNamespace(term=SimpleNamespace(stabilises=each)) for each in (True, False, True)]
    rows = np.array([[3.0, 4.0], [9.0, 9.0], [0.0, -0.2], [5.0, 12.0]])
    problem = SimpleNamespace(constraints=parts, places=lambda: [slice(0, 1), slice(1, 2), slice(2, 4)])
    model = model_of(
        evaluator=SimpleNamespace(problem=problem), point=SimpleNamespace(constraints_by_variables=rows)
    )
    found = proposal._slope(task_of(model=model, climbing=True))
    assert found == pytest.approx(10.0 * np.array([0.6 + 5.0 / 13.0, 0.8 - 1.0 + 12.0 / 13.0]))


def test_aims_that_are_missed_have_a_price_and_limits_that_are_broken_do_not():
    values = np.array([0.5, -0.1, 0.2])
    assert proposal._at_their_price(task_of(aims=1), values)
    assert not proposal._at_their_price(task_of(aims=0), values)
    assert not proposal._at_their_price(task_of(aims=1), np.array([0.5, 0.2, 0.0]))
    assert proposal._at_their_price(task_of(aims=2), np.array([0.5, 0.2, -0.1]))


def test_a_step_is_bounded_by_its_window_in_tensions_and_by_its_share_of_other_steps(monkeypatch):
    """Of half a newton where the start's mean is 2 N, so that the radius goes a quarter of its step; a cable
    below its least goes there as far as the window lets it, and one whose tension is next to nothing has
    none."""
    seen = []

    def quadratic(curvature, slope, rows, values, low, high):
        seen.append((curvature, slope, rows, values, low, high))
        return np.array([0.5, -0.999, 1.0])

    monkeypatch.setattr(proposal, "minimise_quadratic", quadratic)
    problems = []

    def from_there(evaluate, u, low, high, evaluations):
        problems.append(evaluate(np.array([1.0, -2.0, 0.5])))
        return u

    monkeypatch.setattr(proposal, "_from_there", from_there)
    monkeypatch.setattr(proposal, "_slope", lambda task: np.array([2.0, 3.0, 100.0]))
    monkeypatch.setattr(proposal, "_curvature", lambda model, width: np.diag([8.0, 2.0, 4.0]))
    model = model_of(
        point=SimpleNamespace(constraints=np.array([-0.4])), constraints_by_y=np.array([[1.0, -2.0, 5.0]])
    )
    task = task_of(model=model, excess=np.array([0.15]))
    y, predicted = proposal._optimum(task)
    curvature, slope, rows, values, low, high = seen[0]
    assert slope == pytest.approx([1.0, 1.5, 1.0])
    assert rows == pytest.approx(np.array([[0.5, -1.0, 0.05]]))
    assert values == pytest.approx([-0.25])
    assert low == pytest.approx([-1.0, -1.0, -1.0])
    assert high == pytest.approx([1.0, 1.0, 1.0])
    assert y == pytest.approx([2.25, 0.0, 0.11]), "0.0005 N is less than a thousandth of 2 N"
    value, steeper, left, told = problems[0]
    assert value == pytest.approx(1.0 - 3.0 + 0.5 + 0.5 * (8.0 + 8.0 + 1.0))
    assert steeper == pytest.approx([1.0 + 8.0, 1.5 - 4.0, 1.0 + 2.0])
    assert left == pytest.approx([-0.25 + 0.5 + 2.0 + 0.025])
    assert told is rows or told == pytest.approx(rows)
    u = np.array([0.5, -0.999, 1.0])
    assert predicted == pytest.approx(slope @ u + 0.5 * u @ curvature @ u)
    proposal._optimum(task_of(model=model, window=6.0))
    low, high = seen[1][4:]
    assert low == pytest.approx([(0.3 - 2.0) / 6.0, -0.5 / 6.0, -1.0])
    assert high == pytest.approx([1.0, 5.5 / 6.0, 1.0]), "and no more than its whole step"
    model.origin = np.array([-0.4, 0.5, 0.1])
    proposal._optimum(task_of(model=model))
    assert (seen[2][4][0], seen[2][5][0]) == (1.0, 1.0)
    model.origin = np.array([2.0, 0.503, 0.1])
    beyond = []
    monkeypatch.setattr(proposal, "minimise_quadratic", lambda *_: np.array([0.5, -1.0, 1.0]))
    monkeypatch.setattr(proposal, "_from_there", lambda evaluate, u, *_: beyond.append(u) or u)
    assert proposal._optimum(task_of(model=model))[0][1] == pytest.approx(0.003), "3 mN are some"
    assert len(beyond) == 1
    proposal._optimum(task_of(model=model, guards=[WholeGuard(np.array([9.0]), np.zeros((1, 2)) + 1e-9)]))
    many = model_of(point=SimpleNamespace(constraints=np.full(9, -0.4)), constraints_by_y=np.ones((9, 3)))
    proposal._optimum(task_of(model=many, excess=np.zeros(9)))
    assert len(beyond) == 1, "MMA doesn't go on with guards, nor with more than eight constraints"
    few = model_of(point=SimpleNamespace(constraints=np.full(8, -0.4)), constraints_by_y=np.ones((8, 3)))
    proposal._optimum(task_of(model=few, excess=np.zeros(8)))
    assert len(beyond) == 2
    model.origin = np.array([2.0, 0.5, 0.1])
    monkeypatch.setattr(proposal, "minimise_quadratic", quadratic)
    grouped = task_of(model=model, groups=np.array([0, 1]))
    monkeypatch.setattr(proposal, "_equal_steps", lambda *_: np.array([0.0, -0.999, 0.0]))
    assert proposal._optimum(grouped)[0][1] == pytest.approx(0.0005), "of cables alike none goes alone"


@pytest.mark.parametrize(("near", "asked"), [(-0.9, [1]), (-0.8, [0, 1])])
def test_limits_before_any_load_that_no_step_within_the_window_reaches_are_left_out(monkeypatch, near, asked):
    """A window of 0.5 N and of a quarter of the radius' step changes each by 0.5 + 0.3 + 0.05."""
    seen = []
    monkeypatch.setattr(proposal, "minimise_quadratic", lambda *given: seen.append(given) or np.zeros(3))
    monkeypatch.setattr(proposal, "_from_there", lambda evaluate, u, *_: u)
    monkeypatch.setattr(proposal, "_slope", lambda task: np.zeros(3))
    monkeypatch.setattr(proposal, "_curvature", lambda model, width: np.eye(3))
    loads = {"none": np.zeros((2, 6)), "wet": np.ones((2, 6))}
    limits = [SimpleNamespace(term=SimpleNamespace(load=name)) for name in loads]
    problem = SimpleNamespace(constraints=limits, loads=loads, places=lambda: [slice(0, 1), slice(1, 2)])
    model = model_of(
        point=SimpleNamespace(constraints=np.array([near, near])),
        constraints_by_y=np.array([[1.0, -0.6, 5.0], [1.0, -0.6, 5.0]]),
        evaluator=SimpleNamespace(problem=problem),
    )
    propose(task_of(model=model, excess=np.zeros(2)))
    assert len(seen[0][3]) == len(asked), "under a load each stays"


def test_cables_alike_change_their_lengths_by_the_same():
    """Rest lengths l of three cables answer to tensions by l = y / k; the first and the last are alike."""
    k = np.array([1.0, 2.0, 4.0])
    answers = object.__new__(proposal.WholeAnswers)
    object.__setattr__(answers, "of_rest_lengths", lambda member: k[:, None] * member)
    task = task_of(model=model_of(answers=answers), groups=np.array([0, 1, 0]))
    width = np.array([0.5, 0.5, 0.25])

    none, nothing = np.zeros((0, 3)), np.zeros(0)

    def step(slope, low=-1.0, high=1.0, rows=none, values=nothing):
        return proposal._equal_steps(
            task,
            width,
            proposal.Asked(
                np.diag([1e-6] * 3), np.array(slope), rows, values, np.full(3, low), np.full(3, high)
            ),
        )

    assert step([-1.0, 1.0, 0.0]) == pytest.approx([0.125, -1.0, 1.0], abs=1e-4)
    assert step([-1.0, 1.0, 0.0], low=-0.2, high=0.4) == pytest.approx([0.05, -0.2, 0.4], abs=1e-4)
    held = step([-1.0, 1.0, 0.0], rows=np.array([[0.0, 0.0, 1.0]]), values=np.array([-0.6]))
    assert held == pytest.approx([0.075, -1.0, 0.6], abs=1e-4)
    broken = step([-1.0, 1.0, 0.0], rows=np.array([[0.0, 0.0, 1.0]]), values=np.array([0.3]))
    assert broken == pytest.approx([0.0, -1.0, 0.0], abs=1e-4), "what is broken may stay so"


def test_a_problem_of_few_variables_with_hardly_any_curvature_has_the_answer_of_its_dense_matrix():
    """Of these problems one has no answer by the formula for few columns."""
    rng = np.random.default_rng(1)
    solved = 0
    for _ in range(120):
        size, rank, count = (int(rng.integers(*span)) for span in ((2, 40), (0, 5), (0, 8)))
        columns, slope = rng.normal(size=(size, rank)), rng.normal(size=size)
        rows, values = rng.normal(size=(count, size)), rng.normal(size=count) - 0.5
        rest = slope, rows, values, -rng.random(size), rng.random(size)
        dense, few = (minimise_quadratic(each, *rest) for each in (columns @ columns.T, LowRank(columns)))
        assert (dense is None) == (few is None)
        if dense is not None:
            least = [slope @ u + 0.5 * ((columns.T @ u) ** 2).sum() for u in (dense, few)]
            assert least[1] == pytest.approx(least[0], rel=1e-5, abs=1e-6)
            solved += 1
    assert solved > 60
