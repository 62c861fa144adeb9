"""A load along the stable branch, by increments and, where these end, by the path.

Increments (loading.py) end where Newton's steps lose definiteness or don't come to rest, however short they
are. So they do where the branch ends, but also beyond the kink of a cable that goes slack or taut, where a
structure gets thousands of times as soft or as stiff. So the path is followed from the last stable state on
(path.py): where it comes to the whole load without a point that isn't stable, the branch hasn't ended.

A model whose parts pull at one another as it is drawn, as a rod that a shorter cable bends to a bow, isn't on
a branch there: it comes to rest without load first (`prestressed`).
"""

from __future__ import annotations

from dataclasses import replace

from shellform.arrays import Reals
from shellform.errors import NotConverged
from shellform.structure.elements.state import State
from shellform.structure.solve.assembly import Assembly
from shellform.structure.solve.drive import Drive
from shellform.structure.solve.equilibrium import LIMIT, TOLERANCE, Equilibrium, Relaxing, find_equilibrium
from shellform.structure.solve.leaps import at_rest
from shellform.structure.solve.loading import SMALLEST, BranchPart, Loaded, Reached, follow_branch
from shellform.structure.solve.path import FIRST, follow
from shellform.structure.solve.residual import ResidualNorm


def settle(
    assembly: Assembly,
    start: State,
    drive: Drive,
    *,
    begin: float = 0.0,
    end: float = 1.0,
    tolerance: float = TOLERANCE,
    stay: bool = False,
    limit: int = LIMIT,
    report: Reached | None = None,
) -> Loaded:
    """As `advance`, heeding what increments may pass over; the stable branch ends where the path says so,
    too, or can't be followed."""
    way = follow_branch(
        assembly,
        start,
        drive,
        begin=begin,
        end=end,
        tolerance=tolerance,
        heeding=True,
        limit=limit,
        report=report,
    )
    if way.share < 1.0:
        way = _along_path(assembly, way, drive, begin, end, tolerance, report)
    return way.ended(assembly, drive, begin, end, tolerance, stay=stay, limit=limit, report=report)


def prestressed(
    assembly: Assembly,
    state: State,
    load: Reals,
    *,
    tolerance: float,
    limit: int = LIMIT,
    progress: Relaxing | None = None,
) -> tuple[Equilibrium | None, int]:
    """The equilibrium to which a state comes that isn't one under the `load` (n, 6), mostly none, and
    factorisations spent; None where the state is one itself, and where no stable one is found."""
    measure, balance = ResidualNorm(assembly), assembly.evaluate(state)
    residual = measure.residual(balance, load)
    if measure.balanced(residual, balance, state, load, tolerance, stagnant=True):
        return None, 0
    try:
        found = find_equilibrium(assembly, state, load, tolerance=tolerance, limit=limit, progress=progress)
    except NotConverged as error:
        return None, error.iterations
    return found if found.stable else None, found.factorisations


def _along_path(
    assembly: Assembly,
    way: BranchPart,
    drive: Drive,
    begin: float,
    end: float,
    tolerance: float,
    report: Reached | None,
) -> BranchPart:
    """The way followed to its end where the path from there on is stable up to it, else as it is but for the
    factorisations."""
    here, share = begin + way.share * (end - begin), way.share
    base, change = drive.at(here), end - here
    if not at_rest(assembly, way.state, base):
        return way
    rest, passed, spent = Drive(change * drive.load, change * drive.imposed, base), [], 0
    if not (rest.moves_supports or rest.load.ravel()[assembly.free].any()):
        return way  # without a load there is no path
    first = min(FIRST, SMALLEST / (1.0 - share))
    try:
        for point in follow(
            assembly, way.state, rest, first=first, tolerance=tolerance, events=False, heeding=True
        ):
            found = point.equilibrium
            before, spent = spent, found.factorisations
            if not found.stable:
                break
            own = replace(found, factorisations=spent - before)  # a path counts from its start
            passed.append((share + point.factor * (1.0 - share), own))
    except NotConverged as error:
        spent = error.iterations
    spent += way.factorisations
    if not passed or passed[-1][0] < 1.0:
        return replace(way, factorisations=spent)
    if report is not None:
        for each in passed[1:]:
            report(*each)
    last = passed[-1][1]
    return BranchPart(1.0, last.state, last, spent)
