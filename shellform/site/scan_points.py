"""Points of scans and surveys, read from a file."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from shellform.arrays import Reals, reals
from shellform.errors import InputError
from shellform.site.measurements import names_in, numbered_cells, refuse_twice, too_many_cells
from shellform.surface.units import unit_factor


def read_points(path: str | Path, *, unit: str = "m") -> Reals:
    """Points (k, 3), m, from a CSV file: columns x, y, z by their names in the first line or, without names,
    the first three; lines that start with # and lines whose coordinates are all empty (markers out of sight)
    are passed over. Raises InputError."""
    metres = unit_factor(unit, where="scan.unit")
    file = Path(path)
    rows = numbered_cells(file, "Give a text file: x, y, z of a point in each line.")
    columns = [0, 1, 2]
    names = names_in(rows[0][1]) if rows else []
    named = {"x", "y", "z"} <= set(names)
    if named:
        refuse_twice(file, names, "xyz")
        columns = [names.index(each) for each in "xyz"]
        rows = rows[1:]
    elif rows and _are_numbered([cells for _, cells in rows]):
        raise InputError(
            "has points with numbers, and no names of columns",
            where=str(file),
            value=", ".join(rows[0][1]),
            remedy="Name the columns in the first line: x, y, z, and node or crossing where the numbers are those.",
        )
    found = []
    for line, row in rows:
        if named and len(row) > len(names):
            raise too_many_cells(file, line, len(row), len(names))
        cells = [row[k].strip() if k < len(row) else "" for k in columns]
        if any(cells):
            try:
                point = [float(each) for each in cells]
            except ValueError as error:
                raise InputError(
                    "must be three numbers",
                    where=f"{file}, line {line}",
                    value=cells,
                    remedy="Write them with decimal points: 0.0125."
                    if any("," in cell for cell in cells)
                    else "Write three numbers, or none where a marker is hidden."
                    if named
                    else "Name the columns x, y, z in the first line.",
                ) from error
            if not all(map(math.isfinite, point)):
                raise InputError(
                    "must be three finite numbers",
                    where=f"{file}, line {line}",
                    value=cells,
                    remedy="Leave the three cells empty where a marker is hidden.",
                )
            found.append(point)
    if not found:
        raise InputError(
            "has no points", where=str(file), remedy="Give a text file: x, y, z of a point in each line."
        )
    return metres * reals(str(file), found, (None, 3))


def _are_numbered(rows: Sequence[Sequence[str]]) -> bool:
    """Whether each row begins with a whole number of its own and has three cells after it."""
    first = [row[0] for row in rows]
    return len(set(first)) == len(first) and all(len(row) > 3 and row[0].isdigit() for row in rows)
