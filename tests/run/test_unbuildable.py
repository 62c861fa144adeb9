"""What can't be built is refused with the amounts by which it is too much, on surfaces and nets that are
stood in for."""

import math
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import shellform as sf
from shellform.errors import InputError
from shellform.run import unbuildable
from shellform.run.sizes import DesignWish, RodChoice
from shellform.run.unbuildable import (
    Falls,
    Obstacle,
    Tips,
    Unbuildable,
    Why,
    flat_between_creases,
    refuse_flat,
    refuse_size,
    refuse_tipping,
    refused,
    too_curved,
)
from shellform.surface.shape import target

NEEDED = 1.5


def rods(radius=0.01, strength=255e6):
    return RodChoice(
        "stock", sf.Rod.round(young=40e9, radius=radius, strength=strength, density=2000.0).section
    )


def net_bent(out):
    """A net whose first segment is bent most, by this curvature, 1/m."""
    bent = np.array([[out, 0.1 * out], [0.5 * out, 0.3 * out]])
    quality = SimpleNamespace(curvature=bent, curvature_max=out)
    positions = np.array([[0.0, 0.0, 0.0], [1.0, 2.0, 4.0], [3.0, 8.0, 6.0]])
    return SimpleNamespace(
        quality=quality,
        curvature=bent,
        target=SimpleNamespace(positions=positions),
        grid=SimpleNamespace(rod_ends=np.array([[0, 1], [1, 2]])),
    )


def placed(out):
    return SimpleNamespace(net=net_bent(out))


def of_size(*size):
    return SimpleNamespace(size=np.array(size), longer_side=max(size[:2]), source="a mesh")


@pytest.mark.parametrize("size", [(0.2, 0.1, 9.0), (0.1, 0.2, 0.0), (150.0, 1.0, 400.0), (3.0, 149.0, 1.0)])
def test_shells_of_a_fifth_of_a_metre_to_150_m_in_plan_are_of_a_size_that_there_is(size):
    refuse_size(of_size(*size))


@pytest.mark.parametrize(
    ("written", "size", "unit", "metres"),
    [
        ("2\u202f000 × 900 × 500\u202f000 m", (2000.0, 900.0, 5e5), "mm", "2"),
        ("1\u202f999 × 900 × 500 m", (1999.0, 900.0, 500.0), "cm", "20"),
        ("300 × 75\u202f000 × 1 m", (300.0, 75000.0, 1.0), "mm", "75"),
        ("199 × 1 × 1 m", (199.0, 1.0, 1.0), "in", "5.05"),
        ("151 × 1 × 1 m", (151.0, 1.0, 1.0), "in", "3.84"),
        ("7\u202f500 × 1 × 1 m", (7500.0, 1.0, 1.0), "mm", "7.5"),
        ("76\u202f000 × 1 × 1 m", (76000.0, 1.0, 1.0), None, None),
        ("0.0019 × 0.001 × 9 m", (0.0019, 0.001, 9.0), None, None),
    ],
)
def test_a_size_that_no_shell_has_is_refused_with_the_first_unit_that_makes_a_building_of_it(
    written, size, unit, metres
):
    with pytest.raises(InputError, match="which no gridshell is") as told:
        refuse_size(of_size(*size))
    assert f"is {written}, which" in told.value.what
    assert f"150 m). {told.value.remedy}" in str(told.value), "one sentence ends before the next"
    if unit is None:
        assert told.value.remedy == "Scale the file to the size that is meant."
    else:
        first = f"Give the file's unit, which makes it {metres} m with --unit {unit}"
        assert re.match(first + "[,.]", told.value.remedy)


def test_of_a_model_in_millimetres_its_own_unit_is_named_beside_that_which_makes_a_building_of_it():
    with pytest.raises(InputError, match="which no gridshell is") as told:
        refuse_size(of_size(900.0, 600.0, 210.0))
    made = "9 m with --unit cm, 0.9 m with --unit mm, 22.9 m with --unit in"
    assert told.value.remedy == f"Give the file's unit, which makes it {made}."
    with pytest.raises(InputError, match="which no gridshell is") as told:
        refuse_size(of_size(75000.0, 1.0, 1.0))
    assert told.value.remedy == "Give the file's unit, which makes it 75 m with --unit mm."


