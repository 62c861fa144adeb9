"""How rods and edge beams leave the ground: tangents of their axes at the supports.

A rod's tangent is what its flat direction becomes where its end is turned as the state says. An element's
chord isn't it: it lags behind by half the turn of the element. Edge beams are made in their curve, and their
nodes aren't turned along with it; their tangent is that of the parabola through their first three nodes.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from shellform.arrays import Reals
from shellform.net.grid import rod_names
from shellform.net.net import Net
from shellform.output.workshop.edge_schedule import edge_names
from shellform.structure.elements.rotation import matrices
from shellform.structure.elements.state import State


def rods_away(net: Net, state: State) -> dict[int, Reals]:
    """By the node at each end of each rod the unit vector (3,) along the rod's axis there, into the rod."""
    turned, flat = matrices(state.quaternions), net.grid.flat
    found = {}
    for rod in net.grid.rods:
        for foot, inner in ((0, 1), (-1, -2)):
            node = int(rod.nodes[foot])
            along = flat[rod.nodes[inner]] - flat[node]
            found[node] = turned[node] @ (along / np.linalg.norm(along))
    return found


def edge_away(places: Reals) -> Reals:
    """The unit vector (3,) along an edge beam at its foot, the first of the `places` (k, 3), m, of its
    nodes."""
    first = places[1] - places[0]
    if len(places) > 2:
        second = places[2] - places[0]
        one, other = np.linalg.norm(first), np.linalg.norm(first) + np.linalg.norm(places[2] - places[1])
        first = first * other / one - second * one / other
    return np.asarray(first / np.linalg.norm(first))


def away(net: Net, state: State) -> dict[int, tuple[str, str, Reals]]:
    """By node what ends there: names, which of their ends, "first" or "second", and the unit vector (3,)
    along it from there; of edge beams that meet in one the first one's."""
    along = rods_away(net, state)
    ends = {
        int(rod.nodes[side]): (name, word, along[int(rod.nodes[side])])
        for name, rod in zip(rod_names(net.grid), net.grid.rods, strict=True)
        for side, word in ((0, "first"), (-1, "second"))
    }
    for name, line in zip(edge_names(net), net.edges, strict=True):
        for nodes, word in ((line.nodes[:3], "first"), (line.nodes[:-4:-1], "second")):
            names, words, lead = ends.get(int(nodes[0]), ("", "", edge_away(state.positions[nodes])))
            ends[int(nodes[0])] = (
                f"{names}, {name}" if names else name,
                f"{words}, {word}" if words else word,
                lead,
            )
    return ends


def fixing_note(net: Net) -> tuple[str, ...]:
    """When supports are fixed, and rods' ends to edge beams, a sentence; nothing where no rod ends on one."""
    supported = not set(rods_away(net, net.target)).isdisjoint(net.supports.tolist())
    if not net.edges and not supported:
        return ()
    if not net.edges:
        last = "Fix supports last, where rods' ends"
    elif supported:
        last = "Fix supports, and rods' ends to edge beams, last, where these ends"
    else:
        last = "Fix edge beams' feet, and rods' ends to the beams, last, where they"
    return (
        f"{last} lie while a scaffold holds the crossings: rods that are bent by the little that a support is off bow out, "
        "and thick ones break.",
    )


def turning_note(net: Net, states: Mapping[str, State]) -> tuple[str, ...]:
    """How much rods turn in their supports from the wanted shape to each of the `states`, a sentence; nothing
    where none stands on a support."""
    wanted = rods_away(net, net.target)
    feet = {int(node): number for number, node in enumerate(net.supports) if int(node) in wanted}
    if not feet:
        return ()
    most = []
    for name, state in states.items():
        here = rods_away(net, state)
        # twice the arcsine of half the difference keeps small angles to full precision
        turns = {
            node: 2.0 * np.arcsin(min(1.0, 0.5 * float(np.linalg.norm(here[node] - wanted[node]))))
            for node in feet
        }
        node = max(turns, key=lambda each: turns[each])
        most.append(f"{name} up to {np.degrees(turns[node]):.1f}° (S{feet[node]})")
    return (f"From these directions rods turn in their supports: {', '.join(most)}.",)
