"""The page of a study in one HTML file: front, scatter, parallel coordinates, rank correlations, best
designs, table. No network.

The template, style and script stand in `assets/study.*`; the script draws from JSON inside the page. Names
and reasons are text from elsewhere: the template escapes them, the JSON has no "<", and the page's own policy
refuses every script but its own and every request.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from shellform.arrays import Reals
from shellform.gridshell.gridshell import Gridshell
from shellform.output.page.measures import Measure
from shellform.output.page.template import filled, part
from shellform.output.pictures.colours import VIRIDIS
from shellform.problem.paths import deviations
from shellform.quantities import number
from shellform.structure.elements.state import State

MOST_ROWS = 4000  # that are drawn; the front is always among them
_COLOURS = tuple("#{:02x}{:02x}{:02x}".format(*colour) for colour in VIRIDIS[::2])
_SEGMENTS = 1500  # of a thumbnail


@dataclass(frozen=True)
class StudyRow:
    """A design in the table: its `number`, `key`, whether it is `done`, `status` and `reason` in words, and
    its `columns` by name."""

    number: int
    key: str
    done: bool
    status: str
    reason: str
    columns: Mapping[str, Any]


@dataclass(frozen=True)
class StudyContent:
    """What the page says.

    - `title`; `notes`; `designs`: how many are done and failed.
    - `rows` with their columns: those `varied` were given, those `found` came out; `measures` by column.
    - `goals` by column: 1 where it is to be small, -1 where large.
    - `front`: the keys of the rows on it, of which `best` have a card.
    - `links` to pages and `pictures` (SVG), by key.
    - `correlation`: of ranks, by column found and column varied.
    """

    title: str
    rows: Sequence[StudyRow]
    varied: Sequence[str]
    found: Sequence[str]
    measures: Mapping[str, Measure]
    goals: Mapping[str, float]
    front: Sequence[str]
    best: Sequence[str]
    links: Mapping[str, str]
    pictures: Mapping[str, str]
    designs: Mapping[str, int]
    correlation: Mapping[str, Mapping[str, float]]
    notes: Sequence[str]


def study_page(study: StudyContent) -> str:
    """The page's text."""
    names = [*study.varied, *study.found]
    measures = [study.measures.get(name, Measure(name)) for name in names]
    front = set(study.front)
    drawn = [
        [
            row.number,
            int(row.key in front),
            *(_scaled(row.columns.get(name), each) for name, each in zip(names, measures, strict=True)),
        ]
        for row in study.rows
        if row.done
    ]
    data = {
        "names": [_label(name, each) for name, each in zip(names, measures, strict=True)],
        "varied": len(study.varied),
        "goals": [names.index(name) for name in study.goals if name in names],
        "colours": list(_COLOURS),
        "rows": drawn,
        "links": {str(row.number): study.links[row.key] for row in study.rows if row.key in study.links},
    }
    shown = {row.key: row for row in reversed(study.rows)}
    failed = Counter(f"{row.status}: {row.reason}" for row in study.rows if not row.done)
    return filled(
        "study.html",
        {
            "study": study,
            "cards": [shown[key] for key in study.best if key in shown],
            "columns": [(name, _label(name, each), each) for name, each in zip(names, measures, strict=True)],
            "labels": {name: _label(name, each) for name, each in zip(names, measures, strict=True)},
            "scaled": _scaled,
            "failed": failed.most_common(20),
            "shade": _shade,
        },
        generator="shellform study",
        style=part("look.css") + part("study.css"),
        script=part("study.js"),
        data=data,
        number=number_text,
    )


def spread(keys: Sequence[str], most: int = 24) -> list[str]:
    """At most so many of a front's keys, evenly spread along it."""
    at = np.linspace(0, len(keys) - 1, min(most, len(keys))).round().astype(int)
    return [keys[k] for k in np.unique(at)]


