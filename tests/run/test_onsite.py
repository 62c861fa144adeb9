"""Calibration, surveys and erection through the command line: results, and every kind of bad input
refused.
"""

import csv
import json
import tomllib
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from shellform.case.case import load_case
from shellform.errors import InputError
from shellform.run import onsite, site_sources
from shellform.run.folder import read_run
from shellform.run.run import run_case
from shellform.site import measurements
from shellform.structure.network import assemble
from shellform.structure.solve.equilibrium import find_equilibrium
from tests.command import ROOT, shellform

NOISE = 0.15e-3


def refused(result, *words):
    assert result.returncode == 2, result.stderr
    assert "Traceback" not in result.stderr
    for word in words:
        assert word in result.stderr


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A run up to its initial design under a third of the paper's load, which the unbraced grid bears too."""
    place = tmp_path_factory.mktemp("run")
    run_case(load_case(ROOT / "scripts/scale_model.toml", ["load.force=1.0"]), place, until="initial")
    return place


@pytest.fixture(scope="module")
def run(folder):
    return read_run(folder)


def written(path, head, rows):
    path.write_text("\n".join([head, *(",".join(map(str, row)) for row in rows)]) + "\n", encoding="utf-8")
    return path


def as_built(run, error, seed=5):
    """The initial design with wrong cable lengths, unloaded."""
    design, rng = run.designs["initial"], np.random.default_rng(seed)
    other = replace(design, rest_length=design.rest_length + error * rng.normal(size=len(design.rest_length)))
    return find_equilibrium(
        assemble(run.shell.network(other)), run.states["initial"]["none"], run.loads["none"], on_branch=True
    ).state


