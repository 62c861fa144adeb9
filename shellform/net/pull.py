"""Pulling an oversized flat grid onto a surface (operation 1 of the framework, after Kuijenhoven and Hoogenboom).

The grid is the structural model of section 3, with fictitious stiffness: rods, connectors between their two layers that
resist shear of the grid a little, and on every node a spring that slides on the surface (structure/spring.py). Implicit
dynamic relaxation finds the equilibrium for one spring density after the other: soft springs let the grid find its place
without folding, stiff ones bring it close.

Everything is measured in the rod's bending stiffness EI and the spacing s, so that the same settings suit a model of 0.9 m
and a hall of 100 m: EI = s² (N·m² with s in m), EA = 4 EI (s/r)²/s² with a slenderness s/r = 50, spring densities in EI/s³.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from shellform.arrays import Reals
from shellform.errors import NotConverged
from shellform.net.compass import Finder
from shellform.net.grid import Grid, grid_beams
from shellform.structure import rotation
from shellform.structure.assembly import Assembly
from shellform.structure.beam import Beams
from shellform.structure.equilibrium import find_equilibrium
from shellform.structure.spring import Distance, SlidingSprings
from shellform.structure.state import State

SPRING_DENSITY = (0.05, 0.5, 5.0)  # EI/s³; directly at 5 the grid folds (findings: 1e3 N/m at EI/s³ = 189 N/m)
SHEAR_STIFFNESS = 0.01  # of a connector against turning in the grid's plane, EI/s a radian
REACH=1.0
_SLENDERNESS = 50.0  # s/r
_TORSION = 1.0 / 1.3  # GJ/EI of a round rod with Poisson's ratio 0.3
_CONNECTOR = 10.0  # bending stiffness of a connector, EI/s a radian: stiff beside the rods
_TETHER = 5.0  # of the springs that hold the net's place and direction, EI/s³
_TOLERANCE = 1e-6  # residual of the last density; the others only lead there
_LEADING = 1e-3

Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class Pulled:
    """The grid's state on the surface: `curvature` (m, 2), 1/m, of the rod elements at their two ends, `pull` (n,), the
    spring force on each node in EI/s², and the `factorisations` it took."""

    state: State
    curvature: Reals
    pull: Reals
    factorisations: int


def pull(
    grid: Grid,
    finder: Finder,
    origin: Reals,
    frame: Reals,
    *,
    spring_density: Sequence[float] = SPRING_DENSITY,
    shear_stiffness: float = SHEAR_STIFFNESS,
    progress: Progress | None = None,
    limit: int = 1500,
) -> Pulled:
    """The state of the grid pulled from flat onto the surface of `finder`.

    The flat grid starts in the tangent plane at `origin` (3,), its axes turned by `frame` (3, 3). Raises NotConverged.
    """
    beams = fictitious_beams(grid, shear_stiffness)
    turned = rotation.from_matrices(np.broadcast_to(frame, (1, 3, 3)))
    state = State(origin + grid.flat @ frame.T, np.repeat(turned, len(grid.flat), axis=0))
    none = np.zeros((len(grid.flat), 6))
    unit = grid.spacing**2 / grid.spacing**3
    spent = 0
    loose = np.zeros((len(grid.flat), 6), dtype=bool)
    tethers = _tethers(grid, origin, frame)
    springs = None
    for stage, density in enumerate(spring_density):
        springs = sliding_springs(grid, finder, density)
        last = stage == len(spring_density) - 1
        assembly = Assembly(len(grid.flat), (beams, springs, *tethers), loose)
        try:
            found = find_equilibrium(
                assembly,
                state,
                none,
                tolerance=_TOLERANCE if last else _LEADING,
                limit=limit,
                reach=REACH*grid.spacing,
                progress=None if progress is None else lambda _, residual, q=density: progress(f"springs {q:g}", residual),
            )
        except NotConverged as error:
            raise NotConverged(
                f"The grid could not be pulled onto the surface with springs of density {density:g}: {error.what}",
                state=error.state,
                residual=error.residual,
                iterations=error.iterations,
                remedy="Try a smaller spacing, another angle, more shear_stiffness, or more steps in spring_density.",
            ) from error
        state, spent = found.state, spent + found.factorisations
    assert springs is not None
    return Pulled(state, _curvature(grid, beams, state), np.abs(springs.stretch(state)) * density * unit / 1.0, spent)


def fictitious_beams(grid: Grid, shear_stiffness: float) -> Beams:
    """Rods with EI = s² and connectors that keep the two layers' normals together and resist shear a little."""
    bending = grid.spacing**2
    axial = 4.0 * _SLENDERNESS**2 * bending / grid.spacing**2
    joint = bending * grid.gap / grid.spacing
    return grid_beams(
        grid,
        rod=(axial, _TORSION * bending, bending, bending),
        connector=(axial * grid.gap / grid.spacing, shear_stiffness * joint, _CONNECTOR * joint, _CONNECTOR * joint),
    )


def sliding_springs(grid: Grid, finder: Finder, density: float) -> SlidingSprings:
    """Springs of `density` EI/s³ on every node, each pulling to its layer's distance from the surface."""

    def distance(points: Reals) -> tuple[Reals, Reals]:
        foot = finder.foot(points)
        return foot.distance, foot.normal

    count = len(grid.flat)
    strength = np.full(count, density * grid.spacing**2 / grid.spacing**3)
    return SlidingSprings(np.arange(count), strength, grid.layer, distance)


def _curvature(grid: Grid, beams: Beams, state: State) -> Reals:
    """Resultant curvature (m, 2), 1/m, at the two ends of each rod element: M/EI of equation (1)."""
    count = len(grid.rod_ends)
    moments = beams.local_forces(state)[:count]
    stiffness = beams.bending_y[:count, None]
    return np.hypot(moments[:, [2, 5]], moments[:, [3, 6]]) / stiffness


def _tethers(grid: Grid, origin: Reals, frame: Reals) -> tuple[SlidingSprings, SlidingSprings]:
    """Springs that keep the net from drifting and turning on the surface, where nothing else holds it.

    The crossing at the lattice's origin is tied to the plane across u through `origin`; it and the crossings half-way out
    on its u rod are tied to the plane along u. Two planes and a long arm: held at one node, a net that would rather lie at
    another angle bends its rods sharply there.
    """

    def plane(normal: Reals) -> Distance:
        return lambda points: ((points - origin) @ normal, np.broadcast_to(normal, points.shape))

    middle = int(np.argmin(np.abs(grid.lattice).sum(axis=1)))
    along = np.flatnonzero(grid.lattice[:, 1] == grid.lattice[middle, 1])
    places = grid.lattice[along, 0]
    halfway = [int(along[np.argmin(np.abs(places - 0.5 * end))]) for end in (places.min(), places.max())]
    held = np.unique(grid.crossing_nodes[[middle, *halfway], 0])
    strength = _TETHER * grid.spacing**2 / grid.spacing**3
    return (
        SlidingSprings(grid.crossing_nodes[[middle], 0], np.full(1, strength), np.zeros(1), plane(frame[:, 0])),
        SlidingSprings(held, np.full(len(held), strength), np.zeros(len(held)), plane(frame[:, 1])),
    )
