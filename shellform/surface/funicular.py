"""Funicular shapes by the force density method (Schek 1974).

A network whose branches carry forces proportional to their lengths, n = q l with force densities q, N/m, is
in equilibrium under nodal loads p where

    C' diag(q) C x = p

for each coordinate x, C being the branch-node matrix: one sparse symmetric system, definite where the network
has one shape. Positive q is tension; a thrust shell is the same with the loads turned round, so a shell under
its weight is the hanging net under loads p pointing up.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Literal

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike
from scipy.sparse.linalg import SuperLU, splu

from shellform.arrays import Flags, Indices, Reals, flags, indices, reals
from shellform.errors import InputError, NotConverged, require_number
from shellform.surface.bounded import bounded_minimum
from shellform.surface.readers.draft import require_mesh_size
from shellform.surface.shape.triangles import counted_edges, vertex_areas

if TYPE_CHECKING:  # which load gmsh and numba
    from shellform.surface.shape.target import Surface

_ROUNDS = 200  # in which heights and weights settle, at the most
_SETTLED = 1e-10  # change of the heights in a round, of the rise
_NEAREST = 1e-9  # weight of being uniform in a fit, of the mean diagonal
_SINGULAR = 1e-12  # of the diagonal: a pivot below that is rounding


def force_density(
    nodes: ArrayLike, edges: ArrayLike, densities: ArrayLike, loads: ArrayLike, fixed: ArrayLike
) -> Reals:
    """Node positions (n, 3), m, in equilibrium.

    `nodes` (n, 3), m, give the places of the `fixed` (n,) ones; `edges` (m, 2) carry force `densities` (m,),
    N/m, tension positive, and `loads` (n, 3), N, act on the nodes, along the axes' directions. Raises
    InputError where the free nodes aren't held, or where tension and compression together leave no definite
    shape.
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
    plan: ArrayLike,
    triangles: ArrayLike,
    fixed: ArrayLike,
    *,
    rise: float,
    load: Literal["surface", "plan"] = "surface",
) -> Reals:
    """Heights (v,), m, of the shell over a triangulated `plan` (v, 2), m, that bears a uniform weight by
    thrust alone.

    Its `fixed` (v,) vertices stay at height 0 and its highest point is at `rise`, m, above them. The `load`
    is uniform per area of the surface, which is found by iteration, or of the plan. The thrust is the same in
    all plan directions: the branches' force densities are the cotangent weights of the triangles, with which
    the plan is in equilibrium with itself whatever the mesh; the rise sets their scale. Raises InputError
    where nothing is free or fixed, and NotConverged.
    """
    place = reals("plan", plan, (None, 2))
    faces = indices("triangles", triangles, (None, 3), below=len(place))
    held = flags("fixed", fixed, (len(place),))
    if held.all() or not held.any():
        which = "every" if held.all() else "no"
        raise InputError(
            f"{which} vertex is fixed",
            where="fixed",
            remedy="Fix the edge, and mesh the plan finer if need be.",
        )
    return _raised(place, faces, held, *_isotropic_thrust(place, faces), rise, load)


def _raised(
    place: Reals, faces: Indices, held: Flags, ends: Indices, density: Reals, rise: float, load: str
) -> Reals:
    """Heights (v,), m, over a plan in equilibrium with these force densities, for any scale of them: the rise
    sets it.
    """
    require_number(rise, above=0.0, where="rise", give="metres, such as 0.2")
    if load not in ("surface", "plan"):
        raise InputError(
            "must be surface or plan",
            where="load",
            value=load,
            remedy='Give "surface" for a layer of even thickness, "plan" for what weighs evenly in plan.',
        )
    free = ~held
    solver = _definite(_stiffness(len(place), ends, density)[free][:, free])
    shape = np.column_stack([place, np.zeros(len(place))])
    for _ in range(_ROUNDS):
        raised = np.zeros(len(place))
        raised[free] = solver.solve(vertex_areas(shape, faces)[free])
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


