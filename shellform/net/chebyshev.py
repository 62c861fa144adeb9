"""From a surface to its Chebyshev net (operation 1 of the framework): lattice, pull, trim, quality."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from shellform.arrays import Reals, reals
from shellform.errors import InputError, require_count, require_number
from shellform.net.compass import Finder, Guide, covering_lattice, raised
from shellform.net.grid import Grid, lattice_grid
from shellform.net.net import Net
from shellform.net.notes import NetNote, NoteKind
from shellform.net.pull import (
    FROM_COMPASS,
    FROM_FLAT,
    LIMIT,
    REACH,
    SHEAR_STIFFNESS,
    TOLERANCE,
    Pulled,
    Pulling,
    compass_start,
    flat_start,
    laid,
    pull,
)
from shellform.net.quality import measure, nearness, refuse_distance, refuse_folds
from shellform.net.refusal import NoNet, Reason
from shellform.net.trim import Limits, Trimmed, Uncovered, bare_rods, trim
from shellform.structure.elements.threads import dense_on_one
from shellform.surface.shape.locate import Locator
from shellform.surface.shape.target import Surface, triangle_areas

MERGE = 0.2  # of the spacing
_ROUND = 2.0 * np.pi * (1.0 + 1e-9)  # rad, a whole turn
ELEMENTS = 4  # a segment, as in section 4.1
# Spacings past the edge; the next is tried where the pulled grid left the surface's rim bare
_MARGINS = (1.5, 2.5, 4.0, 6.5, 10.0)
_BEYOND = 1.5  # spacings that the surface goes on past the margin


@dataclass(frozen=True)
class NetTuning:
    """Of the pulling: at most `limit` factorisations a density, steps of up to `reach` spacings, down to a
    residual of `tolerance`; and by how many segments rods go on past the lattice's last crossing, `tail`."""

    limit: int = LIMIT
    reach: float = REACH
    tolerance: float = TOLERANCE
    tail: int = 0


Method = Literal["pull", "compass"]
Start = Literal["compass", "flat"]


@dataclass(frozen=True, kw_only=True)
class NetSettings:
    """What a net is to be, but for where it lies: rods `spacing` m apart along u (`spacing_v` along v; None:
    the same), the two layers `gap` m apart, and what else `pull_net` says."""

    spacing: float
    gap: float
    spacing_v: float | None = None
    guides: tuple[ArrayLike, ArrayLike] | None = None
    elements: int = ELEMENTS
    method: Method = "pull"
    start: Start = "compass"
    spring_density: Sequence[float] | None = None
    shear_stiffness: float = SHEAR_STIFFNESS
    merge: float = MERGE
    ground: float | None = None
    outline: ArrayLike | None = None
    tuning: NetTuning = field(default_factory=NetTuning)

    @property
    def spacings(self) -> tuple[float, float]:
        """Along u and v, m."""
        return self.spacing, self.spacing if self.spacing_v is None else self.spacing_v


def pull_net(
    surface: Surface,
    *,
    spacing: float,
    gap: float,
    spacing_v: float | None = None,
    angle: float = 0.0,
    offset: tuple[float, float] = (0.0, 0.0),
    guides: tuple[ArrayLike, ArrayLike] | None = None,
    elements: int = ELEMENTS,
    method: Method = "pull",
    start: Start = "compass",
    spring_density: Sequence[float] | None = None,
    shear_stiffness: float = SHEAR_STIFFNESS,
    merge: float = MERGE,
    ground: float | None = None,
    outline: ArrayLike | None = None,
    tuning: NetTuning | None = None,
    progress: Pulling | None = None,
) -> Net:
    """The Chebyshev net on the surface, of rods `spacing` m apart along u (`spacing_v` along v), the two
    layers `gap` m apart.

    - It lies at the `angle`, rad, of the u rods against the x axis in plan, where its origin is, and the
      `offset` of that from the middle of the plan, in spacings along u and v; or along `guides`, two curves
      in plan, (k, 2) m each, that cross at the origin and along which the u rod and the v rod through it run.
    - Rods end at the surface's edge, at the `ground` level, m, and at the closed curve `outline` (k, 2), m in
      plan; joints nearer to the end than `merge` spacings are left out.
    - The `method` "pull" relaxes the grid, of so many `elements` a segment, on sliding springs of
      `spring_density`, EI/s³, rising, and `shear_stiffness`, EI/s a radian (pull.py), from the compass net or
      the flat grid (`start`); "compass" leaves the compass net as it is. `tuning`: of the numbers behind it.

    Raises InputError for settings that can't work on this surface, NoNet for surfaces too curved for one net,
    Stalled where the pull fails.
    """
    settings = NetSettings(
        spacing=spacing,
        gap=gap,
        spacing_v=spacing_v,
        guides=guides,
        elements=elements,
        method=method,
        start=start,
        spring_density=spring_density,
        shear_stiffness=shear_stiffness,
        merge=merge,
        ground=ground,
        outline=outline,
        tuning=tuning or NetTuning(),
    )
    return net_at(surface, settings, angle=angle, offset=offset, progress=progress)


