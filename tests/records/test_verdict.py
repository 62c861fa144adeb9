"""Checks of designs, and the verdict on the one to build."""

import math
from dataclasses import replace

import pytest

from shellform.cli.terminal import tell_designs, tell_verdict
from shellform.net.cover import BarePatch
from shellform.records.as_built import AsBuilt, Farthest
from shellform.records.checks import checks
from shellform.records.limited import Bounds
from shellform.records.optimisation import CableCountRecord, SymmetryRecord
from shellform.records.summary import StandingRecord
from shellform.records.verdict import asked, failed, headline, to_build, verdict
from tests.records import made
from tests.records.made import design, load, optimisation, summary


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
    assert len(found) == 3 + 3 + 1 + 1 + 1 + 1 + 3
    assert asked(found, "polished") == asked(found, "initial") == len(found) - 1, (
        "the optimiser's is another's"
    )


@pytest.mark.parametrize(
    ("load", "changes", "name"),
    [
        ("design", {"stable": False}, "Stands under the design load"),
        ("additional", {"on_branch": False}, "Stands under 1.2 × the load"),
        ("none", {"rod_utilisation_max": 1.01}, "Rods under no load"),
        ("additional", {"deviation_rms": 0.0051}, "Deviation under 1.2 × the load, root mean square (6)"),
        ("additional", {"edge_utilisation_max": 1.02}, "Edge beams under 1.2 × the load"),
        ("design", {"residual": float("nan")}, "In equilibrium under the design load"),
        (None, {"cable_force_max": 20.1}, "Largest cable force before any load and under each (5)"),
        ("none", {"cable_force_max": 20.1}, "Largest cable force before any load and under each (5)"),
    ],
)
def test_each_check_fails_alone_where_its_number_is_past_the_limit(shell, designs, load, changes, name):
    assert fails(shell, designs, load, **changes) == [name]


@pytest.mark.parametrize(
    ("load", "changes"),
    [
        ("none", {"deviation_rms": 0.05}),  # (6) of those beyond it
        ("design", {"deviation_rms": 0.05}),
        ("additional", {"deviation_rms": 0.005}),  # each limit itself is kept
        ("none", {"rod_utilisation_max": 1.0}),
        ("design", {"cable_force_max": 20.0}),
        ("design", {"residual": 1e-6}),
    ],
)
def test_nothing_fails_at_a_limit_or_where_a_constraint_does_not_speak_of_the_load(
    shell, designs, load, changes
):
    assert fails(shell, designs, load, **changes) == []


def test_a_constraint_fails_above_zero_and_reads_as_share_of_its_limit(shell, designs):
    values = {
        "cable_force": -0.65,
        "misfit.additional": -0.75,
        "built_misfit": 0.44,
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
        "120 %",
        "0.90 ×",
        "1.50 ×",
        "beyond",
        "within",
        "not known",
    ]
    assert [cell.holds for cell in found.values()] == [
        True,
        True,
        False,
        False,
        True,
        False,
        True,
        False,
    ]
    assert {"Optimiser: uplift of supports, wind load", "Optimiser: other thing"} < set(found)


@pytest.mark.parametrize(("value", "holds"), [(0.0, True), (0.0009, True), (0.0011, False)])
@pytest.mark.parametrize("name", ["cable_force", "misfit.additional", "softness.additional", "uplift.wind"])
def test_a_constraint_that_is_missed_by_up_to_a_thousandth_of_its_limit_holds(
    shell, designs, name, value, holds
):
    found = checks(every(shell, designs), designs, summary(designs, constraints={name: value}), BOUNDS)
    told = [check.cells["optimised"].holds for check in found if check.name.startswith("Optimiser")]
    assert told == [holds]


