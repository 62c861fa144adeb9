"""Structures adjusted on site: what is off along a rod at its end strains nothing, cables pull as planned."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from shellform.gridshell.layers import rod_stress
from shellform.gridshell.tolerances import Tolerances
from shellform.reliability import adjusting
from shellform.reliability.adjusting import adjusted, ends_last, tightened
from shellform.reliability.drawing import LEAST, built_beams, draw_errors
from shellform.reliability.members import Member
from shellform.reliability.path_of_one import UNLOADED, Limit
from shellform.reliability.perfect import perfect
from shellform.reliability.standing import Workshop

OFF = Tolerances(supports=5e-4, marks=5e-4)


def straight(*rods):
    """Rods of unit elements along x, nodes 0 to 5, in the perfect structure."""
    places = np.zeros((6, 3))
    places[:, 0] = np.arange(6.0)
    ends = np.array([[0, 1], [1, 2], [3, 2], [3, 4], [4, 5]])  # the third runs against the rod
    return SimpleNamespace(
        members=SimpleNamespace(rods=rods, beam_length=np.ones(5)),
        network=SimpleNamespace(beams=SimpleNamespace(ends=ends)),
        unloaded=SimpleNamespace(positions=places),
    )


def off(nominal, first, last):
    """Marks off by a tenth in every element, and the rod's ends by so much, m."""
    errors = draw_errors_of_marks()
    errors.supports[0, :3], errors.supports[5, :3] = first, last
    return errors


def draw_errors_of_marks():
    @np.vectorize
    def tenth(_):
        return 0.1

    return adjusting.Errors(
        **{name: np.zeros(0) for name in ("cable_length", "cable_stiffness", "load", "shape")},
        supports=np.zeros((6, 6)),
        beam_length=tenth(np.zeros(5)),
        beam_stiffness=np.ones(5),
        beam_curvature=np.zeros((5, 2)),
    )


SENSE = np.array([1.0, 1.0, -1.0, 1.0, 1.0])


def test_the_last_segments_follow_their_supports_along_the_rod_and_inner_marks_stay():
    nominal = straight(Member(np.arange(5), SENSE, np.array([0, 2, 3, 5])))
    found = ends_last(nominal, off(nominal, (-0.02, 9.0, 9.0), (-0.04, 0.0, 1.0))).beam_length
    assert found == pytest.approx([0.01, 0.01, 0.1, -0.02, -0.02]), "out of the shell it grows longer"


def test_elements_that_run_against_the_rod_are_turned_round():
    nominal = straight(Member(np.array([2]), np.array([-1.0]), np.array([0, 1])))
    errors = draw_errors_of_marks()
    errors.supports[2, 0], errors.supports[3, 0] = 0.25, 0.75
    assert ends_last(nominal, errors).beam_length == pytest.approx([0.1, 0.1, 0.5, 0.1, 0.1])


def test_a_segment_between_two_supports_follows_both_and_something_is_left_of_it():
    nominal = straight(Member(np.arange(5), SENSE, np.array([0, 5])))
    assert ends_last(nominal, off(nominal, (-0.5, 0, 0), (0.25, 0, 0))).beam_length == pytest.approx(
        [0.15] * 5
    )
    assert ends_last(nominal, off(nominal, (5.0, 0, 0), (0, 0, 0))).beam_length == pytest.approx(
        [LEAST - 1.0] * 5
    )


def test_rods_of_adjusted_structures_bear_less_and_cables_pull_as_planned(dome, nominal):
    workshop, planned = Workshop(nominal), nominal.network.cables.tension(nominal.unloaded)
    before, after, missed, misses = [], [], [], []
    for number in range(6):
        errors = draw_errors(nominal.members, OFF, 3, number)
        then = adjusted(workshop, errors)
        assert then.supports == pytest.approx(errors.supports), "these stand where they stand"
        for each, stresses, off_by in ((errors, before, missed), (then, after, misses)):
            state = workshop.limit(each, most=0.0, tell=False).state
            beams = built_beams(nominal.network.beams, each)
            stresses.append(rod_stress(dome.rod.section, beams, beams.local_forces(state)).max())
            cables = replace(
                nominal.network.cables,
                rest_length=nominal.network.cables.rest_length + each.cable_length[nominal.present],
            )
            off_by.append(np.abs(cables.tension(state) - planned).max())
    assert np.median(after) < 0.9 * np.median(before)
    assert np.median(misses) < 0.5 * np.median(missed)


def test_cables_that_hang_slack_as_planned_keep_their_length_and_none_goes_beyond_its_reserve(
    nominal, monkeypatch
):
    cables = nominal.network.cables
    monkeypatch.setattr(adjusting, "_FELT", 0.7)
    force = cables.tension(nominal.unloaded)
    assert 0 < (felt := force > 0.7 * force.max()).sum() < len(force)
    errors = draw_errors(nominal.members, OFF, 3, 0)
    found = tightened(Workshop(nominal), errors).cable_length[nominal.present]
    assert (found[~felt] == errors.cable_length[nominal.present][~felt]).all()
    assert (found[felt] != errors.cable_length[nominal.present][felt]).all()
    monkeypatch.setattr(adjusting, "RESERVE", 1e-6)
    found = tightened(Workshop(nominal), errors).cable_length[nominal.present]
    assert np.abs(found[felt]).max() == pytest.approx(1e-6 * cables.rest_length[felt].max(), rel=0.3)
    assert (np.abs(found[felt]) <= 1.000001e-6 * cables.rest_length[felt]).all()


def test_a_structure_without_an_unloaded_state_is_adjusted_as_far_as_it_came(nominal, monkeypatch):
    workshop, errors = Workshop(nominal), draw_errors(nominal.members, OFF, 3, 0)
    lost = Limit(0.0, UNLOADED, nominal.unloaded, 0)
    monkeypatch.setattr(workshop, "limit", lambda *_, **__: lost)
    assert tightened(workshop, errors) is errors


def test_without_cables_there_is_nothing_to_tighten(dome):
    none = replace(dome.design(), present=np.zeros(len(dome.cable_ends), dtype=bool))
    bare = perfect(dome, none, 0.01 * dome.point_load(4.5, every=2))
    errors = draw_errors(bare.members, OFF, 3, 0)
    assert tightened(Workshop(bare), errors) is errors
