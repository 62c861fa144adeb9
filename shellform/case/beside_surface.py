"""What of a case can't be on its surface, and what is doubtful on it: lengths in millimetres, weights in kN.

What can't be meant is refused before the net is pulled; what is only unusual is told.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from shellform.arrays import Reals
from shellform.case.case import Case
from shellform.case.entries import (
    CableEntry,
    ConcreteEntry,
    JointsWeightEntry,
    LoadEntry,
    OwnRodEntry,
    PointsEntry,
    SheetEntry,
)
from shellform.case.sized import STRETCHED
from shellform.case.wrong_loads import refuse_loads
from shellform.errors import InputError
from shellform.gridshell.loads import CONCRETE, GRAVITY, as_concrete, refuse_bulk
from shellform.quantities import (
    AREA_MASS,
    DENSITIES,
    DENSITY,
    FORCES,
    LENGTHS,
    MASSES,
    MILLINEWTONS,
    if_other_unit,
    newtons,
    number,
)
from shellform.surface.shape.target import Surface

_THICK = 0.04  # of the larger side: vaults of stone are as thick
_LIGHT, _HEAVY = 10.0, 2e4  # N/m²: 0.4 mm and 0.8 m of concrete
_LIKELY = (100.0, 5e3)  # N/m²: 4 mm and 0.2 m of concrete
_DENSE, _DENSEST = 1e4, 23e3  # kg/m³: of concrete and of rods
_FAR = 10.0  # times the larger side: what lies farther away has nothing to do with the surface
_WIDE = 30.0  # times the larger side, of an outline that then cuts nothing
_JOINTS = 500.0  # N/m²: as much as 20 mm of concrete


def refuse_beside(case: Case, surface: Surface) -> None:
    """Raises InputError for lengths of the case that no entry on this surface can have, and for loads that
    can't be on any."""
    refuse_loads(case)
    side = float(surface.size.max())
    for name, part in case.part.items():
        if isinstance(part, ConcreteEntry):
            refuse_bulk(surface, part.thickness, where=f"part.{name}.thickness")
    for where, length in _allowed(case):
        meant = if_other_unit(length, LENGTHS, side / 1e4, side / 20.0)
        if length > side and meant:
            raise InputError(
                f"is more than the surface's larger side of {side:.4g} m",
                where=where,
                value=length,
                remedy=f"Give metres, such as {side / 200.0:.1g}, or {0.9 * side:.2g} for no limit.{meant}",
            )
    for where, level in (("edges.ground", case.edges.ground), ("net.ground", case.net.ground)):
        if level is not None:
            _refuse_far(where, surface, np.array([[level]]), (2,))
    for where, curve in _curves(case):
        _refuse_far(where, surface, np.array(curve), (0, 1))


def doubts(case: Case, surface: Surface) -> tuple[str, ...]:
    """What may have been given in another unit, a sentence each."""
    side, area = float(surface.size.max()), case.net.spacing * (case.net.spacing_v or case.net.spacing)
    # beside concrete other loads may be light
    poured = any(isinstance(part, ConcreteEntry) for part in case.part.values())
    told = [
        f"{where} is {length:g} m: more than the surface's larger side, so that it limits nothing."
        for where, length in _allowed(case)
        if length > side
    ]
    for where, entry in _loads(case):
        if isinstance(entry, LoadEntry | PointsEntry):
            weight = entry.force / (entry.every * area)
            if (weight < _LIGHT and not poured) or weight > _HEAVY:
                likely = (each * entry.every * area for each in _LIKELY)
                meant = if_other_unit(entry.force, FORCES | MILLINEWTONS, *likely)
                told.append(
                    _doubt(f"{where}.force", f"{number(entry.force, 6)} N", as_concrete(weight), meant)
                )
        if isinstance(entry, ConcreteEntry):
            if entry.thickness > _THICK * side:
                meant = if_other_unit(entry.thickness, LENGTHS, side / 1000.0, _THICK * side)
                much = f"a {side / entry.thickness:.0f}th of the surface's larger side"
                told.append(_doubt(f"{where}.thickness", f"{entry.thickness:g} m", much, meant))
            if entry.density > _DENSE:
                meant = if_other_unit(entry.density, DENSITIES, 300.0, 6e3)
                times = f"{entry.density / CONCRETE:.3g}"
                much = f"{times} times what concrete has, as on a model 1 : {times}"
                told.append(_doubt(f"{where}.density", f"{entry.density:g} kg/m³", much, meant))
        if isinstance(entry, SheetEntry) and entry.mass * GRAVITY > _HEAVY / 10.0:
            meant = if_other_unit(entry.mass, AREA_MASS.units, 0.1, 100.0)
            much = as_concrete(entry.mass * GRAVITY)
            told.append(_doubt(f"{where}.mass", f"{entry.mass:g} kg/m²", much, meant))
        if isinstance(entry, JointsWeightEntry) and entry.mass * GRAVITY > _JOINTS * area:
            meant = if_other_unit(entry.mass, MASSES, 0.0, 0.1 * _JOINTS * area / GRAVITY)
            much = as_concrete(entry.mass * GRAVITY / area)
            told.append(_doubt(f"{where}.mass", f"{entry.mass:g} kg", much, meant))
    outline = np.ptp(np.array(case.net.outline or [(0.0, 0.0)]), axis=0).max()
    if outline > _WIDE * side:
        much = f"{outline / side:.0f} times as wide as the surface, so that it cuts nothing"
        told.append(_doubt("net.outline", f"{outline:g} m wide", much, ""))
    if isinstance(case.rod, OwnRodEntry) and case.rod.density > _DENSEST:
        meant = if_other_unit(case.rod.density, DENSITIES, *DENSITY.usual)
        much = "more than any material has, as on a model whose weights are to suit its loads"
        told.append(_doubt("rod.density", f"{case.rod.density:g} kg/m³", much, meant))
    return (*told, *_of_cables(case.cable))


