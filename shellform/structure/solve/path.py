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
where it doesn't get there, or where the cubic through both its ends with their rates turns round twice in between:
so long a step leaps from one stable branch to the next, over two limit points.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from shellform.arrays import Indices, Reals
from shellform.errors import InputError, NotConverged
from shellform.structure.elements import rotation
from shellform.structure.elements.state import State, extended, moved
from shellform.structure.solve.assembly import Assembly, Balance
from shellform.structure.solve.equilibrium import TOLERANCE, TURN, Equilibrium
from shellform.structure.solve.extended import with_twice_the_digits
from shellform.structure.solve.factorisation import Indefinite
from shellform.structure.solve.loading import Drive, kinked, turns_between
from shellform.structure.solve.residual import STAGNANT, ResidualNorm, Turning, held, overturned

FIRST = 0.1  # of the goal, the first step's change of the factor
MOST = 500  # points
_ITERATIONS = 12  # of Newton in one step
_EASY = 4  # iterations that leave the step as it is
_LONGEST, _SHORTEST = 2.0, 0.25  # change of the step from one to the next
_SMALLEST = 1e-6  # of the first step
_STIFFER = 4.0  # times as stiff after it: a first step, as long as its goal is far, may have left its branch
_BISECTIONS = 30
_LOCATED = 1e-7  # of the factor, as near as an event is located


Lead = tuple[int, int, float]
"""A degree of freedom that leads: the node, the axis 0 to 2, its displacement, m."""


@dataclass(frozen=True)
class PathPoint:
    """A converged point of the path: load `factor`; `equilibrium`; `rate`, the change of the factor with the
    path's length (1/m, negative where the load falls); `event`: "", "limit point" or "bifurcation"."""

    factor: float
    equilibrium: Equilibrium
    rate: float
    event: str = ""


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
) -> Iterator[PathPoint]:
    """The points of the path from the equilibrium `start` at factor 0, one by one.

    It ends when the factor comes to `goal` for the first time. With a `lead` that degree of freedom is led instead, up
    to its displacement. `first`: the first step, as a share of the goal or of the led displacement; `most` points. With
    `events` limit points and bifurcations are located and given as points of their own. Raises NotConverged with the last state where no step succeeds
    or the points run out, InputError for a held degree of freedom as lead.
    """
    precise = with_twice_the_digits(assembly)
    load, measure = drive.at(goal), ResidualNorm(assembly)
    if precise is not None and measure.drowns(assembly.evaluate(start), start, load, tolerance):
        assembly, start = precise, extended(start)
    walk = _Path(assembly, start, drive, tolerance, goal, lead)
    here = walk.point(start, 0.0, 0)
    if lead is not None:
        size = first * lead[2]
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
    smallest = _SMALLEST * abs(size)
    last: Reals | None = None
    doubted: _Doubted = None
    for _ in range(most):
        try:
            size, there = _onward(walk, here, size, last, smallest, doubted)
            doubted = None
            crossing = (here.factor - goal) * (there.factor - goal) <= 0.0 and there.factor != here.factor
            if lead is None and crossing:
                there = walk.at_factor(here, there, goal)
        except _Missed as missed:
            doubted = missed.doubted or doubted
            size *= _SHORTEST
            if abs(size) < smallest:
                raise walk.gave_up(here, "The path could not be followed further") from None
            continue
        if events and there.negative != here.negative:
            event = walk.located(here, size, last, there)
            if event is not None:
                yield event
        yield there.point()
        if lead is None:
            if there.factor == goal:
                return
        elif abs(walk.displacement(there.state, lead)) >= abs(lead[2]) * (1.0 - 1e-9):
            return
        last = walk.between(here.state, there.state)
        size *= float(np.clip(np.sqrt(_EASY / max(there.iterations, 1)), 0.5, _LONGEST))
        if lead is not None:
            left = lead[2] - walk.displacement(there.state, lead)
            size = float(np.sign(left)) * min(abs(size), abs(left))
        here = there
    raise walk.gave_up(here, f"The path did not come to its end within {most} points")


def _onward(
    walk: _Path, here: _Here, size: float, last: Reals | None, smallest: float, doubted: _Doubted
) -> tuple[float, _Here]:
    """The step taken and its point; the `doubted` one where a cable's kink lies on the way that no shorter one gets over.
    Raises _Missed."""
    try:
        there = walk.step(here, size, last)
    except _Missed:
        if doubted is None or not kinked(walk.assembly, here.state, doubted[1].state):
            raise
        return doubted
    way = float(np.linalg.norm(walk.between(here.state, there.state)))
    leaps = last is None and there.rate * here.rate > _STIFFER * here.rate**2
    if here.negative == there.negative and way > 0.0:
        leaps |= turns_between(here.rate, there.rate, (there.factor - here.factor) / way)
    if leaps and abs(size) * _SHORTEST >= smallest:
        raise _Missed((size, there))
    return size, there


