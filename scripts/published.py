"""A run of one of the paper's two studies (section 4.1), set beside what the paper says of it.

What is published stands in published.toml, each number with its place in the paper. A run gives the same
quantities under the same keys; the table joins them, and says of each line whether it must agree ("equal":
inputs, and relations that hold on any shape), can be compared in its order of magnitude only ("order": the
paper's surface is not public), or not at all ("none").
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from scripts import published_standing
from scripts.published_standing import Stands
from shellform.case.case import LoadEntry
from shellform.errors import InputError
from shellform.gridshell.loads import pressure
from shellform.optimiser.optimum import Step
from shellform.records.history import read_history
from shellform.records.summary import DesignRecord
from shellform.run.folder import Run
from shellform.tables import Table, table_text
from shellform.written import write_text

STUDIES = ("fixed", "radius")
# the paper's objective, where the case's has a share for what the paper knows nothing of
PAPER = {
    "fixed": ["optimise.misfit=0.7", "optimise.cable_force=0.3", "optimise.built_misfit=0"],
    "radius": [],
}
_DATA = Path(__file__).with_name("published.toml")
_ACTIVE = 0.02  # of a constraint's limit: the paper's 0.0 and -0.01 are active, its -0.05 is not
_TITLES = {
    "fixed": "Rods of 2 mm (section 4.1, figures 10 to 14)",
    "radius": "Rod radius free (section 4.1, figures 15 and 16)",
}
_SAYS = {"equal": "=", "order": "~", "none": "–"}

Value = float | str | None


@dataclass(frozen=True)
class Line:
    """One `quantity`: its value `here`, with the paper's `method` here, and in the `paper` (None: not known),
    all in `unit`; `source`, its place in the paper; `compare`: "equal", "order" or "none"; `note`."""

    key: str
    quantity: str
    here: Value
    method: Value
    paper: Value
    unit: str
    source: str
    compare: str
    note: str


def paper() -> dict[str, Any]:
    """What published.toml holds."""
    return tomllib.loads(_DATA.read_text(encoding="utf-8"))


def study_of(run: Run) -> str:
    """Which of the two studies the run is: "fixed" or "radius"."""
    return "radius" if run.case.optimise.rod_radius > 0.0 else "fixed"


def beside(run: Run, *, fixed: Run | None = None, method: Run | None = None) -> list[Line]:
    """The lines of the run's study in the paper's order. The study with a free radius is compared with the
    `fixed` one too, and either with a run of the paper's `method`, where given.

    Raises InputError where a run isn't finished, `fixed` is no run of the fixed radius, or `method` none of
    the same study by the paper's method.
    """
    study = study_of(run)
    if fixed is not None and study_of(fixed) != "fixed":
        raise InputError("is no run with a fixed radius", where=str(fixed.folder))
    if method is not None and (method.case.optimise.method != "paper" or study_of(method) != study):
        raise InputError(f"is no run of the study {study!r} by the paper's method", where=str(method.folder))
    values = quantities(run)
    theirs = {} if method is None else quantities(method)
    if fixed is not None and study == "radius":
        values |= _ratios(values, quantities(fixed))
    lines = [
        Line(
            each["key"],
            each["quantity"],
            values.get(each["key"]),
            theirs.get(each["key"]),
            each.get("value"),
            each.get("unit", ""),
            each["source"],
            each["compare"],
            each.get("note", ""),
        )
        for each in paper()["values"]
        if each["study"] in (study, "both")
    ]
    return lines + _beyond(run, values)


def quantities(run: Run) -> dict[str, Value]:
    """What the run says, by the keys and in the units of published.toml."""
    summary, steps = run.summary, history(run)
    optimisation, net, surface, model = summary.optimisation, summary.net, summary.surface, summary.model
    if "optimised" not in run.designs or not steps or not (optimisation and net and surface and model):
        raise InputError(
            "the run isn't finished",
            where=str(run.folder),
            remedy="Run shellform design on it without --until.",
        )
    designs, start = summary.designs, steps[0]
    first, best = designs["initial"], designs["optimised"]
    misfits = [model.nodes * each.loads["design"].deviation_rms ** 2 for each in (first, best)]
    # The second term of the objective at the start is its share, and so on.
    shares = [start.terms.get(name, 0.0) for name in ("misfit", "cable_force", "rod_radius")]
    found: dict[str, Value] = {
        **_inputs(run),
        "length": surface.size[0],
        "width": surface.size[1],
        "height": surface.size[2],
        "radius_max": None if net.rod_radius_max is None else 1e3 * net.rod_radius_max,
        "nodes": model.nodes,
        "cables_start": first.cables,
        "iterations": optimisation.iterations,
        "misfit_weight": shares[0] / misfits[0],
        "force_weight": shares[1] / first.cable_force_sum,
        "radius_weight": shares[2] / first.rod_radius,
        "misfit_start": misfits[0],
        "misfit_end": misfits[1],
        "force_start": first.cable_force_sum,
        "force_end": best.cable_force_sum,
        "radius_start": 1e3 * first.rod_radius,
        "radius_end": 1e3 * best.rod_radius,
        "objective_start": start.objective,
        "objective_end": optimisation.objective_end,
        "cables_end": best.cables,
        "force_largest": run.case.cable.force_max
        * (1.0 + max(step.constraints["cable_force"] for step in steps)),
        "c1_start": start.constraints["misfit.additional"],
        "c1_end": optimisation.constraints["misfit.additional"],
        "c2_start": start.constraints["cable_force"],
        "c2_end": optimisation.constraints["cable_force"],
    }
    for name, design in designs.items():
        for load, each in design.loads.items():
            found[f"deviation.{name}.{load}.max"] = 1e3 * each.deviation_max
            found[f"deviation.{name}.{load}.mean"] = 1e3 * each.deviation_mean
    return {**found, **_relations(designs, found)}


def history(run: Run) -> list[Step]:
    """The accepted designs of history.csv."""
    return [step for step in read_history(run.folder) if step.accepted]


def table(lines: Sequence[Line]) -> Table:
    """The lines as a table."""
    heads = ("key", "quantity", "unit", "here", "method", "paper", "compare", "source", "note")
    rows = tuple(
        (
            line.key,
            line.quantity,
            line.unit,
            *map(_exact, (line.here, line.method, line.paper)),
            line.compare,
            line.source,
            line.note,
        )
        for line in lines
    )
    return Table("published", heads, rows)


def _exact(value: Value) -> str | None:
    """A number with all its digits."""
    return None if value is None else str(value)


def page(run: Run, lines: Sequence[Line]) -> str:
    """The lines and the run's history as Markdown."""
    rows = [
        f"| {line.quantity} | {_number_text(line.here)} | {_number_text(line.method)} | {_number_text(line.paper, digits=4)} | {line.unit} | {_SAYS[line.compare]} "
        f"| {line.source} | {line.note} |"
        for line in lines
    ]
    first = history(run)[0]
    terms, constraints = list(first.terms), list(first.constraints)
    names = [*(f"term.{name}" for name in terms), *(f"constraint.{name}" for name in constraints)]
    columns = ["evaluation", "objective", *names, "cables"]
    steps = [_line(step, terms, constraints) for step in history(run)]
    return "\n".join(
        [
            f"# {_TITLES[study_of(run)]}",
            "",
            "= must agree; ~ depends on the shape: orders of magnitude only, the paper's surface not being public; – can't be",
            "compared.",
            "",
            "| quantity | here | the paper's method here | paper | unit | | where in the paper | note |",
            "| --- | --- | --- | --- | --- | --- | --- | --- |",
            *rows,
            "",
            "Accepted designs. The paper draws these curves (figures 10 and 11, 15 and 16); its text gives their ends above. Here they",
            "are drawn in figures/objective.png and figures/constraints.png, the deviations in figures/deviations.png.",
            "",
            "| " + " | ".join(columns) + " |",
            "| " + " | ".join("---" for _ in columns) + " |",
            *steps,
            "",
        ]
    )


