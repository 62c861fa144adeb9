"""Loads: true areas, weights, pours and combinations, on a flat net, a sphere's cap and the vault."""

import dataclasses

import numpy as np
import pytest

import shellform as sf
from shellform.errors import InputError
from shellform.gridshell import areas, loads
from shellform.gridshell.loads import Region
from shellform.net.grid import lattice_grid
from shellform.net.net import Net
from shellform.net.quality import MAPS, Quality
from shellform.structure.elements.sections import Round, isotropic
from shellform.structure.elements.state import State
from shellform.surface.shape.target import make_surface

Q = 1226.25  # N/m², 5 cm of concrete


def square(cells):
    """The unit square as triangles, `cells` along each side, their diagonals turned alternately."""
    place = np.linspace(0.0, 1.0, cells + 1)
    x, y = np.meshgrid(place, place, indexing="ij")
    corner = np.arange((cells + 1) ** 2).reshape(cells + 1, -1)
    a, b, c, d = (
        part.ravel() for part in (corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:])
    )
    return make_surface(
        np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)]),
        np.vstack([np.column_stack(t) for t in [(a, b, c), (a, c, d)]]),
    )


def flat_net(count, spacing=0.1, gap=0.002):
    """Crossings count × count at (i + 1/2) spacings; the rods' ends are the outermost crossings."""
    lattice = np.array([(i, j) for i in range(count) for j in range(count)])
    grid = lattice_grid(lattice, spacing=(spacing, spacing), gap=gap, elements=2)
    place = grid.flat + np.array([0.5 * spacing, 0.5 * spacing, 0.0])
    turns = np.tile([1.0, 0.0, 0.0, 0.0], (len(place), 1))
    maps = {name: np.zeros((len(grid.rod_ends), 2, 2) if name == "curvature" else 1) for name in MAPS}
    numbers = {field.name: 0.0 for field in dataclasses.fields(Quality) if field.name not in MAPS}
    return Net(grid, State(place, turns), np.zeros(0, dtype=int), Quality(**numbers, **maps))


@pytest.fixture(scope="module")
def flat():
    return flat_net(10), square(7)


def cap(angle=0.6, around=90, up=30):
    """A cap of the unit sphere with half the opening `angle`, its crown at z = 1; facets on a polar grid."""
    ring = angle * np.arange(1, up + 1) / up
    turn = 2.0 * np.pi * np.arange(around) / around
    t, p = np.meshgrid(ring, turn, indexing="ij")
    points = np.vstack(
        [
            [0.0, 0.0, 1.0],
            np.column_stack(
                [(np.sin(t) * np.cos(p)).ravel(), (np.sin(t) * np.sin(p)).ravel(), np.cos(t).ravel()]
            ),
        ]
    )
    number = 1 + np.arange(up * around).reshape(up, around)
    after = np.roll(number, -1, axis=1)
    faces = [np.column_stack([np.zeros(around, dtype=int), number[0], after[0]])]
    for low in range(up - 1):
        faces.append(np.column_stack([number[low], number[low + 1], after[low + 1]]))
        faces.append(np.column_stack([number[low], after[low + 1], after[low]]))
    return make_surface(points, np.vstack(faces))


@pytest.mark.parametrize("cells", [1, 7, 40])
def test_each_crossing_of_a_flat_square_net_carries_a_square_whatever_the_mesh(cells):
    net = flat_net(10)
    carried = areas.tributary(net, areas.facets(square(cells)))
    upper = net.grid.crossing_nodes[:, 1]
    np.testing.assert_allclose(carried[upper], 0.01, rtol=1e-9)
    assert carried.sum() == pytest.approx(1.0, rel=1e-12)


def test_a_uniform_load_on_a_flat_square_net_adds_up_to_load_times_area(flat):
    load = loads.concrete(*flat, thickness=0.05)
    assert load[:, 2].sum() == pytest.approx(-Q, rel=1e-12)
    assert not load[:, [0, 1, 3, 4, 5]].any()
    assert not load[flat[0].grid.crossing_nodes[:, 0]].any()


