"""What grows with the load factor: dead loads and the motion of supports, which takes the free nodes along by
the tangent, K dx = -K_held d, as far as no element folds.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shellform.arrays import Reals, Record
from shellform.errors import NotConverged
from shellform.structure.elements.state import State, moved
from shellform.structure.solve.assembly import Assembly
from shellform.structure.solve.extended import fit_for
from shellform.structure.solve.factorisation import NotPositiveDefinite
from shellform.structure.solve.residual import held, overturned

_LEAST = 1e-6  # of the whole, by which supports move on at least where the branch has ended
_LAST_DIGITS = 1e-15  # of a load, which nothing can be told from


@dataclass(frozen=True, eq=False)
class Drive(Record):
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


def moved_on(
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


def carried(assembly: Assembly, state: State, drive: Drive, change: float) -> tuple[State, int]:
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
