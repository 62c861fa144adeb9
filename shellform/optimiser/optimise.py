"""Optimising a gridshell by sequential convex programming (operation 3).

Svanberg's method of moving asymptotes (1987, 2002) replaces a problem by a sequence of convex ones that are
solved exactly. Directly in the rest lengths (moving_asymptotes.py) it finds as good a fit with as few cables
in tension, but knows nothing of what holds the shell up: without its slack cables the design collapses
(documentation/decisions.md). Here each convex problem is the model in tensions (step_model.py), exact in
first order and with Gauss-Newton curvature; interior points and NLopt's MMA solve it within a window round
the present design (proposal.py), and the trial is then evaluated by its true equilibria (trials.py,
descent.py):

- it is accepted where objective and constraints improve; the window grows where the model predicted well and
  shrinks where not;
- a trial whose equilibrium leaves the stable branch is given up at the first lost definiteness and the window
  shrinks;
- under the further loads no mode may become softer than a share of what the softest one has at the start
  under the design load (engineering.py: ModalStiffness): deviations don't see buckling coming, its stiffness
  does, and designs keep away from the end of their branch;
- a start that doesn't bear the further loads climbs first: steps along the gradient of that stiffness carry
  its stable branch up to them;
- where no better design is found cables are kept taut under the further loads (guards.py), and free again in
  turns;
- then, with half of the evaluations at least, cables that the shell can do without are taken away in batches,
  the others kept taut.

Designs that are to stand as built keep more of that stiffness at first, and are judged by drawn structures,
the same for each (trial_structures.py): after the descent, and each time cables have been taken away, before
the others are optimised again: that serves the objective with what makes a design stand. From then on the
stiffness is no limit but a means. A design that falls is asked for more of it, and steps towards that follow,
until it stands; where one with less than was asked for stands, thinning goes on from there. After the descent
the last design that stood is taken instead where that costs less; where the way to more stiffness leads to
none, the structures that fall are kept in mind and lead it (minding.py). Where no design near one that falls
stands, the search goes back to the last one that does, or takes fewer cables away. At the end a fresh sample
judges, for the search has chosen its designs by their luck with the first one; what falls in it leads the
search on until another one agrees (agreeing.py), and only where the evaluations end before it goes back. The
cables that are left keep a tension that errors don't use up.

A limit that the start breaks stops neither: no batch may break it more.

The search ends where the model predicts too little improvement in its largest window, where steps gain next
to nothing, where the smallest window has no better design, or where the evaluations are used up, and thinning
after some single cables in a row that can't go; the status says which it was. At the end the cables without
tension are taken away and the design is loaded along the documented path (settled.py); if it should not bear
all loads there, the last accepted design that does is returned.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from shellform.arrays import Indices
from shellform.errors import InputError, require_count
from shellform.gridshell.gridshell import Design
from shellform.gridshell.grouping import averaged
from shellform.optimiser.minding import as_borne, finely
from shellform.optimiser.moving_asymptotes import MovingAsymptotes, minimise_directly
from shellform.optimiser.optimum import Checkpoint, Optimum, Step, worse
from shellform.optimiser.phases import run
from shellform.optimiser.resuming import resumed
from shellform.optimiser.search_state import (
    Iterate,
    Keep,
    Models,
    Search,
    Watch,
    accepted_design,
    finish,
    record,
    stiff,
)
from shellform.optimiser.solver import POLISHING, SequentialConvex
from shellform.optimiser.trials import reach, staged
from shellform.problem.constraints import Constraint
from shellform.problem.evaluation import Evaluator
from shellform.problem.paths import deviations
from shellform.problem.problem import Problem
from shellform.problem.terms import Bulges, Misfit, Share
from shellform.reliability.demands import demand
from shellform.reliability.guide import stretch_deviation
from shellform.reliability.perfect import perfect
from shellform.reliability.requirements import Demand
from shellform.reliability.safety import Safety
from shellform.reliability.trial_structures import Judging
from shellform.structure.answers.stability import modes
from shellform.structure.elements.threads import dense_on_one
from shellform.structure.network import assemble
from shellform.structure.solve.loading import Loaded

_AGAIN = 0.01  # of the objective, gained by polishing, for which it is begun again from there
_SEED = 1  # added to the safety's: margins of tension are told by structures that judge nothing


def optimise(
    problem: Problem,
    start: Design,
    *,
    solver: SequentialConvex | MovingAsymptotes | None = None,
    evaluations: int = 100,
    safety: Safety | None = None,
    initial: Design | None = None,
    progress: Watch | None = None,
    keep: Keep | None = None,
    judging: Judging | None = None,
    resume: Checkpoint | None = None,
    followed: Mapping[str, Loaded] | None = None,
) -> Optimum:
    """The best design found from `start` within a number of design `evaluations`.

    With `safety` it stands as built under the problem's loads, no less likely than `initial` (None: the
    start), and up to a fifth more evaluations are spent where a fresh sample disagrees with it. With
    MovingAsymptotes for a `solver` it is found by the paper's own method (moving_asymptotes.py), whether it
    stands or not.

    `progress(step)` is called at each trial, `judging(done, most)` while structures of a design are drawn,
    and `keep(checkpoint)` before each trial: with `resume` the same call goes on from there to the same
    result. Who has `followed` the start under the problem's loads (paths.follow) spares doing it again.

    Raises NotConverged where the start doesn't carry the design load, with the paper's advice; InputError
    where it lies outside the variables' bounds, or has no cables and their lengths are to vary.
    """
    require_count(evaluations, where="evaluations", give="a number of designs to try, such as 100")
    solver = solver or SequentialConvex()
    with dense_on_one():
        if isinstance(solver, MovingAsymptotes):
            return minimise_directly(
                problem,
                start,
                solver,
                evaluations=evaluations,
                progress=progress,
                keep=keep,
                resume=resume,
                followed=followed,
            )
        asked, share = None, solver.stiffness
        if safety is not None:
            share = max(share, safety.stiffness)
            built = {name: problem.loads[name] for name in problem.built_under or problem.loads}
            base = problem.design_load.name
            asked = demand(problem.shell, initial or start, built, safety, design_load=base, judging=judging)
        search, it = begin(
            problem,
            start,
            solver,
            lambda softest: share * softest,
            evaluations,
            progress=progress,
            keep=keep,
            asked=asked,
            judging=judging,
            followed=followed,
        )
        if resume is not None:
            search, it = resumed(search, resume)
        return finish(search, run(search, it))


def polish(
    best: Optimum,
    *,
    solver: SequentialConvex = POLISHING,
    evaluations: int = 20,
    groups: Indices | None = None,
    progress: Watch | None = None,
    judging: Judging | None = None,
) -> Optimum:
    """The design of `best` with the cables that it has and the least misfit under the design load, its
    constraints kept; the solver's `stiffness` is a share of what `best` had to keep.

    The L1 term has chosen the cables and pulled on all of them; without it, each kept taut, they serve the
    shape alone. Where a node is farther off than the solver's `deviation`, half of the objective is the
    farthest nodes' (terms.py: Bulges). The objective never rises: where no better design is found, `best`
    comes back. Drawn structures that the search for `best` kept in mind bear what they did, as far as they
    have to, and fresh samples judge that are larger than its own; else what was asked of `best` as built in
    trials is asked of the polished design, and whether it stands as often is left to whoever judges it, but
    where trials know no enlarged errors. Only the cables' lengths are varied, where they are variables of
    their own.

    Where structures are kept in mind and evaluations are left, it is polished again from there, with what
    they bear measured anew, as long as that gains something and brings no node beyond the `deviation`; the
    objective that comes back counts from the start of the last round.

    With `groups` (c,), numbers for all candidates (grouping.py), the cables of a group keep one rest length;
    the misfit then is compared with that of `best` with averaged lengths. Raises NotConverged where that one
    doesn't bear the loads.
    """
    require_count(evaluations, where="evaluations", give="a number of designs to try, such as 20")
    least = solver.stiffness * best.stiffness  # in each round: what one may use up the next may not again
    found = _polished(best, solver, least, evaluations, groups, progress, judging)
    if groups is not None or found.design is best.design:
        return found
    while found.mind and found.objective < worse(found.objective_start, -_AGAIN):
        spent = found.evaluations
        if spent >= evaluations:
            break
        watch = None if progress is None else partial(_tell_later, progress, spent)
        more = _polished(found, solver, least, evaluations - spent, None, watch, judging)
        if more.design is found.design or _farthest(more) > max(_farthest(found), solver.deviation or 0.0):
            break
        history = (*found.history, *(_later(step, spent) for step in more.history))
        found = replace(
            more,
            history=history,
            evaluations=spent + more.evaluations,
            rejected=found.rejected + more.rejected,
            equilibria=found.equilibria + more.equilibria,
            factorisations=found.factorisations + more.factorisations,
            wasted=found.wasted + more.wasted,
        )
    return found


def _later(step: Step, spent: int) -> Step:
    """The step of a round before which so many evaluations were spent."""
    return replace(step, evaluation=step.evaluation + spent)


def _tell_later(watch: Watch, spent: int, step: Step) -> None:
    watch(_later(step, spent))


def _polished(
    best: Optimum,
    solver: SequentialConvex,
    least: float,
    evaluations: int,
    groups: Indices | None,
    progress: Watch | None,
    judging: Judging | None,
) -> Optimum:
    """Polished once; the softest modes keep a stiffness of `least`, N/m."""
    if groups is not None:
        lengths = averaged(best.design.rest_length, groups, best.design.present)
        best = replace(best, design=replace(best.design, rest_length=lengths))
    cables = [block for block in best.problem.variables if block.of_each_cable]
    problem = replace(
        best.problem,
        minimise=_shape(best, solver),
        variables=cables or best.problem.variables,
    )
    surer = None if best.asked is None else best.asked.surer()
    asked = replace(surer, confirmed=None) if surer is not None and surer.trusted else surer
    alike = None if groups is None else np.unique(groups[best.design.present], return_inverse=True)[1]
    with dense_on_one():
        search, it = begin(
            problem,
            best.design,
            solver,
            lambda _: least,
            evaluations,
            progress=progress,
            asked=asked,
            judging=judging,
            followed=best.loaded if groups is None else None,
        )
        models = Models(search.evaluator, solver, search.models.reach, whole=alike is not None)
        search = replace(search, always_guarded=True, groups=alike, models=models)
        every = np.ones_like(it.tensioned)
        it = replace(it, guarded=True, tensioned=every, fallen=best.fallen, rested=best.rested)
        it = as_borne(search, it, best.mind)
        if surer is not None and it.mind is not None:
            search = replace(finely(search, evaluations), asked=surer)
            it = replace(it, window=search.first_window)
        it = run(search, it)
        polished = finish(search, it)
    better = (
        not it.fell
        and polished.objective < polished.objective_start
        and polished.design.present.sum() == best.design.present.sum()
    )
    # of averaged lengths the polished design is at least that one, in its own states
    if better or groups is not None:
        return polished
    return replace(best, status="no design with less misfit was found", history=polished.history)


def _shape(best: Optimum, solver: SequentialConvex) -> list[Share]:
    """What a polished design is to serve: what the objective holds of the shape, and the farthest nodes where
    they are beyond the solver's deviation."""
    base = best.problem.design_load.name
    own = [each for each in best.problem.minimise if each.term.of_shape] or [Share(1.0, Misfit(base))]
    farthest = [] if solver.deviation is None or _farthest(best) <= solver.deviation else [Bulges(base)]
    whole = sum(each.share for each in own) / (0.5 if farthest else 1.0)
    return [Share(each.share / whole, each.term) for each in own] + [Share(0.5, each) for each in farthest]


