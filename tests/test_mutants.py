"""scripts/mutants.py plants small faults; here only what its list of reasons has to keep."""

import pytest

from scripts import mutants


def test_each_fault_that_stands_with_a_reason_can_still_be_planted():
    assert len(mutants.listed()) > 20


def test_a_reason_for_a_line_that_is_gone_is_told(tmp_path, monkeypatch):
    reasons = tmp_path / "mutants.toml"
    reasons.write_text('"shellform/errors.py: gone = 1.0: 1.0 -> 2.0" = "no such line"\n', encoding="utf-8")
    monkeypatch.setattr(mutants, "KNOWN", reasons)
    with pytest.raises(ValueError, match=r"errors\.py: gone = 1\.0"):
        mutants.listed()
