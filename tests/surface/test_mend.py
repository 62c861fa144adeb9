"""Each defect is mended and told, and the mended surface is the clean one; what can't be mended is refused by
name.
"""

from dataclasses import replace

import numpy as np
import pytest

from shellform.errors import InputError
from shellform.surface.readers import mend
from shellform.surface.readers.draft import Choice, Draft, MeshObject, joined
from shellform.surface.readers.reading import surface_of
from shellform.surface.shape.triangles import open_edges
from tests.surface.shells import cap, split

POINTS, QUADS = cap()
TRIANGLES = split(QUADS)
CLEAN = surface_of(Draft(POINTS, TRIANGLES), "clean")


def mended(points, triangles, **choice):
    return surface_of(Draft(np.asarray(points, dtype=float), np.asarray(triangles)), "shell", **choice)


def told(surface, *words):
    for word in words:
        assert any(word in note for note in surface.mended), surface.mended


def as_clean(surface, atol=1e-9):
    assert len(surface.vertices) == len(CLEAN.vertices)
    assert len(surface.triangles) == len(CLEAN.triangles)
    assert surface.area == pytest.approx(CLEAN.area, abs=atol)
    assert len(surface.boundary) == 1
    assert surface.normals[:, 2].min() > 0.0


def test_a_clean_mesh_is_left_as_it_is():
    assert CLEAN.mended == ()
    np.testing.assert_array_equal(CLEAN.vertices, POINTS)
    np.testing.assert_array_equal(CLEAN.triangles, TRIANGLES)


def test_loose_triangles_are_joined_even_where_their_corners_differ_in_the_last_digits():
    rng = np.random.default_rng(1)
    loose = POINTS[TRIANGLES].reshape(-1, 3)
    loose = loose + rng.uniform(-2e-9, 2e-9, loose.shape)
    surface = mended(loose, np.arange(len(loose)).reshape(-1, 3))
    as_clean(surface, atol=1e-6)
    told(surface, f"{len(loose) - len(POINTS)} vertices lay on others")


def test_points_of_no_face_and_faces_given_twice_are_dropped():
    surface = mended(
        np.vstack([POINTS, [[99.0, 0, 0]]]),
        np.vstack([TRIANGLES, TRIANGLES[:3, [1, 2, 0]], TRIANGLES[:2, ::-1]]),
    )
    as_clean(surface)
    told(surface, "1 point of no face was", "5 faces given twice")


def test_faces_that_are_a_point_or_a_line_are_dropped():
    surface = mended(POINTS, np.vstack([TRIANGLES, [[0, 0, 1], [5, 5, 5]]]))
    as_clean(surface)
    told(surface, "2 faces without area")


def test_flipped_faces_are_turned_and_counted():
    faces = TRIANGLES.copy()
    faces[10:30] = faces[10:30, ::-1]
    surface = mended(POINTS, faces)
    as_clean(surface)
    told(surface, "20 faces were turned")
    as_clean(mended(POINTS, TRIANGLES[:, ::-1]))


def test_a_moebius_strip_has_one_side_only():
    turn = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    across = np.array([-0.3, 0.3])
    points = np.array(
        [
            [(2 + w * np.cos(t / 2)) * np.cos(t), (2 + w * np.cos(t / 2)) * np.sin(t), w * np.sin(t / 2)]
            for t in turn
            for w in across
        ]
    )
    at = 2 * np.arange(40)
    quads = np.column_stack([at, at + 1, (at + 3) % 80, (at + 2) % 80])
    quads[-1] = [78, 79, 0, 1]
    with pytest.raises(InputError, match="one side only"):
        mended(points, split(quads))


def test_patches_of_different_meshes_are_sewn_along_their_common_edge():
    # Two halves of a plane strip, one meshed twice as fine along the seam, their vertices 0.2 mm apart.
    left, coarse = cap(columns=4, rows=6, rise=0.0)
    right, fine = cap(columns=4, rows=12, rise=0.0)
    right = right + np.array([6.0 + 2e-4, 0, 1e-4])
    surface = mended(np.vstack([left, right]), np.vstack([split(coarse), split(fine) + len(left)]))
    assert len(surface.boundary) == 1
    assert surface.area == pytest.approx(48.0, rel=1e-4)
    told(surface, "7 pairs of vertices across a gap of up to 0.00022 m", "6 vertices on another face's edge")


