"""What a search is about, where it stands, and how it judges: records that each phase (phases.py) takes and
gives back.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from shellform.arrays import Flags, Indices, Reals, Record
from shellform.errors import NotConverged
from shellform.gridshell.gridshell import Design
from shellform.optimiser.guards import Guard, solved_guard, whole_guard
from shellform.optimiser.optimum import Checkpoint, Optimum, Step, largest, terms_by_name
from shellform.optimiser.solver import SequentialConvex
from shellform.optimiser.step_model import StepModel, step_model
from shellform.problem.constraints import AtLeast, Constraint, residuals
from shellform.problem.engineering import ModalStiffness
from shellform.problem.evaluation import Evaluated, Evaluator
from shellform.problem.paths import follow, in_tension, without_slack
from shellform.problem.problem import FEASIBLE, LoadCase, Problem
from shellform.reliability.requirements import SEED, Demand, largest_on_path
from shellform.reliability.resting import Resting
from shellform.reliability.scenarios import FactorsAsBuilt, scenarios
from shellform.reliability.scenarios import remembered as remembered_in
from shellform.reliability.trial_structures import Judging

Watch = Callable[[Step], None]
Keep = Callable[[Checkpoint], None]

_FOLLOWED = 1.25  # times what structures in mind are to bear: beyond, steps see no end of their branch
_MAY_MISS = 0.02  # of an aim: along its edge a step that is judged to the last bit leads nowhere
_NEARLY = 0.01  # of the stiffness left, to which the end of their branch is sought


@dataclass(frozen=True, eq=False)
class Search(Record):
    """What stays the same in a search.

    The problem:
    - `problem`: as it was given; `inner`: without constraints on stability.
    - `evaluator`: of the problem that is searched, with constraints on stability, and without those `bounded`
      by the design load's tensions, which are bounds of the model.
    - `groups` (c,): of present cables with one rest length each, None where each has its own.

    The start:
    - `tension`, N: its cables' mean; `softest`, N/m: its softest mode's stiffness; `objective_start`.

    How it is searched:
    - `solver`: its settings; `evaluations`: of designs, at the most.
    - `always_guarded`: whether cables are guarded from the beginning.
    - `models`: step models and guards, made once for each design.

    As built:
    - `asked`: what is asked of designs, None where nothing is; `least`, N: the tension kept for it.

    Whom to tell:
    - `progress` of steps, `keep` of checkpoints, `judging` of drawn structures; when it `began`, s.
    """

    problem: Problem
    solver: SequentialConvex
    evaluator: Evaluator
    bounded: tuple[Constraint, ...]
    evaluations: int
    tension: float
    objective_start: float
    inner: Problem
    softest: float
    asked: Demand | None
    least: float
    groups: Indices | None
    always_guarded: bool
    progress: Watch | None
    keep: Keep | None
    judging: Judging | None
    began: float
    models: Models

    @property
    def base(self) -> str:
        """The design load's name."""
        return self.problem.design_load.name

    @property
    def first_window(self) -> float:
        """N."""
        return self.solver.window * self.tension

    def left(self) -> int:
        """Design evaluations that are left."""
        return self.evaluations - self.evaluator.evaluations


@dataclass(frozen=True, eq=False)
class Accepted(Record):
    """An accepted `design`, the candidates (c,) that are `taut` in it under the design load, by what share it
    breaks its constraints, its `violation`, and its `objective`."""

    design: Design
    taut: Flags
    violation: float
    objective: float = np.inf

    @property
    def built(self) -> Design:
        """The design without its slack cables."""
        return replace(self.design, present=self.taut)


