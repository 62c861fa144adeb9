"""Rods that would do where a design's own do not."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ThickerRodsRecord:
    """Rods of a `radius`, m, with which so many of the `drawn` structures of the initial design are
    `standing` under every load; the name of their `section` where they are from a catalogue."""

    radius: float
    standing: int
    drawn: int
    section: str | None = None
