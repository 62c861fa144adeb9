"""Seams and slivers of a few triangles each, whose gaps and proportions are known beforehand."""

from itertools import pairwise

import numpy as np
import pytest

from shellform.surface.readers import seams
from shellform.surface.readers.draft import Draft
from shellform.surface.readers.seams import sewn, without_slivers
from shellform.surface.shape.triangles import open_edges

SQUARE = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 2.0, 0.0], [0.0, 2.0, 0.0]])
TWO = np.array([[0, 1, 2], [0, 2, 3]])


def beside(gap):
    """Two squares of 2 × 2 m, the second one to the right of the first and that much off and half that much
    higher."""
    second = SQUARE + np.array([2.0 + gap * np.sqrt(0.8), 0.0, gap * np.sqrt(0.2)])
    return Draft(np.vstack([SQUARE, second]), np.vstack([TWO, TWO + 4]))


@pytest.mark.parametrize(
    ("size", "gap", "joined"),
    [
        (4.0, 0.0039, True),  # a thousandth of the size
        (4.0, 0.0041, False),
        (150.0, 0.149, True),
        (150.0, 0.151, False),
        (1000.0, 0.19, True),  # a tenth of the open edges' length
        (1000.0, 0.21, False),
    ],
)
def test_vertices_are_joined_across_a_tenth_of_an_edge_and_a_thousandth_of_the_size(size, gap, joined):
    draft = beside(gap)
    found = sewn(draft, size)
    if not joined:
        assert found.notes == ()
        np.testing.assert_array_equal(found.points, draft.points)
        return
    assert found.notes == (f"2 pairs of vertices across a gap of up to {gap:.2g} m were joined",)
    assert (len(found.points), len(found.triangles), len(open_edges(found.triangles))) == (6, 4, 6)
    seam = found.points[found.points[:, 0].round(1) == np.round(2.0 + 0.45 * gap, 1)]
    middle = np.array([2.0 + 0.5 * gap * np.sqrt(0.8), 0.5 * gap * np.sqrt(0.2)])
    np.testing.assert_allclose(seam[:, [0, 2]], [middle, middle], atol=1e-12)


def test_the_nearest_pairs_are_joined_first_and_each_vertex_once():
    """Three triangles with tips 30, 50 and 80 mm from each other on a line."""
    tips = [0.0, 0.03, 0.08]
    points = [
        [
            [tip, 0.0, 0.0],
            [tip - 3.0 + 3.0 * k, 5.0 + 4.0 * k, 0.0],
            [tip - 6.0 + 3.0 * k, 5.0 + 4.0 * k, 0.0],
        ]
        for k, tip in enumerate(tips)
    ]
    draft = Draft(np.array(points).reshape(-1, 3), np.arange(9).reshape(3, 3))
    found, joined, moved = seams._vertices_joined(draft, 0.1)
    assert (joined, moved) == (1, pytest.approx(0.03))
    assert found.triangles[:, 0].tolist() == [0, 0, 5]
    np.testing.assert_allclose(found.points[[0, 5], 0], [0.015, 0.08])


