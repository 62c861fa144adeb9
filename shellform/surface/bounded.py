"""Least squares with a lower bound, by a primal-dual interior-point method (Wright 1997)."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from shellform.arrays import Reals
from shellform.errors import NotConverged

_ROUNDS = 200  # of the interior-point method, at the most
_SETTLED = 1e-10  # complementarity and residual, of those at the start
_CENTRING = 0.1  # of the present complementarity that the next step aims at
_TO_EDGE = 0.99  # of the way to a bound that a step goes at the most


def bounded_minimum(matrix: sp.csc_array, right: Reals, least: float) -> Reals:
    """The minimum (k,) of x'Ax/2 - b'x, A `matrix` and b `right`, with all x at least `least`, which is
    above 0. Raises NotConverged.
    """
    target = right - matrix @ np.full(len(right), least)
    x = np.full(len(right), least)
    push = np.full(len(right), np.abs(target).max())  # multipliers of x >= 0
    scale = float(x @ push)
    for _ in range(_ROUNDS):
        centre = _CENTRING * float(x @ push) / len(x)
        residual = matrix @ x - target - push
        step = splu(sp.csc_array(matrix + sp.diags_array(push / x))).solve(-residual - push + centre / x)
        turn = centre / x - push - push / x * step
        x = x + _share(x, step) * step
        push = push + _share(push, turn) * turn
        if float(x @ push) < _SETTLED * scale and np.abs(residual).max() < _SETTLED * np.abs(target).max():
            return x + least
    raise NotConverged(
        "the force densities don't settle",
        state=x + least,
        residual=float(x @ push),
        iterations=_ROUNDS,
        remedy="Raise least.",
    )


def _share(value: Reals, step: Reals) -> float:
    """How much of a step keeps values positive."""
    down = step < 0.0
    return min(1.0, _TO_EDGE * float((-value[down] / step[down]).min())) if down.any() else 1.0
