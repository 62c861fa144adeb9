"""A whole study: its designs on an engine, its results in a store, and going on where it stopped.

    DIR/study.toml       a copy of the study file
    DIR/designs.jsonl    a line a design: key and own entries
    DIR/results.jsonl    a line a result, table.parquet, table.csv, seconds.csv (see `store`)
    DIR/runs/KEY         run folders, of those that are kept and those at work
    DIR/stages/KEY       what several designs share: the surface, the net, the first equilibria
    DIR/study.html       the page

A design's key is a hash of its resolved settings, the bytes of its files and the version of the package: the
same design is computed once, whatever it is called, and a second call on a folder finds what is there. Killed
in the middle, each worker repeats at most the stage that it was at.
"""

from __future__ import annotations

import hashlib
import json
import shutil
import time
from collections import Counter
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import shellform
from shellform.case.case import Case, check_script
from shellform.errors import InputError, NotConverged, require_file
from shellform.records.stages import STAGES
from shellform.run.folder import alone, refuse_links
from shellform.run.keys import stage_keys
from shellform.study.engine import Engine, Manned, NoWorkers, Work, engine, sweep
from shellform.study.front import Front, signed
from shellform.study.jobs import Job, disk_is_full, work
from shellform.study.outcome import ListedDesign, Outcome, Row, Status, Value
from shellform.study.page_of_study import write_study_page
from shellform.study.plan import Plan, changes, length, read_study, resolved
from shellform.study.store import Log, arrow, cell_of, designs_of, line_of, picked, write_table
from shellform.study.study_copy import COPY, keep_copy, refuse_not_copied
from shellform.written import make_folder

WRITTEN = (
    COPY, "designs.jsonl", "results.jsonl", "table.parquet", "table.csv", "seconds.csv", "runs", "stages", "study.html",
)  # fmt: skip
_FIRST = ("results.jsonl", "designs.jsonl")  # which a study writes before all others
_SHARE_OF_TIME = 0.02  # that is spent on bringing the table up to date while the study runs
_LATEST = 12  # rows shown
_SHORT = 32  # hexadecimal digits of a key: 128 bits


@dataclass
class StudyProgress:
    """How far a study is, as it goes on; `rows` are the latest with the columns asked for, `manned` tells of
    the workers."""

    total: int
    done: int = 0
    failed: int = 0
    found: int = 0
    dashboard: str = ""
    manned: Manned = field(default_factory=Manned)
    began: float = field(default_factory=time.perf_counter)
    rows: list[Row] = field(default_factory=list)


Batch = Callable[[], Iterable[Mapping[str, Value]]]
"""Gives the entries of a batch of designs, the same each time."""
Show = Callable[[StudyProgress], None]


@dataclass(frozen=True)
class Finding:
    """What a study ended with: counts of designs, those `found` in the folder from before, the columns that
    are `empty` in all designs with a result (a path that no summary has, perhaps misspelt), the table and the
    page."""

    designs: int
    failed: int
    found: int
    empty: tuple[str, ...]
    table: Path
    page: Path


@dataclass(frozen=True)
class _Studying:
    """A study at work in its `folder`: its `plan`, its `log` of outcomes, the `front` so far, and its
    `progress`, which is told by `show`."""

    plan: Plan
    folder: Path
    log: Log
    front: Front
    progress: StudyProgress
    show: Show
    allow_scripts: bool


@dataclass(frozen=True)
class _Design:
    """A design of a study: its `key`, its `own` entries, its `case` with the `keys` of its stages; no case
    where it is refused, for the `reason`."""

    key: str
    own: Mapping[str, Value]
    case: Case | None
    keys: Mapping[str, str]
    reason: str = ""


def run_study(
    file: str | Path,
    folder: str | Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    dashboard: bool = False,
    allow_scripts: bool = False,
    show: Show = lambda progress: None,
    work: Work = work,
) -> Finding:
    """Runs the designs of a study file in `folder` that aren't there yet, and writes its table and page.

    `workers` processes on this machine, or those of a Dask `scheduler`, which have to see the folder by the
    same name. Dask's `dashboard` is open to everybody on this machine. `show` is called with the progress.
    Raises InputError for a bad study and a folder with others' files, NotConverged where the disk is full, no
    worker is there for 5 minutes (of a `scheduler`: an hour), or no design has a result.
    """
    plan = read_study(file)
    arrow()  # before hours are spent on designs
    place = Path(folder).resolve()
    refuse_links(place, WRITTEN)
    _refuse_overwriting(place, Path(file))
    try:
        with alone(place), Log(place / "results.jsonl") as log:
            for part in ("runs", "stages"):
                make_folder(place / part)
            keep_copy(place, Path(file))
            front = Front(signed(plan.study.objective), plan.study.limit)
            study = _Studying(plan, place, log, front, StudyProgress(total=length(plan)), show, allow_scripts)
            _go(study, work, partial(engine, workers=workers, scheduler=scheduler, dashboard=dashboard))
            return _finish(study)
    except OSError as error:
        what = "There is no room on the disk" if disk_is_full(error) else "The study was broken off"
        raise NotConverged(
            f"{what}: {error}", remedy="Run the same command again: it goes on from here."
        ) from error


