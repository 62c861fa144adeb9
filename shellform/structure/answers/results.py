"""What an engineer checks on a loaded network: section forces and stresses, connector rotations, cables,
reactions, energies.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from shellform.arrays import Reals
from shellform.errors import InputError, require_known, unreadable
from shellform.quantities import DENSITY, SECTION_SIZE, SHEAR, STRENGTH, YOUNG, newtons, number
from shellform.structure.elements.beam import Beams
from shellform.structure.elements.cable import Cables
from shellform.structure.elements.sections import (
    SHAPES,
    Material,
    Section,
    isotropic,
    make_section,
    sizes_of,
    stiffness,
    stress,
    stress_by_force,
)
from shellform.structure.elements.state import State
from shellform.structure.network import Network

_MATERIAL = ("young", "shear", "poisson", "density", "strength")
_POSSIBLE = {"young": YOUNG, "shear": SHEAR, "density": DENSITY, "strength": STRENGTH}
_OFF = 0.05  # of a section's stiffness, by which a model's may differ: sizes are rounded


def end_stress(beams: Beams, forces: Reals, sections: Mapping[str, Section]) -> Reals:
    """Largest fibre stress (m, 2), Pa, at both ends of each beam from its section forces (16) (m, 7); NaN for
    kinds without a section.
    """
    result = np.full((len(beams.ends), 2), np.nan)
    for kind, section in sections.items():
        own = beams.of_kind(kind)
        if own.any():
            for end in range(2):
                axial, about_y, about_z = forces[own, 0], forces[own, 2 + 3 * end], forces[own, 3 + 3 * end]
                result[own, end] = stress(section, axial, about_y, about_z)
    return result


def end_stress_by_force(beams: Beams, forces: Reals, sections: Mapping[str, Section]) -> Reals:
    """Derivatives (m, 2, 7) of `end_stress` by the section forces of each beam, 1/m² and 1/m³; 0 for kinds
    without a section.
    """
    result = np.zeros((len(beams.ends), 2, 7))
    for kind, section in sections.items():
        own = beams.of_kind(kind)
        if own.any():
            for end in range(2):
                y, z = 2 + 3 * end, 3 + 3 * end
                rates = stress_by_force(section, forces[own, 0], forces[own, y], forces[own, z])
                result[own, end, 0], result[own, end, y], result[own, end, z] = rates
    return result


def utilisation(beams: Beams, forces: Reals, sections: Mapping[str, Section]) -> Reals:
    """Stress over strength (m,) of each beam, the larger of both ends'; NaN without a section, 0 without a
    known strength.
    """
    strength = np.array(
        [sections[kind].material.strength if kind in sections else np.nan for kind in beams.kinds]
    )
    return np.asarray(end_stress(beams, forces, sections).max(axis=1) / strength[beams.kind])


def twist(deformations: Reals) -> Reals:
    """Rotation (m,), rad, of each beam's second end against its first about its own axis, from its
    deformations (17) (m, 7): for a connector upright on the grid, the turning of the two rods against each
    other in the plane of the grid."""
    return np.asarray(deformations[:, 4] - deformations[:, 1])


def elongation(cables: Cables, state: State) -> Reals:
    """Length over rest length, less 1 (c,); negative in slack cables."""
    return np.asarray(cables.lengths(state) / cables.rest_length - 1.0)


def energy_by_kind(network: Network, state: State) -> dict[str, dict[str, float]]:
    """Strain energy, J, of each kind of beam, split into axial, torsion and bending, and of the cables."""
    beams = network.beams
    forces, deformations = beams.local_forces(state), beams.local_deformations(state)
    work = 0.5 * forces * deformations
    parts = {
        "axial": work[:, 0],
        "torsion": work[:, [1, 4]].sum(axis=1),
        "bending": work[:, [2, 3, 5, 6]].sum(axis=1),
    }
    result = {
        kind: {name: float(values[own].sum()) for name, values in parts.items()}
        for kind in beams.kinds
        if (own := beams.of_kind(kind)).any()
    }
    if len(network.cables.ends):
        result["cable"] = {"axial": float(network.cables.evaluate(state, tangent=False).energy.sum())}
    return result


def stiffness_doubts(beams: Beams, sections: Mapping[str, Section]) -> tuple[str, ...]:
    """Where sections resist in another way than the model's beams of their kind, a sentence each: stresses
    come of the forces that these bear and of the sizes that those have."""
    told = []
    for kind, section in sections.items():
        own, meant = beams.of_kind(kind), stiffness(section)
        there, here = list[str](), list[str]()
        for name, value, given in (
            ("EA", meant.axial, beams.axial),
            ("EIy", meant.bending_y, beams.bending_y),
            ("EIz", meant.bending_z, beams.bending_z),
        ):
            farthest = max(given[own].tolist(), key=lambda each: abs(each - value), default=value)
            if abs(farthest - value) > _OFF * value:
                for found, each in ((there, farthest), (here, value)):
                    found.append(f"{name} {newtons(each) if name == 'EA' else f'{number(each)} N·m²'}")
        if there:
            told.append(
                f"beams of kind {kind!r} resist with {', '.join(there)} in the model, their section with {', '.join(here)}: "
                "stresses and utilisation come of both. Is the unit right?"
            )
    return tuple(told)


def read_sections(path: str | Path) -> dict[str, Section]:
    """Sections by kind of beam from a TOML file: a table for each kind with `shape` (round, tube or
    rectangle), its sizes in m, `young` in Pa, `shear` in Pa or `poisson`, and optionally `density`, kg/m³,
    and `strength`, Pa. Raises InputError."""
    file = Path(path)
    try:
        tables = tomllib.loads(file.read_text(encoding="utf-8-sig"))
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(
            unreadable(error),
            where=str(file),
            remedy="Give the sections as TOML in UTF-8, a table for each kind of beam.",
        ) from error
    return {kind: _section(table, f"{file}: [{kind}]") for kind, table in tables.items()}


def _section(table: object, where: str) -> Section:
    if not isinstance(table, dict):
        raise InputError(
            "must be a table", where=where, value=table, remedy='Write [rod], and below it shape = "round" …'
        )
    shape: Any = table.get("shape")
    require_known(shape, SHAPES, where=where, what="unknown shape")
    sizes = sizes_of(shape)
    for name in table:
        if name not in ("shape", *sizes, *_MATERIAL):
            raise InputError(
                f"unknown entry {name!r}", where=where, remedy=f"Known: {', '.join((*sizes, *_MATERIAL))}."
            )
    for name in (*sizes, "young"):
        if name not in table:
            raise InputError(f"the entry {name!r} is missing", where=where, remedy="Add it.")
    for name, value in table.items():
        if name != "shape" and (isinstance(value, bool) or not isinstance(value, int | float)):
            raise InputError(
                "must be a number",
                where=f"{where}.{name}",
                value=value,
                remedy="Write it without quotation marks, in SI units: 0.005, 40e9.",
            )
    if ("shear" in table) == ("poisson" in table):
        raise InputError(
            "needs either shear or poisson",
            where=where,
            remedy="Give one of the two: each follows from young and the other.",
        )
    for name, value in table.items():
        possible = SECTION_SIZE if name in sizes else _POSSIBLE.get(name)
        if possible is not None:
            least = 0.0 if name == "density" else None
            possible.require(float(value), where=f"{where}.{name}", least=least)
    known = {name: float(table[name]) for name in ("density", "strength") if name in table}
    if "shear" in table:
        material = Material(float(table["young"]), float(table["shear"]), **known)
    else:
        material = isotropic(young=float(table["young"]), poisson=float(table["poisson"]), **known)
    return make_section(shape, (float(table[name]) for name in sizes), material)
