"""What an edge stands on and where its edge beam's nodes lie, on small loops whose lengths are known."""

from types import SimpleNamespace

import numpy as np
import pytest

from shellform.net import edges as module
from shellform.net.edges import Edges, Place
from shellform.net.ground import Ground, ground_under
from shellform.net.limits import NO_LIMITS
from shellform.net.polylines import closed, nearest
from shellform.net.rims import End, Rim, _chains, _reached, edges_of, ends_of, rim_of
from shellform.structure.elements.rotation import matrices
from shellform.surface.shape.target import make_surface

NOWHERE = np.zeros(5, dtype=bool)  # cut off


def test_a_place_holds_where_all_that_is_given_does_its_bounds_included():
    points = np.array([[0.0, 0.0, 1.0], [2.0, 0.0, 2.0], [5.0, 3.0, 3.0], [2.0, -1.0, 3.5]])

    def held(**how):
        return Place("wall", **how).holds(points, opening=False).tolist()

    assert held() == [True] * 4
    assert held(height=(2.0, 3.0)) == [False, True, True, False]
    assert held(box=[[2.0, 3.0, 9.0], [0.0, -0.5, 0.0]]) == [True, True, False, False]
    assert held(curve=[[0.0, 1.0], [2.0, 1.0], [9.0, 1.0]], within=1.0) == [True, True, False, False]
    assert held(curve=[[0.0, 1.0], [2.0, 1.0]], within=2.0) == [True, True, False, True]
    assert held(height=(2.0, 3.0), box=[[0.0, -0.5, 0.0], [2.0, 3.0, 9.0]]) == [False, True, False, False]
    for asked, opening, kept in (
        (True, True, True),
        (True, False, False),
        (False, True, False),
        (False, False, True),
    ):
        assert Place("wall", opening=asked).holds(points, opening=opening).all() == kept


def test_distances_from_an_open_plan_curve_are_those_from_its_nearest_piece():
    curve = np.array([[10.0, 20.0], [13.0, 24.0], [13.0, 24.0], [13.0, 30.0]])
    points = np.array([[10.7, 22.6], [15.0, 27.0], [7.0, 16.0], [13.0, 31.5], [16.0, 20.0]])
    assert nearest(points, curve)[0] == pytest.approx([1.0, 2.0, 5.0, 1.5, 4.8])


def test_an_edge_stands_on_the_ground_up_to_a_fiftieth_of_the_larger_extent_above_its_lowest_point_or_the_level_given():
    """10 m by 30 m: 0.6 m."""
    outer = np.array([[0.0, 0.0, 2.0], [10.0, 0.0, 5.0], [10.0, 30.0, 3.0]])
    surface = make_surface(outer, np.array([[0, 1, 2]]))
    lowest, given = ground_under(surface), ground_under(surface, -1.0)
    assert (lowest.level, lowest.low, lowest.slopes) == pytest.approx((2.0, 0.6, False))
    assert (given.level, given.low, given.slopes) == pytest.approx((-1.0, 0.6, False))


UNDIVIDED = 1000.0  # of a surface so large that its edges are short


def loop(levels, *, opening=False, cut=False, step=1.0):
    """A loop of points one step apart along x and back, at these levels."""
    points = np.array([[step * k, 0.0, level] for k, level in enumerate(levels)])
    return rim_of(points, opening, cut=cut)


def sorted_out(levels, edges=None, low=0.1, **how):
    made = loop(levels, **how)
    module._sort_out(made, Edges() if edges is None else edges, Ground(0.0, np.zeros(2), low))
    return made


def test_what_is_low_stands_on_the_ground_and_what_is_higher_has_an_edge_beam():
    made = sorted_out([0.0, 0.1, 0.11, 0.5, 0.11, 0.1, 0.09])
    assert made.kinds == ["ground", "ground", "beam", "beam", "beam", "ground", "ground"]
    assert made.found == [True] * 7
    assert made.names == [""] * 7


