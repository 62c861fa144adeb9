"""Solving with a factor that has a few entries a column, as that of the graph of a gridshell's beams: column
by column in a compiled loop, where blocks would be nearly empty.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shellform.arrays import Indices, Reals, Record
from shellform.compiled import njit
from shellform.work_clock import Work, counts_as


@dataclass(frozen=True, eq=False)
class Thin(Record):
    """P A P' = L D L': `order` of the rows, L by columns with D on its diagonal, which comes first."""

    order: Indices
    starts: Indices
    rows: Indices
    entries: Reals

    @counts_as(Work.SUBSTITUTIONS)
    def solve(self, right: Reals) -> Reals:
        columns = right[:, None] if right.ndim == 1 else right
        solution = np.asarray(
            _solve(self.order, self.starts, self.rows, self.entries, np.ascontiguousarray(columns))
        )
        return solution[:, 0] if right.ndim == 1 else solution


@njit(cache=True)
def _solve(order, starts, rows, entries, right):  # type: ignore[no-untyped-def]
    size, sides = right.shape
    x = np.empty((size, sides))
    for i in range(size):
        for c in range(sides):
            x[i, c] = right[order[i], c]
    for j in range(size):
        for k in range(starts[j] + 1, starts[j + 1]):
            for c in range(sides):
                x[rows[k], c] -= entries[k] * x[j, c]
    for j in range(size - 1, -1, -1):
        for c in range(sides):
            x[j, c] /= entries[starts[j]]
        for k in range(starts[j] + 1, starts[j + 1]):
            for c in range(sides):
                x[j, c] -= entries[k] * x[rows[k], c]
    result = np.empty((size, sides))
    for i in range(size):
        for c in range(sides):
            result[order[i], c] = x[i, c]
    return result
