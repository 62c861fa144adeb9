"""What a process's time goes into, by kind of work: told by the doors behind which each kind stands.

Nobody listens unless `listening` is on: then each door, called, asks one question and goes on. A kind's time
is its own: what is done within it under another kind counts there alone, so that kinds add up. Times of
threads that work side by side add up too. The processor time is that of the calling thread: what a library
does on threads of its own isn't in it.
"""

from __future__ import annotations

import functools
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from enum import Enum
from typing import ParamSpec, TypeVar

_P = ParamSpec("_P")
_R = TypeVar("_R")


class Work(Enum):
    """A kind of work."""

    COMPILING = "compiling"
    LOOPS = "element loops"
    FACTORISATIONS = "factorisations"
    SUBSTITUTIONS = "back-substitutions"
    EIGENVECTORS = "eigenvectors"
    CONVEX = "convex problems"
    REST = "other"


@dataclass(frozen=True)
class Spent:
    """How often a kind of work was begun, and what it took of the `clock` and of the `processor`, s, summed
    over threads."""

    calls: int = 0
    clock: float = 0.0
    processor: float = 0.0


class WorkClock:
    """Adds up what is begun and ended, in any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._open = threading.local()  # `stack` of what its thread is in the middle of, the innermost last
        self._spent: dict[Work, Spent] = {}

    def begin(self, work: Work) -> None:
        """This thread turns to a kind of work; what it was at pauses."""
        now = (time.perf_counter(), time.thread_time())
        stack = self._stack()
        if stack:
            self._add(*stack[-1], now)
        stack.append((work, now))
        self._add(work, now, now, calls=1)

    def end(self) -> None:
        """This thread goes back to what it was at before."""
        now = (time.perf_counter(), time.thread_time())
        stack = self._stack()
        self._add(*stack.pop(), now)
        if stack:
            stack[-1] = (stack[-1][0], now)

    def taken(self) -> Mapping[Work, Spent]:
        """What was spent since the last asking."""
        with self._lock:
            found, self._spent = self._spent, {}
        return found

    def _stack(self) -> list[tuple[Work, tuple[float, float]]]:
        if not hasattr(self._open, "stack"):
            self._open.stack = []
        stack: list[tuple[Work, tuple[float, float]]] = self._open.stack
        return stack

    def _add(
        self, work: Work, since: tuple[float, float], now: tuple[float, float], *, calls: int = 0
    ) -> None:
        with self._lock:
            before = self._spent.get(work, Spent())
            self._spent[work] = Spent(
                before.calls + calls,
                before.clock + now[0] - since[0],
                before.processor + now[1] - since[1],
            )


_listener: WorkClock | None = None


@contextmanager
def listening() -> Iterator[WorkClock]:
    """A clock that hears what is done in this process within the block."""
    global _listener
    before, clock = _listener, WorkClock()
    _listener = clock
    try:
        yield clock
    finally:
        _listener = before


def listener() -> WorkClock | None:
    """The clock that listens now."""
    return _listener


def counts_as(work: Work) -> Callable[[Callable[_P, _R]], Callable[_P, _R]]:
    """Says of a function that each call of it is work of this kind."""

    def counted(function: Callable[_P, _R]) -> Callable[_P, _R]:
        @functools.wraps(function)
        def called(*values: _P.args, **named: _P.kwargs) -> _R:
            clock = _listener
            if clock is None:
                return function(*values, **named)
            clock.begin(work)
            try:
                return function(*values, **named)
            finally:
                clock.end()

        return called

    return counted


def measured(work: Work, function: Callable[_P, _R]) -> Callable[_P, _R]:
    """A function whose calls are work of this kind; itself where nobody listens."""
    return function if _listener is None else counts_as(work)(function)
