"""The paper's own method (operation 3): the method of moving asymptotes directly in the rest lengths and the
radius.

NLopt's MMA (Svanberg 2002) gets the objective (2), the constraints and their derivatives (appendix A) at true
equilibria, within the bounds (3) and (4). No cables are taken away on the way, no mode is kept stiff: at the
end the cables that are slack under the design load go, as in the paper, and the design is followed along its
documented path, whatever it shows there.

What the paper leaves open, and how it is done here:

- A trial is evaluated from the states of the nearest design known to be stable (the last ones and the best
  are remembered), never from a trial that was lost: one snapped shell would lead all later ones astray.
- A trial that leaves the stable branch is worse than any design: its objective is infinite, so that MMA makes
  its approximation more conservative, which shortens the step; constraints and derivatives, which must be
  finite, are those of the nearest stable design.
- Of a constraint with many values (5) MMA gets the few nearest to their limit, each at its place in the
  order: they are continuous, and its dual has a variable for each.
- Further loads that the start doesn't bear are raised in stages. A stage is a run of MMA of its own over a
  few evaluations, and longer where its best design bears no more; the next one starts from that, with shorter
  steps.

`accepted` in the history means: the best so far, feasible designs by their objective and before all others,
which stand by their violation. MMA itself doesn't tell which trials it went on from.

NLopt's memory can't be saved. A checkpoint holds what MMA was told since its run began, from which the same
run is made again without solving anything; so a search that is resumed ends with the same bytes.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from shellform.arrays import Indices, Reals, Record
from shellform.errors import NotConverged
from shellform.gridshell.gridshell import Design
from shellform.optimiser.convex import minimise
from shellform.optimiser.optimum import (
    Checkpoint,
    Optimum,
    Step,
    arrays_of,
    largest,
    states_of,
    terms_by_name,
)
from shellform.optimiser.solver import check_settings
from shellform.optimiser.trials import reach, staged
from shellform.problem.evaluation import COUNTS, Evaluated, Evaluator, Linearisation, OffBranch
from shellform.problem.paths import follow, without_slack
from shellform.problem.problem import Problem
from shellform.structure.solve.loading import Loaded
from shellform.work_clock import Work, counts_as

_NUMBERS = ("stage", "margin", "until", "caution")
_TOLD = ("variables", "objective", "slope", "rows", "row_slopes")

_SMALLEST = 0.125  # of the further load, to which a branch's end is sought: nearer stages were never left
_CAUTION = 1e3  # of a later stage, so that MMA needn't find anew how soon trials leave the branch


@dataclass(frozen=True)
class MovingAsymptotes:
    """Settings of the paper's method in `optimise`.

    - `tolerance`: relative change of the objective from one iteration of MMA to the next, that ends it.
    - `rows`: of a constraint with many values, those nearest to their limit that MMA is told.
    - `starts`: stable designs whose states are remembered as starts: the last ones, and the best.
    - `stage`: evaluations at one stage of further loads that the start doesn't bear.
    - `margin`, `least_margin`: of the whole further load, left between a stage and the end of the stable
      branch, at first and at last.
    """

    tolerance: float = 1e-4
    rows: int = 8
    starts: int = 6
    stage: int = 8
    margin: float = 0.15
    least_margin: float = 0.01

    def __post_init__(self) -> None:
        check_settings(self, shares=("tolerance", "margin", "least_margin"))


@dataclass(frozen=True, eq=False)
class _Told(Record):
    """What MMA was told of a trial: the `variables` (s,), the `objective` and its `slope` (s,), `rows` (k,)
    of the constraints and their slopes (k, s)."""

    variables: Reals
    objective: float
    slope: Reals
    rows: Reals
    row_slopes: Reals


@dataclass(eq=False)
class _Search:
    """A search and where it stands, changed in place since NLopt calls back.

    - `problem`, `solver`, `evaluator`, at most so many `evaluations`, whom to tell `progress` and `keep`,
      when it `began`, s.
    - `stage` of the further loads, and the `margin` before their end.
    - `near`: points of this stage to start from, the best one last; `accepted`: its designs without their
      slack cables.
    - `told`: what MMA was told in its present run, which began with the `caution`; `until`: how much that is
      before the further loads are raised again.
    - `history` of all trials; `status`: why it ended.
    """

    problem: Problem
    solver: MovingAsymptotes
    evaluator: Evaluator
    evaluations: int
    progress: Callable[[Step], None] | None
    keep: Callable[[Checkpoint], None] | None
    began: float
    stage: float = 1.0
    margin: float = 0.0
    near: list[Linearisation] = field(default_factory=list)
    accepted: list[Design] = field(default_factory=list)
    told: list[_Told] = field(default_factory=list)
    until: int = 0
    caution: float = 1.0
    history: list[Step] = field(default_factory=list)
    status: str = "the number of evaluations was reached"

    @property
    def base(self) -> str:
        """The design load's name."""
        return self.problem.design_load.name

    @property
    def best(self) -> Linearisation:
        """The best point of this stage."""
        return self.near[-1]

    def begin(self, point: Evaluated) -> None:
        """Goes on from a point at the present stage, MMA from the beginning."""
        first = self.evaluator.linearised(point)
        self.near, self.accepted = [first], [self.taut(first)]
        self.told = [_as_told(self, first.variables, first, first.objective)]
        self.until = 1 + self.solver.stage
        _note(self, first, True)

    def taut(self, point: Linearisation) -> Design:
        """The point's design without the cables that are slack under the design load."""
        return without_slack(self.problem.shell, point.design, point.states[self.base])

    def left(self) -> int:
        """Design evaluations that are left."""
        return self.evaluations - self.evaluator.evaluations


