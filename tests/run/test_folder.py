"""Run folders: what is refused to be overwritten or read, and that a disc that fills up is told in one
sentence.
"""

import errno
import json
import resource
import shutil
from pathlib import Path

import numpy as np
import pytest

from shellform.errors import InputError
from shellform.records.progress import Event, unheard
from shellform.run.folder import alone, read_run, refuse_overwriting
from shellform.run.log import logged
from shellform.run.pages import write_report
from shellform.run.run import run_case
from tests.command import ROOT, shellform, shellform_process
from tests.run.small_run import begin, finish, small_case

CASE = ROOT / "scripts/scale_model.toml"


@pytest.fixture
def copy(begun, tmp_path):
    return Path(shutil.copytree(begun, tmp_path / "copy"))


def changed(file, **entries):
    file.write_text(json.dumps({**json.loads(file.read_text(encoding="utf-8")), **entries}), encoding="utf-8")


def test_a_run_left_after_its_initial_design_is_read_as_far_as_it_came(begun):
    run = read_run(begun)
    assert list(run.designs) == ["unbraced", "initial"]
    assert run.best == "initial"
    assert set(run.states["initial"]) == {"none", "design", "additional"}
    assert repr(run).endswith("designs unbraced, initial)")
    assert repr(run.states["initial"]["none"]) == f"State({run.shell.node_count} nodes)"


def test_what_is_made_to_compare_with_can_be_left_out(tmp_path):
    folder = begin(ROOT, tmp_path / "run", "cable.without=false")
    finish(folder)
    assert list(read_run(folder).designs) == ["initial", "optimised"]
    assert "Unbraced" not in write_report([folder]).read_text(encoding="utf-8")
    refused = shellform("calibrate", folder, "points.csv=none")
    assert refused.returncode == 2
    assert "points.csv: there is no such file" in refused.stderr, "of the grid nothing is missing"


def test_folders_that_are_no_run_or_have_no_designs_yet_are_refused(tmp_path, copy):
    with pytest.raises(InputError, match="is no run folder"):
        read_run(tmp_path)
    changed(copy / "summary.json", designs={})
    with pytest.raises(InputError, match=r"no designs yet.*it goes on"):
        read_run(copy)


def test_a_run_of_a_newer_version_is_neither_read_nor_overwritten_but_with_fresh(copy):
    changed(copy / "summary.json", shellform="99.0")
    read_run(copy)  # its files are as ours
    with pytest.raises(InputError, match=r"holds a run of a newer shellform \(found '99.0'\).*--fresh"):
        run_case(small_case(ROOT), copy, until="surface")
    changed(copy / "summary.json", version=2)
    for refused in (lambda: read_run(copy), lambda: run_case(small_case(ROOT), copy, until="surface")):
        with pytest.raises(InputError, match="was written by a newer shellform"):
            refused()
    run_case(small_case(ROOT), copy, until="surface", fresh=True)
    assert json.loads((copy / "summary.json").read_text(encoding="utf-8"))["version"] == 1


def test_a_run_with_files_missing_or_of_another_state_of_its_case_is_told_to_be_unfinished(copy):
    (copy / "net.npz").rename(copy / "kept.npz")
    with pytest.raises(InputError, match=r"net.npz: isn't there: the run is unfinished.*shellform design"):
        read_run(copy)
    (copy / "kept.npz").rename(copy / "net.npz")
    with np.load(copy / "designs/initial.npz") as data:
        less = {name: data[name] for name in data if not name.startswith("additional")}
    np.savez_compressed(copy / "designs/initial.npz", **less)
    with pytest.raises(
        InputError, match=r"initial.npz: belongs to another state of the case: the run is half-finished"
    ):
        read_run(copy)
    (copy / "designs/initial.npz").unlink()
    with pytest.raises(InputError, match=r"initial.npz: isn't there: the run is unfinished"):
        read_run(copy)


