"""Loading step by step along one documented path.

Slender structures have many equilibria; which one is meant is a matter of how the load came on. The path
here: from an equilibrium, loads and imposed displacements change together in increments (`STEP` of the whole
unless said otherwise); each is solved from the one before by steps that may not lose definiteness on the way
(`on_branch`). Where they do, or where many steps are needed, the increment is halved, down to `SMALLEST` of
the whole; after two that succeed it is doubled again. Where even the smallest fails the stable branch has
ended; the rest is then applied at once, supports being moved no farther at a time than no element folds, and
implicit dynamic relaxation follows the snap-through to wherever it ends. So the same start and load always
lead to the same state. Supports that move take the free nodes along by the tangent, K dx = -K_held d, before
the steps begin.

An increment may be so wide that its steps leap over an unstable stretch and meet nothing on their way that
isn't definite: a truss of von Mises that bears 0.38 is at rest under 1.0 beyond its snap, with positive
definite tangents only. The cubic of the load factor over the way between both states, from the factors and
from the rates K gives at both, then turns round twice in between (`turns_between`); `heeding` that takes one
factorisation more an increment. What stiffens a great deal, and a cable that goes slack, look alike, even in
the smallest increment: only where the structure comes back when it is taken back has nothing snapped.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from shellform.arrays import Reals
from shellform.errors import NotConverged
from shellform.structure.elements.state import State, moved
from shellform.structure.solve.assembly import Assembly
from shellform.structure.solve.equilibrium import TOLERANCE, Equilibrium, find_equilibrium
from shellform.structure.solve.extended import fit_for
from shellform.structure.solve.factorisation import NotPositiveDefinite
from shellform.structure.solve.residual import ResidualNorm, held, overturned

STEP = 0.25
SMALLEST = 1.0 / 64.0
_PATIENCE = 25  # factorisations of one increment; on the branch five or six are enough
_RETURNED = 0.1  # of the way of an increment, as near as it comes to its begin from its end unless it leapt
_LEAST = 1e-6  # of the whole, by which supports move on at least where the branch has ended
_LAST_DIGITS = 1e-15  # of a load, which nothing can be told from
_STRAIGHT = 5  # factorisations that an increment takes at the most …
_NEAR = 0.02  # … and of the extent, that its nodes move, which leaps over nothing
_BALANCED = 1e-5  # residual up to which a state from which increments begin is in equilibrium
_REGROWTH = 2  # good increments before one is doubled again

Reached = Callable[[float, Equilibrium], None]
"""Called with each share of the way that is reached, and the equilibrium there."""


@dataclass(frozen=True)
class Drive:
    """What grows with the load factor: dead `load` (n, 6), N and N·m, and the motion `imposed` (n, 6) of held
    degrees of freedom, m and rad (turns about fixed axes); `base` (n, 6) is there all the time."""

    load: Reals
    imposed: Reals
    base: Reals

    def at(self, factor: float) -> Reals:
        """The dead load (n, 6) at the factor; nothing where base and load cancel to their last digits."""
        grown = factor * self.load
        total = self.base + grown
        total[np.abs(total) <= _LAST_DIGITS * np.abs(grown)] = 0.0
        return total

    @property
    def moves_supports(self) -> bool:
        """Whether held degrees of freedom move."""
        return bool(self.imposed.any())


def forces(load: Reals, *, base: Reals | None = None) -> Drive:
    """A load (n, 6) that grows alone, on top of `base` (n, 6)."""
    none = np.zeros_like(load)
    return Drive(load, none, none if base is None else base)


@dataclass(frozen=True)
class Loaded:
    """The equilibrium under the whole load; `share` of the load change up to which the stable branch was
    followed (1: to the end); `factorisations` of all increments."""

    equilibrium: Equilibrium
    share: float
    factorisations: int

    @property
    def on_branch(self) -> bool:
        """Whether the state lies on the stable branch from the start."""
        return self.share == 1.0


def apply_load(
    assembly: Assembly,
    start: State,
    before: Reals,
    after: Reals,
    *,
    step: float = STEP,
    smallest: float = SMALLEST,
    tolerance: float = TOLERANCE,
    stay: bool = False,
    heeding: bool = False,
    report: Reached | None = None,
) -> Loaded:
    """The equilibrium under the load `after` (n, 6), reached from the equilibrium `start` under the load
    `before`; see `advance`.
    """
    return advance(
        assembly,
        start,
        forces(after - before, base=before),
        step=step,
        smallest=smallest,
        tolerance=tolerance,
        stay=stay,
        heeding=heeding,
        report=report,
    )


def advance(
    assembly: Assembly,
    start: State,
    drive: Drive,
    *,
    begin: float = 0.0,
    end: float = 1.0,
    step: float = STEP,
    smallest: float = SMALLEST,
    tolerance: float = TOLERANCE,
    stay: bool = False,
    heeding: bool = False,
    limit: int = 1000,
    report: Reached | None = None,
) -> Loaded:
    """The equilibrium at the drive's factor `end`, reached from the equilibrium `start` at the factor
    `begin`.

    Increments are at most `step` and at least `smallest`, shares of the whole. With `stay` the end of the
    stable branch is returned instead of what lies beyond the snap-through: the last stable equilibrium and
    the share of the change that it bears; `heeding`: increments that leap over an unstable stretch are halved
    too. `report(share, equilibrium)` is called at each accepted increment; `limit` bounds the factorisations
    of what follows a snap-through. Raises NotConverged.
    """
    share, spent, good = 0.0, 0, 0
    state, found = start, None
    width = widest = 1.0 / max(1, round(1.0 / step))
    while share < 1.0:
        goal = 1.0 if share + width > 1.0 - 1e-12 else share + width
        factor = begin + goal * (end - begin)
        try:
            then, cost = _carried(assembly, state, drive, (goal - share) * (end - begin))
            spent += cost
            found = find_equilibrium(
                assembly, then, drive.at(factor), tolerance=tolerance, limit=_PATIENCE, on_branch=True
            )
            spent += found.factorisations
            reached = found.stable  # converged onto an unstable equilibrium: no branch goes on from there
            if reached and heeding and (found.factorisations > _STRAIGHT or _far(state, found.state)):
                change = (goal - share) * (end - begin)
                if _may_leap(assembly, state, found.state, drive, factor, change):
                    reached = 0.5 * width < smallest and _returns(
                        assembly, state, found.state, drive, factor, change, limit
                    )
        except NotConverged as error:
            spent += error.iterations
            reached = False
        if not reached:
            width, good = 0.5 * width, 0
            if width < smallest:
                break
            continue
        assert found is not None
        share, state, good = goal, found.state, good + 1
        if report is not None:
            report(share, found)
        if good == _REGROWTH:
            width, good = min(2.0 * width, widest), 0
    if share < 1.0 and not stay:
        at = share
        while True:
            then, at = _moved_on(assembly, state, drive, at, begin, end)
            found = find_equilibrium(
                assembly, then, drive.at(begin + at * (end - begin)), tolerance=tolerance, limit=limit
            )
            state, spent = found.state, spent + found.factorisations
            if report is not None:
                report(at, found)
            if at == 1.0:
                break
    elif share < 1.0 or found is None:
        found = find_equilibrium(
            assembly, state, drive.at(begin + share * (end - begin)), tolerance=tolerance
        )
        spent += found.factorisations
    return Loaded(replace(found, factorisations=spent), share, spent)


def turns_between(before: float, after: float, mean: float) -> bool:
    """Whether a cubic with the slopes `before` and `after`, of one sign, at its ends, and the `mean` slope
    from one to the other, has slopes of the other sign on its way."""
    # At the share t of the way its slope is before - 2 half t + square t².
    half, square = 2.0 * before + after - 3.0 * mean, 3.0 * (before + after - 2.0 * mean)
    if not (before * after > 0.0 and before * square > 0.0):
        return False
    return 0.0 < half / square < 1.0 and half * half > before * square


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


def _alike(before: State, after: State) -> bool:
    """Whether both states have the same number of digits; else the motion at one of them lacks some."""
    return (before.tail is None) == (after.tail is None)


def _at_rest(assembly: Assembly, state: State, load: Reals) -> bool:
    """Whether the state is in equilibrium, which that of a prestressed model without a start isn't."""
    return ResidualNorm(assembly).residual(assembly.evaluate(state, tangent=False), load) < _BALANCED


