"""`shellform new`: what it proposes stands, and what can't be built is said with a way out that works."""

import errno
import os
import re
import tomllib
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from shellform.case.build_gridshell import gridshell
from shellform.case.build_net import net_of, surface_of
from shellform.case.case import load_case
from shellform.errors import InputError, NotConverged
from shellform.gridshell.catalogue import read_catalogue
from shellform.gridshell.edge_beams import Bundle
from shellform.gridshell.gridshell import Rod, erection_stress
from shellform.gridshell.joints import following
from shellform.gridshell.layers import single
from shellform.net.chebyshev import pull_net
from shellform.problem.paths import follow
from shellform.records.progress import unheard
from shellform.run import first_net, first_trial, propose
from shellform.run.first_design import first_design, standing_design
from shellform.run.first_edges import edge_choices
from shellform.run.first_net import Allowance
from shellform.run.first_refusal import Refused, WayOut
from shellform.run.first_trial import NEEDED, PULLED, FirstParts, Followed
from shellform.run.propose import propose_case
from shellform.run.proposed_edges import edge_beams_table, edge_beams_told
from shellform.run.proposed_shape import (
    built_deviation,
    cables_pull,
    optimise_table,
    rods_strength,
    stray_told,
)
from shellform.run.sizes import (
    LEAST_PRESTRAIN,
    STRAINED,
    DesignWish,
    Placed,
    Rope,
    choices,
    curvature_shown,
    curvature_usual,
    first_spacing,
    hopeless,
    least_spacing,
    load_borne,
    next_choice,
    next_thinner,
    practical,
    radius_for,
    rest_ratio_for,
    rope_for,
    usual_thickness,
    wished,
)
from shellform.run.unbuildable import (
    Obstacle,
    Unbuildable,
    Why,
    refuse_flat,
    refuse_size,
    refuse_tipping,
    refused,
)
from shellform.structure.elements.sections import Round, Tube, mass_per_length, stiffness
from shellform.surface.readers.reading import read_surface
from shellform.surface.shape.target import curvature, make_surface
from tests.net.edge_shells import barrel, sail
from tests.surface.shells import cap, write_obj

DOME = Path(__file__).parent.parent / "data" / "dome_mm.step"


def dish(size=8.0, rise=1.6, unit=1.0, count=21):
    """z = rise (1 - (2r/a)²) / 2 over a square, m, in the unit."""
    x, y = (
        each.ravel() for each in np.meshgrid(*2 * [np.linspace(-size / 2, size / 2, count)], indexing="ij")
    )
    z = rise * (2.0 - (2.0 * x / size) ** 2 - (2.0 * y / size) ** 2) / 2.0
    i = np.arange(count * count).reshape(count, count)
    a, b, c, d = (each.ravel() for each in (i[:-1, :-1], i[1:, :-1], i[1:, 1:], i[:-1, 1:]))
    faces = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    return make_surface(np.column_stack([x, y, z]) / unit, faces)


def as_obj(file, surface):
    lines = [f"v {x} {y} {z}" for x, y, z in surface.vertices.tolist()]
    lines += ["f " + " ".join(str(k + 1) for k in triangle) for triangle in surface.triangles.tolist()]
    file.write_text("\n".join(lines))
    return file


@pytest.fixture(scope="module", autouse=True)
def few_drawn():
    """Of what stands eight structures are drawn instead of forty; how many are is tested in
    test_first_judgements.py, and a search with all of them in tests/cli/test_quiet.py."""
    with pytest.MonkeyPatch.context() as changed:
        for module in ("first_design", "first_finish", "first_trial"):
            changed.setattr(f"shellform.run.{module}.DRAWN", 8)
        yield


@pytest.fixture(scope="module")
def proposed(tmp_path_factory):
    """The dome's case with one angle tried, and what was told."""
    case = tmp_path_factory.mktemp("new") / "dome.toml"
    told = propose_case(DOME, case, {}, allow_scripts=False, wish=DesignWish(angle=45.0))
    return case, told


def test_a_proposed_case_loads_and_its_initial_design_stands_under_both_loads_as_design_solves_it(proposed):
    case = load_case(proposed[0], ["net.elements=2"])
    assert Path(case.surface.file).resolve() == DOME.resolve()
    surface = surface_of(case.surface)
    net, _, _ = net_of(case, surface)
    shell, loads = gridshell(case, net, surface)
    assert shell.joint.gap == net.grid.gap == 2.0 * shell.rod.section.fibres[1]
    found = follow(shell, shell.design(rest_ratio=case.cable.rest_ratio), loads, stay=True)
    assert all(each.on_branch for each in found.values())


def test_new_tells_what_it_reads_and_once_what_was_mended_in_it(tmp_path):
    file, heard = tmp_path / "flat.obj", []
    lines = ["v 0 0 0", "v 4 0 0", "v 4 4 0", "v 0 4 0", "v 9 9 9", "f 1 2 3", "f 1 3 4"]
    file.write_text("\n".join(lines), encoding="utf-8")
    with pytest.raises(InputError, match="keeps to a plane"):
        propose_case(file, tmp_path / "flat.toml", {}, allow_scripts=False, report=heard.append)
    assert [each.text for each in heard if "no face" in each.text] == ["1 point of no face was dropped"]
    assert heard[0].text == "reading flat.obj"