@dataclass(frozen=True, eq=False)
class Iterate(Record):
    """Where a search stands.

    - `point`: the present design; `accepted`: all designs up to it; `history`: all trials.
    - `phase`: "climb", "descend", "lead", "thin" or "agree"; `status`: why it ended, once it has.
    - `stiffness`, N/m: what the softest modes keep under the further loads.
    - `stage`: share of the further loads that is borne; `margin`: what is kept from the end of their branch.
    - `window`, N.
    - `guarded`: whether cables are under further loads; `tensioned` (c,): cables that stay in tension.
    - `excess` (k,), 1/N²: of constraints over their linear models at the last trial, by the window squared.
    - `climbing`: whether stability stands in for the objective.

    Descending:
    - `refused`: whether the last trial was; `before`: the objective when cables could last go slack.
    - `idle`: accepted steps in a row that gained next to nothing.

    Thinning:
    - `thrifty`: the objective up to which cables are still taken away.
    - `batch`: how many go next; `failures`: single ones in a row that can't; `needed` (c,): those that can't.
    - `paused`: whether it waits for a fresh sample; `counted`: the cables at the last one.

    As built:
    - `fallen`: numbers of structures that have, the last ones first; `fell`: whether the last design has.
    - `samples`: fresh ones drawn so far.
    - `rested`: where the structures tried rest in the last design that stood, by the largest load of a path.
    - `mind`: drawn structures that are to bear their loads, None where nothing but stiffness leads;
      `remembered`: the design in which they were followed.

    Led by structures in mind:
    - `stood`, `begun`: how many designs were accepted when the last one stood, and when this turn began.
    - `led_to`: the objective of the one that stood.
    - `until`: how many evaluations are spent when this turn ends.
    """

    point: Evaluated
    accepted: tuple[Accepted, ...]
    history: tuple[Step, ...]
    stiffness: float
    stage: float
    window: float
    margin: float
    guarded: bool
    tensioned: Flags
    excess: Reals
    climbing: bool = False
    status: str = "the number of evaluations was reached"
    phase: str = "climb"
    refused: bool = False
    idle: int = 0
    before: float = float("inf")
    thrifty: float = 0.0
    batch: int = 0
    failures: int = 0
    needed: Flags = field(default_factory=lambda: np.zeros(0, dtype=bool))
    counted: int = 0
    paused: bool = False
    fallen: tuple[int, ...] = ()
    fell: bool = False
    mind: FactorsAsBuilt | None = None
    remembered: Design | None = None
    stood: int = 0
    led_to: float = float("inf")
    until: int = 0
    begun: int = 0
    samples: int = 0
    rested: Mapping[str, Resting] = field(default_factory=dict)


class Models:
    """Step models and guards, made once for each design that steps start from: the last one's are kept for
    another try in a smaller window. Of more cables than are `many` for the solver neither is dense, unless it
    is to be `whole`, as where cables keep one length."""

    def __init__(
        self, evaluator: Evaluator, solver: SequentialConvex, reach: float, *, whole: bool = False
    ) -> None:
        self.evaluator, self.solver, self.reach, self.whole = evaluator, solver, reach, whole
        self._model: StepModel | None = None
        self._at: Evaluated | None = None
        self._guards: tuple[Evaluated, list[Guard]] | None = None

    def at(self, point: Evaluated) -> StepModel:
        """The step model at the point."""
        if self._model is None or self._at is not point:
            self._model = step_model(self.evaluator, point, whole=self._whole(point))
            self._at = point
        return self._model

    def guards(self, point: Evaluated) -> list[Guard]:
        """Of the point's cables below the reach, N, under further loads; without load they may be slack."""
        if self._guards is None or self._guards[0] is not point:
            evaluator = self.evaluator
            shell, design = evaluator.shell, point.design
            rates = [shell.beams_by_radius(design.radius)] if evaluator.blocks.moves_radius else []
            assembly, cables = evaluator.assembly(design), shell.cables(design)
            loads = evaluator.problem.loads
            names = [
                name for name in evaluator.problem.used() if name != evaluator.base and loads[name].any()
            ]
            guard = whole_guard if self._whole(point) else solved_guard
            self._guards = (
                point,
                [guard(assembly, point.states[name], cables, self.reach, *rates) for name in names],
            )
        return self._guards[1]

    def _whole(self, point: Evaluated) -> bool:
        each_cable = self.evaluator.blocks.each_cable is not None
        return self.whole or not each_cable or int(point.design.present.sum()) <= self.solver.many


