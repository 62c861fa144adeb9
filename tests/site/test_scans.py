"""Points named after markers, by hand: pairs, starts, motions and doubts of small lopsided sets."""

import re
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from shellform.errors import InputError
from shellform.site import scans
from shellform.site.scans import (
    Match,
    Motion,
    Scan,
    apart,
    counted_alike,
    distances,
    laid,
    match,
    refuse_unlike,
    rigid_fit,
)

MARKERS = np.array(
    [[0, 0, 0], [4, 0, 0.5], [7, 1, 0], [1, 3, 0.9], [5, 4, 0.3], [2, 6, 0], [8, 5, -0.4], [-3, 2, 0.2]]
) + np.array([20.0, -30.0, 5.0])
TURN, SHIFT = Rotation.from_rotvec([0.3, -0.5, 2.0]).as_matrix(), np.array([3.0, -40.0, 7.0])
MIDDLE = np.array([50.0, 20.0, 10.0])
NONE = np.zeros((1, 6))


def turned(degrees):
    """About z."""
    return Rotation.from_rotvec([0.0, 0.0, np.deg2rad(degrees)]).as_matrix()


def test_the_rigid_motion_of_points_to_places_is_found_and_never_a_mirror():
    found = rigid_fit(MARKERS, MARKERS @ TURN.T + SHIFT)
    assert found.turn == pytest.approx(TURN)
    assert found.shift == pytest.approx(SHIFT)
    assert found(MARKERS[:2]) == pytest.approx(MARKERS[:2] @ TURN.T + SHIFT)
    mirrored = rigid_fit(MARKERS, MARKERS * [1.0, 1.0, -1.0])
    assert np.linalg.det(mirrored.turn) == pytest.approx(1.0)
    assert mirrored.turn @ mirrored.turn.T == pytest.approx(np.eye(3))
    flat = MARKERS * [1.0, 1.0, 0.0]
    assert rigid_fit(flat, flat).turn == pytest.approx(np.eye(3))


def test_each_marker_takes_its_nearest_point_and_each_point_one_marker_within_reach():
    markers = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [5.0, 0.0, 0.0], [9.0, 0.0, 0.0]])
    cloud = np.array([[0.3, 0.0, 0.0], [-0.1, 0.0, 0.0], [1.2, 0.0, 0.0], [5.6, 0.0, 0.0], [9.0, 0.49, 0.0]])
    assert scans._pairs(cKDTree(markers), cloud, 0.5).tolist() == [-1, 0, 1, -1, 3]
    assert scans._pairs(cKDTree(markers), cloud[::-1], 0.7).tolist() == [3, 2, 1, 0, -1]


def test_closest_points_are_iterated_until_the_pairs_stay_and_what_is_lost_costs_the_reach():
    """Turned by 12° the outermost of 5 by 5 points, 0.59 off, lie nearest to other markers at first."""
    markers = np.array([[x, y, 0.0] for x in range(-2, 3) for y in range(-2, 3)])
    cloud = markers[:-1] @ turned(12.0).T
    begun = scans._pairs(cKDTree(markers), cloud, 0.55)
    assert begun.tolist() != list(range(24))
    cost, pairs, motion = scans._closest(
        cKDTree(markers), cloud, markers, Motion(np.eye(3), np.zeros(3)), 0.55
    )
    assert pairs.tolist() == list(range(24))
    assert motion.turn == pytest.approx(turned(-12.0))
    assert cost == pytest.approx(0.55**2), "one marker without a point, and the others met"


def test_the_cost_of_a_pairing_is_what_its_points_are_off_in_square():
    """Two points are pulled apart by 0.2 each, which no motion takes back; a stray point costs nothing of its
    own."""
    markers = np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0]])
    cloud = np.vstack([markers * [1.2, 1.0, 1.0], [[9.0, 9.0, 0.0]]])
    cost, pairs, _ = scans._closest(cKDTree(markers), cloud, markers, Motion(np.eye(3), np.zeros(3)), 0.5)
    assert pairs.tolist() == [0, 1, 2, 3, -1]
    assert cost == pytest.approx(2 * 0.2**2)


def test_from_fewer_than_four_pairs_no_motion_is_made():
    markers = MARKERS[:5]
    cloud = np.vstack([markers[:3], markers[3:] + 90.0])
    start = Motion(np.eye(3), np.array([0.1, 0.0, 0.0]))
    cost, pairs, motion = scans._closest(cKDTree(markers), cloud, markers, start, 0.5)
    assert pairs.tolist() == [0, 1, 2, -1, -1]
    assert motion is start
    assert cost == pytest.approx(3 * 0.1**2 + 2 * 0.5**2)


