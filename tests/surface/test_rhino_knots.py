"""The knots that Rhino leaves out."""

import numpy as np
import pytest

from shellform.surface.readers.nurbs import with_end_knots


@pytest.mark.parametrize(
    ("inner", "degree", "whole"),
    [
        ([0, 0, 1, 2, 2], 2, [0, 0, 0, 1, 2, 2, 2]),  # clamped: repeated once more
        (
            [0, 1, 2, 3, 4],
            2,
            [-1, 0, 1, 2, 3, 4, 5],
        ),  # uniform: as far off as the next ones are from each other
        ([0, 1, 3, 4, 6, 7], 3, [-1, 0, 1, 3, 4, 6, 7, 8]),
    ],
)
def test_rhino_s_knot_vector_gets_back_its_first_and_last_knot(inner, degree, whole):
    np.testing.assert_array_equal(with_end_knots(inner, degree), whole)
