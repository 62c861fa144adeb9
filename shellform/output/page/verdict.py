"""What a run's numbers say: checks with pass or fail for every design, and the answers to what a designer
asks first.

A check compares a number of the summary with its limit, and says nothing where a design was never asked for
it. A computation that ended without a result fails: its residual is no number. Numbers stand in the units in
which people read them: mm, N, %.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from shellform.gridshell.catalogue import label
from shellform.gridshell.gridshell import Design, Gridshell, max_radius
from shellform.structure.elements.sections import mass_per_length
from shellform.structure.elements.state import State

LOADS = {"none": "no load", "design": "the design load", "additional": "the additional load"}
TITLES = {
    "unbraced": "Unbraced",
    "initial": "Initial",
    "unloaded": "Optimised unloaded",
    "optimised": "Optimised",
    "rounded": "Rounded",
    "polished": "Polished",
}
_CONSTRAINTS = {
    "cable_force": "cable forces",
    "misfit": "misfit",
    "robust_misfit": "misfit with scatter",
    "softness": "stiffness of the softest mode",
    "utilisation": "rods' stress",
    "connector_turn": "connectors' turning",
    "slackness": "least pull of a cable",
    "uplift": "uplift of supports",
}
_MADE_FROM_IT = ("rounded", "polished")
_AT_LEAST = ("softness", "slackness")  # of which as much is demanded, not at most
_SETTLED = 1e-6  # unbalanced over largest force: what an equilibrium that counts as found stays below
_SLACK = 1e-3  # of a limit: what the optimiser itself lets pass


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
    """One check of one design: what it found, in words, and whether it `holds` (None: not asked)."""

    told: str
    holds: bool | None


@dataclass(frozen=True)
class Check:
    """One check of all designs: its `name`, the `limit` in words, and a cell by design."""

    name: str
    limit: str
    cells: Mapping[str, Cell]


def load_title(name: str, factor: float | None = None) -> str:
    """A load case in words."""
    told = LOADS.get(name, f"“{name}”")
    return f"{factor:.3g} × the load" if name == "additional" and factor is not None else told


def design_title(name: str) -> str:
    """A design in words."""
    return TITLES.get(name, name)


def checks(
    shells: Mapping[str, Gridshell], designs: Mapping[str, Design], summary: Mapping[str, Any], bounds: Bounds
) -> list[Check]:
    """Every check of the designs, each on its own shell: standing, stress, forces, misfit, the optimiser's
    own constraints, equilibrium."""
    told: Mapping[str, Any] = {name: summary.get("designs", {}).get(name, {}) for name in designs}
    loads = list(dict.fromkeys(load for row in told.values() for load in row.get("loads", {})))
    factors = {
        load: row["loads"][load].get("factor")
        for row in told.values()
        for load in loads
        if load in row.get("loads", {})
    }
    found: list[Check] = []

    def each(name: str, limit: str, cell: Any) -> None:
        found.append(Check(name, limit, {design: cell(design) for design in designs}))

    def of(load: str, cell: Any) -> Any:
        return lambda design: (
            cell(told[design]["loads"][load]) if load in told[design].get("loads", {}) else Cell("–", None)
        )

    for load in loads:
        each(
            f"Stands under {load_title(load, factors[load])}",
            "stable, without snapping through",
            of(load, _stands),
        )
    for load in loads:
        each(
            f"Rods under {load_title(load, factors[load])}",
            "stress up to 100 % of the strength",
            of(load, lambda row: _share(row.get("rod_utilisation_max"))),
        )
    each(
        "Rods bent into the shape (1)",
        "up to 100 % of the curvature they bear",
        lambda design: _share(designs[design].radius / max_radius(shells[design].net, shells[design].rod)),
    )

    def worst(design: str, key: str, loaded: bool = False) -> float | None:
        rows = [row for load, row in told[design].get("loads", {}).items() if load != "none" or not loaded]
        return max((row[key] for row in rows if row.get(key) is not None), default=None)

    each(
        "Largest cable force under the design load and those beyond it (5)",
        f"{number(bounds.force)} N",
        lambda design: _below(
            worst(design, "cable_force_max", True) or told[design].get("cable_force_max"), bounds.force, "N"
        ),
    )
    for title, key, limit, scale, unit in (
        (
            "Rods' stress with axial force under any load",
            "stress_utilisation_max",
            bounds.stress,
            100.0,
            "% of the strength",
        ),
        ("Connectors' turning under any load", "connector_turn_max", bounds.turn, 180.0 / math.pi, "°"),
        ("Uplift of a support under any load", "uplift_max", bounds.uplift, 1.0, "N"),
    ):
        if limit is not None:
            values = {design: worst(design, key) for design in designs}
            cells = {
                d: _below(None if v is None else scale * v, scale * limit, unit) for d, v in values.items()
            }
            found.append(Check(title, f"{number(scale * limit)} {unit}", cells))
    if bounds.critical is not None:
        least = bounds.critical
        each(
            "Stays stable beyond the design load",
            f"up to {least:g} × the design load",
            lambda design: _stays(told[design].get("loads", {}).get("design", {}), least),
        )
    for load in loads:
        if load not in ("none", "design"):
            each(
                f"Deviation under {load_title(load, factors[load])}, root mean square (6)",
                f"{number(1e3 * bounds.misfit)} mm",
                of(
                    load,
                    lambda row: _below(1e3 * row.get("deviation_rms", math.nan), 1e3 * bounds.misfit, "mm"),
                ),
            )
    for name, value in (summary.get("optimisation") or {}).get("constraints", {}).items():
        cell = _constraint(name, value)
        cells = {design: cell if design == "optimised" else Cell("–", None) for design in designs}
        found.append(Check(constraint_title(name), _constraint_limit(name), cells))
    optimised = summary.get("optimisation") or {}
    built = next((name for name in ("polished", "rounded", "optimised") if name in designs), "")
    if "cables_max" in optimised:
        least, kept = optimised["cables_max"], {"unloaded", "initial", "unbraced"}
        each(
            "Number of cables",
            f"up to {least['asked']}, as far as the limits allow",
            lambda design: (
                Cell("–", None)
                if design in kept
                else Cell(f"{told[design]['cables']}", told[design]["cables"] <= least["asked"])
            ),
        )
    if "symmetric" in optimised:
        alike = optimised["symmetric"]
        words = f"{alike['groups']} lengths" if alike["kept"] else optimised.get("not_polished", "not alike")
        each(
            "Symmetric cables have one length",
            "asked for",
            lambda design: Cell(words, bool(alike["kept"])) if design == built else Cell("–", None),
        )
    for load in loads:
        each(
            f"In equilibrium under {load_title(load, factors[load])}",
            f"unbalanced force up to {_SETTLED:.0e} of the largest",
            of(load, _settled),
        )
    return found


def failed(found: Sequence[Check], design: str) -> list[Check]:
    """The checks that don't hold for the design; for one made from the optimised one those of the constraints
    it was made under as well."""
    names = [design, "optimised"] if design in _MADE_FROM_IT else [design]
    return [check for check in found if any(_fails(check, name, design) for name in names)]


def asked(found: Sequence[Check], design: str) -> int:
    """How many checks were made of the design."""
    names = [design, "optimised"] if design in _MADE_FROM_IT else [design]
    return sum(
        any(name in check.cells and check.cells[name].holds is not None for name in names) for check in found
    )


def constraint_title(name: str) -> str:
    """A constraint of the optimiser in words."""
    kind, _, load = name.partition(".")
    told = f"Optimiser: {_CONSTRAINTS.get(kind, kind.replace('_', ' '))}"
    return f"{told}, {load} load" if load else told


def number(value: float, digits: int = 3) -> str:
    """A number for people: so many digits, no exponent where it can be avoided."""
    if not math.isfinite(value):
        return "?"
    if value == 0.0 or 1e-3 <= abs(value) < 1e6:
        places = 0 if value == 0.0 else max(0, digits - 1 - math.floor(math.log10(abs(value))))
        text = f"{value:,.{places}f}".replace(",", "\u202f")
        return text.rstrip("0").rstrip(".") if "." in text else text
    return f"{value:.{digits}g}"


@dataclass(frozen=True)
class Answer:
    """What a designer asks first: the `question`, the answer in a few words, what stands behind it, and if it
    is `good` (None: neither)."""

    question: str
    told: str
    detail: str
    good: bool | None = None


def answers(
    shell: Gridshell, name: str, design: Design, states: Mapping[str, State], summary: Mapping[str, Any]
) -> list[Answer]:
    """How far off is the shell, how many cables, which rods, is it safe beyond the load, what to buy: for the
    design to build."""
    row = summary.get("designs", {}).get(name, {})
    loads = row.get("loads", {})
    main, more = loads.get("design", {}), loads.get("additional", {})
    section = shell.rod.resized(design.radius).section
    grid, cables = shell.net.grid, shell.cables(design)
    rods = np.array([rod.length for rod in grid.rods])
    found = []
    if main:
        found.append(
            Answer(
                "How far off is the shell?",
                f"{_mm(main['deviation_max'])} at most",
                f"{_mm(main['deviation_mean'])} in the mean, under the design load",
                None if main.get("stable") and main.get("on_branch", True) else False,
            )
        )
    pull = cables.tension(states["design"]) if "design" in states else np.zeros(len(cables.ends))
    found.append(
        Answer(
            "How many cables?",
            f"{len(cables.ends)} of {len(shell.cable_ends)}",
            f"{number(float(pull.max(initial=0.0)))} N at most in one, {number(float(pull.sum()))} N in all, "
            "under the design load",
        )
    )
    used = main.get("rod_utilisation_max")
    stressed = (
        ""
        if used is None or not math.isfinite(shell.rod.strength)
        else f"; at {100 * used:.0f} % of their strength"
    )
    found.append(
        Answer(
            "Which rods?",
            label(section),
            f"{len(rods)} rods of up to {number(1e3 * float(rods.max()))} mm{stressed}",
            None,
        )
    )
    if more:
        factor = more.get("factor", math.nan)
        used = more.get("rod_utilisation_max", math.nan)
        known = math.isfinite(used) and math.isfinite(shell.rod.strength)
        rods_told = f", rods at {100.0 * used:.0f} % of their strength" if known else ""
        if not more.get("stable"):
            safe, words = False, "No, it is unstable"
        elif not more.get("on_branch", True):
            safe, words = False, "No, it snaps through"
        elif known and used > 1.0 + _SLACK:
            safe, words = False, "No, rods break"
        else:
            safe, words = True, "Yes, it stands"
        off = (
            f"{_mm(more['deviation_max'])} off at most, {_mm(more['deviation_mean'])} in the mean{rods_told}"
        )
        found.append(
            Answer(f"Is it safe at {factor:.3g} × the load?", words, f"{off}. {_collapse(main)}", safe)
        )
    mass = mass_per_length(section) * float(rods.sum())
    weight = f" ({number(mass)} kg)" if mass > 0.0 else ""
    found.append(
        Answer(
            "What to buy?",
            f"{number(float(rods.sum()))} m of rod{weight}",
            f"{len(rods)} rods, {len(grid.lattice)} connectors, {len(shell.net.supports)} supports, {len(cables.ends)} cables of "
            f"{number(float(cables.rest_length.sum()))} m in all{_lengths(summary)}",
        )
    )
    return found


def _lengths(summary: Mapping[str, Any]) -> str:
    """To how many lengths the cables are cut, where that is known."""
    count = summary.get("documents", {}).get("cut_lengths")
    return "" if count is None else f", cut to {count} different lengths"


def _collapse(row: Mapping[str, Any]) -> str:
    """What is known of the load at which the shell loses stability, from the design load's part of the
    summary.
    """
    if row.get("critical_factor") is not None:
        return f"Stability ends at {row['critical_factor']:.2f} × the design load."
    if row.get("critical_sought") is not None and row.get("critical_kind") is None:
        return f"Stable up to {row['critical_sought']:g} × the design load, the most that was tried."
    return "At which load it collapses isn't known."


def _mm(metres: float) -> str:
    return f"{number(1e3 * metres, 2)} mm"


def _fails(check: Check, name: str, design: str) -> bool:
    own = check.cells.get(design)
    if name != design and own is not None and own.holds is not None:
        return False  # its own check counts, not the one of the design it was made from
    cell = check.cells.get(name)
    return cell is not None and cell.holds is False


def _stands(row: Mapping[str, Any]) -> Cell:
    if not row.get("stable", False):
        return Cell("unstable", False)
    return Cell("stands", True) if row.get("on_branch", True) else Cell("snapped through", False)


def _stays(row: Mapping[str, Any], least: float) -> Cell:
    if row.get("critical_factor") is not None:
        return Cell(f"{row['critical_factor']:.2f} ×", row["critical_factor"] >= least * (1.0 - _SLACK))
    if row.get("critical_sought") is not None and row.get("critical_kind") is None:
        return Cell(f"beyond {row['critical_sought']:g} ×", row["critical_sought"] >= least)
    return Cell("not known", None)


def _settled(row: Mapping[str, Any]) -> Cell:
    residual = row.get("residual")
    if residual is None:
        return Cell("–", None)
    return Cell(f"{residual:.0e}", bool(residual <= _SETTLED))


def _share(value: float | None) -> Cell:
    if value is None or not math.isfinite(value):
        return Cell("not known", None)
    return Cell(f"{100.0 * value:.0f} %", value <= 1.0 + _SLACK)


def _below(value: float | None, limit: float, unit: str) -> Cell:
    if value is None or not math.isfinite(value):
        return Cell("not known", None)
    return Cell(f"{number(value)} {unit}", value <= limit * (1.0 + _SLACK))


def _constraint_limit(name: str) -> str:
    return "at least what is demanded" if name.partition(".")[0] in _AT_LEAST else "up to the limit"


def _constraint(name: str, value: float) -> Cell:
    """From value / limit - 1 <= 0. A misfit counts by its square, a softness is 1 - (stiffness / least)², a
    slackness 1 - pull / least, and an uplift is offset, so that its share tells nothing."""
    if not math.isfinite(value):
        return Cell("not known", False)
    kind, holds = name.partition(".")[0], value <= _SLACK
    if kind in _AT_LEAST:
        ratio = math.sqrt(max(1.0 - value, 0.0)) if kind == "softness" else 1.0 - value
        return Cell(f"{ratio:.2f} ×", holds)
    if kind == "uplift":
        return Cell("within" if holds else "beyond", holds)
    share = math.sqrt(max(1.0 + value, 0.0)) if kind == "misfit" else 1.0 + value
    return Cell(f"{100.0 * share:.0f} %", holds)
