"""What numbers measure: the SI unit, what is possible, and the units in which they are given by mistake.

A length in millimetres where metres are asked for, a modulus in GPa or a density in t/m³ is refused where it
comes in, with the number to write: "For 50 mm write 0.05." What is `possible` is wide enough for models of a
hand's size, halls of 100 m and materials from foam to diamond; what doesn't suit the surface or the spacing
is refused where these are known, with the same words (`if_other_unit`). A number that was converted twice is
told as what it was: 0.00005 as 50 mm.

What is told to people is written as they write it: digits in groups, forces in N, kN or MN, and powers of ten
only where there would be more noughts than can be read at a glance.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Final

from shellform.errors import InputError, require_number, typed

MILLIMETRES: Final = {"mm": 1e-3}
LENGTHS: Final = {"mm": 1e-3, "cm": 1e-2}
STRESSES: Final = {"MPa": 1e6, "GPa": 1e9, "kPa": 1e3}
MODULI: Final = {"GPa": 1e9, "MPa": 1e6, "kPa": 1e3}
DENSITIES: Final = {"t/m³": 1e3, "kN/m³": 1e3 / 9.81, "N/m³": 1.0 / 9.81, "g/m³": 1e-3}
FORCES: Final = {"kN": 1e3}
MEGANEWTONS: Final = {"MN": 1e6}
MILLINEWTONS: Final = {"mN": 1e-3}
MASSES: Final = {"g": 1e-3}
"""By their names, so much of each in the SI unit."""
_RAISED: Final = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_NEWTONS: Final = ((1e7, "MN", 1e6), (1e3, "kN", 1e3))  # from so many N on, so many N a unit
_STRETCHED_ONCE = 50.0  # per cent: what is less is no rest length of a cable
_ROUNDING = 1e-9  # of the largest extent
_TWICE = 1e3  # what is lost where a number in the SI unit was taken for one in its thousandth


@dataclass(frozen=True)
class Quantity:
    """A kind of number: `give` says what to give, with the SI `unit` and an example; `of` whose it is; from
    the least to the most that is `possible`; from and to what is `usual`, m, Pa or kg/m³: what a number in
    another of the `units` must come to for these to be named."""

    of: str
    unit: str
    give: str
    possible: tuple[float, float]
    usual: tuple[float, float]
    units: Mapping[str, float]

    def require(self, value: float, *, where: str = "", least: float | None = None) -> float:
        """The value. Raises InputError for one that isn't possible; with a `least` of 0 that is too: none of
        it."""
        require_number(value, where=where, give=self.give)
        if value < 0.0 or (value == 0.0 and least is None):
            require_number(value, above=0.0, where=where, give=self.give)
        low, high = self.possible
        if value == least or low <= value <= high:
            return value
        raise InputError(
            f"must be between {typed(low)} and {typed(high)} {self.unit}, as {self.of}",
            where=where,
            value=value,
            remedy=f"Give {self.give}.{self.hint(value)}",
        )

    def or_none(self, value: float) -> float:
        """The same of what may be 0."""
        return self.require(value, least=0.0)

    def hint(self, value: float) -> str:
        """What to write of a value that was given in another unit."""
        return if_other_unit(value, self.units, *self.usual)


def require_rest_ratio(value: float, *, where: str = "") -> float:
    """The value, rest length over length of a cable that is strained. Raises InputError."""
    share = isinstance(value, int | float) and value >= _STRETCHED_ONCE  # 1.5 may be 1.5 % of strain
    give = "rest length over length, a little below 1, such as 0.99"
    require_number(value, above=0.0, below=1.0, where=where, give=give, share=share)
    return value


def if_other_unit(value: float, units: Mapping[str, float], low: float, high: float) -> str:
    """What to write of a value that is meant to lie between `low` and `high` and that does so in one of the
    `units` (each by its name, so much in the SI unit): of 50, in mm, 0.05."""
    found = {unit: value * each for unit, each in units.items() if low <= value * each <= high}
    told = [f" For {typed(value)} {unit} write {typed(meant)}." for unit, meant in found.items()]
    unit, each = next(iter(units.items()))
    for meant in (_TWICE * value, value / _TWICE):
        if not told and low <= meant <= high:
            told = [f" For {typed(meant / each)} {unit} write {typed(meant)}."]
    return "".join(told)


def number(value: float, digits: int = 3) -> str:
    """A number for people: so many digits, in groups of three (12 300), as a power of ten (3 × 10⁻⁵) below
    0.0001 and from a milliard on."""
    if not math.isfinite(value):
        return "?"
    if value == 0.0:
        return "0"
    told = f"{value:.{digits - 1}e}"
    if 1e-4 <= abs(float(told)) < 1e9:
        places = max(0, digits - 1 - math.floor(math.log10(abs(value))))
        text = f"{value:,.{places}f}".replace(",", "\u202f")
        return text.rstrip("0").rstrip(".") if "." in text else text
    mantissa, _, power = told.partition("e")
    short = mantissa.rstrip("0").rstrip(".") if "." in mantissa else mantissa
    return f"{short} × 10{str(int(power)).translate(_RAISED)}"


def coordinates(point: Iterable[float], digits: int = 3) -> str:
    """A point, m, for people: "(1.2, -3, 0.45)"."""
    return "(" + ", ".join(f"{each + 0.0:.{digits}g}" for each in point) + ")"


def rounded(point: Iterable[float], places: int = 3) -> list[float]:
    """A point's coordinates, m, to so many decimals, as messages list them: 0.0 for what rounds to -0.0."""
    return [round(float(each), places) + 0.0 for each in point]


