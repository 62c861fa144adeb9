"""summary.json, stages.json and history.csv: what is written is read back; what is damaged is refused by its
key.
"""

import json
from dataclasses import MISSING, fields, is_dataclass, replace
from types import NoneType
from typing import get_args, get_type_hints

import numpy as np
import pytest

from shellform.errors import Damaged, InputError
from shellform.optimiser.optimum import Step, by_constraint
from shellform.output.page.report import _charts
from shellform.records.drawn import Drawn
from shellform.records.failures import RareRecord
from shellform.records.history import read_history, write_history
from shellform.records.profile import Profile, StageProfile, read_profile, write_profile
from shellform.records.raising import WayUpRecord
from shellform.records.scattering import SampleRecord
from shellform.records.stages import StagesDone, read_stages, write_stages
from shellform.records.summary import (
    StandingRecord,
    Summary,
    VerdictRecord,
    document,
    read_summary,
    write_summary,
)
from tests.records.made import design, load, summary

NAMES = ("initial", "optimised")


def changed(folder, change):
    """The summary in the folder with a change made to what JSON says."""
    found = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    change(found)
    (folder / "summary.json").write_text(json.dumps(found), encoding="utf-8")


def test_a_summary_is_read_back_as_it_was_written(tmp_path):
    stands = StandingRecord(200, 199, 0.972, 0.95, 0)
    row = load("design", critical_sought=3.0, critical_factor=1.4, critical_factor_error=0.01, stands=stands)
    ways = (
        WayUpRecord("supports", False, lost="It snaps"),
        WayUpRecord("scaffold", True, 0.9, "raising", 1.0, 2.0, 3.0, 4),
    )
    whole = summary(NAMES).with_design("polished", design(loads={"design": row}, ways_up=ways))
    whole = replace(
        whole,
        verdict=VerdictRecord("polished", False, ("Rods",), (), ("As built: it snaps.",)),
        failed={"figures": "no OpenGL"},
        seconds={"net": 1.0},
    )
    write_summary(tmp_path, whole)
    assert read_summary(tmp_path) == whole
    assert read_summary(tmp_path / "nowhere") == Summary()


def test_what_a_record_leaves_out_is_read_back_as_none(tmp_path):
    """A run with safety.rare in which no structure fell left a summary.json that nothing could read, and one
    with --profile a profile.json, where the system doesn't tell the memory."""
    found = RareRecord("polished", "design", 0.0005, 620, {})
    write_summary(tmp_path, replace(summary(NAMES), rare=(found,)))
    assert read_summary(tmp_path).rare == (found,)
    measured = Profile(cores=2).also("net", StageProfile("key", 2.0, 1.0, 1.0, {}))
    write_profile(tmp_path, measured)
    assert read_profile(tmp_path) == measured

    def unreadable(kind, seen):
        """Fields of a record, and of those in it, that are left out where they are None, and then missed."""
        if kind in seen:
            return
        seen.add(kind)
        hints = get_type_hints(kind)
        for each in fields(kind):
            inside = [hints[each.name]]
            for part in inside:
                inside += get_args(part)
                if isinstance(part, type) and is_dataclass(part):
                    yield from unreadable(part, seen)
            needed = each.default is MISSING and each.default_factory is MISSING
            if NoneType in inside and needed and "beside" not in each.metadata:
                yield f"{kind.__name__}.{each.name}"

    assert list(unreadable(Summary, set())) == []
    assert list(unreadable(Profile, set())) == []
    assert list(unreadable(Drawn, set())) == []


def test_whether_a_load_is_a_multiple_of_the_design_load_is_kept_and_taken_for_granted_of_older_runs(
    tmp_path,
):
    other = load("additional", factor=0.652, multiple=False)
    write_summary(tmp_path, summary(NAMES).with_design("polished", design(loads={"additional": other})))
    rows = read_summary(tmp_path).designs
    assert rows["polished"].loads["additional"].times is None
    assert rows["initial"].loads["additional"].times == 1.2
    changed(tmp_path, lambda found: found["designs"]["polished"]["loads"]["additional"].pop("multiple"))
    assert read_summary(tmp_path).designs["polished"].loads["additional"].times == 0.652


