"""What is sized before anything is solved: the spacing, the cables, the concrete, and with which section to
begin.

Spacing. A net is refused, or its rods break, where cells are large against the surface's radius of curvature;
so it is at most a third of the radius that all but a twentieth of the surface keeps (a quantile of area: one
crease doesn't decide). Beside this it follows the span, so that there are enough crossings for the shape and
few enough to build, and above a metre what is usual on site.

Buckling. The braced grid is taken as an orthotropic shell: across, rods of EI every s bend with D = EI / s;
in its surface, the cables of EA on both diagonals of each cell resist shear with S = EA / (√2 s). A sphere of
such a shell buckles at 2 √(D S) / R² and more where the rods' own EA counts too, a barrel at less. The number
that stands before √(D S) was set by four shells that were solved; it only says where to begin.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from shellform import quantities
from shellform.errors import InputError, require_degrees, require_number
from shellform.gridshell.catalogue import Catalogue, label, named, read_catalogue
from shellform.gridshell.gridshell import erection_stress
from shellform.gridshell.layers import TwoLayers, layers_of, locked_bending
from shellform.gridshell.tolerances import tolerances_of_size
from shellform.net.net import Net
from shellform.plan_rectangle import longest_side
from shellform.structure.elements.sections import Section, mass_per_length
from shellform.surface.shape.bends import curvature_mean_square, curvature_shown, curvature_usual
from shellform.surface.shape.target import Surface, width

_HOPELESS = 0.03  # of the load needed, by the estimate: rods of a tenth of the depth that is needed
_BUCKLES = (
    0.3  # of the load needed, at which rods buckle between their joints: a sphere's thrust is a rough guess
)
_BY_RADIUS = 3.0  # cells across a radius of curvature
_CROSSINGS = 260.0  # to begin with
MOST_CROSSINGS = 1100  # beyond which a first design takes minutes
CURVED = 600  # crossings for the sake of curvature, at the most: what asks for more are creases
_USUAL = 1.0  # m, of rods on site
THICKNESS = 0.05  # m: usual
OF_SPAN = 500.0  # such a part of its span a shell may be off, or half its thickness
_SAGS = 2.0  # times that far edges may sag under the additional load
BUILT_OF_SPAN = 50.0  # such a part any structure as built may be, or its thickness
_SLENDER = 80.0  # thicknesses across the larger side of a model, on which 50 mm would be a block
_DEPTH = 7.0  # spacings over a rod's depth, at the least: thicker, it is no grid of slender rods
_CATALOGUES = ("gfrp_rods", "gfrp_tubes", "steel_tubes")
_LATHS = "timber_laths"  # whose rods are built in two layers
# m, diameters in stock
_ROPES = (0.0003, 0.0005, 0.001, 0.0015, 0.002, 0.003, 0.004, 0.005, 0.006, 0.008, 0.010, 0.012, 0.014, 0.016)
_MOST_ROPE = 0.008  # m, to begin with
_ROPE = 0.006  # of the spacing, a rope's diameter
_ROPE_AREA, _ROPE_YOUNG, _ROPE_STRENGTH = 0.597, 120e9, 1380e6  # of the diameter's square; Pa; Pa at breaking
STRAINED = 0.5 * _ROPE_STRENGTH / _ROPE_YOUNG  # of a rope under the largest force that it is let bear
_BUCKLING = 1.4  # times √(EI GA) of a width and the squared curvature: the load under which a grid buckles
LEAST_PRESTRAIN, _MOST_PRESTRAIN = 0.001, 0.004  # of the cables
_AMPLE = 2.0  # times what is needed, by the estimate of buckling: there the sections begin
EDGES = ("auto", "wall")
BENT = 0.65  # of a rod's strength, that bending it into the net takes at the most of the first that is tried


@dataclass(frozen=True)
class Rope:
    """A stainless strand 1 × 19 of a `diameter`, m, as sold: EA, N, and half of what breaks it, N."""

    diameter: float

    @property
    def stiffness(self) -> float:
        """EA, N."""
        return _ROPE_YOUNG * _ROPE_AREA * self.diameter**2

    @property
    def force_max(self) -> float:
        """N."""
        return 0.5 * _ROPE_STRENGTH * _ROPE_AREA * self.diameter**2


@dataclass(frozen=True)
class RodChoice:
    """A `section` with the name of the catalogue that has it."""

    catalogue: str
    section: Section

    @property
    def label(self) -> str:
        """As the catalogue calls it."""
        return label(self.section)

    @property
    def bending(self) -> float:
        """EI_y, N·m²: across the surface, under loads."""
        return locked_bending(self.section)[0]

    @property
    def moment(self) -> float:
        """About what bending moment across the surface it bears under loads, N·m: its strength times I / d, d
        the distance of the outermost fibre."""
        material, fibre = self.section.material, self.section.fibres[1]
        outermost = 3.0 * fibre if layers_of(self.section) == 2 else fibre
        return material.strength * self.bending / (material.young * outermost)


@dataclass(frozen=True)
class DesignWish:
    """What the user wants: a `rod` like "gfrp_rods/8 mm", a `spacing` and a `thickness` of the concrete, m,
    an `angle`, degrees, rods in so many `layers`; None: to be found, of a named rod one layer. `edges` says
    what the outer edge stands on: "auto", what the geometry says, or "wall", walls all round up to it."""

    rod: str | None = None
    spacing: float | None = None
    thickness: float | None = None
    angle: float | None = None
    layers: int | None = None
    edges: str = "auto"

    def __post_init__(self) -> None:
        for name in ("spacing", "thickness"):
            value = getattr(self, name)
            if value is not None:
                require_number(
                    value, above=0.0, where=f"--{name}", give="metres, such as 0.05, or leave it out"
                )
        if self.thickness is not None:
            quantities.THICKNESS.require(self.thickness, where="--thickness")
        if self.spacing is not None:
            quantities.SPACING.require(self.spacing, where="--spacing")
        if self.angle is not None:
            require_degrees(
                self.angle,
                where="--angle",
                give="degrees, such as 45, or leave it out for the least bending",
            )
        if self.layers not in (None, 1, 2):
            raise InputError(
                "must be 1 or 2",
                where="--layers",
                value=self.layers,
                remedy="Give 1 for single rods, 2 for laths on one another.",
            )
        if self.edges not in EDGES:
            raise InputError(
                "is no way to stand",
                where="--edges",
                value=self.edges,
                remedy=f"Give {' or '.join(EDGES)}, or leave it out.",
            )
        wished(self.rod)


@dataclass(frozen=True, eq=False)
class Placed:
    """A net with the `angle`, degrees, and `offset`, spacings, at which it lies."""

    net: Net
    angle: float
    offset: tuple[float, float]


def first_spacing(surface: Surface) -> tuple[float, str]:
    """The spacing, m, to begin with, and its reason."""
    area, bent = surface.area, curvature_shown(surface)
    radius = 1.0 / max(bent, 1e-12)
    curved, finest = radius / _BY_RADIUS, math.sqrt(area / CURVED)
    shown = f"a third of the surface's radius of {radius:.3g} m"
    enough = math.sqrt(area / _CROSSINGS)
    usual = max(_USUAL, math.sqrt(area / MOST_CROSSINGS))
    spacing = min(enough, usual, max(curved, finest))
    if spacing == enough:
        told = f"about {_CROSSINGS:.0f} crossings"
    elif spacing == usual:
        told = "usual on site" if usual == _USUAL else f"{MOST_CROSSINGS} crossings at the most"
    elif curved < finest:
        told = f"{CURVED} crossings at the most, where {shown} asks for {curved:.2g} m"
    else:
        told = shown
    return practical(spacing), told


def practical(spacing: float) -> float:
    """Rounded down to what is set out with a rule: 5 cm steps from half a metre on, else two digits."""
    if spacing >= 0.5:
        return round(0.05 * math.floor(spacing / 0.05 + 1e-9), 2)
    step = 10.0 ** (math.floor(math.log10(spacing)) - 1)
    return float(f"{step * math.floor(spacing / step + 1e-9):.2g}")


def usual_thickness(surface: Surface) -> float:
    """Of the concrete with which `new` begins, m: 50 mm, less on models of under 4 m."""
    return max(min(THICKNESS, whole_mm(surface.longer_side / _SLENDER)), 0.002)


def may_come_off(surface: Surface, thickness: float) -> float:
    """How far the shape may be off for the sake of cables, m: a 500th of the span, by which EN 1992-1-1,
    7.4.1, lets concrete be bent in use; but half its thickness in any case, since the thrust line of the
    shape as designed lies in it up to that."""
    return max(0.5 * thickness, width(surface) / OF_SPAN)


def may_sag(surface: Surface, thickness: float) -> float:
    """How far edges may sag under the additional load, m, before heavier beams are tried: no cable lifts
    them."""
    return _SAGS * may_come_off(surface, thickness)


def may_stray(surface: Surface, thickness: float) -> float:
    """How far any structure as built may be off, m: a fiftieth of the span, or the concrete's thickness where
    that is more.

    The deepest dent that scanners found in three concrete shells is 80 mm on a length of 5 m, a 62nd of it
    (Elferink, Eigenraam, Hoogenboom and Rots, HERON 61-3, 2016). Of 28 designs for cases of `new` the worst
    structure is within three quarters of this, but for a saddle, which is 1.6 times as far off.
    """
    return max(thickness, width(surface) / BUILT_OF_SPAN)


def whole_mm(thickness: float) -> float:
    """Rounded down."""
    return math.floor(1e3 * thickness) / 1e3


def rope_for(spacing: float) -> Rope:
    """The stock strand nearest to 6 mm at a metre's spacing, with which to begin."""
    usual = [each for each in _ROPES if each <= _MOST_ROPE]
    return Rope(min(usual, key=lambda each: abs(math.log(each / (_ROPE * spacing)))))


