"""The case file's tables on the structure as built: what it is off by, and what is asked of it."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field, NonNegativeInt, model_validator

from shellform.case.entries import Entry
from shellform.case.sized import Count, CountOrNone, PlaceDeviation
from shellform.gridshell.tolerances import LARGEST_SHARE, SOURCES

_Share = Annotated[float, Field(ge=0.0, le=LARGEST_SHARE)]


def _deviation(unit: str, name: str) -> Any:
    """The field of a standard deviation: its unit, the source of its size, and what holds where it is left
    out."""
    words = f"{unit}: {SOURCES[name]}; left out: by the shell's size"
    return Field(None, description=words)


class TolerancesEntry(Entry):
    """Standard deviations of what a gridshell as built is off by; 0 leaves a cause out. What is left out
    follows the shell's size, as run folders' case files say with its source.
    """

    cable_length: PlaceDeviation | None = _deviation("m", "cable_length")
    cable_stiffness: _Share | None = _deviation("share", "cable_stiffness")
    supports: PlaceDeviation | None = _deviation("m, each coordinate", "supports")
    marks: PlaceDeviation | None = _deviation("m, of crossings along rods", "marks")
    rod_stiffness: _Share | None = _deviation("share, of each rod", "rod_stiffness")
    rod_bow: _Share | None = _deviation("rise over length of each rod", "rod_bow")
    connectors: _Share | None = _deviation("share", "connectors")
    load_each: _Share | None = _deviation("share, of each crossing's load", "load_each")
    load_all: _Share | None = _deviation("share, of the whole load", "load_all")
    load_uneven: _Share | None = _deviation("share, of one half's load", "load_uneven")
    shape: _Share | None = _deviation("amplitude of each soft mode over the span", "shape")
    cable_stiffness_all: _Share | None = Field(
        None, description=f"share, of all cables together; left out: 0, {SOURCES['cable_stiffness_all']}"
    )
    connectors_all: _Share | None = Field(
        None, description=f"share, of all connectors together; left out: 0, {SOURCES['connectors_all']}"
    )
    tape: _Share | None = Field(
        None, description=f"share, of all lengths along a rod; left out: {SOURCES['tape']}"
    )


class SafetyEntry(Entry):
    """What is asked of the structure as built, drawn with [tolerances]."""

    required: bool = Field(True, description="false: only told, whatever it is")
    probability_design: float = Field(
        0.99, ge=0.0, lt=1.0, description="share of drawn structures that stand under the design load"
    )
    probability_additional: float | None = Field(
        None,
        ge=0.0,
        lt=1.0,
        description="under every other load; left out: no less than of the initial design",
    )
    critical_factor: float = Field(
        1.25,
        ge=0.0,
        lt=100.0,
        description="of the perfect structure under the design load, with rod elements halved; 0: not asked",
    )
    critical_further: dict[str, Annotated[float, Field(gt=1.0, lt=100.0)]] = Field(
        {}, description="the same of further load cases, by name: { half = 1.2 }"
    )
    drawn: Count = Field(200, description="structures of the design to build")
    compared: Count = Field(
        20,
        description="structures of the designs to compare with; of the initial one all where no fewer than of it are to stand",
    )
    rare: CountOrNone = Field(
        0,
        multiple_of=10,
        description="structures a level of the subset simulation that tells how rarely the design to build falls: "
        "with 200, one in a thousand takes some 560 structures; 0: not asked",
    )
    confidence: float = Field(0.95, gt=0.0, lt=1.0, description="of the probability that is told")
    seed: NonNegativeInt = Field(0, description="of the drawing; the search draws others")

    @model_validator(mode="after")
    def _enough(self) -> SafetyEntry:
        if self.compared > self.drawn:
            raise ValueError("compared must not exceed drawn; lower it, or raise drawn")
        if 0.0 < self.critical_factor < 1.0:
            raise ValueError("critical_factor must be 0 (not asked) or at least 1")
        if 0 < self.rare < 20:
            raise ValueError("rare must be 0 (not asked) or at least 20")
        return self
