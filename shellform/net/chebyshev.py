"""From a surface to its Chebyshev net (operation 1 of the framework): lattice, pull, trim, quality.

From an origin on the surface (lattice_origin.py) the compass method (compass.py) tells which crossings of a
lattice cover it and a margin around, on the surface as it goes on past its edge. The flat grid of these rods
is pulled onto it by sliding springs (pull.py), or laid as the compass has it, cut at the edge (trim.py) and
measured (quality.py). A pulled grid draws itself in: where it leaves the rim bare, the margin is made wider
and everything begins anew; past the widest one no net covers the surface. Where the trimmed grid leaves a
part of it bare (cover.py), rods of a single joint stay too, if less is with them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from shellform.arrays import Reals, reals
from shellform.errors import InputError, require_angle, require_count, require_number, typed
from shellform.net.compass import Finder, covering_lattice
from shellform.net.cover import NOTABLE, UNCOVERED, Cover, cover, refuse_bare
from shellform.net.grid import Grid, lattice_grid
from shellform.net.lattice_origin import origin_at, origin_of_guides
from shellform.net.limits import NetLimits
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
from shellform.net.trim import FEWEST, Trimmed, Uncovered, bare_rods, trim
from shellform.quantities import LENGTHS, MILLIMETRES, if_other_unit
from shellform.structure.elements.state import State
from shellform.structure.elements.threads import dense_on_one
from shellform.surface.shape.locate import Locator
from shellform.surface.shape.target import Surface

MERGE = 0.2  # of the spacing
ELEMENTS = 4  # a segment, as in section 4.1
# Spacings past the edge; the next is tried where the pulled grid left the surface's rim bare
_MARGINS = (1.5, 2.5, 4.0, 6.5, 10.0)
_STIFFEST = 1e6  # of springs, EI/s³, and against shear, EI/s; and one over the softest: beyond it rods are lost in rounding
_BEYOND = 1.5  # spacings that the surface goes on past the margin


@dataclass(frozen=True)
class NetTuning:
    """Of the pulling: at most `limit` factorisations a density, steps of up to `reach` spacings, down to a
    residual of `tolerance`; and by how many segments rods go on past the lattice's last crossing, `tail`."""

    limit: int = LIMIT
    reach: float = REACH
    tolerance: float = TOLERANCE
    tail: int = 0

    def __post_init__(self) -> None:
        require_count(self.limit, where="tuning.limit", give=f"a number of factorisations, such as {LIMIT}")
        require_count(self.tail, least=0, where="tuning.tail", give="a number of segments, such as 2")
        require_number(self.reach, above=0.0, where="tuning.reach", give=f"spacings, such as {REACH:g}")
        give = f"a share of the forces, such as {TOLERANCE:g}"
        require_number(self.tolerance, above=0.0, below=1.0, where="tuning.tolerance", give=give)


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
    uncovered_max: float = UNCOVERED
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
    uncovered_max: float = UNCOVERED,
    tuning: NetTuning | None = None,
    progress: Pulling | None = None,
) -> Net:
    """The Chebyshev net on the surface, of rods `spacing` m apart along u (`spacing_v` along v), the two
    layers `gap` m apart.

    - It lies at the `angle`, rad, of the u rods against the x axis in plan, where its origin is, and the
      `offset` of that from the middle of the plan, in spacings along u and v; or along `guides`, two curves
      in plan, (k, 2) m each, that cross at the origin and along which the u rod and the v rod through it run.
    - Rods end at the surface's edge, at the `ground` level, m, and at the closed curve `outline` (k, 2), m in
      plan; joints nearer to the end than `merge` spacings are left out. Of the surface the share
      `uncovered_max` may lie farther than three quarters of the spacing from any rod.
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
        uncovered_max=uncovered_max,
        tuning=tuning or NetTuning(),
    )
    return net_at(surface, settings, angle=angle, offset=offset, progress=progress)


@lru_cache(maxsize=2)  # of each margin: nets at several angles are pulled onto one surface
def _locator(surface: Surface, reach: float) -> Locator:
    return Locator(surface, reach=reach)


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
    require_settings(surface, settings)
    _check_place(angle, offset)
    limits = _limits(settings)
    density = _densities(settings.spring_density, settings.start)
    for margin in _MARGINS:
        finder = _locator(surface, (margin + _BEYOND) * max(steps))
        origin = (
            origin_at(surface, finder, steps, angle=angle, offset=offset)
            if settings.guides is None
            else origin_of_guides(surface, finder, settings.guides)
        )
        places, points = covering_lattice(
            finder, origin.point, origin.guides, steps, margin=margin * max(steps)
        )
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
                    begin if settings.start == "compass" else flat_start(grid, origin.point, origin.frame),
                    origin.point,
                    origin.frame,
                    spring_density=density,
                    shear_stiffness=settings.shear_stiffness,
                    guided=settings.guides is not None,
                    progress=progress,
                    limit=tuned.limit,
                    reach=tuned.reach,
                    tolerance=tuned.tolerance,
                )
            trimmed, covered = _trimmed(surface, finder, grid, pulled.state, settings)
        except Uncovered as error:
            bare = error.rods
            continue
        net = _net(finder, grid, pulled, trimmed, covered, settings.uncovered_max)
        return replace(net, limits=limits)
    raise _short(bare, angle)


def _limits(settings: NetSettings) -> NetLimits:
    outline = settings.outline
    return NetLimits(settings.ground, None if outline is None else reals("net.outline", outline, (None, 2)))


def require_settings(surface: Surface, settings: NetSettings) -> None:
    """Raises InputError for settings that can't work on this surface."""
    steps, gap = settings.spacings, settings.gap
    x, y = surface.plan_sides.tolist()
    extent, narrow = max(x, y), min(x, y)
    for name, spacing in zip(("net.spacing", "net.spacing_v"), steps, strict=True):
        require_number(
            spacing, above=0.0, where=name, give=f"metres, such as {narrow / 10.0:.2g} on this surface"
        )
        if spacing > 0.5 * narrow:
            raise InputError(
                f"is too large for a surface of {x:.3g} × {y:.3g} m in plan",
                where=name,
                value=spacing,
                remedy="Choose a smaller spacing, or check the surface's unit."
                + if_other_unit(spacing, LENGTHS, extent / 100.0, narrow / 4.0),
            )
        if spacing < extent / 2000.0:
            raise InputError(
                f"is too small for a surface {extent:.4g} m wide: more than a million crossings",
                where=name,
                value=spacing,
                remedy="Choose a larger spacing, or check the surface's unit."
                + if_other_unit(spacing, LENGTHS, extent / 100.0, narrow / 4.0),
            )
    if not 0.0 < gap < 0.5 * min(steps):
        raise InputError(
            "must be positive and well below the spacing",
            where="joint.gap",
            value=gap,
            remedy=f"Give metres below {0.5 * min(steps):.3g}, at least a rod's diameter."
            + if_other_unit(gap, MILLIMETRES, 0.002 * min(steps), 0.4 * min(steps)),
        )
    require_count(settings.elements, where="net.elements", give="beam elements a segment, such as 4")
    give = "a share of the spacing, such as 0.2"
    require_number(settings.merge, above=0.0, below=0.5, where="net.merge", give=give, share=True)
    give = f"a share of the surface, such as {UNCOVERED:g}"
    require_number(
        settings.uncovered_max, least=0.0, most=1.0, where="net.uncovered_max", give=give, share=True
    )
    give = f"EI/s a radian, such as {SHEAR_STIFFNESS:g}"
    require_number(
        settings.shear_stiffness,
        least=1.0 / _STIFFEST,
        most=_STIFFEST,
        where="net.shear_stiffness",
        give=give,
    )
    if settings.ground is not None:
        require_number(settings.ground, where="net.ground", give="a level in metres, or leave it out")


