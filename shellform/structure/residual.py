"""How far a state is from equilibrium, and what holds a rod that is free to spin."""

from __future__ import annotations

import numpy as np

from shellform.arrays import Reals
from shellform.structure.assembly import Assembly, Balance
from shellform.structure.state import State

_SPIN = 1e-10  # share of a rotation's own stiffness that holds a rod free to spin about its axis


class Measure:
    """Measures unbalanced forces, moments divided by a length, against the largest applied or internal force.

    `arms` (n,), m: that length for each node, the mean rest length of its beams; `mass_shape` (f,): 1 for free translations
    and the arm's square for free rotations, so that both weigh alike.
    """

    def __init__(self, assembly: Assembly) -> None:
        self.free = assembly.free
        self.arms = _arms(assembly)
        self._turns = self.free % 6 >= 3
        self._arms_of_turns = self.arms[self.free[self._turns] // 6]
        self.mass_shape = np.ones(len(self.free))
        self.mass_shape[self._turns] = self._arms_of_turns**2

    def residual(self, balance: Balance, load: Reals) -> float:
        """Largest unbalanced force over the scale under the dead `load` (n, 6); infinite where a force isn't finite."""
        unbalanced = (load - balance.force).ravel()[self.free]
        unbalanced[self._turns] /= self._arms_of_turns
        largest = float(np.abs(unbalanced).max(initial=0.0))
        if not np.isfinite(largest):
            return float("inf")
        scale = self.scale(balance, load)
        return largest / scale if scale > 0.0 else 0.0

    def scale(self, balance: Balance, load: Reals) -> float:
        """The largest applied or internal force, N."""
        applied = np.abs(load)
        return max(float(applied[:, :3].max()), balance.largest, float((applied[:, 3:] / self.arms[:, None]).max()))

    def rounding(self, balance: Balance, state: State, load: Reals) -> float:
        """The residual that rounding of the coordinates alone leaves: stiff short elements answer to the last bit."""
        assert balance.tangent is not None
        stiffest = float(np.abs(balance.tangent).max(initial=0.0))
        last_bit = 4.0 * np.finfo(float).eps * float(np.abs(state.positions).max(initial=0.0))
        scale = self.scale(balance, load)
        return stiffest * last_bit / scale if scale > 0.0 else 0.0


def held(assembly: Assembly, balance: Balance) -> Reals:
    """The tangent's lower values with rotations held by 1e-10 of their own stiffness.

    A pinned straight rod can spin about its axis without any force; that much stiffness makes the matrix regular and is far
    below what rounding leaves of the softest mode that matters.
    """
    assert balance.tangent is not None
    values = balance.tangent.copy()
    turns = assembly.matrix.diagonal[assembly.free % 6 >= 3]
    values[turns] += _SPIN * np.abs(values[turns])
    return values


def _arms(assembly: Assembly) -> Reals:
    """A length (n,) for each node, m: the mean rest length of the beams that meet there (1 where there are none)."""
    total, number = np.zeros(assembly.count), np.zeros(assembly.count)
    for part in assembly.beams:
        for end in part.ends.T:
            np.add.at(total, end, part.rest_length)
            np.add.at(number, end, 1.0)
    return np.where(number > 0.0, total / np.maximum(number, 1.0), 1.0)
