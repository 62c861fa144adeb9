"""A surface cut off at a level."""

import numpy as np
import pytest

from shellform.errors import InputError
from shellform.surface.shape import cut as cuts
from shellform.surface.shape.cut import cut_off
from shellform.surface.shape.target import make_surface
from tests.surface.test_fairing import sheet


def cone(x, y):
    return 5.0 - np.hypot(x, y)


def test_what_is_left_ends_on_the_level_and_lies_on_the_surface_as_it_was():
    surface = sheet(lambda x, y: 4.0 - 0.2 * (x * x + y * y))
    cut = cut_off(surface, 1.0)
    assert cut.vertices[:, 2].min() == pytest.approx(1.0)
    (rim,) = cut.boundary
    np.testing.assert_allclose(np.hypot(*cut.vertices[rim, :2].T), np.sqrt(15.0), atol=0.03)
    x, y, z = cut.vertices.T
    np.testing.assert_allclose(z, 4.0 - 0.2 * (x * x + y * y), atol=0.012)  # triangles' sag
    assert cut.area < surface.area
    assert any("cut off" in each for each in cut.mended)


def test_triangles_are_divided_to_the_area_above_the_level():
    surface = sheet(lambda x, y: 0.5 * x)
    cut = cut_off(surface, 0.35)
    assert cut.area == pytest.approx(surface.area * (4.0 - 0.7) / 8.0, rel=1e-9)
    corner = cut.vertices[cut.triangles]
    sides = np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2)
    area = 0.5 * np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)
    assert (area / sides.max(axis=1) ** 2).min() > 0.02, "no slivers"


def test_a_surface_above_the_level_stays_as_it_is():
    surface = sheet(cone)
    assert cut_off(surface, float(surface.vertices[:, 2].min())) is surface


@pytest.mark.parametrize(
    ("above", "said"), [(np.nan, "height"), (6.0, "higher than all"), (1.5, "pieces of like size")]
)
def test_levels_that_leave_no_shell_are_refused(above, said):
    with pytest.raises(InputError, match=said):
        cut_off(sheet(lambda x, y: np.abs(x)), above)


def test_of_uneven_pieces_the_largest_stays():
    surface = sheet(lambda x, y: np.where(x < 2.0, 2.0 - np.abs(x + 1.0) / 2.0, 0.4 + 0.9 * (x - 2.0)))
    cut = cut_off(surface, 1.0)
    assert cut.vertices[:, 0].max() < 2.0


def area_of(points, faces):
    corner = points[faces]
    return 0.5 * np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)


def test_each_triangle_keeps_what_lies_above_the_level_once():
    """At 1 m: one above, one with a corner on it, one with an edge on it, two across, one below, one under an
    edge on the level; crossings are shared, and each triangle keeps its turning."""
    points = np.array(
        [[0.0, 0.0, 3.0], [2.0, 0.0, 3.0], [0.0, 2.0, 2.0], [2.0, 2.0, 1.0], [4.0, 0.0, 1.0], [0.0, 4.0, 0.0], [4.0, 4.0, -2.0]]
    )  # fmt: skip
    faces = np.array([[0, 1, 2], [1, 3, 2], [1, 4, 3], [2, 3, 5], [3, 6, 5], [4, 6, 3], [0, 2, 5]])
    side = np.sign(points[:, 2] - 1.0)
    found, kept = cuts._divided(points, faces, side, 1.0)
    np.testing.assert_array_equal(found[:7], points)
    np.testing.assert_allclose(sorted(found[7:].tolist()), [[0.0, 2.0 + 2.0 / 3.0, 1.0], [0.0, 3.0, 1.0]])
    middle, edge = (7 + int(np.argmin(np.abs(found[7:, 1] - y))) for y in (3.0, 8.0 / 3.0))
    told = {tuple(np.roll(face, -int(np.argmin(face))).tolist()) for face in kept}
    assert len(kept) == len(told) == 6
    assert {(0, 1, 2), (1, 3, 2), (1, 4, 3), (2, 3, middle)} <= told
    assert told - {(0, 1, 2), (1, 3, 2), (1, 4, 3), (2, 3, middle)} in (
        {(0, 2, middle), (0, middle, edge)},
        {(0, 2, edge), (2, middle, edge)},
    )
    assert area_of(found[:, [0, 1, 1]] * [1.0, 1.0, 0.0], np.array(kept)).sum() == pytest.approx(
        2 + 2 + 2 + 1
    )


