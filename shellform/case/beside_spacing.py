"""What of a case can't be beside the distance of its rods: seen before there is a surface."""

from __future__ import annotations

from shellform.case.entries import CableEntry, JointEntry, NetEntry, OptimiseEntry, OwnRodEntry
from shellform.case.safety_entries import TolerancesEntry
from shellform.errors import InputError
from shellform.gridshell.possible_rods import refuse_thick
from shellform.gridshell.tolerances import LENGTHS as DEVIATIONS
from shellform.quantities import LENGTHS, MILLIMETRES, if_other_unit

_LONGEST = 2.0  # spacings, of a cell's diagonal
_OFF = 0.25  # spacings: what lies so far off as a standard deviation has no place in the grid


def refuse_rods(rod: OwnRodEntry, net: NetEntry) -> None:
    """Raises InputError for rods as thick as they are apart."""
    for name, times in (("radius", 2.0), ("width", 1.0)):
        size = getattr(rod, name)
        if size is not None:
            refuse_thick(size, times, _spacing(net), where=f"rod.{name}")


def refuse_others(
    net: NetEntry, joint: JointEntry, cable: CableEntry, tolerances: TolerancesEntry, optimise: OptimiseEntry
) -> None:
    """Raises InputError for a gap, deviations and lengths of cables that no grid of that spacing has."""
    spacing = _spacing(net)
    if joint.gap >= 0.5 * spacing:
        raise InputError(
            f"must be well below net.spacing ({spacing:g} m)",
            where="joint.gap",
            value=joint.gap,
            remedy=f"Give metres, twice the rod's radius as is usual, or rods more than {2.0 * joint.gap:g} m apart (net.spacing).{if_other_unit(joint.gap, MILLIMETRES, 0.002 * spacing, 0.4 * spacing)}",
        )
    for name in DEVIATIONS:
        deviation = getattr(tolerances, name)
        if deviation is not None and deviation > _OFF * spacing:
            _refuse(
                f"tolerances.{name}", deviation, f"{_OFF:g} of net.spacing", 1e-5 * spacing, 0.1 * spacing
            )
    longest = _LONGEST * max(net.spacing, net.spacing_v or 0.0)
    for name, length, share in (
        ("cable.adjustment", cable.adjustment, 0.2),
        ("optimise.rest_length_min", optimise.rest_length_min, 0.5),
    ):
        if length is not None and length > longest:
            _refuse(
                name,
                length,
                f"the longest cable between rods {spacing:g} m apart",
                1e-4 * spacing,
                share * longest,
            )


def _refuse(where: str, value: float, what: str, low: float, high: float) -> None:
    raise InputError(
        f"is more than {what}",
        where=where,
        value=value,
        remedy=f"Give metres, such as {0.5 * high:.2g}.{if_other_unit(value, LENGTHS, low, high)}",
    )


def _spacing(net: NetEntry) -> float:
    return min(net.spacing, net.spacing_v or net.spacing)
