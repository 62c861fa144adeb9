"""Which objects of a file are the surface, and how its polygons become triangles."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from shellform.errors import InputError
from shellform.surface.readers import draft
from shellform.surface.readers.draft import Choice, MeshObject, among, check_points, joined, triangulated

SQUARE = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
LABELS = [("Shell::Roof", "a"), ("Shell::Roof", "b"), ("Shell::roof", ""), ("Site", "a"), ("", "c")]


def area_of(points, triangles):
    corner = points[triangles]
    return 0.5 * np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])


@pytest.mark.parametrize(
    ("choice", "kept"),
    [
        (Choice(), [0, 1, 2, 3, 4]),
        (Choice(layer="ROOF"), [0, 1, 2]),
        (Choice(layer="shell::roof"), [0, 1, 2]),
        (Choice(layer="site"), [3]),
        (Choice(name="A"), [0, 3]),
        (Choice(layer="roof", name="a"), [0]),
    ],
)
def test_objects_are_chosen_by_layer_and_by_name_in_whatever_case(choice, kept):
    assert np.flatnonzero(among(LABELS, choice, "f.3dm")).tolist() == kept


def test_where_none_is_meant_what_there_is_is_listed_the_most_frequent_first():
    with pytest.raises(InputError, match=r"surface\.layer: f\.3dm has no such surface") as told:
        among(LABELS, Choice(layer="Shell"), "f.3dm")
    assert told.value.remedy == "There are 'Shell::Roof' (2), 'Shell::roof', 'Site'."
    with pytest.raises(InputError, match=r"surface\.object") as told:
        among(LABELS, Choice(layer="site", name="b"), "f.3dm")
    assert "'a' (2), 'b', 'c'" in told.value.remedy
    for count, more in ((12, "."), (13, " and 1 more."), (20, " and 8 more.")):
        with pytest.raises(InputError) as told:
            among([(f"L{k}", "") for k in range(count)], Choice(layer="x"), "f.3dm")
        assert told.value.remedy.count("'L") == 12
        assert told.value.remedy.endswith(more)
    with pytest.raises(InputError, match=r"None has a name"):
        among([("a", ""), ("b", "")], Choice(name="x"), "f.3dm")


def test_a_layer_asked_for_as_an_object_is_told_to_be_one_and_the_other_way_round():
    for choice, remedy in (
        (Choice(name="Roof"), "A layer is called so: surface.layer."),
        (Choice(layer="b"), "An object is called so: surface.object."),
    ):
        with pytest.raises(InputError) as told:
            among([("Shell::Roof", ""), ("Site", "b")], choice, "f.obj")
        assert told.value.remedy == remedy


def test_chosen_parts_are_numbered_one_after_the_other():
    parts = [
        MeshObject("a", "1", SQUARE, (np.array([[0, 1, 2, 3]]),)),
        MeshObject("b", "2", SQUARE + 5.0, (np.array([[0, 1, 2]]),)),
        MeshObject(
            "a", "3", SQUARE + 9.0, (np.array([[3, 1, 2]]), np.array([[0, 1, 3]]), np.zeros((2, 2), int))
        ),
    ]
    found = joined(parts, Choice(name="a"), "f.obj")
    np.testing.assert_array_equal(found.points, np.vstack([SQUARE, SQUARE + 9.0]))
    assert found.triangles.tolist() == [[0, 1, 2], [0, 2, 3], [7, 5, 6], [4, 5, 7]]


def test_points_that_objects_share_stand_once_in_the_whole_and_none_of_those_left_out():
    square, other = SQUARE, SQUARE + 7.0
    parts = [
        MeshObject("a", "", square, (np.array([[0, 1, 2]]),)),
        MeshObject("b", "", other, (np.array([[0, 1, 2, 3]]),)),
        MeshObject("c", "", square, (np.array([[1, 3, 2]]),)),
    ]
    found = joined(parts, Choice(), "f.obj")
    np.testing.assert_array_equal(found.points, np.vstack([square, other]))
    assert found.triangles.tolist() == [[0, 1, 2], [4, 5, 6], [4, 6, 7], [1, 3, 2]]
    alone = joined(parts, Choice(name="c"), "f.obj")
    np.testing.assert_array_equal(alone.points, square[1:])
    assert alone.triangles.tolist() == [[0, 2, 1]]


def test_a_point_of_no_face_is_kept_to_be_told_beside_objects_left_out():
    parts = [MeshObject(name, "", SQUARE, (np.array([[0, 1, 2]]),)) for name in "ab"]
    np.testing.assert_array_equal(joined(parts, Choice(name="a"), "f.obj").points, SQUARE)
    parts = [
        replace(part, faces=(np.array([face]),))
        for part, face in zip(parts, [[0, 1, 2], [4, 1, -1]], strict=True)
    ]
    np.testing.assert_array_equal(joined(parts, Choice(name="a"), "f.obj").points, SQUARE)


@pytest.mark.parametrize(
    ("face", "named"), [([0, 1, 4], 5), ([0, 1, 7], 8), ([-1, 1, 2], 0), ([0, -3, 2], -2), ([-2, 1, 9], -1)]
)
def test_a_face_that_names_a_vertex_that_is_not_there_is_refused_with_its_number(face, named):
    with pytest.raises(InputError, match=f"f.obj: a face names vertex {named}, of 4"):
        joined([MeshObject("", "", SQUARE, (np.array([face]),))], Choice(), "f.obj")


def test_files_without_faces_and_with_too_many_are_refused(monkeypatch):
    one = MeshObject("", "", SQUARE, (np.array([[0, 1, 2, 3]]),))
    with pytest.raises(InputError, match="holds no faces"):
        joined([MeshObject("", "", SQUARE, (np.zeros((0, 3), int),))], Choice(), "f")
    monkeypatch.setattr(draft, "MOST_TRIANGLES", 4)
    assert len(joined([one, one], Choice(), "f").triangles) == 4
    with pytest.raises(InputError, match="has 6 triangles; up to 4 are read"):
        joined([one, one, one], Choice(), "f")
    monkeypatch.setattr(draft, "_MOST_CORNERS", 5)
    turn = np.linspace(0.0, 2.0 * np.pi, 6, endpoint=False)
    ring = np.column_stack([np.cos(turn), np.sin(turn), 0.0 * turn])
    assert len(joined([MeshObject("", "", ring, (np.arange(5)[None],))], Choice(), "f").triangles) == 3
    with pytest.raises(InputError, match="has a face of 6 corners; up to 5 are read"):
        joined([MeshObject("", "", ring, (np.arange(6)[None],))], Choice(), "f")


def test_the_first_vertex_without_a_number_is_named_and_the_others_counted():
    points = np.ones((9, 3))
    check_points(points, "f")
    points[[3, 5, 8], [2, 0, 1]] = np.nan, np.inf, -np.inf
    with pytest.raises(InputError, match="f: vertex 4 has a coordinate that is no number, as 2 others have"):
        check_points(points, "f")


KITE = np.array([[0.0, -2.0, 0.0], [0.6, 0.0, 0.0], [0.0, 2.0, 0.0], [-1.4, 0.0, 0.0]])  # 4 m long, 2 m wide


@pytest.mark.parametrize("lifted", range(4))
@pytest.mark.parametrize("height", [0.4, -0.4])
def test_a_quadrilateral_is_cut_along_the_diagonal_that_folds_less(lifted, height):
    """Of a kite across: the sine of a fold is as its length over the areas of both triangles, 2 m / (2 m² 2
    m²) across and 4 m / (1.2 m² 2.8 m²) along."""
    points = KITE + [3.0, 5.0, 2.0] * np.ones((4, 1))
    points[lifted, 2] += height
    assert triangulated(points, np.array([[0, 1, 2, 3]])).tolist() == [[0, 1, 3], [1, 2, 3]]
    assert triangulated(points, np.array([[1, 2, 3, 0]])).tolist() == [[1, 2, 3], [1, 3, 0]]


def test_several_quadrilaterals_are_cut_each_in_its_own_way():
    points = np.vstack([KITE, KITE[:, [1, 0, 2]] * [1.0, -1.0, 1.0]])
    points[[0, 5], 2] += 0.4
    found = triangulated(points, np.array([[1, 2, 3, 0], [4, 5, 6, 7], [0, 1, 2, 3]]))
    assert found.tolist() == [[1, 2, 3], [1, 3, 0], [4, 5, 7], [5, 6, 7], [0, 1, 3], [1, 2, 3]]
    assert triangulated(points, np.array([[4, 5]])).shape == (0, 3)


POLYGONS = {
    "an L": [(0, 0), (3, 0), (3, 1), (1, 1), (1, 4), (0, 4)],
    "a comb": [(0, 0), (7, 0), (7, 3), (6, 3), (6, 1), (4, 1), (4, 5), (3, 5), (3, 1), (1, 1), (1, 4), (0, 4)],
    "a star": [(np.cos(t) * r, np.sin(t) * r) for k in range(10) for t, r in [(np.pi * k / 5, (2.0, 0.7)[k % 2])]],
}  # fmt: skip


@pytest.mark.parametrize("name", [*POLYGONS])
@pytest.mark.parametrize("begin", [0, 2, 5])
@pytest.mark.parametrize("mirrored", [False, True])
def test_a_concave_polygon_is_cut_into_triangles_that_lie_in_it_and_do_not_turn_over(name, begin, mirrored):
    """Wherever its corners are counted from, on a slope of its own, and away from the origin."""
    flat = np.roll(np.array(POLYGONS[name], dtype=float), -begin, axis=0)
    flat = flat[::-1] if mirrored else flat
    x, y = flat.T
    whole = 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))
    points = np.column_stack([x + 30.0, y - 20.0, 0.5 * x - 0.3 * y + 7.0])
    count = len(points)
    found = triangulated(points, np.arange(count)[None])
    assert found.shape == (count - 2, 3)
    areas = area_of(points, found)[:, 2]
    assert (areas * np.sign(whole) > 1e-9).all()
    assert areas.sum() == pytest.approx(whole)
    edges = {frozenset(pair) for three in found.tolist() for pair in itertools.combinations(three, 2)}
    assert {frozenset((k, (k + 1) % count)) for k in range(count)} <= edges
    assert len(edges) == 2 * count - 3


def test_the_ear_whose_smallest_angle_is_widest_is_cut_first():
    """Of a house with a flat roof on one side: its angles at corner 3, a right one with equal sides, are 45°
    and more."""
    house = np.array([[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [4.2, 1.0, 0.0], [3.0, 3.0, 0.0], [0.0, 1.5, 0.0]])

    def smallest(k):
        a, b, c = house[k - 1], house[k], house[(k + 1) % 5]
        sides = sorted(np.linalg.norm(p - q) for p, q in ((a, b), (b, c), (c, a)))
        return np.arccos((sides[1] ** 2 + sides[2] ** 2 - sides[0] ** 2) / (2.0 * sides[1] * sides[2]))

    best = max(range(5), key=smallest)
    first = triangulated(house, np.arange(5)[None])[0].tolist()
    assert first == [(best - 1) % 5, best, (best + 1) % 5]
    assert draft._smallest_angle(house[[best - 1, best, (best + 1) % 5]]) == pytest.approx(smallest(best))


def test_the_smallest_angle_of_a_triangle_of_3_4_and_5_is_that_opposite_of_3():
    ear = np.array([[1.0, 2.0, 5.0], [1.0, 2.0, 8.0], [5.0, 2.0, 5.0]])
    for turned in itertools.permutations(range(3)):
        assert draft._smallest_angle(ear[[*turned]]) == pytest.approx(np.arctan(3.0 / 4.0))
    assert draft._smallest_angle(ear[[0, 0, 1]]) < np.pi / 2.0


@pytest.mark.parametrize(
    ("others", "inside"),
    [
        ([[0.5, 0.5, 0.0]], True),
        ([[2.0, 2.0, 0.0]], False),
        ([[-0.1, 0.5, 0.0], [0.5, -0.1, 0.0]], False),
        ([[3.0, 3.0, 0.0], [0.2, 1.9, 0.0]], True),
        ([[0.0, 1.0, 0.0]], False),
    ],
)
def test_an_ear_that_another_corner_lies_in_is_told(others, inside):
    """A corner on its side doesn't lie in it."""
    ear = np.array([[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [0.0, 3.0, 0.0]])
    for side in (1.0, -1.0):
        turned = ear if side > 0.0 else ear[::-1]
        assert draft._any_inside(np.array(others), turned, np.array([0.0, 0.0, side])) == inside
