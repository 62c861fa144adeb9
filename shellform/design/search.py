"""The search that `mma.optimize` and `mma.polish` make: rounds of proposal, trial and judgement, in three phases.

Climbing, where the start doesn't bear the additional loads; descending, by the objective; thinning, which takes cables away.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace

import numpy as np

from shellform.arrays import Flags, Indices, Reals
from shellform.design.checks import Softness
from shellform.design.gridshell import Design
from shellform.design.grouping import averaged
from shellform.design.guard import Guard, guard
from shellform.design.optimum import Checkpoint, Optimum, Step
from shellform.design.problem import FEASIBLE, Evaluator, OffBranch, Point, Problem, follow, without_slack
from shellform.design.proposal import Task, places, propose
from shellform.design.tensions import TensionModel, tension_model
from shellform.design.terms import AtMost, CableForces, Term
from shellform.design.thinning import kept_stiffness, spared
from shellform.errors import NotConverged
from shellform.structure.loading import Loaded, apply_load
from shellform.structure.stability import modes
from shellform.structure.state import State

_MARGIN = 0.15  # of the whole additional load that is left at first between a stage and the end of the stable branch …
_NEAREST = 0.01  # … and at last
_GROW, _SHRINK = 1.6, 0.4
_GOOD, _POOR = 0.7, 0.3  # true over predicted improvement
_SETTLED = 1e-3  # relative improvement predicted for the largest window that ends the optimisation
SMALLEST = 0.03  # window, in mean tensions, at which no better design is to be found
_PENALTY = 10.0  # of a violated constraint beside the objective, which is 1 at the start
_FAILURES = 6  # single cables in a row that can't be taken away, after which thinning ends
_BATCHES = 8  # share of the taut cables that the first batch takes, one in so many
_KEPT = 0.4  # of the stiffness in any direction, at the additional load, that must be left without a batch
_THINNING = 1.5  # of the objective that cables with little use may cost
_IDLE = 0.2  # of the cables in a search that may be slack under all loads before they are left out of it
_REPAIRS = 2  # steps after each batch

Watch = Callable[[Step], None]
Keep = Callable[[Checkpoint], None]

_NUMBERS = ("stage", "window", "margin", "guarded", "climbing", "status")
_COUNTS = ("evaluations", "rejected", "equilibria", "factorisations", "wasted")


@dataclass(frozen=True)
class Track:
    """Where a search is on its way: its `phase`; the `first` window, N; whether the last trial was `refused`; the objective `before` this turn;
    in thinning the objective that is still `thrifty`, the size of the next `batch`, single `failures` in a row, cables `needed` (c,)."""

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
    """The state of one optimisation."""

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
            self.stage, states = 1.0, {name: reached[name].equilibrium.state for name in self.evaluator.used()}
        else:
            self.stage = self._stage(start, state, 0.0)
            states = self._staged(start, state, self.stage)
        self.point = self.evaluator.seed(start, states, self.stage)
        self.tension = float(np.mean(self._tensions(self.point)))
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
        self.climbing = False  # the softest modes stand in for the objective
        self.always_guarded = False
        self.guarded = False  # cables may not go slack under additional loads
        self.keep: Keep | None = None
        self.track = Track(self.window)

    def stiffness(self) -> float:
        """Of the softest mode of the start under the first load, N/m."""
        return float(modes(self.evaluator.assembly(self.point.design), self.point.states[self.base], 1).stiffness[0])

    def keep_stiff(self, least: float) -> None:
        """Adds the limit on the softest mode, N/m, under each additional load."""
        own = {part.term.load for part in self.problem.limits if isinstance(part.term, Softness)}
        additional = [name for name in self.evaluator.used() if name not in (self.base, *own) and self.problem.loads[name].any()]
        if not (least > 0.0 and additional):
            return
        self.least = least
        limits = [*self.evaluator.problem.limits, *(AtMost(1.0, Softness(name, least)) for name in additional)]
        self.evaluator.problem = replace(self.evaluator.problem, limits=limits)
        self.point = self.evaluator.seed(self.point.design, self.point.states, self.stage)
        self.accepted, self.history = [self.point], [self._record(self.point, True)]

    def run(self, evaluations: int, *, thin: bool) -> Optimum:
        """First the branch up to the additional loads, then the objective alone, then thinning."""
        self.most = evaluations
        if self.track.phase == "climb":
            self._climb()
            self.track = replace(self.track, phase="descend")
        if self.track.phase == "descend":
            self._descend()
            while self.accepted:
                sound = self._sound(self.accepted[-1])
                if sound is not None:
                    self.accepted[-1] = self.point = sound
                    break
                self.accepted.pop()
            if self.accepted and thin:
                self._begin_thinning()
        if self.track.phase == "thin":
            self._thin()
        return self._finish()

    def _left(self) -> int:
        """Design evaluations that are left."""
        return self.most - self.evaluator.evaluations

    def _told(self) -> None:
        """Hands out where the search stands."""
        if self.keep is not None:
            self.keep(self._checkpoint())

    def _checkpoint(self) -> Checkpoint:
        counted = self.evaluator
        numbers = {name: getattr(self, name) for name in _NUMBERS}
        numbers |= {name: getattr(counted, name) for name in _COUNTS}
        numbers |= {name: getattr(self.track, name) for name in _TRACKED}
        design = self.point.design
        arrays = {"rest_length": design.rest_length, "present": design.present, "braces": self.braces, "needed": self.track.needed}
        for name, state in self.point.states.items():
            arrays |= {f"{name} positions": state.positions, f"{name} quaternions": state.quaternions}
        return Checkpoint(numbers | {"radius": design.radius}, arrays, tuple(self.history))

    def resume(self, checkpoint: Checkpoint) -> None:
        """Goes back to where a search of the same problem, start and settings stood."""
        numbers, arrays = checkpoint.numbers, checkpoint.arrays
        for name in _NUMBERS:
            setattr(self, name, numbers[name])
        self.braces = np.array(arrays["braces"])
        self.evaluator.start = replace(self.evaluator.start, present=np.array(arrays["present"]))
        design = Design(arrays["rest_length"], self.evaluator.start.present, numbers["radius"])
        states = {name: State(arrays[f"{name} positions"], arrays[f"{name} quaternions"]) for name in self.evaluator.used()}
        self.point = self.evaluator.seed(design, states, self.stage)
        for name in _COUNTS:
            setattr(self.evaluator, name, numbers[name])
        self.track = Track(**{name: numbers[name] for name in _TRACKED}, needed=np.array(arrays["needed"]))
        self.accepted, self.history = [self.point], list(checkpoint.history)
        self.began -= self.history[-1].seconds

    def _climb(self) -> None:
        """Steps that stiffen the softest mode under the staged loads, whatever the objective, until the additional loads are borne whole.

        Each goes along the gradient of the limits on it, with all cables kept taut; it counts where the stable branch reaches farther.
        """
        if self.stage == 1.0 or self.least == 0.0:
            return
        self.guarded = self.climbing = True
        while self.stage < 1.0 and self._left() > 0 and self.window > self.smallest * self.tension:
            self._told()
            model = self._model()
            y, _ = propose(self._task(model))
            trial = self._try(model, y)
            stage = 0.0 if trial is None else self._stage(trial.design, trial.states[self.base], 0.0)
            if trial is None or stage <= self.stage:
                self.window *= _SHRINK
                self.history.append(self._record(trial or self.point, False))
                continue
            self.stage = stage
            self.point = self.evaluator.seed(trial.design, self._staged(trial.design, trial.states[self.base], stage), stage)
            self.accepted.append(self.point)
            self.history.append(self._record(self.point, True))
        self.window, self.guarded, self.climbing = self.track.first, self.always_guarded, False

    def _descend(self) -> None:
        """Rounds of model, trial and judgement: first cables may go slack, and where that leads no further, none may; and so in turns
        as long as a turn improves the objective."""
        track = self.track
        while self._left() > 0:
            self.track = track
            self._told()
            model = self._model()
            y, predicted = propose(self._task(model))
            settled = self._settled(predicted)
            if settled:
                self.status = settled
                turned = self.guarded and self.point.objective > (1.0 - _SETTLED) * track.before
                if self.always_guarded or turned or len(self.evaluator.used()) == 1:  # without additional loads there are no guards
                    return
                track = replace(track, before=self.point.objective if self.guarded else track.before)
                self.guarded, self.window = not self.guarded, track.first
                continue
            trial = self._try(model, y)
            if trial is None or self._merit(trial) >= self._merit(self.point):
                self.window *= _SHRINK
                track = replace(track, refused=True)
                self.history.append(self._record(trial or self.point, False))
                continue
            ratio = (trial.objective - self.point.objective) / min(predicted, -1e-300)
            grown = 1.0 if track.refused else _GROW  # a window that was just refused isn't tried again at once
            self.window *= grown if ratio > _GOOD else (_SHRINK if ratio < _POOR else 1.0)
            track = replace(track, refused=False)
            self._accept(trial)

    def _settled(self, predicted: float) -> str:
        """The criterion of convergence that the point meets, in words; empty where none is met."""
        if self.stage < 1.0 or self._violation(self.point) > 0.0:
            return ""
        if -predicted < _SETTLED * self.point.objective and self.window >= self.tension:
            return f"the model predicts less than {_SETTLED:.1%} improvement"
        if self.window < self.smallest * self.tension:
            return "the objective has no better design within the smallest window"
        return ""

    def _begin_thinning(self) -> None:
        self.window = max(self.window, 0.1 * self.tension)
        self.guarded = True
        self.track = replace(
            self.track,
            phase="thin",
            thrifty=_THINNING * self.point.objective,
            batch=max(1, self._taut(self.point) // _BATCHES),
            needed=np.zeros(len(self.braces), dtype=bool),
        )

    def _thin(self) -> None:
        """Takes away cables that the shell can spare (thinning.py), in batches, and lets the others make up for them.

        Those left are kept taut while their tensions are optimised again. A batch that the shell doesn't bear, or that costs too
        much of the objective, is cut; a single cable that can't go is kept for good.
        """
        track = self.track
        while track.failures < _FAILURES and self._left() > 0:
            self.track = self._without_slack(track)
            track = self.track
            self._told()
            over = self.most_cables is not None and self._taut(self.point) > self.most_cables
            budget = np.inf if over else track.thrifty
            model = self._model()
            leaving = self._spared(model, track.needed, track.batch)
            if not len(leaving):
                self.status += ", and every cable that is left is needed for stability"
                return
            self.braces = model.origin[: len(self.braces)] > 0.0
            self.braces[leaving] = False
            trial = self._without(model, leaving)
            if trial is not None and self._merit(trial) < 2.0 * budget:
                trial = self._repair(trial, budget)
            fits = trial is not None and self._merit(trial) <= budget and self._violation(trial) <= 0.0
            sound = self._sound(trial) if trial is not None and fits else None
            if sound is None:
                self.history.append(self._record(trial or self.point, False))
                alone = len(leaving) == 1
                needed = track.needed.copy()
                needed[leaving] = alone
                track = replace(track, needed=needed, failures=track.failures + alone, batch=max(1, len(leaving) // 3))
                continue
            self._accept(sound)
            track = replace(track, failures=0, batch=int(1.3 * track.batch) + 1)
        done = track.failures >= _FAILURES
        self.status += ", and no further cable can be taken away" if done else ", and thinning ended with the last evaluation"
        if self.most_cables is not None and self._taut(self.point) > self.most_cables:
            self.status += f"; no design with {self.most_cables} cables was found that keeps every limit"

    def _without_slack(self, track: Track) -> Track:
        """Leaves cables out of the search that are slack under all loads, once they are many: a model solves for every cable in it."""
        design, cables = self.point.design, self.problem.shell.cables(self.point.design)
        pulls = np.array([cables.tension(state) for state in self.point.states.values()])
        kept = (pulls > 0.0).any(axis=0)
        if kept.mean() > 1.0 - _IDLE:
            return track
        present = design.present.copy()
        present[np.flatnonzero(present)[~kept]] = False
        self.evaluator.start = replace(self.evaluator.start, present=present)
        self.braces = self.braces[kept]
        self.point = self.evaluator.seed(replace(design, present=present), self.point.states, self.stage)
        self.accepted[-1] = self.point
        return replace(track, needed=track.needed[kept])

    def _repair(self, point: Point, budget: float) -> Point:
        """A few steps with the cables that are left, none of which may go slack."""
        before, self.point = self.point, point
        for _ in range(min(_REPAIRS, self._left())):
            model = self._model()
            y, _ = propose(self._task(model))
            trial = self._try(model, y)
            if trial is None or self._merit(trial) >= self._merit(self.point):
                self.window *= _SHRINK
            else:
                self.window *= _GROW
                self.point = trial
        self.window = float(np.clip(self.window, 0.05 * self.tension, self.tension))
        best, self.point = self.point, before
        return best

    def _spared(self, model: TensionModel, needed: Flags, most: int) -> Indices:
        """Taut cables, numbered among those present, that can go at once, from the one with the least use."""
        state = self.point.states[self.evaluator.used()[-1]]
        kept = kept_stiffness(model.assembly, state, self.problem.shell.cables(self.point.design))
        loss = 1.0 - np.diag(kept)
        pull = model.origin[: len(loss)]
        score = loss / loss.sum() + pull / pull.sum()
        free = np.flatnonzero((pull > 0.0) & ~needed)
        return spared(kept, free[np.argsort(score[free], kind="stable")], most, _KEPT)

    def _accept(self, trial: Point) -> None:
        self.point = trial
        self._raise()
        self.accepted.append(self.point)
        self.history.append(self._record(self.point, True))

    def _sound(self, point: Point) -> Point | None:
        """The same design in the states to which the documented path leads, without its slack cables; None where it doesn't bear all loads
        there or breaks a limit: of two equilibria side by side, a search from design to design may have come to the other one."""
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
        return found if self._violation(found) <= max(self._violation(point), 0.0) else None

    def _taut(self, point: Point) -> int:
        return int((self._tensions(point) > 0.0).sum())

    def _is_bound(self, term: Term) -> bool:
        return isinstance(term, CableForces) and term.load == self.base and term.chosen is None

    def _model(self) -> TensionModel:
        """The convex model at the present point, made once for each."""
        if self._modelled is None or self._modelled.point is not self.point:
            self._modelled = self._new_model()
        return self._modelled

    def _new_model(self) -> TensionModel:
        shell, design = self.problem.shell, self.point.design
        longest = (self.evaluator.bounds()[1][: len(shell.cable_lengths)] * shell.cable_lengths)[design.present]
        return tension_model(
            shell,
            self.evaluator.assembly(design),
            self.point,
            self.point.states[self.base],
            longest,
            frees_radius=self.problem.frees_radius,
        )

    def _guards(self) -> list[Guard]:
        """Of the present point under the additional loads, made once for each, and none while cables may go slack."""
        if not self.guarded:
            return []
        if self._guarded is None or self._guarded[0] is not self.point:
            shell, design = self.problem.shell, self.point.design
            rates = [shell.beams_by_radius(design.radius)] if self.problem.frees_radius else []
            assembly, cables = self.evaluator.assembly(design), shell.cables(design)
            names = [name for name in self.evaluator.used() if name != self.base]
            self._guarded = (self.point, [guard(assembly, self.point.states[name], cables, self.tension, *rates) for name in names])
        return self._guarded[1]

    def _task(self, model: TensionModel) -> Task:
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
        )

    def _try(self, model: TensionModel, y: Reals) -> Point | None:
        design = model.design(y, self.point.design.present)
        if self.groups is not None:
            rest = design.rest_length.copy()
            rest[design.present] = averaged(rest[design.present], self.groups, np.ones(len(self.groups), dtype=bool))
            design = replace(design, rest_length=rest)
        near = {**self.evaluator.predicted(self.point, design, but=self.base), self.base: model.predicted(y)}
        try:
            return self.evaluator.evaluate(self.evaluator.variables(design), near, self.stage, lead=not self.guarded)
        except OffBranch:
            return None

    def _without(self, model: TensionModel, leaving: Indices) -> Point | None:
        """The point without some cables, the others at the rest lengths that they have: the shell moves less than at their tensions."""
        design = self.point.design
        rest = design.rest_length.copy()
        rest[np.flatnonzero(design.present)[leaving]] = model.longest[leaving]
        variables = self.evaluator.variables(replace(design, rest_length=rest))
        try:
            return self.evaluator.evaluate(variables, self.point.states, self.stage)
        except OffBranch:
            return None

    def _merit(self, point: Point) -> float:
        return point.objective + _PENALTY * max(self._violation(point), 0.0)

    def _violation(self, point: Point) -> float:
        values = [float(point.constraints.max(initial=-1.0))]
        values += [float(self._tensions(point).max(initial=0.0)) / part.limit - 1.0 for part in self.bounded]
        largest = max(values)
        return largest if largest > FEASIBLE else 0.0

    def _tensions(self, point: Point) -> Reals:
        return self.problem.shell.cables(point.design).tension(point.states[self.base])

    def _stage(self, design: Design, state: State, least: float) -> float:
        """The stage to which the design's stable branch under the additional loads allows to go."""
        stages = []
        for name in self.evaluator.used():
            if name != self.base:
                before, after = self.problem.loads[self.base], self.problem.loads[name]
                assembly = self.evaluator.assembly(design)
                loaded = apply_load(assembly, state, before, after, step=0.5, smallest=min(0.125, self.margin), stay=True)
                self.evaluator.factorisations += loaded.factorisations
                stages.append(1.0 if loaded.on_branch else max(least, loaded.share - self.margin))
        return min(stages, default=1.0)

    def _staged(self, design: Design, state: State, stage: float) -> dict[str, State]:
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
        stage = self._stage(design, state, self.stage)
        if stage <= self.stage:
            # Far from the end of its branch a design feels no limit on its softest mode, and nothing drives it on: go nearer.
            self.margin = max(0.5 * self.margin, _NEAREST)
        else:
            self.stage = stage
            self.point = self.evaluator.seed(design, self._staged(design, state, stage), stage)

    def _record(self, point: Point, accepted: bool) -> Step:
        problem = self.evaluator.problem
        pull = self._tensions(point)
        terms = {self._name(part.term): float(value) for part, value in zip(problem.minimize, point.terms, strict=True)}
        constraints = {self._name(part.term): float(pull.max(initial=0.0)) / part.limit - 1.0 for part in self.bounded}
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

    def _finish(self) -> Optimum:
        """The last accepted design that bears all loads on the documented path."""
        shell, problem = self.problem.shell, self.problem
        none = np.zeros((len(shell.net.grid.flat), 6))
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
        judge.start, judge.weights = replace(self.evaluator.start, present=design.present), self.evaluator.weights
        self.evaluator = _counted(judge, self.evaluator)
        return self._record(self.evaluator.seed(design, states, 1.0), True)


def _name(kind: type) -> str:
    """A term's name in histories: its class' name in small letters, but for those that stand for the same."""
    short = {"RmsMisfit": "misfit", "CableForces": "cable_force", "LargestCableForce": "cable_force", "RodUtilisation": "utilisation"}
    return short.get(kind.__name__) or "".join(f"_{c.lower()}" if c.isupper() else c for c in kind.__name__).lstrip("_")


def _counted(judge: Evaluator, counts: Evaluator) -> Evaluator:
    judge.evaluations, judge.rejected = counts.evaluations, counts.rejected
    judge.equilibria, judge.factorisations, judge.wasted = counts.equilibria, counts.factorisations, counts.wasted
    return judge
