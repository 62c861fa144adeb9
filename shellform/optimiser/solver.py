"""Optimising a gridshell with the method of moving asymptotes (operation 3; Svanberg 1987, 2002).

MMA replaces the problem by a sequence of convex ones that are solved exactly. Its own separable approximation
knows nothing of how cables work together, and in the rest lengths it is kinked where a cable goes slack: on a
prestressed gridshell its first trials snap the shell through and its later ones hardly move (README, "What
was tried"). Here each convex problem is the model in tensions (tensions.py), exact in first order and with
the misfit's Gauss-Newton curvature; NLopt's MMA solves it within a window round the present design
(proposal.py), and the trial is then evaluated by its true equilibria (search.py, phases.py):

- it is accepted where objective and constraints improve; the window grows where the model predicted well and shrinks where not;
- a trial whose equilibrium leaves the stable branch is given up at the first lost definiteness and the window shrinks;
- under the additional loads no mode may become softer than a share of what the softest one has at the start under the first load
  (checks.py: Softness): deviations don't see buckling coming, its stiffness does, and designs keep away from the end of their branch;
- a start that doesn't bear the additional loads climbs first: steps along the gradient of that stiffness carry its stable branch up to them;
- where no better design is found cables are kept taut under the additional loads (guard.py), and free again in turns;
- then cables that the shell can spare are taken away in batches, the others kept taut.

The search ends where the model predicts less than 0.1 % improvement in its largest window, where the smallest
window has no better design, or where the evaluations are used up, and thinning after six single cables in a
row that can't go; the status says which it was. At the end the cables without tension are taken away and the
design is loaded along the documented path (loading.py); if it should not bear all loads there, the last
accepted design that does is returned.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shellform.arrays import Indices
from shellform.gridshell.gridshell import Design
from shellform.gridshell.grouping import averaged
from shellform.optimiser.convex import minimise
from shellform.optimiser.optimum import Checkpoint, Optimum, Step
from shellform.optimiser.phases import run
from shellform.optimiser.search import Keep, Search, Watch
from shellform.problem.problem import FEASIBLE, Problem
from shellform.problem.terms import Misfit, Share
from shellform.structure.elements.threads import dense_on_one

__all__ = ["FEASIBLE", "Checkpoint", "Optimum", "Step", "minimise", "optimise", "polish"]

WINDOW = 0.2  # first half-width, in mean tensions of the start
STIFFNESS = 0.08  # of the start's softest mode under the first load, kept under the additional ones
_POLISHED = 0.8  # of that, which polishing may use up
POLISHING = 20  # design evaluations
_FINEST = 0.003  # window of polishing, in mean tensions, at which no better design is to be found


def optimise(
    problem: Problem,
    start: Design,
    *,
    evaluations: int = 100,
    window: float = WINDOW,
    thin: bool = True,
    stiffness: float = STIFFNESS,
    most_cables: int | None = None,
    progress: Watch | None = None,
    keep: Keep | None = None,
    resume: Checkpoint | None = None,
) -> Optimum:
    """The best design found from `start` within a number of design `evaluations`.

    `window`: half-width of the first step, in mean cable tensions; `thin`: whether cables that do little are
    taken away at the end; `stiffness`: what the softest mode must keep under the additional loads, as a share
    of the start's under the first (0: nothing); `most_cables`: down to so many cables are taken away whatever
    they do for the objective, as long as every limit is kept; `progress(step)` is called at each trial,
    `keep(checkpoint)` before each: with `resume` the same call goes on from there to the same result.

    Raises NotConverged where the start doesn't carry the first load case, with the paper's advice.
    """
    with dense_on_one():
        search = Search(problem, start, window, progress)
        search.most_cables = most_cables
        search.keep_stiff(stiffness * search.stiffness())
        search.keep = keep
        if resume is not None:
            search.resume(resume)
        return run(search, evaluations, thin=thin)


def polish(
    best: Optimum,
    *,
    evaluations: int = POLISHING,
    groups: Indices | None = None,
    progress: Watch | None = None,
) -> Optimum:
    """The design of `best` with the cables that it has and the least misfit under the first load, its limits
    kept.

    The L1 term has chosen the cables and pulled on all of them; without it, each kept taut, they serve the
    shape alone. The misfit never rises: where no better design is found, `best` comes back. The radius stays.

    With `groups` (c,), numbers for all candidates (grouping.py), the cables of a group keep one rest length;
    the misfit then is compared with that of `best` with averaged lengths. Raises NotConverged where that one
    doesn't bear the loads.
    """
    base = next(iter(best.problem.loads))
    if groups is not None:
        best = replace(
            best,
            design=replace(
                best.design, rest_length=averaged(best.design.rest_length, groups, best.design.present)
            ),
        )
    problem = replace(best.problem, minimise=[Share(1.0, Misfit(base))])
    with dense_on_one():
        search = Search(problem, best.design, WINDOW, progress)
        search.keep_stiff(_POLISHED * best.stiffness)
        search.braces[:] = True
        search.guarded = search.always_guarded = True
        search.groups = (
            None if groups is None else np.unique(groups[best.design.present], return_inverse=True)[1]
        )
        search.smallest = _FINEST
        polished = run(search, evaluations, thin=False)
    better = (
        polished.objective < polished.objective_start
        and polished.design.present.sum() == best.design.present.sum()
    )
    if (
        better or groups is not None
    ):  # of averaged lengths the polished design is at least that one, in its own states
        return polished
    return replace(best, status="no design with less misfit was found", history=polished.history)
