"""What the optimiser's constraints come to, told as users gave their limits.

Residuals are what a search steps by: misfits count by their squares, a softness is 1 - (stiffness / least)²,
a slackness 1 - pull / least, and an uplift is offset, so that its share tells nothing.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from shellform.problem.problem import FEASIBLE

AT_LEAST = ("softness", "slackness")  # of which as much is demanded, not at most
_SQUARED = ("misfit", "built_misfit")  # sums of squares of what users limit as a root mean square


def share_of_limit(name: str, residual: float) -> float | None:
    """What was found over its limit, of a constraint of this name, such as "misfit.additional"; None where
    the residual doesn't tell."""
    kind = name.partition(".")[0]
    if kind == "uplift":
        return None
    if kind == "softness":
        return math.sqrt(max(1.0 - residual, 0.0))
    if kind in AT_LEAST:
        return max(1.0 - residual, 0.0)  # what hangs slack pulls with nothing
    return math.sqrt(max(1.0 + residual, 0.0)) if kind in _SQUARED else 1.0 + residual


def not_kept(constraints: Mapping[str, float]) -> list[str]:
    """The constraints, residuals by name, that aren't kept, each with its share of the limit where that is
    known."""
    shares = {name: share_of_limit(name, value) for name, value in constraints.items() if value > FEASIBLE}
    return [name if share is None else f"{name} at {share:.1%} of it" for name, share in shares.items()]
