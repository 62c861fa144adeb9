"""What the page says: checks, answers, numbers, charts, embedded pictures, and a surface made light."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

import shellform as sf
from shellform.errors import InputError
from shellform.output.page import report
from shellform.output.page.charts import line_chart
from shellform.output.page.embed import embed
from shellform.output.page.verdict import Bounds, answers, asked, checks, failed, number
from shellform.structure.elements.state import State

LOADS = {
    "none": {"factor": 0.0, "deviation_max": 0.002, "deviation_mean": 0.001, "deviation_rms": 0.0012},
    "design": {"factor": 1.0, "deviation_max": 0.004, "deviation_mean": 0.002, "deviation_rms": 0.0024},
    "additional": {"factor": 1.2, "deviation_max": 0.008, "deviation_mean": 0.003, "deviation_rms": 0.004},
}
SOUND = {"stable": True, "on_branch": True, "residual": 1e-10, "rod_utilisation_max": 0.8}


@pytest.fixture
def designs(shell):
    return {
        "initial": shell.design(),
        "optimised": shell.design(rest_ratio=0.98),
        "polished": shell.design(rest_ratio=0.97),
    }


def told(designs, load=None, constraints=None, **changes):
    """A summary with one load's row of the last design changed."""
    rows = {
        name: {"cable_force_max": 7.0, "loads": {each: {**row, **SOUND} for each, row in LOADS.items()}}
        for name in designs
    }
    last = rows[list(designs)[-1]]
    (last["loads"][load] if load else last).update(changes)
    return {"designs": rows, "optimisation": {"constraints": constraints or {"cable_force": -0.65}}}


BOUNDS = Bounds(20.0, 0.005)


def every(shell, designs):
    return {name: shell for name in designs}


def fails(shell, designs, *arguments, **changes):
    found = checks(every(shell, designs), designs, told(designs, *arguments, **changes), BOUNDS)
    return [check.name for check in failed(found, "polished")]


def test_a_sound_design_holds_all_checks_those_of_the_optimiser_among_them(shell, designs):
    found = checks(every(shell, designs), designs, told(designs), BOUNDS)
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
    summary = told(designs, constraints=values)
    found = {
        check.name: check.cells["optimised"]
        for check in checks(every(shell, designs), designs, summary, BOUNDS)
        if check.name.startswith("Optimiser")
    }
    assert [cell.told for cell in found.values()] == [
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
    summary = told(designs, load, **changes)
    found = failed(checks(every(shell, designs), designs, summary, replace(BOUNDS, **bound)), "polished")
    assert [check.cells["polished"].told for check in found] == [words]
    unasked = replace(BOUNDS, force=np.inf)
    assert failed(checks(every(shell, designs), designs, summary, unasked), "polished") == []
    looser = {name: 0.5 * limit if name == "critical" else 2.0 * limit for name, limit in bound.items()}
    assert (
        failed(checks(every(shell, designs), designs, summary, replace(BOUNDS, **looser)), "polished") == []
    )


def test_the_polished_design_does_not_fail_by_what_only_the_optimised_one_broke(shell, designs):
    summary = told(designs)
    summary["designs"]["optimised"]["cable_force_max"] = 30.0
    assert failed(checks(every(shell, designs), designs, summary, BOUNDS), "polished") == []
    assert len(failed(checks(every(shell, designs), designs, summary, BOUNDS), "optimised")) == 1


def test_rods_thicker_than_the_net_bears_fail_by_equation_1(shell, designs):
    thick = designs | {"polished": replace(designs["polished"], radius=0.002)}
    assert fails(shell, thick) == ["Rods bent into the shape (1)"]


def test_the_answers_are_numbers_of_the_design(shell, designs):
    design, states = designs["polished"], {"design": shell.target}
    found = {answer.question: answer for answer in answers(shell, "polished", design, states, told(designs))}
    pull = shell.cables(design).tension(shell.target)
    assert found["How far off is the shell?"].told == "4 mm at most"
    assert found["How many cables?"].detail.startswith(f"{number(pull.max())} N at most in one")
    assert found["Which rods?"].told == "⌀ 2 mm"
    length = sum(rod.length for rod in shell.net.grid.rods)
    assert found["What to buy?"].told == f"{number(length)} m of rod"
    assert found["Is it safe at 1.2 × the load?"].good
    assert "isn't known" in found["Is it safe at 1.2 × the load?"].detail
    for known, words in [
        ({"critical_factor": 1.85}, "ends at 1.85 ×"),
        ({"critical_factor": None, "critical_sought": 3.0}, "up to 3 ×"),
    ]:
        sought = told(designs, "design", **known)
        assert words in answers(shell, "polished", design, states, sought)[3].detail
    for change, words in [
        ({"on_branch": False}, "No, it snaps through"),
        ({"stable": False}, "No, it is unstable"),
        ({"rod_utilisation_max": 1.1}, "No, rods break"),
    ]:
        answer = answers(shell, "polished", design, states, told(designs, "additional", **change))[3]
        assert answer.told == words
        assert answer.good is False


def test_the_mass_of_the_rods_is_told_where_their_density_is_known(shell, designs):
    material = replace(shell.rod.section.material, density=2000.0)
    heavy = replace(shell, rod=sf.Rod(replace(shell.rod.section, material=material)))
    buy = answers(heavy, "polished", designs["polished"], {}, told(designs))[-1]
    mass = 2000.0 * math.pi * 0.001**2 * sum(rod.length for rod in shell.net.grid.rods)
    assert f"({number(mass)} kg)" in buy.told


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"),
        (1.2345, "1.23"),
        (0.0123, "0.0123"),
        (12345.0, "12\u202f345"),
        (100.0, "100"),
        (-2.5, "-2.5"),
        (1e-7, "1e-07"),
        (math.inf, "?"),
    ],
)
def test_numbers_are_written_for_people(value, text):
    assert number(value) == text


