"""Compiled loops over elements, shared among the cores, and dense algebra kept on one.

Each element writes to places of its own, so that the result is the same to the last bit on any number of
cores. Sums over many terms in BLAS come out otherwise on another number of threads, which an optimisation's
decisions can magnify: 108 and 102 cables.
"""

from __future__ import annotations

import os
import threading
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from functools import cache
from typing import Any, TypeVar

from shellform.work_clock import Work, measured

Item = TypeVar("Item")
Result = TypeVar("Result")

_WORTH_SHARING = 500  # elements; below, starting the threads takes longer than the loop
_AHEAD = 2  # times the cores: items that are under way or done before their turn
_OWN = threading.local()  # `taken` in a thread whose siblings keep the other cores busy


def cores() -> int:
    """How many cores this process may use: OMP_NUM_THREADS where it is set, else those that it is granted."""
    asked = os.environ.get("OMP_NUM_THREADS", "")
    if asked.isdigit() and int(asked) > 0:
        return int(asked)
    return granted_cores()


def granted_cores() -> int:
    """How many cores the system grants to this process."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def dense_on_one() -> Iterator[None]:
    """Dense algebra on one thread within, so that its sums don't depend on their number."""
    from threadpoolctl import threadpool_limits

    with threadpool_limits(limits=1, user_api="blas"):
        yield


def share(loop: Callable[..., Any], count: int, *arguments: Any) -> None:
    """Runs `loop(start, stop, *arguments)` over 0 to `count`; the loop has to release the interpreter
    (nogil). Side by side with others it runs on its own core.
    """
    number = 1 if getattr(_OWN, "taken", False) else min(cores(), count // _WORTH_SHARING)
    loop = measured(Work.LOOPS, loop)
    if number < 2:
        loop(0, count, *arguments)
        return
    bounds = [count * k // number for k in range(number + 1)]
    pool = _pool(os.getpid(), number - 1)
    running = [pool.submit(loop, bounds[k], bounds[k + 1], *arguments) for k in range(1, number)]
    loop(0, bounds[1], *arguments)
    for each in running:
        each.result()


def side_by_side(work: Callable[[Item], Result], items: Sequence[Item]) -> list[Result]:
    """`work` on every item, on as many threads as there are cores; results in order. What is done so within
    one of the items stays on its thread. The first error that is raised ends the rest.
    """
    return list(_results(work, items, len(items)))


def in_turn(work: Callable[[Item], Result], items: Sequence[Item]) -> Generator[Result, None, None]:
    """The results of `side_by_side` one after the other, while those that come next are worked on. Who closes
    it leaves out what hasn't begun by then.
    """
    return _results(work, items, _AHEAD * cores())


def _results(
    work: Callable[[Item], Result], items: Sequence[Item], ahead: int
) -> Generator[Result, None, None]:
    """With no more than `ahead` items whose results nobody has taken."""
    number = 1 if getattr(_OWN, "taken", False) else min(cores(), len(items))
    if number < 2:
        for item in items:
            yield work(item)
        return
    with ThreadPoolExecutor(number, "shellform-case", _take) as pool:
        running: deque[Future[Result]] = deque()
        try:
            for item in items:
                running.append(pool.submit(work, item))
                if len(running) == ahead:
                    yield running.popleft().result()
            while running:
                yield running.popleft().result()
        finally:
            for each in running:
                each.cancel()


def _take() -> None:
    """Says of the thread that it has a core to itself."""
    _OWN.taken = True


@cache
def _pool(process: int, threads: int) -> ThreadPoolExecutor:
    """The threads of a process: a forked child has none of its parent's."""
    return ThreadPoolExecutor(threads, thread_name_prefix=f"shellform-{process}")
