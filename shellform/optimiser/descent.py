"""Steps of a search, from an iterate to an iterate: rounds of proposal (proposal.py), trial (trials.py) and
judgement (search_state.py).

A descent takes the steps that the objective asks for, within the limits. A climb comes before it where the
start doesn't bear the further loads, and takes those that stiffen its softest mode.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shellform.arrays import Reals
from shellform.optimiser.going_back import within_limits
from shellform.optimiser.optimum import worse
from shellform.optimiser.proposal import propose
from shellform.optimiser.resuming import tell
from shellform.optimiser.search_state import (
    Iterate,
    Search,
    accepted_design,
    merit,
    missed,
    noted,
    violation,
)
from shellform.optimiser.step_model import StepModel
from shellform.optimiser.trials import accepted, attempt, attempt_towards, reach, staged, task
from shellform.problem.problem import FEASIBLE

_TINY = -1e-300  # a predicted change that isn't one
# of the objective, gained since cables were last let go slack, for which they are let again where thinning is
# to end with what stands
_WORTH_LETTING_GO = 0.05
_IDLE = 2  # accepted steps in a row that gain next to nothing, after which thinning makes more of the rest
_BACK = 1 / 16, 1 / 4  # of the way to a design that keeps every limit, by which one goes back that breaks one


def climb(search: Search, it: Iterate) -> Iterate:
    """Steps that stiffen the softest mode under the staged loads, whatever the objective, until the
    further loads are borne whole.

    Each goes along the gradient of the constraints on it, with all cables kept taut; it counts where the
    stable branch reaches farther.
    """
    if it.stage == 1.0 or not any(part.term.stabilises for part in search.evaluator.problem.constraints):
        return it
    evaluator, base = search.evaluator, search.base
    it = replace(it, guarded=True, climbing=True)
    while it.stage < 1.0 and search.left() > 0 and it.window > search.solver.smallest * search.tension:
        tell(search, it)
        model = search.models.at(it.point)
        y, _ = propose(task(search, it, model))
        trial, it = attempt(search, it, model, y)
        stage = 0.0 if trial is None else reach(evaluator, trial.design, trial.states[base], 0.0, it.margin)
        if trial is None or stage <= it.stage:
            it = replace(it, window=it.window * search.solver.shrink)
            it = noted(search, it, trial or it.point, False)
            continue
        states = staged(evaluator, trial.design, trial.states[base], stage)
        point = evaluator.seed(trial.design, states, stage)
        it = replace(it, stage=stage, point=point, accepted=(*it.accepted, accepted_design(search, point)))
        it = noted(search, it, point, True)
    return replace(it, window=search.first_window, guarded=search.always_guarded, climbing=False)


def descend(search: Search, it: Iterate, *, least: int = 0) -> Iterate:
    """Rounds of model, trial and judgement: first cables may go slack, and where that leads no further, none
    may; and so on as long as both together improve the objective. A design that keeps every limit leaves the
    `least` of the evaluations to what comes next, and is where it ends, where there is one."""
    return within_limits(search, _brought_within(search, _rounds(search, it, least)))


def _brought_within(search: Search, it: Iterate) -> Iterate:
    """Where rounds have ended with a design that breaks a limit: a little back along the straight way to the
    last accepted one that keeps all of them, in one or two evaluations more, rather than all the way. The
    same iterate where that leads to none that keeps them and is better than that one."""
    if violation(search, it.point) <= 0.0:
        return it
    kept = next((each for each in reversed(it.accepted) if each.violation <= 0.0), None)
    if kept is None or not np.array_equal(kept.design.present, it.point.design.present):
        return it
    for share in _BACK:
        trial = attempt_towards(search, it, kept.design, share)
        if trial is not None and violation(search, trial) <= 0.0 and trial.objective < kept.objective:
            status = it.status and f"{it.status}; a little before that one, within its limits"
            return accepted(search, replace(it, status=status), trial)
        it = noted(search, it, trial or it.point, False)
    return it


def _rounds(search: Search, it: Iterate, least: int) -> Iterate:
    solver = search.solver
    while search.left() > (least if it.stage == 1.0 and violation(search, it.point) <= 0.0 else 0):
        tell(search, it)
        model = search.models.at(it.point)
        y, predicted = propose(task(search, it, model))
        status = _settled(search, replace(it, excess=_binding(it, model, y)), predicted)
        if status:
            it = replace(it, status=status)
            worth = solver.settled if search.asked is None else _WORTH_LETTING_GO
            gained_little = it.guarded and it.point.objective > worse(it.before, -worth)
            # guarded it would try the same again
            in_vain = not it.guarded and it.point.objective > worse(it.before, -solver.settled)
            # without further loads there are no guards
            if search.always_guarded or gained_little or in_vain or len(search.evaluator.problem.used()) == 1:
                return it
            before = it.point.objective if it.guarded else it.before
            it = replace(it, before=before, guarded=not it.guarded, window=search.first_window, idle=0)
            continue
        trial, it = attempt(search, it, model, y)
        if trial is None or merit(search, trial) >= merit(search, it.point):
            it = replace(it, window=it.window * solver.shrink, refused=True)
            it = noted(search, it, trial or it.point, False)
            continue
        ratio = (trial.objective - it.point.objective) / min(predicted, _TINY)
        grown = 1.0 if it.refused else solver.grow  # a window that was just refused isn't tried again at once
        factor = grown if ratio > solver.good else (solver.shrink if ratio < solver.poor else 1.0)
        gained = trial.objective < worse(it.point.objective, -solver.settled)
        idle = it.idle + 1 if least and not gained and violation(search, trial) <= 0.0 else 0
        it = accepted(search, replace(it, window=it.window * factor, refused=False, idle=idle), trial)
    return it


def _binding(it: Iterate, model: StepModel, y: Reals) -> Reals:
    """The excess (k,) of those constraints alone that hold the step to y (y,) back by it."""
    if not it.excess.any():
        return it.excess
    kept_off = it.excess * it.window**2
    return np.where(model.constraints_at(y) + kept_off > -FEASIBLE, it.excess, 0.0)


def _settled(search: Search, it: Iterate, predicted: float) -> str:
    """The criterion of convergence that the point meets, in words; empty where none is met. A window times as
    large gains so many times what is `predicted` for this one at the most, for the model is convex; but where
    constraints are held at a distance for their curvature a smaller one may gain more."""
    solver = search.solver
    if it.stage < 1.0:
        return ""
    kept = violation(search, it.point) <= 0.0
    largest = max(search.tension / it.window, 1.0)
    borne = kept and missed(search, it.point) <= 0.0  # else steps are for what structures are to bear
    bounded = it.window >= search.tension or not it.excess.any()
    if borne and bounded and -predicted * largest < solver.settled * abs(it.point.objective):
        return f"the model predicts less than {solver.settled:.1%} improvement"
    if kept and it.idle >= _IDLE:
        return f"{_IDLE} steps in a row improved it by less than {solver.settled:.1%} each"
    if it.window < solver.smallest * search.tension:
        return (
            "the objective has no better design within the smallest window"
            if kept
            else "no design within the smallest window breaks its limits less"
        )
    return ""
