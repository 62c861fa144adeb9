"""What is measured on a loaded gridshell: the terms of the objective (2) and of the constraints (5) and (6).

A term gives a vector of values and its partial derivatives by the node positions and by the design; the chain
through the equilibrium is sensitivity.py's. Each names the load case at which it is taken.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import scipy.sparse as sp

from shellform.arrays import Reals
from shellform.errors import InputError
from shellform.gridshell.gridshell import Design, Gridshell
from shellform.structure.elements.state import State


@dataclass(frozen=True)
class Measure:
    """`value` (g,); `by_dof` (g, 6 n) sparse, by the nodes' translations and spins at a fixed design;
    `by_rest_length` (g, c) sparse and `by_radius` (g,) at a fixed state. Cables are all candidates; absent
    ones have zero derivatives."""

    value: Reals
    by_dof: sp.csr_array
    by_rest_length: sp.csr_array
    by_radius: Reals


class Term(Protocol):
    """Something measured at the load case `load` ("" where no state is needed)."""

    @property
    def load(self) -> str: ...

    def measure(self, shell: Gridshell, design: Design, state: State) -> Measure: ...


@dataclass(frozen=True)
class Misfit:
    """d'd, m²: the sum over all nodes of the squared distance from the target (7), differentiated as such:
    (A.9) is 0/0 at zero distance, its product with d is not."""

    load: str

    def measure(self, shell: Gridshell, design: Design, state: State) -> Measure:
        """One value, m²."""
        away = state.positions - shell.target.positions
        slope = np.hstack([2.0 * away, np.zeros_like(away)])
        return _measure(shell, [float((away**2).sum())], by_dof=sp.csr_array(slope.reshape(1, -1)))


@dataclass(frozen=True)
class RmsMisfit:
    """d'd over the number of nodes, m²; a limit on it is the square of a limit on the root mean square
    distance (6).
    """

    load: str

    def measure(self, shell: Gridshell, design: Design, state: State) -> Measure:
        """One value, m²."""
        whole = Misfit(self.load).measure(shell, design, state)
        count = len(state.positions)
        return _measure(shell, whole.value / count, by_dof=whole.by_dof / count)


@dataclass(frozen=True)
class CableForces:
    """n, N: the tension of every candidate cable, or of the `chosen` ones (5); absent cables have none."""

    load: str
    chosen: tuple[int, ...] | None = None

    def measure(self, shell: Gridshell, design: Design, state: State) -> Measure:
        """As many values as candidates, or as chosen, N."""
        measure = _tensions(shell, design, state)
        if self.chosen is None:
            return measure
        rows = list(self.chosen)
        return Measure(
            measure.value[rows],
            measure.by_dof[rows],
            measure.by_rest_length[rows],
            measure.by_radius[rows],
        )


@dataclass(frozen=True)
class CableForce:
    """The sum of all cable tensions, N: the L1 norm whose weight empties cables that aren't needed (2)."""

    load: str

    def measure(self, shell: Gridshell, design: Design, state: State) -> Measure:
        """One value, N."""
        each = _tensions(shell, design, state)
        return Measure(
            np.array([each.value.sum()]),
            sp.csr_array(each.by_dof.sum(axis=0).reshape(1, -1)),
            sp.csr_array(each.by_rest_length.sum(axis=0).reshape(1, -1)),
            np.zeros(1),
        )


@dataclass(frozen=True)
class RodRadius:
    """The rods' radius, m."""

    load: str = ""

    def measure(self, shell: Gridshell, design: Design, state: State) -> Measure:
        """One value, m."""
        return _measure(shell, [design.radius], by_radius=[1.0])


@dataclass(frozen=True)
class Share:
    """A summand of the objective: its weight is such that it makes up `share` of the objective's value 1 at
    the start.
    """

    share: float
    term: Term

    def __post_init__(self) -> None:
        if not self.share > 0.0:
            raise InputError("a share must be positive", where="minimise", value=self.share)


@dataclass(frozen=True)
class AtMost:
    """The constraint that every value of the term is at most `limit` (in the term's unit; RmsMisfit's in m).

    It is scaled to value / limit - 1 <= 0, as in figures 11 and 16.
    """

    limit: float
    term: Term

    def __post_init__(self) -> None:
        if not self.limit > 0.0:
            raise InputError("a limit must be positive", where="limits", value=self.limit)

    @property
    def scale(self) -> float:
        """What the term's values are divided by."""
        return self.limit**2 if isinstance(self.term, RmsMisfit) else self.limit


def _measure(
    shell: Gridshell, value: object, *, by_dof: sp.csr_array | None = None, by_radius: object = (0.0,)
) -> Measure:
    nodes, cables = shell.node_count, len(shell.cable_ends)
    return Measure(
        np.asarray(value, dtype=float),
        sp.csr_array((1, 6 * nodes)) if by_dof is None else by_dof,
        sp.csr_array((1, cables)),
        np.asarray(by_radius, dtype=float),
    )


def _tensions(shell: Gridshell, design: Design, state: State) -> Measure:
    cables = shell.cables(design)
    present = np.flatnonzero(design.present)
    count, nodes = len(shell.cable_ends), shell.node_count
    value = np.zeros(count)
    value[present] = cables.tension(state)
    rows = np.repeat(present, 6)
    by_dof = sp.csr_array(
        (cables.tension_by_position(state).ravel(), (rows, cables.dofs().ravel())),
        shape=(count, 6 * nodes),
    )
    by_rest = sp.csr_array((cables.tension_by_rest_length(state), (present, present)), shape=(count, count))
    return Measure(value, by_dof, by_rest, np.zeros(count))
