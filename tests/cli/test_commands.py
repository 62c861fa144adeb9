"""The commands, as a user calls them: results, exit status, and messages without traceback."""

import html
import json
import os
import re
import signal
import stat
import subprocess
import sys
import threading

import numpy as np
import pytest

from shellform.case.build_net import FAR, counted_from, distant_origin
from shellform.cli import program
from shellform.records.stages import STAGES
from tests.command import ROOT, begin, shellform, shellform_process
from tests.run.test_propose import as_obj, dish
from tests.stubs import CASE

MODEL = {
    "format": "shellform-model",
    "version": 1,
    "nodes": [[0, 0, 0], [1, 0, 0], [2, 0, 0]],
    "beams": [{"nodes": [k, k + 1], "EA": 1e6, "GJ": 10, "EIy": 20, "EIz": 20} for k in range(2)],
    "supports": [{"node": 0, "fixed": [True] * 6}],
    "loads": {"tip": [{"node": 2, "force": [0, 0, -1]}], "side": [{"node": 2, "force": [0, 1, 0]}]},
}


def refused(result, *words):
    assert result.returncode == 2, result.stderr
    assert "Traceback" not in result.stderr
    for word in words:
        assert word in result.stderr


def model_file(tmp_path, **changes):
    file = tmp_path / "model.json"
    file.write_text(json.dumps({**MODEL, **changes}), encoding="utf-8")
    return file


def test_analyse_writes_the_result_of_the_contract(tmp_path):
    result = shellform_process("analyse", model_file(tmp_path), "--load", "tip", "--increments", 2)
    assert result.returncode == 0, result.stderr
    found = json.loads(result.stdout)
    assert found["converged"]
    assert found["stable"]
    assert found["negative_pivots"] == 0
    # PL³/3EI = 0.1333, less what large displacement and two elements take.
    assert found["displacements"][2][2] == pytest.approx(-0.1333, abs=2e-3)
    assert found["reactions"][0]["force"][2] == pytest.approx(1.0, abs=1e-6)
    assert [step["factor"] for step in found["increments"]] == [0.5, 1.0]
    keys = "beam_forces cable_forces energy iterations residual rotations seconds"
    assert set(keys.split()) < set(found)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"format": "other"}, ["format"]),
        ({"beems": []}, ["Did you mean 'beams'"]),
        ({"nodes": [[0, 0, 0], [1, 0, "x"], [2, 0, 0]]}, ["nodes"]),
        (
            {"beams": [{"nodes": [0, 7], "EA": 1, "GJ": 1, "EIy": 1, "EIz": 1}]},
            ["beams[0].nodes", "out of range"],
        ),
        ({"beams": [{"nodes": [0, 1], "EA": -1, "GJ": 1, "EIy": 1, "EIz": 1}]}, ["beams[0].EA", "positive"]),
        ({"beams": [{"nodes": [0, 0], "EA": 1, "GJ": 1, "EIy": 1, "EIz": 1}]}, ["beams[0]", "coincide"]),
        ({"supports": []}, ["nothing restrains"]),
        ({"supports": [{"node": 0, "fixed": [True]}]}, ["supports[0].fixed"]),
        ({"cables": [{"nodes": [1, 1], "EA": 5}]}, ["cables[0]", "itself"]),
        ({"loads": {"tip": [{"node": 9}]}}, ["loads.tip[0].node"]),
    ],
)
def test_bad_models_are_refused_by_field_and_element(tmp_path, changes, words):
    refused(shellform("analyse", model_file(tmp_path, **changes), "--load", "tip"), *words)


def test_a_result_takes_the_place_of_no_file_that_it_was_computed_from(tmp_path):
    model = model_file(tmp_path)
    sections = tmp_path / "rods.toml"
    sections.write_text("[rod]\n", encoding="utf-8")
    before = model.read_bytes()
    (tmp_path / "link.json").symlink_to(model)
    for output in (model, tmp_path / "link.json", sections):
        ended = shellform("analyse", model, "--load", "tip", "--sections", sections, "--output", output)
        refused(ended, "would be overwritten", output.name)
    refused(shellform("analyse", model, "--load", "tip", "--output", tmp_path), "is a folder")
    assert model.read_bytes() == before


