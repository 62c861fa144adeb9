"""The design problem (equations 2 to 6) and its evaluation on the stable branch.

The variables are the rest lengths of the candidate cables over their lengths in the target, and the rod
radius over its start value where a RodRadius term frees it: all near 1, so that one step length suits them
all.

A trial design is evaluated from the nearest design that was evaluated before: its equilibria are where
Newton's method starts, and it may not lose definiteness on the way (`on_branch`). A trial that leaves the
stable branch is given up at once: `OffBranch`. Loads other than the first are staged: stage t in [0, 1]
stands for first + t (load - first), so that a start that doesn't bear an additional load can be led to a
design that does.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from shellform.arrays import Flags, Reals
from shellform.errors import InputError, NotConverged
from shellform.gridshell.gridshell import Design, Gridshell
from shellform.problem.terms import AtMost, RodRadius, Share, Term
from shellform.structure.answers.sensitivity import (
    by_rest_length,
    by_stiffness,
    gradients,
    predicted,
    respond,
)
from shellform.structure.elements.state import State
from shellform.structure.elements.threads import side_by_side
from shellform.structure.network import assemble
from shellform.structure.solve.assembly import Assembly
from shellform.structure.solve.equilibrium import find_equilibrium
from shellform.structure.solve.factorisation import NotPositiveDefinite
from shellform.structure.solve.loading import Loaded, apply_load

_TRIAL = 12  # factorisations for one trial equilibrium; from a near design five are enough
_LED = 0.5  # of an additional load, the steps by which it is led
_FAR = 20.0  # times the largest of the start's misfits: a trial this far off has left the branch unnoticed …
_NEAR = 0.02  # … but for one whose root mean square distance is below this share of the target's size
FEASIBLE = 1e-3  # largest violation, over the limit, of a design that counts as feasible
_SLACK_MARGIN = 1e-6  # relative tension below which a cable counts as slack


class OffBranch(Exception):
    """A trial design whose equilibrium isn't on the stable branch."""


@dataclass(frozen=True)
class Problem:
    """Minimise the sum of `minimise` subject to `limits` on `shell` under `loads` (name -> (n, 6)), the first
    being the design load.

    `rest_length_min`, m, and `rest_length_max`, times the initial rest length, are the bounds (3);
    `radius_bounds`, m, (4).
    """

    shell: Gridshell
    loads: Mapping[str, Reals]
    minimise: Sequence[Share]
    limits: Sequence[AtMost] = ()
    rest_length_min: float = 0.01
    rest_length_max: float = 1.1
    radius_bounds: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        used = {term.load for term in self.terms} - {""}
        for name in sorted(used - set(self.loads)):
            raise InputError(
                f"there is no load case {name!r}", where="problem", remedy=f"Known: {', '.join(self.loads)}."
            )
        total = sum(part.share for part in self.minimise)
        if abs(total - 1.0) > 1e-9:
            raise InputError(
                "the shares of the objective must add up to 1", where="problem.minimise", value=total
            )

    @property
    def terms(self) -> list[Term]:
        """The terms of the objective, then those of the limits."""
        return [part.term for part in self.minimise] + [part.term for part in self.limits]

    @property
    def frees_radius(self) -> bool:
        """Whether the rod radius is a variable."""
        return any(isinstance(part.term, RodRadius) for part in self.minimise)


@dataclass(frozen=True)
class Point:
    """A design on the stable branch: `variables` (s,), `states` by load case, `objective`, its weighted
    `terms`, `constraints` (k,), at most 0 where met, and the derivatives `objective_by_variables` (s,),
    `constraints_by_variables` (k, s)."""

    variables: Reals
    design: Design
    states: Mapping[str, State]
    objective: float
    terms: Reals
    constraints: Reals
    objective_by_variables: Reals
    constraints_by_variables: Reals
    stage: float


