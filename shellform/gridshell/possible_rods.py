"""Rods that there can be: of a material that there is, thinner than they are apart."""

from __future__ import annotations

import math

from shellform.errors import InputError
from shellform.quantities import (
    DENSITIES,
    DENSITY,
    MILLIMETRES,
    SHEAR,
    STRENGTH,
    STRESSES,
    YOUNG,
    Quantity,
    if_other_unit,
)
from shellform.structure.elements.sections import Section

_STIFFEST = 1e9  # m²/s², Young's modulus over density: diamond has 0.35e9, fibres of carbon up to 0.5e9
_WEAKEST = 1e-5  # strength over Young's modulus: brittle stone has ten times as much


def require_rods_material(
    young: float, shear: float | None, strength: float, density: float, *, where: str
) -> None:
    """Raises InputError where no rods are of a material with these moduli and strength (inf: not known), Pa,
    and density (0: not known), kg/m³; in the entries `where` they stand."""
    YOUNG.require(young, where=f"{where}.young")
    if shear is not None:
        SHEAR.require(shear, where=f"{where}.shear")
    if strength != math.inf:
        STRENGTH.require(strength, where=f"{where}.strength")
        if strength < _WEAKEST * young:
            low = max(STRENGTH.usual[0], 10.0 * _WEAKEST * young)
            raise InputError(
                f"is less than a {1.0 / _WEAKEST:.0f}th of Young's modulus, {young:g} Pa, as no material's is",
                where=f"{where}.strength",
                value=strength,
                remedy=f"Give {STRENGTH.give}.{if_other_unit(strength, STRESSES, low, STRENGTH.usual[1])}",
            )
    DENSITY.require(density, where=f"{where}.density", least=0.0)
    if density > 0.0 and young > _STIFFEST * density:
        low = max(DENSITY.usual[0], 2.0 * young / _STIFFEST)
        raise InputError(
            f"is too little for Young's modulus of {young:g} Pa: no material is so light and so stiff",
            where=f"{where}.density",
            value=density,
            remedy=f"Give {DENSITY.give}.{if_other_unit(density, DENSITIES, low, DENSITY.usual[1])}",
        )


def require_section(section: Section, sizes: Quantity, *, where: str) -> None:
    """Raises InputError for a section, given `where`, of a material that no rod has or of other than possible
    `sizes`."""
    own = section.material
    require_rods_material(own.young, own.shear, own.strength, own.density, where="material")
    for size in section.sizes:
        sizes.require(size, where=where)


def refuse_thick(size: float, times: float, spacing: float, *, where: str) -> None:
    """Raises InputError for rods so many `times` as wide as their `size`, m, given `where`, that would leave
    no room between them at that `spacing`, m."""
    if times * size >= spacing:
        raise InputError(
            f"makes rods {times * size:g} m wide, which are {spacing:g} m apart",
            where=where,
            value=size,
            remedy=f"Give metres, well below the spacing.{if_other_unit(size, MILLIMETRES, 0.005 * spacing, 0.3 * spacing)}",
        )
