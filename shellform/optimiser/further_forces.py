"""Bounds of a step's tensions by limits on cable forces under loads beside the design load.

Under the design load these limits are bounds of the tensions t themselves. Under another load a cable at
present pulls by

    d = EA (l' / l0 - l / l0)

more, l and l' being its lengths under the two, and is bounded as if it did so after the step: t + d <= limit.
The limit is one smooth value for all cables (problem/engineering.py), and its slope knows of those alone that
are near it already. Steps that are held by that slope only take others up to their bounds under the design
load, and beyond the limit under the other one, whatever their window. Where k cables come to the limit at
once, the smooth value lies a share ln k / q above it, 2 % for a hundred: so much lower are the bounds set,
round after round, until the smooth value of t + d keeps the limit.
"""

from __future__ import annotations

from dataclasses import dataclass

from shellform.arrays import Reals, Record
from shellform.optimiser.step_model import StepModel
from shellform.problem.engineering import LargestCableForce

ROUNDS = 3  # in which bounds are lowered: after two the smooth value is within a thousandth
_KEPT = 0.003  # of the limit, left for what d changes by in the step


@dataclass(frozen=True, eq=False)
class FurtherForce(Record):
    """A limit of the largest cable force under another load: the `term`, the `most` that it may be, N, and
    what cables pull there `more` (c,), N, than under the design load."""

    term: LargestCableForce
    most: float
    more: Reals

    def upper(self, reserve: float) -> Reals:
        """Bounds (c,), N, of tensions under the design load, a `reserve`, N, below the limit."""
        return self.most - reserve - self.more

    def beyond(self, tensions: Reals) -> float:
        """By how much, N, `tensions` (c,), N, under the design load come beyond the limit, or nearer to it
        than they may; negative where they don't."""
        return self.term.of(tensions + self.more) - (1.0 - _KEPT) * self.most


def further_forces(model: StepModel) -> list[FurtherForce]:
    """The limits of a step from the model's point; none where tensions aren't varied."""
    evaluator, point = model.evaluator, model.point
    limits = [
        (part.term, part.upper)
        for part in evaluator.problem.constraints
        if isinstance(part.term, LargestCableForce)
    ]
    if not model.tensions or not limits:
        return []
    ties = evaluator.shell.cables(point.design)
    before = ties.lengths(point.states[evaluator.base])

    def more(load: str) -> Reals:
        return ties.stiffness / ties.rest_length * (ties.lengths(point.states[load]) - before)

    return [FurtherForce(term, most, more(term.load)) for term, most in limits]