def test_a_result_goes_into_the_pipe_or_the_file_that_its_name_leads_to(tmp_path):
    arguments = ["analyse", model_file(tmp_path), "--load", "tip", "--output"]
    os.mkfifo(tmp_path / "pipe.json")
    (tmp_path / "link.json").symlink_to(tmp_path / "result.json")
    read = []
    reader = threading.Thread(target=lambda: read.append((tmp_path / "pipe.json").read_text()), daemon=True)
    reader.start()
    ended = shellform(*arguments, tmp_path / "pipe.json")
    assert ended.returncode == 0, ended.stderr
    reader.join(10)
    assert json.loads(read[0])["converged"]
    ended = shellform(*arguments, tmp_path / "link.json")
    assert ended.returncode == 0, ended.stderr
    assert json.loads((tmp_path / "result.json").read_text(encoding="utf-8"))["converged"]
    assert stat.S_ISFIFO((tmp_path / "pipe.json").stat().st_mode)
    assert (tmp_path / "link.json").is_symlink()


def test_the_way_to_an_example_is_told_as_a_shell_takes_it(tmp_path):
    place = tmp_path / "my vault"
    told = shellform("example", "model", place).stdout
    assert f"\n  cd '{place}'\n" in told


def test_analyse_tells_of_a_section_that_isn_t_the_model_s_in_its_result_and_on_the_terminal(tmp_path):
    sections, model = tmp_path / "rods.toml", model_file(tmp_path)
    table = "[rod]\nshape = 'round'\nradius = {}\nyoung = 40e9\nshear = 15e9\nstrength = 255e6\n"
    sections.write_text(table.format(0.5), encoding="utf-8")
    result = shellform("analyse", model, "--load", "tip", "--sections", sections)
    assert result.returncode == 0, result.stderr
    (warning,) = json.loads(result.stdout)["warnings"]
    assert "beams of kind 'rod' resist with EA" in warning
    assert f"shellform: note: {warning}" in result.stderr
    sections.write_text(table.format(4), encoding="utf-8")
    ended = shellform("analyse", model, "--load", "tip", "--sections", sections)
    refused(ended, "[rod].radius: must be between", "For 4 mm write 0.004.")


def test_analyse_asks_for_the_case_where_there_are_several(tmp_path):
    refused(shellform("analyse", model_file(tmp_path)), "several load cases", "tip, side")
    refused(shellform("analyse", model_file(tmp_path), "--load", "top"), "no such load case")
    broken = tmp_path / "broken.json"
    broken.write_text('{"nodes": [NaN', encoding="utf-8")
    refused(shellform("analyse", broken))
    refused(shellform("analyse", tmp_path / "none.json"), "can't be read")


def test_check_tells_size_area_and_counts():
    result = shellform("check", "scripts/scale_model.toml")
    assert result.returncode == 0, result.stderr
    assert "0.902" in result.stdout
    assert "crossings to expect" in result.stdout


def test_check_shows_on_a_terminal_what_it_reads(monkeypatch):
    monkeypatch.setenv("FORCE_COLOR", "1")  # which makes a terminal of any stream
    result = shellform("check", "scripts/scale_model.toml")
    assert "reading scale_model.toml" in result.stderr
    assert "reading" not in result.stdout


