"""One design of a study, as a worker runs it: its stages in a folder of its own, begun with what it shares
with others.

Whatever happens ends as an outcome with a status. A full disk is no property of a design: its status stops
the study.
"""

from __future__ import annotations

import errno
import shutil
import socket
import time
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from shellform.case.case import Case
from shellform.errors import Damaged, InputError, NotConverged
from shellform.records import stages, summary
from shellform.records.summary import Summary, document, read_summary
from shellform.study.outcome import Outcome, Status, flat

_DISK = {errno.ENOSPC, errno.EDQUOT, errno.EIO, errno.EROFS}
_SHARED = (stages.FILE, summary.FILE)
_NOT_FOUND = ("format", "version", "seconds")  # by the design: the same for all, or different each time


@dataclass(frozen=True)
class Job:
    """A case to be run in `folder` until a stage, after the jobs `before`, each of which begins the next with
    its files.
    """

    key: str
    case: Case
    until: str
    folder: str
    before: tuple[Job, ...] = ()
    allow_scripts: bool = False


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
        with _alone(folder):
            if job.before:
                _begin(folder, Path(job.before[-1].folder))
            found = _run(job, folder)
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
        values=flat(tree),
        seconds={**found.seconds, "here": round(time.perf_counter() - began, 4)},
        worker=socket.gethostname(),
    )


def _run(job: Job, folder: Path) -> Summary:
    from shellform.compiled import set_num_threads
    from shellform.run import run
    from shellform.run.folder import NoRunFolder

    set_num_threads(1)
    try:
        return run.run_case(job.case, folder, until=job.until, allow_scripts=job.allow_scripts)
    except (Damaged, NoRunFolder):
        # By a machine switched off while it wrote, or killed before its first stage was done.
        return run.run_case(job.case, folder, until=job.until, allow_scripts=job.allow_scripts, fresh=True)


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
        place = folder / file.relative_to(source)
        if file.is_file() and file.name not in (*_SHARED, "lock") and ".part" not in file.name:
            place.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(file, place)
    for name in reversed(_SHARED):
        partial = folder / f"{name}.part"
        shutil.copyfile(source / name, partial)
        partial.replace(folder / name)


def disk_is_full(error: BaseException | None) -> bool:
    """Whether the disk is behind an error: it is full, read-only or broken."""
    while error is not None:
        if isinstance(error, OSError) and error.errno in _DISK:
            return True
        error = error.__cause__ or error.__context__
    return False


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Waits until no other process works in a folder: one whose study was killed may still be at its last
    step.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with locked(folder / "lock", wait=True):
        yield


@contextmanager
def locked(file: Path, *, wait: bool) -> Iterator[None]:
    """Holds a lock, which ends with the process whatever becomes of it. Raises BlockingIOError where another
    holds it.
    """
    with open(file, "wb") as opened:
        try:
            import fcntl
        except ImportError:  # no such locks on Windows
            yield
            return
        fcntl.flock(opened, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        yield
