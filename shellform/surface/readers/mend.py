"""Mending a draft into one clean skin, each thing that is done told in a sentence.

In this order: vertices at one place are merged, faces that shrink to nothing or are given twice and points of
no face dropped; edges of neighbouring patches that nearly touch are sewn (seams.py); a piece is chosen; faces
are turned alike; slivers are collapsed or flipped; of a closed skin the upper or lower face is taken
(sides.py); a vertex at which the edge meets itself is parted; and toothed edges are made smooth (teeth.py).
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from shellform import quantities
from shellform.arrays import Indices, Reals
from shellform.errors import InputError, how_many
from shellform.surface.readers.draft import Draft, choosable, noted, without_unused
from shellform.surface.readers.outliers import without_outliers
from shellform.surface.readers.seams import sewn, without_slivers
from shellform.surface.readers.sides import pieces_of, shared_edges, side_of
from shellform.surface.readers.teeth import without_teeth
from shellform.surface.shape.triangles import counted_edges, directed_edges, triangle_areas

_SAME = 1e-8  # of the size: vertices nearer than that are one
_FLAT = 5e-10  # of the squared size: a surface smaller than that has no area
_FURTHEST = 1e9  # m from the origin
_PIECES_TOLD = 5  # the largest ones, in one message
_LOOSE = 1e-3  # of the area: loose pieces that have less in all are crumbs of a scan
_PARTED = 1e-6  # of the size: how far the two sides of a parted vertex move into their faces


def mended(draft: Draft, where: str, *, face: str | None = None, piece: int | None = None) -> Draft:
    """The draft as one connected skin with an edge, faces turned alike. Raises InputError for what can't be
    mended and lacks a choice.
    """
    largest = float(np.abs(draft.points).max(initial=0.0))
    if largest > _FURTHEST:
        raise InputError(
            f"has coordinates of up to {largest:.3g} m",
            where=where,
            remedy="Check its unit, and move it to the origin.",
        )
    extent = np.ptp(draft.points, axis=0) if len(draft.points) else np.zeros(3)
    size = float(extent.max())
    if not size > 0.0:
        raise InputError("has no extent", where=where, remedy="Export the surface as a mesh.")
    draft = _merged(draft, size)
    if not triangle_areas(draft.points, draft.triangles).sum() > _FLAT * size * size:
        raise InputError(
            "the mesh has no triangle with an area", where=where, remedy="Export the surface as a mesh."
        )
    draft = sewn(draft, size)
    _refuse_branches(draft, where)
    draft = _one_piece(draft, piece, where)
    turned = turned_alike(draft.triangles, where)
    flipped = int((turned != draft.triangles).any(axis=1).sum())
    draft = replace(draft, triangles=turned)
    if flipped:
        draft = noted(
            draft,
            how_many(
                flipped,
                "face was turned the same way as the others",
                "faces were turned the same way as the others",
            ),
        )
    draft = without_slivers(without_outliers(draft))
    return without_teeth(_parted(_open(draft, face, where), size))


def turned_alike(triangles: Indices, where: str) -> Indices:
    """Triangles (t, 3) turned so that neighbours pass their common edge in opposite directions, in each piece
    as most were.

    Raises InputError for a skin with one side only.
    """
    first, second, clash = shared_edges(triangles)
    if not clash.any():
        return triangles
    # Each triangle twice, as it is (i) and turned over (i + count): what agrees hangs together.
    count = len(triangles)
    one = np.concatenate([first, first + count])
    other = np.concatenate([np.where(clash, second + count, second), np.where(clash, second, second + count)])
    graph = sp.csr_array((np.ones(len(one)), (one, other)), shape=(2 * count, 2 * count))
    label = connected_components(graph, directed=False)[1]
    if (label[:count] == label[count:]).any():
        raise InputError(
            "the surface has one side only, like a Möbius strip", where=where, remedy="Check the faces."
        )
    piece = pieces_of(triangles)
    pieces = int(piece.max()) + 1
    start = np.zeros(pieces, dtype=np.int64)
    start[piece[::-1]] = np.arange(count)[::-1]
    turned = label[:count] != label[start[piece]]
    most = np.bincount(piece, weights=turned, minlength=pieces) * 2 > np.bincount(piece, minlength=pieces)
    turned ^= most[piece]
    result = triangles.copy()
    result[turned] = result[turned][:, ::-1]
    return result


def _merged(draft: Draft, size: float) -> Draft:
    """Vertices at one place merged, whatever their last digits; no triangle without area or given twice; no
    vertex without triangle.
    """
    kept = without_unused(draft)
    unused = len(draft.points) - len(kept.points)
    if unused:
        draft = noted(
            kept, how_many(unused, "point of no face was dropped", "points of no face were dropped")
        )
    draft = _without_points(draft)
    same = _same_places(draft.points, _SAME * size)
    merged = int((same != np.arange(len(same))).sum())
    if merged:
        draft = noted(
            draft,
            how_many(
                merged, "vertex lay on another and was merged", "vertices lay on others and were merged"
            ),
        )
        draft = _without_points(replace(draft, triangles=same[draft.triangles]))
    _, once = np.unique(np.sort(draft.triangles, axis=1), axis=0, return_index=True)
    if len(once) < len(draft.triangles):
        note = how_many(
            len(draft.triangles) - len(once), "face given twice was dropped", "faces given twice were dropped"
        )
        draft = noted(replace(draft, triangles=draft.triangles[np.sort(once)]), note)
    return without_unused(draft)


def _same_places(points: Reals, reach: float) -> Indices:
    """For each point (v,) the first of those that lie within `reach` m of it, of each other, and so on."""
    count = len(points)
    # Equal ones first, in whatever numbers; then what few are nearly equal.
    order = np.lexsort(points.T)
    new = (
        np.append(True, (points[order][1:] != points[order][:-1]).any(axis=1))
        if count
        else np.zeros(0, dtype=bool)
    )
    place = np.empty(count, dtype=np.int64)
    place[order] = np.cumsum(new) - 1
    apart = points[order[new]]
    pairs = cKDTree(apart).query_pairs(reach, output_type="ndarray")
    links = sp.csr_array((np.ones(len(pairs)), pairs.T), shape=(len(apart), len(apart)))
    groups, label = connected_components(links, directed=False)
    first = np.full(groups, count)
    np.minimum.at(first, label[place], np.arange(count))
    return np.asarray(first[label[place]])


def _without_points(draft: Draft) -> Draft:
    """The draft without triangles that have a vertex twice, and without what is then unused."""
    a, b, c = draft.triangles.T
    whole = (a != b) & (b != c) & (c != a)
    if not whole.all():
        draft = noted(
            replace(draft, triangles=draft.triangles[whole]),
            how_many(int((~whole).sum()), "face without area was dropped", "faces without area were dropped"),
        )
    return without_unused(draft)


def _refuse_branches(draft: Draft, where: str) -> None:
    pairs, counts = counted_edges(draft.triangles)
    if (counts > 2).any():
        place = draft.points[pairs[np.argmax(counts > 2), 0]]
        others = choosable(draft)
        raise InputError(
            f"{how_many(int((counts > 2).sum()), 'edge belongs', 'edges belong')} to more than two faces, the first at "
            f"{quantities.rounded(place, 4)} m",
            where=where,
            remedy=f"Choose {others}; or remove the faces inside or behind the surface and export it again."
            if others
            else "Remove the faces inside or behind the surface and export it again.",
        )


def _one_piece(draft: Draft, piece: int | None, where: str) -> Draft:
    label = pieces_of(draft.triangles)
    count = int(label.max()) + 1
    if piece is not None and not 1 <= piece <= count:
        raise InputError(
            f"{where} has no such piece",
            where="surface.piece",
            value=piece,
            remedy=f"There are {count}, 1 the largest.",
        )
    if count == 1:
        return draft
    area = np.bincount(label, triangle_areas(draft.points, draft.triangles))
    order = np.argsort(-area, kind="stable")
    loose = float(area[order[1:]].sum())
    if piece is None and loose > _LOOSE * area.sum():
        others = choosable(draft)
        listed = ", ".join(quantities.number(area[k]) for k in order[:_PIECES_TOLD]) + (
            " …" if count > _PIECES_TOLD else ""
        )
        raise InputError(
            f"has {count} separate pieces, of {listed} m²",
            where=where,
            remedy=f"Choose one (surface.piece): {_choices(draft, label, order[:_PIECES_TOLD])}; "
            + (f"or {others}; " if others else "")
            + "or join their edges.",
        )
    taken = order[0 if piece is None else piece - 1]
    kept = without_unused(replace(draft, triangles=draft.triangles[label == taken]))
    if piece is not None:
        return noted(kept, f"piece {piece} of {count} was taken, {quantities.number(area[taken])} m²")
    told = how_many(count - 1, "loose piece was dropped", "loose pieces were dropped")
    return noted(kept, f"{told}, {quantities.number(loose, 2)} m² in all")


def _choices(draft: Draft, label: Indices, pieces: Indices) -> str:
    """The option that takes each of the `pieces` (p,), and how large that is, so that it is known again."""
    told = []
    for number, piece in enumerate(pieces.tolist(), 1):
        points = draft.points[np.unique(draft.triangles[label == piece])]
        extent = np.ptp(points, axis=0)
        size = " × ".join(f"{each:.3g}" for each in quantities.extents(extent))
        # to a hundredth of its size, however far from the origin
        places = 2 - math.floor(math.log10(extent.max()))
        centre = quantities.rounded(0.5 * (points.min(axis=0) + points.max(axis=0)), places)
        middle = ", ".join(f"{x:.12g}" for x in centre)
        told.append(f"--piece {number} is {size} m about ({middle})")
    return ", ".join(told)


def _open(draft: Draft, face: str | None, where: str) -> Draft:
    """The draft, or of a closed skin its upper or lower face. Raises InputError for a face of what isn't
    closed, or which face isn't said of what is."""
    if 2 * len(shared_edges(draft.triangles)[0]) < 3 * len(draft.triangles):
        if face is None or draft.of_solid:
            return draft
        raise InputError(
            f"{where} holds a surface that isn't closed, as a solid's skin is: it has no {face} face to choose",
            where="surface.face",
            value=face,
            remedy="Leave surface.face (--face) out.",
        )
    if face is None:
        raise InputError(
            "is closed, like a solid's skin: it has no edge at which rods could end",
            where=where,
            remedy="Choose its upper or lower face (surface.face, --face), or export that face alone.",
        )
    kept = replace(draft, triangles=draft.triangles[side_of(draft.points, draft.triangles, face, where)])
    return _one_piece(noted(without_unused(kept), f"the {face} face of a closed skin was taken"), None, where)


