"""Catalogues of rods: TOML files of sections that can be bought, and rounding to them (operation 4 of the
framework).

The optimised radius stands for a section similar to the rod's. It is rounded to the next stiffer section of
the catalogue: for round rods of one material that is the next higher radius, as in the paper; for tubes and
laths the least stiff section that bends in neither direction more easily. Only sections count that bear the
curvature of the net: σ = E κ c at the outermost fibre (equation 1).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from shellform.errors import InputError, require_count, require_number, unreadable
from shellform.gridshell.edge_beams import Bundle
from shellform.gridshell.gridshell import Design, Gridshell, Rod, TooCurved, erection_stress
from shellform.gridshell.layers import TwoLayers
from shellform.gridshell.possible_rods import require_rods_material
from shellform.net.net import Net
from shellform.quantities import DIAMETER, STOCK_LENGTH
from shellform.structure.elements.sections import (
    SHAPES,
    Material,
    Round,
    Section,
    Tube,
    isotropic,
    make_section,
    mass_per_length,
    sizes_of,
    stiffness,
)
from shellform.structure.refusals import refusal

_SHIPPED = Path(__file__).resolve().parent.parent / "catalogues"
_EQUAL = 1e-9  # relative: stiffnesses that count as equal


class _Material(msgspec.Struct, forbid_unknown_fields=True):
    young: float
    strength: float
    density: float
    shear: float | None = None
    poisson: float | None = None
    lasting: float = 1.0


class _Sizes(msgspec.Struct, forbid_unknown_fields=True):
    round: list[float] = []
    tube: list[tuple[float, float]] = []
    rectangle: list[tuple[float, float]] = []


class _CatalogueFile(msgspec.Struct, forbid_unknown_fields=True):
    material: _Material
    sizes: _Sizes
    title: str = ""
    stock_length: float | None = None


_PARTS = {"material": _Material, "sizes": _Sizes, "": _CatalogueFile}


@dataclass(frozen=True)
class Catalogue:
    """`sections` of one `material` under a `title`, by rising stiffness; `stock_length`, m, in which they are
    sold, where it is known.
    """

    title: str
    material: Material
    sections: tuple[Section, ...]
    stock_length: float | None = None


def shipped_catalogues() -> list[str]:
    """Names of the catalogues that come with shellform."""
    return sorted(path.stem for path in _SHIPPED.glob("*.toml"))


def read_catalogue(source: str | Path) -> Catalogue:
    """The catalogue in a TOML file, or a shipped one by its name.

    `[material]` has young, shear or poisson, density, strength (flexural) and lasting, the share of it that
    rods bear for as long as they stay bent; `stock_length` may say in which lengths, m, they are sold;
    `[sizes]` has lists round (diameters), tube (outer diameter, wall) and rectangle (width in the surface,
    height across it). SI units. Raises InputError naming the entry that is wrong.
    """
    path = _SHIPPED / f"{source}.toml" if str(source) in shipped_catalogues() else Path(source)
    try:
        document = msgspec.toml.decode(path.read_text(encoding="utf-8-sig"), type=_CatalogueFile)
    except OSError as error:
        remedy = f"Shipped are {', '.join(shipped_catalogues())}."
        said = unreadable(error) if path.exists() else "is neither shipped nor a file"
        raise InputError(said, where=f"catalogue {path}", remedy=remedy) from error
    except UnicodeDecodeError as error:
        raise InputError(unreadable(error), where=f"catalogue {path}", remedy="Save it as UTF-8.") from error
    except msgspec.ValidationError as error:
        raise refusal(error, _PARTS).within(f"catalogue {path}") from error
    except (msgspec.DecodeError, ValueError, RecursionError) as error:  # ValueError: a number of 5,000 digits
        raise InputError(
            f"isn't valid TOML: {error}",
            where=f"catalogue {path}",
            remedy="Mend that line: NAME = VALUE, text in quotation marks, lists in [ ].",
        ) from error
    material = _checked(f"catalogue {path}", lambda: _material(document.material))
    sections = [
        _checked(f"catalogue {path}: sizes.{shape}[{k}]", partial(_bought, shape, size, material))
        for shape in SHAPES
        for k, size in enumerate(getattr(document.sizes, shape))
    ]
    if not sections:
        raise InputError(
            "has no sizes", where=f"catalogue {path}: sizes", remedy="List round, tube or rectangle."
        )
    stock = document.stock_length
    if stock is not None:
        STOCK_LENGTH.require(stock, where=f"catalogue {path}: stock_length")
    return Catalogue(document.title or path.stem, material, tuple(sorted(sections, key=_order)), stock)


def _material(given: _Material) -> Material:
    if (given.shear is None) == (given.poisson is None):
        raise InputError(
            "needs either shear or poisson",
            where="material",
            remedy="Give one of the two: each follows from young and the other.",
        )
    require_number(
        given.lasting,
        above=0.0,
        most=1.0,
        where="material.lasting",
        give="a share of the strength, such as 0.4",
        share=True,
    )
    strength = given.strength * given.lasting
    require_rods_material(given.young, given.shear, strength, given.density, where="material")
    if given.shear is None:
        return isotropic(
            young=given.young, poisson=given.poisson or 0.0, density=given.density, strength=strength
        )
    return Material(given.young, given.shear, given.density, strength)


def _bought(shape: str, size: float | tuple[float, float], material: Material) -> Section:
    """A section from the size by which it is sold: of what has a radius, the diameter comes first."""
    sizes = [size] if isinstance(size, float) else list(size)
    for each in sizes:
        DIAMETER.require(each)
    if "radius" in sizes_of(shape):
        sizes[0] *= 0.5
    return make_section(shape, sizes, material)


def _checked(where: str, make: Callable[[], Any]) -> Any:
    try:
        return make()
    except InputError as error:
        raise error.within(where) from error


def label(section: Section, places: int = 6) -> str:
    """What a section is called, in mm to so many decimal places (two are as exact as rods are made): "⌀ 10
    mm", "⌀ 42 × 3.5 mm", "50 × 35 mm", "2 layers of 50 × 35 mm", "19 rods ⌀ 10 mm"."""

    def mm(size: float) -> str:
        return f"{round(1e3 * size, places):g}"

    if isinstance(section, TwoLayers):
        return f"2 layers of {label(section.single, places)}"
    if isinstance(section, Bundle):
        return f"{section.count} rods ⌀ {mm(2.0 * section.radius)} mm"
    if isinstance(section, Round):
        return f"⌀ {mm(2.0 * section.radius)} mm"
    if isinstance(section, Tube):
        return f"⌀ {mm(2.0 * section.radius)} × {mm(section.thickness)} mm"
    return " × ".join(mm(size) for size in section.sizes) + " mm"


