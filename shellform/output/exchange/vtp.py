"""Gridshells as lines for ParaView (VTP); the door to VTK's writer, which needs no OpenGL."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shellform.arrays import Reals, indices, reals
from shellform.errors import InputError
from shellform.output.pictures.panel import Panel
from shellform.written import door, write_text


def write_vtp(path: str | Path, panel: Panel, cells: Mapping[str, ArrayLike] | None = None) -> None:
    """Writes a state: its rods and cables with `deviation` [m], `cable_force` [N] and further `cells` (see
    `write_lines`).
    """
    force = np.concatenate([np.full(len(panel.beams), np.nan), panel.cable_forces])
    data = {"cable_force": force, **(cells or {})}
    write_lines(path, panel.positions, panel.beams, panel.cables, {"deviation": panel.deviation}, data)


def write_lines(
    path: str | Path,
    positions: ArrayLike,
    beams: ArrayLike,
    cables: ArrayLike,
    point_data: Mapping[str, ArrayLike],
    cell_data: Mapping[str, ArrayLike],
) -> None:
    """Writes `beams` (m, 2), then `cables` (c, 2), as lines between `positions` (n, 3), m, for ParaView
    (VTP).

    `point_data` arrays have n rows. `cell_data` arrays have m + c rows, beams first, NaN where a value has no
    meaning, or m rows, for beams only. The cell array `cable` is added: 0 for beams, 1 for cables. Raises
    InputError for wrong lengths.
    """
    target = door(path, ".vtp")
    nodes = reals("positions", positions, (None, 3))
    rods = indices("beams", beams, (None, 2), below=len(nodes))
    ties = indices("cables", cables, (None, 2), below=len(nodes))
    points = {name: _rows(f"point_data[{name!r}]", given, [len(nodes)]) for name, given in point_data.items()}
    cells: dict[str, NDArray[np.float64] | NDArray[np.uint8]] = {}
    for name, given in cell_data.items():
        values = _rows(f"cell_data[{name!r}]", given, [len(rods) + len(ties), len(rods)])
        blank = np.full((len(rods) + len(ties) - len(values), *values.shape[1:]), np.nan)
        cells[name] = np.concatenate([values, blank])
    cells["cable"] = np.repeat(np.array([0, 1], dtype=np.uint8), [len(rods), len(ties)])
    _write(target, nodes, np.vstack([rods, ties]), points, cells)


def _write(
    target: Path,
    nodes: Reals,
    pairs: NDArray[np.int64],
    points: Mapping[str, Reals],
    cells: Mapping[str, NDArray[Any]],
) -> None:
    from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray
    from vtkmodules.vtkCommonCore import vtkPoints
    from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
    from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter

    places, lines, mesh = vtkPoints(), vtkCellArray(), vtkPolyData()
    places.SetData(numpy_to_vtk(np.array(nodes), deep=True))
    starts = numpy_to_vtkIdTypeArray(np.arange(0, 2 * len(pairs) + 1, 2, dtype=np.int64), deep=True)
    lines.SetData(
        starts, numpy_to_vtkIdTypeArray(np.ascontiguousarray(pairs.ravel(), dtype=np.int64), deep=True)
    )
    mesh.SetPoints(places)
    mesh.SetLines(lines)
    for attributes, named in [(mesh.GetPointData(), points), (mesh.GetCellData(), cells)]:
        for name, values in named.items():
            column = numpy_to_vtk(np.ascontiguousarray(values), deep=True)
            column.SetName(name)
            attributes.AddArray(column)
    writer = vtkXMLPolyDataWriter()
    writer.SetInputData(mesh)
    writer.WriteToOutputStringOn()  # Python tells of a full disc, VTK only by leaving no file
    writer.Write()
    write_text(target, writer.GetOutputString())  # arrays stand in base 64


def _rows(name: str, given: ArrayLike, lengths: Sequence[int]) -> Reals:
    values = np.asarray(given, dtype=np.float64)  # NaN is a value here
    if values.ndim not in (1, 2) or len(values) not in lengths:
        wanted = " or ".join(str(length) for length in dict.fromkeys(lengths))
        raise InputError(f"{name} has the wrong shape", value=values.shape, remedy=f"Give {wanted} rows.")
    return values
