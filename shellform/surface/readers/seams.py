"""Seams between patches, and slivers.

Sewing: the edges of two patches that run along each other are joined where they are nearer than a tenth of
their mean edge length and a thousandth of the size. Vertices that face each other become one in the middle; a
vertex that faces the inside of an edge (a T-junction) is taken into it, by cutting the triangle there.

Slivers, triangles a hundred times as long as high, have no usable normal: one with a short side loses it, one
without gives its long side to its neighbour, or goes where that lies on the edge.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from shellform.arrays import Indices, Reals
from shellform.errors import how_many
from shellform.quantities import number
from shellform.surface.readers.draft import Draft, noted, without_unused
from shellform.surface.shape.triangles import (
    area_vectors,
    directed_edges,
    open_edges,
    triangle_areas,
)

_GAP = 0.1  # of the mean length of open edges
_MOST_GAP = 1e-3  # of the size
_INSIDE = 1e-3  # of an edge's length: nearer to its ends than that is no T-junction
_SLIVER = 0.01  # height over longest side
_SHORT = 0.05  # shortest over longest side, below which a sliver loses its short side
_ROUNDS = 8  # of joining vertices, of cutting edges and of removing slivers, each at the most


def sewn(draft: Draft, size: float) -> Draft:
    """The draft with open edges that run along each other joined; notes tell how many and how far they
    moved.
    """
    rim = open_edges(draft.triangles)
    if not len(rim):
        return draft
    length = np.linalg.norm(draft.points[rim[:, 1]] - draft.points[rim[:, 0]], axis=1)
    reach = min(_GAP * float(length.mean()), _MOST_GAP * size)
    # each vertex once a round: where several patches meet, then pairs of pairs
    draft, joined, gap = _in_rounds(_vertices_joined, draft, reach)
    draft, cut, off = _in_rounds(_edges_cut, draft, reach)
    notes = draft.notes
    if joined:
        notes = (
            *notes,
            how_many(
                joined,
                f"pair of vertices across a gap of {number(gap, 2)} m was joined",
                f"pairs of vertices across a gap of up to {number(gap, 2)} m were joined",
            ),
        )
    if cut:
        notes = (
            *notes,
            f"{cut} vertices on another face's edge (T-junctions, up to {number(off, 2)} m off) were taken into it",
        )
    return replace(draft, notes=notes)


def _in_rounds(
    close: Callable[[Draft, float], tuple[Draft, int, float]], draft: Draft, reach: float
) -> tuple[Draft, int, float]:
    """The draft after as many rounds as close something, how often in all, and the farthest, m."""
    count, far = 0, 0.0
    for _ in range(_ROUNDS):
        draft, more, away = close(draft, reach)
        count, far = count + more, max(far, away)
        if not more:
            break
    return draft, count, far


def _vertices_joined(draft: Draft, reach: float) -> tuple[Draft, int, float]:
    rim = open_edges(draft.triangles)
    border = np.unique(rim)
    pairs = border[cKDTree(draft.points[border]).query_pairs(reach, output_type="ndarray")].reshape(-1, 2)
    if not len(pairs):
        return draft, 0, 0.0
    count = len(draft.points)
    edges = np.sort(directed_edges(draft.triangles), axis=1)
    pairs = pairs[~np.isin(pairs.min(axis=1) * count + pairs.max(axis=1), edges[:, 0] * count + edges[:, 1])]
    gap = np.linalg.norm(draft.points[pairs[:, 0]] - draft.points[pairs[:, 1]], axis=1)
    taken = np.zeros(count, dtype=bool)
    same, points = np.arange(count), draft.points.copy()
    joined, moved = 0, 0.0
    for k in np.argsort(gap):
        a, b = pairs[k]
        if not (taken[a] or taken[b]):
            taken[[a, b]] = True
            same[b] = a
            points[a] = 0.5 * (points[a] + points[b])
            joined, moved = joined + 1, max(moved, float(gap[k]))
    faces = same[draft.triangles]
    whole = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    return without_unused(replace(draft, points=points, triangles=faces[whole])), joined, moved


def _edges_cut(draft: Draft, reach: float) -> tuple[Draft, int, float]:
    """Open edges cut at the open vertices that lie on them."""
    rim = open_edges(draft.triangles)
    border = np.unique(rim)
    begin, along = draft.points[rim[:, 0]], draft.points[rim[:, 1]] - draft.points[rim[:, 0]]
    length = np.linalg.norm(along, axis=1)
    near = cKDTree(draft.points[border]).query_ball_point(begin + 0.5 * along, 0.5 * length + reach)
    if not any(len(each) > 2 for each in near):
        return draft, 0, 0.0
    owner = {
        (a, b): t for t, (i, j, k) in enumerate(draft.triangles.tolist()) for a, b in ((i, j), (j, k), (k, i))
    }
    cuts: dict[int, tuple[int, int, list[tuple[float, int]]]] = {}
    moved, count = 0.0, 0
    for k, candidates in enumerate(near):
        a, b = int(rim[k, 0]), int(rim[k, 1])
        if len(candidates) < 3:
            continue
        found = []
        for vertex in border[candidates].tolist():
            triangle = owner[a, b]
            if vertex in draft.triangles[triangle]:
                continue
            share = float((draft.points[vertex] - begin[k]) @ along[k]) / length[k] ** 2
            away = float(np.linalg.norm(draft.points[vertex] - begin[k] - share * along[k]))
            if _INSIDE < share < 1.0 - _INSIDE and away < reach:
                found.append((share, vertex))
                moved = max(moved, away)
        if found and owner[a, b] not in cuts:
            cuts[owner[a, b]] = (a, b, sorted(found))
            count += len(found)
    if not cuts:
        return draft, 0, 0.0
    kept = np.ones(len(draft.triangles), dtype=bool)
    kept[list(cuts)] = False
    fans = []
    for triangle, (a, b, found) in cuts.items():
        tip = next(int(v) for v in draft.triangles[triangle] if v not in (a, b))
        stops = [a, *(vertex for _, vertex in found), b]
        fans += [[first, second, tip] for first, second in pairwise(stops)]
    return replace(draft, triangles=np.vstack([draft.triangles[kept], np.array(fans)])), count, moved


def without_slivers(draft: Draft) -> Draft:
    """The draft without triangles a hundred times as long as high, as far as they can be removed without
    folding the surface.
    """
    collapsed = flipped = dropped = 0
    for _ in range(_ROUNDS):
        draft, counts = _fewer_slivers(draft)
        collapsed, flipped, dropped = collapsed + counts[0], flipped + counts[1], dropped + counts[2]
        if not any(counts):
            break
    done = [(collapsed, "collapsed"), (flipped, "flipped"), (dropped, "dropped at the edge")]
    sentences = [f"{count} {what}" for count, what in done if count]
    return noted(draft, f"slivers: {', '.join(sentences)}") if sentences else draft


def _fewer_slivers(draft: Draft) -> tuple[Draft, tuple[int, int, int]]:
    """One round over slivers that don't touch each other."""
    points, faces = draft.points, draft.triangles.copy()
    corner = points[faces]
    sides = np.linalg.norm(corner - np.roll(corner, -1, axis=1), axis=2)  # side k from corner k to k + 1
    thin = np.flatnonzero(2.0 * triangle_areas(points, faces) < _SLIVER * sides.max(axis=1) ** 2)
    if not len(thin):
        return draft, (0, 0, 0)
    start, around = _incidence(faces, len(points))
    border = np.zeros(len(points), dtype=bool)
    border[open_edges(faces).ravel()] = True
    touched = np.zeros(len(points), dtype=bool)
    alive = np.ones(len(faces), dtype=bool)
    done = [0, 0, 0]
    for t in thin.tolist():
        ring = np.unique(np.concatenate([around[start[v] : start[v + 1]] for v in faces[t]]))
        if touched[faces[ring]].any():
            continue
        short, long = int(sides[t].argmin()), int(sides[t].argmax())
        change = (
            _collapse(points, faces, ring, t, short, border)
            if sides[t, short] < _SHORT * sides[t, long]
            else _flip(points, faces, ring, t, long)
        )
        if change is None:
            continue
        kind, rows, new = change
        alive[rows[len(new) :]] = False
        faces[rows[: len(new)]] = new
        done[kind] += 1
        touched[np.unique(draft.triangles[ring])] = True
    return without_unused(replace(draft, triangles=faces[alive])), (done[0], done[1], done[2])


