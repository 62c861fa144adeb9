"""A search's dealings with true equilibria: trials, the documented path of a design, and stages of further
loads that a design doesn't bear whole.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from shellform.arrays import Indices, Reals
from shellform.gridshell.gridshell import Design
from shellform.gridshell.grouping import averaged
from shellform.optimiser.optimum import worse
from shellform.optimiser.proposal import Task
from shellform.optimiser.search_state import (
    Accepted,
    Iterate,
    Search,
    accepted_design,
    in_mind,
    noted,
    violation,
)
from shellform.optimiser.step_model import StepModel
from shellform.problem.evaluation import Evaluated, Evaluator, OffBranch
from shellform.problem.paths import follow
from shellform.reliability.loaded_states import loaded_states
from shellform.reliability.requirements import FRESH, Required
from shellform.reliability.trial_structures import JudgedTrial, confirm, judge_trial
from shellform.structure.elements.state import State
from shellform.structure.solve.loading import SMALLEST, apply_load

_ELSEWHERE = 0.1  # of the objective: a design that is worse by more has come to another equilibrium
_SAME = 1e-6  # relative: violations in two states of one equilibrium
_COARSE = 0.5  # the first load step of a search for the end of a branch


def task(search: Search, it: Iterate, model: StepModel, *, reviving: bool = True) -> Task:
    """What the next step is asked for, in which cables that don't pull may come back (`reviving`)."""
    return Task(
        solver=search.solver,
        model=model,
        window=it.window,
        tension=search.tension,
        bounded=search.bounded,
        tensioned=it.tensioned,
        guards=search.models.guards(it.point) if it.guarded else [],
        climbing=it.climbing,
        groups=search.groups,
        excess=it.excess * it.window**2,
        least=max(search.least if it.phase == "thin" else 0.0, search.solver.least_tension * search.tension),
        aims=in_mind(search),
        reviving=reviving,
    )


def attempt(search: Search, it: Iterate, model: StepModel, y: Reals) -> tuple[Evaluated | None, Iterate]:
    """The design at the model's `y` (y,), None where an equilibrium leaves the stable branch; and the
    iterate with what the trial shows of the constraints' curvature."""
    evaluator = search.evaluator
    design = model.design(y)
    if search.groups is not None:
        rest = design.rest_length.copy()
        every = np.ones(len(search.groups), dtype=bool)
        rest[design.present] = averaged(rest[design.present], search.groups, every)
        design = replace(design, rest_length=rest)
    near = {**evaluator.predicted(it.point, design, but=search.base), search.base: model.predicted(y)}
    trial = _on_branch(search, it, design, near, lead=_leads(it))
    if trial is None:
        return None, it
    above = np.maximum(trial.constraints - model.constraints_at(y), 0.0) / it.window**2
    return trial, replace(it, excess=np.where(trial.constraints > -search.solver.near, above, 0.0))


def attempt_without(search: Search, it: Iterate, model: StepModel, leaving: Indices) -> Evaluated | None:
    """The design without the cables `leaving`, the others at the rest lengths that they have: the
    shell moves less than at their tensions. None where it leaves the stable branch."""
    design = it.point.design
    rest = design.rest_length.copy()
    rest[np.flatnonzero(design.present)[leaving]] = model.longest[leaving]
    return _on_branch(search, it, replace(design, rest_length=rest), it.point.states, lead=_leads(it))


def attempt_towards(search: Search, it: Iterate, other: Design, share: float) -> Evaluated | None:
    """The design a `share` of the straight way from the point's to the `other` one, of the same cables. None
    where it leaves the stable branch."""
    own = it.point.design
    rest = own.rest_length + share * (other.rest_length - own.rest_length)
    radius = own.radius + share * (other.radius - own.radius)
    design = replace(own, rest_length=rest, radius=radius)
    return _on_branch(search, it, design, search.evaluator.predicted(it.point, design))


def _leads(it: Iterate) -> bool:
    """Whether trials are led to further loads that Newton's method doesn't find from what is predicted: in
    thinning, whose batches change much, and in descents without guards; not in steps as small as structures
    in mind ask for."""
    return it.mind is None and (it.phase == "thin" or not it.guarded)


def _on_branch(
    search: Search, it: Iterate, design: Design, near: Mapping[str, State], *, lead: bool = False
) -> Evaluated | None:
    """The design, rounded as it would be built, in the equilibria next to the states `near` it, or to which
    the further loads `lead` (Evaluator); None where one of them leaves the stable branch."""
    evaluator = search.evaluator
    try:
        return evaluator.evaluate(evaluator.rounded(design), near, it.stage, lead=lead)
    except OffBranch:
        return None


