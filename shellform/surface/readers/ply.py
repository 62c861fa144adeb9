"""PLY files (Turk 1994) with any elements, scalar and list types, in text and both byte orders; the door to
plyfile.

Of all that a file holds only the places of its vertices and the corners of its faces, or its strips of
triangles (-1 begins another), are taken: colours, qualities, materials and texture coordinates are passed
over.
"""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import plyfile

from shellform.arrays import Indices, Reals
from shellform.errors import InputError
from shellform.surface.readers.draft import Choice, Draft, MeshObject, joined

_CORNERS = ("vertex_indices", "vertex_index")
_ANEW = "Check that the file is whole and that its ending fits its content."


def read_ply(file: Path, choice: Choice) -> Draft:
    """The polygons of a file. Raises InputError for what can't be used."""
    try:
        data = file.read_bytes()
        data = data[:3].lower() + data[3:]  # some programs write the first word in capitals
        elements = {each.name: each for each in plyfile.PlyData.read(BytesIO(data), mmap=False).elements}
    except MemoryError:
        raise
    except Exception as error:  # plyfile raises NumPy's errors besides its own where a file is damaged
        raise InputError(
            f"can't be read as PLY: {error or type(error).__name__}", where=str(file), remedy=_ANEW
        ) from error
    points = _places(elements, file)
    blocks = [
        *(_polygons(_corners(elements["face"], file)) if "face" in elements else ()),
        *(_strips(_corners(elements["tristrips"], file)) if "tristrips" in elements else ()),
    ]
    return joined([MeshObject("", "", points, tuple(blocks))], choice, str(file))


def _places(elements: dict[str, Any], file: Path) -> Reals:
    """The vertices' places (v, 3)."""
    names = [each.name for each in elements["vertex"].properties] if "vertex" in elements else []
    if not {"x", "y", "z"} <= set(names) or not elements["vertex"].count:
        raise InputError("holds no points", where=str(file), remedy="Export the surface as a mesh.")
    try:
        place = [np.asarray(elements["vertex"][axis], dtype=float) for axis in "xyz"]
    except (TypeError, ValueError) as error:
        raise InputError("its coordinates are lists", where=str(file), remedy=_ANEW) from error
    return np.column_stack(place)


def _corners(element: Any, file: Path) -> list[Indices]:
    """The corners of each face or strip."""
    lists = [each.name for each in element.properties if isinstance(each, plyfile.PlyListProperty)]
    named = [name for name in _CORNERS if name in lists]
    if not named:
        raise InputError(
            f"its {element.name} element has no list vertex_indices",
            where=str(file),
            remedy="Export the mesh anew.",
        )
    return [_whole(corners, file) for corners in element[named[0]]]


def _whole(corners: Any, file: Path) -> Indices:
    """One face's corners (k,): whole numbers, of whatever type the file has them."""
    numbers = np.asarray(corners)
    if numbers.dtype.kind == "f" and not (numbers == np.rint(numbers)).all():
        raise InputError(
            f"a face names vertices {numbers.tolist()}, which are no whole numbers",
            where=str(file),
            remedy="Export the mesh anew.",
        )
    return numbers.astype(np.int64)


def _polygons(faces: list[Indices]) -> list[Indices]:
    """Arrays (f, k) of faces with k corners each."""
    sizes = np.array([len(face) for face in faces], dtype=np.int64)
    return [
        np.stack([faces[k] for k in np.flatnonzero(sizes == size)])
        for size in np.unique(sizes).tolist()
        if size > 2
    ]


def _strips(strips: list[Indices]) -> list[Indices]:
    """The triangles (t, 3) of strips, every second of which runs the other way."""
    blocks = []
    for strip in strips:
        for run in np.split(strip, np.flatnonzero(strip == -1)):
            run = run[run != -1]
            if len(run) > 2:
                three = np.column_stack([run[:-2], run[1:-1], run[2:]])
                three[1::2] = three[1::2, ::-1]
                blocks.append(three)
    return blocks
