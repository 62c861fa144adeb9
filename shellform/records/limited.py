"""What an engineer limits, and constraint (5): each at its worst over a design's load cases, with what to do
where it isn't kept.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from shellform.quantities import newtons, number
from shellform.records.as_built import AsBuilt
from shellform.records.check import (
    ADJUSTED,
    SLACK,
    UNASKED,
    UNKNOWN,
    Cell,
    Check,
    below,
    on_worse_mesh,
    quantity,
)
from shellform.records.raising import SCAFFOLD, easiest
from shellform.records.remedies import RodSizes, RodsOf, allow, allow_less, rounded_up
from shellform.records.summary import DesignRecord, LoadRecord
from shellform.records.words import exceeds, load_title


@dataclass(frozen=True)
class Bounds:
    """What the case limits: tension `force`, N, of cables, of which they may have a share of `pull` as
    planned, before any load and under each; root mean square `misfit`, m, under the loads beyond the design
    load; and where an engineer asked for it (None: not) the largest `deviation`, m, under the design load, of
    the perfect structure and as `built`, and `unloaded`; `stress` over strength, connectors' `turn`, rad,
    `uplift` and `thrust`, N, of supports under any load, least pull `slack`, N, of cables under the
    `slack_loads`, and by load the least `critical` factor; what is asked of structures as built (`safety`);
    how the case gives its `rods`' size; and which share of the surface may lie beyond the rods
    (`uncovered`)."""

    force: float
    misfit: float
    deviation: float | None = None
    built: float | None = None
    unloaded: float | None = None
    stress: float | None = None
    turn: float | None = None
    uplift: float | None = None
    thrust: float | None = None
    slack: float | None = None
    slack_loads: tuple[str, ...] = ()
    critical: Mapping[str, float] = field(default_factory=dict)
    safety: AsBuilt | None = None
    rods: RodSizes | None = None
    uncovered: float = 1.0
    pull: float = 1.0


@dataclass(frozen=True)
class _Found:
    """What a design has of something that is limited: the `value`, in the unit of the case's entry, and the
    `row` of the load under which it has it (None: of all loads)."""

    value: float
    row: LoadRecord | None


def _allowed(limit: _Limit, found: _Found, rods: RodsOf) -> str:
    return allow(limit.entry, found.value)


def _less_stressed(limit: _Limit, found: _Found, rods: RodsOf) -> str:
    """More than the strength is nothing to allow."""
    if found.row is None or rounded_up(found.value) <= 1.0:
        return allow(limit.entry, found.value)
    return rods.less_stressed(found.row.rod_utilisation_max, found.value, min(limit.most or 1.0, 1.0))


def _pulling(force: float, bounds: Bounds) -> str:
    """What allows a cable so much `force`, N, as planned."""
    if force <= bounds.force:
        return allow("limits.cable_utilisation", force / bounds.force)
    return allow("cable.force_max", force / bounds.pull)


@dataclass(frozen=True)
class _Limit:
    """One that an engineer set, or (5): its `title`, the `most` of what is limited (None: not limited), in
    the unit of the case's `entry`; what a design has of it (`found`, None: not known); the `unit` in which
    people read it, so many of which (`times`) make one of the entry's; and the `remedy`."""

    title: str
    entry: str
    most: float | None
    found: Callable[[DesignRecord], _Found | None]
    unit: str
    times: float = 1.0
    remedy: Callable[[_Limit, _Found, RodsOf], str] = _allowed


