"""What each support bears under a load: the force of the ground on the shell, split into what presses the
foot down, what it has to be held down with, and what pushes it sideways.

A support's reaction is the internal forces of its node less the load that acts on it directly. It is what the
support pushes the shell with: upwards where the shell rests on it, downwards (uplift) where it holds the
shell down, inwards where it takes an arch's thrust.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shellform.arrays import Indices, Reals
from shellform.gridshell.gridshell import Design, Gridshell
from shellform.net.edges import HELD
from shellform.net.net import Net
from shellform.net.polylines import nearest
from shellform.structure.elements.state import State
from shellform.structure.network import assemble


@dataclass(frozen=True)
class Support:
    """One support under one load: its number in the net's `supports` and its `node`; the `kind` and `name` of
    the edge that it belongs to; its `place` (3,), m; the `force` (3,), N, with which it pushes the shell."""

    number: int
    node: int
    kind: str
    name: str
    place: tuple[float, float, float]
    force: tuple[float, float, float]

    @property
    def pressure(self) -> float:
        """What the shell presses on it with, N; 0 where it lifts off."""
        return max(self.force[2], 0.0)

    @property
    def uplift(self) -> float:
        """What it has to be held down with, N; 0 where the shell rests on it."""
        return max(-self.force[2], 0.0)

    @property
    def thrust(self) -> float:
        """The horizontal force on it, N."""
        return float(np.hypot(self.force[0], self.force[1]))


@dataclass(frozen=True)
class Reactions:
    """All `supports` of a design under one load, and the largest `uplift`, `thrust` and `pressure`, N."""

    supports: tuple[Support, ...]

    @property
    def uplift(self) -> float:
        """N, of the support that needs the most."""
        return max(each.uplift for each in self.supports)

    @property
    def thrust(self) -> float:
        """N, of the support that needs the most."""
        return max(each.thrust for each in self.supports)

    @property
    def pressure(self) -> float:
        """N, of the support that bears the most."""
        return max(each.pressure for each in self.supports)

    @property
    def total(self) -> tuple[float, float, float]:
        """The sum (3,), N: what carries the load."""
        x, y, z = np.array([each.force for each in self.supports]).sum(axis=0)
        return float(x), float(y), float(z)


def reactions(shell: Gridshell, design: Design, state: State, load: Reals) -> Reactions:
    """What every support of the design bears in the equilibrium `state` under the `load` (n, 6), N."""
    held = shell.net.supports
    kinds = edge_of(shell.net, held)
    force = assemble(shell.network(design)).unbalanced(state, load)[held, :3]
    return Reactions(
        tuple(
            Support(number, int(node), *kinds[number], _three(state.positions[node]), _three(force[number]))
            for number, node in enumerate(held)
        )
    )


def edge_of(net: Net, nodes: Indices) -> list[tuple[str, str]]:
    """Kind and name of the held stretch of the edge that is nearest to each of the nodes in the target; where
    the net doesn't know its edges, the ground."""
    held = [each for each in net.stretches if each.kind in HELD]
    if not held:
        return [("ground", "")] * len(nodes)
    place = net.target.positions[nodes]
    away = np.array([nearest(place, each.points)[0] for each in held])
    return [(held[k].kind, held[k].name) for k in np.argmin(away, axis=0)]


def _three(values: Reals) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z
