"""How much cables pull at each stage, in words, beside what they may pull (5): some most before the
pour.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from shellform.arrays import Reals
from shellform.quantities import newtons
from shellform.records.words import exceeds, listed


def force_notes(pulls: Mapping[str, Reals], before: str, limit: float | None) -> tuple[str, ...]:
    """Of the tensions (c,), N, by stage, that `before` any load among them, and their `limit`, N
    (None: not known), a sentence each: the largest, what is above the limit, what hangs slack before."""
    if not len(pulls[before]):
        return ()
    most = {name: int(np.argmax(pull)) for name, pull in pulls.items()}
    found = ", ".join(f"{name} {newtons(float(pulls[name][k]))} (C{k})" for name, k in most.items())
    told = [f"Largest force: {found}."]
    if limit is not None:
        told[0] += f" The limit is {newtons(limit)} (cable.force_max)."
        above = [
            (name, k)
            for name, pull in pulls.items()
            for k, n in enumerate(pull.tolist())
            if exceeds(n, limit)
        ]
        if above:
            told.append(f"More than that: {listed([f'C{k} ({name})' for name, k in above])}.")
    slack = np.flatnonzero(pulls[before] <= 0.0).tolist()
    if slack:
        told.append(f"Slack before any load: {listed([f'C{k}' for k in slack])}.")
    return tuple(told)


def tightening_notes(before: Reals) -> tuple[str, ...]:
    """By what cables are tightened that pull `before` (c,), N, any load, a sentence; nothing where none
    does."""
    if not (before > 0.0).any():
        return ()
    return (
        "Tighten a cable to its force before any load, by its rest length only where it hangs slack then: lengths alone "
        "leave in it what supports and marks are off.",
    )