def limited(rows: Mapping[str, DesignRecord], rods: Mapping[str, RodsOf], bounds: Bounds) -> list[Check]:
    """Constraint (5), and what an engineer limits, each at its worst over the load cases: of the designs that
    have the `rods`."""
    limits = [
        _Limit(
            "Largest deviation under the design load",
            "limits.deviation",
            bounds.deviation,
            lambda row: _under("design", row, _deviation),
            "mm",
            1e3,
        ),
        _Limit(
            "Largest deviation as built under the design load",
            "limits.built_deviation",
            bounds.built,
            lambda row: _under("design", row, _built_deviation),
            "mm",
            1e3,
        ),
        _Limit(
            "Largest deviation before any load",
            "limits.unloaded_deviation",
            bounds.unloaded,
            lambda row: _under("none", row, _deviation),
            "mm",
            1e3,
        ),
        _Limit(
            "Rods' stress with axial force under any load",
            "limits.utilisation",
            bounds.stress,
            lambda row: _worst(row.loads.values(), lambda load: load.stress_utilisation_max),
            "% of the strength",
            100.0,
            _less_stressed,
        ),
        _Limit(
            "Connectors' turning under any load",
            "limits.connector_turn",
            bounds.turn,
            lambda row: _worst(row.loads.values(), lambda load: load.connector_turn_max),
            "°",
            180.0 / math.pi,
        ),
        _Limit(
            "Uplift of a support under any load",
            "limits.uplift",
            bounds.uplift,
            lambda row: _worst(row.loads.values(), lambda load: load.uplift_max),
            "N",
        ),
        _Limit(
            "Thrust on a support under any load",
            "limits.thrust",
            bounds.thrust,
            lambda row: _worst(row.loads.values(), lambda load: load.thrust_max),
            "N",
        ),
    ]
    planned = bounds.pull * bounds.force
    pulled = _Limit(
        "Largest cable force before any load and under each (5)",
        "cable.force_max",
        planned,
        _pull,
        "N",
        remedy=lambda limit, found, _: _pulling(found.value, bounds),
    )
    designs = list(rods)
    found = [
        _at_most(pulled, planned, rows, rods),
        *(_at_most(each, each.most, rows, rods) for each in limits if each.most is not None),
        *_strained_as_built(rows, designs, bounds.force),
    ]
    if bounds.slack is not None:
        found += [_taut(rows, designs, load, bounds.slack) for load in bounds.slack_loads]
    return found


def _strained_as_built(rows: Mapping[str, DesignRecord], designs: Sequence[str], force: float) -> list[Check]:
    """What rods and cables bear as built under the design load, where it is known: told, and not asked for;
    what is beyond the strength or `force`, N, asks for care."""
    rods, cables = dict.fromkeys(designs, UNASKED), dict.fromkeys(designs, UNASKED)
    for name in designs:
        row = rows[name].loads.get("design") if name in rows else None
        if row is None or row.built_shape is None:
            continue
        own, then = row.built_shape, row.adjusted_shape
        before = rows[name].loads.get("none")
        tight = before is None or before.cable_force_max is None or before.cable_force_max > 0.0
        if own.stress is not None:
            ways = rows[name].ways_up
            scaffold = not ways or easiest(ways).by == SCAFFOLD
            stress = None if then is None else then.stress
            rods[name] = _stressed(own.stress, stress, tight=tight, scaffold=scaffold)
        if own.pull is not None:
            cables[name] = _pulled(own.pull, None if then is None else then.pull, force)
    limits = "100 % breaks them", f"{newtons(force)} are cable.force_max"
    titles = (
        "Rods' stress as built under the design load",
        "Largest cable force as built under the design load",
    )
    return [
        Check(title, f"told, in the median of structures; {limit}", cells)
        for title, limit, cells in zip(titles, limits, (rods, cables), strict=True)
        if set(cells.values()) != {UNASKED}
    ]


def _stressed(
    own: tuple[float, float], then: tuple[float, float] | None, *, tight: bool, scaffold: bool
) -> Cell:
    """The rods' stress as built over their strength, the median and the worst, and `then`, adjusted on
    site; `tight`: whether a cable pulls before any load, `scaffold`: whether it is raised by one."""

    def words(stress: tuple[float, float]) -> str:
        usual, worst = (number(100.0 * each) for each in stress)
        return f"{usual} % of the strength, {worst} % in the worst"

    cables = ", and tighten cables to their force before any load" if tight else ""
    last = "Fix supports last" if scaffold else "Raise it by a scaffold instead, fix supports last"
    return _as_built(
        own,
        then,
        words,
        lambda stress: stress > 1.0,
        care=f", which breaks rods. {last}, where rods' ends lie on a scaffold{cables}",
        more="Where a rod bows out between two crossings, loosen it beside them and clamp it anew",
        beyond="with rods beyond their strength as built",
    )


