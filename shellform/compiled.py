"""Door to Numba: loops in machine code, compiled by the first process that needs them and kept in a cache for
all later ones.

The first compilation takes seconds in which nothing else would be seen to happen, so it is announced, once a
process, unless the environment has SHELLFORM_QUIET, which processes hand on to those that they start.

The cache lies beside the package, or in the user's home where the package can't be written; where neither can,
in a temporary folder of this process and those that it starts. Processes that compile side by side take turns at a
function's entry, each machine code has a file of its own name, and it is there before the entry names it: Numba's own
entry could name the code that another process, or an older version of the function, left under the same number.
"""

from __future__ import annotations

import atexit
import contextlib
import os
import secrets
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numba
from numba import prange, set_num_threads
from numba.core import event
from numba.core.caching import IndexDataCacheFile

from shellform.work_clock import Work, WorkClock, listener

__all__ = ["njit", "prange", "set_num_threads"]


class _Told(event.Listener):  # type: ignore[misc]
    """Tells who listens (work_clock.py) what is spent on compiling."""

    def __init__(self) -> None:
        self._heard: list[WorkClock | None] = []

    def on_start(self, event: Any) -> None:
        clock = listener()
        self._heard.append(clock)
        if clock is not None:
            clock.begin(Work.COMPILING)

    def on_end(self, event: Any) -> None:
        clock = self._heard.pop()
        if clock is not None:
            clock.end()


class _Announcement(event.Listener):  # type: ignore[misc]
    """Tells of the first compilation; what comes from the cache isn't compiled."""

    def __init__(self) -> None:
        self._told = False

    def on_start(self, event: Any) -> None:
        if not self._told:
            self._told = True
            print(
                "shellform: compiling its loops for this machine, once (about 15 s) ...",
                file=sys.stderr,
                flush=True,
            )

    def on_end(self, event: Any) -> None:
        """Nothing to be told."""


def njit(**options: Any) -> Callable[[Callable[..., Any]], Any]:
    """As Numba's, for functions that are kept in a cache."""

    def compiled(function: Callable[..., Any]) -> Any:
        try:
            found = numba.njit(**options)(function)
        except RuntimeError:  # no place for the cache
            _cache_for_now()
            found = numba.njit(**options)(function)
        if options.get("cache"):
            own = found._cache
            own._cache_file = _Entry(own.cache_path, own._impl.filename_base, own._cache_file._source_stamp)
        return found

    return compiled


class _Entry(IndexDataCacheFile):  # type: ignore[misc]
    """What the cache holds of one function: an index of signatures, and a file of machine code for each."""

    def save(self, key: Any, data: Any) -> None:
        """Takes machine code up."""
        with self._alone():
            known = self._load_index()
            if not known:  # what there is belongs to an older version of the function
                for file in Path(self._cache_path).glob(
                    self._data_name_pattern.format(number=0)[:-5] + "*.nbc"
                ):
                    with contextlib.suppress(OSError):
                        file.unlink()
            known[key] = self._data_name(secrets.randbits(60))
            self._save_data(known[key], data)
            self._save_index(known)

    @contextlib.contextmanager
    def _alone(self) -> Iterator[None]:
        try:
            import fcntl
        except ImportError:  # no such locks on Windows: an entry may get lost there, and is compiled again
            yield
            return
        with open(f"{self._index_path}.lock", "wb") as held:
            fcntl.flock(held, fcntl.LOCK_EX)
            yield


def _cache_for_now() -> None:
    folder = tempfile.mkdtemp(prefix="shellform-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    os.environ["NUMBA_CACHE_DIR"] = numba.config.CACHE_DIR = folder


event.register("numba:compile", _Told())
if "SHELLFORM_QUIET" not in os.environ:
    event.register("numba:compile", _Announcement())
