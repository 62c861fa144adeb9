"""The same design gives the same files, whenever they are written."""

import os
import re
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import rhino3dm

from shellform.output.workshop.drawings import write_dxf
from shellform.output.workshop.layout import Sheet
from shellform.surface.occ import write_curves
from shellform.surface.readers.rhino import Item, write_rhino
from shellform.surface.readers.rhino_bytes import without_date_and_path
from shellform.tables import Table, write_tables

ROOT = Path(__file__).parent.parent.parent
CURVES = [np.eye(3), np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])]
ITEMS = [Item("rods u", "U0", np.eye(3)), Item("rods u", "U1", 2.0 * np.eye(3))]


def steps(folder):
    write_curves(folder / "a.step", CURVES, ["U0", "C0"])


def workbook(folder):
    write_tables(folder, [Table("cables", ("number", "length [m]"), ((1, 0.5), (2, 0.7)))])


def drawing(folder):
    write_dxf(folder / "a.dxf", Sheet("grid", [], 2.5))


def rhino(folder):
    write_rhino(folder / "a.3dm", ITEMS, {"rods u": "#000000"})


@pytest.mark.parametrize("write", [steps, workbook, drawing, rhino])
def test_a_file_written_again_another_second_has_the_same_bytes(tmp_path, write):
    found = []
    for name in ("first", "second"):
        (tmp_path / name).mkdir()
        write(tmp_path / name)
        found.append({file.name: file.read_bytes() for file in (tmp_path / name).iterdir()})
        time.sleep(1.0)
    assert found[0]
    assert found[0] == found[1]


def test_processes_that_order_sets_otherwise_write_the_same_bytes(tmp_path):
    found = []
    for seed in (1, 5, 7):  # of which the last two gave a drawing its classes in another order
        folder = tmp_path / str(seed)
        folder.mkdir()
        code = (
            "import sys\nfrom pathlib import Path\nfrom tests.output import test_same_bytes as files\n"
            "for write in (files.steps, files.workbook, files.drawing, files.rhino):\n"
            "    write(Path(sys.argv[1]))"
        )
        command = [sys.executable, "-c", code, str(folder)]
        subprocess.run(command, check=True, env={**os.environ, "PYTHONHASHSEED": str(seed)}, cwd=ROOT)
        found.append({file.name: file.read_bytes() for file in folder.iterdir()})
    assert len(found[0]) >= 4
    for name, content in found[0].items():
        assert found[1][name] == content, name
        assert found[2][name] == content, name


def test_a_rhino_file_tells_nothing_of_when_and_where_it_was_written_and_is_read_as_before(tmp_path):
    rhino(tmp_path)
    content = (tmp_path / "a.3dm").read_bytes()
    assert "a.3dm".encode("utf-16-le") not in content
    model = rhino3dm.File3dm.Read(str(tmp_path / "a.3dm"))
    assert [each.Attributes.Name for each in model.Objects] == ["U0", "U1"]
    assert model.Objects[1].Geometry.PointAtEnd.Z == 2.0
    assert (model.Created.year, model.LastEdited.year) == (1970, 1970)


@pytest.mark.parametrize("damage", [lambda c: c[:100], lambda c: c[:40] + b"\x7f" * 8 + c[48:]])
def test_bytes_that_are_no_rhino_file_s_are_refused(tmp_path, damage):
    rhino(tmp_path)
    with pytest.raises(ValueError, match="chunk"):
        without_date_and_path(damage((tmp_path / "a.3dm").read_bytes()))


def test_a_step_file_tells_nothing_of_when_it_was_written(tmp_path):
    steps(tmp_path)
    text = (tmp_path / "a.step").read_text(encoding="utf-8")
    assert re.findall(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d", text) == ["1970-01-01T00:00:00"]
