"""A network of rods and cables with its supports: the structural model, whatever it came from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from shellform.arrays import Flags, Indices, Reals, flags, reals
from shellform.errors import InputError
from shellform.structure.assembly import Assembly
from shellform.structure.beam import Beams
from shellform.structure.cable import Cables


@dataclass(frozen=True)
class Network:
    """`nodes` (n, 3), m, of the stress-free state; `beams`; `cables`; supports.

    `fixed` (n, 6): which translations and rotations along and about the global axes are held; `imposed` (n, 6), m and
    rad (a rotation vector): the displacement that a held freedom is given at load factor 1.
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
                raise InputError("a node number is out of range", where=f"{name}[{element}]", value=ends[element].tolist())


def assemble(network: Network) -> Assembly:
    """The assembler of the network's beams and cables. Raises InputError for what nothing restrains."""
    check_restrained(network)
    return Assembly(len(network.nodes), (network.beams, network.cables), network.fixed)


def check_restrained(network: Network) -> None:
    """Raises InputError naming a node without elements, or a connected part that could drift off along an axis."""
    count = len(network.nodes)
    ends = np.vstack([network.beams.ends, network.cables.ends])
    alone = np.ones(count, dtype=bool)
    alone[ends.ravel()] = False
    alone &= ~network.fixed[:, :3].all(axis=1)
    if alone.any():
        node = int(np.argmax(alone))
        raise InputError("no element touches this node", where=f"nodes[{node}]", remedy="Remove it or connect it.")
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
    """The number of connected parts of `count` nodes joined by `ends` (k, 2), and each node's part (count,)."""
    graph = sp.coo_array((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(count, count))
    parts, label = connected_components(graph, directed=False)
    return int(parts), np.asarray(label, dtype=np.int64)
