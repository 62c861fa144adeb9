"""Cables that a step may not let go slack.

Where a cable goes slack the tangent loses its stiffness at once. Far from collapse that is a kink like
others; but a cable that helps to hold the softest mode under an additional load may leave the shell without
equilibrium, and no derivative tells of it beforehand: that of the mode's stiffness may even promise a rise
(documentation/decisions.md).

A guard is the linear model of those tensions under one load: t + (∂t/∂s) Δs, one adjoint solve for each, kept
from falling below a floor.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shellform.arrays import Reals
from shellform.structure.answers.sensitivity import (
    adjoint,
    by_rest_length,
    by_stiffness,
    respond,
    tension_rows,
)
from shellform.structure.elements.beam import Beams
from shellform.structure.elements.cable import Cables
from shellform.structure.elements.state import State
from shellform.structure.solve.assembly import Assembly


@dataclass(frozen=True)
class Guard:
    """The `tension` (g,), N, of guarded cables under a load, and `tension_by_design` (g, c + r), N/m, by the
    rest lengths of the present cables and, where it is free, the radius."""

    tension: Reals
    tension_by_design: Reals


def guard(
    assembly: Assembly, state: State, cables: Cables, reach: float, *rates: Beams, most: int | None = None
) -> Guard:
    """The guard of the cables with tensions between 0 and `reach`, N, in the stable `state`, at `most` so many,
    those with the least; `rates` are the beams' by a free radius.

    Raises NotPositiveDefinite.
    """
    response = respond(
        assembly, state, by_rest_length(assembly, state, cables), by_stiffness(assembly, state, *rates)
    )
    tension = cables.tension(state)
    near = np.flatnonzero((tension > 0.0) & (tension < reach))
    if most is not None:
        near = np.sort(near[np.argsort(tension[near], kind="stable")[:most]])
    by_design = adjoint(response, tension_rows(assembly, state, cables)[near])
    by_design[np.arange(len(near)), near] += cables.tension_by_rest_length(state)[near]
    return Guard(tension[near], by_design)
