"""How much cables pull at each stage, in words, beside what they may pull: constraint (5) limits them under
load alone, and some pull most before the pour.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from shellform.arrays import Reals
from shellform.quantities import newtons
from shellform.records.words import exceeds, listed


def force_notes(pulls: Mapping[str, Reals], before: str, limit: float | None) -> tuple[str, ...]:
    """Of the tensions (c,), N, by stage, that `before` any load among them, and their `limit`, N, under load
    (None: not known), a sentence each: the largest, what is above the limit, what hangs slack before."""
    if not len(pulls[before]):
        return ()
    most = {name: int(np.argmax(pull)) for name, pull in pulls.items()}
    found = ", ".join(f"{name} {newtons(float(pulls[name][k]))} (C{k})" for name, k in most.items())
    told = [f"Largest force: {found}."]
    if limit is not None:
        above = [k for k, pull in enumerate(pulls[before].tolist()) if exceeds(pull, limit)]
        told[0] += f" The limit, {newtons(limit)}, counts under load alone (cable.force_max)."
        if above:
            told.append(
                f"Before any load more than that: {listed([f'C{k}' for k in above])}. Choose cables, ends and turnbuckles "
                "for it."
            )
    slack = np.flatnonzero(pulls[before] <= 0.0).tolist()
    if slack:
        told.append(f"Slack before any load: {listed([f'C{k}' for k in slack])}.")
    return tuple(told)