def _motion(assembly: Assembly, state: State, drive: Drive) -> Reals | None:
    """How all nodes move (n, 3) with the load factor, m, by the tangent; None where that isn't positive
    definite."""
    own = fit_for(assembly, state)
    grows = drive.load - assembly.force_along(state, drive.imposed) if drive.moves_supports else drive.load
    motion = drive.imposed.ravel().copy()
    try:
        factor = own.matrix.factor(held(own, own.evaluate(state)))
    except NotPositiveDefinite:
        return None
    motion[assembly.free] = factor.solve(grows.ravel()[assembly.free])
    return motion.reshape(-1, 6)[:, :3]


def _may_leap(
    assembly: Assembly, before: State, after: State, drive: Drive, factor: float, change: float
) -> bool:
    """Whether an increment from one state to the other, by a `change` of the load factor up to this one, may
    have leapt over an unstable stretch: whether the cubic through both, with the rates at which the nodes
    move there, turns back. A state that isn't in equilibrium before, or has other digits, tells nothing."""
    if not _alike(before, after) or not _at_rest(assembly, before, drive.at(factor - change)):
        return False
    way = after.positions - before.positions
    length, rates = float(np.linalg.norm(way)), []
    for state in (before, after):
        motion = _motion(assembly, state, drive)
        rate = 0.0 if motion is None else float(np.einsum("ij,ij", way, motion))
        if length == 0.0 or rate == 0.0:
            return False
        rates.append(length / rate)
    return turns_between(rates[0], rates[1], change / length)


