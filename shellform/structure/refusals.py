"""What msgspec finds wrong with a document, in our words."""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping
from typing import Any, NoReturn

import msgspec

from shellform.errors import InputError


def refuse(error: msgspec.ValidationError, parts: Mapping[str, Any]) -> NoReturn:
    """msgspec's finding in our words: `Expected `float`, got `str` - at `$.beams[3].EA``."""
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
        }
        for name, words in kinds.items():
            said = said.replace(name, words)
        raise InputError(
            said.replace("`", "").lower(), where=where, remedy="See the model file's description."
        ) from error
    if field[1] == "required":
        raise InputError(f"the field {field[2]!r} is missing", where=where, remedy="Add it.") from error
    part = next(key for key in ("beams", "cables", "supports", "loads", "start", "") if where.startswith(key))
    known = parts[part].__struct_fields__
    near = difflib.get_close_matches(field[2], known, n=1)
    hint = f"Did you mean {near[0]!r}?" if near else f"Known: {', '.join(known)}."
    raise InputError(f"unknown field {field[2]!r}", where=where, remedy=hint) from error


def check_node(node: int, where: str, count: int) -> None:
    """Raises InputError for a node that isn't there."""
    if not 0 <= node < count:
        raise InputError(
            "is out of range", where=where, value=node, remedy=f"Nodes run from 0 to {count - 1}."
        )