def test_bad_surfaces_and_cases_are_refused_without_a_traceback(tmp_path):
    refused(shellform("check", tmp_path / "none.obj"), "no such file")
    case = tmp_path / "case.toml"
    text = (
        (ROOT / "scripts/scale_model.toml")
        .read_text(encoding="utf-8")
        .replace("../surfaces", str(ROOT / "surfaces"))
    )
    case.write_text(text.replace("spacing = 0.055", "spacin = 0.055"), encoding="utf-8")
    refused(shellform("design", case, "--output", tmp_path / "run"), "Did you mean 'net.spacing'")
    case.write_text(text.replace("vault.py", "none.py"), encoding="utf-8")
    refused(shellform("design", case, "--output", tmp_path / "run"), "no such file")
    case.write_text(text, encoding="utf-8")
    wide = ["--set", "surface.dimensions.length=900", "--set", "surface.dimensions.width=550"]
    refused(
        shellform("design", case, "--output", tmp_path / "run", *wide, "--set", "surface.size=10"), "unit"
    )
    refused(shellform("design", case, "--output", tmp_path / "run", "--set", "rod.radius=0.01"), "they break")
    refused(
        shellform("design", case, "--output", tmp_path / "run", "--until", "lunch"), "Known: surface, net"
    )
    refused(shellform("render", tmp_path / "none"), "no run folder")
    refused(shellform("report", tmp_path / "none"), "no run folder")
    own = tmp_path / "own.py"
    own.write_text("raise SystemExit(0)", encoding="utf-8")
    refused(shellform("net", own, "--spacing", 0.1, "--output", tmp_path / "net"), "--allow-scripts")


def test_what_no_command_takes_is_refused_with_where_to_read_what_it_does():
    refused(shellform("frobnicate"), "No such command 'frobnicate'. ", "--help lists what it takes.")
    refused(shellform("design"), "Missing argument 'case'. ", "design --help lists")
    refused(shellform("render", "run", "--limit", "wide"), "'--limit'", "render --help lists")


def test_without_a_command_the_help_stands_on_standard_error_as_it_is():
    alone, asked = shellform(), shellform("--help")
    assert (alone.returncode, alone.stdout) == (2, "")
    assert (asked.returncode, asked.stdout) == (0, alone.stderr)
    assert alone.stderr.startswith("Usage: ")


def test_check_takes_what_a_file_leaves_open_and_tells_what_was_mended(tmp_path):
    standing = shellform("check", "surfaces/hypar.obj", "--unit", "cm", "--up", "y")
    assert standing.returncode == 0, standing.stderr
    assert "0.05 × 0.03 × 0.05 m (is the unit right?)" in standing.stdout
    closed = shellform("check", "tests/data/rhinovault_holes.json", "--fill", "all")
    assert "1 hole was closed" in closed.stdout
    assert "COMPAS JSON" in closed.stdout
    one = shellform("check", "tests/data/tna_tutorial.3dm", "--object", "mesh 1")
    assert "0.01 × 0.01 × 0 m" in one.stdout
    refused(shellform("check", "surfaces/hypar.obj", "--piece", 2), "surface.piece", "There are 1")
    refused(shellform("check", "surfaces/hypar.obj", "--piece", 0), "surface.piece")
    refused(shellform("check", "surfaces/hypar.obj", "--up", "w"), "surface.up")


def test_a_refused_surface_leaves_nothing_behind(tmp_path):
    bad = tmp_path / "bad.stl"
    bad.write_text("solid cut off\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\n")
    case = tmp_path / "case.toml"
    text = (
        (ROOT / "scripts/scale_model.toml")
        .read_text(encoding="utf-8")
        .replace("../surfaces/vault.py", "bad.stl")
    )
    before, _, after = text.partition("[surface.dimensions]")
    case.write_text(before + after[after.index("[net]") :], encoding="utf-8")
    refused(shellform("net", bad, "--spacing", 0.5, "--output", tmp_path / "net"), "bad.stl")
    refused(shellform("design", case, "--output", tmp_path / "run"), "bad.stl")
    refused(shellform("check", bad), "bad.stl")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bad.stl", "case.toml"]


