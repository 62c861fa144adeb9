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
from the rates K gives at both, then turns round twice in between (`turns_between`). What stiffens a great
deal, and a cable that goes slack, look alike, even in the smallest increment: only where the structure comes
back when it is taken back has nothing snapped. Or it passes over a pair of bifurcations, which its ends
foretell (outlook.py). `heeding` both takes one factorisation more an increment. That the smallest one fails
is no proof that the branch ends, for Newton's steps may miss what lies beyond a cable's kink: the path tells
(settled.py).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from shellform.arrays import Reals
from shellform.errors import NotConverged
from shellform.structure.elements.state import State
from shellform.structure.solve.assembly import Assembly
from shellform.structure.solve.drive import Drive, carried, forces, moved_on
from shellform.structure.solve.equilibrium import LIMIT, TOLERANCE, Equilibrium, find_equilibrium
from shellform.structure.solve.leaps import Watch

STEP = 0.25  # of the whole, the first increment
SMALLEST = 1.0 / 64.0  # of the whole: shorter increments count as the end of the branch
_PATIENCE = 25  # factorisations of one increment; on the branch five or six are enough
_REGROWTH = 2  # good increments before one is doubled again

Reached = Callable[[float, Equilibrium], None]
"""Called with each share of the way that is reached, and the equilibrium there."""


@dataclass(frozen=True, eq=False)
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
    limit: int = LIMIT,
    report: Reached | None = None,
) -> Loaded:
    """The equilibrium at the drive's factor `end`, reached from the equilibrium `start` at the factor
    `begin`.

    Increments are at most `step` and at least `smallest`, shares of the whole. With `stay` the end of the
    stable branch is returned instead of what lies beyond the snap-through: the last stable equilibrium and
    the share of the change that it bears; `heeding`: increments that may pass over an unstable stretch are
    halved too. `report(share, equilibrium)` is called at each accepted increment; `limit` bounds the
    factorisations of what follows a snap-through. Raises NotConverged.
    """
    way = follow_branch(
        assembly,
        start,
        drive,
        begin=begin,
        end=end,
        step=step,
        smallest=smallest,
        tolerance=tolerance,
        heeding=heeding,
        limit=limit,
        report=report,
    )
    return way.ended(assembly, drive, begin, end, tolerance, stay=stay, limit=limit, report=report)


@dataclass(frozen=True, eq=False)
class BranchPart:
    """How far increments have followed the stable branch: up to a `share` of the load change, to the `state`
    that was `found` there, None at the start; `factorisations` spent."""

    share: float
    state: State
    found: Equilibrium | None
    factorisations: int

    def ended(
        self,
        assembly: Assembly,
        drive: Drive,
        begin: float,
        end: float,
        tolerance: float,
        *,
        stay: bool,
        limit: int,
        report: Reached | None,
    ) -> Loaded:
        """The last stable equilibrium where the branch was followed to its end or was to be stayed on, else
        what lies beyond it under the whole load."""
        state, found, spent, at = self.state, self.found, self.factorisations, self.share
        while at < 1.0 and not stay:
            then, at = moved_on(assembly, state, drive, at, begin, end)
            found = find_equilibrium(
                assembly, then, drive.at(begin + at * (end - begin)), tolerance=tolerance, limit=limit
            )
            state, spent = found.state, spent + found.factorisations
            if report is not None:
                report(at, found)
        if found is None or (self.share < 1.0 and stay):
            factor = begin + self.share * (end - begin)
            found = find_equilibrium(assembly, state, drive.at(factor), tolerance=tolerance)
            spent += found.factorisations
        return Loaded(replace(found, factorisations=spent), self.share, spent)


def follow_branch(
    assembly: Assembly,
    start: State,
    drive: Drive,
    *,
    begin: float,
    end: float,
    step: float = STEP,
    smallest: float = SMALLEST,
    tolerance: float,
    heeding: bool,
    limit: int,
    report: Reached | None,
) -> BranchPart:
    """How far increments lead along the stable branch; see `advance`."""
    share, spent, good = 0.0, 0, 0
    state, last = start, None
    width = widest = 1.0 / max(1, round(1.0 / step))
    heeding &= begin != end  # else there is nothing to pass over
    watch = Watch(assembly, drive, max(abs(begin), abs(end)), limit) if heeding else None
    while share < 1.0:
        goal = 1.0 if share + width > 1.0 - 1e-12 else share + width
        factor, change, least = begin + goal * (end - begin), (goal - share) * (end - begin), smallest
        try:
            then, cost = carried(assembly, state, drive, change)
            spent += cost
            found = find_equilibrium(
                assembly, then, drive.at(factor), tolerance=tolerance, limit=_PATIENCE, on_branch=True
            )
            spent += found.factorisations
            reached = found.stable  # converged onto an unstable equilibrium: no branch goes on from there
            if reached and watch is not None:
                shortest = 0.5 * width < smallest
                if watch.leaps(state, found, factor, change, shortest=shortest):
                    reached = False
                elif watch.passes_over(state, found.state, factor, change):
                    reached, least = False, 0.0  # the watch itself lets the shortest ones pass
        except NotConverged as error:
            spent += error.iterations
            reached = False
        if not reached:
            width, good = 0.5 * width, 0
            if width < least:
                break
            continue
        share, state, last, good = goal, found.state, found, good + 1
        if report is not None:
            report(share, found)
        if good == _REGROWTH:
            width, good = min(2.0 * width, widest), 0
    return BranchPart(share, state, last, spent + (0 if watch is None else watch.spent))
