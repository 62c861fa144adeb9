"""Every check of a run's designs.

A check compares a number of the summary with its limit, and says nothing where a design was never asked for
it. Checks of one design count only what was evaluated on it. A computation that ended without a result fails:
its residual is no number. What holds on the design's own mesh has to hold with rod elements halved too, where
that was computed. Numbers stand in the units in which people read them: mm, N, %.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from shellform.gridshell.gridshell import Design, Gridshell, max_radius
from shellform.quantities import newtons, number
from shellform.records.as_built import AsBuilt, critical_checks, guide_checks, standing_checks
from shellform.records.check import SLACK, UNASKED, UNKNOWN, Cell, Check, Subject, below, quantity, share_of
from shellform.records.optimisation import OptimisationRecord
from shellform.records.remedies import RodSizes, RodsOf, allow, allow_count, allow_less
from shellform.records.summary import DesignRecord, LoadRecord, Summary
from shellform.records.words import constraint_titles, load_title

BUILT = ("optimised", "rounded", "polished")  # in the order in which they are made
_SQUARED = ("misfit", "built_misfit")  # sums of squares of what users limit as a root mean square
_AT_LEAST = ("softness", "slackness")  # of which as much is demanded, not at most
# Unbalanced over largest force: what an equilibrium that counts as found stays below.
_SETTLED, _SETTLED_TOLD = 1e-6, "unbalanced force up to a millionth of the largest"
_EVALUATIONS = "Give the search twice the evaluations (optimise.evaluations), or loosen the limit."


@dataclass(frozen=True)
class Bounds:
    """What the case limits: tension `force`, N, of cables under the design load and those beyond it; root
    mean square `misfit`, m, under those beyond it; and where an engineer asked for it (None: not) the largest
    `deviation`, m, under the design load, of the perfect structure and as `built`, and `unloaded`; `stress`
    over strength, connectors' `turn`, rad, `uplift` and `thrust`, N, of supports under any load, least pull
    `slack`, N, of cables under the `slack_loads`, and by load the least `critical` factor; what is asked of
    structures as built (`safety`); and how the case gives its `rods`' size."""

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


@dataclass(frozen=True)
class _Judged:
    """What is judged: the names of the `designs`, `rows` of those that the summary has, and their `rods`."""

    designs: tuple[str, ...]
    rows: Mapping[str, DesignRecord]
    rods: Mapping[str, RodsOf]

    @property
    def factors(self) -> dict[str, float]:
        """Of the load cases, in their order, times the design load."""
        return {load: row.loads[load].factor for row in self.rows.values() for load in row.loads}

    def under(
        self, title: str, limit: str, cell: Callable[[LoadRecord, RodsOf], Cell], loads: Sequence[str]
    ) -> list[Check]:
        """One check under each of the `loads`, its `cell` from a design's record under it and its rods."""
        return [
            Check(
                f"{title} under {load_title(load, self.factors[load])}",
                limit,
                {
                    name: cell(self.rows[name].loads[load], self.rods[name])
                    if name in self.rows and load in self.rows[name].loads
                    else UNASKED
                    for name in self.designs
                },
            )
            for load in loads
        ]


def checks(
    shells: Mapping[str, Gridshell], designs: Mapping[str, Design], summary: Summary, bounds: Bounds
) -> list[Check]:
    """Every check of the designs, each on its own shell: standing, as built too, stress, forces, misfit, the
    optimiser's own constraints, equilibrium."""
    largest = {name: max_radius(shells[name].net, shells[name].rod) for name in designs}
    spacing = None if summary.net is None else summary.net.spacing
    rods = {
        name: RodsOf(designs[name].radius, largest[name], spacing, summary.thicker, bounds.rods)
        for name in designs
    }
    rows = {name: summary.designs[name] for name in designs if name in summary.designs}
    judged = _Judged(tuple(designs), rows, rods)
    factors = judged.factors
    loads, loaded = list(factors), [load for load in factors if load != "none"]
    bent = {name: _stressed(designs[name].radius / largest[name], rods[name]) for name in designs}
    return [
        *judged.under("Stands", "stable, without snapping through", _stands, loads),
        *standing_checks(rows, rods, loaded, factors, bounds.safety),
        *guide_checks(rows, list(rods), loaded, factors),
        *critical_checks(rows, rods, bounds.critical),
        *judged.under(
            "Rods",
            "stress up to 100 % of the strength",
            lambda row, rods: _stressed(_stress(row), rods),
            loads,
        ),
        *_of_edge_beams(judged),
        Check("Rods bent into the shape (1)", "up to 100 % of the curvature they bear", bent),
        *_limited(rows, list(designs), bounds),
        *_deviating(judged, bounds),
        *_of_the_optimiser(summary.optimisation, rows, list(designs)),
        *judged.under(
            "In equilibrium",
            _SETTLED_TOLD,
            lambda row, rods: _settled(row),
            loads,
        ),
    ]