@dense_on_one()
def net_at(
    surface: Surface,
    settings: NetSettings,
    *,
    angle: float,
    offset: tuple[float, float] = (0.0, 0.0),
    progress: Pulling | None = None,
) -> Net:
    """The net with these settings at the `angle`, rad, and `offset`: `pull_net`, whose errors it raises."""
    steps, tuned = settings.spacings, settings.tuning
    _check(surface, settings)
    _check_place(angle, offset)
    limits = _limits(settings)
    density = _densities(settings.spring_density, settings.start)
    for margin in _MARGINS:
        finder = Locator(surface, reach=(margin + _BEYOND) * max(steps))
        origin, frame, lines = _origin(surface, finder, steps, angle, offset, settings.guides)
        places, points = covering_lattice(finder, origin, lines, steps, margin=margin * max(steps))
        grid = lattice_grid(
            places, spacing=steps, gap=settings.gap, elements=settings.elements, tail=tuned.tail
        )
        begin = compass_start(grid, finder, places, points)
        bare = bare_rods(grid, begin, finder, limits)
        if bare:  # what the compass net leaves bare, no pulling covers
            continue
        try:
            if settings.method == "compass":
                pulled = laid(grid, begin)
            else:
                pulled = pull(
                    grid,
                    finder,
                    begin if settings.start == "compass" else flat_start(grid, origin, frame),
                    origin,
                    frame,
                    spring_density=density,
                    shear_stiffness=settings.shear_stiffness,
                    guided=settings.guides is not None,
                    progress=progress,
                    limit=tuned.limit,
                    reach=tuned.reach,
                    tolerance=tuned.tolerance,
                )
            trimmed = trim(grid, pulled.state, finder, merge=settings.merge, limits=limits)
        except Uncovered as error:
            bare = error.rods
            continue
        return _net(surface, finder, grid, pulled, trimmed)
    raise _short(bare, angle)


def _limits(settings: NetSettings) -> Limits:
    outline = settings.outline
    return Limits(settings.ground, None if outline is None else reals("net.outline", outline, (None, 2)))


def _check(surface: Surface, settings: NetSettings) -> None:
    """Raises InputError for settings that can't work on this surface."""
    steps, gap = settings.spacings, settings.gap
    extent = float(max(surface.size[:2]))
    narrow = float(min(surface.size[:2]))
    for name, spacing in zip(("net.spacing", "net.spacing_v"), steps, strict=True):
        require_number(
            spacing, above=0.0, where=name, give=f"metres, such as {narrow / 10.0:.2g} on this surface"
        )
        if spacing > 0.5 * narrow:
            raise InputError(
                f"is too large for a surface of {surface.size[0]:.3g} × {surface.size[1]:.3g} m in plan",
                where=name,
                value=spacing,
                remedy="Choose a smaller spacing, or check the surface's unit.",
            )
        if spacing < extent / 2000.0:
            raise InputError(
                f"is too small for a surface {extent:.4g} m wide: more than a million crossings",
                where=name,
                value=spacing,
                remedy="Choose a larger spacing, or check the surface's unit.",
            )
    if not 0.0 < gap < 0.5 * min(steps):
        raise InputError(
            "must be positive and well below the spacing",
            where="joint.gap",
            value=gap,
            remedy=f"Give metres below {0.5 * min(steps):.3g}, at least a rod's diameter.",
        )
    require_count(settings.elements, where="net.elements", give="beam elements a segment, such as 4")
    give = "a share of the spacing, such as 0.2"
    require_number(settings.merge, above=0.0, below=0.5, where="net.merge", give=give, share=True)


