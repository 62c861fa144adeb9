"""Checks of the structure as built: how many drawn ones stand, and up to which factor the perfect one does.

How many drawn structures may fall is counted: of 200 with 0.99 asked for, two. Of a smaller sample nothing is
concluded but that a design fails which would fail even if all structures not drawn yet stood. A critical
factor has to be kept with rod elements halved too.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

from shellform.quantities import number
from shellform.records.check import UNASKED, UNKNOWN, Cell, Check, Subject
from shellform.records.remedies import RodsOf
from shellform.records.summary import DesignRecord, LoadRecord, StandingRecord
from shellform.records.words import critical_words, load_title, standing_words
from shellform.reliability.safety import allowed

EQUAL = 1e-3  # relative: critical factors that count as equal


@dataclass(frozen=True)
class Farthest:
    """How `far`, m, a structure as built may snap on its way without asking for care, and `of` what that is,
    in words."""

    far: float
    of: str


@dataclass(frozen=True)
class AsBuilt:
    """The share of drawn structures that must stand under the `design` load, and under every `other` one
    (None: no less than of the initial design, and never more than under the design load), of so many `drawn`;
    only told where it isn't `required`. Those that `snap` farther than that on their way stand, and ask for
    care (None: none does)."""

    design: float
    other: float | None
    drawn: int
    required: bool = True
    snap: Farthest | None = None


def standing_checks(
    rows: Mapping[str, DesignRecord],
    rods: Mapping[str, RodsOf],
    loads: Sequence[str],
    factors: Mapping[str, float | None],
    safety: AsBuilt | None,
) -> list[Check]:
    """How many drawn structures stand."""
    if safety is None:
        return []
    found = []
    for load in loads:
        fallen = _most_fallen(rows, load, safety)
        cells = {
            name: _drawn(rows[name], load, rods[name], fallen, safety) if name in rows else UNASKED
            for name in rods
        }
        limit = f"at least {safety.drawn - fallen} of {safety.drawn}" if safety.required else "told only"
        title = f"As built under {load_title(load, factors[load])}"
        found.append(Check(title, limit, cells, Subject.DRAWN, load))
    return found


def guide_checks(
    rows: Mapping[str, DesignRecord],
    names: Sequence[str],
    loads: Sequence[str],
    factors: Mapping[str, float | None],
) -> list[Check]:
    """The guide beside the drawn structures, and how well both agree: it judges nothing."""
    found = []
    for load in loads:
        known = {name: rows[name].loads[load] for name in names if name in rows and load in rows[name].loads}
        stiffness = {
            name: row.expected_stiffness for name, row in known.items() if row.expected_stiffness is not None
        }
        if stiffness:
            cells = {
                name: Cell(f"{number(stiffness[name])} N/m", None, False) if name in stiffness else UNASKED
                for name in names
            }
            found.append(
                Check(
                    f"Softest mode as built under {load_title(load, factors[load])}", _agreement(known), cells
                )
            )
    return found


def _agreement(rows: Mapping[str, LoadRecord]) -> str:
    """Of how many pairs of designs the guide tells as the drawn structures do which one stands more often."""
    both = [
        (row.expected_stiffness, row.stands.standing / row.stands.drawn)
        for row in rows.values()
        if row.expected_stiffness is not None and row.stands is not None
    ]
    pairs = [(a, b) for a, b in combinations(both, 2) if a[1] != b[1]]
    if not pairs:
        return "a guide; the drawn structures decide"
    alike = sum((a[0] > b[0]) == (a[1] > b[1]) for a, b in pairs)
    return (
        f"a guide: orders {alike} of {len(pairs)} pairs of designs as the drawn structures do, which decide"
    )


def falls(rows: Mapping[str, DesignRecord], name: str, safety: AsBuilt) -> bool:
    """Whether more of a design's drawn structures have fallen under a load than may."""
    return any(
        row.stands is not None and row.stands.drawn - row.stands.standing > _most_fallen(rows, load, safety)
        for load, row in rows[name].loads.items()
    )


