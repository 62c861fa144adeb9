"""How a design can be raised, and what its rods bear on the way."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

SCAFFOLD = "scaffold"


@dataclass(frozen=True)
class WayUpRecord:
    """One way up: `by` "supports" that move in or a "scaffold", and whether that is under `every` crossing.

    On it rods bear at most so much of their strength, `utilisation` (0: the strength isn't known), in a
    `stage`. The largest force on a support, `reaction`; a scaffold pushes a crossing with up to `push` and
    holds `held_down` crossings down with up to `pull`, N. Where no stable path leads up, the reason why is
    `lost`, and the others are None.
    """

    by: str
    every: bool
    utilisation: float | None = None
    stage: str | None = None
    reaction: float | None = None
    push: float | None = None
    pull: float | None = None
    held_down: int | None = None
    lost: str = ""

    @property
    def strength_known(self) -> bool:
        """Whether what rods bear could be told of their strength: bent rods bear something."""
        return self.utilisation is not None and self.utilisation > 0.0


def easiest(ways: Sequence[WayUpRecord]) -> WayUpRecord:
    """The way on which rods bear the smallest share of their strength; the last where none was found."""
    found = [each for each in ways if each.utilisation is not None]
    return min(found, key=lambda each: each.utilisation or 0.0) if found else ways[-1]
