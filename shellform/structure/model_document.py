"""The document of a model file: its fields by their types, which msgspec reads and checks in compiled code (a
million nodes in about two seconds).
"""

from __future__ import annotations

import json
from typing import Any

import msgspec

from shellform.errors import InputError, unreadable
from shellform.structure.refusals import refusal

_NO_JSON = (msgspec.DecodeError, UnicodeDecodeError, RecursionError)
_Three = tuple[float, float, float]
_Axes = tuple[_Three, _Three, _Three]
_Six = tuple[float, float, float, float, float, float]


class GivenBeam(msgspec.Struct, forbid_unknown_fields=True, gc=False):
    nodes: tuple[int, int]
    EA: float
    GJ: float
    EIy: float
    EIz: float
    z_axis: _Three | None = None
    rest_length: float | None = None
    kind: str = "rod"
    axes: tuple[_Axes, _Axes] | None = None


class GivenCable(msgspec.Struct, forbid_unknown_fields=True, gc=False):
    nodes: tuple[int, int]
    EA: float
    rest_length: float | None = None


class GivenSupport(msgspec.Struct, forbid_unknown_fields=True, gc=False):
    node: int
    fixed: tuple[bool, bool, bool, bool, bool, bool]
    displacement: _Six | None = None


class GivenLoad(msgspec.Struct, forbid_unknown_fields=True, gc=False):
    node: int
    force: _Three | None = None
    moment: _Three | None = None


class GivenStart(msgspec.Struct, forbid_unknown_fields=True):
    positions: list[_Three]
    rotations: list[_Three]


class ModelDocument(msgspec.Struct, forbid_unknown_fields=True):
    format: str
    version: int
    nodes: list[_Three]
    beams: list[GivenBeam] = []
    cables: list[GivenCable] = []
    supports: list[GivenSupport] = []
    loads: dict[str, list[GivenLoad]] = {}
    start: GivenStart | None = None


_PARTS = {
    "": ModelDocument,
    "beams": GivenBeam,
    "cables": GivenCable,
    "supports": GivenSupport,
    "loads": GivenLoad,
    "start": GivenStart,
}


def decoded(content: bytes) -> ModelDocument:
    """The document in the bytes of a file; nan and infinity, which JSON doesn't know and json.dump writes,
    are left to whoever checks the numbers. Raises InputError naming the field and the element."""
    try:
        return msgspec.json.decode(content, type=ModelDocument)
    except msgspec.ValidationError as error:
        raise _refused(error, _parsed(content)) from error
    except _NO_JSON as error:
        wrong = InputError(f"isn't JSON: {error}", remedy="Mend that place; json.dump writes what is valid.")
    strange: list[str] = []

    def number(name: str) -> float:
        strange.append(name)
        return float(name)

    try:
        data = json.loads(content.decode("utf-8"), parse_constant=number)
    except UnicodeDecodeError as error:
        raise InputError(unreadable(error), remedy="Save it as UTF-8.") from error
    except (ValueError, RecursionError):
        raise wrong from None
    if not strange:
        raise wrong
    return converted(data)


def _parsed(content: bytes) -> Any:
    """What JSON says; None where it is broken farther on than where its types were found wrong."""
    try:
        return msgspec.json.decode(content)
    except _NO_JSON:
        return None


def converted(data: Any) -> ModelDocument:
    """The document of parsed JSON. Raises InputError naming the field and the element."""
    try:
        return msgspec.convert(data, ModelDocument)
    except msgspec.ValidationError as error:
        raise _refused(error, data) from error


def _refused(error: msgspec.ValidationError, data: Any) -> InputError:
    """What is wrong with a document; msgspec doesn't tell in which of the loads."""
    loads = data.get("loads") if isinstance(data, dict) else None
    found = refusal(error, _PARTS)
    if found.where.startswith("loads") and isinstance(loads, dict):
        for name, entries in loads.items():
            try:
                msgspec.convert(entries, list[GivenLoad])
            except msgspec.ValidationError as own:
                load = refusal(own, {"": GivenLoad})
                return InputError(load.what, where=f"loads.{name}{load.where}", remedy=load.remedy)
    return found
