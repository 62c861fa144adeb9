"""A run that is being made: its case, its folder, whom it reports to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from shellform.case.case import Case
from shellform.records.progress import Event, Kind, Report
from shellform.run.profiling import Profiler


@dataclass(frozen=True)
class Workspace:
    """The `case` of a run that is being made, its `folder`, whom to `report` events to, the `keys` of its
    stages, `until` which of them it is made, what measures them, if anything does, and whether it is a
    `sketch`."""

    case: Case
    folder: Path
    report: Report
    keys: Mapping[str, str]
    until: str
    profiler: Profiler | None
    sketch: bool

    def path(self, name: str) -> Path:
        """Of a file in the folder."""
        return self.folder / name

    def say(self, stage: str, text: str, kind: Kind = Kind.PROGRESS) -> None:
        """Reports an event of a stage."""
        self.report(Event(stage, text, kind))
