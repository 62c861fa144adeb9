"""What is measured of a net, and what is refused."""

import contextlib
import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from shellform.errors import InputError
from shellform.net import cover, quality
from shellform.net.chebyshev import pull_net
from shellform.net.grid import cells, lattice_grid
from shellform.net.refusal import NoNet
from shellform.structure.elements.rotation import matrices
from shellform.structure.elements.state import State, at_rest
from shellform.surface.shape.locate import Locator
from shellform.surface.shape.target import make_surface


@pytest.fixture(scope="module")
def plane():
    corners = np.array([[-2.0, -2.0, 0.0], [4.0, -2.0, 0.0], [4.0, 4.0, 0.0], [-2.0, 4.0, 0.0]])
    return make_surface(corners, [[0, 1, 2], [0, 2, 3]])


@pytest.fixture(scope="module")
def grid():
    places = np.array([(i, j) for i in range(6) for j in range(6)])
    return lattice_grid(places, spacing=(0.3, 0.4), gap=0.01, elements=2)


def test_a_flat_net_on_a_plane_is_perfect(plane, grid):
    state = at_rest(grid.flat)
    covered = cover.cover(plane, grid, state)
    found = quality.measure(
        Locator(plane),
        grid,
        state,
        np.zeros((len(grid.rod_ends), 2, 2)),
        np.zeros(grid.node_count),
        spent=0,
        bare=covered.bare,
    )
    assert found.distance_max < 1e-15
    assert found.spacing_error_max < 1e-12
    assert found.shear_angle_min == pytest.approx(0.5 * np.pi)
    assert found.gaussian_curvature == pytest.approx(0.0, abs=1e-12)
    bare = plane.area - (1.5 + 2 * 0.26) * (2.0 + 2 * 0.26)
    assert found.uncovered_area == pytest.approx(bare, rel=0.02)
    assert "distance" not in found.summary()


def test_a_sheared_net_has_its_angle(plane, grid):
    shear = np.array([[1.0, np.sin(0.4), 0.0], [0.0, np.cos(0.4), 0.0], [0.0, 0.0, 1.0]])
    turned = at_rest(grid.flat).quaternions.copy()
    for rod in grid.rods:
        if rod.direction == "v":
            turned[rod.nodes] = [np.cos(0.2), 0.0, 0.0, -np.sin(0.2)]
    state = State(grid.flat @ shear.T, turned)
    np.testing.assert_allclose(quality.shear_angles(grid, state), 0.5 * np.pi - 0.4)
    quality.refuse_folds(Locator(plane), grid, state)


def test_a_folded_net_is_refused(plane, grid):
    folded = grid.flat.copy()
    beyond = folded[:, 0] > 0.65
    folded[beyond, 0] = 1.2 - folded[beyond, 0]
    with pytest.raises(InputError, match=r"folds over itself in \d+ cells, first at \[.*adds up"):
        quality.refuse_folds(Locator(plane), grid, at_rest(folded))


def test_a_net_that_lies_on_itself_is_refused(plane):
    # A ring that closes and goes on: the far columns come to lie on the first ones.
    places = np.array([(i, j) for i in range(30) for j in range(2)])
    ring = lattice_grid(places, spacing=(0.3, 0.3), gap=0.01, elements=1)
    turn, radius = ring.flat[:, 0] / 1.1, 1.1 - ring.flat[:, 1]
    wound = np.column_stack([radius * np.sin(turn), 1.1 - radius * np.cos(turn), 0.0 * turn])
    with pytest.raises(InputError, match="lie on one another"):
        quality.refuse_folds(Locator(plane), ring, at_rest(wound))


def measured(plane, grid, places, *, curvature=None, pull=None):
    bent = np.zeros((len(grid.rod_ends), 2, 2)) if curvature is None else curvature
    pull = np.zeros(grid.node_count) if pull is None else pull
    return quality.measure(Locator(plane), grid, at_rest(places), bent, pull, spent=0, bare=0.0)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_net_off_its_surface_is_refused_above_and_below(plane, grid, side):
    raised = grid.flat + np.array([0.0, 0.0, 0.2 * side])
    found = measured(plane, grid, raised)
    np.testing.assert_allclose(found.distance, 0.2 * side)
    assert (found.distance_max, found.distance_mean) == pytest.approx((0.2, 0.2))
    with pytest.raises(InputError, match=r"0\.2 m off the surface at \["):
        quality.refuse_distance(found, grid, at_rest(raised))
    assert grid.scale == pytest.approx(np.sqrt(0.3 * 0.4))
    for share, off in ((0.099, False), (0.101, True)):
        near = dataclasses.replace(found, distance_max=share * grid.scale)
        if off:
            with pytest.raises(InputError, match="off the surface"):
                quality.refuse_distance(near, grid, at_rest(raised))
        else:
            quality.refuse_distance(near, grid, at_rest(raised))


