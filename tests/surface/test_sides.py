"""Which faces of closed skins are the upper and the lower ones: prisms along y, of which the outline is
given."""

import numpy as np
import pytest

from shellform.errors import InputError
from shellform.surface.readers.sides import shared_edges, side_of

LONG = 3.0  # m, along y


def prism(outline):
    """Points and triangles of the skin round a convex outline (n, 2) of x and z, counterclockwise seen
    against y; triangles 2k and 2k + 1 belong to side k, those that follow to the ends."""
    xz = np.asarray(outline, dtype=float)
    count = len(xz)
    points = np.vstack([np.insert(xz, 1, y, axis=1) for y in (0.0, LONG)]) + np.array([40.0, -7.0, 12.0])
    here, following = np.arange(count), (np.arange(count) + 1) % count
    quads = np.column_stack([here, here + count, following + count, following])
    sides = np.stack([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]], axis=1).reshape(-1, 3)
    fan = np.column_stack([np.zeros(count - 2, dtype=int), here[1:-1], here[2:]])
    faces = np.vstack([sides[:, ::-1], fan, fan[:, ::-1] + count])
    corner = points[faces]
    volume = np.sum(np.cross(corner[:, 0], corner[:, 1]) * corner[:, 2]) / 6.0
    return points, faces if volume > 0.0 else faces[:, ::-1]


def sides_of(outline, face, *, inside_out=False):
    """The numbers of the outline's sides that are the face; none of the ends is."""
    points, faces = prism(outline)
    kept = side_of(points, faces[:, ::-1] if inside_out else faces, face, "shed")
    both = kept[: 2 * len(outline)].reshape(-1, 2)
    assert (both[:, 0] == both[:, 1]).all()
    assert not kept[2 * len(outline) :].any()
    return np.flatnonzero(both[:, 0]).tolist()


def shed(ridge, rise, width=10.0):
    """A shed whose right-hand roof is side 2 and whose left-hand one is side 3; the ground is side 0."""
    return [(0.0, 0.0), (width, 0.0), (width, 4.0), (ridge, 4.0 + rise), (0.0, 4.0)]


@pytest.mark.parametrize("inside_out", [False, True])
@pytest.mark.parametrize(
    ("ridge", "rise", "upper"),
    [
        (8.5, 0.7, [2, 3]),  # folded by 30°
        (8.5, 0.9, [3]),  # by 37°: a face of its own, and less than a quarter of the other one's plan
        (7.9, 1.4, [2, 3]),  # by 44°, and 2.1 of 7.9 m
        (8.1, 1.4, [3]),  # 1.9 of 8.1 m
        (1.9, 1.4, [2]),
        (2.1, 1.4, [2, 3]),
    ],
)
def test_the_upper_face_is_what_points_up_between_edges_of_35_degrees(ridge, rise, upper, inside_out):
    assert sides_of(shed(ridge, rise), "upper", inside_out=inside_out) == upper
    assert sides_of(shed(ridge, rise), "lower", inside_out=inside_out) == [0]
    turned = [(10.0 - x, 9.0 - z) for x, z in shed(ridge, rise)]
    assert sides_of(turned, "lower", inside_out=inside_out) == upper
    assert sides_of(turned, "upper", inside_out=inside_out) == [0]


def bulb(upright, undercut):
    """An outline of sides whose normals turn by 30° at the most, from 118° on the right over the vertical to
    118° on the left: 8 m of them point up, so many stand upright on both sides, and so many below hang
    over."""
    right = [(118.0, undercut), (90.0, upright), (60.0, 1.0), (30.0, 1.0)]
    stretches = [*right, (0.0, 4.0), *((-angle, length) for angle, length in reversed(right))]
    at, outline = np.zeros(2), []
    for angle, length in stretches:
        outline.append(at)
        turn = np.deg2rad(angle)
        at = at + length * np.array([-np.cos(turn), np.sin(turn)])
    return np.round([*outline, at], 12)


def test_three_quarters_of_a_face_have_to_point_to_its_side():
    assert sides_of(bulb(0.5, 0.5), "upper") == list(range(9)), "8 of 10 m"
    with pytest.raises(
        InputError, match="shed: its upper face isn't set off from the rest by an edge"
    ) as told:
        sides_of(bulb(1.0, 0.5), "upper")  # 8 of 11 m: what stands upright doesn't point up
    assert "Export the upper face alone" in told.value.remedy


def test_edges_that_two_triangles_share_are_found_and_which_pass_them_the_same_way():
    triangles = np.array([[0, 1, 2], [1, 0, 3], [2, 1, 4], [1, 2, 5], [7, 8, 9]])
    first, second, same = shared_edges(triangles[[0, 1, 4]])
    assert (first.tolist(), second.tolist(), same.tolist()) == ([0], [1], [False])
    first, second, same = shared_edges(triangles[[0, 4, 3]])
    assert ({first[0], second[0]}, same.tolist()) == ({0, 2}, [True])
    assert [len(each) for each in shared_edges(triangles[4:])] == [0, 0, 0]
