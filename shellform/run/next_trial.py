"""What a trial of `shellform new` fails by, and what it tries next: which section, and which edge beams."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from shellform.net.net import Net
from shellform.run.first_trial import NEEDED, STRESSED, Followed
from shellform.run.sizes import RodChoice, load_borne, next_choice, next_thinner
from shellform.run.unbuildable import Obstacle, Why

EASES = 1.4  # times the load that heavier edge beams have to let it bear, or the stress that they have to spare it
AIMED = 0.92  # of what rods may be stressed to, for which concrete is thinned
_NEAR = 0.8  # of what is needed: where a design falls above it, stronger edge beams may help


def fails_by(tried: Followed) -> Why | None:
    """What a design fails by; None where it doesn't."""
    if tried.factor < NEEDED:  # what breaks before any load has no stability to speak of
        return Why.STRENGTH if tried.factor == 0.0 and tried.stress > 1.0 else Why.STABILITY
    if max(tried.stress, tried.edge) > STRESSED:
        return Why.STRENGTH if tried.stress > STRESSED else Why.EDGES
    return Why.CABLES if tried.pull > 1.0 else None


def edges_may_help(failure: Obstacle) -> bool:
    """Whether stronger edge beams may."""
    falls = failure.why in (Why.STABILITY, Why.SCATTER)
    return failure.why is Why.EDGES or (falls and failure.nearness(NEEDED) >= _NEAR * NEEDED)


def next_section(net: Net, possible: Sequence[RodChoice], at: int, failure: Obstacle) -> int:
    """The section to try after the one that failed."""
    times = 0.0
    if failure.why is not Why.STRENGTH:
        times = max(1.3, (1.1 * NEEDED / max(failure.nearness(NEEDED), 0.1)) ** 1.3)
    return next_choice(net, possible, at, failure.stress, times, STRESSED)


def after(net: Net, possible: Sequence[RodChoice], tried: Mapping[int, Obstacle]) -> int:
    """The section to try after the last of those `tried`; one of them where there is none."""
    at, failure = list(tried.items())[-1]
    found = next_section(net, possible, at, failure)
    if found in tried and failure.why is Why.STRENGTH:  # stiffer ones only bend harder
        least = min(tried, key=lambda each: tried[each].stress)
        return possible.index(thinner_rods(possible, possible[least], tried[least]))
    return found


def thinner_rods(possible: Sequence[RodChoice], choice: RodChoice, failure: Obstacle) -> RodChoice:
    """Of the `possible` sections the stiffest that is so much less deep than the `choice` that bending stresses it no more
    than it may be; the `choice` itself where there is none."""
    if choice not in possible:
        return choice
    share = AIMED * STRESSED / failure.stress
    return possible[next_thinner(possible, possible.index(choice), share)]


def bears_most(failures: Sequence[Obstacle], nearest: Obstacle) -> Obstacle:
    """Of the failures with the spacing and the thickness of the `nearest` the one whose rods are likely to bear most
    concrete: of those that fall the share of the load up to which they stand, of those that break what their strength
    leaves, or that of their edge beams and cables. `nearest` where none bears any.

    Rods that break least aren't always these: deep ones have spent their strength when they are bent."""

    def borne(failure: Obstacle) -> float:
        if failure.choice is None or failure.placed is None:
            return 0.0
        share = failure.nearness(NEEDED) / NEEDED
        if failure.why in (Why.EDGES, Why.CABLES):
            return share / failure.stress
        if failure.why is not Why.STRENGTH:
            return share
        return min(share, load_borne(failure.placed.net, failure.choice, failure.stress, AIMED))

    alike = [
        each for each in failures if each.spacing == nearest.spacing and each.thickness == nearest.thickness
    ]
    return max([nearest, *alike], key=borne)
