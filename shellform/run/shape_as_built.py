"""The shape of structures as built at rest under the design load, and what their rods and cables bear, as
they are set out and adjusted on site.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from shellform.records.built_shape import BuiltShapeRecord
from shellform.records.drawn import DrawnPath, median_and_worst
from shellform.reliability.first_order import moved_by_cause
from shellform.run.sampling import LOOKED_AT, Examined, adjusted_of


def built_shape(path: DrawnPath, each: Examined, seed: int) -> BuiltShapeRecord | None:
    """That of the structures of a `path` that were looked at, and by what it is driven; None where none rests
    under the load."""
    shape = _shape(path)
    if shape is None:
        return None
    return replace(shape, causes=moved_by_cause(each.nominal("design"), each.tolerances, seed=seed))


def adjusted_shape(folder: Path, each: Examined, count: int, seed: int) -> BuiltShapeRecord | None:
    """That of the first structures of a design, `count` at the most, adjusted on site
    (reliability/adjusting.py) and kept in the run `folder`; None where none rests under the load."""
    return _shape(adjusted_of(folder, each, count=min(count, LOOKED_AT), seed=seed))


def _shape(path: DrawnPath) -> BuiltShapeRecord | None:
    if not path.shapes:
        return None
    largest = [each.deviation_max for each in path.shapes]
    return BuiltShapeRecord(
        len(largest),
        float(np.median(largest)),
        max(largest),
        float(np.median([each.deviation_mean for each in path.shapes])),
        {},
        *median_and_worst([each.stress_utilisation_max for each in path.shapes]),
        *median_and_worst([each.cable_force_max for each in path.shapes]),
    )
