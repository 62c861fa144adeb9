"""Where cables can be: on both diagonals of cells, below the surface."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from shellform.arrays import Indices, indices
from shellform.net.grid import cells, edge_diagonals
from shellform.net.net import Net
from shellform.surface.shape.locate import Locator
from shellform.surface.shape.target import Surface

_SAMPLES = (0.25, 0.5, 0.75)  # where along a cable its height over the surface is taken


@lru_cache(maxsize=1)  # of one net for every rod that is tried on it
def candidate_cables(net: Net, below: Surface, *, edge_cells: bool) -> Indices:
    """Ends (c, 2) of the candidates: both diagonals of every cell whose corners are all joints, and with
    `edge_cells` behind them the one of every cell at the edge that has three; those that rise above the
    surface `below` which they have to stay are left out."""
    corners = cells(net.grid)
    pairs = [corners[:, [0, 2]], corners[:, [1, 3]]]
    if edge_cells:
        pairs.append(edge_diagonals(net.grid))
    ends = net.grid.crossing_nodes[:, 0][np.vstack(pairs)]
    place = net.target.positions[ends]
    finder = Locator(below)
    above = np.zeros(len(ends), dtype=bool)
    for share in _SAMPLES:
        above |= finder.foot((1.0 - share) * place[:, 0] + share * place[:, 1]).distance > 0.0
    return indices("ends", ends[~above], (None, 2), below=net.node_count)
