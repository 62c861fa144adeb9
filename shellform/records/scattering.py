"""What scatter does to a design's shape, as summary.json tells it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class CauseRecord:
    """A cause of error: its share of the scatter of the `shape`, and of that part of the misfit's `variance`
    that comes of where the design as planned is off."""

    shape: float
    variance: float


@dataclass(frozen=True)
class SampleRecord:
    """Drawn structures that were loaded: their `count`, those `lost` since they fall, and the others'
    `misfit_mean` and `misfit_deviation`, m²."""

    count: int
    lost: int
    misfit_mean: float | None = field(default=None, metadata={"beside": "count"})
    misfit_deviation: float | None = field(default=None, metadata={"beside": "count"})


@dataclass(frozen=True)
class RobustRecord:
    """What scatter does to a `design`: its `misfit` as planned, `misfit_mean` and `misfit_deviation` as
    built, to first order in the errors, m², as sums over all nodes; `deviation_rms` as planned and
    `deviation_rms_mean`, m, root mean squares over the nodes; `wander_max`, m: the largest scatter of a
    node; `causes` by name; the same in `sentences`; and a drawn `sample`."""

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
