"""Structures adjusted on site: what supports are off strains nothing, and cables pull as planned."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from shellform.gridshell.layers import rod_stress
from shellform.gridshell.tolerances import Tolerances
from shellform.reliability import adjusting
from shellform.reliability.adjusting import adjusted, supports_last, tightened
from shellform.reliability.drawing import Errors, built_beams, draw_errors
from shellform.reliability.members import Member
from shellform.reliability.path_of_one import UNLOADED, Limit
from shellform.reliability.perfect import perfect
from shellform.reliability.standing import Workshop

OFF = Tolerances(supports=5e-4, marks=5e-4)


def test_supports_and_the_rods_last_segments_strain_nothing_and_inner_marks_stay():
    errors = Errors(
        **{name: np.zeros(0) for name in ("cable_length", "cable_stiffness", "load", "shape")},
        supports=np.full((6, 6), 0.005),
        beam_length=np.full(8, 0.1),
        beam_stiffness=np.ones(8),
        beam_curvature=np.zeros((8, 2)),
    )
    rods = (
        Member(np.array([4, 3, 2, 1, 0]), np.ones(5), np.array([0, 2, 3, 5])),
        Member(np.array([6, 7]), np.ones(2), np.array([0, 2])),
    )
    found = supports_last(SimpleNamespace(rods=rods), errors)
    assert found.beam_length == pytest.approx([0, 0, 0.1, 0, 0, 0.1, 0, 0]), "the sixth is of no rod"
    assert not found.supports.any()
    assert errors.supports.all()


def test_rods_of_adjusted_structures_bear_less_and_cables_pull_as_planned(dome, nominal):
    workshop, planned = Workshop(nominal), nominal.network.cables.tension(nominal.unloaded)
    before, after, missed, misses = [], [], [], []
    for number in range(6):
        errors = draw_errors(nominal.members, OFF, 3, number)
        then = adjusted(workshop, errors)
        assert not then.supports.any()
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