def test_a_surface_in_a_survey_s_coordinates_is_refused_with_an_origin_from_which_its_net_is_the_same(
    tmp_path,
):
    lines = []
    for name, (x, y, z) in {"near": (0.0, 0.0, 0.0), "far": (430000.0, 81000.0, 400.0)}.items():
        as_obj(tmp_path / f"{name}.obj", counted_from(dish(count=13), (-x, -y, -z)))
        lines.append([tmp_path / f"{name}.obj", "--spacing", 0.8, "--angle", 0, "--output", tmp_path / name])
    near, far = lines
    assert shellform("net", *near).returncode == 0
    refused = shellform("net", *far)
    assert refused.returncode == 2
    assert "rounding hides the load" in refused.stderr
    origin = re.search(r"--origin (\S+ \S+ \S+)\.$", refused.stderr.strip()).group(1).split()
    assert shellform("net", *far, "--origin", *origin).returncode == 0
    curved = [
        json.loads((tmp_path / name / "summary.json").read_text())["net"]["curvature_max"]
        for name in ("near", "far")
    ]
    assert curved[1] == pytest.approx(curved[0], rel=1e-3)


def test_only_what_lies_far_from_its_origin_gets_one_near_it_and_the_same_one_again():
    surface = dish()
    assert distant_origin(surface, FAR) is None
    origin = distant_origin(counted_from(surface, (-4e5, 2e4, 0.0)), FAR)
    moved = counted_from(counted_from(surface, (-4e5, 2e4, 0.0)), origin)
    assert np.abs(moved.vertices).max() < 3.0 * surface.size.max()
    assert distant_origin(moved, FAR) is None
    assert any("count from (" in each for each in moved.mended)


def test_net_alone_writes_the_contract_s_file_for_a_mesh(tmp_path):
    result = shellform("net", "surfaces/hypar.obj", "--spacing", 0.5, "--angle", 20, "--output", tmp_path)
    assert result.returncode == 0, result.stderr
    net = json.loads((tmp_path / "net.json").read_text(encoding="utf-8"))
    assert len(net["crossings"]) > 50
    assert {"direction", "index", "length", "marks", "crossings", "ends"} == set(net["rods"][0])
    told = {line[:22].strip(): line[24:] for line in result.stdout.splitlines()}
    rods = f"{len(net['rods'])} at 0.5 m, with {len(net['crossings'])} crossings and {len(net['supports'])} supports"
    assert told["rods"] == rods
    assert told["angle of u rods"] == "20° against the x axis"
    assert not set(result.stdout) & set("[{"), "no records of the program's own"


def test_ctrl_c_ends_with_130_and_keeps_what_was_computed(tmp_path):
    case = tmp_path / "dome.toml"
    case.write_text(CASE, encoding="utf-8")
    job = begin("design", case, "--output", tmp_path / "run")
    assert job.stderr is not None
    for line in job.stderr:
        if line.startswith("net: done"):
            job.send_signal(signal.SIGINT)
            break
    said = job.stderr.read()
    assert job.wait(60) == 130
    assert "stopped" in said
    assert "Traceback" not in said
    again = shellform("design", case, "--output", tmp_path / "run", "--until", "net")
    assert again.stderr.count("kept") == 2


SWALLOWED = """
import os, signal, sys
from shellform.structure.elements import threads
from shellform.__main__ import main

signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored where the tests run in the background

class Dropped:
    def __del__(self):
        os.kill(os.getpid(), signal.SIGINT)
        for _ in range(1000):
            pass

import shellform.run.run as run
usual = run.run_case
def run_case(case, folder, **given):
    report = given["report"]
    def told(event):
        if event.stage == "net" and event.kind.name == "DONE":
            Dropped()
        report(event)
    return usual(case, folder, **{**given, "report": told})
run.run_case = run_case
main()
"""


def test_ctrl_c_that_python_drops_in_a_destructor_is_heeded_at_the_next_step(tmp_path):
    case = tmp_path / "dome.toml"
    case.write_text(CASE, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-c", SWALLOWED, "design", case, "--output", tmp_path / "run"],
        capture_output=True,
        text=True,
        cwd=ROOT,
        check=False,
    )
    assert "Exception ignored in" in done.stderr
    assert done.returncode == 130
    assert done.stderr.rstrip().endswith("goes on from there")
    assert not (tmp_path / "run/designs").exists() or not list((tmp_path / "run/designs").iterdir())