def test_the_areas_on_a_sphere_s_cap_add_up_and_rings_follow_archimedes():
    surface = cap()
    triangles = areas.facets(surface)
    # The area of a sphere's zone is 2 pi times its height (Archimedes); facets lie inside by O(h²).
    for low, high in [(np.cos(0.6), 0.9), (0.9, 0.95), (0.95, 1.0)]:
        zone = areas.areas(areas.between(triangles, [0.0, 0.0, 1.0], low, high)).sum()
        assert zone == pytest.approx(2.0 * np.pi * (high - low), rel=2e-3)
    rings = [loads.lying(areas.facets(surface), Region(ring=ring)) for ring in [(0.0, 0.9), (0.9, 2.0)]]
    assert sum(areas.areas(ring).sum() for ring in rings) == pytest.approx(surface.area, rel=1e-12)


def test_the_vault_s_tributary_areas_add_up_to_its_surface(net, vault):
    carried = areas.tributary(net, areas.facets(vault))
    assert carried.sum() == pytest.approx(vault.area, rel=1e-12)
    assert (carried >= 0.0).all()
    assert (carried[net.grid.crossing_nodes[:, 1]] > 0.0).all()
    upper_or_support = np.concatenate([net.grid.crossing_nodes[:, 1], net.supports])
    assert carried[np.setdiff1d(np.arange(len(carried)), upper_or_support)].sum() == 0.0


def test_no_area_lies_nearer_to_another_node(net, vault):
    # The oracle: random points of the surface, each counted for its nearest node.
    rng = np.random.default_rng(0)
    triangles = areas.facets(vault)
    share = areas.areas(triangles)
    which = rng.choice(len(triangles), size=20_000, p=share / share.sum())
    weight = rng.dirichlet([1.0, 1.0, 1.0], size=len(which))
    points = np.einsum("kc,kcx->kx", weight, triangles[which])
    nodes = np.concatenate([net.grid.crossing_nodes[:, 1], net.supports])
    place = np.vstack([net.crossings, net.target.positions[net.supports]])
    nearest = np.linalg.norm(points[:, None, :2] - place[None, :, :2], axis=2)  # in plan first: few remain
    candidates = np.argsort(nearest, axis=1)[:, :12]
    space = np.linalg.norm(points[:, None] - place[candidates], axis=2)
    counted = np.bincount(
        candidates[np.arange(len(points)), space.argmin(axis=1)], minlength=len(place)
    ) / len(points)
    exact = areas.tributary(net, triangles)[nodes] / vault.area
    assert np.abs(counted - exact).max() < 5.0 * np.sqrt(exact.max() / len(points))


def test_inner_crossings_carry_the_area_of_a_cell(net, vault):
    # A cell of the net is a rhombus of area s² sin(angle): why the paper loads every second node by 6.9 N,
    # not 7.4 N (section 4.1).
    carried = areas.tributary(net, areas.facets(vault))[net.grid.crossing_nodes[:, 1]]
    number = {tuple(place): k for k, place in enumerate(net.grid.lattice.tolist())}
    around = [(a, b) for a in (-1, 0, 1) for b in (-1, 0, 1)]
    inner = [k for (i, j), k in number.items() if all((i + a, j + b) in number for a, b in around)]
    points = net.crossings
    cells = []
    for k in inner:
        i, j = net.grid.lattice[k]
        u = points[number[i + 1, j]] - points[number[i - 1, j]]
        v = points[number[i, j + 1]] - points[number[i, j - 1]]
        cells.append(0.25 * np.linalg.norm(np.cross(u, v)))
    assert carried[inner].sum() == pytest.approx(np.sum(cells), rel=0.02)


def test_table_1_of_the_paper():
    # Lengths × 20, weights × 400, thickness 2.5 mm of 50,000 kg/m³ and 5 cm of 2,500 kg/m³: 1.2e3 N/m²; 3.7 N
    # and 1.5e3 N a node.
    small, large = loads.pressure(0.0025, 50_000.0), loads.pressure(0.05, 2500.0)
    assert small == pytest.approx(large, rel=1e-12)
    assert round(small, -2) == 1200.0
    assert round(small * 0.055**2, 1) == 3.7
    assert round(large * 1.1**2, -2) == 1500.0
    model, building = flat_net(6, 0.055), flat_net(6, 1.1, 0.04)
    both = []
    for made, size, thickness, density in [(model, 0.33, 0.0025, 50_000.0), (building, 6.6, 0.05, 2500.0)]:
        skeleton = square(5)
        surface = make_surface(size * skeleton.vertices, skeleton.triangles)
        both.append(loads.concrete(made, surface, thickness=thickness, density=density))
    np.testing.assert_allclose(both[1], 400.0 * both[0], rtol=1e-9)
    upper = model.grid.crossing_nodes[:, 1]
    np.testing.assert_allclose(both[0][upper, 2], -3.709, atol=5e-4)