def test_a_proposed_case_says_why_and_what_its_edges_stand_on(proposed):
    text, told = proposed[0].read_text(encoding="utf-8"), proposed[1]
    assert "equation (1) allows" in text
    assert told["edges"] in text
    case = load_case(proposed[0])
    assert {each.name for each in case.load} == {"design", "additional"}
    assert case.rod.section in {label.split()[0] + " mm" for label in re.findall(r"[\d.]+ mm", text)}


@pytest.mark.parametrize(
    ("size", "thickness", "deviation", "why"),
    [
        (8.0, 0.05, 0.025, "half the concrete"),
        (24.0, 0.05, 0.048, "500th of the span"),
        (1.0, 0.012, 0.006, "half"),
    ],
)
def test_a_proposed_case_saves_cables_up_to_half_its_concrete_or_a_500th_of_its_span(
    size, thickness, deviation, why
):
    surface, tried = (
        dish(size=size, rise=0.2 * size),
        Followed(NEEDED, 0.5, 0.3, 0.0, 0.0, 0.5, np.zeros(3), np.zeros(3)),
    )
    design = SimpleNamespace(thickness=thickness, spacing=0.5, tried=tried)
    entry = optimise_table(surface, design)
    assert tomllib.loads(entry)["optimise"]["deviation"] == deviation
    assert why in entry
    assert "initial design" not in entry
    design.tried = replace(tried, off=4.6 * deviation)
    far = optimise_table(surface, design)
    assert tomllib.loads(far) == tomllib.loads(entry)
    assert "the initial design lies" in far
    assert "4.6 times what its shape may be in the end, of which a search usually leaves a quarter" in far


@pytest.mark.parametrize(
    ("size", "thickness", "most", "why"),
    [(14.0, 0.05, 0.28, "a 50th of the span"), (0.4, 0.016, 0.016, "the concrete's thickness")],
)
def test_a_proposed_case_limits_the_shape_as_built_to_a_50th_of_its_span_or_its_concrete(
    size, thickness, most, why
):
    surface = dish(size=size, rise=0.2 * size)
    design = SimpleNamespace(thickness=thickness, strays=most)
    assert stray_told(design, surface, None) == ""
    entry = built_deviation(surface, design, "")
    assert tomllib.loads(entry) == {"built_deviation": most}
    first, commented = entry.splitlines()
    assert first.endswith(why)
    assert tomllib.loads(commented.removeprefix("# ")) == {"unloaded_deviation": most}
    design.strays = 1.5 * most
    walls = WayOut(SimpleNamespace(strays=0.5 * most), DesignWish(edges="wall"), "With walls")
    told = stray_told(design, surface, walls)
    assert f"stray by up to {1.5e3 * most:g} mm, where {1e3 * most:g} mm may be" in told
    assert told.endswith(f"with --edges wall by up to {500 * most:g} mm")
    assert tomllib.loads(built_deviation(surface, design, told)) == {"built_deviation": most}


@pytest.mark.parametrize("taken", [True, False])
def test_a_shell_that_strays_as_built_is_told_so_and_stands_on_walls_where_the_way_out_is_taken(
    tmp_path, monkeypatch, taken
):
    file, case, wish = as_obj(tmp_path / "a.obj", dish(size=6.0, count=13)), tmp_path / "a.toml", []
    asked = DesignWish(spacing=0.6, angle=0.0, layers=1)
    design = standing_design(read_surface(file), asked, print, Allowance())
    monkeypatch.setattr(propose, "first_design", lambda *_: replace(design, strays=0.2))
    steady = WayOut(
        replace(design, strays=0.05), replace(asked, edges="wall"), "With --edges wall this goes on"
    )
    monkeypatch.setattr(propose, "steadier_on_walls", lambda *_: steady)
    monkeypatch.setattr(propose, "finished_design", lambda design, *_: wish.append("finished") or design)
    told = propose_case(file, case, {}, allow_scripts=False, wish=asked, way_out=taken)
    text = case.read_text(encoding="utf-8")
    assert load_case(case).limits.built_deviation == 0.12
    assert load_case(case).edges.outer == ("wall" if taken else "auto")
    assert wish == (["finished"] if taken else [])
    if taken:
        assert told["way out"] == steady.told
        assert "NOT the surface as it is: structures drawn as built stray by up to 200 mm" in text
        assert "shape" not in told
    else:
        said = "structures drawn as built stray by up to 200 mm, where 120 mm may be; with --edges wall by up to 50 mm"
        assert told["shape"] == said
        assert (
            f"built_deviation = 0.12    # m, under the design load, in the worst of twenty structures as built: a 50th of the span; {said}\n"
            in text
        )


def test_what_the_shape_of_a_proposed_case_may_be_off_by_is_no_requirement_before_it_is_made_one(proposed):
    case = load_case(proposed[0])
    assert (case.optimise.deviation, case.limits.deviation) == (0.0055, None)


def test_the_same_surface_gives_the_same_case(proposed, tmp_path):
    again = proposed[0].parent / "again.toml"
    propose_case(DOME, again, {}, allow_scripts=False, wish=DesignWish(angle=45.0))
    assert again.read_bytes() == proposed[0].read_bytes()


