"""The engineer's limits, scatter and rounding, from the case file to the summary."""

import csv
import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

import shellform as sf
from shellform.case.build_problem import case_problem, varied
from shellform.case.build_safety import case_safety, case_tolerances
from shellform.case.case import load_case
from shellform.errors import InputError, NotConverged
from shellform.gridshell.reactions import reactions
from shellform.optimiser import rounding
from shellform.records.progress import Kind
from shellform.reliability.built_misfit import PAIRS, PAIRS_OF_DEVIATIONS, built_misfit
from shellform.reliability.requirements import SEED
from shellform.run.designs import load_record
from shellform.run.folder import read_run
from shellform.run.optimising import _solver
from shellform.run.run import run_case
from shellform.structure.answers.stability import modes
from shellform.structure.elements.rotation import matrices
from shellform.structure.network import assemble

ROOT = Path(__file__).parent.parent.parent
CASE = ROOT / "scripts/scale_model.toml"
SMALL = ["surface.size=0.02", "net.spacing=0.11", "net.elements=2", "load.force=2.0"]  # half as many rods
LIMITS = [
    "limits.utilisation=0.9",
    "limits.connector_turn=0.4",
    "limits.unloaded_deviation=0.004",
    "limits.uplift=7.0",
    "limits.slack_min=0.05",
    "safety.critical_further={ additional = 1.04 }",
]


@pytest.fixture(scope="module")
def loads(shell):
    design = shell.point_load(4.0, every=2)
    return {"none": np.zeros_like(design), "design": design, "additional": 1.2 * design}


def test_every_limit_of_the_case_reaches_the_problem_under_every_load(shell, loads):
    case = load_case(
        CASE,
        [
            *LIMITS,
            'limits.slack_loads=["none","additional"]',
            "tolerances.supports=1e-4",
            "robust.limit=0.003",
        ],
    )
    problem = case_problem(case, shell, loads, shell.design())
    assert list(problem.loads) == ["design", "none", "additional", "critical additional"]
    np.testing.assert_allclose(problem.loads["critical additional"], 1.04 * loads["additional"])
    assert problem.decisive_load() == "critical additional"
    kinds = [(type(each.term).__name__, each.term.load) for each in problem.constraints]
    for kind in ("RodUtilisation", "ConnectorTurn", "Uplift"):
        assert [load for name, load in kinds if name == kind] == ["none", "design", "additional"]
    assert [load for name, load in kinds if name == "LargestDeviation"] == ["none"]
    assert [load for name, load in kinds if name == "LeastTension"] == ["none", "additional"]
    assert [load for name, load in kinds if name == "LargestCableForce"] == ["none", "additional"]
    assert ("ModalStiffness", "critical additional") in kinds
    assert ("BuiltMisfit", "design") in kinds
    plain = case_problem(load_case(CASE), shell, loads, shell.design())
    assert list(plain.loads) == ["design", "none", "additional"]
    assert len(plain.constraints) == 4


