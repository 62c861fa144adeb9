"""Symmetric sparse factorisation with the symbolic analysis done once.

MKL's PARDISO is the fastest Cholesky that pip installs; CHOLMOD's supernodal one, from the `cvxopt` wheel,
takes its place where there is no MKL, and SciPy's SuperLU in symmetric mode without pivoting where there is
neither, or where a limit on memory leaves no room for them. SHELLFORM_SOLVER=mkl, cholmod or superlu asks for
one of them. A Cholesky factorisation that fails is
information (the state is no stable equilibrium), so it is an exception of its own.

Whether CHOLMOD makes a supernodal L L', which fails where the matrix isn't positive definite, or a simplicial
L D L', which doesn't, hangs on an option of the whole process. Load cases are followed in threads, so one
lock is held from setting that option until the factor that it is meant for is there.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from shellform.arrays import Indices, Reals
from shellform.errors import InputError
from shellform.structure.solve import pardiso
from shellform.structure.solve.addresses import has_room, take_work_areas
from shellform.structure.solve.thin import Thin
from shellform.work_clock import Work, counts_as

try:
    from cvxopt import cholmod, matrix, spmatrix
except ImportError:  # no wheel for this platform: SuperLU serves
    cholmod = None
take_work_areas()  # before MKL and CHOLMOD ask for what is left
# bytes of addresses: where 211e6 were left here, CHOLMOD crashed later; with 252e6 it ran
_BLAS = 240_000_000
if cholmod is not None and not has_room(_BLAS):
    cholmod = None

_FEW = 64  # values
_FEWEST_COLUMNS, _MOST_COLUMNS, _ROOM = 64, 256, 2**24  # solved for at once, and the entries that they have
_SUPERNODAL, _SIMPLICIAL = 2, 0  # values of CHOLMOD's option: L L' by blocks, L D L' column by column
_CHOLMOD = threading.Lock()  # held while the option must stay as it was set

_NAMES = {"mkl": "PARDISO (MKL)", "cholmod": "CHOLMOD (cvxopt)", "superlu": "SuperLU (SciPy)"}


def installed() -> list[str]:
    """The solvers there are, the fastest first."""
    return [name for name in _NAMES if _is_installed(name)]


def _is_installed(name: str) -> bool:
    if name == "mkl":
        return pardiso.library() is not None
    return name == "superlu" or (name == "cholmod" and cholmod is not None)


def column_blocks(count: int, size: int) -> Iterator[slice]:
    """Of `count` right-hand sides of a `size` those that are solved for at once, where there are thousands:
    some 130 MB."""
    step = max(min(_ROOM // max(size, 1), _MOST_COLUMNS), _FEWEST_COLUMNS)
    for first in range(0, count, step):
        yield slice(first, min(first + step, count))


def backend() -> str:
    """Which solver factorises: the one that SHELLFORM_SOLVER names, or the fastest there is. Raises
    InputError.
    """
    asked = os.environ.get("SHELLFORM_SOLVER")
    if asked is None:
        return installed()[0]
    # MKL stays unloaded where another is asked for: in libraries loaded after it (cvxopt's for quadratic
    # programs) its functions take the place of their own, and a search ends with other bytes.
    if asked not in _NAMES or not _is_installed(asked):
        raise InputError(
            "is no solver installed here",
            where="SHELLFORM_SOLVER",
            value=asked,
            remedy=f"There are: {', '.join(installed())}.",
        )
    return asked


def backend_name() -> str:
    """The solver's full name, for reports."""
    return _NAMES[backend()]


class NotPositiveDefinite(ArithmeticError):
    """The matrix has an eigenvalue that is not positive."""


class Factor(Protocol):
    """A factorised matrix."""

    def solve(self, right: Reals) -> Reals:
        """The solution for right-hand sides (n,) or (n, k)."""


class Indefinite(Factor, Protocol):
    """A factorised matrix that needn't be positive definite."""

    @property
    def negative(self) -> int:
        """How many of its eigenvalues are negative."""


