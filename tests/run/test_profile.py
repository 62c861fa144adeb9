"""`design --profile`: what stages take, told beside results that stay as they are."""

import json
from pathlib import Path

import pytest

from shellform.errors import Damaged
from shellform.records.profile import Profile, read_profile
from shellform.records.stages import read_stages
from shellform.run.pages import write_report
from shellform.run.run import run_case
from tests.run.small_run import small_case

ROOT = Path(__file__).parent.parent.parent
SAME = ("surface.npz", "net.npz", "net.json", "case.toml", "stages.json", "designs/initial.npz")


@pytest.fixture(scope="module")
def both(begun, tmp_path_factory):
    place = tmp_path_factory.mktemp("both")
    run_case(small_case(ROOT), place / "profiled", until="initial", profile=True)
    return begun, place / "profiled"


def test_results_are_the_same_bytes_with_a_profile_and_without(both):
    plain, profiled = both
    for name in SAME:
        assert (plain / name).read_bytes() == (profiled / name).read_bytes(), name
    assert not (plain / "profile.json").exists()


def test_kinds_of_work_add_up_to_each_stage_s_processor_time(both):
    found = read_profile(both[1])
    assert list(found.stages) == ["surface", "net", "initial"]
    assert found.cores >= 1
    for stage in found.stages.values():
        spent = sum(each.processor for each in stage.work.values())
        assert spent == pytest.approx(stage.processor, rel=0.02, abs=0.02)
        assert stage.waiting == max(stage.clock - stage.processor, 0.0)
        assert stage.memory_peak is None or 10e6 < stage.memory_peak < 10e9
    assert {"element loops", "factorisations", "back-substitutions", "other"} <= set(
        found.stages["initial"].work
    )


def test_the_page_tells_what_was_measured_and_only_of_the_results_that_are_there(both, tmp_path):
    plain, profiled = both
    words = "Time and memory by kind of work"
    assert words not in write_report([plain], tmp_path / "plain.html").read_text(encoding="utf-8")
    assert words in write_report([profiled], tmp_path / "page.html").read_text(encoding="utf-8")
    other = small_case(ROOT, "cable.stiffness=200.0")
    run_case(other, profiled, until="initial")  # without a profile: the initial design's is an earlier one
    shown = read_profile(profiled).of(read_stages(profiled))
    assert list(shown.stages) == ["surface", "net"]
    run_case(other, profiled, until="initial", profile=True)
    shown = read_profile(profiled).of(read_stages(profiled))
    assert list(shown.stages) == ["surface", "net"], "kept stages are not measured"
    run_case(small_case(ROOT), profiled, until="initial", profile=True)
    assert list(read_profile(profiled).of(read_stages(profiled)).stages) == ["surface", "net", "initial"]


def test_a_profile_that_is_damaged_or_of_another_kind_is_refused_by_name(tmp_path):
    assert read_profile(tmp_path) == Profile()
    file = tmp_path / "profile.json"
    file.write_text("{", encoding="utf-8")
    with pytest.raises(Damaged, match=r"profile\.json"):
        read_profile(tmp_path)
    file.write_text(json.dumps({"format": "mine", "version": 1, "cores": 1, "stages": {}}), encoding="utf-8")
    with pytest.raises(Damaged, match="no profile of this version"):
        read_profile(tmp_path)
