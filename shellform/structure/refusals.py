"""What is wrong with a document: what msgspec finds, in our words, and checks of its numbers and nodes."""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping
from typing import Any

import msgspec
import numpy as np

from shellform.arrays import Reals
from shellform.errors import InputError

_HUGE = 1e30  # squares and ratios of such numbers are still finite
_UNITS = {
    "EA": "newtons, such as 187.0",
    "rest_length": "metres, such as 0.055, or leave it out",
} | dict.fromkeys(("GJ", "EIy", "EIz"), "N·m², such as 0.03")


def refusal(error: msgspec.ValidationError, parts: Mapping[str, Any]) -> InputError:
    """msgspec's finding in our words: `Expected `float`, got `str` - at `$.beams[3].EA``. `parts` are the
    document's by where they stand, itself at ""."""
    said, _, path = str(error).partition(" - at `$")
    where = path.rstrip("`").removeprefix(".").replace("[...]", "")
    field = re.search(r"(unknown|required) field `([^`]*)`", said)
    if field is None:
        kinds = {
            "`float`": "a number",
            "`int`": "a whole number",
            "`bool`": "true or false",
            "`str`": "a word",
            "`object`": "an object",
            "`array`": "an array",
        }
        for name, words in kinds.items():
            said = said.replace(name, words)
        said = said.replace("`", "").lower()
        wanted = said.removeprefix("expected ").partition(", got")[0]
        remedy = f"Write {wanted} there." if wanted != said else "Mend that entry or take it out."
        return InputError(said, where=where, remedy=remedy)
    if field[1] == "required":
        return InputError(f"the field {field[2]!r} is missing", where=where, remedy="Add it.")
    part = max((key for key in parts if where.startswith(key)), key=len)
    known = parts[part].__struct_fields__
    near = difflib.get_close_matches(field[2], known, n=1)
    hint = f"Did you mean {near[0]!r}?" if near else f"Known: {', '.join(known)}."
    return InputError(f"unknown field {field[2]!r}", where=where, remedy=hint)


def check_node(node: int, where: str, count: int) -> None:
    """Raises InputError for a node that isn't there."""
    if not 0 <= node < count:
        raise InputError(
            "is out of range", where=where, value=node, remedy=f"Nodes run from 0 to {count - 1}."
        )


def components(rows: Any, where: str, width: int, field: str = "") -> Reals:
    """Rows (k, width) of finite numbers, each the `field` of an element where it isn't one itself. Raises
    InputError."""
    array = np.array(rows, dtype=float).reshape(-1, width)
    wrong = ~(np.abs(array) <= _HUGE).all(axis=1)
    if wrong.any():
        row = int(np.argmax(wrong))
        raise InputError(
            f"must be below {_HUGE:g}, in SI units",
            where=f"{where}[{row}]{field}",
            value=array[row].tolist(),
            remedy="Write finite numbers in metres, radians, newtons.",
        )
    return array


def node_pairs(pairs: list[tuple[int, int]], name: str, count: int) -> np.ndarray:
    """Ends (k, 2) of elements, of `count` nodes. Raises InputError."""
    try:
        ends = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    except OverflowError as error:
        raise InputError(
            "must be numbers of nodes, counted from 0", where=name, remedy=f"Nodes run from 0 to {count - 1}."
        ) from error
    outside = ((ends < 0) | (ends >= count)).any(axis=1)
    if outside.any():
        element = int(np.argmax(outside))
        raise InputError(
            "is out of range",
            where=f"{name}[{element}].nodes",
            value=ends[element].tolist(),
            remedy=f"Nodes run from 0 to {count - 1}.",
        )
    return ends


def positive(values: Reals, part: str, name: str) -> Reals:
    """The values. Raises InputError."""
    wrong = ~(values > 0.0) | np.isinf(values)
    absurd = (values > _HUGE) | (values < 1.0 / _HUGE)
    for which, what in (
        (wrong, "must be a positive number"),
        (absurd, f"is beyond what can be calculated with ({1 / _HUGE:g} to {_HUGE:g})"),
    ):
        if which.any():
            element = int(np.argmax(which))
            raise InputError(
                what,
                where=f"{part}[{element}].{name}",
                value=float(values[element]),
                remedy=f"Give {_UNITS[name]}.",
            )
    return values