def extents(size: Iterable[float]) -> list[float]:
    """A surface's extents, m, as people are told them: 0 for what is rounding alone beside the largest."""
    sides = [float(each) for each in size]
    return [each if each > _ROUNDING * max(sides) else 0.0 for each in sides]


def force_unit(most: float) -> tuple[str, float]:
    """The unit in which forces up to `most`, N, are read, and how many N it is: N below 1 kN, kN below
    10 MN."""
    return next(((unit, size) for least, unit, size in _NEWTONS if abs(most) >= least), ("N", 1.0))


def newtons(force: float, digits: int = 3) -> str:
    """A force, N, for people, with its unit, which is that of the number that is told."""
    told = float(f"{force:.{digits - 1}e}")
    unit, size = force_unit(told)
    return f"{number(force / size, digits)} {unit}"


ROD_SIZE: Final = Quantity(
    "every rod's radius, wall, width or height is",
    "m",
    "metres, such as 0.0012",
    (1e-5, 0.9),
    (1e-4, 0.5),
    MILLIMETRES,
)
EDGE_SIZE: Final = Quantity(
    "every edge beam's radius, wall, width or height is",
    "m",
    "metres, such as 0.0012",
    (1e-5, 2.0),
    (1e-4, 1.5),
    MILLIMETRES,
)
SECTION_SIZE: Final = Quantity(
    "every beam's radius, thickness, width or height is",
    "m",
    "metres, such as 0.0012",
    (1e-5, 2.0),
    (1e-4, 1.5),
    MILLIMETRES,
)
DIAMETER: Final = Quantity(
    "every rod's diameter, wall, width or height is",
    "m",
    "metres, such as 0.0024",
    (1e-5, 1.8),
    (1e-4, 1.2),
    MILLIMETRES,
)
SPACING: Final = Quantity(
    "every distance of a gridshell's rods is",
    "m",
    "metres, such as 0.5",
    (1e-4, 50.0),
    (5e-3, 5.0),
    MILLIMETRES,
)
GAP: Final = Quantity(
    "every distance of two crossing rods' axes is",
    "m",
    "metres, at least a rod's diameter, such as 0.0024",
    (1e-9, 0.9),
    (1e-4, 0.5),
    MILLIMETRES,
)
THICKNESS: Final = Quantity(
    "every layer of concrete on a gridshell is",
    "m",
    "metres, such as 0.05",
    (5e-4, 1.0),
    (1.5e-3, 0.3),
    LENGTHS,
)
# Below soft foam's, 4e5, and above steel's in MPa; far above diamond's, 1.2e12, for models whose EI is 1.
YOUNG: Final = Quantity(
    "every rod's modulus is",
    "Pa",
    "pascals, such as 40e9",
    (2.5e5, 1e14),
    (1e9, 1e12),
    MODULI,
)
SHEAR: Final = Quantity(
    "every rod's shear modulus is",
    "Pa",
    "pascals, such as 4.5e9",
    (1e5, 1e14),
    (3e7, 5e11),
    MODULI,
)
STRENGTH: Final = Quantity(
    "every rod's strength is",
    "Pa",
    "pascals, such as 255e6",
    (1e4, 5e10),
    (1e6, 1e10),
    STRESSES,
)
# Of models whose load on an area is to stay densities go with 1 over their scale (table 1 of the paper).
DENSITY: Final = Quantity(
    "every rod's density is, on models too",
    "kg/m³",
    "kg/m³, such as 2000",
    (10.0, 1e6),
    (90.0, 23e3),
    DENSITIES,
)
CONCRETE_DENSITY: Final = Quantity(
    "whatever is poured is, on models too",
    "kg/m³",
    "kg/m³, such as 2500",
    (50.0, 1e6),
    (300.0, 6e3),
    DENSITIES,
)
AREA_MASS: Final = Quantity(
    "every membrane and reinforcement is",
    "kg/m²",
    "kg/m², such as 1.2",
    (1e-4, 500.0),
    (0.01, 100.0),
    {"g/m²": 1e-3},
)
JOINT_MASS: Final = Quantity(
    "every joint's mass is", "kg", "kilograms, such as 0.05", (1e-7, 500.0), (1e-4, 50.0), MASSES
)
STOCK_LENGTH: Final = Quantity(
    "every length in which rods are sold is",
    "m",
    "metres as they are sold, such as 6.0",
    (0.05, 1000.0),
    (0.3, 50.0),
    LENGTHS,
)
KERF: Final = Quantity(
    "every saw's cut is",
    "m",
    "a saw cut's width in metres, such as 0.003",
    (1e-5, 0.1),
    (5e-4, 0.01),
    LENGTHS,
)
ADJUSTMENT: Final = Quantity(
    "every turnbuckle's range is",
    "m",
    "metres of the turnbuckles' range, such as 0.02",
    (1e-5, 2.0),
    (1e-3, 0.5),
    LENGTHS,
)
NODE_FORCE: Final = Quantity(
    "every load on a crossing is", "N", "newtons a crossing, such as 6.9", (1e-6, 1e8), (0.01, 1e6), FORCES
)
# Wider than what rods of possible sizes and moduli come to.
AXIAL: Final = Quantity(
    "every EA of cables and joints is", "N", "EA in newtons, such as 7e4", (1e-6, 1e14), (10.0, 1e10), FORCES
)
FLEXURAL: Final = Quantity(
    "every GJ and EI of joints is",
    "N·m²",
    "GJ and EI in N·m², such as 7.5e-4",
    (1e-15, 1e14),
    (1e-6, 1e8),
    {"kN·m²": 1e3},
)
PLACE_DEVIATION: Final = Quantity(
    "every standard deviation of a place or a length is",
    "m",
    "metres, such as 0.0001",
    (1e-9, 1.0),
    (5e-6, 0.1),
    LENGTHS,
)
TURN: Final = Quantity(
    "what a cable is turned by in one round is",
    "m",
    "metres of rest length, such as 0.00025",
    (1e-7, 0.2),
    (2e-5, 0.05),
    MILLIMETRES,
)
