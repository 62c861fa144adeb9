"""Svanberg's test problems through the door to NLopt's MMA.

[1987] K. Svanberg, The method of moving asymptotes, Int. J. Numer. Methods Eng. 24, 359-373: a cantilever of
five boxes, a truss of two bars. [2002] K. Svanberg, A class of globally convergent optimization methods based
on conservative convex separable approximations, SIAM J. Optim. 12, 555-573, section 7: two problems with
matrices S, P, Q of any size.

NLopt's MMA is the method of 2002, so that the iterates of 1987 are not its own. The optima of 2002 were not
to be had in print; a minimum of SciPy's SLSQP and the conditions of Karush, Kuhn and Tucker stand in for
them.
"""

import numpy as np
import pytest
from scipy.optimize import minimize, nnls

from shellform.optimiser.convex import minimise

SHARE = np.array([61.0, 37.0, 19.0, 7.0, 1.0])


def cantilever(x):
    return (
        0.0624 * x.sum(),
        np.full(5, 0.0624),
        np.array([(SHARE / x**3).sum() - 1.0]),
        (-3.0 * SHARE / x**4)[None],
    )


def test_the_cantilever_of_1987_has_its_optimum_in_closed_form():
    """Minimise C sum(x) subject to sum(c/x³) <= 1: with the multiplier eliminated x = c^¼ (sum c^¼)^⅓ and f =
    C (sum c^¼)^(4/3), which [1987] prints as x = (6.016, 5.309, 4.494, 3.502, 2.153), f = 1.340 (the fourth
    is 3.5015)."""
    root = SHARE**0.25
    wanted = root * np.cbrt(root.sum())
    np.testing.assert_allclose(wanted, [6.016, 5.309, 4.494, 3.502, 2.153], atol=6e-4)
    least = 0.0624 * root.sum() ** (4.0 / 3.0)
    assert least == pytest.approx(1.3399564, abs=5e-8)
    best, _ = minimise(
        cantilever,
        np.full(5, 5.0),
        np.full(5, 1.0),
        np.full(5, 10.0),
        constraints=1,
        evaluations=500,
        tolerance=1e-10,
    )
    # The limit is met to 2e-7, with a multiplier of f/3; f is flat along it, so that x is as good as the root
    # of f's error.
    assert cantilever(best)[0] == pytest.approx(least, rel=1e-7)
    np.testing.assert_allclose(best, wanted, rtol=2e-4)


def matrices(n):
    """S, P, Q of [2002]."""
    i, j = np.meshgrid(np.arange(1, n + 1), np.arange(1, n + 1), indexing="ij")
    share = (i + j - 2) / (2 * n - 2)
    size = (1 + np.abs(i - j)) * np.log(n)
    return (2.0 + np.sin(4.0 * np.pi * share)) / size, (1.0 + 2.0 * share) / size, (3.0 - 2.0 * share) / size


def convex_objective(n):
    """Minimise x'Sx over -1 <= x <= 1 with x'Px >= n/2, x'Qx >= n/2: limits that aren't convex. Starts at
    0.5.
    """
    s, p, q = matrices(n)

    def evaluate(x):
        return (
            x @ s @ x,
            2.0 * s @ x,
            np.array([n / 2 - x @ p @ x, n / 2 - x @ q @ x]),
            np.array([-2.0 * p @ x, -2.0 * q @ x]),
        )

    return evaluate, np.full(n, 0.5)


def concave_objective(n):
    """Minimise -x'Sx over -1 <= x <= 1 with x'Px <= n/2, x'Qx <= n/2. Starts at 0.25."""
    s, p, q = matrices(n)

    def evaluate(x):
        return (
            -(x @ s @ x),
            -2.0 * s @ x,
            np.array([x @ p @ x - n / 2, x @ q @ x - n / 2]),
            np.array([2.0 * p @ x, 2.0 * q @ x]),
        )

    return evaluate, np.full(n, 0.25)


@pytest.mark.parametrize("problem", [convex_objective, concave_objective])
def test_the_problems_of_2002_end_where_no_direction_improves_and_no_other_method_finds_less(problem):
    n = 100
    evaluate, start = problem(n)
    best, reason = minimise(
        evaluate, start, -np.ones(n), np.ones(n), constraints=2, evaluations=1000, tolerance=1e-8
    )
    value, slope, limits, slopes = evaluate(best)
    assert reason == "the objective stopped improving"
    assert limits.max() < 1e-6 * n  # NLopt solves the dual of each subproblem to about that
    # -slope must be a combination, none negative, of the active limits' slopes and of the bounds that are
    # reached.
    active = [slopes[k] for k in range(2) if limits[k] > -1e-6 * n] + [
        sign * np.eye(n)[k] for sign in (-1.0, 1.0) for k in np.flatnonzero(sign * best > 1.0 - 1e-9)
    ]
    _, left = nnls(np.array(active).T, -slope)
    assert left < 5e-4 * np.linalg.norm(slope)
    other = minimize(
        lambda x: evaluate(x)[0],
        start,
        jac=lambda x: evaluate(x)[1],
        bounds=[(-1.0, 1.0)] * n,
        constraints={"type": "ineq", "fun": lambda x: -evaluate(x)[2], "jac": lambda x: -evaluate(x)[3]},
        method="SLSQP",
        options={"maxiter": 500, "ftol": 1e-12},
    )
    assert evaluate(other.x)[2].max() < 1e-8
    assert value == pytest.approx(other.fun, rel=1e-6)  # 24.89595 and -75.10404 at n = 100
