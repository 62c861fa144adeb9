"""One design of a study, as a worker runs it: its stages in a folder of its own, begun with what it shares
with others.

Whatever happens ends as an outcome with a status. A full disk is no property of a design: its status stops
the study. A design that takes too long is stopped at its next step; one that hangs within a step is ended
with its process, and found out by the trace which that leaves in the folder when the design is handed out
again.
"""

from __future__ import annotations

import errno
import faulthandler
import shutil
import socket
import threading
import time
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from multiprocessing import parent_process
from pathlib import Path

from shellform.case.case import Case
from shellform.errors import Damaged, InputError, NotConverged
from shellform.records import stages, summary
from shellform.records.progress import Event
from shellform.records.summary import Summary, document, read_summary
from shellform.run.folder import LOCK, NoRunFolder, alone
from shellform.study.outcome import Outcome, Status, flat
from shellform.written import is_partial, make_folder, whole

_DISK = {errno.ENOSPC, errno.EDQUOT, errno.EIO, errno.EROFS}
_SHARED = (stages.FILE, summary.FILE)
_NOT_FOUND = ("format", "version", "seconds")  # by the design: the same for all, or different each time


_TRACE = "overtime.txt"
_HANGS = 2.0  # times the time that is allowed, after which a process is ended


class Overtime(Exception):
    """A design that takes longer than it may."""


@dataclass(frozen=True)
class Job:
    """A case to be run in `folder` until a stage, in at most so many seconds (`longest`), after the jobs
    `before`, each of which begins the next with its files.
    """

    key: str
    case: Case
    until: str
    folder: str
    before: tuple[Job, ...] = ()
    allow_scripts: bool = False
    longest: float = float("inf")


def work(job: Job, before: Outcome | None = None) -> Outcome:
    """Runs a job's stages that aren't in its folder yet; `before` is the outcome of the last job that it
    builds on.
    """
    if before is not None and before.status is not Status.DONE:
        return replace(before, key=job.key)
    began = time.perf_counter()
    folder = Path(job.folder)
    status, reason = Status.DONE, ""
    found = Summary()
    try:
        with ended_where_it_hangs(folder, job.longest):
            if job.before:
                with alone(folder, wait=True):
                    _begin(folder, Path(job.before[-1].folder))
            found = _run(job, folder)
    except Overtime as error:
        status, reason = Status.OVERTIME, str(error)
    except NotConverged as error:
        status, reason = Status.NO_RESULT, str(error)
    except MemoryError:
        status, reason = Status.NO_RESULT, "the memory is full"
    except InputError as error:
        status = Status.NO_ROOM if disk_is_full(error) else Status.REFUSED
        reason = str(error)
    except Exception as error:  # whatever one design raises, the others go on
        status = Status.NO_ROOM if disk_is_full(error) else Status.ERROR
        last = traceback.extract_tb(error.__traceback__)[-1]
        place = f"{Path(last.filename).name}, line {last.lineno}"
        reason = f"{type(error).__name__}: {error} ({place})"
    if status is not Status.DONE:
        found = _kept(folder)
    tree = {name: part for name, part in document(found).items() if name not in _NOT_FOUND}
    return Outcome(
        key=job.key,
        status=status,
        reason=reason.replace(str(folder), "RUN"),
        values={k: v.replace(str(folder), "RUN") if isinstance(v, str) else v for k, v in flat(tree).items()},
        seconds={**found.seconds, "here": round(time.perf_counter() - began, 4)},
        worker=socket.gethostname(),
    )


def _run(job: Job, folder: Path) -> Summary:
    """The job's stages, alone in their folder: a process whose study was killed may still be at its last
    step there.
    """
    from shellform.compiled import set_num_threads
    from shellform.run.run import run_case

    began = time.perf_counter()

    def watch(event: Event) -> None:
        if time.perf_counter() - began > job.longest:
            raise Overtime(f"took longer than {job.longest:g} s: was at {event.stage}, {event.text}")

    set_num_threads(1)
    run = partial(
        run_case, job.case, folder, until=job.until, allow_scripts=job.allow_scripts, wait=True, report=watch
    )
    try:
        return run()
    except (Damaged, NoRunFolder):
        # By a machine switched off while it wrote, or killed before its first stage was done.
        return run(fresh=True)


@contextmanager
def ended_where_it_hangs(folder: Path, longest: float) -> Iterator[None]:
    """Ends a worker's process, whatever it is at, where the block takes far longer than it may. Raises
    Overtime where that has happened.
    """
    trace = make_folder(folder) / _TRACE
    if trace.is_file() and trace.stat().st_size:
        trace.unlink()
        raise Overtime(f"took longer than {longest:g} s, and its worker had to be ended")
    if parent_process() is None or longest == float("inf"):  # nobody would begin another process
        yield
        return
    with open(trace, "w") as told:
        faulthandler.dump_traceback_later(min(_HANGS * longest, threading.TIMEOUT_MAX), exit=True, file=told)
        try:
            yield
        finally:
            faulthandler.cancel_dump_traceback_later()
    trace.unlink()


def _kept(folder: Path) -> Summary:
    """The summary of what was computed before a job failed."""
    try:
        return read_summary(folder)
    except InputError:
        return Summary()


def _begin(folder: Path, source: Path) -> None:
    """Copies another run's stages, unless this one has begun; the file that says what is done comes last."""
    if (folder / "stages.json").exists():
        return
    for file in sorted(source.rglob("*")):
        if file.is_file() and file.name not in (*_SHARED, LOCK) and not is_partial(file):
            with whole(folder / file.relative_to(source)) as copy:
                shutil.copyfile(file, copy)
    for name in reversed(_SHARED):
        with whole(folder / name) as copy:
            shutil.copyfile(source / name, copy)


def disk_is_full(error: BaseException | None) -> bool:
    """Whether the disk is behind an error: it is full, read-only or broken."""
    while error is not None:
        if isinstance(error, OSError) and error.errno in _DISK:
            return True
        error = error.__cause__ or error.__context__
    return False