@pytest.mark.parametrize(
    ("bound", "load", "changes", "words"),
    [
        ({"deviation": 0.001}, "design", {"deviation_max": 0.0015}, "1.5 mm"),
        ({"unloaded": 0.001}, "none", {"deviation_max": 0.0015}, "1.5 mm"),
        ({"stress": 0.9}, "none", {"stress_utilisation_max": 0.95}, "95 % of the strength"),
        ({"turn": 0.1}, "design", {"connector_turn_max": 0.2}, "11.5 °"),
        ({"uplift": 1.0}, "additional", {"uplift_max": 1.5}, "1.5 N"),
        ({"thrust": 2.0}, "none", {"thrust_max": 2.5}, "2.5 N"),
        ({"slack": 0.5}, "none", {"cable_force_min": 0.2}, "0.2 N"),
        ({"force": 20.0}, "additional", {"cable_force_max": 21.0}, "21 N"),
    ],
)
def test_an_engineer_s_limits_are_checked_where_they_are_asked_for(
    shell, designs, bound, load, changes, words
):
    given = summary(designs, load, **changes)
    base = replace(BOUNDS, slack_loads=("none",))
    found = failed(checks(every(shell, designs), designs, given, replace(base, **bound)), "polished")
    assert [check.cells["polished"].found for check in found] == [words]
    if "force" not in bound:
        assert failed(checks(every(shell, designs), designs, given, BOUNDS), "polished") == [], "nobody asked"
    looser = {name: 0.2 * limit if name == "slack" else 2.0 * limit for name, limit in bound.items()}
    assert failed(checks(every(shell, designs), designs, given, replace(base, **looser)), "polished") == []


def test_the_polished_design_does_not_fail_by_what_only_the_optimised_one_broke(shell, designs):
    given = summary(designs)
    given = given.with_design("optimised", design(cable_force_max=30.0))
    assert failed(checks(every(shell, designs), designs, given, BOUNDS), "polished") == []
    assert len(failed(checks(every(shell, designs), designs, given, BOUNDS), "optimised")) == 1


def test_rods_thicker_than_the_net_bears_fail_by_equation_1(shell, designs):
    thick = designs | {"polished": replace(designs["polished"], radius=0.002)}
    assert fails(shell, thick) == ["Rods bent into the shape (1)"]


def critical(factor, halved, kind="limit point"):
    return {
        "critical_sought": 3.0,
        "critical_factor": factor,
        "critical_factor_halved": halved,
        "critical_kind": kind,
    }


@pytest.mark.parametrize(
    ("changes", "holds", "words"),
    [
        (critical(1.31, 1.30), True, "1.310 × (limit point), 1.300 × with rod elements halved"),
        (critical(1.26, 1.24), False, "1.260 × (limit point), 1.240 × with rod elements halved"),
        (critical(1.2, 1.3), False, "1.200 × (limit point), 1.300 × with rod elements halved"),
        (critical(3.0, 3.0, "none"), True, "beyond 3 ×"),
        (critical(3.0, 1.426, "none"), True, "beyond 3 ×, but 1.426 × with rod elements halved"),
        (
            critical(3.0, 1.426, "none") | {"critical_snap_halved": 0.0017},
            True,
            "beyond 3 ×, but 1.426 × with rod elements halved, where a rod's end or a cell snaps by 1.7 mm and it bears on",
        ),
        (critical(1.31, None), None, "1.310 × (limit point)"),
        ({"critical_kind": "not found: no path"}, None, "not known"),
    ],
)
def test_a_critical_factor_holds_where_both_meshes_keep_it(shell, designs, changes, holds, words):
    given = summary(designs, "design", **changes)
    bounds = replace(BOUNDS, critical={"design": 1.25})
    found = next(
        check
        for check in checks(every(shell, designs), designs, given, bounds)
        if check.name == "Critical factor of the design load"
    )
    assert found.cells["polished"].holds is holds
    assert found.cells["polished"].found == words


def standing(drawn, number, **changes):
    return StandingRecord(drawn, number, 0.9, 0.95, 0, **changes)


def as_built(shell, designs, initial, last, asked_for):
    given = summary(designs, "additional", stands=last)
    loads = {name: load(name) for name in ("none", "design")} | {
        "additional": load("additional", stands=initial)
    }
    given = given.with_design("initial", design(loads=loads))
    found = checks(every(shell, designs), designs, given, replace(BOUNDS, safety=asked_for))
    return next(check for check in found if check.name == "As built under 1.2 × the load")