@pytest.mark.parametrize(("side", "unit", "metres"), [(0.01, "mm", "10"), (0.199, "cm", "19.9")])
def test_of_a_shell_that_is_far_too_small_metres_are_suspected_that_were_stated_as_another_unit(
    side, unit, metres
):
    with pytest.raises(InputError, match="which no gridshell is") as told:
        refuse_size(of_size(side, side, 0.3 * side))
    assert told.value.remedy.startswith(f"If {unit} was stated and m was meant, state m by --unit m")
    assert f"makes it {metres} m" in told.value.remedy


@pytest.mark.parametrize(("side", "said", "meant", "metres"), [(0.02, "mm", "m", 20), (2e4, "m", "mm", 20)])
def test_of_files_that_state_their_own_unit_no_option_is_named_which_they_would_refuse(
    tmp_path, side, said, meant, metres
):
    file = tmp_path / "a.step"
    file.write_text("ISO-10303-21;")
    size = np.array([side, side, 0.3 * side])
    surface = SimpleNamespace(size=size, longer_side=side, source=str(file))
    with pytest.raises(InputError, match="which no gridshell is") as told:
        refuse_size(surface)
    assert told.value.remedy.startswith(
        f"If {said} was stated and {meant} was meant, state {meant} in the program that wrote the file"
    )
    assert f"makes it {metres} m" in told.value.remedy
    assert "--unit" not in told.value.remedy


@pytest.mark.parametrize("axes", [(0, 1, 2), (2, 0, 1), (1, 2, 0)])
def test_a_surface_is_flat_that_keeps_to_a_plane_by_a_hundredth_of_its_side_wherever_that_lies(axes):
    x, y = np.array([[5.0, 2.0], [5.0, -2.0], [-5.0, 2.0], [-5.0, -2.0]]).T

    def surface(depth):
        corners = np.column_stack([x, y, 0.5 * depth * np.sign(x * y)])
        return SimpleNamespace(vertices=corners[:, axes] + [100.0, -20.0, 7.0])

    refuse_flat(surface(0.101))
    with pytest.raises(InputError, match=r"within 0\.099 m over 10 m") as told:
        refuse_flat(surface(0.099))
    assert "a tenth of its span, 1 m" in told.value.remedy


def on_feet(*feet):
    positions = np.array([*feet, [60.0, 18.0, 3.0]])
    return SimpleNamespace(
        target=SimpleNamespace(positions=positions), supports=np.arange(len(feet), dtype=int)
    )


def test_supports_hold_a_shell_from_tipping_that_keep_to_no_line_by_a_fiftieth_of_its_extent():
    """Away from the line by d, one of three foot points makes √(2/3) d of that; the extent is 10 m."""
    along, off = math.sqrt(1.5) * 0.2, 1e-3
    for away, tips in ((along + off, False), (along - off, True)):
        net = on_feet([50.0, 20.0, 0.5], [60.0, 20.0, 0.0], [55.0, 20.0 + away, 9.0])
        if not tips:
            refuse_tipping(net)
            continue
        with pytest.raises(Tips, match=r"ground at \(50, 20, 0\.5\) m and \(55, 20\.2, 9\) m only"):
            refuse_tipping(net)
    for few in (([50.0, 20.0, 0.0],), ([50.0, 20.0, 0.0], [60.0, 28.0, 0.0])):
        with pytest.raises(Tips, match="about which it tips"):
            refuse_tipping(on_feet(*few))


FALLS = Obstacle(Why.STABILITY, 0.5, 0.05, 1.2, stress=0.7)
BREAKS = Obstacle(Why.STRENGTH, 0.5, 0.05, 1.6, stress=1.4)
SCATTERS = Obstacle(Why.SCATTER, 0.5, 0.05, 1.6, stress=0.8)


def test_failures_come_near_by_the_load_and_those_that_bear_it_all_by_their_stress():
    assert FALLS.near(NEEDED) == (1.2, 0.0)
    assert replace(FALLS, factor=1.5).near(NEEDED) == (1.5, -0.7)
    assert BREAKS.near(NEEDED) == (1.5, -1.4)
    assert SCATTERS.near(NEEDED) == (1.5, 0.0)
    assert [each.nearness(NEEDED) for each in (FALLS, BREAKS)] == [1.2, 1.6]
    assert SCATTERS.nearness(NEEDED) == pytest.approx(1.35), "drawn structures fall a little below"
    assert replace(SCATTERS, factor=0.8).nearness(NEEDED) == 0.8


