"""One step of a path after the other (path.py): Newton's steps of a given length, to a given factor, or by
the load alone.

Where a cable goes slack or taut a path has a kink, and may bend there by more than a right angle. Newton's
steps of a fixed length then go to and fro between both sides, however short they are. On a stable branch the
load alone gets over it (loading.py): it grows on either side. Which way the path goes on tells the factor:
with as many negative eigenvalues it grows, or falls, as before.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from shellform.arrays import Indices, Reals, Record
from shellform.errors import InputError, NotConverged
from shellform.structure.elements.state import State, motion, moved
from shellform.structure.solve.assembly import Assembly, Balance
from shellform.structure.solve.drive import Drive
from shellform.structure.solve.equilibrium import TURN, Equilibrium
from shellform.structure.solve.factorisation import Indefinite
from shellform.structure.solve.leaps import kinked
from shellform.structure.solve.loading import advance
from shellform.structure.solve.outlook import Outlook, View
from shellform.structure.solve.residual import STAGNANT, ResidualNorm, Turning, held, overturned

_ITERATIONS = 12  # of Newton in one step
_BISECTIONS = 30  # of a step, towards an event: 1e-9 of it
_LOCATED = 1e-7  # of the factor, as near as an event is located


class Lead(NamedTuple):
    """A degree of freedom that leads: the translation of the `node` along the `axis` 0 to 2 by the
    `displacement`, m."""

    node: int
    axis: int
    displacement: float


@dataclass(frozen=True, eq=False)
class PathPoint:
    """A converged point of the path: load `factor`; `equilibrium`; `rate`, the change of the factor with the
    path's length (1/m, negative where the load falls); `event`: "", "limit point" or "bifurcation"."""

    factor: float
    equilibrium: Equilibrium
    rate: float
    event: str = ""


@dataclass(frozen=True, eq=False)
class OnPath(Record):
    """A point with what the next step needs: `tangent` (f,), the change of the free degrees of freedom with
    the factor; the lower `values` of K.
    """

    state: State
    factor: float
    equilibrium: Equilibrium
    tangent: Reals
    rate: float
    iterations: int
    turned: float
    values: Reals

    @property
    def negative(self) -> int:
        """How many pivots of the tangent are."""
        return self.equilibrium.negative

    def point(self) -> PathPoint:
        """What is told of it."""
        return PathPoint(self.factor, self.equilibrium, self.rate)


Doubted = tuple[float, OnPath] | None
"""A step that may have leapt, and where it led."""


class Missed(Exception):
    """A step found no point, or a `doubted` one, with its size, that may lie beyond a leap."""

    def __init__(self, doubted: Doubted = None) -> None:
        self.doubted = doubted


