"""How structures of a design fail as built, and how rarely."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class FailureRecord:
    """How the `design` most likely fails under the `load`.

    - `number`: the structure of middle load factor among the fallen ones; `factor` of the load at which it
      falls; `kind`: by what.
    - `driver`: the cause of error without which it bears most; `without`: by cause, the factor that it
      reaches when that one is left out.
    - `cables` that go slack on the way.
    """

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
    """How rarely structures of the `design` fall under the `load`: the `probability` by subset simulation
    from so many `structures` with its coefficient of `variation`, and the causes' `shares` in the likeliest
    failures. Where none fell, `probability` is the least share that the simulation came to, and `variation`
    None."""

    design: str
    load: str
    probability: float
    structures: int
    shares: Mapping[str, float]
    variation: float | None = None
