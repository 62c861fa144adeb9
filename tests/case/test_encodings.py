"""Files as editors save them: UTF-8 with the mark with which some begin it, and what is no UTF-8."""

import json
import shlex
import shutil

import pytest

from shellform.case.case import load_case, read_toml
from shellform.errors import InputError
from shellform.gridshell.catalogue import read_catalogue
from shellform.run.pages import write_report
from shellform.structure.answers.results import read_sections
from shellform.structure.model import parse_model, read_model, write_model
from shellform.surface.readers.reading import read_surface
from tests.cli.test_commands import MODEL
from tests.command import ROOT
from tests.surface.shells import cap, compas_mesh, split, write_gltf

CASE = ROOT / "scripts/vault.toml"
RODS = ROOT / "shellform/catalogues/gfrp_rods.toml"
MARK = b"\xef\xbb\xbf"


def marked(file, content):
    file.write_bytes(MARK + content)
    return file


def test_a_case_a_catalogue_and_sections_are_read_that_begin_with_the_mark_of_utf_8(tmp_path):
    assert read_toml(marked(tmp_path / "a.toml", CASE.read_bytes())) == read_toml(CASE)
    assert load_case(tmp_path / "a.toml", [f"surface.file={ROOT}/surfaces/vault.py"]).title
    assert read_catalogue(marked(tmp_path / "rods.toml", RODS.read_bytes())).sections
    rod = b'[rod]\nshape = "round"\nradius = 0.01\nyoung = 4e10\npoisson = 0.3\n'
    assert list(read_sections(marked(tmp_path / "sections.toml", rod))) == ["rod"]


def test_a_model_is_read_that_begins_with_the_mark_of_utf_8(tmp_path):
    write_model(tmp_path / "model.json", parse_model(MODEL))
    file = marked(tmp_path / "marked.json", (tmp_path / "model.json").read_bytes())
    assert list(read_model(file).loads) == list(MODEL["loads"])


def test_surfaces_in_json_are_read_that_begin_with_the_mark_of_utf_8(tmp_path):
    points, quads = cap()
    mesh = json.dumps(compas_mesh(points, quads)).encode()
    scene = write_gltf(tmp_path / "a.gltf", points, split(quads))
    for file in (marked(tmp_path / "a.json", mesh), marked(scene, scene.read_bytes())):
        assert read_surface(file, unit="m").area > 0.0


def test_a_run_s_page_is_made_where_an_editor_has_put_the_mark_before_its_case(begun, tmp_path):
    run = shutil.copytree(begun, tmp_path / "run")
    marked(run / "case.toml", (run / "case.toml").read_bytes())
    other = shutil.copytree(begun, tmp_path / "other")
    assert write_report([run, other], tmp_path / "page.html").is_file()


@pytest.mark.parametrize("content", ["# Schüssel\n".encode("latin-1"), "[net]\n".encode("utf-16")])
def test_what_is_no_utf_8_is_told_with_its_line(tmp_path, content):
    for read, name, remedy in (
        (load_case, "a.toml", "Name a TOML file, and save it as UTF-8"),
        (read_catalogue, "rods.toml", "Save it as UTF-8"),
        (read_sections, "sections.toml", "TOML in UTF-8"),
    ):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(
            InputError, match=rf"{name}: isn't text in UTF-8 \(byte 0xf. in line 1\)\. .*{remedy}"
        ):
            read(tmp_path / name)


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("shell.stl", "a surface file"),
        ("my shell.OBJ", "a surface file"),
        ("shell.py", "a surface file"),
        ("session.json", "JSON"),
    ],
)
def test_a_surface_in_place_of_a_case_is_told_how_to_make_one(tmp_path, name, kind):
    for content in (b"o shell\nv 0 0 0\n", b"\x83\x00\xff"):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(InputError, match=f"is {kind}, no TOML") as refused:
            load_case(tmp_path / name)
        told = shlex.split(refused.value.remedy.partition(": ")[2].removesuffix("."))
        made = name.partition(".")[0] + ".toml"
        assert told == ["shellform", "new", str(tmp_path / name), "--output", made]


def test_the_folder_of_a_run_in_place_of_a_case_is_told_where_its_case_lies(tmp_path):
    with pytest.raises(InputError, match=r"can't be read: Is a directory\. Name a file"):
        load_case(tmp_path)
    (tmp_path / "case.toml").write_text("")
    with pytest.raises(InputError, match=r"lies in its folder: .*case\.toml"):
        load_case(tmp_path)
