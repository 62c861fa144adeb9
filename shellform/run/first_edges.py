"""What edge beams `shellform new` tries: a bundle of the rods first, then what is about four times as stiff
as the one before.

Solid rods are there anyway and bend into any curve, so that a light edge beam is a bundle of them; laths and
tubes don't pack. What has to be stiffer is a steel tube, rolled to its curve: as stiff as 37 rods it has a
third of their weight or less. Models are too small for tubes and keep to bundles.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

from shellform.gridshell.catalogue import Catalogue, label, read_catalogue
from shellform.gridshell.edge_beams import Bundle
from shellform.gridshell.layers import single
from shellform.run.sizes import RodChoice
from shellform.structure.elements.sections import Round, Section, mass_per_length, section_area, stiffness

TUBES = "edge_tubes"
COMPOSITE = 0.5  # how far the rods of an edge beam act together
_BUNDLES = (19, 37, 61, 91)  # rods
_STIFFER = 4.0  # times the one before, at the least, are tubes
HEAVY = 2  # from which of the choices on they are far heavier


@dataclass(frozen=True)
class EdgeChoice:
    """What edge beams are: their `section`, a bundle of the rods or one of the catalogue `TUBES`."""

    section: Section

    @property
    def label(self) -> str:
        """Short, for what is told: "19 rods", "⌀ 219.1 × 8 mm"."""
        return f"{self.section.count} rods" if isinstance(self.section, Bundle) else label(self.section)


def edge_choices(rods: RodChoice) -> tuple[EdgeChoice, ...]:
    """By rising stiffness, one for each of the bundles: that, or the lightest tube that is so stiff, where it
    is lighter."""
    own = single(rods.section)
    radius = math.sqrt(section_area(own) / math.pi)  # the round rod of the same area
    bundles = [Bundle(radius, count, COMPOSITE, own.material) for count in _BUNDLES]
    first = _bending(bundles[0])
    return tuple(
        EdgeChoice(
            bundle if number == 0 and isinstance(own, Round) else _lighter(bundle, _STIFFER**number * first)
        )
        for number, bundle in enumerate(bundles)
    )


def _lighter(bundle: Bundle, needed: float) -> Section:
    """The lightest tube with so much EI, N·m², the stiffest where none has it, or the bundle, if that is
    lighter."""
    tubes = _tubes().sections
    stiff = [each for each in tubes if _bending(each) >= needed] or [tubes[-1]]
    found = min(stiff, key=mass_per_length)
    return found if mass_per_length(found) < mass_per_length(bundle) else bundle


def _bending(section: Section) -> float:
    """EI, N·m²."""
    return stiffness(section).bending_y


@cache
def _tubes() -> Catalogue:
    return read_catalogue(TUBES)