def test_a_case_is_not_overwritten_nor_written_under_another_name_or_to_nowhere(tmp_path):
    (tmp_path / "mine.toml").write_text("mine")
    with pytest.raises(InputError, match="not overwritten"):
        propose_case(DOME, tmp_path / "mine.toml", {}, allow_scripts=False)
    with pytest.raises(InputError, match=r"must end in \.toml"):
        propose_case(DOME, tmp_path / "mine.txt", {}, allow_scripts=False)
    with pytest.raises(InputError, match="no such folder"):
        propose_case(DOME, tmp_path / "no" / "mine.toml", {}, allow_scripts=False)
    assert (tmp_path / "mine.toml").read_text() == "mine"


def test_a_folder_that_cannot_be_written_is_told_before_the_surface_is_read(tmp_path, monkeypatch):
    usual = os.open

    def opened(file, flags, *mode, **where):
        if flags & os.O_CREAT and Path(file).parent == tmp_path:
            raise PermissionError(errno.EACCES, "Permission denied", str(file))
        return usual(file, flags, *mode, **where)

    with monkeypatch.context() as closed:
        closed.setattr(os, "open", opened)
        with pytest.raises(InputError, match=r"mine\.toml: can't be written: .*Choose a folder that you may"):
            propose_case(tmp_path / "no.stl", tmp_path / "mine.toml", {}, allow_scripts=False)
    with pytest.raises(InputError, match=r"no\.stl"):
        propose_case(tmp_path / "no.stl", tmp_path / "mine.toml", {}, allow_scripts=False)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("given", [{}, {"origin": [0.0, 0.0, 1000.0]}])
def test_levels_of_a_surface_far_away_count_from_the_origin_that_is_written_with_them(tmp_path, given):
    """A cap of 1.5 m at 1300 m, cut off 0.1 m above its edge."""
    points, quads = cap()
    far = write_obj(tmp_path / "far.obj", 0.25 * points + [0.0, 0.0, 1300.0], quads)
    asked = propose._Asked(far, tmp_path / "far.toml", False, unheard)
    counted = 1300.0 - given.get("origin", [0.0, 0.0, 0.0])[2]
    options = {**given, "above": counted + 0.1, "ground": counted + 0.02}
    ready = propose._read(asked, far, options, None)
    assert ready.options["origin"][2] == 1300.0
    assert [ready.options[each] for each in ("above", "ground")] == [0.1, 0.02]
    again = surface_of(propose.surface_entry(far, ready.options))
    np.testing.assert_allclose(again.vertices, ready.surface.vertices, atol=1e-9)
    assert again.area == pytest.approx(ready.surface.area, rel=1e-9)
    assert again.vertices[:, 2].min() == pytest.approx(0.1, abs=1e-6)


def test_what_is_wished_for_is_checked():
    for wish in ({"spacing": 0.0}, {"thickness": -1.0}, {"angle": np.nan}, {"edges": "air"}):
        with pytest.raises(InputError, match=next(iter(wish))):
            DesignWish(**wish)
    with pytest.raises(InputError, match="--rod"):
        DesignWish(rod="gfrp_rods/9.5 mm")


def test_one_crease_does_not_decide_the_spacing_but_the_radius_of_most_of_the_surface_does():
    smooth = dish()
    folded = make_surface(smooth.vertices.copy(), smooth.triangles)
    points = folded.vertices.copy()
    points[10 * 21 + 10, 2] += 0.15
    folded = make_surface(points, folded.triangles)
    assert curvature_shown(folded) == pytest.approx(curvature_shown(smooth), rel=0.1)
    assert first_spacing(folded)[0] == first_spacing(smooth)[0]
    tight = dish(size=2.0, rise=2.0)
    spacing, reason = first_spacing(tight)
    assert "radius" in reason or spacing * curvature_shown(tight) <= 1.0 / 3.0 + 1e-9


def test_curvature_alone_asks_for_no_more_crossings_than_can_be_tried_in_a_minute():
    x, y = (each.ravel() for each in np.meshgrid(*2 * [np.linspace(-6.0, 6.0, 41)], indexing="ij"))
    flat = dish(size=12.0, rise=0.001, count=41)
    folded = make_surface(
        np.column_stack([x, y, 0.5 * np.abs(x % 2 - 1) + 0.5 * np.abs(y % 2 - 1)]), flat.triangles
    )
    spacing, reason = first_spacing(folded)
    assert folded.area / spacing**2 < 700
    assert "crossings at the most, where a third" in reason


def test_a_crease_leaves_the_usual_curvature_and_the_rods_that_bear_the_load_as_they_are():
    smooth = dish()
    points = smooth.vertices.copy()
    points[:, 2] -= 0.3 * np.abs(points[:, 0])
    creased = make_surface(points, smooth.triangles)
    assert curvature_usual(creased) == pytest.approx(curvature_usual(smooth), rel=0.15)
    assert np.abs(curvature(creased)).max() > 5.0 * curvature_usual(creased)
    least = radius_for(creased, 0.5, 800.0, DesignWish())
    assert least == pytest.approx(radius_for(smooth, 0.5, 800.0, DesignWish()), rel=0.25)
    assert least > radius_for(creased, 0.5, 100.0, DesignWish()) > 0.0
    assert radius_for(creased, 0.5, 1e6, DesignWish()) == 0.0


