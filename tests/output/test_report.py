"""What the page says: answers, numbers, charts, embedded pictures, and a surface made light."""

import base64
import math
import re
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

import shellform as sf
from shellform.errors import InputError
from shellform.net.edges import stand
from shellform.net.net import Stretch
from shellform.optimiser.optimum import Step
from shellform.output.page import report, view_data
from shellform.output.page.charts import line_chart
from shellform.output.page.embed import embed
from shellform.output.page.first_answers import answers
from shellform.output.page.shown_run import ShownRun
from shellform.quantities import number
from shellform.records.built_shape import BuiltShapeRecord
from shellform.records.check import Cell, Check
from shellform.records.summary import DocumentsRecord, StandingRecord, VerdictRecord
from shellform.records.words import constraint_titles
from shellform.structure.elements.state import State
from tests.net.edge_shells import barrel
from tests.records.made import optimisation, summary


def test_the_edge_is_told_by_what_it_stands_on_where_that_is_known(shell):
    arch, foot = shell.target.positions[:3], shell.target.positions[:2]
    stretches = (Stretch("ground", "", foot, False, False), Stretch("beam", "", arch, False, False))
    standing = replace(shell, net=replace(shell.net, stretches=stretches))
    design = standing.design()
    rows = {"initial": design}
    found = {
        answer.question: answer
        for answer in answers(standing, "initial", design, {"design": shell.target}, summary(rows))
    }
    words = found["What does its edge stand on?"].words
    assert (
        words
        == f"{number(stretches[0].length)} m on the ground, {number(stretches[1].length)} m on edge beams"
    )
    asked = answers(shell, "initial", design, {"design": shell.target}, summary(rows))
    assert all(answer.question != "What does its edge stand on?" for answer in asked)


@pytest.fixture
def designs(shell):
    return {
        "initial": shell.design(),
        "optimised": shell.design(rest_ratio=0.98),
        "polished": shell.design(rest_ratio=0.97),
    }


