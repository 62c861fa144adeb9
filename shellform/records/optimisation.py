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
    """What came of the optimisation: `objective_start` and `objective_end`; the work that it took, in
    `iterations`, `evaluations` (so many of them `rejected`), solved `equilibria` and `factorisations` (those
    of rejected evaluations: `factorisations_rejected`); `stiffness_min`, N/m, that the softest mode had to
    keep; its `status`, a sentence; `constraints` as value over limit less 1; whether the optimised design is
    `feasible`; why it was `not_polished`; what came of the wishes `cables_max` and `symmetric`; how far, m, a node may be
    off by what is saved (`deviation_wished`, None: not said)."""

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


@dataclass(frozen=True)
class SectionRecord:
    """A `section` of the catalogue that was tried in rounding: its `rod_radius`, m, `rod_mass`, kg, of all
    rods, whether it is the one `rounded_up` to, and whether it is `feasible`, else `why_not`; its
    `objective`, `deviation_max`, `deviation_mean`, m, `cables` and `stress_utilisation_max`, None where it
    has no design."""

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
