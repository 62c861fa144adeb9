"""Rods of any section, catalogues, and rounding to them (operation 4)."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import shellform as sf
from shellform.errors import InputError
from shellform.gridshell import catalogue as module
from shellform.gridshell.catalogue import (
    label,
    largest,
    named,
    neighbours,
    radius_as_stiff,
    radius_bounds,
    read_catalogue,
    rounded_up,
    sections_allowed,
    shipped_catalogues,
    with_section,
)
from shellform.gridshell.gridshell import TooCurved, erection_stress, max_radius
from shellform.problem.engineering import RodUtilisation
from shellform.problem.terms import LoadedDesign
from shellform.structure.elements.sections import Rectangle, Round, Tube, isotropic, stiffness

GLASS = isotropic(young=40e9, density=2000.0, strength=255e6)
SECTIONS = [
    Round(0.001, GLASS),
    Tube(0.001, 0.0003, GLASS),
    Rectangle(0.002, 0.001, GLASS),
    Rectangle(0.001, 0.002, GLASS),
]


def small(tmp_path, text):
    file = tmp_path / "mine.toml"
    file.write_text(text, encoding="utf-8")
    return file


MINE = """
title = "Mine"
[material]
young = 40e9
poisson = 0.3
density = 2000.0
strength = 255e6
[sizes]
round = [0.0024, 0.002, 0.0022, 0.004]
"""


@pytest.fixture(scope="module")
def mine(tmp_path_factory):
    return read_catalogue(small(tmp_path_factory.mktemp("catalogue"), MINE))


def test_a_round_rod_has_its_closed_forms():
    rod = sf.Rod.round(young=40e9, radius=0.001, strength=255e6)
    area, inertia = np.pi * 1e-6, 0.25 * np.pi * 1e-12
    np.testing.assert_allclose(
        rod.stiffness, [40e9 * area, 2 * inertia * 40e9 / 2.6, 40e9 * inertia, 40e9 * inertia]
    )
    assert (rod.radius, rod.young, rod.strength) == (0.001, 40e9, 255e6)


@pytest.mark.parametrize("section", SECTIONS, ids=label)
def test_stiffness_by_radius_is_the_derivative_among_similar_sections(section):
    rod = sf.Rod(section)
    assert rod.resized(rod.radius) == rod
    step = 1e-6 * rod.radius
    slope = (
        np.array(rod.resized(rod.radius + step).stiffness) - rod.resized(rod.radius - step).stiffness
    ) / (2.0 * step)
    np.testing.assert_allclose(rod.stiffness_by_radius, slope, rtol=1e-8)


@pytest.mark.parametrize("section", SECTIONS, ids=label)
def test_a_resized_rod_keeps_its_proportions_and_has_the_radius_asked_for(section):
    rod = sf.Rod(section).resized(0.0031)
    assert rod.radius == pytest.approx(0.0031, rel=1e-15)
    np.testing.assert_allclose(
        np.array(rod.section.sizes) / rod.radius, np.array(section.sizes) / max(section.fibres)
    )


def test_equation_1_for_round_rods_is_the_net_s(net):
    rod = sf.Rod.round(young=40e9, radius=0.001, strength=255e6)
    assert max_radius(net, rod) == pytest.approx(net.max_radius(young=40e9, strength=255e6), rel=1e-12)
    assert erection_stress(net, rod.section) == pytest.approx(
        40e9 * 0.001 * net.quality.curvature_max, rel=1e-12
    )
    assert max_radius(net, sf.Rod(Tube(0.001, 0.0002, GLASS))) == pytest.approx(
        max_radius(net, rod), rel=1e-12
    )


def test_a_lath_is_stressed_in_its_corner_by_curvature_in_and_out_of_the_surface(net):
    bent = np.abs(net.quality.curvature)
    lath = Rectangle(0.003, 0.001, GLASS)
    stress = 40e9 * (0.0005 * bent[..., 0] + 0.0015 * bent[..., 1])
    assert erection_stress(net, lath) == pytest.approx(stress.max(), rel=1e-12)
    bearable = max_radius(net, sf.Rod(lath))
    assert erection_stress(net, sf.Rod(lath).resized(bearable).section) == pytest.approx(255e6, rel=1e-12)


def test_a_straight_net_bears_any_rod(net):
    straight = replace(net, quality=replace(net.quality, curvature=0.0 * net.quality.curvature))
    assert max_radius(straight, sf.Rod.round(young=40e9, radius=0.5, strength=1e6)) == np.inf


def test_laths_and_tubes_brace_a_net_and_too_thick_ones_are_refused(net, vault, shell):
    for section in SECTIONS[1:3]:
        rod = sf.Rod(section)
        made = sf.brace(net, rod, shell.joint, shell.cable, below=vault)
        rods = made.beams(rod.radius)
        assert rods.bending_y[0] == stiffness(section)[2]
        assert rods.bending_z[0] == stiffness(section)[3]
        with pytest.raises(InputError, match="they break"):
            sf.brace(net, rod.resized(1.001 * max_radius(net, rod)), shell.joint, shell.cable, below=vault)


@pytest.mark.parametrize("name", shipped_catalogues())
def test_shipped_catalogues_are_sorted_by_stiffness_and_of_one_material(name):
    catalogue = read_catalogue(name)
    bending = [stiffness(section)[2] for section in catalogue.sections]
    assert bending == sorted(bending)
    assert len(bending) >= 12
    assert catalogue.material.density > 0.0
    assert np.isfinite(catalogue.material.strength)
    for section in catalogue.sections:
        assert named(catalogue, label(section)) == section


def test_there_are_rods_tubes_and_laths():
    kinds = {type(section) for name in shipped_catalogues() for section in read_catalogue(name).sections}
    assert kinds == {Round, Tube, Rectangle}


def test_a_catalogue_is_read_as_it_is_written(mine):
    assert [section.radius for section in mine.sections] == pytest.approx([0.001, 0.0011, 0.0012, 0.002])
    assert (mine.title, mine.material) == ("Mine", GLASS)
    assert label(named(mine, "2.2mm")) == "⌀ 2.2 mm"


def test_strength_counts_as_far_as_it_lasts(tmp_path):
    lasting = read_catalogue(small(tmp_path, MINE.replace("255e6", "255e6\nlasting = 0.4")))
    assert lasting.material.strength == pytest.approx(102e6)


def test_sections_that_the_net_would_break_are_not_allowed(mine, net):
    bearable = net.max_radius(young=40e9, strength=255e6)
    assert 0.0012 < bearable < 0.002  # else the test says nothing
    assert [section.radius for section in sections_allowed(mine, net)] == pytest.approx(
        [0.001, 0.0011, 0.0012]
    )
    assert largest(mine, net).radius == pytest.approx(0.0012)


def test_a_section_that_is_used_to_the_full_by_the_net_is_allowed(mine, net):
    full = erection_stress(net, mine.sections[2])
    for share, count in [(1.0, 3), (1.0 - 1e-6, 2)]:
        material = replace(mine.material, strength=share * full)
        sections = tuple(replace(each, material=material) for each in mine.sections)
        assert len(sections_allowed(replace(mine, sections=sections, material=material), net)) == count


@pytest.mark.parametrize(
    ("radius", "higher"), [(0.0009, 0.001), (0.001, 0.001), (0.00101, 0.0011), (0.0012, 0.0012)]
)
def test_a_radius_is_rounded_to_the_next_higher_one(mine, shell, radius, higher):
    design = replace(shell.design(), radius=radius)
    made, rounded = rounded_up(shell, design, mine)
    assert rounded.radius == pytest.approx(higher)
    assert made.rod.radius == rounded.radius
    np.testing.assert_array_equal(rounded.rest_length, design.rest_length)
    assert made.net is shell.net


def test_a_tube_or_lath_is_rounded_to_one_that_bends_no_more_easily_about_either_axis(shell):
    for name, section in [
        ("gfrp_tubes", Tube(0.003, 0.0011, GLASS)),
        ("timber_laths", Rectangle(0.012, 0.004, GLASS)),
    ]:
        catalogue = read_catalogue(name)
        flatter = replace(
            shell.net, quality=replace(shell.net.quality, curvature=0.02 * shell.net.quality.curvature)
        )
        first, design = with_section(replace(shell, net=flatter), shell.design(), section)
        made, _ = rounded_up(first, design, catalogue)
        assert (np.array(made.rod.stiffness[2:]) >= first.rod.stiffness[2:]).all()
        softer = [s for s in catalogue.sections if stiffness(s)[2] < made.rod.stiffness[2]]
        assert softer
        assert all((np.array(stiffness(s)[2:]) < first.rod.stiffness[2:]).any() for s in softer)


def test_neighbours_are_the_sizes_below_at_and_above_the_rounded_one(mine, shell):
    def sizes(radius, count=1):
        found = neighbours(shell, replace(shell.design(), radius=radius), mine, count=count)
        return [round(2e3 * design.radius, 3) for _, design in found]

    assert sizes(0.00105) == [2.0, 2.2, 2.4]
    assert sizes(0.0009) == [2.0, 2.2]
    assert sizes(0.00115) == [2.2, 2.4]
    assert sizes(0.00105, 0) == [2.2]
    assert sizes(0.0013) == [2.4]  # nothing is stiff enough: what lies below it
    with pytest.raises(InputError, match=r"at least 0.*sections to either side"):
        sizes(0.001, -1)


def test_a_design_stiffer_than_the_catalogue_is_refused(mine, shell):
    with pytest.raises(InputError, match=r"as stiff as the design's.*⌀ 2.4 mm"):
        rounded_up(shell, replace(shell.design(), radius=0.0013), mine)


def test_a_catalogue_that_the_net_breaks_altogether_is_refused(net):
    with pytest.raises(InputError, match=r"none of the sections.*would be stressed to.*MPa"):
        sections_allowed(read_catalogue("timber_laths"), net)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("young = 40e9\n", "", "mine.toml: material.*young"),
        ("[sizes]", "[size]", "unknown field.*size"),
        ("[0.0024,", '["wide",', r"sizes.round\[0\].*expected a number"),
        ("[0.0024,", "[-0.0024,", r"sizes.round\[0\].*positive.*-0.0024"),
        ("poisson = 0.3", "poisson = 0.3\nshear = 1e9", "either shear or poisson"),
        ("poisson = 0.3", "", "either shear or poisson"),
        ("poisson = 0.3", "poisson = 0.7", "poisson.*0.7"),
        ("255e6", "255e6\nlasting = 1.4", "material.lasting.*1.4"),
        ("255e6", "-1.0", "material.strength.*positive"),
        ("[0.0024, 0.002, 0.0022, 0.004]", "[]", "has no sizes"),
        ("[material]", "[material", "isn't valid TOML"),
        ("[material]", f"x = {'[' * 3000}\n[material]", "isn't valid TOML"),
        ("255e6", "9" * 5000, "isn't valid TOML.*digits"),
    ],
)
def test_wrong_catalogues_are_refused_with_their_entry(tmp_path, old, new, said):
    assert old in MINE
    with pytest.raises(InputError, match=said):
        read_catalogue(small(tmp_path, MINE.replace(old, new, 1)))


def test_unknown_catalogues_and_sections_are_answered_with_the_known_ones(mine):
    with pytest.raises(
        InputError,
        match=r"is neither shipped nor a file. Shipped are edge_tubes, gfrp_rods, gfrp_tubes, steel_tubes, timber_laths",
    ):
        read_catalogue("bamboo")
    with pytest.raises(InputError, match=r"'3 mm'.*Known: ⌀ 2 mm, ⌀ 2.2 mm"):
        named(mine, "3 mm")


def test_where_all_sections_break_the_one_that_is_stressed_least_tells_how_far_it_could_be_bent(mine):
    """E r κ = 40 GPa · 1 mm · 10 / m = 400 MPa of 255; at 255 MPa it is bent to E r / f = 0.157 m."""
    bent = np.zeros((3, 2, 2))
    bent[1, 0, 0] = 10.0
    net = SimpleNamespace(quality=SimpleNamespace(curvature=bent, curvature_max=10.0))
    with pytest.raises(TooCurved, match="⌀ 2 mm would be stressed to 400 of 255 MPa") as told:
        sections_allowed(mine, net)
    assert told.value.radius == pytest.approx(40e9 * 0.001 / 255e6)
    bent[1, 0, 0] = 6.0
    assert [label(section) for section in sections_allowed(mine, net)] == ["⌀ 2 mm"]


def test_a_section_is_stiff_enough_only_where_it_is_so_about_both_axes():
    """Of 3 × 1 mm one of two is stiffer than of 1.5 × 1.5 mm, of 2 × 2 mm both."""
    wide, high, square = (Rectangle(1e-3 * a, 1e-3 * b, GLASS) for a, b in ((3, 1), (1, 3), (2, 2)))
    least = Rectangle(0.0015, 0.0015, GLASS)
    assert module._stiff_enough((wide, high, square), least) == 2
    assert module._stiff_enough((square, wide), least) == 0
    assert module._stiff_enough((wide, high), least) == 2, "none"
    assert module._stiff_enough((square,), square) == 0, "as stiff is stiff enough"


def test_a_catalogue_without_a_title_is_called_by_its_file(tmp_path, mine):
    assert mine.title == "Mine"
    assert read_catalogue(small(tmp_path, MINE.replace('title = "Mine"', ""))).title == "mine"


@pytest.mark.parametrize("section", SECTIONS, ids=label)
def test_the_stress_of_any_section_follows_its_radius(shell, section):
    term = RodUtilisation("wet")
    made, design = with_section(shell, shell.design(), section)
    none = np.zeros((len(made.target.positions), 6))
    measured = term.measure(LoadedDesign(made, design, made.target, none)).whole()
    step = 1e-6 * design.radius
    up, down = (
        term.measure(
            LoadedDesign(made, replace(design, radius=design.radius + s * step), made.target, none)
        ).value[0]
        for s in (1, -1)
    )
    assert measured.by_radius[0] == pytest.approx((up - down) / (2.0 * step), rel=1e-6)
    bending = erection_stress(shell.net, section) / section.material.strength
    # The target bends the straight elements a little less than their net's circles, and axial stress and the
    # smooth maximum come on top: 0.2 to 0.6 % less in all.
    assert measured.value[0] == pytest.approx(bending, rel=0.01)


def test_a_free_radius_may_begin_below_the_softest_section_of_a_catalogue(mine, shell):
    softest = radius_as_stiff(shell.rod, mine.sections[0])
    for radius in (0.8 * softest, 1.01 * softest):
        low, high = radius_bounds(shell.net, shell.rod.resized(radius), mine)
        assert low == pytest.approx(min(radius, softest))
        assert low <= radius <= high