def test_a_curved_seam_between_patches_of_unrelated_meshes_closes():
    # Quarter cylinders whose straight edges match and whose arcs are divided 7 and 16 times.
    def barrel(arcs, x0, x1, columns):
        angle, x = np.meshgrid(
            np.linspace(0.3, np.pi - 0.3, arcs + 1), np.linspace(x0, x1, columns + 1), indexing="ij"
        )
        points = np.column_stack([x.ravel(), 2 * np.cos(angle.ravel()), 2 * np.sin(angle.ravel())])
        at = np.arange(len(points)).reshape(arcs + 1, columns + 1)
        return points, np.stack([at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]], axis=-1).reshape(-1, 4)

    (a, first), (b, second) = barrel(21, 0, 3, 8), barrel(48, 3, 6, 16)
    surface = mended(np.vstack([a, b]), np.vstack([split(first), split(second) + len(a)]))
    assert len(surface.boundary) == 1
    told(surface, "T-junctions")


def test_slivers_are_collapsed_flipped_or_dropped():
    middle = 0.5 * (POINTS[TRIANGLES[50, 0]] + POINTS[TRIANGLES[50, 1]])
    inside = POINTS[TRIANGLES[50]].mean(axis=0)
    near = middle + 1e-3 * (inside - middle)
    a, b, c = TRIANGLES[50]
    new = len(POINTS)
    cut = np.vstack([np.delete(TRIANGLES, 50, axis=0), [[a, b, new], [b, c, new], [c, a, new]]])
    surface = mended(np.vstack([POINTS, near]), cut)
    told(surface, "1 flipped")
    assert heights(surface).min() > 0.1
    assert surface.area == pytest.approx(CLEAN.area, rel=1e-4)
    needle = mended(np.vstack([POINTS, POINTS[a] + 1e-3 * (inside - POINTS[a])]), cut)
    told(needle, "collapsed")
    as_clean(needle, atol=1e-3)
    first, second = open_edges(TRIANGLES)[3]
    row = int(np.flatnonzero((first == TRIANGLES).any(axis=1) & (second == TRIANGLES).any(axis=1))[0])
    a, b, c = TRIANGLES[row]
    tip = next(v for v in (a, b, c) if v not in (first, second))
    middle = POINTS[[first, second]].mean(axis=0)
    cut = np.vstack([np.delete(TRIANGLES, row, axis=0), [[a, b, new], [b, c, new], [c, a, new]]])
    rim = mended(np.vstack([POINTS, middle + 1e-3 * (POINTS[tip] - middle)]), cut)
    told(rim, "1 dropped at the edge")
    assert heights(rim).min() > 0.1


def heights(surface):
    corner = surface.vertices[surface.triangles]
    longest = np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2).max(axis=1)
    return (
        np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)
        / longest**2
    )


def test_of_several_pieces_one_has_to_be_chosen():
    points = np.vstack([POINTS, 0.5 * POINTS + [20, 0, 0]])
    faces = np.vstack([TRIANGLES, TRIANGLES + len(POINTS)])
    with pytest.raises(InputError, match=r"2 separate pieces, of 27, 6.74 m².*--piece"):
        mended(points, faces)
    as_clean(mended(points, faces, piece=1))
    flat = points * [1.0, 1.0, 1e-16]
    with pytest.raises(InputError, match=r"--piece 1 is 6 × 4 × 0 m about \(0, 0, 0\)"):
        mended(flat, faces)
    small = mended(points, faces, piece=2)
    np.testing.assert_allclose(small.size, 0.5 * CLEAN.size)
    told(small, "piece 2 of 2")
    with pytest.raises(InputError, match=r"surface\.piece: shell has no such piece.*There are 2"):
        mended(points, faces, piece=3)


@pytest.mark.parametrize("side", [0.05, 0.2])
def test_crumbs_of_less_than_a_thousandth_of_the_area_are_dropped_and_told(side):
    """Two triangles beside a cap of 27 m², of 0.0025 and of 0.04 m² together."""
    crumbs = np.array(
        [[9.0, 0, 0], [9 + side, 0, 0], [9, side, 0], [9, 3, 1], [9 + side, 3, 1], [9, 3 + side, 1]]
    )
    points = np.vstack([POINTS, crumbs])
    faces = np.vstack([TRIANGLES, len(POINTS) + np.arange(6).reshape(2, 3)])
    if side > 0.1:
        with pytest.raises(InputError, match=r"3 separate pieces, of 27, 0.02, 0.02 m²"):
            mended(points, faces)
        return
    surface = mended(points, faces)
    as_clean(surface)
    told(surface, "2 loose pieces were dropped, 0.0025 m² in all")
    assert mended(points, faces, piece=2).area == pytest.approx(0.5 * side**2)


