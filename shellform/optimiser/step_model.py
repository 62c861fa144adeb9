"""The convex model of one step: the design problem in the cables' tensions, and in what else is varied.

Near an equilibrium under the design load, let the tensions t of all candidate cables and the other variables
r (the rod radius, a user's own) vary instead of the rest lengths. With the tensions given, cables have no
stiffness of their own; with B = ∂f/∂t (each cable's unit pull on its ends), D = EA/l0 of the taut cables and
K = K_t + B D B' the tangent, the state answers by

    X = dx/dt = -K_t⁻¹ B = -K⁻¹ B (I - D B' K⁻¹ B)⁻¹,     dx/dr = -K_t⁻¹ ∂f/∂r,

all from one block solve with the factor of K (Woodbury). The cables' lengths follow as dl = B' dx, and a rest
length of

    l0 = EA l / (EA + t)

gives the tension t at length l. In these variables the problem is nearly convex: the sum of tensions is
linear and a cable dies exactly at t = 0, a bound instead of a kink; a sum of squares q'q, as the misfit d'd,
is quadratic with the Gauss-Newton matrix (Q X)'(Q X), Q = ∂q/∂x; limits on cable forces are bounds too. X
itself, a dense matrix of all degrees of freedom, is never kept: its columns are solved for in blocks, of
which only what the model needs stays.

A cable without tension gets the longest rest length allowed, so that it doesn't quietly help under other
loads; it can come back. Where no block of variables is the rest lengths of all cables one by one, the model
keeps to the variables' own values, and X = -K⁻¹ ∂f/∂r.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from shellform.arrays import Reals
from shellform.gridshell.gridshell import Design
from shellform.problem.evaluation import Evaluator, Linearisation
from shellform.problem.terms import Squares
from shellform.structure.answers.sensitivity import by_rest_length, element_columns
from shellform.structure.elements.state import State, moved
from shellform.structure.solve.assembly import Assembly

_BLOCK = 256  # columns solved for at once
_DEAD = 1e-6  # of the cables' stiffness: a tension below it counts as none


@dataclass(frozen=True)
class Quadratic:
    """A sum of squares in the model: its `slope` (y,) and Gauss-Newton matrix `hessian` (y, y)."""

    slope: Reals
    hessian: Reals


@dataclass(frozen=True)
class StepModel:
    """The model at a `point`, in y = (tensions (c,), N, of the present cables; values of the other blocks).

    `tensions`: how many of y are tensions, c or none; `state` under the design load; `longest` (c,), m, upper
    bounds of the rest lengths. `origin`, `lower`, `upper` (y,): the point and its bounds; `step` (y - c,) the
    largest changes of the other values. `length` (c,), m, and `length_by_y` (c, y); `variables_by_y` (s, y)
    of the problem's variables; `parameters_by_y` (c or c + 1, y) of the present rest lengths and, where it
    moves, the radius; `constraints_by_y` (k, y). `quadratics`: of each term of the objective, None where it
    has none. `pull` (f, y), the forces on the free degrees of freedom by y, and `middle` (c, y), the changes
    of tension that make K's answer to them K_t's.
    """

    evaluator: Evaluator
    assembly: Assembly
    point: Linearisation
    state: State
    tensions: int
    longest: Reals
    origin: Reals
    lower: Reals
    upper: Reals
    step: Reals
    length: Reals
    length_by_y: Reals
    variables_by_y: Reals
    parameters_by_y: Reals
    constraints_by_y: Reals
    quadratics: tuple[Quadratic | None, ...]
    pull: sp.csc_array
    middle: Reals

    def design(self, y: Reals) -> Design:
        """The design of y."""
        blocks, made = self.evaluator.blocks, self.point.design
        first = self.tensions
        for block, own in zip(blocks.variables, blocks.slices, strict=True):
            if block.of_each_cable and self.tensions:
                rest = made.rest_length.copy()
                rest[made.present] = np.minimum(self._rest_lengths(y), self.longest)
                values = rest
            else:
                last = first + own.stop - own.start
                values, first = y[first:last], last
            made = block.applied(blocks.shell, made, values)
        return made

    def predicted(self, y: Reals) -> State:
        """Where the change to y takes the design load's equilibrium, to first order."""
        whole = np.zeros(6 * self.assembly.count)
        change = y - self.origin
        force = self.pull @ change + self.pull[:, : self.tensions] @ (self.middle @ change)
        whole[self.assembly.free] = -self.assembly.factor(self.state).solve(force)
        return moved(self.state, self.assembly.chords.corrected(self.state, whole.reshape(-1, 6)))

    def constraints_at(self, y: Reals) -> Reals:
        """(k,): the constraints' linear model. Linear in y: in the rest lengths a cable that dies leaps to
        the longest one."""
        return self.point.constraints + self.constraints_by_y @ (y - self.origin)

    def _rest_lengths(self, y: Reals) -> Reals:
        """Rest lengths (c,), m, that the model gives to the tensions of y."""
        stiffness = self.evaluator.shell.cable.stiffness
        tension = y[: self.tensions]
        length = self.length + self.length_by_y @ (y - self.origin)
        return np.where(tension > _DEAD * stiffness, stiffness * length / (stiffness + tension), self.longest)