def ellipse(longest=(1.0, 1.0, 0.0)):
    """Points along two axes in the plane, farther along the longest, about (50, 20, 10)."""
    along = np.array(longest) / np.linalg.norm(longest)
    across = np.cross([0.0, 0.0, 1.0], along)
    shares = np.array([-1.0, -0.5, 0.0, 0.5, 1.0])[:, None]
    return np.vstack([4.0 * shares * along, 3.0 * shares * across]) + MIDDLE


def test_principal_axes_are_right_handed_with_the_normal_last_and_leave_strays_out():
    """Half of all points lie within 2, and a stray beyond three times as far doesn't count."""
    points = ellipse()
    normal, side = np.array([0.0, 0.0, 1.0]), np.array([1.0, 1.0, 0.0]) / 2**0.5
    middle, axes = scans._axes(points)
    assert middle == pytest.approx(MIDDLE)
    assert axes.T @ axes == pytest.approx(np.eye(3))
    assert np.linalg.det(axes) == pytest.approx(1.0)
    assert abs(axes[:, 0] @ side) == pytest.approx(1.0)
    assert abs(axes[:, 2] @ normal) == pytest.approx(1.0)
    for far, counts in ((5.9, True), (6.1, False)):
        stray = MIDDLE + far * side
        middle, _ = scans._axes(np.vstack([points, stray]))
        assert (middle[0] > 50.1) == counts


def test_starts_are_the_axes_laid_on_each_other_turned_by_every_fifteenth_degree_and_flipped():
    points = ellipse()
    starts = scans._starts(points @ TURN.T + SHIFT, points)
    assert len(starts) == 48
    turns = [start.turn @ TURN for start in starts]
    for start, turn in zip(starts, turns, strict=True):
        assert turn @ turn.T == pytest.approx(np.eye(3))
        assert np.linalg.det(turn) == pytest.approx(1.0)
        assert start((MIDDLE @ TURN.T + SHIFT)[None]) == pytest.approx(MIDDLE[None])
    told = np.array([turn[2, 2] for turn in turns])
    assert np.abs(told) == pytest.approx(np.ones(48)), "about the normal"
    for way in (1.0, -1.0):
        angles = [
            np.rad2deg(np.arctan2(turn[1, 0], turn[0, 0])) % 360.0 for turn in turns if turn[2, 2] * way > 0
        ]
        assert len(angles) == 24
        assert np.diff(np.sort(angles)) == pytest.approx(np.full(23, 15.0))


def test_points_in_a_scanner_s_axes_and_in_any_order_are_named_and_strays_and_hidden_markers_told():
    order = np.array([6, 2, 0, 5, 3, 1, 7])
    cloud = np.vstack([MARKERS[order], [[400.0, 0.0, 0.0]]]) @ TURN.T + SHIFT
    found = match(cloud, MARKERS, reach=0.5)
    assert found.point.tolist() == [2, 5, 1, 4, -1, 3, 0, 6]
    assert found.missing.tolist() == [4]
    assert found.outliers.tolist() == [7]
    assert found.doubts == ()
    assert found.motion.turn == pytest.approx(TURN.T)
    places = found.places(cloud)
    assert places[[0, 1, 2, 3, 5, 6, 7]] == pytest.approx(MARKERS[[0, 1, 2, 3, 5, 6, 7]])
    assert np.isnan(places[4]).all()
    assert np.isnan(found.distance[4])
    assert np.nanmax(found.distance) < 1e-9


def field(across, along, height=0.2):
    """Crossings of a shallow dome, 1 m apart, that leans a little."""
    x, y = (each.ravel() for each in np.meshgrid(np.arange(across), np.arange(along), indexing="ij"))
    round_about = ((x - 0.5 * across) / across) ** 2 + ((y - 0.5 * along) / along) ** 2
    leaning = height * (x / across) ** 3
    return np.column_stack([x, y, height * across * (1.0 - 2.0 * round_about) + 3.0 * leaning])


@pytest.mark.parametrize(("across", "hidden"), [(20, 0), (30, 2), (40, 5)])
def test_points_of_a_large_grid_are_named_rightly_though_rows_of_markers_at_one_side_are_hidden(
    across, hidden
):
    """The middles lie half of that many rows apart. It had named 98 % of the points, all of them after the
    marker one row farther, where 3 % were hidden."""
    markers = field(across, 24)
    order = np.random.default_rng(3).permutation(np.arange(24 * hidden, len(markers)))
    noise = 0.002 * np.random.default_rng(4).normal(size=(len(order), 3))
    cloud = (markers[order] + noise) @ TURN.T + SHIFT
    found = match(cloud, markers, reach=0.5)
    assert found.point[order].tolist() == list(range(len(order)))
    assert found.missing.tolist() == list(range(24 * hidden))
    assert np.nanmax(found.distance) < 0.02


