"""The designs of a study that no other beats in all objectives at once (Pareto's front), kept up as results
come.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Front:
    """The front so far: objectives by key, all to be small; `signs` are 1 for columns to be small and -1 to
    be large.

    Designs beyond a `limit` and those without a number for each objective have no place on it. Equal designs
    share theirs.
    """

    signs: Mapping[str, float]
    limits: Mapping[str, float]
    found: dict[str, tuple[float, ...]] = field(default_factory=dict)

    def add(self, key: str, row: Mapping[str, Any]) -> list[str]:
        """Takes a design's columns into account; returns the keys that have no place on the front, perhaps
        its own.
        """
        goals = objectives(row, self.signs)
        if goals is None or not usable(row, self.limits):
            return [key]
        if any(_beats(other, goals) for other in self.found.values()):
            return [key]
        beaten = [other for other, theirs in self.found.items() if _beats(goals, theirs)]
        for other in beaten:
            del self.found[other]
        self.found[key] = goals
        return beaten


def signed(objective: Mapping[str, str]) -> dict[str, float]:
    """The signs of a study's objectives."""
    return {name: 1.0 if way == "min" else -1.0 for name, way in objective.items()}


def objectives(row: Mapping[str, Any], signs: Mapping[str, float]) -> tuple[float, ...] | None:
    """A design's objectives, all to be small; None where one of them is missing or there are none."""
    found = [row.get(name) for name in signs]
    if not found or any(
        value is None or isinstance(value, str) or not math.isfinite(value) for value in found
    ):
        return None
    return tuple(sign * float(value) for sign, value in zip(signs.values(), found, strict=True))  # type: ignore[arg-type]


def usable(row: Mapping[str, Any], limits: Mapping[str, float]) -> bool:
    """Whether a design is done and keeps the limits."""
    if row.get("status") != "done":
        return False
    values = {name: row.get(name) for name in limits}
    return all(value is not None and value <= limits[name] for name, value in values.items())


def _beats(one: tuple[float, ...], other: tuple[float, ...]) -> bool:
    return one != other and all(a <= b for a, b in zip(one, other, strict=True))
