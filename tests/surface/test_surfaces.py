"""Target surfaces: smooth closest points, builders, imports, and what is refused."""

from pathlib import Path

import gmsh
import numpy as np
import pytest
from scipy.spatial import Delaunay

from shellform.errors import InputError
from shellform.surface import cad
from shellform.surface.funicular import force_density
from shellform.surface.readers.reading import read_surface
from shellform.surface.shape.locate import Locator
from shellform.surface.shape.target import curvature, make_surface, width

ROOT = Path(__file__).parent.parent.parent


def cap(step, reach=0.7):
    """A cap of the unit sphere."""
    points = [(0.0, 0.0)]
    rings = round(reach / step)
    for k in range(1, rings + 1):
        turn = 2 * np.pi * np.arange(6 * k) / (6 * k) + 0.3 * k
        points += list(reach * k / rings * np.column_stack([np.cos(turn), np.sin(turn)]))
    plan = np.array(points)
    return make_surface(np.column_stack([plan, np.sqrt(1 - (plan**2).sum(axis=1))]), Delaunay(plan).simplices)


def around_sphere(count=2000):
    rng = np.random.default_rng(1)
    turn, radius = rng.uniform(0, 2 * np.pi, count), 0.55 * np.sqrt(rng.uniform(size=count))
    unit = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), np.sqrt(1 - radius**2)])
    return unit, rng.uniform(-0.1, 0.1, count)


def test_feet_on_a_sphere_converge_at_least_with_the_third_power_of_the_mesh():
    unit, height = around_sphere()
    errors = []
    for step in (0.1, 0.05):
        foot = Locator(cap(step)).foot(unit * (1 + height)[:, None])
        errors.append(np.abs(foot.distance - height).max())
        assert not foot.past.any()
    assert errors[1] < 1e-5
    assert np.log2(errors[0] / errors[1]) > 3.0


def test_the_closest_facet_point_agrees_with_a_plain_search():
    surface = cap(0.1)
    corner = surface.vertices[surface.triangles]
    points = np.random.default_rng(2).normal(size=(50, 3))
    weights = np.array([(i, j, 20 - i - j) for i in range(21) for j in range(21 - i)]) / 20.0
    samples = np.einsum("wk,tkx->twx", weights, corner).reshape(-1, 3)
    _, _, distance = Locator(surface).facet(points)
    sampled = np.array([np.linalg.norm(samples - p, axis=1).min() for p in points])
    assert (distance <= sampled + 1e-12).all()
    assert (sampled - distance < 5e-4).all()


def test_the_foot_moves_continuously_across_triangles_and_past_the_edge():
    x = np.linspace(-0.9, 0.9, 40001)
    foot = Locator(cap(0.1), reach=0.4).foot(
        np.column_stack([x, np.full_like(x, 0.123), np.full_like(x, 0.85)])
    )
    assert foot.past.any()
    speed = np.linalg.norm(np.diff(foot.point, axis=0), axis=1) / np.diff(x)
    assert speed.max() < 1.5


def test_curvature_of_a_sphere_is_one_over_its_radius():
    inner = curvature(cap(0.05))[:200]
    np.testing.assert_allclose(inner, 1.0, atol=0.02)


@pytest.mark.parametrize("name", ["vault", "dome", "saddle", "shell_18x11"])
def test_shipped_surfaces_build_the_same_twice_with_their_edge_in_one_loop(name):
    script = ROOT / f"surfaces/{name}.py"
    size = max(cad.dimensions_of(script).values()) / 30
    first, second = cad.build_surface(script, size=size), cad.build_surface(script, size=size)
    np.testing.assert_array_equal(first.vertices, second.vertices)
    assert first.holes == 0
    assert first.normals[:, 2].min() > 0.0


def test_the_saddle_has_both_signs_of_gaussian_curvature():
    surface = cad.build_surface(ROOT / "surfaces/saddle.py", size=0.02)
    gauss = curvature(surface).prod(axis=1)
    inner = np.abs(surface.vertices[:, :2]).max(axis=1) < 0.25
    assert (gauss[inner] < -0.5).any()
    away = (np.abs(surface.vertices[:, 0]) > 0.33) & (np.abs(surface.vertices[:, 1]) < 0.1)
    assert (gauss[away] > 0.5).any()


