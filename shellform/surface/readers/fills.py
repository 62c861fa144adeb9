"""Openings closed, as the paper closes those of its shell (section 4.1, figure 5), so that the gridshell can
stand on the ground all round.

A hole is closed over the plane square to the mean normal round it; an open stretch of the outer edge, between
two places where it stands on the ground, goes on outwards and down to a footprint on the ground. In both
cases the fill has the least bending (plate.py) of all that continue the surface with its slope. The footprint
lies where the fill descends at 45° on average, or at the slope the surface already has at its edge where that
is steeper; or further out, where it leaves the feet in line with the edge on the ground beyond them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from shellform.arrays import Flags, Indices, Reals, Record
from shellform.errors import InputError, how_many
from shellform.quantities import rounded
from shellform.surface.readers.draft import Draft, noted
from shellform.surface.shape.plate import bent_heights
from shellform.surface.shape.target import ON_GROUND, closed_loops, length_round, make_surface
from shellform.surface.shape.triangles import area_vectors, open_edges

_DESCENT = 1.0  # mean slope of a fill down to the ground
_STEEPEST = 3.0  # mean slope of it at the most
_FLATTEST = 0.7  # mean slope of a fill whose footprint goes further out
_WIDEST = np.pi / 4  # angle to its chord at which a footprint leaves a foot
_BLEND = 0.1  # of the span: how softly a footprint goes over from the one rule to the other
_UPRIGHT = 0.15  # least vertical part of a normal that a fill can start from
_SHORT = 0.5  # of an edge: footprints nearer than that to the edge are left out


def filled(
    draft: Draft, where: str, *, what: str | None = None, narrower: float = 0.0, ground: float | None = None
) -> Draft:
    """The draft, z up and mended, with its "holes", its open "edges", or "all" closed, and of holes in any
    case those `narrower`, m, along each axis; its own vertices come first and don't move.

    Edges come down to the `ground`, m (left out: the edge's lowest point). Raises InputError where there is
    nothing to close or no smooth way to.
    """
    if what not in (None, "holes", "edges", "all"):
        raise InputError(
            "must be holes, edges or all",
            where="surface.fill",
            value=what,
            remedy="Leave it out to close nothing.",
        )
    draft = _upwards(draft)
    normals = make_surface(draft.points, draft.triangles, normals=draft.normals, source=where).normals
    openings = openings_of(draft.points, closed_loops(open_edges(draft.triangles)), ground)
    own, closed = len(draft.points), replace(draft, normals=normals)
    outer, level, low, holes = openings.outer, openings.level, openings.low, openings.holes
    every = what in ("holes", "all")
    narrow = openings.narrower(narrower)
    for loop in holes if every else narrow:
        closed = _with_fill(closed, *_capped(draft.points, normals, loop, where))
    if what in ("edges", "all") and ground is not None:
        edge = draft.points[outer, 2]
        if low[outer].sum() < 2:
            raise OffGround(ground, float(edge.min()), float(edge.max()))
    arches = _arches(outer, low, where) if what in ("edges", "all") else []
    for arch in arches:
        closed = _with_fill(closed, *_footed(draft.points, normals, arch, level, where))
    notes = []
    if narrow and not every:
        told = how_many(len(narrow), "hole", "holes")
        notes.append(f"{told} narrower than {narrower:g} m {'was' if len(narrow) == 1 else 'were'} closed")
    if every:
        notes.append(
            how_many(len(holes), "hole was closed", "holes were closed")
            + (
                f", {how_many(openings.standing, 'that stands on the ground was not', 'that stand on the ground were not')}"
                if openings.standing
                else ""
            )
        )
    if what in ("edges", "all"):
        notes.append(
            how_many(
                len(arches),
                f"open stretch of the edge was brought down to the ground at {level:.4g} m",
                f"open stretches of the edge were brought down to the ground at {level:.4g} m",
            )
        )
    for note in notes:
        closed = noted(closed, note)
    if draft.normals is None and closed.normals is not None:  # with the fill, the rim knows both its sides
        estimated = make_surface(closed.points, closed.triangles, source=where).normals
        closed = replace(closed, normals=np.vstack([estimated[:own], closed.normals[own:]]))
    return closed


class OffGround(InputError):
    """A `ground`, m, that was given and that an outer edge, from its `lowest` to its `highest` point, m,
    touches at fewer than two places."""

    def __init__(self, ground: float, lowest: float, highest: float) -> None:
        self.lowest, self.highest = lowest, highest
        super().__init__(
            "the edge touches the ground that is given at fewer than two places, so that it can't be brought down "
            f"between them: it lies at {lowest:.6g} to {highest:.6g} m",
            where="surface.ground",
            value=ground,
            remedy="Give a height nearer to the edge's lowest, or leave it out for that.",
        )


@dataclass(frozen=True, eq=False)
class Openings(Record):
    """What a surface's edges enclose: of its `points` (n, 3) those that lie `low` (n,), on the ground at the
    `level`, m; its `outer` edge, and the `holes` that don't stand on the ground, beside so many `standing`
    there, as doors do."""

    points: Reals
    outer: Indices
    level: float
    low: Flags
    holes: tuple[Indices, ...]
    standing: int

    def narrower(self, width: float) -> list[Indices]:
        """The holes that are narrower than a width, m."""
        return [loop for loop in self.holes if width_of(self.points, loop) < width]


def openings_of(points: Reals, loops: Sequence[Indices], ground: float | None) -> Openings:
    """The openings of a surface whose edges are these `loops`, the longest of them the outer one; the
    `ground`'s level, m (None: the outer edge's lowest point)."""
    outer = max(loops, key=lambda loop: length_round(points[loop]))
    level = float(points[outer, 2].min()) if ground is None else ground
    low = points[:, 2] <= level + ON_GROUND * (float(points[:, 2].max()) - level)
    holes = tuple(loop for loop in loops if loop is not outer and not low[loop].any())
    return Openings(points, outer, level, low, holes, len(loops) - 1 - len(holes))


def width_of(points: Reals, loop: Indices) -> float:
    """How wide an opening is, m: the larger side of a box round it."""
    return float(np.ptp(points[loop], axis=0).max())


def _upwards(draft: Draft) -> Draft:
    up = area_vectors(draft.points, draft.triangles)[:, 2].sum()
    return draft if up >= 0.0 else replace(draft, triangles=draft.triangles[:, ::-1].copy())


@dataclass(frozen=True, eq=False)
class _Arch(Record):
    """A stretch of the outer edge that doesn't stand on the ground: its `vertices` from foot to foot, and the
    ground's vertices `before` and `after` it, which are the feet themselves where the ground is but a point
    there."""

    vertices: Indices
    before: int
    after: int


def _arches(outer: Indices, low: Flags, where: str) -> list[_Arch]:
    """The arches of the outer edge, in its direction."""
    grounded = low[outer]
    if grounded.sum() < 2:
        raise InputError(
            "its edge touches the ground at fewer than two places, so that it can't be brought down between "
            "them",
            where=where,
            remedy="State the ground's height (surface.ground), or close the shell's edge in its own "
            "program.",
        )
    turned = np.roll(outer, -int(np.argmax(grounded)))
    feet = np.flatnonzero(low[turned])
    ends = np.append(feet[1:], len(turned))
    closed = np.append(turned, turned[0])
    count = len(turned)
    found = []
    for a, b in zip(feet, ends, strict=True):
        if b - a > 1:
            before, after = turned[a - 1], turned[(b + 1) % count]
            found.append(
                _Arch(
                    closed[a : b + 1],
                    int(before if low[before] else closed[a]),
                    int(after if low[after] else closed[b]),
                )
            )
    return found


def _capped(
    points: Reals, normals: Reals, loop: Indices, where: str
) -> tuple[Indices, Reals, Reals, Indices]:
    """The rim, new points (k, 3), their normals, and triangles, numbered rim first, of a hole's fill."""
    up = normals[loop].mean(axis=0)
    upright = float(np.linalg.norm(up))
    up = up / upright if upright > _UPRIGHT else np.array([0.0, 0.0, 1.0])
    first = np.cross(up, np.eye(3)[np.argmin(np.abs(up))])
    first /= np.linalg.norm(first)
    frame = np.array([first, np.cross(up, first), up])
    rim = loop[::-1]  # with the fill on its left
    local, slope = points[rim] @ frame.T, _gradients(normals[rim] @ frame.T, points[rim], where)
    inside, triangles = _meshed(local[:, :2], where)
    plan = np.vstack([local[:, :2], inside])
    known = np.full(len(plan), np.nan)
    known[: len(rim)] = local[:, 2]
    heights, slopes = _least_bent(plan, triangles, known, np.arange(len(rim)), slope, closed=True)
    new = slice(len(rim), None)
    return rim, np.column_stack([inside, heights[new]]) @ frame, _upright(slopes[new]) @ frame, triangles


