"""A toothed edge made smooth: that of a mesh cut out of a grid or a scan by whole faces, which turns to and
fro by an element.

No strip goes on past such an edge (shape/extension.py), and rods' ends and edge beams would follow its teeth.
A tooth is two sharp corners in a row that turn the edge opposite ways, an element apart. Along teeth the
edge's vertices move to the curve that weighs how far it lies from them against how it bends: x with
(W + k B'B) x = W p, B the second differences along the edge and k such that waves of less than two square
roots of the number of vertices go. The weights W grow where x would lie farther from p than a tooth, and are
large where there are no teeth, so that corners that are meant stay. Moved vertices are put onto the surface,
or where it goes on past its edge, by a quadratic fitted to those around. Triangles that become slivers or
turn over are dropped, and the vertices that then lie on the edge are moved to the curve too.

An edge whose teeth lie in one plane, as that of a form found over a plan of whole cells, held on the ground
all along it, stays in that plane: its vertices slide along the surface to where it meets the plane, n the
surface's normal, m the plane's and h the height above it, by

    h (n m) t / t²,   t = n - (n m) m,

and the curve through where they came to, smoothed as before, is the edge.

An edge whose sides are longer than an eighth of the surface's extent, or that has few teeth, is meant so.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu, spsolve
from scipy.spatial import cKDTree

from shellform.arrays import Flags, Indices, Reals, Record
from shellform.errors import how_many
from shellform.quantities import number
from shellform.surface.readers.draft import Draft, noted
from shellform.surface.readers.sides import pieces_of
from shellform.surface.shape.target import across_edges, closed_loops, rough_normals
from shellform.surface.shape.tree import Tree
from shellform.surface.shape.triangles import area_vectors, used_points

_FEWEST = 24  # vertices of an edge with teeth
_TEETH = 8  # of an edge, at the least
_SHARP_TURN = np.deg2rad(35.0)  # at a corner of a tooth
_CORNER = np.deg2rad(77.0)  # of the smooth curve's turn at a corner that is meant: right angles come to 80
_LONG = 1.6  # median sides of the edge: the longest side of a tooth
_MEANT = 0.125  # of the narrower extent: longer sides aren't a tooth's
_WAVES = 2.0  # square roots of the number of vertices: the length of waves that are halved
_FIXED = 1e8  # the weight of vertices that stay
_TIGHTENINGS = 40  # of the weights, at the most
_LEVEL = 0.02  # of its median side: an edge that keeps to a plane so closely lies in it
_SLIDES = 4  # along the surface, to its plane
_STEEP = 0.05  # t², at the least: a surface that lies nearly in the plane meets it anywhere
_AROUND = 24  # vertices to which the surface is fitted
_NEAR = 8  # vertices whose normals tell how a place slides
_THIN = 0.1  # of the edge's median side: the least height of a triangle
_ROUNDS = 12  # of dropping triangles
# Of the triangles: a larger piece that would hang together with the others no more is meant.
_BROKEN_OFF = 0.02
_PEELED = 3  # times that spikes are taken off an edge too ragged to be smoothed


def without_teeth(draft: Draft) -> Draft:
    """The draft, in one piece and turned alike, with its toothed edges smooth, and a note of how far they
    moved at most; as it is where no edge is toothed, or where what would be left hangs together no more."""
    points, faces = draft.points, draft.triangles
    for _ in range(1 + _PEELED):
        curves = [
            (loop, side)
            for loop in closed_loops(_rim(faces, len(points)))
            if (side := toothed(points, loop)) is not None
        ]
        if not curves:
            return draft
        found = _smoothed(points, faces, curves)
        if found is not None:
            return _told(draft, *found, len(curves))
        peeled = _without_spikes(faces, len(points))
        if peeled is None:
            return draft
        faces = peeled
    return draft


def _smoothed(
    points: Reals, faces: Indices, curves: Sequence[tuple[Indices, float]]
) -> tuple[Reals, Indices, Tree] | None:
    """The points (v, 3) and the triangles that are left with smooth edges where these loops of vertices with
    their median sides, m, are; and the curves' straight pieces. None where triangles that turn over can't be
    dropped, or a piece would break off."""
    placed, on_edge = points.copy(), np.zeros(len(points), dtype=bool)
    on_edge[_rim(faces, len(points))] = True
    tree, normals = cKDTree(points), rough_normals(points, faces)
    for loop, side in curves:
        placed[loop] = _edge(tree, normals, points[loop], side)
    moved = (placed != points).any(axis=1)
    after = [np.roll(loop, -1) for loop, _ in curves]
    pieces = [placed[np.stack([loop, to, to], axis=1)] for (loop, _), to in zip(curves, after, strict=True)]
    track = Tree(np.vstack(pieces))
    thin = _THIN * min(side for _, side in curves)
    for _ in range(_ROUNDS):
        rim = _rim(faces, len(points))
        bared = np.setdiff1d(rim, np.flatnonzero(on_edge))
        placed[bared] = track.nearest(placed[bared])[1]
        on_edge[bared] = moved[bared] = True
        turned, low = _poor(points, placed, faces, thin)
        dropped = (turned | low) & moved[faces].any(axis=1) & (_on_rim(faces, len(points)) > 0)
        if not dropped.any():  # what turns over behind the edge: the vertices of the edge that came too far
            dropped = np.isin(faces, np.intersect1d(faces[turned], rim)).any(axis=1)
        if not dropped.any():
            break
        left = _whole(faces[~dropped])
        if left is None:
            return None
        faces = left
    starts = _rim(faces, len(points))[:, 0]
    if turned.any() or len(np.unique(starts)) < len(starts):
        return None
    return placed, faces, track


def _edge(tree: cKDTree, normals: Reals, corners: Reals, side: float) -> Reals:
    """The places (n, 3) of the `corners` (n, 3) of a toothed edge once it is smooth, on the surface of the
    points in the `tree` with their normals (v, 3)."""
    bending = _bending(corners)
    placed = _curve(corners, side, bending)
    moved = (placed != corners).any(axis=1)
    placed[moved] = _onto(tree, normals, placed[moved])
    plane = _plane(corners, _LEVEL * side)
    if plane is None:
        return placed
    placed[moved] = _slid(tree, normals, placed[moved], plane, side)
    return np.where(moved[:, None], _projected(bending.through(placed, bending.weight), plane), corners)


def _told(draft: Draft, placed: Reals, faces: Indices, track: Tree, edges: int) -> Draft:
    """The draft of these points (v, 3) and triangles, with a note of how far from the curves the edge was at
    most where it is smooth now."""
    moved = (placed != draft.points).any(axis=1)
    used, among_used = used_points(faces, len(moved))
    most = float(track.nearest(draft.points[moved | ~used])[2].max())
    told = how_many(edges, "edge was toothed and was smoothed", "edges were toothed and were smoothed")
    given = None if draft.normals is None else np.where(moved[:, None], 0.0, draft.normals)[used]
    smooth = replace(draft, points=placed[used], triangles=among_used, normals=given)
    return noted(smooth, f"{told}, by {number(most, 2)} m at most")


def _without_spikes(faces: Indices, count: int) -> Indices | None:
    """The triangles without those of which two sides or more lie on the edge, and without what then hangs on
    by a vertex alone; of `count` vertices. None where a piece would break off."""
    left = _whole(faces[_on_rim(faces, count) < 2])
    while left is not None:
        starts = _rim(left, count)[:, 0]
        met = np.flatnonzero(np.bincount(starts, minlength=count) > 1)
        if not len(met):
            break
        left = _whole(left[~np.isin(left, met).any(axis=1)])
    return left


def toothed(points: Reals, loop: Indices) -> float | None:
    """The median side, m, of an edge, a closed `loop` of vertices (n,), that is toothed by an element; None
    where it isn't."""
    at = _teeth(points[loop])
    side = float(np.median(_sides(points[loop])))
    narrow = float(np.sort(np.ptp(points, axis=0))[1])
    if len(loop) < _FEWEST or len(at) < _TEETH or side > _MEANT * narrow:
        return None
    return side


