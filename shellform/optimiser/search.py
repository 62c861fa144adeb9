"""Where a search of `mma.optimise` or `mma.polish` stands, and what its phases (phases.py) do with it:
models, trials, judgement, records.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace

import numpy as np

from shellform.arrays import Flags, Indices, Reals
from shellform.errors import NotConverged
from shellform.gridshell.gridshell import Design
from shellform.gridshell.grouping import averaged
from shellform.optimiser.guards import Guard, guard
from shellform.optimiser.optimum import Checkpoint, Optimum, Step
from shellform.optimiser.proposal import Task, places
from shellform.optimiser.tensions import TensionModel, tension_model
from shellform.problem.engineering import Softness
from shellform.problem.problem import FEASIBLE, Evaluator, OffBranch, Point, Problem, follow, without_slack
from shellform.problem.terms import AtMost, CableForces, Term
from shellform.structure.answers.stability import modes
from shellform.structure.elements.state import State
from shellform.structure.solve.loading import Loaded, apply_load

# of the whole additional load that is left at first between a stage and the end of the stable branch …
_MARGIN = 0.15
_NEAREST = 0.01  # … and at last
SMALLEST = 0.03  # window, in mean tensions, at which no better design is to be found
_NEAR = 0.5  # below a limit, as a share of it, from where on its curvature counts
_PENALTY = 10.0  # of a violated constraint beside the objective, which is 1 at the start

Watch = Callable[[Step], None]
Keep = Callable[[Checkpoint], None]

_NUMBERS = ("stage", "window", "margin", "guarded", "climbing", "status")
_COUNTS = ("evaluations", "rejected", "equilibria", "factorisations", "wasted")


@dataclass(frozen=True)
class Track:
    """Where a search is on its way: its `phase`; the `first` window, N; whether the last trial was `refused`;
    the objective `before` this turn; in thinning the objective that is still `thrifty`, the size of the next
    `batch`, single `failures` in a row, cables `needed` (c,)."""

    first: float
    phase: str = "climb"
    refused: bool = False
    before: float = float("inf")
    thrifty: float = 0.0
    batch: int = 0
    failures: int = 0
    needed: Flags = field(default_factory=lambda: np.zeros(0, dtype=bool))


_TRACKED = tuple(each.name for each in fields(Track) if each.name != "needed")


class Search:
    """One optimisation: its `point` and all that decides on the next one."""

    def __init__(self, problem: Problem, start: Design, window: float, progress: Watch | None) -> None:
        self.problem, self.progress = problem, progress
        self.base = next(iter(problem.loads))
        # Limits on the base load's cable forces are bounds of the model; the others stay constraints.
        self.bounded = [part for part in problem.limits if self._is_bound(part.term)]
        inner = replace(problem, limits=[part for part in problem.limits if not self._is_bound(part.term)])
        self.evaluator = Evaluator(inner, start)
        self.margin = _MARGIN
        self.began = time.perf_counter()
        reached = self.evaluator.begin()
        state = reached[self.base].equilibrium.state
        if all(reached[name].on_branch for name in self.evaluator.used()):
            self.stage, states = (
                1.0,
                {name: reached[name].equilibrium.state for name in self.evaluator.used()},
            )
        else:
            self.stage = self.reach(start, state, 0.0)
            states = self.staged(start, state, self.stage)
        self.point = self.evaluator.seed(start, states, self.stage)
        self.tension = float(np.mean(self.tensions(self.point)))
        self.window = window * self.tension
        self.braces = np.zeros(int(start.present.sum()), dtype=bool)
        self.objective_start = self.point.objective
        self.accepted = [self.point]
        self.history = [self._record(self.point, True)]
        self.status = "the number of evaluations was reached"
        self.most = 0
        self.least = 0.0
        self.smallest = SMALLEST
        self._modelled: TensionModel | None = None
        self._guarded: tuple[Point, list[Guard]] | None = None
        self.most_cables: int | None = None
        self.groups: Indices | None = None  # of the present cables, with one rest length each
        # What the limits' values at the last trial lay above their linear models, per square of the window:
        # (k,), 1/N².
        self.excess = np.zeros(len(self.point.constraints))
        self.climbing = False  # the softest modes stand in for the objective
        self.always_guarded = False
        self.guarded = False  # cables may not go slack under additional loads
        self.keep: Keep | None = None
        self.track = Track(self.window)

    def stiffness(self) -> float:
        """Of the softest mode of the start under the first load, N/m."""
        return float(
            modes(self.evaluator.assembly(self.point.design), self.point.states[self.base], 1).stiffness[0]
        )

    def keep_stiff(self, least: float) -> None:
        """Adds the limit on the softest mode, N/m, under each additional load."""
        own = {part.term.load for part in self.problem.limits if isinstance(part.term, Softness)}
        additional = [
            name
            for name in self.evaluator.used()
            if name not in (self.base, *own) and self.problem.loads[name].any()
        ]
        if not (least > 0.0 and additional):
            return
        self.least = least
        limits = [
            *self.evaluator.problem.limits,
            *(AtMost(1.0, Softness(name, least)) for name in additional),
        ]
        self.evaluator.problem = replace(self.evaluator.problem, limits=limits)
        self.point = self.evaluator.seed(self.point.design, self.point.states, self.stage)
        self.excess = np.zeros(len(self.point.constraints))
        self.accepted, self.history = [self.point], [self._record(self.point, True)]

    def left(self) -> int:
        """Design evaluations that are left."""
        return self.most - self.evaluator.evaluations

    def tell(self) -> None:
        """Hands out where the search stands."""
        if self.keep is not None:
            self.keep(self._checkpoint())

    def _checkpoint(self) -> Checkpoint:
        counted = self.evaluator
        numbers = {name: getattr(self, name) for name in _NUMBERS}
        numbers |= {name: getattr(counted, name) for name in _COUNTS}
        numbers |= {name: getattr(self.track, name) for name in _TRACKED}
        design = self.point.design
        arrays = {
            "rest_length": design.rest_length,
            "present": design.present,
            "braces": self.braces,
            "excess": self.excess,
            "needed": self.track.needed,
        }
        for name, state in self.point.states.items():
            arrays |= {f"{name} positions": state.positions, f"{name} quaternions": state.quaternions}
        return Checkpoint(numbers | {"radius": design.radius}, arrays, tuple(self.history))

    def resume(self, checkpoint: Checkpoint) -> None:
        """Goes back to where a search of the same problem, start and settings stood."""
        numbers, arrays = checkpoint.numbers, checkpoint.arrays
        for name in _NUMBERS:
            setattr(self, name, numbers[name])
        self.braces, self.excess = np.array(arrays["braces"]), np.array(arrays["excess"])
        self.evaluator.start = replace(self.evaluator.start, present=np.array(arrays["present"]))
        design = Design(arrays["rest_length"], self.evaluator.start.present, numbers["radius"])
        states = {
            name: State(arrays[f"{name} positions"], arrays[f"{name} quaternions"])
            for name in self.evaluator.used()
        }
        self.point = self.evaluator.seed(design, states, self.stage)
        for name in _COUNTS:
            setattr(self.evaluator, name, numbers[name])
        self.track = Track(**{name: numbers[name] for name in _TRACKED}, needed=np.array(arrays["needed"]))
        self.accepted, self.history = [self.point], list(checkpoint.history)
        self.began -= self.history[-1].seconds

    def accept(self, trial: Point) -> None:
        """Goes on from `trial`, as near to the whole additional loads as its stable branch allows."""
        self.point = trial
        self._raise()
        self.accepted.append(self.point)
        self.note(self.point, True)

    def sound(self, point: Point) -> Point | None:
        """The same design in the states to which the documented path leads, without its slack cables; None
        where it doesn't bear all loads there or breaks a limit: of two equilibria side by side, a search from
        design to design may have come to the other one."""
        design = without_slack(self.problem.shell, point.design, point.states[self.base])
        loaded = follow(self.problem.shell, design, self.problem.loads, stay=True)
        self.evaluator.factorisations += sum(each.factorisations for each in loaded.values())
        if not all(each.on_branch for each in loaded.values()):
            return None
        states = {name: loaded[name].equilibrium.state for name in self.evaluator.used()}
        try:
            found = self.evaluator.seed(point.design, states, 1.0)
        except OffBranch:
            return None
        return found if self.violation(found) <= max(self.violation(point), 0.0) else None

    def taut(self, point: Point) -> int:
        """How many cables pull under the base load."""
        return int((self.tensions(point) > 0.0).sum())

    def _is_bound(self, term: Term) -> bool:
        return isinstance(term, CableForces) and term.load == self.base and term.chosen is None

    def model(self) -> TensionModel:
        """The convex model at the present point, made once for each."""
        if self._modelled is None or self._modelled.point is not self.point:
            self._modelled = self._new_model()
        return self._modelled

    def _new_model(self) -> TensionModel:
        shell, design = self.problem.shell, self.point.design
        longest = (self.evaluator.bounds()[1][: len(shell.cable_lengths)] * shell.cable_lengths)[
            design.present
        ]
        return tension_model(
            shell,
            self.evaluator.assembly(design),
            self.point,
            self.point.states[self.base],
            longest,
            frees_radius=self.problem.frees_radius,
        )

    def _guards(self) -> list[Guard]:
        """Of the present point under the additional loads, made once for each, and none while cables may go
        slack.
        """
        if not self.guarded:
            return []
        if self._guarded is None or self._guarded[0] is not self.point:
            shell, design = self.problem.shell, self.point.design
            rates = [shell.beams_by_radius(design.radius)] if self.problem.frees_radius else []
            assembly, cables = self.evaluator.assembly(design), shell.cables(design)
            names = [name for name in self.evaluator.used() if name != self.base]
            self._guarded = (
                self.point,
                [guard(assembly, self.point.states[name], cables, self.tension, *rates) for name in names],
            )
        return self._guarded[1]

    def task(self, model: TensionModel) -> Task:
        """What the next step is asked for."""
        return Task(
            self.evaluator,
            self.point,
            model,
            self.base,
            self.window,
            self.tension,
            self.bounded,
            self.braces,
            self._guards(),
            self.climbing,
            self.groups,
            self.excess * self.window**2,
        )

    def attempt(self, model: TensionModel, y: Reals) -> Point | None:
        """The point with tensions, and radius, `y` (y,); None where its equilibrium leaves the stable branch.
        What it shows of the limits' curvature is kept for the next step."""
        design = model.design(y, self.point.design.present)
        if self.groups is not None:
            rest = design.rest_length.copy()
            rest[design.present] = averaged(
                rest[design.present], self.groups, np.ones(len(self.groups), dtype=bool)
            )
            design = replace(design, rest_length=rest)
        near = {**self.evaluator.predicted(self.point, design, but=self.base), self.base: model.predicted(y)}
        try:
            trial = self.evaluator.evaluate(
                self.evaluator.variables(design), near, self.stage, lead=not self.guarded
            )
        except OffBranch:
            return None
        # Linear in y, as in the proposal: in the rest lengths a cable that dies leaps to the longest one.
        linear = self.point.constraints + self.point.constraints_by_variables @ (
            model.variables_by_y @ (y - model.origin)
        )
        above = np.maximum(trial.constraints - linear, 0.0) / self.window**2
        self.excess = np.where(trial.constraints > -_NEAR, above, 0.0)
        return trial

    def attempt_without(self, model: TensionModel, leaving: Indices) -> Point | None:
        """The point without the cables `leaving`, the others at the rest lengths that they have: the shell
        moves less than at their tensions. None where it leaves the stable branch."""
        design = self.point.design
        rest = design.rest_length.copy()
        rest[np.flatnonzero(design.present)[leaving]] = model.longest[leaving]
        variables = self.evaluator.variables(replace(design, rest_length=rest))
        try:
            return self.evaluator.evaluate(variables, self.point.states, self.stage)
        except OffBranch:
            return None

    def merit(self, point: Point) -> float:
        """The objective and a penalty for the limit that is broken most."""
        return point.objective + _PENALTY * max(self.violation(point), 0.0)

    def violation(self, point: Point) -> float:
        """Of the limit that is broken most, as a share of it; 0 where all hold."""
        values = [float(point.constraints.max(initial=-1.0))]
        values += [float(self.tensions(point).max(initial=0.0)) / part.limit - 1.0 for part in self.bounded]
        largest = max(values)
        return largest if largest > FEASIBLE else 0.0

    def tensions(self, point: Point) -> Reals:
        """Of the present cables (c,) under the base load, N."""
        return self.problem.shell.cables(point.design).tension(point.states[self.base])

    def reach(self, design: Design, state: State, least: float) -> float:
        """The stage to which the design's stable branch under the additional loads allows to go."""
        stages = []
        for name in self.evaluator.used():
            if name != self.base:
                before, after = self.problem.loads[self.base], self.problem.loads[name]
                assembly = self.evaluator.assembly(design)
                loaded = apply_load(
                    assembly, state, before, after, step=0.5, smallest=min(0.125, self.margin), stay=True
                )
                self.evaluator.factorisations += loaded.factorisations
                stages.append(1.0 if loaded.on_branch else max(least, loaded.share - self.margin))
        return min(stages, default=1.0)

    def staged(self, design: Design, state: State, stage: float) -> dict[str, State]:
        """The states of all load cases at a stage, reached step by step from the base load's."""
        states = {self.base: state}
        for name in self.evaluator.used():
            if name != self.base:
                before, after = self.problem.loads[self.base], self.evaluator.load(name, stage)
                loaded = apply_load(self.evaluator.assembly(design), state, before, after)
                self.evaluator.factorisations += loaded.factorisations
                states[name] = loaded.equilibrium.state
        return states

    def _raise(self) -> None:
        if self.stage == 1.0:
            return
        design, state = self.point.design, self.point.states[self.base]
        stage = self.reach(design, state, self.stage)
        if stage <= self.stage:
            # Far from the end of its branch a design feels no limit on its softest mode, and nothing drives
            # it on: go nearer.
            self.margin = max(0.5 * self.margin, _NEAREST)
        else:
            self.stage = stage
            self.point = self.evaluator.seed(design, self.staged(design, state, stage), stage)

    def note(self, point: Point, accepted: bool) -> None:
        """Adds a trial to the history, and tells it."""
        self.history.append(self._record(point, accepted))

    def _record(self, point: Point, accepted: bool) -> Step:
        problem = self.evaluator.problem
        pull = self.tensions(point)
        terms = {
            self._name(part.term): float(value)
            for part, value in zip(problem.minimise, point.terms, strict=True)
        }
        constraints = {
            self._name(part.term): float(pull.max(initial=0.0)) / part.limit - 1.0 for part in self.bounded
        }
        constraints |= {
            self._name(part.term): float(point.constraints[own].max())
            for part, own in zip(problem.limits, places(problem), strict=True)
        }
        step = Step(
            self.evaluator.evaluations,
            point.objective,
            terms,
            constraints,
            int((pull > 0.0).sum()),
            self.stage,
            accepted,
            time.perf_counter() - self.began,
        )
        if self.progress is not None:
            self.progress(step)
        return step

    def _name(self, term: Term) -> str:
        kind = _name(type(term))
        return kind if term.load in ("", self.base) else f"{kind}.{term.load}"

    def finish(self) -> Optimum:
        """The last accepted design that bears all loads on the documented path."""
        shell, problem = self.problem.shell, self.problem
        none = np.zeros((shell.node_count, 6))
        if not self.accepted:
            raise NotConverged(
                "No design was found that carries all loads",
                state=self.point.design,
                iterations=self.evaluator.factorisations,
                remedy="Choose a denser grid, thicker rods, stiffer cables, or more evaluations.",
            )
        point = self.accepted[-1]
        design = without_slack(shell, point.design, point.states[self.base])
        loaded = follow(shell, design, {"none": none, **problem.loads})
        final = self._judge(design, loaded)
        return Optimum(
            problem,
            design,
            loaded,
            self.objective_start,
            final.objective,
            final.constraints,
            tuple(self.history),
            self.status,
            self.evaluator.evaluations,
            self.evaluator.rejected,
            self.evaluator.equilibria,
            self.evaluator.factorisations,
            self.evaluator.wasted,
            self.least,
        )

    def _judge(self, design: Design, loaded: Mapping[str, Loaded]) -> Step:
        states = {name: loaded[name].equilibrium.state for name in self.problem.loads}
        judge = Evaluator(self.evaluator.problem, design)
        judge.start, judge.weights = (
            replace(self.evaluator.start, present=design.present),
            self.evaluator.weights,
        )
        self.evaluator = _counted(judge, self.evaluator)
        return self._record(self.evaluator.seed(design, states, 1.0), True)


def _name(kind: type) -> str:
    """A term's name in histories: its class' name in small letters, but for those that stand for the same."""
    short = {
        "RmsMisfit": "misfit",
        "CableForces": "cable_force",
        "LargestCableForce": "cable_force",
        "RodUtilisation": "utilisation",
    }
    return short.get(kind.__name__) or "".join(
        f"_{c.lower()}" if c.isupper() else c for c in kind.__name__
    ).lstrip("_")


def _counted(judge: Evaluator, counts: Evaluator) -> Evaluator:
    judge.evaluations, judge.rejected = counts.evaluations, counts.rejected
    judge.equilibria, judge.factorisations, judge.wasted = (
        counts.equilibria,
        counts.factorisations,
        counts.wasted,
    )
    return judge
