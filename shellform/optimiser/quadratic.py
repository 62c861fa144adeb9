"""Quadratic problems with many constraints: the door to CVXOPT's interior-point method.

Its linear systems are condensed to the variables, so that constraints cost little.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from cvxopt import matrix, solvers
from scipy.linalg import cho_factor, cho_solve

from shellform.arrays import Reals
from shellform.work_clock import Work, told

_REGULAR = 1e-8  # of the mean curvature, where the model has none


@told(Work.CONVEX)
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
