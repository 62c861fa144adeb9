"""Where a search stands, handed out as a checkpoint and taken up again: the same search goes on from it to
the same result, to the byte.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields, replace

import numpy as np

from shellform.gridshell.gridshell import Design
from shellform.optimiser.optimum import Checkpoint, arrays_of, states_of
from shellform.optimiser.search_state import Accepted, Iterate, Search, aimed, kept_in_mind
from shellform.problem.evaluation import COUNTS
from shellform.reliability.resting import Resting

_ARRAYS = ("tensioned", "excess", "needed")
_PERFECT = "perfect"
_NUMBERS = tuple(
    each.name
    for each in fields(Iterate)
    if each.name not in (*_ARRAYS, "point", "accepted", "history", "mind", "remembered", "rested")
)


def tell(search: Search, it: Iterate) -> None:
    """Hands out where the search stands."""
    if search.keep is None:
        return
    numbers = {name: getattr(it, name) for name in _NUMBERS}
    numbers |= {name: getattr(search.evaluator, name) for name in COUNTS}
    design = it.point.design
    arrays = {"rest_length": design.rest_length, "present": design.present}
    arrays |= {name: getattr(it, name) for name in _ARRAYS}
    arrays |= {
        "accepted rest_length": np.array([each.design.rest_length for each in it.accepted]),
        "accepted present": np.array([each.design.present for each in it.accepted]),
        "accepted radius": np.array([each.design.radius for each in it.accepted]),
        "accepted taut": np.array([each.taut for each in it.accepted]),
        "accepted violation": np.array([each.violation for each in it.accepted]),
        "accepted objective": np.array([each.objective for each in it.accepted]),
    }
    arrays |= arrays_of(it.point.states)
    numbers["rested"] = {name: list(own.drawn) for name, own in it.rested.items()}
    for name, own in it.rested.items():
        drawn = {str(number): state for number, state in own.drawn.items()}
        arrays |= arrays_of({_PERFECT: own.perfect, **drawn}, _prefix(name))
    numbers["radius"], numbers["mind"] = design.radius, {}
    if it.mind is not None and it.remembered is not None:
        numbers["mind"] = {str(each.number): each.least for each in it.mind.scenarios}
        numbers["followed to"] = it.mind.most
        numbers["remembered radius"] = it.remembered.radius
        arrays["remembered rest_length"] = it.remembered.rest_length
        arrays["remembered present"] = it.remembered.present
    search.keep(Checkpoint(numbers, arrays, it.history))


def resumed(search: Search, checkpoint: Checkpoint) -> tuple[Search, Iterate]:
    """Where a search of the same problem, start and settings stood. Raises InputError for a checkpoint of
    another solver."""
    checkpoint.require(_NUMBERS)
    numbers, arrays = checkpoint.numbers, checkpoint.arrays
    design = Design(arrays["rest_length"], np.array(arrays["present"]), numbers["radius"])
    remembered, mind = None, None
    if numbers["mind"]:
        remembered = Design(
            arrays["remembered rest_length"],
            np.array(arrays["remembered present"]),
            numbers["remembered radius"],
        )
        least = {int(number): factor for number, factor in numbers["mind"].items()}
        mind = kept_in_mind(search, remembered, least, numbers.get("followed to"))
    search.evaluator.problem = aimed(search.inner, numbers["stiffness"], mind)
    states = states_of(arrays, search.evaluator.problem.used())
    point = search.evaluator.seed(design, states, numbers["stage"])
    for name in COUNTS:
        setattr(search.evaluator, name, numbers[name])
    kept = {name: numbers[name] for name in _NUMBERS} | {name: np.array(arrays[name]) for name in _ARRAYS}
    kept["fallen"] = tuple(kept["fallen"])
    before = tuple(
        Accepted(
            Design(rest, np.array(present), float(radius)), np.array(taut), float(share), float(objective)
        )
        for rest, present, radius, taut, share, objective in zip(
            *(
                arrays[f"accepted {name}"]
                for name in ("rest_length", "present", "radius", "taut", "violation", "objective")
            ),
            strict=True,
        )
    )
    began = search.began - checkpoint.history[-1].seconds
    rested = {name: _rested(arrays, name, drawn) for name, drawn in numbers.get("rested", {}).items()}
    it = Iterate(
        point, before, tuple(checkpoint.history), mind=mind, remembered=remembered, rested=rested, **kept
    )
    return replace(search, began=began), it


def _rested(arrays: Mapping[str, np.ndarray], load: str, drawn: Sequence[int]) -> Resting:
    found = states_of(arrays, [_PERFECT, *map(str, drawn)], _prefix(load))
    return Resting(found[_PERFECT], {number: found[str(number)] for number in drawn})


def _prefix(load: str) -> str:
    return f"rested under {load}: "
