"""Cables whose tensions are given: they don't answer to their lengths.

A cable's tangent is (EA/l0 - N/l) e e' + N/l I with e = (x_b - x_a)/l; at a given tension EA/l0 is left out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shellform.arrays import Indices, Reals
from shellform.structure.elements.cable import Cables
from shellform.structure.elements.parts import Evaluation
from shellform.structure.elements.state import State

_ROW, _COLUMN = np.tril_indices(6)


@dataclass(frozen=True, eq=False)
class EasedCables:
    """The `cables` without stiffness along them; a part of a model, with their energy and forces."""

    cables: Cables

    def dofs(self) -> Indices:
        """Translations (c, 6) of the two ends."""
        return self.cables.dofs()

    def evaluate(self, state: State, *, tangent: bool, into: Reals | None = None) -> Evaluation:
        """As the cables', with tangents at given tensions (c, 21), N/m."""
        whole = self.cables.evaluate(state, tangent=tangent, into=into)
        if whole.tangent is None:
            return whole
        along = self.cables.tension_by_position(state)
        size = self.cables.stiffness / self.cables.rest_length
        whole.tangent[...] -= (1.0 / size)[:, None] * along[:, _ROW] * along[:, _COLUMN]
        return whole
