"""Many jobs on many processes: the door to Dask.

Workers are processes with one thread each; linear algebra and loops within them keep to that thread, so that
they don't fight for cores. Jobs are handed out within a window of twice the threads, and their outcomes are
passed on as they come, so that memory doesn't grow with the study. A job on which others build is one task on
which theirs depend: Dask runs it once, before them. When a worker dies, Dask starts another and gives its
jobs out again; a job that has taken three workers with it is tried once more when all others are done, then
given up. A cluster that has been without any worker for longer than the study waits ends the sweep, wherever
it waits: for the next job to end, or for an outcome that was lost with its worker.
"""

from __future__ import annotations

import asyncio
import itertools
import logging
import math
import os
import time
import uuid
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import wait
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any

from shellform.errors import InputError, NotConverged, not_installed
from shellform.structure.elements.threads import granted_cores
from shellform.study.jobs import Job
from shellform.study.outcome import Outcome, Status

Work = Callable[[Job, Outcome | None], Outcome]
_DEATHS = 2  # that a job survives
_MOST = 8  # workers for each core of this machine: they would take its memory
_AHEAD = 2  # jobs handed out for each thread
_ANSWERS = 5.0  # seconds in which a scheduler has to
_RECOUNT = 1.0  # seconds after which the cluster's threads are counted anew
_LOOKS = 0.1  # seconds between looks at what has ended, as Dask's own
_OURS, _THEIRS = 300.0, 3600.0  # seconds that a study waits for workers: of its cluster, of another's
_ONE_THREAD = {
    name: "1"
    for name in (
        "OMP_NUM_THREADS",
        "MKL_NUM_THREADS",
        "OPENBLAS_NUM_THREADS",
        "NUMBA_NUM_THREADS",
        "VECLIB_MAXIMUM_THREADS",
        "VTK_SMP_MAX_THREADS",
    )
} | {"MKL_CBWR": "AUTO"}  # MKL adds up in the same order in each process

# bytes given back that the C library keeps: with Dask's 64 kB a design takes 7 % longer, in as much memory
_HEAP = {"MALLOC_TRIM_THRESHOLD_": "67108864", "MALLOC_MMAP_THRESHOLD_": "33554432"}

# Run by each worker process as it starts: Ctrl-C reaches all processes of a terminal, and the study alone
# answers it and ends its workers.
_QUIET = """import logging, signal
signal.signal(signal.SIGINT, signal.SIG_IGN)
for name in ("distributed", "distributed.worker", "distributed.nanny"):
    logging.getLogger(name).setLevel(logging.CRITICAL)
"""


@dataclass(frozen=True)
class Engine:
    """A running cluster: Dask's client, the address of its dashboard, "" where it has none, and for how many
    seconds without any worker a study waits (`patience`).
    """

    client: Any
    dashboard: str
    patience: float


class NoWorkers(NotConverged):
    """A cluster that can't begin its workers, or has been without any for longer than its study waits."""


@contextmanager
def engine(
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    processes: bool = True,
    dashboard: bool = False,
) -> Iterator[Engine]:
    """`workers` processes on this machine (default: one a core), or the cluster at the address `scheduler`.

    Scheduler and workers of this machine listen on its loopback address alone and speak to nobody without the
    certificate that is made for each cluster. Its `dashboard` answers everybody on the machine, so that it
    has to be asked for. With `processes` False the workers are threads, to try out the engine. Raises
    InputError where a cluster doesn't answer and for more than 8 workers a core, NoWorkers where processes
    can't be begun.
    """
    if workers is not None and workers > _MOST * granted_cores():
        what = f"at most {_MOST} for each of the {granted_cores()} cores"
        raise InputError(
            what, where="--workers", value=workers, remedy="Leave it out: one a core is fastest."
        )
    try:
        import dask
        from distributed import (  # before the settings: it adds its own, which would be forgotten with them
            Client,
            LocalCluster,
        )
    except ImportError as error:
        raise not_installed("studies", "study", error) from error

    for name in ("distributed", "distributed.client", "bokeh", "tornado", "tornado.application"):
        logging.getLogger(name).setLevel(logging.CRITICAL)  # what matters of what they tell is in the rows
    with dask.config.set(_settings(processes, dashboard)):
        if scheduler is not None:
            client = _client(scheduler)
            try:
                yield Engine(client, client.dashboard_link or "", _THEIRS)
            finally:
                _close(client)
            return
        before = {name: os.environ.get(name) for name in _ONE_THREAD}
        try:
            cluster = LocalCluster(
                n_workers=workers or granted_cores(),
                threads_per_worker=1,
                memory_limit="auto"
                if processes
                else None,  # in one process each would take the whole one for its own
                processes=processes,
                host="127.0.0.1" if processes else None,
                security=processes
                or None,  # certificates of its own, in memory: nobody else on the machine can send it work
                dashboard_address="127.0.0.1:0",
                worker_dashboard_address=None,
                scheduler_kwargs={"dashboard": dashboard},
            )
        except (OSError, RuntimeError) as error:
            _restore(before)
            raise NoWorkers(
                f"The workers can't be begun: {error}",
                remedy="Look whether memory and processes are free, or ask for fewer (--workers), and run the "
                "same command again.",
            ) from error
        try:
            client = Client(cluster, set_as_default=False)
            try:
                yield Engine(client, cluster.dashboard_link if dashboard else "", _OURS)
            finally:
                _close(client)
        finally:
            _close(cluster)
            _restore(before)  # Dask leaves its processes' environment in this one


