"""Nets with other settings: two spacings, guides, the compass alone, the flat start, cuts at ground, curve
and opening.
"""

import numpy as np
import pytest

import shellform as sf
from shellform.errors import InputError
from shellform.net.grid import neighbours
from shellform.surface.shape.locate import Locator
from shellform.surface.shape.target import make_surface


def bowl(hole=None, count=41):
    """z = 0.3 cos x cos y over 2 × 2 m, with an opening round the point `hole`."""
    line = np.linspace(-1.0, 1.0, count)
    x, y = (each.ravel() for each in np.meshgrid(line, line, indexing="ij"))
    i = np.arange(count * count).reshape(count, count)
    a, b, c, d = i[:-1, :-1].ravel(), i[1:, :-1].ravel(), i[1:, 1:].ravel(), i[:-1, 1:].ravel()
    faces = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    if hole is not None:
        away = np.hypot(x[faces].mean(axis=1) - hole[0], y[faces].mean(axis=1) - hole[1])
        faces = faces[away > 0.3]
    used = np.unique(faces)
    number = np.zeros(len(x), dtype=int)
    number[used] = np.arange(len(used))
    return make_surface(np.column_stack([x, y, 0.3 * np.cos(x) * np.cos(y)])[used], number[faces])


@pytest.fixture(scope="module")
def surface():
    return bowl()


def lengths(net, direction):
    """Chords between neighbouring crossings of the rods of one direction."""
    pairs, _ = neighbours(net.grid)
    moved = np.diff(net.grid.lattice[pairs], axis=1)[:, 0]
    chosen = pairs[moved[:, 0 if direction == "u" else 1] != 0]
    return np.linalg.norm(net.crossings[chosen[:, 1]] - net.crossings[chosen[:, 0]], axis=1)


def test_the_two_directions_keep_a_spacing_of_their_own(surface):
    net = sf.pull_net(surface, spacing=0.15, spacing_v=0.25, gap=0.005, angle=0.3)
    np.testing.assert_allclose(lengths(net, "u"), 0.15, rtol=5e-3)
    np.testing.assert_allclose(lengths(net, "v"), 0.25, rtol=5e-3)
    assert net.grid.spacing_v == 0.25
    assert net.quality.distance_max < 0.002


def test_the_compass_method_alone_keeps_crossings_on_the_surface_and_chords_exact(surface):
    net = sf.pull_net(surface, spacing=0.2, gap=0.005, method="compass")
    assert net.quality.spacing_error_max < 1e-8
    assert net.quality.distance_max < 1e-9
    assert net.quality.pull_max == 0.0


def test_from_the_flat_grid_the_pull_finds_the_same_net_as_from_the_compass_net(surface):
    first, second = (
        sf.pull_net(surface, spacing=0.2, gap=0.005, start=start) for start in ("compass", "flat")
    )
    np.testing.assert_allclose(first.crossings, second.crossings, atol=1e-7)


def test_the_trimmed_flat_grid_bent_onto_the_surface_again_reproduces_the_net(surface):
    from shellform.net.pull import FROM_FLAT, flat_start, pull

    net = sf.pull_net(surface, spacing=0.2, gap=0.005)
    grid = net.grid
    k = int(np.argmin(np.abs(grid.lattice).sum(axis=1)))
    origin = net.crossings[k]
    finder = Locator(surface, reach=0.5)
    normal = finder.foot(origin[None]).normal[0]
    ahead = net.crossings[grid.lattice.tolist().index([1, 0])] - origin
    along = ahead - (ahead @ normal) * normal
    along /= np.linalg.norm(along)
    frame = np.column_stack([along, np.cross(normal, along), normal])
    shift = grid.flat[grid.crossing_nodes[k]].mean(axis=0)
    start = flat_start(grid, origin - frame @ shift, frame)
    again = pull(grid, finder, start, origin, frame, spring_density=FROM_FLAT)
    off = again.state.positions - net.target.positions
    # The pieces past the edge, which are cut off now, no longer hold their neighbours.
    assert np.linalg.norm(off, axis=1).max() < 0.02 * grid.spacing


def test_guides_lead_the_rods_through_the_origin(surface):
    across = np.linspace(-1.3, 1.3, 80)
    guide = np.column_stack([across, 0.1 + 0.15 * across**2])
    net = sf.pull_net(
        surface, spacing=0.2, gap=0.005, method="compass", guides=(guide, [[0.1, -1.3], [0.0, 1.3]])
    )
    at = net.crossings[net.grid.lattice[:, 1] == 0]
    np.testing.assert_allclose(at[:, 1], 0.1 + 0.15 * at[:, 0] ** 2, atol=2e-4)
    pulled = sf.pull_net(surface, spacing=0.2, gap=0.005, guides=(guide, [[0.1, -1.3], [0.0, 1.3]]))
    at = pulled.crossings[pulled.grid.lattice[:, 1] == 0]
    assert np.abs(at[:, 1] - 0.1 - 0.15 * at[:, 0] ** 2).max() < 0.1  # straightened, but not turned


