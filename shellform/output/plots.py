"""Convergence plots (figures 10, 11, 15 and 16 of the paper); the door to matplotlib."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

_COLOURS = ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9")  # Okabe and Ito's


def objective_history(path: str | Path, evaluation: Sequence[int], terms: Mapping[str, Sequence[float]]) -> None:
    """Figure 10: the objective and its weighted terms at each accepted design; the ending of `path` chooses the format."""
    figure = Figure(figsize=(7.0, 4.2), layout="constrained")
    axes = figure.add_subplot()
    total = [sum(values) for values in zip(*terms.values(), strict=True)]
    axes.plot(evaluation, total, color="black", linewidth=2.0, label="objective")
    for (name, values), colour in zip(terms.items(), _COLOURS, strict=False):
        axes.plot(evaluation, values, color=colour, marker=".", label=name.replace("_", " "))
    axes.set(xlabel="design evaluations", ylabel="objective and its terms", ylim=(0.0, None))
    _finish(figure, path)


def constraint_history(path: str | Path, evaluation: Sequence[int], constraints: Mapping[str, Sequence[float]]) -> None:
    """Figure 11: value over limit, minus 1, of each constraint at each accepted design; feasible at and below zero."""
    figure = Figure(figsize=(7.0, 4.2), layout="constrained")
    axes = figure.add_subplot()
    for (name, values), colour in zip(constraints.items(), _COLOURS, strict=False):
        axes.plot(evaluation, values, color=colour, marker=".", label=name.replace("_", " "))
    highest = max((max(values) for values in constraints.values()), default=0.0)
    if highest > 3.0:
        axes.set_yscale("symlog", linthresh=1.0)
    axes.axhspan(0.0, max(1.1 * highest, 0.1), color="#f3d9d6", zorder=0, label="infeasible")
    axes.axhline(0.0, color="black", linewidth=0.8)
    axes.set(xlabel="design evaluations", ylabel="value / limit - 1")
    _finish(figure, path)


def _finish(figure: Figure, path: str | Path) -> None:
    axes = figure.axes[0]
    axes.grid(color="#e0e0e0", linewidth=0.6)
    axes.spines[["top", "right"]].set_visible(False)
    figure.legend(loc="outside right upper", frameon=False)
    FigureCanvasAgg(figure)
    target = Path(path)
    partial = target.with_name(f"{target.stem}.part{target.suffix}")
    figure.savefig(partial, dpi=160)
    os.replace(partial, target)
