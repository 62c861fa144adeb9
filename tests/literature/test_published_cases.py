"""The published and exact cases that `shellform verify` prints."""

import sys

import pytest

from shellform import verification
from shellform.cli import program


@pytest.mark.parametrize("case", verification.CASES, ids=lambda case: case.__name__)
def test_published_values_hold(case):
    for row in case():
        assert row.passed, f"{row.name}: {row.value} instead of {row.reference} ({row.source})"
        assert row.source


def test_a_row_fails_beyond_its_tolerance_relative_to_its_reference():
    row = verification.Comparison("case", "quantity", 2.02, 2.0, 0.0099, "nowhere")
    assert row.difference == pytest.approx(0.01)
    assert not row.passed
    assert verification.Comparison("case", "quantity", 2.02, 2.0, 0.0101, "nowhere").passed
    assert verification.Comparison("case", "quantity", float("nan"), 2.0, 0.1, "nowhere").passed is False
    assert verification.Comparison("case", "quantity", 1e-9, 0.0, 1e-8, "nowhere").difference == 1e-9


@pytest.mark.parametrize(
    ("value", "status", "words"), [(1.0, 0, "all 1 numbers of 1 cases hold"), (1.2, 3, "FAIL")]
)
def test_the_command_prints_each_row_and_its_status_says_whether_all_hold(
    value, status, words, monkeypatch, capsys
):
    def case():
        yield verification.Comparison("a case", "a quantity", value, 1.0, 0.1, "a source")

    monkeypatch.setattr(verification, "CASES", (case,))
    monkeypatch.setattr(sys, "argv", ["shellform", "verify"])
    with pytest.raises(SystemExit) as stop:
        program.main()
    said = capsys.readouterr()
    assert stop.value.code == status
    assert words in said.out
    assert all(word in said.out for word in ("a case", "a quantity", "a source"))
    assert ("1 of 1 numbers do not hold" in said.err) == (status == 3)


def test_there_are_at_least_25_cases_and_each_family_is_there():
    assert len(verification.CASES) >= 25
    assert len({case.__name__ for case in verification.CASES}) == len(verification.CASES)
    families = {case.__module__.rpartition(".")[2] for case in verification.CASES}
    assert families == {
        "beams",
        "bent",
        "buckling",
        "cables",
        "invariances",
        "limit_points",
        "suites",
        "twisted",
    }
