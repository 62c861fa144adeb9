"""Cross-sections of rods: solid round, tube and rectangle, with the elastic properties and stresses that
follow from their sizes.

With area A, second moments I_y, I_z and torsion constant J a rod has EA, GJ, EI_y and EI_z; all four are
given with their derivatives by each size, in the order of `sizes`. Round sections have J = I_y + I_z. A
rectangle of sides a >= b has (Timoshenko and Goodier, Theory of Elasticity, art. 109)

    J = a b³ (1/3 - 64/π⁵ (b/a) Σ tanh(n π a / 2b) / n⁵),   n = 1, 3, 5, ...

The bending stress at a fibre is N/A plus the moments' part; a round rod's largest is |N|/A + |M| r / I, a
rectangle's is in a corner.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, fields
from typing import NamedTuple, Protocol

import numpy as np

from shellform.arrays import Reals
from shellform.errors import InputError, require_number

_ODD = np.arange(1.0, 40.0, 2.0)  # terms of the series; the rest is below 1e-7 of the sum


@dataclass(frozen=True)
class Material:
    """Young's and shear modulus, Pa; density, kg/m³; flexural strength, Pa (inf: not known)."""

    young: float
    shear: float
    density: float = 0.0
    strength: float = math.inf

    def __post_init__(self) -> None:
        for name, value, give in [
            ("young", self.young, "pascals, such as 40e9"),
            ("shear", self.shear, "pascals, such as 15e9"),
            ("strength", self.strength, "pascals, such as 255e6, or leave it out where it isn't known"),
        ]:
            if name != "strength" or value != math.inf:
                require_number(value, above=0.0, where=f"material.{name}", give=give)
        give = "kg/m³, such as 2000, or 0 for weightless rods"
        require_number(self.density, least=0.0, where="material.density", give=give)


def isotropic(
    *, young: float, poisson: float = 0.3, density: float = 0.0, strength: float = math.inf
) -> Material:
    """A material with G = E / (2 (1 + ν))."""
    require_number(
        poisson, above=-1.0, below=0.5, where="material.poisson", give="Poisson's ratio, such as 0.3"
    )
    return Material(young, young / (2.0 * (1.0 + poisson)), density, strength)


class Section(Protocol):
    """A cross-section of a material."""

    @property
    def material(self) -> Material:
        """What it is made of."""

    @property
    def sizes(self) -> tuple[float, ...]:
        """Its sizes, m, in the order in which it is made of them."""

    def with_sizes(self, sizes: Sequence[float]) -> Section:
        """The section of the same kind and material with other sizes, m, in their order."""

    @property
    def constants(self) -> tuple[float, float, float, float]:
        """A, m²; J, I_y, I_z, m⁴."""

    @property
    def constants_by_size(self) -> Reals:
        """Derivatives (k, 4) of A, J, I_y, I_z by each of the k sizes."""

    @property
    def fibres(self) -> tuple[float, float]:
        """Distances, m, of the outermost fibre along the local y and z axes."""

    def bending(self, about_y: Reals, about_z: Reals) -> Reals:
        """Largest bending stress, Pa, under moments about both axes, N·m."""

    def bending_by_moment(self, about_y: Reals, about_z: Reals) -> tuple[Reals, Reals]:
        """Its derivatives, 1/m³, by both moments; 0 where a moment is 0 and the stress has a kink."""

    def bending_by_size(self, about_y: Reals, about_z: Reals) -> list[Reals]:
        """Its derivatives, Pa/m, by each size at fixed moments."""


class BeamStiffness(NamedTuple):
    """What a beam resists with, in the order in which equations and files have it: EA, N; GJ, EI_y, EI_z,
    N·m²."""

    axial: float
    torsion: float
    bending_y: float
    bending_z: float

    @property
    def bending(self) -> tuple[float, float]:
        """EI_y and EI_z, N·m²."""
        return self.bending_y, self.bending_z


def stiffness(section: Section) -> BeamStiffness:
    """With which a rod of the section resists."""
    area, torsion, about_y, about_z = section.constants
    young, shear = section.material.young, section.material.shear
    return BeamStiffness(young * area, shear * torsion, young * about_y, young * about_z)


def section_area(section: Section) -> float:
    """A, m²."""
    return section.constants[0]


def stiffness_by_size(section: Section) -> Reals:
    """Derivatives (k, 4) of EA, GJ, EI_y, EI_z by each size."""
    young, shear = section.material.young, section.material.shear
    return section.constants_by_size * np.array([young, shear, young, young])


def stress(section: Section, axial: Reals, about_y: Reals, about_z: Reals) -> Reals:
    """Largest fibre stress, Pa, under the axial force, N, and the moments, N·m; arrays of one shape."""
    return np.asarray(np.abs(axial) / section_area(section) + section.bending(about_y, about_z))


