"""Assembly and factorisation with twice the digits, for stiffnesses that lie too far apart for double
precision.

Where one part of a structure is 1e8 times as stiff as another, or a member a millionth as long, the last bit
of a coordinate is a force that the load can't be told from, and the soft part's stiffness is lost beside the
rounding of the stiff one's. `ExtendedAssembly` stands in for an assembly then: states have tails, the tangent
(nnz, 2) is a sum of two doubles an entry (elements/double_double.py). What calls for it is told by
`ResidualNorm.rounding`.

L D L' of it is made column by column with all its digits (up-looking, Davis 2005), so that its pivots tell
definiteness and the number of negative eigenvalues; that takes some hundred times as long as PARDISO, and is
left for where the leading digits' factor can't be refined (refined.py).
"""

from __future__ import annotations

import time
from dataclasses import replace
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from shellform.arrays import Indices, Reals
from shellform.compiled import njit
from shellform.structure.elements.beam import Beams
from shellform.structure.elements.cable import Cables
from shellform.structure.elements.double_double import minus, over, plus, times
from shellform.structure.elements.ropes import Ropes
from shellform.structure.elements.state import State, extended
from shellform.structure.solve.assembly import Assembly, Balance, add_forces
from shellform.structure.solve.chords import ChordKeeper
from shellform.structure.solve.factorisation import Factor, Indefinite, NotPositiveDefinite, Symmetric
from shellform.structure.solve.refined import RefinedFactor
from shellform.work_clock import Work, counts_as

_REFINEMENTS = 3  # each leaves 1e-9 of what there was
_SMALL = 1e-2  # rad, below which a series of two terms is right to the last digit


class ExtendedAssembly(Assembly):
    """The same as `plain`, a model of beams, cables and ropes, with twice the digits."""

    def __init__(self, plain: Assembly) -> None:
        self.__dict__.update(plain.__dict__)
        self.__dict__.pop("chords", None)  # those of plain digits, where they were made before
        self.matrix: Symmetric = ExtendedSymmetric(plain.matrix)

    last_digit = 16.0 * Assembly.last_digit**2

    @cached_property
    def chords(self) -> ChordKeeper:
        """As `Assembly.chords`, all beams with one axial stiffness: stiff ones would leave the soft ones none
        of the digits.
        """
        alike = [replace(part, axial=np.ones(len(part.ends))) for part in self.beams]
        return _ExactChords(self.count, alike, self.free)

    @counts_as(Work.LOOPS)
    def evaluate(self, state: State, *, tangent: bool = True) -> Balance:
        """Energy, internal forces and, if asked for, the tangent (nnz, 2) at the state."""
        began = time.perf_counter()
        state = extended(state)
        energy, largest, turned = 0.0, 0.0, 0.0
        force = np.zeros(6 * self.count)
        entries = []
        for part, dofs in zip(self.parts, self._dofs, strict=True):
            if not len(dofs):
                continue
            assert isinstance(part, Beams | Cables | Ropes)
            result = part.evaluate_extended(state, tangent=tangent)
            energy += float(result.energy.sum())
            turned = max(turned, result.turned)
            largest = max(largest, add_forces(dofs, self.reach, result.force, force))
            if result.tangent is not None:
                entries.append(result.tangent.reshape(-1, 2))
        values = None
        if tangent:
            values = np.empty((len(self.matrix.indices), 2))
            _gather(*self._sources, np.concatenate(entries), values)
        self.clock["assembly"] += time.perf_counter() - began
        return Balance(energy, force.reshape(-1, 6), values, largest, turned)


_MADE: WeakKeyDictionary[Assembly, ExtendedAssembly] = WeakKeyDictionary()


def with_twice_the_digits(assembly: Assembly) -> Assembly | None:
    """The same assembly with twice the digits; None where it has them already or its parts can't."""
    if isinstance(assembly, ExtendedAssembly):
        return None
    if not all(isinstance(part, Beams | Cables | Ropes) for part in assembly.parts):
        return None
    if assembly not in _MADE:
        _MADE[assembly] = ExtendedAssembly(assembly)
    return _MADE[assembly]


def fit_for(assembly: Assembly, state: State) -> Assembly:
    """The assembly with the digits that the state has."""
    precise = with_twice_the_digits(assembly) if state.tail is not None else None
    return assembly if precise is None else precise


