"""Checks of designs, and the verdict on the one to build."""

import math
from dataclasses import replace

import pytest

from shellform.records.summary import CableCountRecord, SymmetryRecord
from shellform.records.verdict import Bounds, asked, checks, failed, verdict
from tests.records.made import design, optimisation, summary


@pytest.fixture
def designs(shell):
    return {
        "initial": shell.design(),
        "optimised": shell.design(rest_ratio=0.98),
        "polished": shell.design(rest_ratio=0.97),
    }


BOUNDS = Bounds(20.0, 0.005)


def every(shell, designs):
    return {name: shell for name in designs}


def fails(shell, designs, *arguments, **changes):
    found = checks(every(shell, designs), designs, summary(designs, *arguments, **changes), BOUNDS)
    return [check.name for check in failed(found, "polished")]


def test_a_sound_design_holds_all_checks_those_of_the_optimiser_among_them(shell, designs):
    found = checks(every(shell, designs), designs, summary(designs), BOUNDS)
    assert failed(found, "polished") == []
    assert asked(found, "polished") == len(found) == 3 + 3 + 1 + 1 + 1 + 1 + 3
    assert asked(found, "initial") == len(found) - 1


@pytest.mark.parametrize(
    ("load", "changes", "name"),
    [
        ("design", {"stable": False}, "Stands under the design load"),
        ("additional", {"on_branch": False}, "Stands under 1.2 × the load"),
        ("none", {"rod_utilisation_max": 1.01}, "Rods under no load"),
        ("additional", {"deviation_rms": 0.0051}, "Deviation under 1.2 × the load, root mean square (6)"),
        ("design", {"residual": float("nan")}, "In equilibrium under the design load"),
        (
            None,
            {"cable_force_max": 20.1},
            "Largest cable force under the design load and those beyond it (5)",
        ),
    ],
)
def test_each_check_fails_alone_where_its_number_is_past_the_limit(shell, designs, load, changes, name):
    assert fails(shell, designs, load, **changes) == [name]


def test_a_constraint_fails_above_zero_and_reads_as_share_of_its_limit(shell, designs):
    values = {
        "cable_force": -0.65,
        "misfit.additional": -0.75,
        "softness.additional": 0.19,
        "slackness.none": -0.5,
        "uplift.wind": 0.5,
    }
    values |= {"uplift": -0.1, "other_thing": math.nan}
    given = summary(designs, constraints=values)
    found = {
        check.name: check.cells["optimised"]
        for check in checks(every(shell, designs), designs, given, BOUNDS)
        if check.name.startswith("Optimiser")
    }
    assert [cell.found for cell in found.values()] == [
        "35 %",
        "50 %",
        "0.90 ×",
        "1.50 ×",
        "beyond",
        "within",
        "not known",
    ]
    assert [cell.holds for cell in found.values()] == [True, True, False, True, False, True, False]
    assert {"Optimiser: uplift of supports, wind load", "Optimiser: other thing"} < set(found)


@pytest.mark.parametrize(
    ("bound", "load", "changes", "words"),
    [
        ({"stress": 0.9}, "none", {"stress_utilisation_max": 0.95}, "95 % of the strength"),
        ({"turn": 0.1}, "design", {"connector_turn_max": 0.2}, "11.5 °"),
        ({"uplift": 1.0}, "additional", {"uplift_max": 1.5}, "1.5 N"),
        ({"critical": 1.5}, "design", {"critical_factor": 1.4}, "1.40 ×"),
        ({"critical": 4.0}, "design", {"critical_factor": None, "critical_sought": 3.0}, "beyond 3 ×"),
        ({"force": 20.0}, "additional", {"cable_force_max": 21.0}, "21 N"),
    ],
)
def test_an_engineer_s_limits_are_checked_where_they_are_asked_for(
    shell, designs, bound, load, changes, words
):
    given = summary(designs, load, **changes)
    found = failed(checks(every(shell, designs), designs, given, replace(BOUNDS, **bound)), "polished")
    assert [check.cells["polished"].found for check in found] == [words]
    if "force" not in bound:
        assert failed(checks(every(shell, designs), designs, given, BOUNDS), "polished") == [], "nobody asked"
    looser = {name: 0.5 * limit if name == "critical" else 2.0 * limit for name, limit in bound.items()}
    assert failed(checks(every(shell, designs), designs, given, replace(BOUNDS, **looser)), "polished") == []


def test_the_polished_design_does_not_fail_by_what_only_the_optimised_one_broke(shell, designs):
    given = summary(designs)
    given = given.with_design("optimised", design(cable_force_max=30.0))
    assert failed(checks(every(shell, designs), designs, given, BOUNDS), "polished") == []
    assert len(failed(checks(every(shell, designs), designs, given, BOUNDS), "optimised")) == 1


def test_rods_thicker_than_the_net_bears_fail_by_equation_1(shell, designs):
    thick = designs | {"polished": replace(designs["polished"], radius=0.002)}
    assert fails(shell, thick) == ["Rods bent into the shape (1)"]


def test_the_verdict_names_what_fails_and_what_was_asked_for_but_not_examined(shell, designs):
    bounds = replace(BOUNDS, critical=1.5)
    given = summary(designs, "design", stable=False, critical_sought=3.0, critical_kind="not found: no path")
    found = verdict(checks(every(shell, designs), designs, given, bounds), "polished")
    assert found.design == "polished"
    assert not found.holds
    assert found.failed == ("Stands under the design load",)
    assert found.not_examined == ("Stays stable beyond the design load",)
    sound = verdict(checks(every(shell, designs), designs, summary(designs), BOUNDS), "polished")
    assert sound.holds
    assert sound.failed == sound.not_examined == ()


def test_wishes_for_cables_are_checked_on_the_design_to_build(shell, designs):
    record = optimisation(
        cables_max=CableCountRecord(80, 100, False),
        symmetric=SymmetryRecord(7, False),
        not_polished="the load isn't borne",
    )
    given = replace(summary(designs), optimisation=record)
    found = {check.name: check for check in checks(every(shell, designs), designs, given, BOUNDS)}
    assert found["Number of cables"].cells["polished"].holds is False
    assert not found["Number of cables"].cells["initial"].asked
    assert found["Symmetric cables have one length"].cells["polished"].found == "the load isn't borne"
