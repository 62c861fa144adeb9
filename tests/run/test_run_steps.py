"""Single steps of a run, without running it: what is outdated, when a design deforms too much, and what keys
depend on."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from shellform.case.case import make_case
from shellform.errors import InputError, NotConverged
from shellform.gridshell.catalogue import read_catalogue
from shellform.net.refusal import Stalled
from shellform.records.progress import Kind
from shellform.records.stages import STAGES
from shellform.records.summary import VerdictRecord
from shellform.run import run as module
from shellform.run.keys import stage_keys
from shellform.run.sketch import STAGES_OF_SKETCH
from tests.records.made import design, load, optimisation, summary

VERDICT = VerdictRecord("polished", True, (), ())


@pytest.mark.parametrize("stage", STAGES)
def test_what_a_stage_and_those_after_it_find_anew_is_outdated_and_nothing_before(stage):
    names = ("initial", "optimised", "polished")
    examined = design("design", critical_factor=1.3, critical_sought=2.0)
    given = replace(
        summary(names), designs=dict.fromkeys(names, examined), verdict=VERDICT, optimisation=optimisation()
    )
    given = replace(given, seconds={**dict.fromkeys(STAGES, 2.0), "total": 2.0 * len(STAGES)})
    left, at = module.outdated(given, stage), STAGES.index(stage)
    assert left.seconds == {**dict.fromkeys(STAGES[:at], 2.0), "total": 2.0 * at}
    assert (left.model is None) == (at <= STAGES.index("initial"))
    if at <= STAGES.index("initial"):
        assert left.designs == {}
    elif stage == "optimise":
        assert list(left.designs) == ["initial"]
    else:
        assert list(left.designs) == list(names)
    assert (left.optimisation is None) == (at <= STAGES.index("optimise"))
    assert (left.verdict is None) == (at <= STAGES.index("safety"))
    for each in left.designs.values():
        assert (each.loads["design"].critical_factor is None) == (at <= STAGES.index("safety"))


def test_what_was_mended_in_the_surface_is_told_in_the_run_that_reads_it_and_not_again(monkeypatch, tmp_path):
    mended = (
        "2 edges were toothed and were smoothed, by 0.013 m at most",
        "coordinates count from (7, 8, 0) m",
    )
    surface, told = SimpleNamespace(mended=mended), []
    workspace = SimpleNamespace(
        case=SimpleNamespace(surface=SimpleNamespace(file="hall.obj")),
        say=lambda stage, text, kind: told.append((stage, text, kind)),
        path=tmp_path.joinpath,
    )
    monkeypatch.setattr(module, "doubts", lambda case, surface: ())
    monkeypatch.setattr(module, "save_surface", lambda path, surface: None)
    monkeypatch.setattr(module, "surface_record", lambda surface, file: None)
    for keep in (False, True):
        module._surface(workspace, SimpleNamespace(surface=surface), summary(("polished",)), keep)
    assert told == [("surface", each, Kind.NOTE) for each in mended]


def test_the_stages_that_are_wanted_end_with_the_one_that_is_named_and_a_sketch_has_fewer():
    for sketch, every in ((False, STAGES), (True, [each for each in STAGES if each in STAGES_OF_SKETCH])):
        workspace = SimpleNamespace(sketch=sketch)
        assert module._wanted(workspace) == list(every)
        assert module._wanted(workspace, "net") == ["surface", "net"]
    assert module._wanted(SimpleNamespace(sketch=False), "safety")[-1] == "safety"


@pytest.mark.parametrize(
    ("on_branch", "deviation", "holds"),
    [(True, 0.9, True), (True, 0.91, False), (False, 0.1, False)],
)
def test_an_initial_design_that_comes_off_by_a_tenth_of_the_span_or_snaps_through_ends_the_run(
    monkeypatch, tmp_path, on_branch, deviation, holds
):
    """The surface is 9 m long, 4 m wide and 20 m high."""
    network = SimpleNamespace(
        nodes=np.zeros((7, 3)),
        beams=SimpleNamespace(ends=np.zeros((5, 2))),
        cables=SimpleNamespace(ends=np.zeros((3, 2))),
    )
    shell = SimpleNamespace(
        joint=None, rod=None, net=None, design=lambda rest_ratio: ("start", rest_ratio),
        network=lambda start: network, unbraced=lambda: "bare",
    )  # fmt: skip
    kept = []
    given = summary(["initial"])
    given = replace(given, surface=replace(given.surface, size=(9.0, 4.0, 20.0)))

    def keep(workspace, shell, name, own, reached, loads, so_far):
        kept.append((name, own))
        rows = {
            **design().loads,
            "design": load("design", on_branch=on_branch, deviation_max=deviation),
        }
        return so_far.with_design(name, design(loads=rows))

    monkeypatch.setattr(module, "gridshell", lambda *_: (shell, {"design": 1}))
    monkeypatch.setattr(module, "write_case", lambda *_: None)
    monkeypatch.setattr(module, "default_tolerances", lambda shell: None)
    monkeypatch.setattr(module, "rod_limits", lambda *_: SimpleNamespace(radius_max=1.0))
    monkeypatch.setattr(module, "with_rods", lambda record, rods: record)
    monkeypatch.setattr(module, "joint_doubts", lambda *_: [])
    monkeypatch.setattr(module, "rod_sizes", lambda *_: SimpleNamespace(named="rod.section"))
    monkeypatch.setattr(module.designs, "forget", lambda folder, names, so_far: so_far)
    monkeypatch.setattr(module.designs, "followed", lambda *_: {})
    monkeypatch.setattr(module.designs, "keep", keep)
    case = SimpleNamespace(rod=None, cable=SimpleNamespace(rest_ratio=0.98, without=True))
    workspace = SimpleNamespace(
        case=case, folder=tmp_path, path=lambda name: tmp_path / name, say=lambda *_: None
    )
    parts = module.Parts(surface="surface", net="net")
    if holds:
        found = module._initial(workspace, parts, given, keep=False).summary
        assert (found.model.nodes, found.model.beams, found.model.cables, found.model.freedoms) == (
            7,
            5,
            3,
            42,
        )
        assert kept == [("unbraced", "bare"), ("initial", ("start", 0.98))]
        case.cable.without = False
        module._initial(workspace, parts, given, keep=False)
        assert [name for name, _ in kept] == ["unbraced", "initial", "initial"]
        module._initial(workspace, parts, given, keep=True)
        assert len(kept) == 3
        return
    with pytest.raises(NotConverged, match=f"{1e3 * deviation:.0f} mm") as refused:
        module._initial(workspace, parts, given, keep=False)
    assert "thicker rods (rod.section)" in refused.value.remedy


def test_a_net_that_is_refused_is_to_be_rounded_to_three_of_its_spacings(monkeypatch, tmp_path):
    asked = []

    def stalls(*_, **__):
        raise Stalled("stalls", residual=0.1, iterations=3)

    def way_out(error, surface, radius, folder, again, say):
        asked.append((error.what, surface, radius, folder))
        return InputError("with a way out", where="net")

    monkeypatch.setattr(module, "net_of", stalls)
    monkeypatch.setattr(module, "with_way_out", way_out)
    workspace = SimpleNamespace(
        case=SimpleNamespace(net=SimpleNamespace(spacing=0.4)), path=tmp_path.joinpath, say=print
    )
    with pytest.raises(InputError, match="with a way out"):
        module._net(workspace, module.Parts(surface="surface"), summary(["initial"]), keep=False)
    assert asked == [("stalls", "surface", pytest.approx(1.2), tmp_path / module.BUILDABLE)]


CASE = {
    "surface": {"file": "shell.obj"},
    "net": {"spacing": 0.5},
    "rod": {"young": 40e9, "strength": 255e6, "radius": 0.01},
    "cable": {"stiffness": 1e4, "force_max": 1e3},
    "load": {"force": 100.0},
    "optimise": {"misfit_rms_additional": 0.1},
}


def changed(tmp_path, *, sketch=False, **tables):
    """The first stage whose key is another than that of the case as it is."""
    (tmp_path / "shell.obj").touch()

    def keys(more, sketch=False):
        merged = {**CASE, **{name: {**CASE.get(name, {}), **table} for name, table in more.items()}}
        return stage_keys(make_case(merged, tmp_path / "case.toml"), sketch=sketch)

    one, other = keys({}), keys(tables, sketch)
    differ = [stage for stage in STAGES if one[stage] != other[stage]]
    assert differ == list(STAGES[len(STAGES) - len(differ) :]), "and all after it"
    return differ[0] if differ else None


@pytest.mark.parametrize(
    ("tables", "stage"),
    [
        ({}, None),
        ({"surface": {"size": 0.1}}, "surface"),
        ({"net": {"angle": 30.0}}, "net"),
        ({"edges": {"outer": "wall"}}, "net"),
        ({"edges": {"beam": {"rods": 7}}}, "initial"),
        ({"rod": {"radius": 0.011}}, "net"),  # whose joint follows
        ({"cable": {"rest_ratio": 0.98}}, "initial"),
        ({"cable": {"adjustment": 0.01}}, "documents"),
        ({"rod": {"kerf": 0.004}}, "documents"),
        ({"limits": {"uplift": 1.0}}, "optimise"),
        ({"safety": {"seed": 3}}, "optimise"),
        ({"safety": {"drawn": 201}}, "safety"),  # a search draws 200 at the most
        ({"safety": {"drawn": 199}}, "optimise"),
        ({"safety": {"confidence": 0.9}}, "safety"),
        ({"safety": {"rare": 200}}, "safety"),
        ({"limits": {"built_deviation": 0.01}}, "safety"),  # by which designs are judged, not searched
        ({"figures": {"limit": 0.01}}, "figures"),
        ({"title_block": {"revision": "B"}}, "documents"),
    ],
)
def test_a_changed_entry_is_found_anew_from_the_first_stage_on_that_depends_on_it(tmp_path, tables, stage):
    assert changed(tmp_path, **tables) == stage


def test_the_designs_of_a_sketch_are_no_others(tmp_path):
    assert changed(tmp_path, sketch=True) == "initial"
    (tmp_path / "shell.obj").write_text("v 0 0 0\n", encoding="utf-8")
    assert changed(tmp_path, sketch=True) == "initial"


def test_a_surface_is_another_where_a_buffer_beside_its_scene_is_and_may_lie_anywhere(tmp_path):
    """Its buffers: one in the file, one beside it, and one that isn't there."""
    uris = ["data:application/octet-stream;base64,AAAA", "dome.bin", "x" * 300]
    scene = json.dumps({"buffers": [{"uri": uri, "byteLength": 3} for uri in uris]})
    found = []
    for place, content in (("one", b"abc"), ("two", b"abc"), ("two", b"abcd")):
        (tmp_path / place).mkdir(exist_ok=True)
        (tmp_path / place / "shell.gltf").write_text(scene, encoding="utf-8")
        (tmp_path / place / "dome.bin").write_bytes(content)
        case = make_case({**CASE, "surface": {"file": f"{place}/shell.gltf"}}, tmp_path / "case.toml")
        found.append(stage_keys(case))
    assert found[0] == found[1]
    assert all(found[1][stage] != found[2][stage] for stage in STAGES)


