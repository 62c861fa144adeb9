"""The phases of a search in their order, each from an iterate to an iterate.

Climbing, where the start doesn't bear the further loads, and descending, by the objective (descent.py); being
led by structures that fall (minding.py); thinning, which takes cables away, here; agreeing, with fresh
samples of structures as built (agreeing.py).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shellform.arrays import Flags, Indices
from shellform.gridshell.grouping import patches
from shellform.optimiser.agreeing import agreed, leaving_some, pausing
from shellform.optimiser.descent import climb, descend
from shellform.optimiser.going_back import last_confirmed, last_sound, last_standing
from shellform.optimiser.minding import (
    add_fallen,
    lead,
    looking_closer,
    missed_without,
    ready_to_lead,
    remembering,
)
from shellform.optimiser.optimum import worse
from shellform.optimiser.proposal import propose
from shellform.optimiser.resuming import tell
from shellform.optimiser.search_state import (
    Iterate,
    Search,
    accepted_design,
    aimed,
    merit,
    noted,
    restiffened,
    stiffness_of,
    taut_count,
    violation,
)
from shellform.optimiser.step_model import StepModel
from shellform.optimiser.thinning import Budget, allowed, evenly, kept_stiffness, removable
from shellform.optimiser.trials import (
    accepted,
    attempt,
    attempt_without,
    sound,
    standing,
    task,
)
from shellform.problem.evaluation import Evaluated

_STIFFER = 0.01  # of the stiffness: less is no gain
_SAME = 1e-6  # relative: stiffnesses that count as equal


def run(search: Search, it: Iterate) -> Iterate:
    """First the branch up to the further loads, then the objective alone, then thinning, then what fresh
    samples say."""
    if it.phase == "climb":
        it = replace(climb(search, it), phase="descend")
    if it.phase == "descend":
        thins = search.solver.thin and search.evaluator.blocks.each_cable is not None
        it = last_sound(search, descend(search, it, least=search.evaluations // 2 if thins else 0))
        if thins:
            it = _stiffened(search, it) if it.accepted else last_standing(search, it)
        elif it.mind is not None:  # judged by what it was led by, trials would say nothing new
            it = replace(it, phase="agree")
        else:
            it = last_standing(search, it)
    if it.phase == "lead":
        it = _led(looking_closer(search), it)
    while it.phase in ("thin", "agree"):
        if it.phase == "thin":
            it = _thin(leaving_some(search if it.mind is None else looking_closer(search)), it)
            it = replace(it, phase="agree", until=0, stood=0, led_to=np.inf)
        agrees, it = agreed(search, it)
        if agrees and not it.paused:
            return it
        if not agrees:
            break
        it = _going_on(search, it)
    return last_confirmed(search, it)


def _stiffened(search: Search, it: Iterate) -> Iterate:
    """Ready to thin at a design with as much stiffness as makes it stand as built, since the objective alone
    leaves no more than it has to; or at the last one that stands, with what it has, where that is better or
    there is no other near it."""
    begun = _ready_to_thin(search, it)
    if search.asked is None:
        return begun
    tensioned = replace(begun, tensioned=_tensioned(search, it))
    found, other = _made_to_stand(search, tensioned, it.point, Budget())
    if found is not None and found.objective <= it.point.objective:
        return _ready_to_thin(search, accepted(search, other, found))
    fell = it.accepted[-1].built
    it = last_standing(search, replace(it, fallen=other.fallen))
    if found is not None:  # the way to more stiffness, or the way back: which costs less
        budget = found.objective + search.solver.allowance
        if it.accepted and it.point.objective < budget and violation(search, it.point) <= 0.0:
            return _ready_as_it_is(search, it)
        return _ready_to_thin(search, accepted(search, other, found))
    leading = ready_to_lead(search, it, fell) if it.accepted else None
    return leading or _ready_as_it_is(search, it)


def _led(search: Search, it: Iterate) -> Iterate:
    """Ready to thin at a design to which drawn structures have led; where they lead to none, at the last one
    that stood."""
    it = lead(search, it)
    return _ready_as_it_is(search, it) if it.mind is None else _ready_to_thin(search, it)


def _ready_as_it_is(search: Search, it: Iterate) -> Iterate:
    """Ready to thin, with the stiffness that the design has."""
    return _ready_to_thin(search, _aiming_for(search, it, max(it.stiffness, stiffness_of(search, it.point))))


def _made_to_stand(
    search: Search, it: Iterate, trial: Evaluated, budget: Budget
) -> tuple[Evaluated | None, Iterate]:
    """The trial where it breaks no limit more than the iterate does and stands as built; where it only
    falls, one near it, for which more stiffness is asked, and repaired for, until it stands. None, and the
    iterate with the stiffness that it kept, where it comes to nothing within the `budget`.

    Where designs are judged as built, the stiffness to keep is no limit but what repairs aim for: it comes
    down to what a trial that stands has, and not below the solver's own.
    """
    solver, begun = search.solver, it
    for more in reversed(range(solver.stiffenings + 1)):
        if not budget.covers(search, trial):
            break
        trial, it = _aiming_lower(search, it, trial)
        if violation(search, trial) > max(violation(search, begun.point), 0.0):
            break
        found = sound(search, accepted_design(search, trial))
        if found is None:
            break
        holds, it = standing(search, it, accepted_design(search, found).built)
        if holds:
            return found, it
        before = stiffness_of(search, found)
        if not more or before <= 0.0 or search.left() <= 0:
            break
        if it.mind is not None:
            it = add_fallen(search, replace(it, point=found), accepted_design(search, found).built)
            trial, it = _repaired(search, it, it.point)
            continue
        it = restiffened(search, replace(it, point=found), solver.stiffer * before)
        trial, it = _repaired(search, it, it.point)
        if stiffness_of(search, trial) < (1.0 + _STIFFER) * before:
            break
    search.evaluator.problem = aimed(search.inner, begun.stiffness, begun.mind)
    return None, replace(begun, fallen=it.fallen, fell=it.fell)


def _aiming_lower(search: Search, it: Iterate, trial: Evaluated) -> tuple[Evaluated, Iterate]:
    """With no more stiffness to keep than the trial has, where it is judged as built."""
    lower = _aiming_for(search, replace(it, point=trial), min(it.stiffness, stiffness_of(search, trial)))
    return lower.point, lower


def _aiming_for(search: Search, it: Iterate, stiffness: float) -> Iterate:
    """With another stiffness to keep, N/m, not below the solver's own, where designs are judged as built."""
    aim = max(stiffness, search.solver.stiffness * search.softest)
    if search.asked is None or it.stiffness <= 0.0 or abs(aim - it.stiffness) <= _SAME * it.stiffness:
        return it
    return replace(restiffened(search, it, aim), window=it.window)


