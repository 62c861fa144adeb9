"""The optimiser's settings: sequential convex programming in a trust region.

Each round replaces the problem by a convex model round the present design (step_model.py), exact in first
order and with Gauss-Newton curvature, solves it within a window, and evaluates the trial by its true
equilibria. CVXOPT's interior-point method solves the model, and where no constraint asks for many rows
NLopt's MMA goes on from there (proposal.py).
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass, fields
from typing import Any

from shellform.errors import InputError, require_count, require_number


def check_settings(settings: Any, *, may_be_zero: Collection[str] = (), shares: Collection[str] = ()) -> None:
    """Raises InputError for a number among a solver's `settings` that is out of bounds, as the named `shares`
    are above 1, and for one that isn't whole where they count: by their types. What may be left out (None)
    isn't asked for."""
    for each in fields(settings):
        value = getattr(settings, each.name)
        if value is None and each.default is None:
            continue
        where, otherwise = f"solver.{each.name}", f"or leave it out for {each.default}"
        least = 0 if each.name in may_be_zero else 1
        if str(each.type).startswith("int"):
            require_count(value, least=least, where=where, give=f"a whole number, {otherwise}")
            continue
        share = each.name in shares
        kind = "share up to 1" if share else "positive number"
        most = 1.0 if share else math.inf
        if least == 0:
            give = f"0 or a {kind}, {otherwise}"
            require_number(value, least=0.0, most=most, where=where, give=give, share=share)
        else:
            give = f"a {kind}, {otherwise}"
            require_number(value, above=0.0, most=most, where=where, give=give, share=share)


@dataclass(frozen=True)
class SequentialConvex:
    """Settings of `optimise` and `polish`. Windows and tensions are in mean cable tensions of the start under
    the design load.

    What to choose:
    - `window`: half-width of the first step.
    - `thin`: whether cables that do little are taken away at the end.
    - `stiffness`: what the softest mode must keep under the further loads, as a share of the start's under
      the design load (0: nothing). Deviations don't see buckling coming, its stiffness does.
    - `most_cables`: down to so many cables are taken away whatever they do for the objective, as long as
      every constraint is kept.
    - `deviation`, m: no cable is taken away if a node then is farther than this from its place under the
      design load, or farther than before where it was beyond it; polished, a design with a farther node is
      led by its farthest ones too.

    The trust region:
    - `smallest`: window at which no better design is to be found, which ends a turn.
    - `grow`, `shrink`: of the window after a step whose true improvement over the predicted one is above
      `good`, below `poor`; shrinking is quicker, since a refused trial costs as much as an accepted one.
    - `settled`: relative improvement predicted for the largest window that ends the optimisation: below what
      a constraint may be violated by.
    - `penalty`: of a violated constraint beside the objective, which is 1 at the start: a violation of a
      tenth of the limit outweighs the whole objective.
    - `aim`: of that penalty, the price of what drawn structures that a search keeps in mind miss of what they
      are to bear: it is made up for later more easily than a limit.
    - `near`: below a limit, as a share of it, from where on its curvature counts; farther off it would hold
      steps back for nothing.

    Stages of further loads that the start doesn't bear:
    - `margin`, `least_margin`: of the whole further load, left between a stage and the end of the stable
      branch, at first and at last: the end itself is singular.

    Cables under further loads:
    - `least_tension`: of cables that are to stay in tension.
    - `guards`: cables of each load that are kept from going slack at most, the nearest ones: the step's
      problem is dense in them.
    - `recovery`: of what a window can change at most, which a cable below its least tension must regain.

    Thinning:
    - `batch`: the first batch takes one in so many of the cables in tension; after it they grow by a third
      while they fit and are cut to a third where not.
    - `candidates`: of thousands of cables, those that are looked at for a batch, or as many as it takes.
    - `largest`: cables that a batch takes at most.
    - `kept`: of the stiffness in any direction at the decisive load, that a batch must leave: the others'
      lengths are to make up for the rest. It only keeps trials from failing for nothing: what a design has to
      bear, its constraints and structures as built decide, and of stiff strands each holds most of its
      direction.
    - `allowance`: what all cables with little use together may cost, of the objective at the start, which is
      1: a share of what is left of it would forbid the more the better the shape became.
    - `failures`: single cables in a row that can't go, after which thinning ends.
    - `idle`: of the cables, that may be slack under all loads before they are left out of the search, whose
      models solve for every cable in it.
    - `repairs`: steps after each batch.

    Designs as built:
    - `stiffer`: times the stiffness of a design that falls, which is asked for next, at the most
      `stiffenings` times in a row.
    - `softer`: of the stiffness of a design that stands, which the next batch is asked to keep.

    The step's problem:
    - `many`: cables, beyond which its answers come by solves of their own instead of dense matrices, whose
      time grows with the cube of their number: of 1,644 those take five times as long.
    - `model_evaluations`: of the convex model, some 50 microseconds each, for MMA to go on from the interior
      points' answer.
    """

    window: float = 0.2
    thin: bool = True
    stiffness: float = 0.08
    most_cables: int | None = None
    deviation: float | None = None

    smallest: float = 0.03
    grow: float = 1.6
    shrink: float = 0.4
    good: float = 0.7
    poor: float = 0.3
    settled: float = 1e-3
    penalty: float = 10.0
    aim: float = 0.3
    near: float = 0.5

    margin: float = 0.15
    least_margin: float = 0.01

    least_tension: float = 0.05
    guards: int = 400
    recovery: float = 0.1

    batch: int = 8
    candidates: int = 1024
    largest: int = 4096
    kept: float = 0.1
    allowance: float = 0.08
    failures: int = 6
    idle: float = 0.2
    repairs: int = 2

    stiffer: float = 1.1
    stiffenings: int = 3
    softer: float = 0.95

    many: int = 600
    model_evaluations: int = 200

    def __post_init__(self) -> None:
        check_settings(self, may_be_zero=_MAY_BE_ZERO, shares=_SHARES)
        if not self.shrink < 1.0 <= self.grow:
            raise InputError(
                "windows must shrink by less than 1 and grow by more",
                where="solver.shrink",
                value=(self.shrink, self.grow),
                remedy="Give shrink below 1 and grow of 1 or more, such as 0.4 and 1.6.",
            )
        for name, give in (("grow", "a factor of the window"), ("stiffer", "a factor of the stiffness")):
            value, where = getattr(self, name), f"solver.{name}"
            require_number(
                value, least=1.0, below=100.0, where=where, give=f"{give}, such as 1.1", share=True
            )


_MAY_BE_ZERO = (
    "thin",
    "stiffness",
    "most_cables",
    "guards",
    "many",
    "recovery",
    "repairs",
    "idle",
    "kept",
    "least_tension",
    "stiffenings",
)

_SHARES = (
    "stiffness",
    "good",
    "poor",
    "near",
    "margin",
    "least_margin",
    "least_tension",
    "recovery",
    "kept",
    "allowance",
    "idle",
    "softer",
)

# A polished design serves the shape alone and is near: smaller windows, and of the stiffness kept before it
# may use up a fifth.
POLISHING = SequentialConvex(thin=False, stiffness=0.8, smallest=0.003)
