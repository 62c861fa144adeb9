"""What isn't known exactly about a gridshell as built: independent normal variables z of mean 0 and deviation
1, a group for each cause.

A group gives what the equilibrium needs: the derivatives F (6 n, k) of the internal forces by its variables
at a fixed state and, for multipliers y_k, how y_k'F_k changes with the state and with the cables' rest
lengths; and it varies the structure itself, for sampling. Stiffnesses vary as exp(s z), so that they stay
positive; lengths, places and loads vary linearly.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Protocol

import numpy as np
import scipy.sparse as sp

from shellform.arrays import Indices, Reals
from shellform.errors import InputError
from shellform.gridshell.gridshell import Design, Gridshell
from shellform.net.grid import CONNECTOR
from shellform.structure.elements.beam import Beams
from shellform.structure.elements.cable import Cables
from shellform.structure.elements.state import State

_JOINT = ("axial", "torsion", "bending_y", "bending_z")


@dataclass(frozen=True)
class Scatter:
    """Standard deviations; 0 leaves a cause out. Relative ones: `cable_stiffness` of each cable,
    `cable_stiffness_all` of all together, `joints` of each connector's GJ and EI, `joints_all` of all
    together, `loads` of each loaded node, `loads_all` of all together. In m: `rest_length` of each cable (the
    error of its prestress) and `supports` of each coordinate of each support."""

    cable_stiffness: float = 0.0
    cable_stiffness_all: float = 0.0
    rest_length: float = 0.0
    supports: float = 0.0
    joints: float = 0.0
    joints_all: float = 0.0
    loads: float = 0.0
    loads_all: float = 0.0

    def __post_init__(self) -> None:
        for each in fields(self):
            value = getattr(self, each.name)
            if not (value >= 0.0 and np.isfinite(value)):
                raise InputError("must be finite and not negative", where=f"scatter.{each.name}", value=value)
        if not any(getattr(self, each.name) for each in fields(self)):
            raise InputError(
                "nothing is uncertain", where="scatter", remedy="Give at least one standard deviation."
            )


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
    stiffness. `chosen` are the elements' numbers among the beams, and `properties` what of them varies;
    cables vary in one way only."""

    name: str
    part: Beams | Cables
    deviation: float
    together: bool
    chosen: Indices
    properties: tuple[str, ...]

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
        for name in self.properties:
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
        chord = state.positions[self.cables.ends[:, 1]] - state.positions[self.cables.ends[:, 0]]
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


def groups_of(shell: Gridshell, design: Design, load: Reals, scatter: Scatter) -> list[Group]:
    """The groups of all causes that aren't left out."""
    cables, beams = shell.cables(design), shell.beams(design.radius)
    every = np.arange(len(cables.ends))
    result: list[Group] = []
    if len(every):
        for name, deviation, together in (
            ("cable_stiffness", scatter.cable_stiffness, False),
            ("cable_stiffness_all", scatter.cable_stiffness_all, True),
        ):
            if deviation:
                result.append(Stiffness(name, cables, deviation, together, every, ()))
        if scatter.rest_length:
            result.append(Lengths("rest_length", cables, scatter.rest_length))
    if scatter.supports:
        supports = (6 * shell.net.supports[:, None] + np.arange(3)).ravel()
        result.append(Supports("supports", supports, scatter.supports))
    connectors = np.flatnonzero(beams.of_kind(CONNECTOR))
    for name, deviation, together in (
        ("joints", scatter.joints, False),
        ("joints_all", scatter.joints_all, True),
    ):
        if deviation:
            for properties in (("torsion",), ("bending_y", "bending_z")):
                result.append(
                    Stiffness(
                        name,
                        _only(beams, connectors, properties),
                        deviation,
                        together,
                        connectors,
                        properties,
                    )
                )
    loaded = np.flatnonzero(load.any(axis=1))
    nodes = len(load)
    if len(loaded):
        columns = np.repeat(np.arange(len(loaded)), 6)
        rows = (6 * loaded[:, None] + np.arange(6)).ravel()
        each = sp.csc_array((load[loaded].ravel(), (rows, columns)), shape=(6 * nodes, len(loaded)))
        if scatter.loads:
            result.append(Loads("loads", each, scatter.loads))
        if scatter.loads_all:
            result.append(Loads("loads_all", sp.csc_array(load.reshape(-1, 1)), scatter.loads_all))
    if not result:
        raise InputError(
            "nothing of what is uncertain is there",
            where="scatter",
            remedy="Give the design cables or the shell a load.",
        )
    return result


def unpacked(packed: Reals, size: int) -> Reals:
    """Symmetric matrices (m, size, size) from packed lower triangles."""
    rows, columns = np.tril_indices(size)
    result = np.empty((len(packed), size, size))
    result[:, rows, columns] = packed
    result[:, columns, rows] = packed
    return result


def _only(beams: Beams, chosen: Indices, properties: tuple[str, ...]) -> Beams:
    """The chosen beams with their `properties` for stiffness and nothing else."""
    none = np.zeros(len(chosen))
    axial, torsion, bending_y, bending_z = (
        getattr(beams, name)[chosen] if name in properties else none for name in _JOINT
    )
    return Beams(
        beams.ends[chosen],
        axial,
        torsion,
        bending_y,
        bending_z,
        beams.rest_length[chosen],
        beams.frames[chosen],
        beams.kind[chosen],
        beams.kinds,
    )


def _spread(values: Reals, dofs: Indices, state: State, columns: Indices) -> sp.csc_array:
    """Element values (m, d) as columns (6 n, k)."""
    wide = np.broadcast_to(columns[:, None], dofs.shape)
    shape = (6 * len(state.positions), int(columns.max()) + 1)
    return sp.csc_array((values.ravel(), (dofs.ravel(), wide.ravel())), shape=shape)
