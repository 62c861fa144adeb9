"""What a search is about, where it stands, and how it judges: records that each phase (phases.py) takes and
gives back.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace

import numpy as np

from shellform.arrays import Flags, Indices, Reals
from shellform.errors import NotConverged
from shellform.gridshell.gridshell import Design
from shellform.optimiser.guards import Guard, guard
from shellform.optimiser.optimum import Checkpoint, Optimum, Step
from shellform.optimiser.solver import SequentialConvex
from shellform.optimiser.step_model import StepModel, step_model
from shellform.problem.constraints import AtLeast, Constraint, residuals
from shellform.problem.engineering import ModalStiffness
from shellform.problem.evaluation import Evaluator, Linearisation
from shellform.problem.paths import follow, in_tension, without_slack
from shellform.problem.problem import FEASIBLE, Problem
from shellform.problem.terms import Term
from shellform.reliability.trial_structures import Demand
from shellform.structure.elements.state import State
from shellform.structure.solve.loading import Loaded

Watch = Callable[[Step], None]
Keep = Callable[[Checkpoint], None]

_COUNTS = ("evaluations", "rejected", "equilibria", "factorisations", "wasted")


@dataclass(frozen=True)
class Search:
    """What stays the same in a search of the `problem`: its `solver`; the `evaluator` of the problem that is
    searched, with constraints on stability, and without those that are `bounded` by the design load's
    tensions; the number of design `evaluations`; the start's mean `tension`, N, and its `objective_start`;
    the `inner` problem, without constraints on stability; the `softest` mode's stiffness at the start, N/m;
    `groups` (c,) of present cables with one rest length each; whether cables are guarded from the beginning,
    `always_guarded`; what is `asked` of designs as built, None where nothing is, and the `least` tension, N,
    that cables keep for it; and whom to tell.
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


@dataclass(frozen=True)
class Accepted:
    """An accepted `design`, the candidates (c,) that are `taut` in it under the design load, and by what
    share it breaks its constraints, its `violation`."""

    design: Design
    taut: Flags
    violation: float

    @property
    def built(self) -> Design:
        """The design without its slack cables."""
        return replace(self.design, present=self.taut)


@dataclass(frozen=True)
class Iterate:
    """Where a search stands.

    The `point` and all `accepted` up to it, with the `history` of trials; the `stiffness`, N/m, that the
    softest modes keep under the further loads. The `phase`; the `stage` of the further loads and the `margin`
    kept from the end of their branch; the `window`, N; whether cables are `guarded` under further loads, and
    stability stands in for the objective, `climbing`; the cables (c,) that are `tensioned` and stay so; the
    constraints' `excess` (k,), 1/N², over their linear models at the last trial per square of the window; the
    `status`. Descending: whether the last trial was `refused`; the objective `before` this turn. Thinning:
    the objective that is still `thrifty`, the size of the next `batch`, single `failures` in a row, cables
    `needed` (c,). As built: structures that have `fallen`, the last ones first; whether the last design
    judged `fell`.
    """

    point: Linearisation
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
    before: float = float("inf")
    thrifty: float = 0.0
    batch: int = 0
    failures: int = 0
    needed: Flags = field(default_factory=lambda: np.zeros(0, dtype=bool))
    fallen: tuple[int, ...] = ()
    fell: bool = False


_ARRAYS = ("tensioned", "excess", "needed")
_NUMBERS = tuple(
    each.name for each in fields(Iterate) if each.name not in (*_ARRAYS, "point", "accepted", "history")
)


