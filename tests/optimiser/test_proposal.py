"""The convex problem of a step comes to its optimum, in windows however wide."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import minimize

from shellform.optimiser import proposal
from shellform.optimiser.optimise import begin
from shellform.optimiser.proposal import propose
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