def minimise_directly(
    problem: Problem,
    start: Design,
    solver: MovingAsymptotes,
    *,
    evaluations: int,
    progress: Callable[[Step], None] | None = None,
    keep: Callable[[Checkpoint], None] | None = None,
    resume: Checkpoint | None = None,
    followed: Mapping[str, Loaded] | None = None,
) -> Optimum:
    """The best design that MMA finds from `start` in a number of design `evaluations`, without slack cables.

    `progress`, `keep`, `resume` and `followed` as in `optimise`. Raises NotConverged where the start doesn't
    carry the design load, or no design was found that carries the further ones; InputError where the start
    lies outside the bounds.
    """
    search = _begun(problem, start, solver, evaluations, progress, keep, followed)
    if resume is not None:
        _resume(search, resume)
    while search.left() > 0:
        before = search.evaluator.evaluations, search.stage, search.margin
        _run(search)
        if search.stage == 1.0:
            break
        _raise_stage(search)
        if (search.evaluator.evaluations, search.stage, search.margin) == before:
            break  # as near to the branch's end as is allowed
    return _finished(search)


def _begun(
    problem: Problem,
    start: Design,
    solver: MovingAsymptotes,
    evaluations: int,
    progress: Callable[[Step], None] | None,
    keep: Callable[[Checkpoint], None] | None,
    followed: Mapping[str, Loaded] | None,
) -> _Search:
    """The search at its start, led as far as that bears the further loads."""
    began, used = time.perf_counter(), problem.used()
    evaluator = Evaluator(problem, start)
    reached = evaluator.begin(followed)
    search = _Search(problem, solver, evaluator, evaluations, progress, keep, began, margin=solver.margin)
    state = reached[search.base].equilibrium.state
    if all(reached[name].on_branch for name in used):
        states = {name: reached[name].equilibrium.state for name in used}
    else:
        search.stage = reach(evaluator, start, state, 0.0, search.margin, _SMALLEST)
        states = staged(evaluator, start, state, search.stage)
    search.begin(evaluator.seed(start, states, search.stage))
    return search


def _run(search: _Search) -> None:
    """One run of MMA at the present stage, what it was told already told again."""
    again = iter(list(search.told))
    lower, upper = search.evaluator.blocks.bounds()
    most = len(search.told) + search.left()

    def evaluate(x: Reals) -> tuple[float, Reals, Reals, Reals]:
        told = next(again, None)
        if told is None:
            told = _tried(search, x)
            search.told.append(told)
        return told.objective, told.slope, told.rows, told.row_slopes

    _, reason = minimise(
        evaluate,
        search.told[0].variables,
        lower,
        upper,
        constraints=len(search.told[0].rows),
        evaluations=most if search.stage == 1.0 else min(most, search.until),
        tolerance=search.solver.tolerance,
        caution=search.caution,
    )
    if search.stage == 1.0:
        search.status = reason


@counts_as(Work.REST)
def _tried(search: _Search, x: Reals) -> _Told:
    """A trial evaluated, noted, and remembered where it is stable."""
    _tell(search)
    evaluator = search.evaluator
    near = min(search.near, key=lambda point: float(np.linalg.norm(point.variables - x)))
    try:
        design = evaluator.blocks.design(np.array(x), near.design.present)
        point = evaluator.linearised(evaluator.evaluate(design, near.states, search.stage, lead=True))
    except OffBranch:
        _note(search, near, False)
        return _as_told(search, x, near, np.inf)
    better = point.rank < search.best.rank
    if better:
        search.accepted.append(search.taut(point))
    # the last ones, and behind them the best
    order = [*search.near, point] if better else [*search.near[:-1], point, search.best]
    search.near = order[-search.solver.starts :]
    _note(search, point, better)
    return _as_told(search, x, point, point.objective)


def _raise_stage(search: _Search) -> None:
    """The next stage, from the best design of this one, as near to the whole further loads as that bears;
    where it bears no more than before, MMA's run goes on."""
    evaluator, best, solver = search.evaluator, search.best, search.solver
    state = best.states[search.base]
    stage = reach(evaluator, best.design, state, search.stage, search.margin, _SMALLEST)
    if stage <= search.stage:
        search.margin = max(0.5 * search.margin, solver.least_margin)
        search.until = len(search.told) + solver.stage
        return
    search.stage, search.caution = stage, _CAUTION
    search.begin(evaluator.seed(best.design, staged(evaluator, best.design, state, stage), stage))


