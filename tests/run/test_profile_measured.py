"""What is measured of a stage, by a clock that is stood in for."""

from types import SimpleNamespace

import pytest

from shellform.records.profile import WorkRecord
from shellform.run import profiling
from shellform.work_clock import Work


@pytest.mark.parametrize("watched", [True, False])
def test_what_no_kind_of_work_tells_of_is_the_rest_and_what_the_processor_lacks_was_waited(
    monkeypatch, watched
):
    kinds = [each for each in Work if each is not Work.REST][:2]
    heard = {
        kinds[0]: SimpleNamespace(calls=3, clock=2.0, processor=1.5),
        kinds[1]: SimpleNamespace(calls=4, clock=1.0, processor=0.5),
        Work.REST: SimpleNamespace(calls=9, clock=99.0, processor=99.0),
    }
    seconds, used = iter([10.0, 18.0]), iter([5.0, 10.0])
    monkeypatch.setattr(profiling.time, "perf_counter", lambda: next(seconds))
    monkeypatch.setattr(profiling, "_processor", lambda: next(used))
    monkeypatch.setattr(profiling, "_set_back_peak", lambda: watched)
    monkeypatch.setattr(profiling, "_peak", lambda: 4096)
    found = profiling.Profiler(SimpleNamespace(taken=lambda: heard))._measured("key")
    assert (found.key, found.clock, found.processor, found.waiting) == ("key", 8.0, 5.0, 3.0)
    assert found.memory_peak == (4096 if watched else None)
    assert found.work == {
        kinds[0].value: WorkRecord(3, 2.0, 1.5),
        kinds[1].value: WorkRecord(4, 1.0, 0.5),
        Work.REST.value: WorkRecord(1, 5.0, 3.0),
    }


def test_times_of_processes_that_were_started_count_with_one_s_own(monkeypatch):
    monkeypatch.setattr(profiling.time, "process_time", lambda: 1.5)
    monkeypatch.setattr(
        profiling.os, "times", lambda: SimpleNamespace(children_user=4.0, children_system=0.25)
    )
    assert profiling._processor() == 5.75
