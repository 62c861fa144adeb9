"""Implicit dynamic relaxation with velocity, damping and time step (Rombouts et al. 2018, 2019; section 3).

The network moves in fictitious time by M a + C v = r(x), r = p - f (equation 8). With backward differences
and r linearised at the end of a step dt,

    (M/dt² + C/dt + K) dx = r + M v/dt,   v <- dx/dt,

from rest. M is diagonal, 1 for translations and the square of an element length for rotations, times the mean
stiffness of a translation, so that the natural time of the stiffest motions is about 1; C = c M. Kinetic
damping: where the kinetic energy v'Mv/2 has passed a peak the velocity is set to zero. The time step grows
while steps succeed, which takes the method over into Newton-Raphson, and is cut where the matrix isn't
positive definite or a node or an element would turn too far.

`equilibrium.py` has the form that is the default: no velocity, and the mass only as large as definiteness and
a falling potential ask for.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from shellform.arrays import Reals
from shellform.errors import NotConverged
from shellform.structure.elements.state import State, moved
from shellform.structure.solve.assembly import Assembly
from shellform.structure.solve.equilibrium import LIMIT, TOLERANCE, TURN, Equilibrium, stability
from shellform.structure.solve.factorisation import NotPositiveDefinite
from shellform.structure.solve.residual import (
    STAGNANT,
    ResidualNorm,
    Turning,
    check_turned,
    held,
    overturned,
)

FIRST = 1.0  # time step to begin with, in natural times of the stiffest motions
DAMPING = 0.0  # c, 1 over time; kinetic damping alone needs none
_GROWTH, _CUT = 1.5, 0.5  # of the time step after a good and a failed step
_SHORTEST = 1e-9  # of the first time step: shorter ones lead nowhere


def dynamic(
    assembly: Assembly,
    start: State,
    load: Reals,
    *,
    tolerance: float = TOLERANCE,
    time_step: float = FIRST,
    damping: float = DAMPING,
    limit: int = LIMIT,
    progress: Callable[[int, float], None] | None = None,
) -> Equilibrium:
    """The equilibrium in which the fictitious motion from `start` under the dead `load` (n, 6) comes to rest.

    `time_step` to begin with and viscous `damping`, in natural times of the stiffest motions; `limit` bounds
    the factorisations. Raises NotConverged with the last state.
    """
    measure, turning = ResidualNorm(assembly), Turning(assembly, load)
    state, now = start, assembly.evaluate(start)
    residual, before = measure.residual(now, load), np.inf
    assert now.tangent is not None
    diagonal = np.abs(assembly.matrix.leading(now.tangent)[assembly.matrix.diagonal])
    mass = float(diagonal[assembly.free % 6 < 3].mean()) * measure.mass_shape
    velocity, kinetic, step, spent = np.zeros(len(assembly.free)), 0.0, time_step, 0
    while not measure.balanced(residual, now, state, load, tolerance, residual > STAGNANT * before):
        if spent >= limit or step < _SHORTEST * time_step:
            raise NotConverged(
                f"The fictitious motion didn't come to rest in {spent} factorisations (residual {residual:.1e})",
                state=state,
                residual=residual,
                iterations=spent,
                remedy="Apply the load in more increments, or allow more factorisations.",
            )
        if progress is not None:
            progress(spent, residual)
        inertia = mass / step**2 + damping * mass / step
        values = assembly.matrix.raised(held(assembly, now), assembly.matrix.diagonal, inertia)
        pull = (load - now.force).ravel()[assembly.free] + mass * velocity / step
        spent += 1
        try:
            change = turning.solve(assembly.matrix.factor(values), now, pull)
        except NotPositiveDefinite:
            step *= _CUT
            continue
        motion = assembly.by_node(change)
        trial = moved(state, assembly.chords.corrected(state, motion))
        then = assembly.evaluate(trial)
        far = float(np.abs(motion[:, 3:]).max(initial=0.0)) > TURN
        if far or not np.isfinite(then.energy) or overturned(assembly, state, now.turned, trial, then.turned):
            step, velocity, kinetic = _CUT * step, np.zeros_like(velocity), 0.0
            continue
        velocity = change / step
        moving = float((mass * velocity * velocity).sum())
        if moving < kinetic:  # past a peak of the kinetic energy
            velocity, moving = np.zeros_like(velocity), 0.0
        kinetic, step = moving, _GROWTH * step
        state, now = trial, then
        residual, before = measure.residual(now, load), residual
    check_turned(assembly, state, now, spent)
    stable, negative = stability(assembly, now)
    return Equilibrium(state, now.energy, residual, spent, stable, negative)
