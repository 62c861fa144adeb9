"""VTK files, legacy (.vtk) and XML (.vtu, .vtp, .vts); the door to VTK's readers.

VTK's readers say what they stumble over to an error channel and go on: the first sentence there becomes the
message.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from shellform.errors import InputError, not_installed
from shellform.surface.readers.draft import Choice, Draft, MeshObject, joined

_POLYGONS = (5, 7, 9)  # VTK_TRIANGLE, VTK_POLYGON, VTK_QUAD
_CURVED = {22: 3, 34: 3, 23: 4, 28: 4}  # quadratic triangles and quadrilaterals: their corners come first
_STRIP = 6  # VTK_TRIANGLE_STRIP


def read_vtk(file: Path, choice: Choice, kind: str) -> Draft:
    """The polygons of a file of `kind` "vtk", "vtu", "vtp" or "vts". Raises InputError for what can't be
    used.
    """
    reader = _reader(kind)
    said: list[str] = []
    reader.AddObserver("ErrorEvent", lambda source, event: said.append(event))
    reader.SetFileName(str(file))
    from vtkmodules.vtkCommonCore import vtkObject

    vtkObject.GlobalWarningDisplayOff()
    reader.Update()
    data = reader.GetOutput()
    if said or data is None or reader.GetErrorCode():
        raise InputError(
            f"can't be read as {kind.upper()}",
            where=str(file),
            remedy="Check that it is whole, or write it anew.",
        )
    if not hasattr(data, "GetPoints") or data.GetPoints() is None:
        raise InputError(
            "holds no points", where=str(file), remedy="Export the surface as triangles or polygons."
        )
    from vtkmodules.util.numpy_support import vtk_to_numpy

    points = np.array(vtk_to_numpy(data.GetPoints().GetData()), dtype=float)
    blocks: dict[int, list[list[int]]] = {}
    for k in range(data.GetNumberOfCells()):
        cell = data.GetCellType(k)
        if cell in _POLYGONS or cell in _CURVED or cell == _STRIP:
            ids = data.GetCell(k).GetPointIds()
            corners = [ids.GetId(i) for i in range(ids.GetNumberOfIds())]
            if cell == _STRIP:
                turned = [
                    corners[i : i + 3] if i % 2 == 0 else corners[i : i + 3][::-1]
                    for i in range(len(corners) - 2)
                ]
                blocks.setdefault(3, []).extend(turned)
            else:
                corners = corners[: _CURVED.get(cell, len(corners))]
                blocks.setdefault(len(corners), []).append(corners)
    faces = tuple(np.array(each, dtype=np.int64) for each in blocks.values())
    return joined([MeshObject("", "", points, faces)], choice, str(file))


def _reader(kind: str) -> Any:
    try:
        from vtkmodules.vtkIOLegacy import vtkGenericDataObjectReader
        from vtkmodules.vtkIOXML import (
            vtkXMLPolyDataReader,
            vtkXMLStructuredGridReader,
            vtkXMLUnstructuredGridReader,
        )
    except ImportError as error:
        raise not_installed(f"a surface as {kind.upper()}", "cad-exchange", error) from error
    readers = {
        "vtk": vtkGenericDataObjectReader,
        "vtp": vtkXMLPolyDataReader,
        "vtu": vtkXMLUnstructuredGridReader,
        "vts": vtkXMLStructuredGridReader,
    }
    return readers[kind]()