@pytest.mark.parametrize("angle", [0.0, 0.7, 2.0])
def test_two_half_pours_sum_to_the_whole(net, vault, angle):
    halves = [
        loads.concrete(net, vault, thickness=0.0025, region=Region(half=angle + k * np.pi)) for k in (0, 1)
    ]
    whole = loads.concrete(net, vault, thickness=0.0025)
    np.testing.assert_allclose(halves[0] + halves[1], whole, atol=1e-9 * np.abs(whole).max())
    assert halves[0][:, 2].sum() == pytest.approx(0.5 * whole[:, 2].sum(), rel=0.01)  # openings aside: 0.8 %


def test_strips_rings_and_openings_with_their_complements_sum_to_the_whole(net, vault):
    whole = loads.concrete(net, vault, thickness=0.0025)
    square_ = [[-0.1, -0.1], [0.1, -0.1], [0.1, 0.1], [-0.1, 0.1]]
    hollow = [[-0.3, -0.2], [0.3, -0.2], [0.3, 0.2], [0.0, 0.0], [-0.3, 0.2]]
    families = [
        [Region(strip=(0.3, low, high)) for low, high in [(-9.0, -0.1), (-0.1, 0.15), (0.15, 9.0)]],
        [Region(ring=limits) for limits in [(-1.0, 0.1), (0.1, 0.15), (0.15, 1.0)]],
        [Region(openings=[square_]), Region(inside=[square_])],
        [Region(openings=[hollow]), Region(inside=[hollow[::-1]])],
    ]
    for family in families:
        total = sum(loads.concrete(net, vault, thickness=0.0025, region=region) for region in family)
        np.testing.assert_allclose(total, whole, atol=1e-9 * np.abs(whole).max())


def test_openings_take_away_their_plan_area_of_a_flat_surface(flat):
    hollow = [[0.1, 0.1], [0.9, 0.1], [0.9, 0.9], [0.5, 0.3], [0.1, 0.9]]  # a concave one, 0.64 - 0.24
    other = [[0.2, 0.0], [0.3, 0.0], [0.3, 0.2], [0.2, 0.2]]  # half in the first
    for polygons, taken in [([hollow], 0.40), ([hollow, other], 0.41), ([hollow[::-1], hollow], 0.40)]:
        left = loads.area_load(*flat, 1.0, Region(openings=polygons))
        assert -left[:, 2].sum() == pytest.approx(1.0 - taken, rel=1e-12)
        inside = loads.area_load(*flat, 1.0, Region(inside=polygons))
        assert -inside[:, 2].sum() == pytest.approx(taken, rel=1e-12)


def test_rods_joints_membrane_and_reinforcement_weigh_what_they_weigh(flat):
    net, surface = flat
    glass = isotropic(young=40e9, density=2000.0)
    # 20 rods of 0.9 m and 1 mm radius; 100 joints of 5 g; 0.4 kg/m² and 3 kg/m² on 1 m².
    assert -loads.rods(net, Round(0.001, glass))[:, 2].sum() == pytest.approx(
        9.81 * 18.0 * 2000.0 * np.pi * 1e-6
    )
    per_joint = loads.joints(net, 0.005)
    assert -per_joint[:, 2].sum() == pytest.approx(9.81 * 0.5)
    np.testing.assert_allclose(per_joint[net.grid.crossing_nodes, 2], -0.5 * 0.005 * 9.81)
    assert -loads.sheet(net, surface, 0.4)[:, 2].sum() == pytest.approx(9.81 * 0.4)
    assert -loads.sheet(net, surface, 3.0, Region(half=0.0))[:, 2].sum() == pytest.approx(9.81 * 1.5)


def test_a_trimmed_rod_weighs_along_its_true_length(net):
    glass = isotropic(young=40e9, density=2000.0)
    length = sum(rod.length for rod in net.grid.rods)
    weight = loads.rods(net, Round(0.001, glass))
    assert -weight[:, 2].sum() == pytest.approx(9.81 * length * 2000.0 * np.pi * 1e-6, rel=1e-12)
    assert (weight[:, 2] < 0.0).all()