def test_an_edge_beam_is_carried_down_on_either_side_as_far_as_the_edge_falls_steeply():
    """A tenth of the way in plan is steep: 0.9, 0.6, 0.3 and 0.1 fall by more, 0.02 to 0 doesn't."""
    low = 1.0
    made = sorted_out([0.0, 0.05, 0.2, 0.9, 1.4, 0.6, 0.3, 0.1, 0.02, 0.0], low=low)
    assert made.kinds == ["ground", "ground"] + ["beam"] * 5 + ["ground"] * 3
    assert (
        sorted_out([0.0, 0.9, 1.4, 0.9, 0.0, 0.0, 0.0], low=low).kinds
        == ["ground"] + ["beam"] * 3 + ["ground"] * 3
    )
    late = sorted_out([0.0, 0.0, 0.0, 0.0, 0.0, 0.9, 1.4, 0.9, 0.0], low=low)
    assert late.kinds == ["ground"] * 5 + ["beam"] * 3 + ["ground"]
    gentle = sorted_out([0.0, 0.09, 1.0, 1.1, 1.0, 0.95, 0.0], low=low, step=20.0)
    assert gentle.kinds == ["ground"] * 3 + ["beam"] + ["ground"] * 3
    assert module._falls(np.array([0.0, 0.0, 0.51]), np.array([3.0, 4.0, 0.0]))
    assert not module._falls(np.array([0.0, 0.0, 0.49]), np.array([3.0, 4.0, 0.0]))
    assert not module._falls(np.array([0.0, 0.0, 0.0]), np.array([3.0, 4.0, 2.0]))


def test_places_come_before_the_kind_of_all_edges_and_that_before_the_geometry_and_beams_do_not_run_down_into_them():
    places = (Place("wall", "east", height=(0.2, 0.4)), Place("pin", "all", height=(0.0, 0.4)))
    levels = [0.3, 1.5, 0.9, 0.35, 0.5]
    made = sorted_out(levels, Edges(places), low=1.0)
    assert made.kinds == ["wall", "beam", "ground", "wall", "ground"], "0.9 falls to a wall"
    assert made.names == ["east", "", "", "east", ""]
    assert made.found == [False, True, True, False, True]
    assert sorted_out(levels, Edges(places, outer="free"), low=1.0).kinds == [
        "wall",
        "free",
        "free",
        "wall",
        "free",
    ]
    high = Edges((Place("wall", height=(1.9, 2.1)),))
    kept = sorted_out([2.0, 0.9, 0.5, 0.0, 0.0, 0.5, 0.9], high, low=1.0)
    assert kept.kinds == ["wall"] + ["ground"] * 6, "only edge beams are carried down"
    both = Edges(outer="free", openings="pin")
    assert sorted_out(levels, both, low=1.0).kinds == ["free"] * 5
    assert sorted_out(levels, both, low=1.0, opening=True).kinds == ["pin"] * 5


def test_the_ends_of_a_curve_along_which_a_net_was_cut_off_are_no_part_of_a_beam():
    made = sorted_out([2.0, 2.0, 2.0, 0.0], cut=True)
    assert made.kinds == ["free", "beam", "beam", "ground"]
    assert made.found == [False, True, True, True]


def test_the_stretches_of_a_curve_along_which_a_net_was_cut_off_end_with_it():
    made = sorted_out([0.0, 0.0, 2.0, 2.0, 0.0], cut=True)
    made.kinds = ["ground", "ground", "beam", "beam", "free"]
    first, second = module._stretches(made, NOWHERE)
    assert [(each.kind, each.whole) for each in (first, second)] == [("ground", False), ("beam", False)]
    assert first.points[:, 0].tolist() == [0.0, 1.0, 2.0]
    assert second.points[:, 0].tolist() == [2.0, 3.0, 4.0], "and not back to its beginning"
    made.kinds = ["ground"] * 5
    (one,) = module._stretches(made, NOWHERE)
    assert (one.length, one.whole) == (pytest.approx(2.0 * np.hypot(1.0, 2.0) + 2.0), False)


