"""Tension-only cables (section 3 of the paper: no bending, torsion or compression stiffness).

With length l, rest length l0 and axial stiffness EA, the tension is

    N = EA max(l / l0 - 1, 0)

and pulls the two ends together along e = (x_b - x_a) / l. Its energy is N (l - l0) / 2. A cable at l <= l0 is
slack: no force, no stiffness. The derivatives by l0 are those of the appendix (A.23 to A.26, with seven
entries where it prints six).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from shellform.arrays import Indices, Reals, Record, indices, reals
from shellform.compiled import njit
from shellform.errors import InputError
from shellform.structure.elements.double_double import cable_evaluation
from shellform.structure.elements.parts import Evaluation
from shellform.structure.elements.state import State
from shellform.structure.elements.threads import share

_NOTHING = np.empty((0, 21))
_NO_LENGTH = 1e-300  # a cable whose ends meet is slack and pulls nowhere


@dataclass(frozen=True, eq=False)
class Cables(Record):
    """`ends` (c, 2) node numbers, `rest_length` (c,) m, `stiffness` EA (c,) N."""

    ends: Indices
    rest_length: Reals
    stiffness: Reals

    def __post_init__(self) -> None:
        count = len(self.ends)
        put = object.__setattr__
        put(self, "ends", indices("cables.ends", self.ends, (count, 2), below=np.iinfo(np.int64).max))
        looped = self.ends[:, 0] == self.ends[:, 1]
        if looped.any():
            cable = int(np.argmax(looped))
            raise InputError(
                "the cable joins a node to itself",
                where=f"cables[{cable}]",
                value=int(self.ends[cable, 0]),
                remedy="Give it two different nodes, or leave it out.",
            )
        put(self, "rest_length", reals("cables.rest_length", self.rest_length, (count,), positive=True))
        put(self, "stiffness", reals("cables.stiffness", self.stiffness, (count,), positive=True))

    def dofs(self) -> Indices:
        """Translations (c, 6) of the two ends."""
        return (6 * self.ends[:, :, None] + np.arange(3)).reshape(-1, 6)

    def stiffest(self) -> Reals:
        """The stiffness (c,), N/m, of each cable where it is taut."""
        return self.stiffness / self.rest_length

    def lengths(self, state: State) -> Reals:
        """Lengths (c,), m, at the state (14)."""
        return self.chords(state)[1]

    def chords(self, state: State) -> tuple[Reals, Reals]:
        """From first ends to second ones (c, 3), m, and the lengths (c,), m."""
        chord = state.positions[self.ends[:, 1]] - state.positions[self.ends[:, 0]]
        return chord, np.linalg.norm(chord, axis=1)

    def directions(self, state: State) -> tuple[Reals, Reals]:
        """Unit vectors e (c, 3) from first ends to second ones, and the lengths (c,), m."""
        chord, length = self.chords(state)
        return chord / length[:, None], length

    def evaluate_extended(self, state: State, *, tangent: bool) -> Evaluation:
        """As `evaluate` at a state with a tail, tangents (c, 21, 2) with all their digits."""
        assert state.tail is not None
        count = len(self.ends)
        energy, force = np.empty(count), np.empty((count, 6))
        blocks = np.empty((count if tangent else 0, 21, 2))
        elastic = self.ends, self.rest_length, self.stiffness
        share(cable_evaluation, count, state.positions, state.tail, *elastic, energy, force, blocks)
        return Evaluation(energy, force, blocks if tangent else None)

    def tension(self, state: State) -> Reals:
        """Tension (c,), N; exactly zero in slack cables."""
        if state.tail is not None:
            force = self.evaluate_extended(state, tangent=False).force
            return np.linalg.norm(force[:, :3], axis=1)
        return self.stiffness * np.maximum(self.lengths(state) - self.rest_length, 0.0) / self.rest_length

    def tension_by_rest_length(self, state: State) -> Reals:
        """Partial derivative (c,), N/m, of the tension by the own rest length at fixed geometry: -EA l / l0²
        if taut.
        """
        length = self.lengths(state)
        return np.where(length > self.rest_length, -self.stiffness * length / self.rest_length**2, 0.0)

    def tension_by_position(self, state: State) -> Reals:
        """Derivative (c, 6), N/m, of the tension by the coordinates of the two ends: EA/l0 (-e, e) if
        taut.
        """
        chord, length = self.chords(state)
        slope = np.where(length > self.rest_length, self.stiffness / self.rest_length, 0.0)
        toward = (slope / length)[:, None] * chord
        return np.hstack([-toward, toward])

    def force_by_rest_length(self, state: State) -> Reals:
        """Derivative (c, 6), N/m, of the end forces by the own rest length at fixed geometry (A.23)."""
        chord, length = self.chords(state)
        along = self.tension_by_rest_length(state)[:, None] * chord / length[:, None]
        return np.hstack([-along, along])

    def evaluate(self, state: State, *, tangent: bool, into: Reals | None = None) -> Evaluation:
        """Energy (c,) J, forces (c, 6) N on the ends, packed lower tangents (c, 21) N/m, filled `into`."""
        count = len(self.ends)
        if state.tail is not None and not tangent:
            return self.evaluate_extended(state, tangent=False)
        energy, force = np.empty(count), np.empty((count, 6))
        blocks = _NOTHING if not tangent else np.empty((count, 21)) if into is None else into
        share(
            _evaluate,
            count,
            state.positions,
            self.ends,
            self.rest_length,
            self.stiffness,
            energy,
            force,
            blocks,
        )
        return Evaluation(energy, force, blocks if tangent else None)


def make_cables(ends: ArrayLike, *, rest_length: ArrayLike, stiffness: ArrayLike) -> Cables:
    """Cables between node pairs (c, 2); scalars hold for all cables."""
    pairs = np.asarray(ends, dtype=np.int64).reshape(-1, 2)
    count = len(pairs)
    rest = np.broadcast_to(np.asarray(rest_length, dtype=float), (count,))
    return Cables(pairs, rest, np.broadcast_to(np.asarray(stiffness, dtype=float), (count,)))


@njit(cache=True, error_model="numpy", nogil=True)
def _evaluate(start, stop, positions, ends, rest_length, stiffness, energy, force, blocks):  # type: ignore[no-untyped-def]
    """One pass over the cables from `start` to `stop`; `blocks` is filled where it has rows."""
    e = np.empty(3)
    for c in range(start, stop):
        a, b = ends[c, 0], ends[c, 1]
        for i in range(3):
            e[i] = positions[b, i] - positions[a, i]
        l = np.sqrt(e[0] * e[0] + e[1] * e[1] + e[2] * e[2])
        stretch = max(l - rest_length[c], 0.0)
        slope = stiffness[c] / rest_length[c]
        N = slope * stretch
        energy[c] = 0.5 * N * stretch
        for i in range(3):
            e[i] /= max(l, _NO_LENGTH)
            force[c, i], force[c, 3 + i] = -N * e[i], N * e[i]
        if blocks.shape[0] == 0:
            continue
        taut = slope if stretch > 0.0 else 0.0
        lateral = N / max(l, _NO_LENGTH)
        at = 0
        for row in range(6):
            for column in range(row + 1):
                i, j = row % 3, column % 3
                value = (taut - lateral) * e[i] * e[j] + (lateral if i == j else 0.0)
                blocks[c, at] = value if row // 3 == column // 3 else -value
                at += 1
