"""Cables kept taut: their linear model and the quadratic problem in which they stand."""

import numpy as np
import pytest

import shellform as sf
from shellform.optimiser.guards import whole_guard
from shellform.optimiser.quadratic import minimise_quadratic
from shellform.problem.evaluation import Evaluator
from tests.problems import misfit_and_force


@pytest.fixture(scope="module")
def shell(dome):
    """A small one."""
    return dome


@pytest.fixture(scope="module")
def start(shell):
    problem = misfit_and_force(shell, 2.0)
    evaluator = Evaluator(problem, shell.design())
    states = {name: each.equilibrium.state for name, each in evaluator.begin().items()}
    return evaluator, evaluator.seed(shell.design(), states, 1.0)


def changed(evaluator, point, size):
    rng = np.random.default_rng(3)
    return evaluator.blocks.design(
        point.variables + size * rng.normal(size=len(point.variables)), point.design.present
    )


def test_a_guard_predicts_tensions_under_the_additional_load_to_second_order(shell, start):
    evaluator, point = start
    cables = shell.cables(point.design)
    tension = cables.tension(point.states["wetter"])
    reach = float(np.median(tension))
    held = whole_guard(evaluator.assembly(point.design), point.states["wetter"], cables, reach)
    near = (tension > 0.0) & (tension < reach)
    np.testing.assert_array_equal(held.tension, tension[near])
    errors = []
    for size in (4e-5, 2e-5):
        design = changed(evaluator, point, size)
        moved = evaluator.evaluate(design, point.states, 1.0)
        found = shell.cables(design).tension(moved.states["wetter"])[near]
        told = held.tension + held.tension_by_design @ (design.rest_length - point.design.rest_length)
        errors.append(np.linalg.norm((found - told)[(found > 0) & (told > 0)]))
    assert 1.7 < np.log2(errors[0] / errors[1]) < 2.3


def test_predicted_states_are_near_to_second_order(shell, start):
    evaluator, point = start
    errors = []
    for size in (4e-5, 2e-5):
        design = changed(evaluator, point, size)
        found = evaluator.evaluate(design, point.states, 1.0).states
        told = evaluator.predicted(point, design)
        errors.append(max(np.abs(found[name].positions - told[name].positions).max() for name in found))
    assert 1.7 < np.log2(errors[0] / errors[1]) < 2.3


def test_polishing_lowers_the_misfit_with_the_same_cables_none_of_which_goes_slack(shell, start):
    evaluator, _ = start
    best = sf.optimise(evaluator.problem, shell.design(), evaluations=12)
    polished = sf.polish(best, evaluations=6)
    assert polished.objective < 0.9
    np.testing.assert_array_equal(polished.design.present, best.design.present)
    cables = shell.cables(polished.design)
    before = shell.cables(best.design).tension(best.states["wetter"]) > 0.0
    assert (cables.tension(polished.states["wetter"])[before] > 0.0).mean() > 0.97


def test_constraints_that_contradict_each_other_have_no_solution():
    one = np.ones((1, 1))
    assert (
        minimise_quadratic(one, np.zeros(1), np.array([[1.0], [-1.0]]), np.array([0.5, 0.5]), -one[0], one[0])
        is None
    )


def test_a_quadratic_problem_is_solved_to_its_conditions_of_optimality():
    rng = np.random.default_rng(0)
    root = rng.normal(size=(30, 20))
    hessian, slope = root.T @ root, rng.normal(size=20)
    rows, values = rng.normal(size=(60, 20)), -0.05 * np.ones(60)
    u = minimise_quadratic(hessian, slope, rows, values, -np.ones(20), np.ones(20))
    limits = values + rows @ u
    assert limits.max() < 1e-9
    active = rows[limits > -1e-7]
    assert len(active)
    force, *_ = np.linalg.lstsq(active.T, -(hessian @ u + slope), rcond=None)
    assert (np.abs(u) < 1.0).all()
    np.testing.assert_allclose(active.T @ force, -(hessian @ u + slope), atol=1e-6)
    assert force.min() > 0.0


def test_a_start_that_snaps_through_under_the_additional_load_is_led_to_a_design_that_bears_it(shell):
    problem = misfit_and_force(shell, 5.4)
    start = sf.follow(shell, shell.design(), problem.loads, stay=True)
    assert start["wet"].on_branch
    assert not start["wetter"].on_branch
    best = sf.optimise(problem, shell.design(), solver=sf.SequentialConvex(thin=False), evaluations=30)
    assert best.history[0].stage < 1.0
    assert all(each.on_branch and each.equilibrium.stable for each in best.loaded.values())
    assert max(best.constraints.values()) <= sf.FEASIBLE
    assert best.objective < 0.6
