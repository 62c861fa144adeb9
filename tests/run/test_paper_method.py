"""A case designed by the paper's own method."""

import json

import numpy as np
import pytest

from shellform.case.case import load_case
from shellform.errors import InputError
from shellform.run.folder import read_run
from shellform.run.run import run_case
from tests.conftest import ROOT

SETTINGS = [
    "net.spacing=0.11",
    "net.elements=2",
    "surface.size=0.03",
    "load.force=2.0",
    "cable.without=false",
    "optimise.unloaded=false",
    "optimise.evaluations=15",
    "optimise.method=paper",
]


def case(*more):
    return load_case(ROOT / "scripts/scale_model.toml", [*SETTINGS, *more])


class Killed(Exception):
    pass


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("paper") / "run"
    run_case(case(), place, until="optimise")
    return place


def test_the_paper_s_method_keeps_its_bounds_and_carries_the_design_load_unpolished(folder):
    run = read_run(folder)
    assert set(run.designs) == {"initial", "optimised"}
    start, best = run.designs["initial"], run.designs["optimised"]
    there = best.present
    assert there.sum() < start.present.sum()
    assert (best.rest_length[there] <= 1.1 * start.rest_length[there] * (1.0 + 1e-12)).all()
    assert (best.rest_length[there] >= 0.01).all()
    assert best.radius == start.radius
    told = json.loads((folder / "summary.json").read_text())
    assert told["designs"]["optimised"]["loads"]["design"]["on_branch"]
    assert told["optimisation"]["objective_end"] < 0.5
    assert told["optimisation"]["stiffness_min"] == 0.0
    assert set(told["optimisation"]["constraints"]) == {"cable_force", "misfit.additional"}


def test_the_paper_s_method_has_candidates_at_the_edge_unless_the_case_says_otherwise(folder, tmp_path):
    many = len(read_run(folder).shell.cable_ends)
    run_case(case("cable.edge_cells=false"), tmp_path / "run", until="initial")
    without = read_run(tmp_path / "run").shell.cable_ends
    assert len(without) < many
    run_case(case("optimise.method=convex"), tmp_path / "run", until="initial")
    np.testing.assert_array_equal(read_run(tmp_path / "run").shell.cable_ends, without)


def test_a_run_by_the_paper_s_method_that_is_killed_ends_with_the_same_bytes(folder, tmp_path):
    def killing(event):
        if event.text.startswith("evaluation 8/"):
            raise Killed

    with pytest.raises(Killed):
        run_case(case(), tmp_path / "run", until="optimise", report=killing)
    assert (tmp_path / "run/optimise.npz").is_file()
    run_case(case(), tmp_path / "run", until="optimise")
    assert not (tmp_path / "run/optimise.npz").exists()
    names = ["designs/optimised.json", "designs/initial.json"]
    for name in names:
        assert (tmp_path / "run" / name).read_bytes() == (folder / name).read_bytes()


def test_wishes_that_the_paper_s_method_has_no_means_for_are_refused():
    for wish in ("optimise.symmetric=true", "optimise.cables_max=20"):
        with pytest.raises(InputError, match="neither polishes nor takes cables away"):
            case(wish)
