"""The published and exact cases that `shellform verify` prints."""

import pytest

from shellform.structure import verification


@pytest.mark.parametrize("case", verification.CASES, ids=lambda case: case.__name__)
def test_published_values_hold(case):
    for row in case():
        assert row.passed, f"{row.name}: {row.value} instead of {row.reference} ({row.source})"


@pytest.mark.parametrize("case", verification.CASES, ids=lambda case: case.__name__)
def test_each_case_says_where_its_reference_comes_from(case):
    assert len(case.__doc__) > 80


def test_a_row_fails_beyond_its_tolerance_relative_to_its_reference():
    row = verification.Row("case", "quantity", 2.02, 2.0, 0.0099, "nowhere")
    assert row.difference == pytest.approx(0.01)
    assert not row.passed
    assert verification.Row("case", "quantity", 2.02, 2.0, 0.0101, "nowhere").passed
    assert verification.Row("case", "quantity", float("nan"), 2.0, 0.1, "nowhere").passed is False
    assert verification.Row("case", "quantity", 1e-9, 0.0, 1e-8, "nowhere").difference == 1e-9
