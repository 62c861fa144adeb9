"""From a case to the gridshell and its loads."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from shellform.arrays import Reals
from shellform.case.build_rod import given_section, layered, rod_material, section_of_sizes, stock
from shellform.case.case import (
    Case,
    ConcreteEntry,
    JointEntry,
    JointsWeightEntry,
    LoadCaseEntry,
    LoadEntry,
    OwnRodEntry,
    PointsEntry,
    SheetEntry,
    StockRodEntry,
)
from shellform.case.edge_entries import EdgeBeamEntry
from shellform.errors import InputError
from shellform.gridshell import loads
from shellform.gridshell.catalogue import (
    Catalogue,
    largest,
    named,
    radius_bounds,
    read_catalogue,
    shipped_catalogues,
)
from shellform.gridshell.edge_beams import Bundle, EdgeBeam, weight
from shellform.gridshell.gridshell import (
    Cable,
    Gridshell,
    Joint,
    Rod,
    TooCurved,
    brace,
    erection_stress,
    max_radius,
)
from shellform.gridshell.layers import single
from shellform.gridshell.loads import Region
from shellform.net.net import Net
from shellform.structure.elements.sections import Material, Round, Section, section_area
from shellform.surface.shape.target import Surface


def gridshell(case: Case, net: Net, surface: Surface) -> tuple[Gridshell, dict[str, Reals]]:
    """The case's gridshell and its load cases (n, 6): "none", "design", "additional", then the others as they
    are listed.
    """
    joint = joint_of(case.joint)
    rod, cable = rod_of(case.rod, net), Cable(case.cable.stiffness)
    edge = edge_beam(case.edges.beam, rod) if net.edges else None
    shell = brace(net, rod, joint, cable, below=surface, edge=edge, edge_cells=has_edge_cells(case))
    return shell, load_cases(case, shell, surface)


def joint_of(entry: JointEntry) -> Joint:
    """The case's joints."""
    return Joint(entry.axial, entry.torsion, entry.bending, entry.gap)


def has_edge_cells(case: Case) -> bool:
    """Whether cells at the edge have candidates; the paper's do."""
    asked = case.cable.edge_cells
    return case.optimise.method == "paper" if asked is None else asked


def edge_beam(entry: EdgeBeamEntry, rod: Rod) -> EdgeBeam:
    """The case's edge beams; what isn't given is as the `rod`. A bundle is of rods as these are."""
    if entry.catalogue is not None and entry.section is not None:
        return EdgeBeam(named(read_catalogue(entry.catalogue), entry.section))
    own = rod.section.material
    young = own.young if entry.young is None else entry.young
    shear = own.shear if entry.young is None else young / (2.0 * (1.0 + entry.poisson))
    material = Material(
        young,
        shear,
        own.density if entry.density is None else entry.density,
        own.strength if entry.strength is None else entry.strength,
    )
    section = section_of_sizes(entry, material)
    if section is not None:
        return EdgeBeam(section)
    # The round rod of a lath's or a tube's area stands for it in a bundle.
    radius = math.sqrt(section_area(single(rod.section)) / math.pi)
    return EdgeBeam(Bundle(radius, 19 if entry.rods is None else entry.rods, entry.composite, material))


def rod_of(entry: OwnRodEntry | StockRodEntry, net: Net) -> Rod:
    """The case's rods; without given sizes the largest that the net allows. Raises InputError where it allows
    any.
    """
    section = given_section(entry)
    if section is not None:
        return Rod(section)
    if isinstance(entry, StockRodEntry):
        return Rod(largest(stock(entry, entry.catalogue), net))
    material = rod_material(entry)
    radius = net.max_radius(young=material.young, strength=material.strength)
    if not math.isfinite(radius):
        raise InputError(
            "is needed: the net is straight, so that it bears rods of any size",
            where="rod.radius",
            remedy="Give rod.radius, in m, or rods of a catalogue.",
        )
    return Rod(layered(entry, Round(radius, material)))


@dataclass(frozen=True)
class RodLimits:
    """What a net allows of rods: the farthest that the outermost fibre may lie from a round rod's axis
    (`radius_max`, m), the curvature that the case's rods bear, 1/m, bent as the net bends them (laths across
    the surface and in it), and the net's largest over it, which is the share of their strength that bending
    takes."""

    radius_max: float
    curvature_limit: float
    curvature_utilisation: float


def rod_limits(entry: OwnRodEntry | StockRodEntry, net: Net) -> RodLimits:
    """What the net allows of the case's rods."""
    material, section = rod_material(entry), given_section(entry)
    most = net.max_radius(young=material.young, strength=material.strength)
    if not math.isfinite(most):  # straight
        bearable = 0.0 if section is None else material.strength / (material.young * max(section.fibres))
        return RodLimits(most, bearable, 0.0)
    used = _bent_to(entry, net, section)
    return RodLimits(most, net.quality.curvature_max / used, used)


def _bent_to(entry: OwnRodEntry | StockRodEntry, net: Net, section: Section | None) -> float:
    """The share of their strength to which the case's rods are bent in the net: those of a catalogue, where
    no section is named, as they are chosen, or the one that is bent to the least where all break."""
    if section is not None:
        return erection_stress(net, section) / section.material.strength
    if not isinstance(entry, StockRodEntry):
        return 1.0  # the largest that the net allows
    try:
        chosen = largest(stock(entry, entry.catalogue), net)
    except TooCurved as error:
        return error.radius * net.quality.curvature_max
    return erection_stress(net, chosen) / chosen.material.strength


