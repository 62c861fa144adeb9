"""The judge within a search: few drawn structures, the same for every design, that say much.

They are drawn with all deviations enlarged (requirements.py). The same numbers are drawn for every design
(common random numbers), those that fell before first, and no more than it takes to refuse.

A structure counts as standing where it rests under the load beside the perfect one, or next to where it
rested in an earlier design (resting.py), be it on a path from nothing or not (path_of_one.py); a finished
design's are loaded from nothing.

The perfect structure's critical factor is asked for beside them, with an allowance for the mesh.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace

from shellform.arrays import Record
from shellform.errors import NotConverged
from shellform.gridshell.gridshell import Design, Gridshell
from shellform.reliability.drawing import PERFECT, draw_errors
from shellform.reliability.path_of_one import Limit
from shellform.reliability.perfect import TO_ITS_END, Perfect, perfect
from shellform.reliability.requirements import SEED, Required, critical_wanted
from shellform.reliability.resting import Resting
from shellform.reliability.safety import SAME, critical_on_halved, paths
from shellform.reliability.standing import Workshop
from shellform.structure.elements.threads import in_turn

Judging = Callable[[int, int], None]
"""Called while a design is judged, with how many structures were loaded and how many there are at the
most."""

_AT_ONCE = 4  # structures between two looks at how many have fallen
_RESOLUTION = 1 / 32  # of the largest load, to which it is known where a structure falls


@dataclass(frozen=True, eq=False)
class JudgedTrial(Record):
    """Numbers of the structures that have `fallen` under each load as far as it took to say whether the
    design `stands`, whether the perfect one keeps its `critical` factor, the `factorisations` spent, and the
    `factors` of the largest load on the design load's path that structures bear. Where structures `rested`
    under each path's largest load, if an earlier design's were given."""

    fallen: Mapping[str, tuple[int, ...]]
    critical: bool
    stands: bool
    factorisations: int
    factors: Mapping[int, float] = field(default_factory=dict)
    rested: Mapping[str, Resting] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class _Path:
    """A design on one path of the loads `asked` for: the `largest` of these, of which the others are
    `shares`, on the `nominal` structure from which the `workshop` makes drawn ones, and what of it the
    perfect one is `wanted` to bear (0: that isn't asked). `before`: where structures rested under it in an
    earlier design."""

    asked: Required
    largest: str
    shares: Mapping[str, float]
    nominal: Perfect
    workshop: Workshop
    wanted: float
    before: Resting | None

    @property
    def of_design_load(self) -> bool:
        """Whether the design load is on it."""
        return self.asked.design_load in self.shares

    def queue(self, order: Sequence[int]) -> list[int]:
        """The numbers to load, of those in `order`: the perfect structure first, and of other samples those
        on the design load's path alone."""
        own = [each for each in order if self.of_design_load or each in self.asked.numbers]
        return [PERFECT, *own] if self.wanted > 0.0 else own

    def borne(self, number: int) -> Limit:
        """The share of the largest load that a structure bears, with the state there."""
        asked, marks = self.asked, tuple(self.shares.values())
        errors = draw_errors(self.nominal.members, asked.tolerances(number), asked.safety.seed + SEED, number)
        if number == PERFECT:  # whose path is known so far
            return self.workshop.limit(
                errors,
                most=self.wanted,
                resolution=_RESOLUTION,
                tell=False,
                begin=self.nominal.known_to(self.wanted),
                marks=marks,
                heeding=False,  # a fifth of a trial; the design to build is judged heeding
            )
        return self.workshop.rests(
            errors, resolution=_RESOLUTION, marks=marks, number=number, before=self.before
        )


def _paths(
    shell: Gridshell, design: Design, asked: Required, critical: bool, before: Mapping[str, Resting]
) -> Iterator[_Path]:
    """The paths of the loads asked for, one after the other: each costs the perfect structure's own."""
    for largest, shares in paths(asked.loads).items():
        nominal = perfect(shell, design, asked.loads[largest], step=TO_ITS_END, heeding=False)
        wanted = critical_wanted(asked, shares) if critical else 0.0
        yield _Path(asked, largest, shares, nominal, Workshop(nominal), wanted, before.get(largest))


class _Count:
    """What has been found of a design so far, as JudgedTrial has it; where structures rest if that is to be
    `remembered`."""

    def __init__(self, asked: Required, *, remembered: bool) -> None:
        self.asked, self.remembered = asked, remembered
        self.fallen: dict[str, list[int]] = {name: [] for name in asked.loads}
        self.factors: dict[int, float] = {}
        self.rested: dict[str, Resting] = {}
        self.kept, self.spent = True, 0

    def add(self, path: _Path, number: int, found: Limit) -> None:
        """What one structure bears on a path."""
        factor = found.factor
        self.spent += found.factorisations
        if number == PERFECT:
            self.kept = factor >= path.wanted * (1.0 - SAME)
            return
        if self.remembered and factor >= 1.0 and path.nominal.bears:
            known = self.rested.get(path.largest, Resting(path.nominal.states[-1], {}))
            self.rested[path.largest] = replace(known, drawn={**known.drawn, number: found.state})
        if path.of_design_load:
            self.factors[number] = factor
        beside = path.nominal.lies_beside(found.state)
        for name, share in path.shares.items():
            counts = number in self.asked.numbers or name == self.asked.design_load
            if counts and (factor < share * (1.0 - SAME) or (share == 1.0 and not beside)):
                self.fallen[name].append(number)

    @property
    def stands(self) -> bool:
        """Whether nothing found so far refuses the design."""
        return self.kept and all(len(own) <= self.asked.fallen[name] for name, own in self.fallen.items())

    def judged(self) -> JudgedTrial:
        """As it is told."""
        fallen = {name: tuple(own) for name, own in self.fallen.items()}
        return JudgedTrial(fallen, self.kept, self.stands, self.spent, self.factors, self.rested)


def try_structures(
    shell: Gridshell,
    design: Design,
    asked: Required,
    *,
    first: Sequence[int] = (),
    critical: bool = True,
    whole: bool = False,
    judging: Judging | None = None,
    before: Mapping[str, Resting] | None = None,
) -> JudgedTrial:
    """The design judged by the search's structures, the numbers `first` before the others, and no more of
    them than it takes to refuse it but where the `whole` sample is asked for. Those of `first` that are of
    other samples, where they fell under the design load, have to stand under it and count under no other.
    `before`: where structures rested in an earlier design, from where these are sought; None: that isn't
    known, and isn't wanted of this one. Raises NotConverged where it has no unloaded equilibrium."""
    count = _Count(asked, remembered=before is not None)
    order = [*first, *(number for number in asked.numbers if number not in set(first))]
    for path in _paths(shell, design, asked, critical, before or {}):
        queue = path.queue(order)
        with closing(in_turn(path.borne, queue)) as results:
            for loaded, number in enumerate(queue, start=1):
                count.add(path, number, next(results))
                if loaded % _AT_ONCE and loaded < len(queue):
                    continue
                if judging is not None:
                    judging(loaded, len(queue))
                if not (whole or count.stands):
                    return count.judged()
    return count.judged()


def judge_trial(
    shell: Gridshell,
    design: Design,
    asked: Required,
    *,
    first: Sequence[int] = (),
    whole: bool = False,
    judging: Judging | None = None,
    before: Mapping[str, Resting] | None = None,
) -> JudgedTrial:
    """As `try_structures`; a design without unloaded equilibrium doesn't stand."""
    try:
        return try_structures(shell, design, asked, first=first, whole=whole, judging=judging, before=before)
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
    kept = end.factor >= factor * (1.0 - SAME)
    return replace(
        found, critical=kept, stands=kept, factorisations=found.factorisations + end.factorisations
    )