def test_points_that_fit_a_row_farther_nearly_as_well_are_doubted():
    """A flat field without its rim looks the same from each of its crossings."""
    markers = field(12, 12, height=0.0) * [1.0, 1.3, 1.0]
    inner = markers[((markers > 0.5) & (markers < [10.5, 10.5 * 1.3, 1.0]))[:, :2].all(axis=1)]
    off = 0.02 * np.random.default_rng(5).normal(size=inner.shape)
    found = match(inner[:-1] + off[:-1], markers, reach=0.4)
    assert found.doubts
    assert re.match(r"(Turned by \d+°|Shifted by \d\.\d m) the points fit nearly as well", found.doubts[0])


def test_points_that_are_placed_already_stay_where_they_are_and_tell_how_far_off_they_are():
    off = np.zeros((8, 3))
    off[1], off[6] = [0.03, 0.04, 0.0], [0.0, 0.0, -0.2]
    found = match((MARKERS + off)[::-1], MARKERS, reach=0.21, placed=True)
    assert found.point.tolist() == list(range(7, -1, -1))
    assert found.distance == pytest.approx([0.0, 0.05, 0.0, 0.0, 0.0, 0.0, 0.2, 0.0])
    assert match(MARKERS + off, MARKERS, reach=0.19, placed=True).missing.tolist() == [6]


def test_markers_whose_breadth_is_less_than_a_fiftieth_of_their_length_lie_on_a_line():
    """Wherever the line lies."""
    line = np.column_stack([[-3.0, -1.0, 1.0, 3.0], [1.0, -1.0, -1.0, 1.0], np.zeros(4)])
    for share, refused in ((0.018, True), (0.022, False)):
        markers = line * [1.0, share * 5.0**0.5, 1.0] + [70.0, 400.0, 5.0]  # sizes 20 ** 0.5 and 2
        if refused:
            with pytest.raises(InputError, match="the markers lie on a line"):
                match(markers, markers, reach=0.01, placed=True)
        else:
            assert match(markers, markers, reach=0.01, placed=True).point.tolist() == [0, 1, 2, 3]


@pytest.mark.parametrize(
    ("rival", "swing", "doubted"),
    [(0.0029, 140, True), (0.0029, 0, True), (0.0029, 180, True), (0.0031, 140, False)],
)
def test_a_second_pairing_is_doubted_where_it_costs_less_than_half_as_much_again(
    monkeypatch, rival, swing, doubted
):
    """The best is the third start's; the second pairs the same points, so that it is no rival; the first is
    turned against it, by a matrix that rounding has lengthened."""
    best, pairs = Motion(turned(17.0), np.zeros(3)), np.array([0, 1, 2, 3])
    found = [
        (rival, pairs[[1, 2, 0, 3]], Motion((1.0 + 1e-9) * turned(17.0 + swing), np.zeros(3))),
        (0.0021, pairs, Motion(turned(80.0), np.zeros(3))),
        (0.002, pairs, best),
    ]
    monkeypatch.setattr(scans, "_starts", lambda _cloud, _markers: range(3))
    monkeypatch.setattr(scans, "_closest", lambda _tree, _cloud, _markers, start, _reach: found[start])
    told = match(MARKERS[:4], MARKERS[:4], reach=0.5)
    assert told.motion is best
    if doubted:
        assert f"Turned by {swing}° the points fit nearly as well (1.45 times the cost)" in told.doubts[0]
    else:
        assert told.doubts == ()


def state(places):
    return SimpleNamespace(positions=np.vstack([np.full((2, 3), 99.0), places]))


def test_scans_of_one_frame_share_a_motion_and_one_in_the_model_s_axes_keeps_its_own():
    """The second scan is shifted by 2 mm against the first, with as many points: half of it is left to each;
    the third, placed already, is 3 mm off."""
    nodes, apart_by = np.arange(2, 10), np.array([0.002, 0.0, 0.0])
    scanned = [
        Scan(MARKERS[:7] @ TURN.T + SHIFT, NONE, 3),
        Scan((MARKERS[6::-1] + apart_by) @ TURN.T + SHIFT, NONE, 3),
        Scan(MARKERS + np.array([0.0, 0.003, 0.0]), NONE, None),
    ]
    states = [state(MARKERS)] * 3
    found = laid(scanned, states, nodes, 1.5)
    assert found[0].motion is found[1].motion
    assert found[0].point.tolist() == [0, 1, 2, 3, 4, 5, 6, -1]
    assert found[1].point.tolist() == [6, 5, 4, 3, 2, 1, 0, -1]
    told = distances(scanned, found, states, nodes)
    assert told.shape == (8, 3)
    assert told[:7] == pytest.approx(np.tile([0.001, 0.001, 0.003], (7, 1)))
    assert np.isnan(told[7, :2]).all()
    assert told[7, 2] == pytest.approx(0.003)
    for k, each in enumerate(found):
        np.testing.assert_allclose(each.distance, told[:, k])
    assert distances([], [], [], nodes).shape == (8, 0)