def _parted(draft: Draft, size: float) -> Draft:
    """Vertices at which several fans of triangles meet only in a point, one for each fan, a little inside
    it.
    """
    faces, count = draft.triangles, len(draft.triangles)
    at = faces.T.ravel()  # corner k of triangle t is row k * count + t
    row = np.arange(3 * count).reshape(3, count)
    edges = directed_edges(faces)
    ends = np.column_stack(
        [np.concatenate([row[0], row[1], row[2]]), np.concatenate([row[1], row[2], row[0]])]
    )
    order = np.lexsort((edges.max(axis=1), edges.min(axis=1)))
    both = (np.sort(edges[order][1:], axis=1) == np.sort(edges[order][:-1], axis=1)).all(axis=1)
    one, other = order[:-1][both], order[1:][both]
    straight = edges[one, 0] == edges[other, 0]
    links = np.vstack(
        [
            np.column_stack([ends[one, k], np.where(straight, ends[other, k], ends[other, 1 - k])])
            for k in range(2)
        ]
    )
    graph = sp.csr_array((np.ones(len(links)), links.T), shape=(3 * count, 3 * count))
    fans, fan = connected_components(graph, directed=False)
    if fans == len(draft.points):
        return draft
    of_fan = np.zeros(fans, dtype=np.int64)
    of_fan[fan] = at
    corners = np.bincount(fan, minlength=fans)
    by_vertex = np.lexsort((-corners, of_fan))
    # All but the largest fan of a vertex.
    extra = by_vertex[1:][of_fan[by_vertex][1:] == of_fan[by_vertex][:-1]]
    number = of_fan.copy()
    number[extra] = len(draft.points) + np.arange(len(extra))
    centre = draft.points[faces].mean(axis=1)
    inside = (
        np.column_stack([np.bincount(fan, np.tile(centre[:, k], 3), fans) for k in range(3)])
        / corners[:, None]
    )
    step = inside[extra] - draft.points[of_fan[extra]]
    step *= _PARTED * size / np.maximum(np.linalg.norm(step, axis=1, keepdims=True), 1e-300)
    points = np.vstack([draft.points, draft.points[of_fan[extra]] + step])
    normals = None if draft.normals is None else np.vstack([draft.normals, draft.normals[of_fan[extra]]])
    parted = replace(draft, points=points, triangles=number[fan].reshape(3, count).T.copy(), normals=normals)
    met = how_many(
        len(extra),
        "vertex at which the edge met itself was parted",
        "vertices at which the edge met itself were parted",
    )
    return noted(parted, f"{met}, by {quantities.number(_PARTED * size, 1)} m")
