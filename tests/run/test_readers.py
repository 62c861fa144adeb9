"""The scripts that open a run in Blender and in Grasshopper, run in plain Python against a run folder, with
stand-ins for what these programs bring."""

import json
import math
import shutil
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

from shellform.net.grid import rod_names
from shellform.output.exchange import vtp
from shellform.output.exchange.run_readers import PROGRAMS, reader, write_readers
from shellform.problem.paths import deviations
from shellform.run.folder import read_run


@pytest.fixture(scope="module")
def folder(begun, tmp_path_factory):
    return Path(shutil.copytree(begun, tmp_path_factory.mktemp("read") / "run"))


def ran(program, **names):
    given = {"__name__": "read", **names}
    exec(compile(reader(program), program, "exec"), given)
    return SimpleNamespace(**given)


def written_run(folder, designs, shown, places, lines, *, rods, supports):
    """What the scripts read of a run folder."""
    summary = {"designs": {name: {"rod_radius": 0.01} for name in designs}}
    net = {"rods": [{"direction": "u"}] * rods, "supports": supports}
    for name, content in (("summary", summary), ("net", net)):
        (folder / f"{name}.json").write_text(json.dumps(content), encoding="utf-8")
    (folder / "states").mkdir()
    vtp.write_lines(
        folder / f"states/{shown}-design.vtp", places, lines, np.zeros((0, 2), dtype=int),
        {"deviation": np.zeros(len(places))}, {"cable_force": np.zeros(len(lines))},
    )  # fmt: skip


@pytest.mark.parametrize("program", PROGRAMS)
def test_the_scripts_stand_alone(program):
    text = reader(program)
    assert "shellform" not in [
        line.split()[1] for line in text.splitlines() if line.startswith(("import", "from"))
    ]
    assert 'f"' not in text, "Rhino 7 runs Python 2.7"


def test_rods_and_cables_are_those_of_the_run_with_their_names_and_numbers(folder):
    run = read_run(folder)
    found = ran("blender").read_run(str(folder))
    assert found["design"] == run.best
    state, grid = run.states[run.best]["design"], run.net.grid
    off = deviations(run.shell, state)
    assert [rod["name"] for rod in found["rods"]] == rod_names(grid)
    for told, rod in zip(found["rods"], grid.rods, strict=True):
        assert np.array(told["points"]) == pytest.approx(state.positions[rod.nodes])
        assert told["deviation"] == pytest.approx(off[rod.nodes].tolist())
    cables = run.shell.cables(run.designs[run.best])
    assert [cable["force"] for cable in found["cables"]] == pytest.approx(cables.tension(state).tolist())
    assert [cable["name"] for cable in found["cables"]] == [f"C{k}" for k in range(len(cables.ends))]
    assert found["radius"] == run.designs[run.best].radius
    other = ran("blender").read_run(str(folder), "unbraced", "none")
    assert not other["cables"]
    with pytest.raises(IOError, match="name a design and a load"):
        ran("blender").read_run(str(folder), "unbraced", "snow")


@pytest.mark.parametrize(
    ("made", "shown"),
    [
        (("unbraced", "initial", "optimised", "polished", "unloaded"), "polished"),
        (("unbraced", "initial", "optimised", "unloaded"), "optimised"),
        (("unbraced", "initial"), "initial"),
    ],
)
def test_of_a_run_that_was_not_judged_the_last_design_is_shown_and_never_the_one_to_compare_with(
    tmp_path, made, shown
):
    written_run(tmp_path, made, shown, [[0, 0, 0], [1, 0, 0]], [[0, 1]], rods=1, supports=[])
    assert ran("blender").read_run(str(tmp_path))["design"] == shown


