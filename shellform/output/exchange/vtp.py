"""Gridshells as lines for ParaView, as VTK's XML of polygonal data (VTP; VTK File Formats, "XML File
Formats": arrays in line, in base 64, compressed by zlib in one block each).
"""

from __future__ import annotations

import base64
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shellform.arrays import Reals, indices, reals
from shellform.errors import InputError
from shellform.output.pictures.panel import Panel
from shellform.written import path_to_write, write_text

_TYPES = {"f": ("Float64", "<f8"), "i": ("Int64", "<i8"), "u": ("UInt8", "|u1")}


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
    target = path_to_write(path, ".vtp")
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
    kinds = {"Verts": 0, "Lines": len(pairs), "Strips": 0, "Polys": 0}
    counts = " ".join(f'NumberOf{kind}="{count}"' for kind, count in kinds.items())
    lines = {"connectivity": pairs.ravel(), "offsets": 2 * np.arange(1, len(pairs) + 1)}
    parts = {
        "PointData": points,
        "CellData": cells,
        "Points": {"Points": nodes},
        **{
            kind: lines if count else {name: np.zeros(0, int) for name in lines}
            for kind, count in kinds.items()
        },
    }
    body = "\n".join(
        f"      <{part}>\n"
        + "".join(f"        {_data_array(name, values)}\n" for name, values in arrays.items())
        + f"      </{part}>"
        for part, arrays in parts.items()
    )
    write_text(
        target,
        '<?xml version="1.0"?>\n<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian" '
        'header_type="UInt64" compressor="vtkZLibDataCompressor">\n  <PolyData>\n'
        f'    <Piece NumberOfPoints="{len(nodes)}" {counts}>\n{body}\n    </Piece>\n  </PolyData>\n</VTKFile>\n',
    )


def _data_array(name: str, values: NDArray[Any]) -> str:
    """One array as an element: in base 64 the count and sizes of its blocks (here one), then what they hold,
    compressed.
    """
    kind, form = _TYPES[values.dtype.kind]
    data = np.ascontiguousarray(values, dtype=form).tobytes()
    packed = zlib.compress(data)
    sizes = np.array([1, len(data), 0, len(packed)] if data else [0, 0, 0], dtype="<u8").tobytes()
    text = b"".join(base64.b64encode(part) for part in ((sizes, packed) if data else (sizes,)))
    width = values.shape[1] if values.ndim == 2 else 1
    head = f'type="{kind}" Name={quoteattr(name)} NumberOfComponents="{width}" format="binary"'
    return f"<DataArray {head}>{text.decode()}</DataArray>"


def _rows(name: str, given: ArrayLike, lengths: Sequence[int]) -> Reals:
    values = np.asarray(given, dtype=np.float64)  # NaN is a value here
    if values.ndim not in (1, 2) or len(values) not in lengths:
        wanted = " or ".join(str(length) for length in dict.fromkeys(lengths))
        raise InputError(f"{name} has the wrong shape", value=values.shape, remedy=f"Give {wanted} rows.")
    return values
