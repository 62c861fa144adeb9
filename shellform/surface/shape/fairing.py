"""The nearest surface that is curved nowhere more than a cap: creases rounded, curvature bounded by the least
change.

A surface x = v + d D is sought, v the vertices as given, D directions across it, that solves

    minimise ½ ∫ d² dA   subject to   |κ₁|, |κ₂| ≤ 1/R   everywhere,

since no rod on it, whichever way it runs, is then bent across the surface to less than R. In a vertex' frame
(u, v, n) the second fundamental form is that of the quadratic that fits its two rings of neighbours best,

    II_i = Σ_j C_ij n_i · (x_j - x_i) = II_i(v) + (L d)_i,   L_ij = C_ij n_i · D_j,

of one side at the edge (a crease that runs out there bends rods as well), linear in d while the frames stay.
With Z = II(v) + L d, whose eigenvalues are to be capped, this is a projection, solved by the alternating
direction method of multipliers (Boyd et al. 2011, section 5.2):

    (M + ρ Lᵀ W L) d = ρ Lᵀ W (Z - U - II(v)),   Z = capped(II + U),   U += II - Z

with the areas M and the areas W of the forms' components, II_uv twice. The matrix is sparse and factored once
for fixed frames; frames follow in a few rounds. ρ = R⁴ makes both terms of one size at the length R, where
the change happens.

Quadratics fitted to two rings don't see waves as short as the mesh's sides, in which a cap on them alone
hides what bends more. So what a vertex lies off the quadratic q that its neighbours have without it, over
their mean squared distance h²,

    w_i = (q_i(0) - 0) / h_i² = w_i(v) + (J d)_i,

is made small as well: ½ σ R⁴ ∫ w² dA is added, which adds σ R⁴ Jᵀ W J to the matrix.

D are normals smoothed over R, so that neighbours on both sides of a crease don't cross. Vertices on the
ground stay on their level, and move in plan only where a crease runs into it; where that leaves none that
keeps the cap, the ground is left uncapped: rods end there.

Where much has to change, quadratics fitted across a sharp crease say little of the rounded one. Then the
radius grows in stages from what the surface keeps to R, each from the places p that the one before has come
to, with D, frames and multipliers made anew: ½ ∫ |p - v + d D|² dA is what is least there, so that it stays
the change from the surface as given.

A quadratic sees two rings of neighbours, so that on a fine mesh a change travels slowly across R. Where
nothing comes of it, a coarser one is tried: it shows the curvature less well, but eight lobes that meet in a
point are rounded on a quarter of the vertices alone, in a quarter of the time.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from shellform.arrays import Flags, Indices, Reals, Record
from shellform.errors import InputError, NotConverged, require_number
from shellform.structure.solve.factorisation import Factor, Symmetric
from shellform.surface.shape.quadratics import Quadratics, principal, second, waves
from shellform.surface.shape.target import ON_GROUND, Surface, make_surface, rough_normals
from shellform.surface.shape.triangles import area_vectors, directed_edges, vertex_areas

_MESH = 0.3  # of R: edges that aren't longer show its curvature
_COARSE = 0.45  # the same, where nothing comes of that
_MOST = 30_000  # vertices of the refined mesh
_ROUNDS, _STEPS = 12, 60  # of frames, and of multipliers in each
_BETTER, _VAIN = 0.98, 2  # of the least so far; rounds in a row that don't come below it end the search
_FIRST, _GROWTH = 0.15, 1.4  # of R, the first stage at the least; from one stage to the next
_STAGE_ROUNDS = 4  # of a stage but the last
_STAGED = 6000  # vertices: of more, stages take as long as a way out may, and a coarser mesh comes first
_LOST = 0.05  # of a stage's radius, that is left at one place: no further stage mends that
# σ, of waves as short as the mesh's sides: with 0.1 scans that are rounded to R are bent to 0.7 R in places,
# without to 0.4 R, and with 1 coarse meshes to no less than 1.3 R
_EVEN = 0.3
_MARGIN = 0.96  # of the cap, at which forms are capped
_HEAVY = 10.0  # times their area: vertices on the ground
_RELAXED = 1.6  # over-relaxation
_LEFT = 0.7  # of its area, at the least: of less feet are left that are drawn out to needles


@dataclass(frozen=True, eq=False)
class Faired(Record):
    """A `surface` curved at most to a radius, the surface as it was, `before`, on the same triangles, and how
    far each vertex moved, `change` (v,) m."""

    surface: Surface
    before: Surface
    change: Reals


def faired(surface: Surface, radius: float) -> Faired:
    """The surface nearest to the given one that is curved nowhere to less than `radius`, m; coarse
    meshes are refined to show it.

    Raises InputError for a radius that isn't positive, larger than the surface or too small for a mesh of
    reasonable size, and NotConverged where no near surface keeps it.
    """
    require_number(
        radius, above=0.0, where="fair", give="the tightest curvature's radius in metres, such as 0.2"
    )
    side = surface.longer_side
    if radius > side:
        raise InputError(
            f"is more than the surface's size of {side:.3g} m: rounded so far it would be another one",
            where="fair",
            value=radius,
            remedy="Give a smaller radius, or draw the surface anew.",
        )
    refusals: list[NotConverged] = []
    for start, fit, radii in _attempts(surface, radius):
        try:
            return _rounded(start, fit, radii)
        except NotConverged as error:
            refusals.append(error)
    raise refusals[0]  # how it ends on the fine mesh, all of it capped, without stages


def _attempts(surface: Surface, radius: float) -> Iterator[tuple[Surface, Quadratics, list[float]]]:
    """Meshes of the surface, what of each is capped, and the radii, m, to which it is rounded in turn."""
    for start in _meshes(surface, radius):
        fits: list[Quadratics] = []
        for chosen in (np.ones(len(start.vertices), dtype=bool), ~_on_ground(start)):
            fits.append(Quadratics(start, chosen))
            yield start, fits[-1], [radius]
        for fit in fits if len(start.vertices) <= _STAGED else ():
            yield start, fit, _stages(start, fit, radius)


def _meshes(surface: Surface, radius: float) -> Iterator[Surface]:
    """The surface with sides that show the radius, m, and with coarser ones, unless it is as fine itself."""
    fine = _refined(surface, _MESH * radius)
    yield fine
    coarse = _refined(surface, _COARSE * radius)
    if len(coarse.vertices) < len(fine.vertices):
        yield coarse


def _stages(start: Surface, fit: Quadratics, radius: float) -> list[float]:
    """The radii, m, to which the surface is rounded one after the other."""
    kept = 1.0 / max(fit.most(start.vertices, rough_normals(start.vertices, start.triangles)), 1e-300)
    first = max(_FIRST * radius, kept)
    count = max(math.ceil(math.log(radius / first) / math.log(_GROWTH)), 0) if first < radius else 0
    return [*(first * _GROWTH**k for k in range(count)), radius]


def _rounded(start: Surface, fit: Quadratics, radii: Sequence[float]) -> Faired:
    """The nearest surface that keeps the cap of the last of the `radii`, m, where it is fitted, rounded to
    each of them in turn. Raises NotConverged."""
    at, weight, faces = start.vertices, _weights(start), start.triangles
    if fit.most(at, rough_normals(at, faces)) <= 1.0 / radii[-1]:
        return Faired(start, start, np.zeros(len(at)))
    for radius in radii:
        here = start if at is start.vertices else make_surface(at, faces, source=start.source)
        at, most = _at_stage(
            fit, start, here, weight, radius, _ROUNDS if radius == radii[-1] else _STAGE_ROUNDS
        )
        if most * _LOST * radius > 1.0:
            break
    if most > 1.0 / radii[-1]:
        raise NotConverged(
            f"No surface near this one was found that is curved to {radii[-1]:.3g} m or more everywhere: {1.0 / most:.3g} m "
            "is left at one place",
            residual=radii[-1] * most - 1.0,
            iterations=_ROUNDS * _STEPS,
        )
    found = make_surface(at, faces, source=start.source)
    _refuse_ruin(start, found, radii[-1])
    return Faired(found, start, np.linalg.norm(at - start.vertices, axis=1))


def _at_stage(
    fit: Quadratics, start: Surface, here: Surface, weight: Reals, radius: float, rounds: int
) -> tuple[Reals, float]:
    """Places (v, 3) on the way from `here` to those nearest to the `start` that keep the radius, m, after as
    many rounds as help; and the largest curvature, 1/m, there, or the least that was met, where they
    don't."""
    toward = _directions(here, radius)
    before = np.sum((here.vertices - start.vertices) * toward, axis=1)
    place, multiplier = np.zeros(len(toward)), np.zeros((len(fit.fitted), 3))
    best, vain = np.inf, 0
    for _ in range(rounds):
        place, multiplier = _round(fit, here, toward, weight, before, place, multiplier, radius)
        at = here.vertices + place[:, None] * toward
        most = fit.most(at, rough_normals(at, here.triangles))
        vain = 0 if most < _BETTER * best else vain + 1
        best = min(best, most)
        if most <= 1.0 / radius or vain == _VAIN or np.abs(place).max() > radius:
            break
    return at, best