def test_ends_of_a_short_edge_are_not_joined_with_each_other():
    points = np.array([[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [4.0, 0.05, 0.0], [0.0, 3.0, 0.0]])
    found, joined, moved = seams._vertices_joined(Draft(points, TWO), 0.1)
    assert (joined, moved) == (0, 0.0)
    np.testing.assert_array_equal(found.triangles, TWO)


@pytest.mark.parametrize("noise", [1e-7, 1e-5, 1e-3])
@pytest.mark.parametrize("count", [3, 4, 5, 6, 8])
def test_wedges_that_meet_in_one_point_leave_no_slit_between_them(count, noise):
    """A disc of 5 m parted into wedges, each with corners of its own, up to that far, in m, from
    where they were meant."""
    angle = 2.0 * np.pi * np.arange(count + 1) / count
    wedges = []
    for one, other in pairwise(angle):
        sides = np.array([[np.cos(one), np.sin(one), 0.0], [np.cos(other), np.sin(other), 0.0]])
        wedges.append(np.vstack([np.zeros((1, 3)), *(r * sides for r in (1.0, 2.0, 3.0, 4.0, 5.0))]))
    fan = [[0, 1, 2], *([k + a for a in corner] for k in (1, 3, 5, 7) for corner in ([0, 2, 3], [0, 3, 1]))]
    points = np.vstack(wedges)
    points = points + noise * np.random.default_rng(count).uniform(-1.0, 1.0, points.shape)
    triangles = np.vstack([np.array(fan) + 11 * k for k in range(count)])
    found = sewn(Draft(points, triangles), 10.0)
    assert len(found.points) == 1 + 5 * count
    assert len(open_edges(found.triangles)) == count  # round the disc, and nowhere else
    assert flat_area(found).sum() == pytest.approx(12.5 * count * np.sin(2.0 * np.pi / count), rel=1e-3)


@pytest.mark.parametrize(
    ("share", "away", "cut"),
    [
        (0.5, 0.0, True), (0.1, 0.019, True), (0.9, -0.019, True), (0.3, 0.021, False), (0.3, -0.021, False),
        (0.0011, 0.0, True), (0.0009, 0.0, False), (0.9989, 0.0, True), (0.9991, 0.0, False),
    ],
)  # fmt: skip
@pytest.mark.parametrize("begin", range(3))
def test_an_edge_is_cut_at_a_vertex_that_lies_on_it_and_not_at_its_ends(share, away, cut, begin):
    """An edge of 4 m, and the tip of another triangle that far along it and off it; reached is what is 20 mm
    off."""
    points = np.array(
        [[1.0, 1.0, 0.0], [5.0, 1.0, 0.0], [3.0, 4.0, 0.0], [1.0 + 4.0 * share, 1.0 + away, 0.0], [2.0, -3.0, 0.0], [4.0, -3.5, 0.0]]
    )  # fmt: skip
    faces = np.array([np.roll([0, 1, 2], begin), [3, 4, 5]])
    found, count, moved = seams._edges_cut(Draft(points, faces), 0.02)
    assert (count, moved) == ((1, pytest.approx(abs(away))) if cut else (0, 0.0))
    told = {tuple(np.roll(face, -int(np.argmin(face))).tolist()) for face in found.triangles}
    assert told == ({(3, 4, 5), (0, 3, 2), (1, 2, 3)} if cut else {(3, 4, 5), (0, 1, 2)})


def test_two_vertices_on_one_edge_cut_it_in_their_order():
    points = np.array(
        [
            [0.0, 0.0, 0.0],
            [4.0, 0.0, 0.0],
            [2.0, 3.0, 0.0],
            [3.0, 0.0, 0.0],
            [1.5, 0.0, 0.0],
            [2.0, -3.0, 0.0],
        ]
    )
    found, count, _ = seams._edges_cut(Draft(points, np.array([[0, 1, 2], [3, 4, 5]])), 0.01)
    assert count == 2
    assert found.triangles.tolist() == [[3, 4, 5], [0, 4, 2], [4, 3, 2], [3, 1, 2]]


def test_a_triangle_with_vertices_on_two_of_its_edges_is_cut_twice():
    points = np.array(
        [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0], [2.0, 0.0, 0.0], [2.0, -2.0, 0.0], [0.0, 1.0, 0.0], [-2.0, 1.0, 0.0]]
    )  # fmt: skip
    faces = np.array([[0, 1, 2], [0, 4, 3], [4, 1, 3], [2, 6, 5], [6, 0, 5]])
    found = sewn(Draft(points, faces), 4.0)
    assert found.notes == (
        "2 vertices on another face's edge (T-junctions, up to 0 m off) were taken into it",
    )
    assert len(found.triangles) == 7
    rim = {frozenset(edge) for edge in open_edges(found.triangles).tolist()}
    assert rim == {frozenset(edge) for edge in ((0, 4), (4, 1), (1, 2), (2, 6), (6, 0))}