def is_ragged(points: Reals, loop: Indices) -> bool:
    """Whether an edge, a closed `loop` of vertices (n,), is toothed by an element, or turns sharply at half
    of its vertices or more, whatever its sides."""
    sharp = len(loop) >= _FEWEST and np.median(_turn(points[loop], 1)) > _SHARP_TURN
    return bool(sharp) or toothed(points, loop) is not None


def _sides(corners: Reals) -> Reals:
    """Lengths (n,), m, from each corner of a closed curve (n, 3) to the next."""
    return np.asarray(np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1))


def _teeth(corners: Reals) -> Indices:
    """The places (t, 2), first and last corner, of the teeth of a closed curve (n, 3)."""
    side = _sides(corners)
    along = (np.roll(corners, -1, axis=0) - corners) / np.maximum(side, 1e-300)[:, None]
    before = np.roll(along, 1, axis=0)
    sharp = np.flatnonzero(_turn(corners, 1) > _SHARP_TURN)
    axis = np.cross(before, along)[sharp]
    arc = np.concatenate([[0.0], np.cumsum(side)])
    apart = (np.roll(arc[sharp], -1) - arc[sharp]) % arc[-1]
    back = np.sum(axis * np.roll(axis, -1, axis=0), axis=1) < 0.0
    is_tooth = back & (apart <= _LONG * np.median(side))
    return np.column_stack([sharp, np.roll(sharp, -1)])[is_tooth]