def test_the_answers_are_numbers_of_the_design(shell, designs):
    design, states = designs["polished"], {"design": shell.target}
    found = {
        answer.question: answer for answer in answers(shell, "polished", design, states, summary(designs))
    }
    pull = shell.cables(design).tension(shell.target)
    assert found["How far off is the shell?"].words == "4 mm at most"
    shape = BuiltShapeRecord(20, 0.0531, 0.0674, 0.0113)
    drawn = answers(shell, "polished", design, states, summary(designs, "design", built_shape=shape))[0]
    assert drawn.words == "4 mm as planned, 53 mm as built", "which may be ten times as much"
    before = "Braced and not yet loaded it is 2 mm off at most"
    assert drawn.detail.endswith(f"the median of 20 drawn structures; the worst is 67 mm off. {before}")
    rows = summary(designs, "design", built_shape=shape)
    initial = replace(shape, deviation_mean=0.0045)
    rows = rows.with_design(
        "initial",
        replace(
            rows.designs["initial"],
            loads={"design": replace(rows.designs["initial"].loads["design"], built_shape=initial)},
        ),
    )
    spent = answers(shell, "polished", design, states, rows)[0]
    assert f"{before}. Structures as built were 4.5 mm off in the mean with all cables" in spent.detail
    wished = replace(rows, optimisation=optimisation(deviation_wished=0.003))
    detail = answers(shell, "polished", design, states, wished)[0].detail
    assert f"{before}. The shape is 4 mm off where it is farthest, more than the 3 mm" in detail
    assert "all cables, and are 11 mm" in detail
    bare = replace(summary(designs), optimisation=optimisation(deviation_wished=0.003))
    assert (
        f"as planned. {before}. The shape is 4 mm off"
        in answers(shell, "polished", design, states, bare)[0].detail
    )
    assert "as built" not in found["How far off is the shell?"].detail, "nothing was drawn"
    assert found["How many cables?"].detail.startswith(f"{number(pull.max())} N at most in one")
    assert found["Which rods?"].words == "⌀ 2 mm"
    length = sum(rod.length for rod in shell.net.grid.rods)
    assert found["What to buy?"].words == f"{number(length)} m of rod"
    assert found["Is it safe at 1.2 × the load?"].good is None, "nothing was drawn"
    assert found["Is it safe at 1.2 × the load?"].words == "Not examined as built"
    drawn = summary(designs, "additional", stands=StandingRecord(200, 198, 0.9689, 0.95, 0))
    cell = Cell("198 of 200 structures as built stand (at least 96 % with 95 % confidence)", True)
    answer = answers(shell, "polished", design, states, drawn, as_built=cell)[3]
    assert (answer.words, answer.good) == ("198 of 200 structures as built stand", True)
    assert answer.detail.startswith("At least 96 % with 95 % confidence. As planned")
    few = summary(designs, "additional", stands=StandingRecord(200, 125, 0.562, 0.95, 0))
    cell = Cell("125 of 200 structures as built stand (at least 56 % with 95 % confidence)", True)
    answer = answers(shell, "polished", design, states, few, as_built=cell)[3]
    assert (answer.words, answer.good) == ("Not surely: 125 of 200 structures as built stand", None)
    assert "No more are asked for. As planned" in answer.detail
    assert "isn't known" in found["Is it safe at 1.2 × the load?"].detail
    for known, words in [
        (
            {"critical_factor": 1.85, "critical_kind": "limit point"},
            "ends at 1.850 × the design load (limit point)",
        ),
        ({"critical_factor": 3.0, "critical_kind": "none"}, "up to 3 ×"),
    ]:
        sought = summary(designs, "design", **known)
        assert words in answers(shell, "polished", design, states, sought)[3].detail
    for change, words in [
        ({"on_branch": False}, "No, it snaps through"),
        ({"stable": False}, "No, it is unstable"),
        ({"rod_utilisation_max": 1.1}, "No, rods break"),
    ]:
        answer = answers(shell, "polished", design, states, summary(designs, "additional", **change))[3]
        assert answer.words == words
        assert answer.good is False


def test_the_mass_of_the_rods_is_told_where_their_density_is_known(shell, designs):
    material = replace(shell.rod.section.material, density=2000.0)
    heavy = replace(shell, rod=sf.Rod(replace(shell.rod.section, material=material)))
    buy = answers(heavy, "polished", designs["polished"], {}, summary(designs))[-1]
    mass = 2000.0 * math.pi * 0.001**2 * sum(rod.length for rod in shell.net.grid.rods)
    assert f"({number(mass)} kg)" in buy.words


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"),
        (1.2345, "1.23"),
        (0.0123, "0.0123"),
        (12345.0, "12\u202f345"),
        (100.0, "100"),
        (-2.5, "-2.5"),
        (1e-7, "1 × 10⁻⁷"),
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


def test_no_two_curves_of_a_chart_look_alike():
    chart = line_chart("x", [0, 1], {str(k): [0.0, 1.0] for k in range(9)}, main=False)
    assert len({kind for kind, _ in chart.legend}) == 9
    assert chart.svg.count('again"') == 3


def test_constraints_of_one_quantity_are_told_apart_by_their_loads():
    names = ["utilisation.none", "utilisation", "cable_force", "utilisation.additional", "misfit.additional"]
    assert constraint_titles(names) == {
        "utilisation.none": "rods' stress, no load",
        "utilisation": "rods' stress, design load",
        "cable_force": "cable forces",
        "utilisation.additional": "rods' stress, additional load",
        "misfit.additional": "misfit, additional load",
    }


LOWERED = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")


