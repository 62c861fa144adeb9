"""Runs made again with other wishes, wishes for fewer or equal cables, and stages that fail: on a small dome,
in seconds.
"""

import csv
import json
import os
import subprocess
import sys
from contextlib import nullcontext
from pathlib import Path

import pytest

from shellform.case.case import load_case
from shellform.errors import InputError, NotConverged
from shellform.records.optimisation import CableCountRecord, SymmetryRecord
from shellform.records.stages import STAGES
from shellform.run import checkpoint, optimising
from shellform.run.folder import read_run
from shellform.run.run import run_case
from tests.stubs import CASE

ROOT = Path(__file__).parent.parent.parent
ALONE = ["cable.without=false", "optimise.unloaded=false"]  # without designs to compare with
PLAIN = ["safety.required=false", *ALONE]


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    place = tmp_path_factory.mktemp("again") / "dome.toml"
    place.write_text(f"{CASE}[safety]\ndrawn = 4\ncompared = 2\n", encoding="utf-8")
    return place


def listed(folder):
    return json.loads((folder / "stages.json").read_text(encoding="utf-8"))


@pytest.fixture
def undrawn(monkeypatch):
    """Runs make no pictures."""
    from shellform.run import run

    monkeypatch.setattr(run, "maps_beside", lambda folder: nullcontext(lambda: None))
    monkeypatch.setattr(run, "_figures", nothing_made)


def nothing_made(workspace, parts, summary, keep):
    """In place of a stage."""
    from shellform.run import run

    return run._Ended(parts, summary)


def test_a_design_that_is_not_asked_for_again_is_gone_with_all_its_pictures(file, tmp_path):
    run_case(load_case(file, [*PLAIN, "optimise.polish=2"]), tmp_path, until="optimise")
    assert read_run(tmp_path).best == "polished"
    for name in (
        "mode-polished-design.png",
        "polished-design-top.svg",
        "pour-polished-design.gif",
        "initial-design.png",
    ):
        (tmp_path / "figures" / name).write_bytes(b"drawn")
    run_case(load_case(file, PLAIN), tmp_path, until="optimise")
    assert read_run(tmp_path).best == "optimised"
    assert not list(tmp_path.rglob("*polished*"))
    assert (tmp_path / "figures/initial-design.png").is_file()


def test_a_net_that_is_kept_is_told_with_the_rods_of_the_case_as_it_is(file, tmp_path):
    """Its joint is given, so that nothing of the net depends on the rods."""
    weak = "rod.strength=100e6"
    run_case(load_case(file), tmp_path / "again", until="net")
    before = (tmp_path / "again/net.npz").stat().st_mtime_ns
    told = run_case(load_case(file, [weak]), tmp_path / "again", until="net").net
    assert (tmp_path / "again/net.npz").stat().st_mtime_ns == before
    alone = run_case(load_case(file, [weak]), tmp_path / "alone", until="net").net
    for name in ("rod_radius_max", "curvature_limit", "curvature_utilisation"):
        assert getattr(told, name) == getattr(alone, name) != 0.0
    assert (
        json.loads((tmp_path / "again/summary.json").read_text(encoding="utf-8"))["net"]
        == json.loads((tmp_path / "alone/summary.json").read_text(encoding="utf-8"))["net"]
    )


def test_wishes_for_cables_are_kept_and_told_in_summary_schedule_and_page(file, tmp_path, undrawn):
    most = 50
    wishes = [*ALONE, f"optimise.cables_max={most}", "optimise.symmetric=true", "optimise.polish=2"]
    case = load_case(file, [*wishes, "cable.adjustment=0.004"])
    summary = run_case(case, tmp_path, until="optimise")
    found = summary.optimisation
    cables = summary.designs["polished"].cables
    assert found.cables_max == CableCountRecord(most, cables, cables <= most)
    run = read_run(tmp_path)
    lengths = run.designs["polished"].rest_length[run.designs["polished"].present]
    assert found.symmetric == SymmetryRecord(len(set(lengths.round(9))), True)
    told = run_case(case, tmp_path, until="documents").documents
    assert told.rest_lengths == found.symmetric.groups
    with (tmp_path / "schedules/cables.csv").open(encoding="utf-8") as text:
        rows = list(csv.DictReader(text))
    cut = [float(row["cut length [mm]"]) for row in rows]
    assert told.cut_lengths == len(set(cut)) < told.rest_lengths
    assert all(
        0.0 <= float(row["rest length [mm]"]) - each <= 4.0 + 1e-3
        for row, each in zip(rows, cut, strict=True)
    )
    from shellform.run.pages import write_report

    page = write_report([tmp_path]).read_text(encoding="utf-8")
    assert "Symmetric cables have one length" in page
    assert f"cut to {told.cut_lengths} different lengths" in page
    before = listed(tmp_path)
    run_case(load_case(file, wishes), tmp_path, until="initial")
    assert listed(tmp_path)["optimise"] == before["optimise"], "no design depends on the turnbuckles' range"