def _most_fallen(rows: Mapping[str, DesignRecord], load: str, safety: AsBuilt) -> int:
    share = safety.design
    if load != "design":
        share = _initial_share(rows, load, safety) if safety.other is None else safety.other
    return allowed(share, safety.drawn)


def _initial_share(rows: Mapping[str, DesignRecord], load: str, safety: AsBuilt) -> float:
    """The share of the initial design's structures that stand, not more than is asked for under the design
    load.
    """
    row = rows["initial"].loads.get(load) if "initial" in rows else None
    if row is None or row.stands is None:
        return safety.design
    return min(safety.design, row.stands.standing / row.stands.drawn)


def _drawn(design: DesignRecord, load: str, rods: RodsOf, fallen: int, safety: AsBuilt) -> Cell:
    row = design.loads.get(load)
    if row is None or row.stands is None:
        return replace(UNKNOWN, asked=safety.required and row is not None)
    own = row.stands
    words = standing_words(own)
    if own.drawn - own.standing > fallen:
        lowest = own.lowest or 0.0
        remedy = rods.stronger(1.0 / lowest if lowest > 0.0 else math.inf)
        return Cell(words, False, safety.required, remedy, own.standing / own.drawn)
    caution = _snapping(own, safety.snap) if safety.required else ""
    holds = True if own.drawn >= safety.drawn else None
    return Cell(words, holds, safety.required, "", own.standing / own.drawn, caution)


def _snapping(own: StandingRecord, most: Farthest | None) -> str:
    """That structures snap farther on their way than is without care; "" where none does."""
    if most is None or own.snap <= most.far:
        return ""
    far, without_care = (number(1e3 * each, 2) for each in (own.snap, most.far))
    return (
        f"{own.snapped} of {own.drawn} structures as built {'snaps' if own.snapped == 1 else 'snap'} at a rod's end or a cell "
        f"on the way, by up to {far} mm: more than the {without_care} mm of {most.of}"
    )


def critical_checks(
    rows: Mapping[str, DesignRecord], rods: Mapping[str, RodsOf], critical: Mapping[str, float]
) -> list[Check]:
    """Up to which factor each load's path stays stable, with rod elements halved too."""
    return [
        Check(
            f"Critical factor of {load_title(load)}",
            f"at least {least:g} ×, with rod elements halved too",
            {name: _stays(rows[name], load, least, rods[name]) if name in rows else UNKNOWN for name in rods},
        )
        for load, least in critical.items()
    ]


def keeps_factor(row: LoadRecord, least: float) -> bool | None:
    """Whether a load's path stays stable up to the `least` factor, with rod elements halved too; None where
    that isn't known."""
    lower = _lower_factor(row)
    if lower is None:
        return None
    if lower < least * (1.0 - EQUAL):
        return False
    return None if row.critical_factor_halved is None else True


def _lower_factor(row: LoadRecord) -> float | None:
    """The smaller critical factor of the design's mesh and of that with rod elements halved, as far as they
    are known."""
    coarse, fine = row.critical_factor, row.critical_factor_halved
    return coarse if coarse is None or fine is None else min(coarse, fine)


def _stays(design: DesignRecord, load: str, least: float, rods: RodsOf) -> Cell:
    row = design.loads.get(load)
    if row is None or row.critical_factor is None or row.critical_kind is None:
        return UNKNOWN
    fine, kept = row.critical_factor_halved, keeps_factor(row, least)
    words = critical_words(row.critical_factor, row.critical_kind, halved=fine, snap=row.critical_snap_halved)
    if fine is not None and row.critical_kind != "none":
        words += f", {fine:.3f} × with rod elements halved"
    if kept is False:
        lower = _lower_factor(row) or 0.0
        return Cell(words, False, remedy=rods.stronger(least / lower if lower > 0.0 else math.inf))
    return Cell(words, kept)
