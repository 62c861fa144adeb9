"""One drawn structure, relaxed without load and loaded along its stable branch (standing.py has the
method).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import cast

import numpy as np

from shellform.arrays import Reals
from shellform.errors import NotConverged
from shellform.reliability.branch import STRAY, Branch
from shellform.reliability.drawing import Errors, built_beams, built_cables, built_load
from shellform.reliability.perfect import Perfect
from shellform.reliability.resting import Resting
from shellform.structure.answers.stability import modes
from shellform.structure.elements.beam import Beams
from shellform.structure.elements.cable import Cables
from shellform.structure.elements.state import State, motion, moved
from shellform.structure.solve.assembly import Assembly
from shellform.structure.solve.equilibrium import find_equilibrium
from shellform.structure.solve.factorisation import Factor, NotPositiveDefinite, Symmetric
from shellform.structure.solve.whole_steps import ON_THE_WAY, Foreseen, Here

LIMIT_POINT, BIFURCATION, BORNE, UNLOADED = "limit point", "bifurcation", "none", "no unloaded state"
ENDED = "not looked into"
# cosine of the path's tangent and the softest mode, from which on the load itself is at its limit
_ALIGNED = 0.5

STEP = 1.0  # of the load: most structures bear it whole, and others are followed in smaller steps
MARKED = 1 / 512  # of the load, next to a factor at which it counts on which side a structure falls
SOUGHT = 3.0  # load factor up to which a structure's limit is sought
RESOLUTION = 1 / 256  # of the load, to which it is found where it is told
_RELAXING = 25  # steps to the unloaded state, before it is relaxed instead
_BESIDE = 10  # steps from the perfect structure's loaded state
_AS_BEFORE = 16  # steps from where a structure rested in another design
_RELAXATIONS = 150  # factorisations of a relaxation: what takes more has none
SNAPS = 3  # local ones, that a structure may go on after
_BEYOND = 2.0  # resolutions of its path, where a structure is relaxed that may have snapped
_SNAPPING, _LOOKS = 8, 8  # factorisations after which it is looked how far it has gone, and how often


@dataclass(frozen=True)
class Snap:
    """A rod's end or a cell snaps beyond a load `factor`, and the structure comes to rest: how `far`, m, the
    node goes that goes farthest."""

    factor: float
    far: float


@dataclass(frozen=True, eq=False)
class DrawnOutcome:
    """What became of one drawn structure.

    - `number` under its seed.
    - `factor` of the load up to which its stable branch was followed; `stands`: whether it does.
    - `far`, m: how far a node ends from the perfect structure's place, inf where it fell.
    - `state`: its last one on the branch; `snaps`: local ones on the way.
    - `factorisations` spent.
    - `resting`: its state at rest under a share of the load, where that was asked for; None where it fell
      before. `beams`, `cables`: its own, of which that is.
    """

    number: int
    factor: float
    stands: bool
    far: float
    state: State
    factorisations: int
    snaps: tuple[Snap, ...] = ()
    resting: State | None = None
    beams: Beams | None = None
    cables: Cables | None = None


@dataclass(frozen=True, eq=False)
class Limit:
    """Where a stable branch ends: the load `factor` up to which it was followed, the `kind` of what ended it
    (LIMIT_POINT, BIFURCATION, BORNE where nothing did, UNLOADED where there is no equilibrium even without
    load), the last `state` on it, and the `factorisations` spent."""

    factor: float
    kind: str
    state: State
    factorisations: int


class Bench:
    """Where one structure after the other is loaded: an `assembly` with a factor of its own."""

    def __init__(self, nominal: Perfect, assembly: Assembly) -> None:
        self.nominal, self.assembly = nominal, assembly

    @cached_property
    def unloaded(self) -> Factor | None:
        """The factor of the unloaded perfect structure's tangent, from which each drawn one begins; None
        where it isn't positive definite, which it is to within the friction of numbers that `held` adds."""
        return self._factor(self.nominal.unloaded)

    @cached_property
    def loaded(self) -> Factor | None:
        """The same under the whole load; None where the perfect structure doesn't bear it, too."""
        return self._factor(self.nominal.states[-1]) if self.nominal.bears else None

    def _factor(self, state: State) -> Factor | None:
        """One that lasts as long as the bench."""
        matrix = self.assembly.matrix
        values = self.assembly.evaluate(state).tangent
        assert values is not None
        try:
            return Symmetric(matrix.indptr, matrix.indices).factor(values)
        except NotPositiveDefinite:
            return None


