"""Cables alike: groups by symmetry with one rest length each, fewest lengths to cut, a cap on their
number.
"""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial import Delaunay

import shellform as sf
from shellform.errors import InputError
from shellform.gridshell.grouping import averaged, cut_lengths, symmetric_groups
from shellform.plan_rectangle import axes_in_plan


def cap(*, offset=(0.0, 0.0), radius=1.0, rise=0.3, rings=16):
    points = [(0.0, 0.0)]
    for k in range(1, rings + 1):
        turn = np.linspace(0.0, 2.0 * np.pi, 6 * k, endpoint=False)
        points += list(zip(radius * k / rings * np.cos(turn), radius * k / rings * np.sin(turn), strict=True))
    plan = np.array(points)
    ball = (radius**2 + rise**2) / (2.0 * rise)
    height = np.sqrt(ball**2 - (plan**2).sum(axis=1)) - (ball - rise)
    surface = sf.make_surface(np.column_stack([plan, height]), Delaunay(plan).simplices)
    net = sf.pull_net(surface, spacing=0.2, gap=0.006, offset=offset)
    rod = sf.Rod.round(young=40e9, radius=0.004, strength=400e6)
    joint = sf.Joint(axial=1e6, torsion=0.2, bending=0.2, gap=0.006)
    return sf.brace(net, rod, joint, sf.Cable(stiffness=3000.0), below=surface)


@pytest.fixture(scope="module")
def dome():
    return cap()


@pytest.fixture(scope="module")
def problem(dome):
    wet = dome.point_load(30.0)
    shares = [sf.Share(0.7, sf.Misfit("wet")), sf.Share(0.3, sf.CableForce("wet"))]
    limits = [sf.AtMost(600.0, sf.CableForces("wet")), sf.AtMost(0.01, sf.RmsMisfit("wetter"))]
    return sf.Problem(dome, sf.LoadCase("wet", wet), shares, limits, [sf.LoadCase("wetter", 1.2 * wet)])


def test_a_round_net_s_cables_come_in_groups_of_four_that_lie_on_each_other(dome):
    groups = symmetric_groups(dome)
    assert groups.max() + 1 == len(groups) / 4
    middle = dome.target.positions[dome.cable_ends].mean(axis=1)
    for group in range(groups.max() + 1):
        folded = np.abs(middle[groups == group])
        np.testing.assert_allclose(folded, np.broadcast_to(folded[0], folded.shape), atol=0.02 * 0.2)


def placed(middles, spacing=1.0):
    """A shell with a cable about each of the places (x, y) and crossings in a box 6 by 10 about (20, -3)."""
    ends = np.arange(2 * len(middles)).reshape(-1, 2)
    plan = [
        (s * x, s * y) if (x, y) != (0, 0) else (s - 1.0, 3.0 * (s - 1.0))
        for x, y in middles
        for s in (0.9, 1.1)
    ]
    return lying(plan, ends, spacing)


def lying(plan, ends, spacing=1.0):
    """A shell with cables between `ends` among the places (x, y), which are no crossings; these lie in a box
    6 by 10 about (20, -3)."""
    places = np.array([[20.0 + x, -3.0 + y, 5.0 + x**2 + 2.0 * y**2] for x, y in plan])
    crossings = np.array([[17.0, -8.0, 0.0], [23.0, 2.0, 0.0], [17.0, 2.0, 0.0], [23.0, -8.0, 0.0]])
    nodes = len(places) + np.arange(4)[:, None] + [0, 0]
    net = SimpleNamespace(crossings=crossings, spacing=spacing, grid=SimpleNamespace(crossing_nodes=nodes))
    target = SimpleNamespace(positions=np.vstack([places, crossings]))
    return SimpleNamespace(target=target, cable_ends=ends, net=net)


@pytest.mark.parametrize(
    ("middles", "groups"),
    [
        ([(1, 2), (2, 1), (-1, 2), (-2, 1), (0, 3)], [0, 1, 0, 1, 2]),  # mirrored in x alone
        ([(1, 2), (2, 1), (1, -2), (2, -1), (3, 0)], [0, 1, 0, 1, 2]),  # in y alone
        ([(1, 2), (2, 1), (-2, -1), (-1, -2), (0, 0)], [0, 1, 1, 0, 2]),  # turned by half a turn alone
        ([(1, 2), (-1, 2), (1, -2), (-1, -2), (0, 3), (0, -3)], [0, 0, 0, 0, 1, 1]),
    ],
)
def test_cables_that_a_mirror_or_the_half_turn_lays_on_each_other_are_one_group(middles, groups):
    assert symmetric_groups(placed(middles)).tolist() == groups