def test_what_a_changed_case_will_find_anew_is_forgotten_before_it_is_computed(copy, monkeypatch):
    from shellform.run import run

    def stopped(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(run, "gridshell", stopped)
    with pytest.raises(KeyboardInterrupt):
        run_case(small_case(ROOT, "cable.stiffness=200.0"), copy, until="initial")
    assert set(json.loads((copy / "stages.json").read_text(encoding="utf-8"))) == {"surface", "net"}
    with pytest.raises(InputError, match="no designs yet"):
        read_run(copy)


@pytest.mark.parametrize("name", ["case.toml", "summary.json", "figures/mine.png", "models/gridshell.3dm"])
def test_files_that_shellform_did_not_write_are_not_overwritten_without_fresh(tmp_path, name):
    own = tmp_path / name
    own.parent.mkdir(exist_ok=True)
    own.write_text("{}", encoding="utf-8")
    with pytest.raises(
        InputError, match=rf"is no run folder, and {name.split('/')[0]} in it would be overwritten.*--fresh"
    ):
        run_case(small_case(ROOT), tmp_path, until="surface")
    assert own.read_text(encoding="utf-8") == "{}"
    run_case(small_case(ROOT), tmp_path, until="surface", fresh=True)
    assert "shellform-summary" in (tmp_path / "summary.json").read_text(encoding="utf-8")


def test_a_summary_that_cannot_be_read_is_refused_unless_it_may_be_overwritten(copy, monkeypatch):
    usual = Path.read_bytes

    def read_bytes(path):
        if path == copy / "summary.json":
            raise PermissionError(errno.EACCES, "Permission denied", str(path))
        return usual(path)

    monkeypatch.setattr(Path, "read_bytes", read_bytes)
    with pytest.raises(InputError, match=r"summary\.json: can't be read: Permission denied\. .*--fresh"):
        run_case(small_case(ROOT), copy, until="surface")
    run_case(small_case(ROOT), copy, until="surface", fresh=True)


def test_two_runs_do_not_work_in_one_folder_and_the_lock_ends_with_its_holder(copy):
    case = small_case(ROOT)
    with alone(copy):
        for refused in (
            lambda: run_case(case, copy, until="surface"),
            lambda: run_case(case, copy, until="surface", fresh=True),
        ):
            with pytest.raises(InputError, match=r"another shellform is at work in it.*Wait"):
                refused()
        net = shellform("net", "surfaces/hypar.obj", "--spacing", 0.5, "--output", copy.parent)
        assert net.returncode == 0, net.stderr
    run_case(case, copy, until="surface")


def test_what_killed_writers_left_is_cleared_away_by_the_next_run(copy):
    left = [copy / "net.part-0123456789abcdef.npz", copy / "figures/deviations.part-0123456789abcdef.png"]
    for file in left:
        file.touch()
    run_case(small_case(ROOT), copy, until="surface")
    assert not any(file.exists() for file in left)
    assert (copy / "net.npz").is_file()


@pytest.mark.parametrize("name", ["log.txt", "report.html", "case.toml", "figures", "buildable", "lock"])
def test_symbolic_links_in_a_run_folder_lead_nobody_elsewhere(copy, tmp_path, name):
    outside = tmp_path / "outside"
    outside.mkdir()
    (outside / "mine.txt").write_text("mine", encoding="utf-8")
    if (copy / name).is_dir():
        shutil.rmtree(copy / name)
        (copy / name).symlink_to(outside)
    else:
        (copy / name).unlink(missing_ok=True)
        (copy / name).symlink_to(outside / "mine.txt")
    for refused in (
        lambda: run_case(small_case(ROOT), copy, until="surface"),
        lambda: run_case(small_case(ROOT), copy, until="surface", fresh=True),
        lambda: read_run(copy),
        lambda: write_report([copy]),
    ):
        with pytest.raises(InputError, match=rf"{name}: is a symbolic link.*Delete it"):
            refused()
    assert [file.read_text(encoding="utf-8") for file in outside.iterdir()] == ["mine"]


def test_a_run_folder_deleted_meanwhile_and_a_log_that_leads_elsewhere_are_told(tmp_path):
    with pytest.raises(InputError, match=r"log\.txt: can't be written: No such file.*deleted meanwhile"):
        logged(tmp_path / "gone", unheard)(Event("net", "begun"))
    (tmp_path / "mine.txt").touch()
    (tmp_path / "log.txt").symlink_to(tmp_path / "mine.txt")
    with pytest.raises(InputError, match=r"log\.txt: can't be written.*Delete the symbolic link"):
        logged(tmp_path, unheard)(Event("net", "begun"))
    assert (tmp_path / "mine.txt").read_text(encoding="utf-8") == ""


def test_a_folder_with_other_files_may_take_a_run_and_a_run_may_go_on(tmp_path, copy):
    (tmp_path / "notes.txt").write_text("mine", encoding="utf-8")
    refuse_overwriting(tmp_path)
    refuse_overwriting(copy)
    refuse_overwriting(tmp_path / "none")
    with pytest.raises(InputError, match="is a file"):
        refuse_overwriting(tmp_path / "notes.txt")


def test_the_net_alone_does_not_go_into_a_design_s_run(copy):
    result = shellform("net", "surfaces/hypar.obj", "--spacing", 0.5, "--output", copy)
    assert result.returncode == 2
    assert "holds a run of shellform design" in result.stderr


def test_folders_that_cannot_be_written_are_told(tmp_path):
    for place in ("/proc/shellform/run", "/dev/null/run"):
        with pytest.raises(InputError, match="can't be written"):
            run_case(small_case(ROOT), Path(place), until="surface")


def test_a_disc_that_fills_up_is_told_in_one_line_and_leaves_no_broken_file(tmp_path):
    def small():
        resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))

    result = shellform_process(
        "net", "surfaces/hypar.obj", "--spacing", 0.25, "--output", tmp_path / "run", before=small
    )
    assert result.returncode == 2, result.stderr
    assert "net.npz: can't be written: File too large" in result.stderr
    assert "Traceback" not in result.stderr
    assert [path.name for path in (tmp_path / "run").iterdir()] == ["lock"]


