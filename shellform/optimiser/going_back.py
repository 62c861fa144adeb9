"""Back among the accepted designs of a search: to the last one that is sound, stands as built, or of which a
fresh sample says so.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shellform.optimiser.search_state import Iterate, Search, accepted_design
from shellform.optimiser.trials import confirmed, sound, standing
from shellform.problem.evaluation import Linearisation


def last_confirmed(search: Search, it: Iterate) -> Iterate:
    """Back to the last accepted design of which a fresh sample agrees that it stands, in steps of 1, 2, 4,
    ...: the search has chosen its designs by their luck with the structures it tried."""
    if search.asked is None or not it.accepted:
        return it
    back = 0
    while back < len(it.accepted):
        own = it.accepted[: len(it.accepted) - back]
        if confirmed(search, own[-1].built):
            if back == 0:
                return it
            found = last_sound(search, replace(it, accepted=own))
            if found.accepted and len(found.accepted) == len(own):
                return replace(found, status=f"{it.status}; the last design that a fresh sample confirms")
        back = 2 * back + 1
    return replace(it, status=f"{it.status}; a fresh sample doesn't confirm that it stands as built")


def last_standing(search: Search, it: Iterate) -> Iterate:
    """Back, by bisection, to the last accepted design that stands as built."""
    if search.asked is None or not it.accepted:
        return it
    holds, it = standing(search, it, it.accepted[-1].built)
    if holds:
        return it
    stood, fell = -1, len(it.accepted) - 1  # whether the start stands is found out at last
    while fell - stood > 1:
        middle = max((stood + fell) // 2, 0)
        holds, it = standing(search, it, it.accepted[middle].built)
        stood, fell = (middle, fell) if holds else (stood, middle)
    back = replace(it, accepted=it.accepted[: stood + 1])
    found = last_sound(search, back) if back.accepted else back
    if not found.accepted:  # none stands: the search goes on with what it has, and whoever judges says so
        return replace(it, status=f"{it.status}; no design was found that stands as built")
    return found


def last_sound(search: Search, it: Iterate) -> Iterate:
    """Back to the last accepted design that its documented path leads to."""
    while it.accepted:
        found = sound(search, it.accepted[-1])
        if found is not None:
            last = accepted_design(search, found)
            it = replace(it, accepted=(*it.accepted[:-1], last))
            return _at(search, it, found)
        it = replace(it, accepted=it.accepted[:-1])
    return it


def _at(search: Search, it: Iterate, point: Linearisation) -> Iterate:
    """At the point, whose design may have other cables than the present one."""
    if np.array_equal(point.design.present, it.point.design.present):
        return replace(it, point=point)
    count = int(point.design.present.sum())
    every = np.full(count, search.always_guarded)
    return replace(it, point=point, tensioned=every, needed=np.zeros(count, dtype=bool))
