"""How long the steps of a stage still take."""

from __future__ import annotations

from shellform.compiled import clock_without_compiling

_RECENT = 10  # steps


class Pace:
    """An estimate from the pace of the steps so far, of `planned` in all: the slower one of all and of the
    last ten, since a search slows down where it begins to draw structures. What came before the first step
    and the compiling of loops tell nothing of those that follow, and are left out.
    """

    def __init__(self, planned: int) -> None:
        self.planned = planned
        self._reached: list[tuple[int, float]] = []

    def left(self, done: int) -> float | None:
        """s for what is left once so many steps are `done`; None as long as nothing is known."""
        self._reached.append((done, clock_without_compiling()))
        first = self._reached[0]
        recent = next(each for each in self._reached if each[0] >= done - _RECENT)
        paces = [_between(each, self._reached[-1]) for each in (first, recent)]
        known = [pace for pace in paces if pace is not None]
        return max(known) * max(self.planned - done, 0) if known else None


def _between(early: tuple[int, float], late: tuple[int, float]) -> float | None:
    """s a step; None where there is none between."""
    steps = late[0] - early[0]
    return (late[1] - early[1]) / steps if steps > 0 else None
