"""What stands where on the drawings, on a grid of nine crossings whose places are known beforehand: 2 m apart
along u and 1.5 m along v, rods going on past them by as much.
"""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from shellform.gridshell.layers import TwoLayers
from shellform.net.grid import lattice_grid
from shellform.output.workshop import drawings, layout, setting_out
from shellform.output.workshop.marks import Ring, Sheet, Span, Stroke, Words, box_of, free, overlap, square
from shellform.output.workshop.nesting import Bar, Cutting, Piece
from shellform.structure.elements.sections import Material, Round

GRID = lattice_grid(
    np.array([(i, j) for i in range(3) for j in range(3)]), spacing=(2.0, 1.5), gap=0.05, elements=2, tail=1
)
S = 1500.0  # mm, the smaller spacing


def crossing(i, j):
    return 3 * i + j


@pytest.fixture
def built():
    """Two cables: a rising one from the first crossing to the middle, and a falling one beside it."""
    low = GRID.crossing_nodes[:, 0]
    pairs = [
        (crossing(0, 0), crossing(1, 1)),
        (crossing(1, 2), crossing(2, 1)),
        (crossing(0, 1), crossing(1, 0)),
    ]
    ends = np.array([low[list(pair)] for pair in pairs])
    shell = SimpleNamespace(
        net=SimpleNamespace(grid=GRID, edges=(), supports=np.array([0, len(GRID.flat) - 1])),
        node_count=len(GRID.flat),
        cable_ends=ends,
        rod=SimpleNamespace(section=Round(0.01, Material(40e9, 15e9))),
        cables=lambda design: SimpleNamespace(tension=lambda state: np.array([3.0, 0.0])),
    )
    design = SimpleNamespace(present=np.array([True, True, False]), radius=0.01)
    return SimpleNamespace(grid=GRID, shell=shell, design=design, states={"none": None})


def on(marks, layer, kind):
    return [mark for mark in marks if mark.layer == layer and isinstance(mark, kind)]


def test_cables_run_from_ring_to_ring_and_are_named_beside_their_middles(built):
    """Both are 2.5 m long, along 4 : 3; a ring's radius is 195 mm, and names stand 0.27 × 1.5 m off."""
    marks = layout.cable_plan(built).marks
    rising, falling = on(marks, "CABLES", Stroke)
    np.testing.assert_allclose(rising.points, [(156.0, 117.0), (2000.0 - 156.0, 1500.0 - 117.0)])
    np.testing.assert_allclose(falling.points, [(2156.0, 3000.0 - 117.0), (4000.0 - 156.0, 1500.0 + 117.0)])
    first, second = on(marks, "CABLE_NAMES", Words)
    assert (first.text, first.foot, first.place) == ("C0·1", "bottom", (1000.0, 750.0 + 405.0))
    assert (second.text, second.foot, second.place) == ("C1·1", "top", (3000.0, 2250.0 - 405.0))
    rings = on(marks, "CROSSINGS", Ring)
    assert [ring.centre for ring in rings] == [(2000.0 * i, 1500.0 * j) for i in range(3) for j in range(3)]
    assert [ring.radius for ring in rings] == pytest.approx(9 * [195.0])


def test_rods_of_the_cable_plan_stop_at_rings_and_reach_their_ends(built):
    strokes = [stroke.points for stroke in on(layout.cable_plan(built).marks, "BACKGROUND", Stroke)]
    assert len(strokes) == 6 * 4
    np.testing.assert_allclose(
        strokes[:4],
        [
            [(-2000.0, 0.0), (-195.0, 0.0)],
            [(195.0, 0.0), (2000.0 - 195.0, 0.0)],
            [(2195.0, 0.0), (4000.0 - 195.0, 0.0)],
            [(4195.0, 0.0), (6000.0, 0.0)],
        ],
        atol=1e-9,
    )
    np.testing.assert_allclose(strokes[12], [(0.0, -1500.0), (0.0, -195.0)], atol=1e-9)
    np.testing.assert_allclose(strokes[15], [(0.0, 3195.0), (0.0, 4500.0)], atol=1e-9)


