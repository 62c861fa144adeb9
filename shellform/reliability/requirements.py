"""What is asked of the structures on which a search tries its designs: of which samples they are, how many of
them may fall under each load, and what factor the perfect one keeps.

If the load that structures bear scatters normally about a mean above the one asked for, enlarging their
errors by e divides that distance, counted in deviations, by e: with P the normal distribution, a share p
becomes P(P⁻¹(p) / e), so that what one in a hundred does with errors as they are one in sixteen does with
half as much again. (Larger errors also lower the mean, which errs on the safe side.) A dozen structures then
refuse what else a hundred would be needed for.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtr, ndtri

from shellform.arrays import Reals, Record
from shellform.gridshell.tolerances import Tolerances, enlarged
from shellform.reliability.safety import Safety, allowed, paths

SEED = 2  # added to the safety's: a search doesn't see the structures that a finished design is judged by
FRESH = 100_000  # the number from which on structures are of fresh samples, whose errors are as they are
MOST = 40  # structures by which a search tries designs without enlarged errors
_MESH = 1.01  # over the critical factor asked for: what elements of usual length tell too much, twice over
_SPARE = 1  # of the structures that may fall, none of a fresh sample: what thinning ends with is at the edge of falling


@dataclass(frozen=True, eq=False)
class Required(Record):
    """What a search asks of designs: the `safety`, the dead `loads` (n, 6) under which structures are drawn,
    the `design_load` among them, how many of the structures tried may have `fallen` under each, and the
    number of the `first` of them."""

    safety: Safety
    loads: Mapping[str, Reals]
    design_load: str
    fallen: Mapping[str, int]
    first: int = 0

    @property
    def numbers(self) -> range:
        """Of the structures tried."""
        return range(self.first, self.first + self.safety.tried)

    def tolerances(self, number: int) -> Tolerances:
        """With which a structure is drawn: enlarged, but those of fresh samples."""
        return enlarged(self.safety.tolerances, self.safety.enlarged if number < FRESH else 1.0)


@dataclass(frozen=True, eq=False)
class Demand:
    """What a search asks of structures as built.

    - `trial`: of those on which it tries each design; `confirmed`: of a fresh sample at its end, None where
      that is left to whoever judges what it finds.
    - `trusted`: whether errors are enlarged in trials as was asked for, so that what they confirm seldom
      falls later.
    - `spare`: how many fewer may fall in a fresh sample than of a finished design's: what was chosen among
      many is at the edge of falling.
    """

    trial: Required
    confirmed: Required | None
    trusted: bool = True
    spare: int = _SPARE

    def sample(self, number: int) -> Required:
        """What is required of the fresh sample of this number."""
        fresh = self.confirmed
        assert fresh is not None
        fresh = replace(fresh, first=fresh.first + number * fresh.safety.tried)
        return _sparing(fresh, self.spare) if self.spare else fresh

    def unspared(self) -> Demand:
        """The same where as many may fall in fresh samples as where a finished design is judged."""
        return replace(self, spare=0)

    def surer(self) -> Demand:
        """The same with fresh samples twice as large as those that judge finished designs, of which fewer may
        fall by a standard deviation of what may: for a design that may be left for the one before it."""
        fresh = self.confirmed
        if fresh is None:
            return self
        safety = replace(fresh.safety, tried=2 * fresh.safety.drawn)
        larger = safety.tried / fresh.safety.tried
        fallen = {name: int(larger * count) for name, count in fresh.fallen.items()}
        may = may_fall(safety, fresh.design_load, fresh.design_load)
        spare = max(_SPARE, int(np.sqrt(may)))
        return replace(self, confirmed=replace(fresh, safety=safety, fallen=fallen), spare=spare)

    def after(self, samples: int) -> Demand:
        """The same for a search that comes after one that drew so many fresh samples."""
        fresh = self.confirmed
        if fresh is None:
            return self
        return replace(self, confirmed=replace(fresh, first=fresh.first + samples * fresh.safety.tried))


def closer(asked: Demand) -> Demand:
    """The same with as many structures in a trial as confirm a result: what is led by those that fall comes
    to know the ones by which it is judged."""
    trial, own = asked.trial, replace(asked.trial.safety, tried=max(MOST, asked.trial.safety.tried))
    share = own.tried / trial.safety.tried
    fallen = {name: may_fall(own, name, trial.design_load) for name in trial.fallen}
    for name, count in trial.fallen.items():
        if name != trial.design_load and own.probability_additional is None:
            fallen[name] = max(fallen[name], int(share * count))  # as many as of the start
    return replace(asked, trial=replace(trial, safety=own, fallen=fallen))


def largest_on_path(asked: Required) -> tuple[str, dict[str, float]]:
    """The largest load on the design load's path, and the shares of it that lie on that path: the structures
    are loaded with it, and their imperfections follow the softest modes under it."""
    return next(
        (largest, shares) for largest, shares in paths(asked.loads).items() if asked.design_load in shares
    )


def critical_wanted(asked: Required, shares: Mapping[str, float]) -> float:
    """What the perfect structure is to bear of a path's largest load; 0 where nothing is asked for on it."""
    if asked.safety.critical_factor is None or asked.design_load not in shares:
        return 0.0
    return _MESH * asked.safety.critical_factor * shares[asked.design_load]


def _sparing(asked: Required, spare: int) -> Required:
    """The same with so many less that may fall than the probability allows; where under a further load as
    many may as of the start, fewer by a standard deviation of the difference of two such numbers."""
    fallen = {}
    for name, count in asked.fallen.items():
        known = may_fall(asked.safety, name, asked.design_load)
        chance = np.sqrt(2.0 * count * (1.0 - count / asked.safety.tried))
        if count <= known:
            fallen[name] = max(count - spare, 0)
        else:
            fallen[name] = count if name == asked.design_load else max(int(count - chance), known)
    return replace(asked, fallen=fallen)


def may_fall(safety: Safety, name: str, design_load: str) -> int:
    """How many of the structures tried may fall under a load by the probability that is asked for."""
    wanted = safety.required(name, design_load, None)
    return allowed(float(ndtr(ndtri(wanted) / safety.enlarged)), safety.tried)
