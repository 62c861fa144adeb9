"""The ground under a shell, as its outer edge shows it.

It is level, through the edge's lowest point, unless a slope is plain: the plane on which the shell would come
to rest, the highest one under its middle that lies nowhere over its edge, bears it all round its middle and
touches much more of the edge than level ground does, and where it does the shell comes down to it. So stand
vaults along and across a hillside and domes cut off by one; a roof that rises from one side to another, which
is high there since nothing carries it, doesn't come down there, and one on two low corners may lean either
way.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from shellform.arrays import Reals, Record, reals
from shellform.surface.shape.target import Surface
from shellform.surface.shape.triangles import directed_edges, triangle_areas

LOW = 0.02  # of the longer side in plan: an edge no higher over the ground stands on it
_STEEPEST = 0.5  # fall over length of ground: steeper ones are walls
_MORE = 1.2  # times the edge that stands on level ground
_AROUND = 0.1  # of the longer side in plan: so far from what bears it lies the middle inwards
_RISING = 0.1  # rise over length, from the edge inwards, of a shell that comes down to it
_MOSTLY = 0.8  # of what stands on the slope alone
_DIRECTIONS = 36  # in which bearing is asked for


@dataclass(frozen=True, eq=False)
class Ground(Record):
    """The plane z = `level` + `slope` · (x, y), m: `slope` (2,), its rise over length along x and y; what
    lies no more than `low`, m, over it stands on it."""

    level: float
    slope: Reals
    low: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "slope", reals("slope", self.slope, (2,)))

    @property
    def slopes(self) -> bool:
        """Whether it isn't level."""
        return bool(self.slope.any())

    @cached_property
    def told(self) -> str:
        """How much it slopes, in words; of level ground nothing."""
        if not self.slopes:
            return ""
        bearing = math.degrees(math.atan2(-self.slope[1], -self.slope[0])) % 360.0
        return f"slopes by {float(np.linalg.norm(self.slope)):.2g} m a metre, down at {bearing:.0f}° from x"

    def over(self, points: Reals) -> Reals:
        """How high points (k, 3) lie over it (k,), m, straight up."""
        return np.asarray(points[:, 2] - self.level - points[:, :2] @ self.slope)


def ground_under(surface: Surface, level: float | None = None) -> Ground:
    """The ground under a surface; at a `level`, m, that is given, level."""
    outer = surface.vertices[surface.boundary[0]]
    low = LOW * surface.longer_side
    flat = Ground(float(outer[:, 2].min()) if level is None else level, np.zeros(2), low)
    if level is not None:
        return flat
    middle = _middle(surface)
    sloping = _resting(outer, middle, low)
    if sloping is None or not 0.0 < np.linalg.norm(sloping.slope) <= _STEEPEST:
        return flat
    edge = _Edge(surface)
    level_held, held = edge.stands(flat), edge.stands(sloping)
    added = held & ~level_held
    if edge.length[held].sum() < _MORE * edge.length[level_held].sum():
        return flat
    if not _bears(edge.middle[held][:, :2] - middle, _AROUND * surface.longer_side):
        return flat
    rising = edge.rises(sloping) > _RISING
    if edge.length[added & rising].sum() < _MOSTLY * edge.length[added].sum():
        return flat
    return sloping


def _middle(surface: Surface) -> Reals:
    """The middle of the surface's area (2,), m, in plan."""
    area = triangle_areas(surface.vertices, surface.triangles)
    return np.asarray(area @ surface.vertices[surface.triangles].mean(axis=1)[:, :2] / area.sum())


def _resting(outer: Reals, middle: Reals, low: float) -> Ground | None:
    """The highest plane under the `middle` (2,) that lies nowhere over the points (k, 3) of an edge."""
    from scipy.optimize import linprog

    inward = outer[:, :2] - middle
    found = linprog(
        [-1.0, 0.0, 0.0],
        A_ub=np.column_stack([np.ones(len(outer)), inward]),
        b_ub=outer[:, 2] - outer[:, 2].min(),
        bounds=[(None, None)] * 3,
    )
    if not found.success:
        return None
    height, slope = float(found.x[0]) + float(outer[:, 2].min()), np.asarray(found.x[1:])
    return Ground(height - float(slope @ middle), slope, low)


def _bears(held: Reals, far: float) -> bool:
    """Whether what is `held` (k, 2), m from the middle, lies round it, at least so `far`, m, each way."""
    turns = np.arange(_DIRECTIONS) * (2.0 * math.pi / _DIRECTIONS)
    reach = held @ np.vstack([np.cos(turns), np.sin(turns)])
    return bool(len(held)) and bool((reach.max(axis=0) >= far).all())


class _Edge:
    """The outer edge of a surface, edge by edge of its mesh: the `ends`, twice (e, 3), m, of each, `length`
    (e,), m, `middle` (e, 3) and, inwards of it, the third vertex of its triangle, `inner` (e, 3)."""

    def __init__(self, surface: Surface) -> None:
        loop, points = surface.boundary[0], surface.vertices
        following, count = np.roll(loop, -1), len(points)
        edges = np.sort(directed_edges(surface.triangles), axis=1) @ [count, 1]
        order = np.argsort(edges)
        wanted = np.sort(np.column_stack([loop, following]), axis=1) @ [count, 1]
        triangle = order[np.searchsorted(edges, wanted, sorter=order)] % len(surface.triangles)
        self.inner = points[surface.triangles[triangle].sum(axis=1) - loop - following]
        self.ends = points[loop], points[following]
        self.middle = 0.5 * (self.ends[0] + self.ends[1])
        self.length = np.linalg.norm(self.ends[1] - self.ends[0], axis=1)

    def stands(self, ground: Ground) -> np.ndarray:
        """Which of its edges (e,) stand on the ground from end to end."""
        a, b = self.ends
        return np.maximum(ground.over(a), ground.over(b)) <= ground.low

    def rises(self, ground: Ground) -> Reals:
        """How steeply (e,) the surface rises from the edge inwards, over the ground."""
        away = np.linalg.norm(self.inner - self.middle, axis=1)
        return np.asarray((ground.over(self.inner) - ground.over(self.middle)) / away)
