"""How long an optimisation still takes."""

from __future__ import annotations

from dataclasses import dataclass, replace

from shellform.compiled import clock_without_compiling

# evaluations' worth that the pace of the phase before counts for in a phase that has just begun
_BELIEVED = 5
_CONFIRMING = 1  # of the time between two notes of the last phase: a fresh sample's judgement at the end
# In evaluations of the first phase, measured on 22 searches (vaults, full-size shells, strangers' surfaces):
POLISHING_TAKES = 30  # polishing, which judges as built too
WITHOUT_LOADS = 5  # the design without regard to the loads


@dataclass(frozen=True)
class _Phase:
    """What a phase has taken: from the `began` note of the phase before, `evaluations` in `seconds` with so
    many `notes`."""

    name: str
    began: tuple[int, float]
    evaluations: int = 0
    seconds: float = 0.0
    notes: int = 0


class Pace:
    """An estimate for `planned` evaluations in all and what comes `afterwards`, counted in evaluations of the
    first phase.

    The first phase has its own pace, and those after it, which draw structures and change from one to the
    other, have one in common, slower by factors; where they have just begun they are taken to go on as the
    first. What came before the first note and the compiling of loops tell nothing of what follows, and are
    left out.
    """

    def __init__(self, planned: int, afterwards: int = 0) -> None:
        self.planned, self.afterwards = planned, afterwards
        self._phases: list[_Phase] = []
        self._last = (0, 0.0)

    def left(self, done: int, phase: str = "") -> float | None:
        """s for what is left once so many evaluations are `done`, the last one in a `phase`; None as long as
        nothing is known."""
        now = (done, clock_without_compiling())
        if not self._phases:
            self._phases, self._last = [_Phase(phase, now)], now
            return None
        if self._phases[-1].name != phase:
            self._phases.append(_Phase(phase, self._last))
        self._last = now
        latest = self._phases[-1]
        taken = (now[0] - latest.began[0], now[1] - latest.began[1])
        latest = replace(latest, evaluations=taken[0], seconds=taken[1], notes=latest.notes + 1)
        self._phases[-1] = latest
        return self._estimate(max(self.planned - done, 0))

    def _estimate(self, missing: int) -> float | None:
        """s for so many evaluations and what comes afterwards."""
        known = [each for each in self._phases if each.evaluations > 0 or each.seconds > 0.0]
        if not known or not known[0].evaluations:
            return None
        first = pace = known[0].seconds / known[0].evaluations
        if len(known) == 1:
            return first * (missing + self.afterwards)
        believed = _BELIEVED * first
        seconds = sum(each.seconds for each in known[1:]) + believed
        pace = seconds / (sum(each.evaluations for each in known[1:]) + _BELIEVED)
        between = seconds / (sum(each.notes for each in known[1:]) + _BELIEVED)
        return pace * missing + _CONFIRMING * between + self.afterwards * first


def time_words(seconds: float) -> str:
    """As exact as an estimate is: "40 s", "3 min", "2 h"."""
    for unit, word, most in ((1.0, "s", 100.0), (60.0, "min", 100.0)):
        if seconds < most * unit:
            return f"{seconds / unit:.0f} {word}"
    return f"{seconds / 3600.0:.0f} h"