@pytest.mark.parametrize(
    ("factor", "stress", "before", "eases"),
    [
        (0.9, 0.2, (0.6, 1.2), 1.5),  # it bears less than all: the load alone counts
        (2.0, 0.6, (0.75, 1.2), 4.0),  # twice the load, half the stress
        (2.0, 1.5, (0.75, 1.2), 2.0),  # stressed more since it bears more
        (1.6, 1.5, (1.9, 1.2), 0.8),  # it bore all before
        (0.9, 0.5, (0.0, 1.2), 0.9e12),
    ],
)
def test_what_eases_a_failure_is_told_in_times_its_load_and_less_stress(factor, stress, before, eases):
    own = Obstacle(Why.STRENGTH, 0.5, 0.05, factor, stress=stress)
    former = Obstacle(Why.STRENGTH, 0.5, 0.05, before[0], stress=before[1])
    assert own.eases(former, NEEDED) == pytest.approx(eases)


@pytest.mark.parametrize(
    ("why", "factor", "stress", "bore"),
    [
        (Why.STABILITY, 0.9, 3.6, 0.6),  # what it is stressed to on the ground says nothing
        (Why.SCATTER, 1.5, 0.8, 0.9),
        (Why.STRENGTH, 1.5, 1.25, 0.8),
        (Why.STRENGTH, 1.5, 0.97, 1.0),
        (Why.CABLES, 1.5, 2.0, 0.5),
        (Why.EDGES, 1.5, 1.6, 0.625),
        (Why.NET, 0.0, 0.0, 0.0),
    ],
)
def test_what_a_shell_bore_is_the_share_up_to_which_it_stood_or_was_stressed_no_more_than_it_may(
    why, factor, stress, bore
):
    assert Obstacle(why, 0.5, 0.05, factor, stress=stress).bore(NEEDED) == pytest.approx(bore)


def test_rods_break_unloaded_where_two_thicknesses_of_concrete_point_beyond_what_they_may_bear():
    """From 1.4 at 50 mm to 1.2 at 30 mm: 0.9 at none."""
    choice = rods()
    before = Obstacle(Why.STRENGTH, 0.5, 0.05, 1.6, choice, stress=1.4)
    after = Obstacle(Why.STRENGTH, 0.5, 0.03, 1.6, choice, stress=1.2)
    assert after.breaks_unloaded(before, 0.89)
    assert not after.breaks_unloaded(before, 0.91)
    assert not before.breaks_unloaded(after, 0.1), "more concrete says nothing"
    assert not after.breaks_unloaded(replace(before, thickness=0.03), 0.1)
    assert not after.breaks_unloaded(replace(before, choice=rods(0.02)), 0.1)
    assert not after.breaks_unloaded(replace(before, why=Why.EDGES), 0.1)
    assert not replace(after, why=Why.EDGES).breaks_unloaded(replace(before, why=Why.EDGES), 0.1)


BENT = np.array([[0.1, -8.0], [0.5, -2.0], [1.0, 0.3], [0.0, 0.0]])
SURFACE = SimpleNamespace(
    vertices=np.array([[9.0, 9.0, 9.0], [1.5, 2.0, 3.0], [4.0, 5.0, 6.0], [0.0, 0.0, 0.0]]),
    boundary=[np.array([0]), np.array([3])],
    longer_side=12.0,
    size=np.array([6.0, 12.0, 40.0]),
)


@pytest.fixture
def bent(monkeypatch):
    """A surface that is bent most at its edge, which doesn't count, and then to half a metre."""
    monkeypatch.setattr(target, "curvature", lambda surface: BENT)
    return SURFACE


def test_where_no_net_covers_a_surface_it_is_to_be_rounded_where_it_is_bent_most_inside_its_edge(
    bent, monkeypatch
):
    monkeypatch.setattr(unbuildable, "_rounding", lambda *_: 0.1)
    told = refused(bent, Obstacle(Why.NET, 0.1, 0.05), DesignWish())
    assert (told.why, told.spacing, told.radius) == (Why.NET, 0.1, pytest.approx(0.75))
    assert (
        "no net of 0.1 m covers the surface, which is curved most at (1.5, 2, 3) m, to a radius of 0.5 m"
        in told.what
    )
    assert told.remedy == "Round the surface there to 0.75 m or more."


