"""Tables that go to the workshop: their units, their digits, and words that no spreadsheet may take for a
formula."""

import csv
import io
import math
import re
import zipfile
from dataclasses import replace

import openpyxl
import pytest

from shellform.errors import InputError
from shellform.tables import Table, for_the_workshop, table_text, write_tables

RODS = Table(
    "rods",
    ("rod", "length [m]", "turn [rad]", "pull [N]", "holes [mm]", "count"),
    (("A1", 1.2345678, 0.5, 12.3456789, 7.12345, 3), ("=SUM(A1)", None, -math.pi / 3.0, 0.25, 40.0, 2)),
    ("Cut with a saw.", "+ 2 mm for the kerf"),
)


def test_for_the_workshop_lengths_are_in_mm_and_angles_in_degrees_and_the_rest_is_as_it_was():
    made = for_the_workshop(RODS)
    assert made.columns == ("rod", "length [mm]", "turn [°]", "pull [N]", "holes [mm]", "count")
    first, second = made.rows
    assert first[1:] == (pytest.approx(1234.5678), pytest.approx(28.64789), 12.3456789, 7.12345, 3)
    assert second == ("=SUM(A1)", None, pytest.approx(-60.0), 0.25, 40.0, 2)
    assert (made.name, made.notes) == (RODS.name, RODS.notes)


def test_whole_numbers_under_a_length_are_counts_and_stay():
    made = for_the_workshop(Table("t", ("step [m]",), ((4,), (4.0,))))
    assert made.rows == ((4,), (4000.0,))


def test_mm_are_written_to_three_decimals_and_all_else_to_six_or_exactly():
    rows = list(csv.reader(io.StringIO(table_text(RODS))))
    assert rows[0] == list(RODS.columns)
    assert rows[1] == ["A1", "1.234568", "0.500000", "12.345679", "7.123", "3"]
    assert rows[2][1] == ""
    exact = list(csv.reader(io.StringIO(table_text(RODS, exact=True, line_end="\r\n"))))
    assert exact[1] == ["A1", "1.2345678", "0.5", "12.3456789", "7.12345", "3"]
    assert table_text(RODS, line_end="\r\n").count("\r\n") == 3


@pytest.mark.parametrize(
    ("word", "written"),
    [
        ("=1+2", "'=1+2"),
        ("@SUM(A1)", "'@SUM(A1)"),
        ("-A1", "'-A1"),
        ("+1+cmd", "'+1+cmd"),
        ("\tx", "'\tx"),
        ("-3", "-3"),
        ("+3.25", "+3.25"),
        ("A=1", "A=1"),
        (-3, "-3"),
    ],
)
def test_a_word_that_a_spreadsheet_would_take_for_a_formula_begins_with_an_apostrophe(word, written):
    ((found,),) = list(csv.reader(io.StringIO(table_text(Table("t", ("what",), ((word,),))))))[1:]
    assert found == written
    assert table_text(Table("t", (str(word),), ())) == table_text(Table("t", (written,), ()))


def test_a_row_of_another_length_is_refused_with_its_number_and_how_many_are_wanted():
    with pytest.raises(InputError, match=r"^t: row 1 has another length .*found 1\).*Give 2 values"):
        Table("t", ("a", "b"), ((1, 2), (3,)))


def test_a_column_is_found_by_its_head_and_records_by_theirs():
    assert RODS.column("pull [N]") == [12.3456789, 0.25]
    assert RODS.records()[1]["turn [rad]"] == pytest.approx(-1.0471976)
    with pytest.raises(InputError, match=r"rods: is no column.*Columns: rod, length \[m\]"):
        RODS.column("length [mm]")


def test_a_workbook_has_notes_above_the_heads_and_numbers_to_a_tenth_of_a_mm(tmp_path):
    files = write_tables(tmp_path, [RODS, Table("a name of more letters than thirty-one", ("a",), ((1.5,),))])
    assert [file.name for file in files] == [
        "rods.csv",
        "a name of more letters than thirty-one.csv",
        "notes.txt",
        "schedules.xlsx",
    ]
    assert files[0].read_text(encoding="utf-8") == table_text(RODS)
    book = openpyxl.load_workbook(files[-1])
    assert [len(sheet.title) for sheet in book] == [4, 31]
    sheet = book["rods"]
    rows = [[cell.value for cell in row] for row in sheet.iter_rows()]
    assert [row[0] for row in rows[:2]] == ["Cut with a saw.", "'+ 2 mm for the kerf"]
    assert rows[2] == list(RODS.columns)
    assert rows[3] == list(RODS.rows[0])
    assert rows[4][0] == "'=SUM(A1)"
    assert [cell.number_format for cell in sheet[4]][1:5] == ["0.0000", "0.00", "0.00", "0.0"]
    assert sheet.freeze_panes == "B4"
    assert sheet.auto_filter.ref == "A3:F5"
    assert sheet.print_title_rows == "$3:$3"


def test_what_is_to_be_noted_of_csv_files_stands_beside_them_by_their_names(tmp_path):
    bare = Table("marks", ("mark",), ((1.5,),))
    *_, notes, _ = write_tables(tmp_path, [RODS, bare, replace(bare, name="cables", notes=("Hung in.",))])
    assert notes.read_text(encoding="utf-8") == (
        "Notes on the tables in this folder.\n\nrods.csv\n- Cut with a saw.\n- + 2 mm for the kerf\n\ncables.csv\n- Hung in.\n"
    )


def test_columns_are_as_wide_as_their_longest_word_up_to_80_letters(tmp_path):
    heads = ("x" * 40, "long", "short", "none")
    write_tables(tmp_path, [Table("t", heads, (("y" * 12, "y" * 200, 3.5, None),))])
    sheet = openpyxl.load_workbook(tmp_path / "schedules.xlsx")["t"]
    assert [sheet.column_dimensions[letter].width for letter in "ABCD"] == [22, 80, 10, 10]


def test_a_workbook_tells_no_time_at_which_it_was_made(tmp_path):
    files = [write_tables(tmp_path / name, [RODS])[-1] for name in "ab"]
    assert files[0].read_bytes() == files[1].read_bytes()
    with zipfile.ZipFile(files[0]) as book:
        assert {each.date_time for each in book.infolist()} == {(1980, 1, 1, 0, 0, 0)}
        told = book.read("docProps/core.xml").decode()
    assert told.count("1980-01-01T00:00:00Z") == 2
    assert len(re.findall(r"\d{4}-\d\d-\d\dT", told)) == 2


def test_a_table_is_shown_by_its_size_and_heads():
    assert (
        repr(Table("rods", ("rod", "length [m]"), (("A1", 1.0),)))
        == "Table('rods', 1 row of rod, length [m])"
    )
