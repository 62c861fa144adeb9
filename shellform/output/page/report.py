"""One HTML page with everything that was found, for one run or several side by side: no network, no other
file.

The template, the style and the scripts stand in `assets/`; the template writes what can be read without a
script, and the three-dimensional view and its tables take their numbers from JSON inside the page, with
positions as base64 of little-endian float32. Titles, file names and settings are text from elsewhere: the
template escapes them, the JSON has no "<", and the page's own policy refuses every script but its own and
every request.
"""

from __future__ import annotations

import base64
import json
import math
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from shellform.arrays import Reals
from shellform.errors import InputError
from shellform.gridshell.catalogue import label
from shellform.gridshell.gridshell import Design, Gridshell
from shellform.optimiser.optimum import Step
from shellform.output.page import charts
from shellform.output.page.embed import Picture
from shellform.output.page.first_answers import answers
from shellform.output.page.template import filled, part
from shellform.output.pictures.colours import VIRIDIS
from shellform.problem.paths import deviations
from shellform.records import words
from shellform.records.check import Cell, Check
from shellform.records.summary import Summary, VerdictRecord
from shellform.records.verdict import asked, headline
from shellform.structure.elements.state import State
from shellform.surface.shape.target import Surface

GENERATOR = "shellform report"  # in the page's head, so that it is known again
_SCRIPTS = ("solid.js", "view.js", "tables.js", "page.js")
_MOST_TRIANGLES = 30_000  # of the surface in the view; more are merged
_MARKED = 0.2  # of the largest load on a node: smaller ones get no arrow


@dataclass(frozen=True)
class ShownRun:
    """One run on the page.

    `designs`, each with its `shells` (rods may differ) and its `states` by load case, of which `best` is to
    be built; `loads` (n, 6), N; the run's `summary`, and `checks` and `verdict` made from it; the optimiser's
    `history`; `settings`, the case file's text; `limit`, m, ends the colour scale; `force_max`, N, limits the
    cables; `notes` say what is missing or to be known; `files` are those of the run folder.
    """

    title: str
    place: str
    shells: Mapping[str, Gridshell]
    surface: Surface
    loads: Mapping[str, Reals]
    designs: Mapping[str, Design]
    states: Mapping[str, Mapping[str, State]]
    best: str
    summary: Summary
    checks: Sequence[Check]
    verdict: VerdictRecord
    history: Sequence[Step]
    settings: str
    pictures: Sequence[Picture]
    limit: float
    force_max: float
    notes: Sequence[str]
    files: Sequence[str]

    @property
    def shell(self) -> Gridshell:
        """The shell of the design to build."""
        return self.shells[self.best]


def html(runs: Sequence[ShownRun], versions: Mapping[str, str]) -> str:
    """The page. Raises InputError where there is no run to show."""
    if not runs:
        raise InputError("there is no run to report", where="report", remedy="Name one or more run folders.")
    return filled(
        "page.html",
        {
            "runs": [_content(run, number) for number, run in enumerate(runs)],
            "differences": _differences(runs),
            "versions": versions,
            "gradient": ", ".join(f"rgb{colour}" for colour in VIRIDIS),
        },
        generator=GENERATOR,
        style=part("style.css"),
        script="(() => {\n" + "\n".join(part(name) for name in _SCRIPTS) + "\n})();",
        data={"viridis": VIRIDIS, "runs": [_drawn(run) for run in runs]},
        number=words.number,
    )


def _content(run: ShownRun, number: int) -> dict[str, Any]:
    """What the template writes of a run."""
    summary = run.summary
    rows = [(name, words.design_title(name), summary.designs[name]) for name in run.designs]
    best = summary.designs[run.best]
    return {
        "id": f"run{number}",
        "title": run.title,
        "place": run.place,
        "best": run.best,
        "best_title": words.design_title(run.best),
        "finished": summary.optimisation is not None,
        "verdict": run.verdict,
        "headline": headline(run.verdict),
        "kind": "bad" if run.verdict.failed else "good" if run.verdict.holds else "open",
        "asked": asked(run.checks, run.best),
        "answers": answers(
            run.shell,
            run.best,
            run.designs[run.best],
            run.states[run.best],
            summary,
            as_built=_as_built(run, "additional"),
        ),
        "failure": summary.failure,
        "failure_load": "" if summary.failure is None else words.load_title(summary.failure.load),
        "designs": rows,
        "shown_first": sorted(rows, key=lambda each: each[0] != run.best),
        "loads": [(name, words.load_title(name, _factor(summary, name))) for name in run.loads],
        "checks": run.checks,
        "charts": _charts(run.history),
        "pictures": [(picture, _caption(picture.name)) for picture in run.pictures],
        "notes": [
            *run.notes,
            *(() if summary.net is None else summary.net.notes),
            *(() if summary.surface is None else summary.surface.mended),
        ],
        "settings": run.settings,
        "files": _folders(run.files),
        "model": {} if summary.model is None else asdict(summary.model),
        "source": "" if summary.surface is None else summary.surface.source,
        "optimisation": summary.optimisation,
        "seconds": dict(sorted(summary.seconds.items(), key=lambda each: each[0] == "total")),
        "rod": label(run.shell.rod.resized(run.designs[run.best].radius).section),
        "row": best,
        "limit": 1e3 * run.limit,
        "fitting": _fitting(run),
    }


