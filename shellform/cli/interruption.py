"""Ctrl-C that isn't lost: it raises KeyboardInterrupt where the program is, and once more at the next step
that is reported where that was swallowed.

Python drops an exception that is raised within a destructor, a weak reference's callback or a function that a
library in C calls back (threadpoolctl's search for libraries is one), and some libraries take every exception
for an error of their own.
"""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager

_PRESSED: list[int] = []


@contextmanager
def ctrl_c() -> Iterator[None]:
    """Within, Ctrl-C is noted; ignored where it was, as in a job of a shell that runs in the background."""
    _PRESSED.clear()
    usual = signal.getsignal(signal.SIGINT)
    if usual is not signal.default_int_handler:
        yield
        return
    signal.signal(signal.SIGINT, _note)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, usual)


def pressed() -> bool:
    """Whether Ctrl-C was pressed."""
    return bool(_PRESSED)


def heed() -> None:
    """Raises KeyboardInterrupt where Ctrl-C was pressed and the program still goes on."""
    if _PRESSED:
        raise KeyboardInterrupt


def _note(number: int, frame: object) -> None:
    _PRESSED.append(number)
    raise KeyboardInterrupt
