"""A search that is led by drawn structures: where more stiffness doesn't make a design stand as built, those
that fall are kept in mind, and what each of them is to bear becomes an aim of the search, with exact
derivatives (reliability/scenarios.py).

It begins again at the last design that stands, with the structures in mind that fell in the design to which
the objective alone has led. After a descent the design is judged by all structures again, those that fall now
join, and the search goes on from there, until none falls that has to stand (scenario optimisation). The judge
is the sample: what structures in mind bear is an aim and no limit.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from shellform.arrays import Reals
from shellform.errors import NotConverged
from shellform.gridshell.gridshell import Design
from shellform.optimiser.descent import descend
from shellform.optimiser.going_back import last_sound
from shellform.optimiser.optimum import worse
from shellform.optimiser.search_state import (
    Iterate,
    Search,
    accepted_design,
    aimed,
    kept_in_mind,
    restiffened,
)
from shellform.optimiser.step_model import StepModel
from shellform.optimiser.trials import sound, standing
from shellform.problem.evaluation import OffBranch
from shellform.reliability.demands import to_bear
from shellform.reliability.drawing import PERFECT
from shellform.reliability.requirements import closer

_SHARE = 0.1  # of all evaluations, for one turn of a descent and a judgement at the most …
_FEWEST = 4  # … but so many at least
_LED = 0.5  # … and for all turns
WORTH_A_TURN = 0.03  # of the objective, gained by a turn, for which another is made
_WINDOW = 0.05  # mean tensions, of a turn's first step: what falls first changes within larger ones
_SMALLEST = 0.004  # mean tensions
_MOST = 12  # structures in mind
_OVER = 1.03  # of what they are to bear is aimed for: an aim may be missed by a little
_LESS = 0.01  # of what they bear may be lost where they are to bear what they do


def ready_to_lead(search: Search, it: Iterate, fell: Design) -> Iterate | None:
    """The iterate, at a design that stands as built, ready to be led by the structures that fall in the
    design that `fell`; None where there are none to be followed."""
    search = looking_closer(search)
    led = lead_by(search, it, it.accepted[-1].built, falling(search, it, fell))
    return (
        None if led.mind is None else begin_turn(search, replace(led, phase="lead", stood=len(it.accepted)))
    )


def looking_closer(search: Search) -> Search:
    """The search with more structures in each trial."""
    return search if search.asked is None else replace(search, asked=closer(search.asked))


def lead(search: Search, it: Iterate) -> Iterate:
    """After turns of a descent and a judgement, as long as they lead to a better design that stands as built:
    at the last one that does, or where none does at the one that stood before."""
    last = int(_LED * search.evaluations)
    while search.left() > 0:
        it = descend(finely(search, it.until), it)
        found = sound(search, it.accepted[-1])
        if found is None:
            break
        it = replace(it, point=found, accepted=(*it.accepted[:-1], accepted_design(search, found)))
        holds, it = standing(search, it, it.accepted[-1].built)
        if holds:
            before = it.led_to
            if found.objective < before:
                it = replace(it, stood=len(it.accepted), led_to=found.objective)
            if not found.objective < worse(before, -WORTH_A_TURN):
                break
        if search.evaluator.evaluations >= last:
            break
        it = begin_turn(
            search, remembering(search, it) if holds else add_fallen(search, it, it.accepted[-1].built)
        )
    back = last_sound(search, replace(it, accepted=it.accepted[: it.stood]))
    if it.led_to < np.inf:
        return remembering(search, back)
    return restiffened(search, replace(back, mind=None, remembered=None), back.stiffness)


def add_fallen(search: Search, it: Iterate, design: Design) -> Iterate:
    """With those structures in mind too that fall in the design."""
    return lead_by(search, it, design, falling(search, it, design))


def finely(search: Search, until: int) -> Search:
    """The search in steps as small as what falls first asks for, until so many evaluations are spent."""
    fine = replace(search.solver, window=_WINDOW, smallest=min(_SMALLEST, search.solver.smallest))
    return replace(search, solver=fine, evaluations=min(search.evaluations, until))


def begin_turn(search: Search, it: Iterate) -> Iterate:
    """At the begin of a turn."""
    until = search.evaluator.evaluations + max(_FEWEST, int(_SHARE * search.evaluations))
    return replace(it, until=until, before=float("inf"), guarded=True, window=_WINDOW * search.tension)


def falling(search: Search, it: Iterate, design: Design) -> dict[int, float]:
    """The numbers of structures that fall in the design and have to stand, and the factors of the largest
    load that they are to bear; none where the design has no unloaded equilibrium."""
    assert search.asked is not None
    try:
        return to_bear(
            search.problem.shell,
            design,
            search.asked.trial,
            first=it.fallen,
            judging=search.judging,
            before=it.rested,
        )
    except NotConverged:
        return {}


def lead_by(search: Search, it: Iterate, design: Design, least: Mapping[int, float]) -> Iterate:
    """With these structures in mind too, and a little more than what they are to bear as the aim."""
    return minding(search, it, design, {number: _OVER * factor for number, factor in least.items()})


def minding(search: Search, it: Iterate, design: Design, least: Mapping[int, float]) -> Iterate:
    """With these structures in mind beside those that are, the latest first, all remembered in the `design`,
    as far as they can be followed; the stiffness to keep goes down to the solver's own. As it was where none
    can, or what one of them bears isn't found at the present point."""
    known = {} if it.mind is None else {each.number: each.least for each in it.mind.scenarios}
    latest = list({**least, **known, **least}.items())
    if it.phase == "agree":  # fewest may fall under the smallest load
        latest.sort(key=lambda each: (each[0] != PERFECT, each[1]))
    every = dict(latest[:_MOST])
    if not every:
        return it
    before, aim = search.evaluator.problem, min(search.solver.stiffness * search.softest, it.stiffness)
    try:
        mind = kept_in_mind(search, design, every)
        return restiffened(search, replace(it, mind=mind, remembered=design), aim)
    except (NotConverged, OffBranch):
        search.evaluator.problem = before
        return it


