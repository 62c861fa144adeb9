"""Dead loads on the net's nodes, (n, 6), N and N·m: weights act along -z, and a load case is a sum of factors
times parts.

Concrete, membrane and reinforcement weigh on their true area of what is built of the target surface
(areas.py); a joint's share acts on its upper rod, a support's goes into the ground there and counts in the
reaction only. Rods weigh half an element on each of its nodes, joints half on each rod. Table 1 of the paper
is contained: with lengths times s and the density of what is poured divided by s the load on an area stays,
and that on a node grows with s².
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from shellform.arrays import Indices, Reals, reals
from shellform.errors import InputError, require_angle, require_count, require_known, require_number
from shellform.gridshell.areas import areas, between, facets, tributary, within
from shellform.net.net import Net
from shellform.net.polylines import inside
from shellform.quantities import (
    AREA_MASS,
    CONCRETE_DENSITY,
    JOINT_MASS,
    LENGTHS,
    NODE_FORCE,
    THICKNESS,
    coordinates,
    if_other_unit,
    number,
)
from shellform.structure.elements.sections import Material, Section, mass_per_length
from shellform.surface.shape.target import Surface

GRAVITY = 9.81  # m/s²: the paper's 700 g are 6.9 N
CONCRETE = 2500.0  # kg/m³, wet, with its reinforcement
_BULK = 0.2  # of the larger side: thicker, it is no shell


@dataclass(frozen=True)
class Region:
    """Where something lies on the surface: everywhere, but for what its limits take away.

    - `openings`: plan polygons, m, outside all of which it lies; `inside`: inside one of which.
    - `half`: a direction in plan, rad from x: the half towards it, from the middle of the surface's extent
      along it.
    - `strip`: a direction in plan, rad, and the lowest and highest place along it, m from the origin.
    - `ring`: lowest and highest level, m.
    """

    openings: Sequence[ArrayLike] = ()
    inside: Sequence[ArrayLike] = ()
    half: float | None = None
    strip: tuple[float, float, float] | None = None
    ring: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        if self.half is not None:
            require_angle(self.half, where="load.half", give=_ANGLE)
        if self.strip is not None:
            _numbers("strip", self.strip, 3, f"{_ANGLE}, and two places along it, m")
            require_angle(self.strip[0], where="load.strip[0]", give=_ANGLE)
        if self.ring is not None:
            _numbers("ring", self.ring, 2, "two levels, m")
        for name, limits in [("strip", self.strip and self.strip[1:]), ("ring", self.ring)]:
            if limits and not limits[0] < limits[1]:
                raise InputError(
                    "the first limit must lie below the second",
                    where=f"load.{name}",
                    value=list(limits),
                    remedy="Change places of the two, m.",
                )


EVERYWHERE = Region()


def built(net: Net, surface: Surface) -> Reals:
    """What is built of the surface, as triangles (t, 3, 3), m: beyond the level or the outline at which the
    net ends nothing is."""
    limits, triangles = net.limits, facets(surface)
    if limits.ground is not None:
        triangles = between(triangles, np.array([0.0, 0.0, 1.0]), limits.ground, np.inf)
    if limits.plan is not None:
        triangles = _parted(triangles, limits.plan, "net.outline")[0]
    return triangles


def lying(triangles: Reals, region: Region) -> Reals:
    """The part in the region of what is built, triangles (t, 3, 3), m. Raises InputError where nothing is
    left.
    """
    corners = triangles.reshape(-1, 3)
    if region.half is not None:
        direction = _plan(region.half)
        along = corners @ direction
        triangles = between(triangles, direction, 0.5 * float(along.min() + along.max()), np.inf)
    if region.strip is not None:
        triangles = between(triangles, _plan(region.strip[0]), *region.strip[1:])
    if region.ring is not None:
        triangles = between(triangles, np.array([0.0, 0.0, 1.0]), *region.ring)
    for polygon in region.openings:
        triangles = _parted(triangles, polygon, "load.openings")[1]
    if region.inside:
        found = []
        for polygon in region.inside:  # what lies in two polygons counts once
            part, triangles = _parted(triangles, polygon, "load.inside")
            found.append(part)
        triangles = np.concatenate(found)
    if not areas(triangles).sum() > 0.0:
        raise InputError(
            "no part of the surface is loaded",
            where="load",
            remedy=f"What is built of the surface reaches from {coordinates(corners.min(axis=0))} to "
            f"{coordinates(corners.max(axis=0))} m.",
        )
    return triangles


def _plan(angle: float) -> Reals:
    return np.array([math.cos(angle), math.sin(angle), 0.0])


def _parted(triangles: Reals, polygon: ArrayLike, where: str) -> tuple[Reals, Reals]:
    try:
        return within(triangles, reals(where, polygon, (None, 2)))
    except InputError as error:
        raise InputError(error.what, where=where, value=error.value, remedy=error.remedy) from error


def pressure(thickness: float, density: float) -> float:
    """Weight, N/m², of a layer of `thickness`, m, across the surface, and `density`, kg/m³."""
    THICKNESS.require(thickness, where="load.thickness")
    return GRAVITY * thickness * CONCRETE_DENSITY.require(density, where="load.density")


def as_concrete(weight: float) -> str:
    """What a weight, N/m², is like."""
    thickness = weight / (GRAVITY * CONCRETE)
    size = f"{thickness:.2g} m" if thickness >= 0.995 else f"{float(f'{1e3 * thickness:.2g}'):g} mm"
    return f"{number(weight)} N/m², as {size} of concrete"


def refuse_bulk(surface: Surface, thickness: float, *, where: str) -> None:
    """Raises InputError for a layer of a thickness, m, given `where`, with which the surface would be a block
    and no shell."""
    side = float(surface.size.max())
    if thickness > _BULK * side:
        raise InputError(
            f"makes a block of a surface of {side:.4g} m",
            where=where,
            value=thickness,
            remedy=f"Give metres, such as {side / 80.0:.1g}.{if_other_unit(thickness, LENGTHS, side / 1000.0, side / 15.0)}",
        )


def area_load(net: Net, surface: Surface, weight: float, region: Region = EVERYWHERE) -> Reals:
    """Load (n, 6) of a `weight`, N/m² of the surface, in the region. It adds up to the weight times the area
    of what is built there.
    """
    require_number(weight, above=0.0, where="load.weight", give="N/m², such as 120")
    carried = (
        _carried_everywhere(net, surface)
        if region is EVERYWHERE
        else tributary(net, lying(built(net, surface), region))
    )
    return _down(weight * carried)


@lru_cache(maxsize=1)  # every thickness that is tried lies on one net
def _carried_everywhere(net: Net, surface: Surface) -> Reals:
    return reals("areas", tributary(net, lying(built(net, surface), EVERYWHERE)), (None,))


def concrete(
    net: Net, surface: Surface, *, thickness: float, density: float = CONCRETE, region: Region = EVERYWHERE
) -> Reals:
    """Load (n, 6) of wet concrete of a thickness, m, across the surface, and a density, kg/m³, where it is
    poured.
    """
    weight = pressure(thickness, density)
    refuse_bulk(surface, thickness, where="load.thickness")
    return area_load(net, surface, weight, region)


def sheet(net: Net, surface: Surface, mass: float, region: Region = EVERYWHERE) -> Reals:
    """Load (n, 6) of a membrane or of reinforcement of `mass`, kg/m²."""
    return area_load(net, surface, GRAVITY * AREA_MASS.require(mass, where="load.mass"), region)


def rods(net: Net, section: Section) -> Reals:
    """Load (n, 6) of the rods themselves along their true lengths. Raises InputError where their density
    isn't known.

    It is the weight of this section: where the radius is a variable the load stays that of the section given.
    """
    require_density(section.material)
    half = 0.5 * GRAVITY * mass_per_length(section) * net.grid.rod_rest_lengths
    weight = np.zeros(net.node_count)
    np.add.at(weight, net.grid.rod_ends, half[:, None])
    return _down(weight)


def require_density(material: Material) -> None:
    """Raises InputError where the density of what rods are made of isn't known, and so their weight."""
    if not material.density > 0.0:
        raise InputError("the rods' density isn't known", where="rod.density", remedy="Give it in kg/m³.")