@pytest.mark.parametrize("name", ["gfrp_rods/25 mm", "gfrp_rods/8 mm", "gfrp_tubes/50 × 5 mm"])
def test_a_grid_s_least_spacing_is_seven_times_its_rods_depth_in_whole_millimetres(name):
    (choice,) = wished(name)
    least = 1e3 * least_spacing(choice)
    assert least == pytest.approx(round(least))
    assert 0.0 <= least - 7.0 * 2e3 * max(choice.section.fibres) < 1.0


def test_failed_pulls_are_worth_as_many_factorisations_as_the_net_has_crossings_up_to_three_hundred():
    surface = dish()
    for crossings, worth in ((300.0, 450), (150.0, 450), (600.0, 225), (4500.0, 30)):
        spacing = np.sqrt(surface.area / crossings)
        assert first_net._worth(surface, spacing) == worth


def test_rods_far_too_thin_are_told_from_those_worth_a_trial():
    thin, stout = wished("gfrp_rods/2 mm")[0], wished("gfrp_rods/25 mm")[0]
    assert hopeless(dish(), 0.5, thin, 2000.0)
    assert not hopeless(dish(), 0.5, stout, 2000.0)


def test_a_crease_is_told_as_the_reason_where_the_rods_that_follow_it_bear_too_little():
    surface = dish()
    points = surface.vertices.copy()
    points[:, 2] -= 0.2 * np.maximum(np.abs(points[:, 0]) - 0.4, 0.0)
    surface = make_surface(points, surface.triangles)
    placed = Placed(pull_net(surface, spacing=0.5, gap=0.02, angle=0.0, elements=2), 0.0, (0.0, 0.0))
    thin = wished("gfrp_rods/4 mm")[0]
    failure = Obstacle(Why.STABILITY, 0.5, 0.05, 0.1, thin, placed, np.zeros(3), 0.5)
    told = refused(surface, failure, DesignWish())
    assert isinstance(told, Unbuildable)
    assert told.what.startswith("at (")
    assert told.radius > 1.3 / placed.net.quality.curvature_max
    thick = refused(
        surface, replace(failure, factor=1.2), DesignWish(), design=SimpleNamespace(thickness=0.04)
    )
    assert "--thickness 0.04" in thick.remedy


@pytest.mark.parametrize(("exact", "set_out"), [(0.0557, 0.055), (0.234, 0.23), (0.58, 0.55), (1.04, 1.0)])
def test_spacings_are_rounded_down_to_what_is_set_out(exact, set_out):
    assert practical(exact) == pytest.approx(set_out)
    assert rope_for(1.0).diameter == 0.006


@pytest.fixture(scope="module")
def net():
    """On a barrel."""
    from shellform.net.chebyshev import pull_net

    return pull_net(barrel(), spacing=0.1, gap=0.1 / 27.5, angle=np.deg2rad(45.0), elements=2)


def test_after_a_section_that_falls_a_stiffer_one_comes_and_after_one_that_breaks_one_less_stressed(net):
    found = choices(net, 0.1, None)
    share = [erection_stress(net, each.section) / each.section.material.strength for each in found]
    at = len(found) // 2
    stiffer = next_choice(net, found, at, share[at], 2.0, 0.95)
    assert found[stiffer].bending >= 2.0 * found[at].bending
    assert share[stiffer] <= 0.95
    bent = int(np.argmax(share))
    assert share[next_choice(net, found, bent, share[bent], 0.0, 0.95)] == min(share)
    assert next_choice(net, found, at, 50.0, 0.0, 0.01) == at, "none would do"
    half = 0.5 * (share[at] + 0.95)
    assert load_borne(net, found[at], half, 0.95) == pytest.approx(2.0)


def test_where_stiffer_sections_are_stressed_more_one_less_deep_comes(net):
    found = choices(net, 0.1, None)
    thinner = next_thinner(found, len(found) - 1, 0.8)
    assert max(found[thinner].section.fibres) <= 0.8 * max(found[-1].section.fibres)
    assert found[thinner].bending < found[-1].bending
    assert next_thinner(found, 0, 0.8) == 0, "there is none"


def test_two_layers_are_stiffer_across_the_surface_and_bent_like_one(net):
    one, two = wished("gfrp_rods/6 mm", 1)[0], wished("gfrp_rods/6 mm", 2)[0]
    assert two.bending > 2.0 * one.bending
    assert two.moment > 2.0 * one.moment
    assert erection_stress(net, two.section) == pytest.approx(erection_stress(net, one.section))


def parts_of(rest_ratio, swivels=True):
    rods = wished("gfrp_rods/6 mm")[0]
    return FirstParts(rods, edge_choices(rods)[0], rest_ratio, rope_for(1.0), swivels)


def test_cables_pulled_too_much_at_the_start_get_less_prestrain_and_never_none():
    parts = parts_of(0.996)
    assert 1.0 - parts.eased(PULLED + 0.2).rest_ratio == pytest.approx(0.004 - 0.2 * STRAINED, abs=1e-4)
    slack = parts.eased(3.0)
    assert slack.rest_ratio == 1.0 - LEAST_PRESTRAIN
    assert slack.rope == parts.rope
    assert 1.0 - rest_ratio_for(dish(), 0.4) > 1.0 - rest_ratio_for(dish(), 4.0)


