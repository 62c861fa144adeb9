"""Which designs are on the front, and what a limit lets pass."""

import pytest

from shellform.study.front import objectives, signed, usable
from shellform.study.outcome import Row, Status
from shellform.study.varied import LimitEntry


def test_what_shall_be_large_counts_with_its_sign_turned_and_not_scaled():
    signs = signed({"a": "min", "b": "max"})
    assert signs == {"a": 1.0, "b": -1.0}
    assert objectives({"a": 2.5, "b": 4, "c": 9.0}, signs) == (2.5, -4.0)


@pytest.mark.parametrize("wrong", [None, "slack", float("inf"), float("nan")])
def test_a_design_that_lacks_a_number_for_one_objective_has_none(wrong):
    signs = signed({"a": "min", "b": "max"})
    assert objectives({"a": wrong, "b": 4.0}, signs) is None
    assert objectives({"a": 4.0, "b": wrong}, signs) is None
    assert objectives({"b": 4.0}, signs) is None
    assert objectives({"b": 4.0}, {}) is None


@pytest.mark.parametrize(
    ("a", "b", "fits"),
    [(1.0, 3.0, True), (1.1, 3.0, False), (1.0, 3.1, False), (None, 3.0, False), (1.0, "slack", False), (True, -3, True)],
)  # fmt: skip
def test_a_usable_design_is_done_and_keeps_every_limit(a, b, fits):
    limits = {"a": LimitEntry(most=1.0), "b": LimitEntry(most=3.0)}
    assert usable(Row("k", Status.DONE, "", {"a": a, "b": b, "c": 99.0}), limits) == fits
    assert not usable(Row("k", Status.NO_RESULT, "", {"a": 0.0, "b": 0.0}), limits)
    assert usable(Row("k", Status.DONE, "", {}), {})
