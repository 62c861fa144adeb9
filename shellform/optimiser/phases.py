"""The phases of a search: rounds of proposal (proposal.py), trial and judgement (search.py).

Climbing, where the start doesn't bear the additional loads; descending, by the objective; thinning, which
takes cables away.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shellform.arrays import Flags, Indices
from shellform.optimiser.optimum import Optimum
from shellform.optimiser.proposal import propose
from shellform.optimiser.search import Search, Track
from shellform.optimiser.tensions import TensionModel
from shellform.optimiser.thinning import kept_stiffness, spared
from shellform.problem.problem import Point

_GROW, _SHRINK = 1.6, 0.4
_GOOD, _POOR = 0.7, 0.3  # true over predicted improvement
_SETTLED = 1e-3  # relative improvement predicted for the largest window that ends the optimisation
_FAILURES = 6  # single cables in a row that can't be taken away, after which thinning ends
_BATCHES = 8  # share of the taut cables that the first batch takes, one in so many
_KEPT = 0.4  # of the stiffness in any direction, at the additional load, that must be left without a batch
_THINNING = 1.5  # of the objective that cables with little use may cost
_IDLE = 0.2  # of the cables in a search that may be slack under all loads before they are left out of it
_REPAIRS = 2  # steps after each batch


def run(search: Search, evaluations: int, *, thin: bool) -> Optimum:
    """First the branch up to the additional loads, then the objective alone, then thinning."""
    search.most = evaluations
    if search.track.phase == "climb":
        _climb(search)
        search.track = replace(search.track, phase="descend")
    if search.track.phase == "descend":
        _descend(search)
        while search.accepted:
            sound = search.sound(search.accepted[-1])
            if sound is not None:
                search.accepted[-1] = search.point = sound
                break
            search.accepted.pop()
        if search.accepted and thin:
            _begin_thinning(search)
    if search.track.phase == "thin":
        _thin(search)
    return search.finish()


def _climb(search: Search) -> None:
    """Steps that stiffen the softest mode under the staged loads, whatever the objective, until the
    additional loads are borne whole.

    Each goes along the gradient of the limits on it, with all cables kept taut; it counts where the stable
    branch reaches farther.
    """
    if search.stage == 1.0 or search.least == 0.0:
        return
    search.guarded = search.climbing = True
    while search.stage < 1.0 and search.left() > 0 and search.window > search.smallest * search.tension:
        search.tell()
        model = search.model()
        y, _ = propose(search.task(model))
        trial = search.attempt(model, y)
        stage = 0.0 if trial is None else search.reach(trial.design, trial.states[search.base], 0.0)
        if trial is None or stage <= search.stage:
            search.window *= _SHRINK
            search.note(trial or search.point, False)
            continue
        search.stage = stage
        search.point = search.evaluator.seed(
            trial.design, search.staged(trial.design, trial.states[search.base], stage), stage
        )
        search.accepted.append(search.point)
        search.note(search.point, True)
    search.window, search.guarded, search.climbing = search.track.first, search.always_guarded, False


def _descend(search: Search) -> None:
    """Rounds of model, trial and judgement: first cables may go slack, and where that leads no further, none
    may; and so in turns as long as a turn improves the objective."""
    track = search.track
    while search.left() > 0:
        search.track = track
        search.tell()
        model = search.model()
        y, predicted = propose(search.task(model))
        settled = _settled(search, predicted)
        if settled:
            search.status = settled
            turned = search.guarded and search.point.objective > (1.0 - _SETTLED) * track.before
            if (
                search.always_guarded or turned or len(search.evaluator.used()) == 1
            ):  # without additional loads there are no guards
                return
            track = replace(track, before=search.point.objective if search.guarded else track.before)
            search.guarded, search.window = not search.guarded, track.first
            continue
        trial = search.attempt(model, y)
        if trial is None or search.merit(trial) >= search.merit(search.point):
            search.window *= _SHRINK
            track = replace(track, refused=True)
            search.note(trial or search.point, False)
            continue
        ratio = (trial.objective - search.point.objective) / min(predicted, -1e-300)
        grown = 1.0 if track.refused else _GROW  # a window that was just refused isn't tried again at once
        search.window *= grown if ratio > _GOOD else (_SHRINK if ratio < _POOR else 1.0)
        track = replace(track, refused=False)
        search.accept(trial)


def _settled(search: Search, predicted: float) -> str:
    """The criterion of convergence that the point meets, in words; empty where none is met."""
    if search.stage < 1.0 or search.violation(search.point) > 0.0:
        return ""
    if -predicted < _SETTLED * search.point.objective and search.window >= search.tension:
        return f"the model predicts less than {_SETTLED:.1%} improvement"
    if search.window < search.smallest * search.tension:
        return "the objective has no better design within the smallest window"
    return ""


def _begin_thinning(search: Search) -> None:
    search.window = max(search.window, 0.1 * search.tension)
    search.guarded = True
    search.track = replace(
        search.track,
        phase="thin",
        thrifty=_THINNING * search.point.objective,
        batch=max(1, search.taut(search.point) // _BATCHES),
        needed=np.zeros(len(search.braces), dtype=bool),
    )


def _thin(search: Search) -> None:
    """Takes away cables that the shell can spare (thinning.py), in batches, and lets the others make up for
    them.

    Those left are kept taut while their tensions are optimised again. A batch that the shell doesn't bear, or
    that costs too much of the objective, is cut; a single cable that can't go is kept for good.
    """
    track = search.track
    while track.failures < _FAILURES and search.left() > 0:
        search.track = _without_slack(search, track)
        track = search.track
        search.tell()
        over = search.most_cables is not None and search.taut(search.point) > search.most_cables
        budget = np.inf if over else track.thrifty
        model = search.model()
        leaving = _spared(search, model, track.needed, track.batch)
        if not len(leaving):
            search.status += ", and every cable that is left is needed for stability"
            return
        search.braces = model.origin[: len(search.braces)] > 0.0
        search.braces[leaving] = False
        trial = search.attempt_without(model, leaving)
        if (
            trial is not None and trial.objective < 2.0 * budget
        ):  # limits that it breaks are the repair's business
            trial = _repair(search, trial, budget)
        fits = trial is not None and search.merit(trial) <= budget and search.violation(trial) <= 0.0
        sound = search.sound(trial) if trial is not None and fits else None
        if sound is None:
            search.note(trial or search.point, False)
            alone = len(leaving) == 1
            needed = track.needed.copy()
            needed[leaving] = alone
            track = replace(
                track, needed=needed, failures=track.failures + alone, batch=max(1, len(leaving) // 3)
            )
            continue
        search.accept(sound)
        track = replace(track, failures=0, batch=int(1.3 * track.batch) + 1)
    done = track.failures >= _FAILURES
    search.status += (
        ", and no further cable can be taken away"
        if done
        else ", and thinning ended with the last evaluation"
    )
    if search.most_cables is not None and search.taut(search.point) > search.most_cables:
        search.status += f"; no design with {search.most_cables} cables was found that keeps every limit"


def _without_slack(search: Search, track: Track) -> Track:
    """Leaves cables out of the search that are slack under all loads, once they are many: a model solves for
    every cable in it.
    """
    design, cables = search.point.design, search.problem.shell.cables(search.point.design)
    pulls = np.array([cables.tension(state) for state in search.point.states.values()])
    kept = (pulls > 0.0).any(axis=0)
    if kept.mean() > 1.0 - _IDLE:
        return track
    present = design.present.copy()
    present[np.flatnonzero(present)[~kept]] = False
    search.evaluator.start = replace(search.evaluator.start, present=present)
    search.braces = search.braces[kept]
    search.point = search.evaluator.seed(replace(design, present=present), search.point.states, search.stage)
    search.accepted[-1] = search.point
    return replace(track, needed=track.needed[kept])


def _repair(search: Search, point: Point, budget: float) -> Point:
    """A few steps with the cables that are left, none of which may go slack."""
    before, search.point = search.point, point
    for _ in range(min(_REPAIRS, search.left())):
        model = search.model()
        y, _ = propose(search.task(model))
        trial = search.attempt(model, y)
        if trial is None or search.merit(trial) >= search.merit(search.point):
            search.window *= _SHRINK
        else:
            search.window *= _GROW
            search.point = trial
    search.window = float(np.clip(search.window, 0.05 * search.tension, search.tension))
    best, search.point = search.point, before
    return best


def _spared(search: Search, model: TensionModel, needed: Flags, most: int) -> Indices:
    """Taut cables, numbered among those present, that can go at once, from the one with the least use."""
    state = search.point.states[search.evaluator.used()[-1]]
    kept = kept_stiffness(model.assembly, state, search.problem.shell.cables(search.point.design))
    loss = 1.0 - np.diag(kept)
    pull = model.origin[: len(loss)]
    score = loss / loss.sum() + pull / pull.sum()
    free = np.flatnonzero((pull > 0.0) & ~needed)
    return spared(kept, free[np.argsort(score[free], kind="stable")], most, _KEPT)