def _check_place(angle: float, offset: tuple[float, float]) -> None:
    """Raises InputError for an angle, rad, and an offset, in spacings, that say no place of the net."""
    place, what, remedy = [angle, *offset], "must be numbers", "Give degrees, and spacings."
    if np.isfinite(place).all():
        if abs(angle) <= _ROUND:
            return
        what = f"{angle:g} rad is more than a whole turn"
        remedy = f"Leave whole turns out; if degrees are meant, give {np.deg2rad(angle):.4g} rad."
    raise InputError(what, where="net.angle, net.offset", value=place, remedy=remedy)


def _short(bare: int, angle: float) -> NoNet:
    return NoNet(
        Reason.SHORT,
        f"the net doesn't cover the surface: {bare} rods end short of its edge at {np.rad2deg(angle):.4g}°",
        where="net.angle",
        remedy="Try another angle or a smaller spacing; a surface that is curved too much takes no single "
        "net.",
    )


def _densities(given: Sequence[float] | None, start: Start) -> Sequence[float]:
    if given is None:
        return FROM_COMPASS if start == "compass" else FROM_FLAT
    if not given or any(not 0.0 < each < np.inf for each in given) or list(given) != sorted(given):
        raise InputError(
            "must be positive and rising",
            where="net.spring_density",
            value=list(given),
            remedy="For example [0.05, 0.5, 5.0].",
        )
    return given


def _origin(
    surface: Surface,
    finder: Finder,
    steps: tuple[float, float],
    angle: float,
    offset: tuple[float, float],
    guides: tuple[ArrayLike, ArrayLike] | None,
) -> tuple[Reals, Reals, tuple[Guide, Guide, Guide, Guide]]:
    """The lattice's origin (3,) on the surface, the frame (3, 3) of u, v and normal there, as columns, and
    the guides from it forwards and backwards along u, then along v."""
    if guides is not None:
        along_u, along_v = (reals(f"net.guides[{k}]", each, (None, 2)) for k, each in enumerate(guides))
        plan, halves = _halves(along_u, along_v)
    else:
        heading = np.array([np.cos(angle), np.sin(angle)])
        shift = offset[0] * steps[0] * heading + offset[1] * steps[1] * np.array([-heading[1], heading[0]])
        plan = _middle(surface, finder) + shift
    origin = _above(surface, finder, plan)
    foot = finder.foot(origin[None])
    if finder.past_outline(foot)[0] > 0.0:
        raise InputError(
            "the net's origin lies off the surface",
            where="net.offset" if guides is None else "net.guides",
            value=plan.round(4).tolist(),
            remedy="Choose a smaller offset, or guides that cross on the surface.",
        )
    normal = foot.normal[0]

    def tangent(direction: Reals) -> Reals:
        flat = np.array([*direction, 0.0])
        # The direction along the surface whose plan is the given one
        rise = -(flat @ normal) / normal[2] if abs(normal[2]) > 1e-9 else 0.0
        flat[2] = rise
        flat -= (flat @ normal) * normal
        return np.asarray(flat / np.linalg.norm(flat))

    if guides is not None:
        lines = tuple(Guide(tangent(half[1] - half[0]), half) for half in halves)
        along = lines[0].direction
    else:
        along = tangent(heading)
        side = np.cross(normal, along)
        lines = (Guide(along), Guide(-along), Guide(side), Guide(-side))
    frame = np.column_stack([along, np.cross(normal, along), normal])
    return origin, frame, (lines[0], lines[1], lines[2], lines[3])


