"""The kinds of numbers of the case file: in SI units, and of a size that what they measure can have."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, NonNegativeFloat, PositiveFloat

from shellform import quantities
from shellform.errors import InputError
from shellform.quantities import FORCES, if_other_unit

Spacing = Annotated[PositiveFloat, AfterValidator(quantities.SPACING.require)]
Gap = Annotated[PositiveFloat, AfterValidator(quantities.GAP.require)]
RodSize = Annotated[PositiveFloat, AfterValidator(quantities.ROD_SIZE.require)]
EdgeSize = Annotated[PositiveFloat, AfterValidator(quantities.EDGE_SIZE.require)]
Young = Annotated[PositiveFloat, AfterValidator(quantities.YOUNG.require)]
Shear = Annotated[PositiveFloat, AfterValidator(quantities.SHEAR.require)]
Strength = Annotated[PositiveFloat, AfterValidator(quantities.STRENGTH.require)]
Density = Annotated[NonNegativeFloat, AfterValidator(quantities.DENSITY.or_none)]
StockLength = Annotated[PositiveFloat, AfterValidator(quantities.STOCK_LENGTH.require)]
Kerf = Annotated[NonNegativeFloat, AfterValidator(quantities.KERF.or_none)]
Adjustment = Annotated[NonNegativeFloat, AfterValidator(quantities.ADJUSTMENT.or_none)]
Thickness = Annotated[PositiveFloat, AfterValidator(quantities.THICKNESS.require)]
ConcreteDensity = Annotated[PositiveFloat, AfterValidator(quantities.CONCRETE_DENSITY.require)]
AreaMass = Annotated[PositiveFloat, AfterValidator(quantities.AREA_MASS.require)]
JointMass = Annotated[PositiveFloat, AfterValidator(quantities.JOINT_MASS.require)]
PlaceDeviation = Annotated[NonNegativeFloat, AfterValidator(quantities.PLACE_DEVIATION.or_none)]

STRETCHED = 5.0  # strain of rubber where it breaks
_UNSTRETCHED = 1e-5  # strain to which no cable is set: a thousandth of steel's where it breaks


def refuse_strain(stiffness: float, force_max: float) -> None:
    """Raises InputError for cables of a stiffness EA, N, that no cable has beside the largest force, N, which
    it is let bear."""
    strain = force_max / stiffness
    meant = if_other_unit(stiffness, FORCES, force_max, 1e4 * force_max)
    if strain > STRETCHED and meant:
        raise InputError(
            f"lets cables pull {force_max:g} N, at which they would be {1.0 + strain:.3g} times as long",
            where="cable.stiffness",
            value=stiffness,
            remedy=f"Give EA and cable.force_max both in newtons, or cable.force_max = {stiffness:g} for no limit.{meant}",
        )
    if strain < _UNSTRETCHED:
        raise InputError(
            f"is what cables of {stiffness:g} N bear at a strain of {strain:.2g}, to which none can be set",
            where="cable.force_max",
            value=force_max,
            remedy="Give cable.stiffness, EA, and the force both in newtons."
            + if_other_unit(force_max, FORCES, 1e-4 * stiffness, stiffness),
        )