def test_designs_depend_on_what_stands_in_the_case_s_own_catalogue(tmp_path):
    (tmp_path / "shell.obj").touch()
    shipped = Path(read_catalogue.__code__.co_filename).parent.parent / "catalogues/gfrp_rods.toml"
    stock = shipped.read_text(encoding="utf-8")
    tables = {**CASE, "rod": {"catalogue": "ours.toml", "section": "8 mm"}}
    found = []
    for text in (stock, f"{stock}\n# and more\n"):
        (tmp_path / "ours.toml").write_text(text, encoding="utf-8")
        found.append(stage_keys(make_case(tables, tmp_path / "case.toml")))
    one, other = found
    assert [stage for stage in STAGES if one[stage] == other[stage]] == ["surface", "net"]


def test_the_case_s_own_catalogues_are_the_same_wherever_they_lie(tmp_path):
    """The rods', the one that is rounded to and the edge beams'."""
    shipped = Path(read_catalogue.__code__.co_filename).parent.parent / "catalogues/gfrp_rods.toml"
    tables = {
        **CASE,
        "rod": {"catalogue": "ours.toml", "section": "8 mm"},
        "optimise": {
            **CASE["optimise"],
            "catalogue": "ours.toml",
            "misfit": 0.6,
            "cable_force": 0.3,
            "rod_radius": 0.1,
        },
        "edges": {"beam": {"catalogue": "ours.toml", "section": "12 mm"}},
    }
    found = []
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "shell.obj").touch()
        (tmp_path / name / "ours.toml").write_bytes(shipped.read_bytes())
        found.append(stage_keys(make_case(tables, tmp_path / name / "case.toml")))
    assert found[0] == found[1]
