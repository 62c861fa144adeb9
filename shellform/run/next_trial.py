"""What a trial of `shellform new` fails by, and what it tries next: which section, which edge beams, how much
concrete."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TypeVar

from shellform.gridshell.layers import layers_of
from shellform.net.net import Net
from shellform.run.first_trial import NEEDED, PULLED, STRESSED, FirstParts, Followed
from shellform.run.sizes import (
    CURVED,
    MOST_CROSSINGS,
    Placed,
    RodChoice,
    bent_to,
    load_borne,
    next_choice,
    next_spare,
    next_thinner,
    whole_mm,
)
from shellform.run.unbuildable import Obstacle, Why

EASES = 1.4  # times the load that heavier edge beams have to let it bear, or the stress that they have to spare it
_THINNED = 8  # trials with less concrete
# of drawn structures; of a shell of which fewer stand two thirds of the concrete are tried, not four fifths
_FEW, _FEW_STAND = 0.2, 0.65
_MOST_STAND = 0.5  # of drawn structures: with a little less concrete all do, which is worth going on for
_TOO_THIN = 0.3  # of the least layer: nobody pours so little
AIMED = 0.92  # of what rods may be stressed to, for which concrete is thinned
_NEAR = 0.8  # of what is needed: where a design falls above it, stronger edge beams may help
_EASED = 5  # times that cables are eased, by less prestrain or thicker strands
_STRONGER = 3  # times that strands are made stronger for rods that break
_FALLS = (Why.STABILITY, Why.SCATTER)
_HOPEFUL = 0.5  # of what is needed, that rods bear if it grows as their stiffness does
_SPARED = 0.95  # of the stress before, at the most, for which cables are made slacker once more
Stands = TypeVar("Stands")


def fails_by(tried: Followed) -> Why | None:
    """What a design fails by; None where it doesn't."""
    if tried.factor < NEEDED:  # what breaks before any load has no stability to speak of
        return Why.STRENGTH if tried.factor == 0.0 and tried.stress > 1.0 else Why.STABILITY
    if max(tried.stress, tried.edge) > STRESSED:
        return Why.STRENGTH if tried.stress > STRESSED else Why.EDGES
    return Why.CABLES if tried.pull > 1.0 else None


def relieved(parts: FirstParts, follow: Callable[[FirstParts], Followed]) -> tuple[FirstParts, Followed]:
    """The parts with cables below their limit, by less prestrain or thicker strands, and what they come to
    when they are followed."""
    tried = follow(parts)
    for turn in range(_EASED):
        easier = parts.easier(tried, PULLED if turn == 0 else STRESSED)
        if easier is None:
            break
        before = parts, tried
        parts, tried = easier, follow(easier)
        fell = tried.factor < NEEDED  # joints that turn and slacker cables stiffen less
        if fell or tried.stress > max(STRESSED, _SPARED * before[1].stress):
            if fell or tried.stress > before[1].stress:
                parts, tried = before
            break
    for _ in range(_STRONGER):
        stronger = parts.stronger(tried)
        if stronger is None:
            break
        held = follow(stronger)
        if held.factor < NEEDED or held.stress >= tried.stress:
            break
        parts, tried = stronger, held
    return parts, tried


def edges_may_help(failure: Obstacle, far: float) -> bool:
    """Whether stronger edge beams may: where they give way, where a shell that nearly bears its load falls,
    or where they sag by more than `far`, m, beside rods that break."""
    if failure.why in (Why.EDGES, Why.CABLES):  # cables are pulled where edges move
        return True
    if failure.why is Why.STRENGTH:
        return failure.factor >= NEEDED and failure.sag > far
    return failure.why in _FALLS and failure.nearness(NEEDED) >= _NEAR * NEEDED


def finer_is_vain(nearest: Obstacle, area: float, spacing: float, finer: float) -> bool:
    """Whether on a surface of so much `area`, m², a `finer` spacing, m, than one that failed is too fine to
    solve, or far too little help, by what came `nearest`."""
    if nearest.spacing > spacing:  # a coarser net
        return True
    if area / finer**2 > (CURVED if nearest.why is Why.NET else MOST_CROSSINGS):
        return True
    breaks_at_once = nearest.why is Why.STRENGTH and nearest.factor == 0.0
    falls = nearest.why is Why.STABILITY or breaks_at_once
    return falls and nearest.factor * (spacing / finer) ** 2 < 0.5 * NEEDED


