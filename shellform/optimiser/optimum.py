"""What an optimisation tells: its steps, where it stands on the way, and the design at its end."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from shellform.gridshell.gridshell import Design
from shellform.problem.problem import Problem
from shellform.reliability.trial_structures import Demand
from shellform.structure.elements.state import State
from shellform.structure.solve.loading import Loaded


@dataclass(frozen=True)
class Step:
    """One trial in the history: `objective` and its weighted `terms`, `constraints` by name (largest value of
    each), the `cables` in tension, the `stage` of the additional loads, whether it was `accepted`,
    `seconds` since the start, and the `phase` of the search, "" where it has none or it isn't known."""

    evaluation: int
    objective: float
    terms: Mapping[str, float]
    constraints: Mapping[str, float]
    cables: int
    stage: float
    accepted: bool
    seconds: float
    phase: str = ""


@dataclass(frozen=True)
class Checkpoint:
    """Where an optimisation stood before a trial: `numbers` and words by name, `arrays` by name, and the
    `history` so far.
    """

    numbers: Mapping[str, Any]
    arrays: Mapping[str, np.ndarray]
    history: tuple[Step, ...]


@dataclass(frozen=True)
class Optimum:
    """The solution: what the optimisation found: the `design` without its slack cables, how it carries each
    load on the documented path (`loaded`, with "none" first), the `history`, a `status` sentence, the work it
    took, of which factorisations in rejected trials were `wasted`, and the `stiffness`, N/m, that the softest
    mode had to keep under the additional loads; what is `asked` as built of what is made of it, None: nothing;
    numbers of drawn structures that have `fallen` in the search, and those that it kept in `mind`, with the
    factor of the largest load that each is to bear."""

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

    def __repr__(self) -> str:
        return (
            f"Optimum(objective {self.objective:.3g} from {self.objective_start:.3g}, "
            f"{int(self.design.present.sum())} cables, {self.evaluations} evaluations: {self.status})"
        )

    @property
    def states(self) -> dict[str, State]:
        """The equilibrium state by load case."""
        return {name: loaded.equilibrium.state for name, loaded in self.loaded.items()}
