"""What a case asks for is checked on every design of its run."""

import math
from pathlib import Path
from types import SimpleNamespace

import pytest

from shellform.case.limit_entries import LimitsEntry
from shellform.quantities import newtons, number
from shellform.records.as_built import Farthest
from shellform.records.summary import read_summary
from shellform.run import judged
from shellform.run.folder import read_run
from shellform.run.judged import run_checks
from shellform.run.run import run_case
from tests.run.small_run import begin, small_case

ROOT = Path(__file__).parent.parent.parent
LIMITS = {
    "deviation": "Largest deviation under the design load",
    "built_deviation": "Largest deviation as built under the design load",
    "unloaded_deviation": "Largest deviation before any load",
    "utilisation": "Rods' stress with axial force under any load",
    "cable_utilisation": "Largest cable force before any load and under each (5)",
    "connector_turn": "Connectors' turning under any load",
    "uplift": "Uplift of a support under any load",
    "thrust": "Thrust on a support under any load",
    "slack_min": "Least pull of a cable under no load",
}


@pytest.mark.parametrize(
    ("built", "limit", "wish", "most"),
    [
        (0.3, None, 0.03, Farthest(0.03, "optimise.deviation")),
        (0.02, None, 0.03, Farthest(0.02, "limits.built_deviation")),
        (0.3, 0.01, 0.03, Farthest(0.01, "limits.deviation")),
        (0.3, None, None, Farthest(0.3, "limits.built_deviation")),
        (None, None, None, Farthest(0.024, "a 500th of the span")),
    ],
)
def test_structures_may_snap_as_far_without_care_as_the_least_deviation_that_is_limited_or_wished_for(
    monkeypatch, built, limit, wish, most
):
    limits = SimpleNamespace(built_deviation=built, deviation=limit)
    case = SimpleNamespace(limits=limits, optimise=SimpleNamespace(deviation=wish))
    monkeypatch.setattr(judged, "may_come_off", lambda surface, thickness: surface / 500.0 + thickness)
    assert judged._farthest_snap(SimpleNamespace(case=case, surface=12.0)) == most


def test_every_limit_of_a_case_is_a_check_of_its_designs(tmp_path):
    assert set(LIMITS) == set(LimitsEntry.model_fields) - {"slack_loads"}
    amounts = {
        "deviation": 5e-6,
        "built_deviation": 7e-6,
        "unloaded_deviation": 8e-6,
        "utilisation": 1e-6,
        "cable_utilisation": 1e-3,
        "connector_turn": 2e-6,
        "uplift": 3e-6,
        "thrust": 4e-6,
        "slack_min": 1e3,
    }
    tight = [f"limits.{name}={amount}" for name, amount in amounts.items()]
    run = read_run(begin(ROOT, tmp_path / "run", "net.elements=2", *tight))
    made = run_checks(run)
    found = {check.name: check.cells["initial"] for check in made}
    limits = {check.name: check.limit for check in made}
    assert [limits[LIMITS[name]] for name in LIMITS] == [
        f"{number(5e-3)} mm",
        f"{number(7e-3)} mm",
        f"{number(8e-3)} mm",
        f"{number(1e-4)} % of the strength",
        "0.02 N",
        f"{number(math.degrees(2e-6))} °",
        f"{number(3e-6)} N",
        f"{number(4e-6)} N",
        "at least 1 kN",
    ]
    told = run.summary.designs["initial"].loads.values()
    assert found[LIMITS["thrust"]].found == newtons(max(each.thrust_max for each in told))
    assert found[LIMITS["uplift"]].found == newtons(max(each.uplift_max for each in told))
    assert found[LIMITS["uplift"]].holds is not None  # all supports may press
    assert found[LIMITS["built_deviation"]].holds is None  # nothing was drawn yet
    open_ones = ("uplift", "built_deviation")
    assert [name for name in LIMITS if name not in open_ones and found[LIMITS[name]].holds is not False] == []


def test_a_run_up_to_its_optimum_keeps_its_verdict_when_it_is_run_again(tmp_path):
    case = small_case(
        ROOT, "net.spacing=0.14", "net.elements=2", "optimise.evaluations=3", "optimise.polish=0"
    )
    first = run_case(case, tmp_path / "run", until="optimise")
    assert first.verdict is not None
    assert run_case(case, tmp_path / "run", until="optimise").verdict == first.verdict
    assert read_summary(tmp_path / "run").verdict == first.verdict
