"""Tolerances to first order: independent normal variables z of mean 0 and deviation 1, a group for each
cause.

A group gives what the equilibrium needs: the derivatives F (6 n, k) of the internal forces by its variables
at a fixed state and, for multipliers y_k, how y_k'F_k changes with the state and with the cables' rest
lengths; and it varies the structure itself, for sampling. Stiffnesses vary as exp(s z), so that they stay
positive; lengths, places and loads vary linearly. Marks, rods and shape have no group: what they do is told
by drawn structures.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from shellform.arrays import Indices, Reals
from shellform.errors import InputError
from shellform.gridshell.gridshell import Design, Gridshell
from shellform.gridshell.tolerances import Tolerances
from shellform.net.grid import CONNECTOR
from shellform.structure.elements.beam import STIFFNESSES, Beams
from shellform.structure.elements.cable import Cables
from shellform.structure.elements.state import State


@dataclass(frozen=True)
class Realisation:
    """The structure as built: `beams`, `cables`, the dead `load` (n, 6), and how far held degrees of freedom
    are off, `offset` (n, 6), m.
    """

    beams: Beams
    cables: Cables
    load: Reals
    offset: Reals


class Group(Protocol):
    """The variables of one cause."""

    @property
    def name(self) -> str:
        """The cause."""

    @property
    def count(self) -> int:
        """How many."""

    def forces(self, state: State) -> sp.csc_array:
        """F (6 n, k)."""

    def curvature(self, state: State) -> sp.csc_array:
        """Second derivatives (6 n, k) of the internal forces, each by one variable twice."""

    def motion(self, nodes: int) -> sp.csc_array:
        """Motion (6 n, k) of held degrees of freedom."""

    def by_state(self, state: State, multipliers: Reals) -> Reals:
        """Derivative (6 n, k) by the state of y_k'F_k for multipliers (6 n, k)."""

    def by_rest_length(self, state: State, multipliers: Reals) -> Reals:
        """Derivative (c,) by the present cables' rest lengths of the sum of y_k'F_k."""

    def varied(self, built: Realisation, z: Reals) -> Realisation:
        """The structure with the variables at z (k,)."""


@dataclass(frozen=True)
class Stiffness:
    """Stiffness of `part`'s elements, each on its own or all `together`; the part has the derivative for a
    stiffness. `chosen` are the elements' numbers among all beams or cables; of beams all four constants
    vary."""

    name: str
    part: Beams | Cables
    deviation: float
    together: bool
    chosen: Indices

    @property
    def count(self) -> int:
        """One, or one an element."""
        return 1 if self.together else len(self.chosen)

    def forces(self, state: State) -> sp.csc_array:
        """End forces of the elements with the derivative for a stiffness."""
        return self.deviation * _spread(
            self.part.evaluate(state, tangent=False).force, self.part.dofs(), state, self._column
        )

    def curvature(self, state: State) -> sp.csc_array:
        """Of exp(s z): s² F/s."""
        return self.deviation * self.forces(state)

    def motion(self, nodes: int) -> sp.csc_array:
        """None."""
        return sp.csc_array((6 * nodes, self.count))

    def by_state(self, state: State, multipliers: Reals) -> Reals:
        """The elements' tangents times the multipliers. Spins don't commute: the derivative of an end's
        moment m has -S(m)/2 besides, which cancels over a node in equilibrium; these moments are in no
        equilibrium."""
        dofs = self.part.dofs()
        found = self.part.evaluate(state, tangent=True)
        assert found.tangent is not None
        own = multipliers[dofs, self._column[:, None]]
        result = np.zeros_like(multipliers)
        change = np.einsum("eij,ej->ei", unpacked(found.tangent, dofs.shape[1]), own)
        if isinstance(self.part, Beams):
            for turns in (slice(3, 6), slice(9, 12)):
                change[:, turns] -= 0.5 * np.cross(own[:, turns], found.force[:, turns])
        change *= self.deviation
        np.add.at(result, (dofs, self._column[:, None]), change)
        return result

    def by_rest_length(self, state: State, multipliers: Reals) -> Reals:
        """Through the cables' forces, which are linear in EA."""
        if not isinstance(self.part, Cables):
            return np.zeros(1)
        own = multipliers[self.part.dofs(), self._column[:, None]]
        return self.deviation * np.asarray((own * self.part.force_by_rest_length(state)).sum(axis=1))

    def varied(self, built: Realisation, z: Reals) -> Realisation:
        """Stiffnesses times exp(s z)."""
        factor = np.exp(self.deviation * z)
        if isinstance(self.part, Cables):
            return replace(built, cables=replace(built.cables, stiffness=built.cables.stiffness * factor))
        values = {}
        for name in STIFFNESSES:
            values[name] = getattr(built.beams, name).copy()
            values[name][self.chosen] *= factor
        return replace(built, beams=replace(built.beams, **values))

    @property
    def _column(self) -> Indices:
        return np.zeros(len(self.chosen), dtype=np.int64) if self.together else np.arange(len(self.chosen))


