"""A convex model of the design problem in the cables' tensions.

Near an equilibrium under the base load, let the tensions t of all candidate cables and the rod radius r vary
instead of the rest lengths. With the tensions given, cables have no stiffness of their own; with B = ∂f/∂t
(each cable's unit pull on its ends), D = EA/l0 of the taut cables and K = K_t + B D B' the tangent, the state
answers by

    X = dx/dt = -K_t⁻¹ B = -K⁻¹ B (I - D B' K⁻¹ B)⁻¹,     dx/dr = -K_t⁻¹ ∂f/∂r,

all from one block solve with the factor of K (Woodbury). The cables' lengths follow as dl = B' dx, and a rest
length of

    l0 = EA l / (EA + t)

gives the tension t at length l. In these variables the problem is nearly convex: the sum of tensions is
linear and a cable dies exactly at t = 0, a bound instead of a kink; the misfit d'd is quadratic with the
Gauss-Newton matrix X'X; limits on cable forces are bounds too. X itself, a dense matrix of all degrees of
freedom, is never kept: its columns are solved for in blocks, of which only what the model needs stays, the
cables' lengths and the translations for X'X. Measured on a shell of 10,000 degrees of freedom, the model predicts
the change of the objective to within 2 % at the first step and 0.5 % later, where a separable model in the
rest lengths had to stop after steps a hundred times smaller.

A cable without tension gets the longest rest length allowed, so that it doesn't quietly help under other
loads; it can come back.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from shellform.arrays import Flags, Reals
from shellform.gridshell.gridshell import Design, Gridshell
from shellform.problem.problem import Point
from shellform.structure.answers.sensitivity import element_columns
from shellform.structure.elements.state import State, moved
from shellform.structure.solve.assembly import Assembly

_BLOCK = 256  # columns solved for at once
_DEAD = 1e-6  # of the cables' stiffness: a tension below it counts as none


@dataclass(frozen=True)
class TensionModel:
    """The model at a point, in y = (tensions (c,), N, of the present cables; radius, m, where it is free).

    `origin` (y,); `length` (c,), m, and `length_by_y` (c, y); `variables_by_y` (s, y) of the problem's
    variables; `misfit_by_y` (y,) and `misfit_hessian` (y, y), the slope and the Gauss-Newton matrix of d'd,
    m²; `pull` (f, y), the forces on the free degrees of freedom by y, and `middle` (c, y), the changes of
    tension that make K's answer to them K_t's.
    """

    shell: Gridshell
    assembly: Assembly
    point: Point
    state: State
    longest: Reals
    origin: Reals
    length: Reals
    length_by_y: Reals
    variables_by_y: Reals
    misfit_by_y: Reals
    misfit_hessian: Reals
    pull: sp.csc_array
    middle: Reals

    def rest_lengths(self, y: Reals) -> Reals:
        """Rest lengths (c,), m, that the model gives to the tensions of y."""
        count = len(self.length)
        stiffness = self.shell.cable.stiffness
        tension = y[:count]
        length = self.length + self.length_by_y @ (y - self.origin)
        return np.where(tension > _DEAD * stiffness, stiffness * length / (stiffness + tension), self.longest)

    def design(self, y: Reals, present: Flags) -> Design:
        """The design of y."""
        rest = self.point.design.rest_length.copy()
        rest[present] = np.minimum(self.rest_lengths(y), self.longest)
        radius = float(y[-1]) if len(y) > len(self.length) else self.point.design.radius
        return Design(rest, self.point.design.present, radius)

    def predicted(self, y: Reals) -> State:
        """Where the change to y takes the base load's equilibrium, to first order."""
        whole = np.zeros(6 * self.assembly.count)
        change = y - self.origin
        force = self.pull @ change + self.pull[:, : len(self.length)] @ (self.middle @ change)
        whole[self.assembly.free] = -self.assembly.factor(self.state).solve(force)
        return moved(self.state, self.assembly.chords.corrected(self.state, whole.reshape(-1, 6)))


