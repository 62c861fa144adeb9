"""The progress of a study on the terminal: a table that is drawn anew, or lines where nobody looks at one."""

from __future__ import annotations

import time
from typing import Any

from shellform.quantities import number
from shellform.study.engine import Manned
from shellform.study.outcome import Status, Value
from shellform.study.studies import StudyProgress

_EVERY = 10.0  # seconds between lines
_SHORT = 10.0  # seconds short of workers that are told: one that died is begun anew within a few


class Live:
    """Shows a study's progress on standard error; use it as a context manager and call it with the progress.
    Nothing if `quiet`.
    """

    def __init__(self, *, quiet: bool = False) -> None:
        from rich.console import Console
        from rich.live import Live as Drawn

        self._console = Console(stderr=True, highlight=False, markup=False, soft_wrap=True, quiet=quiet)
        self._drawn = (
            Drawn(console=self._console, refresh_per_second=4, transient=True)
            if self._console.is_terminal
            else None
        )
        self._last = 0.0
        self._dashboard = ""

    def __enter__(self) -> Live:
        if self._drawn:
            self._drawn.start()
        return self

    def __exit__(self, *error: object) -> None:
        if self._drawn:
            self._drawn.stop()

    def __call__(self, progress: StudyProgress) -> None:
        if progress.dashboard != self._dashboard:
            self._dashboard = progress.dashboard
            self._console.print(f"dashboard: {progress.dashboard}")
        if self._drawn:
            self._drawn.update(_table(progress))
        elif time.perf_counter() - self._last > _EVERY:
            self._last = time.perf_counter()
            self._console.print(_line(progress))


def _line(progress: StudyProgress) -> str:
    ready = progress.found + progress.done
    spent = time.perf_counter() - progress.began
    rest = (
        f", about {spent / progress.done * max(0, progress.total - ready):.0f} s to go"
        if progress.done
        else ""
    )
    failed = f", {progress.failed} without a result" if progress.failed else ""
    return f"study: {ready} of {progress.total} designs{failed}{_short(progress.manned)}{rest}"


def _short(now: Manned) -> str:
    """That workers are missing, where they have been for a while."""
    if now.without > _SHORT:
        return f", no worker for {now.without:.0f} s"
    if now.fewer > _SHORT:
        return f", {now.most - now.workers} of {now.most} workers gone for {now.fewer:.0f} s"
    return ""


def _table(progress: StudyProgress) -> Any:
    from rich.table import Table

    table = Table(title=_line(progress), title_justify="left", caption=progress.dashboard or None)
    names = list(progress.rows[-1].columns) if progress.rows else []
    for name in ["status", *names] if progress.rows else []:
        table.add_column(name)
    for row in progress.rows:
        status = str(row.status) if row.status is Status.DONE else f"{row.status}: {row.reason[:60]}"
        table.add_row(status, *(_cell(row.columns.get(name)) for name in names))
    return table


def _cell(value: Value | None) -> str:
    return "" if value is None else number(value, 4) if isinstance(value, float) else str(value)