@dataclass(frozen=True, eq=False)
class _Bending(Record):
    """How the smooth curve of an edge bends: by its `stiffness`, but at the corners that are `kept` (c,),
    with the corners between which it is `free` (n,)."""

    stiffness: float
    kept: Indices
    free: Flags

    @property
    def weight(self) -> Reals:
        """That of the corners (n,) to begin with: those that are free weigh alike, the others stay."""
        return np.where(self.free, 1.0, _FIXED)

    def through(self, corners: Reals, weight: Reals) -> Reals:
        """The places (n, 3) on the curve that lies near the `corners` (n, 3), by their `weight` (n,)."""
        middle = corners.mean(axis=0)  # far from the origin rounding would bend it
        return np.asarray(middle + _bent(corners - middle, weight, self.stiffness, self.kept))


def _bending(corners: Reals) -> _Bending:
    """How the curve of a toothed edge with these corners (n, 3) bends."""
    count, corners = len(corners), corners - corners.mean(axis=0)
    reach = _WAVES * np.sqrt(count)  # the curve's waves, in corners
    at = np.zeros(count, dtype=bool)
    at[_teeth(corners)] = True
    away = cKDTree(np.flatnonzero(at)[:, None], boxsize=[count]).query(np.arange(count)[:, None])[0]
    free = away <= 0.5 * reach
    stiffness = (reach / (2.0 * np.pi)) ** 4
    kept = _meant(corners, np.where(free, 1.0, _FIXED), stiffness, round(0.25 * reach))
    return _Bending(stiffness, kept, free)


def _curve(corners: Reals, side: float, bending: _Bending) -> Reals:
    """The places (n, 3) on the smooth curve for the corners of a toothed edge with this median `side`, m."""
    weight = bending.weight
    for _ in range(_TIGHTENINGS):
        placed = bending.through(corners, weight)
        off = np.linalg.norm(placed - corners, axis=1) / side
        if off.max() <= 1.0:
            break
        weight *= np.maximum(off, 1.0)
    return np.where(bending.free[:, None], placed, corners)


def _plane(corners: Reals, most: float) -> tuple[Reals, Reals] | None:
    """A point (3,) of the plane in which a curve with these corners (n, 3) lies to within `most`, m, and the
    plane's normal (3,); None where it lies in none."""
    middle = corners.mean(axis=0)
    normal = np.linalg.svd(corners - middle, full_matrices=False)[2][2]
    return (middle, normal) if np.ptp(corners @ normal) <= most else None


def _slid(tree: cKDTree, normals: Reals, places: Reals, plane: tuple[Reals, Reals], most: float) -> Reals:
    """The `places` (k, 3) on or beside a surface, slid along it by `most`, m, at the most, to where it meets
    the plane."""
    (middle, upright), start = plane, places
    for _ in range(_SLIDES):
        normal = normals[tree.query(places, k=_NEAR)[1]].sum(axis=1)
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        steep = normal @ upright
        level = normal - steep[:, None] * upright
        by = (places - middle) @ upright * steep / np.maximum(np.sum(level * level, axis=1), _STEEP)
        off = places + by[:, None] * level - start
        far = np.linalg.norm(off, axis=1)[:, None]
        places = _onto(tree, normals, start + off * np.minimum(1.0, most / np.maximum(far, 1e-300)))
    return places


def _projected(places: Reals, plane: tuple[Reals, Reals]) -> Reals:
    """The `places` (n, 3) upright above or below them in the plane."""
    middle, upright = plane
    return np.asarray(places - ((places - middle) @ upright)[:, None] * upright)


def _bent(corners: Reals, weight: Reals, stiffness: float, kept: Indices) -> Reals:
    """The curve (n, 3) that lies near the `corners` (n, 3) by their `weight` (n,) and bends little by its
    `stiffness`, but at the corners that are `kept` (c,) as freely as it likes."""
    return np.asarray(spsolve(_matrix(weight, stiffness, kept), weight[:, None] * corners))


def _matrix(weight: Reals, stiffness: float, kept: Indices) -> sp.csc_array:
    """W + k B'B (n, n), without the rows of B at the corners that are `kept` (c,)."""
    bend = _bends(len(weight))[np.delete(np.arange(len(weight)), kept)]
    return sp.csc_array(sp.diags_array(weight) + stiffness * (bend.T @ bend))


def _bends(count: int) -> sp.csr_array:
    """B (n, n), the second differences along a closed curve of so many corners."""
    ring = sp.eye_array(count, k=1) + sp.eye_array(count, k=1 - count)
    return sp.csr_array(2.0 * sp.eye_array(count) - ring - ring.T)