def test_every_limit_has_the_case_s_amount_in_the_term_s_own_unit(shell, loads):
    case = load_case(
        CASE,
        [
            *LIMITS,
            "limits.thrust=3.0",
            'limits.slack_loads=["none"]',
            "tolerances.supports=1e-4",
            "robust.limit=0.003",
            "cable.force_max=20.0",
            "limits.cable_utilisation=0.9",
            "optimise.misfit_rms_additional=0.004",
        ],
    )
    problem = case_problem(case, shell, loads, shell.design())
    found = {(type(each.term).__name__, each.term.load): each for each in problem.constraints}
    assert len(found) == len(problem.constraints)

    def above(kind, load):
        assert found[kind, load].lower == -np.inf
        return found[kind, load].upper

    for load in ("none", "design", "additional"):
        assert above("RodUtilisation", load) == 0.9
        assert above("ConnectorTurn", load) == 0.4
        assert above("Uplift", load) == 7.0
        assert found["Uplift", load].scale == pytest.approx(14.0)
        assert above("Thrust", load) == 3.0
    assert above("LargestDeviation", "none") == found["LargestDeviation", "none"].term.scale == 0.004
    assert above("CableForces", "design") == 18.0
    for load in ("none", "additional"):
        assert above("LargestCableForce", load) == 18.0
    assert above("RmsMisfit", "additional") == pytest.approx(0.004**2)
    robust = found["BuiltMisfit", "design"].term
    assert (robust.deviations, len(robust.errors)) == (1.0, 2 * PAIRS_OF_DEVIATIONS)
    assert above("BuiltMisfit", "design") == pytest.approx(0.003**2 * shell.node_count)
    least = found["LeastTension", "none"]
    assert (least.lower, least.upper, least.term.scale) == (0.05, np.inf, 0.05)
    assert least.term.let_out == pytest.approx(
        0.5 * (1.0 + case.cable.rest_ratio * case.optimise.rest_length_max)
    )
    states = sf.follow(shell, shell.design(), {"design": loads["design"]})
    softest = modes(assemble(shell.network(shell.design())), states["design"].equilibrium.state, 1).stiffness
    kept = found["ModalStiffness", "critical additional"]
    assert kept.lower == pytest.approx((0.25 * softest[0]) ** 2, rel=1e-6)
    assert kept.upper == np.inf
    assert problem.decisive_load() == "critical additional"
    assert problem.built_under == ("design", "additional")


def test_the_misfit_as_built_is_limited_by_structures_that_neither_try_nor_judge_a_design(shell, loads):
    """By the case's own tolerances and deviations, under the seed of the search and with later numbers."""
    settings = ["tolerances.supports=3e-4", "robust.limit=0.003", "robust.deviations=0.5", "safety.seed=2"]
    (limit,) = [
        each
        for each in case_problem(load_case(CASE, settings), shell, loads, shell.design()).constraints
        if isinstance(each.term, sf.BuiltMisfit)
    ]
    case = load_case(CASE, settings)
    wet = sf.LoadCase("design", loads["design"])
    same = built_misfit(
        shell, shell.design(), wet, case_tolerances(case, shell), seed=2 + SEED, deviations=0.5
    )
    assert limit.term.deviations == 0.5
    for one, other in zip(limit.term.errors, same.errors, strict=True):
        np.testing.assert_array_equal(one.supports, other.supports)


def test_where_nothing_is_off_a_case_that_asks_what_it_does_is_refused_before_the_search(shell, loads):
    causes = [each.name for each in dataclasses.fields(sf.Tolerances)]
    case = load_case(CASE, ["robust.samples=5", *(f"tolerances.{name}=0" for name in causes)])
    with pytest.raises(InputError, match="tolerances: nothing is off"):
        case_problem(case, shell, loads, shell.design())


def test_an_uplift_is_measured_against_what_a_support_bears_where_less_is_allowed(shell, loads):
    case = load_case(CASE, ["limits.uplift=0.1"])
    problem = case_problem(case, shell, loads, shell.design())
    bears = 4.0 * np.count_nonzero(loads["design"][:, 2]) / len(shell.net.supports)
    for each in problem.constraints:
        if type(each.term).__name__ == "Uplift":
            assert (each.term.scale, each.scale) == pytest.approx((bears, bears + 0.1))


def test_a_share_of_the_objective_goes_to_the_misfit_as_built(shell, loads):
    """Drawn with the case's own tolerances, under another seed than the one by which designs are judged."""
    settings = ["optimise.misfit=0.4", "optimise.built_misfit=0.4", "tolerances.supports=3e-4"]
    case = load_case(CASE, settings)
    shares = case_problem(case, shell, loads, shell.design()).minimise
    assert [each.share for each in shares] == [0.4, 0.2, 0.4]
    term = shares[2].term
    assert (term.name, term.load, len(term.errors)) == ("built_misfit", "design", 2 * PAIRS)
    held = np.concatenate([each.supports[shell.net.supports, :3].ravel() for each in term.errors])
    assert held.std() == pytest.approx(3e-4, rel=0.05)
    other = load_case(CASE, [*settings, "safety.seed=1"])
    again = case_problem(other, shell, loads, shell.design()).minimise[2].term
    assert not np.array_equal(again.errors[0].supports, term.errors[0].supports)
    paper = case_problem(load_case(CASE, [*settings, "optimise.method=paper"]), shell, loads, shell.design())
    assert [(each.share, each.term.name) for each in paper.minimise] == [
        (pytest.approx(2 / 3), "misfit"),
        (pytest.approx(1 / 3), "cable_force"),
    ]