def test_spans_tell_the_crossings_rows_and_the_rods_ends(built):
    low, high = np.array([-2000.0, -1500.0]), np.array([6000.0, 4500.0])
    spans = layout._spans(built, low, high, S)
    assert [span.text for span in spans] == ["2 × 2000 = 4000", "8000.0", "2 × 1500 = 3000", "6000.0"]
    assert [(span.a, span.b) for span in spans[:2]] == [
        ((0.0, -1500.0 - 2.35 * S), (4000.0, -1500.0 - 2.35 * S)),
        ((-2000.0, -1500.0 - 2.75 * S), (6000.0, -1500.0 - 2.75 * S)),
    ]
    assert [(span.a, span.b) for span in spans[2:]] == [
        ((-2000.0 - 2.35 * S, 0.0), (-2000.0 - 2.35 * S, 3000.0)),
        ((-2000.0 - 2.75 * S, -1500.0), (-2000.0 - 2.75 * S, 4500.0)),
    ]


def test_edge_beams_that_lie_beside_the_flat_rods_make_the_flat_grid_no_wider(built, monkeypatch):
    monkeypatch.setattr(layout, "label", lambda *_: "")
    flat = np.vstack([GRID.flat, [(40.0, -30.0, 2.0), (50.0, 60.0, 3.0)]])
    rod = SimpleNamespace(section=None, resized=lambda _: SimpleNamespace(section=None))

    def drawn(grid):
        net = SimpleNamespace(grid=grid, edges=(), supports=np.array([0]), notes=())
        return layout.flat_grid(
            SimpleNamespace(grid=grid, design=built.design, shell=SimpleNamespace(net=net, rod=rod))
        )

    assert drawn(replace(GRID, flat=flat)) == drawn(GRID)


def test_segments_are_counted_wherever_the_grid_begins():
    """Crossings 3 to 5 along u and -2 to 1 along v."""
    lattice = np.array([(i, j) for i in range(3, 6) for j in range(-2, 2)])
    grid = lattice_grid(lattice, spacing=(2.0, 1.5), gap=0.05, elements=1)
    spans = layout._spans(SimpleNamespace(grid=grid), np.array([6e3, -3e3]), np.array([10e3, 1.5e3]), S)
    assert [span.text for span in spans] == ["2 × 2000 = 4000", "4000.0", "3 × 1500 = 4500", "4500.0"]
    assert [(span.a[0], span.b[0]) for span in spans[:2]] == 2 * [(6000.0, 10000.0)]
    assert [(span.a[1], span.b[1]) for span in spans[2:]] == 2 * [(-3000.0, 1500.0)]


def test_names_of_rods_stand_in_the_segment_nearest_to_their_middles_to_their_left(built):
    """Of two segments as near the first: from 0 to 2 m, and from 0 to 1.5 m."""
    built.shell.net.supports = np.concatenate([GRID.rods[k].nodes[[0, -1]] for k in (1, 4)])
    for name, rod, place in (
        ("U1", GRID.rods[1], (1000.0, 1500.0 + 0.03 * S)),
        ("V4", GRID.rods[4], (2000.0 - 0.03 * S, 750.0)),
    ):
        stroke, *squares, words = layout._rod(built, name, rod, S)
        assert (words.text, words.angle) == (name, 0.0 if name == "U1" else 90.0)
        assert words.place == pytest.approx(place)
        ends = 1e3 * GRID.flat[rod.nodes[[0, -1]], :2]
        np.testing.assert_allclose(stroke.points, ends)
        np.testing.assert_allclose([np.mean(each.points[:4], axis=0) for each in squares], ends)


def test_a_rod_with_one_crossing_or_an_uneven_one_is_named_where_its_middle_is_nearest(built):
    flat = np.array([[0.0, 0.0, 0.0], [10.0, 0.0, 0.0]])
    plan = SimpleNamespace(grid=SimpleNamespace(flat=flat), shell=built.shell)
    for marks, at in (([4.0], 5.0), ([1.0, 3.0, 9.0], 6.0), ([0.5, 4.5, 7.5], 6.0), ([3.0, 4.6, 9.0], 3.8)):
        rod = SimpleNamespace(direction="u", nodes=np.array([0, 1]), length=10.0, marks=np.array(marks))
        assert layout._rod(plan, "U0", rod, S)[-1].place[0] == pytest.approx(1e3 * at)


