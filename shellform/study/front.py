"""The designs of a study that no other beats in all objectives at once (Pareto's front), kept up as results
come.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from shellform.study.outcome import Row, Status, Value
from shellform.study.varied import LimitEntry


@dataclass(frozen=True)
class Front:
    """The front so far: objectives by key, all to be small; `signs` are 1 for columns to be small and -1 to
    be large.

    Designs beyond a `limit` and those without a number for each objective have no place on it. Equal designs
    share theirs.
    """

    signs: Mapping[str, float]
    limits: Mapping[str, LimitEntry]
    found: dict[str, tuple[float, ...]] = field(default_factory=dict)

    def add(self, row: Row) -> list[str]:
        """Takes a design into account; returns the keys that have no place on the front, perhaps its own."""
        goals = objectives(row.columns, self.signs)
        if goals is None or not usable(row, self.limits):
            return [row.key]
        if any(_beats(other, goals) for other in self.found.values()):
            return [row.key]
        beaten = [other for other, theirs in self.found.items() if _beats(goals, theirs)]
        for other in beaten:
            del self.found[other]
        self.found[row.key] = goals
        return beaten


def signed(objective: Mapping[str, str]) -> dict[str, float]:
    """The signs of a study's objectives."""
    return {name: 1.0 if way == "min" else -1.0 for name, way in objective.items()}


def objectives(columns: Mapping[str, Value | None], signs: Mapping[str, float]) -> tuple[float, ...] | None:
    """A design's objectives, all to be small; None where one of them is missing or there are none."""
    found: list[float] = []
    for name, sign in signs.items():
        value = columns.get(name)
        if value is None or isinstance(value, str) or not math.isfinite(value):
            return None
        found.append(sign * float(value))
    return tuple(found) or None


def usable(row: Row, limits: Mapping[str, LimitEntry]) -> bool:
    """Whether a design is done and keeps the limits."""
    if row.status is not Status.DONE:
        return False
    return all(limit.beyond(row.columns.get(name)) <= 0.0 for name, limit in limits.items())


def _beats(one: tuple[float, ...], other: tuple[float, ...]) -> bool:
    return one != other and all(a <= b for a, b in zip(one, other, strict=True))
