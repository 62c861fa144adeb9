"""Normals and curvature at the vertices of a triangle mesh, by local jets.

Each vertex's neighbourhood of two rings, three at the mesh's edge where only one side is known, is fitted by
a cubic height function over the plane of a first normal, in the sense of least squares (Cazals and Pouget
2005); its slope corrects the normal to third order in the mesh size, its second derivatives give the
curvature. Where the neighbours don't determine a cubic (too few, or too few rows of them) a quadratic is
fitted, else a plane.
"""

from __future__ import annotations

import numpy as np

from shellform.arrays import Indices, Reals, read_only
from shellform.compiled import njit, prange

_MOST = 96  # neighbours
_CHUNK = 256  # vertices in a row on one processor
_DEPENDENT = 0.01  # of a column's size: what is left of it beside the columns before it


def jets(points: Reals, faces: Indices, normals: Reals) -> tuple[Reals, Reals]:
    """Unit normals (v, 3) and principal curvatures (v, 2), 1/m, positive where the surface bends away from
    its upper side.
    """
    points, normals = (read_only(np.ascontiguousarray(each)) for each in (points, normals))
    faces = read_only(faces)
    first, owner = corners_at(faces, len(points))
    unit, bent = np.empty((len(points), 3)), np.empty((len(points), 2))
    _jets(points, faces, normals, first, owner, unit, bent)
    return unit, bent


@njit(cache=True)
def corners_at(faces, count):  # type: ignore[no-untyped-def]
    """The triangles at each vertex: those of vertex v are owner[first[v]:first[v + 1]]."""
    first = np.zeros(count + 1, dtype=np.int64)
    for t in range(len(faces)):
        for k in range(3):
            first[faces[t, k] + 1] += 1
    for v in range(count):
        first[v + 1] += first[v]
    place, owner = first[:-1].copy(), np.empty(3 * len(faces), dtype=np.int64)
    for t in range(len(faces)):
        for k in range(3):
            v = faces[t, k]
            owner[place[v]] = t
            place[v] += 1
    return first, owner


@njit(cache=True)
def _rings(v, rings, faces, first, owner, near):  # type: ignore[no-untyped-def]
    """Writes the vertices within `rings` of v to `near`, v first; returns their number, and that of the first
    ring.
    """
    near[0] = v
    count, begin, ring_one = 1, 0, 1
    for ring in range(rings):
        end = count
        for k in range(begin, end):
            for place in range(first[near[k]], first[near[k] + 1]):
                for j in range(3):
                    other = faces[owner[place], j]
                    known = False
                    for i in range(count):
                        if near[i] == other:
                            known = True
                            break
                    if not known and count < len(near):
                        near[count] = other
                        count += 1
        if ring == 0:
            ring_one = count
        begin = end
    return count, ring_one


@njit(cache=True, parallel=True)
def _jets(points, faces, normals, first, owner, unit, bent):  # type: ignore[no-untyped-def]
    count = len(points)
    for chunk in prange((count + _CHUNK - 1) // _CHUNK):
        near = np.empty(_MOST + 1, dtype=np.int64)
        columns, fit = np.empty((10, _MOST)), np.empty(9)
        n, e1, e2 = np.empty(3), np.empty(3), np.empty(3)
        for v in range(chunk * _CHUNK, min((chunk + 1) * _CHUNK, count)):
            found, ring_one = _rings(v, 2, faces, first, owner, near)
            # An inner vertex has as many neighbours as triangles, one at the edge has one more.
            if ring_one - 1 != first[v + 1] - first[v]:
                found, _ = _rings(v, 3, faces, first, owner, near)
            for i in range(3):
                n[i] = normals[v, i]
            k = 0 if abs(n[0]) < abs(n[1]) and abs(n[0]) < abs(n[2]) else (1 if abs(n[1]) < abs(n[2]) else 2)
            size = np.sqrt(1.0 - n[k] * n[k])
            for i in range(3):
                e1[i] = ((1.0 if i == k else 0.0) - n[k] * n[i]) / size
            for i in range(3):
                j, l = (i + 1) % 3, (i + 2) % 3
                e2[i] = n[j] * e1[l] - n[l] * e1[j]
            reach = 0.0
            for r in range(1, found):
                away = 0.0
                for i in range(3):
                    away += (points[near[r], i] - points[v, i]) ** 2
                reach = max(reach, np.sqrt(away))
            unknowns = 9 if found > 11 else (5 if found > 6 else 2)
            while True:
                for r in range(1, found):
                    x, y, z = 0.0, 0.0, 0.0
                    for i in range(3):
                        d = (points[near[r], i] - points[v, i]) / reach
                        x += d * e1[i]
                        y += d * e2[i]
                        z += d * n[i]
                    q = r - 1
                    columns[0, q], columns[1, q] = x, y
                    columns[2, q], columns[3, q], columns[4, q] = 0.5 * x * x, x * y, 0.5 * y * y
                    columns[5, q], columns[6, q], columns[7, q], columns[8, q] = (
                        x * x * x,
                        x * x * y,
                        x * y * y,
                        y * y * y,
                    )
                    columns[9, q] = z
                if _least_squares(columns, unknowns, found - 1, fit):
                    break
                if unknowns == 2:  # the neighbours lie in a row: the first normal stays
                    fit[0], fit[1] = 0.0, 0.0
                    break
                unknowns = 5 if unknowns == 9 else 2
            p, q = fit[0], fit[1]
            slope = np.sqrt(1.0 + p * p + q * q)
            for i in range(3):
                unit[v, i] = (n[i] - p * e1[i] - q * e2[i]) / slope
            bent[v] = 0.0
            if unknowns >= 5:
                # Shape operator of a graph: second form over first form; a crown (z down) counts positive.
                L, M, N = -fit[2] / slope / reach, -fit[3] / slope / reach, -fit[4] / slope / reach
                E, F, G = 1.0 + p * p, p * q, 1.0 + q * q
                det = E * G - F * F
                mean = 0.5 * (E * N - 2.0 * F * M + G * L) / det
                gauss = (L * N - M * M) / det
                root = np.sqrt(max(mean * mean - gauss, 0.0))
                bent[v, 0], bent[v, 1] = mean + root, mean - root


@njit(cache=True)
def _least_squares(columns, unknowns, rows, fit):  # type: ignore[no-untyped-def]
    """Solves for `fit` by modified Gram and Schmidt, the right side being the last of the columns (10, rows),
    which are overwritten; False where the columns are nearly dependent."""
    R = np.zeros((9, 10))
    for a in range(unknowns):
        before, after = 0.0, 0.0
        for r in range(rows):
            after += columns[a, r] ** 2
        for b in range(a):
            before += R[b, a] ** 2
        before += after
        if not after > _DEPENDENT**2 * before or before == 0.0:
            return False
        R[a, a] = np.sqrt(after)
        for r in range(rows):
            columns[a, r] /= R[a, a]
        for b in range(a + 1, 10):
            if b < unknowns or b == 9:
                total = 0.0
                for r in range(rows):
                    total += columns[a, r] * columns[b, r]
                R[a, b] = total
                for r in range(rows):
                    columns[b, r] -= total * columns[a, r]
    for a in range(unknowns - 1, -1, -1):
        total = R[a, 9]
        for b in range(a + 1, unknowns):
            total -= R[a, b] * fit[b]
        fit[a] = total / R[a, a]
    return True
