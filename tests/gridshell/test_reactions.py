"""What supports bear, and to which stretch of the edge each belongs."""

import numpy as np
import pytest

from shellform.gridshell import reactions


def test_the_distance_from_a_curve_is_that_from_its_nearest_piece():
    curve = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 3.0, 0.0]])
    points = np.array([[1.0, -0.5, 0.0], [2.5, 1.0, 0.0], [-3.0, 4.0, 0.0], [1.9, 1.5, 0.2], [2.0, 5.0, 0.0]])
    wanted = [0.5, 0.5, 5.0, np.hypot(0.1, 0.2), 2.0]
    assert reactions._distance(points, curve) == pytest.approx(wanted)
