"""What the command line prints, and what it completes."""

import json
import os
import subprocess
import sys

import pytest

from tests.command import ROOT, shellform, shellform_process
from tests.stubs import CASE, study_file


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    place = tmp_path_factory.mktemp("quiet")
    (place / "dome.toml").write_text(CASE, encoding="utf-8")
    return place, shellform_process(
        "design", place / "dome.toml", "--output", place / "run", "--until", "net", "--quiet"
    )


def test_quiet_prints_nothing_and_the_log_has_it(made):
    place, result = made
    assert (result.returncode, result.stdout, result.stderr) == (0, "", "")
    assert " net: done in " in (place / "run/log.txt").read_text(encoding="utf-8")


def test_json_prints_the_summary_and_nothing_else(made):
    place, _ = made
    result = shellform("design", place / "dome.toml", "--output", place / "run", "--until", "net", "--json")
    assert json.loads(result.stdout) == json.loads((place / "run/summary.json").read_text(encoding="utf-8"))
    assert "net: kept" in result.stderr


def test_check_tells_numbers_in_json_that_its_lines_tell_in_words(made):
    place, _ = made
    found = json.loads(shellform("check", place / "dome.toml", "--json").stdout)
    lines = shellform("check", place / "dome.toml").stdout
    x, y, z = found["size"]
    assert f"{x:.4g} × {y:.4g} × {z:.4g} m" in lines
    assert f"about {found['expected']['crossings']} at {found['expected']['spacing']:g} m" in lines
    assert f"about {found['rod_radius_max']:.3g} m" in lines


def test_a_net_alone_is_told_in_json_or_not_at_all(tmp_path):
    surface = ROOT / "surfaces/dome.py"
    net = ("net", surface, "--spacing", "0.15", "--angle", "45", "--output")
    told = shellform(*net, tmp_path / "told", "--json")
    assert json.loads(told.stdout) == json.loads((tmp_path / "told/summary.json").read_text(encoding="utf-8"))
    quiet = shellform(*net, tmp_path / "quiet", "--quiet")
    assert (quiet.returncode, quiet.stdout, quiet.stderr) == (0, "", "")


def test_a_study_is_told_in_json_or_not_at_all(tmp_path):
    file = study_file(
        tmp_path,
        'until = "net"\n[vary]\nnet.angle = [0.0, 45.0]\n[column]\ncrossings = "net.crossings"\n'
        'none = "net.none"\n',
    )
    arguments = ("study", file, "--output", tmp_path / "out", "--workers", "1")
    quiet = shellform(*arguments, "--quiet")
    assert (quiet.returncode, quiet.stdout, quiet.stderr) == (0, "", "")
    found = json.loads(shellform(*arguments, "--json").stdout)
    assert (found["designs"], found["found"], found["failed"], found["empty"]) == (2, 2, 0, ["none"])
    assert found["table"] == str(tmp_path / "out/table.parquet")


def test_new_writes_a_case_that_check_reads(tmp_path):
    file = tmp_path / "dome.toml"
    result = shellform("new", ROOT / "surfaces/dome_mm.step", "--output", file)
    assert result.returncode == 0, result.stderr
    assert "equation 1 allows" in result.stdout
    assert shellform("check", file).returncode == 0
    again = shellform("new", ROOT / "surfaces/dome_mm.step", "--output", file)
    assert again.returncode == 2
    assert "is not overwritten" in again.stderr


def test_the_shell_completes_commands():
    wanted = {
        **os.environ,
        "_SHELLFORM_COMPLETE": "complete_bash",
        "COMP_WORDS": "shellform des",
        "COMP_CWORD": "1",
    }
    code = "import sys; sys.argv[0] = 'shellform'; from shellform.cli.program import main; main()"
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env=wanted, cwd=ROOT, timeout=60
    )
    assert result.stdout.strip() == "design"
