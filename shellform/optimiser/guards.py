"""Cables that a step may not let go slack.

Where a cable goes slack the tangent loses its stiffness at once. Far from collapse that is a kink like
others; but a cable that helps to hold the softest mode under an additional load may leave the shell without
equilibrium, and no derivative tells of it beforehand: that of the mode's stiffness may even promise a rise
(documentation/decisions.md).

A guard is the linear model of those tensions under one load: t + (∂t/∂s) Δs, one adjoint solve for each, kept
from falling below a floor. Of thousands of cables few come down to it in a step: one solve tells what a step
does to all of them, and only those that it would let fall get a solve of their own (proposal.py).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
import scipy.sparse as sp

from shellform.arrays import Indices, Reals, Record
from shellform.structure.answers.sensitivity import (
    Response,
    adjoint,
    by_rest_length,
    by_stiffness,
    respond,
    state_change,
    tension_rows,
)
from shellform.structure.elements.beam import Beams
from shellform.structure.elements.cable import Cables
from shellform.structure.elements.state import State
from shellform.structure.solve.assembly import Assembly
from shellform.structure.solve.factorisation import Symmetric


class Guard(Protocol):
    """The tensions of guarded cables under a load, and how they answer to the design: to the rest lengths of
    the present cables (c,) and, where it is free, to the radius (r,)."""

    @property
    def tension(self) -> Reals:
        """(g,), N."""

    def by_design(self, some: Indices) -> Reals:
        """Derivatives (k, c + r), N/m, of some of the tensions."""

    def changed(self, design: Reals) -> Reals:
        """Changes (g,), N, of the tensions by a change (c + r,), m, of the design."""


@dataclass(frozen=True, eq=False)
class WholeGuard(Record):
    """With all derivatives as a dense matrix, `tension_by_design` (g, c + r), N/m."""

    tension: Reals
    tension_by_design: Reals

    def by_design(self, some: Indices) -> Reals:
        """(k, c + r), N/m."""
        return self.tension_by_design[some]

    def changed(self, design: Reals) -> Reals:
        """(g,), N."""
        return np.asarray(self.tension_by_design @ design)


@dataclass(frozen=True, eq=False)
class SolvedGuard(Record):
    """With solves when they are asked for, in the equilibrium of the `response`. The guarded cables are
    numbered `near` (g,) among those present; `by_state` (g, f) and `by_own` (g,), N/m, are their tensions'
    derivatives by the free degrees of freedom and by their own rest lengths."""

    tension: Reals
    near: Indices
    response: Response
    by_state: sp.csr_array
    by_own: Reals

    def by_design(self, some: Indices) -> Reals:
        """(k, c + r), N/m."""
        result = adjoint(self.response, self.by_state[some])
        result[np.arange(len(some)), self.near[some]] += self.by_own[some]
        return result

    def changed(self, design: Reals) -> Reals:
        """(g,), N."""
        return np.asarray(
            self.by_state @ state_change(self.response, design) + self.by_own * design[self.near]
        )


def solved_guard(
    assembly: Assembly, state: State, cables: Cables, reach: float, *rates: Beams
) -> SolvedGuard:
    """The guard of the cables with tensions between 0 and `reach`, N, in the stable `state`; `rates` are the
    beams' by a free radius.

    Raises NotPositiveDefinite.
    """
    guard = _guard(assembly, state, cables, reach, *rates)
    tangent, shared = guard.response.tangent, guard.response.family
    # a family of its own, whose factor serves as long as the guard does
    own = Symmetric(shared.indptr, shared.indices)
    return replace(guard, response=replace(guard.response, family=own, factor=own.factor(tangent)))


def whole_guard(assembly: Assembly, state: State, cables: Cables, reach: float, *rates: Beams) -> WholeGuard:
    """The same with dense matrices."""
    guard = _guard(assembly, state, cables, reach, *rates)
    return WholeGuard(guard.tension, guard.by_design(np.arange(len(guard.tension))))


def _guard(assembly: Assembly, state: State, cables: Cables, reach: float, *rates: Beams) -> SolvedGuard:
    """The guard until the next factorisation in the assembly."""
    response = respond(
        assembly, state, by_rest_length(assembly, state, cables), by_stiffness(assembly, state, *rates)
    )
    tension = cables.tension(state)
    near = np.flatnonzero((tension > 0.0) & (tension < reach))
    by_own = cables.tension_by_rest_length(state)[near]
    return SolvedGuard(tension[near], near, response, tension_rows(assembly, state, cables)[near], by_own)