def _footed(
    points: Reals, normals: Reals, arch: _Arch, level: float, where: str
) -> tuple[Indices, Reals, Reals, Indices]:
    """The same of an arch's fill, which reaches the ground."""
    place = points[arch.vertices]
    chord = place[-1, :2] - place[0, :2]
    span = float(np.linalg.norm(chord))
    if span <= 0.0:
        raise InputError(
            "an open stretch of its edge starts and ends at one place",
            where=where,
            remedy="Close it in its own program.",
        )
    outwards = np.array([chord[1], -chord[0]]) / span
    inner = normals[arch.vertices[1:-1]]  # at a foot two slopes meet, so only the arch between them counts
    slope = _gradients(np.vstack([inner[:1], inner, inner[-1:]]), place, where)
    descent = np.clip(-slope @ outwards, _DESCENT, _STEEPEST)
    for _ in range(3):
        descent[1:-1] = 0.25 * descent[:-2] + 0.5 * descent[1:-1] + 0.25 * descent[2:]
    away = np.maximum(place[:, 2] - level, 0.0) / descent
    away = _in_line(away, place, points[[arch.before, arch.after], :2], outwards, level)
    step = float(np.linalg.norm(np.diff(place, axis=0), axis=1).mean())
    far = np.flatnonzero(away > _SHORT * step)
    if not len(far):
        raise InputError(
            "an open stretch of its edge is lower than its mesh is fine",
            where=where,
            remedy="Refine the mesh.",
        )
    foot = _evenly(
        np.vstack([place[-1, :2], (place[far, :2] + away[far, None] * outwards)[::-1], place[0, :2]]), step
    )[1:-1]
    rim = arch.vertices[::-1]
    outline = np.vstack([place[::-1, :2], foot[::-1]])
    inside, triangles = _meshed(outline, where)
    plan = np.vstack([outline, inside])
    known = np.full(len(plan), np.nan)
    known[: len(rim)] = place[::-1, 2]
    known[len(rim) : len(outline)] = level
    heights, slopes = _least_bent(plan, triangles, known, np.arange(len(rim)), slope[::-1], closed=False)
    return rim, np.column_stack([plan, heights])[len(rim) :], _upright(slopes[len(rim) :]), triangles