def thrust_shell(
    outline: ArrayLike,
    *,
    rise: float,
    size: float,
    supports: Sequence[tuple[int, int]] | None = None,
    openings: Sequence[ArrayLike] = (),
    load: Literal["surface", "plan"] = "surface",
    sag: float = 0.1,
) -> Surface:
    """A shell over a plan that bears a uniform weight by thrust alone, meshed at about `size`, m.

    The `outline` (k, 2), m, runs counterclockwise. It stands on the ground from corner i to corner j for each
    of the `supports` (i, j), numbered from 0, or all along where they are left out. Between supports it is
    free: an arch along the edge bears the thrust of the shell, and its plan draws inwards by about `sag` of
    its span; so do the edges of the `openings`, plan polygons, which are rings. The plan's branches have the
    cotangent weights of its triangles as force densities, the arches those that a cable of that sag has; all
    coordinates are then in equilibrium. `rise` and `load` as in `thrust_heights`. Raises InputError for plans
    that carry no shell.
    """
    from shellform.surface import cad
    from shellform.surface.shape.target import make_surface

    corners = _corners("outline", outline)
    if len(corners) < 3 or _turning(corners) <= 0.0:
        raise InputError(
            "must be at least three corners, counterclockwise",
            where="outline",
            value=corners.tolist(),
            remedy="Reverse their order." if len(corners) > 2 else "Give x and y of each corner, m.",
        )
    require_number(sag, above=0.0, below=0.5, where="sag", give="a share of the span, such as 0.1")
    # before the outline is divided, which alone can be too much
    require_mesh_size(
        size, *np.ptp(corners, axis=0), where="size", give="metres, such as a fortieth of the span"
    )
    line, corner = _divided(corners, size)
    stands = np.ones(len(line), dtype=bool) if supports is None else _standing(supports, corner, len(line))
    holes = [_corners(f"openings[{k}]", each) for k, each in enumerate(openings)]
    for k, hole in enumerate(holes):
        if _turning(hole) == 0.0:
            raise InputError(
                "encloses nothing",
                where=f"openings[{k}]",
                value=hole.tolist(),
                remedy="Give x and y of at least three corners, m.",
            )
    rings = [_divided(hole, size)[0] for hole in holes]
    rings = [ring if _turning(ring) > 0.0 else ring[::-1] for ring in rings]
    inside, faces = cad.mesh_plan([line, *rings], size=size)
    plan = np.vstack([line, *rings, inside])
    held = np.zeros(len(plan), dtype=bool)
    held[: len(line)] = stands
    if held.all():
        raise InputError(
            "leaves no point between the supports", where="size", value=size, remedy="Choose a smaller one."
        )
    ends, density = _isotropic_thrust(plan, faces)
    arches, pull = _arches(line, stands, rings, sag)
    ends, density = np.vstack([ends, arches]), np.concatenate([density, pull])
    flat = np.column_stack([plan, np.zeros(len(plan))])
    drawn = force_density(flat, ends, density, np.zeros_like(flat), held)[:, :2]
    first, second = drawn[faces[:, 1]] - drawn[faces[:, 0]], drawn[faces[:, 2]] - drawn[faces[:, 0]]
    if (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0] <= 0.0).any():
        raise InputError(
            "the plan folds where its free edges draw in",
            where="sag",
            value=sag,
            remedy="Choose a smaller sag, or longer supports.",
        )
    heights = _raised(drawn, faces, held, ends, density, rise, load)
    return make_surface(np.column_stack([drawn, heights]), faces, source="thrust shell")


def nearest_thrust_shell(surface: Surface, *, ground: float | None = None, least: float = 0.05) -> Surface:
    """The thrust shell nearest to a wished-for `surface` under its own uniform weight, with the same plan of
    branches.

    Vertices of its edge within a hundredth of its rise of the `ground`, m (left out: the lowest), are held.
    The force densities are those that leave the least unbalanced force on the surface as it is, none below
    `least` of their mean, so that all stays in compression. Raises InputError where nothing is held, where
    the ground isn't below the surface's top, and where `least` isn't above 0 and at most 1.
    """
    from shellform.surface.shape.target import make_surface

    points, faces = surface.vertices, surface.triangles
    top = float(points[:, 2].max())
    level = float(points[:, 2].min()) if ground is None else ground
    give = "a surface that rises" if ground is None else "metres below its top, or leave it out"
    require_number(level, below=top, where="ground", give=give)
    edge, held = np.concatenate(surface.boundary), np.zeros(len(points), dtype=bool)
    held[edge] = points[edge, 2] < level + 0.01 * (top - level)
    if not held.any():
        raise InputError(
            "nothing of its edge stands on the ground",
            where="ground",
            value=ground,
            remedy="State its height.",
        )
    edges, _ = counted_edges(faces)
    weight = np.column_stack([np.zeros((len(points), 2)), -vertex_areas(points, faces)])
    density = fitted_densities(points, edges, weight, held, least=least)
    return make_surface(
        force_density(points, edges, density, weight, held),
        faces,
        source=f"thrust shell near {surface.source}",
    )


