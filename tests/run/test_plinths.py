"""Feet that rods can't follow are left to plinths."""

import numpy as np
import pytest

from shellform.case.build_net import surface_of
from shellform.case.case import load_case
from shellform.run.plinths import plinths_for
from shellform.run.propose import propose_case
from shellform.run.sizes import DesignWish
from tests.run.test_propose import as_obj, dish
from tests.surface.test_fairing import sheet


def flared(x, y):
    """A dome that ends in a flat rim on the ground."""
    return np.maximum(1.6 - 0.18 * (x * x + y * y), 0.0)


def test_a_dome_with_a_flat_rim_ends_on_plinths_above_the_crease():
    surface = sheet(flared)
    found = plinths_for(surface)
    assert found is not None
    assert found.above == pytest.approx(0.16)
    assert found.surface.vertices[:, 2].min() == pytest.approx(found.above)
    assert "plinths of up to 0.16 m" in found.told


def test_shells_that_rods_follow_to_the_ground_and_creases_higher_up_get_no_plinths():
    assert plinths_for(dish()) is None
    assert plinths_for(sheet(lambda x, y: 2.4 - 0.02 * y * y - np.abs(x) / 2.0)) is None


@pytest.mark.slow
def test_new_writes_the_plinths_into_the_case_and_says_so(tmp_path):
    file, case = as_obj(tmp_path / "flared.obj", sheet(flared, count=41)), tmp_path / "case.toml"
    told = propose_case(file, case, {}, allow_scripts=False, wish=DesignWish(angle=45.0))
    assert "plinths" in told["plinths"]
    entry = load_case(case).surface
    assert entry.above == pytest.approx(0.16)
    assert surface_of(entry).vertices[:, 2].min() == pytest.approx(0.16)
    assert "bent to a radius" in case.read_text(encoding="utf-8")