@pytest.mark.parametrize(("first", "last", "largest"), [(0, 60, 0.37), (200, 263, 410.0), (3, 9, 2.2e-4)])
def test_the_axes_of_a_chart_are_divided_at_a_few_round_numbers_from_end_to_end(first, last, largest):
    at = range(first, last + 1)
    chart = line_chart("x", at, {"x": np.linspace(0.0, largest, len(at))})
    for anchor, low, high in (("middle", first, last), ("end", 0.0, largest)):
        told = re.findall(rf'text-anchor="{anchor}">([-.×⁻⁰¹²³⁴⁵⁶⁷⁸⁹ \d]+)<', chart.svg)
        values = [float(each.replace(" × 10", "e").translate(LOWERED)) for each in told]
        steps = np.diff(values)
        assert steps == pytest.approx(np.full(len(steps), steps[0])), told
        assert f"{steps[0]:.0e}"[0] in "125", steps[0]
        assert low <= values[0] < low + steps[0]
        assert high - steps[0] < values[-1] <= high
        assert 3 <= len(values) <= 7


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
    assert view_data._light(vault)[1] is not None
    monkeypatch.setattr(view_data, "_MOST_TRIANGLES", 2000)
    vertices, triangles = view_data._light(vault)
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


def run_of(shell, vault, design, moved):
    """One with its initial design, which the design load has `moved`."""
    loads = {"none": np.zeros((len(moved.positions), 6)), "design": shell.point_load(6.9)}
    return ShownRun(
        "t",
        "p",
        {"initial": shell},
        vault,
        loads,
        {"initial": design},
        {"initial": {"none": shell.target, "design": moved}},
        "initial",
        summary({"initial": design}),
        [],
        VerdictRecord("initial", True, (), ()),
        [],
        "",
        [],
        0.01,
        [],
        [],
    )


def test_as_many_trials_are_told_as_rejected_as_the_history_marks_so(shell, vault):
    """The summary's own count is of those that left the stable branch: one of 29 on a vault."""
    steps = [
        Step(number, 1.0, {"misfit": 1.0}, {"cable_force": -0.5}, 100, 1.0, number % 2 == 0, 1.0)
        for number in range(5)
    ]
    run = replace(run_of(shell, vault, shell.design(), shell.target), history=steps)
    assert run.summary.optimisation.rejected == 1
    assert "3 evaluations, 2 of them rejected" in report.html([run], {"shellform": "0"})


@pytest.mark.parametrize(
    ("verdict", "kind", "words", "badge"),
    [
        (VerdictRecord("initial", True, (), ()), "good", "Holds", "to build"),
        (VerdictRecord("initial", True, (), (), ("It snaps.",)), "open", "Holds, with a caution", "to build"),
        (VerdictRecord("initial", False, (), ("Stands",)), "open", "Not examined", "best so far"),
        (
            VerdictRecord("initial", False, ("No.",), (), ("It snaps.",)),
            "bad",
            "Does not hold",
            "best so far",
        ),
    ],
)
def test_the_page_shows_the_verdict_in_its_colour_with_what_asks_for_care(
    shell, vault, verdict, kind, words, badge
):
    run = replace(run_of(shell, vault, shell.design(), shell.target), verdict=verdict)
    text = report.html([run, run], {"shellform": "0"})
    assert f'<div class="verdict {kind}">' in text
    assert f'<span class="badge {kind}">{words}</span>' in text
    assert f'<span class="badge {kind}">{badge}</span>' in text
    assert ("<li>Caution: It snaps.</li>" in text) == bool(verdict.cautions)


def test_a_check_that_holds_and_asks_for_care_is_amber(shell, vault):
    cell = Cell("200 of 200 stand", True, caution="1 snaps")
    run = replace(
        run_of(shell, vault, shell.design(), shell.target),
        checks=[Check("As built", "198", {"initial": cell})],
    )
    text = report.html([run], {"shellform": "0"})
    assert (
        '<span class="mark open">✓<span class="spoken"> pass, with a caution</span></span> 200 of 200' in text
    )