def test_a_net_half_above_and_half_below_its_surface_is_off_by_as_much_in_the_mean(plane, grid):
    tilted = grid.flat.copy()
    tilted[:, 2] = 0.1 * np.sign(tilted[:, 0] - 0.7)
    found = measured(plane, grid, tilted)
    assert found.distance_mean == pytest.approx(0.1)
    assert sorted({round(float(each), 9) for each in found.distance}) == [-0.1, 0.1]


def test_a_stretched_net_s_spacing_error_has_its_sign_and_the_largest_counts_whatever_it_is(plane, grid):
    for stretch, error in (([1.02, 1.0, 1.0], 0.02), ([1.01, 0.97, 1.0], 0.03)):
        found = measured(plane, grid, grid.flat * stretch)
        assert found.spacing_error_max == pytest.approx(error)
        assert found.spacing_error.max() == pytest.approx(stretch[0] - 1.0)
        assert found.spacing_error.min() == pytest.approx(min(stretch[1] - 1.0, 0.0), abs=1e-12)


def test_curvature_and_pull_are_the_largest_and_the_mean_of_what_is_given(plane, grid):
    bent = np.zeros((len(grid.rod_ends), 2, 2))
    bent[3, 0], bent[5, 1], bent[7, 0] = [-3.0, 4.0], [4.5, 0.0], [0.0, -4.2]
    pull = np.zeros(grid.node_count)
    pull[2], pull[4] = 0.5, 0.1
    found = measured(plane, grid, grid.flat, curvature=bent, pull=pull)
    assert found.curvature_max == pytest.approx(5.0)
    assert (found.curvature_out_of_plane_max, found.curvature_in_plane_max) == (4.5, 4.2)
    assert (found.pull_max, found.pull_mean) == pytest.approx((0.5, 0.6 / grid.node_count))


@pytest.mark.parametrize(("share", "refused"), [(0.39, True), (0.41, False)])
def test_parts_of_a_net_lie_on_one_another_nearer_than_two_fifths_of_the_smaller_spacing(
    plane, share, refused
):
    """Two strips of two columns, the second one laid so near to the first one."""
    strip = lattice_grid(
        np.array([(i, j) for i in (0, 1, 4, 5) for j in range(2)]), spacing=(0.3, 0.4), gap=0.0, elements=1
    )
    apart = strip.flat.copy()
    far = apart[:, 0] > 0.9
    apart[far, 0] += 0.3 * (1.0 + share) - 1.2
    if refused:
        with pytest.raises(InputError, match="lie on one another in 2 places"):
            quality.refuse_folds(Locator(plane), strip, at_rest(apart))
    else:
        quality.refuse_folds(Locator(plane), strip, at_rest(apart))


def test_the_farthest_crossing_and_the_sharpest_one_tell_a_net_s_distance_and_shear(plane, grid):
    place, turned = grid.flat.copy(), at_rest(grid.flat).quaternions.copy()
    place[grid.crossing_nodes[7], 2] += 0.05
    turned[grid.rods[-1].nodes] = [np.cos(0.2), 0.0, 0.0, -np.sin(0.2)]
    bent, pull = np.zeros((len(grid.rod_ends), 2, 2)), np.zeros(grid.node_count)
    found = quality.measure(Locator(plane), grid, State(place, turned), bent, pull, spent=5, bare=0.0)
    assert found.distance_max == pytest.approx(0.05)
    assert found.distance_mean == pytest.approx(0.05 / len(grid.lattice))
    assert found.shear_angle_min == pytest.approx(0.5 * np.pi - 0.4)
    assert found.factorisations == 5


