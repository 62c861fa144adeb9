"""What to do where a check doesn't hold, each with a number.

Rods: the load that a shell of slender rods bears grows about with the square of their radius (1.3 times the
load with 1.0 mm and 1.8 times with 1.2 mm on the scale model), their stress in a given shape with the radius
itself.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal

from shellform.quantities import number
from shellform.records.thicker_rods import ThickerRodsRecord

_CLOSER = 0.8  # of the spacing, where rods may not become thicker
_EQUAL = 1e-9  # relative: radii that count as equal
_TURNS = 100  # towards the radius that does
_LEAST = 0.5  # of the radius: rods that would have to be thinner than that aren't the same shell's
_MOST = 100.0  # times the load: what lacks so much isn't mended by thicker rods


@dataclass(frozen=True)
class RodSizes:
    """How a case gives the size of its rods: the `entries` that grow with it and their values, m, of rods of
    the `radius`, m; or what is `bought`, from a catalogue: each section's name and the radius, m, of a rod
    similar to the case's that is as stiff, by rising stiffness. Whether the search is `free` to choose the
    radius, not below `least`, m, and `keeps` the stress of the rods below a limit."""

    entries: Mapping[str, float]
    radius: float
    bought: Sequence[tuple[str, float]] = ()
    free: bool = False
    keeps: bool = False
    least: float = 0.0

    @property
    def named(self) -> str:
        """The entries that give the size."""
        return "rod.section" if self.bought else ", ".join(self.entries)

    def at_least(self, wanted: float) -> str | None:
        """What to write for rods as stiff as similar ones of the radius `wanted`, m; None where no catalogue
        has them."""
        if self.bought:
            return next((_section(name) for name, own in self.bought if own >= wanted * (1.0 - _EQUAL)), None)
        return ", ".join(
            f"{name} = {_up(value * wanted / self.radius)}" for name, value in self.entries.items()
        )

    def at_most(self, wanted: float) -> str | None:
        """As `at_least`, for rods no stiffer."""
        if self.bought:
            below = [_section(name) for name, own in self.bought if own <= wanted * (1.0 + _EQUAL)]
            return below[-1] if below else None
        return ", ".join(
            f"{name} = {_down(value * wanted / self.radius)}" for name, value in self.entries.items()
        )

    def kept_at_least(self, wanted: float) -> str | None:
        """As `at_least`, for a search that is free to take thinner ones: the bound from below, which mustn't
        be above the rods that it starts from, and those where they are thinner."""
        least = rounded_up(wanted)
        bound = f"optimise.radius_min = {_up(wanted)}"
        if least <= self.radius:
            return bound
        start = self.at_least(least)
        return None if start is None else f"{start}, {bound}"


@dataclass(frozen=True)
class RodsOf:
    """The rods of a design: their `radius`, the `largest` that the net allows by equation (1), and its
    `spacing`, m (None: not known); `thicker` ones with which the initial design was seen to stand; how the
    case gives their `sizes` (None: by rod.radius)."""

    radius: float
    largest: float
    spacing: float | None
    thicker: ThickerRodsRecord | None = None
    sizes: RodSizes | None = None

    def stronger(self, times: float) -> str:
        """To bear so many times what they bear; rods that were drawn say more than any rule."""
        if self.thicker is not None:
            found = self.thicker
            what = (
                f"rods of {_up(1e3 * found.radius)} mm radius ({self._written(found.radius)})"
                if found.section is None
                else f"rods of {found.section} ({_section(found.section)})"
            )
            return f"Take {what}: with all cables {found.standing} of {found.drawn} drawn structures stand with them."
        if not 1.0 < times < _MOST:
            return self._closer()
        wanted = self.radius * math.sqrt(times)
        said = self._written(wanted)
        if wanted <= self.largest and said is not None:
            free = "" if self._sizes.free else ", or let it be free (optimise.rod_radius = 0.1)"
            return f"Take rods of at least {_up(1e3 * wanted)} mm radius ({said}){free}."
        if said is None:
            return f"Rods as stiff as those of {_up(1e3 * wanted)} mm radius would do, and the catalogue has none. {self._closer()}"
        return (
            f"Rods of {_up(1e3 * wanted)} mm radius would do, and the net's curvature allows {number(1e3 * self.largest)} mm (1). "
            + self._closer()
        )

    def thinner(self, times: float) -> str:
        """To have that part of their stress."""
        wanted = self.radius * times
        if self._sizes.free and not self._sizes.keeps:
            return "Let the search keep the rods' strength (limits.utilisation = 1)."
        said = self._sizes.at_most(wanted)
        if said is None:
            return f"Rods as stiff as those of {_down(1e3 * wanted)} mm radius would do, and the catalogue has none: take another (rod.catalogue)."
        if self._sizes.free:  # a search that keeps the strength ends sooner where it begins with it kept
            if float(_down(wanted)) < self._sizes.least:
                said += f", optimise.radius_min = {_down(wanted)}"
            return f"Begin the search with rods of at most {_down(1e3 * wanted)} mm radius ({said}), or give it twice the evaluations (optimise.evaluations)."
        return f"Take rods of at most {_down(1e3 * wanted)} mm radius ({said})."

    def less_stressed(self, bending: float, stress: float, most: float) -> str:
        """To be stressed to `most` of their strength, where they are to the share `bending` of it by that
        alone and to `stress` with axial force: in a given shape bending goes with the radius, the stress of
        a given force against its square, so that a force that rules wants a closer grid."""
        axial = max(stress - bending, 0.0)
        times = 1.0
        for _ in range(_TURNS):  # down to the largest one that does, where there is one
            times = (most - axial / times**2) / bending if times > _LEAST and bending > 0.0 else 0.0
        return self.thinner(times) if times > _LEAST else self._closer()

    def reserved(self, bent: float, raised: float) -> str:
        """To keep their strength on the way up, on which they bear the share `raised` of it, and `bent` once
        they are up."""
        if self._sizes.free:
            return f"Leave a reserve for it (limits.utilisation = {_down(min(bent, 1.0) / raised)})."
        return self.thinner(1.0 / raised)

    @property
    def _sizes(self) -> RodSizes:
        return self.sizes or RodSizes({"rod.radius": self.radius}, self.radius)

    def _written(self, wanted: float) -> str | None:
        """What to write for rods of the radius, m, or thicker ones."""
        sizes = self._sizes
        return sizes.kept_at_least(wanted) if sizes.free else sizes.at_least(wanted)

    def _closer(self) -> str:
        if self.spacing is None:
            return "Choose a closer grid (net.spacing)."
        return f"Choose a closer grid (net.spacing = {number(_CLOSER * self.spacing)})."


def _section(name: str) -> str:
    return f'rod.section = "{name}"'


def allow(entry: str, value: float, *, or_else: str = "") -> str:
    """To let a limit be what was found."""
    tail = f", or {or_else}" if or_else else ""
    return f"Allow {entry} = {_up(value)}{tail}."


def allow_less(entry: str, value: float) -> str:
    """To let a limit from below be what was found."""
    return f"Allow {entry} = {_down(value)}."


def allow_count(cables: int) -> str:
    """To let so many cables be."""
    return f"Allow optimise.cables_max = {cables}."


def rounded_up(value: float) -> float:
    """To two digits, up."""
    return float(_up(value))


def _up(value: float) -> str:
    """To two digits, to the safe side."""
    size = _digit(value)
    return _plain(math.ceil(value / size - 1e-9) * size)


def _down(value: float) -> str:
    size = _digit(value)
    return _plain(math.floor(value / size + 1e-9) * size)


def _plain(value: float) -> str:
    """To three digits, without a power of ten: 1450000 is read at a glance and can be written in a case."""
    return f"{Decimal(f'{value:.3g}'):f}"


def _digit(value: float) -> float:
    """What the second digit of a number counts."""
    return 10.0 ** (math.floor(math.log10(value)) - 1) if value > 0.0 else 1.0
