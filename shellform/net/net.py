"""The Chebyshev net: a trimmed flat grid and its place on the target surface."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from shellform.arrays import Indices, Reals, indices
from shellform.net.grid import Grid
from shellform.structure.state import State


@dataclass(frozen=True)
class Quality:
    """How good the net is: lengths m, angles rad, curvature 1/m.

    `distance_max`, `distance_mean`: of crossings (the middle between their two nodes) from the surface; `spacing_error_max`:
    largest |chord between neighbouring crossings / spacing - 1|; `shear_angle_min`: smallest angle between the two rods of a
    crossing; `curvature_max`: largest resultant curvature of a rod; `pull_max`, `pull_mean`: what the springs still pull, in
    EI/s² of the rods, the paper's measure of how forced the grid is; `factorisations` that the pulling took.
    """

    distance_max: float
    distance_mean: float
    spacing_error_max: float
    shear_angle_min: float
    curvature_max: float
    pull_max: float
    pull_mean: float
    factorisations: int


@dataclass(frozen=True)
class Net:
    """`grid` flat; `target` its state on the surface, (n,) nodes; `supports` (s,) the nodes at the rods' ends; `quality`;
    `curvature` (m, 2), 1/m, of each rod element at its ends; `notes`: what was left out or changed, a sentence each."""

    grid: Grid
    target: State
    supports: Indices
    curvature: Reals
    quality: Quality
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        count = len(self.grid.flat)
        object.__setattr__(self, "supports", indices("supports", self.supports, (None,), below=count))

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


def crossing_points(grid: Grid, state: State) -> Reals:
    """Positions (c, 3), m, of the crossings: the middle between the nodes of the two rods."""
    return np.asarray(state.positions[grid.crossing_nodes].mean(axis=1))


def neighbours(grid: Grid) -> Indices:
    """Pairs (p, 2) of crossings that are next to each other on a rod, one spacing apart."""
    number = {(int(i), int(j)): k for k, (i, j) in enumerate(grid.lattice)}
    return np.array(
        [
            (k, number[place])
            for (i, j), k in number.items()
            for place in ((i + 1, j), (i, j + 1))
            if place in number
        ]
    ).reshape(-1, 2)


def cells(grid: Grid) -> Indices:
    """Crossings (q, 4) round each complete cell of the lattice: (i, j), (i+1, j), (i+1, j+1), (i, j+1)."""
    number = {(int(i), int(j)): k for k, (i, j) in enumerate(grid.lattice)}
    corners = ((0, 0), (1, 0), (1, 1), (0, 1))
    return np.array(
        [
            [number[(i + a, j + b)] for a, b in corners]
            for i, j in number
            if all((i + a, j + b) in number for a, b in corners)
        ]
    ).reshape(-1, 4)