def accepted_design(search: Search, point: Evaluated) -> Accepted:
    """The point's design, to go back to."""
    taut = in_tension(search.problem.shell, point.design, point.states[search.base])
    return Accepted(point.design, taut, violation(search, point), point.objective)


def stiff(problem: Problem, least: float) -> Problem:
    """The problem with constraints on the softest mode, N/m, under each further load that has none yet."""
    if least <= 0.0:
        return problem
    base = problem.design_load.name
    own = {part.term.load for part in problem.constraints if part.term.stabilises}
    further = [name for name in problem.used() if name not in (base, *own) and problem.loads[name].any()]
    added = [AtLeast(least, ModalStiffness(name, least)) for name in further]
    return replace(problem, constraints=[*problem.constraints, *added])


def aimed(problem: Problem, least: float, mind: FactorsAsBuilt | None) -> Problem:
    """The problem with what leads a search beside its own limits: the stiffness, N/m, and what structures
    that it keeps in mind are to bear."""
    problem = stiff(problem, least)
    if mind is None:
        return problem
    return replace(problem, constraints=[*problem.constraints, AtLeast(1.0, mind)])


def restiffened(search: Search, it: Iterate, least: float) -> Iterate:
    """With another stiffness, N/m, to keep; the window begins anew."""
    search.evaluator.problem = aimed(search.inner, least, it.mind)
    point = search.evaluator.seed(it.point.design, it.point.states, it.stage, before=it.point)
    excess = np.zeros(len(point.constraints))
    return replace(it, stiffness=least, point=point, excess=excess, window=search.first_window)


def kept_in_mind(
    search: Search, design: Design, least: Mapping[int, float], most: float | None = None
) -> FactorsAsBuilt:
    """The structures of the numbers in `least`, drawn as trials draw them, as scenarios of the search with
    the factors of the largest load that they are to bear, remembered in the design; none is followed beyond
    the factor `most` (None: somewhat beyond the largest of these). Raises NotConverged."""
    assert search.asked is not None
    problem, asked, safety = search.problem, search.asked.trial, search.asked.trial.safety
    decisive, _ = largest_on_path(asked)
    drawn = scenarios(
        problem.shell,
        design,
        LoadCase(decisive, asked.loads[decisive]),
        asked.tolerances,
        seed=safety.seed + SEED,
        least=least,
        most=_FOLLOWED * max(least.values()) if most is None else most,
        exact=_NEARLY,
    )
    return remembered_in(problem.shell, design, drawn)


def stiffness_of(search: Search, point: Evaluated) -> float:
    """What the softest modes keep under the further loads, N/m; 0 where none is asked, or one is unstable."""
    problem, count = search.evaluator.problem, len(search.inner.constraints)
    added = zip(problem.constraints[count:], problem.places()[count:], strict=True)
    # residuals are limit / scale - value / scale, value and limit squares
    squares = [
        part.lower - part.scale * float(point.constraints[own].max())
        for part, own in added
        if isinstance(part.term, ModalStiffness)
    ]
    return float(np.sqrt(max(min(squares, default=0.0), 0.0)))


def tensions(search: Search, point: Evaluated) -> Reals:
    """Of the present cables (c,) under the design load, N."""
    return search.problem.shell.cables(point.design).tension(point.states[search.base])


def taut_count(search: Search, point: Evaluated) -> int:
    """How many cables pull under the design load."""
    return int((tensions(search, point) > 0.0).sum())


def violation(search: Search, point: Evaluated) -> float:
    """Of the constraint that is broken most, as a share of its scale; 0 where all hold. What structures kept
    in mind are to bear is an aim and no limit: whoever judges draws them again."""
    limits = len(point.constraints) - in_mind(search)
    values = [float(point.constraints[:limits].max(initial=-1.0))]
    pull = tensions(search, point).max(initial=0.0)
    values += [float(residuals(part, np.array([pull]))[0]) for part in search.bounded]
    worst = max(values)
    return worst if worst > FEASIBLE else 0.0


