"""log.txt in a run folder: every event, with its time."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

from shellform.records.progress import Event, Report

FILE = "log.txt"


def logged(folder: Path, report: Report) -> Report:
    """`report` that writes each event at the end of the folder's log too."""

    def heard(event: Event) -> None:
        with (folder / FILE).open("a", encoding="utf-8") as log:
            log.write(f"{datetime.now().isoformat(timespec='seconds')} {event.stage}: {event.text}\n")
        report(event)

    return heard
