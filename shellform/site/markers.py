"""What marked nodes are called on site: drawings number crossings and rods, the model file numbers nodes.

A crossing has two nodes, on its lower (U) and its upper (V) rod; other nodes lie between crossings.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shellform.arrays import Indices, Record, indices
from shellform.errors import InputError
from shellform.net.grid import Grid, rod_names


@dataclass(frozen=True, eq=False)
class Markers(Record):
    """Of marked `nodes` (m,) the `crossings` (m,) at which they lie, -1 between crossings, and their `rods`,
    named as in drawings: U5, V16."""

    nodes: Indices
    crossings: Indices
    rods: tuple[str, ...]

    def called(self, which: Sequence[int] | Indices) -> str:
        """Those of the markers (k,), as drawings call them, and by node where these have no name for it."""
        return ", ".join(
            f"node {self.nodes[k]} of rod {self.rods[k]}"
            if self.crossings[k] < 0
            else f"crossing {self.crossings[k]} (rod {self.rods[k]})"
            for k in which
        )

    def places(self) -> list[tuple[int, int | str, str]]:
        """Of each marker its node, its crossing ("" between crossings) and its rod, as tables have them."""
        crossings = ("" if each < 0 else each for each in self.crossings.tolist())
        return list(zip(self.nodes.tolist(), crossings, self.rods, strict=True))


def markers_of(grid: Grid, nodes: Indices) -> Markers:
    """The names of `nodes` (m,) of a grid."""
    crossing = np.full(len(grid.flat), -1, dtype=np.int64)
    for side in (0, 1):
        crossing[grid.crossing_nodes[:, side]] = np.arange(len(grid.crossing_nodes))
    rod = np.zeros(len(grid.flat), dtype=np.int64)
    for k, each in enumerate(grid.rods):
        rod[each.nodes] = k
    names = rod_names(grid)
    return Markers(nodes, crossing[nodes], tuple(names[k] for k in rod[nodes].tolist()))


def marked(node_count: int, nodes: Indices) -> Indices:
    """The numbers `nodes` (m,) of markers on a grid of so many nodes. Raises InputError where a number isn't
    one of theirs or comes twice."""
    markers = indices("nodes", nodes, (None,), below=node_count)
    if len(np.unique(markers)) < len(markers):
        raise InputError(
            "a node is marked twice", where="nodes", remedy="Give each marker a node of its own."
        )
    return markers
