"""A run of a case whose sizes can't be meant."""

from dataclasses import replace
from pathlib import Path

import pytest

from shellform.case.case import load_case
from shellform.errors import InputError
from shellform.records.progress import Kind
from shellform.records.stages import read_stages
from shellform.run.first_design import standing_design
from shellform.run.first_look import check_file
from shellform.run.first_net import Allowance
from shellform.run.run import run_case
from shellform.run.sizes import DesignWish

ROOT = Path(__file__).parent.parent.parent
DOME = ROOT / "scripts/dome.toml"
VAULT = f'surface={{file = "{ROOT}/surfaces/vault.ply"}}'


def test_nothing_is_written_and_nothing_found_is_lost_where_a_size_cannot_be_meant(tmp_path):
    wrong = load_case(DOME, [VAULT, "optimise.deviation=5.5"])
    with pytest.raises(InputError, match=r"optimise.deviation: .* For 5.5 mm write 0.0055\."):
        run_case(wrong, tmp_path / "new")
    assert not (tmp_path / "new").exists()
    run_case(load_case(DOME, [VAULT]), tmp_path / "run", until="net")
    kept, files = read_stages(tmp_path / "run"), {each.name for each in (tmp_path / "run").iterdir()}
    with pytest.raises(InputError, match=r"optimise.deviation: "):
        run_case(wrong, tmp_path / "run", until="net")
    assert read_stages(tmp_path / "run") == kept
    assert {each.name for each in (tmp_path / "run").iterdir()} == files


def test_what_is_doubtful_is_told_as_a_run_begins(tmp_path):
    heard = []
    case = load_case(DOME, [VAULT, "part.concrete.density=25000"])
    for _ in range(2):  # computed, then kept
        heard.clear()
        run_case(case, tmp_path, until="surface", report=heard.append)
        (told,) = [each.text for each in heard if each.kind is Kind.NOTE and "density" in each.text]
        assert told.endswith("Is the unit right? For 25000 N/m³ write 2548.42.")


def test_check_refuses_a_case_whose_sizes_cannot_be_on_its_surface(tmp_path):
    case = tmp_path / "case.toml"
    text = DOME.read_text().replace("../surfaces/dome_mm.step", f"{ROOT}/surfaces/vault.ply")
    case.write_text(text.replace("deviation = 0.0055", "deviation = 5.5"))
    with pytest.raises(InputError, match=r"For 5.5 mm write 0.0055\."):
        check_file(case, {}, allow_scripts=False)


def test_new_refuses_concrete_of_which_the_shell_would_be_a_block(vault):
    with pytest.raises(InputError, match=r"--thickness: makes a block .* For 0.5 cm write 0.005\."):
        standing_design(vault, replace(DesignWish(), thickness=0.5), print, Allowance())
