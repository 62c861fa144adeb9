"""Force densities against closed forms, and shells that bear a uniform weight by thrust
alone.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial import Delaunay

from shellform.errors import InputError, NotConverged
from shellform.surface import bounded, cad, funicular
from shellform.surface.funicular import (
    fitted_densities,
    force_density,
    nearest_thrust_shell,
    thrust_heights,
    thrust_shell,
)
from shellform.surface.readers.reading import read_surface

SURFACES = Path(__file__).parent.parent.parent / "surfaces"


def line(count, load):
    """Nodes on the x axis, 1 m apart, loaded along z and fixed at both ends."""
    nodes = np.zeros((count + 1, 3))
    nodes[:, 0] = np.arange(count + 1)
    edges = np.column_stack([np.arange(count), np.arange(1, count + 1)])
    loads = np.zeros((count + 1, 3))
    loads[:, 2] = load
    fixed = np.zeros(count + 1, dtype=bool)
    fixed[[0, -1]] = True
    return nodes, edges, loads, fixed


def disc(rings, radius=1.0):
    """A plan of a circle: points, triangles, and which lie on its edge."""
    points = [(0.0, 0.0)]
    for k in range(1, rings + 1):
        turn = np.arange(6 * k) * np.pi / (3 * k)
        points += list(radius * k / rings * np.column_stack([np.cos(turn), np.sin(turn)]))
    plan = np.array(points)
    return plan, Delaunay(plan).simplices, np.hypot(*plan.T) > radius * (1 - 1e-9)


def test_a_line_of_equal_branches_is_a_parabola():
    # z_i = p i (n - i) / (2 q), exact at the nodes.
    count, density, load = 10, 3.0, 2.0
    nodes, edges, loads, fixed = line(count, load)
    i = np.arange(count + 1)
    result = force_density(nodes, edges, np.full(count, density), loads, fixed)
    np.testing.assert_allclose(result[:, 2], load * i * (count - i) / (2 * density), atol=1e-13)
    np.testing.assert_allclose(result[:, 0], i, atol=1e-13)


def test_all_branches_in_compression_stand_up_to_loads_pointing_down():
    nodes, edges, loads, fixed = line(10, 2.0)
    hanging = force_density(nodes, edges, np.full(10, 3.0), loads, fixed)
    standing = force_density(nodes, edges, np.full(10, -3.0), -loads, fixed)
    np.testing.assert_allclose(standing, hanging, atol=1e-13)


def test_every_free_node_of_an_uneven_network_is_in_equilibrium():
    rng = np.random.default_rng(1)
    plan, triangles, fixed = disc(6)
    nodes = np.column_stack([plan, rng.normal(size=len(plan))])
    edges = np.unique(
        np.sort(np.vstack([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1), axis=0
    )
    densities, loads = rng.uniform(0.1, 10.0, len(edges)), rng.normal(size=nodes.shape)
    found = force_density(nodes, edges, densities, loads, fixed)
    pull = densities[:, None] * (found[edges[:, 1]] - found[edges[:, 0]])
    balance = loads.copy()
    np.add.at(balance, edges[:, 0], pull)
    np.add.at(balance, edges[:, 1], -pull)
    assert np.abs(balance[~fixed]).max() < 1e-12
    np.testing.assert_array_equal(found[fixed], nodes[fixed])


def test_fixed_nodes_alone_stay_where_they_are():
    nodes, edges, loads, _ = line(3, 1.0)
    np.testing.assert_array_equal(
        force_density(nodes, edges, np.ones(3), loads, np.ones(4, dtype=bool)), nodes
    )


def test_networks_that_have_no_shape_are_refused():
    nodes, edges, loads, fixed = line(10, 1.0)
    with pytest.raises(InputError, match="no node is fixed"):
        force_density(nodes, edges, np.ones(10), loads, np.zeros(11, dtype=bool))
    with pytest.raises(InputError, match="hang on nothing"):
        force_density(nodes, edges[:5], np.ones(5), loads, fixed)
    loose = np.ones(10)
    loose[[2, 5]] = 0.0
    with pytest.raises(InputError, match="hang on nothing"):
        force_density(nodes, edges, loose, loads, fixed)
    mixed = np.ones(10)
    mixed[4] = -0.3
    with pytest.raises(InputError, match="no definite shape"):
        force_density(nodes, edges, mixed, loads, fixed)
    with pytest.raises(InputError, match="densities"):
        force_density(nodes, edges, np.full(10, np.nan), loads, fixed)
    with pytest.raises(InputError, match="out of range"):
        force_density(nodes, edges + 1, np.ones(10), loads, fixed)


def test_a_weight_of_the_plan_over_a_circle_gives_a_paraboloid_of_second_order():
    errors = []
    for rings in (10, 20, 40):
        plan, triangles, fixed = disc(rings)
        heights = thrust_heights(plan, triangles, fixed, rise=0.3, load="plan")
        errors.append(np.abs(heights - 0.3 * (1 - (plan**2).sum(axis=1))).max())
    assert errors[-1] < 2e-5
    assert np.log2(errors[0] / errors[2]) / 2 > 1.6  # h² up to the logarithm of linear elements


def test_a_weight_of_the_surface_over_a_circle_follows_its_differential_equation():
    # (r z')' = -c r sqrt(1 + z'²), z(1) = 0: the rise fixes c. Equal thrust in all plan directions.
    rise = 0.6

    def profile(c, radii):
        def slope(r, y):
            return [y[1], -c * np.sqrt(1 + y[1] ** 2) - (y[1] / r if r > 0 else -0.5 * c)]

        return solve_ivp(slope, (0.0, 1.0), [0.0, 0.0], t_eval=radii, rtol=1e-10, atol=1e-12).y[0]

    low, high = 0.1, 10.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if -profile(middle, [1.0])[0] < rise else (low, middle)
    radii = np.linspace(0.0, 1.0, 31)
    plan, triangles, fixed = disc(30)
    heights = thrust_heights(plan, triangles, fixed, rise=rise)
    expected = np.interp(np.hypot(*plan.T), radii, rise + profile(low, radii))
    assert np.abs(heights - expected).max() < 5e-4 * rise


def test_heights_grow_with_the_plan_and_reach_the_rise():
    plan, triangles, fixed = disc(8)
    small = thrust_heights(plan, triangles, fixed, rise=0.2)
    large = thrust_heights(20 * plan, triangles, fixed, rise=4.0)
    np.testing.assert_allclose(large, 20 * small, rtol=1e-12, atol=1e-12)
    assert small.max() == pytest.approx(0.2, rel=1e-14)
    assert (small[fixed] == 0.0).all()
    assert (small[~fixed] > 0.0).all()


def test_plans_that_carry_no_shell_are_refused():
    plan, triangles, fixed = disc(3)
    for rise in (0.0, -1.0, float("nan")):
        with pytest.raises(InputError, match="rise"):
            thrust_heights(plan, triangles, fixed, rise=rise)
    with pytest.raises(InputError, match="load"):
        thrust_heights(plan, triangles, fixed, rise=0.1, load="snow")
    with pytest.raises(InputError, match="no vertex is fixed"):
        thrust_heights(plan, triangles, np.zeros_like(fixed), rise=0.1)
    with pytest.raises(InputError, match="every vertex is fixed"):
        thrust_heights(plan, triangles, np.ones_like(fixed), rise=0.1)
    with pytest.raises(InputError, match="hang on nothing"):
        thrust_heights(np.vstack([plan, [[9, 9]]]), triangles, np.append(fixed, False), rise=0.1)


def test_a_shell_that_still_changes_is_not_given_out(monkeypatch):
    monkeypatch.setattr(funicular, "_ROUNDS", 2)
    with pytest.raises(NotConverged, match="still changes") as stopped:
        thrust_heights(*disc(6), rise=1.0)
    assert stopped.value.iterations == 2
    assert stopped.value.state.shape[1] == 3


SQUARE = [(-4, -5), (4, -5), (5, -4), (5, 4), (4, 5), (-4, 5), (-5, 4), (-5, -4)]
CORNERS = [(1, 2), (3, 4), (5, 6), (7, 0)]


def test_a_shell_that_stands_all_round_is_the_one_of_its_plan():
    turn = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    shell = thrust_shell(np.column_stack([3 * np.cos(turn), 2 * np.sin(turn)]), rise=1.0, size=0.3)
    edge = np.zeros(len(shell.vertices), dtype=bool)
    edge[shell.boundary[0]] = True
    np.testing.assert_allclose(shell.vertices[edge, 2], 0.0, atol=1e-12)
    assert shell.size[2] == pytest.approx(1.0, rel=1e-12)
    inside = thrust_heights(shell.vertices[:, :2], shell.triangles, edge, rise=1.0)
    np.testing.assert_allclose(shell.vertices[:, 2], inside, atol=1e-9)


def test_free_edges_stand_up_as_arches_that_draw_in_by_their_sag():
    shell = thrust_shell(SQUARE, supports=CORNERS, rise=3.0, size=0.4, sag=0.1)
    edge = shell.vertices[shell.boundary[0]]
    front = edge[(edge[:, 1] < -3.0) & (np.abs(edge[:, 0]) < 3.9)]
    crown = front[np.argmin(np.abs(front[:, 0]))]
    assert 0.05 * 8 < crown[1] + 5.0 < 0.13 * 8
    assert 0.5 < crown[2] < 2.5
    assert front[:, 2].max() == pytest.approx(crown[2], abs=0.01)
    feet = edge[edge[:, 2] < 1e-9]
    assert len(feet) == 4 * (1 + round(2**0.5 / 0.4))
    assert shell.normals[:, 2].min() > 0.3


def test_an_opening_stays_open_on_its_ring():
    turn = np.linspace(0, 2 * np.pi, 16, endpoint=False)
    hole = np.column_stack([0.8 * np.cos(-turn), 0.8 * np.sin(-turn)])
    shell = thrust_shell(SQUARE, supports=CORNERS, rise=3.0, size=0.4, openings=[hole])
    assert shell.holes == 1
    rim = shell.vertices[shell.boundary[1]]
    assert rim[:, 2].min() > 2.5
    assert np.hypot(rim[:, 0], rim[:, 1]).mean() == pytest.approx(
        0.73, abs=0.01
    )  # in compression, so that it draws in


def test_a_load_of_the_plan_needs_no_rounds_and_gives_a_flatter_foot():
    by_surface, by_plan = (
        thrust_shell(SQUARE, rise=3.0, size=0.5, load=load) for load in ("surface", "plan")
    )
    assert by_plan.vertices[:, 2].mean() != pytest.approx(by_surface.vertices[:, 2].mean(), rel=1e-4)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"outline": SQUARE[::-1]}, "counterclockwise"),
        ({"outline": SQUARE[:2]}, "at least three corners"),
        ({"sag": 0.6}, "sag"),
        ({"size": 0.0}, "size"),
        ({"size": 1e-6}, r"more than 2,000,000 triangles on a surface of .* Give 0\.\d+ m or more"),
        ({"rise": -1.0}, "rise"),
        ({"supports": [(0, 9)]}, r"supports\(0, 1\) is out of range \(found 9\)"),
        ({"supports": [0, 1]}, "supports has the wrong shape"),
        ({"supports": [(0.0, 1.0)]}, "supports must be whole numbers"),
        ({"outline": [*SQUARE, SQUARE[0]]}, "outline: has a corner twice in a row"),
        ({"openings": [[(4, 4), (6, 4), (6, 6), (4, 4)]]}, r"openings\[0\]: has a corner twice in a row"),
        ({"openings": [[(4, 4), (6, 4)]]}, r"openings\[0\]: encloses nothing"),
        ({"outline": SQUARE[:3], "supports": None, "size": 12.0}, "size: leaves no point"),
        ({"supports": [(0, 0)]}, "fewer than two points"),
        ({"openings": [[(4, 4), (9, 4), (9, 9), (4, 9)]]}, "outline can't be meshed"),
        ({"supports": [(0, 0), (4, 4)], "sag": 0.49}, "plan folds"),
    ],
)
def test_plans_for_a_shell_that_make_no_sense_are_refused(change, words):
    with pytest.raises(InputError, match=words):
        thrust_shell(**{"outline": SQUARE, "supports": CORNERS, "rise": 3.0, "size": 0.5, **change})


def test_fitted_densities_bear_a_shape_that_some_densities_bear():
    rng = np.random.default_rng(3)
    plan, triangles, fixed = disc(6)
    edges = np.unique(
        np.sort(np.vstack([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1), axis=0
    )
    loads = np.column_stack([np.zeros((len(plan), 2)), -rng.uniform(0.5, 1.0, len(plan))])
    flat = np.column_stack([plan, np.zeros(len(plan))])
    shape = force_density(flat, edges, -rng.uniform(1.0, 3.0, len(edges)), loads, fixed)
    found = fitted_densities(shape, edges, loads, fixed)
    assert (found < 0.0).all()
    np.testing.assert_allclose(force_density(shape, edges, found, loads, fixed), shape, atol=1e-6)
    with pytest.raises(InputError, match="no compression"):
        fitted_densities(shape, edges, -loads, fixed)


def test_no_density_falls_below_the_least_where_the_shape_asks_for_tension():
    # A crown with a dent: in equilibrium with tension only.
    plan, triangles, fixed = disc(6)
    radius = np.hypot(*plan.T)
    shape = np.column_stack([plan, (1 - radius**2) * (0.4 + radius**2)])
    edges = np.unique(
        np.sort(np.vstack([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1), axis=0
    )
    loads = np.column_stack([np.zeros((len(plan), 2)), -np.ones(len(plan))])
    found = fitted_densities(shape, edges, loads, fixed, least=0.1)
    least = -found.max()
    assert least > 0.0
    assert (np.isclose(-found, least, rtol=1e-6)).sum() > 5


def test_densities_that_do_not_settle_are_not_given_out(monkeypatch):
    monkeypatch.setattr(bounded, "_ROUNDS", 2)
    plan, triangles, fixed = disc(4)
    shape = np.column_stack([plan, 1 - (plan**2).sum(axis=1)])
    loads = np.column_stack([np.zeros((len(plan), 2)), -np.ones(len(plan))])
    with pytest.raises(NotConverged, match="don't settle"):
        fitted_densities(shape, triangles[:, :2], loads, fixed)


def test_the_thrust_shell_nearest_to_one_is_itself_and_to_a_dome_is_near():
    dome = cad.build_surface(SURFACES / "dome.py", size=0.05)
    near = nearest_thrust_shell(dome)
    away = np.linalg.norm(near.vertices - dome.vertices, axis=1).max()
    assert away < 2e-3
    edge = dome.vertices[:, 2] < 1e-9
    same = thrust_heights(dome.vertices[:, :2], dome.triangles, edge, rise=0.2)
    assert away < 0.5 * np.abs(same - dome.vertices[:, 2]).max()
    again = nearest_thrust_shell(near)
    np.testing.assert_allclose(again.vertices, near.vertices, atol=1e-3 * away)
    with pytest.raises(InputError, match="stands on the ground"):
        nearest_thrust_shell(dome, ground=-5.0)
    with pytest.raises(InputError, match=r"ground: must be below 0\.2.*metres below its top"):
        nearest_thrust_shell(dome, ground=50.0)
    flat = replace(dome, vertices=dome.vertices * [1.0, 1.0, 0.0])
    with pytest.raises(InputError, match=r"ground: must be below 0.*Give a surface that rises\."):
        nearest_thrust_shell(flat)


@pytest.mark.parametrize("ending", ["step", "igs", "brep"])
def test_a_thrust_shell_written_as_cad_comes_back_within_a_thousandth(tmp_path, ending):
    shell = thrust_shell(SQUARE, supports=CORNERS, rise=3.0, size=0.5)
    off = cad.write_fitted(tmp_path / f"shell.{ending}", shell)
    assert 0.0 < off < 1e-3 * 10
    back = read_surface(tmp_path / f"shell.{ending}")
    np.testing.assert_allclose(back.size, shell.size, atol=4e-3)
    assert back.area == pytest.approx(shell.area, rel=1e-4)


@pytest.mark.parametrize(("at_first", "tried"), [(11.0, [250]), (9.0, [250, 1000])])
def test_a_fit_that_a_quick_one_shows_to_be_hopeless_is_not_tried(tmp_path, monkeypatch, at_first, tried):
    """In times what it may be off."""
    shell = thrust_shell(SQUARE, supports=CORNERS, rise=3.0, size=0.5)
    most, asked = 1e-3 * shell.size.max(), []

    def fit(_surface, count):
        asked.append(count)
        return (at_first if count == 250 else 2.0) * most

    monkeypatch.setattr(cad, "_fit", fit)
    with pytest.raises(NotConverged, match="m off"):
        cad.write_fitted(tmp_path / "shell.step", shell)
    assert asked == tried


def test_what_one_b_spline_can_not_be_is_not_written(tmp_path):
    shell = thrust_shell(SQUARE, rise=3.0, size=0.5)
    with pytest.raises(NotConverged, match="m off"):
        cad.write_fitted(tmp_path / "shell.step", shell, within=1e-9)
    for within in (0.0, 5.0, np.nan):
        with pytest.raises(InputError, match=r"within: must be .*a share of the surface's size"):
            cad.write_fitted(tmp_path / "shell.step", shell, within=within)
    with pytest.raises(InputError, match="isn't a CAD file"):
        cad.write_fitted(tmp_path / "shell.obj", shell)
    hole = thrust_shell(SQUARE, rise=3.0, size=0.5, openings=[[(-1, -1), (1, -1), (1, 1), (-1, 1)]])
    with pytest.raises(InputError, match="has openings"):
        cad.write_fitted(tmp_path / "shell.step", hole)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("least", [0.0, -0.1, 5.0, np.nan, np.inf])
def test_densities_that_may_come_to_nothing_are_refused(least):
    """With nothing as the least a shell's branches might hang slack."""
    nodes, edges, loads, fixed = line(3, -1.0)
    nodes[1:3, 2] = 0.5, 0.6
    assert (fitted_densities(nodes, edges, loads, fixed, least=1e-6) < 0.0).all()
    with pytest.raises(
        InputError, match=r"least: .*\(found .*\)\. Give a share of their mean, such as 0\.05"
    ):
        fitted_densities(nodes, edges, loads, fixed, least=least)
    with pytest.raises(InputError, match=r"For 5 % write 0\.05\."):
        fitted_densities(nodes, edges, loads, fixed, least=5)