def test_a_number_of_cables_that_cannot_be_reached_is_said(file, tmp_path):
    lines = []
    case = load_case(file, [*PLAIN, "optimise.cables_max=1"])
    summary = run_case(case, tmp_path, until="optimise", report=lambda event: lines.append(event.text))
    found = summary.optimisation.cables_max
    assert found.kept is False
    assert (
        f"{found.cables} cables are left, not 1: no design with fewer was found that keeps every limit"
        in lines
    )


def test_lengths_that_cannot_be_made_equal_leave_the_design_before_them(file, tmp_path, monkeypatch):
    from shellform.optimiser import optimise

    def refused(*_, **__):
        raise NotConverged("the load isn't borne")

    monkeypatch.setattr(optimise, "polish", refused)
    case = load_case(file, ["optimise.symmetric=true", "optimise.polish=2"])
    summary = run_case(case, tmp_path, until="optimise")
    assert summary.optimisation.not_polished == "the load isn't borne"
    assert summary.optimisation.symmetric.kept is False
    assert read_run(tmp_path).best == "optimised"


@pytest.mark.parametrize("stage", ["figures", "documents"])
def test_a_stage_that_fails_leaves_the_others_to_be_made_and_is_made_by_the_next_run(
    file, tmp_path, monkeypatch, undrawn, stage
):
    from shellform.run import run

    def failing(*_):
        raise InputError("is full", where=stage)

    monkeypatch.setattr(optimising, "optimise", lambda workspace, shell, loads, summary, initial: summary)
    if stage == "figures":
        monkeypatch.setattr(run, "_documents", nothing_made)
    with monkeypatch.context() as broken:
        broken.setattr(run, f"_{stage}", failing)
        with pytest.raises(InputError, match="is full"):
            run_case(load_case(file, ALONE), tmp_path)
    assert set(listed(tmp_path)) == set(STAGES) - {stage}
    assert read_run(tmp_path).summary.failed == {stage: f"{stage}: is full"}
    assert f"The stage “{stage}” failed" in (tmp_path / "report.html").read_text(encoding="utf-8")
    run_case(load_case(file, ALONE), tmp_path)
    assert set(listed(tmp_path)) == set(STAGES)
    assert not read_run(tmp_path).summary.failed


def test_an_optimisation_broken_off_goes_on_from_its_checkpoint_to_the_same_bytes(file, tmp_path):
    case = load_case(file, ["cable.without=false", "optimise.evaluations=8"])
    whole = run_case(case, tmp_path / "whole", until="optimise")
    assert not (tmp_path / "whole" / checkpoint.FILE).exists()

    def stop(event):
        if event.text.startswith("evaluation 4/"):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_case(case, tmp_path / "broken", until="optimise", report=stop)
    assert (tmp_path / "broken" / checkpoint.FILE).is_file()
    lines = []
    again = run_case(
        case, tmp_path / "broken", until="optimise", report=lambda event: lines.append(event.text)
    )
    assert any(line.startswith("going on after evaluation") for line in lines)
    assert again.optimisation == whole.optimisation
    for name in ("optimised.json", "unloaded.json"):
        assert (tmp_path / "broken/designs" / name).read_bytes() == (
            tmp_path / "whole/designs" / name
        ).read_bytes()


def test_a_fresh_run_takes_no_checkpoint_up(file, tmp_path):
    case = load_case(file, [*PLAIN, "optimise.evaluations=8"])

    def stop(event):
        if event.text.startswith("evaluation 4/"):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_case(case, tmp_path, until="optimise", report=stop)
    lines = []
    run_case(case, tmp_path, until="optimise", fresh=True, report=lambda event: lines.append(event.text))
    assert not any(line.startswith("going on") for line in lines)


def test_the_log_tells_every_step_and_how_a_stage_ended(file, tmp_path):
    with pytest.raises(NotConverged):
        run_case(load_case(file, ["load.force=100"]), tmp_path, until="initial")
    told = (tmp_path / "log.txt").read_text(encoding="utf-8")
    assert " run: shellform " in told
    assert " surface: done in " in told
    assert " initial: ended: The initial design " in told


def test_a_design_has_the_same_bytes_on_one_core_and_on_two(tmp_path):
    """Sums over many numbers in dense algebra come out otherwise on another number of threads."""
    few = [
        "surface.size=0.02",
        "net.spacing=0.08",
        "net.elements=2",
        "load.force=4.0",
        "optimise.evaluations=3",
        "optimise.polish=0",
        "optimise.unloaded=false",
        "cable.without=false",
        "safety.drawn=2",
        "safety.compared=2",
    ]
    made = []
    for threads in ("1", "2"):
        folder = tmp_path / threads
        command = [
            sys.executable, "-m", "shellform", "design", str(ROOT / "scripts/scale_model_radius.toml"),
            "--output", str(folder), "--until", "optimise", "--quiet", *(f"--set={each}" for each in few),
        ]  # fmt: skip
        subprocess.run(command, check=True, env={**os.environ, "OMP_NUM_THREADS": threads})
        made.append([(folder / name).read_bytes() for name in ("net.json", "designs/optimised.json")])
    assert made[0][0] == made[1][0], "the net"
    assert made[0][1] == made[1][1], "the optimised design"