def test_shares_of_fixed_radii_go_to_the_others(shell, loads):
    free = load_case(ROOT / "scripts/scale_model_radius.toml")
    fixed = case_problem(free, shell, loads, shell.design(), frees_radius=False)
    assert [each.share for each in fixed.minimise] == pytest.approx([0.75, 0.25])
    assert len(fixed.variables) == 1
    assert len(case_problem(free, shell, loads, shell.design()).variables) == 2


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        (["limits.utilisaton=0.9"], "Did you mean 'limits.utilisation'"),
        (["limits.utilisation=0"], "limits.utilisation.*greater than 0"),
        (["limits.uplift=-1"], "limits.uplift"),
        (["safety.critical_further={ half = 0.9 }"], "safety.critical_further.half.*greater than 1"),
        (["robust.limits=0.1"], "Did you mean 'robust.limit'"),
        (["tolerances.suports=0.1"], "Did you mean 'tolerances.supports'"),
        (["optimise.built_misfit=0.6"], "rod_radius and built_misfit must add up to 1, not 1.3"),
        (["optimise.catalogue=gfrp_rods"], "catalogue is for a free radius"),
        (
            ["optimise.catalogue=none", "optimise.misfit=0.3", "optimise.rod_radius=0.2"],
            "is neither shipped nor a file",
        ),
        (["optimise.neighbours=-1"], "optimise.neighbours"),
        (["limits.deviation=0"], "limits.deviation.*greater than 0"),
        (["limits.unloaded_deviation=-1"], "limits.unloaded_deviation.*greater than 0"),
        (["limits.built_deviation=0"], "limits.built_deviation.*greater than 0"),
        (["cable.rest_ratio=1.0"], "cable.rest_ratio: must be positive and below 1"),
        (["safety.probability_design=1.0"], "safety.probability_design.*less than 1"),
        (["safety.probability_additional=1.0"], "safety.probability_additional.*less than 1"),
    ],
)
def test_wrong_entries_of_limits_and_scatter_are_named(settings, said):
    with pytest.raises(InputError, match=said):
        load_case(CASE, settings)


@pytest.mark.parametrize(
    ("settings", "kept"),
    [
        ([], 0.004),  # of the case
        (["optimise.deviation=0.003"], 0.003),
        (["limits.deviation=0.005"], 0.004),
        (["limits.deviation=0.004", "optimise.deviation=0.003"], 0.003),
        (["limits.deviation=0.002", "optimise.deviation=0.003"], 0.002),
    ],
)
def test_thinning_keeps_the_shape_that_is_asked_for_and_what_is_required_in_any_case(settings, kept):
    assert _solver(load_case(CASE, settings)).deviation == kept
    free = ROOT / "scripts/full_size.toml"
    assert _solver(load_case(free)).deviation is None
    assert _solver(load_case(free, ["limits.deviation=0.02"])).deviation == 0.02


def test_limits_that_can_t_be_are_refused_when_the_problem_is_made(shell, loads):
    case = load_case(CASE, ["limits.slack_min=0.1", 'limits.slack_loads=["storm"]'])
    with pytest.raises(InputError, match=r"limits\.slack_loads.*storm"):
        case_problem(case, shell, loads, shell.design())
    case = load_case(CASE, ["safety.critical_further={ none = 1.3 }"])
    with pytest.raises(InputError, match=r"safety\.critical_further.*none"):
        case_problem(case, shell, loads, shell.design())
    heavy = {name: 5.0 * load for name, load in loads.items()}
    with pytest.raises(NotConverged, match="no critical factor can be kept"):
        case_problem(load_case(CASE, LIMITS), shell, heavy, shell.design())


def test_what_is_shown_of_a_design_without_load_is_its_prestress(shell, loads):
    design = shell.design()
    unloaded = sf.follow(shell, design, {"none": loads["none"]})["none"]
    seen = load_record(shell, design, unloaded, loads["none"], 0.0)
    assert seen.cables_slack == 0
    assert seen.cable_force_min > 1.0
    assert 0.7 < seen.stress_utilisation_max < 0.8


