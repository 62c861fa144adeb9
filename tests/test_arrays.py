"""What is checked at the door of the package."""

import numpy as np
import pytest

from shellform.arrays import indices, reals
from shellform.errors import InputError


@pytest.mark.parametrize("wrong", [0.0, -1.0])
def test_one_number_that_isn_t_positive_among_others_is_refused(wrong):
    with pytest.raises(InputError, match=r"EA\(1,\) must be above zero"):
        reals("EA", [1.0, wrong, 2.0], (3,), positive=True)
    np.testing.assert_array_equal(reals("EA", [1.0, 3.0], (2,), positive=True), [1.0, 3.0])


@pytest.mark.parametrize("wrong", [-1, 3])
def test_one_index_out_of_range_among_others_is_refused(wrong):
    with pytest.raises(InputError, match=r"nodes\(1,\) is out of range"):
        indices("nodes", [0, wrong, 2], (3,), below=3)
    assert indices("nodes", [0, 1, 2], (3,), below=3).tolist() == [0, 1, 2]


@pytest.mark.parametrize("wrong", [np.ones((2, 2)), np.ones(3), np.ones((1, 2, 3)), 1.0])
def test_what_has_another_shape_is_refused(wrong):
    with pytest.raises(InputError, match="places has the wrong shape"):
        reals("places", wrong, (None, 3))


def test_one_number_stands_for_all_where_their_count_is_known_but_a_row_of_one_does_not():
    np.testing.assert_array_equal(reals("EA", 2.0, (3,)), [2.0, 2.0, 2.0])
    with pytest.raises(InputError, match="EA has the wrong shape"):
        reals("EA", [2.0], (3,))
