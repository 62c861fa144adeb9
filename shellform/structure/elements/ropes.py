"""Ropes that draw nodes to places in plan.

A rope of stiffness k, N/m, runs over a pulley at its place p: it pulls the node at x with k times the
distance in plan,

    U = k |p - x|² / 2,   f = k (x - p),   K = k I,

and leaves its height alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shellform.arrays import Indices, Reals, Record, indices, reals
from shellform.structure.elements.parts import Evaluation
from shellform.structure.elements.state import State


@dataclass(frozen=True, eq=False)
class Ropes(Record):
    """Ropes of one `stiffness`, N/m, that draw `nodes` (k,) in plan to `places` (k, 2), m."""

    nodes: Indices
    places: Reals
    stiffness: float

    def __post_init__(self) -> None:
        count = len(self.nodes)
        put = object.__setattr__
        put(self, "nodes", indices("ropes.nodes", self.nodes, (count,), below=np.iinfo(np.int64).max))
        put(self, "places", reals("ropes.places", self.places, (count, 2)))

    def dofs(self) -> Indices:
        """Translations (k, 2) in plan of the nodes."""
        return 6 * self.nodes[:, None] + np.arange(2)

    def force(self, state: State) -> Reals:
        """Forces (k, 2), N, that stretch the ropes."""
        stretch = state.positions[self.nodes, :2] - self.places
        if state.tail is not None:
            stretch += state.tail[self.nodes, :2]
        return np.asarray(self.stiffness * stretch)

    def evaluate(self, state: State, *, tangent: bool, into: Reals | None = None) -> Evaluation:
        """Energy (k,) J, forces (k, 2) N, packed lower tangents (k, 3) N/m, filled `into`."""
        force = self.force(state)
        energy = 0.5 * (force**2).sum(axis=1) / self.stiffness
        if not tangent:
            return Evaluation(energy, force, None)
        packed = np.empty((len(force), 3)) if into is None else into
        packed[:] = self.stiffness * np.array([1.0, 0.0, 1.0])
        return Evaluation(energy, force, packed)

    def evaluate_extended(self, state: State, *, tangent: bool) -> Evaluation:
        """As `evaluate` at a state with a tail, tangents (k, 3, 2) with all their digits."""
        found = self.evaluate(state, tangent=tangent)
        if found.tangent is None:
            return found
        return Evaluation(
            found.energy, found.force, np.stack([found.tangent, np.zeros_like(found.tangent)], axis=2)
        )