def _settings(processes: bool, dashboard: bool) -> dict[str, Any]:
    """Dask's settings of a cluster."""
    return {
        "distributed.scheduler.allowed-failures": _DEATHS,
        "distributed.scheduler.worker-saturation": 1.0,
        "distributed.worker.preload": [_QUIET] if processes else [],
        "distributed.worker.daemon": False,  # surface readers are processes of their own
        # What the processes do for themselves takes 1.8 % of a core in all with these three, 7.1 % as Dask
        # has them.
        "distributed.admin.tick.interval": "500ms",
        "distributed.admin.system-monitor.interval": "2s",
        "distributed.worker.memory.monitor-interval": "500ms",
        # it keeps some 0.6 MB for each second of work, for an hour
        "distributed.worker.profile.enabled": False,
        "distributed.worker.memory.target": False,
        "distributed.worker.memory.spill": False,
        "distributed.nanny.pre-spawn-environ": {**_ONE_THREAD, **_HEAP},
        "distributed.comm.timeouts.connect": "30s",
        # A worker that dies is begun anew by its nanny. Where that takes longer than this, the cluster ends
        # the nanny, and nothing begins a worker any more: at six times the load that its cores can bear, a
        # worker took 33 to 41 s, and Dask waits 15.
        "distributed.deploy.lost-worker-timeout": "1h",
    } | ({} if dashboard else {"distributed.scheduler.http.routes": []})


def _restore(variables: Mapping[str, str | None]) -> None:
    for name, value in variables.items():
        if value is None:
            os.environ.pop(name, None)
        else:
            os.environ[name] = value


def _client(scheduler: str) -> Any:
    """Dask's client of the scheduler at the address. Raises InputError where it doesn't answer."""
    from distributed import Client

    _reach(scheduler)
    try:
        return Client(scheduler, timeout="10s", set_as_default=False)
    except (OSError, ValueError, ImportError) as error:
        raise InputError(
            f"doesn't answer: {error}",
            where="--scheduler",
            value=scheduler,
            remedy="Start one (dask scheduler), mend the address, or leave --scheduler out.",
        ) from error


def _reach(address: str) -> None:
    """Raises InputError where no scheduler answers at an address: Dask's client would go on asking in the
    background, and say so at the end of the process.
    """
    from distributed import Security
    from distributed.comm import connect

    async def call() -> None:
        (await connect(address, timeout=_ANSWERS, **Security().get_connection_args("client"))).abort()

    try:
        asyncio.run(asyncio.wait_for(call(), _ANSWERS))
    except (OSError, ValueError, TypeError, ImportError, RuntimeError, OverflowError) as error:
        raise InputError(
            f"doesn't answer{f': {error}' if str(error) else f' within {_ANSWERS:g} s'}",
            where="--scheduler",
            value=address,
            remedy="Give the address that its scheduler tells, like tcp://10.0.0.1:8786.",
        ) from error


def _close(part: Any) -> None:
    """Ends a client or a cluster; one that takes longer than it should is left behind, and ends with this
    process.
    """
    with suppress(TimeoutError):
        part.close(timeout=10)


@dataclass(frozen=True)
class Manned:
    """How a cluster is manned: its `workers`, the `most` that it was seen to have, and for how many seconds
    it has had `fewer` than those, and been `without` any."""

    workers: int = 0
    most: int = 0
    fewer: float = 0.0
    without: float = 0.0


@dataclass
class _Threads:
    """How many threads a cluster has, `counted` anew each second, the `most` workers that it was seen to
    have, since when it has had fewer (`lost`) and none (`gone`), by the monotonic clock; whom to `tell`."""

    engine: Engine
    tell: Callable[[Manned], None]
    number: int = 1
    most: int = 0
    counted: float = -math.inf
    lost: float = math.inf
    gone: float = math.inf

    def look(self) -> None:
        """Counts them where a second is over. Raises NoWorkers where there has been none for too long."""
        now = time.monotonic()
        if now <= self.counted + _RECOUNT:
            return
        threads = self.engine.client.nthreads()
        self.number, self.counted, workers = sum(threads.values()), now, len(threads)
        self.most = max(self.most, workers)
        self.lost = min(self.lost, now) if workers < self.most else math.inf
        self.gone = math.inf if self.number else min(self.gone, now)
        without = max(0.0, now - self.gone)
        self.tell(Manned(workers, self.most, max(0.0, now - self.lost), without))
        if without > self.engine.patience:
            raise NoWorkers(
                f"The cluster has had no worker for {without:.0f} s",
                remedy="Look why its workers can't be begun (memory, processes, a cluster's queue) and run the "
                "same command again: it goes on from here.",
            )