def _line(step: Step, terms: Sequence[str], constraints: Sequence[str]) -> str:
    """An accepted design in the table."""
    values = [
        step.objective,
        *(step.terms[name] for name in terms),
        *(step.constraints[name] for name in constraints),
    ]
    cells = [str(step.evaluation), *(_number_text(value) for value in values), str(step.cables)]
    return f"| {' | '.join(cells)} |"


def write_beside(
    run: Run, *, fixed: Run | None = None, method: Run | None = None, stands: Sequence[Stands] = ()
) -> list[Path]:
    """Writes published.md and published.csv into the run's folder, and with `stands` published_standing.csv;
    returns them."""
    lines = beside(run, fixed=fixed, method=method)
    texts = {"published.md": page(run, lines), "published.csv": table_text(table(lines))}
    if stands:
        texts["published.md"] += "\n" + published_standing.page(stands)
        texts["published_standing.csv"] = table_text(published_standing.table(stands))
    files = [run.folder / name for name in texts]
    for file, text in zip(files, texts.values(), strict=True):
        write_text(file, text)
    return files


def _inputs(run: Run) -> dict[str, Value]:
    """What the case puts in."""
    case = run.case
    point = isinstance(case.load, LoadEntry)
    return {
        "spacing": 1e3 * case.net.spacing,
        "young": 1e-9 * run.shell.rod.young,
        "elements": case.net.elements,
        "cable_stiffness": case.cable.stiffness,
        "rest_ratio": case.cable.rest_ratio,
        "joint_axial": case.joint.axial,
        "joint_torsion": case.joint.torsion,
        "joint_bending": case.joint.bending,
        "load": case.load.force if isinstance(case.load, LoadEntry) else None,
        "additional": case.load.additional if isinstance(case.load, LoadEntry) else None,
        "force_max": case.cable.force_max,
        "rms_max": 1e3 * case.optimise.misfit_rms_additional,
        "pressure": pressure(0.05, 2500.0) if point else None,
        "node_force": pressure(0.0025, 50_000.0) * case.net.spacing**2 if point else None,
        "node_force_large": pressure(0.05, 2500.0) * (20.0 * case.net.spacing) ** 2 if point else None,
        "share_misfit": case.optimise.misfit,
        "share_force": case.optimise.cable_force,
        "share_radius": case.optimise.rod_radius,
    }


