"""Polylines and polygons, as edges, outlines and openings are given: what lies near them, what inside."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from shellform.arrays import Flags, Reals


def nearest(points: Reals, curve: Reals) -> tuple[Reals, Reals]:
    """The distances (k,), m, of points (k, d) from a polyline (p, d), and the arc lengths (k,), m, along it
    of its places nearest to them. A polygon is `closed` before."""
    away, at, passed = np.full(len(points), np.inf), np.zeros(len(points)), 0.0
    for a, b in pairwise(curve):
        side = b - a
        share = np.clip((points - a) @ side / max(float(side @ side), 1e-300), 0.0, 1.0)
        here, length = np.linalg.norm(points - a - share[:, None] * side, axis=1), float(np.linalg.norm(side))
        at = np.where(here < away, passed + share * length, at)
        away, passed = np.minimum(away, here), passed + length
    return away, at


def closed(polygon: Reals) -> Reals:
    """The polyline (p + 1, d) round a polygon (p, d)."""
    return np.vstack([polygon, polygon[:1]])


def inside(points: Reals, polygon: Reals) -> Flags:
    """Which plan points (k, 2) lie inside the polygon (p, 2), by the parity of crossings of a ray along x."""
    x, y = points[:, :1], points[:, 1:]
    x1, y1 = polygon.T
    x2, y2 = np.roll(polygon, -1, axis=0).T
    straddles = (y1 > y) != (y2 > y)
    with np.errstate(divide="ignore", invalid="ignore"):
        hit = x < x1 + (y - y1) * (x2 - x1) / (y2 - y1)
    return np.asarray((straddles & hit).sum(axis=1) % 2 == 1)