def next_section(net: Net, possible: Sequence[RodChoice], at: int, failure: Obstacle) -> int:
    """The section to try after the one that failed."""
    times = 0.0 if failure.why is Why.STRENGTH else stiffer_times(failure)
    return next_choice(net, possible, at, failure.stress, times, STRESSED)


def stiffer_times(failure: Obstacle) -> float:
    """How many times as stiff rods have to be that don't fall so."""
    return max(1.3, (1.1 * NEEDED / max(failure.nearness(NEEDED), 0.1)) ** 1.3)


def after(
    net: Net, possible: Sequence[RodChoice], tried: Mapping[int, Obstacle], *, bent: float = 0.0
) -> int:
    """The section to try after the last of those `tried`; one of them where there is none.

    What is less stiff than a section that fell would fall too. So where what a failure asks for was tried
    before, or fell, and rods broke under the load, it is one between those: stiffer than all that fell, and
    less deep than what broke least, by what its stress asks for, or by half the way there.

    What a shell is stressed to that lies on the ground says nothing of one that stands. So where that leaves
    none, it is one as much stiffer as the fall asks for, if bending takes no more than a share `bent` of its
    strength, or else the stiffest of such; with 0, where more layers come, none.
    """
    found, (at, failure) = _after(net, possible, tried), list(tried.items())[-1]
    if found not in tried or not bent or failure.why is not Why.STABILITY:
        return found
    return next_spare(net, possible, at, stiffer_times(failure), bent)