def thicker(rope: Rope, times: float = 1.0) -> Rope | None:
    """The first strand in stock whose area is so many `times` as large, the last where none is; None after
    that."""
    larger = [each for each in _ROPES if each > rope.diameter]
    enough = (each for each in larger if each**2 >= times * rope.diameter**2)
    return Rope(next(enough, larger[-1])) if larger else None


def rest_ratio_for(surface: Surface, spacing: float) -> float:
    """Of the cables, rest length over length: their prestrain takes up what all but one in twenty are off in
    length, within bounds."""
    span, length = longest_side(surface.vertices), math.sqrt(2.0) * spacing
    off = tolerances_of_size(span, longest_rod=span, longest_cable=length).cable_length
    return round(1.0 - min(max(2.0 * off / length, LEAST_PRESTRAIN), _MOST_PRESTRAIN), 4)


def choices(net: Net, spacing: float, wish: str | None, layers: int = 1) -> list[RodChoice]:
    """Sections that the net's curvature and its spacing allow, by rising stiffness; with a `wish` like
    "gfrp_rods/8 mm" that one, with the name of a catalogue those of it; rods in so many `layers`. Empty where
    none is thin enough."""
    found = [
        each
        for each in wished(wish, layers)
        if _bent(net, each) <= 1.0 and least_spacing(each) <= spacing * (1.0 + 1e-9)
    ]
    found.sort(key=lambda each: (each.bending, mass_per_length(each.section)))
    return found