class Models:
    """Step models and guards, made once for each linearisation: the last one's are kept for another try in a
    smaller window."""

    def __init__(self, evaluator: Evaluator, reach: float) -> None:
        self.evaluator, self.reach = evaluator, reach
        self._model: StepModel | None = None
        self._guards: tuple[Linearisation, list[Guard]] | None = None

    def at(self, point: Linearisation) -> StepModel:
        """The step model at the point."""
        if self._model is None or self._model.point is not point:
            self._model = step_model(self.evaluator, point)
        return self._model

    def guards(self, point: Linearisation) -> list[Guard]:
        """Of the point's cables below the reach, N, under each further load; without load they may be slack."""
        if self._guards is None or self._guards[0] is not point:
            evaluator = self.evaluator
            shell, design = evaluator.shell, point.design
            rates = [shell.beams_by_radius(design.radius)] if evaluator.blocks.moves_radius else []
            assembly, cables = evaluator.assembly(design), shell.cables(design)
            loads = evaluator.problem.loads
            names = [
                name for name in evaluator.problem.used() if name != evaluator.base and loads[name].any()
            ]
            self._guards = (
                point,
                [guard(assembly, point.states[name], cables, self.reach, *rates) for name in names],
            )
        return self._guards[1]


def accepted_design(search: Search, point: Linearisation) -> Accepted:
    """The point's design, to go back to."""
    taut = in_tension(search.problem.shell, point.design, point.states[search.base])
    return Accepted(point.design, taut, violation(search, point))


def stiff(problem: Problem, least: float) -> Problem:
    """The problem with constraints on the softest mode, N/m, under each further load that has none yet."""
    if least <= 0.0:
        return problem
    base = problem.design_load.name
    own = {part.term.load for part in problem.constraints if part.term.stabilises}
    further = [name for name in problem.used() if name not in (base, *own) and problem.loads[name].any()]
    added = [AtLeast(least, ModalStiffness(name, least)) for name in further]
    return replace(problem, constraints=[*problem.constraints, *added])


def restiffened(search: Search, it: Iterate, least: float) -> Iterate:
    """With another stiffness, N/m, to keep; the window begins anew."""
    search.evaluator.problem = stiff(search.inner, least)
    point = search.evaluator.seed(it.point.design, it.point.states, it.stage)
    excess = np.zeros(len(point.constraints))
    return replace(it, stiffness=least, point=point, excess=excess, window=search.first_window)


def stiffness_of(search: Search, point: Linearisation) -> float:
    """What the softest modes keep under the further loads at the point, N/m; 0 where nothing is asked of
    them, or where a mode is unstable."""
    problem, count = search.evaluator.problem, len(search.inner.constraints)
    added = zip(problem.constraints[count:], problem.places()[count:], strict=True)
    # residuals are limit / scale - value / scale, value and limit squares
    squares = [part.lower - part.scale * float(point.constraints[own].max()) for part, own in added]
    return float(np.sqrt(max(min(squares, default=0.0), 0.0)))


def tensions(search: Search, point: Linearisation) -> Reals:
    """Of the present cables (c,) under the design load, N."""
    return search.problem.shell.cables(point.design).tension(point.states[search.base])


def taut_count(search: Search, point: Linearisation) -> int:
    """How many cables pull under the design load."""
    return int((tensions(search, point) > 0.0).sum())


def violation(search: Search, point: Linearisation) -> float:
    """Of the constraint that is broken most, as a share of its scale; 0 where all hold."""
    values = [float(point.constraints.max(initial=-1.0))]
    pull = tensions(search, point).max(initial=0.0)
    values += [float(residuals(part, np.array([pull]))[0]) for part in search.bounded]
    largest = max(values)
    return largest if largest > FEASIBLE else 0.0


def merit(search: Search, point: Linearisation) -> float:
    """The objective and a penalty for the constraint that is broken most."""
    return point.objective + search.solver.penalty * max(violation(search, point), 0.0)


def noted(search: Search, it: Iterate, point: Linearisation, accepted: bool) -> Iterate:
    """With a trial added to the history, and told."""
    return replace(it, history=(*it.history, record(search, point, it.stage, accepted)))