def test_ctrl_c_while_python_still_loads_the_program_ends_with_130(tmp_path):
    (tmp_path / "typer.py").write_text("raise KeyboardInterrupt", encoding="utf-8")
    early = shellform_process("check", "surfaces/hypar.obj", env={"PYTHONPATH": f"{tmp_path}:{ROOT}"})
    assert (early.returncode, early.stderr) == (130, "shellform: stopped\n")


def test_letters_that_a_terminal_does_not_know_become_question_marks():
    told = shellform_process("check", "surfaces/hypar.obj", env={"PYTHONIOENCODING": "ascii"})
    assert told.returncode == 0, told.stderr
    assert "5 ? 5 ? 3 m" in told.stdout


def told_to(output, *arguments, unbuffered):
    """A command's status and what it says where its standard output is `output`."""
    ended = subprocess.run(
        [sys.executable, "-m", "shellform", *map(str, arguments)],
        stdout=output,
        stderr=subprocess.PIPE,
        text=True,
        cwd=ROOT,
        env={**os.environ, "PYTHONUNBUFFERED": unbuffered},
        check=False,
    )
    return ended.returncode, ended.stderr


@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_output_that_takes_no_more_is_told_and_one_that_nobody_reads_ends_a_command_quietly(
    tmp_path, unbuffered
):
    commands = ["check", "surfaces/hypar.obj"], ["analyse", model_file(tmp_path), "--load", "tip"]
    if os.path.exists("/dev/full"):
        with open("/dev/full", "wb") as full:
            for command in commands:
                status, said = told_to(full, *command, unbuffered=unbuffered)
                assert status == 2
                assert "standard output or a temporary file: can't be written: No space left" in said
                assert "Traceback" not in said
                assert "Exception" not in said
    reading, writing = os.pipe()
    os.close(reading)
    # Where each line is written at once a command can't come to its end; else its status is its own.
    assert told_to(writing, *commands[0], unbuffered=unbuffered) == (3 if unbuffered else 0, "")
    os.close(writing)


def test_a_number_of_five_thousand_digits_is_refused(tmp_path):
    (tmp_path / "case.toml").write_text(f"[net]\nspacing = {'9' * 5000}\n", encoding="utf-8")
    refused(shellform("check", tmp_path / "case.toml"), "isn't valid TOML", "digits")
    refused(
        shellform(
            "design",
            "scripts/scale_model.toml",
            "--output",
            tmp_path / "run",
            "--set",
            f"net.spacing={'9' * 5000}",
        ),
        "net.spacing",
    )


def test_names_that_no_file_can_have_are_refused(tmp_path):
    long = 400 * "a"
    for words in (
        ["analyse", f"{long}.json"],
        ["design", f"{long}.toml", "--output", tmp_path],
        ["check", long],
    ):
        refused(shellform(*words), "aaa")
    for name in (long, "a\\u0000b"):
        text = (ROOT / "scripts/scale_model.toml").read_text(encoding="utf-8")
        (tmp_path / "case.toml").write_text(text.replace("../surfaces/vault.py", name), encoding="utf-8")
        refused(shellform("design", tmp_path / "case.toml", "--output", tmp_path / "run"), "surface.file")


def test_an_angle_that_is_no_number_is_refused(tmp_path):
    arguments = ["net", "surfaces/hypar.obj", "--spacing", 0.5, "--output", tmp_path / "net", "--angle"]
    for angle in ("nan", "inf", "steep"):
        refused(shellform(*arguments, angle), "--angle: must be degrees or auto")