def first_choice(
    net: Net, surface: Surface, spacing: float, possible: Sequence[RodChoice], needed: float
) -> int:
    """Which of the `possible` sections to begin with, so that the grid buckles under `needed`, N/m², by the
    estimate: the least stiff that leaves a third of its strength to the load, or what comes nearest."""
    rope = rope_for(spacing)
    spare = [k for k, each in enumerate(possible) if _bent(net, each) <= BENT] or list(range(len(possible)))
    enough = (
        k for k in spare if buckling_load(surface, spacing, possible[k].bending, rope) >= _AMPLE * needed
    )
    return next(enough, spare[-1])


def next_choice(
    net: Net, possible: Sequence[RodChoice], at: int, stress: float, times: float, most: float
) -> int:
    """The section to try after that `at`, whose `stress` over its strength is told: the least stiff that is
    at least so many `times` as stiff and whose stress is likely to be `most` at the most, else the stiffest
    such one; with 0 `times` the one that is likely to be stressed least. `at` where there is none.

    Bending into the net stresses each section as it is; what the load adds goes with the moment it bears.
    """
    own, bent = possible[at], [_bent(net, each) for each in possible]
    added = max(stress - bent[at], 0.0)
    likely = [share + added * own.moment / each.moment for share, each in zip(bent, possible, strict=True)]
    fit = [k for k, share in enumerate(likely) if share <= most]
    if not times:
        return min(fit, key=likely.__getitem__, default=at)
    return next((k for k in fit if possible[k].bending >= times * own.bending), fit[-1] if fit else at)


def next_spare(net: Net, possible: Sequence[RodChoice], at: int, times: float, most: float) -> int:
    """The least stiff of the sections that are at least so many `times` as stiff as that `at` and of whose
    strength bending takes a share of `most`, else the stiffest of these; `at` where none is stiffer."""
    spare = [k for k, each in enumerate(possible) if _bent(net, each) <= most]
    enough = (k for k in spare if possible[k].bending >= times * possible[at].bending)
    return max(next(enough, spare[-1] if spare else at), at)


