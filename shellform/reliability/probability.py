"""How likely a design stands, from a count of drawn structures.

With s of n drawn structures standing, the probability of standing is at least

    p = Beta⁻¹(1 - c; s, n - s + 1),   0 for s = 0,

with confidence c, whatever it is (Clopper and Pearson 1934, one-sided): the largest p under which so many or
more standing would come about with a chance of at most 1 - c.
"""

from __future__ import annotations

from dataclasses import dataclass

from scipy.special import betaincinv  # scipy.stats would take a seventh of every start to load

from shellform.errors import InputError, require_number

CONFIDENCE = 0.95  # with which bounds of a share are told, where no other is asked for


@dataclass(frozen=True)
class Standing:
    """`standing` of `drawn` structures under `seed` stand: the probability is `at_least` and `at_most` so
    much, each with the `confidence`."""

    drawn: int
    standing: int
    at_least: float
    at_most: float
    confidence: float
    seed: int


def counted(drawn: int, standing: int, *, seed: int, confidence: float = CONFIDENCE) -> Standing:
    """The bounds. Raises InputError for impossible counts."""
    if not 0 <= standing <= drawn or drawn < 1:
        raise InputError(
            "more stand than were drawn, or none was",
            where="drawn",
            value=(drawn, standing),
            remedy="Give how many were drawn, then how many of them stand.",
        )
    give = "a share, such as 0.95"
    require_number(confidence, above=0.0, below=1.0, where="confidence", give=give, share=True)
    least = 0.0 if standing == 0 else float(betaincinv(standing, drawn - standing + 1, 1.0 - confidence))
    most = 1.0 if standing == drawn else float(betaincinv(standing + 1, drawn - standing, confidence))
    return Standing(drawn, standing, least, most, confidence, seed)