def _middle(surface: Surface, finder: Finder) -> Reals:
    """The middle of the plan (2,): its centroid, or where that lies off the surface, as in the bend of an L,
    the place farthest from the edge."""
    corners = surface.vertices[surface.triangles]
    areas = triangle_areas(surface.vertices, surface.triangles)
    centroid = np.asarray(areas @ corners.mean(axis=1) / areas.sum())[:2]
    if finder.past_outline(finder.foot(_above(surface, finder, centroid)[None]))[0] <= 0.0:
        return centroid
    edge = cKDTree(surface.vertices[np.concatenate(surface.boundary)])
    return surface.vertices[np.argmax(edge.query(surface.vertices)[0]), :2]


def _above(surface: Surface, finder: Finder, plan: Reals) -> Reals:
    """The place (3,) on the surface over a `plan` (2,), sought from the vertex nearest to it there."""
    away = np.linalg.norm(surface.vertices[:, :2] - plan, axis=1)
    return raised(finder, plan, surface.vertices[np.argmin(away)])


def _halves(along_u: Reals, along_v: Reals) -> tuple[Reals, list[Reals]]:
    """Where two polylines (k, 2) first cross, (2,), and their four halves from there: forwards and backwards
    along u, along v.
    """
    for i, (a, b) in enumerate(pairwise(along_u)):
        for j, (c, d) in enumerate(pairwise(along_v)):
            matrix = np.column_stack([b - a, c - d])
            if abs(np.linalg.det(matrix)) < 1e-12 * float(np.linalg.norm(b - a) * np.linalg.norm(c - d)):
                continue
            s, t = np.linalg.solve(matrix, c - a)
            if not (0.0 <= s <= 1.0 and 0.0 <= t <= 1.0):
                continue
            meet = a + s * (b - a)
            halves = [
                np.vstack([meet, along_u[i + 1 :]]),
                np.vstack([meet, along_u[i::-1]]),
                np.vstack([meet, along_v[j + 1 :]]),
                np.vstack([meet, along_v[j::-1]]),
            ]
            if all(np.linalg.norm(half[1] - meet) > 0.0 for half in halves):
                if (
                    matrix[0, 0] * matrix[1, 1] - matrix[0, 1] * matrix[1, 0] > 0.0
                ):  # v runs to the right of u: turn it round
                    halves[2], halves[3] = halves[3], halves[2]
                return meet, halves
    raise InputError(
        "the two guide curves don't cross between their ends",
        where="net.guides",
        remedy="Draw them through one point on the surface.",
    )


def _net(surface: Surface, finder: Finder, oversized: Grid, pulled: Pulled, trimmed: Trimmed) -> Net:
    try:
        return _measured(surface, finder, oversized, pulled, trimmed)
    except NoNet as error:
        error.factorisations = pulled.factorisations
        raise


def _measured(surface: Surface, finder: Finder, oversized: Grid, pulled: Pulled, trimmed: Trimmed) -> Net:
    grid, state = trimmed.grid, trimmed.state
    refuse_folds(finder, grid, state)
    own = trimmed.origin >= 0
    force = np.where(own, pulled.pull[trimmed.origin], 0.0)
    quality = measure(
        surface, finder, grid, state, _curvature(oversized, pulled, trimmed), force, pulled.factorisations
    )
    refuse_distance(quality, grid, state)
    near = nearness(quality, grid, state)
    told = (NetNote(NoteKind.NEAR, near),) if near else ()
    return Net(grid, state, trimmed.supports, quality, (*trimmed.notes, *told))


def _curvature(oversized: Grid, pulled: Pulled, trimmed: Trimmed) -> Reals:
    """Curvature (m, 2, 2) of the trimmed rods' elements, from those of the oversized grid at the same nodes;
    cut ends take their inner neighbour's (the extension past the edge bends nothing)."""
    at_node = np.zeros((len(oversized.flat), 2))
    for side in (0, 1):
        nodes, values = oversized.rod_ends[:, side], pulled.curvature[:, side]
        larger = np.abs(values) > np.abs(at_node[nodes])
        at_node[nodes] = np.where(larger, values, at_node[nodes])
    value = np.where(trimmed.origin[:, None] >= 0, at_node[trimmed.origin], 0.0)
    pairs = trimmed.grid.rod_ends
    result = value[pairs]
    cut = trimmed.origin[pairs] < 0
    return np.where(cut[:, :, None], result[:, ::-1], result)
