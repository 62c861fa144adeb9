"""What scatter does to the design to build: mean and deviation of its misfit, by cause, and a check by
sampling if the case asks for one.
"""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass
from typing import Any

import numpy as np

from shellform.arrays import Reals
from shellform.case.build_problem import scatter_of
from shellform.case.entries import RobustEntry
from shellform.gridshell.gridshell import Design, Gridshell
from shellform.problem import robust
from shellform.structure.elements.state import State


@dataclass(frozen=True)
class Robustness:
    """The predicted `spread`, and the `sample` that checks it (None: not asked for); `nodes` of the shell."""

    spread: robust.Spread
    sample: robust.MisfitSample | None
    nodes: int

    def summary(self) -> dict[str, Any]:
        """For summary.json: misfits, m², as sums over all nodes, distances, m, as root mean squares a
        node.
        """
        told = self.spread
        found: dict[str, Any] = {
            "misfit": told.nominal,
            "misfit_mean": told.mean,
            "misfit_deviation": told.deviation,
            "deviation_rms": float(np.sqrt(told.nominal / self.nodes)),
            "deviation_rms_mean": float(np.sqrt(max(told.mean, 0.0) / self.nodes)),
            "wander_max": float(told.node_deviation.max()),
            "causes": {
                name: {"shape": shape, "variance": variance}
                for name, (shape, variance) in told.causes.items()
            },
            "sentences": told.sentences(),
        }
        if self.sample is not None:
            drawn = self.sample.misfits
            enough = len(drawn) > 1
            if self.sample.lost:
                found["sentences"].append(
                    f"{self.sample.lost} of {len(drawn) + self.sample.lost} structures drawn have no equilibrium on the stable branch: the design is too near "
                    "the end of its path for this scatter. Limit its critical factor, or the robust misfit."
                )
            found["sample"] = {
                "count": len(drawn) + self.sample.lost,
                "lost": self.sample.lost,
                "misfit_mean": float(drawn.mean()) if len(drawn) else None,
                "misfit_deviation": float(drawn.std(ddof=1)) if enough else None,
            }
        return found

    def table(self) -> str:
        """By cause as CSV: its share of the shape's scatter, the root mean square motion of a node that it
        causes, its share of the misfit's variance.
        """
        text = io.StringIO()
        writer = csv.writer(text)
        writer.writerow(
            [
                "cause",
                "share of the scatter of the shape",
                "rms motion of a node [mm]",
                "share of the variance of the misfit",
            ]
        )
        for name, (shape, variance) in sorted(self.spread.causes.items(), key=lambda each: -each[1][0]):
            writer.writerow(
                [
                    name,
                    f"{shape:.4f}",
                    f"{1e3 * np.sqrt(shape * self.spread.linear / self.nodes):.4f}",
                    f"{variance:.4f}",
                ]
            )
        return text.getvalue()


def robustness(entry: RobustEntry, shell: Gridshell, design: Design, state: State, load: Reals) -> Robustness:
    """Of the design's stable `state` under the `load`. Raises NotConverged where it isn't stable."""
    scatter = scatter_of(entry)
    told = robust.spread(shell, design, state, load, scatter)
    drawn = (
        robust.sample(shell, design, state, load, scatter, count=entry.samples, seed=entry.seed)
        if entry.samples
        else None
    )
    return Robustness(told, drawn, shell.node_count)
