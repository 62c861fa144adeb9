"""The case file: defaults, round trip, and every message."""

from pathlib import Path

import pytest

from shellform.case.build_gridshell import has_edge_cells, rounding_catalogue
from shellform.case.build_rod import given_section
from shellform.case.build_safety import critical_factors_asked
from shellform.case.case import check_script, dump_case, load_case, shipped_surfaces
from shellform.errors import InputError
from shellform.gridshell.catalogue import label

ROOT = Path(__file__).parent.parent.parent
GOOD = (ROOT / "scripts/scale_model.toml").read_text(encoding="utf-8")


def write(tmp_path, text):
    file = tmp_path / "case.toml"
    file.write_text(text, encoding="utf-8")
    return file


@pytest.mark.parametrize(
    "name", ["scale_model", "scale_model_radius", "scale_model_rounded", "full_size", "full_size_poured"]
)
def test_shipped_cases_are_valid_and_survive_being_written(tmp_path, name):
    case = load_case(ROOT / f"scripts/{name}.toml")
    again = load_case(write(tmp_path, dump_case(case)))
    assert again == case
    assert Path(case.surface.file).is_file()


def test_rods_in_two_layers_are_laths_of_a_catalogue_twice(tmp_path):
    stock = 'catalogue = "timber_laths"\nsection = "15 x 5 mm"\nlayers = 2\ncomposite = 0.7'
    own = GOOD.split("[rod]")[1].split("[", 1)[0]
    case = load_case(write(tmp_path, GOOD.replace(own, f"\n{stock}\n\n")))
    section = given_section(case.rod)
    assert label(section) == "2 layers of 15 × 5 mm"
    assert section.composite == 0.7
    assert {label(each) for each in rounding_catalogue(case).sections} > {"2 layers of 50 × 35 mm"}
    assert load_case(write(tmp_path, dump_case(case))) == case


def test_a_critical_factor_that_is_not_asked_for_stays_unasked_in_the_run_folder(tmp_path):
    case = load_case(ROOT / "scripts/scale_model.toml", ["safety.critical_factor=0"])
    again = load_case(write(tmp_path, dump_case(case)))
    assert again == case
    assert critical_factors_asked(again) == {}
    with pytest.raises(InputError, match=r"critical_factor must be 0 .* or at least 1"):
        load_case(ROOT / "scripts/scale_model.toml", ["safety.critical_factor=0.5"])


def test_settings_take_the_place_of_entries():
    case = load_case(
        ROOT / "scripts/scale_model.toml", ["net.spacing=0.06", "title=other", "rod.radius=0.0012"]
    )
    assert (case.net.spacing, case.title, case.rod.radius) == (0.06, "other", 0.0012)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("spacing = 0.055", "spacin = 0.055", "Did you mean 'net.spacing'"),
        ("[cable]", "[cabel]", "Did you mean 'cable'"),
        (
            "stiffness = 187.0",
            "stiffness = -187.0",
            r"cable.stiffness.*greater than 0.*-187.*Give cable.stiffness \(EA",
        ),
        ("stiffness = 187.0", "stiffness = nan", "cable.stiffness.*finite"),
        ("young = 40e9", "", r"rod.young is missing.*Add rod.young \(Young's modulus, Pa\)"),
        ("misfit = 0.5", "misfit = 0.8", "add up to 1"),
        ("gap = 0.002", "gap = 0.0275", "well below net.spacing"),
        ("spacing = 0.055", 'spacing = "wide"', "net.spacing.*'wide'"),
        ("[net]", "[net", "isn't valid TOML.*line"),
        ("additional = 1.2", "additional = 0.5", "load.additional"),
        ("young = 40e9", "young = 40e9\nkerf = 3", "rod.kerf: .* For 3 mm write 0.003"),
        (
            "young = 40e9",
            "young = 40e9\nstock_length = 6000",
            "rod.stock_length: .* For 6000 mm write 6",
        ),
    ],
)
def test_wrong_entries_are_named_with_a_remedy(tmp_path, old, new, said):
    assert old in GOOD
    with pytest.raises(InputError, match=said):
        load_case(write(tmp_path, GOOD.replace(old, new, 1)))


def test_a_study_given_for_a_case_is_said_to_be_one():
    with pytest.raises(InputError, match=r"is a study of the case scale_model\.toml.*shellform study"):
        load_case(ROOT / "scripts/study_weights.toml")


def test_missing_files_and_malformed_settings_are_refused(tmp_path):
    with pytest.raises(InputError, match="can't be read"):
        load_case(tmp_path / "none.toml")
    with pytest.raises(InputError, match="KEY=VALUE"):
        load_case(ROOT / "scripts/scale_model.toml", ["net.spacing"])
    with pytest.raises(InputError, match=r"--set net\.spacing: its value is nested too deeply"):
        load_case(ROOT / "scripts/scale_model.toml", [f"net.spacing={3000 * '['}"])
    with pytest.raises(InputError, match=r"--set: has letters that are no UTF-8.*udcff"):
        load_case(ROOT / "scripts/scale_model.toml", ["title=a\udcff"])
    with pytest.raises(InputError, match=r"net\.spacing"):
        load_case(ROOT / "scripts/scale_model.toml", [f"net.spacing={5000 * '9'}"])


def test_scripts_from_elsewhere_are_not_run_unasked(tmp_path):
    mine = tmp_path / "shell.py"
    mine.write_text("raise SystemExit", encoding="utf-8")
    with pytest.raises(InputError, match="--allow-scripts"):
        check_script(mine, allow_scripts=False)
    check_script(mine, allow_scripts=True)
    check_script(shipped_surfaces() / "vault.py", allow_scripts=False)
    with pytest.raises(InputError, match="--allow-scripts"):
        check_script(shipped_surfaces() / ".." / "tests" / "conftest.py", allow_scripts=False)


@pytest.mark.parametrize(
    ("settings", "there"),
    [
        ([], False),
        (["optimise.method=paper"], True),
        (["cable.edge_cells=true"], True),
        (["optimise.method=paper", "cable.edge_cells=false"], False),
    ],
)
def test_cells_at_the_edge_have_candidates_by_the_paper_s_method_and_where_they_are_asked_for(
    settings, there
):
    assert has_edge_cells(load_case(ROOT / "scripts/scale_model.toml", settings)) is there