@pytest.mark.parametrize(("off", "alike"), [(0.038, True), (0.042, False)])
def test_ends_lie_on_each_other_within_a_fiftieth_of_the_spacing(off, alike):
    """Of 2 m."""
    shell = placed([(1, 2), (-1, 2)], spacing=2.0)
    shell.target.positions[2:, 1] += off
    if alike:
        assert symmetric_groups(shell).tolist() == [0, 0]
    else:
        with pytest.raises(InputError, match="within 40 mm"):
            symmetric_groups(shell)


@pytest.mark.parametrize("turn", [0.3, 1.2])
def test_a_symmetric_net_has_the_same_groups_when_it_is_turned(turn):
    shell = placed([(1, 2), (-1, 2), (1, -2), (-1, -2), (0, 3), (0, -3)])
    for points in (shell.net.crossings, shell.target.positions):
        points[:, :2] = points[:, :2] @ axes_in_plan(turn).T
    assert symmetric_groups(shell).tolist() == [0, 0, 0, 0, 1, 1]


def test_the_diagonals_of_a_cell_are_apart_though_either_s_middle_lies_nearer_to_the_other_s_image():
    """Cells beside (1, 0) and (-1, 0), whose corners are a little off the mirror's."""
    plan = [(0.5, 0), (1.5, 0.004), (1, 0.5), (1, -0.5), (-0.5, 0), (-1.5, -0.004), (-1, 0.504), (-1, -0.5)]
    ends = np.array([[0, 1], [2, 3], [4, 5], [6, 7]])
    assert symmetric_groups(lying(plan, ends)).tolist() == [0, 1, 0, 1]
    middles = np.array(plan)[ends].mean(axis=1)
    assert abs(middles[2, 1] - middles[0, 1]) > abs(middles[3, 1] - middles[0, 1])


def test_only_present_cables_get_their_group_s_mean_even_where_whole_groups_are_absent():
    values, groups = np.array([1.0, 2.0, 6.0, 40.0, 8.0, 80.0, 5.0]), np.array([0, 1, 0, 0, 2, 3, 1])
    present = np.array([True, True, True, False, False, False, True])
    np.testing.assert_array_equal(averaged(values, groups, present), [3.5, 3.5, 3.5, 40.0, 8.0, 80.0, 3.5])
    np.testing.assert_array_equal(averaged(values, groups, ~present), [1.0, 2.0, 6.0, 40.0, 8.0, 80.0, 5.0])


def test_a_net_without_symmetry_is_refused():
    with pytest.raises(InputError, match="no mirror or half turn"):
        symmetric_groups(cap(offset=(0.37, 0.21)))


def test_polished_groups_keep_one_length_each_lower_the_misfit_and_keep_the_limits(dome, problem):
    best = sf.optimise(problem, dome.design(), solver=sf.SequentialConvex(thin=False), evaluations=6)
    groups = symmetric_groups(dome)
    polished = sf.polish(best, evaluations=6, groups=groups)
    design = polished.design
    np.testing.assert_allclose(
        averaged(design.rest_length, groups, design.present), design.rest_length, rtol=1e-12
    )
    assert polished.objective < polished.objective_start
    assert max(polished.constraints.values()) <= sf.FEASIBLE


def test_cables_are_taken_away_down_to_the_number_asked_for(dome, problem):
    free = sf.optimise(problem, dome.design(), solver=sf.SequentialConvex(thin=False), evaluations=10)
    capped = sf.optimise(problem, dome.design(), solver=sf.SequentialConvex(most_cables=60), evaluations=60)
    assert capped.design.present.sum() <= 60 < free.design.present.sum()
    assert max(capped.constraints.values()) <= sf.FEASIBLE


def test_a_number_of_cables_that_cannot_be_reached_is_told(dome, problem):
    capped = sf.optimise(problem, dome.design(), solver=sf.SequentialConvex(most_cables=1), evaluations=12)
    assert "no design with 1 cables was found" in capped.status


def test_cut_lengths_are_the_fewest_that_the_turnbuckles_allow():
    rest = np.array([1.0, 1.004, 1.009, 1.012, 1.03])
    np.testing.assert_array_equal(cut_lengths(rest[::-1], 0.01)[::-1], [1.0, 1.0, 1.0, 1.012, 1.03])
    np.testing.assert_array_equal(cut_lengths(rest, 0.0), rest)
    with pytest.raises(InputError, match="0 or more"):
        cut_lengths(rest, -1.0)


def test_without_cables_there_is_nothing_to_group():
    with pytest.raises(InputError, match="no cables to group"):
        symmetric_groups(lying([(1, 2), (2, 1)], np.zeros((0, 2), dtype=np.int64)))
