"""Where a net ends besides the surface's edge: at a level, and at a closed curve in plan. Beyond it nothing
is built, and nothing loads the net."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shellform.arrays import Flags, Reals, Record, reals
from shellform.net.polylines import closed, inside, nearest


@dataclass(frozen=True, eq=False)
class NetLimits(Record):
    """Where rods end besides the surface's edge: the `ground`, m, below which nothing is built, and the
    corners of a closed curve in `plan` (k, 2), m, outside which nothing is."""

    ground: float | None = None
    plan: Reals | None = None

    def __post_init__(self) -> None:
        if self.plan is not None:
            object.__setattr__(self, "plan", reals("net.outline", self.plan, (None, 2)))

    def within(self, points: Reals) -> Flags:
        """Which (k,) of points on the surface lie within the ground's level and the curve."""
        return self.beyond(points) < 0.0

    def beyond(self, points: Reals) -> Reals:
        """How far (k,), m, points lie past the nearer of both; negative inside, -inf where there is none."""
        result = np.full(len(points), -np.inf)
        if self.ground is not None:
            result = np.maximum(result, self.ground - points[:, 2])
        if self.plan is not None:
            plan = points[:, :2]
            away, _ = nearest(plan, closed(self.plan))
            result = np.maximum(result, np.where(inside(plan, self.plan), -away, away))
        return np.asarray(result)


NO_LIMITS = NetLimits()
