"""The rectangle round a plan turns with it."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from shellform.plan_rectangle import along_sides, axes_in_plan, longest_side, sides_in_plan, turn_of_plan


def turned(points, degrees):
    """Points (k, 3), turned about the vertical."""
    result = points.copy()
    result[:, :2] = points[:, :2] @ axes_in_plan(np.radians(degrees)).T
    return result


def barrel():
    x, y = np.meshgrid(np.linspace(-4.0, 4.0, 17), np.linspace(0.0, 3.0, 7))
    return np.column_stack([x.ravel(), y.ravel(), 1.0 - (y.ravel() - 1.5) ** 2])


def test_a_plan_along_the_axes_isn_t_turned_by_a_bit_and_its_sides_are_those_of_its_box():
    points = barrel()
    assert turn_of_plan(points) == 0.0
    assert (along_sides(points) == points[:, :2]).all()
    assert sides_in_plan(points).tolist() == np.ptp(points[:, :2], axis=0).tolist()


@pytest.mark.parametrize("degrees", [7.0, 30.0, 45.0, 89.0])
def test_the_sides_of_a_plan_stay_when_it_is_turned(degrees):
    points = turned(barrel(), degrees)
    assert np.degrees(turn_of_plan(points)) == pytest.approx(degrees)
    assert sides_in_plan(points) == pytest.approx([8.0, 3.0])
    assert longest_side(points) == pytest.approx(8.0)
    assert np.ptp(along_sides(points)[:, 0]) == pytest.approx(8.0), "along the turned x"


def test_a_round_plan_lies_along_the_axes_and_a_turned_square_has_its_own_side():
    around = np.linspace(0.0, 2.0 * np.pi, 37)
    assert turn_of_plan(np.column_stack([np.cos(around), np.sin(around)])) == 0.0
    square = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [-1.0, 0.0, 0.0]])
    assert sides_in_plan(square) == pytest.approx([np.sqrt(2.0)] * 2)


def test_points_in_a_row_and_one_above_the_other_have_sides_too():
    row = np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [3.0, 3.0, 0.0]])
    assert sorted(sides_in_plan(row).tolist()) == pytest.approx([0.0, 3.0 * np.sqrt(2.0)])
    above = np.array([[2.0, 5.0, 0.0], [2.0, 5.0, 7.0]])
    assert longest_side(above) == 7.0


def test_no_rectangle_along_a_side_of_the_hull_is_smaller():
    """Each by the reach of all points, for scattered plans of many proportions."""
    rng = np.random.default_rng(1)

    def area(points, turn):
        return np.ptp(points @ axes_in_plan(turn), axis=0).prod()

    for _ in range(200):
        points = rng.normal(size=(rng.integers(4, 60), 2)) * rng.random(2) @ axes_in_plan(3.0 * rng.random())
        corners = points[ConvexHull(points).vertices]
        x, y = (np.roll(corners, -1, axis=0) - corners).T
        least = min(area(points, turn) for turn in np.arctan2(y, x))
        box = area(points, 0.0)
        assert area(points, turn_of_plan(points)) == pytest.approx(least if least < 0.99 * box else box)
