"""Derivatives of a problem's objective and first constraint, held against evaluations on both sides."""

import numpy as np
import pytest

from shellform.problem.evaluation import Evaluator

STEP = 1e-5


def slopes_hold(problem, design, radius):
    """Asserts them along a direction of all rest lengths drawn by chance, and so much of the radius."""
    evaluator = Evaluator(problem, design)
    states = {name: each.equilibrium.state for name, each in evaluator.begin().items()}
    point = evaluator.linearised(evaluator.seed(design, states, 1.0))
    direction = np.append(np.random.default_rng(2).normal(size=len(point.variables) - 1), radius)
    designs = [
        evaluator.blocks.design(point.variables + s * STEP * direction, point.design.present) for s in (1, -1)
    ]
    plus, minus = (evaluator.evaluate(each, states, 1.0) for each in designs)
    slope = (plus.objective - minus.objective) / (2 * STEP)
    assert point.objective_by_variables @ direction == pytest.approx(slope, rel=1e-5)
    slope = (plus.constraints[0] - minus.constraints[0]) / (2 * STEP)
    assert point.constraints_by_variables[0] @ direction == pytest.approx(slope, rel=1e-5)
