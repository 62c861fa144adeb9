"""Least squares with a lower bound, of two and three numbers."""

import numpy as np
import pytest
import scipy.sparse as sp

from shellform.surface.bounded import _share, bounded_minimum


@pytest.mark.parametrize(
    ("matrix", "right", "least", "wanted"),
    [
        ([[2.0, 0.0], [0.0, 1.0]], [4.0, -3.0], 0.5, [2.0, 0.5]),
        ([[2.0, 1.0], [1.0, 2.0]], [1.0, 5.0], 1.0, [1.0, 2.0]),  # without bounds -1 and 3
        ([[2.0, 1.0], [1.0, 2.0]], [7.0, 8.0], 0.5, [2.0, 3.0]),
        ([[4.0, 1.0, 0.0], [1.0, 3.0, 1.0], [0.0, 1.0, 2.0]], [6.0, -9.0, 7.0], 0.25, [1.4375, 0.25, 3.375]),
    ],
)
def test_the_minimum_is_where_what_is_not_at_its_bound_is_in_balance(matrix, right, least, wanted):
    found = bounded_minimum(sp.csc_array(np.array(matrix)), np.array(right), least)
    assert found == pytest.approx(wanted, abs=1e-8)
    assert (found >= least).all()


@pytest.mark.parametrize(
    ("value", "step", "share"),
    [
        ([1.0, 2.0], [-2.0, 1.0], 0.495),
        ([1.0, 2.0], [-2.0, -8.0], 0.2475),
        ([1.0, 2.0], [-0.5, -0.5], 1.0),
        ([1.0, 2.0], [0.0, 3.0], 1.0),
        ([1.0, 2.0], [-1.0, 3.0], 0.99),
    ],
)
def test_a_step_goes_almost_to_the_first_bound_at_the_most(value, step, share):
    assert _share(np.array(value), np.array(step)) == pytest.approx(share)
