"""One HTML page with everything that was found, for one run or several side by side: no network, no other
file.

The template, the style and the scripts stand in `assets/`; the template writes what can be read without a
script, and the three-dimensional view and its tables take their numbers from JSON inside the page, with
positions as base64 of little-endian float32. Titles, file names and settings are text from elsewhere: the
template escapes them, the JSON has no "<", and the page's own policy refuses every script but its own and
every request.
"""

from __future__ import annotations

import json
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any
from urllib.parse import quote

from shellform.errors import InputError
from shellform.gridshell.catalogue import label
from shellform.optimiser.optimum import Step, by_constraint
from shellform.output.page import charts
from shellform.output.page.first_answers import answers
from shellform.output.page.profile_table import profile_table
from shellform.output.page.shown_run import ShownRun
from shellform.output.page.template import filled, part
from shellform.output.page.view_data import ViewedShell, controls, view_data
from shellform.output.pictures.colours import VIRIDIS
from shellform.quantities import force_unit, number
from shellform.records import words
from shellform.records.check import UNASKED, Cell, Check, Subject
from shellform.records.summary import Summary, VerdictRecord
from shellform.records.verdict import asked, headline, provisos

GENERATOR = "shellform report"  # in the page's head, so that it is known again
VIEW = ("solid.js", "view.js", "section.js", "viewer.js")  # the scripts of the view alone
_COUNTED = {
    "nodes": "nodes",
    "beams": "beam elements",
    "cables": "candidate cables",
    "freedoms": "degrees of freedom",
}
_GRADIENT = ", ".join(f"rgb{colour}" for colour in VIRIDIS)


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
            "forces": dict(zip(("unit", "size"), force_unit(_largest_force(runs)), strict=True)),
        },
        generator=GENERATOR,
        style=part("look.css") + part("style.css"),
        script="(() => {\n" + "\n".join(part(name) for name in (*VIEW, "tables.js", "page.js")) + "\n})();",
        data={"viridis": VIRIDIS, "runs": [view_data(viewed(run)) for run in runs]},
        number=number,
    )


def _content(run: ShownRun, number: int) -> dict[str, Any]:
    """What the template writes of a run."""
    summary = run.summary
    rows = [(name, words.design_title(name), summary.designs[name]) for name in run.designs]
    best = summary.designs[run.best]
    ended = [
        check for check in run.checks if check.subject is Subject.SEARCH and not check.cells[run.best].asked
    ]
    return {
        "id": f"run{number}",
        "title": run.title,
        "place": run.place,
        "best_title": words.design_title(run.best),
        "finished": summary.optimisation is not None,
        "verdict": run.verdict,
        "headline": headline(run.verdict),
        "provisos": provisos(run.verdict),
        "kind": _kind(run.verdict),
        "asked": asked(run.checks, run.best),
        "answers": answers(
            run.shell,
            run.best,
            run.designs[run.best],
            run.states[run.best],
            summary,
            as_built=_as_built(run, "additional"),
            next_size=run.next_size,
        ),
        "failure": summary.failure,
        "failure_driver": "" if summary.failure is None else words.cause_title(summary.failure.driver),
        "failure_slack": "" if summary.failure is None else words.goes_slack_words(summary.failure.cables),
        "failure_load": "" if summary.failure is None else words.load_title(summary.failure.load),
        "rare": [(words.load_title(each.load), words.rare_words(each)) for each in summary.rare or ()],
        "designs": rows,
        "shown_first": sorted(rows, key=lambda each: each[0] != run.best),
        "checks": [check for check in run.checks if check not in ended],
        "ended": [(check.title, check.limit, _told(check)) for check in ended],
        "charts": _charts(run.history),
        "pictures": [(picture, _caption(picture.name)) for picture in run.pictures],
        "notes": [
            *run.notes,
            *(() if summary.net is None else summary.net.notes),
            *(() if summary.surface is None else summary.surface.mended),
            *(() if summary.documents is None else summary.documents.notes),
        ],
        "settings": run.settings,
        "files": _folders(run.files, run.home),
        "model": {}
        if summary.model is None
        else {_COUNTED[name]: n for name, n in asdict(summary.model).items()},
        "source": "" if summary.surface is None else summary.surface.source,
        "optimisation": summary.optimisation,
        "rejected": sum(not step.accepted for step in run.history),
        "seconds": dict(sorted(summary.seconds.items(), key=lambda each: each[0] == "total")),
        "profile": profile_table(run.profile),
        "rod": label(run.shell.rod.resized(run.designs[run.best].radius).section, 2),
        "row": best,
        **controls(viewed(run), _GRADIENT),
    }


