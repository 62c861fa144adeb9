"""The tables of the case file, each with its entries, their units, defaults and bounds (case.py puts them
together and reads the file).
"""

from __future__ import annotations

import datetime
from typing import Any, Literal

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    NonNegativeFloat,
    PositiveFloat,
    PositiveInt,
    field_validator,
    model_validator,
)

from shellform.case.sized import (
    Adjustment,
    AreaMass,
    Axial,
    ConcreteDensity,
    Count,
    CountOrNone,
    Degrees,
    Density,
    Flexural,
    Gap,
    JointMass,
    Kerf,
    NetAngle,
    NodeForce,
    RestRatio,
    RodSize,
    Share,
    Shear,
    Spacing,
    StockLength,
    Strength,
    Thickness,
    Young,
    refuse_strain,
)
from shellform.gridshell.possible_rods import require_rods_material

_Polygon = list[tuple[float, float]]


class Entry(BaseModel):
    """A table of the case file: no unknown entries, finite numbers."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class SurfaceEntry(Entry):
    """What is to be built."""

    file: str = Field(description="surface file, or a builder script, relative to the case file")
    unit: Literal["m", "cm", "mm", "in", "ft"] | None = Field(
        None, description="unit of files that carry none"
    )
    up: Literal["x", "y", "z", "-x", "-y", "-z"] | None = Field(
        None, description="vertical axis of the file, with - where it points down; left out: the format's"
    )
    size: PositiveFloat | None = Field(None, description="mesh size, m")
    layer: str = Field("", description="layer of the surface in the file")
    object: str = Field("", description="name of the surface in the file")
    face: Literal["upper", "lower"] | None = Field(None, description="face of a solid")
    piece: PositiveInt | None = Field(None, description="number of a separate piece, 1 the largest")
    fill: Literal["holes", "edges", "all"] | None = Field(None, description="openings to close")
    fill_narrower: NonNegativeFloat = Field(0.0, description="holes narrower than this, m, are closed too")
    ground: float | None = Field(
        None, description="height to which open edges are closed, m; left out: the edge's lowest"
    )
    origin: tuple[float, float, float] | None = Field(
        None,
        description="of a survey's coordinates, m: what all others of the case and of what is written count from; "
        "left out: the file's own",
    )
    above: float | None = Field(
        None, description="level, m, up to which plinths or walls reach: what lies lower is cut off"
    )
    dimensions: dict[str, PositiveFloat] = Field({}, description="named dimensions of a builder script, m")


class NetEntry(Entry):
    """The Chebyshev net."""

    spacing: Spacing = Field(description="between rods, m")
    spacing_v: Spacing | None = Field(None, description="along the v rods; left out: as along u, m")
    angle: NetAngle = Field(0.0, description="of u rods against the x axis, degrees; auto: bent least")
    offset: tuple[float, float] = Field(
        (0.0, 0.0), description="of the net's origin from the middle, spacings; with auto (0, 0) is sought"
    )
    elements: PositiveInt = Field(4, le=100, description="beam elements a segment")
    guides: list[list[tuple[float, float]]] | None = Field(
        None, description="two plan curves in place of angle and offset, m"
    )
    method: Literal["pull", "compass"] = Field(
        "pull", description="compass: the compass net as it is, unrelaxed"
    )
    start: Literal["compass", "flat"] = Field("compass", description="from where the grid is pulled")
    spring_density: list[PositiveFloat] | None = Field(None, description="fictitious springs, rising, EI/s³")
    shear_stiffness: PositiveFloat = Field(
        0.1, description="fictitious, of a joint in the grid's plane, EI/s a radian"
    )
    merge: float = Field(
        0.2, gt=0.0, lt=0.5, description="joints nearer to the edge, in spacings, are left out"
    )
    ground: float | None = Field(None, description="height at which rods end, m")
    outline: list[tuple[float, float]] | None = Field(
        None, description="closed plan curve at which rods end, m"
    )
    uncovered_max: Share = Field(
        0.02, description="share of the surface that may lie farther than 0.75 spacings from any rod"
    )

    @model_validator(mode="after")
    def _guided(self) -> NetEntry:
        if self.guides is not None and (len(self.guides) != 2 or min(len(each) for each in self.guides) < 2):
            raise ValueError("guides must be two curves, each a list of at least two points [x, y]")
        if self.guides is not None and self.angle == "auto":
            raise ValueError("guides leave no angle to search for; leave one of the two out")
        return self


class _BoughtEntry(Entry):
    stock_length: StockLength | None = Field(
        None, description="in which rods are bought, m; left out: the catalogue's, or 6 m"
    )
    kerf: Kerf = Field(0.003, description="width of a saw cut, m")
    layers: Literal[1, 2] = Field(
        1, description="2: bent as two single laths one above the other, then locked by shear blocks"
    )
    composite: Share = Field(0.5, description="how far two layers act together, 1 as if glued, 0 loose")


class OwnRodEntry(_BoughtEntry):
    """Rods of given sizes: round, tubes or laths."""

    young: Young = Field(description="Young's modulus, Pa")
    poisson: float = Field(0.3, ge=0.0, lt=0.5, description="Poisson's ratio, for the shear modulus")
    shear: Shear | None = Field(None, description="shear modulus, Pa, in place of poisson")
    strength: Strength = Field(description="flexural strength, Pa")
    density: Density = Field(0.0, description="kg/m³, for the rods' own weight")
    radius: RodSize | None = Field(
        None, description="of round rods and tubes, m; left out: the largest that the net allows"
    )
    wall: RodSize | None = Field(None, description="of tubes, m")
    width: RodSize | None = Field(None, description="of laths in the surface, m")
    height: RodSize | None = Field(None, description="of laths across the surface, m")

    @model_validator(mode="after")
    def _one_shape(self) -> OwnRodEntry:
        if self.wall is not None and (self.radius is None or self.wall >= self.radius):
            raise ValueError("a tube's wall needs a radius larger than it, m; leave wall out for round rods")
        if (self.width is None) != (self.height is None):
            raise ValueError("a lath needs both width and height; add the other, or give a radius")
        if self.width is not None and self.radius is not None:
            raise ValueError("a rod has either a radius or a width and a height; leave one out")
        return self

    @model_validator(mode="after")
    def _a_material(self) -> OwnRodEntry:
        require_rods_material(self.young, self.shear, self.strength, self.density, where="rod")
        return self


class StockRodEntry(_BoughtEntry):
    """Rods from a catalogue."""

    catalogue: str = Field(description="a shipped catalogue's name, or a TOML file relative to the case file")
    section: str | None = Field(
        None, description='like "10 mm", "42 x 3.5 mm"; left out: the stiffest that the net allows'
    )


class JointEntry(Entry):
    """The connection of two crossing rods, a short beam. What is left out follows the rods: table 1 of the
    paper, scaled; the gap is their depth.
    """

    axial: Axial = Field(description="EA, N")
    torsion: Flexural = Field(description="GJ, N·m²")
    bending: Flexural = Field(description="EI, N·m²")
    gap: Gap = Field(description="between the rods' axes, m")


class CableEntry(Entry):
    """Bracing cables."""

    stiffness: Axial = Field(description="EA, N")
    rest_ratio: RestRatio = Field(0.99, description="initial rest length over length in the target")
    force_max: PositiveFloat = Field(
        description="largest allowed tension before any load and under each, N (constraint 5; by the paper's method under the design load alone); as much as the stiffness limits nothing"
    )
    edge_cells: bool | None = Field(
        None,
        description="candidates in cells at the edge with three joints too; left out: with optimise.method paper",
    )
    without: bool = Field(
        True, description="also load the grid without cables, to compare with (paper, section 4.1)"
    )
    adjustment: Adjustment | None = Field(
        None, description="range of the turnbuckles, m; given: cables are cut to the fewest lengths"
    )

    @model_validator(mode="after")
    def _stretched(self) -> CableEntry:
        refuse_strain(self.stiffness, self.force_max)
        return self


class LoadEntry(Entry):
    """Wet concrete as point loads."""

    force: NodeForce = Field(description="on each loaded crossing, N")
    every: PositiveInt = Field(1, description="2: every second crossing of the checkerboard")
    additional: float = Field(1.2, ge=1.0, lt=100.0, description="factor of the additional load case")
    openings: list[_Polygon] = Field([], description="plan polygons without load, m")


class LoadCaseEntry(Entry):
    """A named load case: factors times parts. The cases "design" and "additional" must be there."""

    name: str = Field(pattern=r"^\w[\w .-]*$", description="of the case, and of its files")
    factors: dict[str, float] = Field({}, description="part = factor")
    stages: list[str] = Field(
        [], description='parts added one after the other in the cases "NAME 1", "NAME 2", …'
    )


class PointsEntry(Entry):
    """Point loads on crossings."""

    kind: Literal["points"]
    force: NodeForce = Field(description="on each loaded crossing, N")
    every: PositiveInt = Field(1, description="2: every second crossing of the checkerboard")
    openings: list[_Polygon] = Field([], description="plan polygons without load, m")
    inside: list[_Polygon] = Field([], description="plan polygons with load, m; left out: everywhere")


class _SpreadEntry(Entry):
    openings: list[_Polygon] = Field([], description="plan polygons where there is none, m")
    inside: list[_Polygon] = Field(
        [], description="plan polygons where there is some, m; left out: everywhere"
    )
    half: Degrees | None = Field(
        None, description="only the half towards this direction in plan, degrees from x"
    )
    strip: tuple[Degrees, float, float] | None = Field(
        None, description="only between two places along a direction: degrees, m, m"
    )
    ring: tuple[float, float] | None = Field(None, description="only between two levels, m")


class ConcreteEntry(_SpreadEntry):
    """Wet concrete on its true area."""

    kind: Literal["concrete"]
    thickness: Thickness = Field(description="across the surface, m")
    density: ConcreteDensity = Field(2500.0, description="kg/m³")


class SheetEntry(_SpreadEntry):
    """A membrane or reinforcement on its true area."""

    kind: Literal["membrane", "reinforcement"]
    mass: AreaMass = Field(description="kg/m²")


class RodsWeightEntry(Entry):
    """The rods' own weight."""

    kind: Literal["rods"]


