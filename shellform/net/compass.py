"""The compass method (Frei Otto): the Chebyshev net that two guide curves determine.

From an origin, the guide curves run over the surface, straight along the two lattice directions or along
curves given in plan, one spacing a step. Every further crossing lies one spacing from its two neighbours
nearer to the guides: the intersection of two circles with the surface, found by Newton's method for a whole
diagonal of the lattice at once. On the extended surface it goes on past the edge, so that it tells which part
of the lattice covers the surface.

Where the two rods of a crossing come to run in one direction the net ends, whatever comes after. By
Hazzidakis' formula the Gaussian curvature of a patch of a net adds up to 2 pi less the sum of its four
angles, so that it lies between - 2 pi and 2 pi: such a surface holds more than that, seen from this origin,
and takes no single net.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from shellform.arrays import Flags, Indices, Reals, Record
from shellform.errors import InputError
from shellform.net.refusal import NoNet, Reason
from shellform.quantities import rounded

_ITERATIONS = 30  # of Newton towards one point, at the most
_CLOSE = 1e-10  # of the spacing
_PARALLEL = 0.05  # sine of the angle between two rods, below which they run in one direction
# Half of what makes the rods of a quadrant between straight guides come to be parallel, π/2.
_LITTLE = 0.25 * math.pi
_MOST = 200_000  # crossings
_MOST_STEPS = 4000  # of one guide


class Finder(Protocol):
    """A closest-point query on a surface that goes on past its edge."""

    def foot(self, points: Reals) -> Any:
        """Foot points of (k, 3) points."""

    def past_edge(self, foot: Any) -> Reals:
        """Signed distance (k,), m, of feet from the edge, positive past it."""

    def past_outline(self, foot: Any) -> Reals:
        """The same as if the surface had no openings."""


@dataclass(frozen=True, eq=False)
class Guide(Record):
    """A guide from the origin on: its first `direction` (3,) along the surface and, if it isn't to run
    straight, the corners of its `plan` (k, 2), m, which begin at the origin."""

    direction: Reals
    plan: Reals | None = None


def covering_lattice(
    finder: Finder,
    origin: Reals,
    guides: tuple[Guide, Guide, Guide, Guide],
    spacing: tuple[float, float],
    *,
    margin: float,
) -> tuple[Indices, Reals]:
    """Lattice places (c, 2) whose compass points (c, 3) lie on the surface or less than `margin` m past its
    edge.

    `origin` (3,) is on the surface; the `guides` run from it forwards and backwards along u, then along v.
    Raises InputError where more than `_MOST` crossings would be needed, and where the net breaks down on the
    surface.
    """
    points: dict[tuple[int, int], Reals] = {(0, 0): origin}
    for number, guide in enumerate(guides):
        axis, sign = number // 2, 1 - 2 * (number % 2)
        for k, point in enumerate(_guide(finder, origin, guide, spacing[axis], margin), start=1):
            points[(sign * k, 0) if axis == 0 else (0, sign * k)] = point
    for right in (1, -1):
        for up in (1, -1):
            _fill(finder, points, right, up, spacing, margin)
    places = sorted(points)
    return np.array(places), np.array([points[place] for place in places])


def raised(finder: Finder, plan: Reals, near: Reals) -> Reals:
    """The point (3,) of the surface on the vertical through `plan` (2,), from the point `near` (3,) on."""
    point = np.array([*plan, near[2]])
    for _ in range(_ITERATIONS):
        foot = finder.foot(point[None])
        below, normal = foot.point[0], foot.normal[0]
        if float(np.linalg.norm(below[:2] - plan)) < 1e-13 * (1.0 + float(np.abs(plan).max())):
            break
        # Where the vertical meets the tangent plane at the foot; on steep ground the foot's height alone
        steep = abs(normal[2]) < 0.1
        point[2] = below[2] - (0.0 if steep else float(normal[:2] @ (plan - below[:2])) / normal[2])
    return np.asarray(below)


def _guide(finder: Finder, origin: Reals, guide: Guide, spacing: float, margin: float) -> Iterator[Reals]:
    """Points one spacing apart from the origin on, up to the first past the margin: along the plan as far as
    it goes, then along the straightest line, in which each two chords lie in one plane with the normal
    between them."""
    here, heading = origin, guide.direction
    upright = finder.foot(origin[None]).normal[0]
    on_plan = guide.plan is not None
    arc = 0.0
    for _ in range(_MOST_STEPS):
        step, lift = spacing, 0.0
        for _ in range(_ITERATIONS):
            if on_plan:
                assert guide.plan is not None
                target = _along(guide.plan, arc + step)
                if target is None:
                    on_plan, step = False, spacing
                    continue
                foot = finder.foot(raised(finder, target, here)[None])
            else:
                foot = finder.foot((here + step * heading + lift * upright)[None])
            there = foot.point[0]
            reached = float(np.linalg.norm(there - here))
            height = float((there - here) @ upright)
            if abs(reached - spacing) < _CLOSE * spacing and (
                on_plan or abs(height - lift) < _CLOSE * spacing
            ):
                break
            step *= spacing / max(reached, 0.1 * spacing)
            lift = height
        arc += step
        yield there
        if finder.past_outline(foot)[0] > margin:
            return
        chord = there - here
        chord = chord - (chord @ foot.normal[0]) * foot.normal[0]
        here, heading, upright = there, chord / np.linalg.norm(chord), foot.normal[0]
    raise NoNet(
        Reason.CIRCLING,
        f"a guide doesn't leave the surface in {_MOST_STEPS} steps: it runs in circles",
        where="net.angle",
        remedy="Choose another angle or origin, or a surface that isn't nearly closed.",
    )


def _along(plan: Reals, arc: float) -> Reals | None:
    """The point (2,) of a polyline (k, 2) at an arc length; None past its end."""
    sides = np.linalg.norm(np.diff(plan, axis=0), axis=1)
    ends = np.concatenate([[0.0], np.cumsum(sides)])
    if arc > ends[-1]:
        return None
    return np.array([np.interp(arc, ends, plan[:, 0]), np.interp(arc, ends, plan[:, 1])])


def _fill(
    finder: Finder,
    points: dict[tuple[int, int], Reals],
    right: int,
    up: int,
    spacing: tuple[float, float],
    margin: float,
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
        found, beyond, good = _corner(finder, a, b, c, spacing)
        if not good.all():
            rods = np.stack([a, b, a + b - c])[:, ~good]
            inside = finder.past_outline(finder.foot(rods.reshape(-1, 3))).reshape(3, -1) < 0.0
            on = (inside[0] & inside[1]) | inside[2]  # the crossing that is missing would lie on the surface
            if on.any():
                k = int(np.flatnonzero(~good)[np.argmax(on)])
                raise _broken(finder, points, places[k], c[k], spacing)
        for place, point, over, fine in zip(places, found, beyond, good, strict=True):
            i, j = place
            nearer = min(overshoot.get((i - right, j), 0.0), overshoot.get((i, j - up), 0.0))
            # A place is of use while one of its neighbours towards the origin isn't yet past the margin.
            if fine and nearer < margin:
                points[place], overshoot[place] = point, float(over)
        if len(points) > _MOST:
            raise InputError(
                f"more than {_MOST} crossings would be needed",
                value=spacing[0],
                remedy="Choose a larger spacing.",
            )
        diagonal += 1


def _corner(
    finder: Finder, a: Reals, b: Reals, c: Reals, spacing: tuple[float, float]
) -> tuple[Reals, Reals, Flags]:
    """The crossings (k, 3) that lie a u spacing from `a` and a v spacing from `b`, across from `c`; their
    signed distances past the outline; and where they exist."""
    point = a + b - c
    good = np.ones(len(a), dtype=bool)
    area = spacing[0] * spacing[1]
    for _ in range(_ITERATIONS):
        foot = finder.foot(point)
        point = foot.point
        to_a, to_b = point - a, point - b
        lengths = np.column_stack([np.sum(to_a**2, axis=1), np.sum(to_b**2, axis=1)])
        off = 0.5 * (lengths - np.square(spacing))
        if np.abs(off[good]).max(initial=0.0) < _CLOSE * area:
            break
        # Newton in the tangent plane: J (s t1 + t t2) = -off with rows to_a, to_b.
        first = np.cross(
            foot.normal, np.where(np.abs(foot.normal[:, :1]) < 0.9, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
        )
        first /= np.linalg.norm(first, axis=1, keepdims=True)
        second = np.cross(foot.normal, first)
        j11, j12 = np.sum(to_a * first, axis=1), np.sum(to_a * second, axis=1)
        j21, j22 = np.sum(to_b * first, axis=1), np.sum(to_b * second, axis=1)
        det = j11 * j22 - j12 * j21
        good &= np.abs(det) > _PARALLEL * area
        det = np.where(good, det, 1.0)
        s = (-off[:, 0] * j22 + off[:, 1] * j12) / det
        t = (-off[:, 1] * j11 + off[:, 0] * j21) / det
        step = s[:, None] * first + t[:, None] * second
        size = np.linalg.norm(step, axis=1, keepdims=True)
        most = 0.5 * min(spacing)
        point = point + np.where(good[:, None], step * np.minimum(1.0, most / np.maximum(size, 1e-300)), 0.0)
    good &= np.abs(off).max(axis=1) < 1e-3 * area
    # Newton's method may also end at the other intersection of the two circles, next to c.
    good &= np.sum((point - c) * (a + b - 2.0 * c), axis=1) > 0.0
    return point, finder.past_outline(foot), good


def _broken(
    finder: Finder,
    points: dict[tuple[int, int], Reals],
    place: tuple[int, int],
    at: Reals,
    spacing: tuple[float, float],
) -> InputError:
    """What is said where the net can't go on at a lattice place, near the point `at`."""
    i, j = place
    step_i, step_j = (1 if i > 0 else -1), (1 if j > 0 else -1)
    cells = [
        [points[p] for p in ((a, b), (a + step_i, b), (a + step_i, b + step_j), (a, b + step_j))]
        for a in range(0, i, step_i)
        for b in range(0, j, step_j)
        if all(p in points for p in ((a, b), (a + step_i, b), (a + step_i, b + step_j), (a, b + step_j)))
    ]
    total = float(gaussian(finder, np.array(cells)).sum()) if cells else math.nan
    parallel = f"its rods come to run in one direction at {rounded(at)}"
    counted = "from the net's origin to there its Gaussian curvature adds up to"
    what = f"the surface is curved too much for one net: {parallel}"
    remedy = "Try another net.angle or net.offset; where none helps it takes a flatter form."
    if abs(total) < _LITTLE:
        what = (
            f"the surface isn't smooth enough for a net: {parallel}, though {counted} {total:.2f} only, where "
            f"π/2 = {0.5 * math.pi:.2f} does that. A crease does, a dent, or an edge that turns to and fro"
        )
        remedy = "Smooth the surface or its edge there, or try another net.angle or net.offset."
    elif cells:
        what += f"; {counted} {total:.2f} (no patch of a net holds 2π = {2 * math.pi:.2f})"
    return NoNet(Reason.BROKEN, what, where="net.spacing", value=spacing[0], remedy=remedy)


def gaussian(finder: Finder, corners: Reals) -> Reals:
    """The Gaussian curvature times the area (q,), rad, of cells with corners (q, 4, 3) on the surface."""
    foot = finder.foot(corners.mean(axis=1))
    foot = finder.foot(foot.point)
    a, b, c, d, e, f = foot.hessian.T  # xx, xy, yy, xz, yz, zz
    # Of the three eigenvalues one is zero: the second invariant is the product of the other two.
    invariant = a * c - b * b + a * f - d * d + c * f - e * e
    across = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    return np.asarray(invariant * 0.5 * np.linalg.norm(across, axis=1))
