"""Joints that follow their rods."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import shellform as sf
from shellform.gridshell.joints import doubts, following, swivelling, turning_stress, usual_gap
from shellform.structure.elements.sections import Material, Rectangle, isotropic


def test_the_paper_s_rods_have_the_paper_s_joint():
    joint = following(sf.Rod.round(young=40e9, radius=0.001))
    assert joint.stiffness == pytest.approx((7.15e4, 7.38e-4, 7.85e-4, 7.85e-4))
    assert joint.gap == pytest.approx(0.002)


def test_table_1_s_full_size_joint_is_that_of_rods_twenty_times_as_thick():
    """Table 1: EA 2.86e7 N, GJ 118 and EI 125.6 N·m², gap 40 mm; rounded there to three digits."""
    joint = following(sf.Rod.round(young=40e9, radius=0.02))
    assert joint.stiffness == pytest.approx((2.86e7, 118.0, 125.6, 125.6), rel=1e-3)
    assert joint.gap == pytest.approx(0.04)


def test_the_gap_of_laths_is_their_height():
    rod = sf.Rod(Rectangle(0.05, 0.03, isotropic(young=11e9)))
    assert following(rod).gap == pytest.approx(0.03)


def test_a_joint_of_other_rods_is_doubted_entry_by_entry():
    thick, thin = (sf.Rod.round(young=40e9, radius=radius) for radius in (0.02, 0.01))
    assert doubts(following(thick), thick) == ()
    found = doubts(following(thick), thin)
    assert [each.name for each in found] == ["torsion", "bending", "gap"]
    assert found[2].fitting == pytest.approx(0.02)
    assert "joint.gap is 0.04" in found[2].told()


@pytest.mark.parametrize(
    ("name", "least", "most"),
    [("axial", 0.25, 4.0), ("torsion", 1e-6, 4.0), ("bending", 0.25, 4.0), ("gap", 0.95, 1.5)],
)
def test_a_joint_is_doubted_from_four_times_what_fits_on_and_a_gap_where_rods_overlap_or_are_far_apart(
    name, least, most
):
    rod = sf.Rod.round(young=40e9, radius=0.01)
    fitting = following(rod)
    softer = int(name != "torsion")  # joints that turn more easily fit any rods
    for times, doubted in (
        (0.99 * most, 0),
        (1.01 * most, 1),
        (1.01 * least, 0),
        (0.99 * least, softer),
    ):
        joint = replace(fitting, **{name: times * getattr(fitting, name)})
        assert [each.name for each in doubts(joint, rod)] == doubted * [name]


def test_a_joint_that_turns_has_a_tenth_of_the_resistance_to_turning_and_the_rest_as_it_was():
    joint = following(sf.Rod.round(young=40e9, radius=0.02))
    turning = swivelling(joint)
    assert turning.torsion == pytest.approx(11.8, rel=1e-3)
    assert replace(turning, torsion=joint.torsion) == joint


@pytest.mark.parametrize("radius", [0.005, 0.02])
def test_what_joints_bend_rods_in_the_surface_goes_with_the_shear_of_the_net_and_not_with_the_depth(radius):
    """Half of GJ Δ / gap on each side of a crossing, over the section modulus π r³ / 4."""
    material = Material(young=40e9, shear=4.5e9, strength=240e6)
    net = SimpleNamespace(quality=SimpleNamespace(shear_angle_min=0.5 * np.pi - 0.3))
    joint = following(sf.Rod.round(young=40e9, radius=radius))
    stress = 0.5 * joint.torsion * 0.3 / joint.gap / (np.pi * radius**3 / 4.0)
    assert turning_stress(net, material) == pytest.approx(stress / 240e6)


def test_before_rods_are_chosen_the_gap_is_the_paper_s_in_proportion_to_the_spacing():
    assert usual_gap(0.055) == pytest.approx(0.002)
    assert usual_gap(1.1) == pytest.approx(0.04)


def test_the_joint_of_laths_has_the_mean_of_both_their_bending_stiffnesses():
    rod = sf.Rod(Rectangle(0.05, 0.03, isotropic(young=11e9)))
    _, _, about_y, about_z = rod.stiffness
    paper = 40e9 * np.pi * 0.001**4 / 4.0
    assert following(rod).bending == pytest.approx(7.85e-4 * (about_y + about_z) / 2.0 / paper)