def test_a_survey_becomes_turns_for_the_crew_and_the_next_one_goes_on_from_there(folder, run, tmp_path):
    crossings = run.shell.net.grid.crossing_nodes[:, 1]
    true = as_built(run, 0.5e-3)
    seen = true.positions[crossings] + NOISE * np.random.default_rng(1).normal(size=(len(crossings), 3))
    named = written(
        tmp_path / "named.csv",
        "x,crossing,y,z",
        [(1e3 * x, k, 1e3 * y, 1e3 * z) for k, (x, y, z) in enumerate(seen)],
    )
    limits = ["--length-error", 0.0005, "--cables", 25, "--largest", 0.001]
    result = shellform("survey", folder, named, "--unit", "mm", *limits, "--output", tmp_path)
    assert result.returncode == 0, result.stderr
    assert "cables to turn" in result.stdout
    with (tmp_path / "turns.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert 5 < len(rows) <= 25
    assert max(abs(int(row["turns"])) for row in rows) <= 4
    for row in rows:
        assert float(row["change [mm]"]) == pytest.approx(0.25 * int(row["turns"]))
    with (tmp_path / "predicted.csv").open(encoding="utf-8", newline="") as file:
        shape = list(csv.DictReader(file))
    before, after = (
        np.array([float(row[f"distance {when} [mm]"]) for row in shape]) for when in ("before", "after")
    )
    assert (after**2).sum() < 0.3 * (before**2).sum()
    # The grid as built, turned as told, comes nearer to the design.
    lengths = run.designs["initial"].rest_length + 0.5e-3 * np.random.default_rng(5).normal(
        size=len(run.shell.cable_ends)
    )
    for row in rows:
        lengths[int(row["cable"])] += 1e-3 * float(row["change [mm]"])
    turned = replace(run.designs["initial"], rest_length=lengths)
    there = find_equilibrium(
        assemble(run.shell.network(turned)), true, run.loads["none"], on_branch=True
    ).state
    goal = run.states["initial"]["none"].positions
    assert ((there.positions - goal) ** 2).sum() < 0.4 * ((true.positions - goal) ** 2).sum()
    # Points in the scanner's axes and in any order tell the same, the second round starts from what the first
    # has learnt.
    cloud = (
        np.random.default_rng(2).permutation(there.positions[crossings])
        @ Rotation.random(random_state=3).as_matrix()
        + 1.0
    )
    loose = written(tmp_path / "cloud.csv", "x;y;z".replace(";", ","), cloud)
    told = onsite.survey(
        folder,
        loose,
        onsite.Survey(cables=25, largest=0.001, length_error=5e-4, after=tmp_path / "belief-1.npz"),
        tmp_path,
    )
    assert "176 nodes were seen" in told.lines[0]
    # Told again, the second round is the same; the third goes on from what it left.
    again = onsite.survey(
        folder,
        loose,
        onsite.Survey(cables=25, largest=0.001, length_error=5e-4, after=tmp_path / "belief-1.npz"),
        tmp_path,
    )
    assert (again.lines, again.files) == (told.lines, told.files)
    assert [file.name for file in told.files] == ["turns.csv", "predicted.csv", "belief-2.npz"]
    third = onsite.survey(folder, loose, onsite.Survey(after=tmp_path / "belief-2.npz"), tmp_path)
    assert third.files[-1].name == "belief-3.npz"


def test_a_survey_overwrites_nothing_that_it_reads_and_goes_on_from_beliefs_without_a_round(
    folder, run, tmp_path
):
    crossings = run.shell.net.grid.crossing_nodes[:, 1]
    seen = run.states["initial"]["none"].positions[crossings]
    file = written(
        tmp_path / "survey.csv", "x,crossing,y,z", [(x, k, y, z) for k, (x, y, z) in enumerate(seen)]
    )
    onsite.survey(folder, file, onsite.Survey(), tmp_path)
    with np.load(tmp_path / "belief-1.npz") as kept:
        old = {name: each for name, each in kept.items() if name != "round"}
    before = (tmp_path / "predicted.csv").read_bytes()
    for name, measured in (("belief-2.npz", file), ("belief.npz", tmp_path / "predicted.csv")):
        np.savez(tmp_path / name, **old)
        options = onsite.Survey(after=tmp_path / name)
        with pytest.raises(InputError, match=r"would be overwritten.*another name.*another --output"):
            onsite.survey(folder, measured, options, tmp_path)
    assert (tmp_path / "predicted.csv").read_bytes() == before
    # What it says to do does: another name, or another folder.
    (tmp_path / "belief-2.npz").rename(tmp_path / "monday.npz")
    told = onsite.survey(folder, file, onsite.Survey(after=tmp_path / "monday.npz"), tmp_path)
    assert told.files[-1] == tmp_path / "belief-2.npz"
    onsite.survey(folder, tmp_path / "predicted.csv", onsite.Survey(), tmp_path / "other")


def test_calibration_erection_and_replays_overwrite_nothing_that_they_read(folder, run, tmp_path):
    crossings = run.shell.net.grid.crossing_nodes[:, 1]
    points = run.states["initial"]["none"].positions[crossings]
    scan = written(tmp_path / "calibration.csv", "x,y,z", points)
    force = written(tmp_path / "erection.csv", "crossing,fz", [(0, -0.1)])
    marks = written(tmp_path / "replay.csv", "crossing", [(k,) for k in range(0, 170, 4)])
    before = [file.read_bytes() for file in (scan, force, marks)]
    for read in (
        lambda: onsite.calibrate(folder, [f"{scan}=none"], placed=True, output=tmp_path),
        lambda: onsite.calibrate(folder, [f"{marks}={scan}"], placed=True, output=tmp_path),
        lambda: onsite.erect(folder, load=str(force), output=tmp_path),
        lambda: onsite.erect(folder, by="scaffold", props=str(force), output=tmp_path),
        lambda: onsite.replay(
            folder, onsite.Survey(), rounds=1, seed=0, slip=0.0, markers=marks, output=tmp_path
        ),
    ):
        with pytest.raises(InputError, match="is read and would be overwritten"):
            read()
    assert [file.read_bytes() for file in (scan, force, marks)] == before


def test_the_loop_of_survey_and_turns_can_be_replayed_with_noise(folder, tmp_path):
    marks = written(tmp_path / "marks.csv", "crossing", [(k,) for k in range(0, 176, 4)])
    result = shellform(
        "survey", folder, "--replay", 2, "--length-error", 0.0005, "--markers", marks, "--output", tmp_path
    )
    assert result.returncode == 0, result.stderr
    with (tmp_path / "replay.csv").open(encoding="utf-8", newline="") as file:
        rms = [float(row["rms distance from the design [mm]"]) for row in csv.DictReader(file)]
    assert len(rms) == 3
    assert rms[-1] < 0.6 * rms[0]


def test_erection_is_told_step_by_step(folder, run, tmp_path):
    halves = written(
        tmp_path / "groups.csv", "cable,group", [(k, 1 + (k > 140)) for k in range(len(run.shell.cable_ends))]
    )
    result = shellform(
        "erect", folder, "--load", "design", "--groups", halves, "--step", 0.25, "--output", tmp_path
    )
    assert result.returncode == 0, result.stderr
    with (tmp_path / "erection.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    stages = list(dict.fromkeys(row["stage"] for row in rows))
    assert stages == ["moving supports", "tightening group 1", "tightening group 2", "loading"]
    assert max(float(row["stress/strength"]) for row in rows) < 1.0
    with np.load(tmp_path / "erection.npz") as shapes:
        assert shapes["positions"].shape == (len(rows), run.net.node_count, 3)
        np.testing.assert_allclose(
            shapes["positions"][-1], run.states["initial"]["design"].positions, atol=1e-6
        )


def test_erection_by_a_scaffold_tells_what_that_bears(folder, run, tmp_path):
    props = written(tmp_path / "props.csv", "crossing", [(k,) for k in range(0, 170, 3)])
    result = shellform(
        "erect", folder, "--by", "scaffold", "--props", props, "--tighten-first", "--step", 0.5,
        "--output", tmp_path,
    )  # fmt: skip
    assert result.returncode == 0, result.stderr
    assert "the scaffold pushes crossings up with up to" in result.stdout
    with (tmp_path / "erection.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    stages = list(dict.fromkeys(row["stage"] for row in rows))
    assert stages == ["raising", "drawing in", "pinning", "tightening", "lowering"]
    assert 0 < max(int(row["crossings held down"]) for row in rows) < 57
    with np.load(tmp_path / "erection.npz") as shapes:
        np.testing.assert_allclose(
            shapes["positions"][-1], run.states["initial"]["none"].positions, atol=1e-6
        )


def test_groups_count_cables_as_drawings_do(shell, tmp_path):
    design = replace(shell.design(), present=np.arange(len(shell.cable_ends)) % 3 == 1)
    last = int(design.present.sum()) - 1
    file = written(tmp_path / "groups.csv", "cable,group", [(last, 1), (0, 2), (1, 1)])
    first, second = measurements.read_groups(file, design)
    assert (first.tolist(), second.tolist()) == ([3 * last + 1, 4], [1])
    with pytest.raises(InputError, match=f"from 0 to {last}"):
        measurements.read_groups(written(file, "cable,group", [(last + 1, 1)]), design)


def test_erection_by_way_points_and_under_weight(folder, run, tmp_path):
    from shellform.site.erection import laid_out

    supports = run.net.supports
    half = 0.5 * (laid_out(run.shell).positions + run.shell.target.positions)
    way = written(tmp_path / "way.csv", "stop,node,x,y,z", [(1, node, *half[node]) for node in supports])
    weight = written(tmp_path / "weight.csv", "crossing,fz", [(k, -0.002) for k in range(20)])
    told = onsite.erect(folder, design="unbraced", way=way, weight=str(weight), step=0.5, output=tmp_path)
    assert told.lines[0].startswith("5 steps: moving supports")


def test_scans_become_connector_stiffness(folder, run, tmp_path):
    shell, rng = run.shell, np.random.default_rng(4)
    crossings = shell.net.grid.crossing_nodes[:, 1]
    marks = crossings[np.linspace(0, len(crossings) - 1, 42).astype(int)]
    markers = written(tmp_path / "markers.csv", "node", [(node,) for node in marks])
    place = shell.target.positions[crossings]
    half = written(
        tmp_path / "half.csv", "crossing,fz", [(k, -1.0) for k in np.flatnonzero(place[:, 0] > 0.0)]
    )
    side = written(tmp_path / "side.csv", "crossing,fx,fy", [(k, 0.4, 0.2) for k in range(len(crossings))])
    true = replace(
        shell,
        joint=replace(shell.joint, torsion=1.3 * shell.joint.torsion, bending=0.9 * shell.joint.bending),
    )
    scans = []
    for number, file in enumerate((half, side)):
        import shellform as sf

        load = measurements.read_loads(file, shell)
        state = sf.follow(true, shell.unbraced(), {"one": load}, stay=True)["one"].equilibrium.state
        points = rng.permutation(state.positions[marks] + NOISE * rng.normal(size=(42, 3)))
        scans.append(f"{written(tmp_path / f'scan{number}.csv', 'x,y,z', points)}={file}")
    result = shellform("calibrate", folder, *scans, "--markers", markers, "--placed", "--output", tmp_path)
    assert result.returncode == 0, result.stderr
    joint = tomllib.loads((tmp_path / "calibration.toml").read_text(encoding="utf-8"))["joint"]
    assert joint["torsion"] == pytest.approx(1.3 * shell.joint.torsion, rel=0.01)
    assert joint["bending"] == pytest.approx(0.9 * shell.joint.bending, rel=0.03)
    assert joint["axial"] == shell.joint.axial
    assert "axial was held" in result.stdout
    with (tmp_path / "calibration.csv").open(encoding="utf-8-sig", newline="") as table:
        rows = list(csv.DictReader(table))[: len(marks)]
    upper = {int(node): k for k, node in enumerate(crossings)}
    assert [(int(row["node"]), int(row["crossing"])) for row in rows] == [
        (m, upper[m]) for m in marks.tolist()
    ]
    for row in rows:  # as the drawings name its upper rod
        direction, number = row["rod"][0], int(row["rod"][1:])
        rod = shell.net.grid.rods[number]
        assert direction == "V"
        assert rod.direction == "v"
        assert int(row["node"]) in rod.nodes
    assert (
        (tmp_path / "calibration.csv")
        .read_text(encoding="utf-8")
        .startswith("pos.,node,crossing,rod,1 start,1,2 start,2")
    )
    # The same from the case file alone.
    told = onsite.calibrate(
        folder / "case.toml", scans[:1], markers=markers, placed=True, free=["torsion"], output=tmp_path
    )
    assert any(line.startswith("torsion = ") for line in told.lines)


def test_a_calibration_takes_the_rods_that_were_built_before_their_cables_unless_a_design_is_named(
    folder, run, monkeypatch, tmp_path
):
    start = run.designs["initial"]
    built = replace(start, radius=0.8 * start.radius, rest_length=0.99 * start.rest_length)
    monkeypatch.setattr(
        site_sources, "read_run", lambda _: replace(run, designs={**run.designs, "polished": built})
    )
    for name, radius, cables in (
        (None, built.radius, 0),
        ("polished", built.radius, len(start.present)),
        ("unbraced", start.radius, 0),
    ):
        taken = site_sources.scanned(folder, name, tmp_path, allow_scripts=False).design
        assert (taken.radius, taken.present.sum()) == (radius, cables)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "no points"),
        ("# nothing but this\n", "no points"),
        ("crossing,x,y,z\n", "no rows"),
        ("crossing,x,y\n0,0,0\n", "no column 'z'"),
        ("crossing,x,y,z,x\n0,0,0,0,0\n", "two columns 'x'"),
        ("crossing,x,y,z\n0,0,0,0,0\n", "line 2.*5 cells for 4"),
        ("crossing,x,y,z\n0,0,zero,0\n", "line 2: y.*number"),
        ("crossing,x,y,z\n0,0,inf,0\n", "line 2: y.*finite"),
        ("crossing,x,y,z\n1.5,0,0,0\n", "line 2: crossing.*whole number"),
        ("# by hand\ncrossing,x,y,z\n999,0,0,0\n", "line 3: crossing.*from 0 to 175"),
        ("crossing,x,y,z\n3,0,0,0\n3,0,0,0\n", "line 3: crossing.*twice"),
        ("crossing,x,y,z\n,0,0,0\n", "line 2: crossing.*number"),
        ("crossing,x,y,z\n3,,,\n", "no node was seen"),
        ("crossing,x,y,z\n3,180,60,40\n", "more than half a spacing"),
        ("x,y,z\n0,0,0\n0,0,1\n", "at least 4 points"),
        ("x,y,z\n0,0,0\n0,0,1\n1,0,0\n5,5,5\n1,1,1\n", "markers are found"),
    ],
)
def test_bad_surveys_are_refused_by_file_line_and_column(folder, tmp_path, text, said):
    file = tmp_path / "survey.csv"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=said):
        onsite.survey(folder, file, onsite.Survey(), tmp_path)