def test_rods_are_told_with_their_marks_and_splices_one_under_the_other(built):
    cutting = Cutting(
        6.0, 0.003, (Bar((Piece(1, 2, 2, 5.0, 3.0), Piece(4, 2, 2, 3.75, 2.25)), 0.0), Bar((Piece(1, 1, 2, 0.0, 5.0),), 0.0)), 2
    )  # fmt: skip
    sheet = layout.rod_strips(built, cutting, 1, 99)
    assert [mark.text for mark in on(sheet.marks, "ROD_NAMES", Words)] == ["U1", "U2", "V3", "V4", "V5"]
    assert [mark.text for mark in on(sheet.marks, "CUT_LENGTHS", Words)] == [
        "L = 8000.0", "L = 8000.0", "L = 6000.0", "L = 6000.0", "L = 6000.0",
    ]  # fmt: skip
    splices = on(sheet.marks, "SPLICES", Words)
    assert [(mark.text, mark.place[0]) for mark in splices] == [
        ("splice 5000.0", 5000.0),
        ("splice 3750.0", 3750.0),
    ]
    assert [mark.place[1] for mark in splices] == pytest.approx([-0.24 * S, -3 * 0.75 * S - 0.24 * S])
    strokes = on(sheet.marks, "SPLICES", Stroke)
    np.testing.assert_allclose(
        [np.mean(stroke.points, axis=0) for stroke in strokes], [(5000.0, 0.0), (3750.0, -3 * 0.75 * S)]
    )
    lengths = on(sheet.marks, "CUT_LENGTHS", Words)
    assert [mark.place[0] > at for mark, at in zip(lengths, (8e3, 8e3, 6e3, 6e3, 6e3), strict=True)] == 5 * [
        True
    ]
    assert [mark.place[1] for mark in lengths] == [-0.75 * S * row for row in range(5)]
    numbers = on(sheet.marks, "CROSSING_NUMBERS", Words)
    assert [(mark.text, mark.place[0]) for mark in numbers[-3:]] == [
        ("6", 1500.0),
        ("7", 3000.0),
        ("8", 4500.0),
    ]
    assert [mark.text for mark in on(sheet.marks, "FIRST_MARKS", Words)][:3] == ["2000.0", "4000.0", "6000.0"]
    ticks = [np.mean(mark.points, axis=0).tolist() for mark in on(sheet.marks, "CROSSINGS", Stroke)]
    np.testing.assert_allclose(ticks[:3], [(2000.0, 0.0), (4000.0, 0.0), (6000.0, 0.0)])
    assert sheet.notes[1] == "Cut from bars of 6000 mm as schedules/bars.csv says."
    assert sheet.notes[2].startswith("Red: splices")
    assert len(layout.rod_strips(built, Cutting(9.0, 0.0, (), 0), 0, 1).notes) == 2


def test_splices_of_two_laths_near_each_other_are_told_one_below_the_other(built):
    """In U1 at 5 m and 1 m further on, and at 0.5 m; words of 13 letters are 1.9 m long."""
    pieces = (Piece(1, 2, 3, 0.5, 4.5), Piece(1, 2, 2, 5.0, 3.0), Piece(1, 2, 2, 6.0, 2.0))
    rod = SimpleNamespace(section=TwoLayers(built.shell.rod.section))
    laths = SimpleNamespace(grid=GRID, shell=SimpleNamespace(rod=rod))
    sheet = layout.rod_strips(laths, Cutting(6.0, 0.003, (Bar(pieces, 0.0),), 1), 1, 3)
    words = on(sheet.marks, "SPLICES", Words)
    assert [(mark.text, mark.place) for mark in words] == [
        ("splice 500.0", (500.0, pytest.approx(-0.24 * S))),
        ("splice 5000.0", (5000.0, pytest.approx(-0.24 * S))),
        ("splice 6000.0", (6000.0, pytest.approx(-0.38 * S))),
    ]
    others = [mark for mark in sheet.marks if isinstance(mark, Words)]
    assert not any(overlap(a.box, b.box) for a in words for b in others if a is not b)
    assert sheet.notes[-1].startswith("Each rod is two laths")


def test_levels_are_told_in_order_and_words_give_way_upwards():
    marks = setting_out._levels({"crown": 900.0, "foot": 0.0, "beam": 10.0}, 5000.0, 200.0, 20.0, 1000.0)
    strokes, words = marks[::2], marks[1::2]
    assert [mark.text for mark in words] == ["foot", "beam", "crown"]
    assert [mark.place for mark in words] == [(5150.0, 200.0), (5150.0, 236.0), (5150.0, 1100.0)]
    assert [stroke.points for stroke in strokes] == [
        ((5060.0, 200.0), (5100.0, 200.0), (5140.0, 200.0)),
        ((5060.0, 210.0), (5100.0, 210.0), (5140.0, 236.0)),
        ((5060.0, 1100.0), (5100.0, 1100.0), (5140.0, 1100.0)),
    ]