def test_no_stretch_lies_where_nothing_is_built():
    made = sorted_out([0.0, 0.0, 5.0, 5.0, 5.05])
    made.kinds = ["ground", "ground", "beam", "beam", "beam"]
    first, second = module._stretches(made, np.array([False, False, False, False, True]))
    assert first.points[:, 0].tolist() == [0.0, 1.0, 2.0]
    assert second.points[:, 0].tolist() == [2.0, 3.0]
    assert module._stretches(made, np.array([True, False, True, True, True])) == [], "a point is none"
    made.kinds = ["free"] * 5
    (only,) = module._stretches(made, np.array([True, False, False, False, False]))
    assert not only.whole
    assert only.points[:, 0].tolist() == [1.0, 2.0, 3.0, 4.0]


def test_runs_go_round_a_loop_and_the_last_may_lie_past_its_end():
    assert module._runs("aabbba") == [(2, 4), (5, 7)]
    assert module._runs("abc") == [(0, 0), (1, 1), (2, 2)]
    assert module._runs("aaa") == [(0, 2)]


def test_stretches_reach_to_where_the_next_one_begins_and_one_all_round_is_whole():
    made = sorted_out([0.0, 0.0, 5.0, 5.0, 5.05])
    made.kinds = ["ground", "ground", "beam", "beam", "beam"]
    first, second = module._stretches(made, NOWHERE)
    assert [(each.kind, each.whole) for each in (first, second)] == [("ground", False), ("beam", False)]
    assert first.points[:, 0].tolist() == [0.0, 1.0, 2.0]
    assert second.points[:, 0].tolist() == [2.0, 3.0, 4.0, 0.0]
    made.kinds = ["pin", "ground", "ground", "ground", "pin"]
    assert [each.whole for each in module._stretches(made, NOWHERE)] == [False, False]
    made.kinds = ["free"] * 5
    (only,) = module._stretches(made, NOWHERE)
    assert only.whole
    assert only.points[:, 0].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0, 0.0]


def test_ends_are_grouped_up_to_a_length_from_the_first_of_each_group():
    ends = [(at, str(at)) for at in (0.0, 0.15, 0.2, 0.21, 0.4, 0.42)]
    groups = module._near(ends, 0.2)
    assert [[at for at, _ in group] for group in groups] == [[0.0, 0.15, 0.2], [0.21, 0.4], [0.42]]


def test_nodes_of_edge_beams_stand_upright_on_the_surface():
    normals = np.array([[0.0, 0.0, 1.0], [0.6, 0.0, 0.8], [-0.48, 0.6, 0.64]])
    turned = matrices(module._upright(normals))
    assert turned[:, :, 2] == pytest.approx(normals)
    assert np.linalg.det(turned) == pytest.approx(np.ones(3))
    assert turned.swapaxes(1, 2) @ turned == pytest.approx(np.array([np.eye(3)] * 3))


SQUARE = np.array([[0.0, 0, 0], [4.0, 0, 0], [4.0, 3.0, 2.0], [0.0, 3.0, 2.0]])


def built(kinds, ends, run, points=SQUARE, scale=4.0):
    """The nodes of an edge beam along a run of a loop, for rods' ends at arc lengths on it, nearest to a
    vertex."""
    made = rim_of(points, False)
    made.kinds, made.names = list(kinds), [f"edge {k}" for k in range(len(points))]
    net = SimpleNamespace(grid=SimpleNamespace(flat=np.zeros((100, 3)), scale=scale))
    builder = module._Builder(net, [made])
    own = []
    for node, (at, vertex) in enumerate(ends, 7):
        track = np.vstack([points, points[:1]])
        middle = np.array([np.interp(at, made.along, track[:, k]) for k in range(3)])
        own.append(End(node, 0, at, vertex, middle))
    builder.beam(made, *run, own)
    return builder


