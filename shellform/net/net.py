"""The Chebyshev net: a trimmed flat grid and its place on the target surface."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from shellform.arrays import Indices, Reals, indices
from shellform.net.grid import Grid, crossing_points
from shellform.net.notes import NetNote
from shellform.net.quality import Quality
from shellform.net.refusal import Attempt
from shellform.structure.elements.state import State


@dataclass(frozen=True)
class Net:
    """`grid` flat; `target` its state on the surface, (n,) nodes; `supports` (s,) the nodes at the rods'
    ends; `quality`; `notes`: what was left out; `attempts` at it, the last of which gave it, where the first
    failed."""

    grid: Grid
    target: State
    supports: Indices
    quality: Quality
    notes: tuple[NetNote, ...] = ()
    attempts: tuple[Attempt, ...] = ()

    def __post_init__(self) -> None:
        count = self.node_count
        object.__setattr__(self, "supports", indices("supports", self.supports, (None,), below=count))

    @property
    def node_count(self) -> int:
        """How many nodes there are, those of both layers of rods."""
        return self.grid.node_count

    @property
    def curvature(self) -> Reals:
        """Resultant curvature (m, 2), 1/m, of each rod element at its two ends."""
        return np.asarray(np.linalg.norm(self.quality.curvature, axis=2))

    @property
    def spacing(self) -> float:
        """m."""
        return self.grid.spacing

    @property
    def crossings(self) -> Reals:
        """Target positions (c, 3), m, of the crossings: the middle between the nodes of the two rods."""
        return crossing_points(self.grid, self.target)

    def max_radius(self, *, young: float, strength: float) -> float:
        """Equation (1), m, for round rods with Young's modulus `young` and flexural strength `strength`, Pa.

        With M = EI kappa it reads r = strength / (young * curvature_max).
        """
        largest = self.quality.curvature_max
        return strength / (young * largest) if largest > 0.0 else math.inf