def sliver(x, height, *, right=False):
    """A triangle 10 m long with its tip that far from its left end, and that high, between others; and, to
    the right of it, the same mirrored, which has a corner in common with it."""
    points = np.array([[0.0, 0.0], [10.0, 0.0], [x, height], [5.0, -5.0], [5.0, 5.0]])
    faces = np.array([[0, 1, 2], [1, 0, 3], [0, 2, 4], [2, 1, 4]])
    if right:
        mirrored = points * [-1.0, 1.0] + [20.0, 0.0] * np.ones((5, 1))
        number = np.array([5, 1, 6, 7, 8])
        points, faces = (
            np.vstack([points, mirrored[[0, 2, 3, 4]]]),
            np.vstack([faces, number[faces[:, ::-1]]]),
        )
    return Draft(np.column_stack([points, np.full(len(points), 3.0)]), faces)


def flat_area(draft):
    corner = draft.points[draft.triangles]
    return 0.5 * np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])[:, 2]


@pytest.mark.parametrize(
    ("x", "height", "note", "count"),
    [
        (0.45, 0.05, "slivers: 1 collapsed", 2),
        (0.55, 0.05, "slivers: 1 flipped", 4),
        (4.0, 0.09, "slivers: 1 flipped", 4),
        (4.0, 0.11, None, 4),
    ],
)
def test_a_sliver_loses_a_side_shorter_than_a_twentieth_of_its_longest_or_else_gives_that_away(
    x, height, note, count
):
    found = without_slivers(sliver(x, height))
    assert found.notes == (() if note is None else (note,))
    assert len(found.triangles) == count
    areas = flat_area(found)
    assert areas.min() > (0.5 if note else 0.0)
    assert areas.sum() == pytest.approx(50.0)
    if note and "flipped" in note:
        assert sorted(map(sorted, found.triangles.tolist())) == [[0, 2, 3], [0, 2, 4], [1, 2, 3], [1, 2, 4]]
    if note and "collapsed" in note:
        np.testing.assert_array_equal(found.points, np.delete(sliver(x, height).points, 2, axis=0))


@pytest.mark.parametrize(("x", "what", "count"), [(0.45, "collapsed", 4), (4.0, "flipped", 8)])
def test_slivers_that_touch_each_other_go_one_after_the_other(x, what, count):
    found = without_slivers(sliver(x, 0.05, right=True))
    assert found.notes == (f"slivers: 2 {what}",)
    assert len(found.triangles) == count
    assert np.abs(flat_area(found)).min() > 0.5
    assert flat_area(found).sum() == pytest.approx(100.0)


def test_a_sliver_whose_long_side_lies_on_the_edge_is_dropped():
    draft = sliver(4.0, 0.05)
    found = without_slivers(Draft(draft.points, draft.triangles[[0, 2, 3]]))
    assert found.notes == ("slivers: 1 dropped at the edge",)
    assert (len(found.triangles), len(found.points)) == (2, 4)


def test_a_triangle_s_height_is_told_over_its_longest_side():
    """3, 4 and 5 m: 2.4 m over the longest; and the same in centimetres."""
    points = np.array([[7.0, 5.0, 2.0], [10.0, 5.0, 2.0], [7.0, 9.0, 2.0]])
    for scale in (1.0, 0.01):
        assert seams._heights(scale * points, np.array([[0, 1, 2], [2, 0, 1]])) == pytest.approx([0.48, 0.48])


@pytest.mark.parametrize(("tip", "turns"), [((0.5, 0.4), False), ((0.5, -0.4), True), ((0.5, 0.0), True)])
def test_a_triangle_with_an_area_may_not_turn_over_and_a_sliver_may(tip, turns):
    points = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.5, 0.6, 0.0], [*tip, 0.0], [0.5, 0.004, 0.0]])
    new = np.array([[0, 1, 3]])
    assert seams._turned(points, np.array([[0, 1, 2]]), new, allowed=0.01) == turns
    assert not seams._turned(points, np.array([[0, 1, 4]]), new, allowed=0.01)
    assert seams._turned(points, np.array([[0, 1, 4]]), new, allowed=0.001) == turns