def test_edge_beams_that_meet_in_a_foot_are_drawn_each_for_itself(tmp_path):
    """A rod, two edge beams from foot to foot that share one, and a ring."""
    places = [[0, 0, 0], [1, 0, 1], [2, 0, 0], [3, 0, 1], [4, 0, 0], [0, 1, 1], [1, 1, 1], [1, 2, 1]]
    lines = [[5, 6], [0, 1], [1, 2], [2, 3], [3, 4], [5, 6], [6, 7], [7, 5]]
    written_run(
        tmp_path, ("initial",), "initial", places, lines, rods=1, supports=[places[k] for k in (0, 2, 4)]
    )
    found = ran("blender").read_run(str(tmp_path))["rods"]
    assert [(rod["name"], rod["nodes"]) for rod in found] == [
        ("U0", [5, 6]), ("E0", [0, 1, 2]), ("E1", [2, 3, 4]), ("E2", [5, 6, 7, 5]),
    ]  # fmt: skip


def test_blender_gets_a_tube_for_each_rod_and_cable(folder, monkeypatch):
    made = {"curves": [], "linked": []}

    class Thing(dict):
        def __init__(self, name, curve):
            super().__init__()
            self.name, self.curve = name, curve

    def curve(name, kind):
        points = SimpleNamespace(count=1, add=lambda n: setattr(points, "count", 1 + n))
        points.foreach_set = lambda what, values: setattr(points, "values", values)
        new = SimpleNamespace(
            name=name, splines=SimpleNamespace(new=lambda kind: SimpleNamespace(points=points))
        )
        new.points = points
        made["curves"].append(new)
        return new

    link = SimpleNamespace(link=made["linked"].append)
    data = SimpleNamespace(
        collections=SimpleNamespace(new=lambda name: SimpleNamespace(name=name, objects=link)),
        curves=SimpleNamespace(new=curve),
        objects=SimpleNamespace(new=Thing),
    )
    scene = SimpleNamespace(collection=SimpleNamespace(children=SimpleNamespace(link=lambda _: None)))
    bpy = SimpleNamespace(data=data, context=SimpleNamespace(scene=scene))
    script = ran("blender", bpy=bpy)
    found = script.read_run(str(folder))
    script.show(found)
    assert len(made["linked"]) == len(found["rods"]) + len(found["cables"])
    for each, item in zip(made["curves"], [*found["rods"], *found["cables"]], strict=True):
        assert each.points.count == len(item["points"])
        assert len(each.points.values) == 4 * len(item["points"])
    assert made["linked"][0]["off the target at most [mm]"] == 1e3 * max(found["rods"][0]["deviation"])
    assert made["linked"][-1]["force [N]"] == found["cables"][-1]["force"]


def test_grasshopper_gets_curves_in_the_document_s_unit(folder, monkeypatch):
    rhino = ModuleType("Rhino")
    rhino.RhinoMath = SimpleNamespace(UnitScale=lambda a, b: 1000.0)
    rhino.UnitSystem = SimpleNamespace(Meters="m")
    rhino.RhinoDoc = SimpleNamespace(ActiveDoc=SimpleNamespace(ModelUnitSystem="mm"))
    rhino.Geometry = SimpleNamespace(
        Point3d=lambda *p: p,
        Curve=SimpleNamespace(CreateInterpolatedCurve=lambda points, degree: points),
        LineCurve=lambda a, b: (a, b),
    )
    monkeypatch.setitem(sys.modules, "Rhino", rhino)
    found = ran("grasshopper", run=str(folder), design="", load="")
    run = read_run(folder)
    state = run.states[run.best]["design"]
    assert np.array(found.rods[0]) == pytest.approx(1e3 * state.positions[run.net.grid.rods[0].nodes])
    assert len(found.cables) == len(found.forces) == len(found.cable_names)
    assert math.dist(*found.cables[0]) == pytest.approx(
        1e3 * run.shell.cables(run.designs[run.best]).lengths(state)[0]
    )
    assert len(found.supports) == len(run.net.supports)


def test_the_scripts_are_written_beside_the_models(tmp_path):
    files = write_readers(tmp_path)
    assert [file.name for file in files] == ["blender.py", "grasshopper.py"]
    assert all(file.read_text(encoding="utf-8") == reader(file.stem) for file in files)