def tension_model(
    shell: Gridshell, assembly: Assembly, point: Point, state: State, longest: Reals, *, frees_radius: bool
) -> TensionModel:
    """The model at the point, `state` being its equilibrium under the base load and `longest` (c,), m, the
    upper bounds of the present cables' rest lengths."""
    design = point.design
    cables = shell.cables(design)
    count = len(cables.ends)
    chord = state.positions[cables.ends[:, 1]] - state.positions[cables.ends[:, 0]]
    length = np.linalg.norm(chord, axis=1)
    unit = chord / length[:, None]
    pull = element_columns(assembly, cables.dofs(), np.hstack([-unit, unit]))

    right = pull
    if frees_radius:
        rate = shell.beams_by_radius(design.radius)
        change = np.zeros(6 * assembly.count)
        np.add.at(change, rate.dofs(), rate.evaluate(state, tangent=False).force)
        right = sp.csc_array(sp.hstack([pull, sp.csc_array(change[assembly.free][:, None])]))
    tension = cables.tension(state)
    stiffness = np.where(tension > 0.0, cables.stiffness / cables.rest_length, 0.0)
    coupling, moved_by = _solved(assembly, state, pull, right)
    # K_t⁻¹ R = K⁻¹ R + K⁻¹ B (I - D B' K⁻¹ B)⁻¹ D B' K⁻¹ R, for R the pulls and the radius' forces alike.
    middle: Reals = np.asarray(
        np.linalg.solve(
            np.eye(count) - stiffness[:, None] * coupling[:, :count], stiffness[:, None] * coupling
        )
    )
    length_by_y = -(coupling + coupling[:, :count] @ middle)
    # K_t⁻¹ R = K⁻¹ R T with T = I + (middle; 0), so that X'X = T' (K⁻¹ R)' (K⁻¹ R) T.
    whole = np.eye(right.shape[1])
    whole[:count] += middle
    away = (state.positions - shell.target.positions).ravel()
    free = assembly.free[assembly.free % 6 < 3]
    misfit_by_y = -2.0 * (away[3 * (free // 6) + free % 6] @ moved_by) @ whole
    misfit_hessian = 2.0 * whole.T @ (moved_by.T @ moved_by) @ whole

    ea = shell.cable.stiffness
    rest_by_y = (ea / (ea + tension))[:, None] * length_by_y
    rest_by_y[:, :count] -= np.diag(ea * length / (ea + tension) ** 2)
    # A dead cable at its longest stays there until it is given tension, which its own column then asks for at
    # full length.
    present = np.flatnonzero(design.present)
    size = len(point.variables)
    variables_by_y = np.zeros((size, right.shape[1]))
    variables_by_y[present] = rest_by_y / shell.cable_lengths[present, None]
    if frees_radius:
        variables_by_y[-1, -1] = point.variables[-1] / design.radius
    origin = np.append(tension, design.radius) if frees_radius else tension
    return TensionModel(
        shell,
        assembly,
        point,
        state,
        longest,
        origin,
        length,
        length_by_y,
        variables_by_y,
        misfit_by_y,
        misfit_hessian,
        right,
        middle,
    )


def _solved(assembly: Assembly, state: State, pull: sp.csc_array, right: sp.csc_array) -> tuple[Reals, Reals]:
    """B' K⁻¹ R (c, y) and the rows of K⁻¹ R (t, y) of the free translations."""
    factor = assembly.factor(state)
    moving = np.flatnonzero(assembly.free % 6 < 3)
    coupling = np.empty((pull.shape[1], right.shape[1]))
    moved_by = np.empty((len(moving), right.shape[1]), order="F")
    for first in range(0, right.shape[1], _BLOCK):
        own = slice(first, min(first + _BLOCK, right.shape[1]))
        solved = factor.solve(np.asfortranarray(right[:, own].toarray()))
        coupling[:, own] = pull.T @ solved
        moved_by[:, own] = solved[moving]
    return coupling, moved_by
