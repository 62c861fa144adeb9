"""The misfit of structures as built, to first order, as a term of a design problem: what errors of making and
building do to the shape becomes worth something beside the perfect structure's own misfit and its cables.

A few structures are drawn once, with every cause of error, and kept while the design changes. At the perfect
structure's equilibrium x, which structure j isn't in, it has the unbalanced forces F_j = f_j(x) - p_j, and
moves by

    X_j = u_j on the degrees of freedom that are held, u_j the places of its supports that are off,
    K X_j = -F_j on the free ones,

K being the perfect structure's tangent. With d the distances from the target the value is the mean m over j
of the misfits q_j = |d + X_j|², and, where that is asked for, k of their standard deviations s. Errors are
drawn in pairs of opposite ones, so that what is linear in them moves the mean nowhere: else the few
structures' own mean would be made up for, and other structures would lie farther off.

The derivative is exact: with G_j = d(value)/dX_j = 2 (1 + k (q_j - m) / s) (d + X_j) / n of n structures, and
K L_j = G_j, the terms -L_j'(dK X_j + dF_j) hold the third derivative of the energy contracted with the sum of
L_j X_j', and the structures' own tangents. Spins don't commute: the derivative of a node's moment m has
-S(m)/2 beside the symmetric tangent, and the nodes of structure j are in no equilibrium.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from shellform.arrays import Reals
from shellform.errors import require_count, require_number
from shellform.gridshell.gridshell import Design, Gridshell
from shellform.gridshell.tolerances import Tolerances
from shellform.problem.problem import LoadCase
from shellform.problem.terms import LoadedDesign, Measurement, Term, distance_squares
from shellform.reliability.drawing import (
    Errors,
    Imperfections,
    built_beams,
    errors_of,
    variables,
)
from shellform.reliability.first_order import Moved, moved_from, solved
from shellform.reliability.perfect import TO_ITS_END, perfect
from shellform.structure.answers.third_derivatives import bilinear, bilinear_by_dof, bilinear_by_rest_length
from shellform.structure.elements.threads import side_by_side
from shellform.structure.solve.assembly import Assembly

PAIRS = 12  # of structures with opposite errors, by which a mean is told
PAIRS_OF_DEVIATIONS = 48  # the same where deviations are added, which few structures tell badly
FIRST = 50_000  # the number from which on they are drawn: neither those that a search tries nor fresh ones


@dataclass(frozen=True, eq=False)
class BuiltMisfit(Term):
    """The mean misfit, m², of structures with some `errors` under the load case `load`, and so many standard
    `deviations` of it, to first order about the perfect structure's equilibrium; their shapes have these
    `imperfections`. The step model takes the perfect structure's misfit's curvature for its own."""

    name = "built_misfit"
    of_shape = True
    load: str
    errors: tuple[Errors, ...]
    imperfections: Imperfections
    deviations: float = 0.0

    def __post_init__(self) -> None:
        require_count(len(self.errors), where="built_misfit.errors", give="at least one structure's errors")
        give = "how many standard deviations are added to the mean, such as 1"
        require_number(self.deviations, least=0.0, where="built_misfit.deviations", give=give)

    def measure(self, at: LoadedDesign) -> Measurement:
        """One value, m². Raises NotConverged where the state isn't stable."""
        assembly = at.assembled().beside()
        moved = moved_from(assembly, at.state, at.load, at.design.present, self.errors, self.imperfections)
        places = at.state.positions - at.shell.target.positions + moved.translations
        value, shares = self._of(places)
        return Measurement(
            np.array([value]),
            late=lambda: self._whole(at, assembly, moved, value, 2.0 * shares * places.transpose(1, 2, 0)),
        )

    def _of(self, places: Reals) -> tuple[float, Reals]:
        """The value at distances (k, n, 3), and its derivative (k,) by each structure's misfit."""
        count = len(places)
        mean, even = float((places**2).sum()) / count, np.full(count, 1.0 / count)
        if self.deviations == 0.0:
            return mean, even
        over = (places**2).sum(axis=(1, 2)) - mean
        deviation = float(np.sqrt((over**2).mean()))
        if deviation == 0.0:
            return mean, even
        return mean + self.deviations * deviation, even * (1.0 + self.deviations * over / deviation)

    def _whole(
        self, at: LoadedDesign, assembly: Assembly, moved: Moved, value: float, by_place: Reals
    ) -> Measurement:
        """With the derivatives, by the structures' places `by_place` (n, 3, k) first."""
        shell, design, state = at.shell, at.design, at.state
        count = len(self.errors)
        right = np.zeros_like(moved.motions)
        right.reshape(-1, 6, count)[:, :3] = by_place
        by_dof = right.sum(axis=1)
        multipliers = solved(assembly, state, right)
        rate = shell.beams_by_radius(design.radius)
        by_rest = bilinear_by_rest_length(assembly.cables[0], state, multipliers, moved.motions)
        by_radius = bilinear(rate, state, multipliers, moved.motions)
        by_dof -= bilinear_by_dof(assembly, state, multipliers, moved.motions)

        def own(number: int) -> tuple[Reals, Reals, float]:
            """What a structure's own forces at the state add to L'F by the state, the rest lengths and the
            radius."""
            built, errors = moved.structures[number], self.errors[number]
            factor = multipliers[:, number].reshape(-1, 6)
            change = built.force_along(state, factor)
            turning = built.evaluate(state, tangent=False).force[:, 3:]
            change[:, 3:] -= 0.5 * np.cross(factor[:, 3:], turning)
            (cables,) = built.cables
            pulls = (factor.ravel()[cables.dofs()] * cables.force_by_rest_length(state)).sum(axis=1)
            beams = built_beams(rate, errors, self.imperfections)
            stiffer = beams.evaluate(state, tangent=False).force
            return change.ravel(), pulls, float((factor.ravel()[beams.dofs()] * stiffer).sum())

        for change, pulls, stiffer in side_by_side(own, list(range(count))):
            by_dof -= change
            by_rest = by_rest + pulls
            by_radius += stiffer
        return Measurement(
            np.array([value]),
            sp.csr_array(by_dof[None]),
            sp.csr_array(design.among_candidates(-by_rest)[None]),
            np.array([-by_radius]),
            squares=distance_squares(at),
        )


def built_misfit(
    shell: Gridshell,
    start: Design,
    case: LoadCase,
    tolerances: Tolerances,
    *,
    seed: int,
    pairs: int | None = None,
    deviations: float = 0.0,
) -> BuiltMisfit:
    """The term for so many pairs of structures (None: PAIRS, or PAIRS_OF_DEVIATIONS where `deviations` are
    added) drawn with the `tolerances` under the `seed`; imperfections of shape follow the softest modes of
    the `start` under the load `case`. Raises InputError for no pairs, NotConverged where the start has no
    unloaded equilibrium."""
    if pairs is None:
        pairs = PAIRS_OF_DEVIATIONS if deviations else PAIRS
    require_count(pairs, where="built_misfit.pairs", give=f"pairs of structures, such as {PAIRS}")
    nominal = perfect(shell, start, case.force, step=TO_ITS_END)
    errors = []
    for number in range(FIRST, FIRST + pairs):
        z = variables(nominal.members, seed, number)
        for sign in (1.0, -1.0):
            own = {name: sign * value for name, value in z.items()}
            errors.append(errors_of(nominal.members, tolerances, own))
    return BuiltMisfit(case.name, tuple(errors), nominal.imperfections, deviations)
