"""Beams that are not straight, or not in line with their nodes, when they are free of stress.

A beam's end triads are A = Q_a F and B = Q_b F, Q the rotations of its nodes and F its frame. Turned ends, A
= Q_a H_a F and B = Q_b H_b F with constant rotations H, shift the state that is free of stress: an element of
length l with its own curvature k (a vector across the axis, 1/m, in the axes of the stress-free state) has

    H_a = R(k l / 2),   H_b = R(-k l / 2),

since its ends are turned by -k l / 2 and k l / 2 against the chord when nothing bends it. H multiplies from
the right and spins from the left, so that forces and tangents with respect to the nodes' spins are those of
the straight beam at its turned ends: the same kernel serves, every element with ends of its own.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from shellform.arrays import Indices, Reals, reals
from shellform.structure.elements import rotation
from shellform.structure.elements.beam import Beams
from shellform.structure.elements.parts import Evaluation
from shellform.structure.elements.state import State


@dataclass(frozen=True)
class BentBeams:
    """`straight` beams whose ends are turned by the unit quaternions `turns` (m, 2, 4) before their nodes
    turn them."""

    straight: Beams
    turns: Reals
    _alone: Beams = field(init=False, repr=False)  # the straight ones, each with two nodes of its own

    def __post_init__(self) -> None:
        count = len(self.straight.ends)
        object.__setattr__(self, "turns", reals("turns", self.turns, (count, 2, 4)))
        apart = np.arange(2 * count).reshape(-1, 2)
        object.__setattr__(self, "_alone", replace(self.straight, ends=apart))

    def dofs(self) -> Indices:
        """Degrees of freedom (m, 12) of each element, as the straight ones'."""
        return self.straight.dofs()

    def evaluate(self, state: State, *, tangent: bool, into: Reals | None = None) -> Evaluation:
        """Energy (m,) J, end forces (m, 12) N and N·m, packed lower tangents (m, 78), filled `into`."""
        alone, own = self.apart(state)
        return alone.evaluate(own, tangent=tangent, into=into)

    def local_forces(self, state: State) -> Reals:
        """Equation (16), (m, 7), N and N·m."""
        alone, own = self.apart(state)
        return alone.local_forces(own)

    def apart(self, state: State) -> tuple[Beams, State]:
        """The straight beams, each between two nodes of its own (2 i and 2 i + 1), and the state of those,
        turned: a spin of a node is one of its beams' ends."""
        flat = self.straight.ends.ravel()
        turned = rotation.product(state.quaternions[flat], self.turns.reshape(-1, 4))
        return self._alone, State(state.positions[flat], turned)


def curved(straight: Beams, curvature: Reals) -> BentBeams:
    """Beams with their own curvature (m, 3), 1/m, across each one's axis in the stress-free state."""
    half = 0.5 * straight.rest_length[:, None] * curvature
    return BentBeams(straight, np.stack([rotation.from_vectors(half), rotation.from_vectors(-half)], axis=1))