def _refuse_overwriting(place: Path, file: Path) -> None:
    """Raises InputError for a folder in which files that no study wrote would be overwritten or dropped; the
    study's own `file` may stand in it.
    """
    if any((place / name).is_file() for name in _FIRST):
        refuse_not_copied(place, file)
        return
    there = [name for name in WRITTEN if (place / name).exists() and not (place / name).samefile(file)]
    if there:
        raise InputError(
            f"is no study's folder, and {', '.join(there)} in it would be overwritten",
            where=str(place),
            remedy="Choose another --output.",
        )


def _go(study: _Studying, work: Work, begin: Callable[[], AbstractContextManager[Engine]]) -> None:
    """Batch after batch: one, or a search's generations; the engine begins with the first that needs it."""
    searching = study.plan.study.method == "search"
    if searching:
        from shellform.study.search import generations

        batches = generations(study.plan)
    else:
        batches = _at_once(study.plan)
    with ExitStack() as stack, open(study.folder / "designs.jsonl", "w", encoding="utf-8") as listed:
        opened: Engine | None = None
        batch = next(batches, None)
        while batch is not None:
            keys, shared, fresh = _list(study, batch, listed)
            _tidy(study, keys)
            if fresh and opened is None:
                opened = stack.enter_context(begin())
                study.progress.dashboard = opened.dashboard
            if fresh and opened is not None:
                _compute(study, opened, _jobs(study, batch, shared), work)
            known = keys if searching else []
            outcomes = study.log.outcomes(known)
            try:
                batch = batches.send(
                    [_row(study, key, outcome) for key, outcome in zip(known, outcomes, strict=True)]
                )
            except StopIteration:
                batch = None


def _at_once(plan: Plan) -> Generator[Batch, list[Row], None]:
    yield lambda: changes(plan)


def _list(study: _Studying, batch: Batch, listed: Any) -> tuple[list[str], Counter[str], int]:
    """Lists a batch's designs; returns their keys, how often each stage is needed by those to be computed,
    and how many these are.
    """
    stages = STAGES[: STAGES.index(study.plan.study.until)]
    shared: Counter[str] = Counter()
    keys, fresh, refused = [], set(), []
    old = set()
    for own in batch():
        design = _identify(study, own)
        listed.write(line_of(ListedDesign(design.key, design.own)))
        keys.append(design.key)
        if design.key in study.log:
            if study.log.old(design.key):
                old.add(design.key)
        elif design.case is None:
            refused.append(Outcome(design.key, Status.REFUSED, design.reason))
        elif design.key not in fresh:
            fresh.add(design.key)
            shared.update(design.keys[stage] for stage in stages)
    listed.flush()
    study.progress.found += len(old)
    if refused:
        _enter(study, list({each.key: each for each in refused}.values()))
    study.show(study.progress)
    return keys, shared, len(fresh)


def _identify(study: _Studying, own: Mapping[str, Value]) -> _Design:
    """A design's case and key."""
    values: Mapping[str, Value] = own
    try:
        case, values = resolved(study.plan, own)
        file = Path(case.surface.file)
        require_file(file, where=f"surface.file: {file}")
        check_script(file, allow_scripts=study.allow_scripts)
        keys = stage_keys(case)
    except InputError as error:
        digest = hashlib.sha256(
            f"{shellform.__version__} refused {json.dumps(dict(values), default=cell_of)} {error}".encode()
        )
        return _Design(digest.hexdigest()[:_SHORT], values, None, {}, str(error))
    until = study.plan.study.until
    # What a summary tells of a net depends on the rods as well.
    digest = hashlib.sha256(f"{until} {keys['initial' if until == 'net' else until]}".encode())
    return _Design(digest.hexdigest()[:_SHORT], values, case, keys)


