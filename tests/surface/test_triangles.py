"""Areas, edges and points of the two halves of a rectangle of 2 m by 1 m, beside a point of neither."""

import numpy as np
import pytest

from shellform.surface.shape.triangles import (
    adjacency,
    area_vectors,
    counted_edges,
    open_edges,
    used_points,
    vertex_areas,
)

POINTS = np.array([[0.0, 0.0, 3.0], [2.0, 0.0, 3.0], [9.0, 9.0, 9.0], [2.0, 1.0, 3.0], [0.0, 1.0, 3.0]])
HALVES = np.array([[0, 1, 3], [0, 3, 4]])


def test_area_vectors_point_to_where_corners_run_anticlockwise_from_whatever_shape_the_triangles_have():
    assert area_vectors(POINTS, HALVES).tolist() == [[0.0, 0.0, 1.0]] * 2
    assert area_vectors(POINTS, HALVES[None, :, ::-1]).tolist() == [[[0.0, 0.0, -1.0]] * 2]
    assert vertex_areas(POINTS, HALVES) == pytest.approx(np.array([2, 1, 0, 2, 1]) / 3.0)


def test_edges_are_counted_and_open_ones_keep_their_direction():
    pairs, times = counted_edges(HALVES)
    assert dict(zip(map(tuple, pairs.tolist()), times.tolist(), strict=True)) == {
        (0, 1): 1, (0, 3): 2, (0, 4): 1, (1, 3): 1, (3, 4): 1,
    }  # fmt: skip
    assert sorted(open_edges(HALVES).tolist()) == [[0, 1], [1, 3], [3, 4], [4, 0]]
    joined = adjacency(HALVES, len(POINTS)).toarray()
    assert (joined == joined.T).all()
    assert joined.sum(axis=0).tolist() == [3.0, 2.0, 0.0, 3.0, 2.0]


def test_triangles_are_numbered_among_the_points_that_they_have():
    used, faces = used_points(HALVES, len(POINTS))
    assert used.tolist() == [True, True, False, True, True]
    np.testing.assert_array_equal(POINTS[used][faces], POINTS[HALVES])