def test_an_edge_beam_between_two_feet_has_a_node_for_each_end_and_others_half_a_spacing_apart_at_most():
    """Between vertices 0 and 3 along 4 m and 13 ** 0.5 m: ends at 1 and 5 m, elements of at most 2 m."""
    side = 13.0**0.5
    builder = built(["ground", "beam", "beam", "ground"], [(5.0, 1), (1.0, 1)], (1, 2))
    assert len(builder.feet) == 2
    (line,) = builder.lines
    assert not line.closed
    assert line.name == "edge 1"
    place = {100 + k: each for k, each in enumerate(builder.places)}
    path = [line.ends[0, 0], *line.ends[:, 1]]
    assert [path[0], path[-1]] == builder.feet
    total = 4.0 + side + 4.0
    arcs = np.array([0.0, 1.0, 3.0, 5.0, *(5.0 + (total - 5.0) * np.arange(1, 5) / 4.0)])
    track, along = np.vstack([SQUARE, SQUARE[:1]]), np.array([0.0, 4.0, 4.0 + side, total, total + side])
    wanted = np.array([[np.interp(at, along, track[:, k]) for k in range(3)] for at in arcs])
    np.testing.assert_allclose([place[node] for node in path], wanted, atol=1e-12)
    assert line.clamps.tolist() == [[path[1], 8], [path[3], 7]]


LOPSIDED = np.array([[0.0, 0, 0], [4.0, 0, 0], [4.0, 3.0, 0], [1.0, 3.0, 0]])