class Symmetric:
    """A family of symmetric matrices with one pattern: lower triangle in CSC form, `indptr` (n + 1,),
    `indices` (nnz,).
    """

    def __init__(self, indptr: Indices, indices: Indices) -> None:
        self.size = len(indptr) - 1
        self.indptr, self.indices = indptr, indices
        self.columns = np.repeat(np.arange(self.size), np.diff(indptr))
        self.diagonal = indptr[:-1]  # the first stored entry of each column of a lower triangle
        chosen = backend()
        self._backend = chosen if self.size else "superlu"  # PARDISO takes no matrix without rows
        self._pardiso: pardiso.Factoriser | None = None
        self._bunch_kaufman: pardiso.Factoriser | None = None
        self._condensed: tuple[Indices, pardiso.Factoriser] | None = None
        self._symbolic: Any = None
        self._matrix: Any = None
        self._latest = _Latest()
        self._last: tuple[Reals, Factor] | None = None

    def factor(self, values: Reals) -> Factor:
        """Cholesky factor of the matrix with lower `values` (nnz,). It serves until the next call of `factor`
        with other ones: where an equilibrium was found stable, what is looked at there costs none again.

        Raises NotPositiveDefinite.
        """
        if self._last is not None:
            before, found = self._last
            # The few first ones tell others apart at once.
            if np.array_equal(before[:_FEW], values[:_FEW]) and np.array_equal(before, values):
                return found
        self._last = None
        found = self._factor(values)
        self._last = values, found
        return found

    @counts_as(Work.FACTORISATIONS)
    def _factor(self, values: Reals) -> Factor:
        if not np.isfinite(values.sum()):
            raise NotPositiveDefinite("the matrix has entries that are not finite")
        if self._backend == "mkl":
            return self._factor_with_pardiso(values)
        if self._backend == "superlu":
            return _SuperLU(self.full(values))
        self._latest.number += 1
        try:
            with _CHOLMOD:
                if self._symbolic is None:
                    cholmod.options["supernodal"] = _SUPERNODAL
                    self._matrix = self._lower(values)
                    self._symbolic = cholmod.symbolic(self._matrix)
                self._matrix.V = matrix(values)
                cholmod.numeric(self._matrix, self._symbolic)
        except ArithmeticError as error:
            raise NotPositiveDefinite("the matrix is not positive definite") from error
        return _Cholmod(self._latest, self._symbolic)

    def _factor_with_pardiso(self, values: Reals) -> Factor:
        if self._pardiso is None:
            self._pardiso = pardiso.Factoriser(self.indptr, self.indices)
        self._latest.number += 1
        try:
            self._pardiso.factor(values)
        except pardiso.NotDefinite as error:
            raise NotPositiveDefinite("the matrix is not positive definite") from error
        return _Pardiso(self._latest, self._pardiso)

    @counts_as(Work.FACTORISATIONS)
    def solve_kept(self, values: Reals, kept: Indices, right: Reals) -> Reals | None:
        """The solution (k, s) on the degrees of freedom `kept` (k,), ascending, for right-hand sides (k, s)
        on them that are zero elsewhere.

        All others are eliminated, which costs as much as a factorisation. Earlier factors go on serving. None
        where the solver can't do it. Raises NotPositiveDefinite.
        """
        if self._backend != "mkl":
            return None
        if self._condensed is None or not np.array_equal(self._condensed[0], kept):
            self._condensed = kept, pardiso.Factoriser(self.indptr, self.indices, kept=kept)
        try:
            return self._condensed[1].solve_kept(values, right)
        except pardiso.NotDefinite as error:
            raise NotPositiveDefinite("the matrix is not positive definite") from error

    @counts_as(Work.FACTORISATIONS)
    def factor_thin(self, values: Reals) -> Factor:
        """L D L' of a matrix whose factor has a few entries a column, as the graph of a gridshell's beams:
        the compiled solve takes a sixth of the time that CHOLMOD's blocks do. It serves for good. Raises
        NotPositiveDefinite."""
        if cholmod is None:
            return _SuperLU(self.full(values))
        symbolic, pivots = self._indefinite(values)
        if not (pivots > 0.0).all():
            raise NotPositiveDefinite("the matrix is not positive definite")
        order = matrix(np.arange(float(self.size)))
        cholmod.solve(symbolic, order, sys=7)
        starts, rows, entries = (np.array(each)[:, 0] for each in cholmod.getfactor(symbolic).CCS)
        return Thin(np.array(order)[:, 0].astype(np.int64), starts, rows, entries)

    @counts_as(Work.FACTORISATIONS)
    def factor_indefinite(self, values: Reals) -> Indefinite:
        """L D L' of a matrix that needn't be positive definite, with its number of negative eigenvalues
        (Sylvester's law).

        It serves until the next factorisation of either kind.
        """
        if self._backend == "mkl":
            if self._bunch_kaufman is None:
                self._bunch_kaufman = pardiso.Factoriser(self.indptr, self.indices, definite=False)
            self._latest.number += 1
            self._last = None
            self._bunch_kaufman.factor(values)
            return _Pardiso(self._latest, self._bunch_kaufman)
        if self._backend == "superlu":
            return _SuperLU(self.full(values), definite=False)
        try:
            symbolic, pivots = self._indefinite(values)
        except ArithmeticError:  # a pivot is exactly zero; SuperLU exchanges rows
            return _SuperLU(self.full(values), definite=False)
        return _Indefinite(symbolic, int((pivots < 0.0).sum()))

    def negative_eigenvalues(self, values: Reals) -> int:
        """How many eigenvalues are negative."""
        return self.factor_indefinite(values).negative

    @counts_as(Work.FACTORISATIONS)
    def newton(self, values: Reals, right: Reals) -> tuple[Reals, bool]:
        """The solution for `right` (n,) with a matrix that needn't be definite, and whether `right` leaves
        its negative part untouched: whether below 1e-9 of y'|D|y, L D L' = A and L D y = right, comes from
        negative pivots."""
        if cholmod is None:
            plain = _SuperLU(self.full(values), definite=False)
            return plain.solve(right), plain.negative == 0
        try:
            symbolic, pivots = self._indefinite(values)
        except ArithmeticError:  # a pivot is exactly zero: no Newton step is to be had
            return np.zeros_like(right), False
        lower = matrix(right)
        cholmod.solve(symbolic, lower, sys=7)
        cholmod.solve(symbolic, lower, sys=4)
        share = np.array(lower)[:, 0] ** 2 / np.abs(pivots)
        untouched = float(share[pivots < 0.0].sum()) <= 1e-9 * float(share.sum())
        solution = matrix(right)
        cholmod.solve(symbolic, solution)
        return np.array(solution)[:, 0], untouched

    def leading(self, values: Reals) -> Reals:
        """The values (nnz,) in double precision: themselves."""
        return values

    def raised(self, values: Reals, places: Indices, by: Reals) -> Reals:
        """A copy of the values with those at `places` larger by `by`."""
        result = values.copy()
        result[places] += by
        return result

    def _indefinite(self, values: Reals) -> tuple[Any, Reals]:
        """CHOLMOD's simplicial LDLᵀ and the pivots D (n,)."""
        lower = self._lower(values)
        with _CHOLMOD:
            cholmod.options["supernodal"] = _SIMPLICIAL
            try:
                symbolic = cholmod.symbolic(lower)
                cholmod.numeric(lower, symbolic)
            finally:  # the convex solvers of the same library take it as it stands
                cholmod.options["supernodal"] = _SUPERNODAL
        inverse = matrix(1.0, (self.size, 1))
        cholmod.solve(symbolic, inverse, sys=6)
        return symbolic, 1.0 / np.array(inverse)[:, 0]

    def _lower(self, values: Reals) -> Any:
        """The lower triangle as CVXOPT holds it."""
        rows, columns = matrix(self.indices.astype(np.int64)), matrix(self.columns)
        return spmatrix(matrix(values), rows, columns, (self.size, self.size))

    def full(self, values: Reals) -> sp.csc_array:
        """The whole matrix (n, n) with lower `values` (nnz,); its pattern is shared, not to be changed."""
        indptr, indices, sources = self._both_triangles
        return sp.csc_array((values[sources], indices, indptr), shape=(self.size, self.size))

    @cached_property
    def _both_triangles(self) -> tuple[Indices, Indices, Indices]:
        """The whole matrix's pattern by columns, and which lower value each of its entries is."""
        places = np.arange(1, len(self.indices) + 1)
        lower = sp.csc_array((places, self.indices, self.indptr), shape=(self.size, self.size))
        both = sp.csc_array(lower + sp.tril(lower, -1).T)
        both.sort_indices()
        return both.indptr, both.indices, both.data - 1