def test_what_the_workshop_has_to_know_is_among_the_notes_of_the_page(shell, vault):
    run = run_of(shell, vault, shell.design(), shell.target)
    spliced = "44 rods are longer than the stock and must be SPLICED"
    documents = DocumentsRecord("initial", 6.0, 90, 90, 0.1, (1, 2), ("90 bars of 6 m.", spliced))
    text = report.html([replace(run, summary=replace(run.summary, documents=documents))], {"shellform": "0"})
    assert f"<li>{spliced}</li>" in text
    assert "rods from 90 bars of 6 m, 2 of them spliced" in text


def test_runs_side_by_side_tell_the_rods_stress_as_each_run_s_own_answers_do(shell, vault):
    """With axial force: bending alone was told there, 97 % of a vault whose rods are at 99 %."""
    run = run_of(shell, vault, shell.design(), shell.target)
    own = run.summary.designs["initial"]
    loads = {name: replace(row, stress_utilisation_max=0.93) for name, row in own.loads.items()}
    run = replace(run, summary=run.summary.with_design("initial", replace(own, loads=loads)))
    text = report.html([run, run], {"shellform": "0"})
    head, row = re.search(r"<thead>(.*?)</thead>\s*<tbody>\s*(.*?)</tr>", text, re.DOTALL).groups()
    heads = re.findall(r"<th.*?>(.*?)</th>", head)
    cells = re.findall(r"<t[hd].*?>(.*?)</t[hd]>", row, re.DOTALL)
    assert cells[heads.index("Rods' stress, design load [%]")] == "93"
    assert "at 93 % of their strength" in text


@pytest.mark.parametrize(("times", "unit"), [(1.0, "N"), (1e3, "kN")])
def test_all_forces_of_the_tables_are_read_in_the_unit_of_the_view(shell, vault, times, unit):
    run = run_of(shell, vault, shell.design(), shell.target)
    own = run.summary.designs["initial"]
    loads = {name: replace(row, cable_force_max=times * 19.8) for name, row in own.loads.items()}
    heavy = replace(own, cable_force_max=times * 18.7, cable_force_sum=times * 132.0, loads=loads)
    text = report.html([replace(run, summary=run.summary.with_design("initial", heavy))], {"shellform": "0"})
    assert f"Largest force [{unit}]" in text
    assert f"All forces [{unit}]" in text
    assert '<td class="num">18.7</td><td class="num">132</td>' in text
    two = report.html(
        [replace(run, summary=run.summary.with_design("initial", heavy)), run], {"shellform": "0"}
    )
    assert f"Largest cable force [{unit}]" in two, "one for all runs"


def test_what_the_view_is_given_is_the_state_of_the_design(shell, vault):
    moved = State(shell.target.positions + 0.001, shell.target.quaternions)
    design = shell.design()
    run = run_of(shell, vault, design, moved)
    assert report.viewed(run).load_titles == {"none": "no load", "design": "the design load"}
    other = replace(run, loads={"additional": run.loads["design"]})
    assert report.viewed(other).load_titles == {"additional": "1.2 × the load"}
    apart = replace(other, summary=summary({"initial": design}, "additional", multiple=False))
    assert report.viewed(apart).load_titles == {"additional": "the additional load"}
    seen = report.viewed(run)
    drawn = view_data.view_data(seen)
    farthest = 1e3 * np.linalg.norm(moved.positions - shell.target.positions, axis=1).max()
    assert farthest <= view_data.fitting(seen) < 2.0 * farthest
    half = 0.5 * np.ptp(shell.target.positions, axis=0)
    assert np.array(drawn["box"]) == pytest.approx(np.array([-half, half]), rel=1e-5)
    found = drawn["designs"][0]["states"]["design"]
    assert found["length"] == pytest.approx(1e3 * shell.cables(design).lengths(moved), abs=1e-4)
    assert found["force"] == pytest.approx(shell.cables(design).tension(moved), rel=1e-5)
    assert [row[0] for row in found["rods"]] == pytest.approx(
        [math.sqrt(3.0)] * len(shell.net.grid.rods), abs=1e-3
    )
    assert drawn["loads"][0]["points"] == []
    assert len(drawn["loads"][1]["points"]) == len(shell.net.grid.lattice)


