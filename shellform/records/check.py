"""One check of a run's designs: a cell by design, each with what was found, whether it holds, and what to
do.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from shellform.records.words import number

SLACK = 1e-3  # of a limit: what the optimiser itself lets pass


@dataclass(frozen=True)
class Cell:
    """One check of one design: what it `found`, in words, whether it `holds` (None: that isn't known),
    whether it was `asked` for at all, the `remedy` where it doesn't hold, and of drawn structures the `share`
    that stands."""

    found: str
    holds: bool | None
    asked: bool = True
    remedy: str = ""
    share: float | None = None


@dataclass(frozen=True)
class Check:
    """One check of all designs: its `name`, the `limit` in words, and a cell by design."""

    name: str
    limit: str
    cells: Mapping[str, Cell]


UNASKED = Cell("–", None, False)
UNKNOWN = Cell("not known", None)


def share_of(value: float, remedy: str = "") -> Cell:
    """A value over its limit."""
    if not math.isfinite(value):
        return UNKNOWN
    return Cell(f"{100.0 * value:.0f} %", value <= 1.0 + SLACK, remedy=remedy)


def below(value: float | None, limit: float, unit: str, remedy: str = "") -> Cell:
    """A value that mustn't exceed its limit."""
    if value is None or not math.isfinite(value):
        return UNKNOWN
    return Cell(f"{number(value)} {unit}", value <= limit * (1.0 + SLACK), remedy=remedy)
