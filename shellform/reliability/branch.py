"""The stable branch of one structure under a growing load, followed step by step (standing.py has the method)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from shellform.arrays import Reals
from shellform.structure.elements.state import State, moved
from shellform.structure.solve.assembly import Assembly, Balance
from shellform.structure.solve.equilibrium import TOLERANCE, TURN
from shellform.structure.solve.factorisation import Factor, NotPositiveDefinite
from shellform.structure.solve.residual import STAGNANT, ResidualNorm, held

STRAY = 0.01  # of the span from where a step was expected to end: the state belongs to another branch
ON_THE_WAY = 1e-5  # residual of states between, from which the next step starts
_PATIENCE = 10  # factorisations of one step
_FAR_OFF = 5.0  # rad, a step that leads nowhere

Report = Callable[[float, State], None]


@dataclass(frozen=True)
class Here:
    """A state on the stable branch with its balance and its tangent's factor, good until the next one is
    made.
    """

    state: State
    balance: Balance
    factor: Factor


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
        report: Report | None = None,
    ) -> tuple[Here, float]:
        """The last state on the branch and its load factor, `most` where the branch goes on, from the state
        `here` at the `factor` on; `report` is told each one's load factor and state."""
        width, good = step, 0
        while factor < most:
            goal = most if factor + width > most - 1e-12 else factor + width
            there = self.step(here, goal, last=goal == most)
            if there is None:
                width, good = 0.5 * width, 0
                again = self.at(here.state)  # its factor was replaced
                assert again is not None
                here = again
                if width < smallest:
                    break
                continue
            here, factor, good = there, goal, good + 1
            if report is not None:
                report(factor, here.state)
            if good == 2:
                width, good = min(2.0 * width, step), 0
        return here, factor

    def step(self, here: Here, goal: float, *, last: bool) -> Here | None:
        """From a state on the branch to the load factor `goal`."""
        load = goal * self.load
        change = self._solved(here, load)
        if change is None:
            return None
        begin = moved(here.state, self.assembly.chords.corrected(here.state, change))
        tolerance = TOLERANCE if last else ON_THE_WAY
        found = self.newton(begin, load, limit=_PATIENCE, tolerance=tolerance)
        if found is None:
            return None
        stray = float(np.abs(found.state.positions - begin.positions).max())
        return found if stray <= STRAY * self.span else None

    def newton(self, begin: State, load: Reals, *, limit: int, tolerance: float) -> Here | None:
        """The equilibrium to which whole steps of Newton's lead from `begin` with every tangent positive
        definite, the last one included; None where one isn't. Where rounding leaves more than the tolerance,
        what it leaves counts as none as far as it would on the way."""
        own, state, before = self.assembly, begin, np.inf
        for _ in range(limit):
            here = self.at(state)
            if here is None:
                return None
            residual = self.measure.residual(here.balance, load)
            noise = self.measure.rounding(here.balance, state, load) if residual > STAGNANT * before else 0.0
            if residual <= max(tolerance, min(noise, ON_THE_WAY)):
                return here
            before = residual
            change = self._solved(here, load)
            if change is None:
                return None
            state = moved(state, own.chords.corrected(state, change))
        return None

    def at(self, state: State) -> Here | None:
        """The state with its tangent's factor; None where that isn't positive definite."""
        balance = self.assembly.evaluate(state)
        self.spent += 1
        try:
            factor = self.assembly.matrix.factor(held(self.assembly, balance))
        except NotPositiveDefinite:
            return None
        return Here(state, balance, factor)

    def _solved(self, here: Here, load: Reals) -> Reals | None:
        """Newton's step (n, 6), no spin beyond TURN; None where it leads nowhere."""
        step = np.zeros(6 * self.assembly.count)
        free = self.assembly.free
        step[free] = here.factor.solve((load - here.balance.force).ravel()[free])
        change = step.reshape(-1, 6)
        spin = float(np.abs(change[:, 3:]).max())
        if not spin <= _FAR_OFF:
            return None
        return change * (TURN / spin) if spin > TURN else change