def joints(net: Net, mass: float) -> Reals:
    """Load (n, 6) of joints of `mass`, kg, each, half on either rod."""
    weight = np.zeros(net.node_count)
    weight[net.grid.crossing_nodes] = 0.5 * GRAVITY * JOINT_MASS.require(mass, where="load.mass")
    return _down(weight)


def points(
    net: Net,
    force: float,
    *,
    every: int = 1,
    openings: Sequence[ArrayLike] = (),
    inside: Sequence[ArrayLike] = (),
) -> Reals:
    """Load (n, 6) of `force`, N (below 0: upwards), on every `every`-th crossing (2: of the checkerboard, as
    in section 4.1), on its upper rod, outside the plan polygons `openings` and, if any are given, inside one
    of `inside`."""
    loaded = crossings_to_load(net, every, openings, inside)
    weight = np.zeros(net.node_count)
    most = NODE_FORCE.possible[1]
    require_number(force, least=-most, most=most, where="load.force", give=NODE_FORCE.give)
    weight[net.grid.crossing_nodes[loaded, 1]] = force
    return _down(weight)


def combined(
    parts: Mapping[str, Reals], factors: Mapping[str, float], *, where: str = "load.factors"
) -> Reals:
    """The load case (n, 6) that is the sum of factors times named parts. Raises InputError for a part that
    isn't there.
    """
    if not factors:
        raise InputError("names no part", where=where, remedy=f"Known: {', '.join(parts)}.")
    for name, factor in factors.items():
        require_known(name, parts, where=where, what="there is no such part of the load")
        require_number(factor, where=f"{where}.{name}", give="a factor of that part, such as 1.2")
    shapes = {name: np.shape(parts[name]) for name in factors}
    if len(set(shapes.values())) > 1:
        raise InputError(
            "adds up parts of different nets",
            where=where,
            value=shapes,
            remedy="Make all parts of one net, a row of each for each of its nodes.",
        )
    return np.asarray(sum(factor * parts[name] for name, factor in factors.items()))