def test_what_is_not_known_is_left_out_but_for_what_stands_beside_a_number():
    found = document(summary(NAMES, "design", critical_sought=3.0))
    row = found["designs"]["optimised"]["loads"]["design"]
    assert row["critical_factor"] is None
    assert row["critical_kind"] is None
    assert "critical_factor" not in found["designs"]["initial"]["loads"]["design"]
    assert {"verdict", "failed", "robust", "sections"}.isdisjoint(found)
    assert "designs" not in document(Summary())
    assert SampleRecord(1, 1).misfit_mean is None


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda found: found["surface"].update(area="large"), "surface.area: input should be a valid number"),
        (lambda found: found["net"].pop("crossings"), "net.crossings is missing"),
        (
            lambda found: found["designs"]["initial"]["loads"]["none"].update(stable="yes"),
            r"designs.initial.loads.none.stable: input should be a valid boolean \(found 'yes'\)",
        ),
        (lambda found: found["optimisation"].update(constraints=[1.0]), "optimisation.constraints: "),
        (lambda found: found["model"].update(nodes=1.5), "model.nodes: input should be a valid integer"),
        (lambda found: found.pop("version"), "version is missing"),
        (lambda found: found.update(format="other"), "is no summary of shellform's"),
    ],
)
def test_a_key_that_is_missing_or_of_another_type_is_refused_by_its_name(tmp_path, change, words):
    write_summary(tmp_path, summary(NAMES))
    changed(tmp_path, change)
    with pytest.raises(Damaged, match=rf"summary.json: .*{words}.*shellform design .* --fresh"):
        read_summary(tmp_path)


def test_keys_of_a_later_version_are_ignored_and_a_later_format_is_refused(tmp_path):
    write_summary(tmp_path, summary(NAMES))
    changed(tmp_path, lambda found: found["net"].update(colour="red"))
    assert read_summary(tmp_path) == summary(NAMES)
    changed(tmp_path, lambda found: found.update(version=2, net=7))
    with pytest.raises(InputError, match="written by a newer shellform"):
        read_summary(tmp_path)


def test_what_is_no_json_is_refused(tmp_path):
    for name, read in (("summary.json", read_summary), ("stages.json", read_stages)):
        for content in (b"", b"\xff\xfe", b'{"format": ', b"[1, 2]", b"[" * 100_000):
            (tmp_path / name).write_bytes(content)
            with pytest.raises(Damaged, match=rf"{name}: is damaged"):
                read(tmp_path)


def test_stages_are_done_with_their_keys(tmp_path):
    done = StagesDone({"surface": "a", "net": "b", "initial": "c"})
    write_stages(tmp_path, done)
    assert read_stages(tmp_path) == done
    assert read_stages(tmp_path / "nowhere") == StagesDone()
    assert done.has("net", "b")
    assert not done.has("net", "c")
    assert done.before("initial").also("report", "d").keys == {"surface": "a", "net": "b", "report": "d"}
    (tmp_path / "stages.json").write_text('{"net": 3}', encoding="utf-8")
    with pytest.raises(Damaged, match=r"stages.json: is damaged: net: input should be a valid string"):
        read_stages(tmp_path)


def test_a_history_is_read_back_as_it_was_written(tmp_path):
    steps = tuple(
        Step(k, 0.5**k, {"misfit": 0.3, "a.b": 1e-17}, {"uplift.x": -0.1 * k}, 7 - k, 1.0, k != 1, 0.125)
        for k in range(3)
    )
    write_history(tmp_path, steps)
    assert read_history(tmp_path) == steps
    assert read_history(tmp_path / "nowhere") == ()


def test_a_history_whose_search_stops_asking_for_stiffness_is_read_back_and_drawn_with_a_gap(tmp_path):
    constraints = [{"uplift": 0.1, "softness.half": -0.2}, {"uplift": 0.0}, {"uplift": -0.1}]
    steps = tuple(
        Step(k, 0.5, {"misfit": 0.5}, own, 7, 1.0, True, 0.125) for k, own in enumerate(constraints)
    )
    write_history(tmp_path, steps)
    assert read_history(tmp_path) == steps
    columns = by_constraint(steps)
    assert list(columns) == ["uplift", "softness.half"]
    assert columns["uplift"] == [0.1, 0.0, -0.1]
    assert columns["softness.half"] == pytest.approx([-0.2, np.nan, np.nan], nan_ok=True)
    assert any(each.title.startswith("Constraints") for each in _charts(steps))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("cables", "ropes", "column cables is missing"),
        ("0.5", "half", "could not convert string to float: 'half'"),
        (",0.125", "", "row 1 has another length than the heads"),
    ],
)
def test_a_damaged_history_is_refused(tmp_path, old, new, words):
    write_history(tmp_path, [Step(0, 0.5, {"misfit": 0.3}, {}, 7, 1.0, True, 0.125)])
    file = tmp_path / "history.csv"
    file.write_text(file.read_text(encoding="utf-8").replace(old, new), encoding="utf-8")
    with pytest.raises(Damaged, match=rf"history.csv: is damaged.*{words}"):
        read_history(tmp_path)


def test_the_total_of_seconds_is_that_of_the_stages_however_often_it_is_taken():
    once = Summary().with_seconds("net", 1.25).with_seconds("initial", 2.5).totalled()
    assert once.seconds == {"net": 1.25, "initial": 2.5, "total": 3.75}
    assert once.totalled() == once
    assert once.with_seconds("net", 2.0).totalled().seconds["total"] == 4.5
