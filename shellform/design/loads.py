"""Which crossings carry load."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from shellform.arrays import Indices, Reals, reals
from shellform.errors import InputError
from shellform.net.net import Net


def crossings_to_load(net: Net, every: int, openings: Sequence[ArrayLike]) -> Indices:
    """Numbers of the crossings whose lattice place i + j is a multiple of `every`, outside the plan polygons `openings`.

    Raises InputError where none is left.
    """
    if every < 1:
        raise InputError("must be at least 1", where="load.every", value=every)
    loaded = net.grid.lattice.sum(axis=1) % every == 0
    plan = net.crossings[:, :2]
    for number, polygon in enumerate(openings):
        corners = reals(f"load.openings[{number}]", polygon, (None, 2))
        if len(corners) < 3:
            raise InputError("needs at least three corners", where=f"load.openings[{number}]", value=len(corners))
        loaded &= ~inside(plan, corners)
    if not loaded.any():
        raise InputError(
            "no crossing is loaded",
            where="load",
            remedy="Make the openings smaller (they are in metres, in plan) or load more crossings.",
        )
    return np.flatnonzero(loaded)


def inside(points: Reals, polygon: Reals) -> np.ndarray:
    """Which plan points (k, 2) lie inside the polygon (p, 2), by the parity of crossings of a ray along x."""
    x, y = points[:, :1], points[:, 1:]
    x1, y1 = polygon.T
    x2, y2 = np.roll(polygon, -1, axis=0).T
    straddles = (y1 > y) != (y2 > y)
    with np.errstate(divide="ignore", invalid="ignore"):
        hit = x < x1 + (y - y1) * (x2 - x1) / (y2 - y1)
    return np.asarray((straddles & hit).sum(axis=1) % 2 == 1)
