"""From a surface to its Chebyshev net (operation 1 of the framework): lattice, pull, trim, quality."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from shellform.arrays import Flags, Indices, Reals
from shellform.errors import InputError
from shellform.net.compass import Finder, covering_lattice
from shellform.net.grid import Grid, lattice_grid
from shellform.net.net import Net, Quality, cells, crossing_points, neighbours
from shellform.net.pull import (
    FROM_COMPASS,
    FROM_FLAT,
    SHEAR_STIFFNESS,
    Progress,
    Pulled,
    compass_start,
    flat_start,
    pull,
)
from shellform.net.trim import Trimmed, Uncovered, trim
from shellform.surface.locate import Locator
from shellform.surface.target import Surface, largest_curvature

MERGE = 0.2  # of the spacing
ELEMENTS = 4  # a segment, as in section 4.1
_REACH = 6.0  # spacings that the surface goes on past its edge
_SHARPEST = 1.0  # largest curvature times spacing
_FAR = 0.1  # of the spacing: a net farther from the surface is refused
_MARGINS = (1.5, 2.5, 4.0)  # spacings past the edge; the next is tried where the pulled grid left the surface's rim bare


def pull_net(
    surface: Surface,
    *,
    spacing: float,
    gap: float,
    angle: float = 0.0,
    offset: tuple[float, float] = (0.0, 0.0),
    elements: int = ELEMENTS,
    start: Literal["compass", "flat"] = "compass",
    spring_density: Sequence[float] | None = None,
    shear_stiffness: float = SHEAR_STIFFNESS,
    merge: float = MERGE,
    progress: Progress | None = None,
) -> Net:
    """The Chebyshev net of rods `spacing` m apart, the two layers `gap` m apart, on the surface.

    `angle`, rad: of the u rods against the x axis in plan, where the net's origin lies; `offset`: of the origin from the middle of
    the plan, in spacings along u and v; `elements` of a segment; `start`: whether the pull begins at the compass
    net or at the flat grid; `spring_density` (EI/s³, rising) and `shear_stiffness` (EI/s a
    radian) of the pulling (net/pull.py); joints nearer to the edge than `merge` spacings are left out.
    Raises InputError for settings that can't work on this surface, NotConverged where the pull fails.
    """
    _check(surface, spacing, gap, elements, merge)
    finder = Locator(surface, reach=_REACH * spacing)
    origin, frame = _origin(surface, finder, spacing, angle, offset)
    for margin in _MARGINS:
        places, points = covering_lattice(finder, origin, frame[:, 0], spacing, margin=margin * spacing)
        grid = lattice_grid(places, spacing=spacing, gap=gap, elements=elements)
        compass = start == "compass"
        pulled = pull(
            grid,
            finder,
            compass_start(grid, finder, places, points) if compass else flat_start(grid, origin, frame),
            origin,
            frame,
            spring_density=spring_density or (FROM_COMPASS if compass else FROM_FLAT),
            shear_stiffness=shear_stiffness,
            progress=progress,
        )
        try:
            trimmed = trim(grid, pulled.state, finder, merge=merge)
        except Uncovered as error:
            bare = error.rods
            continue
        return _net(finder, grid, pulled, trimmed)
    raise InputError(
        f"the net doesn't cover the surface: {bare} rods end short of its edge",
        where="net.angle",
        value=angle,
        remedy="Try another angle or a smaller spacing; a surface that is curved too much takes no single net.",
    )


def _check(surface: Surface, spacing: float, gap: float, elements: int, merge: float) -> None:
    extent = float(max(surface.size[:2]))
    narrow = float(min(surface.size[:2]))
    if not 0.0 < spacing < np.inf:
        raise InputError("must be a positive length", where="net.spacing", value=spacing)
    if spacing > 0.5 * narrow:
        raise InputError(
            f"is too large for a surface of {surface.size[0]:.3g} × {surface.size[1]:.3g} m in plan",
            where="net.spacing",
            value=spacing,
            remedy="Choose a smaller spacing, or check the surface's unit.",
        )
    if spacing < extent / 2000.0:
        raise InputError(
            f"is too small for a surface {extent:.4g} m wide: more than a million crossings",
            where="net.spacing",
            value=spacing,
            remedy="Choose a larger spacing, or check the surface's unit.",
        )
    if not 0.0 < gap < 0.5 * spacing:
        raise InputError(
            "must be positive and well below the spacing", where="joint.gap", value=gap, remedy="Give metres."
        )
    bent = largest_curvature(surface)
    if bent * spacing > _SHARPEST:
        raise InputError(
            f"is too large for a surface that bends to a radius of {1.0 / bent:.3g} m",
            where="net.spacing",
            value=spacing,
            remedy=f"Choose a spacing below {_SHARPEST / bent:.3g} m, or a smoother surface.",
        )
    if elements < 1:
        raise InputError("must be at least 1", where="net.elements", value=elements)
    if not 0.0 < merge < 0.5:
        raise InputError("must lie between 0 and 0.5", where="net.merge", value=merge)


def _origin(
    surface: Surface, finder: Finder, spacing: float, angle: float, offset: tuple[float, float]
) -> tuple[Reals, Reals]:
    """The lattice's origin (3,) on the surface and the frame (3, 3) of u, v and normal there, as columns."""
    corners = surface.vertices[surface.triangles]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    middle = (areas @ corners.mean(axis=1)) / areas.sum()
    away = np.linalg.norm(surface.vertices[:, :2] - middle[:2], axis=1)
    plan = middle[:2]
    heading = np.array([np.cos(angle), np.sin(angle)])
    plan = plan + spacing * (offset[0] * heading + offset[1] * np.array([-heading[1], heading[0]]))
    point = surface.vertices[np.argmin(away)].copy()
    for _ in range(50):  # down or up to the surface along the vertical through the plan point
        point[:2] = plan
        foot = finder.foot(point[None])
        if np.linalg.norm(foot.point[0, :2] - plan) < 1e-12 * float(max(surface.size)):
            break
        point = foot.point[0].copy()
    normal = foot.normal[0]
    along = np.array([*heading, 0.0])
    along = along - (along @ normal) * normal
    along /= np.linalg.norm(along)
    return foot.point[0], np.column_stack([along, np.cross(normal, along), normal])


