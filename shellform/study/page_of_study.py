"""The page of a study folder, from its table and the runs that were kept; the best of these get a page of
their own to be linked to.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from shellform.errors import InputError, how_many
from shellform.output.page.measures import entry_measure, summary_measure
from shellform.output.page.study_page import (
    StudyContent,
    StudyRow,
    chosen,
    rank_correlations,
    spread,
    study_page,
    thumbnail,
)
from shellform.problem.paths import deviations
from shellform.run.folder import read_run
from shellform.run.pages import FILE, write_page
from shellform.study.front import Front, signed
from shellform.study.outcome import Row, Status
from shellform.study.plan import Plan
from shellform.study.store import has_column, read_table
from shellform.written import write_text

_HOLDS = "verdict.holds"  # whether the design to build does; None where it wasn't examined


def write_study_page(folder: Path, plan: Plan) -> Path:
    """Writes study.html."""
    entry = plan.study
    own = [
        f"case.{name}"
        for name in dict.fromkeys(
            [*entry.vary, *(n for each in entry.designs for n in each), *entry.function]
        )
    ]
    names = ["number", "key", "status", "reason", *own, *entry.column]
    table = read_table(folder, [*names, *([_HOLDS] if has_column(folder, _HOLDS) else [])])
    columns: dict[str, list[Any]] = table.to_pydict()
    count = table.num_rows
    signs = signed(entry.objective)
    front = Front(signs, entry.limit)
    first: dict[str, int] = {}
    done = [k for k in range(count) if columns["status"][k] == Status.DONE]
    for k in done:
        key = columns["key"][k]
        front.add(Row(key, Status.DONE, "", {name: columns[name][k] for name in entry.column}))
        first.setdefault(columns["key"][k], k)
    ordered = sorted(front.found, key=lambda key: (front.found[key], key))
    rows = chosen(count, [first[key] for key in ordered])
    best = spread(ordered)
    pictures, limit = _pictures(folder, best)
    notes = (
        []
        if len(rows) == count
        else [f"{len(rows)} of {count} designs are drawn, those on the front among them."]
    )
    gone = sum(not (folder / "runs" / key).is_dir() for key in ordered)
    if entry.keep == "none":
        notes.append("No run was kept (keep), so that there are no pictures.")
    elif gone:
        notes.append(
            f"Of {gone} of {len(ordered)} best designs no run was kept, which were none of the best under other objectives. "
            'To have them give the study another --output, and keep = "all" where objectives are to change.'
        )
    fallen = sum(_falls(columns, first[key]) for key in ordered)
    if fallen:
        notes.append(
            f"{how_many(fallen, 'best design does', 'best designs do')} not hold: to leave such out, add the column "
            'holds = "verdict.holds" and [limit] holds = { least = 1 }.'
        )
    if pictures:
        notes.append(
            f"Pictures: distance from the target under the design load, from 0 (dark) to {1e3 * limit:.3g} "
            f"mm (yellow)."
        )
    content = StudyContent(
        title=entry.title or f"Study of {entry.case}",
        rows=[_row(columns, k, [*own, *entry.column]) for k in rows],
        varied=own,
        found=list(entry.column),
        measures={
            **{name: entry_measure(name.removeprefix("case.")) for name in own},
            **{name: summary_measure(path) for name, path in entry.column.items()},
        },
        goals=signs,
        front=ordered,
        best=best,
        links={key: _link(folder, key) for key in front.found if (folder / "runs" / key).is_dir()},
        pictures=pictures,
        designs={"done": len(done), "failed": count - len(done)},
        correlation=rank_correlations(
            {name: [columns[name][k] for k in done] for name in own},
            {name: [columns[name][k] for k in done] for name in entry.column},
        ),
        notes=notes,
    )
    write_text(folder / "study.html", study_page(content))
    return folder / "study.html"


def _falls(columns: Mapping[str, Sequence[Any]], k: int) -> bool:
    """Whether a design was examined and doesn't hold."""
    return _HOLDS in columns and columns[_HOLDS][k] in (False, 0)


def _row(columns: Mapping[str, Sequence[Any]], k: int, names: Sequence[str]) -> StudyRow:
    """A row of the table."""
    number, key, status, reason = (columns[name][k] for name in ("number", "key", "status", "reason"))
    values = {name: columns[name][k] for name in names}
    return StudyRow(number, key, status == Status.DONE, status, reason, values)


def _link(folder: Path, key: str) -> str:
    return f"runs/{key}/{FILE}" if (folder / "runs" / key / FILE).is_file() else f"runs/{key}/"


def _pictures(folder: Path, keys: list[str]) -> tuple[dict[str, str], float]:
    """A thumbnail of the last design of each kept run under its design load, all in the same colours, and the
    distance at which these end, m; none of runs that stopped before. Runs that have no page yet get one."""
    seen: dict[str, tuple[Any, Any]] = {}
    limit = 0.0
    for key in keys:
        try:
            run = read_run(folder / "runs" / key)
        except InputError:
            continue
        if not (run.folder / FILE).exists():
            write_page([run], run.folder / FILE)
        state = run.states[run.best]["design"]
        seen[key] = run.shell, state
        limit = max(limit, float(deviations(run.shell, state).max()))
    return {key: thumbnail(shell, state, limit) for key, (shell, state) in seen.items()}, limit