class ExtendedSymmetric(Symmetric):
    """A family of symmetric matrices with lower `values` (nnz, 2), hi and lo."""

    def __init__(self, plain: Symmetric) -> None:
        self.__dict__.update(plain.__dict__)
        self._plain = plain

    @cached_property
    def _order(self) -> tuple[Indices, Indices, Indices, Indices, Indices, Indices]:
        """The order of elimination, the permuted pattern's columns (upper triangle), where each of its
        entries comes from, and the elimination tree with the columns of L.
        """
        size = self.size
        weight = np.ones(len(self.indices))
        weight[self.diagonal] = 1.0 + size
        order = splu(
            sp.csc_array(super().full(weight)), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}
        ).perm_c.astype(np.int64)
        rows, columns = order[self.indices], order[self.columns]
        upper = sp.csc_array(
            (np.arange(1, len(rows) + 1), (np.minimum(rows, columns), np.maximum(rows, columns))),
            shape=(size, size),
        )
        indptr, indices = upper.indptr.astype(np.int64), upper.indices.astype(np.int64)
        parent, starts = _symbolic(size, indptr, indices)
        return order, indptr, indices, upper.data.astype(np.int64) - 1, parent, starts

    @counts_as(Work.FACTORISATIONS)
    def _pivots(self, values: Reals) -> ExtendedFactor:
        order, indptr, indices, sources, parent, starts = self._order
        rows, entries, pivots = _numeric(indptr, indices, values[sources], parent, starts)
        return ExtendedFactor(order, starts, rows, entries, pivots)

    @cached_property
    def _leading_family(self) -> Symmetric:
        """The family of the leading digits: one of its own, since factors of `plain` go on serving."""
        return Symmetric(self.indptr, self.indices)

    def _refinable(self, values: Reals) -> RefinedFactor | None:
        """The factor of the leading digits, where it is positive definite and near enough to be refined."""
        try:
            leading = self._leading_family.factor(np.ascontiguousarray(values[:, 0]))
        except NotPositiveDefinite:
            return None
        found = RefinedFactor(leading, self.indptr, self.indices, values)
        return found if found.near() else None

    def factor(self, values: Reals) -> Factor:
        """A factor that serves until the next one. Raises NotPositiveDefinite."""
        if not np.isfinite(values.sum()):
            raise NotPositiveDefinite("the matrix has entries that are not finite")
        refinable = self._refinable(values)
        if refinable is not None:
            return refinable
        found = self._pivots(values)
        if not (found.pivots[:, 0] > 0.0).all():
            raise NotPositiveDefinite("the matrix is not positive definite")
        return found

    def factor_indefinite(self, values: Reals) -> Indefinite:
        """The same of a matrix that needn't be positive definite."""
        return self._refinable(values) or self._pivots(values)

    def newton(self, values: Reals, right: Reals) -> tuple[Reals, bool]:
        """As `Symmetric.newton`."""
        refinable = self._refinable(values)
        if refinable is not None:
            return refinable.solve(right), True
        found = self._pivots(values)
        share = found.lower(right) ** 2 / np.abs(found.pivots[:, 0])
        untouched = float(share[found.pivots[:, 0] < 0.0].sum()) <= 1e-9 * float(share.sum())
        return found.solve(right), untouched

    def leading(self, values: Reals) -> Reals:
        """The values (nnz,) rounded to double precision."""
        return values[:, 0]

    def raised(self, values: Reals, places: Indices, by: Reals) -> Reals:
        """A copy of the values with those at `places` larger by `by`."""
        result = values.copy()
        _raise(result, places, np.broadcast_to(by, places.shape).astype(float))
        return result

    def full(self, values: Reals) -> sp.csc_array:
        """The whole matrix (n, n), rounded to double precision."""
        return super().full(values[:, 0])


class ExtendedFactor:
    """L D L' with `pivots` (n, 2)."""

    def __init__(self, order: Indices, starts: Indices, rows: Indices, entries: Reals, pivots: Reals) -> None:
        self._order, self._starts, self._rows, self._entries, self.pivots = (
            order,
            starts,
            rows,
            entries,
            pivots,
        )

    @property
    def negative(self) -> int:
        """How many eigenvalues are negative."""
        return int((self.pivots[:, 0] < 0.0).sum())

    def lower(self, right: Reals) -> Reals:
        """L^-1 times the right-hand side (n,), in the order of elimination."""
        return np.asarray(
            _solve(self._order, self._starts, self._rows, self._entries, self.pivots, right, True)
        )

    @counts_as(Work.SUBSTITUTIONS)
    def solve(self, right: Reals) -> Reals:
        """The solution for right-hand sides (n,) or (n, k)."""
        columns = right[:, None] if right.ndim == 1 else right
        found = [
            _solve(self._order, self._starts, self._rows, self._entries, self.pivots, np.array(each), False)
            for each in columns.T
        ]
        return np.asarray(found[0]) if right.ndim == 1 else np.column_stack(found)


class _ExactChords(ChordKeeper):
    """The correction to the last digit: its differences are written out, so that it vanishes with the step,
    and its solution is refined, since stiff elements answer to what the anchor leaves of it.
    """

    def corrected(self, state: State, step: Reals) -> Reals:
        """The step (n, 6) with its translations corrected."""
        if not len(self.ends):
            return step
        a, b = self.ends.T
        gap = self._gap(state.positions[b] - state.positions[a], step[b, :3] - step[a, :3])
        correction = np.zeros((len(step), 3))
        for _ in range(_REFINEMENTS):
            pull = self.weight[:, None] * (gap - (correction[b] - correction[a]))
            right = np.zeros_like(correction)
            np.add.at(right, b, pull)
            np.add.at(right, a, -pull)
            for nodes, group, factor in self.axes:
                correction[np.ix_(nodes, group)] += factor.solve(right[np.ix_(nodes, group)])
        result = step.copy()
        result[:, :3] += correction
        return result

    @staticmethod
    def _gap(chord: Reals, change: Reals) -> Reals:
        """d_new - d - Dd = (l + s) (cos t - 1) e + (s sin t / t + l (sin t / t - 1)) n t, (m, 3)."""
        length = np.linalg.norm(chord, axis=1)[:, None]
        axis = chord / length
        along = (axis * change).sum(axis=1)[:, None]
        across = (change - along * axis) / length
        turn = np.linalg.norm(across, axis=1)[:, None]
        short = -2.0 * np.sin(0.5 * turn) ** 2
        lost = np.where(turn < _SMALL, -(turn**2) / 6.0 * (1.0 - turn**2 / 20.0), np.sinc(turn / np.pi) - 1.0)
        return (length + along) * short * axis + (along * (1.0 + lost) + length * lost) * across