def test_placed_scans_in_a_survey_s_coordinates_count_from_the_model_s_origin():
    target, origin = np.random.default_rng(0).random((9, 3)), (430_000.0, 81_000.0, 400.0)
    away, load = target[:4] + origin, np.zeros((9, 6))
    (placed, own, loose), told = counted_alike(
        [Scan(away, load, None), Scan(target, load, None), Scan(away, load, 0)], target, origin
    )
    np.testing.assert_allclose(placed.points, target[:4], atol=1e-9)
    np.testing.assert_array_equal(own.points, target)
    np.testing.assert_array_equal(loose.points, away)
    assert len(told) == 1
    assert told[0].startswith("surface.origin, (430000, 81000, 400) m, was taken off")


def test_a_scan_that_lies_beyond_the_reach_by_the_motion_of_all_is_refused_by_its_number():
    away = np.array([[0.01, 0.2], [np.nan, 0.51]])
    refuse_unlike(away, 0.52)
    with pytest.raises(InputError, match=r"scan 2: doesn't lie on the model.*510 mm off"):
        refuse_unlike(away, 0.5)


def test_how_far_two_motions_lay_points_apart_is_that_of_the_farthest():
    place = np.array([[2.0, 0.0, 0.0], [0.0, 5.0, 0.0]])
    one = Motion(TURN, SHIFT)
    shifted = Motion(TURN, SHIFT + np.array([0.003, 0.004, 0.0]))
    assert apart(one, shifted, place) == pytest.approx(0.005)
    about_z = Motion(turned(3.0) @ TURN, turned(3.0) @ SHIFT)
    assert apart(one, about_z, place) == pytest.approx(2.0 * 5.0 * np.sin(np.deg2rad(1.5)))
    assert apart(one, one, place) == pytest.approx(0.0, abs=1e-12)


def test_markers_without_a_point_have_no_place():
    found = Match(
        np.array([1, -1]), np.array([0]), Motion(turned(90.0), np.array([1.0, 0.0, 0.0])), np.zeros(2), ()
    )
    places = found.places(np.array([[9.0, 9.0, 9.0], [2.0, 3.0, 4.0]]))
    assert places[0] == pytest.approx([-2.0, 2.0, 4.0])
    assert np.isnan(places[1]).all()


def test_scans_of_one_frame_are_turned_alike_though_each_alone_fits_as_well_the_other_way_round():
    """Five by four markers that half a turn lays onto each other but for noise, which speaks for half a turn
    in one of three scans; all together it speaks for none."""
    rng = np.random.default_rng(5)
    x, y = np.meshgrid(np.arange(-2.0, 3.0), [-1.5, -0.5, 0.5, 1.5])
    goal = np.column_stack([x.ravel(), y.ravel(), 0.2 * (4.0 - x.ravel() ** 2)])
    states = [SimpleNamespace(positions=goal) for _ in range(3)]
    odd = 0.004 * np.column_stack([np.zeros((20, 2)), np.sign(x.ravel())])  # no more like this half turned
    off = [odd, -1.2 * odd, odd]
    for seed in range(4):
        order = [rng.permutation(20) for _ in off]
        taken = [(goal + each + 0.01 * odd)[own] for each, own in zip(off, order, strict=True)]
        axes = turned(30.0 + 50.0 * seed)
        frames = [Scan(each @ axes.T + SHIFT, NONE, 0) for each in taken]
        apart_ = [Scan(each @ axes.T + SHIFT, NONE, k) for k, each in enumerate(taken)]
        together = laid(frames, states, np.arange(20), 0.4)
        assert max(np.nanmax(each.distance) for each in together) < 0.05
        ways = {tuple(own[each.point].tolist()) for own, each in zip(order, together, strict=True)}
        assert len(ways) == 1, "the same marker is the same point in each"
        assert all("Turned by 180" in each.doubts[0] for each in together)
        alone = laid(apart_, states, np.arange(20), 0.4)
        assert len({tuple(own[each.point].tolist()) for own, each in zip(order, alone, strict=True)}) == 2
