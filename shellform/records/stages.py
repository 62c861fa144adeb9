"""stages.json: which stages of a run are done, each with the key of all that it depends on."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from shellform.records.files import read_record
from shellform.written import write_text

FILE = "stages.json"
STAGES = ("surface", "net", "initial", "optimise", "safety", "figures", "documents", "report")
SHOWING = STAGES[5:]  # which show what was found: none of them needs another


@dataclass(frozen=True)
class StagesDone:
    """The `keys` of the stages that are done, by name, in their order."""

    keys: Mapping[str, str] = field(default_factory=dict)

    def has(self, stage: str, key: str) -> bool:
        """Whether the stage was done with this key."""
        return self.keys.get(stage) == key

    def before(self, stage: str) -> StagesDone:
        """Those before a stage alone."""
        early = STAGES[: STAGES.index(stage)]
        return StagesDone({name: self.keys[name] for name in early if name in self.keys})

    def also(self, stage: str, key: str) -> StagesDone:
        """With one more."""
        return StagesDone({**self.keys, stage: key})


def read_stages(folder: Path) -> StagesDone:
    """What is done in a run folder; nothing where there is no file. Raises InputError where it is damaged."""
    path = folder / FILE
    return StagesDone(read_record(path, dict[str, str]) if path.is_file() else {})


def write_stages(folder: Path, done: StagesDone) -> None:
    """Writes stages.json. Raises InputError where it can't be written."""
    write_text(folder / FILE, json.dumps(dict(done.keys)))