# OSMesa is asked for where it isn't installed, which leaves VTK with what it has on a machine without GL
# libraries
WITHOUT = {"VTK_DEFAULT_OPENGL_WINDOW": "vtkOSOpenGLRenderWindow"}


def test_without_opengl_one_line_names_the_packages_and_everything_else_is_made(tmp_path, copy):
    result = shellform_process(
        "net", "surfaces/hypar.obj", "--spacing", 0.5, "--output", tmp_path / "net", env=WITHOUT
    )
    assert result.returncode == 0, result.stderr
    assert len([line for line in result.stderr.splitlines() if "apt-get install libegl1" in line]) == 1
    assert sorted(path.name for path in (tmp_path / "net").iterdir()) == [
        "lock",
        "net.json",
        "net.npz",
        "summary.json",
    ]
    refused = shellform_process("render", copy, env=WITHOUT)
    assert refused.returncode == 2
    assert "apt-get install libegl1" in refused.stderr
    lines = shellform_process(
        "render", copy, "--design", "best", "--load", "design", "--format", "svg", env=WITHOUT
    )
    assert lines.returncode == 0, lines.stderr
    assert (copy / "figures/initial-design.svg").is_file()


def test_pictures_that_could_not_be_made_are_made_by_the_next_run(tmp_path, monkeypatch):
    from shellform.output.pictures import scene
    from shellform.run import run

    def missing():
        raise InputError("VTK lacks a library")

    told = []
    case, folder = small_case(ROOT, "cable.without=false"), tmp_path / "run"
    for stage in ("_optimise", "_safety", "_documents"):
        monkeypatch.setattr(run, stage, lambda workspace, parts, summary, keep: run._Ended(parts, summary))
    with monkeypatch.context() as without:
        without.setattr(scene, "require", missing)
        run_case(case, folder, report=lambda event: told.append(event.text))
    assert "no pictures: VTK lacks a library" in told
    assert (folder / "states/initial-design.vtp").stat().st_size > 1000
    assert "figures" not in json.loads((folder / "stages.json").read_text(encoding="utf-8"))
    run_case(case, folder, report=lambda event: told.append(event.text))
    assert (folder / "figures/deviations.png").is_file()
    assert "figures" in json.loads((folder / "stages.json").read_text(encoding="utf-8"))


def test_a_script_runs_a_case_by_the_public_names(tmp_path):
    import shellform as sf
    from shellform.records.summary import document

    folder = str(tmp_path / "run")
    summary = sf.study.run_case(sf.study.load_case(str(CASE), ["net.spacing=0.09"]), folder, until="net")
    assert summary.net.spacing == 0.09
    assert document(summary) == json.loads((tmp_path / "run/summary.json").read_text(encoding="utf-8"))
