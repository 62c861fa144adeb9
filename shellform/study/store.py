"""What a study has found: an append-only log, and the table made from it (door to PyArrow).

    DIR/results.jsonl   a line a finished design: checksum, then JSON with its key, status, reason, values and
    seconds DIR/table.parquet   a row a design in the study's order, all numbers of its summary as columns
    DIR/table.csv       the same with the columns that were asked for DIR/seconds.csv     what each design
    took; apart, since it differs from run to run

A line counts once its checksum and line end are on the disk; what a kill or a full disk leaves behind it is
cut off at the next start. So a design is in the log entirely or not at all, and computed once. The table is
written anew beside the old one and then put in its place. It depends on the log's content, not on the order
of its lines, so that a study that was stopped ends with the same bytes as one that wasn't.
"""

from __future__ import annotations

import datetime
import json
import os
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from difflib import get_close_matches
from functools import reduce
from pathlib import Path
from typing import Any, BinaryIO

from pydantic import TypeAdapter, ValidationError

from shellform.errors import InputError, not_installed
from shellform.records.checks import BUILT
from shellform.records.files import plain
from shellform.study.outcome import TRIED_AGAIN, ListedDesign, Outcome, Value
from shellform.tables import Table, table_text
from shellform.written import whole, write_text

_OUTCOME = TypeAdapter(Outcome)
_GROUP = 4096  # rows of a row group, and all that are in memory at once
_KINDS = {"bool": 0, "int": 1, "float": 2, "str": 3}
_BUILT = (*reversed(BUILT), "initial")


class Log:
    """The results of a study by key, on the disk; in memory a place in the file for each, and the columns
    with their kinds.
    """

    def __init__(self, file: Path) -> None:
        """Opens the log or begins one. Raises InputError where a line before the last is damaged."""
        self.file = file
        self.kinds: dict[str, int] = {}
        self._places: dict[str, int] = {}
        self._unsettled: set[str] = set()
        try:
            self._open = open(file, "a+b", buffering=0)  # noqa: SIM115 (it is open as long as the log)
        except OSError as error:
            raise InputError(
                f"can't be written: {error}", where=str(file), remedy="Choose another --output."
            ) from error
        self._end = 0
        self._open.seek(0)
        with open(file, "rb") as lines:
            for line in lines:
                outcome = _outcome(line)
                if outcome is None:
                    if lines.read(1):
                        self._open.close()
                        raise InputError(
                            "is damaged", where=f"{file}, byte {self._end}", remedy="Choose another --output."
                        )
                    break
                self._enter(outcome, self._end)
                self._end += len(line)
        self._open.truncate(self._end)
        self._begin = self._end

    def __enter__(self) -> Log:
        return self

    def __exit__(self, *error: object) -> None:
        self._open.close()

    def __iter__(self) -> Iterator[str]:
        return iter(self._places)

    def __len__(self) -> int:
        return len(self._places)

    def __contains__(self, key: object) -> bool:
        """Whether there is a result that stands."""
        return key in self._places and key not in self._unsettled

    def old(self, key: str) -> bool:
        """Whether there was a result that stands when the log was opened."""
        return key in self and self._places[key] < self._begin

    def get(self, key: str) -> Outcome | None:
        """A design's outcome, one that is tried again too."""
        if key not in self._places:
            return None
        with open(self.file, "rb") as file:
            return self._at(file, key)

    def outcomes(self, keys: Iterable[str]) -> Iterator[Outcome | None]:
        """As `get`, for many."""
        with open(self.file, "rb") as file:
            for key in keys:
                yield self._at(file, key) if key in self._places else None

    def _at(self, file: BinaryIO, key: str) -> Outcome:
        file.seek(self._places[key])
        outcome = _outcome(file.readline())
        if outcome is None:
            raise InputError(
                "has been changed by somebody else",
                where=str(self.file),
                remedy="Let it finish alone, then run the study again.",
            )
        return outcome

    def add(self, outcomes: Sequence[Outcome]) -> None:
        """Adds outcomes with one write and one wait for the disk. Raises OSError, and holds none of them,
        where there is no room.
        """
        lines = [_line(outcome) for outcome in outcomes]
        block, written = b"".join(lines), 0
        try:
            while written < len(block):
                written += self._open.write(block[written:])
            os.fsync(self._open.fileno())
        except OSError:
            self._open.truncate(self._end)
            raise
        for outcome, line in zip(outcomes, lines, strict=True):
            self._enter(outcome, self._end)
            self._end += len(line)

    def _enter(self, outcome: Outcome, place: int) -> None:
        key = outcome.key
        self._places[key] = place
        (self._unsettled.add if outcome.status in TRIED_AGAIN else self._unsettled.discard)(key)
        for name, value in outcome.values.items():
            self.kinds[name] = _common(self.kinds.get(name), _KINDS[type(value).__name__])


