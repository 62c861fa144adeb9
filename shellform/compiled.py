"""Door to Numba: loops in machine code, compiled by the first process that needs them and kept in a cache for
all later ones.

The first compilation takes seconds in which nothing else would be seen to happen, so it is announced, once a
process, unless the environment has SHELLFORM_QUIET, which processes hand on to those that they start.

The cache lies beside the package, or in the user's home where the package can't be written; where neither can,
in a temporary folder of this process and those that it starts.
"""

from __future__ import annotations

import atexit
import os
import shutil
import sys
import tempfile
from collections.abc import Callable
from typing import Any

import numba
from numba import prange, set_num_threads
from numba.core import event

__all__ = ["njit", "prange", "set_num_threads"]


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
            return numba.njit(**options)(function)
        except RuntimeError:  # no place for the cache
            _cache_for_now()
            return numba.njit(**options)(function)

    return compiled


def _cache_for_now() -> None:
    folder = tempfile.mkdtemp(prefix="shellform-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    os.environ["NUMBA_CACHE_DIR"] = numba.config.CACHE_DIR = folder


if "SHELLFORM_QUIET" not in os.environ:
    event.register("numba:compile", _Announcement())
