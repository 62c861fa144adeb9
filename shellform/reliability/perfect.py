"""The perfect structure of a design or a model file and its path under one load, from which drawn structures
start."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shellform.arrays import Flags, Reals, Record, flags
from shellform.errors import InputError, require_known
from shellform.gridshell.gridshell import Design, Gridshell
from shellform.reliability.branch import Branch
from shellform.reliability.drawing import SOFT_MODES, Imperfections
from shellform.reliability.members import Members, members_of, members_of_model
from shellform.structure.answers.request import with_supports_moved
from shellform.structure.answers.stability import modes
from shellform.structure.elements.state import State
from shellform.structure.model import Model
from shellform.structure.network import Network, assemble
from shellform.structure.solve.equilibrium import find_equilibrium
from shellform.structure.solve.loading import SMALLEST

NOMINAL_STEP = 0.125  # of the load, from one kept state of the perfect structure's path to the next
FAR = 0.05  # of the span from the perfect structure: what rests farther away has fallen
TO_ITS_END = 0.5  # the same where only the last one is asked for


@dataclass(frozen=True, eq=False)
class Perfect(Record):
    """The perfect structure under one load, and its path.

    - `network`; `members`; `present` (c,): which of the candidate cables it has; dead `load` (n, 6).
    - `start`: the state in which its unloaded one is sought.
    - `factors` (k,) of the load along its path, 0 first, as far as that goes, with the `states` there;
      `bears`: whether that is all of the load.
    - `imperfections` of shape with which structures are drawn.
    """

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

    def farthest(self, state: State) -> float:
        """How far, m, a node of a drawn structure at rest under the whole load lies from this one's place, at
        most; inf where this one doesn't bear that load."""
        if not self.bears:
            return np.inf
        return float(np.linalg.norm(state.positions - self.states[-1].positions, axis=1).max())

    def lies_beside(self, state: State) -> bool:
        """Whether that is within FAR of the span, as of a structure that stands."""
        return self.farthest(state) <= FAR * self.members.span

    def known_to(self, most: float) -> tuple[float, State]:
        """The largest factor of the load, up to `most`, to which the path is known, and the state there."""
        last = int(np.count_nonzero(self.factors <= most)) - 1
        return float(self.factors[last]), self.states[last]


def perfect(
    shell: Gridshell,
    design: Design,
    load: Reals,
    *,
    shapes: int = SOFT_MODES,
    step: float = NOMINAL_STEP,
    heeding: bool = True,
) -> Perfect:
    """The perfect structure of a design and its path under the dead `load` (n, 6), in steps of a share of it;
    0: it isn't followed, since drawn structures begin at its unloaded state. `heeding`: steps that may pass
    over an unstable stretch are halved (outlook.py). Raises NotConverged where there is no unloaded state."""
    network, present = shell.network(design), np.asarray(design.present)
    return _perfect(network, members_of(shell), present, load, shell.target, shapes, step, heeding)


def perfect_of(model: Model, load: str, *, shapes: int = SOFT_MODES, step: float = NOMINAL_STEP) -> Perfect:
    """The same of a model file and one of its load cases. Raises InputError for an unknown one."""
    require_known(load, model.loads, where="load", what="there is no such load case")
    network, members = model.network, members_of_model(model)
    if model.start is None:
        raise InputError(
            "the model has no start from which its unloaded state could be sought",
            where="start",
            remedy="Give the bent state as start.",
        )
    every = np.ones(len(network.cables.ends), dtype=bool)
    start = with_supports_moved(network, model.start)
    return _perfect(network, members, every, model.loads[load], start, shapes, step, heeding=True)


def _perfect(
    network: Network,
    members: Members,
    present: np.ndarray,
    load: Reals,
    target: State,
    shapes: int,
    step: float,
    heeding: bool,
) -> Perfect:
    assembly = assemble(network)
    none = np.zeros_like(load)
    unloaded = find_equilibrium(assembly, target, none)
    kept: list[tuple[float, State]] = [(0.0, unloaded.state)]
    branch = Branch(assembly, load, members.span)
    here = branch.at(unloaded.state) if step > 0.0 else None
    reached = 0.0
    if here is not None:
        _, reached = branch.along(
            here,
            0.0,
            1.0,
            step,
            SMALLEST,
            lambda factor, state: kept.append((factor, state)),
            heeding=heeding,
        )
    soft = modes(assembly, kept[-1][1], shapes).shapes if shapes else np.zeros((0, *load.shape))
    return Perfect(
        network=network,
        members=members,
        present=present,
        load=load,
        start=target,
        factors=np.array([share for share, _ in kept]),
        states=tuple(state for _, state in kept),
        bears=reached == 1.0,
        imperfections=Imperfections(unloaded.state, soft),
    )