def _line(outcome: Outcome) -> bytes:
    text = json.dumps(plain(outcome), separators=(",", ":")).encode()
    return b"%08x %s\n" % (zlib.crc32(text), text)


def _outcome(line: bytes) -> Outcome | None:
    """The outcome in a whole line; None of a torn one. Raises InputError for a whole one of another kind."""
    if not line.endswith(b"\n") or line[8:9] != b" " or line[:8] != b"%08x" % zlib.crc32(line[9:-1]):
        return None
    try:
        return _OUTCOME.validate_json(line[9:], strict=True)
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False)[0]
        raise InputError(
            f"is no line of a study's results: {'.'.join(map(str, first['loc']))}: {first['msg']}",
            where="results.jsonl",
            remedy="Choose another --output.",
        ) from error


def picked(values: Mapping[str, Value], columns: Mapping[str, str]) -> dict[str, Value | None]:
    """The columns that were asked for, of an outcome's values; None where a design has no such number."""
    judged = values.get("verdict.design")
    best = next((name for name in (judged, *_BUILT) if f"designs.{name}.cables" in values), "initial")
    return {
        name: values.get(path.replace("designs.best.", f"designs.{best}.")) for name, path in columns.items()
    }


def line_of(design: ListedDesign) -> str:
    """A design as a line of designs.jsonl: lists as their JSON, dates and times as ISO 8601 has them, since a
    cell of a table holds one value.
    """
    own = {name: cell_of(value) for name, value in design.own.items()}
    return json.dumps(plain(replace(design, own=own))) + "\n"


def cell_of(value: Any) -> Value:
    """What a cell has of an entry's value."""
    if isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, datetime.date | datetime.time):
        return value.isoformat()
    return json.dumps(value, default=cell_of)


def arrow() -> tuple[Any, Any]:
    """PyArrow and its reader and writer of Parquet. Raises InputError where they aren't installed."""
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError as error:
        raise not_installed("tables of studies", "study", error) from error
    return pa, pq


def designs_of(file: Path) -> Iterator[ListedDesign]:
    """The designs of a study in order, as `run_study` lists them."""
    with open(file, encoding="utf-8") as lines:
        for line in lines:
            found = json.loads(line)
            yield ListedDesign(found["key"], found["own"])


def write_table(folder: Path, log: Log, columns: Mapping[str, str]) -> int:
    """Writes the tables of all designs in designs.jsonl that have a row in the log; returns how many."""
    pa, pq = arrow()

    own: dict[str, int] = {}
    for design in designs_of(folder / "designs.jsonl"):
        for name, value in design.own.items():
            own[name] = _common(own.get(name), _KINDS[type(value).__name__])
    types = [pa.bool_(), pa.int64(), pa.float64(), pa.string()]
    names = sorted(log.kinds)
    picks = {name: _kind_of_pick(path, log.kinds) for name, path in columns.items()}
    fields = [
        ("number", 1),
        ("key", 3),
        ("status", 3),
        ("reason", 3),
        *((f"case.{name}", kind) for name, kind in own.items()),
        *picks.items(),
        *((name, log.kinds[name]) for name in names if name not in picks),
    ]
    schema = pa.schema([(name, types[kind]) for name, kind in fields])
    heads = tuple(name for name, _ in fields[: 4 + len(own) + len(picks)])
    short: list[tuple[Any, ...]] = []
    spent: list[tuple[Any, ...]] = []
    with whole(folder / "table.parquet") as partial:
        with pq.ParquetWriter(partial, schema, compression="zstd") as writer:
            for group in _groups(folder, log, columns):
                arrays = [_array(pa, group, name, kind, types[kind]) for name, kind in fields]
                writer.write_table(pa.Table.from_arrays(arrays, schema=schema))
                for row in group:
                    short.append(tuple(_cell(row.get(name), kind) for name, kind in fields[: len(heads)]))
                    who = row["number"], row["key"], row["worker"]
                    spent += [(*who, stage, seconds) for stage, seconds in row["seconds"].items()]
        with open(partial, "rb") as written:
            os.fsync(written.fileno())
    write_text(folder / "table.csv", table_text(Table("table", heads, tuple(short)), exact=True))
    columns_of_seconds = ("number", "key", "worker", "stage", "seconds")
    seconds_table = Table("seconds", columns_of_seconds, tuple(spent))
    write_text(folder / "seconds.csv", table_text(seconds_table, exact=True))
    return len(short)


