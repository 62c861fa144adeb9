"""The same design problem for other optimisers: plain functions of its variables, and SciPy's two for smooth
constrained problems.

What step_model.py does with models in the cables' tensions, SciPy's methods do with values and gradients in
the rest lengths alone, which tells what the models are worth. SLSQP (Kraft 1988) solves a sequence of
quadratic problems, each with a line search; trust-constr is an interior point method in a trust region (Byrd,
Hribar and Nocedal 1999). Both build their curvature from gradients.

A trial design that leaves the stable branch has no objective. Its `value` is infinite, so that a line search
or a trust region takes a shorter step; its constraints and derivatives, which must be finite, are those of
the nearest design on the branch. Trials start from the states of the nearest design known; whether SciPy has
accepted that one isn't told, but it is on the stable branch.

SciPy can't be led to a load by stages: the start must bear all loads.

Where a cable goes slack the objective has a kink in its rest length, at which SLSQP stops early.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from shellform.arrays import Reals
from shellform.errors import require_count, require_known, require_number
from shellform.gridshell.gridshell import Design
from shellform.problem.evaluation import Evaluator, Linearisation, OffBranch, not_carried
from shellform.problem.paths import follow, without_slack
from shellform.problem.problem import Problem
from shellform.structure.solve.loading import Loaded

METHODS = ("trust-constr", "SLSQP")
_KEPT = 12  # points on the branch that are remembered as starts: the last ones and the best
# SciPy's unit, in the variables: a fifth of the usual prestrain, as the first window of `optimise` is of the
# tension
_STEP = 2e-3
_INSIDE = 1e-6  # of the bounds' distance that an interior point starts away from them


class Plain:
    """A problem as plain functions of its variables (s,), values over their unit. `start` (s,); `points`, the
    designs on the stable branch evaluated last; `history`, all of them."""

    def __init__(self, problem: Problem, start: Design) -> None:
        """Loads the start; raises NotConverged where it doesn't bear all loads."""
        self.evaluator = Evaluator(problem, start)
        reached = self.evaluator.begin()
        for name in problem.used():
            if not reached[name].on_branch:
                raise not_carried(name, reached[name], "Lead it there by stages: optimise.")
        states = {name: reached[name].equilibrium.state for name in problem.used()}
        point = self.evaluator.linearised(self.evaluator.seed(start, states, 1.0))
        self.start = point.variables
        self.points = [point]
        self.best = point
        self.history = [(0, point.objective, point.violation)]
        self._at = (point.variables.tobytes(), point, True)

    def bounds(self) -> tuple[Reals, Reals]:
        """Lower and upper bounds (s,) (3, 4)."""
        return self.evaluator.blocks.bounds()

    def value(self, variables: Reals) -> float:
        """The objective (2), 1 at the start; infinite off the stable branch."""
        point, there = self._evaluated(variables)
        return point.objective if there else np.inf

    def gradient(self, variables: Reals) -> Reals:
        """Derivative (s,) of the objective."""
        return self._evaluated(variables)[0].objective_by_variables

    def constraints(self, variables: Reals) -> Reals:
        """Values (k,) over their limits less 1, at most 0 where met (5, 6)."""
        return self._evaluated(variables)[0].constraints

    def jacobian(self, variables: Reals) -> Reals:
        """Derivatives (k, s) of the constraints."""
        return self._evaluated(variables)[0].constraints_by_variables

    def _evaluated(self, variables: Reals) -> tuple[Linearisation, bool]:
        """The point at the variables and True, or the nearest one on the branch and False."""
        key = variables.tobytes()
        if self._at[0] != key:
            near = min(self.points, key=lambda point: float(np.linalg.norm(point.variables - variables)))
            try:
                design = self.evaluator.blocks.design(np.array(variables), near.design.present)
                found = self.evaluator.evaluate(design, near.states, 1.0, lead=True)
                point, there = self.evaluator.linearised(found), True
            except OffBranch:
                point, there = near, False
            if there:
                self._remember(point)
            self._at = (key, point, there)
        return self._at[1], self._at[2]

    def _remember(self, point: Linearisation) -> None:
        self.history.append((self.evaluator.evaluations, point.objective, point.violation))
        if point.rank < self.best.rank:
            self.best = point
        self.points = [*(each for each in self.points[1 - _KEPT :] if each is not self.best), self.best]
        if point is not self.best:
            self.points.append(point)


