"""The Chebyshev net of the paper-scale vault, and the compass method's closed forms."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

import shellform as sf
from shellform.errors import InputError
from shellform.net import trim
from shellform.net.compass import _corner
from shellform.net.grid import neighbours
from shellform.net.saved import load_net, net_document, save_net


class Sphere:
    """The exact unit sphere as a finder."""

    def foot(self, points):
        normal = points / np.linalg.norm(points, axis=1, keepdims=True)
        return type("Foot", (), {"point": normal, "normal": normal})()

    def past_outline(self, foot):
        return np.full(len(foot.point), -1.0)


def test_the_compass_net_of_a_sphere_agrees_with_the_published_nodes():
    chord, count = 0.1, 5
    turn = 2 * np.arcsin(chord / 2)
    net = {(0, 0): np.array([0.0, 0.0, 1.0])}
    for k in range(1, count + 1):
        net[k, 0] = np.array([np.sin(k * turn), 0.0, np.cos(k * turn)])
        net[0, k] = np.array([0.0, np.sin(k * turn), np.cos(k * turn)])
    for i in range(1, count + 1):
        for j in range(1, count + 1):
            a, b, c = (net[place][None] for place in ((i - 1, j), (i, j - 1), (i - 1, j - 1)))
            point, _, good = _corner(Sphere(), a, b, c, (chord, chord))
            assert good[0]
            net[i, j] = point[0]
    np.testing.assert_allclose(net[1, 1], [0.09987367, 0.09987367, 0.98997500], atol=1e-7)
    np.testing.assert_allclose(net[5, 5], [0.47459259, 0.47459259, 0.74129870], atol=1e-7)


def test_the_net_lies_within_a_millimetre_with_segments_within_a_percent(net):
    assert net.quality.distance_max < 0.001
    assert net.quality.spacing_error_max < 0.01
    pairs, _ = neighbours(net.grid)
    chord = np.linalg.norm(net.crossings[pairs[:, 1]] - net.crossings[pairs[:, 0]], axis=1)
    assert np.abs(chord / 0.055 - 1).max() == pytest.approx(net.quality.spacing_error_max)


def test_rods_keep_their_length_when_bent(net):
    place = net.target.positions
    for rod in net.grid.rods:
        bent = np.linalg.norm(np.diff(place[rod.nodes], axis=0), axis=1).sum()
        assert bent == pytest.approx(rod.length, rel=3e-3)  # chords of a curve, and the springs' own strain
        assert (np.diff(rod.marks) > 0).all()


class Lattice:
    """Rods with their joints one step apart, along x and across: as many on a side of each part."""

    def __init__(self, *sides):
        self.pieces, self.spacing, self.scale = [], 1.0, 1.0
        first = 0
        for side in sides:
            numbers = first + np.arange(side * side).reshape(side, side)
            first += side * side
            for direction, lines in (("u", numbers), ("v", numbers.T)):
                for line in lines:
                    joints = [(int(c), k + 1.0) for k, c in enumerate(line)]
                    rod = SimpleNamespace(direction=direction)
                    self.pieces.append(
                        SimpleNamespace(rod=rod, start=0.0, end=side + 1.0, joints=lambda own=joints: own)
                    )

    def step(self, direction):
        return self.spacing


def test_rods_of_a_part_that_nothing_joins_to_the_largest_are_told_apart_from_those_with_few_joints():
    lattice = Lattice(5, 3)
    kept, notes = trim._keep(lattice, lattice.pieces, 0.2, 2)
    assert len(kept) == 10
    assert [each.text for each in notes] == [
        "6 rods of parts of the grid that no rod joins to the largest were left out"
    ]
    whole = Lattice(5)
    assert trim._keep(whole, whole.pieces, 0.2, 2)[1] == []


def test_equation_1_gives_the_largest_radius(net):
    radius = net.max_radius(young=40e9, strength=255e6)
    assert radius == pytest.approx(255e6 / (40e9 * net.quality.curvature_max))


def test_a_net_is_the_same_after_saving(tmp_path, net):
    save_net(tmp_path / "net.npz", net)
    again = load_net(tmp_path / "net.npz")
    np.testing.assert_array_equal(again.target.positions, net.target.positions)
    assert json.dumps(net_document(again)) == json.dumps(net_document(net))
    (tmp_path / "bad.npz").write_bytes(b"junk")
    with pytest.raises(InputError, match="damaged"):
        load_net(tmp_path / "bad.npz")


def test_nobody_can_change_a_rod_of_a_net(net):
    with pytest.raises(ValueError, match="read-only"):
        net.grid.lattice += 1
    for name in ("nodes", "arc", "crossings", "at"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(net.grid.rods[0], name)[0] = 7


def test_a_surface_with_a_spike_is_refused(vault):
    peak = vault.vertices.copy()
    away = np.linalg.norm(peak[:, :2], axis=1)
    peak[:, 2] += 0.3 * np.exp(-((away / 0.05) ** 2))
    with pytest.raises(InputError, match="curved too much"):
        sf.pull_net(sf.make_surface(peak, vault.triangles), spacing=0.055, gap=0.002)


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"spacing": 0.5, "gap": 0.002}, "too large"),
        ({"spacing": 55.0, "gap": 0.002}, "too large.* For 55 mm write 0.055"),
        ({"spacing": 5.5e-5, "gap": 1e-6}, "too small.* For 55 mm write 0.055"),
        ({"spacing": 0.055, "gap": 2.0}, "joint.gap.* For 2 mm write 0.002"),
        ({"spacing": 1e-5, "gap": 1e-6}, "too small"),
        ({"spacing": -1.0, "gap": 0.002}, "positive"),
        ({"spacing": 0.055, "gap": 0.05}, "below the spacing"),
        ({"spacing": 0.055, "gap": 0.002, "elements": 0}, "at least 1"),
        ({"spacing": 0.055, "gap": 0.002, "merge": 0.9}, "below 0.5.*share of the spacing"),
        ({"spacing": 0.055, "gap": 0.002, "angle": float("nan")}, "must be numbers"),
        ({"spacing": 0.055, "gap": 0.002, "angle": 45.0}, "if degrees are meant, give 0.7854 rad"),
        (
            {"spacing": 0.055, "gap": 0.002, "shear_stiffness": -0.1},
            "net.shear_stiffness: must be between 1e-6 and 1e6",
        ),
        ({"spacing": 0.055, "gap": 0.002, "ground": float("nan")}, "net.ground: must be finite"),
        ({"spacing": 0.055, "gap": 0.002, "offset": (float("inf"), 0.0)}, "must be numbers"),
    ],
)
def test_settings_that_cannot_work_are_refused(vault, settings, said):
    with pytest.raises(InputError, match=said):
        sf.pull_net(vault, **settings)


@pytest.mark.parametrize(
    "wrong", [{"limit": 0}, {"tail": -1}, {"reach": 0.0}, {"tolerance": 1.0}, {"tolerance": float("nan")}]
)
def test_tuning_that_cannot_work_is_refused_by_name(wrong):
    (name,) = wrong
    with pytest.raises(InputError, match=rf"tuning\.{name}"):
        sf.NetTuning(**wrong)


def test_where_the_centroid_lies_in_the_bend_of_an_l_the_net_begins_on_the_surface():
    size, width, count = 1.2, 0.3, 49
    x, y = (each.ravel() for each in np.meshgrid(*2 * [np.linspace(0.0, size, count)], indexing="ij"))
    i = np.arange(count * count).reshape(count, count)
    quads = np.column_stack([each.ravel() for each in (i[:-1, :-1], i[1:, :-1], i[1:, 1:], i[:-1, 1:])])
    quads = quads[np.minimum(x[quads], y[quads]).mean(axis=1) < width]
    used, quads = np.unique(quads, return_inverse=True)
    quads = quads.reshape(-1, 4)
    place = np.column_stack([x, y, 0.2 * (x * (size - x) + y * (size - y))])[used]
    surface = sf.make_surface(place, np.vstack([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]))
    net = sf.pull_net(surface, spacing=0.06, gap=0.002, elements=2)
    ends = net.crossings[:, :2]
    assert (ends.min(axis=1) < width + 0.01).all()
    assert ends.max() > size - 0.06