def test_point_loads_go_on_the_crossings_that_are_chosen(flat):
    net, _ = flat
    assert (loads.points(net, 2.0)[:, 2] != 0.0).sum() == 100
    assert (loads.points(net, 2.0, every=2)[:, 2] != 0.0).sum() == 50
    middle = [[0.3, 0.3], [0.7, 0.3], [0.7, 0.7], [0.3, 0.7]]
    chosen = loads.points(net, 2.0, inside=[middle])
    assert chosen[:, 2].sum() == pytest.approx(-32.0)
    rest = loads.points(net, 2.0, openings=[middle])
    np.testing.assert_array_equal(chosen + rest, loads.points(net, 2.0))


def test_points_lie_in_a_polygon_whose_sides_slant_and_that_is_hollow():
    """Against the winding of its sides round each point."""
    polygon = np.array([[0.0, 0.0], [5.0, -1.0], [7.0, 4.0], [3.5, 1.5], [1.0, 6.0], [-2.0, 3.0]])
    x, y = np.meshgrid(np.linspace(-3.05, 8.1, 23), np.linspace(-2.03, 7.07, 19))
    points = np.column_stack([x.ravel(), y.ravel()])
    around = polygon - points[:, None]
    angles = np.arctan2(around[..., 1], around[..., 0])
    steps = np.diff(np.column_stack([angles, angles[:, 0]]), axis=1)
    winding = np.rint(((steps + np.pi) % (2.0 * np.pi) - np.pi).sum(axis=1) / (2.0 * np.pi))
    np.testing.assert_array_equal(loads.inside(points, polygon), winding == 1.0)
    np.testing.assert_array_equal(loads.inside(points, polygon[::-1]), winding == 1.0)
    assert 50 < winding.sum() < 200


def test_points_inside_one_of_two_polygons_are_loaded_once_and_none_of_an_opening(flat):
    net, _ = flat
    left, right = ([[a, 0.0], [b, 0.0], [b, 1.0], [a, 1.0]] for a, b in ((0.0, 0.4), (0.3, 0.6)))
    low = [[0.0, 0.0], [1.0, 0.0], [1.0, 0.3], [0.0, 0.3]]
    assert loads.points(net, 2.0, inside=[left, right])[:, 2].sum() == pytest.approx(-2.0 * 60)
    assert loads.points(net, 2.0, inside=[left, right], openings=[low])[:, 2].sum() == pytest.approx(
        -2.0 * 42
    )
    assert loads.points(net, -2.0, openings=[low, left])[:, 2].sum() == pytest.approx(2.0 * 42)


def test_cases_are_sums_of_factors_times_parts(flat):
    parts = {"concrete": loads.concrete(*flat, thickness=0.05), "joints": loads.joints(flat[0], 0.1)}
    case = loads.combined(parts, {"concrete": 1.2, "joints": 1.0})
    np.testing.assert_array_equal(case, 1.2 * parts["concrete"] + parts["joints"])


def test_stages_pour_one_part_after_the_other(flat):
    layers = {f"layer {k}": loads.concrete(*flat, thickness=0.01 * k) for k in (1, 2)}
    parts = {"joints": loads.joints(flat[0], 0.1), **layers}
    cases = loads.staged(parts, ["layer 1", "layer 2"], name="pour", factors={"joints": 1.0, "layer 2": 1.5})
    assert list(cases) == ["pour 1", "pour 2"]
    np.testing.assert_array_equal(cases["pour 1"], parts["joints"] + layers["layer 1"])
    np.testing.assert_allclose(cases["pour 2"], parts["joints"] + layers["layer 1"] + 1.5 * layers["layer 2"])


