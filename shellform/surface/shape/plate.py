"""Heights of least bending over a plan, by Morley's triangle (Morley 1968).

The heights w minimise the integral of |D²w|² over the plan, with w given at some vertices and the slope
across some edges. Morley's element has the heights at the vertices and the slopes θ across the edges as
unknowns, and constant second derivatives, which by Gauss' theorem are the sum over the triangle's edges e of
length l, outward normal n and tangent t

    D²w = Σ l (θ n + (w_b - w_a)/l t) ⊗ n / A

Linear and quadratic heights are reproduced exactly.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import spsolve

from shellform.arrays import Indices, Reals


def bent_heights(
    plan: Reals, triangles: Indices, heights: Reals, edges: Indices, slopes: Reals
) -> tuple[Reals, Reals]:
    """Heights (v,), m, and their slopes (v, 2) over the vertices of a `plan` (v, 2), m, triangles (t, 3)
    turned counterclockwise.

    `heights` (v,) are those given, NaN where free; `slopes` (e,) are those along the right-hand normals of
    directed `edges` (e, 2) of the boundary, which pass it with the plan on their left; elsewhere the boundary
    may turn.
    """
    count = len(plan)
    directed = np.vstack([triangles[:, [1, 2]], triangles[:, [2, 0]], triangles[:, [0, 1]]])
    pairs, number = np.unique(np.sort(directed, axis=1), axis=0, return_inverse=True)
    number = number.ravel()
    along = plan[directed[:, 1]] - plan[directed[:, 0]]
    length = np.linalg.norm(along, axis=1)
    tangent = along / length[:, None]
    normal = np.column_stack([tangent[:, 1], -tangent[:, 0]])
    # θ of an edge is along the normal of its sorted direction.
    sense = np.where(directed[:, 0] == pairs[number, 0], 1.0, -1.0)
    first, second = (
        plan[triangles[:, 1]] - plan[triangles[:, 0]],
        plan[triangles[:, 2]] - plan[triangles[:, 0]],
    )
    area = 0.5 * (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])
    owner = np.tile(np.arange(len(triangles)), 3)
    weight = 1.0 / np.sqrt(area)[owner]
    rows, columns, values = [], [], []
    for k, (i, j) in enumerate([(0, 0), (1, 1), (0, 1), (1, 0)]):
        by_slope = sense * length * normal[:, i] * normal[:, j] * weight
        by_height = tangent[:, i] * normal[:, j] * weight
        rows += [4 * owner + k] * 3
        columns += [count + number, directed[:, 1], directed[:, 0]]
        values += [by_slope, by_height, -by_height]
    shape = (4 * len(triangles), count + len(pairs))
    bend = sp.csr_array(
        (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=shape
    )
    known = np.concatenate([heights, np.full(len(pairs), np.nan)])
    lookup = {(int(a), int(b)): k for k, (a, b) in enumerate(pairs)}
    for (a, b), slope in zip(edges.tolist(), slopes.tolist(), strict=True):
        known[count + lookup[min(a, b), max(a, b)]] = slope if a < b else -slope
    free = np.isnan(known)
    given = np.where(free, 0.0, known)
    right = -(bend.T @ (bend @ given))[free]
    part = bend[:, free]
    result = given
    result[free] = spsolve(sp.csc_array(part.T @ part), right)
    # The slope at a triangle's middle is the mean of those at its edges' middles, and varies from there with
    # D²w.
    across = (sense * result[count + number])[:, None] * normal
    at_edge = across + ((result[directed[:, 1]] - result[directed[:, 0]]) / length)[:, None] * tangent
    middle = at_edge.reshape(3, -1, 2).mean(axis=0)
    return np.asarray(result[:count]), _at_vertices(plan, triangles, middle, _curvatures(bend @ result, area))


def _curvatures(parts: Reals, area: Reals) -> Reals:
    """D²w (t, 2, 2) from its weighted entries 11, 22, 12, 21 of each triangle."""
    entries = parts.reshape(-1, 4) / np.sqrt(area)[:, None]
    return np.asarray(entries[:, [0, 2, 3, 1]].reshape(-1, 2, 2))


def _at_vertices(plan: Reals, triangles: Indices, middle: Reals, curvature: Reals) -> Reals:
    """Slopes (v, 2) at the vertices, the mean of those of the triangles round each."""
    total, times = np.zeros((len(plan), 2)), np.zeros(len(plan))
    centre = plan[triangles].mean(axis=1)
    for k in range(3):
        slope = middle + np.einsum("tij,tj->ti", curvature, plan[triangles[:, k]] - centre)
        np.add.at(total, triangles[:, k], slope)
        np.add.at(times, triangles[:, k], 1.0)
    return total / np.maximum(times, 1.0)[:, None]
