"""Tables that leave the house: CSV files, the notes on them, and one workbook of all; the door to openpyxl.

Values are in SI units, said in the column's head: "length [m]"; `for_the_workshop` makes mm and degrees of
them. An empty cell means that the value isn't known. Words that a spreadsheet would take for a formula, which
may run programs, begin with an apostrophe: then it takes them for words.
"""

from __future__ import annotations

import csv
import io
import math
import re
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from shellform.errors import InputError, how_many
from shellform.written import whole, write_text

Value = str | float | int | None
_TIME, _EPOCH = re.compile(rb"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ"), b"1980-01-01T00:00:00Z"
_NUMBER = re.compile(r"[+-]\d+(\.\d*)?")
_FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n")


@dataclass(frozen=True)
class Table:
    """A table's `name`, the heads of its `columns`, its `rows`, and `notes` that belong to it, a sentence
    each.
    """

    name: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Value, ...], ...]
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for number, row in enumerate(self.rows):
            if len(row) != len(self.columns):
                raise InputError(
                    f"row {number} has another length than the heads",
                    where=self.name,
                    value=len(row),
                    remedy=f"Give {len(self.columns)} values, None where one is missing.",
                )

    def __repr__(self) -> str:
        rows = how_many(len(self.rows), "row", "rows")
        return f"Table({self.name!r}, {rows} of {', '.join(self.columns)})"

    def records(self) -> list[dict[str, Value]]:
        """A dictionary by head for each row: what `pandas.DataFrame` takes."""
        return [dict(zip(self.columns, row, strict=True)) for row in self.rows]

    def column(self, head: str) -> list[Value]:
        """The values under a head. Raises InputError where there is no such head."""
        if head not in self.columns:
            raise InputError(
                "is no column", where=self.name, value=head, remedy=f"Columns: {', '.join(self.columns)}."
            )
        place = self.columns.index(head)
        return [row[place] for row in self.rows]


_WORKSHOP = {"[m]": ("[mm]", 1e3), "[rad]": ("[°]", 180.0 / math.pi)}


def for_the_workshop(table: Table) -> Table:
    """The table with lengths in mm and angles in degrees, each said in its column's head."""
    heads, factors = [], []
    for head in table.columns:
        unit, (other, factor) = next(
            ((unit, how) for unit, how in _WORKSHOP.items() if unit in head), ("", ("", 1.0))
        )
        heads.append(head.replace(unit, other) if unit else head)
        factors.append(factor)
    rows = tuple(
        tuple(
            value * factor if isinstance(value, float) and factor != 1.0 else value
            for value, factor in zip(row, factors, strict=True)
        )
        for row in table.rows
    )
    return Table(table.name, tuple(heads), rows, table.notes)


def table_text(table: Table, *, exact: bool = False, line_end: str = "\n") -> str:
    """The table as CSV: heads, then rows, numbers to six decimals (mm to three) or, if they are to be
    `exact`, with all their digits.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator=line_end)
    places = [3 if "[mm]" in head else 6 for head in table.columns]
    writer.writerow([_harmless(head) for head in table.columns])
    for row in table.rows:
        writer.writerow(
            [
                f"{value:.{digits}f}" if isinstance(value, float) and not exact else _harmless(value)
                for value, digits in zip(row, places, strict=True)
            ]
        )
    return text.getvalue()


def _harmless(value: Value) -> Value:
    """A value that no spreadsheet takes for a formula; "-3" is a number."""
    if not isinstance(value, str) or not value.startswith(_FORMULA) or _NUMBER.fullmatch(value):
        return value
    return f"'{value}"


def notes_text(tables: Sequence[Table]) -> str:
    """What is to be noted of the tables, by the names of their CSV files, which hold the table alone."""
    parts = [
        "\n".join([f"{table.name}.csv", *(f"- {note}" for note in table.notes)])
        for table in tables
        if table.notes
    ]
    return "\n\n".join(["Notes on the tables in this folder.", *parts]) + "\n"


def write_tables(folder: str | Path, tables: Sequence[Table]) -> list[Path]:
    """Writes NAME.csv for each table, what is to be noted of them as notes.txt, and all of it as the sheets
    of schedules.xlsx; returns the files.

    Raises InputError where the folder can't be written to.
    """
    files = []
    for table in tables:
        files.append(Path(folder) / f"{table.name}.csv")
        write_text(files[-1], table_text(table))
    files.append(Path(folder) / "notes.txt")
    write_text(files[-1], notes_text(tables))
    files.append(Path(folder) / "schedules.xlsx")
    content = io.BytesIO()
    _workbook(tables).save(content)
    with whole(files[-1]) as partial:
        partial.write_bytes(_timeless(content))
    return files


def _timeless(book: io.BytesIO) -> bytes:
    """A workbook's content with the same times each time: openpyxl writes those at which it was saved."""
    content = io.BytesIO()
    with zipfile.ZipFile(book) as old, zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as new:
        for name in old.namelist():
            part = old.read(name)
            if name == "docProps/core.xml":
                part = _TIME.sub(_EPOCH, part)
            new.writestr(zipfile.ZipInfo(name), part, zipfile.ZIP_DEFLATED)
    return content.getvalue()


def _workbook(tables: Sequence[Table]) -> Any:
    from openpyxl import Workbook
    from openpyxl.styles import Alignment, Font, PatternFill
    from openpyxl.utils import get_column_letter

    book = Workbook()
    book.remove(book.active)
    for table in tables:
        sheet = book.create_sheet(table.name[:31])
        for line in table.notes:
            sheet.append([_harmless(line)])
        head = len(table.notes) + 1
        sheet.append([_harmless(head) for head in table.columns])
        for cell in sheet[head]:
            cell.font = Font(bold=True)
            cell.fill = PatternFill("solid", fgColor="DDE7EE")
            cell.alignment = Alignment(wrap_text=True, vertical="top")
        for row in table.rows:
            sheet.append([_harmless(value) for value in row])
        for number, name in enumerate(table.columns, 1):
            letter = get_column_letter(number)
            decimals = "0.0000" if "[m]" in name else "0.0" if "[mm]" in name else "0.00"
            longest = len(name) // 2
            for (cell,) in sheet.iter_rows(
                min_row=head + 1, max_row=head + len(table.rows), min_col=number, max_col=number
            ):
                if isinstance(cell.value, float):
                    cell.number_format = decimals
                longest = max(longest, len(str(cell.value)) if isinstance(cell.value, str) else 8)
            sheet.column_dimensions[letter].width = min(longest + 2, 80)
        sheet.freeze_panes = f"B{head + 1}"
        sheet.auto_filter.ref = f"A{head}:{get_column_letter(len(table.columns))}{head + len(table.rows)}"
        sheet.page_setup.orientation = "landscape"
        sheet.page_setup.fitToHeight = 0
        sheet.sheet_properties.pageSetUpPr.fitToPage = True
        sheet.print_title_rows = f"{head}:{head}"
    return book
