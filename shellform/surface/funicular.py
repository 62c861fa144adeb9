"""Funicular shapes by the force density method (Schek 1974).

A network whose branches carry forces proportional to their lengths, n = q l with force densities q, N/m, is in equilibrium under
nodal loads p where

    C' diag(q) C x = p

for each coordinate x, C being the branch-node matrix: one sparse symmetric system, definite where the network has one shape. Positive
q is tension; a thrust shell is the same with the loads turned round, so a shell under its weight is the hanging net under loads p
pointing up.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike
from scipy.sparse.linalg import SuperLU, splu

from shellform.arrays import Indices, Reals, flags, indices, reals
from shellform.errors import InputError, NotConverged

_ROUNDS = 200
_SETTLED = 1e-10  # change of the heights in a round, of the rise
_SINGULAR = 1e-12  # of the diagonal: a pivot below that is rounding


def force_density(
    nodes: ArrayLike, edges: ArrayLike, densities: ArrayLike, loads: ArrayLike, fixed: ArrayLike
) -> Reals:
    """Node positions (n, 3), m, in equilibrium.

    `nodes` (n, 3), m, give the places of the `fixed` (n,) ones; `edges` (m, 2) carry force `densities` (m,), N/m, tension positive, and
    `loads` (n, 3), N, act on the nodes, along the axes' directions. Raises InputError where the free nodes aren't held, or where tension
    and compression together leave no definite shape.
    """
    place = reals("nodes", nodes, (None, 3))
    ends = indices("edges", edges, (None, 2), below=len(place))
    density = reals("densities", densities, (len(ends),))
    load = reals("loads", loads, (len(place), 3))
    held = flags("fixed", fixed, (len(place),))
    if not held.any():
        raise InputError("no node is fixed", where="fixed", remedy="Fix the supports.")
    result = np.array(place)
    if held.all():
        return result
    stiffness = _stiffness(len(place), ends, density)
    free = ~held
    right = load[free] - stiffness[free][:, held] @ place[held]
    # All in compression, under the loads as they are, is all in tension with both turned round.
    sign = 1.0 if stiffness.diagonal().sum() > 0.0 else -1.0
    result[free] = sign * _definite(sign * stiffness[free][:, free]).solve(right)
    return result


def thrust_heights(
    plan: ArrayLike, triangles: ArrayLike, fixed: ArrayLike, *, rise: float, load: Literal["surface", "plan"] = "surface"
) -> Reals:
    """Heights (v,), m, of the shell over a triangulated `plan` (v, 2), m, that bears a uniform weight by thrust alone.

    Its `fixed` (v,) vertices stay at height 0 and its highest point is at `rise`, m, above them. The `load` is uniform per area of the
    surface, which is found by iteration, or of the plan. The thrust is the same in all plan directions: the branches' force densities
    are the cotangent weights of the triangles, with which the plan is in equilibrium with itself whatever the mesh; the rise sets their
    scale. Raises InputError where nothing is free or fixed, and NotConverged.
    """
    if not (np.isfinite(rise) and rise > 0.0):
        raise InputError("must be positive", where="rise", value=rise)
    if load not in ("surface", "plan"):
        raise InputError("must be surface or plan", where="load", value=load)
    place = reals("plan", plan, (None, 2))
    faces = indices("triangles", triangles, (None, 3), below=len(place))
    held = flags("fixed", fixed, (len(place),))
    if held.all() or not held.any():
        which = "every" if held.all() else "no"
        raise InputError(f"{which} vertex is fixed", where="fixed", remedy="Fix the edge, and mesh the plan finer if need be.")
    free = ~held
    solver = _definite(_stiffness(len(place), *_isotropic_thrust(place, faces))[free][:, free])
    shape = np.column_stack([place, np.zeros(len(place))])
    for _ in range(_ROUNDS):
        raised = np.zeros(len(place))
        raised[free] = solver.solve(_tributary_areas(shape, faces)[free])
        raised *= rise / raised.max()
        change = float(np.abs(raised - shape[:, 2]).max())
        if change < _SETTLED * rise or load == "plan":
            return raised
        shape = np.column_stack([place, raised])
    raise NotConverged(
        f"the shell's height still changes by {change:.1e} m a round",
        state=shape,
        residual=change / rise,
        iterations=_ROUNDS,
        remedy="Choose a smaller rise, or mesh the plan more evenly.",
    )


def _stiffness(count: int, ends: Indices, density: Reals) -> sp.csr_array:
    """C' diag(q) C (n, n), N/m."""
    rows = np.arange(len(ends))
    branch = sp.csr_array((np.repeat([-1.0, 1.0], len(ends)), (np.tile(rows, 2), ends.T.ravel())), shape=(len(ends), count))
    return sp.csr_array(branch.T @ sp.diags_array(density) @ branch)


def _definite(matrix: sp.csr_array) -> SuperLU:
    """The factors of a symmetric positive definite matrix, which has its pivots on the diagonal and all positive."""
    remedy = "Check that every node is tied to a fixed one, and the signs of the force densities."
    try:
        factors = splu(
            matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
        )
    except RuntimeError as error:  # exactly singular
        raise InputError("some free nodes hang on nothing", where="densities", remedy=remedy) from error
    pivots = factors.U.diagonal()
    weakest = float((pivots / matrix.diagonal()[np.argsort(factors.perm_c)]).min())
    if not np.array_equal(factors.perm_r, factors.perm_c) or weakest < -_SINGULAR:
        raise InputError("tension and compression leave the network no definite shape", where="densities", remedy=remedy)
    if weakest < _SINGULAR:
        raise InputError("some free nodes hang on nothing", where="densities", remedy=remedy)
    return factors


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
