"""OBJ, OFF and STL, read here since other libraries' readers drop polygons, groups or broken endings without
a word.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from shellform.arrays import Indices, Reals
from shellform.errors import InputError
from shellform.surface.readers.draft import Choice, Draft, MeshObject, joined

_ANEW = "Export it anew."
_STL_HEAD, _STL_FACET = 84, np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("extra", "<u2")])
_COMMA = re.compile(r"\d,\d")  # as some programs write decimals in some countries
_TOLD = 40  # characters of a bad line that are quoted


def read_obj(file: Path, choice: Choice) -> Draft:
    """A Wavefront mesh; `o` lines give the objects' names, `g` lines their layers. Raises InputError naming
    the line that is wrong.
    """
    points: list[list[float]] = []
    groups: dict[tuple[str, str], dict[int, list[list[int]]]] = {}
    ahead: list[tuple[int, int]] = []  # indices of vertices that hadn't come yet, with their lines
    name = group = ""
    for number, line in enumerate(_lines(file), 1):
        key, *rest = line.split() or [""]
        try:
            if key == "v":
                points.append([float(rest[0]), float(rest[1]), float(rest[2])])
            elif key == "f":
                given = [int(each.partition("/")[0]) for each in rest]
                for each in given:
                    if each == 0 or each < -len(points):
                        raise _no_vertex(file, number, each, len(points))
                ahead += [(each, number) for each in given if each > len(points)]
                corners = [each - 1 if each > 0 else each + len(points) for each in given]
                groups.setdefault((group, name), {}).setdefault(len(corners), []).append(corners)
            elif key == "o":
                name = " ".join(rest)
            elif key == "g":
                group = " ".join(rest)
        except InputError:  # which is a ValueError
            raise
        except (ValueError, IndexError) as error:
            raise _bad_line(file, number, line) from error
    for each, number in ahead:
        if each > len(points):
            raise _no_vertex(file, number, each, len(points))
    place = np.array(points, dtype=float).reshape(-1, 3)
    parts = [
        MeshObject(called, layer, place, _blocks(blocks, file)) for (layer, called), blocks in groups.items()
    ]
    return joined(parts, choice, str(file))


def read_off(file: Path, choice: Choice) -> Draft:
    """A Geomview mesh, text. Raises InputError for a file that ends too early or says what it isn't."""
    lines = [(number, line.split("#")[0].split()) for number, line in enumerate(_lines(file), 1)]
    words = [(number, each) for number, each in lines if each]
    if not words or not words[0][1][0].endswith("OFF") or "BINARY" in words[0][1]:
        raise InputError("isn't a text OFF file", where=str(file), remedy=_ANEW)
    if len(words) < 2:
        raise InputError("ends after its first line", where=str(file), remedy=_ANEW)
    head = words[0][1][1:] or words[1][1]
    rows = words[1 if words[0][1][1:] else 2 :]
    last = words[0 if words[0][1][1:] else 1][0]
    try:
        points, faces = int(head[0]), int(head[1])
    except (ValueError, IndexError) as error:
        raise _bad_line(file, last, "") from error
    if len(rows) < points + faces:
        raise InputError(
            f"ends after {len(rows)} of {points + faces} vertices and faces",
            where=str(file),
            remedy=_ANEW,
        )
    try:
        place: list[list[float]] = []
        blocks: dict[int, list[list[int]]] = {}
        for at, row in rows[: points + faces]:
            last = at
            if len(place) < points:
                place.append([float(row[k]) for k in range(3)])
            else:
                size = int(row[0])
                blocks.setdefault(size, []).append([int(row[1 + k]) for k in range(size)])
    except (ValueError, IndexError) as error:
        raise _bad_line(file, last, "") from error
    part = MeshObject("", "", np.array(place, dtype=float).reshape(-1, 3), _blocks(blocks, file))
    return joined([part], choice, str(file))


def read_stl(file: Path, choice: Choice) -> Draft:
    """A stereolithography file, binary or text; a text file's `solid` lines give the objects' names."""
    data = file.read_bytes()
    count = int.from_bytes(data[80:84], "little") if len(data) >= _STL_HEAD else -1
    if count >= 0 and len(data) == _STL_HEAD + count * _STL_FACET.itemsize:
        facets = np.frombuffer(data, _STL_FACET, count, _STL_HEAD)
        return joined([_facets("", facets["corners"].astype(float))], choice, str(file))
    text = data.decode("utf-8", errors="replace")
    if text.lstrip()[:5].lower() != "solid" or "facet" not in text:
        whole = _STL_HEAD + max(count, 0) * _STL_FACET.itemsize
        said = f"ends after {len(data)} of {whole} bytes" if 0 < len(data) < whole else "isn't an STL file"
        raise InputError(said, where=str(file), remedy="Copy or export it anew.")
    parts, corners, name = [], [], ""
    for number, line in enumerate(text.splitlines(), 1):
        key, *rest = line.split() or [""]
        if key == "vertex":
            try:
                corners.append([float(rest[0]), float(rest[1]), float(rest[2])])
            except (ValueError, IndexError) as error:
                raise _bad_line(file, number, line) from error
        elif key == "solid":
            name = " ".join(rest)
        elif key == "endsolid":
            parts.append(_text_facets(name, corners, file))
            corners = []
    if corners:
        raise InputError(
            "ends in the middle, without endsolid", where=str(file), remedy="Copy or export it anew."
        )
    return joined(parts, choice, str(file))


def _text_facets(name: str, corners: list[list[float]], file: Path) -> MeshObject:
    if len(corners) % 3:
        raise InputError(
            f"its solid {name!r} has {len(corners)} vertices, not three a facet",
            where=str(file),
            remedy=_ANEW,
        )
    return _facets(name, np.array(corners, dtype=float).reshape(-1, 3, 3))


def _facets(name: str, corners: Reals) -> MeshObject:
    return MeshObject(name, "", corners.reshape(-1, 3), (np.arange(3 * len(corners)).reshape(-1, 3),))


def _blocks(blocks: dict[int, list[list[int]]], file: Path) -> tuple[Indices, ...]:
    try:
        return tuple(np.array(each, dtype=np.int64) for size, each in blocks.items() if size > 2)
    except OverflowError as error:
        raise InputError(
            "a face names a vertex with a number beyond all counts", where=str(file), remedy=_ANEW
        ) from error


def _lines(file: Path) -> list[str]:
    """The lines of a text file, those that end in a backslash joined with the next."""
    text = file.read_text(encoding="utf-8", errors="replace")
    if "\0" in text:
        raise InputError(
            "isn't a text file", where=str(file), remedy="Check that its ending fits its content."
        )
    return text.replace("\\\n", " ").splitlines()


def _no_vertex(file: Path, number: int, given: int, points: int) -> InputError:
    """For the index 0, one past the last of so many points, or one that counts backwards past the first."""
    missing = f"a face names a vertex {'before the first' if given < 0 else 'after the last'} of {points}; "
    return InputError(
        f"{'' if given == 0 else missing}indices count from 1, or backwards from -1",
        where=f"{file}, line {number}",
        value=given,
        remedy=_ANEW,
    )


def _bad_line(file: Path, number: int, line: str) -> InputError:
    remedy = "Export it anew, with decimal points." if _COMMA.search(line) else _ANEW
    return InputError(
        f"line {number} can't be read", where=str(file), value=line[:_TOLD] or None, remedy=remedy
    )