def _net(finder: Finder, oversized: Grid, pulled: Pulled, trimmed: Trimmed) -> Net:
    grid, state = trimmed.grid, trimmed.state
    folded = _folded(finder, grid, crossing_points(grid, state))
    if folded.any():
        place = grid.lattice[cells(grid)[np.argmax(folded)][0]]
        raise InputError(
            f"the net folds over itself in {int(folded.sum())} cells, first at the crossing {place.tolist()}: "
            "the surface is curved more than rods at this spacing can follow",
            where="net.spacing",
            value=grid.spacing,
            remedy="Choose a smaller spacing, another angle, or a flatter surface.",
        )
    curvature = _curvature(oversized, pulled, trimmed)
    quality = _quality(finder, grid, trimmed, curvature, pulled)
    if quality.distance_max > _FAR * grid.spacing:
        worst = int(np.argmax(np.abs(finder.foot(crossing_points(grid, state)).distance)))
        raise InputError(
            f"the net stays {quality.distance_max:.3g} m off the surface at {crossing_points(grid, state)[worst].round(3).tolist()}: "
            "it is curved more there than a grid of straight rods can follow",
            where="net.spacing",
            value=grid.spacing,
            remedy="Choose a smaller spacing, another angle, or a smoother surface.",
        )
    return Net(grid, state, trimmed.supports, curvature, quality, trimmed.notes)


def _curvature(oversized: Grid, pulled: Pulled, trimmed: Trimmed) -> Reals:
    """Curvature (m, 2) of the trimmed rods' elements, from those of the oversized grid at the same nodes; cut ends take
    their inner neighbour's (the extension past the edge bends nothing)."""
    at_node = np.zeros(len(oversized.flat))
    ends = oversized.rod_ends
    np.maximum.at(at_node, ends[:, 0], pulled.curvature[:, 0])
    np.maximum.at(at_node, ends[:, 1], pulled.curvature[:, 1])
    value = np.where(trimmed.origin >= 0, at_node[trimmed.origin], 0.0)
    pairs = trimmed.grid.rod_ends
    result = value[pairs]
    cut = trimmed.origin[pairs] < 0
    return np.where(cut, result[:, ::-1], result)


def _quality(finder: Finder, grid: Grid, trimmed: Trimmed, curvature: Reals, pulled: Pulled) -> Quality:
    points = crossing_points(grid, trimmed.state)
    distance = np.abs(finder.foot(points).distance)
    pairs = neighbours(grid)
    chord = np.linalg.norm(points[pairs[:, 1]] - points[pairs[:, 0]], axis=1)
    kept = trimmed.origin[trimmed.origin >= 0]
    return Quality(
        distance_max=float(distance.max()),
        distance_mean=float(distance.mean()),
        spacing_error_max=float(np.abs(chord / grid.spacing - 1.0).max()),
        shear_angle_min=float(shear_angles(grid, points).min(initial=0.5 * np.pi)),
        curvature_max=float(curvature.max()),
        pull_max=float(pulled.pull[kept].max()),
        pull_mean=float(pulled.pull[kept].mean()),
        factorisations=pulled.factorisations,
    )


def shear_angles(grid: Grid, points: Reals) -> Reals:
    """The four angles (4 q,), rad, at the corners of the cells: between neighbouring chords, at most 90° each."""
    corner = points[cells(grid)]
    sides = np.roll(corner, -1, axis=1) - corner
    sides /= np.linalg.norm(sides, axis=2, keepdims=True)
    cosine = np.abs(np.sum(sides * np.roll(sides, 1, axis=1), axis=2))
    return np.asarray(np.arccos(np.clip(cosine, 0.0, 1.0)).ravel())


def _folded(finder: Finder, grid: Grid, points: Reals) -> Flags:
    """Which cells (q,) lie upside down on the surface."""
    quads: Indices = cells(grid)
    corner = points[quads]
    across = np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1])
    normal = finder.foot(corner.mean(axis=1)).normal
    return np.asarray(np.sum(across * normal, axis=1) <= 0.0)