@pytest.mark.parametrize("ending", ["step", "iges", "brep"])
def test_cad_files_in_millimetres_come_out_in_metres(tmp_path, ending):
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.model.occ.addRectangle(0, 0, 0, 500, 300)
    gmsh.model.occ.synchronize()
    gmsh.option.setString("Geometry.OCCTargetUnit", "MM")
    file = tmp_path / f"plate.{ending}"
    gmsh.write(str(file))
    gmsh.finalize()
    surface = cad.import_surface(file, unit="mm" if ending == "brep" else None)
    np.testing.assert_allclose(surface.size[:2], [0.5, 0.3], rtol=1e-6)


def test_what_is_no_surface_is_refused_with_a_reason(tmp_path):
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
    gmsh.model.occ.synchronize()
    gmsh.write(str(tmp_path / "box.step"))
    gmsh.finalize()
    with pytest.raises(InputError, match="solid"):
        cad.import_surface(tmp_path / "box.step")
    for name, content in [("empty.step", ""), ("junk.step", "not a step file"), ("junk.brep", "junk")]:
        (tmp_path / name).write_text(content)
        with pytest.raises(InputError):
            cad.import_surface(tmp_path / name)
    for name, content in [
        ("empty.obj", ""),
        ("junk.stl", "junk"),
        ("lines.obj", "v 0 0 0\nv 1 0 0\nl 1 2\n"),
        ("nan.obj", "v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
        ("unknown.xyz", ""),
    ]:
        (tmp_path / name).write_text(content)
        with pytest.raises(InputError):
            read_surface(tmp_path / name)
    with pytest.raises(InputError, match="no such file"):
        read_surface(tmp_path / "missing.obj")


def test_meshes_that_no_shell_can_be_are_refused():
    flat = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0.5, 0.5, 1]], dtype=float)
    with pytest.raises(InputError, match="more than two triangles"):
        make_surface(flat, [[0, 1, 2], [1, 0, 3], [0, 1, 4]])
    with pytest.raises(InputError, match="separate pieces"):
        make_surface(np.vstack([flat[:3], flat[:3] + 5]), [[0, 1, 2], [3, 4, 5]])
    with pytest.raises(InputError, match="closed"):
        make_surface(flat[[0, 1, 2, 4]], [[0, 1, 2], [0, 1, 3], [1, 2, 3], [0, 2, 3]])
    with pytest.raises(InputError, match="no triangle"):
        make_surface(flat, [[0, 0, 1]])


def test_duplicate_vertices_and_flipped_faces_are_mended_and_said():
    points = np.array(
        [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [9, 9, 9]], dtype=float
    )
    surface = make_surface(points, [[0, 1, 2], [3, 5, 4]])
    assert len(surface.vertices) == 4
    assert len(surface.mended) == 2
    assert surface.normals[:, 2].min() > 0.99


def test_the_shipped_hypar_is_read_and_keeps_its_vertices():
    surface = read_surface(ROOT / "surfaces/hypar.obj")
    np.testing.assert_allclose(surface.size, [5.0, 5.0, 3.0], atol=0.01)


def test_a_line_of_equal_branches_hangs_as_force_densities_say():
    count, density, load = 10, 3.0, 2.0
    nodes = np.column_stack([np.linspace(0, 1, count + 1), np.zeros((count + 1, 2))])
    edges = np.column_stack([np.arange(count), np.arange(1, count + 1)])
    fixed = np.zeros(count + 1, dtype=bool)
    fixed[[0, -1]] = True
    loads = np.zeros((count + 1, 3))
    loads[1:-1, 2] = load
    z = force_density(nodes, edges, np.full(count, density), loads, fixed)[:, 2]
    i = np.arange(count + 1)
    np.testing.assert_allclose(z, load * i * (count - i) / (2 * density), atol=1e-12)


def test_unknown_dimensions_get_the_nearest_name():
    with pytest.raises(InputError, match="Did you mean 'height'"):
        cad.build_surface(ROOT / "surfaces/vault.py", size=0.05, hight=0.2)


@pytest.mark.parametrize("angle", [0.0, 30.0, 77.7])
def test_the_width_of_a_surface_is_the_least_in_plan_however_it_is_turned(angle):
    x, y = (each.ravel() for each in np.meshgrid([-10.0, 0.0, 10.0], [-3.0, 3.0], indexing="ij"))
    cos, sin = np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))
    place = np.column_stack([cos * x - sin * y, sin * x + cos * y, 4.0 - 0.04 * x**2])
    triangles = [[0, 2, 3], [0, 3, 1], [2, 4, 5], [2, 5, 3]]
    assert width(make_surface(place, triangles)) == pytest.approx(6.0, rel=0.03)
    assert width(make_surface(place, triangles)) >= 6.0 - 1e-9