def _farthest(best: Optimum) -> float:
    """How far, m, the farthest node is off under the design load."""
    problem = best.problem
    return float(deviations(problem.shell, best.states[problem.design_load.name]).max())


def begin(
    problem: Problem,
    start: Design,
    solver: SequentialConvex,
    kept: Callable[[float], float],
    evaluations: int,
    *,
    progress: Watch | None = None,
    keep: Keep | None = None,
    asked: Demand | None = None,
    judging: Judging | None = None,
    followed: Mapping[str, Loaded] | None = None,
) -> tuple[Search, Iterate]:
    """A search of the problem and its first iterate. `kept` gives the stiffness, N/m, that no mode may fall
    below under the further loads, from that of the start's softest mode under the design load; what is
    `asked` of designs as built; what the start is known to come to (`followed`)."""
    began = time.perf_counter()
    if not start.present.any() and any(block.of_each_cable for block in problem.variables):
        raise InputError(
            "has no cable whose length could vary",
            where="start",
            remedy="Begin with cables, as shell.design() has them, or leave RestLengths out of the variables.",
        )
    # Limits on the design load's cable forces are bounds of the model; the others stay constraints.
    bounded = tuple(part for part in problem.constraints if _is_bound(part, problem))
    inner = replace(
        problem, constraints=[part for part in problem.constraints if not _is_bound(part, problem)]
    )
    evaluator = Evaluator(inner, start)
    evaluator.blocks.check_start()
    reached = evaluator.begin(followed)
    used, base = inner.used(), evaluator.base
    state = reached[base].equilibrium.state
    if all(reached[name].on_branch for name in used):
        stage, states = 1.0, {name: reached[name].equilibrium.state for name in used}
    else:
        stage = reach(evaluator, start, state, 0.0, solver.margin)
        states = staged(evaluator, start, state, stage)
    softest = float(modes(evaluator.assembly(start), state, 1).stiffness[0])
    evaluator.problem = stiff(inner, kept(softest))
    stiffness = kept(softest) if len(evaluator.problem.constraints) > len(inner.constraints) else 0.0
    point = evaluator.seed(start, states, stage)
    pull = problem.shell.cables(start).tension(point.states[base])
    mean = float(np.mean(pull)) if len(pull) else 0.0
    search = Search(
        problem=problem,
        solver=solver,
        evaluator=evaluator,
        bounded=bounded,
        evaluations=evaluations,
        tension=mean if mean > 0.0 else 1.0,  # N: what cables that all are slack may be given
        objective_start=point.objective,
        inner=inner,
        softest=softest,
        asked=asked,
        least=_least_tension(problem, start, asked),
        groups=None,
        always_guarded=False,
        progress=progress,
        keep=keep,
        judging=judging,
        began=began,
        models=Models(evaluator, solver, mean),
    )
    it = Iterate(
        point=point,
        accepted=(accepted_design(search, point),),
        history=(record(search, point, stage, True, "climb"),),
        stiffness=stiffness,
        stage=stage,
        window=search.first_window,
        margin=solver.margin,
        guarded=False,
        tensioned=np.zeros(int(start.present.sum()), dtype=bool),
        excess=np.zeros(len(point.constraints)),
    )
    return search, it


def _is_bound(part: Constraint, problem: Problem) -> bool:
    each_cable = any(block.of_each_cable for block in problem.variables)
    return (
        each_cable
        and part.term.of_each_cable
        and part.term.load == problem.design_load.name
        and part.lower == -np.inf
    )


def _least_tension(problem: Problem, start: Design, asked: Demand | None) -> float:
    """N, that a cable keeps so that errors of lengths don't leave it slack: so many deviations as the safety
    asks for of what the median cable is off by, to first order."""
    if asked is None or asked.trial.safety.margin == 0.0 or not start.present.any():
        return 0.0
    shell = problem.shell
    nominal = perfect(shell, start, problem.design_load.force, shapes=0)
    assembly = assemble(nominal.network)
    stretch = stretch_deviation(
        nominal, asked.trial.safety.tolerances, assembly, seed=asked.trial.safety.seed + _SEED
    )
    cables = nominal.network.cables
    return asked.trial.safety.margin * float(np.median(cables.stiffness / cables.rest_length * stretch))
