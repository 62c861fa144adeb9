"""A surface that goes on past its edge, for grids larger than it.

From every vertex of the edge a straight line leaves the surface along its tangent plane, square to the edge; rings of vertices
along these lines make a strip of ruled surface that continues the surface with its slope. Where the edge turns inwards the
lines would cross: their directions are then evened out along the edge until no cell of the strip turns over.
"""

from __future__ import annotations

import numpy as np

from shellform.arrays import Indices, Reals
from shellform.surface.target import Surface

_SMOOTHINGS = 400


def extended(surface: Surface, reach: float) -> Surface:
    """The surface and a strip `reach` m wide all round; its own vertices and triangles come first and are unchanged."""
    vertices, normals = [surface.vertices], [surface.normals]
    triangles = [surface.triangles]
    count = len(surface.vertices)
    for loop in surface.boundary:
        edge = surface.vertices[loop]
        step = float(np.linalg.norm(np.roll(edge, -1, axis=0) - edge, axis=1).mean())
        rings = max(2, int(np.ceil(reach / (1.5 * step))))
        directions = _outwards(edge, surface.normals[loop], reach)
        inner = loop
        for ring in range(1, rings + 1):
            place = edge + reach * ring / rings * directions
            along = np.roll(place, -1, axis=0) - np.roll(place, 1, axis=0)
            normal = np.cross(directions, along)
            normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
            outer = count + np.arange(len(loop))
            triangles.append(_strip(inner, outer))
            vertices.append(place)
            normals.append(normal)
            count += len(loop)
            inner = outer
    return Surface(np.vstack(vertices), np.vstack(triangles), np.vstack(normals), surface.source)


def _outwards(edge: Reals, normals: Reals, reach: float) -> Reals:
    """Unit directions (k, 3) away from the surface at the vertices of an edge loop, which runs with the surface on its left."""
    directions = _square(edge, normals)
    for _ in range(_SMOOTHINGS):
        far = edge + reach * directions
        along, then = np.roll(edge, -1, axis=0) - edge, np.roll(far, -1, axis=0) - far
        if (np.sum(along * then, axis=1) > 0.05 * np.sum(along * along, axis=1)).all():
            break
        directions = 0.5 * directions + 0.25 * (np.roll(directions, 1, axis=0) + np.roll(directions, -1, axis=0))
        directions -= np.sum(directions * normals, axis=1, keepdims=True) * normals
        directions /= np.maximum(np.linalg.norm(directions, axis=1, keepdims=True), 1e-300)
    return directions


def _square(edge: Reals, normals: Reals) -> Reals:
    """Directions in the tangent plane square to the edge, averaged over neighbours to calm the mesh's jitter."""
    along = np.roll(edge, -1, axis=0) - np.roll(edge, 1, axis=0)
    out = np.cross(along, normals)
    out /= np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-300)
    for _ in range(3):
        out = 0.5 * out + 0.25 * (np.roll(out, 1, axis=0) + np.roll(out, -1, axis=0))
    return np.asarray(out / np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-300))


def _strip(inner: Indices, outer: Indices) -> Indices:
    """Triangles between two loops of the same length, turned like the surface whose edge `inner` is."""
    a, b, c, d = inner, np.roll(inner, -1), np.roll(outer, -1), outer
    return np.vstack([np.column_stack([b, a, d]), np.column_stack([b, d, c])])