def test_what_is_shown_of_a_loaded_design_is_what_its_supports_cables_and_connectors_bear(shell, loads):
    rest = shell.design().rest_length.copy()
    rest[5] = 1.2 * shell.cable_lengths[5]
    design, load = dataclasses.replace(shell.design(), rest_length=rest), loads["design"]
    loaded = sf.follow(shell, design, {"design": load})["design"]
    state = loaded.equilibrium.state
    seen = load_record(shell, design, loaded, load, 1.0)
    pull = shell.cables(design).tension(state)
    assert (seen.cable_force_max, seen.cable_force_min) == (pull.max(), pull.min())
    assert seen.cables_slack == np.count_nonzero(pull <= 0.0) >= 1
    bears = np.array([each.force for each in reactions(shell, design, state, load).supports])
    assert seen.uplift_max == pytest.approx(max(-bears[:, 2].min(), 0.0))
    assert seen.thrust_max == pytest.approx(np.sqrt((bears[:, :2] ** 2).sum(axis=1)).max())
    # A force on the support itself goes straight into it: the state is the same, what holds it isn't.
    pushed, push = load.copy(), [40.0, -30.0, 20.0]
    pushed[shell.net.supports[3], :3] += push
    bears[3] -= push
    told = load_record(shell, design, loaded, pushed, 1.0)
    assert told.uplift_max == pytest.approx(-bears[:, 2].min())
    assert told.thrust_max == pytest.approx(np.sqrt((bears[:, :2] ** 2).sum(axis=1)).max())
    assert told.thrust_max > 2.0 * seen.thrust_max
    # frames that lay along x in the flat grid turn against each other, nearly all about the connector
    one, other = (matrices(state.quaternions[shell.net.grid.crossing_nodes[:, k]])[:, :, 0] for k in (0, 1))
    turn = np.arccos(np.clip(np.sum(one * other, axis=1), -1.0, 1.0))
    assert seen.connector_turn_max == pytest.approx(turn.max(), rel=0.02)
    assert seen.edge_utilisation_max == 0.0


def test_a_run_keeps_its_limits_and_tells_what_scatter_does(tmp_path):
    case = load_case(
        CASE,
        [
            *LIMITS,
            *SMALL,
            "optimise.evaluations=5",
            "optimise.polish=0",
            "tolerances.cable_stiffness=0",
            "tolerances.cable_length=0",
            "tolerances.connectors=0",
            "tolerances.load_each=0",
            "robust.samples=5",
            "safety.drawn=2",
            "safety.compared=1",
            "cable.without=false",
            "optimise.unloaded=false",
        ],
    )
    summary = run_case(case, tmp_path, until="safety")
    with (tmp_path / "history.csv").open(encoding="utf-8", newline="") as file:
        row = next(csv.DictReader(file))
    named = [
        "utilisation.none",
        "utilisation",
        "connector_turn.additional",
        "uplift",
        "slackness.none",
        "softness.critical additional",
        "cable_force.additional",
    ]
    assert {f"constraint.{name}" for name in named} <= set(row)
    best = summary.designs["optimised"].loads
    assert summary.optimisation.feasible
    assert best["design"].critical_factor > 1.25
    assert best["none"].cable_force_min > 0.05
    assert max(each.stress_utilisation_max for each in best.values()) < 0.9
    assert max(each.uplift_max for each in best.values()) < 7.0
    assert summary.robust.design == "optimised"
    assert summary.robust.misfit_mean > summary.robust.misfit
    assert summary.robust.sample.count == 5
    with (tmp_path / "schedules/robust.csv").open(encoding="utf-8", newline="") as file:
        causes = list(csv.DictReader(file))
    assert {each["cause"] for each in causes} == {
        "supports",
        "marks",
        "rod_stiffness",
        "rod_bow",
        "load_all",
        "load_uneven",
        "shape",
    }
    assert sum(float(each["share of the scatter of the shape"]) for each in causes) == pytest.approx(
        1.0, abs=1e-3
    )


