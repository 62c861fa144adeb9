"""From the case's [rod] to what its rods are made of and the section that they have."""

from __future__ import annotations

from dataclasses import replace

from shellform.case.edge_entries import EdgeBeamEntry
from shellform.case.entries import OwnRodEntry, StockRodEntry
from shellform.gridshell.catalogue import Catalogue, label, named, radius_as_stiff, read_catalogue
from shellform.gridshell.gridshell import Rod
from shellform.gridshell.layers import TwoLayers
from shellform.records.remedies import RodSizes
from shellform.structure.elements.sections import Material, Rectangle, Round, Section, Tube, isotropic


def rod_material(entry: OwnRodEntry | StockRodEntry) -> Material:
    """What the case's rods are made of."""
    if isinstance(entry, StockRodEntry):
        return read_catalogue(entry.catalogue).material
    if entry.shear is not None:
        return Material(entry.young, entry.shear, entry.density, entry.strength)
    return isotropic(young=entry.young, poisson=entry.poisson, density=entry.density, strength=entry.strength)


def given_section(entry: OwnRodEntry | StockRodEntry) -> Section | None:
    """The section that the case's rods have whatever the net; None where the net's curvature decides."""
    section = _of_one_layer(entry)
    return None if section is None else layered(entry, section)


def layered(entry: OwnRodEntry | StockRodEntry, section: Section) -> Section:
    """Rods of the section in as many layers as the case has them."""
    return TwoLayers(section, entry.composite) if entry.layers == 2 else section


def stock(entry: OwnRodEntry | StockRodEntry, source: str) -> Catalogue:
    """The catalogue `source` with its sections in as many layers as the case's rods have."""
    found = read_catalogue(source)
    return replace(found, sections=tuple(layered(entry, each) for each in found.sections))


def _of_one_layer(entry: OwnRodEntry | StockRodEntry) -> Section | None:
    if isinstance(entry, StockRodEntry):
        return None if entry.section is None else named(read_catalogue(entry.catalogue), entry.section)
    return section_of_sizes(entry, rod_material(entry))


def section_of_sizes(entry: OwnRodEntry | EdgeBeamEntry, material: Material) -> Section | None:
    """The lath, the round rod or the tube whose sizes an entry gives; None where it gives none."""
    if entry.width is not None and entry.height is not None:
        return Rectangle(entry.width, entry.height, material)
    if entry.radius is None:
        return None
    return Round(entry.radius, material) if entry.wall is None else Tube(entry.radius, entry.wall, material)


def rod_sizes(
    entry: OwnRodEntry | StockRodEntry,
    rod: Rod,
    *,
    free: bool = False,
    keeps: bool = False,
    least: float | None = None,
) -> RodSizes:
    """How the case gives the size of its `rod`, for remedies that name it: whether the search is `free` to
    choose the radius, m, from `least` on, and `keeps` the stress below a limit."""
    if isinstance(entry, StockRodEntry):
        single = read_catalogue(entry.catalogue).sections
        bought = [(label(each), radius_as_stiff(rod, layered(entry, each))) for each in single]
        return RodSizes({}, rod.radius, bought, free, keeps, least or 0.0)
    names = ("radius", "wall", "width", "height")
    given = {f"rod.{name}": getattr(entry, name) for name in names}
    sizes = {name: value for name, value in given.items() if value is not None}
    return RodSizes(sizes or {"rod.radius": rod.radius}, rod.radius, (), free, keeps, least or 0.0)
