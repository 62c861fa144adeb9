"""What scatter does to a design's shape, as summary.json tells it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class CauseRecord:
    """A cause of scatter: its share of the shape's scatter, and of the misfit's variance."""

    shape: float
    variance: float


@dataclass(frozen=True)
class SampleRecord:
    """Drawn structures: their `count`, those `lost` without an equilibrium, and the others' misfit, m²."""

    count: int
    lost: int
    misfit_mean: float | None = field(default=None, metadata={"beside": "count"})
    misfit_deviation: float | None = field(default=None, metadata={"beside": "count"})


@dataclass(frozen=True)
class RobustRecord:
    """What scatter does to a `design`: misfits, m², as sums over all nodes, distances, m, as root mean
    squares a node; `wander_max`, m: the largest scatter of a node; `causes` by name."""

    design: str
    misfit: float
    misfit_mean: float
    misfit_deviation: float
    deviation_rms: float
    deviation_rms_mean: float
    wander_max: float
    causes: Mapping[str, CauseRecord]
    sentences: tuple[str, ...]
    sample: SampleRecord | None = None