@pytest.mark.parametrize(("spacing", "asked", "radius"), [(0.2, 0.6, 0.75), (0.3, 0.6, 0.9), (0.2, 1.7, 1.7)])
def test_it_is_to_be_rounded_to_three_spacings_and_to_what_rods_need_that_bear_the_load(
    bent, monkeypatch, spacing, asked, radius
):
    monkeypatch.setattr(unbuildable, "_rounding", lambda *_: asked)
    failure = Obstacle(Why.NET, spacing, 0.05, error=InputError("hangs over", where="net"))
    told = refused(bent, failure, DesignWish())
    assert told.radius == pytest.approx(radius)
    assert re.fullmatch(
        rf"no net of {spacing:g} m covers the surface, which is curved most .* m: hangs over", told.what
    )


@pytest.mark.parametrize(
    ("usual", "sought", "radius"),
    [
        (0.2, 3.0, 3.0),
        (0.2, 5.0, 4.5),
        (1 / 12 + 1e-3, 99.0, 0.9 / (1 / 12 + 1e-3)),
        (1 / 12 - 1e-3, 3.0, 6.0),
    ],
)
def test_creases_are_rounded_for_the_load_up_to_what_most_of_the_surface_keeps_and_flat_roofs_to_vaults(
    monkeypatch, usual, sought, radius
):
    """The larger side in plan is 12 m; 1.5 times the weight of 60 mm of concrete is 2207 N/m²."""
    asked = []

    def found(surface, spacing, needed, wish):
        asked.append((spacing, round(needed, 2)))
        return sought

    monkeypatch.setattr(unbuildable, "curvature_usual", lambda surface: usual)
    monkeypatch.setattr(unbuildable, "radius_for", found)
    failure = Obstacle(Why.NET, 0.4, 0.06)
    assert unbuildable._rounding(SURFACE, failure, DesignWish()) == pytest.approx(radius)
    assert flat_between_creases(SURFACE) is (usual < 1 / 12)
    assert asked == ([] if usual < 1 / 12 else [(0.4, 2207.25)])


@pytest.mark.parametrize(("wanted", "told"), [(1.63, True), (1.62, False)])
@pytest.mark.parametrize("why", [Why.STABILITY, Why.STRENGTH, Why.SCATTER, Why.EDGES])
def test_a_crease_is_the_reason_where_rounding_lets_rods_bend_a_third_less(monkeypatch, wanted, told, why):
    monkeypatch.setattr(unbuildable, "_rounding", lambda *_: wanted)
    failure = Obstacle(why, 0.5, 0.05, 0.7, rods(), placed(0.8), stress=0.8)
    found = refused(None, failure, DesignWish(), design=SimpleNamespace(thickness=0.02))
    if why not in (Why.STABILITY, Why.STRENGTH) or not told:
        assert not isinstance(found, Unbuildable)
        return
    assert (found.why, found.radius, found.bears, found.spacing) == (Why.CURVATURE, wanted, 0.02, 0.5)
    assert "at (0.5, 1, 2) m rods bend to a radius of 1.25 m" in found.what
    assert "up to 0.70 × the load of 50 mm of concrete at 0.5 m, where 1.5 is needed" in found.what
    thick = refused(None, failure, DesignWish(), design=SimpleNamespace(thickness=0.025))
    assert not isinstance(thick, Unbuildable), "half of what was asked for stands without"


@pytest.fixture
def no_crease(monkeypatch):
    monkeypatch.setattr(unbuildable, "_crease", lambda *_: None)
    monkeypatch.setattr(unbuildable, "_rounding", lambda *_: 2.5)


def test_rods_too_thick_for_their_spacing_are_refused_with_the_spacing_that_they_need(no_crease):
    told = refused(None, Obstacle(Why.SPACING, 0.1, 0.05, choice=rods(0.01)), DesignWish())
    assert "too thick for a spacing of 0.1 m" in told.what
    assert told.remedy.startswith("Give --spacing 0.14 or more")


