"""The evaluation of a design problem on the stable branch.

A trial design is evaluated from the nearest design that was evaluated before: its equilibria are where
Newton's method starts, and it may not lose definiteness on the way (`on_branch`). A trial that leaves the
stable branch is given up at once: `OffBranch`. Loads beside the design load are staged: stage t in [0, 1]
stands for design load + t (load - design load), so that a start that doesn't bear a further load can be led
to a design that does.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, TypeVar

import numpy as np
import scipy.sparse as sp

from shellform.arrays import Flags, Reals, Record
from shellform.errors import NotConverged
from shellform.gridshell.gridshell import Design
from shellform.problem.constraints import residual_rows, residuals
from shellform.problem.paths import follow
from shellform.problem.problem import FEASIBLE, Problem
from shellform.problem.terms import LoadedDesign, Measurement, NotANumber, Term, measured
from shellform.problem.variables import Blocks
from shellform.problem.weights import start_weights
from shellform.structure.answers.sensitivity import (
    by_rest_length,
    by_stiffness,
    gradients,
    predicted,
    respond,
)
from shellform.structure.elements.state import State
from shellform.structure.elements.threads import cores, side_by_side
from shellform.structure.network import assemble
from shellform.structure.solve.assembly import Assembly
from shellform.structure.solve.factorisation import NotPositiveDefinite
from shellform.structure.solve.loading import Loaded, apply_load
from shellform.structure.solve.whole_steps import next_equilibrium

_TRIAL = 12  # factorisations for one trial equilibrium; from a near design five are enough
_LED = 0.5  # of a further load, the steps by which it is led
_FAR = 20.0  # times the largest of the start's misfits: a trial this far off has left the branch unnoticed …
_NEAR = 0.02  # … but for one whose root mean square distance is below this share of the target's size
_KNOWN = 16  # measurements of terms that need no equilibrium, which are kept

# of an Evaluator's work: `factorisations` are those of its equilibria
COUNTS = ("evaluations", "rejected", "equilibria", "factorisations", "wasted")

Made = TypeVar("Made")


class OffBranch(Exception):
    """A trial design whose equilibrium isn't on the stable branch."""


@dataclass(frozen=True, eq=False)
class Evaluated(Record):
    """A design on the stable branch with the values of its `problem`: `variables` (s,), `states` by load case
    at a `stage`, `objective`, its weighted `terms`, `constraints` (k,), residuals at most 0 where met; and
    the `measurements` of all the problem's terms."""

    problem: Problem
    variables: Reals
    design: Design
    states: Mapping[str, State]
    objective: float
    terms: Reals
    constraints: Reals
    measurements: tuple[Measurement, ...]
    stage: float

    @property
    def violation(self) -> float:
        """By how much the worst constraint is violated, as a share of its scale; 0 where all are met."""
        return max(float(self.constraints.max(initial=0.0)), 0.0)

    @property
    def rank(self) -> tuple[float, float]:
        """By which designs are put in order: feasible ones by their objective, before the others by their
        violation."""
        beyond = self.violation
        return (0.0, self.objective) if beyond <= FEASIBLE else (beyond, self.objective)

    @property
    def summands(self) -> tuple[Measurement, ...]:
        """The measurements of the objective's terms."""
        return self.measurements[: len(self.problem.minimise)]


@dataclass(frozen=True, eq=False)
class Linearisation(Evaluated):
    """The same with its first derivatives (appendix A): `objective_by_variables` (s,),
    `constraints_by_variables` (k, s)."""

    objective_by_variables: Reals
    constraints_by_variables: Reals


@dataclass(frozen=True, eq=False)
class _Tried:
    """The stable equilibrium that was found next to a start, None where there is none, and `why`; the
    `factorisations` that it took."""

    state: State | None
    factorisations: int
    why: str