def stress_by_force(
    section: Section, axial: Reals, about_y: Reals, about_z: Reals
) -> tuple[Reals, Reals, Reals]:
    """Derivatives of `stress` by the axial force, 1/m², and the moments, 1/m³."""
    return (np.asarray(np.sign(axial) / section_area(section)), *section.bending_by_moment(about_y, about_z))


def stress_by_size(section: Section, axial: Reals, about_y: Reals, about_z: Reals) -> Reals:
    """Derivatives (k, ...), Pa/m, of `stress` by each of the k sizes at fixed forces."""
    area = section_area(section)
    by_area = -np.abs(axial) / area**2
    rates = [rate[0] * by_area for rate in section.constants_by_size]
    return np.stack(
        [rate + bend for rate, bend in zip(rates, section.bending_by_size(about_y, about_z), strict=True)]
    )


def mass_per_length(section: Section) -> float:
    """kg/m."""
    return section.material.density * section_area(section)


class Circular(ABC):
    """A section whose bending stress doesn't ask in which direction it is bent; `radius`, m, is the outer
    one, unless its `fibres` say otherwise."""

    radius: float

    @property
    @abstractmethod
    def constants(self) -> tuple[float, float, float, float]:
        """A, m²; J, I, I, m⁴."""

    @property
    def fibres(self) -> tuple[float, float]:
        """The outer radius, twice."""
        return self.radius, self.radius

    def bending(self, about_y: Reals, about_z: Reals) -> Reals:
        """|M| c / I, c the distance of the outermost fibre."""
        return np.hypot(about_y, about_z) * (self.fibres[0] / self.constants[2])

    def bending_by_moment(self, about_y: Reals, about_z: Reals) -> tuple[Reals, Reals]:
        """Along the moment."""
        moment = np.hypot(about_y, about_z)
        share = self.fibres[0] / self.constants[2] / np.where(moment > 0.0, moment, 1.0)
        return np.asarray(about_y * share), np.asarray(about_z * share)


@dataclass(frozen=True)
class Round(Circular):
    """A solid round rod of `radius`, m."""

    radius: float
    material: Material

    def __post_init__(self) -> None:
        _positive(self)

    @property
    def sizes(self) -> tuple[float, ...]:
        """The radius."""
        return (self.radius,)

    def with_sizes(self, sizes: Sequence[float]) -> Round:
        """Of these sizes, m."""
        (radius,) = sizes
        return Round(radius, self.material)

    @property
    def constants(self) -> tuple[float, float, float, float]:
        """A = πr², J = 2 I, I = πr⁴/4."""
        inertia = 0.25 * math.pi * self.radius**4
        return math.pi * self.radius**2, 2.0 * inertia, inertia, inertia

    @property
    def constants_by_size(self) -> Reals:
        """By the radius."""
        rate = math.pi * self.radius**3
        return np.array([[2.0 * math.pi * self.radius, 2.0 * rate, rate, rate]])

    def bending_by_size(self, about_y: Reals, about_z: Reals) -> list[Reals]:
        """4 |M| / πr³ falls with the radius' cube."""
        return [-3.0 / self.radius * self.bending(about_y, about_z)]


@dataclass(frozen=True)
class Tube(Circular):
    """A round tube of outer `radius` and wall `thickness`, m."""

    radius: float
    thickness: float
    material: Material

    def __post_init__(self) -> None:
        _positive(self)
        if not self.thickness < self.radius:
            raise InputError(
                "must be less than the radius",
                where="section.thickness",
                value=self.thickness,
                remedy=f"Give the wall in metres, below {self.radius:g}; without a wall it is a round rod.",
            )

    @property
    def sizes(self) -> tuple[float, ...]:
        """Radius and thickness."""
        return self.radius, self.thickness

    def with_sizes(self, sizes: Sequence[float]) -> Tube:
        """Of these sizes, m."""
        radius, thickness = sizes
        return Tube(radius, thickness, self.material)

    @property
    def constants(self) -> tuple[float, float, float, float]:
        """The outer disc's less the inner one's."""
        inner = self.radius - self.thickness
        inertia = 0.25 * math.pi * (self.radius**4 - inner**4)
        return math.pi * (self.radius**2 - inner**2), 2.0 * inertia, inertia, inertia

    @property
    def constants_by_size(self) -> Reals:
        """By the outer radius at one thickness, and by the thickness at one radius."""
        inner = self.radius - self.thickness
        by_radius = math.pi * (self.radius**3 - inner**3)
        by_thickness = math.pi * inner**3
        return np.array(
            [
                [2.0 * math.pi * self.thickness, 2.0 * by_radius, by_radius, by_radius],
                [2.0 * math.pi * inner, 2.0 * by_thickness, by_thickness, by_thickness],
            ]
        )

    def bending_by_size(self, about_y: Reals, about_z: Reals) -> list[Reals]:
        """Of |M| r / I by radius and thickness."""
        inertia, rates = self.constants[2], self.constants_by_size[:, 2]
        moment = np.hypot(about_y, about_z)
        return [
            moment * (1.0 - self.radius * rates[0] / inertia) / inertia,
            -moment * self.radius * rates[1] / inertia**2,
        ]


