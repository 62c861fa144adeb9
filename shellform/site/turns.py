"""Whole turns of turnbuckles: the numbers k of the turnbuckle's step h that nearly minimise

    |away + J h k|² + λ |h k|²

with no more cables touched and none changed further than a crew can. Cables are chosen one by one, each the
one that lowers the sum most with all chosen ones solved for again (orthogonal matching pursuit); rounding to
whole turns goes from the surest to the least sure one with the rest solved for again, and single turns more
or less are tried in the end.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shellform.arrays import Indices, Reals
from shellform.errors import InputError, require_count, require_number

_BATCHES = 50  # in which cables are chosen and rounded: one by one as long as there are fewer of them
_SWEEPS = 20  # over all chosen cables, trying single turns


@dataclass(frozen=True)
class Crew:
    """What a crew can do in one round: turn a turnbuckle in steps of `step`, m of rest length, by at most
    `largest`, m, on at most `cables` cables.
    """

    step: float
    largest: float
    cables: int

    def __post_init__(self) -> None:
        for name, usual in (("step", 0.0001), ("largest", 0.002)):
            give = f"metres of rest length, such as {usual}"
            require_number(getattr(self, name), above=0.0, where=f"crew.{name}", give=give)
        if self.step > self.largest:
            what, remedy = "must not be more than the largest change", f"Give metres up to {self.largest:g}."
            raise InputError(what, where="crew.step", value=self.step, remedy=remedy)
        require_count(self.cables, where="crew.cables", give="a number of cables a round, such as 10")


def whole_turns(jacobian: Reals, away: Reals, crew: Crew, *, weight: float) -> Indices:
    """Whole numbers k (p,) of steps h that nearly minimise |away + J h k|² + weight |h k|² for J (r, p) and
    `away` (r,), within what the crew can do.
    """
    most = int(crew.largest / crew.step * (1.0 + 1e-9))
    gram = crew.step**2 * (jacobian.T @ jacobian + weight * np.eye(jacobian.shape[1]))
    slope = crew.step * (jacobian.T @ away)
    most_cables = min(crew.cables, len(slope))
    batch = 1 + most_cables // _BATCHES
    chosen: list[int] = [] if most_cables < len(slope) else list(range(len(slope)))
    steps = np.zeros(len(slope))
    while len(chosen) < most_cables:
        # What each cable alone would bring more, within its bounds.
        rest = slope + gram @ steps
        best = np.clip(-rest / np.diag(gram), -most, most)
        gain = -(rest * best + 0.5 * np.diag(gram) * best**2)
        gain[chosen] = 0.0
        order = np.argsort(-gain, kind="stable")[: min(batch, most_cables - len(chosen))]
        taken = order[gain[order] > 0.0].tolist()
        if not taken:
            break
        chosen += taken
        steps[chosen] = _bounded(gram, slope, chosen, np.zeros(len(slope)), most)
    whole = np.zeros(len(slope))
    loose = list(chosen)
    while loose:
        steps[loose] = _bounded(gram, slope, loose, whole, most)
        loose.sort(key=lambda each: abs(steps[each] - np.rint(steps[each])))
        surest, loose = loose[:batch], loose[batch:]
        whole[surest] = np.rint(steps[surest])
    return _polished(gram, slope, whole, chosen, most)


def _bounded(gram: Reals, slope: Reals, free: Sequence[int], fixed: Reals, most: int) -> Reals:
    """Nearly the minimum over the `free` entries, each within ±most, of slope·k + k'Gk/2 with the other
    entries `fixed`: what would leave its bounds is set there and the rest solved for again."""
    steps = fixed.copy()
    steps[list(free)] = 0.0
    loose = np.asarray(free)
    while len(loose):
        steps[loose] = 0.0
        found = np.linalg.solve(gram[np.ix_(loose, loose)], -(slope + gram @ steps)[loose])
        steps[loose] = np.clip(found, -most, most)
        inside = np.abs(found) <= most
        if inside.all():
            break
        loose = loose[inside]
    return steps[list(free)]


def _polished(gram: Reals, slope: Reals, whole: Reals, chosen: Sequence[int], most: int) -> Indices:
    """Single turns more or less on the chosen cables as long as they help."""
    steps = whole.copy()
    rest = slope + gram @ steps
    for _ in range(_SWEEPS):
        before = steps.copy()
        for cable in chosen:
            there = float(np.clip(np.rint(steps[cable] - rest[cable] / gram[cable, cable]), -most, most))
            if there != steps[cable]:
                rest = rest + gram[:, cable] * (there - steps[cable])
                steps[cable] = there
        if np.array_equal(before, steps):
            break
    return steps.astype(np.int64)
