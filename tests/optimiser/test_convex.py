"""NLopt's method behind its door: starts beyond bounds, caution, and each point evaluated once."""

import numpy as np
import pytest

from shellform.errors import InputError
from shellform.optimiser import convex


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