def _incidence(faces: Indices, count: int) -> tuple[Indices, Indices]:
    """Triangles round each vertex v: `around[start[v]:start[v + 1]]`."""
    at = faces.ravel()
    order = np.argsort(at, kind="stable")
    return np.searchsorted(at[order], np.arange(count + 1)), order // 3


_Change = tuple[int, Indices, Indices] | None
"""0 collapsed, 1 flipped or 2 dropped; the triangles concerned; their new corners, the rest of them goes."""


def _collapse(points: Reals, faces: Indices, ring: Indices, t: int, side: int, border: Reals) -> _Change:
    """The short side drawn together in one of its ends."""
    a, b = int(faces[t, side]), int(faces[t, (side + 1) % 3])
    keep, go = (a, b) if border[a] or not border[b] else (b, a)
    near = {v: set(faces[ring][(faces[ring] == v).any(axis=1)].ravel().tolist()) for v in (a, b)}
    both = (faces[ring] == a).any(axis=1) & (faces[ring] == b).any(axis=1)
    # The link condition: more common neighbours than common triangles would fold the surface onto itself.
    if len((near[a] & near[b]) - {a, b}) != both.sum() or (border[a] and border[b] and both.sum() == 2):
        return None
    moved = ring[(faces[ring] == go).any(axis=1) & ~both]
    new = np.where(faces[moved] == go, keep, faces[moved])
    if _turned(points, faces[moved], new, allowed=_SLIVER):
        return None
    return 0, np.concatenate([moved, ring[both]]), new