def test_a_free_radius_is_rounded_up_and_the_neighbouring_sections_are_tried_as_safe_as_is_asked(
    tmp_path, monkeypatch
):
    """By the case's own safety: what the search before came to ask of its trials says nothing of these."""
    searched, search = [], rounding.optimise

    def searching(*given, safety, **how):
        searched.append(safety)
        return search(*given, safety=safety, **how)

    monkeypatch.setattr(rounding, "optimise", searching)
    settings = [*SMALL, "optimise.evaluations=5", "optimise.rounded=2", "optimise.polish=0"]
    settings += ["joint.gap=0.0045", "optimise.unloaded=false", "cable.without=false"]
    settings += ["safety.drawn=4", "safety.compared=2"]
    case, heard = load_case(ROOT / "scripts/scale_model_rounded.toml", settings), []
    summary = run_case(case, tmp_path, until="optimise", report=heard.append)
    (doubt,) = [each for each in heard if "the rods that were found" in each.text]
    assert doubt.kind is Kind.NOTE
    assert f"{2.0 * summary.designs['rounded'].rod_radius:.3g} would fit" in doubt.text
    designs, sections = summary.designs, summary.sections
    free = designs["optimised"].rod_radius
    up = next(each for each in sections if each.rounded_up)
    assert up.rod_radius >= free
    assert all(each.rod_radius < free for each in sections if each.rod_radius < up.rod_radius)
    assert 2 <= len(sections) <= 3
    assert designs["rounded"].rod_radius in [each.rod_radius for each in sections]
    with (tmp_path / "schedules/sections.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["section"] for row in rows] == [each.section for each in sections]
    for each in sections:
        assert each.feasible == (not each.why_not)
    run = read_run(tmp_path)
    asked = case_safety(case, run.shell)
    assert {(each.enlarged, each.tried) for each in searched} == {(asked.enlarged, asked.tried)}
    assert run.best == "rounded"
    assert run.shell_of("rounded").rod.radius == designs["rounded"].rod_radius
    # Another case in the same folder leaves nothing of this one behind.
    again = run_case(
        load_case(
            ROOT / "scripts/scale_model_rounded.toml",
            [*settings, "optimise.evaluations=1", "optimise.rounded=0"],
        ),
        tmp_path,
        until="optimise",
    )
    assert "rounded" not in again.designs
    assert "sections" not in json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert read_run(tmp_path).best == "optimised"


def test_sections_that_bear_nothing_are_told_with_the_reason(dome):
    start, load = dome.design(), dome.point_load(2.0, every=2)
    problem = sf.Problem(
        dome,
        sf.LoadCase("wet", load),
        [sf.Share(1.0, sf.Misfit("wet"))],
        [sf.AtMost(20.0, sf.CableForces("wet"))],
    )
    best = sf.optimise(problem, start, solver=sf.SequentialConvex(thin=False), evaluations=2)
    heavy = sf.LoadCase("wet", 4.0 * load)
    stock = sf.read_catalogue(ROOT / "scripts/scale_model_rods.toml")
    trials = rounding.tried(
        best,
        start,
        stock,
        lambda other: dataclasses.replace(problem, shell=other, design_load=heavy),
        evaluations=2,
        beside=0,
    )
    assert [each.section for each in trials] == ["⌀ 2 mm"]
    assert "loses stability" in trials[0].why
    assert trials[0].optimum is None
    assert rounding.chosen(trials) is None


def test_a_least_radius_above_the_rods_own_is_refused_where_the_radius_is_free(shell):
    above = f"optimise.radius_min={1.1 * shell.rod.radius}"
    free = ["optimise.rod_radius=0.2", "optimise.misfit=0.3"]
    with pytest.raises(InputError, match=r"optimise\.radius_min: is above the radius of the rods"):
        varied(load_case(CASE, [*free, above]), shell)
    assert len(varied(load_case(CASE, [*free, above]), shell, frees_radius=False)) == 1
    blocks = varied(load_case(CASE, [*free, f"optimise.radius_min={shell.rod.radius}"]), shell)
    assert blocks[1].bounds(shell, shell.design())[0] == shell.rod.radius
