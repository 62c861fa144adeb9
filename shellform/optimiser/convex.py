"""Convex problems with few constraints: the door to NLopt's method of moving asymptotes (Svanberg 1987,
2002).

Its dual has a variable for each constraint and is solved anew at every iteration: with some sixty constraints
it takes minutes or never ends. Those go to quadratic.py. With few it ends within a hundred evaluations, or
hardly ever.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from shellform.arrays import Reals
from shellform.errors import InputError
from shellform.work_clock import Work, counts_as

try:
    import nlopt
except ImportError as error:  # pragma: no cover
    raise InputError("NLopt can't be loaded", remedy=f"Reinstall it: pip install nlopt ({error})") from error


@counts_as(Work.CONVEX)
def minimise(
    evaluate: Callable[[Reals], tuple[float, Reals, Reals, Reals]],
    start: Reals,
    lower: Reals,
    upper: Reals,
    *,
    constraints: int,
    evaluations: int,
    tolerance: float = 1e-4,
    caution: float = 1.0,
    dual_evaluations: int | None = None,
) -> tuple[Reals, str]:
    """NLopt's MMA from `start` (s,) within bounds: the best point and the reason for the stop.

    `evaluate(x)` returns the objective, its gradient (s,), the `constraints` values g <= 0 and their
    gradients (k, s). `caution`: the curvature with which its approximations begin (rho in Svanberg 2002),
    over NLopt's own. `dual_evaluations`: of one dual problem, after which its best point so far is taken, in
    place of NLopt's own 100,000.
    """
    if ((start < lower) | (start > upper)).any():
        raise InputError(
            "the start lies outside the bounds",
            where="variables",
            value=int(np.argmax((start < lower) | (start > upper))),
            remedy="Start from a design within the variables' bounds, or widen them.",
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
    if caution != 1.0:
        optimizer.set_param("rho_init", caution)
    if dual_evaluations is not None:
        optimizer.set_param("dual_maxeval", dual_evaluations)
    best = np.array(optimizer.optimize(start))
    return best, _REASONS.get(optimizer.last_optimize_result(), "stopped")


_REASONS = {
    nlopt.SUCCESS: "converged",
    nlopt.FTOL_REACHED: "the objective stopped improving",
    nlopt.XTOL_REACHED: "the design stopped changing",
    nlopt.MAXEVAL_REACHED: "the number of evaluations was reached",
}
