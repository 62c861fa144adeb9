"""Sizes by hand: spacings, strands, concrete and sections, on surfaces and nets of which only numbers are
known."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

import shellform as sf
from shellform.errors import InputError
from shellform.run import sizes
from shellform.run.sizes import DesignWish, RodChoice, Rope
from shellform.surface.shape import bends
from tests.stubs import Known


def surface(**known):
    return Known(vertices=None, triangles=None, **known)


@pytest.fixture
def bent(monkeypatch):
    """Sets a surface's principal curvatures, 1/m, and the areas at its points."""

    def is_bent(curvatures, areas):
        monkeypatch.setattr(bends, "curvature", lambda _: np.array(curvatures))
        monkeypatch.setattr(bends, "vertex_areas", lambda *_: np.array(areas))
        return surface()

    return is_bent


def test_buckling_goes_with_the_root_of_both_stiffnesses_and_the_mean_square_of_the_curvatures(bent):
    """(0.01 · 1 + 0.2 · 3 + 0.05 · 2) / 2 / 6 for curvatures of (0, 0.1), (0.4, 0.2) and (0.2, 0.1)."""
    own, rope = bent([[0.0, -0.1], [0.4, 0.2], [-0.2, 0.1]], [1.0, 3.0, 2.0]), Rope(0.006)
    mean = (0.01 + 0.6 + 0.1) / 12
    root = math.sqrt((50.0 / 0.5) * (rope.stiffness / (math.sqrt(2.0) * 0.5)))
    assert sizes.buckling_load(own, 0.5, 50.0, rope) == pytest.approx(sizes._BUCKLING * root * mean)


def test_a_strand_bears_half_of_what_breaks_it():
    assert Rope(0.01).stiffness == pytest.approx(0.597e-4 * 120e9)
    assert Rope(0.01).force_max == pytest.approx(0.5 * 0.597e-4 * 1380e6)
    assert pytest.approx(0.00575) == sizes.STRAINED


@pytest.mark.parametrize(
    ("spacing", "diameter"),
    [(1.0, 0.006), (2.0, 0.008), (9.0, 0.008), (0.4, 0.002), (0.42, 0.003), (0.01, 0.0003), (0.055, 0.0003)],
)
def test_strands_begin_with_the_nearest_to_6_mm_at_a_metre_by_their_ratio_and_with_8_mm_at_most(
    spacing, diameter
):
    assert sizes.rope_for(spacing) == Rope(diameter)


def test_the_strands_in_stock_are_those_that_are_sold_from_a_third_of_a_millimetre_to_16():
    rope, millimetres = Rope(0.0003), []
    while (rope := sizes.thicker(rope)) is not None:
        millimetres.append(round(1e3 * rope.diameter, 6))
    assert millimetres == [0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0, 14.0, 16.0]


@pytest.mark.parametrize(
    ("area", "radius", "spacing", "reason"),
    [
        (26.0, 10.0, 0.31, "about 260 crossings"),
        (500.0, 1e3, 1.0, "usual on site"),
        (2600.0, 1e3, 1.5, "1100 crossings at the most"),
        (100.0, 1.5, 0.5, "a third of the surface's radius of 1.5 m"),
        (
            100.0,
            1.2,
            0.4,
            "600 crossings at the most, where a third of the surface's radius of 1.2 m asks for 0.4 m",
        ),
        (2600.0, 3.0, 1.5, "1100 crossings at the most"),
    ],
)
def test_the_first_spacing_is_the_least_of_three_with_its_reason(monkeypatch, area, radius, spacing, reason):
    monkeypatch.setattr(sizes, "curvature_shown", lambda _: 1.0 / radius)
    found, told = sizes.first_spacing(surface(area=area))
    assert (found, told) == (pytest.approx(spacing), reason)


@pytest.mark.parametrize(
    ("exact", "set_out"),
    [
        (0.5, 0.5), (0.549, 0.5), (0.65, 0.65), (2.999, 2.95), (0.499, 0.49), (0.15, 0.15), (0.0999, 0.099),
        (0.05, 0.05), (0.00518, 0.0051),
    ],
)  # fmt: skip
def test_spacings_are_set_out_in_steps_of_5_cm_from_half_a_metre_on_and_in_two_digits_below(exact, set_out):
    assert sizes.practical(exact) == pytest.approx(set_out, rel=1e-12)


@pytest.mark.parametrize(
    ("side", "thickness"), [(4.0, 0.05), (3.9, 0.048), (12.0, 0.05), (0.3, 0.003), (0.1, 0.002)]
)
def test_concrete_is_50_mm_and_on_models_an_eightieth_of_their_side_in_whole_millimetres(side, thickness):
    assert sizes.usual_thickness(surface(longer_side=side)) == pytest.approx(thickness)


