"""Cables counted for what they are worth when their length isn't known exactly: the expected law.

A cable of length l, rest length l0 and stiffness EA whose stretch m = l - l0 is off by a normal variable of
deviation s has, on average over that, with k = EA / l0, u = m / s, the normal distribution P and its density
p,

    energy    E = k ((m² + s²) P(u) + m s p(u)) / 2
    tension   N = dE/dl = k (m P(u) + s p(u))
    slope     dN/dl = k P(u),     d²N/dl² = k p(u) / s.

There is no kink at l = l0: a cable that is taut by a hair gives half its stiffness, and as s -> 0 the sharp
law of cable.py comes back. By the rest length, at fixed s: dN/dl0 = -N / l0 - k P, d(k P)/dl0 = -k P / l0 - k
p / s.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from shellform.arrays import Indices, Reals, reals
from shellform.structure.elements.cable import Cables
from shellform.structure.elements.parts import Evaluation
from shellform.structure.elements.state import State

_ROWS, _COLUMNS = np.tril_indices(6)


@dataclass(frozen=True)
class ExpectedCables:
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
        energy, tension, slope, _ = self._law(length)
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

    def force_by_rest_length(self, state: State) -> Reals:
        """Derivative (c, 6), N/m, of the end forces by the own rest length, geometry and deviation fixed."""
        chord, length = self.cables.chords(state)
        _, tension, slope, _ = self._law(length)
        rate = -tension / self.cables.rest_length - slope
        along = (rate / length)[:, None] * chord
        return np.hstack([-along, along])

    def stiffness_by_dof(self, state: State, mode: Reals) -> Reals:
        """Derivative (c, 6) of each cable's v'Kv, N/m, by the coordinates of its two ends, for a mode (n, 6).

        With d the ends' relative motion and a = e·d: v'Kv = k P a² + (N / l) (d·d - a²).
        """
        unit, length, along, whole, motion = self._relative(state, mode)
        _, tension, slope, curvature = self._law(length)
        across = (motion - along[:, None] * unit) / length[:, None]  # derivative of a by the second end
        lateral = tension / length
        by_length = curvature * along**2 + (slope / length - lateral / length) * (whole - along**2)
        rate = by_length[:, None] * unit + (2.0 * (slope - lateral) * along)[:, None] * across
        return np.hstack([-rate, rate])

    def stiffness_by_rest_length(self, state: State, mode: Reals) -> Reals:
        """Derivative (c,), N/m², of each cable's v'Kv by its rest length at the state."""
        _, length, along, whole, _ = self._relative(state, mode)
        _, tension, slope, curvature = self._law(length)
        rest = self.cables.rest_length
        by_slope = -slope / rest - curvature
        by_tension = -tension / rest - slope
        return np.asarray(by_slope * along**2 + by_tension / length * (whole - along**2))

    def _law(self, length: Reals) -> tuple[Reals, Reals, Reals, Reals]:
        """Energy, tension and its first two derivatives by the length, (c,) each."""
        stretch, s = length - self.cables.rest_length, self.deviation
        k = self.cables.stiffness / self.cables.rest_length
        share = ndtr(stretch / s)
        density = np.exp(-0.5 * (stretch / s) ** 2) / np.sqrt(2.0 * np.pi)
        energy = 0.5 * k * ((stretch**2 + s**2) * share + stretch * s * density)
        return energy, k * (stretch * share + s * density), k * share, k * density / s

    def _relative(self, state: State, mode: Reals) -> tuple[Reals, Reals, Reals, Reals, Reals]:
        a, b = self.cables.ends.T
        unit, length = self.cables.directions(state)
        motion = mode[b, :3] - mode[a, :3]
        return unit, length, (unit * motion).sum(axis=1), (motion**2).sum(axis=1), motion
