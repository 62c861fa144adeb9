"""The stable branch of one structure under a growing load, followed step by step (standing.py has the
method)."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from shellform.arrays import Reals
from shellform.errors import NotConverged
from shellform.structure.elements.state import State, moved
from shellform.structure.solve.assembly import Assembly
from shellform.structure.solve.equilibrium import TOLERANCE, find_equilibrium
from shellform.structure.solve.outlook import KINK, WINDOW, Outlook, View
from shellform.structure.solve.whole_steps import ON_THE_WAY, Here, WholeSteps

STRAY = 0.01  # of the span from where a step was expected to end: the state belongs to another branch
_PATIENCE = 10  # factorisations of one step
# A step that turns and is as short as a kink counts where it leads back to within a share of its way, in so
# many factorisations.
_RETURNED, _BACK = 0.1, 60


class Branch(WholeSteps):
    """The branch of the structure in the `assembly` under the dead `load` (n, 6), of which no step may stray
    farther than a share of the `span`, m; `spent` counts factorisations."""

    def __init__(self, assembly: Assembly, load: Reals, span: float) -> None:
        super().__init__(assembly)
        self.load, self.span = load, span

    def along(
        self,
        here: Here,
        factor: float,
        most: float,
        step: float,
        smallest: float,
        report: Callable[[float, State], None] | None = None,
        *,
        stops: Sequence[float] = (),
        heeding: bool = False,
    ) -> tuple[Here, float]:
        """The last state on the branch and its load factor, `most` where the branch goes on, from the state
        `here` at the `factor` on; `report` is told each one's load factor and state. At `stops` on the way
        states are as near to equilibrium as at the end. `heeding`: steps that may pass over an unstable
        stretch are halved (outlook.py)."""
        ends = sorted({most, *(each for each in stops if factor < each < most)})
        width, good = step, 0
        outlook = Outlook(self.assembly, self.span, self.measure.mass_shape) if heeding else None
        view = None if outlook is None else self._view(outlook, here, None)
        while factor < most:
            end = next(each for each in ends if each > factor)
            goal = end if factor + width > end - 1e-12 else factor + width
            there = self.step(here, goal, last=goal == end)
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
