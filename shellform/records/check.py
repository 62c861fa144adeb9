"""One check of a run's designs: a cell by design, each with what was found, whether it holds, and what to
do.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum, auto

from shellform.quantities import newtons, number

ADJUSTED = "adjusted on site"  # as terminal, page and the how-to call it
SLACK = 1e-3  # of a limit: what the optimiser itself lets pass
_FINER = 4  # digits, that tell what is farther off than that from the limit


@dataclass(frozen=True)
class Cell:
    """One check of one design: what it `found`, in words, whether it `holds` (None: that isn't known),
    whether it was `asked` for at all, the `remedy` where it doesn't hold, of drawn structures the `share`
    that stands, what asks for care although it holds (`caution`), and how a structure as built has to be, or
    is, where it doesn't bear it as it is set out (`provided`)."""

    found: str
    holds: bool | None
    asked: bool = True
    remedy: str = ""
    share: float | None = None
    caution: str = ""
    provided: str = ""


class Subject(Enum):
    """What a check is of, for those who show some apart."""

    DESIGN = auto()
    DRAWN = auto()  # how many structures, drawn as they will be built, stand
    SEARCH = auto()  # a constraint of the optimiser's own


@dataclass(frozen=True)
class Check:
    """One check of all designs: its `title`, the `limit` in words, and a cell by design; its `subject`, and
    under which `load` drawn structures stand."""

    title: str
    limit: str
    cells: Mapping[str, Cell]
    subject: Subject = Subject.DESIGN
    load: str = ""

    @property
    def name(self) -> str:
        """The title among those of all checks."""
        return f"Optimiser: {self.title}" if self.subject is Subject.SEARCH else self.title


UNASKED = Cell("–", None, False)
UNKNOWN = Cell("not known", None)


def share_of(value: float, remedy: str = "") -> Cell:
    """A value over its limit."""
    if not math.isfinite(value):
        return UNKNOWN
    holds, told = value <= 1.0 + SLACK, f"{100.0 * value:.0f}"
    if not holds and told == "100":  # which is what it may be
        told = number(100.0 * value, _FINER)
    return Cell(f"{told} %", holds, remedy=remedy)


def quantity(value: float, unit: str, digits: int = 3) -> str:
    """A value with its unit, a force in the unit in which it is read."""
    return newtons(value, digits) if unit == "N" else f"{number(value, digits)} {unit}"


def below(value: float | None, limit: float, unit: str, remedy: str = "") -> Cell:
    """A value that mustn't exceed its limit."""
    if value is None or not math.isfinite(value):
        return UNKNOWN
    holds, told = value <= limit * (1.0 + SLACK), quantity(value, unit)
    if not holds and told == quantity(limit, unit):  # which is what it may be
        told = quantity(value, unit, _FINER)
    return Cell(told, holds, remedy=remedy)


def on_worse_mesh(value: float, error: float | None) -> float:
    """A `value` on the mesh on which it is larger, this one or that with rod elements halved, from the
    `error` that the two tell of it (None: not known): q8 = q4 - 3/4 of the error of q4."""
    return max(value, value - 0.75 * (error or 0.0))
