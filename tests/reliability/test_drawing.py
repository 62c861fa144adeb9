"""What drawn structures are off by: every cause by its own deviation, once, and as its own words say."""

from dataclasses import replace

import numpy as np
import pytest

from shellform.errors import InputError
from shellform.gridshell.tolerances import Tolerances
from shellform.plan_rectangle import axes_in_plan
from shellform.reliability.drawing import (
    PERFECT,
    Imperfections,
    built_beams,
    built_cables,
    built_load,
    draw_errors,
    errors_of,
    sizes,
    variables,
)
from shellform.reliability.members import Member, Members, _chains
from shellform.structure.elements.beam import make_beams
from shellform.structure.elements.cable import make_cables
from shellform.structure.elements.state import at_rest, from_vectors


@pytest.fixture(scope="module")
def z(nominal):
    """The variables of one structure."""
    return variables(nominal.members, 3, 8)


def off(nominal, z, **deviations):
    return errors_of(nominal.members, Tolerances(**deviations), z)


def test_lengths_places_and_stiffnesses_are_off_by_their_deviations_times_their_variables(nominal, z):
    members = nominal.members
    found = off(
        nominal, z, cable_length=1e-3, cable_stiffness=0.05, supports=2e-3, connectors=0.1, shape=5e-4
    )
    np.testing.assert_allclose(found.cable_length, 1e-3 * z["cable_length"])
    np.testing.assert_allclose(found.cable_stiffness, np.exp(0.05 * z["cable_stiffness"]))
    np.testing.assert_allclose(found.supports.ravel()[members.held], 2e-3 * z["supports"])
    assert np.count_nonzero(found.supports) == len(members.held)
    np.testing.assert_allclose(found.beam_stiffness[members.connectors], np.exp(0.1 * z["connectors"]))
    np.testing.assert_allclose(found.shape, 5e-4 * np.ptp(members.places, axis=0).max() * z["shape"])
    rods = off(nominal, z, rod_stiffness=0.03)
    for k, rod in enumerate(members.rods):
        np.testing.assert_allclose(rods.beam_stiffness[rod.elements], np.exp(0.03 * z["rod_stiffness"][k]))
    assert (rods.beam_stiffness[members.connectors] == 1.0).all()


def test_a_rod_s_own_arc_rises_by_its_share_of_the_rod_s_length_about_either_axis(nominal, z):
    members = nominal.members
    found = off(nominal, z, rod_bow=1e-3)
    for k, rod in enumerate(members.rods):
        length = members.beam_length[rod.elements].sum()
        rise = np.abs(found.beam_curvature[rod.elements]) * length**2 / 8.0
        wanted = 1e-3 * length * np.abs(z["rod_bow"][2 * k : 2 * k + 2])
        np.testing.assert_allclose(rise, np.tile(wanted, (len(rod.elements), 1)))


def test_loads_are_off_crossing_by_crossing_as_a_whole_and_from_one_half_to_the_other(nominal, z):
    members = nominal.members
    each = off(nominal, z, load_each=0.1).load
    np.testing.assert_allclose(each, 1.0 + 0.1 * z["load_each"][members.zone])
    np.testing.assert_allclose(off(nominal, z, load_all=0.05).load, 1.0 + 0.05 * z["load_all"][0])
    for axis in range(2):
        alone = z | {"load_uneven": np.eye(2)[axis]}
        uneven = off(nominal, alone, load_uneven=0.05).load - 1.0
        along = members.places[:, axis] - members.places[:, axis].mean()
        assert np.abs(uneven).mean() == pytest.approx(0.05)
        np.testing.assert_allclose(uneven / along, uneven[0] / along[0])
        assert uneven[0] / along[0] > 0.0
    every = off(nominal, z, load_each=0.1, load_all=0.05)
    np.testing.assert_allclose(built_load(nominal.load, every)[:, 2], nominal.load[:, 2] * every.load)