class Evaluator:
    """Evaluates designs of one problem, its objective weighted as at the start, and counts its work."""

    def __init__(self, problem: Problem, start: Design) -> None:
        self.problem, self.start = problem, start
        self.shell, self.base = problem.shell, problem.design_load.name
        self.blocks = Blocks(problem.variables, problem.shell, start)
        self.weights: Reals = np.ones(len(problem.minimise))
        self.factorisations = self.equilibria = self.evaluations = self.rejected = self.wasted = 0
        self._assemblies: list[Assembly] = []
        self._present: Flags | None = None
        self._known: list[tuple[Term, Design, Measurement]] = []
        self._far = np.inf

    def begin(self, followed: Mapping[str, Loaded] | None = None) -> dict[str, Loaded]:
        """Loads the start design step by step, under loads of which it isn't known what it comes to
        (`followed`), sets the objective's weights, and returns how far each load case came. Raises
        NotConverged where the design load snaps through, InputError where a term can't be weighed.
        """
        known, loads = dict(followed or {}), self.problem.loads
        others = {name: load for name, load in loads.items() if name not in known}
        known |= follow(self.shell, self.start, others) if others else {}
        reached = {name: known[name] for name in loads}
        for each in reached.values():
            self._count(each.factorisations)
        first = reached[self.base]
        if not first.on_branch:
            raise not_carried(self.base, first, "Choose a denser grid, thicker rods or stiffer cables.")
        found = [each.equilibrium.state for each in reached.values() if each.on_branch]
        target = self.shell.target.positions
        near = len(target) * (_NEAR * float(np.ptp(target, axis=0).max())) ** 2
        self._far = max(near, _FAR * max(float(((each.positions - target) ** 2).sum()) for each in found))
        self.weights = start_weights(self.problem, self.start, reached)
        return reached

    def load(self, name: str, stage: float) -> Reals:
        """The load case at a stage."""
        first = self.problem.design_load.force
        return np.asarray(first + stage * (self.problem.loads[name] - first))

    def seed(
        self, design: Design, states: Mapping[str, State], stage: float, *, before: Evaluated | None = None
    ) -> Evaluated:
        """The values of a design with known equilibria `states` at the stage; terms measured in them for the
        problem as it was `before` aren't again. Raises OffBranch where a term can't be measured, InputError
        where one of the start is no number."""
        known = dict[int, Measurement]()
        if before is not None and before.stage == stage:
            known = dict(zip(map(id, before.problem.terms), before.measurements, strict=True))
        problem, assembly = self.problem, self.assembly(design)
        try:
            places = [self._at(term, design, states, stage, assembly) for term in problem.terms]
            found = [
                known[id(term)] if id(term) in known else self._measured(term, at)
                for term, at in zip(problem.terms, places, strict=True)
            ]
        except NotANumber as error:
            if not self.evaluations:  # the start's: the term's own fault
                raise
            raise OffBranch(str(error)) from error
        except (NotPositiveDefinite, NotConverged) as error:
            raise OffBranch(str(error)) from error
        summands, kept = found[: len(problem.minimise)], found[len(problem.minimise) :]
        objective = np.array([w * each.value.sum() for w, each in zip(self.weights, summands, strict=True)])
        values = [residuals(part, each.value) for part, each in zip(problem.constraints, kept, strict=True)]
        return Evaluated(
            problem=problem,
            variables=self.blocks.of(design).copy(),
            design=design,
            states=dict(states),
            objective=float(objective.sum()),
            terms=objective,
            constraints=np.concatenate([np.zeros(0), *values]),
            measurements=tuple(found),
            stage=stage,
        )

    def linearised(self, point: Evaluated) -> Linearisation:
        """The point with its derivatives, which cost as much as its values: only where steps start are they
        asked for. Raises OffBranch where an equilibrium isn't stable.
        """
        return self._linearised(point, _whole(point), self.assembly(point.design))

    def linearised_beside(self, point: Evaluated, work: Callable[[], Made]) -> tuple[Linearisation, Made]:
        """The same, and what other `work` makes on another core meanwhile, which may use the `assembly` of
        the point's design."""
        assembly = self.assembly(point.design, 1)
        whole = _whole(point)  # before: drawn structures keep all cores busy by themselves
        tasks: list[Callable[[], Any]] = [lambda: self._linearised(point, whole, assembly), work]
        linear, made = side_by_side(lambda task: task(), tasks)
        return linear, made

    def _linearised(
        self, point: Evaluated, whole: Sequence[Measurement], assembly: Assembly
    ) -> Linearisation:
        """The point with derivatives chained from those of its `whole` measurements, on an assembly of its
        design."""
        problem, blocks = point.problem, self.blocks
        terms = problem.terms
        rates = blocks.rates(point.design).multiply(blocks.unit).tocsc()
        rows = [np.zeros((0, blocks.size))] * len(terms)
        for name in dict.fromkeys(term.load for term in terms):
            own = [k for k, term in enumerate(terms) if term.load == name]
            at = self._at(terms[own[0]], point.design, point.states, point.stage, assembly)
            parts = [whole[k] for k in own]
            try:
                total = _chained(parts, at, assembly if name else None, blocks.moves_radius)
            except NotPositiveDefinite as error:
                raise OffBranch(str(error)) from error
            by_variables = np.empty_like(total, shape=(len(total), blocks.size))
            by_variables[...] = total @ rates[: total.shape[1]]
            pieces = np.split(by_variables, np.cumsum([len(each.value) for each in parts])[:-1])
            for k, piece in zip(own, pieces, strict=True):
                rows[k] = piece
        summands, kept = rows[: len(problem.minimise)], rows[len(problem.minimise) :]
        slopes = [w * piece.sum(axis=0) for w, piece in zip(self.weights, summands, strict=True)]
        limited = [residual_rows(part, piece) for part, piece in zip(problem.constraints, kept, strict=True)]
        return Linearisation(
            **{field.name: getattr(point, field.name) for field in fields(Evaluated)},
            objective_by_variables=np.array(slopes).sum(axis=0),
            constraints_by_variables=np.vstack([np.zeros((0, blocks.size)), *limited]),
        )

    def evaluate(
        self, design: Design, near: Mapping[str, State], stage: float, *, lead: bool = False
    ) -> Evaluated:
        """The design's values in the equilibria that Newton's method finds from the states `near` them. Where
        one of a further load isn't found from there, with `lead` the load is followed from the design load's
        equilibrium. Raises OffBranch."""
        self.evaluations += 1
        before = self.factorisations
        used = self.problem.used()
        # The loads that a design may not bear first, so that giving up costs little; to lead, the design
        # load's state is needed.
        order = used if lead else tuple(reversed(used))
        try:
            found: dict[str, State] = {}
            for name, tried in zip(order, self._tried(design, near, stage, order, lead), strict=True):
                self._count(tried.factorisations)
                if tried.state is not None:
                    found[name] = tried.state
                elif lead and self.base in found:
                    found[name] = self._led(design, found[self.base], self.load(name, stage))
                else:
                    raise OffBranch(tried.why)
            return self.seed(design, {name: found[name] for name in used}, stage)
        except OffBranch:
            self.rejected += 1
            self.wasted += self.factorisations - before
            raise

    def rounded(self, design: Design) -> Design:
        """The design as its variables give it, to the last bit."""
        return self.blocks.design(self.blocks.of(design), design.present)

    def predicted(self, point: Evaluated, design: Design, *, but: str = "") -> dict[str, State]:
        """Where a change of the point's design, with the same cables, takes its states, to first order; all
        `but` one load's.
        """
        shell, before = self.shell, point.design
        change = (design.rest_length - before.rest_length)[before.present]
        rates = []
        if self.blocks.moves_radius:
            change = np.append(change, design.radius - before.radius)
            rates = [shell.beams_by_radius(before.radius)]
        assembly, cables, found = self.assembly(before), shell.cables(before), {}
        for name, state in point.states.items():
            if name == but:
                continue
            self.factorisations += 1
            columns = by_rest_length(assembly, state, cables), by_stiffness(assembly, state, *rates)
            found[name] = predicted(assembly, respond(assembly, state, *columns), change)
        return found

    def assembly(self, design: Design, number: int = 0) -> Assembly:
        """The assembly of a design; its pattern is kept while the same cables are present. Those of other
        numbers have factors of their own, for work side by side."""
        if self._present is None or not np.array_equal(self._present, design.present):
            self._assemblies, self._present = [assemble(self.shell.network(design))], design.present
        while len(self._assemblies) <= number:
            self._assemblies.append(self._assemblies[0].beside())
        parts = (self.shell.beams(design.radius), self.shell.cables(design))
        return self._assemblies[number].with_parts(parts)

    def _tried(
        self, design: Design, near: Mapping[str, State], stage: float, order: Sequence[str], lead: bool
    ) -> list[_Tried]:
        """The equilibria under the loads in `order`, sought side by side; those after one that has none are
        given up where they haven't begun, unless others are to `lead` to it. The first that has none is
        always the same one, whichever is found first."""
        idle = [self.assembly(design, number) for number in range(min(cores(), len(order)))]
        lost: list[int] = []

        def settled(place: int) -> _Tried:
            if any(each < place and (not lead or order[each] == self.base) for each in lost):
                return _Tried(None, 0, "a load before it wasn't borne")
            own, name = idle.pop(), order[place]
            found = self._settled(own, near[name], self.load(name, stage))
            idle.append(own)
            if found.state is None:
                lost.append(place)
            return found

        return side_by_side(settled, range(len(order)))

    def _settled(self, assembly: Assembly, start: State, load: Reals) -> _Tried:
        """The stable equilibrium next to the state `start` under the `load`."""
        try:
            found = next_equilibrium(assembly, start, load, limit=_TRIAL)
        except NotConverged as error:
            return _Tried(None, error.iterations, str(error))
        misfit = float(((found.state.positions - self.shell.target.positions) ** 2).sum())
        if not found.stable or misfit > self._far:
            return _Tried(None, found.factorisations, "the equilibrium found isn't next to the start")
        return _Tried(found.state, found.factorisations, "")

    def _led(self, design: Design, known: State, load: Reals) -> State:
        """The equilibrium to which the load leads from the design load's, which is `known`. Raises
        OffBranch."""
        first = self.load(self.base, 1.0)
        loaded = apply_load(self.assembly(design), known, first, load, step=_LED, smallest=_LED, stay=True)
        self._count(loaded.factorisations)
        if not loaded.on_branch:
            raise OffBranch("the design doesn't bear the load on its stable branch")
        return loaded.equilibrium.state

    def _count(self, factorisations: int) -> None:
        self.factorisations += factorisations
        self.equilibria += 1

    def _measured(self, term: Term, at: LoadedDesign) -> Measurement:
        """The term's measurement. One that needs no equilibrium is the same whatever the states: a search
        goes back to designs in other states, and drawn structures that it keeps in mind take longer than all
        else."""
        if term.load:
            return measured(term, at)
        for known, design, found in self._known:
            if known is term and design is at.design:
                return found
        found = measured(term, at)
        self._known = [*self._known[1 - _KNOWN :], (term, at.design, found)]
        return found

    def _at(
        self, term: Term, design: Design, states: Mapping[str, State], stage: float, assembly: Assembly
    ) -> LoadedDesign:
        """Where the term is measured."""
        name = term.load or self.base
        return LoadedDesign(self.shell, design, states[name], self.load(name, stage), assembly)