def test_pieces_that_touch_in_a_point_only_are_pieces():
    corner = POINTS[0] - POINTS[-1]
    points = np.vstack([POINTS, POINTS + corner])
    with pytest.raises(InputError, match="2 separate pieces"):
        mended(points, np.vstack([TRIANGLES, TRIANGLES + len(POINTS)]))


def test_an_edge_that_meets_itself_in_a_vertex_is_parted():
    # Two holes that touch at a corner: the boundary's vertex has two ways on.
    at = np.arange(len(QUADS)).reshape(12, 8)
    quads = np.delete(QUADS, [at[4, 3], at[5, 4]], axis=0)
    surface = mended(POINTS, split(quads))
    told(surface, "1 vertex at which the edge met itself was parted")
    assert len(surface.boundary) == 2
    assert surface.holes == 1
    assert len(surface.vertices) == len(POINTS) + 1


def solid(thickness=0.2):
    """A closed skin round the cap: the upper face, the lower one below it, and a rim of quadrilaterals."""
    normals = CLEAN.normals
    points = np.vstack([POINTS, POINTS - thickness * normals])
    rim = open_edges(TRIANGLES)
    wall = np.column_stack([rim[:, 1], rim[:, 0], rim[:, 0] + len(POINTS), rim[:, 1] + len(POINTS)])
    return points, np.vstack([TRIANGLES, TRIANGLES[:, ::-1] + len(POINTS), split(wall)])


@pytest.mark.parametrize("inside_out", [False, True])
def test_a_solid_gives_its_upper_or_lower_face_when_asked(inside_out):
    points, faces = solid()
    faces = faces[:, ::-1] if inside_out else faces
    with pytest.raises(InputError, match=r"closed.*--face"):
        mended(points, faces)
    upper = mended(points, faces, face="upper")
    as_clean(upper)
    told(upper, "the upper face of a closed skin was taken")
    lower = mended(points, faces, face="lower")
    assert len(lower.triangles) == len(TRIANGLES)
    assert lower.vertices[:, 2].max() == pytest.approx(1.3, abs=1e-6)
    assert lower.normals[:, 2].min() > 0.0


@pytest.mark.parametrize("face", ["upper", "lower"])
def test_a_face_of_what_is_not_closed_is_refused_unless_its_reader_has_taken_it_of_a_solid(face):
    said = rf"^surface\.face: shell holds .*isn't closed.*no {face} face.*found '{face}'.*Leave surface\.face"
    with pytest.raises(InputError, match=said):
        mended(POINTS, TRIANGLES, face=face)
    as_clean(surface_of(Draft(POINTS, TRIANGLES, of_solid=True), "shell", face=face))


def test_a_ball_has_no_edge_that_sets_off_a_face():
    turn, height = np.meshgrid(
        np.linspace(0, 2 * np.pi, 24, endpoint=False), np.linspace(-1.3, 1.3, 13), indexing="ij"
    )
    rows = np.column_stack(
        [
            (np.cos(height) * np.cos(turn)).ravel(),
            (np.cos(height) * np.sin(turn)).ravel(),
            np.sin(height).ravel(),
        ]
    )
    at = np.arange(24 * 13).reshape(24, 13)
    nxt = np.roll(at, -1, axis=0)
    quads = np.stack([at[:, :-1], nxt[:, :-1], nxt[:, 1:], at[:, 1:]], axis=-1).reshape(-1, 4)
    poles = np.vstack([rows, [[0, 0, -1], [0, 0, 1]]])
    caps = np.vstack(
        [
            np.column_stack([nxt[:, 0], at[:, 0], np.full(24, 312)]),
            np.column_stack([at[:, -1], nxt[:, -1], np.full(24, 313)]),
        ]
    )
    with pytest.raises(InputError, match="isn't set off"):
        mended(poles, np.vstack([split(quads), caps]), face="upper")


def test_meshes_without_area_or_with_branching_edges_are_refused():
    with pytest.raises(InputError, match="no extent"):
        mended(np.zeros((3, 3)), [[0, 1, 2]])
    line = np.column_stack([np.arange(5.0), np.zeros((5, 2))])
    with pytest.raises(InputError, match="no triangle with an area"):
        mended(line, [[0, 1, 2], [2, 3, 4]])
    fin = np.vstack([POINTS, [[0.0, 0.0, 5.0]]])
    with pytest.raises(InputError, match="more than two faces, the first at"):
        mended(fin, np.vstack([TRIANGLES, [[60, 61, len(POINTS)]]]))