def test_a_shape_may_be_off_by_a_500th_of_its_span_or_half_its_concrete(monkeypatch):
    monkeypatch.setattr(sizes, "width", lambda _: 15.0)
    assert sizes.may_come_off(surface(), 0.05) == pytest.approx(0.03)
    assert sizes.may_come_off(surface(), 0.07) == pytest.approx(0.035)
    assert sizes.may_sag(surface(), 0.07) == pytest.approx(0.07)
    assert sizes.whole_mm(0.0129) == 0.012


def test_a_structure_as_built_may_be_off_by_a_50th_of_its_span_or_its_concrete(monkeypatch):
    monkeypatch.setattr(sizes, "width", lambda _: 15.0)
    assert sizes.may_stray(surface(), 0.05) == pytest.approx(0.3)
    monkeypatch.setattr(sizes, "width", lambda _: 0.4)
    assert sizes.may_stray(surface(), 0.016) == pytest.approx(0.016)


@pytest.mark.parametrize(
    ("off", "ratio"), [(0.0028284, 0.998), (0.004, 0.9972), (1e-4, 0.999), (0.1, 0.996), (0.0, 0.999)]
)
def test_cables_are_strained_by_twice_what_they_are_off_by_in_length_within_bounds(monkeypatch, off, ratio):
    asked = []

    def of_size(span, *, longest_rod, longest_cable):
        asked.append((span, longest_rod, longest_cable))
        return SimpleNamespace(cable_length=off)

    monkeypatch.setattr(sizes, "tolerances_of_size", of_size)
    box = SimpleNamespace(
        vertices=np.array([[0.0, 0.0, 0.0], [3.0, 9.0, 4.0], [0.0, 9.0, 1.0], [3.0, 0.0, 1.0]])
    )
    assert sizes.rest_ratio_for(box, 2.0) == pytest.approx(ratio, abs=1e-12)
    assert asked == [(9.0, 9.0, pytest.approx(math.sqrt(8.0)))]


class Part(SimpleNamespace):
    """One of a kind."""

    __hash__ = object.__hash__


def section(depth, bending=1.0, moment=1.0, mass=1.0, share=0.5):
    """A section of which all that is asked for is known: what bending into the net takes is its `share`."""
    material = SimpleNamespace(strength=200.0, young=1000.0)
    own = SimpleNamespace(fibres=(0.1 * depth, depth), material=material, mass=mass, share=share)
    return Part(section=own, bending=bending, moment=moment, share=share)


@pytest.fixture
def known(monkeypatch):
    monkeypatch.setattr(sizes, "erection_stress", lambda net, own: 200.0 * own.share)
    monkeypatch.setattr(sizes, "mass_per_length", lambda own: own.mass)


def test_sections_are_those_that_the_curvature_and_the_spacing_allow_by_stiffness_and_then_mass(
    monkeypatch, known
):
    stiff, light, heavy = section(0.01, 9.0), section(0.01, 4.0, mass=1.0), section(0.01, 4.0, mass=2.0)
    just = section(0.02, 1.0, share=1.0)
    breaks, deep = section(0.01, 1.0, share=1.01), section(0.021, 1.0)
    asked = []
    monkeypatch.setattr(
        sizes, "wished", lambda *how: asked.append(how) or [stiff, heavy, breaks, light, deep, just]
    )
    assert sizes.choices(None, 0.28, "some", 2) == [just, light, heavy, stiff]
    assert asked == [("some", 2)]


def test_a_grid_s_spacing_is_seven_depths_of_its_rods_in_whole_millimetres_up():
    for depth, least in ((0.01, 0.14), (0.0101, 0.142), (0.004, 0.056)):
        assert sizes.least_spacing(section(depth)) == pytest.approx(least)


def test_sections_begin_with_the_least_stiff_that_bears_twice_the_load_and_has_strength_to_spare(
    monkeypatch, known
):
    monkeypatch.setattr(sizes, "buckling_load", lambda surface, spacing, bending, rope: 100.0 * bending)
    some = [
        section(0.01, 1.0),
        section(0.01, 2.0, share=0.66),
        section(0.01, 3.0, share=0.65),
        section(0.01, 4.0),
    ]
    for needed, at in ((49.0, 0), (50.0, 0), (51.0, 2), (150.0, 2), (151.0, 3), (999.0, 3)):
        assert sizes.first_choice(None, None, 1.0, some, needed) == at
    tight = [section(0.01, 1.0, share=0.7), section(0.01, 2.0, share=0.9)]
    assert sizes.first_choice(None, None, 1.0, tight, 60.0) == 1, "none has strength to spare"


