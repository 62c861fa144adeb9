"""The case file's tables [limits] and [robust]: what an engineer limits."""

from __future__ import annotations

from pydantic import Field, NonNegativeFloat, NonNegativeInt, PositiveFloat, field_validator

from shellform.case.entries import Entry
from shellform.case.sized import CountOrNone
from shellform.problem.engineering import BROKEN, ConnectorTurn


class LimitsEntry(Entry):
    """What an engineer limits besides constraints (5) and (6), each under every load case and without load,
    but deviations, which count where the concrete hardens and where it is poured, and slack_min, which holds
    under slack_loads; left out: not limited.
    """

    deviation: PositiveFloat | None = Field(
        None, description="largest distance of a node from its place under the design load, m"
    )
    built_deviation: PositiveFloat | None = Field(
        None,
        description="largest distance of a node from its place under the design load as built, at worst, m",
    )
    unloaded_deviation: PositiveFloat | None = Field(
        None, description="largest distance of a node from its place in the braced shell before any load, m"
    )
    utilisation: PositiveFloat | None = Field(
        None,
        le=BROKEN,
        description="largest fibre stress of the rods over their strength, erection stress included",
    )
    cable_utilisation: PositiveFloat = Field(
        1.0, le=1.0, description="largest pull of a cable over cable.force_max, as planned"
    )
    connector_turn: PositiveFloat | None = Field(
        None, description="of two crossing rods against each other from the flat grid, rad"
    )
    uplift: NonNegativeFloat | None = Field(
        None, description="force with which a support may have to hold a rod's end down, N"
    )
    thrust: PositiveFloat | None = Field(None, description="horizontal force that a support may bear, N")
    slack_min: PositiveFloat | None = Field(None, description="least tension of every cable, N")
    slack_loads: list[str] = Field(
        ["none"], description="load cases in which slack_min holds; none: before any load"
    )

    @field_validator("connector_turn")
    @classmethod
    def _less_than_a_right_angle(cls, turn: float | None) -> float | None:
        return None if turn is None else ConnectorTurn("").at_limit(turn)


class RobustEntry(Entry):
    """How far the shape may be moved by what [tolerances] says that a structure is off by."""

    deviations: NonNegativeFloat = Field(
        1.0,
        le=100.0,
        description="standard deviations that are added to the mean misfit where it is limited",
    )
    limit: PositiveFloat | None = Field(
        None, description="of that misfit under the design load, as root mean square distance a node, m"
    )
    samples: CountOrNone = Field(
        0, description="drawn structures solved anew to check mean and deviation; 0: none"
    )
    seed: NonNegativeInt = Field(0, description="of the drawing")