def sound(search: Search, before: Accepted) -> Evaluated | None:
    """The same design in the states to which the documented path leads, without its slack cables; None where
    it doesn't bear all loads there, breaks a constraint, or is worse than it was: of two equilibria side by
    side, a search from design to design may have come to the other one."""
    evaluator, problem = search.evaluator, search.problem
    states, spent = loaded_states(problem.shell, before.built, problem.loads)
    evaluator.factorisations += spent
    if states is None:
        loaded = follow(problem.shell, before.built, problem.loads, stay=True)
        evaluator.factorisations += sum(each.factorisations for each in loaded.values())
        if not all(each.on_branch for each in loaded.values()):
            return None
        states = {name: each.equilibrium.state for name, each in loaded.items()}
    try:
        found = evaluator.seed(before.design, {name: states[name] for name in evaluator.problem.used()}, 1.0)
    except OffBranch:
        return None
    kept = violation(search, found) <= worse(max(before.violation, 0.0), _SAME)
    return found if kept and found.objective <= worse(before.objective, _ELSEWHERE) else None


def standing(search: Search, it: Iterate, built: Design) -> tuple[bool, Iterate]:
    """Whether the design stands as built, and the iterate that knows which structures fell, and if it does,
    where the others rest."""
    if search.asked is None:
        return True, it
    found = judge_trial(
        search.problem.shell,
        built,
        search.asked.trial,
        first=it.fallen,
        judging=search.judging,
        before=it.rested,
    )
    search.evaluator.factorisations += found.factorisations
    fallen = [number for own in found.fallen.values() for number in own]
    fallen = list(dict.fromkeys([*fallen, *it.fallen]))
    rested = found.rested if found.stands else it.rested
    return found.stands, replace(it, fallen=tuple(fallen), fell=not found.stands, rested=rested)


def fresh(search: Search, it: Iterate) -> tuple[JudgedTrial, Iterate]:
    """What a whole fresh sample says of the last accepted design, beside structures of earlier ones that
    fell; and the iterate that knows those that fell under the design load, by which it is judged from now
    on."""
    assert search.asked is not None
    asked, built = search.asked.sample(it.samples), it.accepted[-1].built
    earlier = [number for number in it.fallen if number >= FRESH]
    found = confirm(search.problem.shell, built, asked, first=earlier, whole=True, judging=search.judging)
    search.evaluator.factorisations += found.factorisations
    under = found.fallen[asked.design_load]
    return found, replace(it, samples=it.samples + 1, fallen=tuple(dict.fromkeys([*under, *it.fallen])))


def confirmed(search: Search, asked: Required, built: Design, first: Sequence[int]) -> JudgedTrial:
    """Whether a fresh sample agrees that the design stands as built, as it is `asked`, its structures of the
    numbers `first` before the others."""
    found = confirm(search.problem.shell, built, asked, first=first, judging=search.judging)
    search.evaluator.factorisations += found.factorisations
    return found


def accepted(search: Search, it: Iterate, trial: Evaluated) -> Iterate:
    """Goes on from `trial`, as near to the whole further loads as its stable branch allows."""
    it = _raised(search, replace(it, point=trial))
    return noted(
        search, replace(it, accepted=(*it.accepted, accepted_design(search, it.point))), it.point, True
    )


def _raised(search: Search, it: Iterate) -> Iterate:
    if it.stage == 1.0:
        return it
    evaluator, design, state = search.evaluator, it.point.design, it.point.states[search.base]
    stage = reach(evaluator, design, state, it.stage, it.margin)
    if stage <= it.stage:
        # Far from the end of its branch a design feels no constraint on its softest mode, and nothing drives
        # it on: go nearer.
        return replace(it, margin=max(0.5 * it.margin, search.solver.least_margin))
    point = evaluator.seed(design, staged(evaluator, design, state, stage), stage)
    return replace(it, stage=stage, point=point)


def reach(
    evaluator: Evaluator,
    design: Design,
    state: State,
    least: float,
    margin: float,
    smallest: float = SMALLEST,
) -> float:
    """The stage to which the design's stable branch under the further loads allows to go, `margin` before
    its end, found in load steps of `smallest` at last, and not below `least`."""
    stages = []
    for name in evaluator.problem.used():
        if name != evaluator.base:
            before, after = evaluator.load(evaluator.base, 1.0), evaluator.problem.loads[name]
            loaded = apply_load(
                evaluator.assembly(design),
                state,
                before,
                after,
                step=_COARSE,
                smallest=min(smallest, margin),
                stay=True,
            )
            evaluator.factorisations += loaded.factorisations
            stages.append(1.0 if loaded.on_branch else max(least, loaded.share - margin))
    return min(stages, default=1.0)


def staged(evaluator: Evaluator, design: Design, state: State, stage: float) -> dict[str, State]:
    """The states of all load cases at a stage, reached step by step from the design load's."""
    states = {evaluator.base: state}
    for name in evaluator.problem.used():
        if name != evaluator.base:
            before, after = evaluator.load(evaluator.base, 1.0), evaluator.load(name, stage)
            loaded = apply_load(evaluator.assembly(design), state, before, after)
            evaluator.factorisations += loaded.factorisations
            states[name] = loaded.equilibrium.state
    return states