@dataclass(frozen=True)
class Rectangle:
    """A lath of `width` along the local y and `height` along the local z axis, m."""

    width: float
    height: float
    material: Material

    def __post_init__(self) -> None:
        _positive(self)

    @property
    def sizes(self) -> tuple[float, ...]:
        """Width and height."""
        return self.width, self.height

    def with_sizes(self, sizes: Sequence[float]) -> Rectangle:
        """Of these sizes, m."""
        width, height = sizes
        return Rectangle(width, height, self.material)

    @property
    def constants(self) -> tuple[float, float, float, float]:
        """A = bh, J by the series above, I_y = bh³/12, I_z = hb³/12."""
        b, h = self.width, self.height
        long, short = max(b, h), min(b, h)
        return b * h, long * short**3 * _torsion(short / long)[0], b * h**3 / 12.0, h * b**3 / 12.0

    @property
    def constants_by_size(self) -> Reals:
        """By the width, then by the height."""
        b, h = self.width, self.height
        long, short = max(b, h), min(b, h)
        factor, rate = _torsion(short / long)
        by_long = short**3 * factor - short**4 / long * rate
        by_short = 3.0 * long * short**2 * factor + short**3 * rate
        by_width, by_height = (by_long, by_short) if b >= h else (by_short, by_long)
        return np.array(
            [[h, by_width, h**3 / 12.0, h * b**2 / 4.0], [b, by_height, b * h**2 / 4.0, b**3 / 12.0]]
        )

    @property
    def fibres(self) -> tuple[float, float]:
        """Half the width and half the height."""
        return 0.5 * self.width, 0.5 * self.height

    def bending(self, about_y: Reals, about_z: Reals) -> Reals:
        """In a corner: |M_y| h / 2 I_y + |M_z| b / 2 I_z."""
        _, _, inertia_y, inertia_z = self.constants
        return np.asarray(
            np.abs(about_y) * (0.5 * self.height / inertia_y)
            + np.abs(about_z) * (0.5 * self.width / inertia_z)
        )

    def bending_by_moment(self, about_y: Reals, about_z: Reals) -> tuple[Reals, Reals]:
        """Each moment's own part."""
        _, _, inertia_y, inertia_z = self.constants
        return np.asarray(np.sign(about_y) * (0.5 * self.height / inertia_y)), np.asarray(
            np.sign(about_z) * (0.5 * self.width / inertia_z)
        )

    def bending_by_size(self, about_y: Reals, about_z: Reals) -> list[Reals]:
        """Of 6 |M_y| / bh² + 6 |M_z| / hb²."""
        by_y, by_z = (
            6.0 * np.abs(about_y) / (self.width * self.height**2),
            6.0 * np.abs(about_z) / (self.height * self.width**2),
        )
        return [np.asarray(-(by_y + 2.0 * by_z) / self.width), np.asarray(-(2.0 * by_y + by_z) / self.height)]


SHAPES: dict[str, type[Round] | type[Tube] | type[Rectangle]] = {
    "round": Round,
    "tube": Tube,
    "rectangle": Rectangle,
}
"""The sections by the name of their shape."""


def sizes_of(shape: str) -> tuple[str, ...]:
    """The names of a shape's sizes in the order in which it is made of them."""
    return tuple(each.name for each in fields(SHAPES[shape]) if each.name != "material")


def make_section(shape: str, sizes: Iterable[float], material: Material) -> Section:
    """The section of that shape and its sizes, m, in their order. Raises InputError."""
    make: Callable[..., Section] = SHAPES[shape]
    return make(*sizes, material)


def _torsion(slenderness: float) -> tuple[float, float]:
    """J / (a b³) for b/a = `slenderness` <= 1, and its derivative by it."""
    argument = _ODD * (0.5 * math.pi / slenderness)
    tanh = np.tanh(argument)
    total = float((tanh / _ODD**5).sum())
    rate = float(((1.0 - tanh**2) * -(argument / slenderness) / _ODD**5).sum())
    scale = 64.0 / math.pi**5
    return 1.0 / 3.0 - scale * slenderness * total, -scale * (total + slenderness * rate)


_LARGEST = 1e3  # m, far beyond any rod: a wrong unit, and later an overflow


def _positive(section: Round | Tube | Rectangle) -> None:
    for each in fields(section):
        if each.name != "material":
            value = getattr(section, each.name)
            where, give = f"section.{each.name}", "metres, such as 0.0012"
            require_number(value, above=0.0, where=where, give=give)
            if value > _LARGEST:
                raise InputError(
                    f"must be below {_LARGEST:g} m", where=where, value=value, remedy=f"Give {give}."
                )