def chosen(count: int, front: Sequence[int]) -> list[int]:
    """Which of `count` rows are drawn: all, or the front's and evenly spread others."""
    if count <= MOST_ROWS:
        return list(range(count))
    return sorted({*front[:MOST_ROWS], *np.linspace(0, count - 1, MOST_ROWS).astype(int).tolist()})


def rank_correlations(
    given: Mapping[str, Sequence[Any]], found: Mapping[str, Sequence[Any]]
) -> dict[str, dict[str, float]]:
    """Spearman's rank correlation of each given column with each found one; those that don't vary or aren't
    numbers are left out.
    """
    from scipy.stats import rankdata

    result: dict[str, dict[str, float]] = {}
    for name, values in given.items():
        for other, results in found.items():
            pairs = [
                (float(a), float(b))
                for a, b in zip(values, results, strict=True)
                if _number(a) is not None and _number(b) is not None
            ]
            if len(pairs) < 3:
                continue
            a, b = (rankdata(each) for each in np.array(pairs).T)
            if a.std() > 0.0 and b.std() > 0.0:
                result.setdefault(name, {})[other] = float(np.corrcoef(a, b)[0, 1])
    return result


def thumbnail(shell: Gridshell, state: State, limit: float, *, width: int = 240) -> str:
    """The loaded rods from above at a slant as SVG, coloured by their distance from the target, up to
    `limit`, m.
    """
    away = deviations(shell, state)
    ends = shell.net.grid.rod_ends
    step = max(1, math.ceil(len(ends) / _SEGMENTS))
    ends = ends[::step] if step > 1 else ends
    place = _slanted(state.positions)
    low, size = place.min(axis=0), np.ptp(place, axis=0)
    scale = (width - 8) / max(float(size[0]), 1e-9)
    height = 8 + scale * float(size[1])
    points = 4 + scale * (place - low)
    points[:, 1] = height - points[:, 1]
    shade = np.minimum(
        (len(_COLOURS) * away[ends].mean(axis=1) / max(limit, 1e-12)).astype(int), len(_COLOURS) - 1
    )
    paths = []
    for k, colour in enumerate(_COLOURS):
        lines = points[ends[shade == k]]
        if len(lines):
            path = "".join(f"M{a[0]:.1f} {a[1]:.1f}L{b[0]:.1f} {b[1]:.1f}" for a, b in lines)
            paths.append(f'<path stroke="{colour}" d="{path}"/>')
    lines = 'fill="none" stroke-width="1.6" stroke-linecap="round"'
    head = f'<svg viewBox="0 0 {width} {height:.0f}" role="img" {lines}>'
    return f"{head}<title>{1e3 * float(away.max()):.1f} mm off at most</title>{''.join(paths)}</svg>"


def _slanted(positions: Reals) -> Reals:
    """Seen along a direction 40° above the ground and 30° from y."""
    turn, tilt = math.radians(30.0), math.radians(40.0)
    x, y, z = positions.T
    across = math.cos(turn) * x + math.sin(turn) * y
    along = -math.sin(turn) * x + math.cos(turn) * y
    return np.column_stack([across, math.sin(tilt) * along + math.cos(tilt) * z])


def number_text(value: Any) -> str:
    """A number at four digits; a dash where there is none."""
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return "–"
    return number(value, 4) if isinstance(value, float) else str(value)


def _label(name: str, measure: Measure) -> str:
    """A column's name with its unit: "misfit [mm]"."""
    words = measure.words if name.startswith("case.") else name.replace("_", " ")
    return f"{words.removeprefix('case.')} [{measure.unit}]" if measure.unit else words.removeprefix("case.")


def _scaled(value: Any, measure: Measure) -> Any:
    """A number in the measure's unit; what is no number as it is."""
    plain = _number(value)
    return None if plain is None else _number(plain * measure.factor) if measure.factor != 1.0 else plain


def _number(value: Any) -> float | int | None:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        return None
    return float(f"{value:.6g}") if isinstance(value, float) else value


def _shade(value: float) -> str:
    """How strongly a correlation is coloured."""
    return f"{abs(value):.2f}"