def test_vertices_nearer_than_a_hundred_millionth_of_the_size_are_one():
    points = np.array(
        [[5.0, 5.0, 0.0], [9.0, 5.0, 0.0], [5.0, 8.0, 0.0], [9.0, 5.0, 0.0], [9.0, 8.0, 0.0], [5.0, 8.0, 0.0]]
    )
    faces = np.array([[0, 1, 2], [3, 4, 5]])
    for apart, count in ((0.9e-8, 4), (1.1e-8, 5), (1.9e-8, 5)):
        near = points.copy()
        near[3] += [apart * 4.0, 0.0, 0.0]
        found = mend._merged(Draft(near, faces), 4.0)
        assert len(found.points) == count
        merged = {1: "1 vertex lay on another and was merged", 2: "2 vertices lay on others and were merged"}
        assert found.notes == (merged[6 - count],)


def test_the_first_of_equal_points_stands_for_them_and_nearness_goes_on_from_one_to_the_next():
    x = np.array([3.0, 1.0, 1.09, 3.0, 1.18, 2.0])
    points = np.column_stack([x, 0.0 * x, 7.0 + 0.0 * x])
    assert mend._same_places(points, 0.1).tolist() == [0, 1, 1, 0, 1, 5]
    assert mend._same_places(points, 0.05).tolist() == [0, 1, 2, 0, 4, 5]
    assert mend._same_places(points[:0], 0.1).tolist() == []


def test_lines_of_faces_without_area_are_refused_wherever_they_lie():
    line = np.outer(np.arange(5.0), [3.0, 0.0, 4.0]) + np.array([100.0, 70.0, -30.0])
    with pytest.raises(InputError, match="no triangle with an area"):
        mended(line, [[0, 1, 2], [2, 3, 4]])


def test_what_lies_too_far_from_the_origin_or_has_no_extent_is_refused():
    far = POINTS + np.array([0.0, -0.9e9, 0.0])
    assert mend.mended(Draft(far, TRIANGLES), "s").points.shape == POINTS.shape
    with pytest.raises(InputError, match=r"has coordinates of up to 1\.1e\+09 m"):
        mended(POINTS + np.array([0.0, -1.1e9, 0.0]), TRIANGLES)


def test_of_edges_of_three_faces_the_first_is_told_with_its_place():
    """Two fins on the cap: one of a face on vertices 60 and 61, one on 20 and 21."""
    fins = np.vstack([POINTS, [[0.0, 0.0, 5.0], [-2.0, 0.0, 5.0]]])
    faces = np.vstack([TRIANGLES, [[60, 61, len(POINTS)], [20, 21, len(POINTS) + 1]]])
    place = POINTS[20].round(4).tolist()
    with pytest.raises(InputError) as told:
        mended(fins, faces)
    assert f"2 edges belong to more than two faces, the first at {place} m" in str(told.value)


@pytest.mark.parametrize("branching", [True, False])
def test_of_several_objects_that_make_no_skin_together_it_is_told_how_one_is_chosen(branching):
    fin, away = np.array([POINTS[60], POINTS[61], [0.0, 0.0, 5.0]]), np.add(POINTS, [20.0, 0.0, 0.0])
    other = (fin, np.array([[0, 1, 2]])) if branching else (away, TRIANGLES)
    parts = [MeshObject("roof", "A", POINTS, (TRIANGLES,)), MeshObject("", "site", other[0], (other[1],))]
    with pytest.raises(InputError) as told:
        mend.mended(joined(parts, Choice(), "s"), "s")
    chosen = (
        "by surface.object or surface.layer (--object, --layer), among 'roof' on layer 'A', layer 'site'; or "
    )
    assert chosen in told.value.remedy
    alike = [replace(part, name="roof", layer="A") for part in parts]
    with pytest.raises(InputError) as told:
        mend.mended(joined(alike, Choice(), "s"), "s")
    assert "--object" not in told.value.remedy