class Loading(Branch):
    """One structure under way: the perfect one of the `bench` built with these `errors`, its `number` under a
    seed, and the local `snaps` that it has gone on after so far."""

    def __init__(self, bench: Bench, errors: Errors, number: int) -> None:
        nominal = bench.nominal
        self.bench, self.nominal, self.errors, self.number = bench, nominal, errors, number
        network = nominal.network
        shape = nominal.imperfections
        beams = built_beams(network.beams, errors, shape)
        cables = built_cables(network.cables, nominal.present, errors, shape)
        own = bench.assembly.with_parts((beams, cables))
        super().__init__(own, built_load(nominal.load, errors), nominal.members.span)
        self.snaps: list[Snap] = []

    def outcome(self, step: float, smallest: float, marks: Sequence[float] = ()) -> DrawnOutcome:
        """What becomes of it, loaded from nothing in steps of at most `step` of the load, where it falls
        known to the `smallest` one, and beside factors in `marks` to MARKED."""
        nominal = self.nominal
        here, factor = self.borne(1.0, step, smallest, marks=marks)
        snaps = tuple(self.snaps)
        if here is None:
            return DrawnOutcome(self.number, 0.0, False, np.inf, nominal.unloaded, self.spent, snaps)
        if factor < 1.0:
            return DrawnOutcome(self.number, factor, False, np.inf, here.state, self.spent, snaps)
        far, stands = nominal.farthest(here.state), nominal.lies_beside(here.state)
        return DrawnOutcome(self.number, factor, stands, far, here.state, self.spent, snaps)

    def rested(self, found: DrawnOutcome, share: float, step: float, smallest: float) -> DrawnOutcome:
        """The structure's outcome with its state at rest under a `share` of the load: back along the branch,
        on which it is elastic; where that leads nowhere, or something has snapped since, from nothing
        again."""
        if found.factor < share:
            return found
        there = None
        if not any(each.factor >= share for each in found.snaps):
            there = self.at(found.state)  # its factor was replaced
            if there is not None and found.factor > share:
                there = self.step(there, share, last=True)
        if there is None:
            self.snaps.clear()
            there, factor = self.borne(share, step, smallest)
            there = there if factor >= share else None
        found = replace(found, factorisations=self.spent)
        if there is None:
            return found
        beams, cables = cast(tuple[Beams, Cables], tuple(self.assembly.parts))
        return replace(found, resting=there.state, beams=beams, cables=cables)

    def borne(
        self, most: float, step: float, smallest: float, *, marks: Sequence[float] = ()
    ) -> tuple[Here | None, float]:
        """As `followed` from nothing, but going on after local snaps, which are kept in `snaps`: where the
        structure falls."""
        here, factor = self.followed(most, step, smallest, marks=marks)
        return self.beyond(here, factor, most, step, smallest, marks=marks)

    def beyond(
        self,
        here: Here | None,
        factor: float,
        most: float,
        step: float,
        smallest: float,
        *,
        marks: Sequence[float] = (),
    ) -> tuple[Here | None, float]:
        """The same from the end of its branch on, `here` at the load `factor`."""
        while here is not None and factor < most and len(self.snaps) < SNAPS:
            goal = min(factor + _BEYOND * smallest, most)
            there = self._rested(here, goal)
            if there is None:
                break
            self.snaps.append(Snap(factor, self._farthest(there.state, here.state)))
            here, factor = self.followed(most, step, smallest, begin=(goal, there.state), marks=marks)
        return here, factor

    def _rested(self, here: Here, goal: float) -> Here | None:
        """Where the structure comes to rest under the load factor `goal`, whose stable branch has ended
        `here` below it; None where a node goes farther than STRAY of the span: it falls."""
        state, load = here.state, goal * self.load
        for _ in range(_LOOKS):
            try:
                rest = find_equilibrium(self.assembly, state, load, limit=_SNAPPING)
            except NotConverged as error:
                self.spent += error.iterations
                if not isinstance(error.state, State):
                    return None
                state = error.state
                if self._farthest(state, here.state) > STRAY * self.span:
                    return None
                continue
            self.spent += rest.factorisations
            if self._farthest(rest.state, here.state) > STRAY * self.span:
                return None
            return self.newton(rest.state, load, limit=2, tolerance=ON_THE_WAY)
        return None

    def _farthest(self, state: State, before: State) -> float:
        """How far, m, the node has gone that has gone farthest."""
        return float(np.linalg.norm(state.positions - before.positions, axis=1).max())

    def followed(
        self,
        most: float,
        step: float,
        smallest: float,
        *,
        begin: tuple[float, State] | None = None,
        marks: Sequence[float] = (),
        heeding: bool = False,
    ) -> tuple[Here | None, float]:
        """The last state on the stable branch and its load factor, `most` where the branch goes on; None
        where there is no unloaded state. With `begin` from a state at a load factor that is known to lie on
        the branch. The end is known to the `smallest` step, but next to factors in `marks`, where it decides
        whether a structure stands, to MARKED. `heeding` what steps may pass over (Branch.along)."""
        factor, here = (0.0, self._unloaded()) if begin is None else (begin[0], self.at(begin[1]))
        if here is None:
            return None, factor
        here, factor = self.along(here, factor, most, step, smallest, heeding=heeding)
        for mark in sorted(marks):
            if factor < mark <= min(factor + 2.0 * smallest, most):
                finest = min(MARKED, smallest)
                here, factor = self.along(here, factor, mark, mark - factor, finest, heeding=heeding)
        return here, factor

    def kind(self, here: Here) -> str:
        """What ends the branch just beyond the state: at a limit point the path's tangent turns into the
        softest mode, at a bifurcation it stays across."""
        soft = self.softest(here.state).ravel()[self.assembly.free]
        factor = self.assembly.factor(here.state)
        onward = factor.solve(self.load.ravel()[self.assembly.free])
        mass = self.measure.mass_shape
        size = np.sqrt(float((mass * soft * soft).sum() * (mass * onward * onward).sum()))
        return LIMIT_POINT if abs(float((mass * soft * onward).sum())) > _ALIGNED * size else BIFURCATION

    def softest(self, state: State) -> Reals:
        """The structure's own softest mode in a state (n, 6), the largest translation 1."""
        return modes(self.assembly, state, 1).shapes[0]

    def _unloaded(self) -> Here | None:
        """The unloaded state: supports and free nodes go along with all errors at once, by the perfect
        structure's tangent, since errors of rods' lengths leave the drawn one indefinite until its nodes have
        moved."""
        none = np.zeros_like(self.load)
        begin, foreseen = self._taken_along(self.nominal.unloaded, none, self.bench.unloaded)
        found = self.newton(
            begin, none, limit=_RELAXING, tolerance=ON_THE_WAY, foreseen=foreseen, damped=True
        )
        if found is not None and self._farthest(found.state, begin) <= STRAY * self.span:
            return found
        # By small steps then, from where the errors took the perfect structure, or if that fails from the
        # target.
        for near in (begin, moved(self.nominal.start, self.errors.supports)):
            try:
                relaxed = find_equilibrium(self.assembly, near, none, limit=_RELAXATIONS, symmetric=False)
            except NotConverged as error:
                self.spent += error.iterations
                continue
            self.spent += relaxed.factorisations
            return self.newton(relaxed.state, none, limit=2, tolerance=ON_THE_WAY)
        return None

    def beside(self) -> Here | None:
        """The equilibrium under the whole load to which all errors at once take the perfect structure's, in
        some half of the factorisations of a path from nothing; None where whole steps of Newton's, each
        tangent of them positive definite, lead to none within STRAY of the span of where its own tangent
        leads. That the drawn structure would come there from nothing isn't known."""
        if self.bench.loaded is None:
            return None
        begin, foreseen = self._taken_along(self.nominal.states[-1], self.load, self.bench.loaded)
        return self._next_to(begin, foreseen, limit=_BESIDE)

    def as_before(self, before: Resting) -> Here | None:
        """The equilibrium under the whole load next to where the structure of this number rested in another
        design, moved on as the perfect one has from there, by damped steps where it takes them; None where
        these lead to none within STRAY of the span, or it wasn't seen to rest."""
        own = before.drawn.get(self.number)
        if own is None or not self.nominal.bears:
            return None
        change = motion(before.perfect, self.nominal.states[-1])
        turned = self.assembly.evaluate(own, tangent=False).turned
        begin = moved(own, self.assembly.chords.corrected(own, change))
        return self._next_to(begin, self.foreseen(own, turned, change), limit=_AS_BEFORE, damped=True)

    def _next_to(self, begin: State, foreseen: Foreseen, *, limit: int, damped: bool = False) -> Here | None:
        """The equilibrium under the whole load to which whole steps lead from a state, so many at most,
        within STRAY of the span of it."""
        found = self.newton(
            begin, self.load, limit=limit, tolerance=ON_THE_WAY, foreseen=foreseen, damped=damped
        )
        if found is None or self._farthest(found.state, begin) > STRAY * self.span:
            return None
        return found

    def _taken_along(self, start: State, load: Reals, factor: Factor | None) -> tuple[State, Foreseen]:
        """Where the errors take the perfect structure at rest at `start` under a `load`, by its tangent's
        `factor` (None: supports alone move), and the deformations that are foreseen there."""
        offset = self.errors.supports
        balance = self.assembly.evaluate(start, tangent=False)
        pull = load - balance.force
        if offset.any():
            pull -= self.bench.assembly.force_along(start, offset)
        step = offset.ravel().copy()
        free = self.assembly.free
        if factor is not None:
            step[free] = factor.solve(pull.ravel()[free])
        change = step.reshape(-1, 6)
        begin = moved(start, self.assembly.chords.corrected(start, change))
        return begin, self._as_perfect(start, balance.turned, change)

    def _as_perfect(self, start: State, turned: float, change: Reals) -> Foreseen:
        """The deformations that a step by the perfect structure's tangent leads to: elements take on the
        forces that its own would."""
        still = self.foreseen(start, turned, np.zeros_like(change))
        moved_on = self.foreseen(start, turned, change)
        if still is None or moved_on is None:
            return None
        (before,), (after,), beams = still, moved_on, self.nominal.network.beams
        own = cast(Beams, self.assembly.parts[0])
        softer = own.rest_length / beams.rest_length / self.errors.beam_stiffness
        return (before + softer[:, None] * (after - before),)