def record(search: Search, point: Linearisation, stage: float, accepted: bool) -> Step:
    """A trial as a step of the history, told to who watches."""
    problem, pull = search.evaluator.problem, tensions(search, point)
    terms = {
        _column(search, part.term): float(value)
        for part, value in zip(problem.minimise, point.terms, strict=True)
    }
    largest = np.array([pull.max(initial=0.0)])
    constraints = {_column(search, part.term): float(residuals(part, largest)[0]) for part in search.bounded}
    constraints |= {
        _column(search, part.term): float(point.constraints[own].max(initial=-np.inf))
        for part, own in zip(problem.constraints, problem.places(), strict=True)
    }
    step = Step(
        search.evaluator.evaluations,
        point.objective,
        terms,
        constraints,
        int((pull > 0.0).sum()),
        stage,
        accepted,
        time.perf_counter() - search.began,
    )
    if search.progress is not None:
        search.progress(step)
    return step


def _column(search: Search, term: Term) -> str:
    return term.name if term.load in ("", search.base) else f"{term.name}.{term.load}"


def tell(search: Search, it: Iterate) -> None:
    """Hands out where the search stands."""
    if search.keep is None:
        return
    numbers = {name: getattr(it, name) for name in _NUMBERS}
    numbers |= {name: getattr(search.evaluator, name) for name in _COUNTS}
    design = it.point.design
    arrays = {"rest_length": design.rest_length, "present": design.present}
    arrays |= {name: getattr(it, name) for name in _ARRAYS}
    arrays |= {
        "accepted rest_length": np.array([each.design.rest_length for each in it.accepted]),
        "accepted present": np.array([each.design.present for each in it.accepted]),
        "accepted radius": np.array([each.design.radius for each in it.accepted]),
        "accepted taut": np.array([each.taut for each in it.accepted]),
        "accepted violation": np.array([each.violation for each in it.accepted]),
    }
    for name, state in it.point.states.items():
        arrays |= {f"{name} positions": state.positions, f"{name} quaternions": state.quaternions}
    search.keep(Checkpoint(numbers | {"radius": design.radius}, arrays, it.history))


def resumed(search: Search, checkpoint: Checkpoint) -> tuple[Search, Iterate]:
    """Where a search of the same problem, start and settings stood."""
    numbers, arrays = checkpoint.numbers, checkpoint.arrays
    design = Design(arrays["rest_length"], np.array(arrays["present"]), numbers["radius"])
    search.evaluator.problem = stiff(search.inner, numbers["stiffness"])
    states = {
        name: State(arrays[f"{name} positions"], arrays[f"{name} quaternions"])
        for name in search.evaluator.problem.used()
    }
    point = search.evaluator.seed(design, states, numbers["stage"])
    for name in _COUNTS:
        setattr(search.evaluator, name, numbers[name])
    kept = {name: numbers[name] for name in _NUMBERS} | {name: np.array(arrays[name]) for name in _ARRAYS}
    kept["fallen"] = tuple(kept["fallen"])
    before = tuple(
        Accepted(Design(rest, np.array(present), float(radius)), np.array(taut), float(share))
        for rest, present, radius, taut, share in zip(
            *(
                arrays[f"accepted {name}"]
                for name in ("rest_length", "present", "radius", "taut", "violation")
            ),
            strict=True,
        )
    )
    began = search.began - checkpoint.history[-1].seconds
    return replace(search, began=began), Iterate(point, before, tuple(checkpoint.history), **kept)


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
    last = _judged(search, design, loaded)
    return Optimum(
        problem,
        design,
        loaded,
        search.objective_start,
        last.objective,
        last.constraints,
        it.history,
        it.status,
        evaluator.evaluations,
        evaluator.rejected,
        evaluator.equilibria,
        evaluator.factorisations,
        evaluator.wasted,
        it.stiffness,
        search.asked,
    )


def _judged(search: Search, design: Design, loaded: Mapping[str, Loaded]) -> Step:
    states = {name: loaded[name].equilibrium.state for name in search.problem.loads}
    return record(search, search.evaluator.seed(design, states, 1.0), 1.0, True)
