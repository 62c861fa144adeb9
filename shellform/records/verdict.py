"""What a run's numbers say: checks with pass or fail for every design, and the verdict on the one to build.

A check compares a number of the summary with its limit, and says nothing where a design was never asked for
it. A computation that ended without a result fails: its residual is no number. Numbers stand in the units in
which people read them: mm, N, %. Terminal, summary.json and page all show the one verdict made here.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

from shellform.gridshell.gridshell import Design, Gridshell, max_radius
from shellform.records.summary import (
    DesignRecord,
    LoadRecord,
    OptimisationRecord,
    Summary,
    VerdictRecord,
)
from shellform.records.words import constraint_title, load_title, number

_MADE_FROM_IT = ("rounded", "polished")
_BUILT = ("polished", "rounded", "optimised")
_AT_LEAST = ("softness", "slackness")  # of which as much is demanded, not at most
_SETTLED = 1e-6  # unbalanced over largest force: what an equilibrium that counts as found stays below
SLACK = 1e-3  # of a limit: what the optimiser itself lets pass


@dataclass(frozen=True)
class Bounds:
    """What the case limits: tension `force`, N, of cables under the design load and those beyond it; root
    mean square `misfit`, m, under those beyond it; and where an engineer asked for it (None: not) `stress`
    over strength, connectors' `turn`, rad, `uplift`, N, of supports under any load, and the `critical` factor
    of the design load up to which it stays stable."""

    force: float
    misfit: float
    stress: float | None = None
    turn: float | None = None
    uplift: float | None = None
    critical: float | None = None


@dataclass(frozen=True)
class Cell:
    """One check of one design: what it `found`, in words, whether it `holds` (None: that isn't known), and
    whether it was `asked` for at all."""

    found: str
    holds: bool | None
    asked: bool = True


@dataclass(frozen=True)
class Check:
    """One check of all designs: its `name`, the `limit` in words, and a cell by design."""

    name: str
    limit: str
    cells: Mapping[str, Cell]


_UNASKED = Cell("–", None, False)
_UNKNOWN = Cell("not known", None)


def checks(
    shells: Mapping[str, Gridshell], designs: Mapping[str, Design], summary: Summary, bounds: Bounds
) -> list[Check]:
    """Every check of the designs, each on its own shell: standing, stress, forces, misfit, the optimiser's
    own constraints, equilibrium."""
    rows = {name: summary.designs[name] for name in designs if name in summary.designs}
    loads = list(dict.fromkeys(load for row in rows.values() for load in row.loads))
    factors = {load: row.loads[load].factor for row in rows.values() for load in row.loads}

    def under(
        title: str, limit: str, cell: Callable[[LoadRecord], Cell], chosen: Sequence[str]
    ) -> list[Check]:
        return [
            Check(
                f"{title} under {load_title(load, factors[load])}",
                limit,
                {
                    name: cell(rows[name].loads[load])
                    if name in rows and load in rows[name].loads
                    else _UNASKED
                    for name in designs
                },
            )
            for load in chosen
        ]

    bent = {
        name: _share(designs[name].radius / max_radius(shells[name].net, shells[name].rod))
        for name in designs
    }
    beyond = [load for load in loads if load not in ("none", "design")]
    misfit = 1e3 * bounds.misfit
    deviating = [
        Check(f"{check.name}, root mean square (6)", check.limit, check.cells)
        for check in under(
            "Deviation",
            f"{number(misfit)} mm",
            lambda row: _below(1e3 * row.deviation_rms, misfit, "mm"),
            beyond,
        )
    ]
    return [
        *under("Stands", "stable, without snapping through", _stands, loads),
        *under(
            "Rods", "stress up to 100 % of the strength", lambda row: _share(row.rod_utilisation_max), loads
        ),
        Check("Rods bent into the shape (1)", "up to 100 % of the curvature they bear", bent),
        *_limited(rows, list(designs), bounds),
        *deviating,
        *_of_the_optimiser(summary.optimisation, rows, list(designs)),
        *under("In equilibrium", f"unbalanced force up to {_SETTLED:.0e} of the largest", _settled, loads),
    ]


def failed(found: Sequence[Check], design: str) -> list[Check]:
    """The checks that don't hold for the design; for one made from the optimised one those of the constraints
    it was made under as well."""
    return [check for check in found if any(_fails(check, name, design) for name in _counted(design))]


def asked(found: Sequence[Check], design: str) -> int:
    """How many checks were made of the design."""
    return sum(
        any(name in check.cells and check.cells[name].holds is not None for name in _counted(design))
        for check in found
    )


def verdict(found: Sequence[Check], design: str) -> VerdictRecord:
    """Whether the design to build holds, by its checks."""
    broken = tuple(check.name for check in failed(found, design))
    unknown = tuple(
        check.name
        for check in found
        if design in check.cells and check.cells[design].asked and check.cells[design].holds is None
    )
    return VerdictRecord(design, not broken, broken, unknown)


def _counted(design: str) -> list[str]:
    """The designs whose checks count for this one."""
    return [design, "optimised"] if design in _MADE_FROM_IT else [design]


def _fails(check: Check, name: str, design: str) -> bool:
    own = check.cells.get(design)
    if name != design and own is not None and own.holds is not None:
        return False  # its own check counts, not the one of the design it was made from
    cell = check.cells.get(name)
    return cell is not None and cell.holds is False


def _limited(rows: Mapping[str, DesignRecord], designs: Sequence[str], bounds: Bounds) -> list[Check]:
    """Constraint (5), and what an engineer limits, each at its worst over the load cases."""

    def worst(title: str, unit: str, limit: float, value: Callable[[DesignRecord], float | None]) -> Check:
        cells = {name: _below(value(rows[name]) if name in rows else None, limit, unit) for name in designs}
        return Check(title, f"{number(limit)} {unit}", cells)

    found = [
        worst(
            "Largest cable force under the design load and those beyond it (5)",
            "N",
            bounds.force,
            lambda row: (
                _largest(each.cable_force_max for load, each in row.loads.items() if load != "none")
                or row.cable_force_max
            ),
        )
    ]
    if bounds.stress is not None:
        found.append(
            worst(
                "Rods' stress with axial force under any load",
                "% of the strength",
                100.0 * bounds.stress,
                lambda row: _largest((each.stress_utilisation_max for each in row.loads.values()), 100.0),
            )
        )
    if bounds.turn is not None:
        degrees = 180.0 / math.pi
        found.append(
            worst(
                "Connectors' turning under any load",
                "°",
                degrees * bounds.turn,
                lambda row: _largest((each.connector_turn_max for each in row.loads.values()), degrees),
            )
        )
    if bounds.uplift is not None:
        found.append(
            worst(
                "Uplift of a support under any load",
                "N",
                bounds.uplift,
                lambda row: _largest(each.uplift_max for each in row.loads.values()),
            )
        )
    if bounds.critical is not None:
        least = bounds.critical
        cells = {name: _stays(rows.get(name), least) for name in designs}
        found.append(
            Check("Stays stable beyond the design load", f"up to {least:g} × the design load", cells)
        )
    return found


def _of_the_optimiser(
    record: OptimisationRecord | None, rows: Mapping[str, DesignRecord], designs: Sequence[str]
) -> list[Check]:
    """The optimiser's own constraints, for the optimised design, and the wishes for cables."""
    if record is None:
        return []
    found = []
    for name, value in record.constraints.items():
        cell = _constraint(name, value)
        limit = "at least what is demanded" if name.partition(".")[0] in _AT_LEAST else "up to the limit"
        cells = {design: cell if design == "optimised" else _UNASKED for design in designs}
        found.append(Check(f"Optimiser: {constraint_title(name)}", limit, cells))
    if record.cables_max is not None:
        most = record.cables_max.asked
        cells = {
            design: Cell(f"{rows[design].cables}", rows[design].cables <= most)
            if design in rows and design in _BUILT
            else _UNASKED
            for design in designs
        }
        found.append(Check("Number of cables", f"up to {most}, as far as the limits allow", cells))
    if record.symmetric is not None:
        kept, groups = record.symmetric.kept, record.symmetric.groups
        words = f"{groups} lengths" if kept else record.not_polished or "not alike"
        built = next((name for name in _BUILT if name in designs), "")
        cells = {design: Cell(words, kept) if design == built else _UNASKED for design in designs}
        found.append(Check("Symmetric cables have one length", "asked for", cells))
    return found


def _largest(values: Iterable[float | None], scale: float = 1.0) -> float | None:
    """The largest of those that are known, times the scale."""
    return max((scale * value for value in values if value is not None), default=None)


def _stands(row: LoadRecord) -> Cell:
    if not row.stable:
        return Cell("unstable", False)
    return Cell("stands", True) if row.on_branch else Cell("snapped through", False)


def _stays(design: DesignRecord | None, least: float) -> Cell:
    row = None if design is None else design.loads.get("design")
    if row is None:
        return _UNKNOWN
    if row.critical_factor is not None:
        return Cell(f"{row.critical_factor:.2f} ×", row.critical_factor >= least * (1.0 - SLACK))
    if row.critical_sought is not None and row.critical_kind is None:
        return Cell(f"beyond {row.critical_sought:g} ×", row.critical_sought >= least)
    return _UNKNOWN


def _settled(row: LoadRecord) -> Cell:
    return _UNASKED if row.residual is None else Cell(f"{row.residual:.0e}", bool(row.residual <= _SETTLED))


def _share(value: float) -> Cell:
    return Cell(f"{100.0 * value:.0f} %", value <= 1.0 + SLACK) if math.isfinite(value) else _UNKNOWN


def _below(value: float | None, limit: float, unit: str) -> Cell:
    if value is None or not math.isfinite(value):
        return _UNKNOWN
    return Cell(f"{number(value)} {unit}", value <= limit * (1.0 + SLACK))


def _constraint(name: str, value: float) -> Cell:
    """From value / limit - 1 <= 0. A misfit counts by its square, a softness is 1 - (stiffness / least)², a
    slackness 1 - pull / least, and an uplift is offset, so that its share tells nothing."""
    if not math.isfinite(value):
        return Cell("not known", False)
    kind, holds = name.partition(".")[0], value <= SLACK
    if kind in _AT_LEAST:
        ratio = math.sqrt(max(1.0 - value, 0.0)) if kind == "softness" else 1.0 - value
        return Cell(f"{ratio:.2f} ×", holds)
    if kind == "uplift":
        return Cell("within" if holds else "beyond", holds)
    share = math.sqrt(max(1.0 + value, 0.0)) if kind == "misfit" else 1.0 + value
    return Cell(f"{100.0 * share:.0f} %", holds)