def _of_edge_beams(judged: _Judged) -> list[Check]:
    """Their stress, where a design has any."""
    every = [row for design in judged.rows.values() for row in design.loads.values()]
    if not any(row.edge_utilisation_max for row in every):
        return []
    limit = "stress up to 100 % of the strength"
    return judged.under("Edge beams", limit, lambda row, rods: _edged(row), list(judged.factors))


def _deviating(judged: _Judged, bounds: Bounds) -> list[Check]:
    """Constraint (6), under the loads beyond the design load."""
    most = 1e3 * bounds.misfit
    found = judged.under(
        "Deviation",
        f"{number(most)} mm",
        lambda row, rods: below(
            1e3 * row.deviation_rms,
            most,
            "mm",
            allow("optimise.misfit_rms_additional", row.deviation_rms, or_else="take thicker rods"),
        ),
        [load for load in judged.factors if load not in ("none", "design")],
    )
    return [replace(check, title=f"{check.title}, root mean square (6)") for check in found]


def _stress(row: LoadRecord) -> float:
    """Of the rods over their strength, on the mesh on which it is larger: q8 = q4 - 3/4 of the error of
    q4.
    """
    error = row.rod_utilisation_error or 0.0
    return max(row.rod_utilisation_max, row.rod_utilisation_max - 0.75 * error)


def _deviation(row: LoadRecord) -> float:
    """The largest, m, on the mesh on which it is larger, likewise."""
    return max(row.deviation_max, row.deviation_max - 0.75 * (row.deviation_max_error or 0.0))


def _built_deviation(row: DesignRecord) -> float | None:
    """The worst, m, of the drawn structures that were looked at; of one that fell before there is none."""
    shape = None if "design" not in row.loads else row.loads["design"].built_shape
    return None if shape is None else shape.deviation_max_worst


def _unloaded_deviation(row: DesignRecord) -> float | None:
    """The largest, m, before any load."""
    return None if "none" not in row.loads else _deviation(row.loads["none"])


def _edged(row: LoadRecord) -> Cell:
    """The stress of edge beams over their strength."""
    share = row.edge_utilisation_max or 0.0
    return share_of(
        share, f"Take edge beams {share:.1f} times as strong (edges.beam: more rods, or a section)."
    )


@dataclass(frozen=True)
class _Limit:
    """One that an engineer set, or (5): its `title`, the `most` of what is limited (None: not limited), in
    the unit of the case's `entry`; the `unit` in which people read it, so many of which (`times`) make one of
    the entry's; and a design's `value`, in the entry's unit."""

    title: str
    entry: str
    most: float | None
    value: Callable[[DesignRecord], float | None]
    unit: str
    times: float = 1.0


def _limited(rows: Mapping[str, DesignRecord], designs: Sequence[str], bounds: Bounds) -> list[Check]:
    """Constraint (5), and what an engineer limits, each at its worst over the load cases."""

    def worst(value: Callable[[LoadRecord], float | None]) -> Callable[[DesignRecord], float | None]:
        return lambda row: _largest(value(each) for each in row.loads.values())

    pulled = _Limit(
        "Largest cable force under the design load and those beyond it (5)",
        "cable.force_max",
        bounds.force,
        lambda row: (
            _largest(each.cable_force_max for load, each in row.loads.items() if load != "none")
            or row.cable_force_max
        ),
        "N",
    )
    limits = [
        _Limit(
            "Largest deviation under the design load",
            "limits.deviation",
            bounds.deviation,
            lambda row: _deviation(row.loads["design"]) if "design" in row.loads else None,
            "mm",
            1e3,
        ),
        _Limit(
            "Largest deviation as built under the design load",
            "limits.built_deviation",
            bounds.built,
            _built_deviation,
            "mm",
            1e3,
        ),
        _Limit(
            "Largest deviation before any load",
            "limits.unloaded_deviation",
            bounds.unloaded,
            _unloaded_deviation,
            "mm",
            1e3,
        ),
        _Limit(
            "Rods' stress with axial force under any load",
            "limits.utilisation",
            bounds.stress,
            worst(lambda load: load.stress_utilisation_max),
            "% of the strength",
            100.0,
        ),
        _Limit(
            "Connectors' turning under any load",
            "limits.connector_turn",
            bounds.turn,
            worst(lambda load: load.connector_turn_max),
            "°",
            180.0 / math.pi,
        ),
        _Limit(
            "Uplift of a support under any load",
            "limits.uplift",
            bounds.uplift,
            worst(lambda load: load.uplift_max),
            "N",
        ),
        _Limit(
            "Thrust on a support under any load",
            "limits.thrust",
            bounds.thrust,
            worst(lambda load: load.thrust_max),
            "N",
        ),
    ]
    found = [
        _at_most(pulled, bounds.force, rows, designs),
        *_pulled_before(rows, designs, bounds.force),
        *(_at_most(each, each.most, rows, designs) for each in limits if each.most is not None),
    ]
    if bounds.slack is not None:
        found += [_taut(rows, designs, load, bounds.slack) for load in bounds.slack_loads]
    return found