def test_elevations_show_the_shell_from_the_front_and_above_it_from_the_side():
    """A rod from (1, 2, -0.5) over (3, 5, 2) to (6, 4, 0.25) m, with its ends on the ground."""
    place = np.array([[1.0, 2.0, -0.5], [3.0, 5.0, 2.0], [6.0, 4.0, 0.25]])
    grid = SimpleNamespace(rods=(SimpleNamespace(direction="v", nodes=np.arange(3)),))
    net = SimpleNamespace(edges=(), supports=np.array([0, 2]))
    shell = SimpleNamespace(net=net, target=SimpleNamespace(positions=place))
    marks = setting_out.elevations(
        SimpleNamespace(grid=grid, shell=shell, origin=None, origin_notes=())
    ).marks
    front, side = on(marks, "RODS_V", Stroke)
    up = 2500.0 + 0.3 * 5000.0  # the height, and a gap of the width's share
    np.testing.assert_allclose(front.points, [(1000.0, 0.0), (3000.0, 2500.0), (6000.0, 750.0)])
    np.testing.assert_allclose(side.points, [(2000.0, up), (5000.0, up + 2500.0), (4000.0, up + 750.0)])
    assert [mark.points[0][1] for mark in on(marks, "GROUND", Stroke)] == pytest.approx([0.0, up])
    for ground, (left, right) in zip(
        on(marks, "GROUND", Stroke), ((1000.0, 6000.0), (2000.0, 5000.0)), strict=True
    ):
        assert ground.points[0][0] < left < right < ground.points[1][0]
    told = [mark.text for mark in on(marks, "LEVELS", Words)]
    assert told == 2 * ["lowest support -500.0", "highest support +250.0", "crown +2000.0"]
    spans = on(marks, "DIMENSIONS", Span)
    assert [span.text for span in spans] == ["5000.0", "2500.0", "3000.0", "2500.0"]
    assert [(span.a[0], span.b[0]) for span in spans[::2]] == [(1000.0, 6000.0), (2000.0, 5000.0)]
    assert [span.a[1] for span in spans[1::2]] == pytest.approx([0.0, up])
    assert [span.b[1] for span in spans[1::2]] == pytest.approx([2500.0, up + 2500.0])
    assert [span.upright for span in spans] == [False, True, False, True]


def test_where_a_mark_lies_is_told_by_its_box():
    assert box_of(Ring("CROSSINGS", (5.0, 9.0), 2.0)) == (3.0, 7.0, 7.0, 11.0)
    assert box_of(Stroke("RODS_U", ((4.0, 1.0), (2.0, 8.0), (3.0, -1.0)))) == (2.0, -1.0, 4.0, 8.0)
    assert box_of(Span("DIMENSIONS", (0.0, 5.0), (9.0, 5.0), (0.0, 2.0), 2.0, "9")) == (-3.0, -1.0, 12.0, 8.0)
    assert square(np.array([3.0, 4.0, 9.0]), 0.5).points == (
        (2.5, 3.5), (3.5, 3.5), (3.5, 4.5), (2.5, 4.5), (2.5, 3.5),
    )  # fmt: skip
    width = 0.88 * 10.0 * 4
    for side, x in (("left", 0.0), ("middle", -0.5 * width), ("right", -width)):
        for foot, y in (("bottom", 0.0), ("middle", -5.0), ("top", -10.0)):
            level = Words("ROD_NAMES", (100.0, 200.0), 10.0, "abcd", 0.0, side, foot)
            assert level.box == pytest.approx((100.0 + x, 200.0 + y, 100.0 + x + width, 210.0 + y))
            upright = Words("ROD_NAMES", (100.0, 200.0), 10.0, "abcd", 90.0, side, foot)
            assert upright.box == pytest.approx((90.0 - y, 200.0 + x, 100.0 - y, 200.0 + x + width))


@pytest.mark.parametrize(
    ("other", "lie"),
    [
        ((4.0, 3.0, 6.0, 5.0), False), ((3.9, 2.9, 6.0, 5.0), True), ((3.9, 3.1, 6.0, 5.0), False),
        ((4.1, 0.0, 6.0, 5.0), False), ((-2.0, -2.0, 0.0, 0.1), False), ((-2.0, -2.0, 0.1, 0.1), True),
        ((-2.0, -2.0, 0.1, -0.1), False), ((1.0, 1.0, 2.0, 2.0), True), ((-9.0, -9.0, 9.0, 9.0), True),
    ],
)  # fmt: skip
def test_boxes_that_share_more_than_an_edge_lie_on_each_other(other, lie):
    one = (0.0, 0.0, 4.0, 3.0)
    assert overlap(one, other) == overlap(other, one) == lie
    assert overlap((0.0, 0.0, 1.0, 1.0), (1.5, 0.0, 2.0, 1.0), 0.6)
    assert not overlap((0.0, 0.0, 1.0, 1.0), (1.5, 0.0, 2.0, 1.0), 0.4)