def _in_line(away: Reals, place: Reals, beyond: Reals, outwards: Reals, level: float) -> Reals:
    """Distances (k,), m, from an arch out to its footprint, at least about those given, such that it leaves
    the feet in line with the ground `beyond` them (2, 2), as a smooth footprint does; as given where the arch
    isn't a graph over its chord.
    """
    first, last = place[0, :2], place[-1, :2]
    along = (last - first) / np.linalg.norm(last - first)
    span = float(np.linalg.norm(last - first))
    share, rim = (place[:, :2] - first) @ along / span, (place[:, :2] - first) @ outwards
    if (np.diff(share) <= 0.0).any():
        return away
    leave, arrive = _leaving(first - beyond[0], along, outwards), _leaving(last - beyond[1], -along, outwards)
    curve = span * share * (1.0 - share) * ((1.0 - share) * leave + share * arrive)
    middle = int(np.argmax(place[:, 2]))
    most = rim[middle] + (place[middle, 2] - level) / _FLATTEST
    if curve[middle] > most:
        curve *= max(most, 0.0) / curve[middle]
    blend = _BLEND * span * share * (1.0 - share)
    given = rim + away
    return np.asarray(np.maximum(0.5 * (given + curve + np.hypot(given - curve, blend)) - rim, 0.0))


