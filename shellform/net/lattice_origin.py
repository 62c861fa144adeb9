"""Where a lattice begins on a surface, and how its first two rods go: at an angle and an offset from the
middle of the plan, or along two curves in plan that cross."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from shellform.arrays import Reals, Record, reals
from shellform.errors import InputError
from shellform.net.compass import Finder, Guide, raised
from shellform.net.refusal import Beside, Reason
from shellform.quantities import rounded
from shellform.surface.shape.target import Surface
from shellform.surface.shape.triangles import triangle_areas


@dataclass(frozen=True, eq=False)
class LatticeOrigin(Record):
    """The `point` (3,), m, on the surface; the `frame` (3, 3) of u, v and normal there, as columns; and the
    `guides` from it forwards and backwards along u, then along v."""

    point: Reals
    frame: Reals
    guides: tuple[Guide, Guide, Guide, Guide]


def origin_at(
    surface: Surface,
    finder: Finder,
    spacings: tuple[float, float],
    *,
    angle: float,
    offset: tuple[float, float],
) -> LatticeOrigin:
    """The origin so many `spacings`, m along u and v, as `offset` says from the middle of the plan, with
    straight guides, u at the `angle`, rad, against x in plan. Raises InputError where it lies off the
    surface."""
    heading = np.array([np.cos(angle), np.sin(angle)])
    shift = offset[0] * spacings[0] * heading + offset[1] * spacings[1] * np.array([-heading[1], heading[0]])
    point, normal = _on_surface(surface, finder, _middle(surface, finder) + shift, "net.offset")
    along = _tangent(normal, heading)
    side = np.cross(normal, along)
    lines = Guide(along), Guide(-along), Guide(side), Guide(-side)
    return LatticeOrigin(point, np.column_stack([along, side, normal]), lines)


def origin_of_guides(surface: Surface, finder: Finder, curves: tuple[ArrayLike, ArrayLike]) -> LatticeOrigin:
    """The origin where two `curves` in plan, (k, 2) m, cross, along which the u and the v rod run. Raises
    InputError where they don't cross, or off the surface."""
    along_u, along_v = (reals(f"net.guides[{k}]", each, (None, 2)) for k, each in enumerate(curves))
    plan, halves = _halves(along_u, along_v)
    point, normal = _on_surface(surface, finder, plan, "net.guides")
    first, second, third, fourth = (Guide(_tangent(normal, half[1] - half[0]), half) for half in halves)
    along = first.direction
    frame = np.column_stack([along, np.cross(normal, along), normal])
    return LatticeOrigin(point, frame, (first, second, third, fourth))


def _on_surface(surface: Surface, finder: Finder, plan: Reals, where: str) -> tuple[Reals, Reals]:
    """The point over a `plan` (2,), and the normal there."""
    point = _above(surface, finder, plan)
    foot = finder.foot(point[None])
    if finder.past_outline(foot)[0] > 0.0:
        raise Beside(
            Reason.BESIDE.value,
            where=where,
            value=rounded(plan, 4),
            remedy="Choose a smaller offset, or guides that cross on the surface.",
        )
    return point, foot.normal[0]


def _tangent(normal: Reals, plan: Reals) -> Reals:
    """The direction (3,) along the surface with this `normal` whose plan is the given one (2,)."""
    flat = np.array([*plan, 0.0])
    flat[2] = -(flat @ normal) / normal[2] if abs(normal[2]) > 1e-9 else 0.0
    flat -= (flat @ normal) * normal
    return np.asarray(flat / np.linalg.norm(flat))


def _middle(surface: Surface, finder: Finder) -> Reals:
    """The middle of the plan (2,): its centroid, or where that lies off the surface, as in the bend of an L,
    the place farthest from the edge."""
    corners = surface.vertices[surface.triangles]
    areas = triangle_areas(surface.vertices, surface.triangles)
    centroid = np.asarray(areas @ corners.mean(axis=1) / areas.sum())[:2]
    if finder.past_outline(finder.foot(_above(surface, finder, centroid)[None]))[0] <= 0.0:
        return centroid
    edge = cKDTree(surface.vertices[np.concatenate(surface.boundary)])
    return surface.vertices[np.argmax(edge.query(surface.vertices)[0]), :2]


def _above(surface: Surface, finder: Finder, plan: Reals) -> Reals:
    """The place (3,) on the surface over a `plan` (2,), sought from the vertex nearest to it there."""
    away = np.linalg.norm(surface.vertices[:, :2] - plan, axis=1)
    return raised(finder, plan, surface.vertices[np.argmin(away)])


def _halves(along_u: Reals, along_v: Reals) -> tuple[Reals, list[Reals]]:
    """Where two polylines (k, 2) first cross, (2,), and their four halves from there: forwards and backwards
    along u, along v.
    """
    for i, (a, b) in enumerate(pairwise(along_u)):
        for j, (c, d) in enumerate(pairwise(along_v)):
            matrix = np.column_stack([b - a, c - d])
            if abs(np.linalg.det(matrix)) < 1e-12 * float(np.linalg.norm(b - a) * np.linalg.norm(c - d)):
                continue
            s, t = np.linalg.solve(matrix, c - a)
            if not (0.0 <= s <= 1.0 and 0.0 <= t <= 1.0):
                continue
            meet = a + s * (b - a)
            halves = [
                np.vstack([meet, along_u[i + 1 :]]),
                np.vstack([meet, along_u[i::-1]]),
                np.vstack([meet, along_v[j + 1 :]]),
                np.vstack([meet, along_v[j::-1]]),
            ]
            if all(np.linalg.norm(half[1] - meet) > 0.0 for half in halves):
                # Where v runs to the right of u, it is turned round.
                if matrix[0, 0] * matrix[1, 1] - matrix[0, 1] * matrix[1, 0] > 0.0:
                    halves[2], halves[3] = halves[3], halves[2]
                return meet, halves
    raise InputError(
        "the two guide curves don't cross between their ends",
        where="net.guides",
        remedy="Draw them through one point on the surface.",
    )