class JointsWeightEntry(Entry):
    """The joints' own weight."""

    kind: Literal["joints"]
    mass: JointMass = Field(description="of each, kg")


class OptimiseEntry(Entry):
    """Objective (2), bounds (3, 4) and constraint (6)."""

    method: Literal["convex", "paper"] = Field(
        "convex",
        description="convex: models in the cables' tensions, thinned and polished; paper: moving asymptotes directly "
        "in the rest lengths and the radius, nothing else",
    )
    misfit: Share = Field(0.7, description="share of the misfit in the start value of the objective")
    cable_force: Share = Field(0.3, description="share of the sum of cable forces")
    rod_radius: Share = Field(0.0, description="share of the rod radius; above 0 it is a variable")
    built_misfit: Share = Field(
        0.0,
        description="share of the mean misfit of structures as built with [tolerances], to first order; by the paper's "
        "method it goes to the others",
    )
    rest_length_min: PositiveFloat = Field(0.01, description="bound (3), m")
    rest_length_max: float = Field(
        1.1, gt=1.0, lt=100.0, description="bound (3), times the initial rest length"
    )
    radius_min: PositiveFloat | None = Field(
        None,
        description="bound (4), m; left out: half the start's, with a catalogue as stiff as its softest section that the net allows",
    )
    misfit_rms_additional: PositiveFloat = Field(
        description="constraint (6) as root mean square distance a node, m; as much as the surface's larger side limits nothing"
    )
    evaluations: Count = Field(
        100,
        description="design evaluations at the most, and up to a fifth more where the result falls as built",
    )
    stiffness_min: float = Field(
        0.08,
        ge=0.0,
        lt=1.0,
        description="of the softest mode under additional loads, over the start's under the design load",
    )
    catalogue: str | None = Field(
        None, description="to which a free radius is rounded up; left out: the rods' own, if they have one"
    )
    rounded: CountOrNone = Field(
        30, description="design evaluations for each section that is tried in rounding; 0: no rounding"
    )
    neighbours: CountOrNone = Field(
        1, description="sections below and above the rounded one that are tried too"
    )
    cables_max: PositiveInt | None = Field(
        None, description="cables are taken away down to this number, if limits allow"
    )
    deviation: PositiveFloat | None = Field(
        None,
        description="distance of a node from its place under the design load, m, beyond which no cable is taken away for it, "
        "and polishing serves the farthest nodes beside all",
    )
    allowance: Share = Field(
        0.08,
        description="what all cables that are taken away may cost together, of the objective, which is 1 at the start: with 1 "
        "few cables count before the shape, as far as deviation lets them",
    )
    symmetric: bool = Field(
        False, description="cables that a symmetry of the net joins are polished to one length"
    )
    polish: CountOrNone = Field(
        20, description="design evaluations for the design polished, without the cables' share; 0: none"
    )
    unloaded: bool = Field(
        True,
        description="also make the design without regard to the loads, to compare with (paper, section 4.1)",
    )

    @model_validator(mode="after")
    def _whole(self) -> OptimiseEntry:
        total = self.misfit + self.cable_force + self.rod_radius + self.built_misfit
        if abs(total - 1.0) > 1e-9:
            raise ValueError(
                f"the shares misfit, cable_force, rod_radius and built_misfit must add up to 1, not {total:g}"
            )
        if self.symmetric and not self.polish:
            raise ValueError("symmetric lengths are found in polishing: give polish some evaluations")
        if self.method == "paper" and (self.symmetric or self.cables_max is not None):
            raise ValueError(
                "the paper's method neither polishes nor takes cables away: symmetric and cables_max need method convex"
            )
        if self.catalogue is not None and not self.rod_radius:
            raise ValueError("catalogue is for a free radius: give rod_radius a share")
        return self


class FiguresEntry(Entry):
    """Pictures."""

    limit: PositiveFloat | None = Field(
        None,
        description="end of the colour scale, m; left out: one that the design to build fills under the design load",
    )


class TitleBlockEntry(Entry):
    """What drawings and models for others say of who drew them and when."""

    date: str = Field("", pattern=r"^(\d{4}-\d\d-\d\d)?$", description="of the drawings, like 2026-05-31")
    revision: str = Field("", max_length=20, description="of the drawings")
    author: str = Field("", max_length=60, description="who drew them")

    @field_validator("date", mode="before")
    @classmethod
    def _day(cls, value: Any) -> Any:
        try:
            return value and datetime.date.fromisoformat(str(value)).isoformat()
        except ValueError as error:
            raise ValueError(f"{str(value)!r} is no day; write it like 2026-05-31") from error
