"""Path following through limit points (Riks 1979; Crisfield 1981; Ramm 1981), with forces and with imposed
displacements.

All that grows does so with one load factor f: p(f) = base + f·load on the free degrees of freedom, and the
held ones move by f·imposed. Along the path the unknowns are the free degrees of freedom x and f. A step of
Newton's kind solves

    K dx = r + q df,   r = p - internal forces,   q = load - K_held·imposed,
    a·dx = g,

by two solves with one factor of K, dx = u_r + df u_q, and df = (g - a·u_r) / (a·u_q). The last line is what
holds the step to its size s:

    arc length              a = 2 D,  g = s² - D·D     D the translations since the last point (spherical)
    displacement control    a = e_c,  g = s - D_c      degree of freedom c is led
    load control            df = s - (f - f_last)      only to end at a given factor

Near a limit point K is nearly singular, but dx is not. K needn't be positive definite: its factor is L D L',
whose negative pivots count the negative eigenvalues at each point. Where the count changes between two
points, a limit point lies between them if f turns round there, else a bifurcation; it is located by bisecting
the step on that count. Steps follow the curvature of the path: longer where Newton needs few iterations, cut
where it doesn't get there, or where the cubic through both its ends with their rates turns round twice in
between: so long a step leaps from one stable branch to the next, over two limit points. Where no step gets on
from a stable point, as before the kink that a cable makes, the load alone leads on (walk.py).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from shellform.arrays import Reals
from shellform.errors import InputError
from shellform.structure.elements.state import State, extended
from shellform.structure.solve.assembly import Assembly
from shellform.structure.solve.drive import Drive
from shellform.structure.solve.equilibrium import TOLERANCE
from shellform.structure.solve.extended import with_twice_the_digits
from shellform.structure.solve.leaps import kinked
from shellform.structure.solve.outlook import WINDOW, View, turns_between
from shellform.structure.solve.residual import ResidualNorm
from shellform.structure.solve.walk import Doubted, Lead, Missed, OnPath, PathPoint, Walk

_TOO_LONG = "Lead another displacement, go less far, or in Python allow more points."
FIRST = 0.1  # of the goal, the first step's change of the factor
MOST = 500  # points
_EASY = 4  # iterations that leave the step as it is
_LONGEST, _SHORTEST = 2.0, 0.25  # change of the step from one to the next
_SMALLEST = 1e-6  # of the first step
_STIFFER = 4.0  # times as stiff after it: a first step, as long as its goal is far, may have left its branch


def follow(
    assembly: Assembly,
    start: State,
    drive: Drive,
    *,
    goal: float = 1.0,
    lead: Lead | None = None,
    first: float = FIRST,
    most: int = MOST,
    tolerance: float = TOLERANCE,
    events: bool = True,
    heeding: bool = False,
) -> Iterator[PathPoint]:
    """The points of the path from the equilibrium `start` at factor 0, one by one.

    It ends when the factor comes to `goal` for the first time. With a `lead` that degree of freedom is led
    instead, up to its displacement. `first`: the first step, as a share of the goal or of the led
    displacement; `most` points. With `events` limit points and bifurcations are located and given as points
    of their own; `heeding`: steps from a stable point that may pass over an unstable stretch are cut
    (outlook.py). Raises NotConverged with the last state where no step succeeds or the points run out,
    InputError for a held degree of freedom as lead.
    """
    assembly, start = _with_digits(assembly, start, drive.at(goal), tolerance)
    walk = Walk(assembly, start, drive, tolerance, goal, lead)
    here = walk.point(start, 0.0, 0)
    if lead is not None:
        size = first * lead.displacement
        onward = float(np.sign(size * here.tangent[walk.led]))
    else:
        size = first * abs(goal) * float(np.linalg.norm(here.tangent[walk.moving]))
        onward = walk.direction
    here = replace(here, rate=onward * here.rate)
    if size == 0.0 or not np.isfinite(size):
        raise InputError(
            "the goal of a path must not be zero",
            where="path",
            value=goal if lead is None else lead,
            remedy="Give a load factor other than 0, and a load that moves a free node.",
        )
    yield here.point()
    walk.first = abs(size * here.rate)
    view = walk.view(here, None) if heeding else None
    smallest, largest = _SMALLEST * abs(size), _SHORTEST * abs(size)
    began, doubted = False, None
    for _ in range(most):
        try:
            size, there = _onward(walk, here, size, smallest, doubted, began=began)
            doubted = None
            crossing = (here.factor - goal) * (there.factor - goal) <= 0.0 and there.factor != here.factor
            if lead is None and crossing:
                there = walk.at_factor(here, there, goal)
            seen, event = _looked_at(walk, here, view, size, there, events=events)
        except Missed as missed:
            doubted = missed.doubted or doubted
            size *= _SHORTEST
            if abs(size) >= smallest:
                continue
            beyond = _by_load(walk, here, largest, goal) if lead is None else None
            if beyond is None:
                raise walk.gave_up(here, "The path could not be followed further") from None
            there, doubted = beyond, None
            way = float(np.linalg.norm(walk.between(here.state, there.state)))
            size = float(np.copysign(min(largest, max(way, smallest)), size))
            event, seen = None, walk.view(there, view) if heeding else None
        if event is not None:
            yield event
        yield there.point()
        if lead is None:
            if there.factor == goal:
                return
        elif abs(walk.displacement(there.state, lead)) >= abs(lead.displacement) * (1.0 - 1e-9):
            return
        size *= float(np.clip(np.sqrt(_EASY / max(there.iterations, 1)), 0.5, _LONGEST))
        if lead is not None:
            left = lead.displacement - walk.displacement(there.state, lead)
            size = float(np.sign(left)) * min(abs(size), abs(left))
        here, view, began = there, seen, True
    raise walk.gave_up(here, f"The path did not come to its end within {most} points", _TOO_LONG)


def _with_digits(assembly: Assembly, start: State, load: Reals, tolerance: float) -> tuple[Assembly, State]:
    """The assembly and its state, with twice the digits where rounding would hide the load."""
    precise = with_twice_the_digits(assembly)
    if precise is None or not ResidualNorm(assembly).drowns(assembly.evaluate(start), start, load, tolerance):
        return assembly, start
    return precise, extended(start)


def _looked_at(
    walk: Walk, here: OnPath, view: View | None, size: float, there: OnPath, *, events: bool
) -> tuple[View | None, PathPoint | None]:
    """What is to be seen from `there`, where the step is heeded, since there is a `view` from `here`; and,
    where `events` are asked for, the point of the step where the number of negative eigenvalues changes, if
    it does. Raises Missed where it may have passed over an unstable stretch."""
    if view is not None and there.equilibrium.stable:
        return walk.heeded(here, view, there), None
    if not events or there.negative == here.negative:
        return None, None
    found = walk.located(here, size, there)
    if view is not None:
        if found is None and walk.share(here, there) > WINDOW:
            raise Missed
        if found is not None and found[1] is not here:
            walk.heeded(here, view, found[1], critical=True)
    return None, None if found is None else found[0]


def _onward(
    walk: Walk, here: OnPath, size: float, smallest: float, doubted: Doubted, *, began: bool
) -> tuple[float, OnPath]:
    """The step taken and its point; the `doubted` one where a cable's kink lies on the way that no shorter
    one gets over. Raises Missed."""
    try:
        there = walk.step(here, size)
    except Missed:
        if doubted is None or not kinked(walk.assembly, here.state, doubted[1].state):
            raise
        return doubted
    if there.negative == here.negative and (there.factor - here.factor) * here.rate < 0.0:
        raise Missed  # back over a kink that it had to get over
    way = float(np.linalg.norm(walk.between(here.state, there.state)))
    leaps = not began and there.rate * here.rate > _STIFFER * here.rate**2
    if here.negative == there.negative and way > 0.0:
        leaps |= turns_between(here.rate, there.rate, (there.factor - here.factor) / way)
    if leaps and abs(size) * _SHORTEST >= smallest:
        raise Missed((size, there))
    return size, there


def _by_load(walk: Walk, here: OnPath, size: float, goal: float) -> OnPath | None:
    """The point that the load alone leads to, by as much as a step of this `size`, m, takes by the rate at
    `here`, and no farther than to the `goal`; None where it leads to none."""
    end = here.factor + size * here.rate
    if (end - goal) * (here.factor - goal) < 0.0:
        end = goal
    try:
        return walk.by_load(here, end)
    except Missed:
        return None