@pytest.mark.parametrize(
    ("initial", "last", "holds"),
    [
        ((20, 20), (200, 198), True),
        ((20, 20), (200, 197), False),
        ((20, 10), (200, 100), True),
        ((20, 10), (200, 99), False),
        ((20, 20), (20, 20), None),
        ((20, 20), (20, 17), False),
    ],
)
def test_as_many_structures_stand_as_of_the_initial_design_and_are_drawn_in_full(
    shell, designs, initial, last, holds
):
    check = as_built(shell, designs, standing(*initial), standing(*last), AsBuilt(0.99, None, 200))
    assert check.cells["polished"].holds is holds
    assert check.cells["polished"].found.startswith(
        f"{last[1]} of {last[0]} structures as built stand (at least"
    )


SNAPPED = {"snapped": 3, "snap": 0.082}
FARTHEST = Farthest(0.03, "optimise.deviation")


@pytest.mark.parametrize(
    ("snapped", "farthest", "care"),
    [
        (SNAPPED, FARTHEST, True),
        (SNAPPED | {"snap": 0.03}, FARTHEST, False),
        ({}, FARTHEST, False),
        (SNAPPED, None, False),
    ],
)
def test_a_design_whose_structures_snap_far_on_their_way_holds_and_asks_for_care(
    shell, designs, snapped, farthest, care, capsys
):
    own = AsBuilt(0.99, 0.99, 200, snap=farthest)
    check = as_built(shell, designs, None, standing(200, 200, **snapped), own)
    told = verdict([check, replace(check, title="As built under the design load")], "polished")
    assert told.holds
    assert told.failed == told.not_examined == ()
    assert told.cautions == (
        (
            "As built under 1.2 × the load, as built under the design load: 3 of 200 structures as built snap at a rod's end or "
            "a cell on the way, by up to 82 mm: more than the 30 mm of optimise.deviation.",
        )
        if care
        else ()
    ), "once"
    assert headline(told) == f"The polished design holds: all checks do{', with 1 caution' if care else ''}."
    tell_verdict(told)
    assert capsys.readouterr().out.splitlines() == [
        headline(told),
        *(f"  caution: {each}" for each in told.cautions),
    ]
    assert check.cells["polished"].holds is True


@pytest.mark.parametrize(
    ("cells", "share", "holds", "caution", "provided"),
    [
        (0.24, 0.001, True, False, False),
        (0.26, 0.001, True, True, False),
        (0.99, 0.01, True, True, False),
        (1.0, 0.02, True, True, True),
        (1.0, 0.021, False, True, True),
    ],
)
def test_what_lies_beyond_the_rods_is_told_asks_for_care_and_fails_past_its_limit(
    shell, designs, cells, share, holds, caution, provided
):
    area = cells * made.NET.spacing * made.NET.spacing_v
    patch = BarePatch(area, (1.0, 2.0, 0.5), 0.07)
    net = replace(made.NET, uncovered_area=area, uncovered_share=share, uncovered=(patch,))
    found = checks(
        every(shell, designs), designs, replace(summary(designs), net=net), replace(BOUNDS, uncovered=0.02)
    )
    record = verdict(found, "polished")
    assert record.holds is holds
    check = next(each for each in found if each.title == "Surface beyond the rods")
    assert check.limit == "up to 2 % of it"
    told = f"{area:.2g} m²"
    assert check.cells["initial"].found == f"{100.0 * share:.2g} %, {told}"
    care = (
        f"Surface beyond the rods: {told} of the surface lie farther than 0.75 spacings from any rod: {told} at (1, 2, 0.5) m, "
        "up to 0.07 m from any rod. Formwork needs props of its own there."
    )
    assert record.cautions == ((care,) if caution else ())
    assert record.provided == ((f"with {told} beyond its rods",) if provided else ())
    if provided and holds:
        assert (
            headline(record)
            == f"The polished design holds, with {told} beyond its rods: all checks do, with 1 caution."
        )
    if not holds:
        assert record.failed[0].endswith(
            "Another net.angle or net.offset, or a smaller net.spacing, covers more."
        )


def test_a_net_that_covers_all_says_so_and_one_of_an_older_run_nothing(shell, designs):
    for share, found in ((0.0, ["none"]), (None, [])):
        run = replace(summary(designs), net=replace(made.NET, uncovered_share=share))
        told = checks(every(shell, designs), designs, run, BOUNDS)
        assert [each.cells["polished"].found for each in told if "beyond the rods" in each.title] == found


