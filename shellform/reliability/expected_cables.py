"""Cables counted for what they are worth when their length isn't known exactly: the expected law.

A cable of length l, rest length l0 and stiffness EA whose stretch m = l - l0 is off by a normal variable of
deviation s has, on average over that, with k = EA / l0, u = m / s, the normal distribution P and its density
p,

    energy    E = k ((m² + s²) P(u) + m s p(u)) / 2
    tension   N = dE/dl = k (m P(u) + s p(u))
    slope     dN/dl = k P(u).

There is no kink at l = l0: a cable that is taut by a hair gives half its stiffness, and as s -> 0 the sharp
law of cable.py comes back.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from shellform.arrays import Indices, Reals, Record, reals
from shellform.structure.elements.cable import Cables
from shellform.structure.elements.parts import Evaluation
from shellform.structure.elements.state import State

_ROWS, _COLUMNS = np.tril_indices(6)


@dataclass(frozen=True, eq=False)
class ExpectedCables(Record):
    """`cables` whose stretch is off by the standard `deviation` (c,), m, above zero."""

    cables: Cables
    deviation: Reals

    def __post_init__(self) -> None:
        count = len(self.cables.ends)
        object.__setattr__(self, "deviation", reals("deviation", self.deviation, (count,), positive=True))

    def dofs(self) -> Indices:
        """Translations (c, 6) of the two ends."""
        return self.cables.dofs()

    def tension(self, state: State) -> Reals:
        """Expected tension (c,), N."""
        return self._law(self.cables.lengths(state))[1]

    def evaluate(self, state: State, *, tangent: bool, into: Reals | None = None) -> Evaluation:
        """Energy (c,) J, forces (c, 6) N on the ends, packed lower tangents (c, 21) N/m, filled `into`."""
        unit, length = self.cables.directions(state)
        energy, tension, slope = self._law(length)
        along = tension[:, None] * unit
        force = np.hstack([-along, along])
        if not tangent:
            return Evaluation(energy, force, None)
        lateral = tension / length
        block = (slope - lateral)[:, None, None] * unit[:, :, None] * unit[:, None, :]
        block += lateral[:, None, None] * np.eye(3)
        sign = np.where((_ROWS < 3) == (_COLUMNS < 3), 1.0, -1.0)
        packed = sign * block[:, _ROWS % 3, _COLUMNS % 3]
        if into is not None:
            into[:] = packed
        return Evaluation(energy, force, packed if into is None else into)

    def _law(self, length: Reals) -> tuple[Reals, Reals, Reals]:
        """Energy, J, tension, N, and its derivative by the length, N/m, (c,) each, at the lengths (c,), m."""
        stretch, s = length - self.cables.rest_length, self.deviation
        k = self.cables.stiffness / self.cables.rest_length
        share = ndtr(stretch / s)
        density = np.exp(-0.5 * (stretch / s) ** 2) / np.sqrt(2.0 * np.pi)
        energy = 0.5 * k * ((stretch**2 + s**2) * share + stretch * s * density)
        return energy, k * (stretch * share + s * density), k * share
