"""What turnbuckles of a given range can do: to how many lengths cables are cut for them, and what they can't
reach.

With the turnbuckle closed a cable has its cut length, at most the range shorter than its rest length
(grouping.py). To be hung in without force it has to reach the length between its pins in the grid before
bracing, and to be tightened after a survey it must not be closed yet.
"""

from __future__ import annotations

import numpy as np

from shellform.arrays import Reals
from shellform.errors import how_many
from shellform.gridshell.grouping import cut_lengths


def turnbuckle_notes(rest: Reals, hung: Reals, adjustment: float, *, lengths: int) -> tuple[str, ...]:
    """Of cables of the `rest` lengths (c,), of which so many `lengths` are different, that are `hung` in at
    (c,), m, and turnbuckles with the range `adjustment`, m: a sentence each."""
    cut = cut_lengths(rest, adjustment)
    told = [
        f"Cut to {len(np.unique(cut))} different lengths, the fewest for {lengths} different rest lengths and turnbuckles that "
        f"let a cable out by {1e3 * adjustment:g} mm from its cut length."
    ]
    short = hung - (cut + adjustment)
    if (short > 0.0).any():
        told.append(
            f"Let out in full, {how_many(int((short > 0.0).sum()), 'cable is', 'cables are')} up to {1e3 * float(short.max()):.1f} "
            "mm too short to be hung in without force."
        )
    closed = int((rest - cut < 1e-9).sum())
    told.append(
        f"{how_many(closed, 'turnbuckle is', 'turnbuckles are')} closed at the rest length: a survey can't have them tightened."
    )
    return tuple(told)
