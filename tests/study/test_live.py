"""What the terminal is told of a study as it goes on."""

from types import SimpleNamespace

import pytest

from shellform.study import live
from shellform.study.engine import Manned
from shellform.study.outcome import Row, Status
from shellform.study.studies import StudyProgress


@pytest.fixture
def clock(monkeypatch):
    now = SimpleNamespace(seconds=1030.0)
    monkeypatch.setattr(live, "time", SimpleNamespace(perf_counter=lambda: now.seconds))
    return now


@pytest.mark.parametrize(
    ("done", "found", "failed", "line"),
    [
        (0, 0, 0, "study: 0 of 100 designs"),
        (0, 30, 0, "study: 30 of 100 designs"),
        (12, 0, 0, "study: 12 of 100 designs, about 220 s to go"),
        (12, 28, 3, "study: 40 of 100 designs, 3 without a result, about 150 s to go"),
        (60, 40, 0, "study: 100 of 100 designs, about 0 s to go"),
        (60, 45, 0, "study: 105 of 100 designs, about 0 s to go"),
    ],
)
def test_the_rest_takes_as_long_for_each_design_as_those_did_that_were_computed(
    clock, done, found, failed, line
):
    """After 30 s; what was found from before took no time."""
    progress = StudyProgress(total=100, done=done, failed=failed, found=found, began=1000.0)
    assert live._line(progress) == line


@pytest.mark.parametrize(
    ("manned", "words"),
    [
        (Manned(3, 8, 10.0, 0.0), ""),
        (Manned(3, 8, 10.4, 0.0), ", 5 of 8 workers gone for 10 s"),
        (Manned(0, 8, 9.0, 10.0), ""),
        (Manned(0, 8, 40.0, 10.0), ", 8 of 8 workers gone for 40 s"),
        (Manned(0, 8, 40.0, 25.0), ", no worker for 25 s"),
    ],
)
def test_missing_workers_are_told_once_they_have_been_gone_for_ten_seconds(manned, words):
    assert live._short(manned) == words


def test_where_nobody_looks_a_line_is_told_every_ten_seconds(clock):
    said = []
    shown = live.Live(quiet=True)
    shown._drawn = None
    shown._console = SimpleNamespace(print=said.append)
    for seconds, done in ((1030.0, 1), (1034.0, 2), (1040.0, 3), (1040.5, 4), (1050.4, 5), (1050.6, 6)):
        clock.seconds = seconds
        shown(StudyProgress(total=9, done=done, began=1000.0, dashboard="http://127.0.0.1:8787"))
    assert said[0] == "dashboard: http://127.0.0.1:8787"
    assert [line.split(" of ")[0] for line in said[1:]] == ["study: 1", "study: 4", "study: 6"]


def test_the_table_has_a_line_a_design_with_its_numbers_or_why_there_are_none(clock):
    rows = [
        Row("0", Status.MISSING, "", {}),
        Row("0", Status.CRASHED, "by itself", {}),
        Row("a", Status.DONE, "", {"misfit": 0.00123456, "cables": 12, "said": None}),
        Row("b", Status.REFUSED, "r" * 70, {"misfit": None, "cables": 7, "said": "limit point"}),
    ]
    table = live._table(StudyProgress(total=2, done=2, began=1000.0, rows=rows))
    assert [column.header for column in table.columns] == ["status", "misfit", "cables", "said"]
    assert [list(column.cells) for column in table.columns] == [
        ["missing: ", "crashed: by itself", "done", f"refused: {'r' * 60}"],
        ["", "", "0.001235", ""],
        ["", "", "12", "7"],
        ["", "", "", "limit point"],
    ]
    assert table.caption is None
    told = live._table(StudyProgress(total=2, began=1000.0, dashboard="http://127.0.0.1:8787"))
    assert (told.columns, told.caption) == ([], "http://127.0.0.1:8787")