def test_a_built_structure_has_each_error_once_and_those_of_its_own_cables(dome, nominal, z):
    present = np.arange(len(dome.cable_ends)) % 3 == 1
    cables = dome.cables(replace(dome.design(), present=present))
    found = off(nominal, z, cable_length=1e-3, cable_stiffness=0.05, connectors=0.1, marks=1e-4)
    built = built_cables(cables, present, found)
    np.testing.assert_allclose(built.rest_length, cables.rest_length + 1e-3 * z["cable_length"][present])
    np.testing.assert_allclose(
        built.stiffness, cables.stiffness * np.exp(0.05 * z["cable_stiffness"][present])
    )
    beams = nominal.network.beams
    made = built_beams(beams, found)
    np.testing.assert_allclose(made.rest_length, beams.rest_length + found.beam_length)
    for name in ("axial", "torsion", "bending_y", "bending_z"):
        np.testing.assert_allclose(getattr(made, name), getattr(beams, name) * found.beam_stiffness)


@pytest.mark.parametrize("axis", [0, 1])
def test_a_bowed_rod_is_free_of_stress_on_its_arc(nominal, z, axis):
    along = np.array([0.0, 0.2, 0.5, 0.6, 1.0])
    flat = np.column_stack([along, np.zeros(5), np.zeros(5)])
    ends = np.column_stack([np.arange(4), np.arange(1, 5)])
    rod = make_beams(flat, ends, axial=1e5, torsion=1.0, bending_y=1.0, bending_z=2.0)
    curvature = np.zeros((4, 2))
    curvature[:, axis] = 0.8
    none = off(nominal, z)
    straight = replace(none, beam_length=np.zeros(4), beam_stiffness=np.ones(4))
    bowed = built_beams(rod, replace(straight, beam_curvature=curvature))
    # Chords between nodes of which each is turned by curvature times length against the one before.
    turned, about = 0.8 * along, rod.frames[0, 0, :, 1 + axis]
    middle, step = 0.5 * (turned[:-1] + turned[1:]), np.diff(along)
    side = np.cross(about, [1.0, 0.0, 0.0])
    chords = step[:, None] * (np.cos(middle)[:, None] * [1.0, 0.0, 0.0] + np.sin(middle)[:, None] * side)
    arc = from_vectors(np.vstack([np.zeros(3), np.cumsum(chords, axis=0)]), turned[:, None] * about)
    np.testing.assert_allclose(bowed.local_forces(arc), 0.0, atol=1e-9)
    assert np.abs(bowed.local_forces(from_vectors(flat, np.zeros((5, 3))))).max() > 0.5


def test_a_rod_s_elements_are_told_with_the_sense_in_which_each_runs_along_it():
    """Three in a row, the first and the last of which run against it."""
    places = np.array([[float(k), 0.0, 0.0] for k in range(4)])
    rod = make_beams(places, [[1, 2], [1, 0], [3, 2]], axial=1e5, torsion=1.0, bending_y=1.0, bending_z=1.0)
    ((elements, sense),) = _chains(rod, np.arange(3), 4)
    assert (elements.tolist(), sense.tolist()) == ([1, 0, 2], [-1.0, 1.0, -1.0])


