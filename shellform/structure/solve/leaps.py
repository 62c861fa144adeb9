"""What an increment of the load may have passed over on its way (loading.py has the method)."""

from __future__ import annotations

import numpy as np

from shellform.arrays import Reals
from shellform.errors import NotConverged
from shellform.structure.elements.state import State
from shellform.structure.solve.assembly import Assembly
from shellform.structure.solve.drive import Drive, carried
from shellform.structure.solve.equilibrium import Equilibrium, find_equilibrium
from shellform.structure.solve.extended import fit_for
from shellform.structure.solve.factorisation import Factor, NotPositiveDefinite
from shellform.structure.solve.outlook import WINDOW, Outlook, View
from shellform.structure.solve.residual import ResidualNorm, held

_RETURNED = 0.1  # of the way of an increment, as near as it comes to its begin from its end unless it leapt
_STRAIGHT = 5  # factorisations that an increment takes at the most …
_NEAR = 0.02  # … and of the extent, that its nodes move, which leaps over nothing
_BALANCED = 1e-5  # residual up to which a state from which increments begin is in equilibrium


class Watch:
    """What increments of the `drive` may have passed over; `most` is the largest size of its factor, `limit`
    bounds the factorisations of a way back, and `spent` counts those of what is seen."""

    def __init__(self, assembly: Assembly, drive: Drive, most: float, limit: int) -> None:
        self.assembly, self.drive, self.most, self.limit = assembly, drive, most, limit
        self.spent = 0
        self._views: tuple[View, ...] = ()  # from the ends of the increment looked at last

    def leaps(
        self, before: State, found: Equilibrium, factor: float, change: float, *, shortest: bool
    ) -> bool:
        """Whether an increment by a `change` of the load factor up to this one has leapt; `shortest`: it
        can't be halved any more, so that it is taken back."""
        given = before, found.state, factor, change
        if found.factorisations <= _STRAIGHT and not _far(before, found.state):
            return False
        return self._may_leap(*given) and not (
            shortest and _returns(self.assembly, before, found.state, self.drive, factor, change, self.limit)
        )

    def _may_leap(self, before: State, after: State, factor: float, change: float) -> bool:
        """Whether an increment from one state to the other may have leapt over an unstable stretch. Where not
        both its ends are to be seen, that tells nothing."""
        ends = self._ends(before, after, factor, change)
        return ends is not None and _outlook(fit_for(self.assembly, after), after).turns(*ends, change)

    def passes_over(self, before: State, after: State, factor: float, change: float) -> bool:
        """Whether the increment may have passed over what its ends foretell."""
        share = abs(change) / self.most
        if share <= WINDOW:
            return False
        ends = self._ends(before, after, factor, change)
        return ends is not None and _outlook(fit_for(self.assembly, after), after).passes_over(
            *ends, change, share
        )

    def _ends(self, before: State, after: State, factor: float, change: float) -> tuple[View, View] | None:
        """What is to be seen from both ends of an increment; None where one of them isn't in equilibrium, or
        has more digits than the other, so that the motion at that one lacks some."""
        alike = (before.tail is None) == (after.tail is None)
        begin = self._seen(before, factor - change, None)
        then = self._seen(after, factor, begin if alike else None)
        self._views = tuple(each for each in (begin, then) if each is not None)
        return (begin, then) if alike and begin is not None and then is not None else None

    def _seen(self, state: State, factor: float, before: View | None) -> View | None:
        """What is to be seen from a state by the load factor, after the view `before`; None where it isn't in
        equilibrium."""
        known = next((each for each in self._views if each.state is state), None)
        if known is not None or not at_rest(self.assembly, state, self.drive.at(factor)):
            return known
        self.spent += 1
        found = _motion(self.assembly, state, self.drive)
        if found is None:
            return None
        values, matrix, motion = found
        return _outlook(fit_for(self.assembly, state), state).view(state, values, matrix, motion, before)


def _outlook(assembly: Assembly, state: State) -> Outlook:
    span = float(np.ptp(state.positions, axis=0).max())
    return Outlook(assembly, span, ResidualNorm(assembly).mass_shape)


def kinked(assembly: Assembly, before: State, after: State) -> bool:
    """Whether a cable goes slack or taut from one state to the other."""
    return any(
        np.any((cables.lengths(before) > cables.rest_length) != (cables.lengths(after) > cables.rest_length))
        for cables in assembly.cables
    )


def _far(before: State, after: State) -> bool:
    """Whether a node moves so far that the increment may have leapt over something."""
    way = np.linalg.norm(after.positions - before.positions, axis=1).max()
    return bool(way > _NEAR * np.ptp(before.positions, axis=0).max())


def at_rest(assembly: Assembly, state: State, load: Reals) -> bool:
    """Whether the state is in equilibrium, which that of a prestressed model without a start isn't."""
    return ResidualNorm(assembly).residual(assembly.evaluate(state, tangent=False), load) < _BALANCED


def _motion(assembly: Assembly, state: State, drive: Drive) -> tuple[Reals, Factor, Reals] | None:
    """The tangent's lower values, its factor, and how all nodes move (n, 6) with the load factor by it, m and
    rad; None where it isn't positive definite, and where no node is free."""
    if not len(assembly.free):
        return None
    own = fit_for(assembly, state)
    grows = drive.load - assembly.force_along(state, drive.imposed) if drive.moves_supports else drive.load
    motion, balance = drive.imposed.ravel().copy(), own.evaluate(state)
    assert balance.tangent is not None
    try:
        factor = own.matrix.factor(held(own, balance))
    except NotPositiveDefinite:
        return None
    motion[assembly.free] = factor.solve(grows.ravel()[assembly.free])
    return balance.tangent, factor, motion.reshape(-1, 6)


def _returns(
    assembly: Assembly, before: State, after: State, drive: Drive, factor: float, change: float, limit: int
) -> bool:
    """Whether the state `after` an increment to the load factor comes back to the one `before` it where the
    `change` of the factor is taken back: on one branch it does, with all kinks that cables make, and from
    another one it doesn't."""
    try:
        back, _ = carried(assembly, after, drive, -change)
        there = find_equilibrium(assembly, back, drive.at(factor - change), limit=limit)
    except NotConverged:
        return False
    off = np.linalg.norm(there.state.positions - before.positions)
    return bool(off <= _RETURNED * np.linalg.norm(after.positions - before.positions))