def sweep(
    engine: Engine,
    jobs: Iterable[Job],
    work: Work,
    *,
    manned: Callable[[Manned], None] = lambda now: None,
) -> Iterator[list[Outcome]]:
    """Runs `work` on each job and gives the outcomes in the batches in which they come, in no order. `manned`
    hears each second how the cluster is. Raises NoWorkers where it is without any worker for too long.
    """
    threads = _Threads(engine, manned)
    again: list[Job] = []
    yield from _pass(threads, jobs, work, lambda job, reason: again.append(job))
    lost: list[Outcome] = []
    for job in again:  # alone, so that no other job is blamed
        yield from _pass(threads, [job], work, lambda job, reason: lost.append(_crashed(job, reason)))
    if lost:
        yield lost


def _pass(
    threads: _Threads, jobs: Iterable[Job], work: Work, died: Callable[[Job, str], None]
) -> Iterator[list[Outcome]]:
    from distributed import as_completed

    client, waiting = threads.engine.client, iter(jobs)
    running: dict[str, tuple[Job, Any]] = {}
    shared: dict[str, list[Any]] = {}  # a job before others: its future, and how many running ones need it
    finished = as_completed([], loop=client.loop)
    while True:
        threads.look()
        room = _AHEAD * max(1, threads.number) - len(running)
        fresh = list(itertools.islice(waiting, max(0, room)))
        futures = _submit(client, fresh, work, shared)
        running |= {future.key: (job, future) for job, future in zip(fresh, futures, strict=True)}
        finished.update(futures)
        if not running:
            return
        while not finished.has_ready():
            threads.look()
            with finished.thread_condition:
                finished.thread_condition.wait(_LOOKS)
        batch = finished.next_batch(block=False)
        for future in batch:
            for each in running[future.key][0].before:
                shared[each.key][1] -= 1
                if not shared[each.key][1]:
                    del shared[each.key]
        yield _gathered(threads, [(running.pop(future.key)[0], future) for future in batch], died)


def _gathered(
    threads: _Threads, ended: list[tuple[Job, Any]], died: Callable[[Job, str], None]
) -> list[Outcome]:
    """The outcomes of jobs that ended, asked for at once; one by one where a worker was lost between the end
    and the asking.
    """
    try:
        return _answers(threads, [future for _, future in ended])
    except NoWorkers:
        raise
    except Exception:  # `work` raises nothing: a worker was lost
        done = []
        for job, future in ended:
            try:
                done += _answers(threads, [future])
            except NoWorkers:
                raise
            except Exception as error:
                died(job, _reason(error))
        return done


def _answers(threads: _Threads, futures: list[Any]) -> list[Outcome]:
    """What the futures hold. One that was lost with its worker is computed anew, for which there has to be
    another."""
    client = threads.engine.client
    asked = asyncio.run_coroutine_threadsafe(
        client.gather(futures, asynchronous=True), client.loop.asyncio_loop
    )
    try:
        while not wait([asked], _RECOUNT).done:
            threads.look()
        found: list[Outcome] = asked.result()
        return found
    finally:
        asked.cancel()


def _submit(client: Any, jobs: list[Job], work: Work, shared: dict[str, list[Any]]) -> list[Any]:
    """Hands out jobs, all in one message: what a message costs the client and the scheduler is the first
    limit of a large cluster.

    Each handing out has a name of its own: Dask remembers what failed by name.
    """
    befores = [_begun(client, job, work, shared) for job in jobs]
    names = [f"design-{job.key}-{uuid.uuid4().hex}" for job in jobs]
    handed: list[Any] = client.map(work, jobs, befores, key=names, pure=False) if jobs else []
    return handed


def _begun(client: Any, job: Job, work: Work, shared: dict[str, list[Any]]) -> Any:
    """The last job that a job builds on, handed out unless it already was."""
    before = None
    for each in job.before:
        if each.key not in shared:
            shared[each.key] = [
                client.submit(work, each, before, key=f"stage-{each.key}-{uuid.uuid4().hex}"),
                0,
            ]
        shared[each.key][1] += 1
        before = shared[each.key][0]
    return before


def _crashed(job: Job, reason: str) -> Outcome:
    return Outcome(job.key, Status.CRASHED, reason)


def _reason(error: Exception) -> str:
    """Why there is no outcome."""
    from distributed.scheduler import KilledWorker

    if isinstance(error, KilledWorker):
        return f"took {_DEATHS + 1} workers with it: out of memory, or a fault in a library"
    return f"{type(error).__name__}: {error}"