def test_cables_pulled_too_much_with_the_least_prestrain_become_thicker_as_far_as_there_are_strands():
    parts = parts_of(1.0 - LEAST_PRESTRAIN)
    diameters = []
    while parts is not None:
        diameters.append(parts.rope.diameter)
        parts = parts.eased(1.2)
    assert diameters == [0.006, 0.008, 0.010, 0.012, 0.014, 0.016]
    assert rope_for(2.0).diameter == 0.008, "none begins with more"


def test_rods_that_break_beside_cables_that_give_get_strands_that_bear_what_pulls_them():
    parts = parts_of(0.998)
    breaks = Followed(NEEDED, 1.05, 0.5, 0.0, 0.0, 1.2, np.zeros(3), np.zeros(3))
    assert parts.stronger(breaks) == replace(parts, rope=Rope(0.008))
    assert parts.stronger(replace(breaks, pull=2.5)).rope.diameter == 0.014, "5 times the section, not 2.9"
    assert parts.stronger(replace(breaks, pull=20.0)).rope.diameter == 0.016, "the largest in stock"
    assert replace(parts, rope=Rope(0.016)).stronger(breaks) is None
    assert parts.stronger(replace(breaks, stress=0.95)) is None
    assert parts.stronger(replace(breaks, pull=1.0)) is None, "strands that hold are no reason"
    assert parts.stronger(replace(breaks, factor=0.99 * NEEDED)) is None


def test_of_failures_that_bear_the_load_the_least_stressed_came_nearest():
    falls, breaks, breaks_less = (
        Obstacle(Why.STABILITY, 0.5, 0.05, 1.4, stress=0.2),
        Obstacle(Why.STRENGTH, 0.5, 0.05, NEEDED, stress=1.5),
        Obstacle(Why.STRENGTH, 0.7, 0.05, NEEDED, stress=0.98),
    )
    as_built = Obstacle(Why.SCATTER, 0.5, 0.05, NEEDED, stress=0.9)
    ranked = [falls, breaks, breaks_less, as_built]
    assert sorted(reversed(ranked), key=lambda each: each.near(NEEDED)) == ranked


def test_what_heavier_edge_beams_gain_is_load_until_all_is_borne_and_stress_from_then_on():
    falls = Obstacle(Why.STABILITY, 1.0, 0.05, 0.5, stress=1.2)
    assert replace(falls, factor=0.75).eases(falls, NEEDED) == pytest.approx(1.5)
    stands = Obstacle(Why.STRENGTH, 1.0, 0.05, NEEDED, stress=1.2)
    assert stands.eases(falls, NEEDED) == pytest.approx(3.0)
    assert replace(stands, stress=1.0).eases(stands, NEEDED) == pytest.approx(1.2)


def test_a_shell_on_four_feet_that_no_rods_hold_up_stands_on_heavier_edge_beams():
    """Its edges are arches of 20 m between the feet. On bundles of 19 and 37 rods it bore 16 mm of concrete,
    on such of 61 25 mm."""
    said: list[str] = []
    dome = dish(size=20.0, rise=3.0, count=25)
    found = first_design(dome, DesignWish(spacing=1.4, angle=0.0), said.append)
    assert isinstance(found.parts.edge.section, Tube)
    assert found.thickness >= 0.03
    assert found.parts.edge != edge_choices(found.parts.choice)[0]
    assert any("edge beams of" in each and found.parts.edge.label not in each for each in said)


@pytest.mark.parametrize(("lines", "told"), [(("line",), True), ((), False)])
def test_a_proposed_case_tells_how_far_its_edge_beams_are_off_where_it_has_any(lines, told):
    rods = wished("gfrp_rods/32 mm")[0]
    tried = Followed(NEEDED, 0.5, 0.31, 0.0873, 0.0873, 0.5, np.zeros(3), np.zeros(3))
    for edge, key in zip(edge_choices(rods)[:2], ("rods", "section"), strict=True):
        parts = FirstParts(rods, edge, 0.996, rope_for(1.0), swivels=False)
        entry = edge_beams_table(
            SimpleNamespace(
                parts=parts, tried=tried, placed=SimpleNamespace(net=SimpleNamespace(edges=lines))
            )
        )
        assert key in tomllib.loads(entry)
        assert ("stressed to 31% of their strength, up to 87 mm off under 1.2 ×" in entry) is told


def test_what_edge_beams_are_is_told_with_what_they_weigh():
    """Nineteen rods of 32 mm and 2,000 kg/m³; a tube of 7,850 kg/m³."""
    rods = wished("gfrp_rods/32 mm")[0]
    bundle, tube = (
        edge_beams_told(SimpleNamespace(parts=SimpleNamespace(edge=edge))) for edge in edge_choices(rods)[:2]
    )
    assert bundle == f"19 rods, {19 * np.pi * 0.016**2 * 2000:.3g} kg/m"
    assert re.fullmatch(r"⌀ [\d.]+ × [\d.]+ mm, [\d.]+ kg/m", tube)


