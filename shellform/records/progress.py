"""What a run tells while it works: events, each of a kind, with a line in words."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum


class Kind(Enum):
    """What an event says of its stage. A line of `PROGRESS` is overtaken by the next; the others are worth
    keeping."""

    BEGAN = "began"
    PROGRESS = "progress"
    NOTE = "note"
    KEPT = "kept"
    DONE = "done"
    FAILED = "failed"


@dataclass(frozen=True)
class Event:
    """Something that happened in a `stage`: its `kind`, a `text` without the stage's name, and where they are
    known the `fraction` of the stage that is done and the `seconds_left` at the present pace."""

    stage: str
    text: str
    kind: Kind = Kind.PROGRESS
    fraction: float | None = None
    seconds_left: float | None = None


Report = Callable[[Event], None]
"""Called with each event."""


def unheard(event: Event) -> None:
    """The report of who isn't interested."""