def _tensioned(search: Search, it: Iterate) -> Flags:
    """Which of the present cables (c,) pull under the design load."""
    return np.asarray(search.models.at(it.point).origin[: len(it.tensioned)] > 0.0)


def _ready_to_thin(search: Search, it: Iterate) -> Iterate:
    ready = _going_on(search, it)
    return replace(
        ready,
        thrifty=it.point.objective + search.solver.allowance,
        batch=max(1, ready.counted // search.solver.batch),
        needed=np.zeros(len(it.tensioned), dtype=bool),
    )


def _going_on(search: Search, it: Iterate) -> Iterate:
    """Ready to thin on, as after a pause, with what is left of the objective that may be spent."""
    return replace(
        it,
        window=max(it.window, 0.1 * search.tension),
        guarded=True,
        phase="thin",
        paused=False,
        counted=taut_count(search, it.point),
    )


def _thin(search: Search, it: Iterate) -> Iterate:
    """Takes away cables that the shell can do without (thinning.py), in batches, and lets the others make up
    for them.

    Those left are kept taut while their tensions are optimised again; where designs are judged as built only
    if it takes that to keep the limits. Those that went come back only where more stiffness is asked for or
    structures lead: else they would for a better shape than is asked for. A batch that the shell doesn't
    bear, that breaks a limit more than before, or that costs too much of the objective, is cut; a single
    cable that can't go is kept for good.
    """
    solver = search.solver
    most = solver.most_cables
    while it.failures < solver.failures and search.left() > 0:
        if pausing(search, it):
            return replace(it, paused=True)
        it = _without_slack(search, it)
        tell(search, it)
        over = most is not None and taut_count(search, it.point) > most
        budget = Budget(np.inf if over else it.thrifty, allowed(search, it))
        model = search.models.at(it.point)
        leaving = _leaving(search, it, model)
        if not len(leaving):
            some = taut_count(search, it.point) > 0
            rest = "every cable that is left is needed for stability" if some else "no cable is left"
            return replace(it, status=f"{it.status}, and {rest}")
        tensioned = _tensioned(search, it)
        tensioned[leaving] = False
        it = replace(it, tensioned=tensioned, fell=False)
        trial, found = attempt_without(search, it, model, leaving), None
        if search.asked is not None and trial is not None:
            found, it = _made_to_stand(search, it, trial, budget)
        # constraints that it breaks are the repair's business; but repairs serve the objective too, with what
        # made a design stand
        if found is None and not it.fell and trial is not None:
            if trial.objective < worse(budget.objective, 1.0):
                trial, it = _repaired(search, it, trial, reviving=it.mind is not None)
            found, it = _made_to_stand(search, it, trial, budget)
        if found is None:
            it = noted(search, it, trial or it.point, False)
            alone = len(leaving) == 1
            needed = it.needed.copy()
            needed[leaving] = alone
            it = replace(it, needed=needed, failures=it.failures + alone, batch=max(1, len(leaving) // 3))
            if it.fell and it.mind is None:  # a repair mayn't spend what made the present design stand
                it = _aiming_for(search, it, stiffness_of(search, it.point))
            continue
        it = accepted(search, it, found)
        it = replace(it, failures=0, batch=int(1.3 * it.batch) + 1)
        if it.mind is None:
            it = _aiming_for(search, it, solver.softer * stiffness_of(search, it.point))
        else:
            it = remembering(search, it)
    status = it.status + (
        ", and no further cable can be taken away"
        if it.failures >= solver.failures
        else ", and thinning ended with its last evaluation"
    )
    if most is not None and taut_count(search, it.point) > most:
        status += f"; no design with {most} cables was found that keeps every limit"
    return replace(it, status=status)


def _without_slack(search: Search, it: Iterate) -> Iterate:
    """Leaves cables out of the search that are slack under all loads, once they are many: a model solves for
    every cable in it.
    """
    design, cables = it.point.design, search.problem.shell.cables(it.point.design)
    pulls = np.array([cables.tension(state) for state in it.point.states.values()])
    kept = (pulls > 0.0).any(axis=0)
    if kept.mean() > 1.0 - search.solver.idle:
        return it
    present = design.present.copy()
    present[np.flatnonzero(present)[~kept]] = False
    point = search.evaluator.seed(replace(design, present=present), it.point.states, it.stage)
    return replace(
        it,
        point=point,
        accepted=(*it.accepted[:-1], accepted_design(search, point)),
        tensioned=it.tensioned[kept],
        needed=it.needed[kept],
    )


def _repaired(
    search: Search, it: Iterate, trial: Evaluated, *, reviving: bool = True
) -> tuple[Evaluated, Iterate]:
    """A few steps from the trial with the cables that are left, none of which may go slack, and those that
    went where they may come back (`reviving`); and the iterate with the window and the curvature that they
    found. What a step costs is no reason to refuse it: the first one after more stiffness is asked for costs
    much, which the next one gets back."""
    solver, point = search.solver, it.point
    it = replace(it, point=trial)
    for _ in range(min(solver.repairs, search.left())):
        model = search.models.at(it.point)
        y, _ = propose(task(search, it, model, reviving=reviving))
        better, it = attempt(search, it, model, y)
        if better is None or merit(search, better) >= merit(search, it.point):
            it = replace(it, window=it.window * solver.shrink)
        else:
            it = replace(it, window=it.window * solver.grow, point=better)
    window = float(np.clip(it.window, 0.05 * search.tension, search.tension))
    return it.point, replace(it, point=point, window=window)


def _leaving(search: Search, it: Iterate, model: StepModel) -> Indices:
    """Taut cables, numbered among those present, that can go at once, from the one with the least use; of
    many evenly all over the shell."""
    solver, shell, design = search.solver, search.problem.shell, it.point.design
    state = it.point.states[search.evaluator.problem.decisive_load()]
    pull = model.origin[: model.tensions]
    some, most = np.arange(len(pull)), min(it.batch, solver.largest)
    patch = some  # of few each is one for itself
    if len(pull) > solver.many:
        patch = patches(shell)[design.present]
        free = np.flatnonzero((pull > 0.0) & ~it.needed)
        share = pull[free] / pull[free].sum()
        some = np.sort(free[evenly(share, share, patch[free])[: max(solver.candidates, most)]])
    kept = kept_stiffness(model.assembly, state, shell.cables(design), some)
    loss = 1.0 - np.diag(kept)
    share = pull[some] / pull[some].sum()
    use = loss / loss.sum() + share
    if it.mind is not None:
        use += missed_without(search, it, model)[some]
    free = np.flatnonzero((share > 0.0) & ~it.needed[some])
    order = evenly(use[free], share[free], patch[some[free]])
    return some[removable(kept, free[order], most, solver.kept)]
