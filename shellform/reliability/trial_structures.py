"""The judge within a search: few drawn structures, the same for every design, that say much.

They are drawn with all deviations enlarged. If the load that structures bear scatters normally about a mean
above the one asked for, enlarging by e divides that distance, counted in deviations, by e: with P the normal
distribution, a share p becomes P(P⁻¹(p) / e), so that what one in a hundred does with errors as they are one
in sixteen does with half as much again. (Larger errors also lower the mean, which errs on the safe side.) A
dozen structures then refuse what else a hundred would be needed for. The same numbers are drawn for every
design (common random numbers), those that fell before first, and no more than it takes to refuse.

A structure counts as standing where it rests under the load beside the perfect one, be it on a path from
nothing or not (path_of_one.py); a finished design's are loaded from nothing.

The perfect structure's critical factor is asked for beside them, with an allowance for the mesh.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import ndtr, ndtri

from shellform.arrays import Reals, Record
from shellform.errors import NotConverged
from shellform.gridshell.gridshell import Design, Gridshell
from shellform.gridshell.tolerances import Tolerances, enlarged
from shellform.reliability.drawing import PERFECT, draw_errors
from shellform.reliability.perfect import TO_ITS_END, Perfect, perfect
from shellform.reliability.safety import Safety, allowed, critical_on_halved, paths
from shellform.reliability.standing import Workshop
from shellform.structure.elements.threads import in_turn

SEED = 2  # added to the safety's: a search doesn't see the structures that a finished design is judged by
FRESH = 100_000  # the number from which on structures are of fresh samples, whose errors are as they are
MOST = 40  # structures by which a search tries designs without enlarged errors
Judging = Callable[[int, int], None]
"""Called while a design is judged, with how many structures were loaded and how many there are at the
most."""

_AT_ONCE = 4  # structures between two looks at how many have fallen
_RESOLUTION = 1 / 32  # of the largest load, to which it is known where a structure falls
_MESH = 1.01  # over the critical factor asked for: what elements of usual length tell too much, twice over
_BESIDE = 3  # structures that are to stand beside as many as have to: what is aimed for isn't met by all
_SPARE = 1  # of the structures that may fall, none of a fresh sample: what thinning ends with is at the edge of falling
_SAME = 1e-9  # relative


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
    - `spare`: whether fewer may fall in a fresh sample than of a finished design's, for what was chosen among
      many is at the edge of falling.
    """

    trial: Required
    confirmed: Required | None
    trusted: bool = True
    spare: bool = True

    def sample(self, number: int) -> Required:
        """What is required of the fresh sample of this number."""
        fresh = self.confirmed
        assert fresh is not None
        fresh = replace(fresh, first=fresh.first + number * fresh.safety.tried)
        return _sparing(fresh) if self.spare else fresh

    def unspared(self) -> Demand:
        """The same where as many may fall in fresh samples as where a finished design is judged."""
        return replace(self, spare=False)

    def after(self, samples: int) -> Demand:
        """The same for a search that comes after one that drew so many fresh samples."""
        fresh = self.confirmed
        if fresh is None:
            return self
        return replace(self, confirmed=replace(fresh, first=fresh.first + samples * fresh.safety.tried))


@dataclass(frozen=True)
class JudgedTrial:
    """Numbers of the structures that have `fallen` under each load as far as it took to say whether the
    design `stands`, whether the perfect one keeps its `critical` factor, the `factorisations` spent, and the
    `factors` of the largest load on the design load's path that structures bear."""

    fallen: Mapping[str, tuple[int, ...]]
    critical: bool
    stands: bool
    factorisations: int
    factors: Mapping[int, float] = field(default_factory=dict)


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
        most[design_load] = _known(own, design_load, design_load)
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
    if any(trial.fallen[name] > _known(trial.safety, name, design_load) for name in trial.fallen):
        judged = replace(fresh, seed=fresh.seed - SEED)
        shown = required(shell, start, loads, judged, design_load=design_load, judging=judging)
        return Demand(trial, replace(shown, safety=fresh, first=FRESH), trusted)
    known = {name: _known(fresh, name, design_load) for name in trial.fallen}
    return Demand(trial, Required(fresh, trial.loads, design_load, known, FRESH), trusted)


