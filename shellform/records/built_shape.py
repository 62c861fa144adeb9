"""What structures drawn as they would be built come to under the design load: how far they are off, and what
their rods and cables bear.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class BuiltShapeRecord:
    """The shape of so many `structures` drawn as they would be built, at rest under the load: of their nodes'
    largest distances from the target, m, the median, `deviation_max`, and the largest, `deviation_max_worst`;
    the median of their mean distances, `deviation_mean`. To first order each of the `causes` of error, by
    name, moves a node by so much, m, root mean square, where it is the only one. Of the largest stresses in
    their rods, over the strength, the median, `stress_utilisation_max`, and the largest,
    `stress_utilisation_max_worst`; so `cable_force_max` and `cable_force_max_worst`, N, of their cables
    (None: of older runs)."""

    structures: int
    deviation_max: float
    deviation_max_worst: float
    deviation_mean: float
    causes: Mapping[str, float] = field(default_factory=dict)
    stress_utilisation_max: float | None = None
    stress_utilisation_max_worst: float | None = None
    cable_force_max: float | None = None
    cable_force_max_worst: float | None = None

    @property
    def stress(self) -> tuple[float, float] | None:
        """The rods' stress over their strength, the median and the largest; None where that isn't known."""
        return _pair(self.stress_utilisation_max, self.stress_utilisation_max_worst)

    @property
    def pull(self) -> tuple[float, float] | None:
        """The cables' force, N, the median and the largest; None where there are none or it isn't known."""
        return _pair(self.cable_force_max, self.cable_force_max_worst)


def _pair(usual: float | None, worst: float | None) -> tuple[float, float] | None:
    return (usual, worst) if usual and worst else None
