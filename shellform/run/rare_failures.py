"""How rarely structures of a design fall: subset simulation (reliability/rare.py), each few structures kept
in the run folder, so that it goes on where it stopped."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from shellform.records.drawn import DrawnPath, read_drawn, write_drawn
from shellform.records.failures import RareRecord
from shellform.reliability.rare import rare_failure
from shellform.reliability.standing import Workshop
from shellform.run.sampling import Examined


def rare_of(
    folder: Path,
    examined: Examined,
    load: str,
    *,
    count: int,
    seed: int,
    tell: Callable[[int], None],
) -> RareRecord:
    """The share of structures of the design that fall under the `load`, with `count` structures a level;
    `tell` hears how many there were so far. Raises NotConverged where the perfect structure has no unloaded
    equilibrium."""
    file = f"{examined.name}-rare"
    kept = read_drawn(folder, file, f"{examined.key(seed)} {count}")

    def keep(values: Sequence[float]) -> None:
        factors = tuple(1.0 + value for value in values)
        write_drawn(folder, file, kept.also(load, DrawnPath(factors, tuple(f >= 1.0 for f in factors))))
        tell(len(values))

    found = rare_failure(
        Workshop(examined.nominal(load)),
        examined.tolerances,
        seed=seed,
        count=count,
        known=[factor - 1.0 for factor in kept.paths.get(load, DrawnPath()).factors],
        tell=keep,
    )
    fell = len(found.found.failed) > 0
    return RareRecord(
        examined.name,
        load,
        found.found.probability if fell else found.found.reached,
        found.found.evaluations,
        found.shares,
        found.found.variation if fell else None,
    )
