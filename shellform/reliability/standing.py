"""Structures as built, each loaded from nothing on its own path: does it stand?

A structure is relaxed without load from where the perfect one rests, and then loaded step by step (loading.py
has the path of a single structure). The perfect structure's path, solved once, gives each step its start: its
own motion from one load factor to the next is added to where the drawn structure is. A step counts only where every
tangent on the way is positive definite and no crossing lands farther than `STRAY` of the span from where it was
expected; else it is halved, as on any path. So the large steps lead along the same branch as small ones do.

A structure stands if the equilibrium under the whole load is reached so, is stable, and no node is farther than
`FAR` of the span from the perfect structure's; one that loses stability on the way has fallen, whatever it
would snap to, and how far it came is its load factor.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from queue import SimpleQueue

import numpy as np

from shellform.arrays import Flags, Reals, flags
from shellform.errors import InputError, NotConverged
from shellform.gridshell.gridshell import Design, Gridshell
from shellform.gridshell.tolerances import Tolerances
from shellform.reliability.drawing import (
    SHAPES,
    Errors,
    Imperfections,
    built_beams,
    built_cables,
    built_load,
    errors_of,
    variables,
)
from shellform.reliability.members import Members, members_of, members_of_model
from shellform.structure.answers.stability import modes
from shellform.structure.elements import rotation
from shellform.structure.elements.state import State, moved
from shellform.structure.elements.threads import side_by_side
from shellform.structure.model import Model
from shellform.structure.network import Network, assemble
from shellform.structure.solve.assembly import Assembly
from shellform.structure.solve.equilibrium import Equilibrium, find_equilibrium
from shellform.structure.solve.factorisation import NotPositiveDefinite
from shellform.structure.solve.loading import SMALLEST, apply_load
from shellform.structure.solve.residual import held

FAR = 0.05  # of the span from the perfect structure
STRAY = 0.01  # of the span from where a step was expected to end: the state belongs to another branch
STEP = 0.5  # of the load
_PATIENCE = 12  # factorisations of one step
_RELAXING = 40  # of the unloaded state, before it is sought from the target instead
_NOMINAL_STEP = 0.125  # of the load, from one kept state of the perfect structure's path to the next


@dataclass(frozen=True)
class Perfect:
    """The perfect structure under one `load` (n, 6): its `network`, `members`, which of the candidate cables are
    `present`, its unloaded state and those at `factors` (k,) of the load along its path, as far as that goes (all of it: `bears`);
    `imperfections` of shape."""

    network: Network
    members: Members
    present: Flags
    load: Reals
    start: State
    factors: Reals
    states: tuple[State, ...]
    bears: bool
    imperfections: Imperfections

    def __post_init__(self) -> None:
        object.__setattr__(self, "present", flags("present", self.present, (None,)))

    @property
    def unloaded(self) -> State:
        """The state without load."""
        return self.states[0]

    def at(self, factor: float) -> State | None:
        """The state at a factor of the load, between kept ones along the straight line; None beyond the path."""
        if factor > self.factors[-1]:
            return None
        k = int(np.clip(np.searchsorted(self.factors, factor), 1, max(len(self.factors) - 1, 1)))
        if len(self.factors) == 1:
            return self.states[0]
        share = (factor - self.factors[k - 1]) / (self.factors[k] - self.factors[k - 1])
        before, after = self.states[k - 1], self.states[k]
        return moved(before, share * _motion(before, after))


@dataclass(frozen=True)
class Outcome:
    """One drawn structure: the load `factor` up to which its stable branch was followed, whether it `stands`, how
    `far`, m, a node ends from the perfect structure's place (inf where it fell), its last `state` on the branch, and the
    `factorisations` spent."""

    number: int
    factor: float
    stands: bool
    far: float
    state: State
    factorisations: int


def perfect(shell: Gridshell, design: Design, load: Reals, *, shapes: int = SHAPES) -> Perfect:
    """The perfect structure of a design and its path under the dead `load` (n, 6). Raises NotConverged where it
    has no unloaded equilibrium."""
    return _perfect(
        shell.network(design), members_of(shell), np.asarray(design.present), load, shell.target, shapes
    )


def perfect_model(model: Model, load: str, *, shapes: int = SHAPES) -> Perfect:
    """The same of a model file and one of its load cases. Raises InputError for an unknown one."""
    if load not in model.loads:
        raise InputError(
            "there is no such load case",
            where="load",
            value=load,
            remedy=f"Known: {', '.join(model.loads)}.",
        )
    network, members = model.network, members_of_model(model)
    if model.start is None:
        raise InputError(
            "the model has no start from which its unloaded state could be sought",
            where="start",
            remedy="Give the bent state as start.",
        )
    positions = model.start.positions.copy()
    fixed = network.fixed[:, :3]
    positions[fixed] = (network.nodes + network.imposed[:, :3])[fixed]
    every = np.ones(len(network.cables.ends), dtype=bool)
    return _perfect(
        network, members, every, model.loads[load], State(positions, model.start.quaternions), shapes
    )


class Workshop:
    """Builds and loads drawn structures of one perfect structure, as many side by side as there are cores: each
    thread takes an assembly with a factor of its own."""

    def __init__(self, nominal: Perfect) -> None:
        self.nominal = nominal
        self._first = assemble(nominal.network)
        self._first.chords  # noqa: B018  made once, and shared by all that are copied from it
        self._idle: SimpleQueue[Assembly] = SimpleQueue()
        self._idle.put(self._first)

    def load(self, errors: Errors, *, number: int = 0, step: float = STEP, smallest: float = SMALLEST) -> Outcome:
        """The structure with the errors, loaded from nothing."""
        own = self._taken()
        try:
            return _Loading(self.nominal, own, errors, number).outcome(step, smallest)
        finally:
            self._idle.put(own)

    def drawn(
        self, tolerances: Tolerances, *, seed: int, numbers: Sequence[int], step: float = STEP
    ) -> list[Outcome]:
        """The structures of these numbers under the seed."""
        members = self.nominal.members

        def one(number: int) -> Outcome:
            errors = errors_of(members, tolerances, variables(members, seed, number))
            return self.load(errors, number=number, step=step)

        return side_by_side(one, list(numbers))

    def _taken(self) -> Assembly:
        try:
            return self._idle.get_nowait()
        except Exception:  # noqa: BLE001  queue.Empty
            other = assemble(self.nominal.network)
            other.__dict__["chords"] = self._first.chords
            return other


def _perfect(
    network: Network, members: Members, present: np.ndarray, load: Reals, target: State, shapes: int
) -> Perfect:
    assembly = assemble(network)
    none = np.zeros_like(load)
    unloaded = find_equilibrium(assembly, target, none)
    kept: list[tuple[float, State]] = [(0.0, unloaded.state)]
    reached = apply_load(
        assembly,
        unloaded.state,
        none,
        load,
        step=_NOMINAL_STEP,
        stay=True,
        report=lambda share, found: kept.append((share, found.state)),
    )
    soft = modes(assembly, kept[-1][1], shapes).shapes if shapes else np.zeros((0, *load.shape))
    return Perfect(
        network,
        members,
        present,
        load,
        target,
        np.array([share for share, _ in kept]),
        tuple(state for _, state in kept),
        reached.on_branch,
        Imperfections(unloaded.state, soft),
    )


def _motion(before: State, after: State) -> Reals:
    """Translations and spins (n, 6) from one state to another."""
    back = before.quaternions * np.array([1.0, -1.0, -1.0, -1.0])
    spins = rotation.to_vectors(rotation.product(after.quaternions, back))
    return np.hstack([after.positions - before.positions, spins])


class _Loading:
    """One structure under way."""

    def __init__(self, nominal: Perfect, assembly: Assembly, errors: Errors, number: int) -> None:
        self.nominal, self.errors, self.number = nominal, errors, number
        network = nominal.network
        shape = nominal.imperfections
        self.assembly = assembly.with_parts(
            (
                built_beams(network.beams, errors, shape),
                built_cables(network.cables, nominal.present, errors, shape),
            )
        )
        self.load = built_load(nominal.load, errors)
        self.spent = 0

    def outcome(self, step: float, smallest: float) -> Outcome:
        nominal = self.nominal
        state = self._unloaded()
        if state is None:
            return Outcome(self.number, 0.0, False, np.inf, nominal.unloaded, self.spent)
        factor, width, good = 0.0, step, 0
        while factor < 1.0:
            goal = 1.0 if factor + width > 1.0 - 1e-12 else factor + width
            there = self._step(state, factor, goal)
            if there is None:
                width, good = 0.5 * width, 0
                if width < smallest:
                    return Outcome(self.number, factor, False, np.inf, state, self.spent)
                continue
            state, factor, good = there, goal, good + 1
            if good == 2:
                width, good = min(2.0 * width, step), 0
        far = np.inf
        if nominal.bears:
            far = float(np.linalg.norm(state.positions - nominal.states[-1].positions, axis=1).max())
        stands = far <= FAR * nominal.members.span
        return Outcome(self.number, factor, stands, far, state, self.spent)

    def _unloaded(self) -> State | None:
        """The unloaded state: a first step takes supports and free nodes along with all errors at once."""
        none = np.zeros_like(self.load)
        start = self.nominal.unloaded
        offset = self.errors.supports
        balance = self.assembly.evaluate(start)
        pull = -balance.force
        if offset.any():
            pull = pull - self.assembly.force_along(start, offset)
        step = offset.ravel().copy()
        free = self.assembly.free
        try:
            self.spent += 1
            factor = self.assembly.matrix.factor(held(self.assembly, balance))
            step[free] = factor.solve(pull.ravel()[free])
            begin = moved(start, self.assembly.chords.corrected(start, step.reshape(-1, 6)))
            found = self._found(begin, none, limit=_RELAXING)
        except NotPositiveDefinite:
            found = None
        if found is not None:
            return found
        target = moved(self.nominal.start, offset)
        try:
            relaxed = find_equilibrium(self.assembly, target, none)
        except NotConverged as error:
            self.spent += error.iterations
            return None
        self.spent += relaxed.factorisations
        return relaxed.state if relaxed.stable else None

    def _step(self, state: State, factor: float, goal: float) -> State | None:
        before, after = self.nominal.at(factor), self.nominal.at(goal)
        begin = state
        if before is not None and after is not None:
            begin = moved(state, _motion(before, after))
        found = self._found(begin, goal * self.load, limit=_PATIENCE)
        if found is None:
            return None
        stray = float(np.abs(found.positions - begin.positions).max())
        return found if stray <= STRAY * self.nominal.members.span else None

    def _found(self, begin: State, load: Reals, *, limit: int) -> State | None:
        try:
            found: Equilibrium = find_equilibrium(self.assembly, begin, load, limit=limit, on_branch=True)
        except NotConverged as error:
            self.spent += error.iterations
            return None
        self.spent += found.factorisations
        return found.state if found.stable else None