class _Latest:
    """The `number` of the last factor that a family has made. Factors know it and not their family: a circle
    of references would keep them, half a gigabyte each of a large shell, until garbage is searched for."""

    def __init__(self) -> None:
        self.number = 0


class _Replaced:
    """A factor that is good until its family makes another, the latest when it is made."""

    def __init__(self, latest: _Latest) -> None:
        self._latest, self._number = latest, latest.number

    def _check(self) -> None:
        if self._number != self._latest.number:
            raise RuntimeError("this factor was replaced by a later factorisation of the same family")


class _Pardiso(_Replaced):
    """A factor by PARDISO."""

    def __init__(self, latest: _Latest, factor: pardiso.Factoriser) -> None:
        super().__init__(latest)
        self._factor, self.negative = factor, factor.negative

    @counts_as(Work.SUBSTITUTIONS)
    def solve(self, right: Reals) -> Reals:
        self._check()
        return self._factor.solve(right)


class _Cholmod(_Replaced):
    """A factor by CHOLMOD."""

    def __init__(self, latest: _Latest, factor: Any) -> None:
        super().__init__(latest)
        self._factor = factor

    @counts_as(Work.SUBSTITUTIONS)
    def solve(self, right: Reals) -> Reals:
        self._check()
        return _by_cholmod(self._factor, right)