def test_what_is_only_told_asks_for_no_care_in_the_verdict(shell, designs):
    own = AsBuilt(0.99, 0.99, 200, required=False, snap=FARTHEST)
    check = as_built(shell, designs, None, standing(200, 200, **SNAPPED), own)
    assert verdict([check], "polished").cautions == ()


def test_what_is_only_told_fails_no_design(shell, designs):
    told = AsBuilt(0.99, 0.99, 200, required=False)
    check = as_built(shell, designs, None, standing(200, 1), told)
    assert check.limit == "told only"
    assert verdict([check], "polished").holds
    assert asked([check], "polished") == 0


def test_the_remedy_says_which_rods_would_do_or_that_the_grid_must_be_closer(shell, designs):
    def sentence(lowest):
        own = AsBuilt(0.99, 0.99, 200)
        check = as_built(shell, designs, None, standing(200, 150, lowest=lowest), own)
        return verdict([check], "polished").failed[0]

    assert (
        "asked for: at least 198 of 200. Take rods of at least 1.1 mm radius (rod.radius = 0.0011)"
        in sentence(0.9)
    )
    assert "the net's curvature allows" in sentence(0.2)
    assert "Choose a closer grid (net.spacing = 0.044)" in sentence(0.2)


def test_the_verdict_gives_reason_and_remedy_and_names_what_is_not_examined(shell, designs):
    bounds = replace(BOUNDS, critical={"design": 1.5})
    given = summary(designs, "design", stable=False, critical_kind="not found: no path")
    found = verdict(checks(every(shell, designs), designs, given, bounds), "polished")
    assert found.design == "polished"
    assert not found.holds
    assert len(found.failed) == 1
    assert found.failed[0].startswith("Stands under the design load: unstable, asked for: stable")
    assert found.not_examined == ("Critical factor of the design load",)
    assert headline(found) == "The polished design does not hold: 1 check fails."
    unknown = verdict(checks(every(shell, designs), designs, summary(designs), bounds), "polished")
    assert not unknown.holds, "what isn't examined doesn't hold"
    assert headline(unknown) == "The polished design is not examined: 1 check is still open."
    every_one = checks(every(shell, designs), designs, summary(designs), bounds)
    assert asked(every_one, "polished") == len(every_one) - 2, "neither the optimiser's nor the open one"
    sound = verdict(checks(every(shell, designs), designs, summary(designs), BOUNDS), "polished")
    assert sound.holds
    assert sound.failed == sound.not_examined == ()
    assert headline(sound) == "The polished design holds: all checks do."


@pytest.mark.parametrize(
    ("optimised", "polished", "best"),
    [
        (200, 199, "polished"),
        (200, 197, "optimised"),
        (190, 180, "optimised"),
        (180, 190, "polished"),
        (200, None, "optimised"),
    ],
)
def test_the_design_to_build_is_the_last_that_holds_and_polishing_may_not_make_a_check_worse(
    shell, designs, optimised, polished, best
):
    given = summary(designs)
    for name, number in (("optimised", optimised), ("polished", polished)):
        loads = {each: load(each) for each in ("none", "design", "additional")}
        if number is not None:
            for each in ("design", "additional"):
                loads[each] = load(each, stands=standing(200, number))
        given = given.with_design(name, design(loads=loads))
    bounds = replace(BOUNDS, safety=AsBuilt(0.99, 0.99, 200))
    found = checks(every(shell, designs), designs, given, bounds)
    assert to_build(found, list(designs)) == best


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


def test_the_terminal_names_limits_that_are_broken_by_more_than_a_thousandth(capsys):
    told = made.summary(["optimised"], constraints={"cable_force": 0.0016, "misfit": 0.0008})
    tell_designs(told)
    assert (
        "limits that the optimised design doesn't keep: cable_force at 100.2% of it\n"
        in capsys.readouterr().out
    )


def test_checks_under_a_load_that_is_no_multiple_of_the_design_load_name_no_factor(shell, designs):
    for multiple, words in ((True, "1.2 × the load"), (False, "the additional load")):
        given = summary(designs)
        for name, row in given.designs.items():
            loads = {**row.loads, "additional": replace(row.loads["additional"], multiple=multiple)}
            given = given.with_design(name, replace(row, loads=loads))
        titles = [each.title for each in checks(every(shell, designs), designs, given, BOUNDS)]
        assert f"Stands under {words}" in titles
