"""Units and axes of files that others wrote."""

import numpy as np
import pytest

from shellform.errors import InputError
from shellform.surface.units import downwards, level_axes, turned_back, turned_up, unit_factor


def test_units_are_so_many_metres():
    """The inch and the foot as agreed on in 1959."""
    metres = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 12 * 0.0254}
    assert {unit: unit_factor(unit) for unit in metres} == pytest.approx(metres, rel=1e-12)
    with pytest.raises(InputError, match=r"surface\.unit: isn't a known unit .*Known: m, cm, mm, in, ft"):
        unit_factor("yd")


def test_y_upwards_becomes_z_and_the_axes_keep_their_hand():
    points = np.array([[1.0, 2.0, 3.0], [-4.0, 5.0, -6.0]])
    np.testing.assert_array_equal(turned_up(points, "z"), points)
    np.testing.assert_array_equal(turned_up(points, "y"), [[1.0, -3.0, 2.0], [-4.0, 6.0, 5.0]])
    with pytest.raises(InputError, match=r"surface\.up: must be one of x, y, z, -x, -y, -z"):
        turned_up(points, "w")


@pytest.mark.parametrize(
    ("up", "vertical"),
    [
        ("x", [1, 0, 0]),
        ("y", [0, 1, 0]),
        ("z", [0, 0, 1]),
        ("-x", [-1, 0, 0]),
        ("-y", [0, -1, 0]),
        ("-z", [0, 0, -1]),
    ],
)
def test_the_axis_named_becomes_the_vertical_and_nothing_is_mirrored(up, vertical):
    np.testing.assert_array_equal(turned_up(np.array([vertical], dtype=float), up) + 0.0, [[0.0, 0.0, 1.0]])
    turned = turned_up(np.eye(3), up)
    np.testing.assert_array_equal(turned @ turned.T, np.eye(3))
    np.testing.assert_array_equal(turned_back(turned, up), np.eye(3))
    np.testing.assert_array_equal(turned_up(np.array([vertical], dtype=float), downwards(up))[0, 2], -1.0)
    assert np.linalg.det(turned) == pytest.approx(1.0)
    corners = np.array([[1.0, 2.0, 3.0]])
    assert set(level_axes(up)) == set(range(3)) - {int(np.flatnonzero(vertical)[0])}
    assert np.linalg.norm(turned_up(corners, up)) == pytest.approx(np.linalg.norm(corners))
