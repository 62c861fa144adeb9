"""Convex problems: the door to NLopt's method of moving asymptotes (Svanberg 1987, 2002), and quadratic ones
with many constraints.

MMA's dual has a variable for each constraint and is solved anew at every iteration; with some sixty
constraints that took minutes or never ended. Quadratic problems with that many go to CVXOPT's interior-point
method, which solves them to rounding in a tenth of a second.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from cvxopt import matrix, solvers
from scipy.linalg import cho_factor, cho_solve

from shellform.arrays import Reals
from shellform.errors import InputError

try:
    import nlopt
except ImportError as error:  # pragma: no cover
    raise InputError("NLopt can't be loaded", remedy=f"Reinstall it: pip install nlopt ({error})") from error


def minimise(
    evaluate: Callable[[Reals], tuple[float, Reals, Reals, Reals]],
    start: Reals,
    lower: Reals,
    upper: Reals,
    *,
    constraints: int,
    evaluations: int,
    tolerance: float = 1e-4,
) -> tuple[Reals, str]:
    """NLopt's MMA from `start` (s,) within bounds: the best point and the reason for the stop.

    `evaluate(x)` returns the objective, its gradient (s,), the `constraints` values g <= 0 and their
    gradients (k, s).
    """
    if ((start < lower) | (start > upper)).any():
        raise InputError(
            "the start lies outside the bounds",
            where="variables",
            value=int(np.argmax((start < lower) | (start > upper))),
        )
    memory: dict[bytes, tuple[float, Reals, Reals, Reals]] = {}

    def at(x: Reals) -> tuple[float, Reals, Reals, Reals]:
        key = x.tobytes()
        if key not in memory:
            memory.clear()  # NLopt asks for objective and constraints at one x, one after the other
            memory[key] = evaluate(np.array(x))
        return memory[key]

    def objective(x: Reals, gradient: Reals) -> float:
        value, slope, _, _ = at(x)
        if gradient.size:
            gradient[:] = slope
        return value

    def limits(result: Reals, x: Reals, gradient: Reals) -> None:
        _, _, values, slopes = at(x)
        result[:] = values
        if gradient.size:
            gradient[:] = slopes

    optimizer = nlopt.opt(nlopt.LD_MMA, len(start))
    optimizer.set_min_objective(objective)
    if constraints:
        optimizer.add_inequality_mconstraint(limits, np.full(constraints, 1e-8))
    optimizer.set_lower_bounds(lower)
    optimizer.set_upper_bounds(upper)
    optimizer.set_maxeval(evaluations)
    optimizer.set_ftol_rel(tolerance)
    best = np.array(optimizer.optimize(start))
    return best, _REASONS.get(optimizer.last_optimize_result(), "stopped")


def minimise_quadratic(
    hessian: Reals, slope: Reals, rows: Reals, values: Reals, lower: Reals, upper: Reals
) -> Reals | None:
    """The u (s,) with the least slope'u + u'hessian u / 2 where values + rows u <= 0 and lower <= u <= upper;
    None where nothing meets them all. `hessian` (s, s) is positive semidefinite.
    """
    size = len(slope)
    mean = float(np.diag(hessian).mean())
    curved = hessian + _REGULAR * max(mean, 1e-300) * np.eye(size)

    def limits(x: Reals) -> Reals:
        return np.concatenate([x, -x, rows @ x])

    def pulls(z: Reals) -> Reals:
        return np.asarray(z[:size] - z[size : 2 * size] + rows.T @ z[2 * size :])

    def products(of: Callable[[Reals], Reals]) -> Callable[..., None]:
        def into(x: Any, y: Any, alpha: float = 1.0, beta: float = 0.0, trans: str = "N") -> None:
            y[:] = matrix(alpha * of(np.array(x).ravel()) + beta * np.array(y).ravel())

        return into

    def constrained(x: Any, y: Any, alpha: float = 1.0, beta: float = 0.0, trans: str = "N") -> None:
        products(limits if trans == "N" else pulls)(x, y, alpha, beta)

    def kkt(scaling: Any) -> Callable[[Any, Any, Any], None]:
        """Solves [P G'; G -D²] (x, z) = (bx, bz) by x alone: (P + G' D⁻² G) x = bx + G' D⁻² bz."""
        d = np.array(scaling["d"]).ravel()
        weight = d**-2
        whole = curved + (rows.T * weight[2 * size :]) @ rows
        whole[np.diag_indices(size)] += weight[:size] + weight[size : 2 * size]
        factor = cho_factor(whole, check_finite=False)

        def solve(x: Any, y: Any, z: Any) -> None:
            right = np.array(z).ravel()
            found = cho_solve(factor, np.array(x).ravel() + pulls(weight * right), check_finite=False)
            x[:] = matrix(found)
            z[:] = matrix((limits(found) - right) / d)

        return solve

    right = np.concatenate([upper, -lower, -values])
    dims = {"l": len(right), "q": [], "s": []}
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            answer = solvers.coneqp(
                products(lambda x: np.asarray(curved @ x)),
                matrix(slope),
                constrained,
                matrix(right),
                dims,
                matrix(0.0, (0, size)),
                matrix(0.0, (0, 1)),
                kktsolver=kkt,
                options={"show_progress": False},
            )
    except (
        ValueError,
        ArithmeticError,
        np.linalg.LinAlgError,
    ):  # so CVXOPT ends on some problems without a solution
        return None
    if answer["status"] != "optimal":
        return None
    return np.clip(np.array(answer["x"]).ravel(), lower, upper)


_REGULAR = 1e-8  # of the mean curvature, where the model has none
_REASONS = {
    nlopt.SUCCESS: "converged",
    nlopt.FTOL_REACHED: "the objective stopped improving",
    nlopt.XTOL_REACHED: "the design stopped changing",
    nlopt.MAXEVAL_REACHED: "the number of evaluations was reached",
}