def step_model(evaluator: Evaluator, point: Linearisation) -> StepModel:
    """The model at the point."""
    shell, blocks, design = evaluator.shell, evaluator.blocks, point.design
    state, assembly = point.states[evaluator.base], evaluator.assembly(design)
    cables, present = shell.cables(design), np.flatnonzero(design.present)
    each = blocks.each_cable
    other = np.ones(blocks.size, dtype=bool)
    if each is not None:
        other[each] = False
    count = 0 if each is None else len(present)
    chord = state.positions[cables.ends[:, 1]] - state.positions[cables.ends[:, 0]]
    length = np.linalg.norm(chord, axis=1)
    unit = chord / length[:, None]
    pull = element_columns(assembly, cables.dofs(), np.hstack([-unit, unit]))[:, :count]
    rates = blocks.rates(design)
    right = pull
    if other.any():
        rate = sp.csr_array(rates)[:, other]
        own_forces = _forces(evaluator, assembly, state, design, rate)
        right = sp.csc_array(sp.hstack([pull, own_forces]))
    tension = cables.tension(state)[:count]
    stiffness = np.where(tension > 0.0, (cables.stiffness / cables.rest_length)[:count], 0.0)
    residuals = _distinct(evaluator, point)
    coupling, moved_by = _solved(assembly, state, pull, right, [each.by_dof for each in residuals])
    # K_t⁻¹ R = K⁻¹ R + K⁻¹ B (I - D B' K⁻¹ B)⁻¹ D B' K⁻¹ R, for R the pulls and the others' forces alike.
    middle: Reals = np.asarray(
        np.linalg.solve(
            np.eye(count) - stiffness[:, None] * coupling[:, :count], stiffness[:, None] * coupling
        )
    )
    length_by_y = -(coupling + coupling[:, :count] @ middle)
    # K_t⁻¹ R = K⁻¹ R T with T = I + (middle; 0), so that X'X = T' (K⁻¹ R)' (K⁻¹ R) T.
    whole = np.eye(right.shape[1])
    whole[:count] += middle

    values_by_y = np.zeros((blocks.size, right.shape[1]))
    if each is not None:
        ea = shell.cable.stiffness
        rest_by_y = (ea / (ea + tension))[:, None] * length_by_y
        rest_by_y[:, :count] -= np.diag(ea * length / (ea + tension) ** 2)
        # A dead cable at its longest stays there until it is given tension, which its own column then asks
        # for at full length.
        values_by_y[each.start + present] = rest_by_y
    values_by_y[other, count:] = np.eye(int(other.sum()))
    variables_by_y = values_by_y / blocks.unit[:, None]
    kept = np.append(present, rates.shape[0] - 1) if blocks.moves_radius else present
    values = blocks.values(design)
    lower, upper = blocks.value_bounds()
    shortest, longest = (np.zeros(0) if each is None else side[each][present] for side in (lower, upper))
    return StepModel(
        evaluator,
        assembly,
        point,
        state,
        count,
        longest,
        np.append(tension, values[other]),
        np.append(np.zeros(count), lower[other]),
        np.append(shell.cable.stiffness * (length[:count] / shortest - 1.0), upper[other]),
        blocks.step(design)[other],
        length[:count],
        length_by_y,
        variables_by_y,
        np.asarray(sp.csr_array(rates)[kept] @ values_by_y),
        point.constraints_by_variables @ variables_by_y,
        _quadratics(evaluator, point, residuals, moved_by, whole),
        right,
        middle,
    )