def named(catalogue: Catalogue, name: str, *, where: str = "rod.section") -> Section:
    """The catalogue's section of that label, which stands `where`. Raises InputError naming all of them."""
    found = {_plain(label(section)): section for section in catalogue.sections}
    if _plain(name) not in found:
        known = ", ".join(label(section) for section in catalogue.sections)
        raise InputError(
            f"is not in the catalogue {catalogue.title!r}",
            where=where,
            value=name,
            remedy=f"Known: {known}.",
        )
    return found[_plain(name)]


def _plain(text: str) -> str:
    return text.lower().replace("×", "x").replace("⌀", "").replace("mm", "").replace(" ", "")


def sections_allowed(catalogue: Catalogue, net: Net) -> tuple[Section, ...]:
    """The sections that bear the net's curvature (equation 1), by rising stiffness. Raises InputError where
    there are none.
    """
    found = tuple(
        s for s in catalogue.sections if erection_stress(net, s) <= s.material.strength * (1.0 + _EQUAL)
    )
    if not found:
        least = min(catalogue.sections, key=lambda section: erection_stress(net, section))
        raise TooCurved(
            f"none of the sections of the catalogue {catalogue.title!r} bears the net's curvature of "
            f"{net.quality.curvature_max:.3g} 1/m: "
            f"{label(least)} would be stressed to {erection_stress(net, least) / 1e6:.3g} of "
            f"{least.material.strength / 1e6:.3g} MPa",
            where="rod.catalogue",
            remedy="Choose thinner or stronger rods, another angle of the net, or a flatter surface.",
            radius=erection_stress(net, least) / least.material.strength / net.quality.curvature_max,
        )
    return found


