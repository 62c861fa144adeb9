"""What an optimisation tells: its steps, where it stands on the way, and the design at its end."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from shellform.arrays import Reals, Record
from shellform.errors import InputError
from shellform.gridshell.gridshell import Design
from shellform.problem.problem import Problem
from shellform.reliability.requirements import Demand
from shellform.reliability.resting import Resting
from shellform.structure.elements.state import State
from shellform.structure.solve.loading import Loaded


@dataclass(frozen=True)
class Step:
    """One trial in the history.

    - `evaluation`: its number.
    - `objective` and its weighted `terms` by name, those of one name added up; `constraints` by name, the
      largest value of all of that name, at most 0 where they are kept.
    - `cables` in tension under the design load; `stage`: share of the additional loads.
    - `accepted`: whether it was; `seconds` since the start.
    - `phase` of the search, "" where it has none or it isn't known.
    """

    evaluation: int
    objective: float
    terms: Mapping[str, float]
    constraints: Mapping[str, float]
    cables: int
    stage: float
    accepted: bool
    seconds: float
    phase: str = ""


@dataclass(frozen=True, eq=False)
class Checkpoint(Record):
    """Where an optimisation stood before a trial: `numbers` and words by name, `arrays` by name, and the
    `history` so far.
    """

    numbers: Mapping[str, Any]
    arrays: Mapping[str, np.ndarray]
    history: tuple[Step, ...]

    def require(self, numbers: Collection[str]) -> None:
        """Raises InputError where it hasn't these `numbers`: another solver wrote it."""
        if not set(numbers) <= set(self.numbers):
            raise InputError(
                "was written by a search with another solver",
                where="resume",
                remedy="Go on with the solver, problem and start that wrote it, or leave resume out.",
            )


def arrays_of(states: Mapping[str, State], prefix: str = "") -> dict[str, np.ndarray]:
    """The states by load case as a checkpoint has them, to their last digit; `prefix` begins each name."""
    found: dict[str, np.ndarray] = {}
    for name, state in states.items():
        found |= {
            f"{prefix}{name} positions": state.positions,
            f"{prefix}{name} quaternions": state.quaternions,
        }
        if state.tail is not None:
            found[f"{prefix}{name} tail"] = state.tail
    return found


def states_of(arrays: Mapping[str, np.ndarray], names: Iterable[str], prefix: str = "") -> dict[str, State]:
    """The states of these load cases from what `arrays_of` made of them."""
    return {
        name: State(
            arrays[f"{prefix}{name} positions"],
            arrays[f"{prefix}{name} quaternions"],
            arrays.get(f"{prefix}{name} tail"),
        )
        for name in names
    }


@dataclass(frozen=True, eq=False)
class Optimum:
    """What an optimisation found.

    The design:
    - `design`, without its slack cables, and how it carries each load on the documented path, `loaded`,
      "none" first.
    - `objective`, and of the start `objective_start`; `constraints` by name, the largest value of all of that
      name, at most 0 where they are kept.
    - `problem` that it answers; `stiffness`, N/m, that the softest mode had to keep under the additional
      loads.

    The search:
    - `history` of its trials; `status`: a sentence on why it ended.
    - `evaluations` of designs, `rejected` ones among them; `equilibria`, `factorisations`, of which those in
      rejected trials were `wasted`.

    As built:
    - `asked` of what is made of it, None: nothing.
    - `fallen`: numbers of drawn structures that have in the search; `mind`: those that it kept in mind, with
      the factor of the largest load that each is to bear; where those that it tried `rested` in the last
      design that stood (trial_structures.py).
    """

    problem: Problem
    design: Design
    loaded: Mapping[str, Loaded]
    objective_start: float
    objective: float
    constraints: Mapping[str, float]
    history: Sequence[Step]
    status: str
    evaluations: int
    rejected: int
    equilibria: int
    factorisations: int
    wasted: int
    stiffness: float
    asked: Demand | None = None
    fallen: tuple[int, ...] = ()
    mind: Mapping[int, float] = field(default_factory=dict)
    rested: Mapping[str, Resting] = field(default_factory=dict)

    def __repr__(self) -> str:
        return (
            f"Optimum(objective {self.objective:.3g} from {self.objective_start:.3g}, "
            f"{int(self.design.present.sum())} cables, {self.evaluations} evaluations: {self.status})"
        )

    @property
    def states(self) -> dict[str, State]:
        """The equilibrium state by load case."""
        return {name: loaded.equilibrium.state for name, loaded in self.loaded.items()}


def terms_by_name(problem: Problem, values: Reals) -> dict[str, float]:
    """The values (t,) of the objective's terms by their columns' names, those of one name added up."""
    found: dict[str, float] = {}
    for part, value in zip(problem.minimise, values, strict=True):
        name = problem.column(part.term)
        found[name] = found.get(name, 0.0) + float(value)
    return found


def largest(named: Iterable[tuple[str, float]]) -> dict[str, float]:
    """Values by name, of one name the largest."""
    found: dict[str, float] = {}
    for name, value in named:
        found[name] = max(found.get(name, value), value)
    return found


def by_constraint(steps: Sequence[Step]) -> dict[str, list[float]]:
    """The constraints of steps by name, nan at those that had none of a name: a search that stops asking for
    stiffness goes on without that one."""
    names = dict.fromkeys(name for step in steps for name in step.constraints)
    return {name: [step.constraints.get(name, np.nan) for step in steps] for name in names}


def worse(objective: float, share: float) -> float:
    """What is worse than an objective of either sign by a `share` of its size; better, of a share below 0."""
    return (1.0 + share) * objective if objective >= 0.0 else (1.0 - share) * objective
