"""The stable branch of one structure under a growing load, followed step by step (standing.py has the
method)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from shellform.arrays import Reals
from shellform.errors import NotConverged
from shellform.structure.elements.state import State, moved
from shellform.structure.solve.assembly import Assembly, Balance
from shellform.structure.solve.equilibrium import TOLERANCE, TURN, find_equilibrium
from shellform.structure.solve.factorisation import Factor, NotPositiveDefinite
from shellform.structure.solve.outlook import KINK, WINDOW, Outlook, View
from shellform.structure.solve.residual import STAGNANT, ResidualNorm, held

STRAY = 0.01  # of the span from where a step was expected to end: the state belongs to another branch
ON_THE_WAY = 1e-5  # residual of states between, from which the next step starts
_PATIENCE = 10  # factorisations of one step
_FAR_OFF = 5.0  # rad, a step that leads nowhere
_EASED, _HALF = 0.1, 0.5  # of a mass that is left after a step, at first and at most
# A step that turns and is as short as a kink counts where it leads back to within a share of its way, in so
# many factorisations.
_RETURNED, _BACK = 0.1, 60
_LEAST, _MOST = 0.01, 1e4  # of the first mass: less is none, and more leads nowhere

Foreseen = tuple[Reals, ...] | None  # deformations of each part of beams


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


class Branch:
    """The branch of the structure in the `assembly` under the dead `load` (n, 6), of which no step may stray
    farther than a share of the `span`, m; `spent` counts factorisations."""

    def __init__(self, assembly: Assembly, load: Reals, span: float) -> None:
        self.assembly, self.load, self.span = assembly, load, span
        self.measure = ResidualNorm(assembly)
        self.spent = 0

    def along(
        self,
        here: Here,
        factor: float,
        most: float,
        step: float,
        smallest: float,
        report: Callable[[float, State], None] | None = None,
        *,
        heeding: bool = False,
    ) -> tuple[Here, float]:
        """The last state on the branch and its load factor, `most` where the branch goes on, from the state
        `here` at the `factor` on; `report` is told each one's load factor and state. `heeding`: steps that
        may pass over an unstable stretch are halved (outlook.py)."""
        width, good = step, 0
        outlook = Outlook(self.assembly, self.span, self.measure.mass_shape) if heeding else None
        view = None if outlook is None else self._view(outlook, here, None)
        while factor < most:
            goal = most if factor + width > most - 1e-12 else factor + width
            there = self.step(here, goal, last=goal == most)
            onward = None
            if there is not None and outlook is not None and view is not None:
                onward = self._view(outlook, there, view)
                there = self._heeded(outlook, view, onward, there, (factor, goal))
            if there is None:
                width, good = 0.5 * width, 0
                again = self.at(here.state)  # its factor was replaced
                assert again is not None
                here = again
                if width < (smallest if onward is None else min(smallest, WINDOW)):
                    break
                continue
            here, factor, view, good = there, goal, onward, good + 1
            if report is not None:
                report(factor, here.state)
            if good == 2:
                width, good = min(2.0 * width, step), 0
        return here, factor

    def _view(self, outlook: Outlook, here: Here, before: View | None) -> View:
        """What is to be seen from a state, by the load factor."""
        assert here.balance.tangent is not None
        onward = self.assembly.by_node(here.factor.solve(self.load.ravel()[self.assembly.free]))
        return outlook.view(here.state, here.balance.tangent, here.factor, onward, before)

    def _heeded(
        self, outlook: Outlook, before: View, after: View, there: Here, factors: tuple[float, float]
    ) -> Here | None:
        """The state `there` to which a step has led from one view to the other, between load `factors`; None
        where it may have passed over an unstable stretch."""
        width = factors[1] - factors[0]
        if outlook.turns(before, after, width):
            if width > KINK or not self._returns(before, after, factors[0]):
                return None
            return self.at(there.state)  # its factor was replaced
        return None if outlook.passes_over(before, after, width, width) else there

    def _returns(self, before: View, after: View, factor: float) -> bool:
        """Whether the structure comes back to the state before a step where its load is taken back to the
        `factor`: on one branch it does, with all kinks that cables make. Both are brought to rest, for what
        is left unbalanced ON_THE_WAY takes a soft structure far."""
        places = []
        for state in (before.state, after.state):
            try:
                rest = find_equilibrium(self.assembly, state, factor * self.load, limit=_BACK)
            except NotConverged as error:
                self.spent += error.iterations
                return False
            self.spent += rest.factorisations
            places.append(rest.state.positions)
        way, off = (float(np.linalg.norm(each - places[0])) for each in (after.state.positions, places[1]))
        return off <= _RETURNED * way

    def step(self, here: Here, goal: float, *, last: bool) -> Here | None:
        """From a state on the branch to the load factor `goal`."""
        load = goal * self.load
        change = self._solved(here.factor, here.balance, load)
        if change is None:
            return None
        begin = moved(here.state, self.assembly.chords.corrected(here.state, change))
        tolerance = TOLERANCE if last else ON_THE_WAY
        foreseen = self.foreseen(here.state, here.balance.turned, change)
        found = self.newton(begin, load, limit=_PATIENCE, tolerance=tolerance, foreseen=foreseen)
        if found is None:
            return None
        stray = float(np.abs(found.state.positions - begin.positions).max())
        return found if stray <= STRAY * self.span else None

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
