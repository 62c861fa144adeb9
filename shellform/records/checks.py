"""Every check of a run's designs.

A check compares a number of the summary with its limit, and says nothing where a design was never asked for
it. Checks of one design count only what was evaluated on it. A computation that ended without a result fails:
its residual is no number. What holds on the design's own mesh has to hold with rod elements halved too, where
that was computed. Numbers stand in the units in which people read them: mm, N, %.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from shellform.gridshell.gridshell import Design, Gridshell, max_radius
from shellform.net.cover import BARE, NOTABLE, patches_told
from shellform.optimiser.limits_told import AT_LEAST, share_of_limit
from shellform.quantities import number
from shellform.records.as_built import critical_checks, guide_checks, standing_checks
from shellform.records.check import SLACK, UNASKED, Cell, Check, Subject, below, on_worse_mesh, share_of
from shellform.records.limited import Bounds, limited
from shellform.records.optimisation import OptimisationRecord
from shellform.records.raising import easiest
from shellform.records.remedies import RodsOf, allow, allow_count
from shellform.records.summary import DesignRecord, LoadRecord, NetRecord, Summary
from shellform.records.words import borne_words, constraint_titles, load_title

BUILT = ("optimised", "rounded", "polished")  # in the order in which they are made
# Unbalanced over largest force: what an equilibrium that counts as found stays below.
_SETTLED, _SETTLED_TOLD = 1e-6, "unbalanced force up to a millionth of the largest"
_EVALUATIONS = "Give the search twice the evaluations (optimise.evaluations), or loosen the limit."


@dataclass(frozen=True)
class _Judged:
    """What is judged: the names of the `designs`, `rows` of those that the summary has, and their `rods`."""

    designs: tuple[str, ...]
    rows: Mapping[str, DesignRecord]
    rods: Mapping[str, RodsOf]

    @property
    def factors(self) -> dict[str, float | None]:
        """Of the load cases, in their order, times the design load; None of one that is no multiple of it."""
        return {load: row.loads[load].times for row in self.rows.values() for load in row.loads}

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
            _if_standing(_strained),
            loads,
        ),
        *_of_edge_beams(judged),
        *_covered(summary.net, bounds.uncovered, judged.designs),
        *_raised(judged, required=bounds.safety is not None and bounds.safety.required),
        Check("Rods bent into the shape (1)", "up to 100 % of the curvature they bear", bent),
        *limited(rows, rods, bounds),
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
    return judged.under(
        "Edge beams", limit, _if_standing(lambda row, rods: _edged(row)), list(judged.factors)
    )


def _covered(net: NetRecord | None, most: float, designs: Sequence[str]) -> list[Check]:
    """How much of the surface lies beyond the rods, which is the same for all designs."""
    if net is None or net.uncovered_share is None:
        return []
    area, share = f"{number(net.uncovered_area, 2)} m²", number(100.0 * net.uncovered_share, 2)
    cells = net.uncovered_area / (net.spacing * net.spacing_v)
    care = (
        f"{area} of the surface lie farther than {BARE:g} spacings from any rod: {patches_told(net.uncovered)}. Formwork needs "
        "props of its own there"
    )
    cell = Cell(
        f"{share} %, {area}" if net.uncovered else "none",
        net.uncovered_share <= most,
        remedy="Another net.angle or net.offset, or a smaller net.spacing, covers more.",
        caution=care if cells >= NOTABLE else "",
        provided=f"with {area} beyond its rods" if cells >= 1.0 else "",
    )
    return [
        Check("Surface beyond the rods", f"up to {100.0 * most:.3g} % of it", dict.fromkeys(designs, cell))
    ]


def _raised(judged: _Judged, *, required: bool) -> list[Check]:
    """What rods bear as the grid goes up, required where its standing as built is."""
    cells = {name: _going_up(judged, name, required) for name in judged.designs}
    limit = "stress up to 100 % of the strength" if required else "told only"
    return [Check("Rods on the way up", limit, cells)] if set(cells.values()) != {UNASKED} else []


def _going_up(judged: _Judged, name: str, required: bool) -> Cell:
    row = judged.rows.get(name)
    if row is None or not row.ways_up:
        return UNASKED
    way = easiest(row.ways_up)
    if way.utilisation is None:
        return Cell(borne_words(way), None, required)
    if not way.strength_known:
        return UNASKED
    there = row.loads["none"].stressed if "none" in row.loads else way.utilisation
    cell = share_of(way.utilisation, judged.rods[name].reserved(there, way.utilisation))
    return replace(cell, found=borne_words(way), asked=required)


def _deviating(judged: _Judged, bounds: Bounds) -> list[Check]:
    """Constraint (6), under the loads beyond the design load."""
    most = 1e3 * bounds.misfit
    found = judged.under(
        "Deviation",
        f"{number(most)} mm",
        _if_standing(
            lambda row, rods: below(
                1e3 * row.deviation_rms,
                most,
                "mm",
                allow("optimise.misfit_rms_additional", row.deviation_rms, or_else="take thicker rods"),
            )
        ),
        [load for load in judged.factors if load not in ("none", "design")],
    )
    return [replace(check, title=f"{check.title}, root mean square (6)") for check in found]


def _strained(row: LoadRecord, rods: RodsOf) -> Cell:
    """The rods' stress over their strength, with axial force; that on another mesh differs by as much as that
    of bending."""
    bending, error = row.rod_utilisation_max, row.rod_utilisation_error
    share = on_worse_mesh(row.stressed, error)
    return share_of(share, rods.less_stressed(on_worse_mesh(bending, error), share, 1.0))


def _edged(row: LoadRecord) -> Cell:
    """The stress of edge beams over their strength."""
    share = row.edge_utilisation_max or 0.0
    return share_of(
        share, f"Take edge beams {share:.1f} times as strong (edges.beam: more rods, or a section)."
    )


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
        limit = "at least what is demanded" if name.partition(".")[0] in AT_LEAST else "up to the limit"
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


def _if_standing(cell: Callable[[LoadRecord, RodsOf], Cell]) -> Callable[[LoadRecord, RodsOf], Cell]:
    """Without a remedy where the shape has collapsed: numbers of that one say nothing of the one that stands,
    and what makes it stand is told where it doesn't."""
    return lambda row, rods: replace(cell(row, rods), remedy="") if row.collapsed else cell(row, rods)


def _stands(row: LoadRecord, rods: RodsOf) -> Cell:
    if not row.collapsed:
        return Cell("stands", True)
    factor = row.critical_factor
    remedy = rods.stronger(1.0 / factor if factor else math.inf)
    return Cell("snapped through" if row.stable else "unstable", False, remedy=remedy)


def _settled(row: LoadRecord) -> Cell:
    return UNASKED if row.residual is None else Cell(number(row.residual, 1), bool(row.residual <= _SETTLED))


def _constraint(name: str, value: float) -> Cell:
    """From a residual, at most 0 where the constraint is kept."""
    if not math.isfinite(value):
        return Cell("not known", False)
    share, holds = share_of_limit(name, value), value <= SLACK
    if share is None:
        return Cell("within" if holds else "beyond", holds)
    at_least = name.partition(".")[0] in AT_LEAST
    return Cell(f"{share:.2f} ×" if at_least else f"{100.0 * share:.0f} %", holds)


def _stressed(value: float, rods: RodsOf) -> Cell:
    return share_of(value, rods.thinner(1.0 / value) if value > 0.0 else "")
