"""Answers to a step as dense matrices, all from one block solve with the factor of K (Woodbury).

Its time goes with the cube of the number of cables and its memory with the square: for thousands of them
solved_answers.py serves. X itself, a dense matrix of all degrees of freedom, is never kept: its columns are
solved for in blocks, of which only what the model needs stays.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from shellform.arrays import Reals, Record
from shellform.optimiser.step_setting import Quadratic, Setting
from shellform.problem.terms import Squares
from shellform.structure.elements.state import State
from shellform.structure.solve.assembly import Assembly
from shellform.structure.solve.factorisation import column_blocks


@dataclass(frozen=True, eq=False)
class WholeAnswers(Record):
    """Answers in the `setting` from `length_by_y` (c, y), `variables_by_y` (s, y), `parameters_by_y` (p, y);
    `middle` (n, y), the changes of tension that make K's answer to them K_t's; `quadratics` of sums of
    squares."""

    setting: Setting
    length_by_y: Reals
    variables_by_y: Reals
    parameters_by_y: Reals
    middle: Reals
    quadratics: Sequence[Quadratic]

    def lengthened(self, change: Reals) -> Reals:
        """The cables' changes (c,), m."""
        return np.asarray(self.length_by_y @ change)

    def moved(self, change: Reals) -> Reals:
        """The free degrees of freedom's changes (f,)."""
        at = self.setting
        force = at.right @ change + at.right[:, : at.tensions] @ (self.middle @ change)
        return np.asarray(-at.assembly.factor(at.state).solve(force))

    def parameters_changed(self, change: Reals) -> Reals:
        """The changes (p,), m, of the present rest lengths and, where it moves, the radius."""
        return np.asarray(self.parameters_by_y @ change)

    def by_variables(self, rows: Reals) -> Reals:
        """(k, y) from (k, s), or (y,) from (s,)."""
        return np.asarray(rows @ self.variables_by_y)

    def by_parameters(self, rows: Reals) -> Reals:
        """(k, y) from (k, p)."""
        return np.asarray(rows @ self.parameters_by_y)

    def of_rest_lengths(self, changes: Reals) -> Reals:
        """The changes (y, g) with which rest lengths change as said, (c, g); where y is tensions alone."""
        return np.asarray(np.linalg.solve(self.parameters_by_y, changes))


def whole_answers(at: Setting, residuals: Sequence[Squares]) -> WholeAnswers:
    """The answers in the setting, for these sums of squares."""
    shell, blocks, count = at.evaluator.shell, at.evaluator.blocks, at.tensions
    coupling, moved_by = _solved(
        at.assembly, at.state, at.pull, at.right, [each.by_dof for each in residuals]
    )
    # K_t⁻¹ R = K⁻¹ R + K⁻¹ B (I - D B' K⁻¹ B)⁻¹ D B' K⁻¹ R, for R the pulls and the others' forces alike.
    stiffness = at.stiffness
    middle: Reals = np.asarray(
        np.linalg.solve(
            np.eye(count) - stiffness[:, None] * coupling[:, :count], stiffness[:, None] * coupling
        )
    )
    length_by_y = -(coupling + coupling[:, :count] @ middle)
    values_by_y = np.zeros((blocks.size, at.right.shape[1]))
    if at.each is not None:
        ea = shell.cable.stiffness
        rest_by_y = (ea / (ea + at.tension))[:, None] * length_by_y
        rest_by_y[:, :count] -= np.diag(ea * at.length / (ea + at.tension) ** 2)
        # A dead cable at its longest stays there until it is given tension, which its own column then asks
        # for at full length.
        values_by_y[at.each.start + at.present] = rest_by_y
    values_by_y[at.other, count:] = np.eye(int(at.other.sum()))
    return WholeAnswers(
        at,
        length_by_y,
        values_by_y / blocks.unit[:, None],
        np.asarray(at.parameters @ values_by_y),
        middle,
        _quadratics(residuals, moved_by, middle),
    )


def _quadratics(
    residuals: Sequence[Squares], moved_by: Sequence[tuple[np.ndarray, Reals]], middle: Reals
) -> list[Quadratic]:
    """Of residuals of which those numbered (m,) move, by Q K⁻¹ R (m, y)."""
    # K_t⁻¹ R = K⁻¹ R T with T = I + (middle; 0), so that X'X = T' (K⁻¹ R)' (K⁻¹ R) T.
    whole = np.eye(middle.shape[1])
    whole[: len(middle)] += middle
    return [
        Quadratic(
            -2.0 * (squares.residual[rows] @ by_force) @ whole,
            2.0 * whole.T @ (by_force.T @ by_force) @ whole,
        )
        for squares, (rows, by_force) in zip(residuals, moved_by, strict=True)
    ]


def _solved(
    assembly: Assembly, state: State, pull: sp.csc_array, right: sp.csc_array, residuals: list[sp.csr_array]
) -> tuple[Reals, list[tuple[np.ndarray, Reals]]]:
    """B' K⁻¹ R (c, y), and for each kind of residuals the numbers (m,) of those that move and their Q K⁻¹ R
    (m, y)."""
    factor = assembly.factor(state)
    coupling = np.empty((pull.shape[1], right.shape[1]))
    moved_by = []
    for by_dof in residuals:
        rows = sp.csr_array(by_dof.tocsc()[:, assembly.free])
        moving = np.flatnonzero(np.diff(rows.indptr))
        moved_by.append((moving, rows[moving], np.empty((len(moving), right.shape[1]), order="F")))
    for own in column_blocks(right.shape[1], right.shape[0]):
        solved = factor.solve(np.asfortranarray(right[:, own].toarray()))
        coupling[:, own] = pull.T @ solved
        for _, rows, result in moved_by:
            result[:, own] = rows @ solved
    return coupling, [(moving, result) for moving, _, result in moved_by]
