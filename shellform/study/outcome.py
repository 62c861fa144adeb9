"""What came of one design of a study: the record that a worker sends and that stands in results.jsonl."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Annotated, Any

from pydantic import BeforeValidator

Value = bool | int | float | str


def _single(given: object) -> object:
    """What is given for a value. Raises ValueError where it is none, or a number that isn't finite."""
    if not isinstance(given, Value):
        raise ValueError(
            f"each is one number, text, true or false, and {given} is none; list designs under [[designs]]"
        )
    if isinstance(given, float) and not math.isfinite(given):
        raise ValueError(f"a number is finite, and {given} isn't")
    return given


Single = Annotated[Value, BeforeValidator(_single)]
"""A value in a file, whose refusal says one thing and not one for each type."""


class Status(StrEnum):
    """How a design ended: `REFUSED` its input, `NO_RESULT` no equilibrium or no memory, `ERROR` a fault of
    shellform's; `CRASHED` took its worker down and `OVERTIME` more time than the study allows, and both are
    tried again by a later call; `NO_ROOM` stops the study; `MISSING` is not computed yet."""

    DONE = "done"
    REFUSED = "refused"
    NO_RESULT = "no result"
    ERROR = "error"
    CRASHED = "crashed"
    OVERTIME = "overtime"
    NO_ROOM = "no room"
    MISSING = "missing"


# of a study's tables, whatever is asked for
OWN_COLUMNS = ("number", "key", "status", "reason", "seconds", "worker")
TRIED_AGAIN = (Status.CRASHED, Status.OVERTIME)


@dataclass(frozen=True)
class Outcome:
    """Of the design with this `key`: its `status` and the `reason` for it, the `values` of its summary by
    dotted name, `seconds` by stage, and the `worker` that computed it."""

    key: str
    status: Status
    reason: str = ""
    values: Mapping[str, Value] = field(default_factory=dict)
    seconds: Mapping[str, float] = field(default_factory=dict)
    worker: str = ""


@dataclass(frozen=True)
class ListedDesign:
    """A design as designs.jsonl lists it: its `key`, and the entries that are its `own`."""

    key: str
    own: Mapping[str, Value]


@dataclass(frozen=True)
class Row:
    """A design with the `columns` that a study asked for (None: it has no such number)."""

    key: str
    status: Status
    reason: str
    columns: Mapping[str, Value | None]


def flat(tree: Any, prefix: str = "") -> dict[str, Value]:
    """The numbers, words and flags of a summary by dotted name; short lists of numbers by place, lists of
    words joined.
    """
    found: dict[str, Value] = {}
    if isinstance(tree, Mapping):
        for key, value in tree.items():
            found |= flat(value, f"{prefix}.{key}" if prefix else str(key))
    elif isinstance(tree, list):
        if all(isinstance(each, str) for each in tree):
            found[prefix] = "; ".join(tree)
        elif len(tree) <= 3 and all(isinstance(each, int | float) for each in tree):
            found |= {f"{prefix}.{k}": value for k, value in enumerate(tree)}
    elif isinstance(tree, bool | int | float | str):
        found[prefix] = tree
    return found