def test_bad_tables_of_loads_groups_and_ways_are_refused(folder, run, tmp_path):
    shell, node = run.shell, int(run.net.supports[0])
    with pytest.raises(InputError, match="fx, fy or fz"):
        measurements.read_loads(written(tmp_path / "a.csv", "node", [(1,)]), shell)
    with pytest.raises(InputError, match="'node' or 'crossing'"):
        measurements.read_loads(written(tmp_path / "a.csv", "fz", [(1,)]), shell)
    with pytest.raises(InputError, match="there is no such file"):
        measurements.read_loads(tmp_path / "none.csv", shell)
    with pytest.raises(InputError, match="there is no such file"):
        measurements.read_table(tmp_path / "none.csv", ("x",))
    with pytest.raises(InputError, match="is empty"):
        measurements.read_table(written(tmp_path / "a.csv", "# nothing", []), ("x",))
    (tmp_path / "a.csv").write_text('node,fz\n1,-5.0\n"2,-5.0\n3,-5.0\n', encoding="utf-8")
    with pytest.raises(InputError, match=r"line 3: can't be parted into cells.*Close its quotation marks"):
        measurements.read_loads(tmp_path / "a.csv", shell)
    with pytest.raises(InputError, match="line 2: cable"):
        measurements.read_groups(written(tmp_path / "a.csv", "cable,group", [(-1, 1)]), shell.design())
    with pytest.raises(InputError, match="is no support"):
        measurements.read_way(
            written(
                tmp_path / "a.csv",
                "stop,node,x,y,z",
                [(1, int(shell.net.grid.crossing_nodes[0, 0]), 0, 0, 0)],
            ),
            shell,
        )
    with pytest.raises(InputError, match="twice in one stop"):
        measurements.read_way(written(tmp_path / "a.csv", "stop,node,x,y,z", [(1, node, 0, 0, 0)] * 2), shell)
    with pytest.raises(InputError, match="lacks 63 supports"):
        measurements.read_way(written(tmp_path / "a.csv", "stop,node,x,y,z", [(1, node, 0, 0, 0)]), shell)
    with pytest.raises(InputError, match="every cable of the design once"):
        onsite.erect(folder, groups=written(tmp_path / "a.csv", "cable,group", [(0, 1)]), step=1.0)


