"""Processes that end with the one that began them: readers of files, and those that try nets side by side.

A process that is killed can't end its own, which would go on alone, or wait for work for ever.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys

_PR_SET_PDEATHSIG = 1  # linux/prctl.h


def end_with(parent: int) -> None:
    """Has the system end this process with the `parent`, by its number, however that ends: Linux alone can,
    and other systems leave such a process until its work is done."""
    if sys.platform != "linux":
        return
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:  # it ended before that
        sys.exit("what began it has ended")
