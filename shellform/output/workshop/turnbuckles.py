"""What turnbuckles of a given range can do: to how many lengths cables are cut for them, and what they can't
reach.

With the turnbuckle closed a cable has its cut length, at most the range shorter than its rest length
(grouping.py). To be hung in without force it has to reach the length between its pins in the grid before
bracing, and to be tightened after a survey it must not be closed yet.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shellform.arrays import Reals
from shellform.errors import how_many
from shellform.gridshell.grouping import cut_lengths


@dataclass(frozen=True)
class CutCounts:
    """How many different `rest_lengths` cables have, and to how many `cut_lengths` they are cut; None where
    each is cut for itself."""

    rest_lengths: int
    cut_lengths: int | None


def cut_counts(rest: Reals, adjustment: float | None) -> CutCounts:
    """Of cables of the `rest` lengths (c,), m, and turnbuckles with the range `adjustment`, m, if any."""
    alike = rest.round(9)  # what symmetry makes alike differs in its last bits
    cut = None if adjustment is None else len(np.unique(cut_lengths(rest, adjustment)))
    return CutCounts(len(np.unique(alike)), cut)


def cutting_note(rest: Reals, adjustment: float) -> str:
    """To how many lengths the same cables are cut, a sentence."""
    counts = cut_counts(rest, adjustment)
    return (
        f"Cut to {counts.cut_lengths} different lengths, the fewest for {counts.rest_lengths} different rest lengths and "
        f"turnbuckles that let a cable out by {1e3 * adjustment:g} mm from its cut length."
    )


def turnbuckle_notes(rest: Reals, hung: Reals, adjustment: float) -> tuple[str, ...]:
    """What the turnbuckles of the same cables can't do, a sentence each; the cables are `hung` in at (c,),
    m."""
    cut, told = cut_lengths(rest, adjustment), []
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