def _leaving(way: Reals, along: Reals, outwards: Reals) -> float:
    """The slope over the chord with which an edge on the ground goes on past its foot; none where it would go
    inwards, or is but a point.
    """
    out = float(way @ outwards)
    return float(np.tan(min(np.arctan2(out, float(way @ along)), _WIDEST))) if out > 0.0 else 0.0


def _upright(slopes: Reals) -> Reals:
    """Unit normals (k, 3) of heights with these slopes (k, 2)."""
    normals = np.column_stack([-slopes, np.ones(len(slopes))])
    return np.asarray(normals / np.linalg.norm(normals, axis=1, keepdims=True))


def _gradients(normals: Reals, place: Reals, where: str) -> Reals:
    """Slopes (k, 2) of a surface with these normals (k, 3) over its plan."""
    if (normals[:, 2] < _UPRIGHT).any():
        spot = rounded(place[int(np.argmin(normals[:, 2]))])
        raise InputError(
            f"is too steep to be continued at {spot} m",
            where=where,
            remedy="Close this opening in the shell's own program.",
        )
    return np.asarray(-normals[:, :2] / normals[:, 2:])


def _meshed(outline: Reals, where: str) -> tuple[Reals, Indices]:
    """Points (k, 2) inside an outline (n, 2) that runs counterclockwise, and triangles numbered with the
    outline's points first.
    """
    from shellform.surface import cad

    try:
        return cad.mesh_plan([outline])
    except InputError as error:
        raise InputError(
            f"an opening can't be closed over its plan: {error.what}",
            where=where,
            remedy="Close it in the shell's own program.",
        ) from error


def _least_bent(
    plan: Reals, triangles: Indices, known: Reals, rim: Indices, slope: Reals, *, closed: bool
) -> tuple[Reals, Reals]:
    edges = np.column_stack([rim, np.roll(rim, -1)])
    if not closed:
        edges = edges[:-1]
    along = plan[edges[:, 1]] - plan[edges[:, 0]]
    normal = np.column_stack([along[:, 1], -along[:, 0]]) / np.linalg.norm(along, axis=1, keepdims=True)
    middle = 0.5 * (slope[edges[:, 0]] + slope[edges[:, 1]])
    return bent_heights(plan, triangles, known, edges, np.sum(middle * normal, axis=1))


def _evenly(line: Reals, step: float) -> Reals:
    """A polyline's ends and points between them about `step` apart."""
    at = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1)))
    to = np.linspace(0.0, at[-1], max(2, round(at[-1] / step)) + 1)
    return np.column_stack([np.interp(to, at, line[:, k]) for k in range(2)])


def _with_fill(draft: Draft, rim: Indices, new: Reals, normals: Reals, triangles: Indices) -> Draft:
    assert draft.normals is not None
    number = np.concatenate([rim, len(draft.points) + np.arange(len(new))])
    return replace(
        draft,
        points=np.vstack([draft.points, new]),
        triangles=np.vstack([draft.triangles, number[triangles]]),
        normals=np.vstack([draft.normals, normals]),
    )
