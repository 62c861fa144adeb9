"""The same design gives the same files, whenever they are written."""

import re
import time

import numpy as np
import pytest

from shellform.output.workshop.drawings import write_dxf
from shellform.output.workshop.layout import Sheet
from shellform.surface.occ import write_curves
from shellform.surface.readers.rhino import Item, write_rhino
from shellform.tables import Table, write_tables

CURVES = [np.eye(3), np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])]
ITEMS = [Item("rods u", "U0", np.eye(3)), Item("rods u", "U1", 2.0 * np.eye(3))]


def steps(folder):
    write_curves(folder / "a.step", CURVES, ["U0", "C0"])


def workbook(folder):
    write_tables(folder, [Table("cables", ("number", "length [m]"), ((1, 0.5), (2, 0.7)))])


def drawing(folder):
    write_dxf(folder / "a.dxf", Sheet("grid", [], 2.5))


@pytest.mark.parametrize("write", [steps, workbook, drawing])
def test_a_file_written_again_another_second_has_the_same_bytes(tmp_path, write):
    found = []
    for name in ("first", "second"):
        (tmp_path / name).mkdir()
        write(tmp_path / name)
        found.append({file.name: file.read_bytes() for file in (tmp_path / name).iterdir()})
        time.sleep(1.0)
    assert found[0]
    assert found[0] == found[1]


def test_a_rhino_file_written_again_differs_in_its_date_alone(tmp_path):
    content = []
    for name in ("a.3dm", "b.3dm"):
        write_rhino(tmp_path / name, ITEMS, {"rods u": "#000000"})
        content.append((tmp_path / name).read_bytes())
    assert len(content[0]) == len(content[1])
    differ = [k for k, pair in enumerate(zip(*content, strict=True)) if pair[0] != pair[1]]
    assert len(differ) < 40


def test_a_step_file_tells_nothing_of_when_it_was_written(tmp_path):
    steps(tmp_path)
    text = (tmp_path / "a.step").read_text(encoding="utf-8")
    assert re.findall(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d", text) == ["1970-01-01T00:00:00"]
