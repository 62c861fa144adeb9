"""Units and axes of files that others wrote."""

from __future__ import annotations

import numpy as np

from shellform.arrays import Reals
from shellform.errors import InputError

METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048}


def unit_factor(unit: str) -> float:
    """Metres in one `unit`."""
    if unit not in METRES:
        raise InputError(
            "isn't a known unit", where="surface.unit", value=unit, remedy=f"Known: {', '.join(METRES)}."
        )
    return METRES[unit]


def turned_up(points: Reals, up: str) -> Reals:
    """Points (k, 3) with the axis `up`, "z" or "y", turned to z."""
    if up not in ("y", "z"):
        raise InputError(
            "must be y or z",
            where="surface.up",
            value=up,
            remedy="Give z for CAD files, y for most viewers'.",
        )
    return points if up == "z" else np.column_stack([points[:, 0], -points[:, 2], points[:, 1]])
