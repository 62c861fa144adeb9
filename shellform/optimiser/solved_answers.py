"""Answers to a step, each by a solve with K_t when it is asked for: for thousands of cables.

K_t = K - B D B' is the tangent without the stiffness of the taut cables along them, as sparse as K; it may
have lost definiteness, and is factorised all the same (eased_cables.py). Then

    dx = -K_t⁻¹ R dy,   dl = B' dx,   and chained backwards   a' dl/dy = -(K_t⁻¹ B a)' R,

one solve for a direction or for a measure, however many cables there are. The Gauss-Newton matrix H = 2 (Q
X)'(Q X) is what a soft structure makes it: few shapes move much. From products with r random directions Ω,
two solves each, it comes as Y (Ω'Y)⁻¹ Y' with Y = H Ω (Nyström's approximation; Tropp, Yurtsever, Udell and
Cevher 2017): positive semidefinite, never above H, and exact where H has no more than r shapes. What it
leaves out bends the objective less than its least shape kept does; slopes and constraints are exact as
before.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from shellform.arrays import Reals
from shellform.optimiser.quadratic import LowRank
from shellform.optimiser.step_setting import Quadratic, Setting
from shellform.problem.terms import Squares
from shellform.structure.elements.cable import Cables
from shellform.structure.elements.eased_cables import EasedCables
from shellform.structure.solve.factorisation import Factor, NotPositiveDefinite, Symmetric

_SHAPES = 256  # r
_AT_ONCE = 64  # columns solved for at once: 256 MB at 500,000 degrees of freedom
_SEED = 17  # of the sample: the same model each time
_NOTHING = 1e-10  # of the largest: what rounding leaves


@dataclass(frozen=True, eq=False)
class SolvedAnswers:
    """Answers in the `setting` by the `factor` of K_t; `quadratics` of sums of squares."""

    setting: Setting
    factor: Factor
    quadratics: Sequence[Quadratic] = ()

    def lengthened(self, change: Reals) -> Reals:
        """The cables' changes (c,), m."""
        return np.asarray(self.setting.pull.T @ self.moved(change))

    def moved(self, change: Reals) -> Reals:
        """The free degrees of freedom's changes (f,)."""
        return -self.factor.solve(self.setting.right @ change)

    def parameters_changed(self, change: Reals) -> Reals:
        """The changes (p,), m, of the present rest lengths and, where it moves, the radius."""
        at = self.setting
        values = np.zeros(at.evaluator.blocks.size)
        values[at.other] = change[at.tensions :]
        if at.each is not None:
            ea = at.evaluator.shell.cable.stiffness
            longer = (ea / (ea + at.tension)) * self.lengthened(change)
            tensed = ea * at.length / (ea + at.tension) ** 2 * change[: at.tensions]
            values[at.each.start + at.present] = longer - tensed
        return np.asarray(at.parameters @ values)

    def by_variables(self, rows: Reals) -> Reals:
        """(k, y) from (k, s), or (y,) from (s,)."""
        found = self._by_values(np.atleast_2d(rows) / self.setting.evaluator.blocks.unit)
        return found if rows.ndim > 1 else found[0]

    def by_parameters(self, rows: Reals) -> Reals:
        """(k, y) from (k, p)."""
        return self._by_values(np.asarray(rows @ self.setting.parameters))

    def quadratic(self, squares: Squares) -> Quadratic:
        """Of a sum of squares under the design load."""
        rows = sp.csr_array(squares.by_dof.tocsc()[:, self.setting.assembly.free])
        return Quadratic(2.0 * self._back(np.asarray(rows.T @ squares.residual)), self._low_rank(rows))

    def _by_values(self, rows: Reals) -> Reals:
        """(k, y) from derivatives (k, s) by the values, in their own units."""
        at = self.setting
        result = np.zeros((len(rows), at.right.shape[1]))
        result[:, at.tensions :] = rows[:, at.other]
        if at.each is None:
            return result
        ea = at.evaluator.shell.cable.stiffness
        own = rows[:, at.each.start + at.present]
        for first in range(0, len(rows), _AT_ONCE):
            some = slice(first, first + _AT_ONCE)
            result[some] += self._back(np.asarray(at.pull @ (own[some] * (ea / (ea + at.tension))).T)).T
        result[:, : at.tensions] -= own * (ea * at.length / (ea + at.tension) ** 2)
        return result

    def _back(self, by_state: Reals) -> Reals:
        """X' (y, ...) of derivatives (f, ...) by the free degrees of freedom."""
        return np.asarray(-(self.setting.right.T @ self.factor.solve(np.asfortranarray(by_state))))

    def _low_rank(self, rows: sp.csr_array) -> LowRank:
        """2 (Q X)'(Q X) for residuals that move by `rows` (m, f), in directions of y that matter alike."""
        at, size = self.setting, self.setting.right.shape[1]
        unit = np.ones(size)
        unit[: at.tensions] = float(at.tension[at.tension > 0.0].mean()) if (at.tension > 0.0).any() else 1.0
        unit[at.tensions :] = at.evaluator.blocks.step(at.point.design)[at.other]
        count = min(_SHAPES, size)
        sample = np.linalg.qr(np.random.default_rng(_SEED).normal(size=(size, count)))[0]
        images = np.empty((size, count))
        for first in range(0, count, _AT_ONCE):
            some = slice(first, min(first + _AT_ONCE, count))
            moved = rows @ self.factor.solve(np.asfortranarray(at.right @ (unit[:, None] * sample[:, some])))
            images[:, some] = unit[:, None] * -self._back(2.0 * np.asarray(rows.T @ moved))
        middle = sample.T @ images
        values, turned = np.linalg.eigh(0.5 * (middle + middle.T))
        kept = values > _NOTHING * values[-1]
        return LowRank((images @ turned[:, kept]) / np.sqrt(values[kept]) / unit[:, None])


def solved_answers(at: Setting, residuals: Sequence[Squares]) -> SolvedAnswers:
    """The answers in the setting, for these sums of squares."""
    parts = [EasedCables(part) if isinstance(part, Cables) else part for part in at.assembly.parts]
    values = at.assembly.with_parts(parts).evaluate(at.state).tangent
    assert values is not None
    # a family of its own, whose factor serves as long as the model does
    family = Symmetric(at.assembly.matrix.indptr, at.assembly.matrix.indices)
    try:
        factor: Factor = family.factor(values)
    except NotPositiveDefinite:
        factor = family.factor_indefinite(values)
    answers = SolvedAnswers(at, factor)
    return replace(answers, quadratics=[answers.quadratic(each) for each in residuals])
