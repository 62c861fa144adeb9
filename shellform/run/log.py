"""log.txt in a run folder: every event, with its time."""

from __future__ import annotations

import os
from datetime import datetime
from pathlib import Path

from shellform.records.progress import Event, Report
from shellform.written import refusal

FILE = "log.txt"


def logged(folder: Path, report: Report) -> Report:
    """`report` that writes each event at the end of the folder's log too.

    It raises InputError where that can't be done: the folder was deleted, the disc is full, the log a link.
    """
    file = folder / FILE

    def heard(event: Event) -> None:
        try:
            with open(file, "a", encoding="utf-8", opener=_unlinked) as log:
                log.write(f"{datetime.now().isoformat(timespec='seconds')} {event.stage}: {event.text}\n")
        except OSError as error:
            raise refusal(file, error) from error
        report(event)

    return heard


def _unlinked(path: str, how: int) -> int:
    """Opens a file, and no other through a symbolic link."""
    return os.open(path, how | getattr(os, "O_NOFOLLOW", 0), 0o666)