def _as_told(search: _Search, x: Reals, point: Linearisation, objective: float) -> _Told:
    rows = _rows(search, point.constraints)
    return _Told(
        np.array(x),
        objective,
        point.objective_by_variables,
        point.constraints[rows],
        point.constraints_by_variables[rows],
    )


def _rows(search: _Search, values: Reals) -> Indices:
    """Of each constraint the residuals nearest to their limit, the worst first."""
    most = search.solver.rows
    chosen = [own.start + np.argsort(-values[own], kind="stable")[:most] for own in search.problem.places()]
    return np.concatenate([np.zeros(0, dtype=np.int64), *chosen])


def _note(search: _Search, point: Evaluated, accepted: bool) -> None:
    """A trial in the history, told to who watches."""
    step = _step(search, point, accepted)
    search.history.append(step)
    if search.progress is not None:
        search.progress(step)


def _step(search: _Search, point: Evaluated, accepted: bool) -> Step:
    problem = search.problem
    pull = problem.shell.cables(point.design).tension(point.states[search.base])
    return Step(
        evaluation=search.evaluator.evaluations,
        objective=point.objective,
        terms=terms_by_name(problem, point.terms),
        constraints=largest(
            (problem.column(part.term), float(point.constraints[own].max(initial=-np.inf)))
            for part, own in zip(problem.constraints, problem.places(), strict=True)
        ),
        cables=int((pull > 0.0).sum()),
        stage=search.stage,
        accepted=accepted,
        seconds=time.perf_counter() - search.began,
    )


def _tell(search: _Search) -> None:
    """Hands out where the search stands before a trial."""
    if search.keep is None:
        return
    numbers = {name: getattr(search.evaluator, name) for name in COUNTS}
    numbers |= {name: getattr(search, name) for name in _NUMBERS}
    numbers |= {"radii": [each.design.radius for each in search.near]}
    numbers |= {"accepted radii": [each.radius for each in search.accepted]}
    arrays = {name: np.array([getattr(each, name) for each in search.told]) for name in _TOLD}
    arrays |= {
        f"accepted {name}": np.array([getattr(each, name) for each in search.accepted])
        for name in ("rest_length", "present")
    }
    for k, point in enumerate(search.near):
        arrays[f"{k} rest_length"] = point.design.rest_length
        arrays |= arrays_of(point.states, f"{k} ")
    search.keep(Checkpoint(numbers, arrays, tuple(search.history)))


def _resume(search: _Search, checkpoint: Checkpoint) -> None:
    """Puts the search where one of the same problem, start and settings stood. Raises InputError for a
    checkpoint of another solver."""
    checkpoint.require(_NUMBERS)
    numbers, arrays, evaluator = checkpoint.numbers, checkpoint.arrays, search.evaluator
    for name in _NUMBERS:
        setattr(search, name, numbers[name])
    present, used = search.best.design.present, search.problem.used()
    search.near = []
    for k, radius in enumerate(numbers["radii"]):
        states = states_of(arrays, used, f"{k} ")
        design = Design(arrays[f"{k} rest_length"], present, radius)
        search.near.append(evaluator.linearised(evaluator.seed(design, states, search.stage)))
    search.accepted = [
        Design(lengths, np.array(there), radius)
        for lengths, there, radius in zip(
            arrays["accepted rest_length"], arrays["accepted present"], numbers["accepted radii"], strict=True
        )
    ]
    told = zip(*(arrays[name] for name in _TOLD), strict=True)
    search.told = [_Told(x, float(value), *rest) for x, value, *rest in told]
    search.history = list(checkpoint.history)
    search.began -= checkpoint.history[-1].seconds
    for name in COUNTS:
        setattr(evaluator, name, numbers[name])


def _finished(search: _Search) -> Optimum:
    """The best design without its slack cables on its documented path; where that doesn't lead it to the
    design load, the last one before it that it does."""
    problem, shell, evaluator = search.problem, search.problem.shell, search.evaluator
    if search.stage < 1.0:
        more = "" if search.left() > 0 else ", or more evaluations"
        raise NotConverged(
            "No design was found that carries all loads",
            state=search.best.design,
            iterations=evaluator.factorisations,
            remedy=f"Choose a denser grid, thicker rods, stiffer cables{more}.",
        )
    none = np.zeros((shell.node_count, 6))
    for design in reversed(search.accepted):
        loaded = follow(shell, design, {"none": none, **problem.loads})
        if loaded[search.base].on_branch:
            break
    states = {name: loaded[name].equilibrium.state for name in problem.used()}
    last = _step(search, evaluator.seed(design, states, 1.0), True)
    return Optimum(
        problem=problem,
        design=design,
        loaded=loaded,
        objective_start=search.history[0].objective,
        objective=last.objective,
        constraints=last.constraints,
        history=tuple(search.history),
        status=search.status,
        evaluations=evaluator.evaluations,
        rejected=evaluator.rejected,
        equilibria=evaluator.equilibria,
        factorisations=evaluator.factorisations,
        wasted=evaluator.wasted,
        stiffness=0.0,
    )