def test_bad_options_are_refused(folder, tmp_path):
    good = written(tmp_path / "survey.csv", "x,y,z", [(0, 0, 0)])
    for options, said in (
        ({"noise": 0.0}, "--noise"),
        ({"noise": 1e308}, "--noise"),  # its square is no number
        ({"length_error": -1.0}, "--length-error"),
        ({"length_error": 1e308}, "--length-error"),
        ({"load": "storm"}, "--load"),
        ({"design": "best"}, "--design"),
        ({"after": tmp_path / "none.npz"}, "no such file"),
    ):
        with pytest.raises(InputError, match=said):
            onsite.survey(folder, good, onsite.Survey(**options))
    for crew, said in (
        ({"step": 0.0}, "--step"),
        ({"cables": 0}, r"crew\.cables"),
        ({"step": 0.1}, "more than the largest"),
    ):
        with pytest.raises(InputError, match=said):
            onsite.replay(folder, onsite.Survey(**crew), rounds=1, seed=0, slip=0.0)
    with pytest.raises(InputError, match="--replay"):
        onsite.replay(folder, onsite.Survey(), rounds=0, seed=0, slip=0.0)
    with pytest.raises(InputError, match="--slip"):
        onsite.replay(folder, onsite.Survey(), rounds=1, seed=0, slip=-1.0)
    named = written(tmp_path / "named.csv", "crossing,x,y,z", [(0, 0, 0, 0)])
    with pytest.raises(InputError, match="--unit"):
        onsite.survey(folder, named, onsite.Survey(unit="league"))
    with pytest.raises(InputError, match=r"scan\.unit"):
        onsite.survey(folder, good, onsite.Survey(unit="league"))
    foreign = tmp_path / "foreign.npz"
    np.savez(foreign, a=1)
    with pytest.raises(InputError, match=r"not left by shellform survey.*belief-1\.npz"):
        onsite.survey(folder, good, onsite.Survey(after=foreign))
    names = ("rest_length", "present", "radius", "covariance", "positions", "quaternions")
    np.savez(foreign, **dict.fromkeys(names, 1), origin="initial/wet")
    with pytest.raises(InputError, match=r"another design or load case.*--design and --load"):
        onsite.survey(folder, good, onsite.Survey(after=foreign))
    with pytest.raises(InputError, match="neither a load case nor a file"):
        onsite.calibrate(folder, [f"{good}=storm"])
    with pytest.raises(InputError, match="--noise"):
        onsite.calibrate(folder, [f"{good}=none"], noise=0.0)
    with pytest.raises(InputError, match="isn't a connector's stiffness"):
        onsite.calibrate(folder, [f"{good}=none"], free=["gap"])
    with pytest.raises(InputError, match="--design"):
        onsite.calibrate(folder / "case.toml", [f"{good}=none"], design="initial")
    blocked = tmp_path / "file"
    blocked.write_text("", encoding="utf-8")
    with pytest.raises(InputError, match="can't be written"):
        onsite.erect(folder, design="unbraced", step=1.0, output=blocked)
    refused(shellform("survey", folder), "either a survey or --replay")
    refused(shellform("erect", tmp_path), "is no run folder")
    refused(shellform("erect", folder, "--step", 0), "erect.step")
    refused(shellform("erect", folder, "--by", "balloon"), "Known: supports, scaffold")
    refused(shellform("erect", folder, "--by", "supports", "--tighten-first"), "goes with a scaffold")
    refused(shellform("erect", folder, "--step", "1e-300"), "erect.step: must be between 0.0001 and 1")
    refused(shellform("calibrate", folder), "Missing argument")
    refused(shellform("calibrate", folder, f"{good}=none", "--free", "gap"), "isn't a connector's stiffness")
    assert json.loads((folder / "summary.json").read_text(encoding="utf-8"))["designs"].keys() == {
        "unbraced",
        "initial",
    }
