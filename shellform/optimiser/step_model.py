"""The convex model of one step: the design problem in the cables' tensions, and in what else is varied.

Near an equilibrium under the design load, let the tensions t of all candidate cables and the other variables
r (the rod radius, a user's own) vary instead of the rest lengths. With the tensions given, cables have no
stiffness of their own; with B = ∂f/∂t (each cable's unit pull on its ends), D = EA/l0 of the taut cables and
K = K_t + B D B' the tangent, the state answers by

    X = dx/dt = -K_t⁻¹ B = -K⁻¹ B (I - D B' K⁻¹ B)⁻¹,     dx/dr = -K_t⁻¹ ∂f/∂r,

all from one block solve with the factor of K (Woodbury; whole_answers.py), or where cables are thousands,
each answer from a solve with a factor of K_t (solved_answers.py). The cables' lengths follow as dl = B' dx,
and a rest length of

    l0 = EA l / (EA + t)

gives the tension t at length l. In these variables the problem is nearly convex: the sum of tensions is
linear and a cable dies exactly at t = 0, a bound instead of a kink; a sum of squares q'q, as the misfit d'd,
is quadratic with the Gauss-Newton matrix (Q X)'(Q X), Q = ∂q/∂x; limits on cable forces are bounds too.

A cable without tension gets the longest rest length allowed, so that it doesn't quietly help under other
loads; it can come back. Where no block of variables is the rest lengths of all cables one by one, the model
keeps to the variables' own values, and X = -K⁻¹ ∂f/∂r.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shellform.arrays import Reals, Record
from shellform.gridshell.gridshell import Design
from shellform.optimiser.solved_answers import solved_answers
from shellform.optimiser.step_setting import Answers, Quadratic, setting
from shellform.optimiser.whole_answers import whole_answers
from shellform.problem.evaluation import Evaluated, Evaluator, Linearisation
from shellform.problem.terms import Squares
from shellform.structure.elements.state import State, moved
from shellform.structure.solve.assembly import Assembly

_DEAD = 1e-6  # of the cables' stiffness: a tension below it counts as none


@dataclass(frozen=True, eq=False)
class StepModel(Record):
    """The model at a `point`, in y = (tensions (c,), N, of the present cables; values of the other blocks).

    - `evaluator` of the problem; `assembly` and `state` of the point under the design load.
    - `tensions`: how many of y are tensions, c or none.
    - `shortest`, `longest` (c,), m: bounds of the rest lengths; `length` (c,), m: of the cables as they lie.
    - `origin`, `lower`, `upper` (y,): the point and its bounds; `step` (y - c,): the largest changes of the
      other values.
    - `answers`: of nodes and cables to changes of y.
    - `constraints_by_y` (k, y): derivatives.
    - `quadratics`: of each term of the objective, None where it has none.
    """

    evaluator: Evaluator
    assembly: Assembly
    point: Linearisation
    state: State
    tensions: int
    shortest: Reals
    longest: Reals
    origin: Reals
    lower: Reals
    upper: Reals
    step: Reals
    length: Reals
    answers: Answers
    constraints_by_y: Reals
    quadratics: tuple[Quadratic | None, ...]

    def design(self, y: Reals) -> Design:
        """The design of y. Its rest lengths keep their bounds, whatever the lengths are that a model leads to
        which is linear: of a soft shell they may come below zero."""
        blocks, made = self.evaluator.blocks, self.point.design
        first = self.tensions
        for block, own in zip(blocks.variables, blocks.slices, strict=True):
            if block.of_each_cable and self.tensions:
                rest = made.rest_length.copy()
                rest[made.present] = np.clip(self._rest_lengths(y), self.shortest, self.longest)
                values = rest
            else:
                last = first + own.stop - own.start
                values, first = y[first:last], last
            made = block.applied(blocks.shell, made, values)
        return made

    def predicted(self, y: Reals) -> State:
        """Where the change to y takes the design load's equilibrium, to first order."""
        step = self.assembly.by_node(self.answers.moved(y - self.origin))
        return moved(self.state, self.assembly.chords.corrected(self.state, step))

    def constraints_at(self, y: Reals) -> Reals:
        """(k,): the constraints' linear model. Linear in y: in the rest lengths a cable that dies leaps to
        the longest one."""
        return self.point.constraints + self.constraints_by_y @ (y - self.origin)

    def _rest_lengths(self, y: Reals) -> Reals:
        """Rest lengths (c,), m, that the model gives to the tensions of y."""
        stiffness = self.evaluator.shell.cable.stiffness
        tension = y[: self.tensions]
        length = self.length + self.answers.lengthened(y - self.origin)
        return np.where(tension > _DEAD * stiffness, stiffness * length / (stiffness + tension), self.longest)


def step_model(evaluator: Evaluator, point: Evaluated, *, whole: bool) -> StepModel:
    """The model at the point, with dense matrices if it is to be `whole`. Its answers take as long as the
    point's derivatives, beside which they are worked out."""
    shell, blocks, design = evaluator.shell, evaluator.blocks, point.design
    at = setting(evaluator, point)
    residuals, numbers = _sums_of_squares(evaluator, point)

    def answered() -> Answers:
        return whole_answers(at, residuals) if whole else solved_answers(at, residuals)

    linear, answers = evaluator.linearised_beside(point, answered)
    values = blocks.values(design)
    lower, upper = blocks.value_bounds()
    shortest, longest = (
        np.zeros(0) if at.each is None else side[at.each][at.present] for side in (lower, upper)
    )
    count, length = at.tensions, at.length[: at.tensions]
    return StepModel(
        evaluator=evaluator,
        assembly=at.assembly,
        point=linear,
        state=at.state,
        tensions=count,
        shortest=shortest,
        longest=longest,
        origin=np.append(at.tension, values[at.other]),
        lower=np.append(np.zeros(count), lower[at.other]),
        upper=np.append(shell.cable.stiffness * (length / shortest - 1.0), upper[at.other]),
        step=blocks.step(design)[at.other],
        length=length,
        answers=answers,
        constraints_by_y=answers.by_variables(linear.constraints_by_variables),
        quadratics=tuple(None if k is None else answers.quadratics[k] for k in numbers),
    )


def _sums_of_squares(evaluator: Evaluator, point: Evaluated) -> tuple[list[Squares], list[int | None]]:
    """The sums of squares in the objective under the design load, with residuals of their own each; and which
    of them each term of the objective is, None where it is none."""
    found: list[Squares] = []
    numbers: list[int | None] = []
    for part, measurement in zip(evaluator.problem.minimise, point.summands, strict=True):
        own, number = measurement.squares, None
        if own is not None and part.term.load == evaluator.base:
            number = next((k for k, each in enumerate(found) if _same(own, each)), len(found))
            if number == len(found):
                found.append(own)
        numbers.append(number)
    return found, numbers


def _same(one: Squares, other: Squares) -> bool:
    return one.by_dof.shape == other.by_dof.shape and bool(
        np.array_equal(one.residual, other.residual) and (one.by_dof != other.by_dof).nnz == 0
    )
