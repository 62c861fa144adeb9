"""Pulling an oversized flat grid onto a surface (operation 1 of the framework, after Kuijenhoven and
Hoogenboom).

The grid is the structural model of section 3, with fictitious stiffness: rods, connectors between their two
layers that resist shear of the grid a little, and on every node a spring that slides on the surface
(springs.py). Implicit dynamic relaxation finds the equilibrium for one spring density after the other: soft
springs let the grid find its place without folding, stiff ones bring it close.

Everything is measured in the rod's bending stiffness EI and the spacing s, so that the same settings suit a
model of 0.9 m and a hall of 100 m: EI = s² (N·m² with s in m), EA = 4 EI (s/r)²/s² with a slenderness s/r =
50, spring densities in EI/s³.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from shellform.arrays import Indices, Reals, Record
from shellform.errors import NotConverged
from shellform.net.compass import Finder
from shellform.net.grid import Grid, grid_beams
from shellform.net.refusal import Stalled
from shellform.net.springs import Distance, SlidingSprings
from shellform.structure.elements import rotation
from shellform.structure.elements.beam import Beams
from shellform.structure.elements.state import State
from shellform.structure.solve.assembly import Assembly
from shellform.structure.solve.equilibrium import find_equilibrium

FROM_FLAT = (0.05, 0.5, 5.0)  # EI/s³; directly at 5 a flat grid folds (findings: 1e3 N/m at EI/s³ = 189 N/m)
FROM_COMPASS = (5.0,)  # the compass net lies on the surface already
# of a connector against turning in the grid's plane, EI/s a radian; at 0.01 nets slide for ever
SHEAR_STIFFNESS = 0.1
REACH = 1.0  # spacing a step
LIMIT = 200  # factorisations at one density; nets that are found take up to half of that
_STALL = 40  # steps that bring the residual down by less than a fifth, once it is
_LITTLE = 1e-3  # residual below which a pull that gains no more has stalled
_SLENDERNESS = 50.0  # s/r
_TORSION = 1.0 / 1.3  # GJ/EI of a round rod with Poisson's ratio 0.3
_CONNECTOR = 10.0  # bending stiffness of a connector, EI/s a radian: stiff beside the rods
_TETHER = 5.0  # of the springs that hold the net's place and direction, EI/s³
TOLERANCE = 1e-8  # residual
_LEADING = 1e-3  # residual at which the springs of one density give way to the next

Pulling = Callable[[str, float], None]
"""Called while a net is pulled with what is done and the residual."""


@dataclass(frozen=True, eq=False)
class Pulled(Record):
    """The grid's state on the surface: `curvature` (m, 2, 2), 1/m, at the two ends of each rod element out of
    and in the surface's tangent plane, `pull` (n,), the spring force on each node in EI/s², and the
    `factorisations` it took."""

    state: State
    curvature: Reals
    pull: Reals
    factorisations: int


def flat_start(grid: Grid, origin: Reals, frame: Reals) -> State:
    """The flat grid in the tangent plane at `origin` (3,), its axes turned by `frame` (3, 3)."""
    turned = rotation.from_matrices(frame[None])
    return State(origin + grid.flat @ frame.T, np.repeat(turned, len(grid.flat), axis=0))


def compass_start(grid: Grid, finder: Finder, places: Indices, points: Reals) -> State:
    """The grid laid along the compass net, `points` (c, 3) at lattice `places` (c, 2): each rod a cubic
    spline through its crossings, its nodes on their layers and turned with the surface."""
    known = {(int(i), int(j)): point for (i, j), point in zip(places, points, strict=True)}
    through = np.array([known[(int(i), int(j))] for i, j in grid.lattice])
    place, tangent = np.empty((2, *grid.flat.shape))
    across = np.empty(len(grid.flat), dtype=bool)
    for rod in grid.rods:
        curve = CubicSpline(rod.marks, through[rod.crossings]) if len(rod.crossings) > 2 else None
        if curve is None:
            ends = through[rod.crossings]
            share = ((rod.arc - rod.marks[0]) / (rod.marks[-1] - rod.marks[0]))[:, None]
            place[rod.nodes], tangent[rod.nodes] = (
                (1.0 - share) * ends[0] + share * ends[-1],
                ends[-1] - ends[0],
            )
        else:
            within = np.clip(rod.arc, rod.marks[0], rod.marks[-1])  # straight on past its last crossing
            place[rod.nodes], tangent[rod.nodes] = curve(within), curve(within, 1)
            beyond = (rod.arc - within)[:, None]
            if beyond.any():
                place[rod.nodes] += beyond * tangent[rod.nodes]
        across[rod.nodes] = rod.direction == "v"
    foot = finder.foot(place)
    normal = foot.normal
    along = tangent - np.sum(tangent * normal, axis=1, keepdims=True) * normal
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    side = np.cross(normal, along)
    axes = np.where(
        across[:, None, None],
        np.stack([-side, along, normal], axis=2),
        np.stack([along, side, normal], axis=2),
    )
    return State(foot.point + grid.layer[:, None] * normal, rotation.from_matrices(axes))


def pull(
    grid: Grid,
    finder: Finder,
    start: State,
    origin: Reals,
    frame: Reals,
    *,
    spring_density: Sequence[float] = FROM_COMPASS,
    shear_stiffness: float = SHEAR_STIFFNESS,
    guided: bool = False,
    progress: Pulling | None = None,
    limit: int = LIMIT,
    reach: float = REACH,
    tolerance: float = TOLERANCE,
) -> Pulled:
    """The state of the grid pulled onto the surface of `finder` from the state `start`.

    `origin` (3,) and `frame` (3, 3) of u, v and normal are where the lattice's origin is to stay; where the
    start is `guided` by a curve, the rod through the origin keeps to it instead of a plane. At most `limit`
    factorisations a density, steps of at most `reach` spacings, down to a residual of `tolerance`. Raises
    Stalled, which it does early where steps have stopped to bring anything.
    """
    beams = fictitious_beams(grid, shear_stiffness)
    state = start
    none = np.zeros((len(grid.flat), 6))
    spent = 0
    loose = np.zeros((len(grid.flat), 6), dtype=bool)
    tethers = _tethers(grid, origin, frame, start if guided else None)
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
                tolerance=tolerance if last else _LEADING,
                limit=limit,
                reach=reach * grid.scale,
                progress=_watched(progress, density),
            )
        except NotConverged as error:
            raise Stalled(
                f"The grid could not be pulled onto the surface with springs of density {density:g}: "
                f"{error.what}",
                state=error.state,
                residual=error.residual,
                iterations=spent + error.iterations,
                remedy="Try a smaller spacing, another angle, more shear_stiffness, or more steps in "
                "spring_density.",
            ) from error
        state, spent = found.state, spent + found.factorisations
    assert springs is not None
    return Pulled(
        state, _curvature(grid, beams, state), density / grid.scale * np.abs(springs.stretch(state)), spent
    )


def _watched(progress: Pulling | None, density: float) -> Callable[[int, float], None]:
    """Tells the `progress` of one density, and ends a relaxation that has stopped to come nearer: what is
    left then is the surface's, known to a finite order, against which no step helps."""
    residuals: list[float] = []

    def watch(spent: int, residual: float) -> None:
        if progress is not None:
            progress(f"springs of {density:g} EI/s³", residual)
        residuals.append(residual)
        recent = residuals[-_STALL:]
        if len(recent) == _STALL and max(recent) < _LITTLE and residual > 0.8 * recent[0]:
            raise NotConverged(
                f"The residual stays at {residual:.1e}",
                residual=residual,
                iterations=spent,
                remedy="Choose a smaller spacing or another angle.",
            )

    return watch


