"""What is asked of designs, found from what a design shows when its structures are tried: of all that come
after the one that a search starts from, and of the structures that fall in one, which of them are to bear
what.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

from shellform.arrays import Reals
from shellform.gridshell.gridshell import Design, Gridshell
from shellform.reliability.drawing import PERFECT
from shellform.reliability.requirements import (
    FRESH,
    MOST,
    SEED,
    Demand,
    Required,
    critical_wanted,
    largest_on_path,
    may_fall,
)
from shellform.reliability.resting import Resting
from shellform.reliability.safety import Safety
from shellform.reliability.trial_structures import JudgedTrial, Judging, try_structures

_BESIDE = 3  # structures that are to stand beside as many as have to: what is aimed for isn't met by all


def demand(
    shell: Gridshell,
    start: Design,
    loads: Mapping[str, Reals],
    safety: Safety,
    *,
    design_load: str = "design",
    judging: Judging | None = None,
) -> Demand:
    """What is asked of designs that come after `start`, in trials and of fresh samples.

    Errors are enlarged in trials as far as is asked for, or half as much, or not at all: the first with which
    the start bears the design load, for few structures at the edge of falling can't tell one design from
    another. Where they are enlarged less, more structures make up for it: a search that tries hundreds of
    designs on a dozen finds one for that dozen. The fresh sample is as large as the one that judges a
    finished design: of what forty confirmed, three of two hundred fell. Where as many may fall as of the
    start, that judge's structures are counted: another sample has up to a tenth more of them. Raises
    NotConverged where the start has no unloaded equilibrium."""
    trial, many = None, max(MOST, safety.tried)
    for factor, tries in ((safety.enlarged, safety.tried), (0.5 * (1.0 + safety.enlarged), many)):
        own = replace(safety, enlarged=factor, tried=tries)
        most = {name: own.tried for name, load in loads.items() if load.any()}
        most[design_load] = may_fall(own, design_load, design_load)
        asked = Required(own, {name: loads[name] for name in most}, design_load, most)
        bears = try_structures(shell, start, asked, critical=False, judging=judging)
        if bears.stands:
            trial = _shown(asked, bears)
            break
    if trial is None:
        own = replace(safety, enlarged=1.0, tried=many)
        trial = required(shell, start, loads, own, design_load=design_load, judging=judging)
    trusted = trial.safety.enlarged == safety.enlarged > 1.0
    fresh = replace(safety, enlarged=1.0, tried=safety.drawn)
    if any(trial.fallen[name] > may_fall(trial.safety, name, design_load) for name in trial.fallen):
        judged = replace(fresh, seed=fresh.seed - SEED)
        shown = required(shell, start, loads, judged, design_load=design_load, judging=judging)
        return Demand(trial, replace(shown, safety=fresh, first=FRESH), trusted)
    known = {name: may_fall(fresh, name, design_load) for name in trial.fallen}
    return Demand(trial, Required(fresh, trial.loads, design_load, known, FRESH), trusted)


def required(
    shell: Gridshell,
    start: Design,
    loads: Mapping[str, Reals],
    safety: Safety,
    *,
    design_load: str = "design",
    judging: Judging | None = None,
) -> Required:
    """What is asked of designs that come after `start`: under the design load what the probability says for
    enlarged errors, or what `start` shows where that is less, for the search would have nowhere to begin;
    under other loads likewise, by `Safety.required`. Raises NotConverged where it has no unloaded
    equilibrium."""
    own = {name: load for name, load in loads.items() if load.any()}
    every = Required(safety, own, design_load, {name: safety.tried for name in own})
    return _shown(every, try_structures(shell, start, every, critical=False, judging=judging))


def _shown(asked: Required, shown: JudgedTrial) -> Required:
    """The same with as many fallen as the probability allows or the start has `shown`."""
    safety, fallen = asked.safety, {}
    for name in asked.loads:
        known = may_fall(safety, name, asked.design_load)
        bound = safety.probability_additional is None or name == asked.design_load
        fallen[name] = max(known, len(shown.fallen[name])) if bound else known
    return replace(asked, fallen=fallen)


def to_bear(
    shell: Gridshell,
    design: Design,
    asked: Required,
    *,
    first: Sequence[int] = (),
    judging: Judging | None = None,
    before: Mapping[str, Resting] | None = None,
) -> dict[int, float]:
    """The numbers of structures that fall under loads on the design load's path where more do than may, and
    the factors of the largest one that they were to bear; of the perfect one, if it doesn't keep its critical
    factor, under PERFECT. `before`: where structures rested in an earlier design. Raises NotConverged where
    the design has no unloaded equilibrium."""
    found = try_structures(shell, design, asked, first=first, whole=True, judging=judging, before=before)
    _, shares = largest_on_path(asked)
    return _aims(
        asked, found, {name: found.fallen[name] for name in sorted(shares, key=lambda each: -shares[each])}
    )


def aims(asked: Required, found: JudgedTrial) -> dict[int, float]:
    """As `to_bear`, from a whole sample that was judged already, at the end of a search: of the structures
    that fall those that bear most, as many as have to stand and a few more, under the smaller load first.
    (Before thinning `to_bear` names all of them: thinning spends the reserve that this gives.)"""
    _, shares = largest_on_path(asked)
    names = sorted(shares, key=lambda each: shares[each])
    return _aims(asked, found, {name: _nearest(found, name, asked.fallen[name]) for name in names})


def _nearest(found: JudgedTrial, name: str, allowed: int) -> tuple[int, ...]:
    """Of the structures that fall under the load `name` those that bear most of it, as many as have to stand
    and a few more, from the one that bears least on."""
    fell = sorted(found.fallen[name], key=lambda number: found.factors.get(number, 0.0))
    return tuple(fell[max(0, allowed - _BESIDE) :])


def _aims(asked: Required, found: JudgedTrial, named: Mapping[str, Collection[int]]) -> dict[int, float]:
    """The perfect structure's, and those of the numbers `named` under each load where more fall than may; one
    that is under several keeps the first."""
    _, shares = largest_on_path(asked)
    least: dict[int, float] = {}
    if not found.critical:
        least[PERFECT] = critical_wanted(asked, shares)
    for name, numbers in named.items():
        if len(found.fallen[name]) > asked.fallen[name]:
            for number in numbers:
                least.setdefault(number, shares[name])
    return least
