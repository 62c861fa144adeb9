"""The parts of a fill that are told beforehand: which stretches are open, how far out they go, and their
slopes."""

import numpy as np
import pytest

from shellform.errors import InputError
from shellform.surface.readers import fills


@pytest.mark.parametrize("turned", range(8))
def test_arches_go_from_foot_to_foot_and_know_the_ground_beyond_them(turned):
    """Of a ring of vertices 10 to 17 the 10th, 11th and 14th stand on the ground, of which the first two are
    a line."""
    low = np.isin(np.arange(18), [3, 10, 11, 14])
    found = fills._arches(np.roll(np.arange(10, 18), turned), low, "shell")
    told = {tuple(arch.vertices.tolist()): (arch.before, arch.after) for arch in found}
    assert told == {(11, 12, 13, 14): (10, 14), (14, 15, 16, 17, 10): (14, 11)}


def test_an_edge_with_one_foot_alone_can_not_be_brought_down():
    low = np.arange(8) == 3
    with pytest.raises(InputError, match="touches the ground at fewer than two places"):
        fills._arches(np.arange(8), low, "shell")
    low[6] = True
    assert len(fills._arches(np.arange(8), low, "shell")) == 2


@pytest.mark.parametrize(
    ("way", "slope"),
    [((3.0, 1.0), 1.0 / 3.0), ((2.0, 1.9), 0.95), ((1.0, 3.0), 1.0), ((-1.0, 0.5), 1.0), ((3.0, 0.0), 0.0), ((3.0, -1.0), 0.0)],
)  # fmt: skip
def test_a_footprint_leaves_its_foot_in_line_with_the_ground_up_to_45_degrees_outwards(way, slope):
    along, outwards = np.array([0.6, 0.8]), np.array([0.8, -0.6])
    turned = way[0] * along + way[1] * outwards
    assert fills._leaving(turned, along, outwards) == pytest.approx(slope)
    assert fills._leaving(7.0 * turned, along, outwards) == pytest.approx(slope)


def arch(height):
    """An arch of 4 m along x from (1, 2), its vertices' heights over a ground at 5 m, and how far out they go
    at 45°."""
    x = np.array([0.0, 1.0, 2.0, 3.0, 4.0])
    z = height * np.array([0.0, 0.75, 1.0, 0.5, 0.0])
    return np.column_stack([1.0 + x, np.full(5, 2.0), 5.0 + z]), z


def out_to(height, beyond):
    place, away = arch(height)
    return fills._in_line(away, place, np.array(beyond), np.array([0.0, -1.0]), 5.0)


SHARE = np.array([0.0, 0.25, 0.5, 0.75, 1.0])
SOFT = 0.4 * SHARE * (1.0 - SHARE)


def softly(given, curve):
    return 0.5 * (given + curve + np.hypot(given - curve, SOFT))


def test_a_footprint_beside_feet_in_line_with_the_chord_goes_as_far_out_as_its_height():
    _, away = arch(1.2)
    found = out_to(1.2, [[0.0, 2.0], [6.0, 2.0]])
    np.testing.assert_allclose(found, softly(away, 0.0))
    assert found[0] == found[-1] == 0.0


def test_a_footprint_goes_on_in_line_with_the_ground_beyond_each_of_its_feet():
    """At 45° beyond the first, and at 1 : 2 beyond the last."""
    _, away = arch(1.2)
    bump = 4.0 * SHARE * (1.0 - SHARE)
    first, last = bump * (1.0 - SHARE), bump * SHARE * 0.5
    np.testing.assert_allclose(out_to(1.2, [[0.0, 3.0], [6.0, 2.0]]), softly(away, first), atol=1e-12)
    np.testing.assert_allclose(out_to(1.2, [[0.0, 2.0], [7.0, 3.0]]), softly(away, last), atol=1e-12)
    np.testing.assert_allclose(out_to(1.2, [[0.0, 3.0], [7.0, 3.0]]), softly(away, first + last), atol=1e-12)


def test_a_footprint_further_out_descends_at_seven_to_ten_at_the_crown_at_the_least():
    _, away = arch(0.2)
    bump = 4.0 * SHARE * (1.0 - SHARE) * (1.0 - SHARE)  # half a metre in the middle
    np.testing.assert_allclose(
        out_to(0.2, [[0.0, 3.0], [6.0, 2.0]]), softly(away, bump * (0.2 / 0.7) / 0.5), atol=1e-12
    )


def test_an_arch_that_is_no_graph_over_its_chord_keeps_its_distances():
    place, away = arch(1.2)
    place[2, 0] = place[3, 0]
    found = fills._in_line(away, place, np.array([[0.0, 3.0], [7.0, 3.0]]), np.array([0.0, -1.0]), 5.0)
    np.testing.assert_array_equal(found, away)


def test_slopes_and_normals_are_each_other_s_and_normals_flatter_than_nine_degrees_are_refused():
    slopes = np.array([[0.75, 0.0], [0.0, -2.4], [2.0, 1.0]])
    normals = fills._upright(slopes)
    np.testing.assert_allclose(normals[:2], [[-0.6, 0.0, 0.8], [0.0, 12.0 / 13.0, 5.0 / 13.0]])
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0)
    place = np.array([[1.0, 2.0, 3.0], [4.0, 5.5, 6.1234], [7.0, 8.0, 9.0]])
    np.testing.assert_allclose(fills._gradients(normals, place, "shell"), slopes)
    for upright, fits in ((0.151, True), (0.149, False)):
        normals[1] = [np.sqrt(1.0 - upright**2), 0.0, upright]
        if fits:
            assert fills._gradients(normals, place, "shell")[1, 0] == pytest.approx(-6.547, abs=1e-3)
            continue
        with pytest.raises(InputError, match=r"too steep to be continued at \[4\.0, 5\.5, 6\.123\] m"):
            fills._gradients(normals, place, "shell")


def test_a_line_is_divided_evenly_along_its_length():
    line = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 4.0]])
    np.testing.assert_allclose(
        fills._evenly(line, 1.7), [[0.0, 0.0], [1.75, 0.0], [3.0, 0.5], [3.0, 2.25], [3.0, 4.0]]
    )
    np.testing.assert_allclose(fills._evenly(line, 100.0), [[0.0, 0.0], [3.0, 0.5], [3.0, 4.0]])
