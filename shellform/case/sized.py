"""The kinds of numbers of the case file: in SI units, and of a size that what they measure can have."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field, NonNegativeFloat, NonNegativeInt, PositiveFloat, PositiveInt

from shellform import quantities
from shellform.errors import InputError, require_degrees, typed
from shellform.quantities import FORCES, MEGANEWTONS, if_other_unit, newtons, number


def _turned(value: float | Literal["auto"]) -> float | Literal["auto"]:
    """An angle, degrees, or that it is to be sought. Raises InputError for more than a whole turn."""
    if value != "auto":
        require_degrees(value, where="", give="degrees, such as 45")
    return value


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
NodeForce = Annotated[PositiveFloat, AfterValidator(quantities.NODE_FORCE.require)]
RestRatio = Annotated[float, AfterValidator(quantities.require_rest_ratio)]
Axial = Annotated[PositiveFloat, AfterValidator(quantities.AXIAL.require)]
Flexural = Annotated[PositiveFloat, AfterValidator(quantities.FLEXURAL.require)]
Degrees = Annotated[float, AfterValidator(_turned)]
NetAngle = Annotated[float | Literal["auto"], AfterValidator(_turned)]
PlaceDeviation = Annotated[NonNegativeFloat, AfterValidator(quantities.PLACE_DEVIATION.or_none)]

_MOST = 1_000_000  # drawn structures and design evaluations: a day's work of a large machine, and years' of a small one
Share = Annotated[float, Field(ge=0.0, le=1.0)]
Count = Annotated[PositiveInt, Field(le=_MOST)]
CountOrNone = Annotated[NonNegativeInt, Field(le=_MOST)]

STRETCHED = 5.0  # strain of rubber where it breaks
_UNSTRETCHED = 1e-5  # strain to which no cable is set: a thousandth of steel's where it breaks


def refuse_strain(stiffness: float, force_max: float) -> None:
    """Raises InputError for cables of a stiffness EA, N, that no cable has beside the largest force, N, which
    it is let bear."""
    strain = force_max / stiffness
    likely = force_max, 1e4 * force_max
    meant = if_other_unit(stiffness, FORCES, *likely) or if_other_unit(stiffness, MEGANEWTONS, *likely)
    if strain > STRETCHED and meant:
        raise InputError(
            f"lets cables pull {newtons(force_max)}, at which they would be {number(1.0 + strain)} times as long",
            where="cable.stiffness",
            value=stiffness,
            remedy=f"Give EA and cable.force_max both in newtons, or cable.force_max = {typed(stiffness)} for no limit.{meant}",
        )
    if strain < _UNSTRETCHED:
        raise InputError(
            f"is what cables of {newtons(stiffness)} bear at a strain of {number(strain, 2)}, to which none can be set",
            where="cable.force_max",
            value=force_max,
            remedy="Give cable.stiffness, EA, and the force both in newtons."
            + if_other_unit(force_max, FORCES, 1e-4 * stiffness, stiffness),
        )
