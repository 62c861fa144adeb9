"""How far a state is from equilibrium, how far its elements may turn, what holds a rod that is free to spin,
and Newton's step under dead moments.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse.linalg import LinearOperator, gmres

from shellform.arrays import Reals
from shellform.compiled import njit
from shellform.errors import NotConverged
from shellform.structure.elements.state import State
from shellform.structure.solve.assembly import Assembly, Balance
from shellform.structure.solve.factorisation import Factor

HOLDS = np.radians(170.0)  # largest local rotation that is accepted: at 180 degrees its measure turns back
_UNTOLD = np.radians(90.0)  # of twist, up to which it is not told
OF_LOAD = 1e-6  # of the load, the largest residual that is ever told to be none
_BOUND = 16.0  # times what rounding leaves at most, its bound: of 1,060 random networks 16 to 400
_LEFT = 0.25  # share of what may be told to be none that rounding of the measure itself doesn't take away
_OF_STRESS = 1e-5  # of the largest internal force, the same where there is no load
STAGNANT = 0.1  # ratio of two residuals one after the other: a step that brings less may be down to rounding
_NO_STRESS = 1e-3  # of the largest internal force: above, what rounding leaves is all there is of it
_HELD = 1e-10  # share of a rotation's own stiffness that holds a rod free to spin about its axis
_HELD_EXTENDED = 1e-22  # with twice the digits, where soft rods must not feel how stiff ones are held


class ResidualNorm:
    """Unbalanced forces, moments divided by a length, measured against the largest applied or internal force.

    `arms` (n,), m: that length for each node; `mass_shape` (f,): 1 for free translations
    and the arm's square for free rotations, so that both weigh alike.
    """

    def __init__(self, assembly: Assembly) -> None:
        self.free = assembly.free
        self.arms = assembly.arms
        self._reach = assembly.reach
        self._last_digit = assembly.last_digit
        turns = self.free % 6 >= 3
        self.mass_shape = np.ones(len(self.free))
        self.mass_shape[turns] = self.arms[self.free[turns] // 6] ** 2

    def residual(self, balance: Balance, load: Reals) -> float:
        """Largest unbalanced force over the scale under the dead `load` (n, 6); infinite where a force isn't
        finite.
        """
        largest = float(_largest_difference(load.ravel(), balance.force.ravel(), self.free, self._reach))
        if not np.isfinite(largest):
            return float("inf")
        scale = self.scale(balance, load)
        return largest / scale if scale > 0.0 else 0.0

    def scale(self, balance: Balance, load: Reals) -> float:
        """The largest applied or internal force, N."""
        return max(float(_largest(load.ravel(), self._reach)), balance.largest)

    def rounding(self, balance: Balance, state: State, load: Reals) -> float:
        """The residual that rounding of the coordinates alone leaves: stiff short elements answer to the last
        bit.
        """
        assert balance.tangent is not None
        stiffest = float(balance.tangent.max(initial=0.0))  # on the diagonal
        last_bit = 4.0 * self._last_digit * float(np.abs(state.positions).max(initial=0.0))
        scale = self.scale(balance, load)
        return stiffest * last_bit / scale if scale > 0.0 else 0.0

    def most(self, balance: Balance, load: Reals, tolerance: float) -> float:
        """The largest residual of what is told to be an equilibrium: 1e-6 of the `load` (n, 6), or the
        `tolerance` where it is looser. A structure without load is measured by its own stress: 1e-5 of the
        largest internal force (what double precision leaves of edge beams beside bent laths; a tenth of it
        takes twice the digits).
        """
        applied, scale = float(_largest(load.ravel(), self._reach)), self.scale(balance, load)
        share = max(OF_LOAD, tolerance)
        return share * applied / scale if applied > 0.0 else max(share, _OF_STRESS)

    def balanced(
        self,
        residual: float,
        balance: Balance,
        state: State,
        load: Reals,
        tolerance: float,
        stagnant: bool,
        *,
        whole: Reals | None = None,
    ) -> bool:
        """Whether the residual of a state counts as none: within the tolerance or, where steps have stopped
        to bring anything (`stagnant`), within what rounding leaves, and never above `most`, of the load or,
        on the way to it, of the `whole` (n, 6), less what rounding may hide of the residual itself. A
        structure without load whose forces are all rounding is without stress.
        """
        measured = load if whole is None else whole
        most, noise = self.most(balance, measured, tolerance), self.rounding(balance, state, load)
        if measured.any():
            most = max(most - noise / _BOUND, _LEFT * most)
        if residual <= min(tolerance, most):
            return True
        if not stagnant:
            return False
        return residual <= min(noise, most) or (noise > _NO_STRESS and residual <= noise and not load.any())

    def drowns(
        self, balance: Balance, state: State, load: Reals, tolerance: float, *, surely: bool = False
    ) -> bool:
        """Whether rounding may leave more than the largest residual that may be told to be none; whether it
        does so `surely`, for its bound is sixteen times what it leaves or more."""
        noise = self.rounding(balance, state, load) / (_BOUND if surely else 1.0)
        return bool(noise > self.most(balance, load, tolerance) and (load.any() or noise <= _NO_STRESS))


def overturned(assembly: Assembly, before: State, was: float, after: State, turned: float) -> bool:
    """Whether an element has turned, or may have on the way, beyond what its local rotation is measured for:
    from one state to the other, at which `Balance.turned` was `was` and is `turned`.
    """
    if turned == 0.0:  # more in one step than a chord and nodes together can turn
        return False
    nodes = np.abs(np.einsum("ij,ij->i", before.quaternions, after.quaternions)).min(initial=1.0)
    chord = assembly.chords.largest_turn(before, after)
    return turned > HOLDS or max(was, _UNTOLD) + 4.0 * np.arccos(min(nodes, 1.0)) + chord > np.pi


def check_turned(assembly: Assembly, state: State, balance: Balance, spent: int) -> None:
    """Raises NotConverged naming the element where one has turned beyond what its local rotation is measured
    for.
    """
    if balance.turned <= HOLDS:
        return
    worst = [np.linalg.norm(beams.local_deformations(state)[:, 1:4], axis=1) for beams in assembly.beams]
    worst = [
        np.maximum(near, np.linalg.norm(beams.local_deformations(state)[:, 4:], axis=1))
        for near, beams in zip(worst, assembly.beams, strict=True)
    ]
    beam = int(np.argmax(np.concatenate(worst)))
    raise NotConverged(
        f"beams[{beam}] is turned against its ends by {np.degrees(balance.turned):.0f} degrees",
        state=state,
        iterations=spent,
        remedy="Apply the load in more increments, or divide the rod into more elements.",
    )


class Drowned(NotConverged):
    """The load can't be told from what rounding leaves of stiff elements' forces."""


def drowned(assembly: Assembly, state: State, residual: float, spent: int) -> Drowned:
    """The refusal that names the stiffest elements."""
    names, values = [], []
    for kind, parts in (("beams", assembly.beams), ("cables", assembly.cables)):
        for part in parts:
            own = part.stiffest()
            values.append(own)
            names += [f"{kind}[{k}]" for k in range(len(own))]
    stiffness = np.concatenate(values)
    order = np.argsort(-stiffness, kind="stable")
    those = order[stiffness[order] > 1e-2 * stiffness[order[0]]]
    more = f" and {len(those) - 3} more" if len(those) > 3 else ""
    return Drowned(
        f"Rounding hides the load beside the stiffness of {', '.join(names[k] for k in those[:3])}{more}, up to "
        f"{stiffness[order[0]]:.1e} N/m (residual {residual:.1e})",
        state=state,
        residual=residual,
        iterations=spent,
        remedy="Make them softer or longer, or the others stiffer.",
    )


def held(assembly: Assembly, balance: Balance) -> Reals:
    """The tangent's lower values with rotations held by 1e-10 of their own stiffness.

    A pinned straight rod can spin about its axis without any force; that much stiffness makes the matrix
    regular and is far below what rounding leaves of the softest mode that matters.
    """
    values = balance.tangent
    assert values is not None
    if values.ndim == 1:
        return np.asarray(_stiffened(values, assembly.turns, _HELD))
    return assembly.matrix.raised(values, assembly.turns, _HELD_EXTENDED * np.abs(values[assembly.turns, 0]))


@njit(cache=True)
def _stiffened(values, places, share):  # type: ignore[no-untyped-def]
    """A copy of the values, those at `places` larger by a share of their size."""
    result = values.copy()
    for place in places:
        result[place] += share * abs(result[place])
    return result


@njit(cache=True)
def _largest_difference(load, force, free, reach):  # type: ignore[no-untyped-def]
    """The largest |load - force| on the free degrees of freedom, each times its reach; infinite where one
    isn't finite.
    """
    largest = 0.0
    for dof in free:
        size = abs(load[dof] - force[dof]) * reach[dof]
        if not np.isfinite(size):
            return np.inf
        largest = max(largest, size)
    return largest


@njit(cache=True)
def _largest(load, reach):  # type: ignore[no-untyped-def]
    """The largest |load|, each times its reach."""
    largest = 0.0
    for dof in range(len(load)):
        largest = max(largest, abs(load[dof]) * reach[dof])
    return largest


class Turning:
    """Newton's step where dead moments turn about fixed axes in space.

    Rotations don't commute, so the exact tangent of a node in equilibrium with an applied moment m has
    -S(m)/2 besides its symmetric part. With K + E C E' for the tangent, C holding those blocks, the step (I +
    K⁻¹ E C E') x = K⁻¹ r is found by GMRES, exactly after as many solves as there are such blocks' ranks.
    """

    def __init__(self, assembly: Assembly, load: Reals) -> None:
        rotations = assembly.number.reshape(-1, 6)[:, 3:]
        # With one free rotation there is nothing that it could fail to commute with.
        self.nodes = np.flatnonzero(load[:, 3:].any(axis=1) & ((rotations >= 0).sum(axis=1) > 1))
        self.rows = rotations[self.nodes]

    def solve(self, factor: Factor, balance: Balance, right: Reals) -> Reals:
        """The step (f,) for the unbalanced forces `right` (f,)."""
        plain = factor.solve(right)
        if not len(self.nodes):
            return plain
        moments = balance.force[self.nodes, 3:]

        def turned(step: Reals) -> Reals:
            increments = np.where(self.rows >= 0, step[self.rows], 0.0)
            change = np.zeros_like(step)
            kept = self.rows >= 0
            change[self.rows[kept]] = (-0.5 * np.cross(moments, increments))[kept]
            return step + factor.solve(change)

        size = len(right)
        found, failed = gmres(
            LinearOperator((size, size), matvec=turned, dtype=float), plain, rtol=1e-10, restart=50, maxiter=4
        )
        return plain if failed else np.asarray(found)