def fitted_densities(
    nodes: ArrayLike, edges: ArrayLike, loads: ArrayLike, fixed: ArrayLike, *, least: float = 0.05
) -> Reals:
    """Force densities (m,), N/m, all in compression (negative), with which the network as it stands is
    nearest to equilibrium.

    They minimise the squared unbalanced forces on the free `nodes` (n, 3), m, under `loads` (n, 3), N, with
    the size of each at least `least` times that of the uniform density that fits best; of many such, those
    nearest to uniform. Arguments as in `force_density`. Raises InputError where no compression bears the
    loads better than none, and where `least` isn't above 0 and at most 1.
    """
    give = "a share of their mean, such as 0.05"
    require_number(least, above=0.0, most=1.0, where="least", give=give, share=True)
    place = reals("nodes", nodes, (None, 3))
    ends = indices("edges", edges, (None, 2), below=len(place))
    load = reals("loads", loads, (len(place), 3))
    free = ~flags("fixed", fixed, (len(place),))
    across = place[ends[:, 1]] - place[ends[:, 0]]
    columns = np.tile(np.arange(len(ends)), 2)
    rows = ends.T.ravel()
    # Compression of size q pushes node a along x_a - x_b and node b the other way: the force on the nodes is
    # B q + p.
    blocks = [
        sp.csr_array(
            (np.concatenate([-across[:, k], across[:, k]]), (rows, columns)), shape=(len(place), len(ends))
        )
        for k in range(3)
    ]
    push = sp.vstack([block[free] for block in blocks]).tocsc()
    right = -np.concatenate([load[free, k] for k in range(3)])
    even = push.sum(axis=1)
    uniform = float(even @ right / (even @ even)) if even.any() else 0.0
    if not uniform > 0.0:
        raise InputError(
            "no compression bears the loads",
            where="loads",
            remedy="Check that they press on the shell from outside.",
        )
    normal = push.T @ push
    nearest = _NEAREST * float(normal.diagonal().mean())
    matrix = sp.csc_array(normal + nearest * sp.eye_array(len(ends)))
    return -bounded_minimum(matrix, push.T @ right + nearest * uniform, least * uniform)


def _corners(name: str, polygon: ArrayLike) -> Reals:
    """The corners (k, 2), m, of a closed polygon. Raises InputError where one lies on the next."""
    corners = reals(name, polygon, (None, 2))
    again = (corners == np.roll(corners, -1, axis=0)).all(axis=1)
    if len(corners) > 1 and again.any():
        raise InputError(
            "has a corner twice in a row",
            where=name,
            value=corners[np.argmax(again)].tolist(),
            remedy="Leave one of the two out: the last corner and the first are joined by themselves.",
        )
    return corners


def _turning(polygon: Reals) -> float:
    """Twice the area, m², of a closed polygon, positive counterclockwise."""
    after = np.roll(polygon, -1, axis=0)
    return float(np.sum(polygon[:, 0] * after[:, 1] - polygon[:, 1] * after[:, 0]))


def _divided(polygon: Reals, size: float) -> tuple[Reals, Indices]:
    """A closed polygon's points (n, 2) about `size` apart, and the places of its corners among them."""
    points: list[Reals] = []
    corner: list[int] = []
    for a, b in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        corner.append(len(points))
        count = max(1, round(float(np.linalg.norm(b - a)) / size))
        points += [a + (b - a) * k / count for k in range(count)]
    return np.array(points), np.array(corner)


def _standing(supports: Sequence[tuple[int, int]], corner: Indices, count: int) -> Flags:
    held = np.zeros(count, dtype=bool)
    for i, j in indices("supports", supports, (None, 2), below=len(corner)).tolist():
        length = int((corner[j] - corner[i]) % count)
        held[(corner[i] + np.arange(length + 1)) % count] = True
    if held.sum() < 2:
        raise InputError(
            "hold the shell in fewer than two points",
            where="supports",
            value=list(supports),
            remedy="Support more.",
        )
    return held


def _arches(line: Reals, stands: Flags, rings: Sequence[Reals], sag: float) -> tuple[Indices, Reals]:
    """Branches (m, 2) along free edges and their force densities (m,), for a thrust of 1 N/m in the shell.

    An edge of span L that sags by f bears a pull of 1 N/m with a force of L²/8f; a ring of radius R with R.
    """
    ends, density = [np.zeros((0, 2), dtype=np.int64)], [np.zeros(0)]
    count = len(line)
    start = int(np.argmax(stands))
    order = np.append((start + np.arange(count)) % count, start)
    feet = np.flatnonzero(stands[order])
    for a, b in pairwise(feet.tolist()):
        if b - a < 2:
            continue
        mine = np.column_stack([order[a:b], order[a + 1 : b + 1]])
        span = float(np.linalg.norm(line[order[b]] - line[order[a]]))
        ends.append(mine)
        density.append(span / (8.0 * sag) / np.linalg.norm(line[mine[:, 1]] - line[mine[:, 0]], axis=1))
    for ring in rings:
        mine = count + np.column_stack([np.arange(len(ring)), np.roll(np.arange(len(ring)), -1)])
        length = np.linalg.norm(np.roll(ring, -1, axis=0) - ring, axis=1)
        ends.append(mine)
        density.append(float(length.sum()) / (2.0 * np.pi) / length)
        count += len(ring)
    return np.vstack(ends), np.concatenate(density)


def _stiffness(count: int, ends: Indices, density: Reals) -> sp.csr_array:
    """C' diag(q) C (n, n), N/m."""
    rows = np.arange(len(ends))
    branch = sp.csr_array(
        (np.repeat([-1.0, 1.0], len(ends)), (np.tile(rows, 2), ends.T.ravel())), shape=(len(ends), count)
    )
    return sp.csr_array(branch.T @ sp.diags_array(density) @ branch)


def _definite(matrix: sp.csr_array) -> SuperLU:
    """The factors of a symmetric positive definite matrix, which has its pivots on the diagonal and all
    positive.
    """
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
        raise InputError(
            "tension and compression leave the network no definite shape", where="densities", remedy=remedy
        )
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
