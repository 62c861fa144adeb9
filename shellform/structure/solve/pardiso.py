"""Door to MKL PARDISO's sparse Cholesky, from the library that `pip install mkl` brings (x86 Linux and
Windows).

On one thread it is as fast as CHOLMOD from the `cvxopt` wheel for 8,000 degrees of freedom of a gridshell,
and two to three times as fast from 30,000 on. One thread is what it gets up to 200,000 degrees of freedom:
two halve the time of an idle machine, but PARDISO's threads wait for each other without sleeping, and where
another process holds one of two cores a factorisation of 2 ms was seen to take 139. Larger systems get two
threads, told to add up in the same order however many there are (conditional numerical reproducibility, iparm
34), so that the same case gives the same bytes. Minimum degree beats nested dissection up to some 300,000
degrees of freedom.

Two levels of blocks (iparm 24) are meant for many threads and serve one as well where many solutions follow
each factorisation: of gridshells with 7,488, 11,520, 31,200 and 127,296 degrees of freedom a factorisation
takes 1.07, 1.08, 1.16 and 1.08 times as long as in one level, a solve 0.58, 0.68, 0.75 and 1.1 times, the
analysis 1.8, 2.0, 1.9 and 1.5 times. The later kind of them (10) is faster than both, but told of 38 in a
hundred matrices that were not definite, and of the others nothing. Orders of elimination made outside (iparm
5) do without two levels: AMD of the graph of nodes halves the analysis of small ones, and solves take 1.6
times as long. Reference: Intel oneAPI Math Kernel Library, Developer Reference, "oneMKL PARDISO", parameters
as numbered there (from 1).
"""

from __future__ import annotations

import ctypes
import os
import weakref
from functools import cache
from importlib.metadata import PackageNotFoundError, files
from typing import Any

import numpy as np

from shellform.arrays import Indices, Reals
from shellform.structure.elements.threads import cores
from shellform.structure.solve.addresses import has_room

_POSITIVE_DEFINITE, _INDEFINITE = 2, -2  # mtype: real, symmetric
_ANALYSE, _FACTOR, _SOLVE, _RELEASE = 11, 22, 33, -1  # phase
_NOT_DEFINITE, _FULL = -4, -2  # error: a pivot that is zero or negative, no memory
_DISSECTION_FROM = 300_000  # degrees of freedom
_TWO_THREADS_FROM = 200_000  # degrees of freedom
_TWO_LEVELS_UP_TO = 20_000  # degrees of freedom
_STRICT = 0x10002  # MKL_CBWR_AUTO | MKL_CBWR_STRICT; kept as it is where the processor has no such mode
_ANALYSIS = 96  # bytes an entry: 51 to 62 were measured for cubes of rods of 50,000 to 3,300,000 entries
# bytes of addresses: 260e6 of files that it loads for the newest processors, and its buffers
_PARTS = 320_000_000
_BESIDE = 64_000_000  # bytes that a phase takes beside what it tells of; 31e6 were measured
# right-hand sides, which two threads solve side by side without waiting, on one core too: each comes out
# otherwise as one of so many on a thread than as one of half as many
_MANY = 16


_Integers = np.ndarray[Any, np.dtype[Any]]


class NotDefinite(ArithmeticError):
    """A pivot was not positive."""


@cache
def library() -> Any:
    """The loaded library, or None where it isn't installed, or where a limit on memory leaves no room for its
    parts: it would end the program, not say so.
    """
    try:
        listed = files("mkl") or []
    except PackageNotFoundError:
        return None
    for file in listed:
        if file.name.startswith(("libmkl_rt.so", "mkl_rt")) and file.name.endswith(
            (".so", ".dll", ".1", ".2", ".3")
        ):
            if not has_room(_PARTS):
                return None
            # OpenMP's threads spin for 200 ms after each call unless told otherwise, on the cores that the
            # assembly needs.
            os.environ.setdefault("KMP_BLOCKTIME", "0")
            try:
                loaded = ctypes.CDLL(os.fspath(file.locate()))
            except OSError:
                return None
            # The same bytes wherever an array happens to begin: otherwise a run that was resumed ended 4e-13
            # m beside one that wasn't.
            loaded.MKL_CBWR_Set(_STRICT)
            loaded.MKL_Set_Dynamic(0)  # as many threads as are asked for, on however few cores
            return loaded
    return None


