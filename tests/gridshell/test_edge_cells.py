"""Candidate cables in cells at the edge."""

import numpy as np

import shellform as sf
from shellform.net.grid import edge_diagonals


def test_the_vault_has_a_candidate_more_in_each_of_its_22_cells_of_three_joints(shell, vault):
    """145 cells of four joints, and 22 of three, whose one diagonal ends at no support and lies below the
    surface.
    """
    more = sf.brace(shell.net, shell.rod, shell.joint, shell.cable, below=vault, edge_cells=True)
    assert (len(shell.cable_ends), len(more.cable_ends)) == (290, 312)
    np.testing.assert_array_equal(more.cable_ends[:290], shell.cable_ends)
    added = more.cable_ends[290:]
    lower = shell.net.grid.crossing_nodes[:, 0]
    assert np.isin(added, lower).all()
    assert not np.isin(added, shell.net.supports).any()
    pairs = {tuple(sorted(each)) for each in more.cable_ends.tolist()}
    assert len(pairs) == 312
    # across a cell, from a rod's end to the next rod's
    grid = shell.net.grid
    apart = np.abs(np.diff(grid.lattice[edge_diagonals(grid)], axis=1))
    assert (apart == 1).all()
