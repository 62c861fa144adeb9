"""Static equilibrium by implicit dynamic relaxation (section 3; Rombouts et al. 2018, 2019).

The network moves in fictitious time by M a + C v = r(x), r = p - f (equation 8). Linearised at the end of a
step dt, with v = dx/dt, the step solves

    (M/dt² + C/dt + K) dx = r + M v_old/dt.

Kinetic damping in its strictest form sets v_old to zero at every step; with m = M/dt² + C/dt this leaves

    (K + m) dx = r,

Newton-Raphson regularised by the mass m, and Newton-Raphson itself for m -> 0. The mass is diagonal, 1 for
translations and the square of an element length for rotations, so that both weigh alike, times one factor:
zero as long as the tangent is positive definite, raised until K + m is positive definite where it isn't or
where the potential U - p·x would rise, lowered as steps succeed. Every accepted step therefore lowers the
potential, so that what is found is a stable equilibrium, through snap-through if need be. Dead moments have
no potential; their work over a step stands in for it.

`on_branch` asks for the equilibrium next to the start only: at the first lost definiteness it gives up.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from shellform.arrays import Reals
from shellform.errors import NotConverged
from shellform.structure.elements.state import State, extended, moved
from shellform.structure.solve.assembly import Assembly, Balance
from shellform.structure.solve.extended import with_twice_the_digits
from shellform.structure.solve.factorisation import Factor, NotPositiveDefinite
from shellform.structure.solve.residual import (
    STAGNANT,
    Drowned,
    ResidualNorm,
    Turning,
    check_turned,
    drowned,
    held,
    overturned,
)

# unbalanced over largest force; rounding leaves about 1e-10 for rods of EA/l = 1e7 N/m and 10 N loads
TOLERANCE = 1e-8
LIMIT = 1000  # factorisations of one relaxation
TURN = 0.5  # rad, the largest rotation increment of a node in one step, in which the updates are first order
_GROWTH, _DECAY = 10.0, 0.2  # of the mass after a failed and a good step
_SUFFICIENT = 1e-4  # share of the predicted decrease of the potential that a step must bring (Armijo)
# A residual near the goal that falls this much counts, whatever the potential does: sliding springs on a
# surface known to a finite order have no exact one.
_CLOSE, _CONTRACTION = 1e-2, 0.9
_SHORTEST = 0.1  # share of a step to which it is cut before the mass is raised instead
_PATIENCE = 3  # steps with mass between two looks for a symmetric path
_HEAVY = 1e6  # times the largest stiffness
_FAR = 1e6  # m or rad, a step of Newton's iteration that leads nowhere
_SYMMETRIC_UP_TO = 20_000  # degrees of freedom
_HALVINGS = 4  # of one step before the mass is raised instead


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """A state in which the forces balance.

    `residual`: largest unbalanced force (moments over an element length) over the largest applied or internal
    force; `factorisations` spent; `energy` strain energy, J; `stable`: the tangent on the free degrees of
    freedom is positive definite (a rod's rotation about its own axis disregarded); `negative`: how many of
    its eigenvalues are negative.
    """

    state: State
    energy: float
    residual: float
    factorisations: int
    stable: bool
    negative: int


class LostBranch(NotConverged):
    """The equilibrium next to the start ended: the tangent lost its definiteness on the way."""


Relaxing = Callable[[int, float], None]
"""Called at every step with the factorisations so far and the residual."""


def find_equilibrium(
    assembly: Assembly,
    start: State,
    load: Reals,
    *,
    tolerance: float = TOLERANCE,
    limit: int = LIMIT,
    reach: float = np.inf,
    on_branch: bool = False,
    symmetric: bool = True,
    progress: Relaxing | None = None,
) -> Equilibrium:
    """The equilibrium that implicit dynamic relaxation reaches from `start` under the dead `load` (n, 6), N
    and N·m.

    Held degrees of freedom stay where `start` has them. `limit` bounds the factorisations;
    `progress(factorisations, residual)` is called at every step. `symmetric`: whether the way there may be
    exactly so, for which small models are looked at; that of a structure with errors isn't. Raises
    NotConverged with the last state, LostBranch where `on_branch` is set and definiteness is lost.
    """
    try:
        return _relaxed(assembly, start, load, tolerance, limit, reach, on_branch, symmetric, progress)
    except Drowned as error:
        precise = with_twice_the_digits(assembly)
        if precise is None or not isinstance(error.state, State):
            raise
        begin = extended(error.state)
        return _relaxed(precise, begin, load, tolerance, limit, reach, on_branch, symmetric, progress)


def _relaxed(
    assembly: Assembly,
    start: State,
    load: Reals,
    tolerance: float,
    limit: int,
    reach: float,
    on_branch: bool,
    symmetric: bool,
    progress: Relaxing | None,
) -> Equilibrium:
    """The relaxation with the digits that the assembly has. Raises Drowned where they aren't enough."""
    walk = _Relaxation(assembly, start, load, reach, tolerance)
    walk.symmetric &= symmetric
    if walk.drowns():
        raise drowned(assembly, start, walk.residual, 0)
    while not walk.balanced():
        if progress is not None:
            progress(walk.factorisations, walk.residual)
        if walk.factorisations >= limit:
            raise NotConverged(
                f"No equilibrium after {walk.factorisations} factorisations (residual {walk.residual:.1e})",
                state=walk.state,
                residual=walk.residual,
                iterations=walk.factorisations,
                remedy="Apply the load in more increments, or start from a state nearer to the equilibrium.",
            )
        walk.step(on_branch)
    check_turned(assembly, walk.state, walk.now, walk.factorisations)
    stable, negative = stability(assembly, walk.now)
    return Equilibrium(walk.state, walk.now.energy, walk.residual, walk.factorisations, stable, negative)


def newton(
    assembly: Assembly,
    start: State,
    load: Reals,
    *,
    tolerance: float = TOLERANCE,
    limit: int = 50,
    progress: Relaxing | None = None,
) -> Equilibrium:
    """The equilibrium that plain Newton-Raphson reaches from `start` under the dead `load` (n, 6): K dx = r,
    whole steps, no mass.

    It may end on an unstable equilibrium, which implicit dynamic relaxation never does. Raises NotConverged
    with the state of the smallest residual after `limit` factorisations, or where a step isn't finite.
    """
    measure, turning = ResidualNorm(assembly), Turning(assembly, load)
    if measure.drowns(assembly.evaluate(start), start, load, tolerance):
        precise = with_twice_the_digits(assembly)
        if precise is None:
            raise drowned(assembly, start, np.inf, 0)
        return newton(precise, extended(start), load, tolerance=tolerance, limit=limit, progress=progress)
    state, best, least, before = start, start, np.inf, np.inf
    for spent in range(limit + 1):
        now = assembly.evaluate(state)
        residual = measure.residual(now, load)
        if progress is not None:
            progress(spent, residual)
        if residual < least:
            best, least = state, residual
        stagnant, before = residual > STAGNANT * before, residual
        if measure.balanced(residual, now, state, load, tolerance, stagnant):
            check_turned(assembly, state, now, spent)
            stable, negative = stability(assembly, now)
            return Equilibrium(state, now.energy, residual, spent, stable, negative)
        if not np.isfinite(residual):
            break
        unbalanced = (load - now.force).ravel()[assembly.free]
        factor = assembly.matrix.factor_indefinite(held(assembly, now))
        step = assembly.by_node(turning.solve(factor, now, unbalanced))
        if not np.isfinite(step).all() or np.abs(step).max() > _FAR:
            break
        state = moved(state, step)
    raise NotConverged(
        f"Newton's iteration found no equilibrium (smallest residual {least:.1e})",
        state=best,
        residual=least,
        iterations=spent,
        remedy="Apply the load in more increments, or use the relaxation, which finds stable states from "
        "afar.",
    )


def stability(assembly: Assembly, balance: Balance) -> tuple[bool, int]:
    """Whether the tangent is positive definite, and its number of negative eigenvalues; turns about rod axes
    are held.
    """
    values = held(assembly, balance)
    try:
        assembly.matrix.factor(values)
    except NotPositiveDefinite:
        return False, assembly.matrix.negative_eigenvalues(values)
    return True, 0


class _Relaxation:
    """The moving state of one relaxation."""

    def __init__(self, assembly: Assembly, start: State, load: Reals, reach: float, tolerance: float) -> None:
        self.symmetric = len(assembly.free) <= _SYMMETRIC_UP_TO
        self.assembly, self.load, self.state, self.reach = assembly, load, start, reach
        self.tolerance = tolerance
        self.now = assembly.evaluate(start)
        self.measure = ResidualNorm(assembly)
        self.mass_shape = self.measure.mass_shape
        self.mass = 0.0
        self.factorisations = 0
        self.patience = _PATIENCE
        self.turning = Turning(assembly, load)
        self.before = np.inf
        self.residual = self.measure.residual(self.now, load)

    def step(self, on_branch: bool) -> None:
        """One accepted step."""
        values = held(self.assembly, self.now)
        unbalanced = (self.load - self.now.force).ravel()[self.assembly.free]
        if self.mass > 0.0 and self._saddle(values, unbalanced):
            return
        while True:
            clock = self.assembly.clock
            began = time.perf_counter()
            factor = self._factor(values, on_branch)
            then = time.perf_counter()
            direction = self.turning.solve(factor, self.now, unbalanced)
            clock["factorisation"] += then - began
            clock["solve"] += time.perf_counter() - then
            # Not unbalanced @ direction: BLAS would wake a second thread for one sum, and wait for it where
            # the core is taken.
            if self._advance(direction, float(np.einsum("i,i", unbalanced, direction))):
                return
            self._raise_mass()

    def _factor(self, values: Reals, on_branch: bool) -> Factor:
        while True:
            shifted = values
            if self.mass > 0.0:
                shifted = self.assembly.matrix.raised(
                    values, self.assembly.matrix.diagonal, self.mass * self.mass_shape
                )
            self.factorisations += 1
            try:
                return self.assembly.matrix.factor(shifted)
            except NotPositiveDefinite as error:
                if on_branch:
                    raise LostBranch(
                        "The stable equilibrium next to the start was lost",
                        state=self.state,
                        residual=self.residual,
                        iterations=self.factorisations,
                        remedy="Take a smaller step.",
                    ) from error
                self._raise_mass()

    def _heaviest(self) -> float:
        """The mass at which a step leads nowhere; 0 where the tangent isn't finite."""
        largest = float(self._diagonal().max(initial=0.0))
        return _HEAVY * max(largest, 1.0) if np.isfinite(largest) else 0.0

    def _diagonal(self) -> Reals:
        """The sizes (f,) of the tangent's diagonal."""
        assert self.now.tangent is not None
        return np.abs(self.assembly.matrix.leading(self.now.tangent)[self.assembly.matrix.diagonal])

    def _raise_mass(self) -> None:
        least = 1e-7 * float(np.mean(self._diagonal()[self.assembly.free % 6 < 3]))
        self.mass = max(
            _GROWTH * self.mass, least if least > 0.0 else max(float(np.abs(self.load).max()), 1.0)
        )
        if not self.mass <= self._heaviest():
            if self.residual < _CLOSE and self._noise() > self.measure.most(
                self.now, self.load, self.tolerance
            ):
                raise drowned(self.assembly, self.state, self.residual, self.factorisations)
            raise NotConverged(
                f"The relaxation stalled (residual {self.residual:.1e})",
                state=self.state,
                residual=self.residual,
                iterations=self.factorisations,
                remedy="Apply the load in more increments, or loosen the tolerance.",
            )

    def _saddle(self, values: Reals, unbalanced: Reals) -> bool:
        """A Newton step where the tangent has negative eigenvalues that the unbalanced forces don't touch.

        So it is on an exactly symmetric path past its bifurcation (a strip rolled up in its plane by more
        moment than it bears sideways): the mass that those modes ask for would only slow down the others.
        Exact symmetry is for small models; large ones are spared the factorisation, which isn't blocked and
        takes a hundred times as long as Cholesky's.
        """
        if not self.symmetric:
            return False
        if self.patience > 0:
            self.patience -= 1
            return False
        self.patience = _PATIENCE
        self.factorisations += 1
        direction, untouched = self.assembly.matrix.newton(values, unbalanced)
        downhill = float(unbalanced @ direction)
        if not untouched or downhill <= 0.0 or not self._advance(direction, downhill):
            return False
        self.patience = 0
        return True

    def _advance(self, direction: Reals, downhill: float) -> bool:
        step = self.assembly.by_node(direction)
        turn, shift = float(np.abs(step[:, 3:]).max()), float(np.abs(step[:, :3]).max())
        if not np.isfinite(turn + shift):  # a tangent's last pivots are next to nothing: more mass is needed
            return False
        share = min(1.0, TURN / max(turn, TURN), self.reach / max(shift, 1e-300))
        if share < _SHORTEST:
            return False
        full = share == 1.0
        for halving in range(_HALVINGS + 1):
            whole_step = self.assembly.chords.corrected(self.state, share * step)
            trial = moved(self.state, whole_step)
            then = self.assembly.evaluate(trial)
            if overturned(self.assembly, self.state, self.now.turned, trial, then.turned):
                share *= 0.5
                continue
            rise = then.energy - self.now.energy - float(np.einsum("ij,ij", self.load, whole_step))
            rounding = 1e-12 * (abs(then.energy) + abs(self.now.energy))
            residual = self.measure.residual(then, self.load)
            lower = rise <= -_SUFFICIENT * share * downhill
            # Next to the goal the change of the potential drowns in rounding: there the residual decides.
            settling = share * downhill <= rounding and residual < max(2.0 * self.residual, self._noise())
            closing = (self.residual < _CLOSE or self.turns) and residual < _CONTRACTION * self.residual
            if lower or settling or closing:
                self.before = self.residual
                self.state, self.now, self.residual = trial, then, residual
                if halving == 0 and full:
                    self._lower_mass()
                return True
            share *= (
                0.5 if not np.isfinite(rise) else float(np.clip(_minimum(rise, downhill, share), 0.1, 0.5))
            )
        return False

    def _lower_mass(self) -> None:
        self.mass *= _DECAY
        if self.mass > 0.0 and self.mass < 1e-10 * float(self._diagonal().mean()):
            self.mass = 0.0

    @property
    def turns(self) -> bool:
        """Whether moments turn nodes in space: the potential is a guide then, not a measure."""
        return len(self.turning.nodes) > 0

    def balanced(self) -> bool:
        """Whether the state is in equilibrium. Raises Drowned where rounding doesn't let it come nearer."""
        stagnant = self.residual > STAGNANT * self.before
        known = self.measure.balanced(
            self.residual, self.now, self.state, self.load, self.tolerance, stagnant
        )
        if not known and stagnant and self.residual <= self._noise():
            raise drowned(self.assembly, self.state, self.residual, self.factorisations)
        return known

    def drowns(self) -> bool:
        """Whether rounding surely hides what there is to find from the start; where it only may, steps show
        it, for those that stagnate too high are given up (`balanced`)."""
        return self.measure.drowns(self.now, self.state, self.load, self.tolerance, surely=True)

    def _noise(self) -> float:
        return self.measure.rounding(self.now, self.state, self.load)


def _minimum(rise: float, downhill: float, share: float) -> float:
    """Where along the step, as a share of it, the parabola through the two potentials and the slope has its
    minimum.
    """
    slope = -downhill * share
    curvature = rise - slope
    return 0.5 * -slope / curvature if curvature > 0.0 else 0.5