def _check_place(angle: float, offset: tuple[float, float]) -> None:
    """Raises InputError for an angle, rad, and an offset, in spacings, that say no place of the net."""
    place = [angle, *offset]
    if not np.isfinite(place).all():
        raise InputError(
            "must be numbers",
            where="net.angle, net.offset",
            value=place,
            remedy="Give an angle, and spacings along u and v.",
        )
    require_angle(angle, where="net.angle", give="an angle in radians, such as 0.785")


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
    if (
        not given
        or any(not 1.0 / _STIFFEST <= each <= _STIFFEST for each in given)
        or list(given) != sorted(given)
    ):
        raise InputError(
            f"must be positive and rising, from {typed(1.0 / _STIFFEST)} to {typed(_STIFFEST)}",
            where="net.spring_density",
            value=list(given),
            remedy="For example [0.05, 0.5, 5.0].",
        )
    return given


def _trimmed(
    surface: Surface, finder: Finder, grid: Grid, state: State, settings: NetSettings
) -> tuple[Trimmed, Cover]:
    """The pulled grid trimmed, and what it covers: rods of a single joint stay where a notable part less is
    bare with them. Raises Uncovered."""
    limits = _limits(settings)

    def kept(fewest: int) -> tuple[Trimmed, Cover]:
        found = trim(grid, state, finder, merge=settings.merge, limits=limits, fewest=fewest)
        return found, cover(surface, found.grid, found.state, limits.within)

    usual, notable = kept(FEWEST), NOTABLE * grid.scale**2
    if usual[1].bare < notable:
        return usual
    more = kept(1)
    return more if usual[1].bare - more[1].bare >= notable else usual


def _net(
    finder: Finder, oversized: Grid, pulled: Pulled, trimmed: Trimmed, covered: Cover, uncovered_max: float
) -> Net:
    try:
        net = _measured(finder, oversized, pulled, trimmed, covered)
        refuse_bare(covered, uncovered_max, net.spacing)
        return net
    except NoNet as error:
        error.factorisations = pulled.factorisations
        raise


def _measured(finder: Finder, oversized: Grid, pulled: Pulled, trimmed: Trimmed, covered: Cover) -> Net:
    grid, state = trimmed.grid, trimmed.state
    refuse_folds(finder, grid, state)
    own = trimmed.origin >= 0
    force = np.where(own, pulled.pull[trimmed.origin], 0.0)
    curvature = _curvature(oversized, pulled, trimmed)
    quality = measure(finder, grid, state, curvature, force, spent=pulled.factorisations, bare=covered.bare)
    refuse_distance(quality, grid, state)
    near = nearness(quality, grid, state)
    told = (NetNote(NoteKind.NEAR, near),) if near else ()
    return Net(grid, state, trimmed.supports, quality, (*trimmed.notes, *told), cover=covered)


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
