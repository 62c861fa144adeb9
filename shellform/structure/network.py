"""A network of rods and cables with its supports: the structural model, whatever it came from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from shellform.arrays import Flags, Indices, Reals, Record, flags, reals
from shellform.errors import InputError, how_many
from shellform.quantities import number
from shellform.structure.elements.beam import Beams
from shellform.structure.elements.cable import Cables
from shellform.structure.solve.assembly import Assembly

_APART = 1e12  # ratio of stiffnesses of which double precision leaves four digits
_MISFIT = 2.0  # ratio of a beam's rest length to the distance of its nodes
_STRAIGHT = 1e-9  # off the axis, over the rod's length
_WIDE, _SLENDER = 150.0, 1e4  # m; length over radius of gyration: in metres elements of wire keep below it
_SPUN = 1e-4  # rad about an axis that is held, below which a node counts as not turned about it
_LOOSE = 1e-12  # of the firmest, an eigenvalue of what holds a part, below which it doesn't


@dataclass(frozen=True, eq=False)
class Network(Record):
    """`nodes` (n, 3), m, of the stress-free state; `beams`; `cables`; supports.

    `fixed` (n, 6): which translations and rotations along and about the global axes are held; `imposed` (n,
    6), m and rad (a rotation vector): the displacement that a held degree of freedom is given at load factor
    1.
    """

    nodes: Reals
    beams: Beams
    cables: Cables
    fixed: Flags
    imposed: Reals

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "nodes", reals("nodes", self.nodes, (None, 3)))
        count = len(self.nodes)
        put(self, "fixed", flags("fixed", self.fixed, (count, 6)))
        put(self, "imposed", reals("imposed", self.imposed, (count, 6)))
        for name, ends in [("beams", self.beams.ends), ("cables", self.cables.ends)]:
            if ends.size and ends.max() >= count:
                element = int(np.argmax(ends.max(axis=1) >= count))
                raise InputError(
                    "a node number is out of range",
                    where=f"{name}[{element}]",
                    value=ends[element].tolist(),
                    remedy="Nodes are counted from 0.",
                )


def assemble(network: Network) -> Assembly:
    """The assembler of the network's beams and cables. Raises InputError for what nothing restrains."""
    check_restrained(network)
    return Assembly(len(network.nodes), (network.beams, network.cables), network.fixed)


def check_restrained(network: Network) -> None:
    """Raises InputError naming a node without elements, or a connected part that could drift off along an
    axis.
    """
    count = len(network.nodes)
    ends = np.vstack([network.beams.ends, network.cables.ends])
    alone = np.ones(count, dtype=bool)
    alone[ends.ravel()] = False
    alone &= ~network.fixed[:, :3].all(axis=1)
    if alone.any():
        node = int(np.argmax(alone))
        raise InputError(
            "no element touches this node", where=f"nodes[{node}]", remedy="Remove it or connect it."
        )
    parts, label = connected(count, ends)
    for axis, name in enumerate("xyz"):
        held = np.zeros(parts, dtype=bool)
        held[label[network.fixed[:, axis]]] = True
        if not held.all():
            node = int(np.argmax(label == int(np.argmin(held))))
            size = int((label == label[node]).sum())
            raise InputError(
                f"nothing restrains the part of {size} nodes around this node along {name}",
                where=f"nodes[{node}]",
                remedy="Add a support.",
            )


