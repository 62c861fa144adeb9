"""Models that several cases share, and the ways in which they are solved: under loads, at a held degree of
freedom, at critical points.
"""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from shellform.arrays import Reals
from shellform.structure.answers.stability import critical_load
from shellform.structure.elements.beam import make_beams
from shellform.structure.elements.cable import Cables, make_cables
from shellform.structure.elements.state import State, at_rest
from shellform.structure.network import Network, assemble
from shellform.structure.solve.drive import forces
from shellform.structure.solve.equilibrium import find_equilibrium
from shellform.structure.solve.path import follow

Stiffness = tuple[float, float, float, float]
"""EA, GJ, EI_y, EI_z."""

CLAMP = [True] * 6
PIN = [True, True, True, False, False, False]
FORK = [True, True, True, True, False, False]
"""Held in place and against spin about x; free to turn about y and z."""


def no_cables() -> Cables:
    """None at all."""
    return make_cables(np.zeros((0, 2)), rest_length=1.0, stiffness=1.0)


def chain(points: Reals, stiffness: Stiffness, held: dict[int, list[bool]]) -> Network:
    """Beams from point to point (n, 3) with (EA, GJ, EI_y, EI_z); `held` degrees of freedom by node."""
    count = len(points)
    ends = np.column_stack([np.arange(count - 1), np.arange(1, count)])
    ea, gj, ey, ez = stiffness
    fixed = np.zeros((count, 6), dtype=bool)
    for node, dofs in held.items():
        fixed[node] = dofs
    beams = make_beams(points, ends, axial=ea, torsion=gj, bending_y=ey, bending_z=ez)
    return Network(points, beams, no_cables(), fixed, np.zeros((count, 6)))


def ropes(points: Reals, cables: Cables, anchors: ArrayLike) -> Network:
    """Cables alone, the nodes `anchors` held."""
    none = make_beams(
        points, np.zeros((0, 2), dtype=int), axial=1.0, torsion=1.0, bending_y=1.0, bending_z=1.0
    )
    fixed = np.zeros((len(points), 6), dtype=bool)
    fixed[np.asarray(anchors), :3] = True
    return Network(points, none, cables, fixed, np.zeros((len(points), 6)))


def line(elements: int, length: float = 1.0) -> Reals:
    """Points (elements + 1, 3) along x from the origin."""
    return np.column_stack([np.linspace(0.0, length, elements + 1), np.zeros((elements + 1, 2))])


def polyline(corners: ArrayLike, elements: int) -> Reals:
    """Points along straight legs between the corners (k, 3), `elements` a leg."""
    ends = np.asarray(corners, dtype=float)
    legs = [np.linspace(a, b, elements + 1)[1:] for a, b in itertools.pairwise(ends)]
    return np.vstack([ends[:1], *legs])


def in_plane(network: Network) -> Network:
    """The same with all motion out of the x-z plane held."""
    fixed = network.fixed.copy()
    fixed[:, [1, 3, 5]] = True
    return replace(network, fixed=fixed)


def load_at(network: Network, node: int, load: ArrayLike) -> Reals:
    """The load (n, 6) with `load` (6,) or (3,) at one node."""
    force = np.zeros((len(network.nodes), 6))
    given = np.asarray(load, dtype=float)
    force[node, : len(given)] = given
    return force


def solved(network: Network, load: Reals | None = None, start: State | None = None) -> State:
    """The equilibrium reached from `start` (at rest unless given) under the load at once."""
    force = np.zeros((len(network.nodes), 6)) if load is None else load
    return find_equilibrium(assemble(network), start or at_rest(network.nodes), force).state


def pushed(
    network: Network, start: State, dof: tuple[int, int], places: ArrayLike
) -> list[tuple[State, float]]:
    """The equilibria where one translation (node, axis) is held at one coordinate after the other, and the
    force that holds it.

    Displacement control: what is unstable under a dead load is stable here, and a limit point is no obstacle.
    """
    node, axis = dof
    fixed = network.fixed.copy()
    fixed[node, axis] = True
    assembly = assemble(replace(network, fixed=fixed))
    none = np.zeros((len(network.nodes), 6))
    state, found = start, []
    for place in np.atleast_1d(np.asarray(places, dtype=float)):
        positions = state.positions.copy()
        positions[node, axis] = place
        state = find_equilibrium(assembly, State(positions, state.quaternions), none).state
        found.append((state, float(assembly.evaluate(state, tangent=False).force[node, axis])))
    return found


def critical(network: Network, load: Reals, goal: float) -> float:
    """The factor of the load, up to `goal`, at which the unloaded shape's branch loses stability; NaN where
    it doesn't.
    """
    found = critical_load(assemble(network), at_rest(network.nodes), forces(load), goal=goal)
    return found.factor if found is not None else float("nan")


def turning_points(network: Network, load: Reals, node: int, goal: float) -> list[tuple[float, float]]:
    """Load factor and drop of a node at the limit points and bifurcations of the path from no load to `goal`
    (arc length).
    """
    path = follow(assemble(network), at_rest(network.nodes), forces(load), goal=goal)
    height = float(network.nodes[node, 2])
    return [(p.factor, height - float(p.equilibrium.state.positions[node, 2])) for p in path if p.event]


def order(errors: ArrayLike) -> float:
    """The observed order of convergence of the errors (k,) of meshes each twice as fine as the one before:
    the last pair's.
    """
    first, second = np.abs(np.asarray(errors, dtype=float))[-2:]
    return float(np.log2(first / second))
