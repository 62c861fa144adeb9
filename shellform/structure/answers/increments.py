"""The equilibria that an analysis came to one after the other, as result.json tells them
(documentation/reference/model.md): those after each increment of the load, or the points of a path."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from shellform.arrays import Reals, Record


@dataclass(frozen=True)
class Waypoint:
    """An equilibrium inside an increment: at which load `factor`, found by how many `factorisations`, and
    whether it is `stable`."""

    factor: float
    factorisations: int
    stable: bool

    def document(self) -> dict[str, Any]:
        """As the file says it."""
        return {"factor": self.factor, "iterations": self.factorisations, "stable": self.stable}


@dataclass(frozen=True, eq=False)
class Reached(Record):
    """An equilibrium at which load `factor`, found by how many `factorisations`; how far each loaded node has
    moved, `displacements` (3,), m, by its number; whether it is `stable`, and how many pivots are
    `negative`."""

    factor: float
    factorisations: int
    displacements: Mapping[int, Reals]
    stable: bool
    negative: int

    def document(self) -> dict[str, Any]:
        """As the file says it."""
        return {
            "factor": self.factor,
            "iterations": self.factorisations,
            "displacements": {str(node): moved.tolist() for node, moved in self.displacements.items()},
            "stable": self.stable,
            "negative_pivots": self.negative,
        }


@dataclass(frozen=True, eq=False)
class LoadIncrement:
    """An increment of the load: what was `reached`, and the `waypoints` before it, if there were any."""

    reached: Reached
    waypoints: tuple[Waypoint, ...]

    def document(self) -> dict[str, Any]:
        """As the file says it."""
        return {**self.reached.document(), "steps": [each.document() for each in self.waypoints]}


@dataclass(frozen=True, eq=False)
class PathIncrement:
    """From one point of a path to the next: what was `reached`; the `rate`, 1/m, at which the factor goes
    with the path's length there; and the `event` there: "", "limit point" or "bifurcation"."""

    reached: Reached
    rate: float
    event: str

    def document(self) -> dict[str, Any]:
        """As the file says it."""
        return {**self.reached.document(), "rate": self.rate, "event": self.event}
