"""`design --profile`: what each stage of a run takes of time and memory, by kind of work.

The peak of memory is the system's own (VmHWM), set back at the beginning of each stage, which Linux alone
allows.
"""

from __future__ import annotations

import os
import time
from pathlib import Path

from shellform.records.profile import (
    Profile,
    StageProfile,
    WorkRecord,
    read_profile,
    write_profile,
)
from shellform.structure.elements.threads import cores
from shellform.structure.solve.memory import kernel_entry
from shellform.work_clock import Work, WorkClock

_SET_BACK = "5"  # what /proc/self/clear_refs takes for the peak (man 5 proc)


class Profiler:
    """Measures stages, one after the other, from when it is made, by what a `clock` hears."""

    def __init__(self, clock: WorkClock) -> None:
        self._clock = clock
        self._begin()

    def over(self, folder: Path, stage: str, key: str, *, kept: bool) -> None:
        """A stage has ended: it goes into the folder's profile, unless its result was `kept` from before; the
        next one begins. Raises InputError where the profile is damaged or can't be written."""
        if not kept:
            before = read_profile(folder)
            profile = Profile(cores=cores(), stages=before.stages).also(stage, self._measured(key))
            write_profile(folder, profile)
        self._begin()

    def _begin(self) -> None:
        self._clock.taken()
        self._watched = _set_back_peak()
        self._since, self._used = time.perf_counter(), _processor()

    def _measured(self, key: str) -> StageProfile:
        clock, processor = time.perf_counter() - self._since, _processor() - self._used
        found = {
            work.value: WorkRecord(each.calls, each.clock, each.processor)
            for work, each in self._clock.taken().items()
            if work is not Work.REST
        }
        named = [sum(getattr(each, name) for each in found.values()) for name in ("clock", "processor")]
        rest = WorkRecord(1, max(clock - named[0], 0.0), max(processor - named[1], 0.0))
        waiting = max(clock - processor, 0.0)
        work = {each.value: found[each.value] for each in Work if each.value in found}
        peak = _peak() if self._watched else None
        return StageProfile(key, clock, processor, waiting, work | {Work.REST.value: rest}, peak)


def _processor() -> float:
    """s of the processor, of this process and of those that it started and that have ended."""
    times = os.times()
    return time.process_time() + times.children_user + times.children_system


def _set_back_peak() -> bool:
    """Whether the peak of memory could be set back to what is held now."""
    try:
        Path("/proc/self/clear_refs").write_text(_SET_BACK, encoding="ascii")
    except OSError:  # another system, or one that doesn't allow it
        return False
    return _peak() is not None


def _peak() -> int | None:
    """Bytes, at the most since the peak was set back; None where the system doesn't tell."""
    return kernel_entry(Path("/proc/self/status"), "VmHWM:")