def largest(catalogue: Catalogue, net: Net) -> Section:
    """The stiffest section that the net allows: that of the initial design (operation 2)."""
    return sections_allowed(catalogue, net)[-1]


def radius_bounds(net: Net, rod: Rod, catalogue: Catalogue) -> tuple[float, float]:
    """Bounds (4), m, of the radius of sections similar to the rod's: from as stiff as the softest section
    that the net allows, or from the rod's own where that is softer, to as stiff as the stiffest, so that each
    can be rounded up.

    Raises InputError where the rod is stiffer than the stiffest.
    """
    sections = sections_allowed(catalogue, net)
    low, high = (radius_as_stiff(rod, sections[k]) for k in (0, -1))
    if rod.radius > high * (1.0 + _EQUAL):
        raise _too_stiff(rod.radius, catalogue, sections)
    return min(low, rod.radius), max(high, rod.radius)


def radius_as_stiff(rod: Rod, section: Section) -> float:
    """The radius, m, of a rod similar to `rod` that is as stiff as the section: between two of different
    shape the stiffness about the weaker axis counts."""
    own = np.array(rod.stiffness.bending)
    return rod.radius * float((np.array(stiffness(section).bending) / own).min()) ** 0.25


def rounded_up(shell: Gridshell, design: Design, catalogue: Catalogue) -> tuple[Gridshell, Design]:
    """The gridshell and design with the next stiffer section of the catalogue, the cables as they are
    (operation 4).

    Raises InputError where no section that the net allows is stiff enough.
    """
    sections = sections_allowed(catalogue, shell.net)
    at = _stiff_enough(sections, shell.rod.resized(design.radius).section)
    if at < len(sections):
        return with_section(shell, design, sections[at])
    raise _too_stiff(design.radius, catalogue, sections)


def _too_stiff(radius: float, catalogue: Catalogue, sections: Sequence[Section]) -> InputError:
    return InputError(
        f"no section of the catalogue {catalogue.title!r} that bears the net's curvature is as stiff as the "
        "design's",
        where="rod.catalogue",
        value=radius,
        remedy=f"The stiffest is {label(sections[-1])}: bound the radius by it.",
    )


def neighbours(
    shell: Gridshell, design: Design, catalogue: Catalogue, *, count: int = 1
) -> list[tuple[Gridshell, Design]]:
    """The gridshell and design with each of `count` sections below the rounded-up one, that one, and `count`
    above it, by rising stiffness, as far as the catalogue goes and the net allows. Raises InputError for a
    count below 0."""
    require_count(
        count, least=0, where="neighbours.count", give="how many sections to either side, such as 1"
    )
    sections = sections_allowed(catalogue, shell.net)
    at = _stiff_enough(sections, shell.rod.resized(design.radius).section)
    return [with_section(shell, design, section) for section in sections[max(at - count, 0) : at + count + 1]]


def with_section(shell: Gridshell, design: Design, section: Section) -> tuple[Gridshell, Design]:
    """The gridshell and design with rods of another section."""
    rod = Rod(section)
    return replace(shell, rod=rod), replace(design, radius=rod.radius)


def _stiff_enough(sections: Sequence[Section], least: Section) -> int:
    """The place of the first of the sections that bends about neither axis more easily than `least`; past the
    end if none does.
    """
    wanted = stiffness(least).bending
    for k, section in enumerate(sections):
        if all(
            has >= needed * (1.0 - _EQUAL)
            for has, needed in zip(stiffness(section).bending, wanted, strict=True)
        ):
            return k
    return len(sections)


def _order(section: Section) -> tuple[float, float, float]:
    return *stiffness(section).bending, mass_per_length(section)