@pytest.mark.parametrize(
    "rods", ["gfrp_rods/1.5 mm", "gfrp_rods/50 mm", "gfrp_tubes/76 x 5 mm", "steel_tubes/88.9 x 4 mm"]
)
def test_edge_beams_that_are_tried_are_each_much_stiffer_than_the_one_before_and_never_heavier_than_bundles(
    rods,
):
    for layers in (1, 2):
        choice = wished(rods, layers)[0]
        own = single(choice.section)
        found = [each.section for each in edge_choices(choice)]
        stiff = [stiffness(each)[2] for each in found]
        assert all(after > 2.0 * before for before, after in pairwise(stiff))
        assert isinstance(found[0], Bundle) == isinstance(own, Round), "laths and tubes don't pack"
        assert all(each.composite == 0.5 for each in found if isinstance(each, Bundle))
        assert rods == "gfrp_rods/1.5 mm" or not any(isinstance(each, Bundle) for each in found[1:])
        for section, count in zip(found, (19, 37, 61, 91), strict=True):
            radius = np.sqrt(own.constants[0] / np.pi)
            bundle = Bundle(radius, count, 0.5, own.material)
            assert mass_per_length(section) <= mass_per_length(bundle)
            assert stiffness(section)[2] >= stiffness(bundle)[2]


def test_rods_that_less_concrete_does_not_spare_are_not_tried_with_still_less():
    rods = wished("gfrp_rods/6 mm")[0]
    breaks = Obstacle(Why.STRENGTH, 0.5, 0.05, NEEDED, rods, stress=1.40)
    half = replace(breaks, thickness=0.025, stress=1.38)
    assert half.breaks_unloaded(breaks, 0.95)
    assert not replace(half, stress=1.10).breaks_unloaded(breaks, 0.95)
    assert not replace(breaks, stress=1.38).breaks_unloaded(breaks, 0.95)
    assert not half.breaks_unloaded(replace(breaks, why=Why.STABILITY), 0.95)


def test_prestress_that_breaks_rods_at_their_ends_is_halved_and_halved_again_before_anything_else():
    parts = parts_of(0.996)
    breaks = Followed(NEEDED, 1.4, 0.5, 0.0, 0.0, 2.0, np.zeros(3), np.zeros(3))
    assert parts.easier(breaks, PULLED).rest_ratio == pytest.approx(0.998)
    assert parts.easier(breaks, PULLED).easier(breaks, PULLED).rest_ratio == 1.0 - LEAST_PRESTRAIN
    assert replace(parts, rest_ratio=1.0 - LEAST_PRESTRAIN).easier(breaks, PULLED) is None
    assert parts.easier(replace(breaks, factor=1.2), PULLED) is None, "slacker cables bear no more"
    assert parts.easier(replace(breaks, stress=0.5, pull=0.8), PULLED) is None
    assert parts.easier(replace(breaks, stress=0.5), PULLED) == parts.eased(2.0)
    assert parts.easier(replace(breaks, stress=0.5, edge=0.96), PULLED) is None, "edge beams come first"


def test_joints_turn_where_cables_are_made_slacker_for_rods_that_are_stressed_too_much():
    parts = parts_of(0.996, swivels=False)
    breaks = Followed(NEEDED, 1.4, 0.5, 0.0, 0.0, 0.5, np.zeros(3), np.zeros(3))
    eased = parts.easier(breaks, PULLED)
    assert eased == replace(parts, rest_ratio=0.998, swivels=True)
    assert eased.joint.torsion == pytest.approx(0.1 * parts.joint.torsion)
    least = replace(parts, rest_ratio=1.0 - LEAST_PRESTRAIN)
    assert least.easier(breaks, PULLED) == replace(least, swivels=True)


@pytest.mark.slow
def test_a_half_sphere_is_designed_with_joints_that_turn(tmp_path):
    """Joints that resist turning stress its rods to 106 % or more, whichever rods and spacing."""
    x, y, _ = dish(size=2.0, rise=0.0, count=29).vertices.T
    across, along = x * np.sqrt(1.0 - 0.5 * y * y), y * np.sqrt(1.0 - 0.5 * x * x)
    z = np.sqrt(np.maximum(1.0 - across**2 - along**2, 0.0))
    sphere = make_surface(5.0 * np.column_stack([across, along, z]), dish(count=29).triangles)
    file, case = as_obj(tmp_path / "half.obj", sphere), tmp_path / "case.toml"
    wish = DesignWish(rod="gfrp_rods/22 mm", spacing=0.7, layers=2, angle=45.0)
    told = propose_case(file, case, {}, allow_scripts=False, wish=wish)
    assert "turn" in told["joints"]
    found = load_case(case).joint
    fitting = following(Rod(wished(wish.rod, 2)[0].section))
    assert found.torsion == pytest.approx(0.1 * fitting.torsion, rel=0.01)
    assert found.bending == pytest.approx(fitting.bending)


