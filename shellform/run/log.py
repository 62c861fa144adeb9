"""log.txt in a run folder: every line of progress, with its time."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

from shellform.run.folder import Report

FILE = "log.txt"


def logged(folder: Path, report: Report) -> Report:
    """`report` that writes each line at the end of the folder's log too."""

    def told(stage: str, text: str) -> None:
        with (folder / FILE).open("a", encoding="utf-8") as log:
            log.write(f"{datetime.now().isoformat(timespec='seconds')} {stage}: {text}\n")
        report(stage, text)

    return told