def _pulled_before(rows: Mapping[str, DesignRecord], designs: Sequence[str], force: float) -> list[Check]:
    """The largest cable force before any load, which is told and not asked for, where it is known; `force`,
    N: the limit under load."""
    pulls = {name: row.loads["none"].cable_force_max for name, row in rows.items() if "none" in row.loads}
    told = {name: Cell(newtons(pull), None, False) for name, pull in pulls.items() if pull is not None}
    cells = {name: told.get(name, UNASKED) for name in designs}
    limit = f"told; the limit, {newtons(force)}, counts under load"
    return [Check("Largest cable force before any load", limit, cells)] if told else []


def _at_most(limit: _Limit, most: float, rows: Mapping[str, DesignRecord], designs: Sequence[str]) -> Check:
    cells = {}
    for name in designs:
        value = limit.value(rows[name]) if name in rows else None
        cells[name] = (
            UNKNOWN
            if value is None or not math.isfinite(value)
            else below(limit.times * value, limit.times * most, limit.unit, allow(limit.entry, value))
        )
    return Check(limit.title, quantity(limit.times * most, limit.unit), cells)


def _of_the_optimiser(
    record: OptimisationRecord | None, rows: Mapping[str, DesignRecord], designs: Sequence[str]
) -> list[Check]:
    """The optimiser's own constraints, for the optimised design, and the wishes for cables."""
    if record is None:
        return []
    found = []
    titles = constraint_titles(record.constraints)
    for name, value in record.constraints.items():
        cell = replace(_constraint(name, value), remedy=_EVALUATIONS)
        limit = "at least what is demanded" if name.partition(".")[0] in _AT_LEAST else "up to the limit"
        cells = {design: cell if design == "optimised" else UNASKED for design in designs}
        found.append(Check(titles[name], limit, cells, Subject.SEARCH))
    if record.cables_max is not None:
        most = record.cables_max.asked
        cells = {
            design: Cell(
                f"{rows[design].cables}", rows[design].cables <= most, remedy=allow_count(rows[design].cables)
            )
            if design in rows and design in BUILT
            else UNASKED
            for design in designs
        }
        found.append(Check("Number of cables", f"up to {most}, as far as the limits allow", cells))
    if record.symmetric is not None:
        kept, groups = record.symmetric.kept, record.symmetric.groups
        words = f"{groups} lengths" if kept else record.not_polished or "not alike"
        built = next((name for name in reversed(BUILT) if name in designs), "")
        cells = {design: Cell(words, kept) if design == built else UNASKED for design in designs}
        found.append(Check("Symmetric cables have one length", "asked for", cells))
    return found


def _largest(values: Iterable[float | None]) -> float | None:
    """The largest of those that are known."""
    return max((value for value in values if value is not None), default=None)


def _taut(rows: Mapping[str, DesignRecord], designs: Sequence[str], load: str, least: float) -> Check:
    """The least pull of a cable."""
    cells = {}
    for name in designs:
        row = rows[name].loads.get(load) if name in rows else None
        pull = None if row is None else row.cable_force_min
        remedy = (
            allow_less("limits.slack_min", pull) if pull else "Leave limits.slack_min out, or let it be 0.01."
        )
        cells[name] = (
            UNKNOWN if pull is None else Cell(newtons(pull), pull >= least * (1.0 - SLACK), remedy=remedy)
        )
    return Check(f"Least pull of a cable under {load_title(load)}", f"at least {newtons(least)}", cells)


def _stands(row: LoadRecord, rods: RodsOf) -> Cell:
    if row.stable and row.on_branch:
        return Cell("stands", True)
    factor = row.critical_factor
    remedy = rods.stronger(1.0 / factor if factor else math.inf)
    return Cell("snapped through" if row.stable else "unstable", False, remedy=remedy)


def _settled(row: LoadRecord) -> Cell:
    return UNASKED if row.residual is None else Cell(number(row.residual, 1), bool(row.residual <= _SETTLED))


def _constraint(name: str, value: float) -> Cell:
    """From value / limit - 1 <= 0. Misfits count by their squares, a softness is 1 - (stiffness / least)², a
    slackness 1 - pull / least, and an uplift is offset, so that its share tells nothing."""
    if not math.isfinite(value):
        return Cell("not known", False)
    kind, holds = name.partition(".")[0], value <= SLACK
    if kind in _AT_LEAST:
        ratio = math.sqrt(max(1.0 - value, 0.0)) if kind == "softness" else 1.0 - value
        return Cell(f"{ratio:.2f} ×", holds)
    if kind == "uplift":
        return Cell("within" if holds else "beyond", holds)
    share = math.sqrt(max(1.0 + value, 0.0)) if kind in _SQUARED else 1.0 + value
    return Cell(f"{100.0 * share:.0f} %", holds)


def _stressed(value: float, rods: RodsOf) -> Cell:
    return share_of(value, rods.thinner(1.0 / value) if value > 0.0 else "")
