"""`design --sketch`: a first look that never holds, beside which full jobs stay what they are."""

import json
from pathlib import Path

import pytest

from shellform.case.case import load_case
from shellform.errors import InputError
from shellform.records.verdict import headline
from shellform.run.folder import read_run
from shellform.run.judged import judged, run_checks
from shellform.run.keys import stage_keys
from shellform.run.pages import write_report
from shellform.run.run import run_case
from shellform.run.sketch import PICTURE, refuse_over_full, sketched
from tests.command import shellform
from tests.run.small_run import begin, small_case

ROOT = Path(__file__).parent.parent.parent
SETTINGS = ("optimise.evaluations=3", "net.elements=3")


@pytest.fixture(scope="module")
def sketch(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sketch") / "run"
    return folder, run_case(small_case(ROOT, *SETTINGS), folder, sketch=True)


def test_a_sketch_is_coarse_and_has_one_picture_and_no_page(sketch):
    folder, summary = sketch
    assert [file.name for file in (folder / "figures").iterdir()] == ["sketch.png"]
    assert not (folder / "report.html").exists()
    assert list(summary.designs) == ["initial", "optimised"]
    case = load_case(folder / "case.toml")
    assert (case.net.elements, case.optimise.evaluations, case.optimise.polish) == (2, 3, 0)
    assert json.loads((folder / "summary.json").read_text(encoding="utf-8"))["sketch"] is True
    assert sketched(sketched(case)) == sketched(case)


def test_a_sketch_never_holds_whatever_the_case_asks_for(sketch, tmp_path):
    folder, summary = sketch
    assert not summary.verdict.holds
    assert "Full job" in summary.verdict.not_examined
    if not summary.verdict.failed:
        assert "is not examined" in headline(summary.verdict)
    run = read_run(folder)
    assert judged(run) == summary.verdict
    assert all(
        check.cells[name].holds is None
        for check in run_checks(run)
        for name in run.designs
        if check.name == "Full job"
    )
    page = write_report([folder], tmp_path / "page.html").read_text(encoding="utf-8")
    assert "a sketch: coarse elements, few evaluations, no structures drawn" in page


def test_a_sketch_s_designs_are_no_full_job_s_even_of_the_same_entries():
    case = sketched(small_case(ROOT, *SETTINGS))
    full, rough = stage_keys(case), stage_keys(case, sketch=True)
    assert [stage for stage in full if full[stage] == rough[stage]] == ["surface", "net"]


def test_made_again_a_sketch_is_kept_and_says_the_same(sketch):
    folder, summary = sketch
    told = []
    again = run_case(small_case(ROOT, *SETTINGS), folder, sketch=True, report=told.append)
    kept = [event.stage for event in told if event.kind.value == "kept"]
    assert kept == ["surface", "net", "initial", "optimise", "figures"]
    assert again.verdict == summary.verdict


def test_a_full_job_after_a_sketch_is_the_same_as_without_and_a_sketch_does_not_take_its_place(tmp_path):
    run_case(small_case(ROOT, *SETTINGS), tmp_path / "run", until="initial", sketch=True)
    made = tmp_path / "run" / PICTURE
    made.write_bytes(b"as the sketch's stage leaves it")
    begin(ROOT, tmp_path / "run", *SETTINGS)
    begin(ROOT, tmp_path / "plain", *SETTINGS)
    for name in ("net.npz", "designs/initial.npz", "case.toml", "stages.json"):
        assert (tmp_path / "run" / name).read_bytes() == (tmp_path / "plain" / name).read_bytes(), name
    assert not made.exists()
    assert "sketch" not in json.loads((tmp_path / "run/summary.json").read_text(encoding="utf-8"))
    before = (tmp_path / "run/stages.json").read_bytes()
    with pytest.raises(InputError, match="holds a full run, which a sketch would replace"):
        run_case(small_case(ROOT, *SETTINGS), tmp_path / "run", sketch=True)
    assert (tmp_path / "run/stages.json").read_bytes() == before


def test_a_damaged_sketch_is_made_anew_where_that_is_asked_for(tmp_path):
    (tmp_path / "summary.json").write_text('{"format": "shellform run"', encoding="utf-8")
    with pytest.raises(InputError):
        refuse_over_full(tmp_path, fresh=False)
    refuse_over_full(tmp_path, fresh=True)


def test_the_command_names_the_picture(sketch):
    folder, _ = sketch
    settings = [
        word
        for each in ("net.spacing=0.11", "surface.size=0.03", "load.force=2.0", *SETTINGS)
        for word in ("--set", each)
    ]
    told = shellform("design", ROOT / "scripts/scale_model.toml", "--output", folder, "--sketch", *settings)
    assert f"look at {folder / PICTURE} first" in told.stdout
    assert "not examined: Full job" in told.stdout