def test_a_shell_that_tips_stands_on_walls_all_round_where_the_way_out_is_taken_and_its_case_says_so(
    tmp_path,
):
    flat = dish(size=6.0, count=13)
    x, y, _ = flat.vertices.T
    saddle = make_surface(np.column_stack([x, y, 1.0 + 0.1 * x * y]), flat.triangles)
    file, case, heard = as_obj(tmp_path / "saddle.obj", saddle), tmp_path / "case.toml", []
    told = propose_case(
        file,
        case,
        {},
        allow_scripts=False,
        wish=DesignWish(spacing=0.6, angle=0.0),
        way_out=True,
        report=lambda event: heard.append(event.text),
    )
    assert "wall" in told["edges"]
    assert load_case(case).edges.outer == "wall"
    assert "With --edges wall this goes on" in told["way out"]
    head = case.read_text(encoding="utf-8").partition("[surface]")[0]
    assert re.search(r"#   NOT the surface as it is: .*tips.*\n#   but the way out\. .*walls all round", head)
    assert any("not as it is" in each and "tips" in each for each in heard), (
        "nobody is led elsewhere in silence"
    )


def test_the_way_out_taken_may_be_another_surface_which_the_case_then_names(tmp_path, monkeypatch):
    given = as_obj(tmp_path / "given.obj", dish(size=6.0, count=13))
    nearest = as_obj(tmp_path / "near\nest.obj", dish(size=6.0, rise=1.2, count=13))
    wish, seen = DesignWish(spacing=0.6, angle=0.0, layers=1), []

    def refused(surface, *_):
        seen.append(surface.size[2])
        raise InputError("is creased", where="rod")

    def finished(design, surface, *_):
        seen.append(surface.size[2])
        return design

    design = standing_design(read_surface(nearest), wish, print, Allowance())
    offer = WayOut(design, wish, f"The nearest is {nearest}", nearest)
    monkeypatch.setattr(propose, "first_design", refused)
    monkeypatch.setattr(propose, "finished_design", finished)
    monkeypatch.setattr(propose, "with_ways_out", lambda error, *_, **__: Refused(error, offer))
    case = tmp_path / "case.toml"
    propose_case(given, case, {"unit": "cm"}, allow_scripts=False, wish=wish, way_out=True)
    assert seen == pytest.approx([0.016, 1.2]), "the unit is the given file's"
    entry = load_case(case).surface
    assert (tmp_path / entry.file).resolve() == nearest.resolve()
    assert entry.unit is None
    assert load_case(case).title == "given, nearest buildable surface", (
        "which drawings and page are headed by"
    )


def test_without_a_way_out_the_shell_stays_refused_for_its_own_reason(tmp_path, monkeypatch):
    def refused(surface, *_):
        raise InputError("is creased", where="rod", remedy="Round it.")

    monkeypatch.setattr(propose, "first_design", refused)
    monkeypatch.setattr(propose, "with_ways_out", lambda error, *_, **__: Refused(error))
    given, case = as_obj(tmp_path / "given.obj", dish(size=6.0, count=13)), tmp_path / "case.toml"
    with pytest.raises(InputError, match="is creased") as refusal:
        propose_case(given, case, {}, allow_scripts=False, way_out=True)
    assert refusal.value.remedy == "Round it."
    assert not case.exists()


def test_what_was_done_to_a_surface_before_it_was_rounded_stays_in_the_case_s_head(tmp_path, monkeypatch):
    flat = dish(size=6.0, count=13)
    far = make_surface(flat.vertices + np.array([500000.0, 200000.0, 0.0]), flat.triangles)
    folder = tmp_path / "my  shells \x1b[31m"
    folder.mkdir()
    given, nearest = as_obj(folder / "given.obj", far), as_obj(folder / "nearest.obj", flat)
    wish = DesignWish(spacing=0.6, angle=0.0, layers=1)

    def refused(surface, *_):
        raise InputError("is creased", where="rod")

    design = standing_design(read_surface(nearest), wish, print, Allowance())
    monkeypatch.setattr(propose, "first_design", refused)
    offer = WayOut(design, wish, f"The nearest is {nearest}", nearest)
    monkeypatch.setattr(propose, "with_ways_out", lambda error, *_, **__: Refused(error, offer))
    case = folder / "case.toml"
    propose_case(given, case, {}, allow_scripts=False, wish=wish, way_out=True)
    assert load_case(case).title.startswith("given"), "what can't be printed in a path is written out"
    head = case.read_text(encoding="utf-8").partition("[surface]")[0]
    assert "#   coordinates count from [499997.0, 199997.0, 0.0] m\n" in head
    assert "my  shells \\x1b[31m" in head


def test_drawing_ends_with_the_first_structure_that_falls_and_none_is_drawn_after_it(monkeypatch, net):
    drawn = []

    class Bench:
        def __init__(self, nominal):
            pass

        def load_numbers(self, tolerances, *, seed, numbers):
            drawn.extend(numbers)
            return [SimpleNamespace(stands=number != 4, factorisations=11) for number in numbers]

    monkeypatch.setattr(first_trial, "Workshop", Bench)
    monkeypatch.setattr(first_trial, "perfect", lambda *_: None)
    parts = FirstParts(wished("gfrp_rods/2 mm")[0], 19, 0.998, rope_for(0.1), swivels=False)
    assert first_trial.drawn_standing(net, barrel(), parts, 0.002) == first_trial.FirstSample(5, 66)
    assert drawn == [0, 1, 2, 3, 4, 5]


def test_models_begin_with_thinner_concrete_and_shells_with_what_is_usual():
    assert usual_thickness(dish()) == 0.05
    assert usual_thickness(dish(size=1.0, rise=0.2)) == 0.012
    assert usual_thickness(dish(size=0.05, rise=0.01)) == 0.002