class Walk:
    """The path of the `assembly` under a `drive` from the state `start`, and what was found of it on the way:
    `spent` factorisations, the `largest` factor come to, and whether only rotations move (`by_turns`). The
    number of the degree of freedom that is `led` among the free ones, None where none is; the `direction` of
    the first step, 1 or -1."""

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
        span = float(np.ptp(start.positions, axis=0).max())
        self.outlook = Outlook(assembly, span, self.measure.mass_shape)
        self._made: tuple[Reals, Indefinite] | None = None  # the last factor and of which values it is
        self.first = 0.0  # change of the factor in the first step, below which none is a load to speak of
        self.direction = 1.0 if lead is not None or goal > 0.0 else -1.0

    def number(self, lead: Lead) -> int:
        """Place among the free degrees of freedom of the one that leads."""
        found = np.flatnonzero(self.assembly.free == 6 * lead.node + lead.axis)
        if not len(found):
            raise InputError(
                "is held or doesn't exist; only a free displacement can lead",
                where="path",
                value=(lead.node, lead.axis),
                remedy="Choose a node that is free along that axis.",
            )
        return int(found[0])

    def displacement(self, state: State, lead: Lead) -> float:
        """Of the degree of freedom that leads, m, since the start."""
        place = lead.node, lead.axis
        return float(state.positions[place] - self.start.positions[place])

    def between(self, before: State, after: State) -> Reals:
        """Translations (t,) of the free degrees of freedom from one state to the other; rotation vectors
        where nothing else moves.
        """
        if self.by_turns:
            return motion(before, after)[:, 3:].ravel()[self._flat()]
        return (after.positions - before.positions).ravel()[self._flat()]

    def point(self, state: State, factor: float, iterations: int) -> OnPath:
        """The equilibrium `state` at a load factor, with the tangent of the path there. Raises InputError
        where nothing moves under the load."""
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
        assert balance.tangent is not None
        rate, values = 1.0 / speed, balance.tangent
        return OnPath(state, factor, found, tangent, rate, iterations, balance.turned, values)

    def step(self, here: OnPath, size: float) -> OnPath:
        """The point at `size` from `here`. Raises Missed."""
        tangent, led = here.tangent, self.led
        if led is None:
            change = float(np.copysign(size, here.rate)) / float(np.linalg.norm(tangent[self.moving]))
        else:
            if tangent[led] == 0.0:
                raise Missed
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
                raise Missed
            matrix = self._factor(balance)
            by_forces = self.turning.solve(matrix, balance, unbalanced)
            by_factor = self.turning.solve(matrix, balance, self._drive(state))
            if led is not None:
                slope, rest = by_factor[led], gap - by_forces[led]
            else:
                slope, rest = 2.0 * float(done @ by_factor), gap - 2.0 * float(done @ by_forces)
            if slope == 0.0:
                raise Missed
            shift = float(rest / slope)
            state, factor = self._moved(state, by_forces + shift * by_factor, shift), factor + shift
        raise Missed

    def at_factor(self, here: OnPath, there: OnPath, goal: float) -> OnPath:
        """The point at the factor `goal` between two points: Newton's steps from the nearer one. Raises
        Missed where they turn too far.
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
        if there.equilibrium.stable:
            reached = self.by_load(here, goal)
            if reached is not None and reached.factor == goal:
                return reached
        return there  # the factor is close to a turning point: the path goes on and comes by again

    def by_load(self, here: OnPath, end: float) -> OnPath | None:
        """The point to which the load alone leads on the stable branch from `here`, at the factor `end` or
        where that branch ends before; None where `here` isn't stable, or nothing is reached. Raises Missed
        where an element turns too far."""
        if not here.equilibrium.stable:
            return None
        self._made = None
        try:
            found = advance(
                self.assembly,
                here.state,
                self.drive,
                begin=here.factor,
                end=end,
                tolerance=self.tolerance,
                stay=True,
                heeding=True,
            )
        except NotConverged as error:
            self.spent += error.iterations
            return None
        self.spent += found.factorisations
        if found.share == 0.0:
            return None
        factor = end if found.on_branch else here.factor + found.share * (end - here.factor)
        return self._settled(here, found.equilibrium.state, factor, _ITERATIONS)

    def view(self, here: OnPath, before: View | None) -> View | None:
        """What is to be seen from a point, by the length of the path; None from one that isn't stable."""
        if not here.equilibrium.stable:
            return None
        onward = self.drive.imposed.ravel().copy()
        onward[self.assembly.free] = here.tangent
        onward *= here.rate
        made = self._made
        if made is None or made[0] is not here.values:  # it was replaced
            made = here.values, self._factor(self.assembly.evaluate(here.state))
        return self.outlook.view(here.state, here.values, made[1], onward.reshape(-1, 6), before)

    def heeded(self, here: OnPath, seen: View, there: OnPath, *, critical: bool = False) -> View:
        """What is to be seen from a stable point to which a step has led from one with the view `seen`.
        Raises Missed where it may have passed over an unstable stretch (Outlook.passes_over)."""
        then = self.view(there, seen)
        assert then is not None
        width = float(np.linalg.norm(self.between(here.state, there.state)))
        if self.outlook.passes_over(seen, then, width, self.share(here, there), critical=critical):
            raise Missed
        return then

    def share(self, here: OnPath, there: OnPath) -> float:
        """By what share of the load it changes from one point to the other."""
        return abs(there.factor - here.factor) / max(abs(here.factor), abs(there.factor), self.first)

    def located(self, here: OnPath, size: float, there: OnPath) -> tuple[PathPoint, OnPath] | None:
        """The point between two where the number of negative eigenvalues changes, and the last one found
        before it; None where steps to it find none."""
        low, high, before, near = 0.0, 1.0, here, there
        total = size if self.led is not None else float(np.linalg.norm(self.between(here.state, there.state)))
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            try:
                found = self.step(here, middle * total)
            except Missed:
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
        return replace(near.point(), event=kind), before

    def gave_up(
        self,
        here: OnPath,
        what: str,
        remedy: str = "Take a smaller first step, or lead another displacement.",
    ) -> NotConverged:
        """The refusal to go on from a point, saying `what` failed."""
        return NotConverged(
            f"{what} (load factor {here.factor:.6g})",
            state=here.state,
            residual=here.equilibrium.residual,
            iterations=self.spent,
            remedy=remedy,
        )

    def _settled(self, here: OnPath, state: State, factor: float, iterations: int) -> OnPath:
        """The converged point, its rate signed by which way along the path the factor grows. Raises Missed
        where an element has turned too far on the way.
        """
        found = self.point(state, factor, iterations)
        if overturned(self.assembly, here.state, here.turned, state, found.turned):
            raise Missed
        self.largest = max(self.largest, abs(factor))
        onward = float(np.sign(found.tangent[self.moving] @ self.between(here.state, state))) or 1.0
        if found.negative == here.negative and kinked(self.assembly, here.state, state):
            onward = float(np.sign(here.rate))  # a path may bend there by more than a right angle
        return replace(found, rate=onward * abs(found.rate))

    def _balanced(
        self, residual: float, before: float, balance: Balance, state: State, factor: float
    ) -> bool:
        """Whether a state of the path is in equilibrium after a step from the residual `before`. The load
        that counts is the largest on the way, for it falls to nothing on it.
        """
        whole = self.drive.at(max(self.largest, abs(factor)))
        stagnant = residual > STAGNANT * before
        load = self.drive.at(factor)
        return self.measure.balanced(residual, balance, state, load, self.tolerance, stagnant, whole=whole)

    def _factor(self, balance: Balance) -> Indefinite:
        self.spent += 1
        factor = self.assembly.matrix.factor_indefinite(held(self.assembly, balance))
        assert balance.tangent is not None
        self._made = balance.tangent, factor
        return factor

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
            raise Missed
        return moved(state, self.assembly.chords.corrected(state, step))

    def _flat(self) -> Indices:
        free = self.assembly.free[self.moving]
        return 3 * (free // 6) + free % 3
