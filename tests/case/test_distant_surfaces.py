"""Surfaces that lie far from the origin of their coordinates: when they are refused, and which origin is
named."""

import re

import numpy as np
import pytest

from shellform.case.build_net import distant_origin, refuse_distant
from shellform.errors import InputError
from shellform.surface.shape.target import Surface

SIDES = np.array([3.0, 2.0, 0.5])  # of the plate's box, m


def plate(corner):
    """Two triangles whose box begins at the corner."""
    flat = np.array([[0.0, 0.0, 0.0], [3.0, 0.0, 0.5], [3.0, 2.0, 0.0], [0.0, 2.0, 0.5]])
    return Surface(flat + np.array(corner), [[0, 1, 2], [0, 2, 3]], np.tile([0.0, 0.0, 1.0], (4, 1)))


def test_a_surface_is_refused_farther_than_5000_of_its_larger_sides_from_the_origin():
    largest = 5000.0 * SIDES.max()
    refuse_distant(plate((largest - SIDES[0] - 1.0, 0.0, 0.0)))
    refuse_distant(plate((0.0, 1.0 - largest, 0.0)))
    for corner in [(largest - SIDES[0] + 1.0, 0.0, 0.0), (0.0, -1.0 - largest, 0.0)]:
        with pytest.raises(InputError, match="rounding hides the load"):
            refuse_distant(plate(corner))


@pytest.mark.parametrize("corner", [(431234.5, -81987.25, 400.125), (-20001.0, 30002.0, -0.75)])
def test_the_origin_that_is_named_is_round_and_just_below_the_surface_s_lower_corner(corner):
    origin = distant_origin(plate(corner), 5000.0)
    below = np.array(corner) - origin
    assert (below >= 0.0).all()
    assert (below < SIDES.max()).all()
    np.testing.assert_array_equal(
        origin, np.round(origin)
    )  # whole metres: the side of 3 m has one digit before
    with pytest.raises(InputError) as refused:
        refuse_distant(plate(corner))
    named = re.search(r"--origin (\S+) (\S+) (\S+)\.$", str(refused.value)).groups()
    np.testing.assert_array_equal([float(each) for each in named], origin)
