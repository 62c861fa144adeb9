"""Candidate cables in cells at the edge."""

import numpy as np
import pytest

import shellform as sf
from shellform.net.grid import edge_diagonals
from shellform.surface.shape.target import make_surface


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


@pytest.mark.parametrize("edge_cells", [False, True])
def test_a_candidate_stays_only_where_its_quarters_and_its_middle_lie_below_the_surface(shell, edge_cells):
    """Below a level the vault's diagonals split into those that stay and those that go."""
    corners = [[-9.0, -9.0], [9.0, -9.0], [9.0, 9.0], [-9.0, 9.0]]
    lower = shell.net.grid.crossing_nodes[:, 0]
    heights = shell.net.target.positions[lower, 2]
    level = float(np.quantile(heights, 0.6))
    plane = make_surface(np.column_stack([corners, np.full(4, level)]), [[0, 1, 2], [0, 2, 3]])
    far = make_surface(np.column_stack([corners, np.full(4, 9.0)]), [[0, 1, 2], [0, 2, 3]])
    kept, every = (
        sf.brace(shell.net, shell.rod, shell.joint, shell.cable, below=each, edge_cells=edge_cells).cable_ends
        for each in (plane, far)
    )
    ends = shell.net.target.positions[every][:, :, 2]
    along = np.array([0.25, 0.5, 0.75])
    height = ends[:, :1] * (1.0 - along) + ends[:, 1:] * along
    stays = height.max(axis=1) <= level
    assert 20 < stays.sum() < len(every) - 20
    across = (ends.min(axis=1) < level) & (ends.max(axis=1) > level)
    assert stays[across].any(), "an end may lie above, where the rod does"
    assert not stays[across].all()
    np.testing.assert_array_equal(kept, every[stays])
