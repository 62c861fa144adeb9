"""Sections of the case file beyond the paper's: the engineer's limits, and what scatters in a structure as built."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field, NonNegativeFloat, NonNegativeInt, PositiveFloat


class Section(BaseModel):
    """A table of the case file: no unknown entries, finite numbers."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class LimitsEntry(Section):
    """What an engineer limits besides constraints (5) and (6), each under every load case and without load; left out: not limited."""

    utilisation: PositiveFloat | None = Field(None, description="largest fibre stress of the rods over their strength, erection stress included")
    connector_turn: PositiveFloat | None = Field(None, description="of two crossing rods against each other from the flat grid, rad")
    uplift: NonNegativeFloat | None = Field(None, description="force with which a support may have to hold a rod's end down, N")
    slack_min: PositiveFloat | None = Field(None, description="least tension of every cable, N")
    slack_loads: list[str] = Field(["none"], description="load cases in which slack_min holds; none: before any load")
    critical_factor: float | None = Field(None, gt=1.0, description="of each of critical_loads, up to which its path stays stable")
    critical_loads: list[str] = Field(["design"], min_length=1, description="load cases that critical_factor holds for")


class RobustEntry(Section):
    """Standard deviations of what isn't known exactly, each relative where no unit is named; 0 leaves a cause out."""

    cable_stiffness: NonNegativeFloat = Field(0.0, description="of each cable")
    cable_stiffness_all: NonNegativeFloat = Field(0.0, description="of all cables together")
    rest_length: NonNegativeFloat = Field(0.0, description="of each cable: the error of its prestress, m")
    supports: NonNegativeFloat = Field(0.0, description="of each coordinate of each support, m")
    joints: NonNegativeFloat = Field(0.0, description="of each connector's torsion and bending stiffness")
    joints_all: NonNegativeFloat = Field(0.0, description="of all connectors together")
    loads: NonNegativeFloat = Field(0.0, description="of the load on each node")
    loads_all: NonNegativeFloat = Field(0.0, description="of the whole load")
    deviations: NonNegativeFloat = Field(1.0, description="standard deviations that are added to the mean misfit where it is limited or minimised")
    limit: PositiveFloat | None = Field(None, description="of that misfit under the design load, as root mean square distance a node, m")
    samples: NonNegativeInt = Field(0, description="drawn structures solved anew to check mean and deviation; 0: none")
    seed: NonNegativeInt = Field(0, description="of the drawing")
