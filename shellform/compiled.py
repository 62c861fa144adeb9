"""Door to Numba: loops in machine code, compiled by the first process that needs them and kept in a cache for
all later ones.

The first compilation takes seconds in which nothing else would be seen to happen, so it is announced, once a
process, unless the environment has SHELLFORM_QUIET, which processes hand on to those that they start.
"""

from __future__ import annotations

import os
import sys
from typing import Any

from numba import njit, prange, set_num_threads
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


if "SHELLFORM_QUIET" not in os.environ:
    event.register("numba:compile", _Announcement())