def closer(asked: Demand) -> Demand:
    """The same with as many structures in a trial as confirm a result: what is led by those that fall comes
    to know the ones by which it is judged."""
    trial, own = asked.trial, replace(asked.trial.safety, tried=max(MOST, asked.trial.safety.tried))
    share = own.tried / trial.safety.tried
    fallen = {name: _known(own, name, trial.design_load) for name in trial.fallen}
    for name, count in trial.fallen.items():
        if name != trial.design_load and own.probability_additional is None:
            fallen[name] = max(fallen[name], int(share * count))  # as many as of the start
    return replace(asked, trial=replace(trial, safety=own, fallen=fallen))


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
        known = _known(safety, name, asked.design_load)
        bound = safety.probability_additional is None or name == asked.design_load
        fallen[name] = max(known, len(shown.fallen[name])) if bound else known
    return replace(asked, fallen=fallen)


def try_structures(
    shell: Gridshell,
    design: Design,
    asked: Required,
    *,
    first: Sequence[int] = (),
    critical: bool = True,
    whole: bool = False,
    judging: Judging | None = None,
) -> JudgedTrial:
    """The design judged by the search's structures, the numbers `first` before the others, and no more of
    them than it takes to refuse it but where the `whole` sample is asked for. Those of `first` that are of
    other samples, where they fell under the design load, have to stand under it and count under no other.
    Raises NotConverged where it has no unloaded equilibrium."""
    safety, spent = asked.safety, 0
    fallen: dict[str, list[int]] = {name: [] for name in asked.loads}
    factors: dict[int, float] = {}
    order = [*first, *(number for number in asked.numbers if number not in set(first))]
    kept = True
    for largest, shares in paths(asked.loads).items():
        nominal = perfect(shell, design, asked.loads[largest], step=TO_ITS_END, heeding=False)
        workshop = Workshop(nominal)
        wanted = _critical(asked, shares) if critical else 0.0

        def one(
            number: int,
            nominal: Perfect = nominal,
            workshop: Workshop = workshop,
            wanted: float = wanted,
            shares: Mapping[str, float] = shares,
        ) -> tuple[float, int]:
            """The share of the largest load that a structure bears."""
            errors = draw_errors(nominal.members, asked.tolerances(number), safety.seed + SEED, number)
            marks = tuple(shares.values())
            if number == PERFECT:  # whose path is known so far
                begin = nominal.known_to(wanted)
                found = workshop.limit(
                    errors,
                    most=wanted,
                    resolution=_RESOLUTION,
                    tell=False,
                    begin=begin,
                    marks=marks,
                    heeding=False,  # a fifth of a trial; the design to build is judged heeding
                )
            else:
                found = workshop.rests(errors, resolution=_RESOLUTION, marks=marks)
            return found.factor, found.factorisations

        judged = order if asked.design_load in shares else [each for each in order if each in asked.numbers]
        queue = [PERFECT, *judged] if wanted > 0.0 else judged
        with closing(in_turn(one, queue)) as results:
            for begin in range(0, len(queue), _AT_ONCE):
                numbers = queue[begin : begin + _AT_ONCE]
                for number in numbers:
                    factor, work = next(results)
                    spent += work
                    if number == PERFECT:
                        kept = factor >= wanted * (1.0 - _SAME)
                        continue
                    if asked.design_load in shares:
                        factors[number] = factor
                    for name, share in shares.items():
                        counts = number in asked.numbers or name == asked.design_load
                        if counts and factor < share * (1.0 - _SAME):
                            fallen[name].append(number)
                if judging is not None:
                    judging(begin + len(numbers), len(queue))
                refused = not kept or any(len(fallen[name]) > asked.fallen[name] for name in shares)
                if refused and not whole:
                    return JudgedTrial(_numbers(fallen), kept, False, spent, factors)
    enough = all(len(own) <= asked.fallen[name] for name, own in fallen.items())
    return JudgedTrial(_numbers(fallen), kept, kept and enough, spent, factors)


