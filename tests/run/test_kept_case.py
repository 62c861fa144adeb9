"""The run folder's case.toml and the case's own catalogues beside it."""

from pathlib import Path

import pytest

from shellform.case.case import load_case, make_case
from shellform.errors import InputError
from shellform.gridshell.catalogue import read_catalogue
from shellform.run.folder import read_run
from shellform.run.kept_case import write_case
from shellform.run.keys import stage_keys
from shellform.run.run import run_case
from tests.command import ROOT
from tests.run.small_run import small_case
from tests.stubs import CASE

MINE = "[material]\nyoung = 40e9\nshear = 4e9\ndensity = 1900\nstrength = 255e6\n[sizes]\nround = [0.002, 0.003]\n"


def own(tmp_path):
    """The small case's tables with rods, edge beams and rounding from three files, two of one name."""
    data = small_case(ROOT).model_dump(mode="json", exclude_none=True)
    for place in (tmp_path, tmp_path / "elsewhere"):
        place.mkdir(exist_ok=True)
        (place / "mine.toml").write_text(f"title = '{place.name}'\n{MINE}", encoding="utf-8")
    data["rod"] = {"catalogue": "mine.toml", "section": "2 mm"}
    data["edges"]["beam"] = {"catalogue": "elsewhere/mine.toml", "section": "3 mm"}
    return data


def test_a_run_is_read_with_its_own_rods_wherever_their_catalogue_has_gone(tmp_path):
    case = make_case(own(tmp_path), tmp_path / "case.toml")
    run_case(case, tmp_path / "run", until="initial")
    for file in (tmp_path / "mine.toml", tmp_path / "elsewhere/mine.toml"):
        file.write_text(MINE.replace("40e9", "10e9"), encoding="utf-8")
    assert read_run(tmp_path / "run").shell.rod.young == 40e9
    for file in (tmp_path / "mine.toml", tmp_path / "elsewhere/mine.toml"):
        file.unlink()
    moved = (tmp_path / "run").rename(tmp_path / "moved")
    assert read_run(moved).shell.rod.young == 40e9


def test_catalogues_of_one_name_are_kept_apart_and_make_the_same_run(tmp_path):
    case = make_case(own(tmp_path), tmp_path / "case.toml")
    (tmp_path / "kept").mkdir()
    write_case(tmp_path / "kept", case)
    kept = load_case(tmp_path / "kept/case.toml")
    assert [read_catalogue(each.catalogue).title for each in (kept.rod, kept.edges.beam)] == [
        tmp_path.name,
        "elsewhere",
    ]
    assert {Path(each.catalogue).parent for each in (kept.rod, kept.edges.beam)} == {
        (tmp_path / "kept/catalogues").resolve()
    }
    assert kept.edges.beam.section == case.edges.beam.section
    before = stage_keys(case)
    assert [stage for stage, key in stage_keys(kept).items() if key == before[stage]][:2] == [
        "surface",
        "net",
    ]
    write_case(tmp_path / "kept", kept)
    assert stage_keys(load_case(tmp_path / "kept/case.toml")) == stage_keys(kept)


def test_shipped_catalogues_are_named_and_not_copied(tmp_path):
    case = tmp_path / "case.toml"
    before, _, after = CASE.partition("[rod]")
    joint = after[after.index("[joint]") :]
    case.write_text(f'{before}[rod]\ncatalogue = "gfrp_rods"\nsection = "8 mm"\n{joint}', encoding="utf-8")
    (tmp_path / "kept").mkdir()
    write_case(tmp_path / "kept", load_case(case))
    assert load_case(tmp_path / "kept/case.toml").rod.catalogue == "gfrp_rods"
    assert not (tmp_path / "kept/catalogues").exists()


def test_a_catalogue_that_has_gone_since_the_case_was_read_is_named(tmp_path):
    case = make_case(own(tmp_path), tmp_path / "case.toml")
    (tmp_path / "mine.toml").unlink()
    with pytest.raises(InputError, match=r"mine\.toml.*Put it back"):
        write_case(tmp_path, case)