def _of_cables(cable: CableEntry) -> Iterator[str]:
    """Where the largest force is less than what cables begin with, or no cable comes to it."""
    most, value = cable.force_max, f"cable.force_max is {number(cable.force_max, 6)} N"
    strained = cable.stiffness * (1.0 / cable.rest_ratio - 1.0)
    if strained > most:
        within = math.ceil(1e4 / (1.0 + most / cable.stiffness)) / 1e4
        begin = f" With cable.rest_ratio = {within:g} cables begin within it." if within < 1.0 else ""
        yield (
            f"{value}: less than the {newtons(strained)} to which cable.rest_ratio strains cables of {newtons(cable.stiffness)}."
            f"{begin}{if_other_unit(most, FORCES, strained, cable.stiffness)}"
        )
    if most > STRETCHED * cable.stiffness:
        yield f"{value}: so much as no cable of {newtons(cable.stiffness)} bears, so that it limits nothing."


def _doubt(where: str, value: str, what: str, meant: str) -> str:
    return f"{where} is {value}: {what}. Is the unit right?{meant}"


def _allowed(case: Case) -> Iterator[tuple[str, float]]:
    """How far the shape may be off, m, by the entries that say so."""
    for where, length in (
        ("limits.deviation", case.limits.deviation),
        ("limits.built_deviation", case.limits.built_deviation),
        ("limits.unloaded_deviation", case.limits.unloaded_deviation),
        ("optimise.deviation", case.optimise.deviation),
        ("optimise.misfit_rms_additional", case.optimise.misfit_rms_additional),
        ("robust.limit", None if case.robust is None else case.robust.limit),
        ("figures.limit", case.figures.limit),
    ):
        if length is not None:
            yield where, length


def _loads(case: Case) -> Iterator[tuple[str, Any]]:
    """The load, or load cases, and all parts of loads, by the entries."""
    yield "load", case.load
    for name, part in case.part.items():
        yield f"part.{name}", part


def _curves(case: Case) -> Iterator[tuple[str, Sequence[tuple[float, float]]]]:
    """The curves in plan, by the entries."""
    if case.net.outline:
        yield "net.outline", case.net.outline
    for k, guide in enumerate(case.net.guides or []):
        yield f"net.guides[{k}]", guide
    for k, stretch in enumerate(case.edges.stretch):
        if stretch.curve is not None:
            yield f"edges.stretch[{k}].curve", stretch.curve
    for where, entry in _loads(case):
        for name in ("openings", "inside"):
            for k, polygon in enumerate(getattr(entry, name, ())):
                if polygon:
                    yield f"{where}.{name}[{k}]", polygon


def _refuse_far(where: str, surface: Surface, points: Reals, axes: Sequence[int]) -> None:
    """Raises InputError for points (k, a), m, along some of the `axes`, whose box lies farther from the
    surface's than that is large."""
    low, high = (end[list(axes)] for end in (surface.vertices.min(axis=0), surface.vertices.max(axis=0)))
    reach = _FAR * float(surface.size.max())

    def far(given: Reals) -> bool:
        return bool(((given.min(axis=0) > high + reach) | (given.max(axis=0) < low - reach)).any())

    if not far(points):
        return
    units = [f" For millimetres write {_short(1e-3 * points)}."] if not far(1e-3 * points) else []
    raise InputError(
        f"lies away from the surface, which reaches from {_short(low)} to {_short(high)} m there",
        where=where,
        value=points[0].tolist() if len(points) > 1 else float(points[0, 0]),
        remedy=f"Give metres.{''.join(units)}",
    )


def _short(numbers: Reals) -> str:
    return ", ".join(f"{each:.4g}" for each in numbers.ravel()[:4]) + (" …" if numbers.size > 4 else "")