def test_rods_end_at_the_surface_edge_at_the_ground_and_at_a_curve(surface):
    square = np.array([[-0.6, -0.7], [0.8, -0.5], [0.7, 0.6], [-0.5, 0.8]])
    edge, ground, curve = (
        sf.pull_net(surface, spacing=0.15, gap=0.005, **kind)
        for kind in ({}, {"ground": 0.2}, {"outline": square})
    )
    ends = edge.target.positions[edge.supports]
    foot = Locator(surface, reach=0.3).foot(ends)
    assert np.abs(Locator(surface, reach=0.3).past_edge(foot)).max() < 1e-5
    np.testing.assert_allclose(ground.target.positions[ground.supports, 2], 0.2, atol=1e-9)
    for x, y, _ in curve.target.positions[curve.supports]:
        sides = np.roll(square, -1, axis=0) - square
        off = np.abs(
            np.cross(
                np.column_stack([sides, np.zeros(4)]),
                [*(np.array([x, y])), 0] - np.column_stack([square, np.zeros(4)]),
            )
        )
        assert (off[:, 2] / np.linalg.norm(sides, axis=1)).min() < 1e-8
    for net in (edge, ground, curve):
        assert net.quality.uncovered_area < 0.01, "what isn't built isn't bare"
    assert max(ground.cover.area, curve.cover.area) < 0.7 * edge.cover.area


def test_rods_cut_by_an_opening_keep_their_lengths_and_marks():
    net = sf.pull_net(bowl(hole=(0.2, 0.1)), spacing=0.12, gap=0.004, angle=0.2)
    grid = net.grid
    by_index = {}
    for rod in grid.rods:
        by_index.setdefault((rod.direction, rod.index), []).append(rod)
        flat = grid.flat[rod.nodes]
        np.testing.assert_allclose(np.linalg.norm(flat - flat[0], axis=1), rod.arc, atol=1e-12)
        np.testing.assert_allclose(np.diff(rod.marks) / 0.12, np.round(np.diff(rod.marks) / 0.12), atol=1e-9)
        assert rod.marks[0] >= 0.2 * 0.12
        assert rod.length - rod.marks[-1] >= 0.2 * 0.12
        bent = net.target.positions[rod.nodes]
        assert np.linalg.norm(np.diff(bent, axis=0), axis=1).sum() == pytest.approx(rod.length, rel=3e-3)
        layer = 0 if rod.direction == "u" else 1
        np.testing.assert_array_equal(grid.crossing_nodes[rod.crossings, layer], rod.nodes[rod.at])
    twice = [rods for rods in by_index.values() if len(rods) == 2]
    assert len(twice) >= 4
    for first, second in twice:
        assert not set(first.crossings) & set(second.crossings)
    ends = net.target.positions[net.supports, :2]
    assert (np.abs(np.hypot(*(ends - [0.2, 0.1]).T) - 0.3) < 0.1).sum() >= 8


def ball(opening):
    """The unit sphere but for a cap of `opening` degrees about its lowest point."""
    turn = np.linspace(0.0, np.pi - np.deg2rad(opening), 40)[1:]
    round_ = 2 * np.pi * np.arange(80) / 80
    rings = np.array(
        [[np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)] for t in turn for p in round_]
    )
    faces = [[0, 1 + j, 1 + (j + 1) % 80] for j in range(80)]
    for i in range(38):
        for j in range(80):
            a, b = 1 + 80 * i + j, 1 + 80 * i + (j + 1) % 80
            faces += [[a, a + 80, b], [b, a + 80, b + 80]]
    points = np.vstack([[0.0, 0.0, 1.0], rings])
    return make_surface(points, faces, normals=points)


def test_a_hemisphere_takes_a_net_and_a_nearly_closed_ball_is_refused_with_the_place_and_the_amount():
    net = sf.pull_net(ball(90), spacing=0.2, gap=0.005, angle=0.1)
    assert net.quality.uncovered_area < 0.05
    assert 4.0 < net.quality.gaussian_curvature < 2 * np.pi
    with pytest.raises(InputError, match=r"curved too much for one net.*at \[.*adds up to \d"):
        sf.pull_net(ball(30), spacing=0.2, gap=0.005, angle=0.1)


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"spacing_v": -1.0}, "net.spacing_v"),
        ({"spring_density": [5.0, 0.5]}, "rising"),
        ({"spring_density": []}, "rising"),
        ({"offset": (30.0, 0.0)}, "off the surface"),
        ({"guides": ([[0, 0], [1, 0]], [[2, 2], [3, 3]])}, "don't cross"),
        ({"outline": [[5.0, 5.0], [6.0, 5.0], [6.0, 6.0]]}, "no grid fits"),
    ],
)
def test_settings_that_cannot_work_are_refused(surface, settings, said):
    with pytest.raises(InputError, match=said):
        sf.pull_net(surface, spacing=0.2, gap=0.005, **settings)