def missed(search: Search, point: Evaluated) -> float:
    """By what share of its aim a structure in mind misses it, beyond what an aim may be missed by."""
    aims = len(point.constraints) - in_mind(search)
    return max(float(point.constraints[aims:].max(initial=0.0)) - _MAY_MISS, 0.0)


def in_mind(search: Search) -> int:
    """How many of the constraints' values, the last ones, are of structures that the search keeps in mind."""
    added = search.evaluator.problem.constraints[len(search.inner.constraints) :]
    return sum(len(part.term.scenarios) for part in added if isinstance(part.term, FactorsAsBuilt))


def merit(search: Search, point: Evaluated) -> float:
    """The objective and a penalty for the constraint that is broken most, or for the aim that is missed most,
    which is made up for later more easily than a limit."""
    penalty, aim = search.solver.penalty, search.solver.aim
    return point.objective + penalty * max(violation(search, point), aim * missed(search, point), 0.0)


def noted(search: Search, it: Iterate, point: Evaluated, accepted: bool) -> Iterate:
    """With a trial added to the history, and told."""
    return replace(it, history=(*it.history, record(search, point, it.stage, accepted, it.phase)))


def record(search: Search, point: Evaluated, stage: float, accepted: bool, phase: str) -> Step:
    """A trial as a step of the history, told to who watches."""
    problem, pull = search.evaluator.problem, tensions(search, point)
    most = np.array([pull.max(initial=0.0)])
    limits = [(problem.column(part.term), float(residuals(part, most)[0])) for part in search.bounded]
    limits += [
        (problem.column(part.term), float(point.constraints[own].max(initial=-np.inf)))
        for part, own in zip(problem.constraints, problem.places(), strict=True)
        if own.stop <= len(point.constraints) - in_mind(search)
    ]
    step = Step(
        evaluation=search.evaluator.evaluations,
        objective=point.objective,
        terms=terms_by_name(problem, point.terms),
        constraints=largest(limits),
        cables=int((pull > 0.0).sum()),
        stage=stage,
        accepted=accepted,
        seconds=time.perf_counter() - search.began,
        phase=phase,
    )
    if search.progress is not None:
        search.progress(step)
    return step


def finish(search: Search, it: Iterate) -> Optimum:
    """The last accepted design, on its documented path. Raises NotConverged where there is none."""
    shell, problem, evaluator = search.problem.shell, search.problem, search.evaluator
    none = np.zeros((shell.node_count, 6))
    if not it.accepted:
        raise NotConverged(
            "No design was found that carries all loads",
            state=it.point.design,
            iterations=evaluator.factorisations,
            remedy="Choose a denser grid, thicker rods, stiffer cables, or more evaluations.",
        )
    design = without_slack(shell, it.point.design, it.point.states[search.base])
    loaded = follow(shell, design, {"none": none, **problem.loads})
    states = {name: loaded[name].equilibrium.state for name in problem.loads}
    last = record(search, evaluator.seed(design, states, 1.0), 1.0, True, it.phase)
    return Optimum(
        problem=problem,
        design=design,
        loaded=loaded,
        objective_start=search.objective_start,
        objective=last.objective,
        constraints=last.constraints,
        history=it.history,
        status=it.status,
        evaluations=evaluator.evaluations,
        rejected=evaluator.rejected,
        equilibria=evaluator.equilibria,
        factorisations=evaluator.factorisations,
        wasted=evaluator.wasted,
        stiffness=it.stiffness,
        asked=None if search.asked is None else search.asked.after(it.samples + 1),
        fallen=it.fallen,
        rested=it.rested,
        mind={} if it.mind is None else {each.number: each.least for each in it.mind.scenarios},
    )