def test_a_curve_leaves_gaps_where_there_is_no_number_and_is_cut_at_the_axis():
    chart = line_chart("a & b", [0, 1, 2, 3, 4], {"x": [0.0, 0.5, math.nan, 9.0, 0.1]}, most=1.0, limit=0.8)
    lines = re.findall('points="([^"]*)"', chart.svg)
    assert [len(line.split()) for line in lines] == [2, 2]
    ordinates = [float(point.split(",")[1]) for line in lines for point in line.split()]
    assert min(ordinates) == pytest.approx(12.0), "9 stands at the upper end, which is 1"
    assert "refused" in chart.svg
    assert "a &amp; b" in chart.svg
    assert line_chart("flat", [0], {"x": [0.0]}).svg.count("<polyline") == 1


def test_pictures_are_made_small_films_go_in_as_they_are(tmp_path):
    Image.fromarray(np.zeros((900, 3200, 3), np.uint8)).save(tmp_path / "wide.png")
    Image.fromarray(np.zeros((8, 9, 4), np.uint8)).save(tmp_path / "clear.png")
    (tmp_path / "pour.mp4").write_bytes(b"film")
    found, left = embed(
        [tmp_path / name for name in ("wide.png", "clear.png", "pour.mp4", "none.png")], budget=10**6
    )
    assert [(each.width, each.height, each.film) for each in found] == [
        (1600, 450, False),
        (9, 8, False),
        (0, 0, True),
    ]
    assert found[0].source.startswith("data:image/webp;base64,")
    assert found[2].source == "data:video/mp4;base64,ZmlsbQ=="
    assert len(left) == 1
    assert "none.png can't be read" in left[0]


def test_a_picture_of_absurdly_many_pixels_is_left_out_and_named(tmp_path, monkeypatch):
    Image.fromarray(np.zeros((90, 90, 3), np.uint8)).save(tmp_path / "huge.png")
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 1000)
    found, left = embed([tmp_path / "huge.png"], budget=10**6)
    assert not found
    assert "huge.png can't be read" in left[0]


def test_a_fine_surface_is_made_light_and_stays_where_it_is(vault, monkeypatch):
    assert report._light(vault)[1] is not None
    monkeypatch.setattr(report, "_MOST_TRIANGLES", 2000)
    vertices, triangles = report._light(vault)
    assert 500 < len(triangles) < 4000
    assert triangles.max() < len(vertices)
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
    assert area == pytest.approx(vault.area, rel=0.035)  # the edge draws in by half a cell: 2.9 %


def test_file_names_are_told_in_words():
    assert report._caption("optimised-none") == "Optimised: no load"
    assert report._caption("utilisation-polished-design") == "Utilisation: polished, the design load"
    assert report._caption("net-skew") == "Net: skew"
    assert report._caption("deviations") == "Deviations"


def test_a_page_of_no_run_is_refused():
    with pytest.raises(InputError, match="no run to report"):
        report.html([], {})


def test_what_the_view_is_given_is_the_state_of_the_design(shell, vault):
    moved = State(shell.target.positions + 0.001, shell.target.quaternions)
    design = shell.design()
    states = {"none": shell.target, "design": moved}
    loads = {"none": np.zeros((len(moved.positions), 6)), "design": shell.point_load(6.9)}
    entry = report.Entry(
        "t",
        "p",
        {"initial": shell},
        vault,
        loads,
        {"initial": design},
        {"initial": states},
        "initial",
        told({"initial": design}),
        [],
        "",
        [],
        0.01,
        BOUNDS,
        [],
        [],
    )
    drawn = report._drawn(entry)
    found = drawn["designs"][0]["states"]["design"]
    assert found["length"] == pytest.approx(1e3 * shell.cables(design).lengths(moved), abs=1e-4)
    assert found["force"] == pytest.approx(shell.cables(design).tension(moved), rel=1e-5)
    assert [row[0] for row in found["rods"]] == pytest.approx(
        [math.sqrt(3.0)] * len(shell.net.grid.rods), abs=1e-3
    )
    assert drawn["loads"][0]["points"] == []
    assert len(drawn["loads"][1]["points"]) == len(shell.net.grid.lattice)
