"""How structures of a design fail as built, and how rarely."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class FailureRecord:
    """How the `design` most likely fails under the `load`: structure `number`, of middle load factor among
    the fallen ones, falls at the load `factor` by what `kind` tells; the `driver` is the cause of error
    without which it bears most, `without` the factors that it reaches with one cause left out; `cables` go
    slack on the way."""

    design: str
    load: str
    number: int
    factor: float
    kind: str
    driver: str
    without: Mapping[str, float]
    cables: tuple[str, ...]


@dataclass(frozen=True)
class RareRecord:
    """How rarely structures of the `design` fall under the `load`: the `probability` by subset simulation from
    so many `structures` with its coefficient of `variation`, and the causes' `shares` in the likeliest failures.
    Where none fell, `probability` is the least share that the simulation came to, and `variation` None."""

    design: str
    load: str
    probability: float
    variation: float | None
    structures: int
    shares: Mapping[str, float]