class Factoriser:
    """Symbolic analysis, done once, and numeric factors of symmetric matrices of one pattern.

    `indptr` (n + 1,), `indices` (nnz,): the lower triangle by columns, the diagonal first in each. Cholesky
    factors, or with `definite` false Bunch and Kaufman's L D L' with pivots of one and two rows, or with
    degrees of freedom `kept` (k,), ascending, the elimination of all others.
    """

    def __init__(
        self, indptr: Indices, indices: Indices, *, definite: bool = True, kept: Indices | None = None
    ) -> None:
        self.size = len(indptr) - 1
        # The lower triangle by columns is the upper one by rows, which is what PARDISO reads.
        rows, self._columns = indptr.astype(np.int32), indices.astype(np.int32)
        self._settings = np.zeros(64, dtype=np.int32)
        put = self._settings
        put[0] = 1  # iparm(1): these settings, not the defaults
        put[1] = 2 if self.size > _DISSECTION_FROM else 0  # iparm(2): the order of elimination
        if self.size > _TWO_THREADS_FROM:
            put[33] = 2  # iparm(34): reproducible
        put[34] = 1  # iparm(35): indices from 0
        if definite and kept is None and self.size <= _TWO_LEVELS_UP_TO:
            put[23] = 1  # iparm(24): two levels of blocks
        if not definite:
            put[9] = 12  # iparm(10): pivots below 1e-12 of the largest entry are lifted to it
            put[20] = 1  # iparm(21): Bunch and Kaufman's pivots
        listed = np.zeros(1, dtype=np.int32)
        self._complement = np.zeros((0, 0))
        if kept is not None:
            put[35] = 1  # iparm(36): the Schur complement of what the list of degrees of freedom marks
            listed = np.zeros(self.size, dtype=np.int32)
            listed[kept] = 1
            self._complement = np.zeros((len(kept), len(kept)))
        self._none = np.zeros(1)
        self._values = self._none
        self._analysed = False
        kind = _POSITIVE_DEFINITE if definite else _INDEFINITE
        self._fixed = _Fixed(kind, self.size, self._settings, rows, self._columns, listed)
        self._finalizer = weakref.finalize(self, _release, self._fixed)

    def factor(self, values: Reals) -> None:
        """Factorises the matrix with lower `values` (nnz,). Raises NotDefinite, MemoryError."""
        self._values = np.ascontiguousarray(values)
        self._analyse(self._none)
        self._call(_FACTOR, 1, self._none, self._none)

    def solve_kept(self, values: Reals, right: Reals) -> Reals:
        """The solution (k, s) on the kept degrees of freedom for the matrix with lower `values` (nnz,) and
        `right` (k, s) on them, zero elsewhere: a dense Cholesky solution with the Schur complement. Raises
        NotDefinite, MemoryError."""
        self._values = np.ascontiguousarray(values)
        self._analyse(self._complement)
        self._call(_FACTOR, 1, self._none, self._complement)
        solution = np.array(right, dtype=float, order="F")
        size, sides, failed = ctypes.c_int(len(right)), ctypes.c_int(right.shape[1]), ctypes.c_int(0)
        ref, mkl = ctypes.byref, library()
        before = mkl.MKL_Set_Num_Threads_Local(1)
        mkl.dposv(
            ctypes.c_char_p(b"L"),
            ref(size),
            ref(sides),
            _at(self._complement),
            ref(size),
            _at(solution),
            ref(size),
            ref(failed),
        )
        mkl.MKL_Set_Num_Threads_Local(before)
        if failed.value:
            raise NotDefinite
        return solution

    @property
    def negative(self) -> int:
        """How many eigenvalues of the matrix last factorised as indefinite are negative (iparm(23))."""
        return int(self._settings[22])

    def solve(self, right: Reals) -> Reals:
        """The solution for right-hand sides (n,) or (n, k) with the last factor."""
        columns = np.asfortranarray(right, dtype=float)
        solution = np.empty_like(columns)
        if columns.size:
            self._call(_SOLVE, 1 if right.ndim == 1 else right.shape[1], columns, solution)
        return solution

    def _analyse(self, complement: Reals) -> None:
        """The symbolic analysis, where it isn't done yet. Raises MemoryError where there is no room for it or
        for the factor.
        """
        if self._analysed:
            return
        _ask_for(_ANALYSIS * len(self._columns))
        self._call(_ANALYSE, 1, self._none, complement)
        _ask_for(1024 * int(self._settings[16]))  # iparm(17): kB of the factor
        self._analysed = True

    def _call(self, phase: int, count: int, right: Reals, solution: Reals) -> None:
        error = _pardiso(self._fixed, phase, self._values, count, right, solution)
        if error == _NOT_DEFINITE:
            raise NotDefinite
        if error == _FULL:
            raise MemoryError("PARDISO has no memory for the factor")
        if error:
            raise ArithmeticError(f"PARDISO ended with error {error} in phase {phase}")


class _Fixed:
    """What is the same in all calls for one matrix, and where it lies: finding that out anew took as long as
    a tenth of a solve of 1,500 rows."""

    def __init__(
        self,
        kind: int,
        size: int,
        settings: _Integers,
        rows: _Integers,
        columns: _Integers,
        listed: _Integers,
    ) -> None:
        self.size = size
        self.begun: _Integers = np.zeros(64, dtype=np.int64)  # PARDISO's own places
        self._held = settings, rows, columns, listed  # as long as their places are known
        self.handle, self.settings, self.listed = _at(self.begun), _at(settings), _at(listed)
        self.rows, self.columns = _at(rows), _at(columns)
        self.kind, self.order = ctypes.byref(ctypes.c_int(kind)), ctypes.byref(ctypes.c_int(size))


_ONE, _QUIET = ctypes.byref(ctypes.c_int(1)), ctypes.byref(ctypes.c_int(0))


def _pardiso(fixed: _Fixed, phase: int, values: Reals, count: int, right: Reals, solution: Reals) -> int:
    step, sides, error = ctypes.c_int(phase), ctypes.c_int(count), ctypes.c_int(0)
    ref = ctypes.byref
    mkl = library()
    threads = min(2, cores()) if fixed.size > _TWO_THREADS_FROM else 1
    if phase == _SOLVE and count >= _MANY:
        threads = 2
    before = mkl.MKL_Set_Num_Threads_Local(threads)
    mkl.PARDISO(
        fixed.handle, _ONE, _ONE, fixed.kind, ref(step), fixed.order, _at(values),
        fixed.rows, fixed.columns, fixed.listed,
        ref(sides), fixed.settings, _QUIET, _at(right), _at(solution), ref(error),
    )  # fmt: skip
    mkl.MKL_Set_Num_Threads_Local(before)
    return error.value


def _ask_for(size: int) -> None:
    """Takes `size` bytes and gives them back. Raises MemoryError; PARDISO, refused the same, now and then
    crashes.
    """
    np.empty(size + _BESIDE, dtype=np.uint8)


def _at(array: Any) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


def _release(fixed: _Fixed) -> None:
    if fixed.begun.any():
        none = np.zeros(1)
        _pardiso(fixed, _RELEASE, none, 1, none, none)
