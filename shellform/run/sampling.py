"""Structures of a design drawn and loaded a few at a time, each few kept in the run folder."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

import shellform
from shellform.arrays import Reals, Record
from shellform.compiled import clock_without_compiling
from shellform.gridshell.gridshell import Design, Gridshell
from shellform.gridshell.layers import rod_utilisation
from shellform.gridshell.tolerances import Tolerances
from shellform.problem.paths import deviations
from shellform.records.drawn import DrawnPath, DrawnShape, DrawnSnap, read_drawn, write_drawn
from shellform.reliability.adjusting import adjusted
from shellform.reliability.path_of_one import DrawnOutcome
from shellform.reliability.perfect import TO_ITS_END, Perfect, perfect
from shellform.reliability.safety import paths
from shellform.reliability.standing import Workshop

_AT_ONCE = 10  # structures, before they are kept
LOOKED_AT = 20  # structures of which the shape is looked at: each takes some factorisations more


@dataclass(frozen=True, eq=False)
class Examined(Record):
    """A design under examination: its `name`, the `shell` whose `design` it is, the dead `loads` (n, 6) by
    name, and the `tolerances` with which it is built."""

    name: str
    shell: Gridshell
    design: Design
    loads: Mapping[str, Reals]
    tolerances: Tolerances

    def nominal(self, load: str) -> Perfect:
        """The perfect structure on the whole of the load's path. Raises NotConverged where it has no unloaded
        equilibrium."""
        return perfect(self.shell, self.design, self.loads[load], step=TO_ITS_END)

    def key(self, seed: int) -> str:
        """Of all that its drawn structures depend on."""
        network = self.shell.network(self.design)
        digest = hashlib.sha256(f"{shellform.__version__} {seed} {asdict(self.tolerances)}".encode())
        digest.update(" ".join(map(json.dumps, self.loads)).encode())  # by which paths are kept
        for array in (
            self.shell.target.positions,
            network.beams.axial,
            network.beams.bending_y,
            network.beams.bending_z,
            network.beams.torsion,
            network.beams.rest_length,
            network.cables.ends,
            network.cables.rest_length,
            network.cables.stiffness,
            *self.loads.values(),
        ):
            digest.update(np.ascontiguousarray(array).tobytes())
        return digest.hexdigest()


class Clock:
    """How long is left of so many structures `planned` at the most, by those that were drawn so far, and of
    what comes `afterwards`, which takes as long as so many structures."""

    def __init__(self, planned: int, afterwards: int = 0) -> None:
        self.planned, self.afterwards, self.done, self.spent = planned, afterwards, 0, 0.0

    def kept(self, count: int) -> None:
        """So many were drawn before."""
        self.planned = max(self.planned - count, 0)

    def took(self, count: int, seconds: float) -> None:
        """So many were drawn now."""
        self.done, self.spent = self.done + count, self.spent + seconds
        self.planned = max(self.planned, self.done)

    def left(self) -> float:
        """Seconds."""
        return self.spent / max(self.done, 1) * (self.planned - self.done + self.afterwards)

    def fraction(self) -> float:
        """Of all of it."""
        return self.done / max(self.planned + self.afterwards, 1)


def drawn_of(
    folder: Path,
    examined: Examined,
    load: str,
    *,
    count: int,
    seed: int,
    clock: Clock,
    tell: Callable[[int], None],
) -> DrawnPath:
    """Structures 0 to `count` of the design under the `load`; those in the folder are taken from there.
    Raises NotConverged where the perfect structure has no unloaded equilibrium."""
    kept = read_drawn(folder, examined.name, examined.key(seed))
    path = kept.paths.get(load, DrawnPath())
    clock.kept(min(len(path.factors), count))
    own = paths(examined.loads).get(load, {})
    workshop = None
    while len(path.factors) < count:
        began = clock_without_compiling()
        if workshop is None:
            workshop = Workshop(examined.nominal(load))
        first = len(path.factors)
        some = workshop.load_numbers(
            examined.tolerances,
            seed=seed,
            numbers=range(first, min(first + _AT_ONCE, count)),
            marks=tuple(own.values()),
            resting=own.get("design") if first < LOOKED_AT else None,
        )
        path = path.and_then(_path(examined, some))
        kept = kept.also(load, path)
        write_drawn(folder, examined.name, kept)
        clock.took(len(some), clock_without_compiling() - began)
        tell(len(path.factors))
    return _first(path, count)


def adjusted_of(folder: Path, examined: Examined, *, count: int, seed: int) -> DrawnPath:
    """The first `count` structures of the design, adjusted on site and then loaded along the path on which
    the design load lies; those in the folder are taken from there. Raises NotConverged where the perfect
    structure has no unloaded equilibrium."""
    kept = read_drawn(folder, examined.name, examined.key(seed))
    load, own = next((load, own) for load, own in paths(examined.loads).items() if "design" in own)
    workshop = None
    while (first := len(kept.adjusted.factors)) < count:
        workshop = workshop or Workshop(examined.nominal(load))
        some = workshop.load_numbers(
            examined.tolerances,
            seed=seed,
            numbers=range(first, min(first + _AT_ONCE, count)),
            marks=tuple(own.values()),
            resting=own["design"],
            adjust=partial(adjusted, workshop),
        )
        kept = replace(kept, adjusted=kept.adjusted.and_then(_path(examined, some)))
        write_drawn(folder, examined.name, kept)
    return _first(kept.adjusted, count)


def _first(path: DrawnPath, count: int) -> DrawnPath:
    """The first so many of a path's structures."""
    return DrawnPath(
        path.factors[:count],
        path.stand[:count],
        tuple(each for each in path.snaps if each.number < count),
        tuple(each for each in path.shapes if each.number < count),
    )


def _path(examined: Examined, outcomes: Sequence[DrawnOutcome]) -> DrawnPath:
    """What is kept of structures, the first ones of a design."""
    return DrawnPath(
        tuple(each.factor for each in outcomes),
        tuple(each.stands for each in outcomes),
        tuple(DrawnSnap(each.number, snap.factor, snap.far) for each in outcomes for snap in each.snaps),
        tuple(_shapes(examined, outcomes)),
    )


def _shapes(examined: Examined, outcomes: Sequence[DrawnOutcome]) -> Iterator[DrawnShape]:
    """Of the first structures, those that rest under the design load."""
    shell, section = examined.shell, examined.shell.rod.resized(examined.design.radius).section
    for each in outcomes:
        state, beams, cables = each.resting, each.beams, each.cables
        if state is None or beams is None or cables is None or each.number >= LOOKED_AT:
            continue
        far = deviations(shell, state)
        yield DrawnShape(
            each.number,
            float(far.max()),
            float(far.mean()),
            float(rod_utilisation(section, beams, state).max()),
            float(cables.tension(state).max(initial=0.0)),
        )