def as_borne(search: Search, it: Iterate, least: Mapping[int, float]) -> Iterate:
    """With the structures of the numbers in `least` in mind that are to bear what they bear in the present
    design, as far as they have to: an aim that is missed to begin with would lead the search to it instead of
    where the objective does. As it was where none of them can be followed, or what one bears isn't found."""
    if not least:
        return it
    design, point, before = it.point.design, it.point, search.evaluator.problem
    try:
        mind = kept_in_mind(search, design, least)
        search.evaluator.problem = aimed(search.inner, it.stiffness, mind)
        found = search.evaluator.seed(design, point.states, it.stage).constraints[-len(mind.scenarios) :]
    except (NotConverged, OffBranch):
        search.evaluator.problem = before
        return it
    own = [
        replace(each, least=min(1.0 / _OVER, (1.0 - _LESS) * (1.0 - by)) * each.least)
        for each, by in zip(mind.scenarios, found, strict=True)
    ]
    mind = replace(mind, scenarios=tuple(own))
    return restiffened(search, replace(it, mind=mind, remembered=design), it.stiffness)


def remembering(search: Search, it: Iterate) -> Iterate:
    """With the structures in mind remembered in the present design, and its shapes of imperfection."""
    if it.mind is None:
        return it
    return replace(minding(search, it, it.accepted[-1].built, {}), window=it.window)


def missed_without(search: Search, it: Iterate, model: StepModel) -> Reals:
    """By what share (c,) of all present cables' the structures in mind would miss more of what they are to
    bear without each of them, to first order: the most that any structure loses when the cable goes slack."""
    assert it.mind is not None
    blocks, present = search.evaluator.blocks, np.flatnonzero(it.point.design.present)
    assert blocks.each_cable is not None  # else nothing is thinned
    rows = model.point.constraints_by_variables[-len(it.mind.scenarios) :, blocks.each_cable][:, present]
    longer = (model.length - it.point.design.rest_length[present]) / blocks.unit[blocks.each_cable][present]
    misses = np.maximum(rows * longer, 0.0).max(axis=0)
    return np.asarray(misses / max(float(misses.sum()), 1e-300))
