"""From the elements of several parts to one force vector and one sparse tangent.

The pattern of the tangent is built once: each packed entry of each element has a fixed slot among the values of the lower
triangle, so that an assembly is one pass of additions. Held freedoms never enter; a node that no beam touches has no
rotations.
"""

from __future__ import annotations

import copy
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numba import njit

from shellform.arrays import Flags, Indices, Reals
from shellform.structure.beam import Beams
from shellform.structure.chords import ChordKeeper
from shellform.structure.parts import Part
from shellform.structure.sparse import Factor, Symmetric
from shellform.structure.state import State


@dataclass(frozen=True)
class Balance:
    """All elements at one state: strain `energy` J, nodal internal `force` (n, 6), lower `tangent` values (or None).

    `largest` is the largest component of any element's end force, N: the scale for residuals.
    """

    energy: float
    force: Reals
    tangent: Reals | None
    largest: float


class Assembly:
    """Parts on `count` nodes with held freedoms `fixed` (count, 6). `free` (f,) lists the free freedoms in order;
    `clock` adds up the seconds spent on assembly, factorisation and solve."""

    def __init__(self, count: int, parts: Sequence[Part], fixed: Flags) -> None:
        self.count = count
        self.parts = tuple(parts)
        freedoms = [part.freedoms() for part in self.parts]
        active = np.zeros(6 * count, dtype=bool)
        for each in freedoms:
            active[each.ravel()] = True
        active &= ~fixed.ravel()
        self.free: Indices = np.flatnonzero(active)
        number = np.full(6 * count, -1, dtype=np.int64)
        number[self.free] = np.arange(len(self.free))
        self.clock: dict[str, float] = {"assembly": 0.0, "factorisation": 0.0, "solve": 0.0}
        self._freedoms = freedoms
        self._translational = [(each[0] % 6 < 3) if len(each) else np.zeros(0, dtype=bool) for each in freedoms]
        self.matrix, self._slots = _pattern(number, freedoms)

    def with_parts(self, parts: Sequence[Part]) -> Assembly:
        """The same assembly, its pattern shared, with parts of the same elements and other properties."""
        other = copy.copy(self)
        other.parts = tuple(parts)
        return other

    @property
    def beams(self) -> list[Beams]:
        """The parts that are beams."""
        return [part for part in self.parts if isinstance(part, Beams)]

    @cached_property
    def chords(self) -> ChordKeeper:
        """The second-order correction of steps; `with_parts` keeps it, its weights needn't be up to date."""
        return ChordKeeper(self.count, self.beams, self.free)

    def evaluate(self, state: State, *, tangent: bool = True) -> Balance:
        """Energy, internal forces and, if asked for, the tangent at the state."""
        began = time.perf_counter()
        energy, largest = 0.0, 0.0
        force = np.zeros(6 * self.count)
        values = np.zeros(len(self.matrix.indices) + 1)  # the last collects what belongs to held freedoms
        for part, freedoms, slots, moved in zip(
            self.parts, self._freedoms, self._slots, self._translational, strict=True
        ):
            if not len(freedoms):
                continue
            result = part.evaluate(state, tangent=tangent)
            energy += float(result.energy.sum())
            largest = max(largest, float(np.abs(result.force[:, moved]).max()))
            _scatter(freedoms, result.force, force)
            if result.tangent is not None:
                _scatter(slots, result.tangent, values)
        self.clock["assembly"] += time.perf_counter() - began
        return Balance(energy, force.reshape(-1, 6), values[:-1] if tangent else None, largest)

    def factor(self, state: State) -> Factor:
        """Cholesky factor of the tangent at the state, good until the next factorisation here.

        Raises NotPositiveDefinite where the state is not stable.
        """
        values = self.evaluate(state).tangent
        assert values is not None
        return self.matrix.factor(values)


def _pattern(number: Indices, freedoms: Sequence[Indices]) -> tuple[Symmetric, list[Indices]]:
    """The common lower pattern, and for each part the slot (m, k (k + 1) / 2) of each packed entry (nnz: nowhere)."""
    size = int(number.max(initial=-1)) + 1
    keys = [np.arange(size) * (size + 1)]  # every diagonal entry is stored, whatever touches it
    for each in freedoms:
        row, column = np.tril_indices(each.shape[1])
        mapped = number[each]
        upper, lower = np.minimum(mapped[:, row], mapped[:, column]), np.maximum(mapped[:, row], mapped[:, column])
        keys.append(np.where(upper < 0, -1, upper * size + lower))
    entries = np.unique(np.concatenate([key.ravel() for key in keys]))
    entries = entries[entries >= 0]
    slots = [np.where(key < 0, len(entries), np.searchsorted(entries, key)) for key in keys[1:]]
    columns, rows = np.divmod(entries, size) if size else (entries, entries)
    indptr = np.searchsorted(columns, np.arange(size + 1))
    return Symmetric(indptr, rows), slots


@njit(cache=True)
def _scatter(slots, values, total):  # type: ignore[no-untyped-def]
    for e in range(slots.shape[0]):
        for k in range(slots.shape[1]):
            total[slots[e, k]] += values[e, k]
