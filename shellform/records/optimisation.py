"""What came of the optimisation and of rounding, as summary.json tells it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class CableCountRecord:
    """How many cables were `asked` for at the most, how many `cables` there are, and whether the wish is
    `kept`."""

    asked: int
    cables: int
    kept: bool


@dataclass(frozen=True)
class SymmetryRecord:
    """The `groups` of cables that symmetry makes alike, and whether one length each is `kept`."""

    groups: int
    kept: bool


@dataclass(frozen=True)
class OptimisationRecord:
    """What came of the optimisation.

    - `objective_start`, `objective_end`; `status`: a sentence on why it ended.
    - `constraints`: by name, at most 0 where kept: value over limit less 1, of a misfit the square of that,
      of softness and of least pulls as optimiser/limits_told.py reads them; `feasible`: whether the optimised
      design keeps them.
    - `iterations`, `evaluations` (`rejected` ones left the stable branch; those that were none better too
      are marked in history.csv), solved `equilibria`, and `factorisations` (those of rejected evaluations:
      `factorisations_rejected`): the work that it took.
    - `stiffness_min`, N/m, that the softest mode had to keep.
    - `not_polished`: why it wasn't.
    - `cables_max`, `symmetric`: what came of these wishes.
    - `deviation_wished`, m: how far a node may be off by what is saved (None: not said).
    - `cable_force_limit`, N: what a cable may pull (5).
    """

    objective_start: float
    objective_end: float
    iterations: int
    evaluations: int
    equilibria: int
    factorisations: int
    status: str
    constraints: Mapping[str, float]
    rejected: int = 0
    factorisations_rejected: int = 0
    stiffness_min: float | None = None
    feasible: bool | None = None
    not_polished: str | None = None
    cables_max: CableCountRecord | None = None
    symmetric: SymmetryRecord | None = None
    deviation_wished: float | None = None
    cable_force_limit: float | None = None


@dataclass(frozen=True)
class SectionRecord:
    """A section of the catalogue that was tried in rounding.

    - `section`: its name; `rod_radius`, m; `rod_mass`, kg, of all rods.
    - `rounded_up`: whether it is the one that the free radius is rounded up to.
    - `feasible`: whether its design keeps all limits, else `why_not`.
    - `objective`, `deviation_max`, `deviation_mean`, m, `cables` and `stress_utilisation_max`: None where it
      has no design.
    """

    section: str
    rod_radius: float
    rod_mass: float
    rounded_up: bool
    objective: float | None = field(metadata={"beside": "section"})
    deviation_max: float | None = field(metadata={"beside": "section"})
    deviation_mean: float | None = field(metadata={"beside": "section"})
    cables: int | None = field(metadata={"beside": "section"})
    stress_utilisation_max: float | None = field(metadata={"beside": "section"})
    feasible: bool
    why_not: str