def _meant(corners: Reals, weight: Reals, stiffness: float, half: int) -> Indices:
    """The corners (c,) of a toothed edge that are no teeth: where the curve turns sharply within `half` of
    its corners on either side, and has a sharp corner once it may."""
    count = len(corners)
    turn = _turn(_bent(corners, weight, stiffness, np.zeros(0, dtype=np.int64)), half)
    kept, seen = list[int](), list[int]()
    for place in np.argsort(-turn, kind="stable"):
        apart = [min((place - other) % count, (other - place) % count) for other in seen]
        if turn[place] <= _SHARP_TURN or min(apart, default=count) <= 2 * half:
            continue
        seen.append(int(place))
        around = np.arange(place - half, place + half + 1) % count
        best = _loosest(corners, weight, stiffness, np.array(kept, dtype=np.int64), around)
        if _turn(_bent(corners, weight, stiffness, np.array([*kept, best])), 1)[best] > _CORNER:
            kept.append(best)
    return np.array(kept, dtype=np.int64)


def _loosest(corners: Reals, weight: Reals, stiffness: float, kept: Indices, tried: Indices) -> int:
    """That one of the corners `tried` (t,), none of them `kept`, at which the curve comes to least once it
    may bend there: with x the curve, A its matrix and b the corner's row of B, to k (b'x)² / (1 - k b'A⁻¹b)
    less."""
    solve = splu(_matrix(weight, stiffness, kept)).solve
    rows = _bends(len(corners))[tried].toarray()
    bent = ((rows @ solve(weight[:, None] * corners)) ** 2).sum(axis=1)
    held = stiffness * np.sum(rows * solve(rows.T).T, axis=1)
    return int(tried[np.argmax(bent / (1.0 - held))])


def _turn(corners: Reals, half: int) -> Reals:
    """By how much (n,), rad, a closed curve turns between the chords over `half` of its corners (n, 3) before
    and after each."""
    before = corners - np.roll(corners, half, axis=0)
    after = np.roll(corners, -half, axis=0) - corners
    lengths = np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1)
    return np.asarray(
        np.arccos(np.clip(np.sum(before * after, axis=1) / np.maximum(lengths, 1e-300), -1.0, 1.0))
    )


def _onto(tree: cKDTree, normals: Reals, places: Reals) -> Reals:
    """The `places` (k, 3) near a surface's edge, put onto it, or onto what continues it, along its normal: by
    the quadratic height function over the tangent plane that fits the vertices around best."""
    points = np.asarray(tree.data)
    near = tree.query(places, k=min(_AROUND, len(points)))[1]
    result = np.empty_like(places)
    for k, (place, around) in enumerate(zip(places, near, strict=True)):
        normal = normals[around].sum(axis=0)
        normal /= np.linalg.norm(normal)
        across = np.linalg.svd(normal[None])[2][1:]
        offset = points[around] - place
        u, v = (offset @ across.T).T
        columns = np.column_stack([np.ones(len(u)), u, v, u * u, u * v, v * v])
        height = np.linalg.lstsq(columns, offset @ normal, rcond=None)[0][0]
        result[k] = place + height * normal
    return result


def _rim(faces: Indices, count: int) -> Indices:
    """The directed sides (e, 2) that one triangle alone has; of `count` vertices."""
    at = np.argwhere(across_edges(faces, count) < 0)
    return np.column_stack([faces[at[:, 0], (at[:, 1] + k) % 3] for k in (0, 1)])


def _on_rim(faces: Indices, count: int) -> Indices:
    """How many sides (t,) of each triangle no other has; of `count` vertices."""
    return np.asarray((across_edges(faces, count) < 0).sum(axis=1))


def _poor(before: Reals, after: Reals, faces: Indices, thin: float) -> tuple[Flags, Flags]:
    """Which triangles (t,) turn over, and which become lower than `thin`, m."""
    old, new = area_vectors(before, faces), area_vectors(after, faces)
    corner = after[faces]
    longest = np.linalg.norm(np.roll(corner, -1, axis=1) - corner, axis=2).max(axis=1)
    return np.sum(old * new, axis=1) <= 0.0, 2.0 * np.linalg.norm(new, axis=1) < thin * longest


def _whole(faces: Indices) -> Indices | None:
    """The triangles of the largest piece that hangs together by sides; None where another is no crumb."""
    label = pieces_of(faces)
    sizes = np.bincount(label, minlength=1)
    others = np.delete(sizes, np.argmax(sizes))
    return None if others.max(initial=0) > _BROKEN_OFF * len(faces) else faces[label == np.argmax(sizes)]
