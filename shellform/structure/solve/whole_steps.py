"""Newton's whole steps, in a mixed form, to the equilibrium next to a state on its stable branch.

A step of a slender rod stretches it by second-order terms, which the next tangent takes for axial forces, and
every second iteration only takes them away again. In a mixed form, of Magisano, Leonetti and Garcea (2017),
the deformations that the last linear system foresaw are unknowns of their own: the tangent is theirs
(Assembly.tangent_of), the forces are the state's. That takes two thirds to three quarters of the
factorisations. No step is shortened and no potential looked at: that every tangent is positive definite is
all that says that the branch hasn't been left, so whoever takes long steps looks at their ends besides.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from shellform.arrays import Reals
from shellform.errors import NotConverged
from shellform.structure.elements.state import State, moved
from shellform.structure.solve.assembly import Assembly, Balance
from shellform.structure.solve.equilibrium import LIMIT, TOLERANCE, TURN, Equilibrium, find_equilibrium
from shellform.structure.solve.factorisation import Factor, NotPositiveDefinite
from shellform.structure.solve.residual import STAGNANT, ResidualNorm, Turning, held, overturned

ON_THE_WAY = 1e-5  # residual of states between, from which the next step starts
_PATIENCE = 10  # factorisations, after which relaxation looks for the equilibrium
_FAR_OFF = 5.0  # rad, a step that leads nowhere
_EASED, _HALF = 0.1, 0.5  # of a mass that is left after a step, at first and at most
_LEAST, _MOST = 0.01, 1e4  # of the first mass: less is none, and more leads nowhere

Foreseen = tuple[Reals, ...] | None  # deformations of each part of beams


def next_equilibrium(
    assembly: Assembly, start: State, load: Reals, *, tolerance: float = TOLERANCE, limit: int = LIMIT
) -> Equilibrium:
    """The stable equilibrium next to the state `start` under the dead `load` (n, 6), N and N·m, by whole
    steps and, where these lose definiteness or don't come to rest, by relaxation on the branch.

    `limit` bounds the factorisations of the latter. Raises NotConverged, LostBranch where definiteness is
    lost.
    """
    spent = 0
    if start.tail is None and not len(Turning(assembly, load).nodes):
        steps = WholeSteps(assembly)
        here = steps.newton(start, load, limit=_PATIENCE, tolerance=tolerance)
        spent = steps.spent
        if here is not None and steps.counts(start, here.state, here.balance, load, tolerance):
            residual = steps.measure.residual(here.balance, load)
            return Equilibrium(here.state, here.balance.energy, residual, spent, True, 0)
    try:
        found = find_equilibrium(assembly, start, load, tolerance=tolerance, limit=limit, on_branch=True)
    except NotConverged as error:
        error.iterations += spent
        raise
    return replace(found, factorisations=spent + found.factorisations)


@dataclass(frozen=True, eq=False)
class Here:
    """A state on the stable branch with its balance and its tangent's factor, good until the next one is
    made.
    """

    state: State
    balance: Balance
    factor: Factor


class Mass:
    """What is added to tangents that aren't positive definite, N/m, times the shape of implicit dynamic
    relaxation's mass (equilibrium.py). It begins with what the `largest` force, N, takes away of the
    stiffness across an element of a usual `length`, m, and is a tenth after each step, or more where a tenth
    has been too little."""

    def __init__(self, largest: float, length: float) -> None:
        self.value = 0.0
        self._first = self._next = largest / length
        self._left = _EASED

    def grow(self) -> bool:
        """Makes it larger; False where that leads nowhere."""
        self.value = self.value / self._left if self.value > 0.0 else self._next
        self._left = min(self._left**0.5, _HALF)
        return 0.0 < self.value <= _MOST * self._first

    def ease(self) -> None:
        """Makes it smaller after a step, in the end none."""
        self._next = _LEAST * self._first
        self.value = self._left * self.value if self._left * self.value > self._next else 0.0


class WholeSteps:
    """Of the structure in the `assembly`; `measure` tells how far it is from rest, `spent` counts
    factorisations."""

    def __init__(self, assembly: Assembly) -> None:
        self.assembly = assembly
        self.measure = ResidualNorm(assembly)
        self.spent = 0

    def counts(self, start: State, state: State, balance: Balance, load: Reals, tolerance: float) -> bool:
        """Whether the state to which steps have led from `start`, with its `balance`, is told to be in
        equilibrium under the `load`, rounding aside, and no element has turned too far on the way."""
        residual = self.measure.residual(balance, load)
        if not self.measure.balanced(residual, balance, state, load, tolerance, stagnant=False):
            return False
        if balance.turned == 0.0:
            return True
        was = self.assembly.evaluate(start, tangent=False).turned
        return not overturned(self.assembly, start, was, state, balance.turned)

    def newton(
        self,
        begin: State,
        load: Reals,
        *,
        limit: int,
        tolerance: float,
        foreseen: Foreseen = None,
        damped: bool = False,
    ) -> Here | None:
        """The equilibrium to which whole steps of Newton's lead from `begin` with every tangent that is made
        positive definite, that of the equilibrium included; None where one isn't. `damped`: those on the way
        that aren't are made so by a mass, which shortens steps. Where rounding leaves more than the
        tolerance, what it leaves counts as none as far as it would on the way. Tangents on the way are those
        of the deformations that were `foreseen`, by the step that led to `begin` and then by each one
        (Assembly.tangent_of); the equilibrium's is its own."""
        own, state, before, factor, mass = self.assembly, begin, np.inf, None, None
        for _ in range(limit):
            balance = own.evaluate(state, tangent=False)
            if damped and mass is None:
                mass = Mass(balance.largest, float(own.arms.mean()))
            residual = self.measure.residual(balance, load)
            if residual <= tolerance:
                return self.at(state)
            # A step that has brought so much brings as much again with the tangent that it was made with.
            heavy = mass is not None and mass.value > 0.0
            if factor is None or heavy or residual * (residual / before) > tolerance:
                balance = replace(balance, tangent=self._tangent(state, balance, foreseen))
                noise = self.measure.rounding(balance, state, load) if residual > STAGNANT * before else 0.0
                if residual <= min(noise, ON_THE_WAY):
                    return self.at(state)
                factor = self._factor(balance, mass)
            before = residual
            change = None if factor is None else self._solved(factor, balance, load)
            if change is None:
                return None
            if mass is not None:
                mass.ease()
            foreseen = self.foreseen(state, balance.turned, change)
            state = moved(state, change)
        return None

    def foreseen(self, state: State, turned: float, change: Reals) -> Foreseen:
        """The deformations to which a step (n, 6) leads by its linear system; None where they aren't known:
        where a beam is turned far, or coordinates have twice the digits."""
        if turned > 0.0 or state.tail is not None:
            return None
        return self.assembly.foreseen(state, change)

    def _tangent(self, state: State, balance: Balance, foreseen: Foreseen) -> Reals:
        if foreseen is None or balance.turned > 0.0:
            values = self.assembly.evaluate(state).tangent
            assert values is not None
            return values
        return self.assembly.tangent_of(state, foreseen)

    def at(self, state: State) -> Here | None:
        """The state with its tangent's factor; None where that isn't positive definite."""
        balance = self.assembly.evaluate(state)
        factor = self._factor(balance)
        return None if factor is None else Here(state, balance, factor)

    def _factor(self, balance: Balance, mass: Mass | None = None) -> Factor | None:
        """Of the balance's tangent; None where it isn't positive definite, or with a `mass` that may grow no
        more."""
        matrix, values = self.assembly.matrix, held(self.assembly, balance)
        while True:
            raised = values
            if mass is not None and mass.value > 0.0:
                raised = matrix.raised(values, matrix.diagonal, mass.value * self.measure.mass_shape)
            self.spent += 1
            try:
                return matrix.factor(raised)
            except NotPositiveDefinite:
                if mass is None or not mass.grow():
                    return None

    def _solved(self, factor: Factor, balance: Balance, load: Reals) -> Reals | None:
        """Newton's step (n, 6), no spin beyond TURN; None where it leads nowhere."""
        unbalanced = (load - balance.force).ravel()[self.assembly.free]
        change = self.assembly.by_node(factor.solve(unbalanced))
        spin = float(np.abs(change[:, 3:]).max())
        if not spin <= _FAR_OFF:
            return None
        return change * (TURN / spin) if spin > TURN else change