@pytest.mark.parametrize("begin", range(3))
@pytest.mark.parametrize("mirrored", [False, True])
def test_a_triangle_with_a_corner_on_the_level_is_cut_from_there(begin, mirrored):
    points = np.array([[0.0, 0.0, 2.0], [3.0, 0.0, 0.5], [0.0, 2.0, -2.5]])
    face = np.roll([0, 1, 2], begin)[:: -1 if mirrored else 1]
    found, kept = cuts._divided(points, face[None], np.array([1.0, 0.0, -1.0]), 0.5)
    np.testing.assert_allclose(found, [*points.tolist(), [0.0, 2.0 / 3.0, 0.5]])
    ((a, b, c),) = kept.tolist()
    assert sorted((a, b, c)) == [0, 1, 3]
    assert ((a, b, c) in ((0, 1, 3), (1, 3, 0), (3, 0, 1))) != mirrored


def test_a_vertex_inside_moves_along_its_edges_and_one_of_the_rim_along_the_rim_alone():
    """The middle of a square, 0.1 m above the level, of whose corners one is 0.9 m below and the others are
    above."""
    points = np.array(
        [[0.0, 0.0, 0.1], [2.0, 0.0, -0.9], [0.0, 2.0, 0.3], [-2.0, 0.0, 0.5], [0.0, -2.0, 0.4]]
    )
    surface = make_surface(points, np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1]]))
    found, side = cuts._snapped(surface, 0.0)
    np.testing.assert_allclose(found[0], [0.2, 0.0, 0.0], atol=1e-15)
    np.testing.assert_array_equal(found[1:], points[1:])
    assert side.tolist() == [0.0, -1.0, 1.0, 1.0, 1.0]


@pytest.mark.parametrize("level", [1.0, 1.5])
@pytest.mark.parametrize("turned", [False, True])
def test_a_slope_is_cut_to_its_length_whether_or_not_vertices_lie_on_the_level(level, turned):
    """Of a slope of 1 : 2 over 8 × 8 m, which rises from -2 to 2 m and has vertices at each sixth of a
    metre."""
    surface = sheet(lambda x, y: 0.5 * (y if turned else x))
    for above in (level - 1.0, level - 1.0 + 0.02, level - 1.0 + 0.08, level - 1.0 - 0.02):
        cut = cut_off(surface, above)
        assert cut.area == pytest.approx(surface.area * (2.0 - above) / 4.0, rel=1e-9)
        assert cut.vertices[:, 2].min() == pytest.approx(above, abs=1e-12)
        assert cut.mended[-1].startswith(f"cut off {above + 2.0:.3g} m above its lowest point")


def test_vertices_near_a_crossing_move_onto_it_along_their_edge_and_the_nearest_one_decides():
    """A strip of two triangles on a slope, 0.1 and 0.3 of whose edges' lengths lie below the level."""
    points = np.array([[0.0, 0.0, -0.1], [0.0, 1.0, -0.3], [1.0, 0.0, 0.9], [1.0, 1.0, 0.7]])
    surface = make_surface(points, np.array([[0, 2, 3], [0, 3, 1]]))
    found, side = cuts._snapped(surface, 0.0)
    # vertex 0 has edges to 2, crossed at a tenth, and to 3, which isn't on the rim, crossed at an eighth
    np.testing.assert_allclose(found, [[0.1, 0.0, 0.0], [0.0, 1.0, -0.3], [1.0, 0.0, 0.9], [1.0, 1.0, 0.7]])
    assert side.tolist() == [0.0, -1.0, 1.0, 1.0]
    found, side = cuts._snapped(surface, 0.55)
    # vertex 3 is 0.15 above: crossed at 0.15 of its edge to 1 and at 3/16 of that to 0
    np.testing.assert_allclose(found[3], [0.85, 1.0, 0.55])
    assert side.tolist() == [-1.0, -1.0, 1.0, 0.0]


def test_seven_tenths_of_the_area_above_the_level_have_to_be_in_one_piece():
    """Two ridges along y, as wide as they are high above the level: of 10 m in all, 7.2 and 6.8 are one's."""
    for share, fits in ((0.72, True), (0.68, False)):
        left, right = 2.5 * share, 2.5 * (1.0 - share)

        def ridges(x, y, left=left, right=right):
            return np.maximum(left - np.abs(x + 2.0), right - np.abs(x - 2.0))

        surface = sheet(ridges, count=81)
        if fits:
            assert cut_off(surface, 0.001).vertices[:, 0].max() < 0.0
        else:
            with pytest.raises(InputError, match="pieces of like size"):
                cut_off(surface, 0.001)
