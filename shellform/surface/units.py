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
            remedy="Give z for CAD files, y for most viewers', x for a shell that was drawn so, -z for a form that hangs.",
        )
    if up == "z":
        return points
    order, signs = _AXES[up]
    return np.column_stack(
        [points[:, k] if sign > 0 else -points[:, k] for k, sign in zip(order, signs, strict=True)]
    )


def turned_back(points: Reals, up: str) -> Reals:
    """Points (k, 3) that `turned_up` made of a file's with its axis `up`, in the file's axes again."""
    order, signs = _AXES[up]
    back = np.empty_like(points)
    back[:, list(order)] = points * np.array(signs, dtype=float)
    return back


def downwards(up: str) -> str:
    """The axis `up` of a file pointing the other way, by its name: "-z" for "z"."""
    return up[1:] if up.startswith("-") else f"-{up}"


def level_axes(up: str) -> tuple[int, int]:
    """The numbers of a file's two axes that are level where `up` is vertical."""
    first, second, _ = _AXES[up][0]
    return first, second
