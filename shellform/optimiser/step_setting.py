"""Where a step is taken from, and what its model needs to know of it: how cables, nodes and residuals answer.

Two ways to the answers: all of them at once, as dense matrices (whole_answers.py), or each when it is asked
for, by a solve of its own (solved_answers.py).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import scipy.sparse as sp

from shellform.arrays import Flags, Indices, Reals, Record
from shellform.optimiser.quadratic import LowRank
from shellform.problem.evaluation import Evaluated, Evaluator
from shellform.structure.answers.sensitivity import by_rest_length, element_columns, force_by_stiffness
from shellform.structure.elements.cable import Cables
from shellform.structure.elements.state import State
from shellform.structure.solve.assembly import Assembly


@dataclass(frozen=True, eq=False)
class Setting(Record):
    """Where a step begins: a `point` under the design load, and what moves it.

    y = (tensions (n,) of the present cables; values of the other blocks).

    - `evaluator` of the problem; `state` and `assembly` of the point.
    - `cables` (c,): the present ones, numbered `present` (c,) among the candidates; `length` (c,), m.
    - `tensions`: n, which is c or 0; `tension` (n,), N.
    - `each`: where the rest lengths stand among the problem's variables, None where no block is these;
      `other` (s,): which of the variables are other ones.
    - `pull` (f, n): forces on the free degrees of freedom by the tensions; `right` (f, y): by all of y.
    - `rates` (c + 1, s): of all rest lengths and the radius by the variables.
    """

    evaluator: Evaluator
    assembly: Assembly
    point: Evaluated
    state: State
    cables: Cables
    present: Indices
    tensions: int
    each: slice | None
    other: Flags
    length: Reals
    tension: Reals
    pull: sp.csc_array
    right: sp.csc_array
    rates: sp.csc_array

    @property
    def stiffness(self) -> Reals:
        """EA/l0 (n,), N/m, of the taut cables; 0 of the slack ones."""
        stiffest = (self.cables.stiffness / self.cables.rest_length)[: self.tensions]
        return np.where(self.tension > 0.0, stiffest, 0.0)

    @property
    def parameters(self) -> sp.csr_array:
        """The rates (c or c + 1, s) of the present rest lengths and, where it moves, of the radius."""
        last = self.rates.shape[0] - 1
        kept = np.append(self.present, last) if self.evaluator.blocks.moves_radius else self.present
        return sp.csr_array(sp.csr_array(self.rates)[kept])


@dataclass(frozen=True, eq=False)
class Quadratic(Record):
    """A sum of squares in the model: its `slope` (y,) and Gauss-Newton matrix `hessian` (y, y)."""

    slope: Reals
    hessian: Reals | LowRank


class Answers(Protocol):
    """How the model answers to a change of y. Derivatives by the problem's variables, in their units, or by
    `Setting.parameters` are chained to y by `by_variables` and `by_parameters`."""

    def lengthened(self, change: Reals) -> Reals:
        """The cables' changes (c,), m."""

    def moved(self, change: Reals) -> Reals:
        """The free degrees of freedom's changes (f,)."""

    def parameters_changed(self, change: Reals) -> Reals:
        """Those of `Setting.parameters` (p,), m."""

    def by_variables(self, rows: Reals) -> Reals:
        """(k, y) from (k, s), or (y,) from (s,)."""

    def by_parameters(self, rows: Reals) -> Reals:
        """(k, y) from (k, p)."""

    @property
    def quadratics(self) -> Sequence[Quadratic]:
        """Of the sums of squares under the design load that the answers were made for."""


def setting(evaluator: Evaluator, point: Evaluated) -> Setting:
    """The setting of a step from the point."""
    shell, blocks, design = evaluator.shell, evaluator.blocks, point.design
    state, assembly = point.states[evaluator.base], evaluator.assembly(design)
    cables, present = shell.cables(design), np.flatnonzero(design.present)
    each = blocks.each_cable
    other = np.ones(blocks.size, dtype=bool)
    if each is not None:
        other[each] = False
    count = 0 if each is None else len(present)
    unit, length = cables.directions(state)
    pull = element_columns(assembly, cables.dofs(), np.hstack([-unit, unit]))[:, :count]
    rates = blocks.rates(design)
    right = pull
    if other.any():
        own_forces = _forces(evaluator, assembly, state, point, sp.csr_array(rates)[:, other])
        right = sp.csc_array(sp.hstack([pull, own_forces]))
    return Setting(
        evaluator=evaluator,
        assembly=assembly,
        point=point,
        state=state,
        cables=cables,
        present=present,
        tensions=count,
        each=each,
        other=other,
        length=length,
        tension=cables.tension(state)[:count],
        pull=pull,
        right=right,
        rates=rates,
    )


def _forces(
    evaluator: Evaluator, assembly: Assembly, state: State, point: Evaluated, rate: sp.csr_array
) -> sp.csc_array:
    """(f, v): the internal forces by values that change rest lengths and radius by `rate` (c + 1, v)."""
    shell, design = evaluator.shell, point.design
    result = sp.csc_array((len(assembly.free), rate.shape[1]))
    if rate[:-1].nnz:
        columns = by_rest_length(assembly, state, shell.cables(design))
        result = result + sp.csc_array(columns @ rate[np.flatnonzero(design.present)])
    if rate[[-1]].nnz:
        beams = shell.beams_by_radius(design.radius)
        change = force_by_stiffness(beams, state)[assembly.free]
        result = result + sp.csc_array(change[:, None] * rate[[-1]].toarray())
    return sp.csc_array(result)