def test_after_a_section_comes_the_least_stiff_that_is_stiff_enough_and_likely_to_be_stressed_no_more(known):
    """Bending takes 0.5, the load 0.4 more of the first: 0.2, 0.1 and 0.05 more of those of 2, 4 and 8 times
    its moment."""
    some = [
        section(0.01, 2.0, 3.0, share=0.5), section(0.01, 4.0, 6.0, share=0.6), section(0.01, 6.0, 12.0, share=0.5),
        section(0.01, 10.0, 24.0, share=0.89),
    ]  # fmt: skip
    following = lambda times, most, stress=0.9: sizes.next_choice(None, some, 0, stress, times, most)  # noqa: E731
    assert [following(times, 0.95) for times in (1.0, 1.01, 2.0, 2.01, 3.01, 9.0)] == [0, 1, 1, 2, 3, 3]
    assert [following(1.5, most) for most in (0.81, 0.79)] == [1, 2]
    assert following(9.0, 0.93) == 2, "the stiffest of those that fit"
    assert following(0.0, 0.95) == 2, "the least stressed"
    assert following(0.0, 0.5) == following(2.0, 0.5) == 0, "there is none"
    assert following(1.5, 0.6, 0.3) == 1, "less than bending takes adds nothing"


def test_after_what_fell_come_the_least_stiff_rods_that_are_stiff_enough_and_have_strength_to_spare(known):
    some = [
        section(0.01, 2.0, share=0.5), section(0.01, 4.0, share=0.66), section(0.01, 5.0, share=0.65),
        section(0.01, 8.0, share=0.6), section(0.01, 9.0, share=0.7),
    ]  # fmt: skip
    assert [sizes.next_spare(None, some, 0, times, 0.65) for times in (1.5, 2.5, 2.6, 4.0, 99.0)] == [
        2,
        2,
        3,
        3,
        3,
    ]
    assert sizes.next_spare(None, some, 4, 1.3, 0.65) == 4, "none is stiffer"
    assert sizes.next_spare(None, some, 0, 99.0, 0.7) == 4, "where bending may take more"
    assert sizes.next_spare(None, [section(0.01, 2.0, share=0.7)], 0, 1.3, 0.65) == 0


def test_the_stiffest_section_that_is_so_much_less_deep_comes_where_bending_breaks_rods():
    some = [section(depth) for depth in (0.004, 0.008, 0.006, 0.01)]
    assert sizes.next_thinner(some, 3, 0.8) == 2
    assert sizes.next_thinner(some, 2, 1.0) == 0
    assert sizes.next_thinner(some, 3, 0.5) == 0
    assert sizes.next_thinner(some, 3, 0.3) == 3
    steel = sf.Rod.round(young=210e9, radius=0.006, strength=355e6, density=7850.0).section
    some[2] = sizes.RodChoice("steel", steel)
    assert sizes.next_thinner(some, 3, 0.8) == 1, "steel of 6 mm is bent to a radius of 3.5 m at the least"


def test_the_share_of_a_load_that_a_section_bears_is_what_bending_leaves_of_its_strength(known):
    own = section(0.01, share=0.4)
    assert sizes.load_borne(None, own, 1.0, 0.7) == pytest.approx(0.5)
    assert sizes.load_borne(None, own, 0.6, 0.7) == pytest.approx(1.5)
    assert sizes.load_borne(None, own, 1.0, 0.3) == 0.0


@pytest.mark.parametrize("layers", [1, 2])
def test_the_moment_that_rods_bear_is_their_strength_over_the_distance_of_the_outermost_fibre(layers):
    """Of two layers, which share half of it, the axes lie two depths apart: the outermost three."""
    round_rod = sf.Rod.round(young=40e9, radius=0.01, strength=255e6).section
    own = sizes.TwoLayers(round_rod) if layers == 2 else round_rod
    choice = RodChoice("some", own)
    alone = 40e9 * math.pi * 0.01**4 / 4.0
    bending = alone if layers == 1 else 2.0 * alone + 0.5 * 40e9 * math.pi * 0.01**2 * 0.04**2 / 2.0
    assert choice.bending == pytest.approx(bending)
    assert choice.moment == pytest.approx(255e6 * bending / (40e9 * (0.01 if layers == 1 else 0.03)))