@pytest.mark.parametrize(("second", "shared"), [(6.75, True), (6.85, False)])
def test_ends_within_a_fifth_of_the_spacing_share_a_node_at_their_mean_and_the_way_is_counted_from_the_first_foot(
    second, shared
):
    """From vertex 1, at 4 m of 10 + 10 ** 0.5 m, by vertices 2 and 3 to vertex 0; ends at 6, 6.75 or 6.85 and
    9 m."""
    builder = built(["ground", "ground", "beam", "beam"], [(9.0, 3), (second, 2), (6.0, 2)], (2, 3), LOPSIDED)
    (line,) = builder.lines
    place = {100 + k: each for k, each in enumerate(builder.places)}
    path = [line.ends[0, 0], *line.ends[:, 1]]
    assert [place[node].tolist() for node in builder.feet] == [[4.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
    assert [path[0], path[-1]] == builder.feet
    track, along = np.vstack([LOPSIDED, LOPSIDED[:1]]), np.array([0.0, 4.0, 7.0, 10.0, 10.0 + 10.0**0.5])
    first, total = 0.5 * (6.0 + second), along[-1]
    arcs = [4.0, 0.5 * (4.0 + first), first] if shared else [4.0, 6.0, second]
    arcs += [0.5 * (arcs[-1] + 9.0), 9.0, *(9.0 + (total - 9.0) * np.arange(1, 4) / 3.0)]
    wanted = np.array([[np.interp(at, along, track[:, k]) for k in range(3)] for at in arcs])
    np.testing.assert_allclose([place[node] for node in path], wanted, atol=1e-12)
    pairs = {int(end): int(node) for node, end in line.clamps}
    assert pairs == {9: path[2 if shared else 1], 8: path[2], 7: path[arcs.index(9.0)]}


def square(low, high):
    return [[low, low, 0.0], [high, low, 0.0], [high, high, 0.0], [low, high, 0.0]]


def test_rods_ends_lie_on_the_nearest_edge_half_a_gap_below_or_above_it_unless_they_were_cut_off():
    """On a square of 10 m with an opening from 4 to 6 m; the last three ends are farther than half a spacing
    from either."""
    middles = np.array(
        [[3, 0, 0], [10, 7, 0], [6, 5.5, 0], [4, 4.5, 0], [9.55, 1, 0], [2, 2, 0], [2, 3, 0], [0.55, 4, 0]]
    )
    layer = np.array([0.05, -0.05] * 4)
    surface = SimpleNamespace(
        vertices=np.array([*square(0.0, 10.0), *square(4.0, 6.0)]),
        boundary=[np.arange(4), np.arange(4, 8)],
        longer_side=UNDIVIDED,
    )
    net = SimpleNamespace(
        rod_ends=np.arange(8)[::-1],
        target=SimpleNamespace(
            positions=(middles + layer[:, None] * [0.0, 0.0, 1.0])[::-1],
            quaternions=np.tile([1.0, 0, 0, 0], (8, 1)),
        ),
        grid=SimpleNamespace(layer=layer[::-1], scale=1.0),
        limits=NO_LIMITS,
    )
    ends, rims = ends_of(net, surface)
    assert [(each.opening, each.cut) for each in rims] == [(False, False), (True, False), (False, True)]
    assert [each.node for each in ends] == list(range(8))[::-1]
    np.testing.assert_allclose([each.middle for each in ends], middles, atol=1e-12)
    on_edges = [(each.rim, each.at, each.vertex) for each in ends[:5]]
    assert on_edges == [(0, 3.0, 0), (0, 17.0, 2), (1, 3.5, 2), (1, 7.5, 0), (0, pytest.approx(11.0), 1)]
    cut = rims[2]
    assert len(cut.points) == 5
    for each in ends[5:]:
        assert each.rim == 2
        np.testing.assert_allclose(cut.points[each.vertex], each.middle, atol=1e-12)
        assert each.at == cut.along[each.vertex]
    assert sorted(each.vertex for each in ends[5:]) == [1, 2, 3]


def test_an_edge_beam_that_runs_past_the_loop_s_first_point_keeps_its_order_and_has_no_foot_where_it_is_free():
    builder = built(["beam", "free", "ground", "beam"], [(0.5, 0), (13.5, 0), (11.5, 3)], (3, 4), scale=9.0)
    (line,) = builder.lines
    path = [line.ends[0, 0], *line.ends[:, 1]]
    assert len(builder.feet) == 1
    place = {100 + k: each for k, each in enumerate(builder.places)}
    assert place[path[0]].tolist() == [4.0, 3.0, 2.0], "the foot on the ground comes first"
    assert line.clamps[:, 1].tolist() == [9, 8, 7]
    assert len(path) == 4, "ends 2 m and more apart share no node where the spacing is 9 m"


def test_an_edge_beam_all_round_is_a_closed_ring():
    builder = built(["beam"] * 4, [(1.0, 0), (8.0, 2)], (0, 3), scale=40.0)
    assert not builder.lines, "two nodes are no ring"
    builder = built(["beam"] * 4, [(1.0, 0), (8.0, 2)], (0, 3), scale=4.0)
    (line,) = builder.lines
    assert line.closed
    total = 2.0 * (4.0 + 13.0**0.5)
    assert len(builder.places) == 4 + int(np.ceil((total - 7.0) / 2.0))
    assert not builder.feet


def test_feet_in_one_place_are_one():
    builder = built(["ground", "beam", "beam", "ground"], [(5.0, 1)], (1, 2))
    first = builder.feet[0]
    assert builder._foot(SQUARE[0]) == first
    assert builder._foot(SQUARE[0] + 0.1) == 100 + len(builder.places) - 1
    assert len(builder.feet) == 3


def test_arc_lengths_on_a_polygon_are_those_of_the_nearest_places():
    polygon = np.array([[10.0, 5.0], [14.0, 5.0], [14.0, 8.0], [10.0, 8.0]])
    points = np.array([[11.0, 4.0], [15.0, 6.5], [13.0, 9.0], [9.0, 6.0], [15.0, 9.0], [13.9, 5.0]])
    assert nearest(points, closed(polygon))[1] == pytest.approx([1.0, 5.5, 8.0, 13.0, 7.0, 3.9])


def test_a_chain_of_ends_is_parted_at_each_gap_that_is_wider_than_told():
    middle = np.array([[0.0, 0, 0], [1.0, 0, 0], [2.0, 0, 0], [5.0, 0, 0], [6.0, 0, 0], [6.0, 1.0, 0]])
    order = np.arange(6)
    assert [chain.tolist() for chain in _chains(order, middle, 9.0)] == [[0, 1, 2, 3, 4, 5]]
    assert [chain.tolist() for chain in _chains(order, middle, 2.0)] == [[3, 4, 5], [0, 1, 2]]
    assert [chain.tolist() for chain in _chains(order, middle, 3.0)] == [[0, 1, 2, 3, 4, 5]]
    turned = np.roll(order, -1)
    assert [chain.tolist() for chain in _chains(turned, middle, 2.0)] == [[3, 4, 5], [0, 1, 2]]


def test_a_cut_reaches_the_surface_s_edge_only_where_that_is_near():
    rims = [rim_of(SQUARE, False), Rim(SQUARE + 0.1, False, True, [], [], [], np.zeros(5))]
    points = np.array([[0.5, 0.2, 0.0], [3.0, 2.0, 2.0]])
    near = np.linalg.norm([1.0, 1.0, 0.0])
    np.testing.assert_allclose(_reached(points, rims, 1.01 * near), [[0.0, 0.0, 0.0], [4.0, 3.0, 2.0]])
    np.testing.assert_allclose(_reached(points, rims, 0.99 * near), [[0.0, 0.0, 0.0], points[1]])


def test_a_rim_s_arc_lengths_go_all_round():
    assert rim_of(SQUARE, True).along == pytest.approx(
        [0.0, 4.0, 4.0 + 13**0.5, 8.0 + 13**0.5, 8.0 + 2 * 13**0.5]
    )


def test_edges_longer_than_a_fiftieth_of_the_longer_side_are_divided_evenly_and_keep_their_vertices():
    """10 m in plan: no longer than 0.2 m. Of a triangle's edges the first is 0.5 m long, the second has just
    0.2 m, the last as much as both span."""
    corners = np.array([[0.0, 0.0, 0.0], [0.3, 0.4, 0.0], [0.3, 0.4, 0.2]])
    surface = SimpleNamespace(vertices=corners, boundary=[np.arange(3)], longer_side=10.0)
    (rim,) = edges_of(surface)
    shares = [(0, 0), (1 / 3, 0), (2 / 3, 0), (1, 0), (1, 0.2), (2 / 3, 0.4 / 3), (1 / 3, 0.2 / 3)]
    np.testing.assert_allclose(rim.points, [(0.3 * a, 0.4 * a, z) for a, z in shares], atol=1e-12)
    assert rim.along[[3, 4]] == pytest.approx([0.5, 0.7])


def test_ends_that_were_cut_off_are_chained_up_to_two_and_a_half_spacings_and_reach_edges_as_near():
    """A spacing of 2 m: of five ends two lie 7 m from the other three, the outermost of which lie 2.8 and 3.4
    m from a corner."""
    middles = 2.0 * np.array([[0.8, 1.5, 0], [2, 3, 0], [3, 3, 0], [6.5, 2.5, 0], [6.5, 2, 0], [9.55, 1, 0]])
    surface = SimpleNamespace(
        vertices=2.0 * np.array([*square(0.0, 10.0), *square(4.0, 6.0)]),
        boundary=[np.arange(4), np.arange(4, 8)],
        longer_side=UNDIVIDED,
    )
    net = SimpleNamespace(
        rod_ends=np.arange(6),
        target=SimpleNamespace(positions=middles, quaternions=np.tile([1.0, 0, 0, 0], (6, 1))),
        grid=SimpleNamespace(layer=np.zeros(6), scale=2.0),
        limits=NO_LIMITS,
    )
    ends, rims = ends_of(net, surface)
    assert ends[5].rim == 0, "less than half a spacing from the edge"
    assert ends[0].rim == ends[1].rim == ends[2].rim
    assert ends[3].rim == ends[4].rim != ends[0].rim
    assert len(rims) == 4
    points = rims[ends[0].rim].points.tolist()
    points = points if points[1] == middles[0].tolist() else points[::-1]
    assert points == [[0.0, 0.0, 0.0], *middles[:3].tolist(), [8.0, 8.0, 0.0]]