def _fitting(run: ShownRun) -> float:
    """The end of a scale, mm, that the design to build fills under its design load: 1, 2 or 5 times a power of
    ten."""
    main = run.summary.designs[run.best].loads.get("design")
    largest = 1e3 * (run.limit if main is None else main.deviation_max)
    power = 10.0 ** math.floor(math.log10(max(largest, 1e-6)))
    return float(
        next(step * power for step in (1.0, 2.0, 5.0, 10.0) if largest <= step * power * (1.0 + 1e-9))
    )


def _as_built(run: ShownRun, load: str) -> Cell | None:
    """How many drawn structures of the design to build stand, as its check says."""
    title = f"As built under {words.load_title(load, _factor(run.summary, load))}"
    return next((check.cells.get(run.best) for check in run.checks if check.name == title), None)


def _factor(summary: Summary, load: str) -> float | None:
    return next((row.loads[load].factor for row in summary.designs.values() if load in row.loads), None)


def _caption(name: str) -> str:
    """A file's name in words: "utilisation-optimised-design" is "Utilisation: optimised, the design load"."""
    parts = [
        words.TITLES.get(part, words.LOADS.get(part, part.replace("_", " "))) for part in name.split("-")
    ]
    said = [part if k == 0 else part[:1].lower() + part[1:] for k, part in enumerate(parts)]
    text = said[0] + (": " + ", ".join(said[1:]) if len(said) > 1 else "")
    return text[:1].upper() + text[1:]


def _folders(files: Sequence[str]) -> dict[str, list[str]]:
    """File names by folder; "" for those in the run folder itself."""
    found: dict[str, list[str]] = {}
    for file in files:
        folder, _, name = file.rpartition("/")
        found.setdefault(folder, []).append(name)
    return found


def _charts(history: Sequence[Step]) -> list[charts.Chart]:
    """Objective and terms, constraints, and the number of cables at each accepted design."""
    steps = [step for step in history if step.accepted]
    if not steps:
        return []
    at = [float(step.evaluation) for step in steps]
    terms = {"objective": [step.objective for step in steps]}
    terms |= {name.replace("_", " "): [step.terms[name] for step in steps] for name in steps[0].terms}
    limits = {
        words.constraint_title(name): [step.constraints[name] for step in steps]
        for name in steps[0].constraints
    }
    found = [charts.line_chart("Objective and its terms", at, terms)]
    if limits:
        title = "Constraints: value over limit, less 1 (cut at −1.5 and 1)"
        found.append(charts.line_chart(title, at, limits, least=-1.5, most=1.0, limit=0.0, main=False))
    found.append(
        charts.line_chart("Cables in tension", at, {"cables": [float(step.cables) for step in steps]})
    )
    return found


def _differences(runs: Sequence[ShownRun]) -> list[tuple[str, list[str]]]:
    """Settings by name that are not the same in all runs, with each run's value ("–": not set)."""
    if len(runs) < 2:
        return []
    flat = [_flat(tomllib.loads(run.settings)) for run in runs]
    names = list(dict.fromkeys(name for each in flat for name in each))
    rows = [(name, [each.get(name, "–") for each in flat]) for name in names]
    return [(name, values) for name, values in rows if len(set(values)) > 1]


def _flat(table: Mapping[str, Any], prefix: str = "") -> dict[str, str]:
    found: dict[str, str] = {}
    for name, value in table.items():
        if isinstance(value, dict):
            found |= _flat(value, f"{prefix}{name}.")
        else:
            text = json.dumps(value, ensure_ascii=False)
            found[f"{prefix}{name}"] = text if len(text) <= 80 else f"{text[:77]}…"
    return found


