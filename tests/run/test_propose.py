"""`shellform new`."""

from pathlib import Path

import pytest

from shellform.case.case import load_case
from shellform.errors import InputError
from shellform.run.propose import propose_case

DOME = Path(__file__).parent.parent / "data" / "dome_mm.step"


def test_a_proposed_case_loads_and_its_rods_keep_equation_1(tmp_path):
    propose_case(DOME, tmp_path / "dome.toml", {"fill": "all"}, allow_scripts=False)
    case = load_case(tmp_path / "dome.toml")
    assert Path(case.surface.file).resolve() == DOME.resolve()
    assert case.surface.fill == "all"
    assert "equation (1) allows" in (tmp_path / "dome.toml").read_text(encoding="utf-8")
    assert case.joint.gap == 2 * case.rod.radius


def test_a_case_is_not_overwritten_nor_written_under_another_name_or_to_nowhere(tmp_path):
    (tmp_path / "mine.toml").write_text("mine")
    with pytest.raises(InputError, match="not overwritten"):
        propose_case(DOME, tmp_path / "mine.toml", {}, allow_scripts=False)
    with pytest.raises(InputError, match=r"must end in \.toml"):
        propose_case(DOME, tmp_path / "mine.txt", {}, allow_scripts=False)
    with pytest.raises(InputError, match="no such folder"):
        propose_case(DOME, tmp_path / "no" / "mine.toml", {}, allow_scripts=False)
    assert (tmp_path / "mine.toml").read_text() == "mine"


def test_a_proposed_case_loads_the_area_and_tells_what_its_edges_stand_on(tmp_path):
    told = propose_case(DOME, tmp_path / "dome.toml", {}, allow_scripts=False)
    case = load_case(tmp_path / "dome.toml")
    assert case.part["concrete"].thickness == 0.05
    assert {each.name for each in case.load} == {"design", "additional"}
    assert "on the ground" in told["edges"]
    assert told["edges"] in (tmp_path / "dome.toml").read_text(encoding="utf-8")