def _flip(points: Reals, faces: Indices, ring: Indices, t: int, side: int) -> _Change:
    """The long side turned to join the two tips, or the triangle dropped where it has no neighbour there."""
    a, b, tip = (int(faces[t, (side + k) % 3]) for k in range(3))
    beside = [r for r in ring.tolist() if r != t and a in faces[r] and b in faces[r]]
    if not beside:
        return 2, np.array([t]), np.zeros((0, 3), dtype=np.int64)
    other = beside[0]
    far = next(int(v) for v in faces[other] if v not in (a, b))
    if any(tip in faces[r] and far in faces[r] for r in ring.tolist()):
        return None
    new = np.array([[tip, a, far], [far, b, tip]])
    if (faces[other] == a).argmax() == (
        (faces[other] == b).argmax() + 2
    ) % 3:  # the neighbour runs a to b too: turned over
        return None
    if _heights(points, new).min() <= _heights(points, faces[[t, other]]).min():
        return None
    return 1, np.array([t, other]), new


def _turned(points: Reals, old: Indices, new: Indices, allowed: float) -> bool:
    """Whether a triangle that had an area turns over."""
    before, after = area_vectors(points, old), area_vectors(points, new)
    solid = _heights(points, old) > allowed
    return bool((np.sum(before * after, axis=1)[solid] <= 0.0).any())


def _heights(points: Reals, faces: Indices) -> Reals:
    """Height over longest side (f,)."""
    corner = points[faces]
    longest = np.linalg.norm(corner - np.roll(corner, -1, axis=1), axis=2).max(axis=1)
    return np.asarray(2.0 * triangle_areas(points, faces) / np.maximum(longest, 1e-300) ** 2)
