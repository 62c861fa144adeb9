"""How rarely a design falls: subset simulation (subset.py) over the errors of its structures.

The limit state of a structure is the load factor at which it loses its stable branch, less the factor 1 of
the load that it has to bear. Factors are sought up to `SOUGHT`, found to `RESOLUTION`, and beyond that taken
as equal: where more than nine tenths of all structures bear more, the first level goes on from those that
don't, however few, and where all do, nothing fails.

The factors come in an order that the seed decides alone: what was found before it was broken off is gone
through again with the factors that are `known`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from shellform.arrays import Reals
from shellform.gridshell.tolerances import Tolerances
from shellform.reliability.drawing import errors_of, sizes
from shellform.reliability.members import Members
from shellform.reliability.path_of_one import RESOLUTION, SOUGHT
from shellform.reliability.standing import Workshop
from shellform.reliability.subset import Rare, subset_simulation
from shellform.structure.elements.threads import side_by_side

COUNT = 200  # samples a level: one in a thousand takes three levels, 560 structures
_AT_ONCE = 10  # structures, before they are told
_STEP = 0.25  # of the load, on a structure's path at first
_MEDIAN = 0.4549  # of a squared standard normal variable


@dataclass(frozen=True, eq=False)
class RareFailure:
    """`found` by subset simulation; `shares` of each cause in the squared distance of the likeliest failure
    from the perfect structure, less what as many variables have there by chance (empty where nothing failed).
    """

    found: Rare
    shares: dict[str, float]


def rare_failure(
    workshop: Workshop,
    tolerances: Tolerances,
    *,
    seed: int,
    count: int = COUNT,
    most: float = SOUGHT,
    known: Sequence[float] = (),
    tell: Callable[[Sequence[float]], None] | None = None,
) -> RareFailure:
    """The probability that a structure of the workshop's design doesn't bear its load.

    `count` structures are followed on each level, none beyond the load factor `most`. `tell` hears the load
    factors less 1 of all structures so far, after every few; `known` are the first of those that an earlier
    call with the same arguments told, so that it goes on from there. Raises InputError for a `count` that
    isn't a multiple of ten of at least 20."""
    members = workshop.nominal.members
    names = list(tolerances.causes)
    counts = sizes(members)

    def one(z: Reals) -> float:
        errors = errors_of(members, tolerances, _by_cause(members, names, z))
        fell = workshop.fall(errors, most=most, step=_STEP, resolution=RESOLUTION, tell=False)
        return fell.factor - 1.0

    values, asked = list(known), 0

    def limit_state(points: Reals) -> list[float]:
        nonlocal asked
        begin, asked = asked, asked + len(points)
        while len(values) < asked:
            some = points[len(values) - begin :][:_AT_ONCE]
            values.extend(side_by_side(one, list(some)))
            if tell is not None:
                tell(values)
        return values[begin:asked]

    found = subset_simulation(limit_state, sum(counts[name] for name in names), count=count, seed=seed)
    return RareFailure(found, _shares(found, names, [counts[name] for name in names]))


def _by_cause(members: Members, names: list[str], z: Reals) -> dict[str, Reals]:
    """The variables of each cause; 0 for those that are left out."""
    counts, first = sizes(members), 0
    found = {name: np.zeros(count) for name, count in counts.items()}
    for name in names:
        found[name] = z[first : first + counts[name]]
        first += counts[name]
    return found


def _shares(found: Rare, names: list[str], counts: list[int]) -> dict[str, float]:
    """Shares, 1 in all, of the causes `names`, each with so many variables as `counts` says; none where
    nothing failed.

    They are those of the squares of the mean failed point. In this mean, variables that have nothing to do
    with failing nearly cancel; what is left of them is noise, which is told from the median of the squares,
    since most variables are such, and taken off."""
    if not len(found.failed):
        return {}
    squared = found.failed.mean(axis=0) ** 2
    noise = float(np.median(squared)) / _MEDIAN
    ends = np.cumsum([0, *counts]).tolist()
    parts = [max(float(squared[a:b].sum()) - (b - a) * noise, 0.0) for a, b in pairwise(ends)]
    total = sum(parts) or 1.0
    return {name: part / total for name, part in zip(names, parts, strict=True)}