def test_a_gap_of_nothing_is_refused_and_not_taken_for_one_that_is_left_out(tmp_path):
    net = ["net", "surfaces/hypar.obj", "--spacing", 0.5, "--output", tmp_path / "net", "--gap"]
    for gap in (0, -1):
        refused(shellform(*net, gap), "must be positive", f"found {float(gap)}")


def test_check_of_a_case_takes_no_option_of_surface_files(tmp_path):
    case = ROOT / "scripts/dome.toml"
    refused(shellform("check", case, "--unit", "mm"), "--unit: is for surface files", "surface.unit")
    refused(shellform("check", case, "--fill-narrower", 1), "--fill-narrower: is", "surface.fill_narrower")


def test_an_angle_beyond_a_whole_turn_is_refused_in_degrees_before_anything_is_read(tmp_path):
    surface = tmp_path / "none.obj"
    net = ["net", surface, "--spacing", 0.5, "--output", tmp_path / "net"]
    for words in (net, ["new", surface, "--output", tmp_path / "case.toml"]):
        refused(shellform(*words, "--angle", 405), "--angle: 405° is more than a whole turn", "give 45.")
    refused(
        shellform("new", surface, "--output", tmp_path / "case.toml", "--angle", "nan"),
        "--angle: must be finite",
        "leave it out for the least bending",
    )


@pytest.mark.parametrize(
    ("command", "said"),
    [(name, "is kept, and the same command goes on from there") for name in ("design", "study")]
    + [
        (name, "not finished is lost, and the same command begins anew")
        for name in ("new", "net", "check", "verify", "survey", "analyse")
    ],
)
def test_ctrl_c_within_compiled_code_stops_as_anywhere_else_and_what_is_kept_is_told(
    monkeypatch, capsys, command, said
):
    monkeypatch.setattr(sys, "argv", ["shellform", command, "design"])

    def interrupted(standalone_mode):
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        raise SystemError("CPUDispatcher returned a result with an exception set")  # what numba makes of it

    # Set, for it is ignored where the tests run in the background.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    monkeypatch.setattr(program, "app", interrupted)
    try:
        with pytest.raises(SystemExit) as end:
            program.main()
        after = signal.getsignal(signal.SIGINT)
    finally:
        signal.signal(signal.SIGINT, before)
    assert end.value.code == 130
    assert said in capsys.readouterr().err
    assert after is signal.default_int_handler


def test_the_main_job_runs_resumes_and_can_be_re_analysed(tmp_path):
    run = tmp_path / "run"
    arguments = ["design", "scripts/scale_model.toml", "--output", run]
    for setting in (
        "surface.size=0.02",
        "net.spacing=0.1",
        "net.elements=2",
        "load.force=5.0",
        "optimise.evaluations=5",
        "optimise.polish=3",
        "safety.required=false",
        "safety.drawn=4",
        "safety.compared=2",
    ):
        arguments += ["--set", setting]
    result = shellform(*arguments)
    assert result.returncode == 0, result.stderr
    summary = json.loads((run / "summary.json").read_text(encoding="utf-8"))
    designs = summary["designs"]
    assert set(designs) == {"unbraced", "initial", "unloaded", "optimised", "polished"}
    assert summary["optimisation"]["objective_end"] < 0.5
    assert max(summary["optimisation"]["constraints"].values()) <= 1e-3
    optimised = designs["optimised"]["loads"]
    assert all(optimised[load]["stable"] and optimised[load]["on_branch"] for load in optimised)
    # As section 4.1 of the paper orders its designs.
    assert not designs["unbraced"]["loads"]["design"]["on_branch"]
    braced = ["initial", "unloaded", "optimised"]
    mean = {
        name: {load: designs[name]["loads"][load]["deviation_mean"] for load in optimised} for name in braced
    }
    assert min(braced, key=lambda name: mean[name]["none"]) == "unloaded"
    assert max(braced, key=lambda name: mean[name]["none"]) == "optimised"
    assert min(braced, key=lambda name: mean[name]["design"]) == "optimised"
    for name in (
        "case.toml",
        "history.csv",
        "net.json",
        "figures/deviations.png",
        "figures/objective.png",
        "drawings/grid.dxf",
        "report.html",
    ):
        assert (run / name).stat().st_size > 0
    again = shellform(*arguments)
    assert again.returncode == 0
    assert again.stderr.count("kept") == len(STAGES)
    (run / "report.html").unlink()
    restored = shellform(*arguments)
    assert restored.stderr.count("kept") == len(STAGES) - 1
    assert (run / "report.html").is_file()
    page = shellform("report", run, "--output", tmp_path / "page.html")
    assert page.stdout.strip() == str(tmp_path / "page.html"), page.stderr
    assert (run / "report.html").stat().st_size < 15e6
    for name in ("optimised", "unbraced"):
        found = shellform("analyse", run / f"designs/{name}.json", "--load", "design")
        assert found.returncode == 0, found.stderr
        moved = np.array(json.loads(found.stdout)["displacements"])
        model = json.loads((run / f"designs/{name}.json").read_text(encoding="utf-8"))
        away = np.linalg.norm(np.array(model["nodes"]) + moved - model["start"]["positions"], axis=1)
        assert away.max() == pytest.approx(designs[name]["loads"]["design"]["deviation_max"], abs=0.9e-6)


