"""CSV files that come from a site: columns by their names in the first line, in any order; lines that start
with # are passed over.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from shellform.arrays import Indices, Reals
from shellform.errors import InputError, how_many, require_file, unreadable
from shellform.gridshell.gridshell import Design, Gridshell
from shellform.net.grid import rod_names
from shellform.quantities import PLACE_DEVIATION


@dataclass(frozen=True)
class MeasuredRow:
    """A `line` of a file with its `values` by column, NaN where a cell is empty."""

    line: int
    values: dict[str, float]


_NAMED = re.compile(r"[A-Za-z]+(\d+)")  # as drawings and schedules name cables: C12
_STRETCH = 1.01  # times a rod's length: its ends get no farther apart before it breaks


def check_noise(noise: float) -> None:
    """Raises InputError for a standard deviation of measured coordinates, m, whose square is nothing or all
    beside them."""
    PLACE_DEVIATION.require(noise, where="--noise")


def numbered_cells(
    file: Path, remedy: str = "Give a table as CSV in UTF-8, with a head line."
) -> list[tuple[int, list[str]]]:
    """The lines of a table in UTF-8, each with its number and its cells; remarks and empty lines are passed
    over. Cells are parted by what the first line has of semicolon, tab and comma, where it has none of them
    by blanks. Raises InputError where the file can't be read, with the `remedy`, and where a line is no row
    of its own: a quotation mark that isn't closed runs on over the lines that follow."""
    require_file(file)
    try:
        text = file.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(unreadable(error), where=str(file), remedy=remedy) from error
    kept = [
        (number, line)
        for number, line in enumerate(text.splitlines(), 1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    delimiter = next((each for each in ";\t," if kept and each in kept[0][1]), " ")
    rows: list[tuple[int, list[str]]] = []
    for number, line in kept:
        try:
            # blanks at a line's end begin no cell
            (cells,) = csv.reader([line.strip(" ")], delimiter=delimiter, skipinitialspace=True, strict=True)
        except csv.Error as error:
            raise InputError(
                f"can't be parted into cells: {error}",
                where=f"{file}, line {number}",
                remedy="Close its quotation marks, or leave them out.",
            ) from error
        rows.append((number, cells))
    return rows


def names_in(cells: Sequence[str]) -> list[str]:
    """The names of columns in the cells of a first line, without regard to capitals."""
    return [each.strip().lower() for each in cells]


def refuse_twice(file: Path, names: Sequence[str], needed: Sequence[str]) -> None:
    """Raises InputError for columns' names of which a `needed` one is there twice."""
    for name in needed:
        if names.count(name) > 1:
            raise InputError(f"has two columns {name!r}", where=str(file), remedy="Name each column once.")


def too_many_cells(file: Path, line: int, cells: int, columns: int) -> InputError:
    """What a line with more cells than the file has columns is refused with: numbers with decimal commas have
    two."""
    return InputError(
        f"has {cells} cells for {columns} columns",
        where=f"{file}, line {line}",
        remedy="Give each line a cell for each column, empty ones too, and write numbers with decimal points.",
    )


def read_table(
    path: str | Path, needed: tuple[str, ...], optional: tuple[str, ...] = (), *, empty: tuple[str, ...] = ()
) -> list[MeasuredRow]:
    """The rows of a CSV file with the columns `needed` and perhaps some `optional` ones; only those in
    `empty` may have empty cells.

    Raises InputError naming file, line and column.
    """
    file = Path(path)
    lines = numbered_cells(file)
    columns = f"Columns: {', '.join(needed)}" + (f"; if wanted {', '.join(optional)}." if optional else ".")
    if not lines:
        raise InputError("is empty", where=str(file), remedy=columns)
    first = lines[0][1]
    names = names_in(first)
    for name in needed:
        if name not in names:
            raise InputError(
                f"has no column {name!r} in its first line",
                where=str(file),
                value=", ".join(first),
                remedy=columns,
            )
    refuse_twice(file, names, names)
    rows = []
    for number, cells in lines[1:]:
        if len(cells) > len(names):
            raise too_many_cells(file, number, len(cells), len(names))
        values = {}
        for name in [each for each in (*needed, *optional) if each in names]:
            place = names.index(name)
            cell = cells[place].strip() if place < len(cells) else ""
            values[name] = _number(cell, f"{file}, line {number}: {name}", name in empty)
        rows.append(MeasuredRow(number, values))
    if not rows:
        raise InputError("has no rows below its first line", where=str(file), remedy=columns)
    return rows


def has_column(path: str | Path, name: str) -> bool:
    """Whether the first line of a file that can be read names the column."""
    lines = numbered_cells(Path(path))
    return bool(lines) and name in names_in(lines[0][1])


def nodes_of(path: str | Path, rows: list[MeasuredRow], shell: Gridshell) -> Indices:
    """The nodes (k,) that rows name by a `node` of the model or by a `crossing` of the net (its upper rod's
    node); none twice.
    """
    crossings = shell.net.grid.crossing_nodes[:, 1]
    found: list[int] = []
    for row in rows:
        for name, count in (("node", shell.node_count), ("crossing", len(crossings))):
            if name in row.values:
                where = f"{path}, line {row.line}: {name}"
                at = _index(row.values[name], where, count)
                node = at if name == "node" else int(crossings[at])
                if node in found:
                    raise InputError("is there twice", where=where, value=at, remedy="Keep one of the rows.")
                found.append(node)
                break
    return np.array(found, dtype=np.int64)


def read_nodes(path: str | Path, shell: Gridshell) -> Indices:
    """Marked nodes from a CSV file with a column `node` or `crossing`."""
    return nodes_of(path, read_table(path, (named_by(path),)), shell)


def named_by(path: str | Path) -> str:
    """How a file names nodes: by "node" or "crossing". Raises InputError where by neither."""
    for name in ("node", "crossing"):
        if has_column(path, name):
            return name
    raise InputError(
        "has no column 'node' or 'crossing' in its first line",
        where=str(path),
        remedy="Numbers are those of net.json and the model files.",
    )


def read_loads(path: str | Path, shell: Gridshell) -> Reals:
    """A dead load (n, 6), N, from a CSV file: `node` or `crossing`, and fx, fy, fz of which those left out
    are 0.
    """
    axes = ("fx", "fy", "fz")
    rows = read_table(path, (named_by(path),), axes)
    if not any(name in rows[0].values for name in axes):
        raise InputError(
            "has no column fx, fy or fz in its first line",
            where=str(path),
            remedy="Forces are in N, fz upwards.",
        )
    load = np.zeros((shell.node_count, 6))
    for node, row in zip(nodes_of(path, rows, shell), rows, strict=True):
        load[node, :3] = [row.values.get(name, 0.0) for name in axes]
    return load


def read_places(path: str | Path, shell: Gridshell) -> tuple[Indices, Reals]:
    """Nodes (k,) and their places (k, 3), m, in the model's axes from a CSV file: `node` or `crossing`, x, y,
    z; empty where one wasn't seen.
    """
    rows = read_table(path, (named_by(path), "x", "y", "z"), empty=("x", "y", "z"))
    return nodes_of(path, rows, shell), np.array([[row.values[axis] for axis in "xyz"] for row in rows])


def counted_alike(
    places: Reals, expected: Reals, origin: Sequence[float] | None, *, reach: float
) -> tuple[Reals, tuple[str, ...]]:
    """Measured `places` (k, 3), m, near the `expected` (m, 3), in coordinates that count from where the
    model's do: from `origin` (3,), m, in a survey's. Where they lie nearer so, it is taken off, and what was
    done is said; an origin within `reach`, m, couldn't be told from what is measured.
    """
    if origin is None or float(np.linalg.norm(origin)) <= reach:
        return places, ()
    apart = np.nanmean(places, axis=0) - expected.mean(axis=0)
    if np.linalg.norm(apart - origin) >= np.linalg.norm(apart):
        return places, ()
    told = ", ".join(f"{each:.9g}" for each in origin)
    return places - np.array(origin), (
        f"surface.origin, ({told}) m, was taken off the coordinates that were given",
    )


def read_groups(path: str | Path, design: Design) -> list[Indices]:
    """Groups of candidate cables by rising number from a CSV file: `cable`, its number among the design's own
    cables, as in drawings and model files, and `group`."""
    present = np.flatnonzero(design.present)
    teams: dict[float, list[int]] = {}
    for row in read_table(path, ("cable", "group")):
        where = f"{path}, line {row.line}: cable"
        cable = int(present[_index(row.values["cable"], where, len(present))])
        teams.setdefault(row.values["group"], []).append(cable)
    return [np.array(teams[group], dtype=np.int64) for group in sorted(teams)]


def read_way(
    path: str | Path, shell: Gridshell, origin: Sequence[float] | None = None
) -> tuple[list[Reals], tuple[str, ...]]:
    """Places (s, 3), m, of all supports at stops by rising number, from a CSV file: `stop`, `node` (a
    support's), x, y, z; and how they were made to count from `origin` (3,), m, as the model does, in words.
    """
    supports = [int(each) for each in shell.net.supports]
    stops: dict[float, dict[int, list[float]]] = {}
    for row in read_table(path, ("stop", "node", "x", "y", "z")):
        where = f"{path}, line {row.line}: node"
        node = _index(row.values["node"], where, shell.node_count)
        if node not in supports:
            raise InputError(
                "is no support",
                where=where,
                value=node,
                remedy=f"Supports: {', '.join(map(str, supports[:8]))}, …",
            )
        places = stops.setdefault(row.values["stop"], {})
        if node in places:
            raise InputError(
                "is there twice in one stop",
                where=where,
                value=node,
                remedy="Give each support one row a stop.",
            )
        places[node] = [row.values[axis] for axis in "xyz"]
    for stop, places in stops.items():
        lacking = [node for node in supports if node not in places]
        if lacking:
            raise InputError(
                f"stop {stop:g} lacks {how_many(len(lacking), 'support', 'supports')}",
                where=str(path),
                value=lacking[0],
                remedy="Give every support a row in each stop.",
            )
    for stop, places in stops.items():
        _refuse_far_ends(stop, places, path, shell)
    given = np.array([[stops[stop][node] for node in supports] for stop in sorted(stops)])
    target = shell.target.positions
    reach = float(np.ptp(target, axis=0).max())
    alike, told = counted_alike(given.reshape(-1, 3), target[supports], origin, reach=reach)
    return list(alike.reshape(-1, len(supports), 3)), told


def _refuse_far_ends(stop: float, places: dict[int, list[float]], path: str | Path, shell: Gridshell) -> None:
    """Raises InputError where a stop puts a rod's supports farther apart than the rod is long."""
    grid = shell.net.grid
    for name, rod in zip(rod_names(grid), grid.rods, strict=True):
        ends = [places[int(node)] for node in rod.nodes[[0, -1]] if int(node) in places]
        apart = math.dist(*ends) if len(ends) == 2 else 0.0
        if apart > rod.length * _STRETCH:
            raise InputError(
                f"stop {stop:g} puts the ends of {name} {apart:.4g} m apart, farther than it is long",
                where=str(path),
                value=round(rod.length, 6),
                remedy="Give metres, each support at its own node.",
            )


def _number(cell: str, where: str, may_be_empty: bool) -> float:
    if not cell and may_be_empty:
        return math.nan
    try:
        value = float(cell)
    except ValueError as error:
        named = _NAMED.fullmatch(cell)
        remedy = "Write its number alone, such as 12, or a decimal one with a point, such as 0.0125."
        if named:
            remedy = f"Write its number alone: {named[1]}."
        raise InputError("must be a number", where=where, value=cell, remedy=remedy) from error
    if not math.isfinite(value):
        raise InputError(
            "must be finite",
            where=where,
            value=cell,
            remedy="Write what was measured, or leave that row out.",
        )
    return value


def _index(value: float, where: str, count: int) -> int:
    if value != int(value) or not 0 <= value < count:
        raise InputError(
            f"must be a whole number from 0 to {count - 1}",
            where=where,
            value=int(value) if value == int(value) else value,
            remedy="Take it from the run's own tables, which number from 0.",
        )
    return int(value)