def _after(net: Net, possible: Sequence[RodChoice], tried: Mapping[int, Obstacle]) -> int:
    """By what the sections are likely to be stressed to."""
    at, failure = list(tried.items())[-1]
    found = next_section(net, possible, at, failure)
    fallen, least = _stiffest_fallen(tried), _least_broken(tried)
    if least is None or (found not in tried and found > fallen):
        return found
    thinner = possible.index(thinner_rods(possible, possible[least], to_bear(tried[least])))
    if failure.why is Why.STRENGTH and thinner > fallen and _may_stand(possible, tried, thinner):
        return thinner
    between = _between(possible, tried)
    return between[len(between) // 2] if between else at


def more_come(choice: RodChoice, layers: Sequence[int]) -> bool:
    """Whether rods in more of the `layers` are tried after this choice's."""
    return layers_of(choice.section) < layers[-1]


def narrowed(possible: Sequence[RodChoice], tried: Mapping[int, Obstacle]) -> bool:
    """Whether less stiff sections of those `tried` fell and deeper ones broke, and others lie between: one of
    these is likelier to stand than any on a finer net."""
    return _stiffest_fallen(tried) >= 0 and bool(_between(possible, tried))


def _between(possible: Sequence[RodChoice], tried: Mapping[int, Obstacle]) -> list[int]:
    """The sections stiffer than all that fell and less deep than what broke least; none where none broke, nor
    any that is sure to fall."""
    least = _least_broken(tried)
    if least is None:
        return []
    deep = bent_to(possible[least])
    stiffer = range(_stiffest_fallen(tried) + 1, least)
    untried = [k for k in stiffer if k not in tried and bent_to(possible[k]) < deep]
    return [k for k in untried if _may_stand(possible, tried, k)]


def _may_stand(possible: Sequence[RodChoice], tried: Mapping[int, Obstacle], at: int) -> bool:
    """Whether a section may that is stiffer than all that fell: not where it is hardly stiffer than what bore
    next to nothing."""
    fallen = _stiffest_fallen(tried)
    if fallen < 0:
        return True
    times = possible[at].bending / possible[fallen].bending
    return times * tried[fallen].nearness(NEEDED) >= _HOPEFUL * NEEDED


def _stiffest_fallen(tried: Mapping[int, Obstacle]) -> int:
    """-1 where none fell."""
    return max((k for k, each in tried.items() if each.why in _FALLS), default=-1)


def _least_broken(tried: Mapping[int, Obstacle]) -> int | None:
    """The section stressed least of those that broke, by which others are judged: stiffer ones only bend
    harder."""
    broken = [k for k, each in tried.items() if each.why is Why.STRENGTH]
    return min(broken, key=lambda each: tried[each].stress, default=None)


def to_bear(failure: Obstacle) -> float:
    """Which share of the stress that broke rods they may have."""
    return AIMED * STRESSED / failure.stress


def stiffer_rods(
    net: Net, possible: Sequence[RodChoice], choice: RodChoice, stress: float, times: float
) -> RodChoice | None:
    """Of the `possible` sections the least stiff that is at least so many `times` as stiff as the `choice`
    and is likely to be stressed no more than it may be, else the stiffest such one; None where that is no
    stiffer. `stress` is that of the choice over its strength."""
    rising = sorted(possible, key=lambda each: each.bending)
    if choice not in rising:  # its net was pulled anew, and bends rods a little more
        return None
    at = rising.index(choice)
    found = next_choice(net, rising, at, stress, times, STRESSED)
    return rising[found] if found > at else None


def thinner_rods(possible: Sequence[RodChoice], choice: RodChoice, share: float) -> RodChoice:
    """Of the `possible` sections, by rising stiffness, the stiffest that is so much less deep than the
    `choice`, for its material, that bending stresses it no more than a `share` as much; the `choice` itself
    where there is none."""
    if choice not in possible:
        return choice
    return possible[next_thinner(possible, possible.index(choice), share)]


def bears_most(failures: Sequence[Obstacle], nearest: Obstacle) -> Obstacle:
    """Of the failures with the spacing and the thickness of the `nearest` the one whose rods are likely to
    bear most concrete: of those that fall the share of the load up to which they stand, of those that break
    what their strength leaves, or that of their edge beams and cables. `nearest` where none bears any.

    Rods that break least aren't always these: deep ones have spent their strength when they are bent."""

    def borne(failure: Obstacle) -> float:
        if failure.choice is None or failure.placed is None:
            return 0.0
        if failure.why is not Why.STRENGTH:
            return failure.bore(NEEDED)
        share = failure.nearness(NEEDED) / NEEDED
        return min(share, load_borne(failure.placed.net, failure.choice, failure.stress, AIMED))

    alike = [
        each for each in failures if each.spacing == nearest.spacing and each.thickness == nearest.thickness
    ]
    return max([nearest, *alike], key=borne)


def thinned(
    failure: Obstacle,
    nearest: Obstacle,
    possible: Sequence[RodChoice],
    least: float,
    stands: Callable[[Placed, RodChoice, float, float], Stands | Obstacle],
    over: Callable[[], bool],
    tried: Iterable[RodChoice] = (),
) -> tuple[Obstacle, Stands | None]:
    """What stands with the most concrete where the `failure` has shown that its rods don't bear theirs, if
    anything does, and what came nearest to the thickness asked for: the `nearest` until now, or rods that
    bending breaks less.

    Rods that break give way to others of the `possible` that break less; once these are known the concrete is
    thinned for those that bear most, to about what the last trial says that they bear. Rods that would break
    without any concrete give way to less deep ones under as much as before. `stands` tries a net, rods, a
    spacing and a thickness, m; `least`, m, is the thinnest layer that is poured; nothing is tried once it is
    `over`, unless most structures stood in the last trial, nor with as much concrete as the failure's those
    that were `tried` with it before.
    """
    assert failure.choice is not None
    rods, thickness = failure.choice, failure.thickness
    seen, less_deep = {rods, *tried}, None
    for _ in range(_THINNED):
        if failure.factor == 0.0:  # without any concrete it doesn't stand
            break
        if over() and not (failure.why is Why.SCATTER and failure.stood >= _MOST_STAND):
            break
        assert failure.placed is not None
        other = less_deep or rods
        if less_deep is None and failure.why is Why.STRENGTH and rods in possible:
            other = possible[next_section(failure.placed.net, possible, possible.index(rods), failure)]
        if other in seen:
            thickness, other = whole_mm(_borne(failure, rods) * thickness), rods
        seen.add(other)
        if thickness < _TOO_THIN * least:
            break
        result = stands(failure.placed, other, failure.spacing, thickness)
        if not isinstance(result, Obstacle):
            return nearest, result
        if result.why is Why.NET:
            break
        if other != rods and less_deep is None and result.factor < failure.factor:
            continue  # they break less, and fall instead
        before, failure, rods, less_deep = failure, result, other, None
        if failure.breaks_unloaded(before, STRESSED):
            nearest, thickness = failure, before.thickness
            less_deep = thinner_rods(possible, rods, to_bear(failure))
            if less_deep in seen or thickness < least:
                break
    return nearest, None


def _borne(failure: Obstacle, rods: RodChoice) -> float:
    """About what share of its concrete the shell bears that failed so."""
    if failure.why is not Why.STRENGTH:
        most = _FEW_STAND if failure.why is Why.SCATTER and failure.stood < _FEW else 0.8
        return min(most, 0.95 * failure.nearness(NEEDED) / NEEDED)
    assert failure.placed is not None
    return min(max(load_borne(failure.placed.net, rods, failure.stress, AIMED), 0.5), 0.9)
