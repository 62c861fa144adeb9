"""How a drawn structure fails: under which load, in which shape, which cables leave it, which error drives
it.

Which cause drives a failure is found by taking it away: the same structure is loaded again with one cause's
errors left out, and what its load factor gains is that cause's part. Gains needn't add up, since causes work
together; a first-order share about the perfect structure's limit point would add up and be wrong (the
collapse starts from another path). The cables are those that are slack at the end of the branch and taut in
the perfect structure under the same load.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from shellform.arrays import Indices, Reals, Record
from shellform.errors import InputError
from shellform.gridshell.tolerances import Tolerances
from shellform.reliability.drawing import built_cables, errors_of, variables
from shellform.reliability.path_of_one import Limit
from shellform.reliability.standing import Workshop
from shellform.structure.elements.state import State
from shellform.structure.elements.threads import side_by_side

_RESOLUTION = 1 / 1024  # of the load: what most causes bring is less than what a count has to know
_MOST = 1.5  # load factor up to which a structure without one cause is followed


@dataclass(frozen=True, eq=False)
class Failure(Record):
    """How one drawn structure falls.

    - `number` under its seed; `factor` of the load at which it fell; `kind`: by what (path_of_one.py).
    - `without`: by cause, the load factor that it reaches with that one left out, the most helpful first.
    - `cables`: numbers of those of the design's cables that have gone slack.
    - `state`: its last one; `mode` (n, 6), largest translation 1: its own softest there, in which it gives
      way.
    """

    number: int
    factor: float
    kind: str
    without: Mapping[str, float]
    cables: Indices
    mode: Reals
    state: State

    @property
    def driver(self) -> str:
        """The cause without which it would bear most."""
        return next(iter(self.without))


def explained(workshop: Workshop, tolerances: Tolerances, *, seed: int, number: int) -> Failure:
    """Of one fallen structure. Raises InputError where it has no unloaded state or bears its load."""
    nominal = workshop.nominal
    z = variables(nominal.members, seed, number)
    errors = errors_of(nominal.members, tolerances, z)
    end = workshop.fall(errors, most=1.0, resolution=_RESOLUTION)
    if end.factor >= 1.0:  # it went on after a snap that is told apart from a fall by small steps alone
        end = workshop.fall(errors, most=1.0)
    if end.factor >= 1.0 or end.factor == 0.0:
        raise InputError(
            "the structure hasn't fallen under its load",
            where="number",
            value=number,
            remedy="Choose a structure that falls under this load.",
        )
    active = list(tolerances.causes)

    def left(cause: str) -> Limit:
        other = {**z, cause: np.zeros_like(z[cause])}
        own = errors_of(nominal.members, tolerances, other)
        return workshop.fall(own, most=_MOST, resolution=_RESOLUTION, tell=False)

    found = {cause: each.factor for cause, each in zip(active, side_by_side(left, active), strict=True)}
    cables = nominal.network.cables
    built = built_cables(cables, nominal.present, errors, nominal.imperfections)
    nearest = int(np.argmin(np.abs(nominal.factors - end.factor)))
    slack = (built.tension(end.state) <= 0.0) & (cables.tension(nominal.states[nearest]) > 0.0)
    return Failure(
        number,
        end.factor,
        end.kind,
        dict(sorted(found.items(), key=lambda each: -each[1])),
        np.flatnonzero(slack),
        workshop.with_structure(errors, lambda own: own.softest(end.state)),
        end.state,
    )
