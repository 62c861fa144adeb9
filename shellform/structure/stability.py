"""Buckling modes from the tangent's factorisation."""

from __future__ import annotations

import numpy as np

from shellform.arrays import Reals
from shellform.structure.assembly import Assembly
from shellform.structure.state import State

_ITERATIONS = 30
_SETTLED = 1e-4


def lowest_mode(assembly: Assembly, state: State) -> Reals:
    """The softest mode (n, 6) of the tangent at a stable state, its largest translation 1: inverse iteration.

    Raises NotPositiveDefinite where the state isn't stable.
    """
    factor = assembly.factor(state)
    moving = assembly.free % 6 < 3
    # A fixed start that is orthogonal to no mode in practice keeps results repeatable.
    mode = np.where(moving, np.cos(1.7 * np.arange(len(assembly.free))), 0.0)
    for _ in range(_ITERATIONS):
        then = factor.solve(np.where(moving, mode, 0.0))
        then /= np.abs(then[moving]).max()
        change = min(np.abs(then - mode).max(), np.abs(then + mode).max())
        mode = then
        if change < _SETTLED:
            break
    result = np.zeros(6 * assembly.count)
    result[assembly.free] = mode
    return result.reshape(-1, 6)