def next_thinner(possible: Sequence[RodChoice], at: int, share: float) -> int:
    """The stiffest of the sections less stiff than that `at` that bending stresses at most a `share` as much
    (of one material: that is a share as deep), for where what is added to the stress of bending into the net
    is more bending, at supports and ends of rods, and grows with the depth; `at` where there is none."""
    least = share * bent_to(possible[at])
    return next((k for k in range(at - 1, -1, -1) if bent_to(possible[k]) <= least), at)


def load_borne(net: Net, choice: RodChoice, stress: float, most: float) -> float:
    """What share of the load a section bears with a stress of `most` over its strength, whose `stress` under
    all of it is told."""
    bent = _bent(net, choice)
    return max(most - bent, 0.0) / max(stress - bent, 1e-12)


def _bent(net: Net, choice: RodChoice) -> float:
    """What bending into the net takes of a section's strength."""
    return erection_stress(net, choice.section) / choice.section.material.strength


def least_spacing(choice: RodChoice) -> float:
    """The spacing, m, in whole millimetres, below which rods are too deep for a grid of slender rods."""
    return math.ceil(1e3 * _DEPTH * 2.0 * max(choice.section.fibres) - 1e-9) / 1e3


def wished(wish: str | None, layers: int = 1) -> list[RodChoice]:
    """The sections among which to choose, in so many `layers`. Raises InputError for an unknown catalogue or
    section.
    """
    if layers == 2:
        found = [*wished(None), *wished(_LATHS)] if wish is None else wished(wish)
        return [RodChoice(each.catalogue, TwoLayers(each.section)) for each in found]
    if wish is None:
        return [RodChoice(name, each) for name in _CATALOGUES for each in read_catalogue(name).sections]
    name, _, size = wish.partition("/")
    catalogue: Catalogue = read_catalogue(name)
    if not size:
        return [RodChoice(name, each) for each in catalogue.sections]
    try:
        return [RodChoice(name, named(catalogue, size))]
    except InputError as error:
        raise InputError(error.what, where="--rod", value=wish, remedy=error.remedy) from error


def radius_for(surface: Surface, spacing: float, needed: float, wish: DesignWish) -> float:
    """The radius, m, to which rods can be bent that are likely to bear `needed`, N/m², where the surface is
    curved as usual: of all sections, in one layer or two, the least; 0 where none is."""
    layers = (1, 2) if wish.layers is None and wish.rod is None else (wish.layers or 1,)
    fit = [each for n in layers for each in wished(wish.rod, n) if least_spacing(each) <= spacing]
    borne = {each: _without_creases(surface, spacing, each) for each in fit}
    for ample in (_AMPLE, 0.5 * _AMPLE, 0.25 * _AMPLE):  # the estimate is rough
        enough = [bent_to(each) / BENT for each in fit if borne[each] >= ample * needed]
        if enough:
            return min(enough)
    return 0.0


def hopeless(surface: Surface, spacing: float, choice: RodChoice, needed: float) -> bool:
    """Whether rods are so thin that by the estimate the surface, curved as usual, would buckle far below
    `needed`, N/m², or they themselves between two joints."""
    if _without_creases(surface, spacing, choice) < _HOPELESS * needed:
        return True
    return _between_joints(surface, spacing, choice) < _BUCKLES * needed


def _between_joints(surface: Surface, spacing: float, choice: RodChoice) -> float:
    """The load, N/m², under which rods buckle between two joints, at the most: these clamp them (Euler), and
    each rod has the thrust of a sphere, q R / 2 times the spacing, R no more than the span."""
    radius = min(1.0 / max(curvature_usual(surface), 1e-12), width(surface))
    return 4.0 * math.pi**2 * choice.bending / spacing**2 / (0.5 * radius * spacing)


def _without_creases(surface: Surface, spacing: float, choice: RodChoice) -> float:
    """About what load, N/m², the braced grid buckles under, curved as usual everywhere."""
    return _buckling(spacing, choice.bending, rope_for(spacing), 0.5 * curvature_usual(surface) ** 2)


def bent_to(choice: RodChoice) -> float:
    """To which a rod can be bent until it breaks, m: equation (1)."""
    material = choice.section.material
    return material.young * max(choice.section.fibres) / material.strength


def buckling_load(surface: Surface, spacing: float, bending: float, rope: Rope) -> float:
    """About what load, N/m², the braced grid of rods with EI `bending`, N·m², buckles under."""
    return _buckling(spacing, bending, rope, curvature_mean_square(surface))


def _buckling(spacing: float, bending: float, rope: Rope, squared: float) -> float:
    """The same of a surface whose curvature has that mean square, 1/m²."""
    across, shear = bending / spacing, rope.stiffness / (math.sqrt(2.0) * spacing)
    return _BUCKLING * math.sqrt(across * shear) * squared