@njit(cache=True)
def _gather(first, places, sources, entries, values):  # type: ignore[no-untyped-def]
    """As assembly._gather, with all digits."""
    for v in range(len(values)):
        values[v] = entries[first[v]]
    for k in range(len(places)):
        v, s = places[k], sources[k]
        values[v, 0], values[v, 1] = plus((values[v, 0], values[v, 1]), (entries[s, 0], entries[s, 1]))


@njit(cache=True)
def _raise(values, places, by):  # type: ignore[no-untyped-def]
    for k in range(len(places)):
        p = places[k]
        values[p, 0], values[p, 1] = plus((values[p, 0], values[p, 1]), (by[k], 0.0))


@njit(cache=True)
def _symbolic(size, indptr, indices):  # type: ignore[no-untyped-def]
    """The elimination tree of an upper triangle by columns, and where each column of L begins."""
    parent, flag = np.full(size, -1), np.full(size, -1)
    count = np.zeros(size, dtype=np.int64)
    for k in range(size):
        flag[k] = k
        for p in range(indptr[k], indptr[k + 1]):
            i = indices[p]
            while flag[i] != k:
                if parent[i] == -1:
                    parent[i] = k
                count[i] += 1
                flag[i] = k
                i = parent[i]
    starts = np.zeros(size + 1, dtype=np.int64)
    for k in range(size):
        starts[k + 1] = starts[k] + count[k]
    return parent, starts


@njit(cache=True, error_model="numpy")
def _numeric(indptr, indices, values, parent, starts):  # type: ignore[no-untyped-def]
    """Rows and entries (.., 2) of L by columns, and the pivots (n, 2)."""
    size = len(parent)
    rows, entries = np.empty(starts[size], dtype=np.int64), np.empty((starts[size], 2))
    filled = starts[:size].copy()
    pivots, y = np.empty((size, 2)), np.zeros((size, 2))
    flag, pattern = np.full(size, -1), np.empty(size, dtype=np.int64)
    for k in range(size):
        top = size
        flag[k] = k
        for p in range(indptr[k], indptr[k + 1]):
            i = indices[p]
            y[i, 0], y[i, 1] = plus((y[i, 0], y[i, 1]), (values[p, 0], values[p, 1]))
            length = 0
            while flag[i] != k:
                pattern[length] = i
                length += 1
                flag[i] = k
                i = parent[i]
            while length > 0:
                top -= 1
                length -= 1
                pattern[top] = pattern[length]
        pivot = (y[k, 0], y[k, 1])
        y[k, 0], y[k, 1] = 0.0, 0.0
        for t in range(top, size):
            i = pattern[t]
            own = (y[i, 0], y[i, 1])
            y[i, 0], y[i, 1] = 0.0, 0.0
            for p in range(starts[i], filled[i]):
                r = rows[p]
                y[r, 0], y[r, 1] = minus((y[r, 0], y[r, 1]), times((entries[p, 0], entries[p, 1]), own))
            share = over(own, (pivots[i, 0], pivots[i, 1]))
            pivot = minus(pivot, times(share, own))
            rows[filled[i]] = k
            entries[filled[i], 0], entries[filled[i], 1] = share
            filled[i] += 1
        pivots[k, 0], pivots[k, 1] = pivot
    return rows, entries, pivots


@njit(cache=True, error_model="numpy")
def _solve(order, starts, rows, entries, pivots, right, half):  # type: ignore[no-untyped-def]
    size = len(order)
    x = np.zeros((size, 2))
    for i in range(size):
        x[order[i], 0] = right[i]
    for j in range(size):
        own = (x[j, 0], x[j, 1])
        for p in range(starts[j], starts[j + 1]):
            r = rows[p]
            x[r, 0], x[r, 1] = minus((x[r, 0], x[r, 1]), times((entries[p, 0], entries[p, 1]), own))
    if half:
        return x[:, 0].copy()
    for j in range(size - 1, -1, -1):
        own = over((x[j, 0], x[j, 1]), (pivots[j, 0], pivots[j, 1]))
        for p in range(starts[j], starts[j + 1]):
            r = rows[p]
            own = minus(own, times((entries[p, 0], entries[p, 1]), (x[r, 0], x[r, 1])))
        x[j, 0], x[j, 1] = own
    result = np.empty(size)
    for i in range(size):
        result[i] = x[order[i], 0]
    return result
