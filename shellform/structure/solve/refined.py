"""Solutions with twice the digits by a factor of the leading ones.

Where the load is merely small, as that of one crossing of ten thousand, the tangent's leading digits do for
its factor: solutions are refined against all digits (Wilkinson; Higham 2002, chapter 12). They do where I -
M^-1 K, with K the tangent and M what was factorised, shrinks a random vector a hundredfold at its third turn,
for then the eigenvalues of M^-1 K lie about 1 and K is as positive definite as M.
"""

from __future__ import annotations

import numpy as np

from shellform.arrays import Indices, Reals
from shellform.compiled import njit
from shellform.structure.elements.double_double import minus, times
from shellform.structure.solve.factorisation import Factor

_ROUNDS = 12  # of refinement, each of which leaves a hundredth or less
_NEAR = 1e-2  # of a vector that a third turn may leave of it


class RefinedFactor:
    """The factor of a positive definite matrix's leading digits; solutions are refined against `values` (nnz,
    2)."""

    negative = 0

    def __init__(self, leading: Factor, indptr: Indices, indices: Indices, values: Reals) -> None:
        self._leading, self._matrix = leading, (indptr, indices, values)

    def near(self) -> bool:
        """Whether refinement converges fast, for any right-hand side."""
        left = np.random.default_rng(0).standard_normal((len(self._matrix[0]) - 1, 1))
        for _ in range(3):
            before, left = (
                left,
                left + self._leading.solve(_residual(*self._matrix, np.zeros_like(left), left)),
            )
        return bool(np.linalg.norm(left) <= _NEAR * np.linalg.norm(before))

    def solve(self, right: Reals) -> Reals:
        """The solution for right-hand sides (n,) or (n, k)."""
        columns = np.ascontiguousarray(right[:, None] if right.ndim == 1 else right)
        found = self._leading.solve(columns)
        for _ in range(_ROUNDS):
            change = self._leading.solve(_residual(*self._matrix, columns, found))
            found = found + change
            if np.linalg.norm(change) <= np.finfo(float).eps * np.linalg.norm(found):
                break
        return found[:, 0] if right.ndim == 1 else found


@njit(cache=True)
def _residual(indptr, indices, values, right, x):  # type: ignore[no-untyped-def]
    """right - A x (n, k) of a lower triangle by columns, summed with all digits."""
    size, sides = right.shape
    result = np.empty((size, sides))
    left = np.empty((size, 2))
    for c in range(sides):
        for i in range(size):
            left[i, 0], left[i, 1] = right[i, c], 0.0
        for j in range(size):
            for p in range(indptr[j], indptr[j + 1]):
                i, entry = indices[p], (values[p, 0], values[p, 1])
                left[i, 0], left[i, 1] = minus((left[i, 0], left[i, 1]), times(entry, (x[j, c], 0.0)))
                if i != j:
                    left[j, 0], left[j, 1] = minus((left[j, 0], left[j, 1]), times(entry, (x[i, c], 0.0)))
        for i in range(size):
            result[i, c] = left[i, 0]
    return result
