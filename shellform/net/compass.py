"""The compass method (Frei Otto): the Chebyshev net that two guide curves determine.

From an origin, the guide curves run straight over the surface along the two lattice directions, one spacing a step. Every
further crossing lies one spacing from its two neighbours nearer to the guides: the intersection of two circles with the
surface, found by Newton's method for a whole diagonal of the lattice at once. It serves here to know which part of the
lattice covers the surface and how far beyond the edge it has to reach; on the extended surface it goes on past the edge.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Protocol

import numpy as np

from shellform.arrays import Flags, Indices, Reals
from shellform.errors import InputError

_ITERATIONS = 20
_CLOSE = 1e-9  # of the spacing


class Finder(Protocol):
    """A closest-point query on a surface that goes on past its edge."""

    def foot(self, points: Reals) -> Any:
        """Foot points of (k, 3) points."""

    def past_edge(self, foot: Any) -> Reals:
        """Signed distance (k,), m, of feet from the edge, positive past it."""

    def past_outline(self, foot: Any) -> Reals:
        """The same as if the surface had no openings."""


def covering_lattice(
    finder: Finder, origin: Reals, direction: Reals, spacing: float, *, margin: float, most: int = 100_000
) -> tuple[Indices, Reals]:
    """Lattice places (c, 2) whose compass points (c, 3) lie on the surface or less than `margin` m past its edge.

    `origin` (3,) and the u `direction` (3,) are on the surface and along it. Raises InputError where more than `most` crossings
    would be needed.
    """
    points: dict[tuple[int, int], Reals] = {(0, 0): origin}
    normal = finder.foot(origin[None]).normal[0]
    sideways = np.cross(normal, direction)
    for axis, along in [(0, direction), (1, sideways)]:
        for sign in (1, -1):
            for k, point in enumerate(_guide(finder, origin, sign * along, spacing, margin), start=1):
                points[(sign * k, 0) if axis == 0 else (0, sign * k)] = point
    for right in (1, -1):
        for up in (1, -1):
            _fill(finder, points, right, up, spacing, margin, most)
    places = sorted(points)
    return np.array(places), np.array([points[place] for place in places])


def _guide(finder: Finder, origin: Reals, direction: Reals, spacing: float, margin: float) -> Iterator[Reals]:
    """Points one spacing apart along the straightest line from the origin, up to the first past the margin."""
    here, heading = origin, direction
    while True:
        step = spacing
        for _ in range(_ITERATIONS):
            foot = finder.foot((here + step * heading)[None])
            there = foot.point[0]
            reached = float(np.linalg.norm(there - here))
            if abs(reached - spacing) < _CLOSE * spacing:
                break
            step *= spacing / max(reached, 0.1 * spacing)
        yield there
        if finder.past_outline(foot)[0] > margin:
            return
        chord = there - here
        chord = chord - (chord @ foot.normal[0]) * foot.normal[0]
        here, heading = there, chord / np.linalg.norm(chord)


def _fill(
    finder: Finder, points: dict[tuple[int, int], Reals], right: int, up: int, spacing: float, margin: float, most: int
) -> None:
    """Fills one quadrant, diagonal by diagonal; `right` and `up` are its signs."""
    overshoot: dict[tuple[int, int], float] = {}
    diagonal = 2
    while True:
        places = [
            (right * i, up * (diagonal - i))
            for i in range(1, diagonal)
            if (right * (i - 1), up * (diagonal - i)) in points
            and (right * i, up * (diagonal - i - 1)) in points
            and (right * (i - 1), up * (diagonal - i - 1)) in points
        ]
        if not places:
            return
        a = np.array([points[(i - right, j)] for i, j in places])
        b = np.array([points[(i, j - up)] for i, j in places])
        c = np.array([points[(i - right, j - up)] for i, j in places])
        found, past, good = _corner(finder, a, b, c, spacing)
        for place, point, beyond, fine in zip(places, found, past, good, strict=True):
            i, j = place
            nearer = min(overshoot.get((i - right, j), 0.0), overshoot.get((i, j - up), 0.0))
            # A place is of use while one of its neighbours towards the origin isn't yet past the margin.
            if fine and nearer < margin:
                points[place], overshoot[place] = point, float(beyond)
        if len(points) > most:
            raise InputError(
                f"more than {most} crossings would be needed", value=spacing, remedy="Choose a larger spacing."
            )
        diagonal += 1


def _corner(finder: Finder, a: Reals, b: Reals, c: Reals, spacing: float) -> tuple[Reals, Reals, Flags]:
    """Points (k, 3) at the spacing from a and b, away from c, how far past the edge they are, and whether they exist."""
    point = a + b - c
    good = np.ones(len(a), dtype=bool)
    for _ in range(_ITERATIONS):
        foot = finder.foot(point)
        point = foot.point
        to_a, to_b = point - a, point - b
        off = 0.5 * np.column_stack([np.sum(to_a**2, axis=1), np.sum(to_b**2, axis=1)]) - 0.5 * spacing**2
        if np.abs(off[good]).max(initial=0.0) < _CLOSE * spacing**2:
            break
        # Newton in the tangent plane: J (s t1 + t t2) = -off with rows to_a, to_b.
        first = np.cross(foot.normal, np.where(np.abs(foot.normal[:, :1]) < 0.9, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]))
        first /= np.linalg.norm(first, axis=1, keepdims=True)
        second = np.cross(foot.normal, first)
        j11, j12 = np.sum(to_a * first, axis=1), np.sum(to_a * second, axis=1)
        j21, j22 = np.sum(to_b * first, axis=1), np.sum(to_b * second, axis=1)
        det = j11 * j22 - j12 * j21
        good &= np.abs(det) > 0.05 * spacing**2
        det = np.where(good, det, 1.0)
        s = (-off[:, 0] * j22 + off[:, 1] * j12) / det
        t = (-off[:, 1] * j11 + off[:, 0] * j21) / det
        step = s[:, None] * first + t[:, None] * second
        size = np.linalg.norm(step, axis=1, keepdims=True)
        point = point + np.where(good[:, None], step * np.minimum(1.0, 0.5 * spacing / np.maximum(size, 1e-300)), 0.0)
    good &= np.abs(off).max(axis=1) < 1e-3 * spacing**2
    return point, finder.past_outline(foot), good