def _whole(point: Evaluated) -> list[Measurement]:
    """The point's measurements with their derivatives."""
    return [each.whole() for each in point.measurements]


def not_carried(name: str, loaded: Loaded, remedy: str) -> NotConverged:
    """What to say of an initial design that doesn't bear a load case."""
    return NotConverged(
        f"The initial design doesn't carry the load case {name!r}: it loses stability at {loaded.share:.2f} "
        f"of it",
        state=loaded.equilibrium.state,
        remedy=remedy,
    )


def _chained(
    measurements: list[Measurement], at: LoadedDesign, assembly: Assembly | None, moves_radius: bool
) -> Reals:
    """Total derivatives (g, c) by all rest lengths, and (g, c + 1) by the radius where it moves; where no
    equilibrium is needed there is no `assembly`."""
    shell, design, state = at.shell, at.design, at.state
    partial = sp.vstack([each.by_rest_length for each in measurements]).toarray()
    if moves_radius:
        partial = np.column_stack([partial, np.concatenate([each.by_radius for each in measurements])])
    if assembly is None:
        return np.asarray(partial)
    # A column of each candidate cable, empty for the absent ones.
    spread = sp.eye_array(len(shell.cable_ends), format="csr")[design.present]
    rates = [shell.beams_by_radius(design.radius)] if moves_radius else []
    columns = sp.csc_array(by_rest_length(assembly, state, shell.cables(design)) @ spread)
    response = respond(assembly, state, columns, by_stiffness(assembly, state, *rates))
    by_state = sp.vstack([each.by_dof for each in measurements]).tocsc()[:, assembly.free].toarray()
    return gradients(response, by_state, partial)
