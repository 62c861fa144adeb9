"""Fictitious springs that pull nodes to a surface and slide on it (operation 1 of the framework).

A spring of density q, N/m, joins a node at x to its closest point on the surface, found anew at every state,
so that it pulls along the normal n only. With the signed distance d(x), its gradient n and its Hessian H, and
the level at which the node is to lie,

    U = q (d - level)² / 2,   f = q (d - level) n,   K = q (n n' + (d - level) H),

each the exact derivative of the one before, so that Newton's method converges as it does for the rods.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from shellform.arrays import Indices, Reals, Record, indices, reals
from shellform.structure.elements.parts import Evaluation
from shellform.structure.elements.state import State

Distance = Callable[[Reals], tuple[Reals, Reals, Reals]]
"""From points (k, 3), m, to signed distances (k,), m, their gradients (k, 3) and packed lower Hessians
(k, 6), 1/m."""

_LOWER = np.tril_indices(3)


@dataclass(frozen=True, eq=False)
class SlidingSprings(Record):
    """`nodes` (k,) pulled with `density` (k,) N/m to lie at `level` (k,) m above the surface of
    `distance`.
    """

    nodes: Indices
    density: Reals
    level: Reals
    distance: Distance

    def __post_init__(self) -> None:
        count = len(self.nodes)
        put = object.__setattr__
        put(self, "nodes", indices("springs.nodes", self.nodes, (count,), below=np.iinfo(np.int64).max))
        put(self, "density", reals("springs.density", self.density, (count,), positive=True))
        put(self, "level", reals("springs.level", self.level, (count,)))

    def dofs(self) -> Indices:
        """Translations (k, 3) of the pulled nodes."""
        return 6 * self.nodes[:, None] + np.arange(3)

    def stretch(self, state: State) -> Reals:
        """How far (k,), m, each node lies above its level; the spring's force is `density` times that."""
        return self.distance(state.positions[self.nodes])[0] - self.level

    def evaluate(self, state: State, *, tangent: bool, into: Reals | None = None) -> Evaluation:
        """Energy (k,) J, forces (k, 3) N, packed lower tangents (k, 6) N/m, filled `into`."""
        distance, normal, hessian = self.distance(state.positions[self.nodes])
        stretch = distance - self.level
        force = (self.density * stretch)[:, None] * normal
        energy = 0.5 * self.density * stretch**2
        if not tangent:
            return Evaluation(energy, force, None)
        packed = np.empty((len(energy), 6)) if into is None else into
        packed[:] = self.density[:, None] * (
            normal[:, _LOWER[0]] * normal[:, _LOWER[1]] + stretch[:, None] * hessian
        )
        return Evaluation(energy, force, packed)
