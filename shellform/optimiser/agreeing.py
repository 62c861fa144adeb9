"""A search that goes on until a fresh sample agrees with it (scenario optimisation).

A search chooses its designs by their luck with the structures that it tries them on. So what thinning ends
with is drawn anew, as often as a finished design is. The structures of this sample that fall and have to
stand are kept in mind (minding.py) and lead the search on; those under the design load are among what it is
judged by from then on, and another sample, that no step has seen, judges what comes of it. Going back to
earlier designs (going_back.py) gives away cables that a few lengths make up for: it is left for where the
evaluations that are granted for this are spent.
"""

from __future__ import annotations

from dataclasses import replace

from shellform.optimiser.descent import descend
from shellform.optimiser.going_back import last_sound
from shellform.optimiser.minding import WORTH_A_TURN, begin_turn, finely, lead_by
from shellform.optimiser.optimum import worse
from shellform.optimiser.search_state import Iterate, Search, accepted_design, taut_count
from shellform.optimiser.trials import fresh, sound
from shellform.reliability.demands import aims

_MORE = 0.2  # of all evaluations, that come on top where a sample disagrees
_MOST = 12  # samples, after which a turn without a step is the last
_PAUSE = 0.75  # of the cables, at which thinning asks a sample on its way
_LEFT = 0.4  # of all evaluations, that thinning leaves where trials know no enlarged errors


def leaving_some(search: Search) -> Search:
    """The search with as many evaluations as thinning may take. What few structures with errors as they are
    have confirmed falls in a fresh sample as a rule, and the fewer cables are left, the less can be led."""
    if search.asked is None or search.asked.trusted:
        return search
    return replace(search, evaluations=search.evaluations - int(_LEFT * search.evaluations))


def pausing(search: Search, it: Iterate) -> bool:
    """Whether thinning is to ask a fresh sample now: where trials know no enlarged errors, each time a
    quarter of the cables that were `counted` at the last sample has gone. Such trials let go too many as a
    rule, and a few lengths make up for that only where it is seen soon."""
    if search.asked is None or search.asked.trusted or search.asked.confirmed is None:
        return False
    return taut_count(search, it.point) < _PAUSE * it.counted


def agreed(search: Search, it: Iterate) -> tuple[bool, Iterate]:
    """Whether a fresh sample agrees that the last design stands, and the iterate.

    Where one disagrees, turns follow: what falls in it leads a descent, and another sample judges what that
    comes to. Where thinning has ended they go on after a sample has agreed, too, as long as each leads to a
    better design with which one agrees. A turn that finds no step is followed by one that another sample
    leads on, but that sample can't agree: drawn often enough, a design stands by luck."""
    if search.asked is None or search.asked.confirmed is None or not it.accepted:
        return True, it
    asked = search.asked
    search = replace(search, evaluations=search.evaluations + int(_MORE * search.evaluations))
    while True:
        refused = False
        if it.until:  # in the middle of a turn
            spent = search.evaluator.evaluations
            it = descend(finely(search, it.until), it)
            refused = len(it.accepted) == it.begun  # by the sample that led the turn, which found no step
            if refused and (
                it.begun == it.stood or it.samples >= _MOST or search.evaluator.evaluations == spent
            ):
                break
            if not refused:
                there = sound(search, it.accepted[-1])
                if there is None:
                    break
                it = replace(it, point=there, accepted=(*it.accepted[:-1], accepted_design(search, there)))
        judged, it = fresh(search, it)
        if judged.stands and refused:
            break
        if judged.stands:
            found, before = it.point.objective, it.led_to
            if found < before:
                it = replace(it, stood=len(it.accepted), led_to=found)
            if it.mind is None or it.paused or not found < worse(before, -WORTH_A_TURN):
                break
        least = {} if judged.stands else aims(asked.sample(it.samples), judged)
        it = lead_by(search, it, it.accepted[-1].built, least)
        if it.mind is None or search.left() <= 0:
            break
        it = begin_turn(search, replace(it, begun=len(it.accepted)))
    if it.stood in (0, len(it.accepted)):
        return it.stood > 0, it
    back = last_sound(search, replace(it, accepted=it.accepted[: it.stood]))
    return (True, back) if len(back.accepted) == it.stood else (False, it)