def _returns(
    assembly: Assembly, before: State, after: State, drive: Drive, factor: float, change: float, limit: int
) -> bool:
    """Whether the state `after` an increment to the load factor comes back to the one `before` it where the
    `change` of the factor is taken back: on one branch it does, with all kinks that cables make, and from
    another one it doesn't."""
    try:
        back, _ = _carried(assembly, after, drive, -change)
        there = find_equilibrium(assembly, back, drive.at(factor - change), limit=limit)
    except NotConverged:
        return False
    off = np.linalg.norm(there.state.positions - before.positions)
    return bool(off <= _RETURNED * np.linalg.norm(after.positions - before.positions))


def _moved_on(
    assembly: Assembly, state: State, drive: Drive, share: float, begin: float, end: float
) -> tuple[State, float]:
    """The state with the supports moved on from a share of the whole, to its end or as far as they turn no
    element too far and halve the length of none, and the share reached. Raises NotConverged where they can't
    move.
    """
    goal = 1.0
    while True:
        change = (goal - share) * (end - begin)
        then = _with_supports(state, drive, change)
        turned = drive.moves_supports and turns_half(change * drive.imposed)
        if not drive.moves_supports or not (turned or _folded(assembly, state, then)):
            return then, goal
        goal = share + 0.5 * (goal - share)
        if goal - share < _LEAST:
            raise NotConverged(
                "Supports that move fold an element",
                state=state,
                remedy="Apply the motion in more increments, or divide the rods into more elements.",
            )


def turns_half(motion: Reals) -> bool:
    """Whether a motion (n, 6), m and rad, turns a node by half a turn or more: the state after it doesn't
    tell which way, or how often, it went round."""
    return bool(np.linalg.norm(motion[:, 3:], axis=1).max(initial=0.0) >= np.pi)


def _folded(assembly: Assembly, before: State, after: State) -> bool:
    """Whether moving supports turn an element too far or halve its length."""
    was, turned = (assembly.evaluate(each, tangent=False).turned for each in (before, after))
    return assembly.chords.halved(before, after) or overturned(assembly, before, was, after, turned)


def _with_supports(state: State, drive: Drive, change: float) -> State:
    return moved(state, change * drive.imposed) if drive.moves_supports else state


def _carried(assembly: Assembly, state: State, drive: Drive, change: float) -> tuple[State, int]:
    """The state with the supports moved by the change of the factor and the free nodes along with them, and
    factorisations spent. Raises NotConverged where that folds an element.
    """
    if not drive.moves_supports:
        return state, 0
    motion = change * drive.imposed
    pull = -assembly.force_along(state, motion).ravel()[assembly.free]
    step = motion.ravel().copy()
    try:
        own = fit_for(assembly, state)
        step[assembly.free] = own.matrix.factor(held(own, own.evaluate(state))).solve(pull)
    except NotPositiveDefinite:
        then = _with_supports(state, drive, change)
    else:
        then = moved(state, assembly.chords.corrected(state, step.reshape(-1, 6)))
    if turns_half(step.reshape(-1, 6)) or _folded(assembly, state, then):
        raise NotConverged(
            "Supports that move fold an element",
            state=state,
            iterations=1,
            remedy="Move them by less, or in more stops.",
        )
    return then, 1
