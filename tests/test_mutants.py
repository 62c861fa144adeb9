"""scripts/mutants.py plants small faults; here that it can, and what its list of reasons has to keep."""

import gc
import os

import pytest

from scripts import mutants
from shellform.run import sizes


def test_each_fault_that_stands_with_a_reason_can_still_be_planted():
    assert len(mutants.listed()) > 20


def test_a_reason_for_a_line_that_is_gone_is_told(tmp_path, monkeypatch):
    reasons = tmp_path / "mutants.toml"
    reasons.write_text('"shellform/errors.py: gone = 1.0: 1.0 -> 2.0" = "no such line"\n', encoding="utf-8")
    monkeypatch.setattr(mutants, "KNOWN", reasons)
    with pytest.raises(ValueError, match=r"errors\.py: gone = 1\.0"):
        mutants.listed()


def test_a_fault_is_planted_in_what_was_loaded_before_tests_were_collected():
    """Of which Python's collector lists nothing, since it is left alone (conftest.py)."""
    file = mutants.ROOT / "shellform/run/sizes.py"
    fault = next(each for each in mutants.faults(file) if each.after == "spacing < 0.5")
    assert gc.get_freeze_count() > 0, "else the test says nothing"
    child = os.fork()
    if child == 0:
        os._exit(0 if mutants.plant(fault) and sizes.practical(0.62) == 0.62 else 1)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