def _drawn(run: ShownRun) -> dict[str, Any]:
    """What the view and the tables are made from: lengths in mm but for positions, which are in m from the
    `middle`; forces in N."""
    shell, grid = run.shell, run.shell.net.grid
    place = shell.target.positions
    middle = 0.5 * (place.min(axis=0) + place.max(axis=0))
    joint_of = {int(node): k for k, pair in enumerate(grid.crossing_nodes) for node in pair}
    vertices, triangles = _light(run.surface)
    return {
        "title": run.title,
        "limit": 1e3 * run.limit,
        "fitting": _fitting(run),
        "radius": shell.rod.radius,
        "spacing": shell.net.spacing,
        "strength": bool(np.isfinite(shell.rod.strength)),
        "force_max": run.force_max,
        "target": _floats(place - middle),
        "supports": shell.net.supports.tolist(),
        "rods": [
            {
                "name": f"{rod.direction.upper()}{number}",
                "nodes": rod.nodes.tolist(),
                "length": round(1e3 * rod.length, 3),
                "crossings": len(rod.crossings),
            }
            for number, rod in enumerate(grid.rods)
        ],
        "cables": {
            "ends": shell.cable_ends.tolist(),
            "joints": [[joint_of[int(n)] for n in pair] for pair in shell.cable_ends],
        },
        "surface": {"vertices": _floats(vertices - middle), "triangles": _bytes(triangles.astype("<u4"))},
        "loads": [
            {
                "name": name,
                "title": words.load_title(name, _factor(run.summary, name)),
                "points": _marked(load),
            }
            for name, load in run.loads.items()
        ],
        "designs": [_design(run, name) for name in run.designs],
        "best": list(run.designs).index(run.best),
    }


def _design(run: ShownRun, name: str) -> dict[str, Any]:
    shell, design = run.shells[name], run.designs[name]
    cables = shell.cables(design)
    states = {}
    for load, state in run.states[name].items():
        use = _utilisation(shell, design, state)
        away = deviations(shell, state)
        states[load] = {
            "positions": _floats(state.positions - _middle(shell)),
            "utilisation": _floats(use),
            "length": np.round(1e3 * cables.lengths(state), 4).tolist(),
            "force": [_short(value) for value in cables.tension(state)],
            "rods": [
                [round(1e3 * float(away[rod.nodes].max()), 4), _short(use[rod.nodes].max())]
                for rod in shell.net.grid.rods
            ],
        }
    return {
        "name": name,
        "title": words.design_title(name),
        "radius": design.radius,
        "cables": np.flatnonzero(design.present).tolist(),
        "rest": np.round(1e3 * cables.rest_length, 4).tolist(),
        "states": states,
    }


def _middle(shell: Gridshell) -> Reals:
    place = shell.target.positions
    return np.asarray(0.5 * (place.min(axis=0) + place.max(axis=0)))


def _utilisation(shell: Gridshell, design: Design, state: State) -> Reals:
    """Bending stress over strength (n,) at each node, the larger of its elements' ends; 0 where the strength
    isn't known.
    """
    use = np.zeros(shell.node_count)
    np.maximum.at(use, shell.net.grid.rod_ends, shell.bending_utilisation(design, state))
    return use


def _marked(load: Reals) -> list[int]:
    weight = np.linalg.norm(load[:, :3], axis=1)
    return [int(node) for node in np.flatnonzero(weight > _MARKED * weight.max())]


def _light(surface: Surface) -> tuple[Reals, Any]:
    """Vertices (v, 3), m, and triangles (t, 3) of the surface; of a fine one vertices in one cell of a cubic
    grid are merged to their mean."""
    vertices, triangles = np.asarray(surface.vertices), np.asarray(surface.triangles)
    if len(triangles) <= _MOST_TRIANGLES:
        return vertices, triangles
    size = np.sqrt(2.0 * surface.area / _MOST_TRIANGLES)
    _, cell = np.unique(
        np.floor((vertices - vertices.min(axis=0)) / size).astype(np.int64), axis=0, return_inverse=True
    )
    cell = cell.ravel()
    count = np.bincount(cell).astype(float)
    merged = np.column_stack([np.bincount(cell, vertices[:, k]) / count for k in range(3)])
    corners = cell[triangles]
    whole = (corners != np.roll(corners, 1, axis=1)).all(axis=1)
    return merged, corners[whole]


def _floats(values: Reals) -> str:
    return _bytes(np.asarray(values).astype("<f4"))


def _bytes(values: Any) -> str:
    return base64.b64encode(np.ascontiguousarray(values).tobytes()).decode()


def _short(value: float) -> float:
    return float(f"{value:.6g}")
