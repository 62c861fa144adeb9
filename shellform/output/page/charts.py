"""Line charts as inline SVG, for the page: no library, no script; colours are the page's own, so that they
follow dark and light.

A curve is a row of points joined by straight lines. Values outside the axis are cut at its ends, which the
caption says.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from shellform.quantities import number

_WIDTH, _HEIGHT = 460, 270  # of a chart, in its own units, and its margins:
_LEFT, _RIGHT, _TOP, _BOTTOM = 52, 12, 12, 40
_COLOURS = 6  # of style.css: --series-1 …


@dataclass(frozen=True)
class Chart:
    """A drawn chart: its `title`, the `svg`, and a legend of (class, label)."""

    title: str
    svg: str
    legend: Sequence[tuple[str, str]]


def line_chart(
    title: str,
    at: Sequence[float],
    curves: Mapping[str, Sequence[float]],
    *,
    least: float | None = None,
    most: float | None = None,
    limit: float | None = None,
    main: bool = True,
) -> Chart:
    """Curves over `at` (k,), each (k,), the first drawn strongest where it is the `main` one. `least` and
    `most` cut the axis; above `limit` is shaded as not allowed.

    A value that is no number leaves a gap.
    """
    values = np.array([list(curve) for curve in curves.values()], dtype=float).reshape(len(curves), len(at))
    finite = values[np.isfinite(values)]
    low = min(finite.min(initial=0.0), 0.0 if limit is None else limit)
    high = max(
        finite.max(initial=0.0), low + 1e-9, -math.inf if limit is None else limit + 0.25 * abs(limit - low)
    )
    low, high = max(low, -math.inf if least is None else least), min(high, math.inf if most is None else most)
    steps = _ticks(low, high)
    low, high = min(low, steps[0]), max(high, steps[-1])
    first, last = float(at[0]), float(max(at[-1], at[0] + 1))

    def x(value: float) -> float:
        return round(_LEFT + (value - first) / (last - first) * (_WIDTH - _LEFT - _RIGHT), 1)

    def y(value: float) -> float:
        share = (min(max(value, low), high) - low) / (high - low)
        return round(_HEIGHT - _BOTTOM - share * (_HEIGHT - _TOP - _BOTTOM), 1)

    parts = [
        f'<svg viewBox="0 0 {_WIDTH} {_HEIGHT}" role="img" aria-label="{escape(title, quote=True)}" '
        f'class="chart">'
    ]
    if limit is not None and limit < high:
        parts.append(
            f'<rect class="refused" x="{_LEFT}" y="{y(high)}" width="{_WIDTH - _LEFT - _RIGHT}" '
            f'height="{round(y(limit) - y(high), 1)}"/>'
        )
    for step in steps:
        parts.append(
            f'<line class="grid" x1="{_LEFT}" x2="{_WIDTH - _RIGHT}" y1="{y(step)}" y2="{y(step)}"/>'
        )
        parts.append(f'<text x="{_LEFT - 8}" y="{y(step) + 4}" text-anchor="end">{number(step)}</text>')
    for step in _ticks(first, last, whole=True):
        parts.append(
            f'<text x="{x(step)}" y="{_HEIGHT - _BOTTOM + 18}" text-anchor="middle">{number(step)}</text>'
        )
    parts.append(
        f'<text x="{(_LEFT + _WIDTH - _RIGHT) / 2}" y="{_HEIGHT - 4}" text-anchor="middle">design '
        f"evaluations</text>"
    )
    legend = []
    for k in reversed(range(len(curves))):
        kind = f"series-{(k if main else k + 1) % _COLOURS + 1}{' main' if main and k == 0 else ''}"
        kind += " again" if k >= _COLOURS else ""
        for run in _runs(np.isfinite(values[k])):
            line = " ".join(f"{x(at[i])},{y(values[k, i])}" for i in run)
            parts.append(f'<polyline class="{kind}" points="{line}"/>')
        legend.append((kind, list(curves)[k]))
    parts.append("</svg>")
    return Chart(title, "".join(parts), legend[::-1])


def _runs(good: np.ndarray) -> list[list[int]]:
    """Neighbouring true places, together."""
    runs: list[list[int]] = []
    for i in np.flatnonzero(good):
        if runs and runs[-1][-1] == i - 1:
            runs[-1].append(int(i))
        else:
            runs.append([int(i)])
    return runs


def _ticks(low: float, high: float, *, whole: bool = False) -> list[float]:
    """About five round numbers from `low` to `high`."""
    rough = (high - low) / 5.0
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(power * k for k in (1, 2, 5, 10) if power * k >= rough)
    step = max(step, 1.0) if whole else step
    return [step * k for k in range(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1)] or [
        low
    ]