def test_a_cell_is_folded_where_one_of_its_corners_is_turned_over(plane):
    """A square whose corner is pushed in beyond the diagonal."""
    cell = lattice_grid(np.array([(0, 0), (1, 0), (0, 1), (1, 1)]), spacing=(0.3, 0.3), gap=0.0, elements=1)
    for share, refused in ((0.55, False), (0.45, True)):
        pushed = cell.flat.copy()
        pushed[np.abs(pushed - [0.3, 0.3, 0.0]).max(axis=1) < 1e-9, :2] = 0.3 * share
        told = pytest.raises(NoNet, match="in 1 cell,") if refused else contextlib.nullcontext()
        with told:
            quality.refuse_folds(Locator(plane), cell, at_rest(pushed))


def test_crossings_that_lie_nearer_or_farther_than_their_spacing_by_half_a_percent_are_told_with_their_place(
    grid,
):
    error = np.zeros(60)
    error[3] = 0.001
    for worst, said in (
        (-0.0049, ""),
        (0.0049, ""),
        (-0.0054, "0.54 % nearer"),
        (-0.00502, "0.5020 % nearer"),
        (0.0071, "0.71 % farther"),
    ):
        error[8] = worst
        made = SimpleNamespace(spacing_error=error, spacing_error_max=abs(worst))
        told = quality.nearness(made, grid, at_rest(grid.flat))
        assert bool(told) == bool(said)
        assert said in told
    pair = quality.neighbours(grid)[0][8]
    place = quality.crossing_points(grid, at_rest(grid.flat))[pair].mean(axis=0).round(3).tolist()
    assert f"crossings at {place} lie" in told
    assert "where up to 0.50 % is usual" in told


def test_the_resultant_curvature_is_made_of_its_two_parts(net):
    bent = net.quality.curvature
    assert bent.shape == (len(net.grid.rod_ends), 2, 2)
    assert net.quality.curvature_out_of_plane_max <= net.quality.curvature_max
    np.testing.assert_allclose(net.curvature, np.hypot(bent[..., 0], bent[..., 1]))


def test_hazzidakis_formula_holds_over_every_rectangle_of_the_net(vault, net):
    """The Gaussian curvature of a patch of a net adds up to 2π less its four angles (Hazzidakis 1879)."""
    finder = Locator(vault, reach=0.1)
    quads = cells(net.grid)
    corner = net.crossings[quads]
    inside = quality.gaussian(finder, corner)
    place = {tuple(p): k for k, p in enumerate(net.grid.lattice.tolist())}
    of_cell = {tuple(net.grid.lattice[q[0]].tolist()): k for k, q in enumerate(quads)}
    nodes = net.grid.crossing_nodes
    tangents = [matrices(net.target.quaternions[nodes[:, layer]])[:, :, layer] for layer in (0, 1)]
    angle = np.arccos(np.sum(tangents[0] * tangents[1], axis=1))
    tried = 0
    for i, j in place:
        for m, n in ((1, 1), (2, 2), (3, 4), (4, 3), (5, 5)):
            wanted = [(i + a, j + b) for a in range(m) for b in range(n)]
            if not all(w in of_cell for w in wanted):
                continue
            total = inside[[of_cell[w] for w in wanted]].sum()
            omega = [angle[place[p]] for p in ((i, j), (i + m, j), (i + m, j + n), (i, j + n))]
            missing = -omega[0] + omega[1] - omega[2] + omega[3]  # the angles at two corners are π less omega
            assert missing == pytest.approx(total, abs=0.01 + 0.03 * abs(total))
            tried += 1
    assert tried > 100


def test_a_net_whose_crossings_come_nearer_than_their_spacing_is_refused_with_the_place_and_one_that_bends_less_is_not():
    """A rod of length s on a cylinder of radius R has a chord of 2 R sin(s / 2R): 0.5 % less at s = 0.35
    R."""
    for radius, refused in ((2.7, True), (3.3, False)):
        around, along = np.linspace(-1.2, 1.2, 31), np.linspace(-3.0, 3.0, 31)
        t, y = (each.ravel() for each in np.meshgrid(around, along, indexing="ij"))
        i = np.arange(31 * 31).reshape(31, 31)
        a, b, c, d = (each.ravel() for each in (i[:-1, :-1], i[1:, :-1], i[1:, 1:], i[:-1, 1:]))
        faces = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
        barrel = make_surface(np.column_stack([radius * np.sin(t), y, radius * np.cos(t)]), faces)
        net = pull_net(barrel, spacing=1.0, gap=0.001, elements=4)
        told = (
            pytest.raises(NoNet, match="nearer than their spacing") if refused else contextlib.nullcontext()
        )
        with told:
            quality.refuse_nearness(net.quality, net.grid, net.target)