def _relations(designs: Mapping[str, DesignRecord], values: Mapping[str, Value]) -> dict[str, Value]:
    """What the paper says of its designs that should hold on any shape, "yes" or "no"; left out where a
    design was not made.
    """

    def away(name: str, load: str) -> float:
        return designs[name].loads[load].deviation_rms

    braced = [name for name in ("initial", "unloaded") if name in designs]
    found = {"half_vanish": designs["optimised"].cables < 0.5 * designs["initial"].cables}
    found["c1_active"] = abs(_number(values["c1_end"])) < _ACTIVE <= abs(_number(values["c2_end"]))
    if "unbraced" in designs:
        found["unbraced_snaps"] = not designs["unbraced"].loads["design"].on_branch
    if "unloaded" in designs:
        found["unloaded_fits_best"] = all(
            away("unloaded", "none") < away(name, "none") for name in designs if name != "unloaded"
        )
        found["optimised_fits_best"] = all(
            away("optimised", "none") > away(name, "none") for name in braced
        ) and all(
            away("optimised", load) < away(name, load) for name in braced for load in ("design", "additional")
        )
    return {name: "yes" if value else "no" for name, value in found.items()}


def _beyond(run: Run, values: Mapping[str, Value]) -> list[Line]:
    """The polished design, which the paper doesn't have."""
    polished = run.summary.designs.get("polished")
    if polished is None:
        return []
    lines: list[tuple[str, str, Value, str]] = [
        ("cables_polished", "cables of the polished design", polished.cables, "")
    ]
    for load in ("none", "design", "additional"):
        for word, said in (("max", "largest"), ("mean", "mean")):
            key = f"deviation.polished.{load}.{word}"
            lines.append((key, f"{said} deviation, load {load!r}: polished design", values[key], "mm"))
    return [
        Line(key, quantity, here, None, None, unit, "–", "none", "past the paper")
        for key, quantity, here, unit in lines
    ]


def _ratios(free: Mapping[str, Value], fixed: Mapping[str, Value]) -> dict[str, Value]:
    """The study with a free radius over the one with a fixed radius."""
    names = ("misfit", "force", "cables", "radius")
    ratio = {name: _number(free[f"{name}_end"]) / _number(fixed[f"{name}_end"]) for name in names}
    lower = all(ratio[name] < 1.0 for name in names[:3])
    changes: dict[str, Value] = {f"{name}_change": value for name, value in ratio.items()}
    return {**changes, "all_lower": "yes" if lower else "no"}


def _number(value: Value) -> float:
    assert isinstance(value, (int, float))
    return value


def _number_text(value: Value, digits: int = 3) -> str:
    """Numbers with so many digits, a dash for what is not known."""
    if value is None:
        return "–"
    if isinstance(value, str):
        return value
    return f"{value:.0f}" if 1e3 <= abs(value) < 1e5 else f"{value:.{digits}g}"