def staged(
    parts: Mapping[str, Reals],
    steps: Sequence[str],
    *,
    name: str,
    factors: Mapping[str, float],
    where: str = "load.stages",
) -> dict[str, Reals]:
    """Load cases "NAME 1", "NAME 2", …: the parts `steps` are added one after the other, as layers or
    sections are poured.

    `factors` are what is there from the beginning; a part named there too has its factor, another 1. Raises
    InputError where there is no step or a part is added twice.
    """
    if not steps or len(set(steps)) < len(steps):
        raise InputError(
            "each part is added once, and one at least",
            where=where,
            value=list(steps),
            remedy=f"Name parts in their order, of {', '.join(parts)}.",
        )
    before = {part: factor for part, factor in factors.items() if part not in steps}
    result = {}
    for k in range(len(steps)):
        now = before | {part: factors.get(part, 1.0) for part in steps[: k + 1]}
        result[f"{name} {k + 1}"] = combined(parts, now, where=where)
    return result


def crossings_to_load(
    net: Net, every: int, openings: Sequence[ArrayLike], within_one: Sequence[ArrayLike]
) -> Indices:
    """Numbers of the crossings whose lattice place i + j is a multiple of `every`, outside the plan polygons
    `openings` and, if any are given, inside one of `within_one`.

    Raises InputError where none is left.
    """
    require_count(every, where="load.every", give="1 for all crossings, 2 for the checkerboard")
    loaded = net.grid.lattice.sum(axis=1) % every == 0
    plan = net.crossings[:, :2]
    for polygon in _polygons("load.openings", openings):
        loaded &= ~inside(plan, polygon)
    if len(within_one):
        loaded &= np.any([inside(plan, polygon) for polygon in _polygons("load.inside", within_one)], axis=0)
    if not loaded.any():
        raise InputError(
            "no crossing is loaded",
            where="load",
            remedy="Make the openings smaller (they are in metres, in plan) or load more crossings.",
        )
    return np.flatnonzero(loaded)


def _polygons(where: str, given: Sequence[ArrayLike]) -> list[Reals]:
    result = []
    for k, polygon in enumerate(given):
        corners = reals(f"{where}[{k}]", polygon, (None, 2))
        if len(corners) < 3:
            raise InputError(
                "needs at least three corners",
                where=f"{where}[{k}]",
                value=len(corners),
                remedy="Give the corners' x and y in order, m, as [[0, 0], [1, 0], [0, 1]].",
            )
        result.append(corners)
    return result


def _down(weight: Reals) -> Reals:
    """Weights (n,), N, as a load (n, 6)."""
    load = np.zeros((len(weight), 6))
    load[:, 2] = -weight
    return load


_ANGLE = "a direction in plan in radians, such as 1.57"


def _numbers(name: str, given: object, count: int, give: str) -> None:
    """Raises InputError for what aren't so many numbers; infinite ones are no limit."""
    try:
        found = np.asarray(given, dtype=float)
    except (TypeError, ValueError):
        found = np.empty(0)
    if found.shape != (count,) or np.isnan(found).any():
        what, remedy = f"must be {count} numbers", f"Give {give}."
        raise InputError(what, where=f"load.{name}", value=given, remedy=remedy)
