"""Records as JSON files: written with every field, read back strictly.

Whoever reads gets a frozen dataclass or an InputError that names the file, the key and what to do. Keys that
the record doesn't have are ignored (a later version may have added them); a missing one, or a word where a
number belongs, is refused.
"""

from __future__ import annotations

import json
from collections.abc import Hashable, Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

from pydantic import TypeAdapter, ValidationError

from shellform.errors import ANEW, Damaged, InputError, unreadable

_T = TypeVar("_T")


def plain(record: Any) -> Any:
    """A record as dicts, lists, numbers and words.

    A field that is None is left out, unless its metadata name the field `beside` which it stands as null; so
    is an empty mapping whose metadata say `if_any`.
    """
    if is_dataclass(record) and not isinstance(record, type):
        found = {}
        for field in fields(record):
            value = getattr(record, field.name)
            beside = field.metadata.get("beside")
            if value is None and (beside is None or getattr(record, beside) is None):
                continue
            if field.metadata.get("if_any") and not value:
                continue
            found[field.name] = plain(value)
        return found
    if isinstance(record, Mapping):
        return {name: plain(value) for name, value in record.items()}
    if isinstance(record, list | tuple):
        return [plain(value) for value in record]
    return record


def text_of(record: Any) -> str:
    """A record as the text of its file."""
    return json.dumps(plain(record), indent=1)


def read_record(path: Path, kind: type[_T]) -> _T:
    """The record in a JSON file. Raises Damaged (an InputError) naming the key that is missing or wrong."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise Damaged(unreadable(error), where=str(path), remedy=ANEW) from error
    try:
        adapter: TypeAdapter[_T] = _adapter(cast(Hashable, kind))
        return adapter.validate_json(data, strict=True)
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False)[0]
        raise _refusal(path, first) from error


def names_format(path: Path, name: str) -> bool:
    """Whether a file seems to be of the format with that name, be it damaged: the name stands at its
    beginning. Raises InputError where nobody may look."""
    try:
        return path.is_file() and name.encode() in path.read_bytes()[:200]
    except OSError as error:
        raise InputError(
            unreadable(error),
            where=str(path),
            remedy="Give yourself the right to read it, choose another --output, or let --fresh overwrite it.",
        ) from error


@cache
def _adapter(kind: Hashable) -> TypeAdapter[Any]:
    found: TypeAdapter[Any] = TypeAdapter(cast(Any, kind))
    return found


def _refusal(path: Path, error: Mapping[str, Any]) -> Damaged:
    """What pydantic found first, in words."""
    key = ".".join(str(part) for part in error["loc"])
    if not key:
        return Damaged(f"is damaged: {error['msg']}", where=str(path), remedy=ANEW)
    if error["type"] == "missing":
        return Damaged(f"is damaged: {key} is missing", where=str(path), remedy=ANEW)
    said = str(error["msg"])
    return Damaged(
        f"is damaged: {key}: {said[:1].lower()}{said[1:]}",
        where=str(path),
        value=type(error["input"]).__name__ if isinstance(error["input"], dict | list) else error["input"],
        remedy=ANEW,
    )
