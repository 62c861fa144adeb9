"""One drawn structure, relaxed without load and loaded along its stable branch (standing.py has the
method).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import numpy as np

from shellform.arrays import Reals
from shellform.errors import NotConverged
from shellform.reliability.bent_beams import BentBeams
from shellform.reliability.drawing import (
    Errors,
    built_beams,
    built_cables,
    built_load,
)
from shellform.reliability.perfect import Perfect
from shellform.structure.answers.stability import modes
from shellform.structure.elements.beam import Beams
from shellform.structure.elements.state import State, moved
from shellform.structure.solve.assembly import Assembly, Balance
from shellform.structure.solve.equilibrium import TOLERANCE, TURN, find_equilibrium
from shellform.structure.solve.factorisation import Factor, NotPositiveDefinite
from shellform.structure.solve.residual import ResidualNorm, held

LIMIT_POINT, BIFURCATION, BORNE, UNLOADED = "limit point", "bifurcation", "none", "no unloaded state"
ENDED = "not looked into"
_ALIGNED = (
    0.5  # cosine of the path's tangent and the softest mode, from which on the load itself is at its limit
)

FAR = 0.05  # of the span from the perfect structure
STRAY = 0.01  # of the span from where a step was expected to end: the state belongs to another branch
STEP = 0.5  # of the load
SOUGHT = 3.0  # load factor up to which a structure's limit is sought
_PATIENCE = 10  # factorisations of one step
_RELAXING = 15  # of the unloaded state, before it is sought from the target instead
_ON_THE_WAY = 1e-5  # residual of states between, from which the next step starts
_PASSES = 2  # of bringing beams to their length
_FAR_OFF = 5.0  # rad, a step that leads nowhere


@dataclass(frozen=True)
class DrawnOutcome:
    """One drawn structure: the load `factor` up to which its stable branch was followed, whether it `stands`,
    how `far`, m, a node ends from the perfect structure's place (inf where it fell), its last `state` on the
    branch, and the `factorisations` spent."""

    number: int
    factor: float
    stands: bool
    far: float
    state: State
    factorisations: int


@dataclass(frozen=True)
class Limit:
    """Where a stable branch ends: the load `factor` up to which it was followed, the `kind` of what ended it
    (LIMIT_POINT, BIFURCATION, BORNE where nothing did, UNLOADED where there is no equilibrium even without
    load), the last `state` on it, and the `factorisations` spent."""

    factor: float
    kind: str
    state: State
    factorisations: int


@dataclass(frozen=True)
class Here:
    """A state on the stable branch with its balance and its tangent's factor, good until the next one is
    made.
    """

    state: State
    balance: Balance
    factor: Factor


class Loading:
    """One structure under way."""

    def __init__(self, nominal: Perfect, assembly: Assembly, errors: Errors, number: int) -> None:
        self.nominal, self.errors, self.number = nominal, errors, number
        network = nominal.network
        shape = nominal.imperfections
        self.assembly = assembly.with_parts(
            (
                built_beams(network.beams, errors, shape),
                built_cables(network.cables, nominal.present, errors, shape),
            )
        )
        self.load = built_load(nominal.load, errors)
        self.measure = ResidualNorm(self.assembly)
        self.spent = 0

    def outcome(self, step: float, smallest: float) -> DrawnOutcome:
        nominal = self.nominal
        here, factor = self.followed(1.0, step, smallest)
        if here is None:
            return DrawnOutcome(self.number, 0.0, False, np.inf, nominal.unloaded, self.spent)
        if factor < 1.0:
            return DrawnOutcome(self.number, factor, False, np.inf, here.state, self.spent)
        far = np.inf
        if nominal.bears:
            far = float(np.linalg.norm(here.state.positions - nominal.states[-1].positions, axis=1).max())
        stands = far <= FAR * nominal.members.span
        return DrawnOutcome(self.number, factor, stands, far, here.state, self.spent)

    def followed(self, most: float, step: float, smallest: float) -> tuple[Here | None, float]:
        """The last state on the stable branch and its load factor, `most` where the branch goes on; None
        where there is no unloaded state."""
        here = self._unloaded()
        factor, width, good = 0.0, step, 0
        while here is not None and factor < most:
            goal = most if factor + width > most - 1e-12 else factor + width
            there = self.step(here, goal, last=goal == most)
            if there is None:
                width, good = 0.5 * width, 0
                here = self.at(here.state)  # its factor was replaced
                if width < smallest:
                    break
                continue
            here, factor, good = there, goal, good + 1
            if good == 2:
                width, good = min(2.0 * width, step), 0
        return here, factor

    def kind(self, here: Here) -> str:
        """What ends the branch just beyond the state: at a limit point the path's tangent turns into the
        softest mode, at a bifurcation it stays across."""
        soft = modes(self.assembly, here.state, 1).shapes[0].ravel()[self.assembly.free]
        factor = self.assembly.factor(here.state)
        onward = factor.solve(self.load.ravel()[self.assembly.free])
        mass = self.measure.mass_shape
        size = np.sqrt(float((mass * soft * soft).sum() * (mass * onward * onward).sum()))
        return LIMIT_POINT if abs(float((mass * soft * onward).sum())) > _ALIGNED * size else BIFURCATION

    def _unloaded(self) -> Here | None:
        """The unloaded state: supports and free nodes go along with all errors at once, by the perfect
        structure's tangent, since errors of rods' lengths leave the drawn one indefinite until its nodes have
        moved."""
        nominal, none = self.nominal, np.zeros_like(self.load)
        start, offset = nominal.unloaded, self.errors.supports
        perfect = self.assembly.with_parts((nominal.network.beams, nominal.network.cables))
        pull = -self.assembly.evaluate(start, tangent=False).force
        if offset.any():
            pull -= perfect.force_along(start, offset)
        step = offset.ravel().copy()
        free = self.assembly.free
        try:
            self.spent += 1
            step[free] = perfect.factor(start).solve(pull.ravel()[free])
        except NotPositiveDefinite:  # held by the friction of its numbers: below what `held` adds
            pass
        begin = moved(start, self.assembly.chords.corrected(start, step.reshape(-1, 6)))
        begin = self._to_length(begin)
        found = self._newton(begin, none, limit=_RELAXING, tolerance=_ON_THE_WAY)
        if found is not None:
            return found
        try:
            relaxed = find_equilibrium(self.assembly, moved(nominal.start, offset), none)
        except NotConverged as error:
            self.spent += error.iterations
            return None
        self.spent += relaxed.factorisations
        return self._newton(relaxed.state, none, limit=2, tolerance=_ON_THE_WAY)

    def _to_length(self, state: State) -> State:
        """The state with its nodes moved so that the beams have the perfect structure's axial strains: rods
        are so stiff along their axis that what a linear motion leaves would buckle them. The nearest motion
        in the sense of least squares weighted by EA / l0, as in chords.py."""
        beams = self.nominal.network.beams
        built = self.assembly.parts[0]
        rest = (built.straight if isinstance(built, BentBeams) else cast(Beams, built)).rest_length
        a, b = beams.ends.T
        before = self.nominal.unloaded.positions
        goal = rest / beams.rest_length * np.linalg.norm(before[b] - before[a], axis=1)
        positions = state.positions.copy()
        chords = self.assembly.chords
        for _ in range(_PASSES):
            along = positions[b] - positions[a]
            length = np.linalg.norm(along, axis=1)
            pull = (chords.weight * (goal - length) / length)[:, None] * along
            right = np.zeros_like(positions)
            np.add.at(right, b, pull)
            np.add.at(right, a, -pull)
            for nodes, group, factor in chords.axes:
                positions[np.ix_(nodes, group)] += factor.solve(right[np.ix_(nodes, group)])
        return State(positions, state.quaternions)

    def step(self, here: Here, goal: float, *, last: bool) -> Here | None:
        """From a state on the branch to the load factor `goal`."""
        load = goal * self.load
        change = self._solved(here, load)
        if change is None:
            return None
        begin = moved(here.state, self.assembly.chords.corrected(here.state, change))
        tolerance = TOLERANCE if last else _ON_THE_WAY
        found = self._newton(begin, load, limit=_PATIENCE, tolerance=tolerance)
        if found is None:
            return None
        stray = float(np.abs(found.state.positions - begin.positions).max())
        return found if stray <= STRAY * self.nominal.members.span else None

    def _newton(self, begin: State, load: Reals, *, limit: int, tolerance: float) -> Here | None:
        """The equilibrium to which whole steps of Newton's lead from `begin` with every tangent positive
        definite, the last one included; None where one isn't."""
        own, state, before = self.assembly, begin, np.inf
        for _ in range(limit):
            here = self.at(state)
            if here is None:
                return None
            residual = self.measure.residual(here.balance, load)
            noise = self.measure.rounding(here.balance, state, load) if residual > 0.1 * before else 0.0
            if residual <= max(tolerance, noise):
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