def test_a_design_that_does_not_hold_ends_with_status_3_and_has_its_page(tmp_path):
    case = tmp_path / "dome.toml"
    case.write_text(CASE, encoding="utf-8")
    arguments = ["design", case, "--output", tmp_path / "run", "--until", "safety"]
    for setting in (
        "safety.drawn=4",
        "safety.compared=2",
        "safety.critical_factor=9.0",
        "cable.without=false",
        "optimise.unloaded=false",
        "optimise.evaluations=1",
    ):
        arguments += ["--set", setting]
    result = shellform(*arguments)
    assert result.returncode == 3, result.stderr
    verdict = json.loads((tmp_path / "run/summary.json").read_text(encoding="utf-8"))["verdict"]
    assert not verdict["holds"]
    reasons = [each for each in verdict["failed"] if each.startswith("Critical factor of the design load")]
    assert len(reasons) == 1
    assert reasons[0] in result.stdout, "the same words"
    page = shellform("report", tmp_path / "run")
    assert page.returncode == 0, page.stderr
    text = html.unescape((tmp_path / "run/report.html").read_text(encoding="utf-8"))
    assert reasons[0] in text
    assert "The optimised design does not hold" in text
    assert "The optimised design does not hold" in result.stdout
    kept = shellform(*arguments)
    assert kept.returncode == 3, "what was kept is judged as before"


def test_check_tells_what_design_doubts_when_it_begins_and_ends_well(tmp_path):
    text = (ROOT / "scripts/dome.toml").read_text(encoding="utf-8")
    text = text.replace("../surfaces", (ROOT / "surfaces").as_posix())
    case = tmp_path / "case.toml"

    def checked(old, new, *words):
        assert old in text
        case.write_text(text.replace(old, new, 1), encoding="utf-8")
        found = shellform("check", case, *words)
        assert found.returncode == 0, found.stderr
        return found.stdout

    dense = ('kind = "concrete"', 'kind = "concrete"\ndensity = 25000')
    meant = "part.concrete.density is 25000 kg/m³: 10 times what concrete has"
    assert meant in checked(*dense)
    (doubt,) = json.loads(checked(*dense, "--json"))["doubts"]
    assert doubt.startswith(meant)
    begun = shellform("design", case, "--until", "surface", "--output", tmp_path / "run")
    assert doubt in begun.stderr
    assert "less than the" in checked("rest_ratio = 0.9971", "rest_ratio = 0.9")
    assert "joint.bending is 5" in checked("[cable]", "[joint]\nbending = 5.0\n[cable]")
    assert "doubt" not in checked("[cable]", "[cable]")
    assert json.loads(checked("[cable]", "[cable]", "--json"))["doubts"] == []