def two_rods():
    """A rod of three elements that is marked at its ends and after two, whose last one runs against it, and
    one of one with a lock; two connectors; three cables; a support held in two directions; four nodes in two
    zones."""
    rods = (
        Member(np.array([0, 2, 1]), np.array([1.0, 1.0, -1.0]), np.array([0, 2, 3])),
        Member(np.array([3]), np.array([1.0]), np.array([0, 1]), np.array([6])),
    )
    places = np.array([[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [4.0, 2.0, 0.0], [0.0, 2.0, 1.0]])
    lengths = np.array([1.0, 2.0, 3.0, 4.0, 0.1, 0.1, 4.0])
    return Members(rods, np.array([4, 5]), 3, np.array([6, 8]), np.array([0, 1, 1, 0]), 2, places, lengths)


def test_marks_lengthen_the_elements_between_them_in_proportion_and_leave_each_a_fifth_of_its_length():
    members = two_rods()
    none = {name: np.zeros(count) for name, count in sizes(members).items()}
    assert {name: len(z) for name, z in none.items()} == {
        "cable_length": 3, "cable_stiffness": 3, "supports": 2, "marks": 5, "rod_stiffness": 2, "rod_bow": 4,
        "connectors": 2, "load_each": 2, "load_all": 1, "load_uneven": 2, "shape": 3, "cable_stiffness_all": 1,
        "connectors_all": 1, "tape": 2,
    }  # fmt: skip
    z = none | {"marks": np.array([1.0, 3.0, -2.0, 5.0, 1.0])}
    found = errors_of(members, Tolerances(marks=0.1), z).beam_length
    # the first two elements, 1 and 3 m, by 0.2 m together, the last of 2 m by -0.5 m; the other rod by -0.4 m
    assert found == pytest.approx([0.05, -0.5, 0.15, -0.4, 0.0, 0.0, 0.0])
    found = errors_of(members, Tolerances(marks=0.6), z).beam_length
    assert found == pytest.approx([0.3, -1.6, 0.9, -2.4, 0.0, 0.0, 0.0])


def test_a_tape_lengthens_all_of_a_rod_by_its_share_beside_what_marks_do():
    members = two_rods()
    none = {name: np.zeros(count) for name, count in sizes(members).items()}
    z = none | {"marks": np.array([1.0, 3.0, -2.0, 5.0, 1.0]), "tape": np.array([1.0, -2.0])}
    found = errors_of(members, Tolerances(tape=0.01), z).beam_length
    assert found == pytest.approx([0.01, 0.02, 0.03, -0.08, 0.0, 0.0, 0.0])
    found = errors_of(members, Tolerances(marks=0.1, tape=0.01), z).beam_length
    assert found == pytest.approx([0.06, -0.48, 0.18, -0.48, 0.0, 0.0, 0.0])


def test_rods_bow_and_stiffen_with_their_locks_and_connectors_each_and_all_together():
    members = two_rods()
    none = {name: np.zeros(count) for name, count in sizes(members).items()}
    z = none | {"rod_bow": np.array([1.0, 2.0, -3.0, 0.5])}
    found = errors_of(members, Tolerances(rod_bow=0.01), z).beam_curvature
    one, other = 8.0 * 0.01 / 6.0, 8.0 * 0.01 / 4.0
    assert found == pytest.approx(
        np.array(
            [
                [one, 2.0 * one], [one, -2.0 * one], [one, 2.0 * one], [-3.0 * other, 0.5 * other],
                [0.0, 0.0], [0.0, 0.0], [0.0, 0.0],
            ]
        )
    )  # fmt: skip
    z = none | {
        "rod_stiffness": np.array([1.0, -2.0]),
        "connectors": np.array([0.5, 1.5]),
        "connectors_all": np.ones(1),
    }
    stiff = Tolerances(rod_stiffness=0.1, connectors=0.2, connectors_all=0.3)
    logs = np.log(errors_of(members, stiff, z).beam_stiffness)
    assert logs == pytest.approx([0.1, 0.1, 0.1, -0.2, 0.1 + 0.3, 0.3 + 0.3, -0.2])
    z = none | {"cable_stiffness": np.array([1.0, 0.0, -1.0]), "cable_stiffness_all": np.array([2.0])}
    logs = np.log(
        errors_of(members, Tolerances(cable_stiffness=0.1, cable_stiffness_all=0.05), z).cable_stiffness
    )
    assert logs == pytest.approx([0.2, 0.1, 0.0])
    z = none | {"supports": np.array([1.0, -2.0]), "shape": np.array([1.0, 0.0, -1.0])}
    found = errors_of(members, Tolerances(supports=0.01, shape=0.001), z)
    assert found.supports[1].tolist() == pytest.approx([0.01, 0.0, -0.02, 0.0, 0.0, 0.0])
    assert found.shape == pytest.approx([0.004, 0.0, -0.004]), "of the longest side, 4 m"


def test_one_half_of_the_plan_is_heavier_by_as_much_as_the_other_is_lighter_and_by_the_share_on_average():
    places = np.array([[0.0, 0.0, 1.0], [5.0, 0.0, 2.0], [5.0, 40.0, 3.0], [0.0, 20.0, 9.0]])
    shares = replace(two_rods(), places=places).halves
    assert shares[:, 0] == pytest.approx([-1.0, 1.0, 1.0, -1.0])
    assert shares[:, 1] == pytest.approx(np.array([-15.0, -15.0, 25.0, 5.0]) / 15.0)
    slanting = places.copy()
    slanting[:, :2] = places[:, :2] @ axes_in_plan(0.5).T
    assert replace(two_rods(), places=slanting).halves == pytest.approx(shares), "however it is turned"
    row = replace(two_rods(), places=np.array([1.0, 2.0, 5.0, 6.0])[:, None] * [1.0, 1.0, 0.0]).halves
    sizes_in_row = np.sort(np.abs(row).mean(axis=0))
    assert sizes_in_row == pytest.approx([0.0, 1.0], abs=1e-12), "in a row there is no other half"


def test_loads_of_zones_halves_and_the_whole_multiply():
    members = two_rods()
    none = {name: np.zeros(count) for name, count in sizes(members).items()}
    z = none | {"load_each": np.array([1.0, -2.0]), "load_all": np.array([3.0])}
    found = errors_of(members, Tolerances(load_each=0.1, load_all=0.05), z).load
    assert found == pytest.approx(1.15 * np.array([1.1, 0.8, 0.8, 1.1]))
    uneven = errors_of(
        members, Tolerances(load_uneven=0.2), none | {"load_uneven": np.array([1.0, 0.0])}
    ).load
    assert uneven == pytest.approx([0.8, 1.2, 1.2, 0.8])
    both = errors_of(
        members, Tolerances(load_each=0.1, load_uneven=0.2), z | {"load_uneven": np.array([1.0, 0.0])}
    )
    assert both.load == pytest.approx(np.array([1.1, 0.8, 0.8, 1.1]) * uneven)


def test_a_cable_keeps_a_twentieth_of_its_length_and_goes_along_with_the_shape():
    cables = make_cables([[0, 1], [1, 2]], rest_length=np.array([1.0, 2.0]), stiffness=10.0)
    members = two_rods()
    none = {name: np.zeros(count) for name, count in sizes(members).items()}
    present = np.array([True, False, True])
    short = errors_of(
        members, Tolerances(cable_length=1.0), none | {"cable_length": np.array([-0.94, 0.0, -1.96])}
    )
    assert built_cables(cables, present, short).rest_length == pytest.approx([0.06, 0.1])
    state = at_rest(members.places)
    sideways = np.zeros((1, 4, 6))
    sideways[0, 1, 0] = 1.0  # the middle node along the first cable and across the second
    shaped = replace(errors_of(members, Tolerances(), none), shape=np.array([0.3]))
    found = built_cables(cables, present, shaped, Imperfections(state, sideways)).rest_length
    assert found == pytest.approx([1.3, 2.0 + np.hypot(2.0, 0.3) - 2.0])
    two = Imperfections(state, np.vstack([sideways, sideways]))
    shaped = replace(shaped, shape=np.array([0.3, 0.0]))
    assert built_cables(cables, present, shaped, two).rest_length == pytest.approx(found)
    beams = make_beams(members.places, [[0, 1], [1, 2]], axial=1e5, torsion=1.0, bending_y=1.0, bending_z=1.0)
    straight = replace(
        shaped, beam_length=np.zeros(2), beam_stiffness=np.ones(2), beam_curvature=np.zeros((2, 2))
    )
    assert built_beams(beams, straight, two).rest_length == pytest.approx([4.3, np.hypot(2.0, 0.3)])
    assert built_beams(beams, straight).rest_length == pytest.approx([4.0, 2.0])


def test_the_perfect_structure_has_no_errors_and_numbers_are_no_less_than_nothing():
    members = two_rods()
    found = draw_errors(members, Tolerances(marks=0.1, load_all=0.1, supports=0.1), 5, PERFECT)
    assert not found.beam_length.any()
    assert not found.supports.any()
    assert (found.load == 1.0).all()
    assert draw_errors(members, Tolerances(supports=0.1), 5, 0).supports.any()
    for wrong in ({"seed": -1, "number": 0}, {"seed": 0, "number": -1}):
        with pytest.raises(InputError, match="must"):
            variables(members, **wrong)