def _round(
    fit: Quadratics,
    here: Surface,
    toward: Reals,
    weight: Reals,
    before: Reals,
    place: Reals,
    multiplier: Reals,
    radius: float,
) -> tuple[Reals, Reals]:
    """The displacements (v,) and multipliers (i, 3) after a number of steps in the frames at `place`;
    `before` (v,), m: how far the vertices had moved along the directions before."""
    at = here.vertices + place[:, None] * toward
    frames = fit.frames(rough_normals(at, here.triangles))
    own, rate = fit.found_by_distance(second, at, frames, toward)
    given = own - (rate @ place).reshape(-1, 3)
    area = radius**4 * weight[fit.fitted]
    weighted = sp.diags_array(np.repeat(area, 3) * np.tile([1.0, 2.0, 1.0], len(area))) @ rate
    off, wavier = fit.found_by_distance(waves, at, frames, toward)
    evened = sp.diags_array(_EVEN * area) @ wavier
    factor = _factored(sp.diags_array(weight) + rate.T @ weighted + wavier.T @ evened)
    held = weight * before + evened.T @ (off[:, 0] - wavier @ place)
    most = _MARGIN / radius
    form, capped = own, _capped(own + multiplier, most)
    for _ in range(_STEPS):
        place = factor.solve(weighted.T @ (capped - multiplier - given).ravel() - held)
        form = given + (rate @ place).reshape(-1, 3)
        mixed = _RELAXED * form + (1.0 - _RELAXED) * capped
        capped = _capped(mixed + multiplier, most)
        multiplier = multiplier + mixed - capped
    return place, multiplier