class _Missed(Exception):
    """A step found no point, or a `doubted` one, with its size, that may lie beyond a leap."""

    def __init__(self, doubted: _Doubted = None) -> None:
        self.doubted = doubted


@dataclass(frozen=True)
class _Here:
    """A point with what the next step needs: `tangent` (f,), the change of the free degrees of freedom with
    the factor.
    """

    state: State
    factor: float
    equilibrium: Equilibrium
    tangent: Reals
    rate: float
    iterations: int
    turned: float

    @property
    def negative(self) -> int:
        """How many pivots of the tangent are."""
        return self.equilibrium.negative

    def point(self) -> PathPoint:
        """What is told of it."""
        return PathPoint(self.factor, self.equilibrium, self.rate)


_Doubted = tuple[float, _Here] | None
"""A step that may have leapt, and where it led."""


class _Path:
    """The path of the `assembly` under a `drive` from the state `start`, and what was found of it on the way: `spent`
    factorisations, the `largest` factor come to, and whether only rotations move (`by_turns`). The number of the degree of
    freedom that is `led` among the free ones, None where none is; the `direction` of the first step, 1 or -1."""

    def __init__(
        self, assembly: Assembly, start: State, drive: Drive, tolerance: float, goal: float, lead: Lead | None
    ) -> None:
        self.assembly, self.drive, self.tolerance, self.start = assembly, drive, tolerance, start
        self.measure = ResidualNorm(assembly)
        self.turning = Turning(assembly, drive.load + drive.base)
        self.moving = assembly.free % 6 < 3
        self.by_turns = False
        self.spent = 0
        self.largest = abs(goal) if lead is None else 0.0  # of the factors come to
        self.led = None if lead is None else self.number(lead)
        self.direction = 1.0 if lead is not None or goal > 0.0 else -1.0

    def number(self, lead: Lead) -> int:
        """Place among the free degrees of freedom of the one that leads."""
        found = np.flatnonzero(self.assembly.free == 6 * lead[0] + lead[1])
        if not len(found):
            raise InputError(
                "is held or doesn't exist; only a free displacement can lead",
                where="path",
                value=lead[:2],
                remedy="Choose a node that is free along that axis.",
            )
        return int(found[0])

    def displacement(self, state: State, lead: Lead) -> float:
        """Of the degree of freedom that leads, m, since the start."""
        return float(state.positions[lead[0], lead[1]] - self.start.positions[lead[0], lead[1]])

    def between(self, before: State, after: State) -> Reals:
        """Translations (t,) of the free degrees of freedom from one state to the other; rotation vectors where
        nothing else moves.
        """
        if self.by_turns:
            back = before.quaternions * [1.0, -1.0, -1.0, -1.0]
            turned = rotation.to_vectors(rotation.product(after.quaternions, back))
            return turned.ravel()[self._flat()]
        return (after.positions - before.positions).ravel()[self._flat()]

    def point(self, state: State, factor: float, iterations: int) -> _Here:
        """The equilibrium `state` at a load factor, with the tangent of the path there. Raises InputError where nothing
        moves under the load."""
        balance = self.assembly.evaluate(state)
        matrix = self._factor(balance)
        tangent = self.turning.solve(matrix, balance, self._drive(state))
        residual = self.measure.residual(balance, self.drive.at(factor))
        found = Equilibrium(
            state, balance.energy, residual, self.spent, matrix.negative == 0, matrix.negative
        )
        speed = float(np.linalg.norm(tangent[self.moving]))
        if speed == 0.0 and not self.spent > 1:  # twisted, a straight rod has no other path than its turns
            self.moving, self.by_turns = self.assembly.free % 6 >= 3, True
            speed = float(np.linalg.norm(tangent[self.moving]))
        if speed == 0.0:
            raise InputError(
                "nothing moves under this load", where="path", remedy="Choose a load that acts on free nodes."
            )
        return _Here(state, factor, found, tangent, 1.0 / speed, iterations, balance.turned)

    def step(self, here: _Here, size: float, last: Reals | None) -> _Here:
        """The point at `size` from `here`, to which the step `last` (t,) led. Raises _Missed."""
        tangent, led = here.tangent, self.led
        if led is None:
            along = tangent[self.moving]
            onward = self.direction if last is None else float(np.sign(along @ last)) or 1.0
            change = onward * abs(size) / float(np.linalg.norm(along))
        else:
            if tangent[led] == 0.0:
                raise _Missed
            change = size / float(tangent[led])
        state, factor = self._moved(here.state, change * tangent, change), here.factor + change
        before = np.inf
        for iteration in range(1, _ITERATIONS + 1):
            balance = self.assembly.evaluate(state)
            unbalanced = (self.drive.at(factor) - balance.force).ravel()[self.assembly.free]
            done = np.zeros(len(self.assembly.free))
            done[self.moving] = self.between(here.state, state)
            gap = size - done[led] if led is not None else size * size - float(done @ done)
            size_kept = abs(gap) <= 1e-6 * (abs(size) if led is not None else size * size)
            residual = self.measure.residual(balance, self.drive.at(factor))
            if size_kept and self._balanced(residual, before, balance, state, factor):
                return self._settled(here, state, factor, iteration)
            before = residual
            if not residual < 1e12:
                raise _Missed
            matrix = self._factor(balance)
            by_forces = self.turning.solve(matrix, balance, unbalanced)
            by_factor = self.turning.solve(matrix, balance, self._drive(state))
            if led is not None:
                slope, rest = by_factor[led], gap - by_forces[led]
            else:
                slope, rest = 2.0 * float(done @ by_factor), gap - 2.0 * float(done @ by_forces)
            if slope == 0.0:
                raise _Missed
            shift = float(rest / slope)
            state, factor = self._moved(state, by_forces + shift * by_factor, shift), factor + shift
        raise _Missed

    def at_factor(self, here: _Here, there: _Here, goal: float) -> _Here:
        """The point at the factor `goal` between two points: Newton's steps from the nearer one. Raises
        _Missed where they turn too far.
        """
        near = here if abs(here.factor - goal) < abs(there.factor - goal) else there
        state = self._moved(near.state, (goal - near.factor) * near.tangent, goal - near.factor)
        before = np.inf
        for iteration in range(1, _ITERATIONS + 1):
            balance = self.assembly.evaluate(state)
            residual = self.measure.residual(balance, self.drive.at(goal))
            if self._balanced(residual, before, balance, state, goal):
                return self._settled(here, state, goal, iteration)
            before = residual
            if not residual < 1e12:
                break
            unbalanced = (self.drive.at(goal) - balance.force).ravel()[self.assembly.free]
            state = self._moved(state, self.turning.solve(self._factor(balance), balance, unbalanced), 0.0)
        return there  # the factor is close to a turning point: the path goes on and comes by again

    def located(self, here: _Here, size: float, last: Reals | None, there: _Here) -> PathPoint | None:
        """The point between two where the number of negative eigenvalues changes."""
        low, high, before, near = 0.0, 1.0, here, there
        total = size if self.led is not None else float(np.linalg.norm(self.between(here.state, there.state)))
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            try:
                found = self.step(here, middle * total, last)
            except _Missed:
                return None
            if found.negative == here.negative:
                low, before = middle, found
            else:
                high, near = middle, found
            if (
                abs(near.rate) * (high - low) * abs(total) < _LOCATED * max(abs(near.factor), 1e-300)
                and high - low < 1e-3
            ):
                break
        kind = "limit point" if before.rate * near.rate < 0.0 else "bifurcation"
        return replace(near.point(), event=kind)

    def gave_up(self, here: _Here, what: str) -> NotConverged:
        """The refusal to go on from a point, saying `what` failed."""
        return NotConverged(
            f"{what} (load factor {here.factor:.6g})",
            state=here.state,
            residual=here.equilibrium.residual,
            iterations=self.spent,
            remedy="Take a smaller first step, lead another displacement, or allow more points.",
        )

    def _settled(self, here: _Here, state: State, factor: float, iterations: int) -> _Here:
        """The converged point, its rate signed by which way along the path the factor grows. Raises _Missed where
        an element has turned too far on the way.
        """
        found = self.point(state, factor, iterations)
        if overturned(self.assembly, here.state, here.turned, state, found.turned):
            raise _Missed
        self.largest = max(self.largest, abs(factor))
        onward = float(np.sign(found.tangent[self.moving] @ self.between(here.state, state))) or 1.0
        return replace(found, rate=onward * abs(found.rate))

    def _balanced(
        self, residual: float, before: float, balance: Balance, state: State, factor: float
    ) -> bool:
        """Whether a state of the path is in equilibrium after a step from the residual `before`. The load that counts
        is the largest on the way, for it falls to nothing on it.
        """
        whole = self.drive.at(max(self.largest, abs(factor)))
        stagnant = residual > STAGNANT * before
        load = self.drive.at(factor)
        return self.measure.balanced(residual, balance, state, load, self.tolerance, stagnant, whole=whole)

    def _factor(self, balance: Balance) -> Indefinite:
        self.spent += 1
        return self.assembly.matrix.factor_indefinite(held(self.assembly, balance))

    def _drive(self, state: State) -> Reals:
        drive = self.drive.load
        if self.drive.moves_supports:
            drive = drive - self.assembly.force_along(state, self.drive.imposed)
        return drive.ravel()[self.assembly.free]

    def _moved(self, state: State, change: Reals, factor: float) -> State:
        whole = factor * self.drive.imposed.ravel()
        whole[self.assembly.free] = change
        step = whole.reshape(-1, 6)
        turn = float(np.abs(step[:, 3:]).max(initial=0.0))
        if not turn <= 2.0 * TURN:  # also where it isn't a number
            raise _Missed
        return moved(state, self.assembly.chords.corrected(state, step))

    def _flat(self) -> Indices:
        free = self.assembly.free[self.moving]
        return 3 * (free // 6) + free % 3