@pytest.mark.parametrize(
    ("needed", "radius"), [(49.0, 2.0), (51.0, 4.0), (101.0, 4.0), (201.0, 4.0), (399.0, 4.0), (401.0, 0.0)]
)
def test_the_radius_is_that_of_the_thinnest_rods_that_are_likely_to_bear_the_load(
    monkeypatch, needed, radius
):
    """100 and 200 N/m² are borne by rods that equation (1) lets bend to 1.3 and 2.6 m, with 0.65 of their
    strength to twice that radius over 1.3: first twice what is needed is asked for, then that, then half."""
    thin, thick, too_deep = section(0.26), section(0.52), section(0.9)
    borne, asked = {thin: 100.0, thick: 200.0, too_deep: 1e9}, []

    def wished(rod, layers):
        asked.append((rod, layers))
        return [thick, thin, too_deep] if layers == 1 else []

    monkeypatch.setattr(sizes, "wished", wished)
    monkeypatch.setattr(sizes, "_without_creases", lambda surface, spacing, each: borne[each])
    anything = SimpleNamespace(rod=None, layers=None)
    assert sizes.radius_for(None, 7.5, needed, anything) == pytest.approx(radius)
    sizes.radius_for(None, 7.5, needed, SimpleNamespace(rod="some", layers=None))
    sizes.radius_for(None, 7.5, needed, SimpleNamespace(rod=None, layers=2))
    assert asked == [(None, 1), (None, 2), ("some", 1), (None, 2)]


def test_without_its_creases_a_surface_buckles_as_if_it_were_curved_as_usual_in_one_direction(monkeypatch):
    monkeypatch.setattr(sizes, "curvature_usual", lambda _: 0.2)
    monkeypatch.setattr(sizes, "width", lambda _: 20.0)
    own = section(0.01, bending=50.0)
    root = math.sqrt((50.0 / 0.5) * (Rope(0.003).stiffness / (math.sqrt(2.0) * 0.5)))
    borne = sizes._BUCKLING * root * 0.5 * 0.04
    assert sizes._without_creases(surface(), 0.5, own) == pytest.approx(borne)
    assert sizes.hopeless(surface(), 0.5, own, 34.0 * borne)
    assert not sizes.hopeless(surface(), 0.5, own, 33.0 * borne), "a thirtieth and more may do"


@pytest.mark.parametrize(("span", "thrust"), [(20.0, 2.5), (4.0, 2.0)])
def test_rods_that_would_buckle_between_their_joints_are_hopeless_however_stiff_the_shell(
    monkeypatch, span, thrust
):
    """Of a radius of 5 m: half of that, or of the span, times the spacing of 0.5 m is a rod's thrust over the
    load; clamped it buckles under 4 π² EI / s²."""
    monkeypatch.setattr(sizes, "curvature_usual", lambda _: 0.2)
    monkeypatch.setattr(sizes, "width", lambda _: span)
    monkeypatch.setattr(sizes, "_without_creases", lambda *_: math.inf)
    borne = 4.0 * math.pi**2 * 2.0 / 0.25 / (thrust * 0.5)
    own = section(0.01, bending=2.0)
    assert sizes.hopeless(surface(), 0.5, own, 3.4 * borne)
    assert not sizes.hopeless(surface(), 0.5, own, 3.3 * borne), "three tenths and more may do"


def test_sections_are_those_of_a_catalogue_that_is_named_or_of_all_that_are_shipped_for_rods():
    every, laths = sizes.wished(None), sizes.wished("timber_laths")
    assert {each.catalogue for each in every} == {"gfrp_rods", "gfrp_tubes", "steel_tubes"}
    assert {each.catalogue for each in laths} == {"timber_laths"}
    twice = sizes.wished(None, 2)
    assert len(twice) == len(every) + len(laths)
    assert [each.section.single for each in twice] == [each.section for each in (*every, *laths)]
    (one,) = sizes.wished("gfrp_rods/8 mm")
    assert one.section.radius == pytest.approx(0.004)
    assert [each.section.single for each in sizes.wished("gfrp_rods/8 mm", 2)] == [one.section]


@pytest.mark.parametrize(
    ("wish", "where"),
    [
        ({}, None),
        ({"spacing": 0.1, "thickness": 0.01, "angle": -30.0, "layers": 2, "edges": "wall"}, None),
        ({"layers": 1}, None),
        ({"spacing": -0.1}, "--spacing"),
        ({"thickness": 0.0}, "--thickness"),
        ({"angle": math.inf}, "--angle"),
        ({"layers": 3}, "--layers"),
        ({"layers": 0}, "--layers"),
        ({"edges": "ground"}, "--edges"),
        ({"rod": "gfrp_rods/9.5 mm"}, "--rod"),
    ],
)
def test_what_is_wished_for_can_be(wish, where):
    if where is None:
        made = DesignWish(**wish)
        assert {name: getattr(made, name) for name in wish} == wish
        return
    with pytest.raises(InputError) as told:
        DesignWish(**wish)
    assert told.value.where == where
