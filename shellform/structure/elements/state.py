"""The state of a network: where its nodes are and how they are turned."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from shellform.arrays import Reals, Record, reals
from shellform.structure.elements import rotation
from shellform.structure.elements.double_double import moved_on, quaternions_of


@dataclass(frozen=True, eq=False)
class State(Record):
    """Positions (n, 3), m, and total rotations from the stress-free state, unit quaternions (n, 4).

    `tail` (n, 7): what positions and quaternions have beyond double precision where stiffnesses lie so far
    apart that it takes part (double_double.py), else None.
    """

    positions: Reals
    quaternions: Reals
    tail: Reals | None = None

    def __post_init__(self) -> None:
        positions = reals("positions", self.positions, (None, 3))
        object.__setattr__(self, "positions", positions)
        object.__setattr__(self, "quaternions", reals("quaternions", self.quaternions, (len(positions), 4)))
        if self.tail is not None:
            object.__setattr__(self, "tail", reals("tail", self.tail, (len(positions), 7)))

    def __repr__(self) -> str:
        return f"State({len(self.positions)} nodes)"

    @property
    def rotations(self) -> Reals:
        """Total rotation vectors (n, 3), rad, of length at most pi."""
        return rotation.to_vectors(self.quaternions)


def at_rest(positions: ArrayLike) -> State:
    """The state with unrotated nodes at `positions` (n, 3), m."""
    place = np.asarray(positions, dtype=float)
    return State(place, rotation.identity(len(place)))


def from_vectors(positions: ArrayLike, rotations: ArrayLike) -> State:
    """The state with nodes at `positions` (n, 3), m, turned by the rotation vectors `rotations` (n, 3),
    rad.
    """
    place = np.asarray(positions, dtype=float)
    return State(place, rotation.from_vectors(reals("rotations", rotations, (len(place), 3))))


def moved(state: State, step: Reals) -> State:
    """The state after `step` (n, 6): translations, m, and rotation increments about global axes, rad
    (equation 9).
    """
    if state.tail is not None:
        turns = quaternions_of(np.ascontiguousarray(step[:, 3:]))
        place, tail = moved_on(state.positions, state.quaternions, state.tail, step, turns)
        return State(place[:, :3], place[:, 3:], tail)
    return State(state.positions + step[:, :3], rotation.turned(step[:, 3:], state.quaternions))


def motion(before: State, after: State) -> Reals:
    """The step (n, 6) that leads from one state to the other, as `moved` takes it: translations, m, and
    rotation vectors about global axes, rad, of length at most pi. Digits of a tail don't count."""
    back = before.quaternions * [1.0, -1.0, -1.0, -1.0]
    turns = rotation.to_vectors(rotation.product(after.quaternions, back))
    return np.hstack([after.positions - before.positions, turns])


def extended(state: State) -> State:
    """The same state, its digits beyond double precision carried on from here."""
    return (
        state
        if state.tail is not None
        else State(state.positions, state.quaternions, np.zeros((len(state.positions), 7)))
    )
