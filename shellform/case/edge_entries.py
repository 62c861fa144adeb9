"""The table [edges] of the case file: what the surface's edges stand on, and what edge beams are."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, PositiveFloat, PositiveInt, model_validator

from shellform.case.entries import Entry
from shellform.case.sized import Density, EdgeSize, Share, Strength, Young


class EdgeBeamEntry(Entry):
    """What edge beams are: a bundle of rods, a round one, a tube, a lath, or one from a catalogue. Made in
    its final curve.
    """

    rods: PositiveInt | None = Field(
        None, description="in a bundle, each as the case's rods; left out with all else: 19"
    )
    composite: Share = Field(0.5, description="how far a bundle's rods act together, 1 as if glued, 0 loose")
    radius: EdgeSize | None = Field(None, description="of one round rod or tube, m")
    wall: EdgeSize | None = Field(None, description="of a tube, m")
    width: EdgeSize | None = Field(None, description="of a lath in the surface, m")
    height: EdgeSize | None = Field(None, description="of a lath across the surface, m")
    catalogue: str | None = Field(None, description="a shipped catalogue's name, or a TOML file")
    section: str | None = Field(None, description='of the catalogue, like "42 x 3.5 mm"')
    young: Young | None = Field(None, description="Pa; left out: as the rods")
    poisson: float = Field(0.3, ge=0.0, lt=0.5, description="Poisson's ratio, where young is given")
    strength: Strength | None = Field(None, description="flexural strength, Pa; left out: as the rods")
    density: Density | None = Field(None, description="kg/m³; left out: as the rods")

    @model_validator(mode="after")
    def _one_shape(self) -> EdgeBeamEntry:
        if (self.width is None) != (self.height is None):
            raise ValueError("a lath needs both width and height; add the other")
        if (self.catalogue is None) != (self.section is None):
            raise ValueError("a section from a catalogue needs both catalogue and section; add the other")
        given = [name for name in ("rods", "radius", "width", "catalogue") if getattr(self, name) is not None]
        if len(given) > 1:
            raise ValueError(f"an edge beam has only one of {', '.join(given)}; leave the others out")
        if self.wall is not None and (self.radius is None or self.wall >= self.radius):
            raise ValueError("a tube's wall needs a radius larger than it, m; leave wall out for a round rod")
        return self


_EdgeKind = Literal["auto", "ground", "wall", "abutment", "beam", "free", "pin", "fill"]


class StretchEntry(Entry):
    """A part of the edge, where all that is given holds."""

    kind: Literal["ground", "wall", "abutment", "beam", "free", "pin"] = Field(
        description="what holds the rods' ends there; pin: in mid-air, by something else"
    )
    name: str = Field("", description="in pictures and lists")
    height: tuple[float, float] | None = Field(None, description="between two levels, m")
    box: tuple[tuple[float, float, float], tuple[float, float, float]] | None = Field(
        None, description="in a box with these opposite corners, m"
    )
    curve: list[tuple[float, float]] | None = Field(None, min_length=2, description="along a plan curve, m")
    within: PositiveFloat | None = Field(
        None, description="no farther from the curve than this, m; left out: half a spacing"
    )
    opening: bool | None = Field(None, description="true: edges of openings only, false: the outer edge only")

    @model_validator(mode="after")
    def _somewhere(self) -> StretchEntry:
        if self.height is not None and not self.height[0] < self.height[1]:
            raise ValueError("height needs the lower level first")
        if self.height is None and self.box is None and self.curve is None and self.opening is None:
            raise ValueError("say where: give height, box, curve or opening")
        return self


class EdgesEntry(Entry):
    """What the surface's edges stand on."""

    outer: _EdgeKind = Field(
        "auto", description="auto: ground where it is low, an edge beam elsewhere; fill: down to the ground"
    )
    openings: _EdgeKind = Field("auto", description="the same for openings; fill: closed")
    ground: float | None = Field(
        None,
        description="its level, m; left out: net.ground, or what the outer edge shows, its lowest point or a slope",
    )
    stretch: list[StretchEntry] = Field([], description="parts of the edge, the first that holds counts")
    beam: EdgeBeamEntry = Field(
        default_factory=lambda: EdgeBeamEntry.model_validate({}), description="what edge beams are"
    )
