"""A cheap guide to how likely a design stands: the softest mode's stiffness along the whole path, with each
cable counted for what it is worth under its tolerance (expected_cables.py).

A perfect structure may count on cables that a length error of a hair leaves slack. At each state of the
perfect path the tangent is taken with the expected law instead of the sharp one, the deviation of a cable's
stretch being that of its own length and, to first order (first_order.py), of everything else that is off. The
least of the lowest eigenvalues along the path is the guide; below zero, the average structure doesn't stand.
It ranks designs; how likely they stand the sample says.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shellform.arrays import Reals, Record, reals
from shellform.errors import NotConverged
from shellform.gridshell.tolerances import Tolerances
from shellform.reliability.drawing import built_cables, draw_errors
from shellform.reliability.expected_cables import ExpectedCables
from shellform.reliability.first_order import moved_from
from shellform.reliability.perfect import Perfect
from shellform.structure.answers.stability import modes
from shellform.structure.elements.cable import Cables
from shellform.structure.elements.state import State
from shellform.structure.network import assemble
from shellform.structure.solve.assembly import Assembly

DRAWN = 24  # structures from which deviations of stretches are taken: a share of 1/sqrt(2·24) off, 14 %
_LEAST = 1e-6  # m, the smallest deviation that is counted


@dataclass(frozen=True, eq=False)
class PathStiffness(Record):
    """The softest mode's `stiffness` (k,), N/m, at the load `factors` (k,) of the path, with cables counted
    for what they are worth; negative where the average structure has fallen."""

    factors: Reals
    stiffness: Reals

    @property
    def least(self) -> float:
        """The smallest along the path, N/m."""
        return float(self.stiffness.min())

    def least_to(self, factor: float) -> float:
        """The smallest up to a factor of the load, N/m, between two states on the straight line."""
        here = float(np.interp(factor, self.factors, self.stiffness))
        return min(here, float(self.stiffness[self.factors <= factor].min()))


def guide(perfect: Perfect, tolerances: Tolerances, *, seed: int = 0, drawn: int = DRAWN) -> PathStiffness:
    """The guide of a perfect structure's path as far as it goes, at each of its kept states."""
    assembly = assemble(perfect.network)
    deviation = stretch_deviation(perfect, tolerances, assembly, seed=seed, drawn=drawn)
    found = [
        expected_stiffness(assembly, perfect.network.cables, state, deviation) for state in perfect.states
    ]
    return PathStiffness(perfect.factors, reals("stiffness", found, (len(found),)))


def expected_stiffness(assembly: Assembly, cables: Cables, state: State, deviation: Reals) -> float:
    """The softest mode's stiffness, N/m, at a state, the cables' stretches off by `deviation` (c,), m."""
    if not len(cables.ends):
        return float(modes(assembly, state, 1).stiffness[0])
    other = assembly.with_parts((assembly.parts[0], ExpectedCables(cables, deviation)))
    return float(modes(other, state, 1).stiffness.min())


def stretch_deviation(
    perfect: Perfect, tolerances: Tolerances, assembly: Assembly, *, seed: int, drawn: int = DRAWN
) -> Reals:
    """Standard deviation (c,), m, of each cable's stretch l - l0 without load, to first order in all errors
    but the shape's and the load's; where no first order is to be had, that of the cables' own length."""
    cables, state, none = perfect.network.cables, perfect.unloaded, np.zeros_like(perfect.load)
    own = np.full(len(cables.ends), max(tolerances.cable_length, _LEAST))
    if not len(cables.ends):
        return own
    some = [draw_errors(perfect.members, tolerances, seed, number) for number in range(drawn)]
    try:
        found = moved_from(assembly, state, none, perfect.present, some, None).translations
    except NotConverged:
        return own
    a, b = cables.ends.T
    unit, _ = cables.directions(state)
    longer = ((found[:, b] - found[:, a]) * unit).sum(axis=2)
    total = np.zeros(len(cables.ends))
    for k, errors in enumerate(some):
        rest = built_cables(cables, perfect.present, errors).rest_length
        total += (longer[k] - (rest - cables.rest_length)) ** 2
    return np.asarray(np.maximum(np.sqrt(total / drawn), own))
