"""What scatter does to the design to build: mean and deviation of its misfit, by cause, and a check by
sampling if the case asks for one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shellform.arrays import Reals
from shellform.case.limit_entries import RobustEntry
from shellform.gridshell.gridshell import Design, Gridshell
from shellform.gridshell.tolerances import Tolerances
from shellform.quantities import number
from shellform.records.scattering import CauseRecord, RobustRecord, SampleRecord
from shellform.reliability import robust
from shellform.structure.elements.state import State
from shellform.tables import Table


@dataclass(frozen=True, eq=False)
class Robustness:
    """The predicted `spread`, and the `sample` that checks it (None: not asked for); `nodes` of the shell."""

    spread: robust.Spread
    sample: robust.MisfitSample | None
    nodes: int

    def record(self, design: str) -> RobustRecord:
        """For summary.json, of the design with this name."""
        spread = self.spread
        return RobustRecord(
            design=design,
            misfit=spread.nominal,
            misfit_mean=spread.mean,
            misfit_deviation=spread.deviation,
            deviation_rms=float(np.sqrt(spread.nominal / self.nodes)),
            deviation_rms_mean=float(np.sqrt(spread.mean / self.nodes)),
            wander_max=float(spread.node_deviation.max()),
            causes={name: CauseRecord(shape, variance) for name, (shape, variance) in spread.causes.items()},
            sentences=(*spread.sentences(), *self._checked()),
            sample=self._sampled(),
        )

    def _checked(self) -> list[str]:
        """What the structures that were loaded say of the prediction, in words."""
        told = self._sampled()
        if told is None:
            return []
        stand, found = told.count - told.lost, []
        if told.misfit_mean is not None and told.misfit_deviation is not None:
            found.append(
                f"Of {told.count} structures drawn and loaded {stand} stand, with a misfit of "
                f"{number(told.misfit_mean)} ± {number(told.misfit_deviation, 2)} m²."
            )
        if told.lost:
            found.append(
                f"{told.lost} of {told.count} structures drawn fall under the load: the design is too near "
                "the end of its path for these tolerances. Ask for a larger safety.critical_factor, or limit "
                "the misfit as built (robust.limit)."
            )
        return found

    def _sampled(self) -> SampleRecord | None:
        if self.sample is None:
            return None
        drawn = self.sample.misfits
        return SampleRecord(
            count=len(drawn) + self.sample.lost,
            lost=self.sample.lost,
            misfit_mean=float(drawn.mean()) if len(drawn) else None,
            misfit_deviation=float(drawn.std(ddof=1)) if len(drawn) > 1 else None,
        )

    def table(self) -> Table:
        """By cause: its share of the shape's scatter, the root mean square motion of a node that it causes,
        its share of the misfit's variance.
        """
        heads = (
            "cause",
            "share of the scatter of the shape",
            "rms motion of a node [mm]",
            "share of the variance of the misfit",
        )
        causes = sorted(self.spread.causes.items(), key=lambda each: -each[1][0])
        squared = (self.spread.mean - self.spread.nominal) / self.nodes
        rows = tuple(
            (
                name,
                f"{shape:.4f}",
                f"{1e3 * np.sqrt(shape * squared):.4f}",
                f"{variance:.4f}",
            )
            for name, (shape, variance) in causes
        )
        return Table("robust", heads, rows)


def robustness(
    entry: RobustEntry, shell: Gridshell, design: Design, state: State, load: Reals, tolerances: Tolerances
) -> Robustness:
    """Of the design's stable `state` under the `load`. Raises InputError where no tolerance is given,
    NotConverged where the state isn't stable."""
    spread = robust.spread(shell, design, state, load, tolerances, seed=entry.seed)
    drawn = (
        robust.sample(shell, design, load, tolerances, count=entry.samples, seed=entry.seed)
        if entry.samples
        else None
    )
    return Robustness(spread, drawn, shell.node_count)
