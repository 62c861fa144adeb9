"""Structures as built, each loaded from nothing on its own path: does it stand?

A structure is relaxed without load from where the perfect one rests, and then loaded (path_of_one.py), with
the whole load at first. A step (branch.py) begins along the tangent of the path, whose factor is at hand, and
goes on by whole steps of Newton's in a mixed form (structure/solve/whole_steps.py). It counts only where
every tangent that is made on the way is positive definite, the one at its end among them, and no node lands
farther than `STRAY` of the span from where the path's tangent led; else it is halved, as on any path. So the
large steps lead along the same branch as small ones do.

A structure stands if the equilibrium under the whole load is reached so, is stable, and no node is farther
than `FAR` of the span from the perfect structure's. One that loses stability on the way is relaxed under a
little more load. Where it comes to rest before any node has gone farther than `STRAY` of the span, one rod's
end or one cell has snapped, it goes on from there, and the snap is told; else it has fallen, whatever it
would come to, and how far it came is its load factor.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from typing import TypeVar

from shellform.arrays import Reals
from shellform.errors import require_count
from shellform.gridshell.gridshell import Design, Gridshell
from shellform.gridshell.tolerances import Tolerances
from shellform.reliability.drawing import Errors, draw_errors
from shellform.reliability.path_of_one import (
    BORNE,
    ENDED,
    RESOLUTION,
    STEP,
    UNLOADED,
    Bench,
    DrawnOutcome,
    Limit,
    Loading,
    Snap,
)
from shellform.reliability.perfect import Perfect, perfect
from shellform.reliability.probability import CONFIDENCE, Standing, counted
from shellform.reliability.resting import Resting
from shellform.structure.elements.state import State
from shellform.structure.elements.threads import side_by_side
from shellform.structure.network import assemble
from shellform.structure.solve.loading import SMALLEST
from shellform.structure.solve.whole_steps import Here

Found = TypeVar("Found")


@dataclass(frozen=True, eq=False)
class DrawnSample:
    """The `outcomes` of drawn structures, number after number, and what they say of the probability of
    standing.
    """

    outcomes: tuple[DrawnOutcome, ...]
    standing: Standing


def sample(
    shell: Gridshell,
    design: Design,
    load: Reals,
    tolerances: Tolerances,
    *,
    count: int,
    seed: int,
    confidence: float = CONFIDENCE,
) -> DrawnSample:
    """`count` drawn structures of a design, each loaded from nothing with the dead `load` (n, 6).

    The same seed gives the same structures whatever the count. Raises InputError for a count below 1,
    NotConverged where the perfect structure has no unloaded equilibrium.
    """
    require_count(count, where="count", give="a number of structures to draw, such as 200")
    made = Workshop(perfect(shell, design, load)).load_numbers(tolerances, seed=seed, numbers=range(count))
    stand = sum(each.stands for each in made)
    return DrawnSample(tuple(made), counted(count, stand, seed=seed, confidence=confidence))


class Workshop:
    """Builds and loads drawn structures of one perfect structure, as many side by side as there are cores:
    each thread takes an assembly with a factor of its own."""

    def __init__(self, nominal: Perfect) -> None:
        self.nominal = nominal
        self._first = assemble(nominal.network)
        self._first.chords  # noqa: B018  made once, and shared by all that are copied from it
        self._idle: SimpleQueue[Bench] = SimpleQueue()
        self._idle.put(Bench(nominal, self._first))

    def load(
        self,
        errors: Errors,
        *,
        number: int = 0,
        step: float = STEP,
        smallest: float = SMALLEST,
        marks: Sequence[float] = (),
        resting: float | None = None,
    ) -> DrawnOutcome:
        """The structure with the errors, loaded from nothing, and surely on which side of load factors in
        `marks` it falls; where it rests under a share `resting` of the load, if that is asked for."""

        def outcome(loading: Loading) -> DrawnOutcome:
            found = loading.outcome(step, smallest, marks)
            return found if resting is None else loading.rested(found, resting, step, smallest)

        return self.with_structure(errors, outcome, number=number)

    def limit(
        self,
        errors: Errors,
        *,
        most: float,
        step: float = STEP,
        resolution: float = 1 / 64,
        tell: bool = True,
        begin: tuple[float, State] | None = None,
        marks: Sequence[float] = (),
        heeding: bool = True,
    ) -> Limit:
        """Where the structure with the errors loses stability under its growing load, which with `begin` is
        known to bear a factor of it in a state, and surely on which side of factors in `marks`; what ends its
        path is looked into only to `tell` it. `heeding`: what steps may pass over (outlook.py)."""

        def ended(own: Loading) -> Limit:
            end = own.followed(most, step, resolution, begin=begin, marks=marks, heeding=heeding)
            return self._ended(own, end, most, tell)

        return self.with_structure(errors, ended)

    def fall(
        self,
        errors: Errors,
        *,
        most: float,
        step: float = STEP,
        resolution: float = 1 / 64,
        tell: bool = True,
    ) -> Limit:
        """As `limit`, from nothing, but going on after local snaps: where the structure falls."""
        return self.with_structure(
            errors, lambda own: self._ended(own, own.borne(most, step, resolution), most, tell)
        )

    def beyond(
        self, errors: Errors, end: Limit, *, most: float, step: float = STEP, resolution: float = RESOLUTION
    ) -> tuple[float, tuple[Snap, ...]]:
        """Up to which load factor, `most` at the most, a structure goes on from the `end` of its stable
        branch, and the local snaps on its way: where it falls there, that end's and none."""

        def went_on(own: Loading) -> tuple[float, tuple[Snap, ...]]:
            _, factor = own.beyond(own.at(end.state), end.factor, most, step, resolution)
            return factor, tuple(own.snaps)

        return self.with_structure(errors, went_on)

    def rests(
        self,
        errors: Errors,
        *,
        resolution: float,
        marks: Sequence[float] = (),
        number: int = 0,
        before: Resting | None = None,
    ) -> Limit:
        """As `fall`, up to the whole load, but a structure that rests under it beside the perfect one, or
        next to where the one of its `number` rested in another design `before` (path_of_one.py), isn't
        loaded from nothing."""

        def ended(own: Loading) -> Limit:
            there = None if before is None else own.as_before(before)
            there = own.beside() if there is None else there
            end = own.borne(1.0, STEP, resolution, marks=marks) if there is None else (there, 1.0)
            return self._ended(own, end, 1.0, tell=False)

        return self.with_structure(errors, ended, number=number)

    def _ended(self, own: Loading, end: tuple[Here | None, float], most: float, tell: bool) -> Limit:
        here, factor = end
        if here is None:
            return Limit(0.0, UNLOADED, self.nominal.unloaded, own.spent)
        kind = BORNE if factor >= most else (own.kind(here) if tell else ENDED)
        return Limit(factor, kind, here.state, own.spent)

    def with_structure(self, errors: Errors, work: Callable[[Loading], Found], *, number: int = 0) -> Found:
        """What `work` finds of the structure with the errors, on an assembly that is its own meanwhile."""
        own = self._taken()
        try:
            return work(Loading(own, errors, number))
        finally:
            self._idle.put(own)

    def load_numbers(
        self,
        tolerances: Tolerances,
        *,
        seed: int,
        numbers: Sequence[int],
        step: float = STEP,
        marks: Sequence[float] = (),
        resting: float | None = None,
        adjust: Callable[[Errors], Errors] | None = None,
    ) -> list[DrawnOutcome]:
        """The structures of these numbers under the seed, each as `load` loads it, with the errors that
        `adjust` leaves (None: all of them)."""

        def one(number: int) -> DrawnOutcome:
            errors = draw_errors(self.nominal.members, tolerances, seed, number)
            left = errors if adjust is None else adjust(errors)
            return self.load(left, number=number, step=step, marks=marks, resting=resting)

        return side_by_side(one, list(numbers))

    def _taken(self) -> Bench:
        try:
            return self._idle.get_nowait()
        except Empty:
            return Bench(self.nominal, self._first.beside())
