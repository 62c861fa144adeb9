"""Funicular shapes by the force density method (Schek 1974).

A network whose branches carry forces proportional to their lengths, n = q l with force densities q, N/m, is in equilibrium under
nodal loads p where

    C' diag(q) C x = p

for each coordinate x, C being the branch-node matrix: one sparse linear solve. Positive q is tension; a thrust shell is the
same with the loads turned round, so a shell under its weight is the hanging net under loads p pointing up.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike
from scipy.sparse.linalg import spsolve

from shellform.arrays import Flags, Indices, Reals, flags, indices, reals
from shellform.errors import InputError, NotConverged

_ROUNDS = 200
_SETTLED = 1e-10  # change of the heights in a round, of the rise


def force_density(
    nodes: ArrayLike, edges: ArrayLike, densities: ArrayLike, loads: ArrayLike, fixed: ArrayLike
) -> Reals:
    """Node positions (n, 3), m, in equilibrium.

    `nodes` (n, 3) give the places of the `fixed` (n,) ones; `edges` (m, 2) carry force `densities` (m,), N/m, tension positive, and
    `loads` (n, 3), N, act on the nodes. Raises InputError where the free nodes aren't held.
    """
    place = reals("nodes", nodes, (None, 3))
    ends = indices("edges", edges, (None, 2), below=len(place))
    density = reals("densities", densities, (len(ends),))
    load = reals("loads", loads, (len(place), 3))
    held = flags("fixed", fixed, (len(place),))
    if not held.any():
        raise InputError("no node is fixed", where="fixed", remedy="Fix the supports.")
    rows = np.arange(len(ends))
    branch = sp.csr_array(
        (np.repeat([-1.0, 1.0], len(ends)), (np.tile(rows, 2), ends.T.ravel())), shape=(len(ends), len(place))
    )
    stiffness = sp.csc_array(branch.T @ sp.diags_array(density) @ branch)
    free = ~held
    right = load[free] - stiffness[free][:, held] @ place[held]
    result = np.array(place)
    solved = spsolve(stiffness[free][:, free].tocsc(), right)
    if not np.isfinite(solved).all():
        raise InputError("some free nodes hang on nothing", where="densities", remedy="Check signs and connections.")
    result[free] = solved.reshape(-1, 3)
    return result


def thrust_heights(plan: Reals, triangles: Indices, fixed: Flags, *, rise: float) -> Reals:
    """Heights (v,), m, of the shell over a triangulated `plan` (v, 2) that bears a uniform weight of its surface by thrust alone.

    Its `fixed` (v,) vertices stay at height 0 and its highest point is at `rise`. The thrust is the same in all plan directions:
    the branches' force densities are the cotangent weights of the triangles, with which the plan is in equilibrium with itself
    whatever the mesh. The weight follows the surface's area, found by iteration. Raises NotConverged.
    """
    if not rise > 0.0:
        raise InputError("must be positive", where="rise", value=rise)
    edges, densities = _isotropic_thrust(plan, triangles)
    flat = np.column_stack([plan, np.zeros(len(plan))])
    shape = flat
    for _ in range(_ROUNDS):
        weight = _tributary_areas(shape, triangles)
        load = np.column_stack([np.zeros((len(plan), 2)), weight])
        raised = force_density(flat, edges, densities, load, fixed)[:, 2]
        raised *= rise / raised.max()
        change = float(np.abs(raised - shape[:, 2]).max())
        shape = np.column_stack([plan, raised])
        if change < _SETTLED * rise:
            return raised
    raise NotConverged(
        f"The shell's height still changes by {change:.1e} m a round", state=shape, remedy="Choose a smaller rise."
    )


def _isotropic_thrust(plan: Reals, triangles: Indices) -> tuple[Indices, Reals]:
    """Edges (m, 2), repeated, and their cotangent weights (m,)."""
    edges, weights = [], []
    for k in range(3):
        a, b, c = (triangles[:, (k + i) % 3] for i in range(3))
        first, second = plan[b] - plan[a], plan[c] - plan[a]
        cross = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
        weights.append(0.5 * np.sum(first * second, axis=1) / np.abs(cross))
        edges.append(np.column_stack([b, c]))
    return np.vstack(edges), np.concatenate(weights)


def _tributary_areas(points: Reals, triangles: Indices) -> Reals:
    """A third of the area of every triangle to each of its vertices (v,), m²."""
    corner = points[triangles]
    area = 0.5 * np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)
    total = np.zeros(len(points))
    for k in range(3):
        np.add.at(total, triangles[:, k], area / 3.0)
    return total
