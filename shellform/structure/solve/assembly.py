"""From the elements of several parts to one force vector and one sparse tangent.

The pattern of the tangent is built once: each packed entry of each element has a fixed slot among the values
of the lower triangle, so that an assembly is one pass of additions. Held degrees of freedom never enter; a
node that no beam touches has no rotations.
"""

from __future__ import annotations

import copy
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from shellform.arrays import Flags, Indices, Reals, Record
from shellform.compiled import njit
from shellform.structure.elements.beam import Beams
from shellform.structure.elements.cable import Cables
from shellform.structure.elements.parts import Part
from shellform.structure.elements.state import State
from shellform.structure.elements.threads import Item, Result, share, side_by_side
from shellform.structure.solve.chords import ChordKeeper
from shellform.structure.solve.factorisation import Factor, Symmetric
from shellform.work_clock import Work, counts_as


@dataclass(frozen=True, eq=False)
class Balance(Record):
    """All elements at one state: strain `energy` J, nodal internal `force` (n, 6), lower `tangent` values (or
    None).

    `largest` is the largest component of any element's end force, moments over the node's arm, N: the scale
    for residuals. `turned`, rad: the largest local rotation or twist of a beam, 0 where all are below 45
    degrees.
    """

    energy: float
    force: Reals
    tangent: Reals | None
    largest: float
    turned: float