def test_a_search_ends_at_the_same_place_once_its_work_is_done():
    said = []
    wish = DesignWish(rod="gfrp_rods/40 mm", spacing=0.8, angle=45.0)
    with pytest.raises(
        (InputError, NotConverged), match=r"^The shell doesn't stand: it|would be stressed to"
    ):
        first_design(dish(), replace(wish, thickness=0.4), said.append, Allowance(1))
    assert sum("stands up to" in each for each in said) == 1


def test_sections_are_real_ones_that_the_net_and_the_spacing_allow(net):
    found = choices(net, 0.1, None)
    assert found
    assert [each.bending for each in found] == sorted(each.bending for each in found)
    for each in found:
        assert each.section in read_catalogue(each.catalogue).sections
        assert 2.0 * max(each.section.fibres) <= 0.1 / 7.0
        assert max(each.section.fibres) <= net.max_radius(
            young=each.section.material.young, strength=each.section.material.strength
        ) * (1 + 1e-9)


def test_a_shell_whose_feet_lie_in_a_line_is_refused_since_it_tips_and_one_on_three_is_not(net):
    feet = net.supports[np.argsort(net.target.positions[net.supports] @ [1.0, 1.0, 0.0])]
    with pytest.raises(InputError, match="tips"):
        refuse_tipping(replace(net, supports=feet[[0, -1]]))
    refuse_tipping(net)


def test_a_size_that_no_shell_has_is_refused_and_the_unit_named_makes_it_one(tmp_path):
    file = as_obj(tmp_path / "dish.obj", dish(unit=0.001))
    with pytest.raises(InputError, match="unit") as refused:
        refuse_size(read_surface(file))
    unit = re.search(r"--unit (\w+)", refused.value.remedy).group(1)
    refuse_size(read_surface(file, unit=unit))
    with pytest.raises(InputError, match="unit"):
        refuse_size(sail(size=0.01, rise=0.002))


def test_a_flat_surface_is_refused_whichever_way_it_lies_and_one_with_the_rise_named_is_not():
    flat = dish(rise=1e-3)
    with pytest.raises(InputError, match="flat plate") as refused:
        refuse_flat(flat)
    rise = float(re.search(r"span, ([\d.]+) m", refused.value.remedy).group(1))
    refuse_flat(dish(rise=rise))
    for times in (0.02, 50.0):  # a model and a stadium: flat is what is flat for its size
        with pytest.raises(InputError, match="flat plate"):
            refuse_flat(make_surface(times * flat.vertices, flat.triangles))
        shell = dish(rise=rise)
        refuse_flat(make_surface(times * shell.vertices, shell.triangles))
    points = flat.vertices.copy()
    points[:, 2] += 0.5 * points[:, 0]
    with pytest.raises(InputError, match="flat plate"):
        refuse_flat(make_surface(points, flat.triangles))


def test_rods_that_break_are_refused_with_their_stress_and_place_and_without_them_it_goes_on():
    with pytest.raises(InputError, match="rod: ⌀ 14 mm of gfrp_rods would be bent to") as refused:
        first_design(barrel(), DesignWish(rod="gfrp_rods/14 mm", angle=45.0, spacing=0.2))
    assert "%" in refused.value.what
    assert " at (" in refused.value.what
    assert "Leave --rod" in refused.value.remedy
    found = first_design(barrel(), DesignWish(angle=45.0, spacing=0.1))
    assert found.tried.factor >= NEEDED


def test_concrete_that_no_single_layer_bears_is_refused_and_the_thickness_named_stands():
    wish = DesignWish(rod="gfrp_rods/40 mm", spacing=0.8, thickness=0.4, angle=45.0)
    surface = dish()
    with pytest.raises(NotConverged, match="isn't stable enough") as refused:
        first_design(surface, wish)
    bears = float(re.search(r"--thickness ([\d.]+)", refused.value.remedy).group(1))
    found = first_design(surface, DesignWish(wish.rod, wish.spacing, bears, wish.angle))
    assert found.thickness == bears < wish.thickness
    assert found.tried.factor >= NEEDED
    assert found.standing == found.drawn


@pytest.mark.parametrize(
    ("stress", "unloaded", "limit"), [(0.85, 0.85, 0.9), (0.86, 0.7, 1.0), (0.7, 0.86, 1.0)]
)
def test_a_tenth_of_the_rods_strength_is_left_for_errors_where_the_initial_design_leaves_more(
    stress, unloaded, limit
):
    entry = rods_strength(SimpleNamespace(tried=SimpleNamespace(stress=stress, unloaded=unloaded)))
    assert tomllib.loads(entry) == {"utilisation": limit}
    assert ("for errors of building" in entry) == (limit < 1.0 or "comes to 0.86" in entry)
    assert ("0.86" in entry) == (limit == 1.0)


@pytest.mark.parametrize(("pull", "limit"), [(0.4, 0.93), (0.85, 0.93), (0.86, 1.0)])
def test_some_of_what_cables_may_pull_is_left_for_errors_where_the_initial_design_leaves_more(pull, limit):
    entry = cables_pull(SimpleNamespace(tried=SimpleNamespace(pull=pull)))
    assert tomllib.loads(entry) == {"cable_utilisation": limit}
    assert ("comes to 0.86" in entry) == (limit == 1.0)