class Evaluator:
    """Evaluates designs of one problem; remembers where it was, and counts its work."""

    def __init__(self, problem: Problem, start: Design) -> None:
        self.problem, self.start = problem, start
        self.shell = problem.shell
        self.weights: Reals = np.ones(len(problem.minimise))
        self.factorisations = self.equilibria = self.evaluations = self.rejected = self.wasted = 0
        self._assembly: Assembly | None = None
        self._present: Flags | None = None
        self._far = np.inf

    def begin(self) -> dict[str, Loaded]:
        """Loads the start design step by step, sets the objective's weights, and returns how far each load
        case came.

        Raises NotConverged where the first load case snaps through.
        """
        reached = follow(self.shell, self.start, self.problem.loads)
        first = next(iter(self.problem.loads))
        for each in reached.values():
            self._count(each.factorisations)
        if not reached[first].on_branch:
            raise not_carried(first, reached[first], "Choose a denser grid, thicker rods or stiffer cables.")
        state = reached[first].equilibrium.state
        found = [each.equilibrium.state for each in reached.values() if each.on_branch]
        target = self.shell.target.positions
        near = len(target) * (_NEAR * float(np.ptp(target, axis=0).max())) ** 2
        self._far = max(near, _FAR * max(float(((each.positions - target) ** 2).sum()) for each in found))
        values = [part.term.measure(self.shell, self.start, state).value[0] for part in self.problem.minimise]
        self.weights = np.array([part.share for part in self.problem.minimise]) / np.maximum(values, 1e-300)
        return reached

    def variables(self, design: Design) -> Reals:
        """Variables (s,) of a design."""
        lengths = design.rest_length / self.shell.cable_lengths
        return np.append(lengths, design.radius / self.start.radius) if self.problem.frees_radius else lengths

    def design(self, variables: Reals) -> Design:
        """The design of variables (s,), with the start's cables."""
        count = len(self.shell.cable_lengths)
        radius = (
            float(variables[count] * self.start.radius) if self.problem.frees_radius else self.start.radius
        )
        return Design(variables[:count] * self.shell.cable_lengths, self.start.present, radius)

    def bounds(self) -> tuple[Reals, Reals]:
        """Lower and upper bounds (s,) of the variables (3, 4)."""
        problem, lengths = self.problem, self.shell.cable_lengths
        lower = problem.rest_length_min / lengths
        upper = problem.rest_length_max * self.start.rest_length / lengths
        if problem.frees_radius:
            radius = problem.radius_bounds or (0.25 * self.start.radius, self.start.radius)
            lower = np.append(lower, radius[0] / self.start.radius)
            upper = np.append(upper, radius[1] / self.start.radius)
        return lower, upper

    def load(self, name: str, stage: float) -> Reals:
        """The load case at a stage."""
        first = next(iter(self.problem.loads.values()))
        return np.asarray(first + stage * (self.problem.loads[name] - first))

    def seed(self, design: Design, states: Mapping[str, State], stage: float) -> Point:
        """The point of a design whose equilibria `states` at the stage are known. Raises OffBranch where one
        isn't stable.
        """
        self.factorisations += len(states)
        try:
            return linearise(
                self.problem,
                self.weights,
                self.assembly(design),
                self.variables(design),
                design,
                states,
                stage,
            )
        except NotPositiveDefinite as error:
            raise OffBranch(str(error)) from error

    def evaluate(
        self, variables: Reals, near: Mapping[str, State], stage: float, *, lead: bool = False
    ) -> Point:
        """The design at the variables, its equilibria sought from the states `near` them; where those of
        other loads than the first turn out too far off, with `lead` from the first load's, along the load's
        own path. Raises OffBranch."""
        self.evaluations += 1
        before = self.factorisations
        design = self.design(variables)
        assembly = self.assembly(design)
        try:
            found: dict[str, State] = {}
            # The loads that a design may not bear first, so that giving up costs little; to lead, the first
            # load's state is needed.
            for name in self.used() if lead else reversed(self.used()):
                found[name] = self._settled(
                    assembly, near[name], found if lead else {}, self.load(name, stage), stage
                )
            return self.seed(design, {name: found[name] for name in self.used()}, stage)
        except OffBranch:
            self.rejected += 1
            self.wasted += self.factorisations - before
            raise

    def predicted(self, point: Point, design: Design, *, but: str = "") -> dict[str, State]:
        """Where a change of the point's design, with the same cables, takes its states, to first order; all
        `but` one load's.
        """
        shell, before = self.shell, point.design
        change = (design.rest_length - before.rest_length)[before.present]
        rates = []
        if self.problem.frees_radius:
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

    def assembly(self, design: Design) -> Assembly:
        """The assembly of a design; its pattern is kept while the same cables are present."""
        parts = (self.shell.beams(design.radius), self.shell.cables(design))
        if (
            self._assembly is None
            or self._present is None
            or not np.array_equal(self._present, design.present)
        ):
            self._assembly, self._present = assemble(self.shell.network(design)), design.present
            return self._assembly
        return self._assembly.with_parts(parts)

    def used(self) -> list[str]:
        """The load cases that objective or constraints need."""
        names = {term.load for term in self.problem.terms}
        return [name for name in self.problem.loads if name in names]

    def _settled(
        self, assembly: Assembly, near: State, known: Mapping[str, State], load: Reals, stage: float
    ) -> State:
        """The equilibrium next to `near`, or where that is too far off, the one that the load leads to from
        the first known one.
        """
        try:
            return self._settle(assembly, near, load)
        except OffBranch:
            if not known:
                raise
        first, state = next(iter(known.items()))
        loaded = apply_load(
            assembly, state, self.load(first, stage), load, step=_LED, smallest=_LED, stay=True
        )
        self._count(loaded.factorisations)
        if not loaded.on_branch:
            raise OffBranch("the design doesn't bear the load on its stable branch")
        return loaded.equilibrium.state

    def _settle(self, assembly: Assembly, start: State, load: Reals) -> State:
        try:
            found = find_equilibrium(assembly, start, load, limit=_TRIAL, on_branch=True)
        except NotConverged as error:
            self._count(error.iterations)
            raise OffBranch(str(error)) from error
        self._count(found.factorisations)
        misfit = float(((found.state.positions - self.shell.target.positions) ** 2).sum())
        if not found.stable or misfit > self._far:
            raise OffBranch("the equilibrium found isn't next to the start")
        return found.state

    def _count(self, factorisations: int) -> None:
        self.factorisations += factorisations
        self.equilibria += 1