class Assembly:
    """Parts on `count` nodes, put together.

    - `parts`, in order; `free` (f,): the degrees of freedom that aren't held, in order; `number` (6 count,):
      the place of each degree of freedom among them, -1 where it is held or has no stiffness.
    - `arms` (count,), m: the mean rest length of each node's beams.
    - `matrix`: the pattern and the factor of the tangent.
    - `clock`, s: what was spent on assembly, factorisation and solve.
    - `last_digit`: how exactly, relative to 1, coordinates are told.
    """

    last_digit: float = float(np.finfo(float).eps)

    def __init__(self, count: int, parts: Sequence[Part], fixed: Flags) -> None:
        self.count = count
        self.parts = tuple(parts)
        dofs = [part.dofs() for part in self.parts]
        active = np.zeros(6 * count, dtype=bool)
        for each in dofs:
            active[each.ravel()] = True
        active &= ~fixed.ravel()
        self.free: Indices = np.flatnonzero(active)
        self.number: Indices = np.full(6 * count, -1, dtype=np.int64)
        self.number[self.free] = np.arange(len(self.free))
        self.clock: dict[str, float] = {"assembly": 0.0, "factorisation": 0.0, "solve": 0.0}
        self._dofs = dofs
        self.arms = _arms(count, self.beams)
        # What turns a force or a moment into a force: 1 for translations, 1 over the node's arm for
        # rotations.
        self.reach: Reals = np.repeat(1.0 / self.arms[:, None], 6, axis=1)
        self.reach[:, :3] = 1.0
        self.reach = self.reach.ravel()
        self.matrix, self._sources = _pattern(self.number, dofs)
        ends = np.cumsum([0] + [len(each) * each.shape[1] * (each.shape[1] + 1) // 2 for each in dofs])
        self._shares = list(zip(ends[:-1].tolist(), ends[1:].tolist(), strict=True))
        self._entries = np.empty(int(ends[-1]))

    def with_parts(self, parts: Sequence[Part]) -> Assembly:
        """The same assembly, its pattern shared, with parts of the same elements and other properties."""
        other = copy.copy(self)
        other.parts = tuple(parts)
        other._entries = np.empty_like(self._entries)
        return other

    def beside(self) -> Assembly:
        """The same assembly, its pattern shared, with a factor of its own, for work that goes on side by
        side."""
        other = self.with_parts(self.parts)
        other.matrix = Symmetric(self.matrix.indptr, self.matrix.indices)
        other.clock = dict.fromkeys(self.clock, 0.0)
        return other

    def by_node(self, values: Reals) -> Reals:
        """Values (f,) of the free degrees of freedom as (n, 6) of the nodes, 0 where these are held."""
        every = np.zeros(6 * self.count)
        every[self.free] = values
        return every.reshape(-1, 6)

    @property
    def beams(self) -> list[Beams]:
        """The parts that are beams."""
        return [part for part in self.parts if isinstance(part, Beams)]

    @property
    def cables(self) -> list[Cables]:
        """The parts that are cables."""
        return [part for part in self.parts if isinstance(part, Cables)]

    @cached_property
    def turns(self) -> Indices:
        """Places of the free rotations' diagonal entries among the tangent's values."""
        return self.matrix.diagonal[self.free % 6 >= 3]

    @cached_property
    def chords(self) -> ChordKeeper:
        """The second-order correction of steps; `with_parts` keeps it, its weights needn't be up to date."""
        return ChordKeeper(self.count, self.beams, self.free)

    @counts_as(Work.LOOPS)
    def evaluate(self, state: State, *, tangent: bool = True) -> Balance:
        """Energy, internal forces and, if asked for, the tangent at the state."""
        began = time.perf_counter()
        energy, largest, turned = 0.0, 0.0, 0.0
        force = np.zeros(6 * self.count)
        for part, dofs, (first, last) in zip(self.parts, self._dofs, self._shares, strict=True):
            if not len(dofs):
                continue
            block = self._entries[first:last].reshape(len(dofs), -1) if tangent else None
            result = part.evaluate(state, tangent=tangent, into=block)
            energy += float(result.energy.sum())
            turned = max(turned, result.turned)
            largest = max(largest, add_forces(dofs, self.reach, result.force, force))
        values = self._gathered() if tangent else None
        self.clock["assembly"] += time.perf_counter() - began
        return Balance(energy, force.reshape(-1, 6), values, largest, turned)

    def unbalanced(self, state: State, load: Reals) -> Reals:
        """Internal forces less the `load` (n, 6), N and N·m: what the ground bears (the reactions) where
        degrees of freedom are held, and what is out of balance elsewhere."""
        return self.evaluate(state, tangent=False).force - load

    def foreseen(self, state: State, motion: Reals) -> tuple[Reals, ...]:
        """The deformations (m, 7) of each part of beams to which the `motion` (n, 6) leads to first order."""
        return tuple(part.foreseen(state, motion) for part in self.beams)

    @counts_as(Work.LOOPS)
    def tangent_of(self, state: State, deformations: Sequence[Reals]) -> Reals:
        """The tangent's lower values (nnz,) at the state, of beams that have other `deformations` than follow
        from it, part after part. Those of the last step's linear system make Newton's iteration a mixed one,
        in which stresses are unknowns of their own (Magisano, Leonetti and Garcea 2017): a slender rod that a
        finite step has stretched by second-order terms isn't told to be stiffer, or softer, by a force that
        the next step takes away again."""
        began = time.perf_counter()
        given = iter(deformations)
        for part, dofs, (first, last) in zip(self.parts, self._dofs, self._shares, strict=True):
            own = next(given) if isinstance(part, Beams) else None
            if not len(dofs):
                continue
            block = self._entries[first:last].reshape(len(dofs), -1)
            if isinstance(part, Beams) and own is not None:
                part.tangent_of(state, own, block)
            else:
                part.evaluate(state, tangent=True, into=block)
        values = self._gathered()
        self.clock["assembly"] += time.perf_counter() - began
        return values

    def _gathered(self) -> Reals:
        """The tangent's values (nnz,) from the elements' entries."""
        values = np.empty(len(self.matrix.indices))
        share(_gather, len(values), *self._sources, self._entries, values)
        return values

    def force_along(self, state: State, motion: Reals) -> Reals:
        """How the internal forces (n, 6) begin to change, N and N·m, as the nodes move by `motion` (n, 6),
        held degrees of freedom too.
        """
        change = np.zeros(6 * self.count)
        for part, dofs in zip(self.parts, self._dofs, strict=True):
            if len(dofs):
                tangent = part.evaluate(state, tangent=True).tangent
                assert tangent is not None
                _multiply(dofs, tangent, motion.ravel(), change)
        return change.reshape(-1, 6)

    def factor(self, state: State) -> Factor:
        """Cholesky factor of the tangent at the state, good until the next factorisation here.

        Raises NotPositiveDefinite where the state is not stable.
        """
        values = self.evaluate(state).tangent
        assert values is not None
        return self.matrix.factor(values)


def on_their_own(
    first: Assembly, work: Callable[[Assembly, Item], Result], items: Sequence[Item]
) -> list[Result]:
    """`work` on every item, side by side on the cores, each with an assembly that no other is using, since
    one keeps one factor: the `first` or one beside it; results in order."""
    idle = [first]

    def alone(item: Item) -> Result:
        try:
            own = idle.pop()
        except IndexError:
            own = first.beside()
        found = work(own, item)
        idle.append(own)
        return found

    return side_by_side(alone, items)


def _arms(count: int, beams: Sequence[Beams]) -> Reals:
    """A length (count,) for each node, m: the mean rest length of the beams that meet there (1 where there
    are none).
    """
    total, number = np.zeros(count), np.zeros(count)
    for part in beams:
        for end in part.ends.T:
            np.add.at(total, end, part.rest_length)
            np.add.at(number, end, 1.0)
    return np.where(number > 0.0, total / np.maximum(number, 1.0), 1.0)


def _pattern(
    number: Indices, dofs: Sequence[Indices]
) -> tuple[Symmetric, tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """The common lower pattern, and which packed entries of all elements, one after the other, add up to each
    of its values: `first` has one for each value, and `sources` what else adds to the values at `places`,
    which ascend."""
    size = int(number.max(initial=-1)) + 1
    count = sum(len(each) * each.shape[1] * (each.shape[1] + 1) // 2 for each in dofs)
    # Half the width is half the memory that an assembly has to read.
    width = np.int32 if count < np.iinfo(np.int32).max else np.int64
    row, column = np.empty(count, dtype=width), np.empty(count, dtype=width)
    begin = 0
    for each in dofs:
        begin = _entries(number, each, begin, row, column)
    order = np.flatnonzero(column >= 0).astype(width)
    order = _counted(column, _counted(row, order, size), size)
    indptr, indices, *sources = _merged(row, column, order, size)
    return Symmetric(indptr, indices), (sources[0], sources[1], sources[2])


@njit(cache=True)
def _entries(number, dofs, begin, row, column):  # type: ignore[no-untyped-def]
    """Fills rows and columns of the packed entries of all elements from place `begin` on; where a degree of
    freedom is held the column is -1.
    """
    at = begin
    for e in range(dofs.shape[0]):
        for i in range(dofs.shape[1]):
            for j in range(i + 1):
                a, b = number[dofs[e, i]], number[dofs[e, j]]
                row[at], column[at] = max(a, b), min(a, b)
                at += 1
    return at


@njit(cache=True)
def _counted(keys, order, size):  # type: ignore[no-untyped-def]
    """`order` sorted by keys[order], which run from 0 to size - 1; equal ones stay in order (counting
    sort).
    """
    place = np.zeros(size + 1, dtype=np.int64)
    for k in order:
        place[keys[k] + 1] += 1
    for k in range(1, size + 1):
        place[k] += place[k - 1]
    result = np.empty_like(order)
    for k in order:
        result[place[keys[k]]] = k
        place[keys[k]] += 1
    return result


@njit(cache=True)
def _merged(row, column, order, size):  # type: ignore[no-untyped-def]
    """The pattern, column by column, of sorted entries with repetitions, and first, places and sources of
    `_pattern`.
    """
    new = np.empty(len(order), dtype=np.bool_)
    last_row, last_column, count = -1, -1, 0
    for k in range(len(order)):
        r, c = row[order[k]], column[order[k]]
        new[k] = r != last_row or c != last_column
        last_row, last_column = r, c
        count += new[k]
    indptr, indices = np.zeros(size + 1, dtype=np.int64), np.empty(count, dtype=np.int64)
    first, places, sources = (
        np.empty(count, order.dtype),
        np.empty(len(order) - count, order.dtype),
        np.empty(len(order) - count, order.dtype),
    )
    value, extra = -1, 0
    for k in range(len(order)):
        if new[k]:
            value += 1
            indices[value] = row[order[k]]
            indptr[column[order[k]] + 1] += 1
            first[value] = order[k]
        else:
            places[extra], sources[extra] = value, order[k]
            extra += 1
    for c in range(size):
        indptr[c + 1] += indptr[c]
    return indptr, indices, first, places, sources


@njit(cache=True, nogil=True)
def _gather(start, stop, first, places, sources, entries, values):  # type: ignore[no-untyped-def]
    """The first entry of each value, then what adds to it: two loops without a branch that a processor could
    guess wrong.
    """
    for v in range(start, stop):
        values[v] = entries[first[v]]
    for k in range(np.searchsorted(places, start), np.searchsorted(places, stop)):
        values[places[k]] += entries[sources[k]]


@njit(cache=True)
def add_forces(dofs, reach, element, total):  # type: ignore[no-untyped-def]
    """Adds the elements' end forces to the nodes' and returns the largest component, moments over the node's
    arm.
    """
    largest = 0.0
    for e in range(dofs.shape[0]):
        for k in range(dofs.shape[1]):
            dof = dofs[e, k]
            total[dof] += element[e, k]
            largest = max(largest, abs(element[e, k]) * reach[dof])
    return largest


@njit(cache=True)
def _multiply(dofs, tangent, motion, total):  # type: ignore[no-untyped-def]
    """Adds each element's packed symmetric tangent times its motion."""
    for e in range(dofs.shape[0]):
        at = 0
        for i in range(dofs.shape[1]):
            for j in range(i + 1):
                total[dofs[e, i]] += tangent[e, at] * motion[dofs[e, j]]
                if j < i:
                    total[dofs[e, j]] += tangent[e, at] * motion[dofs[e, i]]
                at += 1
