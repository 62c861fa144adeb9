"""Processes that end with the one that began them: readers of files, those that draw, and those that try nets
side by side.

A process that is killed can't end its own, which would go on alone, or wait for work for ever.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys
from pathlib import Path

_PR_SET_PDEATHSIG = 1  # linux/prctl.h


def command_of(module: str) -> list[str]:
    """What runs a `module` of this package, whose arguments follow, where `surroundings` are its
    environment."""
    return [sys.executable, "-P", "-m", module]


def surroundings() -> dict[str, str]:
    """This process's environment, in which another finds this very package."""
    package = str(Path(__file__).parents[1])
    path = os.pathsep.join([package, *filter(None, [os.environ.get("PYTHONPATH")])])
    return {**os.environ, "PYTHONPATH": path}


def answering() -> int:
    """The descriptor of standard output, for this process's answer alone: what libraries write there past
    Python goes nowhere from now on."""
    answer = os.dup(1)
    with open(os.devnull, "wb") as nowhere:
        os.dup2(nowhere.fileno(), 1)
    return answer


def end_with(parent: int) -> None:
    """Has the system end this process with the `parent`, by its number, however that ends: Linux alone can,
    and other systems leave such a process until its work is done."""
    if sys.platform != "linux":
        return
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:  # it ended before that
        sys.exit("what began it has ended")