def test_words_are_free_a_fifth_of_their_height_from_the_others():
    words = Words("ROD_NAMES", (0.0, 0.0), 10.0, "a")
    assert free(words, [])
    assert free(words, [(0.0, 12.5, 9.0, 20.0), (11.0, 0.0, 20.0, 9.0)])
    assert not free(words, [(50.0, 50.0, 60.0, 60.0), (0.0, 11.5, 9.0, 20.0)])


@pytest.mark.parametrize(
    ("wide", "tall", "letters", "paper", "scale"),
    [
        (5200.0, 1000.0, 40.0, "A3", 20.0),  # of 264 × 265 mm on A3
        (1000.0, 5200.0, 40.0, "A3", 20.0),
        (5200.0, 1000.0, 32.0, "A3", 20.0),
        (5200.0, 1000.0, 31.9, "A2", 15.0),  # of 438 × 388 mm
        (6600.0, 10.0, 99.0, "A3", 25.0),
        (6601.0, 10.0, 99.0, "A3", 50.0),
        (10.0, 6625.0, 99.0, "A3", 25.0),
        (10.0, 6626.0, 99.0, "A3", 50.0),
        (200.0, 100.0, 9.0, "A3", 1.0),
        (25825.0, 10.0, 1.0, "A0", 25.0),  # of 1033 × 809 mm, whatever its letters
        (10.0, 20225.0, 1.0, "A0", 25.0),
        (2e6, 10.0, 1.0, "A0", 1000.0),
    ],
)
def test_a_drawing_is_to_the_first_scale_that_fits_the_smallest_paper_on_which_it_is_legible(
    wide, tall, letters, paper, scale
):
    marks = (Stroke("RODS_U", ((70.0, -30.0), (70.0 + wide, -30.0 + tall))),)
    assert drawings.fitted(Sheet("", marks, letters)) == (paper, scale)
    assert list(drawings.SCALES) == sorted(set(drawings.SCALES))


def test_a_dimension_in_the_file_measures_along_its_own_direction():
    asked = []

    def dimension(**how):
        asked.append((how["angle"], how["p1"], how["p2"], how["base"], how["text"]))
        return SimpleNamespace(render=lambda: None)

    space = SimpleNamespace(add_linear_dim=dimension)
    drawings._draw(space, Span("DIMENSIONS", (1.0, 5.0), (9.0, 5.0), (1.0, 2.0), 2.0, "8.0"))
    drawings._draw(space, Span("DIMENSIONS", (1.0, 5.0), (1.0, 9.0), (0.0, 5.0), 2.0, "4.0"))
    assert asked == [
        (0.0, (1.0, 5.0), (9.0, 5.0), (1.0, 2.0), "8.0"),
        (90.0, (1.0, 5.0), (1.0, 9.0), (0.0, 5.0), "4.0"),
    ]


def test_squares_on_the_flat_grid_stand_at_ends_that_are_supports_alone(built):
    """Of the grid's first and last node; edge beams hold the other ends."""
    marks = [mark for rod in GRID.rods for mark in layout._rod(built, "", rod, S)]
    squares = on(marks, "SUPPORTS", Stroke)
    ends = 1e3 * GRID.flat[[0, -1], :2]
    np.testing.assert_allclose([np.mean(each.points[:4], axis=0) for each in squares], ends, atol=1e-9)


def test_supports_on_one_level_are_told_once():
    place = np.array([[1.0, 2.0, 0.5], [3.0, 5.0, 2.0], [6.0, 4.0, 0.50004]])
    grid = SimpleNamespace(rods=(SimpleNamespace(direction="v", nodes=np.arange(3)),))
    shell = SimpleNamespace(
        net=SimpleNamespace(edges=(), supports=np.array([0, 2])), target=SimpleNamespace(positions=place)
    )
    marks = setting_out.elevations(
        SimpleNamespace(grid=grid, shell=shell, origin=None, origin_notes=())
    ).marks
    assert [mark.text for mark in on(marks, "LEVELS", Words)] == 2 * ["supports +500.0", "crown +2000.0"]