def not_carried(name: str, loaded: Loaded, remedy: str) -> NotConverged:
    """What to say of an initial design that doesn't bear a load case."""
    return NotConverged(
        f"The initial design doesn't carry the load case {name!r}: it loses stability at {loaded.share:.2f} of it",
        state=loaded.equilibrium.state,
        remedy=remedy,
    )


def linearise(
    problem: Problem,
    weights: Reals,
    assembly: Assembly,
    variables: Reals,
    design: Design,
    states: Mapping[str, State],
    stage: float,
) -> Point:
    """Values and derivatives of objective and constraints at a design whose equilibria are known (appendix
    A).
    """
    shell = problem.shell
    present = np.flatnonzero(design.present)
    size = len(shell.cable_ends) + problem.frees_radius
    scale = (
        np.append(shell.cable_lengths, design.radius / variables[-1])
        if problem.frees_radius
        else shell.cable_lengths
    )
    cables = shell.cables(design)
    rates = [shell.beams_by_radius(design.radius)] if problem.frees_radius else []
    # A column of each candidate cable, empty for the absent ones.
    spread = sp.csr_array(
        (np.ones(len(present)), (np.arange(len(present)), present)),
        shape=(len(present), len(shell.cable_ends)),
    )
    values: list[Reals] = [np.zeros(0)] * len(problem.limits)
    rows: list[Reals] = [np.zeros((0, size))] * len(problem.limits)
    objective = np.zeros(len(problem.minimise))
    objective_rows = np.zeros((len(problem.minimise), size))
    any_state = next(iter(states.values()))
    for name in dict.fromkeys(term.load for term in problem.terms):
        state = states.get(name, any_state)
        wanted = [term for term in problem.terms if term.load == name]
        measures = [term.measure(shell, design, state) for term in wanted]
        partial = sp.hstack(
            [
                sp.vstack([m.by_rest_length for m in measures]),
                sp.csr_array(np.concatenate([m.by_radius for m in measures])[:, None]),
            ]
        ).toarray()[:, :size]
        if name:
            columns = sp.csc_array(by_rest_length(assembly, state, cables) @ spread)
            response = respond(assembly, state, columns, by_stiffness(assembly, state, *rates))
            by_state = sp.vstack([m.by_dof for m in measures]).tocsc()[:, assembly.free].toarray()
            total = gradients(response, by_state, partial)
        else:
            total = partial
        pieces = np.split(total * scale, np.cumsum([len(m.value) for m in measures])[:-1])
        found = dict(zip(map(id, wanted), zip(measures, pieces, strict=True), strict=True))
        for k, part in enumerate(problem.minimise):
            if id(part.term) in found and part.term.load == name:
                measure, piece = found[id(part.term)]
                objective[k], objective_rows[k] = weights[k] * measure.value[0], weights[k] * piece[0]
        for k, limit in enumerate(problem.limits):
            if id(limit.term) in found and limit.term.load == name:
                measure, piece = found[id(limit.term)]
                values[k], rows[k] = measure.value / limit.scale - 1.0, piece / limit.scale
    return Point(
        variables.copy(),
        design,
        dict(states),
        float(objective.sum()),
        objective,
        np.concatenate([np.zeros(0), *values]),
        objective_rows.sum(axis=0),
        np.vstack([np.zeros((0, size)), *rows]),
        stage,
    )


