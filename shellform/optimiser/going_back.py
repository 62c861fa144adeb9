"""Back among the accepted designs of a search: to the last one that keeps every limit, is sound, stands as
built, or of which a fresh sample says so.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from shellform.optimiser.search_state import Accepted, Iterate, Search, accepted_design
from shellform.optimiser.trials import confirmed, sound, standing
from shellform.problem.evaluation import Evaluated
from shellform.reliability.requirements import Required


def last_confirmed(search: Search, it: Iterate) -> Iterate:
    """Back to the last accepted design that is found of which a fresh sample agrees that it stands: the
    search has chosen its designs by their luck with the structures it tried. Where none is, to the last one
    of which it does with none spared."""
    if search.asked is None or search.asked.confirmed is None or not it.accepted:
        return it
    for asked in (search.asked, search.asked.unspared()):
        found = _last_confirmed(search, it, asked.sample(it.samples))
        if found is not None:
            return replace(found, fell=False)
    return replace(
        it, fell=True, status=f"{it.status}; a fresh sample doesn't confirm that it stands as built"
    )


def _last_confirmed(search: Search, it: Iterate, asked: Required) -> Iterate | None:
    stood = _confirmed_among(search, asked, it.accepted)
    if stood == len(it.accepted) - 1:
        return it
    while stood >= 0:
        found = last_sound(search, replace(it, accepted=it.accepted[: stood + 1]))
        if len(found.accepted) == stood + 1:
            return replace(found, status=f"{it.status}; the last design that a fresh sample confirms")
        stood = _confirmed_among(search, asked, found.accepted)  # its documented path led to another design
    return None


def _confirmed_among(search: Search, asked: Required, accepted: Sequence[Accepted]) -> int:
    """The number of the last one that is found to be confirmed, -1 where none is: in steps of 1, 2, 4, ...
    from the end, and between the last two of them by bisection. Structures in which one fell come first in
    the next: what falls takes several times the work of what stands."""
    fallen: list[int] = []

    def holds(number: int) -> bool:
        found = confirmed(search, asked, accepted[number].built, fallen)
        own = [number for each in found.fallen.values() for number in each]
        fallen[:] = dict.fromkeys([*own, *fallen])
        return found.stands

    stood, fell, back = len(accepted) - 1, len(accepted), 1
    while stood >= 0 and not holds(stood):
        stood, fell, back = max(stood - back, 0) if stood else -1, stood, 2 * back
    while stood >= 0 and fell - stood > 1:
        middle = (stood + fell) // 2
        stood, fell = (middle, fell) if holds(middle) else (stood, middle)
    return stood


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
        return replace(it, fell=True, status=f"{it.status}; no design was found that stands as built")
    return replace(found, fell=False)


def within_limits(search: Search, it: Iterate) -> Iterate:
    """Back to the last accepted design that keeps every limit, where the last one breaks one. On its way a
    descent may pass where what it gains outweighs that; where its evaluations end there, what it has is no
    result. No further back than to where this turn began, or to what stood."""
    kept = [number for number, each in enumerate(it.accepted, start=1) if each.violation <= 0.0]
    if not kept or kept[-1] == len(it.accepted) or kept[-1] < max(it.begun, it.stood):
        return it
    back = last_sound(search, replace(it, accepted=it.accepted[: kept[-1]]))
    return back if len(back.accepted) == kept[-1] else it


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


def _at(search: Search, it: Iterate, point: Evaluated) -> Iterate:
    """At the point, whose design may have other cables than the present one."""
    if np.array_equal(point.design.present, it.point.design.present):
        return replace(it, point=point)
    count = int(point.design.present.sum())
    every = np.full(count, search.always_guarded)
    return replace(it, point=point, tensioned=every, needed=np.zeros(count, dtype=bool))
