"""What was left out of a net or tried for it, each note of a kind and in words."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class NoteKind(Enum):
    """What a note tells: `JOINTS` near the edge, where rods cross without a connector; `RODS` with too few
    joints; crossings `NEAR` each other since rods bend between them; `ATTEMPT`: one that failed before this
    net was found, or gave it; the `GROUND`, where it was taken to slope. `OTHER`: of a net saved without
    kinds."""

    JOINTS = "joints"
    RODS = "rods"
    NEAR = "near"
    ATTEMPT = "attempt"
    GROUND = "ground"
    OTHER = "other"


@dataclass(frozen=True)
class NetNote:
    """A note: its `kind`, and a `text` for people."""

    kind: NoteKind
    text: str