def test_the_flat_grid_lies_under_the_shell_as_near_as_it_can(shell):
    flat, place = shell.net.grid.flat, shell.target.positions
    laid = view_data.laid_out(flat, place)
    apart = np.linalg.norm(laid[:, None, :2] - laid[None, :, :2], axis=2)[:40, :40]
    assert apart == pytest.approx(np.linalg.norm(flat[:, None, :2] - flat[None, :, :2], axis=2)[:40, :40])
    near = np.linalg.norm((laid - place)[:, :2], axis=1).mean()
    for turn in (-0.05, 0.05):
        spun = (laid[:, :2] - laid[:, :2].mean(axis=0)) @ [
            [math.cos(turn), math.sin(turn)],
            [-math.sin(turn), math.cos(turn)],
        ] + laid[:, :2].mean(axis=0)
        assert np.square(spun - place[:, :2]).sum() > np.square((laid - place)[:, :2]).sum()
    assert near < 0.2
    assert laid[:, 2].min() == pytest.approx(place[:, 2].min())


def test_a_radius_between_two_sizes_is_told_as_it_can_be_made_with_the_next_size_sold(shell, designs):
    design = replace(designs["polished"], radius=0.00132268)
    found = answers(shell, "polished", design, {}, summary(designs), next_size="⌀ 3 mm")
    rods = next(answer for answer in found if answer.question == "Which rods?")
    assert rods.words == "⌀ 2.65 mm"
    assert rods.detail.endswith("the next size sold is ⌀ 3 mm")


def test_cables_that_are_slack_before_the_load_are_named(shell, designs):
    given = summary(designs, "none", slack=("C3", "C7"))
    found = answers(shell, "polished", designs["polished"], {}, given)
    cables = next(answer for answer in found if answer.question == "How many cables?")
    assert "slack before any load: C3, C7" in cables.detail


def test_the_view_has_the_edge_beams_on_which_arches_hang():
    surface = barrel()
    net = sf.pull_net(surface, spacing=0.1, gap=0.002, angle=np.deg2rad(45.0), elements=2)
    none = np.zeros((0, 2), dtype=np.int64)
    assert view_data.net_data(net, "arches", "", none)["edges"] == []
    standing = stand(net, surface)
    drawn = view_data.net_data(standing, "arches", "", none)
    assert len(standing.edges) == 2
    assert drawn["edges"] == [pair for line in standing.edges for pair in line.ends.tolist()]


def test_before_the_grid_is_bent_edge_beams_are_in_their_places_and_the_grid_lies_on_the_ground_between_them():
    surface = barrel(raised=-3.0)
    net = sf.pull_net(surface, spacing=0.1, gap=0.002, angle=np.deg2rad(30.0), elements=2)
    standing = stand(net, surface)
    place = standing.target.positions
    drawn = view_data.net_data(standing, "arches", "", np.zeros((0, 2), dtype=np.int64))
    flat = np.frombuffer(base64.b64decode(drawn["flat"]), dtype="<f4").reshape(-1, 3)
    flat = flat + 0.5 * (place.min(axis=0) + place.max(axis=0))
    rods = np.unique(net.grid.rod_ends)
    beams = np.setdiff1d(np.arange(len(place)), rods)
    np.testing.assert_allclose(flat[beams], place[beams], atol=1e-6)
    assert flat[rods, 2].min() == pytest.approx(place[:, 2].min(), abs=1e-6)
    assert np.ptp(flat[rods, 2]) == pytest.approx(net.grid.gap, abs=1e-6)
    assert np.linalg.norm((flat - place)[rods, :2], axis=1).mean() < 0.1