@dataclass(frozen=True)
class Lengths:
    """The cables' rest lengths."""

    name: str
    cables: Cables
    deviation: float

    @property
    def count(self) -> int:
        """One a cable."""
        return len(self.cables.ends)

    def forces(self, state: State) -> sp.csc_array:
        """(A.23)."""
        return self.deviation * _spread(
            self.cables.force_by_rest_length(state), self.cables.dofs(), state, np.arange(self.count)
        )

    def curvature(self, state: State) -> sp.csc_array:
        """By a rest length twice: 2 EA / l0³ along the chord."""
        return self.deviation**2 * _spread(
            self._twice(state), self.cables.dofs(), state, np.arange(self.count)
        )

    def motion(self, nodes: int) -> sp.csc_array:
        """None."""
        return sp.csc_array((6 * nodes, self.count))

    def by_state(self, state: State, multipliers: Reals) -> Reals:
        """The force by rest length is -EA / l0² times the chord: linear in the places of the ends."""
        dofs, columns = self.cables.dofs(), np.arange(self.count)[:, None]
        own = multipliers[dofs, columns]
        pulled = np.where(
            self._taut(state), -self.deviation * self.cables.stiffness / self.cables.rest_length**2, 0.0
        )
        away = pulled[:, None] * (own[:, 3:] - own[:, :3])
        result = np.zeros_like(multipliers)
        np.add.at(result, (dofs, columns), np.hstack([-away, away]))
        return result

    def by_rest_length(self, state: State, multipliers: Reals) -> Reals:
        """By the own rest length once more."""
        own = multipliers[self.cables.dofs(), np.arange(self.count)[:, None]]
        return self.deviation * np.asarray((own * self._twice(state)).sum(axis=1))

    def varied(self, built: Realisation, z: Reals) -> Realisation:
        """Rest lengths plus s z."""
        return replace(
            built, cables=replace(built.cables, rest_length=built.cables.rest_length + self.deviation * z)
        )

    def _taut(self, state: State) -> np.ndarray:
        return self.cables.lengths(state) > self.cables.rest_length

    def _twice(self, state: State) -> Reals:
        chord, _ = self.cables.chords(state)
        scale = np.where(self._taut(state), 2.0 * self.cables.stiffness / self.cables.rest_length**3, 0.0)
        return np.hstack([-scale[:, None] * chord, scale[:, None] * chord])


@dataclass(frozen=True)
class Supports:
    """The places of the supports."""

    name: str
    dofs: Indices
    deviation: float

    @property
    def count(self) -> int:
        """Three a support."""
        return len(self.dofs)

    def forces(self, state: State) -> sp.csc_array:
        """None at a fixed state: it is the motion that strains."""
        return sp.csc_array((6 * len(state.positions), self.count))

    curvature = forces

    def motion(self, nodes: int) -> sp.csc_array:
        """Each degree of freedom by s."""
        values = np.full(self.count, self.deviation)
        return sp.csc_array((values, (self.dofs, np.arange(self.count))), shape=(6 * nodes, self.count))

    def by_state(self, state: State, multipliers: Reals) -> Reals:
        """None."""
        return np.zeros_like(multipliers)

    def by_rest_length(self, state: State, multipliers: Reals) -> Reals:
        """None."""
        return np.zeros(1)

    def varied(self, built: Realisation, z: Reals) -> Realisation:
        """Offsets of s z."""
        offset = built.offset.copy()
        offset.reshape(-1)[self.dofs] += self.deviation * z
        return replace(built, offset=offset)


@dataclass(frozen=True)
class Loads:
    """The loads `parts` (k, n, 6), N, each of which varies as a whole."""

    name: str
    parts: sp.csc_array
    deviation: float

    @property
    def count(self) -> int:
        """As many as parts."""
        return int(self.parts.shape[1])

    def forces(self, state: State) -> sp.csc_array:
        """A load more counts as an internal force less."""
        return sp.csc_array(-self.deviation * self.parts)

    def curvature(self, state: State) -> sp.csc_array:
        """None: loads vary linearly."""
        return sp.csc_array(self.parts.shape)

    def motion(self, nodes: int) -> sp.csc_array:
        """None."""
        return sp.csc_array(self.parts.shape)

    def by_state(self, state: State, multipliers: Reals) -> Reals:
        """Loads are dead."""
        return np.zeros_like(multipliers)

    def by_rest_length(self, state: State, multipliers: Reals) -> Reals:
        """None."""
        return np.zeros(1)

    def varied(self, built: Realisation, z: Reals) -> Realisation:
        """Loads times 1 + s z."""
        return replace(built, load=built.load + self.deviation * np.asarray(self.parts @ z).reshape(-1, 6))