def _capped(forms: Reals, most: float) -> Reals:
    """The nearest forms (i, 3) whose eigenvalues are between -most and most."""
    mean, apart = principal(forms)
    high, low = np.clip(mean + apart, -most, most), np.clip(mean - apart, -most, most)
    share = 0.5 * (high - low) / np.maximum(apart, 1e-300)
    half = 0.5 * (forms[:, 0] - forms[:, 2])
    middle = 0.5 * (high + low)
    return np.column_stack([middle + share * half, share * forms[:, 1], middle - share * half])


def _directions(surface: Surface, radius: float) -> Reals:
    """Unit directions (v, 3) across the surface: normals smoothed over the radius; level on the ground."""
    points, faces = surface.vertices, surface.triangles
    normals, area = rough_normals(points, faces), vertex_areas(surface.vertices, surface.triangles)
    corner = points[faces]
    count = len(points)
    stiff = sp.csr_array((count, count))
    for k in range(3):
        b, c = faces[:, (k + 1) % 3], faces[:, (k + 2) % 3]
        p, q = corner[:, (k + 1) % 3] - corner[:, k], corner[:, (k + 2) % 3] - corner[:, k]
        half = 0.5 * np.sum(p * q, axis=1) / np.linalg.norm(np.cross(p, q), axis=1)
        half = np.maximum(half, 0.0)  # of blunt triangles too: directions only have to be smooth
        rows, columns = np.concatenate([b, c, b, c]), np.concatenate([b, c, c, b])
        entries = np.concatenate([half, half, -half, -half])
        stiff = stiff + sp.csr_array((entries, (rows, columns)), shape=(count, count))
    smooth = _factored(sp.diags_array(area) + radius**2 * stiff).solve(area[:, None] * normals)
    smooth[_on_ground(surface), 2] = 0.0
    size = np.linalg.norm(smooth, axis=1)[:, None]
    return np.where(size > 0.1, smooth / np.maximum(size, 1e-300), 0.0)