@pytest.mark.parametrize(
    ("stress", "rod", "radius", "remedy"),
    [
        (2.0, None, 8.4, "2 times its radius"),  # 1.05 of twice 4 m
        (0.5, None, 4.2, "1 times its radius"),
        (0.5, "gfrp_rods/8 mm", 4.2, "Leave --rod gfrp_rods/8 mm out"),
    ],
)
def test_rods_that_break_are_refused_with_the_radius_to_which_they_could_be_bent(
    no_crease, stress, rod, radius, remedy
):
    failure = Obstacle(Why.CURVATURE, 0.5, 0.05, 0.0, rods(), placed(0.25), np.array([1.0, 2.0, 3.0]), stress)
    told = refused(None, failure, DesignWish(rod=rod))
    assert (told.why, told.radius) == (Why.CURVATURE, pytest.approx(radius))
    assert f"{stress:.0%} of its strength at (1, 2, 3) m, at a spacing of 0.5 m" in told.what
    assert "concrete" not in told.what
    assert remedy in told.remedy


def test_what_the_load_needs_is_rounded_to_where_it_is_more_but_not_for_rods_that_were_asked_for(no_crease):
    failure = Obstacle(Why.CURVATURE, 0.5, 0.05, 0.0, rods(), placed(2.0), stress=1.5)
    assert refused(None, failure, DesignWish()).radius == 2.5
    own = refused(None, failure, DesignWish(rod="gfrp_rods/8 mm")).radius
    assert own == pytest.approx(1.05 * 1.5 * 0.5)


@pytest.mark.parametrize(
    ("why", "factor", "words"),
    [
        (Why.STABILITY, 1.2, "its rods at 80% of their strength, and gives way first at (1, 2, 3) m"),
        (Why.EDGES, 1.5, "its edge beams at 80% of their strength"),
        (Why.CABLES, 1.5, "its cables at 80% of what they may bear"),
        (Why.SCATTER, 1.6, "its rods at 80% of their strength, and gives way first at (1, 2, 3) m"),
        (Why.STRENGTH, 1.6, "its rods at 80% of their strength"),
    ],
)
@pytest.mark.parametrize("bears", [None, 0.012])
def test_what_falls_or_breaks_under_its_load_is_refused_with_what_stands(
    no_crease, why, factor, words, bears
):
    failure = Obstacle(why, 0.4, 0.06, factor, rods(), placed(0.25), np.array([1.0, 2.0, 3.0]), 0.8)
    told = refused(None, failure, DesignWish(), design=bears and SimpleNamespace(thickness=bears))
    if why is Why.STRENGTH and bears is None:
        assert isinstance(told, Unbuildable)
        return
    assert isinstance(told, Falls)
    assert told.bears == bears
    assert f"at 0.4 m; with 60 mm of concrete it stands up to {factor:.2f} × its load" in told.what
    assert told.what.endswith(words)
    if bears is None:
        assert told.remedy.startswith("Give the surface more rise")
    else:
        assert told.remedy.startswith("A single layer of rods bears --thickness 0.012:")


def test_a_refusal_keeps_its_amounts_where_no_way_out_helped():
    told = Unbuildable(
        "is bent",
        why=Why.NET,
        where="net",
        remedy="Round it.",
        spacing=0.4,
        radius=1.234,
        design=SimpleNamespace(thickness=0.02),
    )
    other = told.in_vain()
    assert other.what.startswith("is bent; no surface near it that is rounded there to 1.2 m or more")
    assert (other.why, other.where, other.remedy) == (Why.NET, "net", "It takes a rounder form there.")
    assert (other.spacing, other.radius, other.bears) == (0.4, 1.234, 0.02)


@pytest.mark.parametrize(
    ("curvature", "why", "share"), [(0.5, Why.SPACING, 0.7882), (0.7, Why.CURVATURE, 1.1035)]
)
def test_a_net_is_too_curved_where_the_rods_that_it_stresses_least_break_and_else_too_close(
    curvature, why, share
):
    """Rods of 10 mm radius bear σ / (E r) = 0.6375 1/m; a tenth in the surface adds half a percent."""
    thick, thin = rods(0.02), rods(0.01)
    found = too_curved(placed(curvature), [thick, thin], 0.1, 0.05)
    assert (found.why, found.choice, found.spacing, found.thickness, found.factor) == (
        why,
        thin,
        0.1,
        0.05,
        0.0,
    )
    assert found.stress == pytest.approx(share, rel=1e-3)
    np.testing.assert_array_equal(found.where, [0.5, 1.0, 2.0])