def fictitious_beams(grid: Grid, shear_stiffness: float) -> Beams:
    """Rods with EI = s² and connectors that keep the two layers' normals together and resist shear a
    little.
    """
    bending = grid.scale**2
    axial = 4.0 * _SLENDERNESS**2 * bending / grid.scale**2
    joint = bending * grid.gap / grid.scale
    return grid_beams(
        grid,
        rod=(axial, _TORSION * bending, bending, bending),
        connector=(
            axial * grid.gap / grid.scale,
            shear_stiffness * joint,
            _CONNECTOR * joint,
            _CONNECTOR * joint,
        ),
    )


def sliding_springs(grid: Grid, finder: Finder, density: float) -> SlidingSprings:
    """Springs of `density` EI/s³ on every node, each pulling to its layer's distance from the surface."""

    def distance(points: Reals) -> tuple[Reals, Reals, Reals]:
        foot = finder.foot(points)
        return foot.distance, foot.normal, foot.hessian

    count = len(grid.flat)
    strength = np.full(count, density / grid.scale)
    return SlidingSprings(np.arange(count), strength, grid.layer, distance)


def _curvature(grid: Grid, beams: Beams, state: State) -> Reals:
    """Curvature (m, 2, 2), 1/m, at the two ends of each rod element, out of plane (positive over a crown) and
    in plane: M/EI of equation (1), the end moments of an evenly bent element being opposite."""
    count = len(grid.rod_ends)
    moments = beams.local_forces(state)[:count, [[2, 3], [5, 6]]]
    return np.asarray(moments * [[[1.0, 1.0], [-1.0, -1.0]]] / beams.bending_y[:count, None, None])


def laid(grid: Grid, state: State) -> Pulled:
    """The grid as it lies, without springs: what the compass method alone gives."""
    beams = fictitious_beams(grid, SHEAR_STIFFNESS)
    return Pulled(state, _curvature(grid, beams, state), np.zeros(len(grid.flat)), 0)


def _tethers(
    grid: Grid, origin: Reals, frame: Reals, start: State | None
) -> tuple[SlidingSprings, SlidingSprings]:
    """Springs that keep the net from drifting and turning on the surface, where nothing else holds it.

    The crossing at the lattice's origin is tied to the plane across u through `origin`; it and the crossings
    half-way out on its u rod are tied to the plane along u. Two planes and a long arm: held at one node, a
    net that would rather lie at another angle bends its rods sharply there. Of a given `start`, they keep
    their distance from the second plane.
    """

    def plane(normal: Reals) -> Distance:
        return lambda points: (
            (points - origin) @ normal,
            np.broadcast_to(normal, points.shape),
            np.zeros((len(points), 6)),
        )

    middle = int(np.argmin(np.abs(grid.lattice).sum(axis=1)))
    along = np.flatnonzero(grid.lattice[:, 1] == grid.lattice[middle, 1])
    places = grid.lattice[along, 0]
    halfway = [int(along[np.argmin(np.abs(places - 0.5 * end))]) for end in (places.min(), places.max())]
    held = np.unique(grid.crossing_nodes[[middle, *halfway], 0])
    strength = _TETHER / grid.scale
    level = np.zeros(len(held)) if start is None else (start.positions[held] - origin) @ frame[:, 1]
    return (
        SlidingSprings(
            grid.crossing_nodes[[middle], 0], np.full(1, strength), np.zeros(1), plane(frame[:, 0])
        ),
        SlidingSprings(held, np.full(len(held), strength), level, plane(frame[:, 1])),
    )