def _factored(matrix: sp.sparray) -> Factor:
    """A symmetric positive definite matrix, factored."""
    lower = sp.csc_array(sp.tril(matrix))
    lower.sort_indices()
    return Symmetric(lower.indptr, lower.indices).factor(lower.data)


def _weights(surface: Surface) -> Reals:
    """Areas (v,), m², at the vertices, those on the ground heavier."""
    area = vertex_areas(surface.vertices, surface.triangles)
    area[_on_ground(surface)] *= _HEAVY
    return area


def _on_ground(surface: Surface) -> Flags:
    """Which vertices (v,) of the edge stand on the ground."""
    level = surface.vertices[:, 2]
    result = np.zeros(len(level), dtype=bool)
    result[np.concatenate(surface.boundary)] = True
    return result & (level <= level.min() + ON_GROUND * np.ptp(level))


def _refined(surface: Surface, longest: float) -> Surface:
    """The surface with triangles cut in four until no edge is longer, m; where that makes too many, only the
    longer edges halved."""
    for every in (True, False):
        points, faces = surface.vertices, surface.triangles
        while True:
            pairs = np.sort(directed_edges(faces), axis=1)
            edges, number = np.unique(pairs, axis=0, return_inverse=True)
            long = np.linalg.norm(points[edges[:, 1]] - points[edges[:, 0]], axis=1) > longest
            if not long.any():
                unchanged = faces is surface.triangles
                return surface if unchanged else make_surface(points, faces, source=surface.source)
            cut = long | every
            if len(points) + np.count_nonzero(cut) > _MOST:
                break
            middle = np.where(cut, len(points) + np.cumsum(cut) - 1, -1)
            points = np.vstack([points, 0.5 * (points[edges[cut, 0]] + points[edges[cut, 1]])])
            faces = _halved(points, faces, middle[number.reshape(3, -1).T])
    raise InputError(
        f"needs triangles of {longest:.3g} m, more than {_MOST} vertices",
        where="fair",
        remedy="Give a larger radius, or a surface with a mesh as even as can be.",
    )


def _halved(points: Reals, faces: Indices, middle: Indices) -> Indices:
    """The triangles (t, 3) that come of `faces` whose edges ab, bc, ca have a vertex in the middle, `middle`
    (f, 3), or none, -1."""
    cut = middle >= 0
    found = [faces[~cut.any(axis=1)]]
    for turn in range(3):  # so that one cut edge is ab, and of two the whole one is ca
        (a, b, c), (ab, bc, ca) = np.roll(faces, -turn, axis=1).T, np.roll(middle, -turn, axis=1).T
        one = (ab >= 0) & (bc < 0) & (ca < 0)
        found += [np.column_stack(each)[one] for each in ((a, ab, c), (ab, b, c))]
        two = (ab >= 0) & (bc >= 0) & (ca < 0)
        across = np.linalg.norm(points[a] - points[bc], axis=1) < np.linalg.norm(
            points[c] - points[ab], axis=1
        )
        first, second = two & across, two & ~across
        found += [np.column_stack((ab, b, bc))[two]]
        found += [np.column_stack(each)[first] for each in ((a, ab, bc), (a, bc, c))]
        found += [np.column_stack(each)[second] for each in ((a, ab, c), (ab, bc, c))]
    (a, b, c), (ab, bc, ca), every = faces.T, middle.T, cut.all(axis=1)
    found += [np.column_stack(each)[every] for each in ((a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca))]
    return np.vstack(found)


def _refuse_ruin(start: Surface, found: Surface, radius: float) -> None:
    """Raises NotConverged where triangles turned over, or much of the surface is gone."""
    old, new = (area_vectors(each.vertices, each.triangles) for each in (start, found))
    what = ""
    if (np.sum(old * new, axis=1) <= 0.0).any():
        what = "folds over"
    elif found.area < _LEFT * start.area:
        what = f"keeps {100.0 * found.area / start.area:.0f} % of its area: it would be another one"
    if what:
        raise NotConverged(
            f"Rounded to {radius:.3g} m the surface {what}",
            residual=float("nan"),
            iterations=_ROUNDS * _STEPS,
        )
