"""The published cases that `shellform verify` prints, and the orders with which they converge."""

import numpy as np
import pytest

from shellform.structure import verification


@pytest.mark.parametrize("case", verification.CASES, ids=lambda case: case.__name__.strip("_"))
def test_published_values_hold(case):
    for row in case():
        assert row.passed, f"{row.name}: {row.value} instead of {row.reference} ({row.source})"


def test_the_elastica_converges_with_the_square_of_the_element_length():
    exact = 0.81060902  # Mattiasson 1981, PL²/EI = 10; EA = 1e7 leaves 1e-6
    errors = [abs(verification.elastica(n, 10.0)[1] - exact) for n in (10, 20, 40)]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert (np.abs(orders - 2.0) < 0.2).all()


def test_the_roll_up_closes_in_one_step_with_ten_elements():
    assert verification.roll_up(10) < 1e-6