def groups_of(shell: Gridshell, design: Design, load: Reals, tolerances: Tolerances) -> list[Group]:
    """The groups of all causes that aren't left out. Raises InputError where that leaves none."""
    result = [
        *_of_cables(shell.cables(design), tolerances),
        *_of_supports(shell, tolerances),
        *_of_connectors(shell.beams(design.radius), tolerances),
        *_of_load(shell, load, tolerances),
    ]
    if not result:
        raise InputError(
            "nothing is off",
            where="tolerances",
            remedy="Give one of cable_length, cable_stiffness, supports, connectors, load_each, load_all, "
            "load_uneven, and to what it is of: the design a cable, the shell a load.",
        )
    return result


def _of_cables(cables: Cables, tolerances: Tolerances) -> list[Group]:
    every = np.arange(len(cables.ends))
    result: list[Group] = []
    for name, together in (("cable_stiffness", False), ("cable_stiffness_all", True)):
        deviation = getattr(tolerances, name)
        if deviation and len(every):
            result.append(Stiffness(name, cables, deviation, together, every))
    if tolerances.cable_length and len(every):
        result.append(Lengths("cable_length", cables, tolerances.cable_length))
    return result


def _of_supports(shell: Gridshell, tolerances: Tolerances) -> list[Group]:
    held = (6 * shell.net.supports[:, None] + np.arange(3)).ravel()
    return [Supports("supports", held, tolerances.supports)] if tolerances.supports else []


def _of_connectors(beams: Beams, tolerances: Tolerances) -> list[Group]:
    chosen = np.flatnonzero(beams.of_kind(CONNECTOR))
    part = beams.chosen(chosen)
    return [
        Stiffness(name, part, getattr(tolerances, name), together, chosen)
        for name, together in (("connectors", False), ("connectors_all", True))
        if getattr(tolerances, name)
    ]


def _of_load(shell: Gridshell, load: Reals, tolerances: Tolerances) -> list[Group]:
    loaded = np.flatnonzero(load.any(axis=1))
    if not len(loaded):
        return []
    crossings, crossing = np.unique(zones_of(shell)[loaded], return_inverse=True)
    rows = (6 * loaded[:, None] + np.arange(6)).ravel()
    each = sp.csc_array(
        (load[loaded].ravel(), (rows, np.repeat(crossing, 6))), shape=(load.size, len(crossings))
    )
    uneven = [(load * share[:, None]).ravel() for share in halves(shell.target.positions).T]
    return [
        Loads(name, parts, getattr(tolerances, name))
        for name, parts in (
            ("load_each", each),
            ("load_all", sp.csc_array(load.reshape(-1, 1))),
            ("load_uneven", sp.csc_array(np.column_stack(uneven))),
        )
        if getattr(tolerances, name)
    ]


def zones_of(shell: Gridshell) -> Indices:
    """The crossing (n,) that each node's load is counted to: the nearest in the flat grid."""
    grid = shell.net.grid
    middle = grid.flat[grid.crossing_nodes].mean(axis=1)[:, :2]
    return np.asarray(cKDTree(middle).query(grid.flat[:, :2])[1], dtype=np.int64)


def halves(places: Reals) -> Reals:
    """Shares (n, 2) of a load that make one half of the plan heavier by as much as the other is lighter, in
    two directions at right angles: a plane each, whose mean size over the nodes at `places` (n, 3) is 1."""
    plan = places[:, :2] - places[:, :2].mean(axis=0)
    return np.asarray(plan / np.maximum(np.abs(plan).mean(axis=0), 1e-300))


def unpacked(packed: Reals, size: int) -> Reals:
    """Symmetric matrices (m, size, size) from packed lower triangles."""
    rows, columns = np.tril_indices(size)
    result = np.empty((len(packed), size, size))
    result[:, rows, columns] = packed
    result[:, columns, rows] = packed
    return result


def _spread(values: Reals, dofs: Indices, state: State, columns: Indices) -> sp.csc_array:
    """Element values (m, d) as columns (6 n, k)."""
    wide = np.broadcast_to(columns[:, None], dofs.shape)
    shape = (6 * len(state.positions), int(columns.max()) + 1)
    return sp.csc_array((values.ravel(), (dofs.ravel(), wide.ravel())), shape=shape)
