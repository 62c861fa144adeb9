"""What a net covers of its surface, where it leaves it bare, and what is refused."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from shellform.errors import InputError
from shellform.net import chebyshev, cover, trim
from shellform.net.chebyshev import NetSettings, pull_net
from shellform.net.grid import lattice_grid
from shellform.net.ladder import climbed_net
from shellform.net.notes import NoteKind
from shellform.net.refusal import Change, NoNet, Reason
from shellform.net.saved import load_net, save_net
from shellform.structure.elements.state import at_rest
from shellform.surface.shape.target import make_surface


@pytest.fixture(scope="module")
def plane():
    """6 × 4 m in a hundred and fifty squares."""
    x, y = np.meshgrid(np.linspace(0.0, 6.0, 16), np.linspace(0.0, 4.0, 11), indexing="ij")
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    at = np.arange(x.size).reshape(x.shape)
    a, b, c, d = (each.ravel() for each in (at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]))
    return make_surface(points, np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])]))


def laid(columns, rows, spacing=0.5):
    """A flat grid of rods that lie at the multiples of the spacing that are named."""
    places = np.array([(i, j) for i in columns for j in rows])
    grid = lattice_grid(places, spacing=(spacing, spacing), gap=0.01, elements=2)
    corner = grid.flat[grid.crossing_nodes].mean(axis=1).min(axis=0)
    first = spacing * np.array([min(columns), min(rows), 0.0])
    return grid, at_rest(grid.flat - corner + first)


def test_what_is_bare_is_sampled_a_quarter_of_the_spacing_apart(monkeypatch):
    """Of a triangle of 2 m² in 144 parts those whose middle lies beyond 0.75 m along x: 28 that stand and 28
    that hang; with half the spacing in 529 those beyond half as far."""
    corners = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0]])
    surface = SimpleNamespace(vertices=corners, triangles=np.array([[0, 1, 2]]))
    monkeypatch.setattr(
        cover, "Tree", lambda _pieces: SimpleNamespace(nearest=lambda points: (None, None, points[:, 0]))
    )
    for scale, bare in ((1.0, 2.0 * 56 / 144), (0.5, 2.0 * 361 / 529)):
        made = SimpleNamespace(rod_ends=np.array([[0, 1]]), scale=scale)
        found = cover.cover(surface, made, at_rest(corners))
        assert found.bare == pytest.approx(bare)
        assert len(found.patches) == 1
        assert found.area == pytest.approx(2.0)
        assert found.share == pytest.approx(0.5 * bare)


def test_a_net_over_all_of_the_surface_leaves_nothing_bare(plane):
    found = cover.cover(plane, *laid(range(13), range(9)))
    assert found == cover.Cover(pytest.approx(24.0), ())
    assert found.share == 0.0


def test_each_patch_has_its_area_its_place_and_how_far_it_lies_from_rods(plane):
    """Rods over x from 2 to 5 m, with tails of half a segment: 1.375 m are bare on one side, 0.375 m on the
    other."""
    grid, state = laid(range(4, 11), range(9))
    low, high = (float(each) for each in (state.positions[:, 0].min(), state.positions[:, 0].max()))
    found = cover.cover(plane, grid, state)
    wide, narrow = found.patches
    assert wide.area == pytest.approx(4.0 * (low - 0.375), rel=0.1)
    assert narrow.area == pytest.approx(4.0 * (6.0 - high - 0.375), rel=0.3)
    assert wide.place[0] == pytest.approx(0.0, abs=0.125)
    assert narrow.place[0] == pytest.approx(6.0, abs=0.125)
    assert wide.away == pytest.approx(low - wide.place[0], rel=0.02)
    assert found.bare == pytest.approx(wide.area + narrow.area)
    told = cover.patches_told(found.patches)
    assert told.startswith(f"{wide.area:.2g} m² at (")
    assert told.endswith(f"up to {narrow.away:.2g} m from any rod")
    assert cover.patches_told(6 * (wide,)).endswith("; and 2 more")


def test_what_is_not_built_is_not_bare(plane):
    grid, state = laid(range(4, 13), range(9))
    found = cover.cover(plane, grid, state, lambda points: points[:, 0] > 2.0)
    assert found.patches == ()
    assert found.area == pytest.approx(16.0, rel=0.05)


def test_more_that_is_bare_than_may_be_is_refused_with_where_and_how_much(plane):
    found = cover.cover(plane, *laid(range(4, 13), range(9)))
    cover.refuse_bare(found, found.share, 0.5)
    with pytest.raises(
        NoNet, match=r"^net.spacing.*% of the surface lie farther than 0.75 spacings"
    ) as refused:
        cover.refuse_bare(found, 0.02, 0.5)
    assert refused.value.reason is Reason.BARE
    assert "where 2 % may" in refused.value.what
    assert cover.patches_told(found.patches) in refused.value.what


def pointed(length=8.0, half=1.8):
    """A low vault over a triangle, with a point into which rods hardly reach."""
    u, v = np.meshgrid(np.linspace(0.0, 1.0, 49), np.linspace(-1.0, 1.0, 33), indexing="ij")
    x, y = (length * u).ravel()[32:], (half * u * v).ravel()[32:]  # the point once
    at = np.maximum(np.arange(u.size).reshape(u.shape) - 32, 0)
    a, b, c, d = (each.ravel() for each in (at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]))
    triangles = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    whole = (triangles != np.roll(triangles, 1, axis=1)).all(axis=1)
    return make_surface(np.column_stack([x, y, 0.02 * x * (length - x)]), triangles[whole])


def joints(net):
    return [len(rod.crossings) for rod in net.grid.rods]


def test_rods_of_a_single_joint_stay_where_else_more_would_be_bare(monkeypatch):
    """At 20° two rods with one joint reach into the point; without them 0.9 cells more are bare."""
    surface = pointed()
    place = {"spacing": 0.5, "gap": 0.02, "angle": math.radians(20.0), "elements": 2, "uncovered_max": 1.0}
    net = pull_net(surface, **place)
    assert joints(net).count(1) == 2
    assert "2 rods of a single joint stay" in net.notes[-1].text
    assert net.notes[-1].kind is NoteKind.RODS
    monkeypatch.setattr(chebyshev, "NOTABLE", math.inf)
    before = pull_net(surface, **place)
    assert min(joints(before)) == 2
    assert len(before.grid.rods) < len(net.grid.rods)
    assert before.cover.bare - net.cover.bare > 0.5 * 0.5**2
    assert before.quality.uncovered_area == before.cover.bare


@pytest.mark.parametrize(
    ("arcs", "fewest", "poor"),
    [
        ([0.5], 2, True),
        ([0.5], 1, False),
        ([0.37], 1, True),  # 0.37 and 0.63 m at 0.5 m: 0.93 of 1.0 spacings²
        ([0.2, 0.6], 1, False),
        ([0.2, 0.6], 2, False),
        ([], 1, False),
    ],
)
def test_a_rod_stays_with_one_joint_where_its_supports_errors_bend_it_little(monkeypatch, arcs, fewest, poor):
    """Three times what they are off by over the product of its two parts: of 0.54 m with parts of 0.36 and
    0.18 m supports 5 mm off made 8 times its strength."""
    monkeypatch.setattr(trim, "_SINGLE", 1.0)
    piece = SimpleNamespace(start=0.0, end=1.0)
    assert trim._poor(piece, arcs, 0.5, fewest) is poor


def test_where_nothing_is_bare_rods_of_a_single_joint_are_left_out():
    net = pull_net(pointed(8.0, 3.5), spacing=0.5, gap=0.02, elements=2)
    assert net.cover.patches == ()
    assert "3 rods with fewer than 2 joints were left out" in [note.text for note in net.notes]
    assert min(joints(net)) == 2


def test_a_net_that_leaves_too_much_bare_is_refused_and_given_where_that_is_allowed():
    place = {"spacing": 0.5, "gap": 0.02, "angle": math.radians(45.0), "elements": 2}
    with pytest.raises(NoNet, match=r"2\.26 % of the surface.*net\.uncovered_max") as refused:
        pull_net(pointed(), **place)
    assert refused.value.factorisations > 0
    net = pull_net(pointed(), **place, uncovered_max=0.03)
    assert net.cover.share == pytest.approx(0.0226, abs=1e-4)
    with pytest.raises(InputError, match=r"net\.uncovered_max.*a share of the surface, such as 0\.02"):
        pull_net(pointed(), **place, uncovered_max=1.5)


def test_the_ladder_finds_a_net_that_leaves_less_bare():
    settings = NetSettings(spacing=0.5, gap=0.02, elements=2)
    net, given = climbed_net(pointed(), settings, angle=math.radians(45.0))
    assert net.attempts[0].reason is Reason.BARE
    assert given.change is Change.TURNED
    assert net.cover.share <= 0.02


def test_what_a_net_leaves_bare_is_saved_with_it(tmp_path):
    net = pull_net(pointed(), spacing=0.5, gap=0.02, angle=math.radians(20.0), elements=2)
    assert net.cover.patches
    save_net(tmp_path / "net.npz", net)
    assert load_net(tmp_path / "net.npz").cover == net.cover
