"""What was left out of a net, each note of a kind and in words."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class NoteKind(Enum):
    """What was left out: `JOINTS` near the edge, where rods cross without a connector; `RODS` with too few
    joints. `OTHER`: of a net that was saved without kinds."""

    JOINTS = "joints"
    RODS = "rods"
    OTHER = "other"


@dataclass(frozen=True)
class NetNote:
    """A note: its `kind`, and a `text` for people."""

    kind: NoteKind
    text: str
