"""What the text of a CAD file states by itself: its unit (STEP's length unit, IGES' global section), and
whether it has "nan" for a number, on which OpenCASCADE doesn't come to an end (STEP, BREP) or makes another
surface (IGES)."""

from __future__ import annotations

import re
from pathlib import Path

_NAN = {
    "step": re.compile(r"(?<=[,(\s])[-+]?nan(?=[,)\s])", re.IGNORECASE),
    "iges": re.compile(r"(?<![^,\s])[-+]?nan(?=\s*[,;])", re.IGNORECASE),
    "brep": re.compile(r"(?<=\s)[-+]?nan(?=\s)", re.IGNORECASE),
}
_STEP_WORDS = re.compile(r"'[^']*'|/\*.*?\*/", re.DOTALL)  # strings and comments
_STEP_LENGTH = re.compile(r"=\s*\(([^;]*?LENGTH_UNIT[^;]*?)\)\s*;", re.DOTALL)
_STEP_UNIT = re.compile(r"SI_UNIT\s*\(\s*(\$|\.\w+\.)\s*,\s*\.METRE\.\s*\)")
_STEP_OTHER = re.compile(r"CONVERSION_BASED_UNIT\s*\(\s*'([^']*)'")
_PREFIXES = {"$": "m", ".MILLI.": "mm", ".CENTI.": "cm", ".DECI.": "dm", ".MICRO.": "µm", ".KILO.": "km"}
_NAMES = {"INCH": "in", "INCHES": "in", "FOOT": "ft", "FEET": "ft", "MM": "mm", "M": "m", "CM": "cm", "IN": "in"}  # fmt: skip
_IGES_FLAGS = {1: "in", 2: "mm", 4: "ft", 5: "mi", 6: "m", 7: "km", 8: "mil", 9: "µm", 10: "cm", 11: "µin"}
_IGES_WORDS = {str(flag) for flag in (*_IGES_FLAGS, 3)}  # as they are written
_FLAG = 13  # place of the unit's flag in IGES' global section; its name follows, for flag 3
_GLOBAL, _TEXT = 72, 72  # of an IGES line: the section's letter, and where its text ends


def stated_unit(file: Path, kind: str) -> str | None:
    """The unit that a "step" or "iges" file states, like "mm"; None where it can't be told."""
    text = file.read_text(encoding="latin-1")
    if kind == "step":
        return _of_step(text)
    return _of_iges(text) if kind == "iges" else None


def line_without_number(file: Path, kind: str) -> int | None:
    """The number of the first line of a "step", "iges" or "brep" file that has "nan" for a number; None where
    none has."""
    text = file.read_text(encoding="latin-1")
    if "nan" not in text.lower():
        return None
    if kind == "step":
        text = _STEP_WORDS.sub(lambda words: "\n" * words[0].count("\n"), text)
    for number, line in enumerate(text.split("\n"), 1):
        told = line[:_TEXT] if kind == "iges" and line[_GLOBAL : _GLOBAL + 1] == "P" else line
        if (kind != "iges" or told is not line) and _NAN[kind].search(f" {told} "):
            return number
    return None


def _of_step(text: str) -> str | None:
    found: set[str] = set()
    for entity in _STEP_LENGTH.findall(text):
        other, own = _STEP_OTHER.search(entity), _STEP_UNIT.search(entity)
        if other:
            found.add(_NAMES.get(other.group(1).upper(), other.group(1).lower()))
        elif own and own.group(1) in _PREFIXES:
            found.add(_PREFIXES[own.group(1)])
    # A conversion to inches names the millimetre that an inch has 25.4 of.
    named = found - set(_PREFIXES.values())
    chosen = named or found
    return chosen.pop() if len(chosen) == 1 else None


def _of_iges(text: str) -> str | None:
    lines = [line for line in text.splitlines() if line[_GLOBAL : _GLOBAL + 1] == "G"]
    words = _words("".join(line[:_TEXT] for line in lines))
    if len(words) <= _FLAG or words[_FLAG].strip() not in _IGES_WORDS:
        return None
    flag = int(words[_FLAG])
    if flag == 3 and len(words) > _FLAG + 1:
        return _NAMES.get(words[_FLAG + 1].strip().upper())
    return _IGES_FLAGS.get(flag)


def _words(text: str) -> list[str]:
    """The parameters of a section, of which strings say how long they are: 4Hmesh."""
    found, at = list[str](), 0
    while at < len(text):
        string = re.match(r"\s*(\d{1,9})H", text[at:])
        if string:
            begin = at + string.end()
            word, at = text[begin : begin + int(string.group(1))], begin + int(string.group(1))
        else:
            stop = re.search(r"[,;]", text[at:])
            end = len(text) if stop is None else at + stop.start()
            word, at = text[at:end], end
        found.append(word)
        if text[at : at + 1] == ";":
            break
        at += 1
    return found
