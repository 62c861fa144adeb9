"""What pydantic finds wrong with a case file, or another of its kind, in words: the entry, what is wrong with
it, the value, and the remedy that the schema knows.
"""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import NoneType, UnionType
from typing import Annotated, Any, get_args, get_origin

from pydantic import BaseModel, Tag, ValidationError

from shellform.errors import InputError, if_per_cents

_FACTOR = 100.0  # the largest upper bound of shares and factors: from there on they can only be per cents


def refusal(
    error: ValidationError,
    root: type[BaseModel],
    where: str = "",
    *,
    follows: Mapping[str, str] | None = None,
) -> InputError:
    """What to say of wrong entries of what is of `root`'s kind, in the file that `where` names. A table that
    `follows` another, and is missing because that is wrong, isn't told."""
    wrong = {each["loc"][0] for each in error.errors() if each["loc"]}
    found = [
        _in_words(each, root)
        for each in error.errors()
        if each["type"] != "missing" or (follows or {}).get(str(each["loc"][0])) not in wrong
    ]
    remedies = dict.fromkeys(remedy for _, remedy in found if remedy)
    return InputError("; ".join(what for what, _ in found), where=where, remedy=" ".join(remedies))


def _in_words(error: Any, root: type[BaseModel]) -> tuple[str, str]:
    """One validation error in words: the entry of the file of `root`'s kind, what is wrong and the value; and
    the remedy, the nearest known name or what the entry is. What a table's own check says has its remedy in
    it.
    """
    kind = error["type"]
    place = _place(error["loc"], root)
    entry, names = place.name, place.table.model_fields
    if kind == "extra_forbidden":
        if error["loc"][-1] in place.elsewhere:
            return f"{entry} doesn't go with {place.sign}", "Leave out one or the other."
        near = difflib.get_close_matches(str(error["loc"][-1]), names, n=1, cutoff=0.5)
        nearest = ".".join([*entry.split(".")[:-1], *near])
        known = f"Leave it out, or write one of {', '.join(names)}."
        return f"{entry} is no known entry", f"Did you mean {nearest!r}?" if near else known
    if kind == "union_tag_invalid":
        return (
            f"{entry}.kind is no known kind (found {error['ctx']['tag']!r})",
            f"Write one of {error['ctx']['expected_tags']}.",
        )
    if kind == "union_tag_not_found":
        return f"{entry}.kind is missing", f"Write one of {', '.join(map(repr, place.kinds))}."
    meaning = f" ({place.meaning})" if place.meaning else ""
    if kind == "missing":
        return f"{entry} is missing", f"Add {entry}{meaning}."
    message = str(error["msg"]).removeprefix("Value error, ")
    message = message[:1].lower() + message[1:]
    if kind == "value_error":
        said = error["ctx"]["error"]
        if isinstance(said, InputError):
            return f"{said.where or entry}: {said.what} (found {said.value!r})", said.remedy
        return f"{entry}: {message}", ""
    return f"{entry}: {message} (found {error['input']!r})", f"Give {entry}{meaning}.{_if_per_cents(error)}"


def _if_per_cents(error: Any) -> str:
    """What to write of a share or factor too large that its hundredth would suit: of 97, or "97", 0.97."""
    bounds = error.get("ctx", {})
    bound = bounds.get("lt", bounds.get("le"))
    if bound is None or isinstance(bound, int) or bound > _FACTOR:  # nobody counts in per cents
        return ""
    return if_per_cents(float(error["input"]), bound)


@dataclass(frozen=True)
class _Place:
    """An entry: its `name` as the file has it, the `table` in which it stands, the schema's `meaning` of it,
    and the `kinds` of which it may be. Where the table is one of several kinds, `sign` is the entry that
    tells which, and `elsewhere` the names that the others alone have."""

    name: str
    table: Any
    meaning: str
    kinds: Sequence[str]
    sign: str
    elsewhere: frozenset[str]


def _place(parts: Sequence[int | str], root: type[BaseModel]) -> _Place:
    """Where pydantic's `parts` lead; where an entry may be of several kinds, they name the kind too."""
    names: list[str] = []
    kind: Any = root
    table: Any = root
    meaning = sign = ""
    elsewhere: frozenset[str] = frozenset()
    for part in parts:
        plain = get_args(kind)[0] if get_origin(kind) is Annotated else kind
        # A table that may be left out.
        if get_origin(plain) is UnionType and len(get_args(plain)) == 2 and NoneType in get_args(plain):
            plain = next(each for each in get_args(plain) if each is not NoneType)
        choices = {tag: each for each in get_args(plain) for tag in _tags(each)}
        if part in choices:
            kind = choices[part]
            sign, elsewhere = _told_apart(str(part), choices, ".".join(names))
            continue
        names.append(str(part))
        if get_origin(plain) in (list, dict):
            kind = get_args(plain)[-1]
        elif isinstance(plain, type) and issubclass(plain, BaseModel):
            table = plain
            field = plain.model_fields.get(str(part))
            kind = Any if field is None else field.annotation
            meaning = "" if field is None else field.description or ""
        else:
            kind = Any
    kinds = [tag for each in _choices(kind) for tag in _tags(each)]
    return _Place(".".join(names) or root.__name__.lower(), table, meaning, kinds, sign, elsewhere)


def _told_apart(tag: str, choices: dict[str, Any], name: str) -> tuple[str, frozenset[str]]:
    """The entry of the table called `name` by which its kind `tag` is told from the other choices, and the
    entries that those alone have."""
    tables = {each: _table(choice) for each, choice in choices.items()}
    own = tables[tag]
    others = {entry for each in tables.values() for entry in each} - own.keys()
    if "kind" in own:
        return f"{name}.kind = {tag!r}", frozenset(others)
    shared = {entry for each, fields in tables.items() if each != tag for entry in fields}
    needed = [entry for entry, field in own.items() if field.is_required() and entry not in shared]
    return f"{name}.{needed[0]}" if needed else "", frozenset(others if needed else ())


def _table(choice: Any) -> dict[str, Any]:
    """The fields of a union's choice by name; none where it is no table."""
    plain = get_args(choice)[0] if get_origin(choice) is Annotated else choice
    return dict(plain.model_fields) if isinstance(plain, type) and issubclass(plain, BaseModel) else {}


def _choices(kind: Any) -> tuple[Any, ...]:
    """What a union is one of, bare or annotated."""
    return get_args(get_args(kind)[0] if get_origin(kind) is Annotated else kind)


def _tags(choice: Any) -> list[str]:
    """The names by which pydantic tells a choice of a union apart."""
    own = [each.tag for each in get_args(choice)[1:] if isinstance(each, Tag)]
    if isinstance(choice, type) and issubclass(choice, BaseModel) and "kind" in choice.model_fields:
        own += get_args(choice.model_fields["kind"].annotation)
    return own