def _cell(value: Any, kind: int) -> Any:
    return float(value) if kind == 2 and value is not None else value


def _common(known: int | None, kind: int) -> int:
    """The kind of a column that has values of both; booleans among numbers become numbers."""
    return kind if known is None or known == kind else max(known, kind, 2)


def _kind_of_pick(path: str, kinds: Mapping[str, int]) -> int:
    names = (path.replace("designs.best.", f"designs.{each}.") for each in _BUILT)
    known = [kinds[name] for name in names if name in kinds]
    return reduce(_common, known) if known else 2


def _groups(folder: Path, log: Log, columns: Mapping[str, str]) -> Iterator[list[dict[str, Any]]]:
    group: list[dict[str, Any]] = []
    designs = list(enumerate(designs_of(folder / "designs.jsonl")))
    found = log.outcomes(design.key for _, design in designs)
    for (number, design), row in zip(designs, found, strict=True):
        if row is None:
            continue
        group.append(
            {
                **row.values,
                **picked(row.values, columns),
                **{f"case.{name}": value for name, value in design.own.items()},
                **{name: getattr(row, name) for name in ("key", "status", "reason", "seconds", "worker")},
                "number": number,
            }
        )
        if len(group) == _GROUP:
            yield group
            group = []
    if group:
        yield group


def _array(pa: Any, rows: Sequence[Mapping[str, Any]], name: str, kind: int, form: Any) -> Any:
    values = [row.get(name) for row in rows]
    if kind >= 2:
        to: Any = float if kind == 2 else str
        values = [None if value is None else to(value) for value in values]
    return pa.array(values, form)


def has_column(folder: Path, name: str) -> bool:
    """Whether a study's table, which is there, has the column."""
    return name in arrow()[1].read_schema(folder / "table.parquet").names


def read_table(folder: str | Path, columns: Sequence[str] | None = None, filters: Any = None) -> Any:
    """A study's table as a `pyarrow.Table`, of some columns and rows if asked: `filters=[("cables", "<",
    100)]`.

    Raises InputError where there is none, or a damaged one, and for columns and filters that it hasn't.
    """
    pa, pq = arrow()

    file = Path(folder) / "table.parquet"
    if not file.is_file():
        raise InputError("there is no table", where=str(file), remedy="Make one with shellform study.")
    names = None if columns is None else [columns] if isinstance(columns, str) else list(columns)
    try:
        known = pq.read_schema(file).names
        for name in [each for each in names or () if each not in known]:
            near = get_close_matches(name, known, 1)
            raise InputError(
                "is no column of the table",
                where=str(file),
                value=name,
                remedy=f"Did you mean {near[0]!r}?" if near else f"It begins with {', '.join(known[:8])}.",
            )
        return pq.read_table(file, columns=names, filters=filters)
    except InputError:
        raise
    except (pa.ArrowException, OSError, TypeError, ValueError) as error:
        if filters is not None:
            read_table(folder, names)  # a table that is damaged says so
            raise InputError(
                f"can't be used: {str(error).splitlines()[0][:200]}",
                where="filters",
                value=filters,
                remedy='Name a column of the table, a sign and a value, as [("cables", "<", 100)].',
            ) from error
        raise InputError(
            f"is damaged: {error}", where=str(file), remedy="Run the study again; its results are kept."
        ) from error
