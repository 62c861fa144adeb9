"""Which rods stand where the given ones don't."""

from dataclasses import replace

import numpy as np
import pytest

from shellform.gridshell.gridshell import max_radius
from shellform.gridshell.tolerances import Tolerances
from shellform.records.as_built import AsBuilt
from shellform.records.remedies import RodsOf
from shellform.reliability.standing import sample
from shellform.run.thicker import DRAWN, rods_that_stand

AS_BUILT = Tolerances(cable_length=1e-4, supports=1e-4, marks=2e-4, load_each=0.1, load_all=0.05)
ASKED = AsBuilt(0.99, None, 200)


@pytest.fixture(scope="module")
def load(dome):
    """One and a half times what half of the drawn structures bear."""
    return dome.point_load(9.0, every=2)


@pytest.fixture(scope="module")
def found(dome, load):
    return rods_that_stand(dome, dome.design(), {"design": load}, AS_BUILT, ASKED, seed=3)


def standing(shell, radius, load):
    design = replace(shell.design(), radius=radius)
    return sample(shell, design, load, AS_BUILT, count=DRAWN, seed=3).standing.standing


def test_the_rods_that_are_named_stand_and_the_given_ones_do_not(dome, load, found):
    assert dome.rod.radius < found.radius <= max_radius(dome.net, dome.rod)
    assert found.standing == standing(dome, found.radius, load) == DRAWN
    assert standing(dome, dome.rod.radius, load) < DRAWN


def test_no_rods_are_named_beyond_what_the_net_allows(dome, load):
    weak = replace(dome, rod=type(dome.rod).round(young=40e9, radius=dome.rod.radius, strength=1e6))
    assert max_radius(weak.net, weak.rod) < weak.rod.radius
    assert rods_that_stand(weak, weak.design(), {"design": load}, AS_BUILT, ASKED, seed=3) is None


def test_a_load_that_no_rods_bear_names_none(dome):
    heavy = dome.point_load(1e4, every=2)
    assert rods_that_stand(dome, dome.design(), {"design": heavy}, AS_BUILT, ASKED, seed=3) is None


def test_the_remedy_names_rods_that_were_seen_to_stand_instead_of_a_rule(found):
    rule = RodsOf(0.001, 0.002, 0.1).stronger(1.2)
    seen = RodsOf(0.001, 0.002, 0.1, found).stronger(1.2)
    assert "at least 1.1 mm" in rule
    assert f"rod.radius = {found.radius:g}" in seen
    assert f"{DRAWN} of {DRAWN}" in seen
    assert np.isfinite(found.radius)