def follow(
    shell: Gridshell, design: Design, loads: Mapping[str, Reals], *, stay: bool = False
) -> dict[str, Loaded]:
    """The documented path of a design: unloaded from the target shape by relaxation, then each load case on
    its own from there, step by step (loading.py). `shellform analyse` goes the same way.

    The cases are solved side by side on the cores. With `stay` snap-through isn't followed. Raises
    NotConverged where no equilibrium is found.
    """
    none = np.zeros((shell.node_count, 6))
    network = shell.network(design)
    idle = [
        assemble(network)
    ]  # assemblies that no case is using: each keeps one factor, and the cases go side by side
    unloaded = find_equilibrium(idle[0], shell.target, none)

    def loaded(load: Reals) -> Loaded:
        if not load.any():
            return Loaded(unloaded, 1.0, unloaded.factorisations)
        try:
            own = idle.pop()
        except IndexError:
            own = assemble(network)
        found = apply_load(own, unloaded.state, none, load, stay=stay)
        idle.append(own)
        return found

    return dict(zip(loads, side_by_side(loaded, list(loads.values())), strict=True))


def taut(shell: Gridshell, design: Design, state: State) -> Flags:
    """Which candidate cables (c,) are present and under tension in the state."""
    cables = shell.cables(design)
    pulled = cables.lengths(state) > cables.rest_length * (1.0 + _SLACK_MARGIN)
    result = np.zeros(len(shell.cable_ends), dtype=bool)
    result[np.flatnonzero(design.present)[pulled]] = True
    return result


def without_slack(shell: Gridshell, design: Design, state: State) -> Design:
    """The design without the cables that are slack in the state: the shell doesn't notice."""
    return replace(design, present=taut(shell, design, state))


def deviations(shell: Gridshell, state: State) -> Reals:
    """Distance (n,), m, of every node from its place in the target (7)."""
    return np.linalg.norm(state.positions - shell.target.positions, axis=1)
