"""Units and axes of files that others wrote."""

from __future__ import annotations

import numpy as np

from shellform.arrays import Reals
from shellform.errors import InputError, require_known

# by the file's vertical axis, which of its axes become x, y and z, and their signs
_AXES: dict[str, tuple[tuple[int, int, int], tuple[int, int, int]]] = {
    "x": ((1, 2, 0), (1, 1, 1)),
    "y": ((0, 2, 1), (1, -1, 1)),
    "z": ((0, 1, 2), (1, 1, 1)),
    "-x": ((1, 2, 0), (1, -1, -1)),
    "-y": ((0, 2, 1), (1, 1, -1)),
    "-z": ((0, 1, 2), (1, -1, -1)),
}
METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048}


def unit_factor(unit: str, *, where: str = "surface.unit") -> float:
    """Metres in one `unit`, which is given `where`. Raises InputError for an unknown one."""
    require_known(unit, METRES, where=where, what="isn't a known unit")
    return METRES[unit]


def turned_up(points: Reals, up: str) -> Reals:
    """Points (k, 3) of a file whose vertical axis is `up`, "x", "y" or "z", or "-x", "-y" or "-z" where that
    points down, turned so that it is z; nothing is mirrored."""
    if up not in _AXES:
        raise InputError(
            f"must be one of {', '.join(_AXES)}",
            where="surface.up",
            value=up,
            remedy="Give z for CAD files, y for most viewers', -z for a form that hangs.",
        )
    if up == "z":
        return points
    order, signs = _AXES[up]
    return np.column_stack(
        [points[:, k] if sign > 0 else -points[:, k] for k, sign in zip(order, signs, strict=True)]
    )


def level_axes(up: str) -> tuple[int, int]:
    """The numbers of a file's two axes that are level where `up` is vertical."""
    first, second, _ = _AXES[up][0]
    return first, second
