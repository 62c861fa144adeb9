"""A second-order update that turns chords instead of stretching them.

A step of Newton's kind moves nodes along straight lines; a beam of length l whose chord turns by t grows by l
t²/2, and slender rods answer with an axial force of EA t²/2 that dwarfs everything else: steps would have to
be tiny. After each step the new chord ought to be

    d_new = (l + s) (cos t e + sin t n),

with e the old direction, s the axial part of the step and t n its lateral part over l. The correction c of
the node positions that comes nearest to all new chords, in the sense of least squares weighted by EA / l0,
solves L c = B' w (d_new - d - Dd) with the weighted graph Laplacian L of the beams, the same in every step
and for each axis but for the supports, so that it is factorised once. It is of second order in the step, so
that nothing changes in the limit.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from shellform.arrays import Indices, Reals
from shellform.compiled import njit
from shellform.structure.elements.beam import Beams
from shellform.structure.elements.state import State
from shellform.structure.solve.factorisation import Factor, Symmetric

_ANCHOR = 1e-9  # of the largest weight, holds what no support holds


class ChordKeeper:
    """The correction for the beams among the parts of a model, for its free degrees of freedom `free`."""

    def __init__(self, count: int, beams: list[Beams], free: Indices) -> None:
        self.ends = np.vstack([part.ends for part in beams]) if beams else np.zeros((0, 2), dtype=np.int64)
        if not len(self.ends):
            return
        weight = self.weight = np.concatenate([part.axial / part.rest_length for part in beams])
        rows = np.arange(len(self.ends))
        incidence = sp.coo_array(
            (np.repeat([-1.0, 1.0], len(rows)), (np.tile(rows, 2), self.ends.T.ravel())),
            shape=(len(rows), count),
        ).tocsr()
        laplacian = sp.csc_array(sp.csr_array(incidence.T.tocsr() * weight) @ incidence)
        # Axes with the same supports share a factor; with pinned supports all three do.
        nodes_of = [free[free % 6 == axis] // 6 for axis in range(3)]
        together: list[list[int]] = []
        for axis, nodes in enumerate(nodes_of):
            same = next((group for group in together if np.array_equal(nodes_of[group[0]], nodes)), None)
            together.append([axis]) if same is None else same.append(axis)
        self.axes: list[tuple[Indices, Indices, Factor]] = []
        for group in together:
            nodes = nodes_of[group[0]]
            block = sp.csc_array(
                sp.tril(laplacian[nodes][:, nodes] + _ANCHOR * weight.max() * sp.eye_array(len(nodes)))
            )
            block.sort_indices()
            family = Symmetric(block.indptr.astype(np.int64), block.indices.astype(np.int64))
            self.axes.append((nodes, np.array(group), family.factor_thin(block.data)))

    def largest_turn(self, before: State, after: State) -> float:
        """The largest angle, rad, between a beam's chord in one state and in the other."""
        one, two = (
            each.positions[self.ends[:, 1]] - each.positions[self.ends[:, 0]] for each in (before, after)
        )
        across, along = np.linalg.norm(np.cross(one, two), axis=1), (one * two).sum(axis=1)
        return float(np.arctan2(across, along).max(initial=0.0))

    def halved(self, before: State, after: State) -> bool:
        """Whether a beam of one state has less than half its length, or is reversed, in the other."""
        one, two = (
            each.positions[self.ends[:, 1]] - each.positions[self.ends[:, 0]] for each in (before, after)
        )
        return bool(((one * two).sum(axis=1) < 0.5 * (one * one).sum(axis=1)).any())

    def corrected(self, state: State, step: Reals) -> Reals:
        """The step (n, 6) with its translations corrected."""
        if not len(self.ends):
            return step
        right = np.zeros((len(step), 3))
        _pull(state.positions, step, self.ends, self.weight, right)
        result = step.copy()
        for nodes, group, factor in self.axes:
            result[np.ix_(nodes, group)] += factor.solve(right[np.ix_(nodes, group)])
        return result


@njit(cache=True, error_model="numpy")
def _pull(positions, step, ends, weight, right):  # type: ignore[no-untyped-def]
    """Adds B' w (d_new - d - Dd) to `right` (n, 3)."""
    for e in range(len(ends)):
        a, b = ends[e, 0], ends[e, 1]
        dx, dy, dz = (
            positions[b, 0] - positions[a, 0],
            positions[b, 1] - positions[a, 1],
            positions[b, 2] - positions[a, 2],
        )
        cx, cy, cz = step[b, 0] - step[a, 0], step[b, 1] - step[a, 1], step[b, 2] - step[a, 2]
        l = np.sqrt(dx * dx + dy * dy + dz * dz)
        ex, ey, ez = dx / l, dy / l, dz / l
        s = ex * cx + ey * cy + ez * cz
        # t n, and the turn t
        x, y, z = (cx - s * ex) / l, (cy - s * ey) / l, (cz - s * ez) / l
        t = np.sqrt(x * x + y * y + z * z)
        along = (l + s) * np.cos(t)
        across = (l + s) * (np.sin(t) / t if t > 0.0 else 1.0)
        x = weight[e] * (along * ex + across * x - dx - cx)
        y = weight[e] * (along * ey + across * y - dy - cy)
        z = weight[e] * (along * ez + across * z - dz - cz)
        right[b, 0] += x
        right[b, 1] += y
        right[b, 2] += z
        right[a, 0] -= x
        right[a, 1] -= y
        right[a, 2] -= z
