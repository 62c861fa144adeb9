"""Door to Numba: loops in machine code, compiled by the first process that needs them and kept in a cache for
all later ones.

The first compilation takes seconds in which nothing else would be seen to happen, so it is announced, once a
process, unless the environment has SHELLFORM_QUIET, which processes hand on to those that they start.

The cache lies beside the package, or in the user's home where the package can't be written; where neither
can, in a temporary folder of this process and those that it starts. Of processes that need the same function
one compiles it, and the others wait for what it leaves. Each machine code has a file of its own name, and it
is there before the entry names it: Numba's own entry could name the code that another process, or an older
version of the function, left under the same number.
"""

from __future__ import annotations

import atexit
import contextlib
import os
import secrets
import shutil
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
from numba import prange, set_num_threads
from numba.core import event
from numba.core.caching import FunctionCache, IndexDataCacheFile

from shellform.work_clock import Work, WorkClock, listener

__all__ = ["clock_without_compiling", "is_kept", "njit", "prange", "set_num_threads"]

_WHOLE = "one to one and a half minutes of a free core in all"  # 94 s of processor time, measured once beside other work
_FIRST_TOLD = 10.0  # s of compiling
_LONGEST_TURN = 300.0  # s that are waited for another process's: one that is stopped keeps its own


class _Compilation(event.Listener):  # type: ignore[misc]
    """Adds up what compiling takes, tells it who listens (work_clock.py), and unless it is to be `quiet`
    announces the first loop and how far it has come after 10, 20, 40 … s; what comes from the cache isn't
    compiled. Numba compiles one loop at a time, with others within it.
    """

    def __init__(self, *, quiet: bool) -> None:
        self.seconds = 0.0
        self._quiet, self._loops, self._next = quiet, 0, _FIRST_TOLD
        self._open: list[tuple[WorkClock | None, float]] = []

    def on_start(self, event: Any) -> None:
        if not self._loops and not self._open:
            self._say(f"compiling its loops for this machine, once ({_WHOLE}) ...")
        clock = listener()
        self._open.append((clock, time.perf_counter()))
        if clock is not None:
            clock.begin(Work.COMPILING)

    def on_end(self, event: Any) -> None:
        clock, began = self._open.pop()
        if clock is not None:
            clock.end()
        if self._open:
            return
        self._loops += 1
        self.seconds += time.perf_counter() - began
        if self.seconds >= self._next:
            self._say(
                f"{self._loops} loop{'s' if self._loops > 1 else ''} compiled in {self.seconds:.0f} s ..."
            )
            self._next = 2.0 * self.seconds

    def _say(self, text: str) -> None:
        if not self._quiet:
            print(f"shellform: {text}", file=sys.stderr, flush=True)


_compilation = _Compilation(quiet="SHELLFORM_QUIET" in os.environ)
event.register("numba:compile", _compilation)


def clock_without_compiling() -> float:
    """s, of a clock that stands still while this process compiles loops: for estimates of what is left."""
    return time.perf_counter() - _compilation.seconds


def njit(*, cache: bool = False, **options: Any) -> Callable[[Callable[..., Any]], Any]:
    """As Numba's, for functions that are kept in a cache."""

    def compiled(function: Callable[..., Any]) -> Any:
        found = numba.njit(**options)(function)
        if cache:
            try:
                found._cache = _Cache(function)
            except RuntimeError:  # no place for it
                _cache_for_now()
                found._cache = _Cache(function)
        return found

    return compiled


def is_kept(function: Any) -> bool:
    """Whether the cache holds a compiled function as it is written now, for arguments of any kind."""
    return bool(function._cache._cache_file._load_index())


class _Cache(FunctionCache):  # type: ignore[misc]
    """What is kept of one function. Who finds no machine code there has a turn at it, until that is saved:
    another process that comes for it waits. A process that ends leaves its turn."""

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        stamp = self._impl.locator.get_source_stamp()
        self._cache_file = _Entry(self.cache_path, self._impl.filename_base, stamp)
        self._turn: int | None = None

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The machine code for a signature; None where it is to be compiled by this process."""
        found = super().load_overload(sig, target_context)
        if found is None and self._turn is None:
            self._impl.locator.ensure_cache_path()
            self._turn = _turn(f"{self._cache_file._index_path}.lock")
            found = super().load_overload(sig, target_context)
            if found is not None:
                self.leave()
        return found

    def save_overload(self, sig: Any, data: Any) -> None:
        """Takes machine code up, and ends the turn."""
        try:
            super().save_overload(sig, data)
        finally:
            self.leave()

    def leave(self) -> None:
        """Ends the turn, if there is one."""
        if self._turn is not None:
            os.close(self._turn)
            self._turn = None


class _BrokenOff(event.Listener):  # type: ignore[misc]
    """Ends the turn at a function whose compiling fails or is interrupted: this process may live on."""

    def on_start(self, event: Any) -> None:
        """Nothing."""

    def on_end(self, event: Any) -> None:
        cache = event.data["dispatcher"]._cache
        if event._exc_details is not None and isinstance(cache, _Cache):  # is_failed says the contrary
            cache.leave()


event.register("numba:compile", _BrokenOff())


class _Entry(IndexDataCacheFile):  # type: ignore[misc]
    """An index of signatures, and a file of machine code for each."""

    def save(self, key: Any, data: Any) -> None:
        """Takes machine code up; one process at a time."""
        known = self._load_index()
        if not known:  # what there is belongs to an older version of the function
            for file in Path(self._cache_path).glob(self._data_name_pattern.format(number=0)[:-5] + "*.nbc"):
                with contextlib.suppress(OSError):
                    file.unlink()
        known[key] = self._data_name(secrets.randbits(60))
        self._save_data(known[key], data)
        self._save_index(known)


def _turn(path: str) -> int:
    """The descriptor of a lock, until it is closed, or after the longest wait of none. What is waited for it
    counts as compiling."""
    held = os.open(path, os.O_CREAT | os.O_WRONLY, 0o666)
    if not _locked(held):
        _compilation.on_start(None)
        try:
            until = time.monotonic() + _LONGEST_TURN
            while not _locked(held) and time.monotonic() < until:
                time.sleep(0.05)
        finally:
            _compilation.on_end(None)
    return held


def _locked(held: int) -> bool:
    """Whether the lock is this process's now; always on Windows, which has no such ones: an entry may get
    lost there, and is compiled again."""
    try:
        import fcntl
    except ImportError:
        return True
    try:
        fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _cache_for_now() -> None:
    folder = tempfile.mkdtemp(prefix="shellform-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    os.environ["NUMBA_CACHE_DIR"] = numba.config.CACHE_DIR = folder
