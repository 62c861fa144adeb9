"""Places on polylines and in polygons, against what a drawing says."""

import numpy as np
import pytest

from shellform.net.polylines import closed, inside, nearest

BEND = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 4.0]])
DART = np.array([[0.0, 0.0], [4.0, 2.0], [0.0, 4.0], [1.0, 2.0]])


def test_points_are_as_far_from_a_polyline_as_from_its_nearest_side_or_end():
    away, at = nearest(np.array([[1.0, 2.0], [5.0, 1.0], [-3.0, -4.0], [4.0, 7.0], [3.0, 0.0]]), BEND)
    assert away == pytest.approx([2.0, 2.0, 5.0, np.sqrt(10.0), 0.0])
    assert at == pytest.approx([1.0, 4.0, 0.0, 7.0, 3.0])


def test_a_piece_that_ends_nearer_counts_only_as_far_as_it_goes():
    curve = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 3.0, 0.0]])
    points = np.array([[1.0, -0.5, 0.0], [2.5, 1.0, 0.0], [-3.0, 4.0, 0.0], [1.9, 1.5, 0.2], [2.0, 5.0, 0.0]])
    assert nearest(points, curve)[0] == pytest.approx([0.5, 0.5, 5.0, np.hypot(0.1, 0.2), 2.0])


def test_round_a_polygon_the_last_side_counts_too_and_one_without_length_does_nothing():
    point = np.array([[1.0, 2.0]])
    assert nearest(point, BEND)[0] == pytest.approx([2.0])
    away, at = nearest(point, closed(BEND))
    assert away == pytest.approx([0.4]), "of 3 x 4 with a diagonal of 5"
    assert at == pytest.approx([7.0 + 2.8])
    again, _ = nearest(point, closed(closed(BEND)))
    assert again == pytest.approx(away)


def test_distances_are_found_in_space_as_in_plan():
    curve = np.column_stack([BEND, [0.0, 0.0, 3.0]])
    away, at = nearest(np.array([[3.0, 4.0, 8.0], [1.0, 0.0, 2.0]]), curve)
    assert away == pytest.approx([5.0, 2.0])
    assert at == pytest.approx([8.0, 1.0])


def test_a_point_in_the_notch_of_a_polygon_lies_outside_whichever_way_round_it_goes():
    points = np.array([[2.0, 2.0], [0.5, 2.0], [0.5, 0.5], [5.0, 2.0], [-1.0, 1.0]])
    for polygon in (DART, DART[::-1]):
        assert inside(points, polygon).tolist() == [True, False, True, False, False]
