"""Where structures rest under a load in one design, from where a search takes them along to the next one. In
designs side by side a structure rests side by side too, while from the perfect structure's place supports
that are off lead to where its tangent isn't positive definite. It may have come to rest in more than one
place: which of them it keeps to is no matter to whether it stands.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from shellform.arrays import Record
from shellform.structure.elements.state import State


@dataclass(frozen=True, eq=False)
class Resting(Record):
    """A design's states under one load, and all of it: the `perfect` structure's, and those of `drawn` ones
    by their numbers under a search's seed."""

    perfect: State
    drawn: Mapping[int, State]
