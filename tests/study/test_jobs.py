"""How a worker ends a design that takes too long, and what it does with what it shares."""

import errno
import threading
from types import SimpleNamespace

import pytest

from shellform.errors import InputError
from shellform.records.summary import Summary
from shellform.run import run
from shellform.study import jobs
from shellform.study.jobs import Job, Overtime, disk_is_full, ended_where_it_hangs, work
from shellform.study.outcome import Outcome, Status


class Trace:
    """In place of the fault handler: after how long a process would be ended."""

    def __init__(self, monkeypatch, parent="a nanny"):
        self.told = []
        monkeypatch.setattr(jobs, "faulthandler", self)
        monkeypatch.setattr(jobs, "parent_process", lambda: parent)

    def dump_traceback_later(self, seconds, exit, file):
        self.told.append((seconds, exit))

    def cancel_dump_traceback_later(self):
        self.told.append("cancelled")


@pytest.mark.parametrize(
    ("longest", "ended"),
    [(45.0, 90.0), (0.4, 0.8), (threading.TIMEOUT_MAX, threading.TIMEOUT_MAX)],
)
def test_a_process_is_ended_after_twice_the_time_that_its_design_may_take(
    monkeypatch, tmp_path, longest, ended
):
    trace = Trace(monkeypatch)
    with ended_where_it_hangs(tmp_path / "r", longest):
        assert trace.told == [(ended, True)]
        assert (tmp_path / "r" / "overtime.txt").is_file()
    assert trace.told[1:] == ["cancelled"]
    assert not (tmp_path / "r" / "overtime.txt").exists()


@pytest.mark.parametrize(("parent", "longest"), [(None, 45.0), ("a nanny", float("inf"))])
def test_a_process_that_nobody_would_begin_anew_or_that_has_all_the_time_is_not_ended(
    monkeypatch, tmp_path, parent, longest
):
    trace = Trace(monkeypatch, parent)
    with ended_where_it_hangs(tmp_path, longest):
        pass
    assert trace.told == []


def test_a_trace_that_a_process_left_as_it_was_ended_is_told_once(monkeypatch, tmp_path):
    Trace(monkeypatch)
    (tmp_path / "overtime.txt").write_text("Thread 0x1: hung")
    told = pytest.raises(Overtime, match=r"took longer than 45 s, and its worker had to be ended")
    with told, ended_where_it_hangs(tmp_path, 45.0):
        pass
    (tmp_path / "overtime.txt").write_text("")  # killed from outside
    with ended_where_it_hangs(tmp_path, 45.0):
        pass


def test_a_design_is_stopped_at_its_first_step_after_the_time_that_it_may_take(monkeypatch, tmp_path):
    clock = SimpleNamespace(now=700.0)
    monkeypatch.setattr(jobs, "time", SimpleNamespace(perf_counter=lambda: clock.now))
    at = []

    def run_case(case, folder, *, report, **how):
        assert how == {"until": "net", "allow_scripts": True, "wait": True}
        for seconds in (0.0, 29.0, 30.0, 30.5, 31.0):
            clock.now = 700.0 + seconds
            at.append(seconds)
            report(SimpleNamespace(stage="optimise", text="step 3"))

    monkeypatch.setattr(run, "run_case", run_case)
    found = work(Job("k", None, "net", str(tmp_path / "r"), allow_scripts=True, longest=30.0))
    assert (found.status, found.reason) == (
        Status.OVERTIME,
        "took longer than 30 s: was at optimise, step 3",
    )
    assert at == [0.0, 29.0, 30.0, 30.5]
    assert found.seconds["here"] == 30.5


def test_a_design_goes_on_from_the_last_of_what_it_shares_unless_that_failed(monkeypatch, tmp_path):
    monkeypatch.setattr(run, "run_case", lambda *_, **__: Summary())
    for name, text in (("surface", "a"), ("net", "b"), ("initial", "c")):
        (tmp_path / name).mkdir()
        for file in ("summary.json", "stages.json", "net.json", jobs.LOCK):
            (tmp_path / name / file).write_text(f"{file} {text}")
    before = tuple(Job(name, None, name, str(tmp_path / name)) for name in ("surface", "net", "initial"))
    job = Job("k", None, "optimise", str(tmp_path / "r"), before)
    lost = Outcome("net", Status.NO_RESULT, "no way", {"x": 1}, {"net": 2.0}, "w")
    assert work(job, lost) == Outcome("k", Status.NO_RESULT, "no way", {"x": 1}, {"net": 2.0}, "w")
    assert not (tmp_path / "r").exists()
    assert work(job, Outcome("net", Status.DONE)).status is Status.DONE
    assert (tmp_path / "r" / "net.json").read_text() == "net.json c"
    assert (tmp_path / "r" / "stages.json").read_text() == "stages.json c"
    lock = tmp_path / "r" / jobs.LOCK
    assert not lock.exists() or " c" not in lock.read_text(), "it is the other one's"
    (tmp_path / "r" / "net.json").write_text("own")
    work(job)
    assert (tmp_path / "r" / "net.json").read_text() == "own", "it has begun"


def test_a_fault_of_the_package_is_told_with_the_line_that_raised_it(monkeypatch, tmp_path):
    def deep():
        raise ZeroDivisionError("by zero")

    def run_case(*_, **__):
        deep()

    monkeypatch.setattr(run, "run_case", run_case)
    line = deep.__code__.co_firstlineno + 1
    found = work(Job("k", None, "net", str(tmp_path / "r")))
    assert found.reason == f"ZeroDivisionError: by zero (test_jobs.py, line {line})"


def test_the_disk_is_looked_for_behind_whatever_was_raised_because_of_it():
    full, denied = OSError(errno.ENOSPC, "full"), OSError(errno.EACCES, "denied")

    def after(error, *, said):
        raised, while_at_it = InputError("can't be written"), ValueError("on the way")
        raised.__cause__, while_at_it.__context__ = error, error
        return raised if said else while_at_it

    assert disk_is_full(full)
    assert disk_is_full(OSError(errno.EROFS, "read-only"))
    assert not disk_is_full(denied)
    assert not disk_is_full(None)
    for said in (True, False):
        assert disk_is_full(after(full, said=said))
        assert not disk_is_full(after(denied, said=said))
