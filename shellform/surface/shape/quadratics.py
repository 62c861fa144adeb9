"""Quadratics fitted to the two rings of neighbours of a surface's vertices: how it is curved there, and the
waves as short as the mesh's sides that such a fit doesn't show.

In a vertex' frame (u, v, n) both are linear in the neighbours' heights n · (x_j - x_i), and so, while the
frames stay, in how far vertices move along given directions (fairing.py).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import scipy.sparse as sp

from shellform.arrays import Flags, Indices, Reals
from shellform.surface.shape.target import Surface
from shellform.surface.shape.triangles import directed_edges

Measure = Callable[[Reals], Reals]


class Quadratics:
    """Quadratics through the neighbours of the vertices `fitted` (i,), those `chosen` (v,) that have enough
    of them: how what they say follows from places. That is linear in the neighbours' heights, with
    coefficients (i, c, k) that a `measure` makes of their own coordinates (i, k, 3)."""

    def __init__(self, surface: Surface, chosen: Flags) -> None:
        count, faces = len(surface.vertices), surface.triangles
        pairs = directed_edges(faces)
        ones = np.ones(len(pairs))
        next_to = sp.csr_array((ones, (pairs[:, 0], pairs[:, 1])), shape=(count, count))
        next_to = sp.csr_array(next_to + next_to.T)
        near = sp.csr_array(next_to @ next_to + next_to)
        near.setdiag(0.0)
        near.eliminate_zeros()
        size = np.diff(near.indptr)
        self.fitted: Indices = np.flatnonzero((size >= 6) & chosen)
        self.count = count
        # Vertices with equally many neighbours are fitted together.
        self._groups = [
            (which, near.indices[near.indptr[self.fitted[which]][:, None] + np.arange(k)])
            for k in np.unique(size[self.fitted])
            if len(which := np.flatnonzero(size[self.fitted] == k))
        ]
        self._order = np.argsort(np.concatenate([which for which, _ in self._groups]))

    def frames(self, normals: Reals) -> Reals:
        """Axes (i, 3, 3) u, v, n as rows at the fitted vertices, from the normals (v, 3) of all."""
        n = normals[self.fitted]
        least = np.eye(3)[np.argmin(np.abs(n), axis=1)]
        u = np.cross(least, n)
        u /= np.linalg.norm(u, axis=1)[:, None]
        return np.stack([u, np.cross(n, u), n], axis=1)

    def found(self, measure: Measure, at: Reals, frames: Reals) -> Reals:
        """What is measured (i, c) of places (v, 3)."""
        return self._in_order([found for _, _, _, found in self._measured(measure, at, frames)])

    def found_by_distance(
        self, measure: Measure, at: Reals, frames: Reals, toward: Reals
    ) -> tuple[Reals, sp.csr_array]:
        """What is measured (i, c) of places (v, 3), and its derivatives (c i, v) by distances that vertices
        move along `toward` (v, 3), at fixed frames."""
        parts, rows, columns, values = [], [], [], []
        for which, near, fit, found in self._measured(measure, at, frames):
            here = self.fitted[which]
            parts.append(found)
            risen = np.einsum("ib,ikb->ik", frames[which, 2], toward[near])
            self_risen = np.einsum("ib,ib->i", frames[which, 2], toward[here])
            kinds = fit.shape[1]
            row = kinds * which[:, None] + np.arange(kinds)
            rows += [np.broadcast_to(row[:, :, None], fit.shape).ravel(), row.ravel()]
            columns += [np.broadcast_to(near[:, None, :], fit.shape).ravel(), np.repeat(here, kinds)]
            values += [(fit * risen[:, None, :]).ravel(), (-fit.sum(axis=2) * self_risen[:, None]).ravel()]
        entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
        shape = kinds * len(self.fitted), self.count
        return self._in_order(parts), sp.csr_array(entries, shape=shape)

    def _measured(
        self, measure: Measure, at: Reals, frames: Reals
    ) -> Iterator[tuple[Indices, Indices, Reals, Reals]]:
        """Of vertices that are fitted together which they are (g,), their neighbours (g, k), the measure's
        coefficients (g, c, k) and what it comes to (g, c)."""
        for which, near in self._groups:
            own = np.einsum("iab,ikb->ika", frames[which], at[near] - at[self.fitted[which], None])
            fit = measure(own)
            yield which, near, fit, np.einsum("ick,ik->ic", fit, own[..., 2])

    def _in_order(self, parts: list[Reals]) -> Reals:
        """What was found group by group, as the fitted vertices stand."""
        return np.asarray(np.concatenate(parts)[self._order])

    def most(self, at: Reals, normals: Reals) -> float:
        """The largest principal curvature, 1/m."""
        mean, apart = principal(self.found(second, at, self.frames(normals)))
        return float((np.abs(mean) + apart).max(initial=0.0))


def second(own: Reals) -> Reals:
    """C (i, 3, k): II_uu, II_uv, II_vv, 1/m, of the best quadratic through the vertex from the heights of
    neighbours at own coordinates (i, k, 3)."""
    columns, reach = _quadratics(own)
    return np.linalg.pinv(columns, rcond=1e-6)[:, 2:] / reach[:, :, None] ** 2


def waves(own: Reals) -> Reals:
    """(i, 1, k): the height at the vertex of the best quadratic from those of neighbours at own coordinates
    (i, k, 3), over their mean squared distance, 1/m."""
    columns, _ = _quadratics(own)
    through = np.concatenate([np.ones_like(columns[..., :1]), columns], axis=2)
    apart = np.mean(np.sum(own[..., :2] ** 2, axis=2), axis=1)
    return np.linalg.pinv(through, rcond=1e-3)[:, :1] / apart[:, None, None]


def _quadratics(own: Reals) -> tuple[Reals, Reals]:
    """x, y, x²/2, xy, y²/2 (i, k, 5) of neighbours at own coordinates (i, k, 3), m, over how far they reach
    (i, 1), m."""
    reach = np.abs(own[..., :2]).max(axis=(1, 2))[:, None]
    x, y = own[..., 0] / reach, own[..., 1] / reach
    return np.stack([x, y, 0.5 * x * x, x * y, 0.5 * y * y], axis=2), reach


def principal(forms: Reals) -> tuple[Reals, Reals]:
    """Mean of the two principal curvatures (i,) and half their difference."""
    mean = 0.5 * (forms[:, 0] + forms[:, 2])
    return mean, np.hypot(0.5 * (forms[:, 0] - forms[:, 2]), forms[:, 1])
