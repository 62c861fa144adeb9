"""A surface that goes on past its edge and over its openings, for grids larger than it.

From every vertex of the outer edge a straight line leaves the surface along its tangent plane, square to the
edge; rings of vertices along these lines make a strip of ruled surface that continues the surface with its
slope. Where the edge turns inwards the lines would cross: their directions are then evened out along the
edge, over a longer and longer stretch, until no cell of the strip turns over; where even that isn't enough,
the lines end before they cross.

An opening is closed by rings of vertices that thin out towards its middle. They lie where the sum of the
squares of the Laplacian is smallest, with the slope of the surface along the opening's edge: like a thin
plate clamped there.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import spsolve

from shellform.arrays import Indices, Reals
from shellform.surface.shape.jets import jets
from shellform.surface.shape.target import Surface, rough_normals
from shellform.surface.shape.triangles import adjacency

_OPEN = 0.05  # of a cell's width at the edge: the least that it may narrow to
# squares of the numbers of vertices to even out over
_STRETCHES = (0.0, 1.0, 4.0, 16.0, 64.0, 256.0, 1024.0, 4096.0)
_SHORTENED = 0.8  # of the length at which a line would cross its neighbour


def extended(surface: Surface, reach: float) -> tuple[Surface, int]:
    """The surface with its openings closed and a strip `reach` m wide round it: its own vertices and
    triangles come first, unchanged, then those over the openings, up to the number of triangles returned,
    then those of the strip."""
    outer, *openings = surface.boundary
    vertices, normals, triangles = [surface.vertices], [surface.normals], [surface.triangles]
    count = len(surface.vertices)
    for loop in openings:
        points, faces = _lid(surface, loop, count)
        everything = np.vstack([surface.vertices, *vertices[1:], points])
        whole = np.vstack([surface.triangles, *triangles[1:], faces])
        unit = jets(everything, whole, rough_normals(everything, whole))[0]
        vertices.append(points)
        normals.append(unit[count:])
        triangles.append(faces)
        count += len(points)
    closed = sum(len(each) for each in triangles)
    edge = surface.vertices[outer]
    step = float(np.linalg.norm(np.roll(edge, -1, axis=0) - edge, axis=1).mean())
    rings = max(2, int(np.ceil(reach / (1.5 * step))))
    directions, lengths = _outwards(edge, surface.normals[outer], reach)
    inner = outer
    for ring in range(1, rings + 1):
        place = edge + (ring / rings * lengths)[:, None] * directions
        along = np.roll(place, -1, axis=0) - np.roll(place, 1, axis=0)
        normal = np.cross(directions, along)
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
        rim = count + np.arange(len(outer))
        triangles.append(_strip(inner, rim))
        vertices.append(place)
        normals.append(normal)
        count += len(outer)
        inner = rim
    return Surface(np.vstack(vertices), np.vstack(triangles), np.vstack(normals), surface.source), closed


def _outwards(edge: Reals, normals: Reals, reach: float) -> tuple[Reals, Reals]:
    """Unit directions (k, 3) away from the surface at the vertices of an edge loop, which runs with the
    surface on its left, and how far (k,), m, lines may run along them."""
    square = _square(edge, normals)
    count = len(edge)
    ring = sp.eye_array(count, k=1) + sp.eye_array(count, k=1 - count)
    laplacian = 2.0 * sp.eye_array(count) - ring - ring.T
    best, furthest = square, np.zeros(count)
    for stretch in _STRETCHES:
        directions = square
        if stretch > 0.0:
            directions = spsolve(sp.csc_array(sp.eye_array(count) + stretch * laplacian), square)
            directions = directions - np.sum(directions * normals, axis=1, keepdims=True) * normals
            directions /= np.maximum(np.linalg.norm(directions, axis=1, keepdims=True), 1e-300)
        free = _free_length(edge, normals, directions)
        if free.min() >= reach:
            return directions, np.full(count, reach)
        free = np.minimum(_SHORTENED * free, reach)
        if free.min() > furthest.min() or stretch == 0.0:
            best, furthest = directions, free
    side = np.linalg.norm(np.roll(edge, -1, axis=0) - edge, axis=1)
    for _ in range(count):  # lengths change along the edge no faster than half as much as the edge runs
        before = furthest
        nearby = np.minimum(np.roll(furthest + 0.5 * side, 1), np.roll(furthest, -1) + 0.5 * side)
        furthest = np.minimum(furthest, nearby)
        if np.array_equal(before, furthest):
            break
    return best, np.maximum(furthest, 1e-3 * side)


def _free_length(edge: Reals, normals: Reals, directions: Reals) -> Reals:
    """How far (k,), m, the line from each vertex runs before a cell beside it narrows to almost nothing (inf:
    never).
    """
    along = np.roll(edge, -1, axis=0) - edge
    spread = np.roll(directions, -1, axis=0) - directions
    least = np.full(len(edge), np.inf)
    for shift in (0, -1):  # the cell's side on its first and on its second vertex
        direction, normal = np.roll(directions, shift, axis=0), np.roll(normals, shift, axis=0)
        wide = np.sum(direction * np.cross(along, normal), axis=1)
        narrowing = np.sum(direction * np.cross(spread, normal), axis=1)
        room = wide - _OPEN * np.linalg.norm(along, axis=1)
        length = np.where(narrowing < 0.0, room / np.maximum(-narrowing, 1e-300), np.inf)
        least = np.minimum(least, np.where(room > 0.0, length, 0.0))
    return np.asarray(np.minimum(least, np.roll(least, 1)))


def _square(edge: Reals, normals: Reals) -> Reals:
    """Directions in the tangent plane square to the edge, averaged over neighbours to calm the mesh's
    jitter.
    """
    along = np.roll(edge, -1, axis=0) - np.roll(edge, 1, axis=0)
    out = np.cross(along, normals)
    out /= np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-300)
    for _ in range(3):
        out = 0.5 * out + 0.25 * (np.roll(out, 1, axis=0) + np.roll(out, -1, axis=0))
        out -= np.sum(out * normals, axis=1, keepdims=True) * normals
    return np.asarray(out / np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-300))


def _strip(inner: Indices, outer: Indices) -> Indices:
    """Triangles between two loops, the second with at most as many vertices, turned like the surface whose
    edge `inner` is.
    """
    m, n = len(inner), len(outer)
    faces = []
    i = j = 0
    while i < m or j < n:
        if j >= n or (i < m and (i + 0.5) * n <= (j + 0.5) * m):
            faces.append((inner[(i + 1) % m], inner[i % m], outer[j % n]))
            i += 1
        else:
            faces.append((inner[i % m], outer[j % n], outer[(j + 1) % n]))
            j += 1
    return np.array(faces)


def _lid(surface: Surface, loop: Indices, count: int) -> tuple[Reals, Indices]:
    """Vertices (k, 3), numbered from `count`, and triangles that close an opening."""
    edge, size = surface.vertices[loop], len(loop)
    rings = max(1, round(size / (2.0 * np.pi)))
    faces, inner, made = [], loop, count
    for ring in range(1, rings):
        rim = made + np.arange(max(3, round(size * (1.0 - ring / rings))))
        faces.append(_strip(inner, rim))
        inner, made = rim, made + len(rim)
    faces.append(np.column_stack([np.roll(inner, -1), inner, np.full(len(inner), made)]))
    made += 1
    triangles = np.vstack(faces)
    # Numbered anew: the lid's own vertices, then its edge, then a ring of ghosts one step back on the surface
    step = float(np.linalg.norm(np.roll(edge, -1, axis=0) - edge, axis=1).mean())
    ghosts = edge - step * _square(edge, surface.normals[loop])
    own = made - count
    number = np.full(made, -1)
    number[count:made] = np.arange(own)
    number[loop] = own + np.arange(size)
    behind = _strip(own + size + np.arange(size), own + np.arange(size))
    local = np.vstack([number[triangles], behind])
    total = own + 2 * size
    graph = adjacency(local, total)
    laplacian = sp.csr_array(sp.eye_array(total) - sp.diags_array(1.0 / graph.sum(axis=1)) @ graph)[
        : own + size
    ]
    free, known = laplacian[:, :own], laplacian[:, own:] @ np.vstack([edge, ghosts])
    points = spsolve(sp.csc_array(free.T @ free), -free.T @ known)
    return np.asarray(points).reshape(own, 3), triangles