def _kind(verdict: VerdictRecord) -> str:
    """How a verdict is shown: red, green, or amber, where something isn't known or asks for care."""
    if verdict.failed:
        return "bad"
    return "good" if verdict.holds and not verdict.cautions else "open"


def _largest_force(runs: Sequence[ShownRun]) -> float:
    """Of a cable under any load, N, by which the view, too, chooses the unit that all forces are read in."""
    designs = [run.summary.designs[name] for run in runs for name in run.designs]
    loaded = [row.cable_force_max or 0.0 for each in designs for row in each.loads.values()]
    return max([*loaded, *(each.cable_force_max for each in designs)], default=0.0)


def viewed(run: ShownRun) -> ViewedShell:
    """What of the run the view shows."""
    titles = {name: words.load_title(name, _times(run.summary, name)) for name in run.loads}
    return ViewedShell(
        title=run.title,
        shells=run.shells,
        designs=run.designs,
        states=run.states,
        best=run.best,
        loads=run.loads,
        load_titles=titles,
        surface=run.surface,
        limit=run.limit,
    )


def _as_built(run: ShownRun, load: str) -> Cell | None:
    """How many drawn structures of the design to build stand, as its check says."""
    return next(
        (
            check.cells.get(run.best)
            for check in run.checks
            if check.subject is Subject.DRAWN and check.load == load
        ),
        None,
    )


def _times(summary: Summary, load: str) -> float | None:
    return next((row.loads[load].times for row in summary.designs.values() if load in row.loads), None)


def _caption(name: str) -> str:
    """A file's name in words: "utilisation-optimised-design" is "Utilisation: optimised, the design load"."""
    parts = [
        words.TITLES.get(part, words.LOADS.get(part, part.replace("_", " "))) for part in name.split("-")
    ]
    said = words.run_on(parts)
    text = said[0] + (": " + ", ".join(said[1:]) if len(said) > 1 else "")
    return text[:1].upper() + text[1:]


def _folders(files: Sequence[str], home: str) -> dict[str, list[tuple[str, str]]]:
    """File names with their addresses by folder; "" for those in the run folder itself."""
    found: dict[str, list[tuple[str, str]]] = {}
    for file in files:
        folder, _, name = file.rpartition("/")
        found.setdefault(folder, []).append((name, quote(f"{home}{file}")))
    return found


def _told(check: Check) -> Cell:
    """The one cell that says something."""
    return next((cell for cell in check.cells.values() if cell.asked), UNASKED)


def _charts(history: Sequence[Step]) -> list[charts.Chart]:
    """Objective and terms, constraints, and the number of cables at each accepted design."""
    steps = [step for step in history if step.accepted]
    if not steps:
        return []
    at = [float(step.evaluation) for step in steps]
    terms = {"objective": [step.objective for step in steps]}
    terms |= {name.replace("_", " "): [step.terms[name] for step in steps] for name in steps[0].terms}
    found_of = by_constraint(steps)
    titles = words.constraint_titles(found_of)
    limits = {title: found_of[name] for name, title in titles.items()}
    found = [charts.line_chart("Objective and its terms", at, terms)]
    if limits:
        title = "Constraints: beyond the limit, as a share of it (allowed up to 0; cut at −1.5 and 1)"
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