def _numbers(fallen: Mapping[str, list[int]]) -> dict[str, tuple[int, ...]]:
    return {name: tuple(own) for name, own in fallen.items()}


def largest_on_path(asked: Required) -> tuple[str, dict[str, float]]:
    """The largest load on the design load's path, and the shares of it that lie on that path: the structures
    are loaded with it, and their imperfections follow the softest modes under it."""
    return next(
        (largest, shares) for largest, shares in paths(asked.loads).items() if asked.design_load in shares
    )


def to_bear(
    shell: Gridshell,
    design: Design,
    asked: Required,
    *,
    first: Sequence[int] = (),
    judging: Judging | None = None,
) -> dict[int, float]:
    """The numbers of structures that fall under loads on the design load's path where more do than may, and
    the factors of the largest one that they were to bear; of the perfect one, if it doesn't keep its critical
    factor, under PERFECT. Raises NotConverged where the design has no unloaded equilibrium."""
    found = try_structures(shell, design, asked, first=first, whole=True, judging=judging)
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
        least[PERFECT] = _critical(asked, shares)
    for name, numbers in named.items():
        if len(found.fallen[name]) > asked.fallen[name]:
            for number in numbers:
                least.setdefault(number, shares[name])
    return least


def _critical(asked: Required, shares: Mapping[str, float]) -> float:
    """What the perfect structure is to bear of a path's largest load; 0 where nothing is asked for on it."""
    if asked.safety.critical_factor is None or asked.design_load not in shares:
        return 0.0
    return _MESH * asked.safety.critical_factor * shares[asked.design_load]


def judge_trial(
    shell: Gridshell,
    design: Design,
    asked: Required,
    *,
    first: Sequence[int] = (),
    whole: bool = False,
    judging: Judging | None = None,
) -> JudgedTrial:
    """As `try_structures`; a design without unloaded equilibrium doesn't stand."""
    try:
        return try_structures(shell, design, asked, first=first, whole=whole, judging=judging)
    except NotConverged as error:
        return JudgedTrial({name: () for name in asked.loads}, False, False, error.iterations)


def confirm(
    shell: Gridshell,
    design: Design,
    asked: Required,
    *,
    first: Sequence[int] = (),
    whole: bool = False,
    judging: Judging | None = None,
) -> JudgedTrial:
    """As `judge_trial`, and with the critical factor kept on the mesh with rod elements halved."""
    found = judge_trial(shell, design, asked, first=first, whole=whole, judging=judging)
    factor = asked.safety.critical_factor
    if not found.stands or factor is None:
        return found
    end = critical_on_halved(shell, design, asked.loads[asked.design_load], factor)
    kept = end.factor >= factor * (1.0 - _SAME)
    return replace(
        found, critical=kept, stands=kept, factorisations=found.factorisations + end.factorisations
    )


def _sparing(asked: Required) -> Required:
    """The same with one less that may fall than the probability allows. Where under a further load as many
    may fall as of the start, fewer by a standard deviation of the difference of two such numbers."""
    fallen = {}
    for name, count in asked.fallen.items():
        known = _known(asked.safety, name, asked.design_load)
        chance = np.sqrt(2.0 * count * (1.0 - count / asked.safety.tried))
        if count <= known:
            fallen[name] = max(count - _SPARE, 0)
        else:
            fallen[name] = count if name == asked.design_load else max(int(count - chance), known)
    return replace(asked, fallen=fallen)


def _known(safety: Safety, name: str, design_load: str) -> int:
    """How many of the structures tried may fall under a load by the probability that is asked for."""
    wanted = safety.required(name, design_load, None)
    return allowed(float(ndtr(ndtri(wanted) / safety.enlarged)), safety.tried)