def test_pieces_are_told_with_their_areas_sizes_and_middles_the_largest_first():
    """A triangle of 2 × 3 m, one of 4 × 5 m away from it, and one of 1 × 2 m on a wall."""
    points = np.array(
        [
            [1.0, 1.0, 0.0], [3.0, 1.0, 0.0], [1.0, 4.0, 0.0],
            [10.0, 10.0, 7.0], [14.0, 10.0, 7.0], [10.0, 15.0, 7.0],
            [0.0, 30.0, 0.0], [1.0, 30.0, 0.0], [0.0, 30.0, 2.0],
        ]
    )  # fmt: skip
    with pytest.raises(InputError, match=r"shell: has 3 separate pieces, of 10, 3, 1 m²") as told:
        mended(points, np.arange(9).reshape(3, 3))
    assert (
        "--piece 1 is 4 × 5 × 0 m about (12, 12.5, 7), --piece 2 is 2 × 3 × 0 m about (2, 2.5, 0), "
        "--piece 3 is 1 × 0 × 2 m about (0.5, 30, 1)"
    ) in told.value.remedy
    second = mend.mended(Draft(points, np.arange(9).reshape(3, 3)), "shell", piece=2)
    assert second.points.tolist() == points[:3].tolist()
    assert second.notes[-1] == "piece 2 of 3 was taken, 3 m²"
    for piece in (0, 4):
        with pytest.raises(InputError, match="has no such piece"):
            mended(points, np.arange(9).reshape(3, 3), piece=piece)


def test_where_pieces_lie_is_told_so_that_they_are_known_apart_far_from_the_origin_too():
    points = np.array([[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 5.0, 0.0]])
    beside = 10.0 * points + [8.0, 0.0, 0.0]
    far = np.vstack([points, beside]) + np.array([2683456.0, 1247890.0, 408.25])
    with pytest.raises(InputError, match="has 2 separate pieces, of 1\u202f000, 10 m²") as told:
        mended(far, np.arange(6).reshape(2, 3))
    assert (
        "--piece 1 is 40 × 50 × 0 m about (2683484, 1247915, 408.2), "
        "--piece 2 is 4 × 5 × 0 m about (2683458, 1247892.5, 408.25)"
    ) in told.value.remedy


def test_more_than_five_pieces_are_told_in_part():
    side = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    for count, more in ((5, False), (6, True)):
        points = np.vstack([(6.0 - k) * side + [10.0 * k, 0.0, 0.0] * np.ones(3) for k in range(count)])
        with pytest.raises(InputError, match=f"has {count} separate pieces") as told:
            mended(points, np.arange(3 * count).reshape(-1, 3))
        assert ("…" in str(told.value)) == more
        assert "--piece 5 is" in told.value.remedy
        assert "--piece 6 is" not in told.value.remedy


def test_vertices_at_which_the_edge_meets_itself_are_parted_by_a_millionth_into_the_smaller_fan():
    """Two triangles with a common edge, and two others in a row behind them, each on the last one's
    corner."""
    points = np.array(
        [[0.0, -1.0, 1.0], [4.0, 0.0, 1.0], [0.0, 1.0, 1.0], [0.0, 3.0, 1.0], [8.0, 2.0, 1.0], [8.0, 0.0, 1.0], [12.0, 2.0, 1.0], [12.0, 0.0, 1.0]]
    )  # fmt: skip
    faces = np.array([[0, 1, 2], [2, 1, 3], [1, 5, 4], [4, 7, 6]])
    found = mend._parted(Draft(points, faces, np.arange(24.0).reshape(8, 3)), 12.0)
    assert found.notes == ("2 vertices at which the edge met itself were parted, by 1 × 10⁻⁵ m",)
    assert len(found.points) == 10
    np.testing.assert_array_equal(found.points[:8], points)
    assert found.triangles.tolist() == [[0, 1, 2], [2, 1, 3], [8, 5, 9], [4, 7, 6]]
    for new, old, face in ((8, 1, [1, 5, 4]), (9, 4, [1, 5, 4])):
        inwards = points[face].mean(axis=0) - points[old]
        wanted = 1.2e-5 * inwards / np.linalg.norm(inwards)
        np.testing.assert_allclose(found.points[new] - points[old], wanted, atol=1e-12)
        np.testing.assert_array_equal(found.normals[new], np.arange(24.0).reshape(8, 3)[old])


def test_faces_are_turned_as_most_of_their_own_piece():
    """Two strips of three triangles: one face of the first is turned over, and two of the second."""
    strip = np.array([[0, 1, 2], [2, 1, 3], [2, 3, 4]])
    first, second = strip.copy(), strip + 10
    first[1] = first[1, ::-1]
    second[[0, 2]] = second[[0, 2], ::-1]
    found = mend.turned_alike(np.vstack([first, second]), "shell")
    np.testing.assert_array_equal(found[:3], strip)
    np.testing.assert_array_equal(found[3:], (strip + 10)[:, ::-1])
    first[:2] = strip[0, ::-1], strip[1]
    np.testing.assert_array_equal(mend.turned_alike(first, "shell"), strip)