def rod_bounds(case: Case, shell: Gridshell) -> tuple[float, float]:
    """Bounds (4) of the rods' radius, m: the catalogue's, or from half the start's to the largest that the
    net allows.
    """
    rod, lowest = shell.rod, case.optimise.radius_min
    catalogue = rounding_catalogue(case)
    if catalogue is not None:
        low, high = radius_bounds(shell.net, rod, catalogue)
    else:
        low, high = 0.5 * rod.radius, max(rod.radius, max_radius(shell.net, rod))
    return lowest or low, high


def rounding_catalogue(case: Case) -> Catalogue | None:
    """The catalogue to which a free radius is rounded, if there is one."""
    if case.optimise.catalogue is not None:
        return stock(case.rod, case.optimise.catalogue)
    return stock(case.rod, case.rod.catalogue) if isinstance(case.rod, StockRodEntry) else None


def load_cases(case: Case, shell: Gridshell, surface: Surface) -> dict[str, Reals]:
    """The case's loads (n, 6), N: "none", "design", "additional", then the others as they are listed."""
    entry = case.load
    if isinstance(entry, LoadEntry):
        design = shell.point_load(entry.force, every=entry.every, openings=entry.openings)
        return {"none": np.zeros_like(design), "design": design, "additional": entry.additional * design}
    used = parts_used(entry)
    return cases_of_parts(entry, {name: _named(name, case.part[name], shell, surface) for name in used})


def parts_used(entry: Sequence[LoadCaseEntry]) -> list[str]:
    """The parts that load cases add up, each once."""
    return list(dict.fromkeys(part for each in entry for part in [*each.factors, *each.stages]))


def cases_of_parts(entry: Sequence[LoadCaseEntry], parts: Mapping[str, Reals]) -> dict[str, Reals]:
    """As `load_cases`, of the parts by name."""
    found: dict[str, Reals] = {}
    for each in entry:
        where = f"load {each.name!r}"
        if each.stages:
            found |= loads.staged(parts, each.stages, name=each.name, factors=each.factors, where=where)
        else:
            found[each.name] = loads.combined(parts, each.factors, where=where)
    if len(found) < sum(max(1, len(each.stages)) for each in entry):
        raise InputError(
            "a stage has the name of another case",
            where="load.stages",
            value=list(found),
            remedy="Give the stage another name.",
        )
    if not found["design"][:, 2].any():
        raise InputError(
            "weighs nothing", where="load 'design'", remedy="Give its parts factors other than 0."
        )
    first = {
        "none": np.zeros_like(found["design"]),
        "design": found["design"],
        "additional": found["additional"],
    }
    return first | found


def _named(name: str, entry: Any, shell: Gridshell, surface: Surface) -> Reals:
    try:
        return _part(entry, shell, surface)
    except InputError as error:
        raise error.within(f"part.{name}") from error


def _part(entry: Any, shell: Gridshell, surface: Surface) -> Reals:
    net = shell.net
    if isinstance(entry, PointsEntry):
        return loads.points(net, entry.force, every=entry.every, openings=entry.openings, inside=entry.inside)
    if isinstance(entry, ConcreteEntry):
        return loads.concrete(
            net, surface, thickness=entry.thickness, density=entry.density, region=_region(entry)
        )
    if isinstance(entry, SheetEntry):
        return loads.sheet(net, surface, entry.mass, _region(entry))
    if isinstance(entry, JointsWeightEntry):
        return loads.joints(net, entry.mass)
    own = loads.rods(net, shell.rod.section)
    return own if shell.edge is None else own + weight(net, shell.edge)


def _region(entry: ConcreteEntry | SheetEntry) -> Region:
    turned = None if entry.half is None else math.radians(entry.half)
    strip = None if entry.strip is None else (math.radians(entry.strip[0]), *entry.strip[1:])
    return Region(entry.openings, entry.inside, turned, strip, entry.ring)


def own_catalogues(case: Case) -> dict[str, Path]:
    """Files of the case's own catalogues, those that don't come with shellform, by the table that names
    them."""
    named_by = {
        "optimise": case.optimise.catalogue,
        "rod": case.rod.catalogue if isinstance(case.rod, StockRodEntry) else None,
        "edges": case.edges.beam.catalogue,
    }
    shipped = shipped_catalogues()
    return {table: Path(each) for table, each in named_by.items() if each is not None and each not in shipped}


def with_catalogues(case: Case, files: Mapping[str, str]) -> Case:
    """The case with other files for its own catalogues, by the table that names them."""
    entries: dict[str, Any] = {"optimise": case.optimise, "rod": case.rod, "edges": case.edges.beam}
    renamed = {table: entries[table].model_copy(update={"catalogue": file}) for table, file in files.items()}
    if "edges" in renamed:
        renamed["edges"] = case.edges.model_copy(update={"beam": renamed["edges"]})
    return case.model_copy(update=renamed)


def catalogue_bytes(case: Case) -> bytes:
    """The content of the case's own catalogues, if it has any, for the keys of its stages."""
    return b"".join(each.read_bytes() for each in own_catalogues(case).values() if each.is_file())