@dataclass(frozen=True, eq=False)
class Compared:
    """What a SciPy `method` found.

    - `design`: the best feasible one without its slack cables, or the least infeasible one; `loaded`: how it
      carries each load on the documented path, "none" first.
    - `objective` and largest `violation` where the optimiser had it.
    - `history`: (evaluation, objective, violation) of the designs on the branch.
    - `evaluations`, of which `rejected`, and `factorisations`: the work.
    - `status`: SciPy's sentence, or that the evaluations were used up.
    """

    method: str
    design: Design
    loaded: Mapping[str, Loaded]
    objective: float
    violation: float
    history: Sequence[tuple[int, float, float]]
    evaluations: int
    rejected: int
    factorisations: int
    status: str


class _Enough(Exception):
    """The evaluations are used up."""


def compare(
    problem: Problem,
    start: Design,
    *,
    method: str = "trust-constr",
    evaluations: int = 200,
    tolerance: float = 1e-8,
) -> Compared:
    """SciPy's optimum of the problem from the start, within a number of design `evaluations`.

    `tolerance`: of the objective for SLSQP; of the gradient, the trust region and the barrier for
    trust-constr. For the same problem from optimise give its solver `stiffness=0`, `thin=False`: both add to
    the problem. Raises InputError for another method and NotConverged where the start doesn't bear all loads.
    """
    require_known(method, METHODS, where="method", what="is no known method")
    require_count(evaluations, where="evaluations", give="a number of designs to try, such as 200")
    require_number(tolerance, above=0.0, below=1.0, where="tolerance", give="a small share, such as 1e-8")
    plain = Plain(problem, start)

    def counted(function: Any) -> Any:
        def at(unit: Reals) -> Any:
            if plain.evaluator.evaluations >= evaluations:
                raise _Enough
            return function(plain.start + _STEP * unit)

        return at

    try:
        with warnings.catch_warnings():
            status = _minimised(plain, counted, method, evaluations, tolerance)
    except _Enough:
        status = "the number of evaluations was reached"
    shell, best, evaluator = problem.shell, plain.best, plain.evaluator
    design = without_slack(shell, best.design, best.states[problem.design_load.name])
    none = np.zeros((shell.node_count, 6))
    return Compared(
        method=method,
        design=design,
        loaded=follow(shell, design, {"none": none, **problem.loads}),
        objective=best.objective,
        violation=best.violation,
        history=tuple(plain.history),
        evaluations=evaluator.evaluations,
        rejected=evaluator.rejected,
        factorisations=evaluator.factorisations,
        status=status,
    )


def _minimised(plain: Plain, counted: Any, method: str, evaluations: int, tolerance: float) -> str:
    """SciPy's run in units of _STEP from the start; its sentence."""
    from scipy.optimize import BFGS, Bounds, NonlinearConstraint, minimize

    # A trial off the branch gives the gradient of the point before once more, of which SciPy's update of the
    # curvature warns.
    warnings.filterwarnings("ignore", message="delta_grad == 0.0", category=UserWarning)
    lower, upper = ((bound - plain.start) / _STEP for bound in plain.bounds())
    value, gradient = counted(plain.value), counted(lambda x: _STEP * plain.gradient(x))
    limits, slopes = counted(plain.constraints), counted(lambda x: _STEP * plain.jacobian(x))
    begin = np.zeros(len(plain.start))
    constraints: Any = ()
    options: dict[str, Any] = {"maxiter": evaluations}
    if method == "SLSQP":
        if len(plain.best.constraints):
            constraints = {"type": "ineq", "fun": lambda u: -limits(u), "jac": lambda u: -slopes(u)}
        options["ftol"] = tolerance
    else:
        if len(plain.best.constraints):
            constraints = NonlinearConstraint(limits, -np.inf, 0.0, jac=slopes, hess=BFGS())
        begin = np.clip(begin, lower + _INSIDE * (upper - lower), upper - _INSIDE * (upper - lower))
        options |= {"gtol": tolerance, "xtol": tolerance, "barrier_tol": tolerance}
    found = minimize(
        value,
        begin,
        jac=gradient,
        hess=BFGS() if method == "trust-constr" else None,
        bounds=Bounds(lower, upper, keep_feasible=True),
        constraints=constraints,
        method=method,
        options=options,
    )
    return str(found.message)
