"""How points lie in plan: the smallest rectangle round them, which turns with them.

Of the smallest rectangles one has a side along an edge of the points' convex hull (Freeman and Shapira,
Communications of the ACM 18, 1975).
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from shellform.arrays import Reals

_SMALLER = 0.99  # of the area of the box along the axes: one that is hardly smaller is none


def turn_of_plan(points: Reals) -> float:
    """The angle, rad, in [0, π/2), by which the smallest rectangle round points (k, 2 or 3) in plan is turned
    from x and y; 0 where none is smaller by over a hundredth than the box along them, as of round plans."""
    plan = points[:, :2] - points[:, :2].mean(axis=0)
    try:
        corners = plan[ConvexHull(plan).vertices]
    except QhullError:  # one above the other, or in a row, along which it lies
        along = plan @ np.linalg.svd(plan, full_matrices=False)[2][0]
        corners = plan[[np.argmin(along), np.argmax(along)]]
    x, y = (np.roll(corners, -1, axis=0) - corners).T
    headings = np.mod(np.arctan2(y, x), 2.0 * np.pi)
    first = int(np.argmin(headings))
    corners, headings = np.roll(corners, -first, axis=0), np.roll(headings, -first)
    turns = np.unique(np.mod(headings, 0.5 * np.pi))
    areas = _extents(corners, headings, turns) * _extents(corners, headings, turns + 0.5 * np.pi)
    least = int(np.argmin(areas))
    return float(turns[least]) if areas[least] < _SMALLER * np.ptp(plan, axis=0).prod() else 0.0


def _extents(corners: Reals, headings: Reals, towards: Reals) -> Reals:
    """How far a convex polygon reaches along each of the directions `towards` (t,), rad, both ways together
    (t,), m; its sides (h,) run from `corners` (h, 2), counterclockwise, at rising `headings`, rad. Farthest
    out lies the corner from which sides turn past a right angle to the direction."""

    def reach(direction: Reals) -> Reals:
        past = np.mod(direction + 0.5 * np.pi, 2.0 * np.pi)
        there = corners[np.searchsorted(headings, past) % len(corners)]
        return np.asarray((there * np.column_stack([np.cos(direction), np.sin(direction)])).sum(axis=1))

    return reach(towards) + reach(towards + np.pi)


def sides_in_plan(points: Reals) -> Reals:
    """The sides (2,), m, of the smallest rectangle round points (k, 2 or 3) in plan, nearest to x first."""
    return np.asarray(np.ptp(along_sides(points), axis=0))


def longest_side(points: Reals) -> float:
    """The longest side, m, of the upright box round points (k, 3) on that rectangle."""
    return max(float(sides_in_plan(points).max()), float(np.ptp(points[:, 2])))


def along_sides(points: Reals) -> Reals:
    """Points (k, 2 or 3) in plan (k, 2) along the sides of the smallest rectangle round them."""
    turn = turn_of_plan(points)
    return points[:, :2] if turn == 0.0 else np.asarray(points[:, :2] @ axes_in_plan(turn))


def axes_in_plan(turn: float) -> Reals:
    """The unit vectors, columns (2, 2), along x and y turned by so much."""
    c, s = np.cos(turn), np.sin(turn)
    return np.array([[c, -s], [s, c]])