def test_loads_that_cannot_be_are_refused_with_their_entry(flat):
    net, surface = flat
    for call, said in [
        (lambda: loads.concrete(net, surface, thickness=0.0), "load.thickness.*positive"),
        (lambda: loads.concrete(net, surface, thickness=0.1, density=-1.0), "load.density.*positive"),
        (lambda: loads.sheet(net, surface, float("nan")), "load.mass.*finite"),
        (lambda: loads.area_load(net, surface, 0.0), "load.weight"),
        (lambda: loads.joints(net, -1.0), "load.mass"),
        (lambda: loads.rods(net, Round(0.001, isotropic(young=1e9))), "rod.density.*kg/m³"),
        (lambda: Region(ring=(0.2, 0.1)), "load.ring.*below the second"),
        (lambda: Region(strip=(0.0, 0.2, 0.2)), "load.strip.*below the second"),
        (
            lambda: loads.area_load(net, surface, 1.0, Region(strip=(0.0, 5.0, 6.0))),
            r"no part of the surface.*\(1, 1, 0\) m",
        ),
        (
            lambda: loads.area_load(net, surface, 1.0, Region(openings=[[[0, 0], [1, 1]]])),
            "load.openings.*three corners",
        ),
        (
            lambda: loads.area_load(net, surface, 1.0, Region(inside=[[[0, 0], [4, 4], [4, 0], [0, 3]]])),
            "load.inside.*crosses itself",
        ),
        (lambda: loads.points(net, float("nan")), "load.force.*between -1e8 and 1e8"),
        (lambda: loads.points(net, 1.0, every=0), "load.every"),
        (lambda: loads.points(net, 1.0, inside=[[[5, 5], [6, 5], [6, 6]]]), "no crossing is loaded"),
        (lambda: loads.points(net, 1.0, inside=[[[5, 5], [6, 5]]]), r"load.inside\[0\].*three corners"),
        (lambda: loads.combined({"a": np.zeros((1, 6))}, {"b": 1.0}), "no such part.*'b'.*Known: a"),
        (lambda: loads.combined({"a": np.zeros((1, 6))}, {}), "names no part"),
        (lambda: loads.combined({"a": np.zeros((1, 6))}, {"a": np.inf}), "load.factors.a.*finite"),
    ]:
        with pytest.raises(InputError, match=said):
            call()


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Region(half=np.nan), r"load\.half: must be finite"),
        (lambda: Region(half=90.0), r"load\.half: 90 rad is more than a whole turn.*give 1\.571 rad"),
        (lambda: Region(strip=(-45.0, 0.0, 0.1)), r"load\.strip\[0\]: -45 rad.*give -0\.7854 rad"),
        (lambda: Region(half="west"), r"load\.half: must be a number"),
        (lambda: Region(strip=(0.0, 0.1)), r"load\.strip: must be 3 numbers"),
        (lambda: Region(strip=(0.0, np.nan, 0.1)), r"load\.strip: must be 3 numbers"),
        (lambda: Region(strip=(np.inf, 0.0, 0.1)), r"load\.strip\[0\]: must be finite"),
        (lambda: Region(ring=(0.1, "top")), r"load\.ring: must be 2 numbers"),
        (lambda: Region(ring=(0.1,)), r"load\.ring: must be 2 numbers"),
        (lambda: Region(ring=(0.1, np.nan)), r"load\.ring: must be 2 numbers"),
    ],
)
def test_a_region_whose_limits_are_no_numbers_is_refused(make, said):
    with pytest.raises(InputError, match=said):
        make()


def test_a_strip_or_ring_may_have_no_limit_on_one_side(flat):
    net, surface = flat
    whole = loads.area_load(net, surface, Q)
    parts = [Region(strip=(0.3, -np.inf, 0.4)), Region(strip=(0.3, 0.4, np.inf))]
    np.testing.assert_allclose(
        sum(loads.area_load(net, surface, Q, part) for part in parts), whole, atol=1e-9
    )


def test_parts_of_different_nets_are_not_added_up(flat):
    weight = loads.area_load(*flat, Q)
    with pytest.raises(InputError, match=r"load\.factors: adds up parts of different nets .*'b': \(3, 6\)"):
        loads.combined({"a": weight, "b": weight[:3]}, {"a": 1.0, "b": 1.0})


@pytest.mark.parametrize("steps", [[], ["west", "east", "west"]])
def test_a_pour_of_nothing_or_of_one_part_twice_is_refused(flat, steps):
    parts = dict.fromkeys(("west", "east"), loads.area_load(*flat, Q))
    with pytest.raises(InputError, match=r"load\.stages: each part is added once"):
        loads.staged(parts, steps, name="pour", factors={})


def test_a_gridshell_s_point_load_is_the_same(shell):
    np.testing.assert_array_equal(shell.point_load(6.9, every=2), loads.points(shell.net, 6.9, every=2))
    assert sf.Region is Region