@dataclass(frozen=True)
class _Indefinite:
    """A `factor` by CHOLMOD with so many `negative` pivots, its own for good."""

    factor: Any
    negative: int

    @counts_as(Work.SUBSTITUTIONS)
    def solve(self, right: Reals) -> Reals:
        return _by_cholmod(self.factor, right)


def _by_cholmod(factor: Any, right: Reals) -> Reals:
    """The solution for the columns of `right` (n, k), or for a vector (n,)."""
    solution = matrix(np.ascontiguousarray(right[:, None] if right.ndim == 1 else right))
    cholmod.solve(factor, solution)
    result = np.array(solution)
    return result[:, 0] if right.ndim == 1 else result


class _SuperLU:
    """A factor by SciPy's SuperLU, its own for good. Raises NotPositiveDefinite where it isn't, if it is to
    be `definite`."""

    def __init__(self, full: sp.csc_array, *, definite: bool = True) -> None:
        options = {"SymmetricMode": True}
        try:
            self._lu = splu(full, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
        except RuntimeError as error:  # "Factor is exactly singular"
            raise NotPositiveDefinite(str(error)) from error
        pivots = self._lu.U.diagonal()
        self.negative = int((pivots < 0.0).sum())
        if definite and not (pivots > 0.0).all():
            raise NotPositiveDefinite("the matrix is not positive definite")

    @counts_as(Work.SUBSTITUTIONS)
    def solve(self, right: Reals) -> Reals:
        return np.asarray(self._lu.solve(right))