def _pulled(own: tuple[float, float], then: tuple[float, float] | None, most: float) -> Cell:
    """The cables' force as built, N, the median and the worst, and `then`, adjusted on site, which may be so
    much at `most`."""

    def words(pull: tuple[float, float]) -> str:
        usual, worst = map(newtons, pull)
        return f"{usual}, {worst} in the worst"

    return _as_built(
        own,
        then,
        words,
        lambda pull: exceeds(pull, most),
        care=f", more than the {newtons(most)} of cable.force_max. Tighten cables to their force before any "
        "load, not to their length alone",
        more="For more than that take stronger cables, or plan with a smaller limits.cable_utilisation",
        beyond="with cables beyond cable.force_max as built",
    )


def _as_built(
    own: tuple[float, float],
    then: tuple[float, float] | None,
    words: Callable[[tuple[float, float]], str],
    over: Callable[[float], bool],
    *,
    care: str,
    more: str,
    beyond: str,
) -> Cell:
    """What structures as built bear, the median and the worst, and `then`, adjusted on site, in `words`. What
    is `over` its limit in the worst asks for `care`, and for `more` where it is so when adjusted; in the
    median the verdict says so: that the design holds adjusted, or `beyond` its limit."""
    found, told = words(own), ""
    caution, provided = found + care, beyond
    if then is not None:
        told = f"; adjusted on site {words(then)}"
        caution += f": then {words(then)}{f'. {more}' if over(then[1]) else ''}"
        provided = beyond if over(then[0]) else ADJUSTED
    return Cell(
        found + told,
        None,
        False,
        caution=caution if over(own[1]) else "",
        provided=provided if over(own[0]) else "",
    )


def _at_most(
    limit: _Limit, most: float, rows: Mapping[str, DesignRecord], rods: Mapping[str, RodsOf]
) -> Check:
    cells = {}
    for name, own in rods.items():
        found = limit.found(rows[name]) if name in rows else None
        if found is None or not math.isfinite(found.value):
            cells[name] = UNKNOWN
            continue
        # what a shape that has collapsed has of it says nothing of the one that stands
        remedy = "" if found.row is not None and found.row.collapsed else limit.remedy(limit, found, own)
        cells[name] = below(limit.times * found.value, limit.times * most, limit.unit, remedy)
    return Check(limit.title, quantity(limit.times * most, limit.unit), cells)


def _worst(rows: Iterable[LoadRecord], value: Callable[[LoadRecord], float | None]) -> _Found | None:
    """The largest of the values that are known."""
    known = [(found, row) for row in rows if (found := value(row)) is not None]
    return _Found(*max(known, key=lambda each: each[0])) if known else None


def _under(load: str, row: DesignRecord, value: Callable[[LoadRecord], float | None]) -> _Found | None:
    """The value under the one load."""
    return _worst([row.loads[load]] if load in row.loads else [], value)


def _pull(row: DesignRecord) -> _Found | None:
    """Of the cables, N, before any load and under each; the design's own where that isn't known."""
    found = _worst(row.loads.values(), lambda load: load.cable_force_max)
    return found if found is not None and found.value else _Found(row.cable_force_max, None)


def _deviation(row: LoadRecord) -> float:
    """The largest, m."""
    return on_worse_mesh(row.deviation_max, row.deviation_max_error)


def _built_deviation(row: LoadRecord) -> float | None:
    """The worst, m, of the drawn structures that were looked at; of one that fell before there is none."""
    return None if row.built_shape is None else row.built_shape.deviation_max_worst


_SLACK = "Leave limits.slack_min out, or this load out of limits.slack_loads."  # of what pulls with nothing


def _taut(rows: Mapping[str, DesignRecord], designs: Sequence[str], load: str, least: float) -> Check:
    """The least pull of a cable."""
    cells = {}
    for name in designs:
        row = rows[name].loads.get(load) if name in rows else None
        pull = None if row is None else row.cable_force_min
        if row is not None and not rows[name].cables:
            cells[name] = Cell("no cable", True)
            continue
        remedy = allow_less("limits.slack_min", pull) if pull else _SLACK
        if row is not None and row.collapsed:
            remedy = ""
        cells[name] = (
            UNKNOWN if pull is None else Cell(newtons(pull), pull >= least * (1.0 - SLACK), remedy=remedy)
        )
    return Check(f"Least pull of a cable under {load_title(load)}", f"at least {newtons(least)}", cells)
