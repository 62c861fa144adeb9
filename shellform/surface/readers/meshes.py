"""MSH files, and meshes and lines written; the door to meshio."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import meshio
import numpy as np

from shellform.arrays import Indices, Reals
from shellform.errors import InputError
from shellform.surface.readers.draft import Choice, Draft, MeshObject, joined
from shellform.written import whole

if TYPE_CHECKING:  # which loads numba, and the reader's process does without
    from shellform.surface.shape.target import Surface

_WRITTEN = {
    ".stl": "stl",
    ".obj": "obj",
    ".ply": "ply",
    ".off": "off",
    ".vtk": "vtk",
    ".vtu": "vtu",
    ".msh": "gmsh",
}
_STAMPED = ("obj", "ply")
_STAMP = re.compile(rb"(Created by meshio v[^,\n]*), [^\n]*")  # when, which no other file of a run says
_CORNERS = {"triangle": 3, "quad": 4}  # which come first of the points of curved elements, of whatever order


def read_msh(file: Path, choice: Choice) -> Draft:
    """The polygons of a MSH file. Raises InputError for what can't be used."""
    try:
        mesh = meshio.read(file, file_format="gmsh")
    except (
        Exception,
        SystemExit,
    ) as error:  # meshio raises whatever its readers stumble over, and even exits
        raise InputError(
            f"can't be read as MSH: {error or type(error).__name__}",
            where=str(file),
            remedy="Check that the file is whole and that its ending fits its content.",
        ) from error
    points = np.asarray(mesh.points, dtype=float)
    if points.ndim != 2 or points.shape[1] not in (2, 3) or not len(points):
        raise InputError("holds no points", where=str(file), remedy="Export the surface as a mesh.")
    if points.shape[1] == 2:
        points = np.column_stack([points, np.zeros(len(points))])
    faces = tuple(
        np.asarray(block.data, dtype=np.int64)[:, : _CORNERS.get(block.type.rstrip("0123456789"))]
        for block in mesh.cells
        if block.type.startswith(("triangle", "quad", "polygon"))
    )
    return joined([MeshObject("", "", points, faces)], choice, str(file))


def write_mesh(path: str | Path, surface: Surface) -> None:
    """Writes the triangles in metres, in the format of the path's ending, whole or not at all: the same bytes
    each time. Raises InputError for an ending that isn't known and where it can't be written.
    """
    kind = _WRITTEN.get(Path(path).suffix.lower())
    if kind is None:
        raise InputError(
            "isn't a mesh format that is written", where=str(path), remedy=f"Known: {', '.join(_WRITTEN)}."
        )
    with whole(path) as partial:
        meshio.Mesh(surface.vertices, [("triangle", surface.triangles)]).write(partial, file_format=kind)
        if kind in _STAMPED:
            partial.write_bytes(_STAMP.sub(rb"\1", partial.read_bytes(), count=1))


def write_values(path: Path, surface: Surface, values: Mapping[str, Reals]) -> None:
    """Writes the triangles, in metres, as an unstructured grid (.vtu) with `values` (v,) at the vertices,
    whole or not at all. Raises InputError where it can't be written."""
    with whole(path) as partial:
        meshio.Mesh(surface.vertices, [("triangle", surface.triangles)], dict(values)).write(partial, "vtu")


def write_lines(
    path: Path,
    points: Reals,
    lines: Indices,
    point_data: Mapping[str, Reals],
    cell_data: Mapping[str, Reals | Indices],
) -> None:
    """Writes `lines` (m, 2) between `points` (n, 3), m, as an unstructured grid (.vtu) with data of n and of
    m rows.
    """
    cells = [("line", lines)]
    meshio.Mesh(
        points, cells, dict(point_data), {name: [values] for name, values in cell_data.items()}
    ).write(path, "vtu")
