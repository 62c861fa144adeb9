"""How an entry of a study varies, and what bounds a column."""

from __future__ import annotations

import math
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from shellform.study.outcome import Single, Value

MOST = 1_000_000  # designs


class StudyEntry(BaseModel):
    """A table of a study file, in which nothing unknown may stand."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class VaryEntry(StudyEntry):
    """How one entry of the case varies: a list, a range, or files."""

    values: list[Single] | None = Field(None, min_length=1, description="the values themselves")
    low: float | None = Field(None, description="of a range")
    high: float | None = Field(None, description="of a range")
    count: int | None = Field(None, ge=1, le=MOST, description="of values that a grid takes from a range")
    scale: Literal["linear", "log"] = Field("linear", description="log: equal ratios")
    whole: bool = Field(False, description="whole numbers alone")
    files: str | None = Field(
        None, description='pattern of files beside or below the study file, like "shells/*.step"'
    )

    @model_validator(mode="after")
    def _one_way(self) -> VaryEntry:
        if (self.low is None) != (self.high is None):
            raise ValueError("a range needs both low and high; add the other")
        if [self.values, self.low, self.files].count(None) != 2:
            raise ValueError("give one of: a list of values, low and high, files")
        if self.low is not None and self.high is not None:
            if not self.low < self.high:
                raise ValueError("low must be below high; change places of the two")
            if self.scale == "log" and self.low <= 0.0:
                raise ValueError("equal ratios need a low above zero; raise it, or leave scale out")
            if self.whole and math.ceil(self.low) > math.floor(self.high):
                raise ValueError(
                    "no whole number lies between low and high; widen the range, or leave whole out"
                )
        return self

    @property
    def whole_ends(self) -> tuple[int, int]:
        """The first and the last whole number of a range."""
        return math.ceil(self.low or 0.0), math.floor(self.high or 0.0)


class LimitEntry(StudyEntry):
    """What a column is to be at least, at most, or both."""

    least: float | None = Field(None, description="smallest value")
    most: float | None = Field(None, description="largest value")

    @model_validator(mode="after")
    def _some(self) -> LimitEntry:
        if self.least is None and self.most is None:
            raise ValueError("give a number, or least = and most = of one")
        if self.least is not None and self.most is not None and self.least > self.most:
            raise ValueError("least must not be above most; change places of the two")
        return self

    def beyond(self, value: Value | None) -> float:
        """How far a value is beyond what it may be, below zero one within; what isn't known, or is a word, is
        beyond it."""
        if value is None or isinstance(value, str) or math.isnan(value):
            return 1.0
        over = -math.inf if self.most is None else float(value) - self.most
        under = -math.inf if self.least is None else self.least - float(value)
        return max(over, under)


def ranged(entry: VaryEntry, at: float) -> Value:
    """The value of a range at 0 (low) to 1 (high)."""
    if entry.whole:
        first, last = entry.whole_ends
        return round(_between(first, last, at, entry.scale))
    low, high = entry.low or 0.0, entry.high or 0.0
    return min(max(_between(low, high, at, entry.scale), low), high)


def drawn(entry: VaryEntry, at: float) -> Value:
    """The value of a range at a place in [0, 1) that was drawn: whole ones each have as much of it."""
    if not entry.whole:
        return ranged(entry, at)
    first, last = entry.whole_ends
    return min(max(round(_between(first - 0.5, last + 0.5, at, entry.scale)), first), last)


def _between(low: float, high: float, at: float, scale: str) -> float:
    return low * (high / low) ** at if scale == "log" else low + at * (high - low)