def _forces(
    evaluator: Evaluator, assembly: Assembly, state: State, design: Design, rate: sp.csr_array
) -> sp.csc_array:
    """(f, v): the internal forces by values that change rest lengths and radius by `rate` (c + 1, v)."""
    shell = evaluator.shell
    result = sp.csc_array((len(assembly.free), rate.shape[1]))
    if rate[:-1].nnz:
        columns = by_rest_length(assembly, state, shell.cables(design))
        result = result + sp.csc_array(columns @ rate[np.flatnonzero(design.present)])
    if rate[[-1]].nnz:
        beams = shell.beams_by_radius(design.radius)
        change = np.zeros(6 * assembly.count)
        np.add.at(change, beams.dofs(), beams.evaluate(state, tangent=False).force)
        result = result + sp.csc_array(change[assembly.free][:, None] * rate[[-1]].toarray())
    return sp.csc_array(result)


def _distinct(evaluator: Evaluator, point: Linearisation) -> list[Squares]:
    """The sums of squares in the objective under the design load, with residuals of their own each."""
    found: list[Squares] = []
    for part, measurement in zip(evaluator.problem.minimise, point.measurements, strict=True):
        own = measurement.squares
        if (
            own is not None
            and part.term.load == evaluator.base
            and not any(_same(own, each) for each in found)
        ):
            found.append(own)
    return found


def _same(one: Squares, other: Squares) -> bool:
    return one.by_dof.shape == other.by_dof.shape and bool(
        np.array_equal(one.residual, other.residual) and (one.by_dof != other.by_dof).nnz == 0
    )


def _quadratics(
    evaluator: Evaluator,
    point: Linearisation,
    residuals: Sequence[Squares],
    moved_by: Sequence[tuple[np.ndarray, Reals]],
    whole: Reals,
) -> tuple[Quadratic | None, ...]:
    made = [
        Quadratic(
            -2.0 * (squares.residual[rows] @ by_force) @ whole,
            2.0 * whole.T @ (by_force.T @ by_force) @ whole,
        )
        for squares, (rows, by_force) in zip(residuals, moved_by, strict=True)
    ]
    result: list[Quadratic | None] = []
    for part, measurement in zip(evaluator.problem.minimise, point.measurements, strict=True):
        own = measurement.squares
        known = own is not None and part.term.load == evaluator.base
        result.append(
            next(made[k] for k, each in enumerate(residuals) if own is not None and _same(own, each))
            if known
            else None
        )
    return tuple(result)


def _solved(
    assembly: Assembly, state: State, pull: sp.csc_array, right: sp.csc_array, residuals: list[sp.csr_array]
) -> tuple[Reals, list[tuple[np.ndarray, Reals]]]:
    """B' K⁻¹ R (c, y), and for each kind of residuals the numbers (m,) of those that move and their Q K⁻¹ R
    (m, y)."""
    factor = assembly.factor(state)
    coupling = np.empty((pull.shape[1], right.shape[1]))
    moved_by = []
    for by_dof in residuals:
        rows = sp.csr_array(by_dof.tocsc()[:, assembly.free])
        moving = np.flatnonzero(np.diff(rows.indptr))
        moved_by.append((moving, rows[moving], np.empty((len(moving), right.shape[1]), order="F")))
    for first in range(0, right.shape[1], _BLOCK):
        own = slice(first, min(first + _BLOCK, right.shape[1]))
        solved = factor.solve(np.asfortranarray(right[:, own].toarray()))
        coupling[:, own] = pull.T @ solved
        for _, rows, result in moved_by:
            result[:, own] = rows @ solved
    return coupling, [(moving, result) for moving, _, result in moved_by]
