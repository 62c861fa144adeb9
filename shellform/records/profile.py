"""profile.json: what a run's stages took of time and memory, by kind of work."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from shellform.errors import Damaged
from shellform.records.files import read_record, text_of
from shellform.records.stages import STAGES, StagesDone
from shellform.written import write_text

FILE = "profile.json"
FORMAT, VERSION = "shellform-profile", 1


@dataclass(frozen=True)
class WorkRecord:
    """A kind of work: how often it was begun, s of the clock and of the processor, summed over threads."""

    calls: int
    clock: float
    processor: float


@dataclass(frozen=True)
class StageProfile:
    """A stage with the `key` that it had: s of the `clock`, of the `processor` (all threads, and processes
    that have ended), and of `waiting`: by so much the clock was ahead of the processor. `memory_peak`, bytes,
    is the most that this process held at once; None where the system doesn't tell. `work` by kind; what no
    kind is told of is "other".
    """

    key: str
    clock: float
    processor: float
    waiting: float
    work: Mapping[str, WorkRecord]
    memory_peak: int | None = None


@dataclass(frozen=True)
class Profile:
    """The `stages` that were measured, by name, on a machine that grants so many `cores`."""

    format: str = FORMAT
    version: int = VERSION
    cores: int = 0
    stages: Mapping[str, StageProfile] = field(default_factory=dict)

    def also(self, stage: str, measured: StageProfile) -> Profile:
        """With one more, in the stages' order."""
        stages = {**self.stages, stage: measured}
        return replace(self, stages={name: stages[name] for name in STAGES if name in stages})

    def of(self, done: StagesDone) -> Profile:
        """Of the stages alone whose results are those that are done."""
        return replace(
            self, stages={name: each for name, each in self.stages.items() if done.has(name, each.key)}
        )


def read_profile(folder: Path) -> Profile:
    """The profile in a run folder; an empty one where none was made. Raises Damaged (an InputError)."""
    file = folder / FILE
    if not file.is_file():
        return Profile()
    found = read_record(file, Profile)
    if (found.format, found.version) != (FORMAT, VERSION):
        raise Damaged("is no profile of this version", where=str(file), remedy="Delete it.")
    return found


def write_profile(folder: Path, profile: Profile) -> None:
    """Writes profile.json. Raises InputError where it can't be written."""
    write_text(folder / FILE, text_of(profile))