def connected(count: int, ends: Indices) -> tuple[int, Indices]:
    """The number of connected parts of `count` nodes joined by `ends` (k, 2), and each node's part
    (count,).
    """
    graph = sp.coo_array((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(count, count))
    parts, label = connected_components(graph, directed=False)
    return int(parts), np.asarray(label, dtype=np.int64)


def doubts(network: Network) -> list[str]:
    """What is allowed but rarely meant, a sentence each: nodes in one place, elements side by side,
    stiffnesses too far apart, rest lengths far from the distance of their nodes, nodes in millimetres,
    displacements imposed on what isn't fixed, straight rods that nothing keeps from spinning about their own
    axis (that spin is held in the solution)."""
    return [
        *_coincident(network),
        *_side_by_side(network),
        *_far_apart(network),
        *_misfitting(network),
        *_in_millimetres(network),
        *_unheld(network),
        *_free_to_spin(network),
    ]


def lost_moments(network: Network, load: Reals) -> list[str]:
    """The same of moments of the `load` (n, 6) on nodes that have no rotations."""
    lost = np.asarray(load[:, 3:].any(axis=1))
    lost[network.beams.ends.ravel()] = False
    if not lost.any():
        return []
    first = int(np.argmax(lost))
    return [f"Moments act on nodes that no beam touches, nodes[{first}] the first: nothing bears them."]


def held_spins(network: Network, rotations: Reals) -> list[str]:
    """The same of nodes one of whose three rotations is held, with total `rotations` (n, 3), rad: held is
    their spin about that axis, step by step, and turns about both others add up to one about it, by the order
    in which they come."""
    held = network.fixed[:, 3:]
    off = np.where(held & (held.sum(axis=1) == 1)[:, None], np.abs(rotations), 0.0)
    node, axis = np.unravel_index(int(np.argmax(off)), off.shape)
    if not off[node, axis] > _SPUN:
        return []
    return [
        f"At nodes[{node}] only the rotation about {'xyz'[axis]} is held: held is its spin in each step, and by turning about both "
        f"other axes it has turned by {number(off[node, axis], 2)} rad about that one, by how much depends on the steps. Take more "
        "increments, or hold two rotations or none."
    ]


def _coincident(network: Network) -> list[str]:
    order = np.lexsort(network.nodes.T)
    same = (network.nodes[order[1:]] == network.nodes[order[:-1]]).all(axis=1)
    if not same.any():
        return []
    k = int(np.argmax(same))
    pair = sorted((int(order[k]), int(order[k + 1])))
    return [
        f"{how_many(int(same.sum()), 'node lies', 'nodes lie')} where another one does, nodes[{pair[0]}] and "
        f"nodes[{pair[1]}] the first; they don't touch."
    ]


def repeated(ends: Indices) -> tuple[Indices, Indices]:
    """Of elements between `ends` (k, 2), in either direction, those (r,) that join the two nodes of an
    earlier one, and the first (r,) that does."""
    _, first, of = np.unique(np.sort(ends, axis=1), axis=0, return_index=True, return_inverse=True)
    earlier = first[of.ravel()]
    again = np.flatnonzero(earlier != np.arange(len(ends)))
    return again, earlier[again]


def _side_by_side(network: Network) -> list[str]:
    told, beams = [], network.beams
    # What adds to another beam in part only, as the locks of two layers, is meant.
    whole = np.flatnonzero(beams.axial > 0.0)
    cables = np.arange(len(network.cables.ends))
    for name, ends, own in (("beam", beams.ends, whole), ("cable", network.cables.ends, cables)):
        again, earlier = repeated(ends[own])
        if len(again):
            told.append(
                f"{how_many(len(again), f'{name} joins', f'{name}s join')} two nodes that another one joins, "
                f"{name}s[{own[again[0]]}] beside {name}s[{own[earlier[0]]}] the first; all count."
            )
    return told


def _in_millimetres(network: Network) -> list[str]:
    beams, side = network.beams, float(np.ptp(network.nodes, axis=0).max())
    softer = np.minimum(beams.bending_y, beams.bending_z)
    bent = (softer > 0.0) & (beams.axial > 0.0)
    if side < _WIDE or not bent.any():
        return []
    thick = np.sqrt(softer[bent] / beams.axial[bent])  # radius of gyration, m, where EA and EI are right
    slender = float(np.median(beams.rest_length[bent] / thick))
    if slender < _SLENDER:
        return []
    return [
        f"The nodes reach over {number(side, 4)} m, and beams are {number(slender, 2)} times as long as EA and EI make them thick: if "
        f"millimetres were meant, write metres, {number(1e-3 * side, 4)} in place of {number(side, 4)}."
    ]


def _unheld(network: Network) -> list[str]:
    lost = ((network.imposed != 0.0) & ~network.fixed).any(axis=1)
    if not lost.any():
        return []
    return [
        f"Displacements are imposed on what isn't fixed, at nodes[{int(np.argmax(lost))}] the first: they count for nothing there."
    ]


def _far_apart(network: Network) -> list[str]:
    beams, cables = network.beams, network.cables
    length = beams.rest_length
    values = np.concatenate(
        [
            beams.axial / length,
            12.0 * beams.bending_y / length**3,
            12.0 * beams.bending_z / length**3,
            cables.stiffness / cables.rest_length,
        ]
    )
    there = values > 0.0
    if not there.any() or values.max() <= _APART * values[there].min():
        return []
    count = len(beams.ends)

    def named(k: int) -> str:
        return f"beams[{k % count}]" if k < 3 * count else f"cables[{k - 3 * count}]"

    stiff, soft = int(values.argmax()), int(np.where(there, values, np.inf).argmin())
    return [
        f"{named(stiff)} ({number(values[stiff], 2)} N/m) is {number(values[stiff] / values[soft], 2)} times as stiff as "
        f"{named(soft)}; digits are lost."
    ]


def _misfitting(network: Network) -> list[str]:
    beams = network.beams
    length = np.linalg.norm(network.nodes[beams.ends[:, 1]] - network.nodes[beams.ends[:, 0]], axis=1)
    off = (beams.rest_length > _MISFIT * length) | (beams.rest_length < length / _MISFIT)
    off &= ~beams.built_in  # their nodes lie elsewhere where they have no stress
    if not off.any():
        return []
    k = int(np.argmax(off))
    return [
        f"{int(off.sum())} beams have rest lengths far from the distance of their nodes, beams[{k}] the "
        "first "
        f"({beams.rest_length[k]:.4g} m over {length[k]:.4g} m)."
    ]


def _free_to_spin(network: Network) -> list[str]:
    ends = network.beams.ends
    if not len(ends):
        return []
    parts, label = connected(len(network.nodes), ends)
    touched = np.unique(ends)
    anchor = np.zeros(parts, dtype=np.int64)
    anchor[label[ends[::-1, 0]]] = ends[::-1, 0]
    axis = network.nodes[ends[:, 1]] - network.nodes[ends[:, 0]]
    direction = np.zeros((parts, 3))
    direction[label[ends[::-1, 0]]] = axis[::-1]
    direction[label[touched]] /= np.linalg.norm(direction[label[touched]], axis=1)[:, None]
    away = network.nodes[touched] - network.nodes[anchor[label[touched]]]
    own = direction[label[touched]]
    off = np.linalg.norm(np.cross(away, own), axis=1)
    size = np.zeros(parts)
    np.maximum.at(size, label[touched], np.linalg.norm(away, axis=1))
    crooked = np.zeros(parts, dtype=bool)
    np.logical_or.at(crooked, label[touched], off > _STRAIGHT * size[label[touched]])
    # A held rotation stops the spin where its axis has a part along the rod.
    held = np.zeros(parts, dtype=bool)
    np.logical_or.at(
        held, label[touched], (network.fixed[touched, 3:] & (np.abs(own) > _STRAIGHT)).any(axis=1)
    )
    has_beam = np.zeros(parts, dtype=bool)
    has_beam[label[touched]] = True
    free = np.flatnonzero(has_beam & ~crooked & ~held)
    if not len(free):
        return []
    first = int(anchor[free[0]])
    return [
        f"{len(free)} straight rods are free to spin about their own axis, the one at nodes[{first}] the "
        "first; the spin is held."
    ]


def swinging(network: Network) -> Indices:
    """A node (k,) of each of the parts of beams that their supports let turn as a whole and that no cable
    holds: the tangent of one that nothing loads is singular, but for what holds rotations in the solution."""
    touched, ends = np.unique(network.beams.ends), network.beams.ends
    if not len(touched):
        return touched
    _, first, label = np.unique(
        connected(len(network.nodes), ends)[1][touched], return_index=True, return_inverse=True
    )
    parts, place = len(first), network.nodes[touched]
    middle = np.zeros((parts, 3))
    np.add.at(middle, label, place)
    arm = place - (middle / np.bincount(label)[:, None])[label]
    reach = np.zeros(parts)
    np.maximum.at(reach, label, np.linalg.norm(arm, axis=1))
    arm /= reach[label, None]
    # What a held degree of freedom keeps still of the motion u + ω × arm, and of the turn ω.
    node, dof = np.nonzero(network.fixed[touched])
    axis = np.eye(3)[dof % 3]
    shifts = (dof < 3)[:, None]
    held = np.hstack([np.where(shifts, axis, 0.0), np.where(shifts, np.cross(arm[node], axis), axis)])
    grip = np.zeros((parts, 6, 6))
    np.add.at(grip, label[node], held[:, :, None] * held[:, None, :])
    values, vectors = np.linalg.eigh(grip)
    loose = (values < _LOOSE * np.maximum(values[:, -1:], 1.0)).sum(axis=1)
    # A straight rod's spin moves no node.
    softest = vectors[:, :, 0][label]
    moved = np.zeros(parts)
    np.maximum.at(moved, label, np.linalg.norm(softest[:, :3] + np.cross(softest[:, 3:], arm), axis=1))
    swings = (loose > 1) | ((loose == 1) & (moved > _STRAIGHT))
    swings[label[np.isin(touched, network.cables.ends)]] = False
    return touched[first[swings]]


def free_to_swing(found: Indices) -> list[str]:
    """The same of parts of beams that swing, a node (k,) of each of which was `found`."""
    if not len(found):
        return []
    return [
        f"{len(found)} parts of beams can swing about their supports as a whole, the one at nodes[{found[0]}] the first; "
        "where no load holds such a swing it is held, and `stable` disregards it."
    ]
