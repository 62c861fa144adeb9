"""How good a net is: numbers for the summary, values for maps, and what is refused.

A net is refused where a cell is turned over or folded, where two parts of it lie on one another, and where it
stays off the surface: too much curvature for the spacing. In each case the refusal says where.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from shellform.arrays import Reals, Record, reals
from shellform.errors import how_many
from shellform.net.compass import Finder, gaussian
from shellform.net.grid import Grid, cells, crossing_points, neighbours
from shellform.net.refusal import NoNet, Reason
from shellform.quantities import rounded
from shellform.structure.elements.rotation import matrices
from shellform.structure.elements.state import State

_FAR = 0.1  # of the spacing: a net farther from the surface is refused
SPACING_ERROR = 0.005  # of the spacing: more is told, and not proposed (2.9 spacings of radius, or 100 gaps)
_OVERLAP = 0.4  # of the spacing: nearer to each other two crossings that aren't neighbours lie on one another


@dataclass(frozen=True)
class NetNumbers:
    """How good a net is, in numbers. Lengths in m, angles in rad, curvature in 1/m.

    - `distance_max`, `distance_mean`: of crossings (the middle between their two nodes) from the surface.
    - `spacing_error_max`: largest |chord between neighbouring crossings / spacing - 1|.
    - `shear_angle_min`: smallest angle between the two rods of a crossing.
    - `curvature_max`: largest resultant curvature of a rod; `curvature_out_of_plane_max` and
      `curvature_in_plane_max`: its parts out of and in the surface's tangent plane.
    - `pull_max`, `pull_mean`: what the springs still pull, in EI/s² of the rods, the paper's measure of how
      forced the grid is.
    - `uncovered_area`, m²: farther from any rod than three quarters of the spacing (cover.py).
    - `gaussian_curvature`, rad: of the surface, added up over the net's cells.
    - `factorisations` that the pulling took.
    """

    distance_max: float
    distance_mean: float
    spacing_error_max: float
    shear_angle_min: float
    curvature_max: float
    curvature_out_of_plane_max: float
    curvature_in_plane_max: float
    pull_max: float
    pull_mean: float
    uncovered_area: float
    gaussian_curvature: float
    factorisations: int


@dataclass(frozen=True, eq=False)
class Quality(Record, NetNumbers):
    """The numbers, and what maps show: `distance` (c,), signed, and `shear_angle` (c,) of crossings;
    `spacing_error` (p,), signed, of the pairs of neighbours; `curvature` (m, 2, 2) of rod elements at their
    two ends, out of and in plane; `pull` (n,) of nodes."""

    distance: Reals
    shear_angle: Reals
    spacing_error: Reals
    curvature: Reals
    pull: Reals

    def __post_init__(self) -> None:
        for name in MAPS:
            shape = (None, 2, 2) if name == "curvature" else (None,)
            object.__setattr__(self, name, reals(name, getattr(self, name), shape))

    def summary(self) -> dict[str, Any]:
        """The numbers without the maps."""
        return {field.name: getattr(self, field.name) for field in dataclasses.fields(NetNumbers)}


MAPS = ("distance", "shear_angle", "spacing_error", "curvature", "pull")


def measure(
    finder: Finder, grid: Grid, state: State, curvature: Reals, pull: Reals, *, spent: int, bare: float
) -> Quality:
    """The quality of the trimmed grid in its state; `curvature` (m, 2, 2) of its rod elements, `pull` (n,) on
    its nodes; `spent`, factorisations; `bare`, m² of the surface.
    """
    points = crossing_points(grid, state)
    distance = finder.foot(points).distance
    pairs, steps = neighbours(grid)
    chord = np.linalg.norm(points[pairs[:, 1]] - points[pairs[:, 0]], axis=1)
    error = chord / steps - 1.0
    angle = shear_angles(grid, state)
    bent = np.abs(curvature)
    corners = points[cells(grid)]
    return Quality(
        distance_max=float(np.abs(distance).max()),
        distance_mean=float(np.abs(distance).mean()),
        spacing_error_max=float(np.abs(error).max()),
        shear_angle_min=float(angle.min(initial=0.5 * math.pi)),
        curvature_max=float(np.hypot(bent[..., 0], bent[..., 1]).max()),
        curvature_out_of_plane_max=float(bent[..., 0].max()),
        curvature_in_plane_max=float(bent[..., 1].max()),
        pull_max=float(pull.max(initial=0.0)),
        pull_mean=float(pull.mean()),
        uncovered_area=bare,
        gaussian_curvature=float(gaussian(finder, corners).sum()) if len(corners) else 0.0,
        factorisations=spent,
        distance=distance,
        shear_angle=angle,
        spacing_error=error,
        curvature=curvature,
        pull=pull,
    )


def shear_angles(grid: Grid, state: State) -> Reals:
    """The angle (c,), rad, at most 90°, between the axes of the two rods of each crossing."""
    first, second = (
        matrices(state.quaternions[grid.crossing_nodes[:, layer]])[:, :, layer] for layer in (0, 1)
    )
    cosine = np.abs(np.sum(first * second, axis=1))
    return np.asarray(np.arccos(np.clip(cosine, 0.0, 1.0)))


def refuse_folds(finder: Finder, grid: Grid, state: State) -> None:
    """Raises InputError where cells are turned over or two parts of the net lie on one another."""
    points = crossing_points(grid, state)
    quads = cells(grid)
    corner = points[quads]
    sides = np.roll(corner, -1, axis=1) - corner
    normal = finder.foot(corner.mean(axis=1)).normal
    turned = np.sum(np.cross(np.roll(sides, 1, axis=1), sides) * normal[:, None], axis=2) <= 0.0
    folded = turned.any(axis=1)
    if folded.any():
        middle = rounded(corner[np.argmax(folded)].mean(axis=0))
        raise NoNet(
            Reason.FOLDED,
            f"the net folds over itself in {how_many(int(folded.sum()), 'cell', 'cells')}, first at {middle}: the surface, whose "
            "Gaussian curvature adds up "
            f"to {float(gaussian(finder, corner).sum()):.2f} there, is curved more than rods at this spacing "
            "can follow",
            where="net.spacing",
            value=float(grid.spacing),
            remedy="Choose a smaller spacing, another angle, or a flatter surface.",
        )
    close = cKDTree(points).query_pairs(_OVERLAP * min(grid.spacing, grid.spacing_v), output_type="ndarray")
    apart = np.abs(grid.lattice[close[:, 0]] - grid.lattice[close[:, 1]]).max(axis=1, initial=0) > 1
    if apart.any():
        place = rounded(points[close[np.argmax(apart), 0]])
        raise NoNet(
            Reason.OVERLAPPING,
            f"two parts of the net lie on one another in {int(apart.sum())} places, first at {place}",
            where="net.spacing",
            value=float(grid.spacing),
            remedy="Choose another angle or offset.",
        )


def refuse_distance(quality: Quality, grid: Grid, state: State) -> None:
    """Raises InputError for a net that stays off its surface."""
    if quality.distance_max > _FAR * grid.scale:
        worst = rounded(crossing_points(grid, state)[np.argmax(np.abs(quality.distance))])
        raise NoNet(
            Reason.OFF,
            f"the net stays {quality.distance_max:.3g} m off the surface at {worst}: "
            "it is curved more there than a grid of straight rods can follow",
            where="net.spacing",
            value=float(grid.spacing),
            remedy="Choose a smaller spacing, another angle, or a smoother surface.",
        )


def nearness(quality: Quality, grid: Grid, state: State) -> str:
    """Where neighbouring crossings lie nearer than their spacing or farther, by more than `SPACING_ERROR`, in
    words; empty where none do. Where a rod of length s bends to a radius R its chord is s²/(24 R²) shorter;
    and crossings are counted in the middle between two rods g apart, where they lie g/(2 R) nearer or farther
    than along the rods' own axes."""
    error = quality.spacing_error
    if quality.spacing_error_max <= SPACING_ERROR:
        return ""
    worst = int(np.argmax(np.abs(error)))
    points = crossing_points(grid, state)
    place = rounded(points[neighbours(grid)[0][worst]].mean(axis=0))
    off, usual = 100.0 * abs(error[worst]), f"{100.0 * SPACING_ERROR:.2f}"
    told = f"{off:.2f}" if f"{off:.2f}" != usual else f"{off:.4f}"  # what it may be isn't what it is
    return (
        f"crossings at {place} lie {told} % {'nearer' if error[worst] < 0.0 else 'farther'} "
        f"than their spacing, where up to {usual} % is usual: rods are bent there too sharply for "
        "their spacing or the gap between them"
    )


def refuse_nearness(quality: Quality, grid: Grid, state: State) -> None:
    """Raises NoNet for a net whose neighbouring crossings lie nearer than its spacing or farther
    (nearness)."""
    told = nearness(quality, grid, state)
    if told:
        refusal = NoNet(
            Reason.NEAR,
            told,
            where="net.spacing",
            value=float(grid.spacing),
            remedy="Choose a smaller spacing, or a surface without creases.",
        )
        refusal.factorisations = quality.factorisations
        raise refusal
