"""What the assembler asks of a part (beams, cables, springs): its degrees of freedom, and its forces and
stiffness at a state.

Freedom 6 i + k of a network is translation (k = 0, 1, 2) or rotation (k = 3, 4, 5) of node i along global
axes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from shellform.arrays import Indices, Reals, Record
from shellform.structure.elements.state import State


@dataclass(frozen=True, eq=False)
class Evaluation(Record):
    """Elements of one part at one state: `energy` (m,) J, `force` (m, k) its gradient, `tangent` (m, k (k +
    1) / 2).

    The tangent is the packed lower triangle, row by row, of each element's symmetric Hessian; None where not
    asked for. `turned`, rad: the largest local rotation or twist of a beam, 0 where all are below 45 degrees.
    """

    energy: Reals
    force: Reals
    tangent: Reals | None
    turned: float = 0.0


class Part(Protocol):
    """Elements of one kind."""

    def dofs(self) -> Indices:
        """Degrees of freedom (m, k) of each element, in the order of the columns of `force`."""

    def evaluate(self, state: State, *, tangent: bool, into: Reals | None = None) -> Evaluation:
        """Energy, forces and, if asked for, tangents of all elements, written `into` an array of their shape
        if one is given.
        """