def _jobs(study: _Studying, batch: Batch, shared: Counter[str]) -> Iterator[Job]:
    """The designs of a batch that have no result yet, with the stages that they share with others: as the
    first of the batch has them, with a result or without, so that their folders are the same however often a
    study was begun.
    """
    until, seen = study.plan.study.until, set()
    first: dict[str, Case] = {}
    shared_by_all = study.allow_scripts, study.plan.study.longest
    stages = STAGES[: STAGES.index(until)]
    for own in batch():
        design = _identify(study, own)
        if design.case is None:
            continue
        for key in (design.keys[stage] for stage in stages):
            if shared[key] > 1:
                first.setdefault(key, design.case)
        if design.key in study.log or design.key in seen:
            continue
        seen.add(design.key)
        before: tuple[Job, ...] = ()
        counts = [shared[design.keys[stage]] for stage in stages]
        for k, stage in enumerate(stages):
            # A stage that all who share it share the next of, too, needs no folder of its own.
            if counts[k] > 1 and counts[k] > (counts[k + 1] if k + 1 < len(counts) else 1):
                key = design.keys[stage][:_SHORT]
                folder = str(study.folder / "stages" / key)
                case = first[design.keys[stage]]
                before = (*before, Job(key, case, stage, folder, before, *shared_by_all))
        folder = str(study.folder / "runs" / design.key)
        yield Job(design.key, design.case, until, folder, before, *shared_by_all)


def _compute(study: _Studying, opened: Engine, jobs: Iterator[Job], work: Work) -> None:
    written, cost = time.perf_counter(), 0.0

    def manned(now: Manned) -> None:
        short = now.fewer or study.progress.manned.fewer
        study.progress.manned = now
        if short:
            study.show(study.progress)

    try:
        for outcomes in sweep(opened, jobs, work, manned=manned):
            _enter(study, outcomes)
            study.progress.manned = replace(study.progress.manned, without=0.0)  # somebody answered
            study.show(study.progress)
            now = time.perf_counter()
            if now - written > max(2.0, cost / _SHARE_OF_TIME):
                write_table(study.folder, study.log, study.plan.study.column)
                written = time.perf_counter()
                cost = written - now
    except (KeyboardInterrupt, NoWorkers):
        with Log(study.log.file) as log:  # read anew: the last lines may be written and not yet entered
            write_table(study.folder, log, study.plan.study.column)
        raise


def _enter(study: _Studying, outcomes: Sequence[Outcome]) -> None:
    """Into the log first; then run folders that nobody wants may go. Raises NotConverged where a worker found
    no room on the disk."""
    for outcome in outcomes:
        if outcome.status is Status.NO_ROOM:
            raise NotConverged(
                f"A worker found no room: {outcome.reason}",
                remedy="Make room and run the same command again.",
            )
    if not outcomes:
        return
    study.log.add(outcomes)
    for outcome in outcomes:
        study.progress.done += 1
        study.progress.failed += outcome.status is not Status.DONE
        row = _row(study, outcome.key, outcome)
        study.progress.rows.append(row)
        for key in _unwanted(study, row):
            _drop(study.folder / "runs" / key)
    del study.progress.rows[:-_LATEST]


def _row(study: _Studying, key: str, outcome: Outcome | None) -> Row:
    """A design with the columns that were asked for."""
    if outcome is None:
        return Row(key, Status.MISSING, "", {})
    return Row(key, outcome.status, outcome.reason, picked(outcome.values, study.plan.study.column))


def _unwanted(study: _Studying, row: Row) -> list[str]:
    """The runs that aren't kept, now that this design is known."""
    keep = study.plan.study.keep
    off = study.front.add(row)
    return off if keep == "best" else [row.key] if keep == "none" else []


def _tidy(study: _Studying, keys: Sequence[str]) -> None:
    """Brings the front up to what the log has of these designs, and drops what an earlier call had no time to
    drop. What the log has of others, from before the study or its case was changed, is on no front of this
    one.
    """
    for found, outcome in zip(keys, study.log.outcomes(keys), strict=True):
        if outcome is not None:
            for key in _unwanted(study, _row(study, found, outcome)):
                _drop(study.folder / "runs" / key)


def _drop(folder: Path) -> None:
    if folder.is_dir():
        shutil.rmtree(folder, ignore_errors=True)  # a leftover is dropped by the next call


def _finish(study: _Studying) -> Finding:
    plan = study.plan
    write_table(study.folder, study.log, plan.study.column)
    page = write_study_page(study.folder, plan)
    if plan.study.keep == "none":
        _drop(study.folder / "stages")
    failed, reason, count = 0, "", 0
    empty = set(plan.study.column)
    keys = [design.key for design in designs_of(study.folder / "designs.jsonl")]
    for outcome in study.log.outcomes(keys):
        count += 1
        if outcome is None or outcome.status is not Status.DONE:
            failed += 1
            reason = reason or ("" if outcome is None else f"{outcome.status}: {outcome.reason}")
        elif empty:
            found = picked(outcome.values, plan.study.column)
            empty -= {name for name, value in found.items() if value is not None}
    if failed == count:
        raise NotConverged(
            f"None of {count} designs has a result. The first was {reason}",
            remedy="Run one of them alone with shellform design, and mend what it says.",
        )
    old = sum(study.log.old(key) for key in set(keys))
    return Finding(
        count,
        failed,
        old,
        tuple(name for name in plan.study.column if name in empty),
        study.folder / "table.parquet",
        page,
    )
