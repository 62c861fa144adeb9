"""What somebody has deleted from a run folder is made again, and nothing else."""

import shutil
from pathlib import Path
from types import SimpleNamespace

import pytest

from shellform.records.stages import STAGES, StagesDone, read_stages
from shellform.records.summary import Summary, read_summary
from shellform.run.lasting import _files, lasting, take_away
from shellform.run.run import run_case
from tests.command import ROOT
from tests.run.small_run import finish, small_case


@pytest.fixture(scope="module")
def whole(begun, tmp_path_factory):
    """A run in whose place every stage left something."""
    folder = finish(Path(shutil.copytree(begun, tmp_path_factory.mktemp("whole") / "run")))
    names = [f"figures/net-{each}.png" for each in ("distance", "curvature", "skew", "springs")]
    names += [f"figures/{each}.png" for each in ("deviations", "objective", "constraints")]
    for design in ("unbraced", "initial", "optimised"):
        for load in ("none", "design", "additional"):
            names += [f"figures/{design}-{load}.png", f"states/{design}-{load}.vtp"]
    names += [
        f"drawings/{each}{ending}"
        for each in ("grid", "cables", "supports", "elevations", "rods")
        for ending in (".dxf", ".pdf")
    ]
    names += [
        f"schedules/{each}.csv"
        for each in ("rods", "bars", "splices", "marks", "cables", "supports", "survey")
    ]
    names += [
        "schedules/notes.txt",
        "schedules/schedules.xlsx",
        *(f"models/gridshell{each}" for each in (".vtu", ".3dm", ".glb")),
    ]
    names += ["models/blender.py", "models/grasshopper.py", "report.html"]
    for name in names:
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).touch()
    return folder


def done_in(folder):
    return list(lasting(folder, read_stages(folder), read_summary(folder)).keys)


@pytest.mark.parametrize(
    ("name", "stage"),
    [
        ("surface.npz", "surface"),
        ("net.npz", "net"),
        ("net.json", "net"),
        ("designs/unbraced.npz", "initial"),
        ("designs/initial.npz", "initial"),
        ("designs/optimised.npz", "optimise"),
        ("history.csv", "optimise"),
        ("figures/deviations.png", "figures"),
        ("figures/net-skew.png", "figures"),
        ("figures/optimised-additional.png", "figures"),
        ("states/unbraced-none.vtp", "initial"),
        ("states/optimised-design.vtp", "optimise"),
        ("designs/initial.json", "initial"),
        ("designs/optimised.json", "optimise"),
        ("drawings/cables.dxf", "documents"),
        ("schedules/marks.csv", "documents"),
        ("models/gridshell.3dm", "documents"),
        ("report.html", "report"),
    ],
)
def test_a_stage_of_which_a_file_was_deleted_is_not_done_nor_are_those_after_it(whole, tmp_path, name, stage):
    copy = Path(shutil.copytree(whole, tmp_path / "run"))
    assert done_in(copy) == list(STAGES)
    (copy / name).unlink()
    assert done_in(copy) == list(STAGES[: STAGES.index(stage)])


def test_of_designs_whose_structures_were_drawn_these_are_asked_for():
    loads = {
        name: SimpleNamespace(
            loads={"none": SimpleNamespace(stands=None), "design": SimpleNamespace(stands=stands)}
        )
        for name, stands in (("unbraced", None), ("initial", "12 of 12"), ("polished", "200 of 200"))
    }
    found = _files("safety", SimpleNamespace(designs=loads, sketch=False))
    assert found == ("designs/initial-drawn.json", "designs/polished-drawn.json")


@pytest.mark.parametrize(
    ("stage", "stay"),
    [
        ("net", []),
        ("optimise", ["figures/net-skew.png"]),
        ("safety", ["figures/net-skew.png", "figures/deviations.png"]),
        ("documents", ["figures/net-skew.png", "figures/deviations.png", "figures/failure.png"]),
        ("report", ["figures/net-skew.png", "figures/deviations.png", "figures/failure.png", "drawings/grid.pdf",
                    "schedules/edge_beams.csv", "models/gridshell.step", "schedules/rods.csv"]),
    ],
)  # fmt: skip
def test_what_shows_a_design_that_is_made_anew_is_taken_away_and_what_was_told_on_site_stays(
    whole, tmp_path, stage, stay
):
    copy = Path(shutil.copytree(whole, tmp_path / "run"))
    told = ["schedules/erection.csv", "schedules/belief-1.npz"]
    for name in ("figures/failure.png", "schedules/edge_beams.csv", "models/gridshell.step", *told):
        (copy / name).touch()
    assert (copy / "report.html").is_file()
    take_away(copy, stage)
    assert not (copy / "report.html").exists(), "it tells of what is made anew"
    shown = ("figures/net-skew.png", "figures/deviations.png", "figures/failure.png", "drawings/grid.pdf",
             "schedules/edge_beams.csv", "models/gridshell.step", "schedules/rods.csv")  # fmt: skip
    assert [name for name in shown if (copy / name).is_file()] == stay
    assert all((copy / name).is_file() for name in (*told, "designs/initial.npz", "history.csv"))


def test_a_run_with_other_rods_that_ends_early_keeps_no_drawings_of_those_before(whole, tmp_path):
    """Its rods.csv still said \"2 layers of 50 mm\" beside a case of one of 30 mm."""
    copy = Path(shutil.copytree(whole, tmp_path / "run"))
    run_case(small_case(ROOT, "rod.radius=0.0009"), copy, until="initial")
    assert not list((copy / "drawings").iterdir())
    assert not (copy / "schedules/rods.csv").exists()
    assert not (copy / "report.html").exists()
    left = read_summary(copy)
    assert left.documents is None
    assert set(left.seconds) == {"surface", "net", "initial", "total"}
    assert left.seconds["total"] == pytest.approx(sum(left.seconds.values()) / 2.0)


def test_where_nothing_was_done_nothing_is_missing(tmp_path):
    assert lasting(tmp_path, StagesDone(), Summary()) == StagesDone()


@pytest.mark.parametrize(
    "name",
    ["surface.npz", "net.npz", "designs/initial.npz", "designs/initial.json", "states/initial-design.vtp"],
)
def test_run_again_the_deleted_file_is_there_with_the_same_bytes(begun, tmp_path, name):
    """It was told "kept", or that the run is unfinished and goes on by the very command that said so."""
    copy = Path(shutil.copytree(begun, tmp_path / "run"))
    (copy / name).unlink()
    told = []
    run_case(small_case(ROOT), copy, until="initial", report=told.append)
    assert (copy / name).read_bytes() == (begun / name).read_bytes()
    stage = {"surface.npz": "surface", "net.npz": "net"}.get(name, "initial")
    kept = [event.stage for event in told if event.kind.value == "kept"]
    assert kept == list(STAGES[: STAGES.index(stage)])
