"""designs/NAME-drawn.json: what came of the structures drawn of a design, one after the other, so that
sampling goes on where it stopped and isn't done again for a design that is still the same."""

from __future__ import annotations

import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from shellform.errors import Damaged
from shellform.records.files import read_record, text_of
from shellform.written import write_text


@dataclass(frozen=True)
class DrawnSnap:
    """Structure `number` came to rest after a local snap at a `factor` of the load, in which a node went
    `far`, m."""

    number: int
    factor: float
    far: float


@dataclass(frozen=True)
class DrawnShape:
    """Structure `number` at rest under the design load: how far, m, its nodes are from their places on the
    target, `deviation_max` and `deviation_mean`; the largest stress in its rods over their strength (0: that
    isn't known), and how much a cable pulls at most, N (None: of older runs)."""

    number: int
    deviation_max: float
    deviation_mean: float
    stress_utilisation_max: float | None = None
    cable_force_max: float | None = None


@dataclass(frozen=True)
class DrawnPath:
    """Structures 0, 1, … under one load: the `factors` of it up to which they were followed, which of them
    `stand`, the local `snaps` on their ways, and the `shapes` of some under the design load, where that lies
    on this path."""

    factors: tuple[float, ...] = ()
    stand: tuple[bool, ...] = ()
    snaps: tuple[DrawnSnap, ...] = ()
    shapes: tuple[DrawnShape, ...] = ()

    def and_then(self, more: DrawnPath) -> DrawnPath:
        """With those that come next."""
        return DrawnPath(
            (*self.factors, *more.factors),
            (*self.stand, *more.stand),
            (*self.snaps, *more.snaps),
            (*self.shapes, *more.shapes),
        )


def median_and_worst(values: Sequence[float | None]) -> tuple[float | None, float | None]:
    """The median and the largest of the values; None where one of them isn't known."""
    known = [each for each in values if each is not None]
    return (statistics.median(known), max(known)) if known and len(known) == len(values) else (None, None)


@dataclass(frozen=True)
class Drawn:
    """The `paths` of a design's structures by load, and that of the first of them `adjusted` on site before
    the design load; `key` is of all that they depend on."""

    key: str
    paths: Mapping[str, DrawnPath] = field(default_factory=dict)
    adjusted: DrawnPath = DrawnPath()

    def also(self, load: str, path: DrawnPath) -> Drawn:
        """With this path in place of the load's."""
        return replace(self, paths={**self.paths, load: path})


def read_drawn(folder: Path, name: str, key: str) -> Drawn:
    """What was drawn of a design so far; nothing where there is none, or of another design of the name, or
    where the file is damaged: it is drawn anew."""
    path = _file(folder, name)
    if not path.is_file():
        return Drawn(key)
    try:
        found = read_record(path, Drawn)
    except Damaged:
        return Drawn(key)
    return found if found.key == key else Drawn(key)


def take_drawn(folder: Path, same: str, name: str, key: str) -> None:
    """Takes over what was drawn of a design that is the `same`, where of the one of the `name` nothing is.
    Raises InputError where it can't be written."""
    found = read_drawn(folder, same, key)
    if found.paths and not read_drawn(folder, name, key).paths:
        write_drawn(folder, name, found)


def write_drawn(folder: Path, name: str, drawn: Drawn) -> None:
    """Writes it whole or not at all. Raises InputError where it can't be written."""
    write_text(_file(folder, name), text_of(drawn))


def _file(folder: Path, name: str) -> Path:
    return folder / f"designs/{name}-drawn.json"
