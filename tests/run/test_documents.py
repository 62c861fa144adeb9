"""The stage that writes drawings, schedules and models of a run's best design."""

import csv
import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shellform.case.case import load_case
from shellform.errors import InputError, NotConverged
from shellform.output.workshop.schedules import TitleBlock
from shellform.records.progress import Kind
from shellform.records.stages import STAGES
from shellform.records.summary import Summary
from shellform.run import documents
from shellform.run.documents import built_design, stock_length, write_documents
from shellform.run.folder import Run
from shellform.run.keys import stage_keys
from shellform.structure.network import assemble
from shellform.structure.solve.equilibrium import find_equilibrium

ROOT = Path(__file__).parent.parent.parent
CASE = ROOT / "scripts/scale_model.toml"


@pytest.fixture(scope="module")
def run(built, vault, shell, tmp_path_factory):
    load = shell.point_load(6.9, every=2)
    loads = {"none": np.zeros_like(load), "design": load, "additional": 1.2 * load}
    states = {
        "unbraced": {name: built.hung for name in loads},
        "initial": built.states,
        "polished": built.states,
    }
    designs = {"unbraced": shell.unbraced(), "initial": shell.design(), "polished": built.design}
    case = load_case(CASE, ["rod.stock_length=0.8", "rod.kerf=0.002"])
    return Run(tmp_path_factory.mktemp("run"), case, vault, shell, loads, designs, states, Summary())


def test_all_documents_of_the_best_design_are_written_and_splices_are_said(run):
    said = []
    found = write_documents(run, report=said.append)
    names = {path.relative_to(run.folder).as_posix() for path in run.folder.rglob("*.*")}
    assert {
        f"drawings/{name}.{kind}"
        for name in ("grid", "cables", "supports", "rods")
        for kind in ("dxf", "pdf")
    } < names
    assert {
        f"schedules/{name}.csv"
        for name in ("rods", "bars", "splices", "marks", "cables", "supports", "survey")
    } < names
    assert {f"models/gridshell{end}" for end in (".vtu", ".3dm", ".glb", ".step", "-opensees.py")} < names
    assert {"schedules/schedules.xlsx", "schedules/notes.txt"} <= names
    assert not [name for name in names if ".part" in name]
    with (run.folder / "schedules/cables.csv").open(encoding="utf-8", newline="") as file:
        assert len(list(csv.DictReader(file))) == run.designs["polished"].present.sum()
    long = [k for k, rod in enumerate(run.net.grid.rods) if rod.length > 0.8]
    assert found.spliced == tuple(long)
    assert (found.design, found.stock_length) == ("polished", 0.8)
    assert [each for each in said if "SPLICED" in each.text and each.kind is Kind.NOTE]
    with (run.folder / "schedules/bars.csv").open(encoding="utf-8", newline="") as file:
        bars = list(csv.DictReader(file))
    assert found.bars == len({row["bar"] for row in bars}) >= found.bars_least
    used = sum(rod.length for rod in run.net.grid.rods)
    assert found.waste == pytest.approx(1.0 - used / (0.8 * found.bars))
    for first, then in itertools.pairwise(bars):
        if first["bar"] == then["bar"]:
            end = float(first["begins on the bar at [mm]"]) + float(first["length [mm]"])
            assert float(then["begins on the bar at [mm]"]) == pytest.approx(end + 2.0, abs=2e-3)


def test_what_is_built_is_the_best_design_with_its_cables_hung_into_the_grid_before_bracing(run):
    words = ["cable.adjustment=0.01", "title_block.date=2026-05-31", "title_block.revision=B"]
    case = load_case(CASE, [*words, "title_block.author=A. Author", "surface.origin=[1.0, 2.0, 3.0]"])
    # The rods of the end are thinner than those of the start, of which the run's unbraced state is.
    best = replace(run.designs["polished"], radius=0.8 * run.designs["polished"].radius)
    built = built_design(replace(run, case=case, designs={**run.designs, "polished": best}))
    assert (built.name, built.design, built.states) == ("polished", best, run.states["polished"])
    bare = replace(best, present=np.zeros(len(best.present), dtype=bool))
    erected = find_equilibrium(
        assemble(run.shell.network(bare)), run.shell.target, run.loads["none"], on_branch=True
    ).state
    np.testing.assert_allclose(built.hung.positions, erected.positions, atol=1e-7)
    assert np.abs(erected.positions - run.states["unbraced"]["none"].positions).max() > 1e-4
    assert (built.adjustment, built.origin, built.title) == (0.01, (1.0, 2.0, 3.0), case.title)
    assert built.block == TitleBlock("2026-05-31", "B", "A. Author")
    # Nor does it take the run's unbraced design, which a case may leave out.
    alone = {name: own for name, own in run.states.items() if name != "unbraced"}
    assert built_design(replace(run, states=alone)).hung is not None


def test_a_grid_that_comes_to_no_rest_without_cables_is_told_and_its_cables_are_hung_into_the_target(
    run, monkeypatch
):
    def astray(*_):
        raise NotConverged("It went astray", remedy="Try others.")

    monkeypatch.setattr(documents, "follow", astray)
    assert built_design(run).hung is None
    assert any("doesn't come to rest" in note for note in write_documents(run).notes)


def test_a_folder_in_which_nothing_can_be_written_is_named(run, tmp_path):
    (tmp_path / "run").write_text("in the way")
    with pytest.raises(InputError, match="can't be written"):
        write_documents(
            Run(tmp_path / "run", *(getattr(run, name) for name in list(Run.__dataclass_fields__)[1:]))
        )


def test_the_stock_is_the_case_s_or_the_catalogue_s_or_six_metres(tmp_path):
    assert stock_length(load_case(CASE)) == 6.0
    assert stock_length(load_case(CASE, ["rod.stock_length=4.0"])) == 4.0
    catalogue = tmp_path / "mine.toml"
    text = (
        "stock_length = 5.0\n[material]\nyoung = 40e9\nshear = 4e9\ndensity = 1900\n"
        "strength = 255e6\n[sizes]\nround = [0.002]\n"
    )
    catalogue.write_text(text, encoding="utf-8")
    case = CASE.read_text(encoding="utf-8").replace("../surfaces", str(ROOT / "surfaces"))
    before, _, after = case.partition("[rod]")
    (tmp_path / "case.toml").write_text(
        f'{before}[rod]\ncatalogue = "mine.toml"\n{after[after.index("[joint]") :]}', encoding="utf-8"
    )
    assert stock_length(load_case(tmp_path / "case.toml")) == 5.0
    assert stock_length(load_case(tmp_path / "case.toml", ["rod.stock_length=7.0"])) == 7.0
    catalogue.write_text(text.replace("5.0", "-5.0"), encoding="utf-8")
    with pytest.raises(InputError, match="stock_length: must be positive"):
        load_case(tmp_path / "case.toml")


def test_another_stock_length_makes_the_documents_anew_and_nothing_else():
    keys = [
        stage_keys(load_case(CASE, settings)) for settings in ([], ["rod.stock_length=4.0", "rod.kerf=0.0"])
    ]
    changed = [stage for stage in STAGES if keys[0][stage] != keys[1][stage]]
    assert changed[0] == "documents"
    assert "figures" not in changed
