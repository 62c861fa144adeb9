"""Quadratic problems with many constraints: the door to CVXOPT's interior-point method.

Its linear systems are condensed to the variables, so that constraints cost little. Where the curvature is L
L' with few columns, they are condensed further, to those and the constraints: M = D + L L' + G' W G with
diagonal D and W is solved with by Sherman, Morrison and Woodbury's formula, whose cost is linear in the
variables. Of thousands of these parts are worked on side by side, and summed in order.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from cvxopt import matrix, solvers
from scipy.linalg import cho_factor, cho_solve

from shellform.arrays import Flags, Reals, Record
from shellform.structure.elements.threads import side_by_side
from shellform.work_clock import Work, counts_as

_REGULAR = 1e-8  # of the mean curvature, where the model has none
_CORRECTIONS = 2  # of what a small diagonal costs the formula in digits
_EXACT = 1e-12  # of the right side, below which nothing is left to correct

_PART = 4096  # variables
_FEW = 200  # variables: of so many the formula may lose what a dense matrix keeps, where nothing is curved
_QUIETLY = partial(np.errstate, over="ignore", invalid="ignore")
_Linear = Callable[[Reals], Reals]
# from the bounds' weights (s,) and the constraints' (k,) to the solution of the condensed system
_Condensed = Callable[[Reals, Reals], _Linear]


@dataclass(frozen=True, eq=False)
class LowRank(Record):
    """The matrix L L' of `columns` L (s, r)."""

    columns: Reals

    def __matmul__(self, u: Reals) -> Reals:
        return np.asarray(self.columns @ (self.columns.T @ u))

    def widened(self, more: int) -> LowRank:
        """With rows and columns of zeros."""
        return LowRank(np.vstack([self.columns, np.zeros((more, self.columns.shape[1]))]))


@counts_as(Work.CONVEX)
def minimise_quadratic(
    hessian: Reals | LowRank, slope: Reals, rows: Reals, values: Reals, lower: Reals, upper: Reals
) -> Reals | None:
    """The u (s,) with the least slope'u + u'hessian u / 2 where values + rows u <= 0 and lower <= u <= upper;
    None where nothing meets them all. `hessian` (s, s) is positive semidefinite. What has one value only
    between its bounds is no variable of the method, which stays within them.
    """
    free = lower < upper
    if not free.all():
        return _of_the_free(free, hessian, slope, rows, values, lower, upper)
    asked = slope, rows, values, lower, upper
    if isinstance(hessian, np.ndarray):
        return _least(*_dense(hessian, rows), *asked)
    found = _least(*_low_rank(hessian, rows), *asked)
    if found is None and len(slope) <= _FEW:
        return _least(*_dense(hessian.columns @ hessian.columns.T, rows), *asked)
    return found


def _least(
    curved: _Linear,
    condensed: _Condensed,
    slope: Reals,
    rows: Reals,
    values: Reals,
    lower: Reals,
    upper: Reals,
) -> Reals | None:
    """The same in variables that are all free, by products with the curvature and solutions of the condensed
    systems."""
    size = len(slope)

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
        solved = condensed(weight[:size] + weight[size : 2 * size], weight[2 * size :])

        def solve(x: Any, y: Any, z: Any) -> None:
            right = np.array(z).ravel()
            found = solved(np.array(x).ravel() + pulls(weight * right))
            x[:] = matrix(found)
            z[:] = matrix((limits(found) - right) / d)

        return solve

    right = np.concatenate([upper, -lower, -values])
    dims = {"l": len(right), "q": [], "s": []}
    try:
        with _QUIETLY():
            answer = solvers.coneqp(
                products(curved),
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


def _of_the_free(
    free: Flags,
    hessian: Reals | LowRank,
    slope: Reals,
    rows: Reals,
    values: Reals,
    lower: Reals,
    upper: Reals,
) -> Reals | None:
    """The same in the variables that are `free` (s,)."""
    u = np.where(free, 0.0, lower)
    left = values + rows @ u
    if not free.any():
        return u if (left <= 0.0).all() else None
    own = LowRank(hessian.columns[free]) if isinstance(hessian, LowRank) else hessian[np.ix_(free, free)]
    found = minimise_quadratic(
        own, (slope + hessian @ u)[free], rows[:, free], left, lower[free], upper[free]
    )
    if found is None:
        return None
    u[free] = found
    return u


def _dense(hessian: Reals, rows: Reals) -> tuple[_Linear, _Condensed]:
    """Products with the curvature, and solutions of the condensed systems."""
    size = len(hessian)
    mean = float(np.diag(hessian).mean())
    curved = hessian + _REGULAR * max(mean, 1e-300) * np.eye(size)

    def condensed(of_bounds: Reals, of_rows: Reals) -> _Linear:
        whole = curved + (rows.T * of_rows) @ rows
        whole[np.diag_indices(size)] += of_bounds
        factor = cho_factor(whole, check_finite=False)
        return lambda right: np.asarray(cho_solve(factor, right, check_finite=False))

    return lambda x: np.asarray(curved @ x), condensed


def _low_rank(hessian: LowRank, rows: Reals) -> tuple[_Linear, _Condensed]:
    """As `_dense`, by the few columns of the curvature and the constraints' rows."""
    few = np.hstack([hessian.columns, rows.T])
    count, size = hessian.columns.shape[1], len(hessian.columns)
    regular = _REGULAR * max(float((hessian.columns**2).sum()) / size, 1e-300)
    parts = [slice(first, first + _PART) for first in range(0, size, _PART)]

    def of_parts(of: Callable[[slice], Reals]) -> list[Reals]:
        def quietly(own: slice) -> Reals:  # each thread has its own state of warnings
            with _QUIETLY():
                return of(own)

        return side_by_side(quietly, parts)

    def summed(of: Callable[[slice], Reals]) -> Reals:
        return np.asarray(sum(of_parts(of)))

    def joined(of: Callable[[slice], Reals]) -> Reals:
        return np.concatenate(of_parts(of))

    def condensed(of_bounds: Reals, of_rows: Reals) -> _Linear:
        diagonal = regular + of_bounds
        root, stiff = np.sqrt(diagonal), np.append(np.ones(count), of_rows)
        scaled = np.empty_like(few)

        def squared(own: slice) -> Reals:
            part = scaled[own]
            np.divide(few[own], root[own, None], out=part)
            return np.asarray(part.T @ part)  # of the same array: half the products

        middle = summed(squared)
        middle[np.diag_indices(few.shape[1])] += 1.0 / stiff
        factor = cho_factor(middle, check_finite=False)

        def near(right: Reals) -> Reals:
            plain = right / root
            inner = cho_solve(factor, summed(lambda own: scaled[own].T @ plain[own]), check_finite=False)
            return joined(lambda own: (plain[own] - scaled[own] @ inner) / root[own])

        def left_of(right: Reals, x: Reals) -> Reals:
            inner = stiff * summed(lambda own: few[own].T @ x[own])
            return joined(lambda own: right[own] - diagonal[own] * x[own] - few[own] @ inner)

        def solved(right: Reals) -> Reals:
            found = near(right)
            left, exact = left_of(right, found), _EXACT * np.abs(right).max()
            for _ in range(_CORRECTIONS):
                if np.abs(left).max() <= exact:
                    break
                better = found + near(left)
                after = left_of(right, better)
                if not np.abs(after).max() < np.abs(left).max():
                    break
                found, left = better, after
            return found

        return solved

    return lambda x: regular * x + hessian @ x, condensed
