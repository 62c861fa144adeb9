"""The surfaces under surfaces/ are the shells that their docstrings promise, smooth, and bent no more than
rods can follow.
"""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

from shellform.surface import cad
from shellform.surface.readers.reading import read_surface
from shellform.surface.shape.target import curvature

SURFACES = Path(__file__).parent.parent.parent / "surfaces"
SCRIPTS = sorted(SURFACES.glob("*.py"))
# Of 1 mm rods: the paper's largest curvature is 4.9 1/m; the full-size shell's is 20 times flatter.
SIZES = {
    "vault": ([0.90, 0.55, 0.21], 0.01, 5.0),
    "dome": ([0.90, 0.70, 0.20], 0.01, 5.0),
    "saddle": ([0.90, 0.60, 0.18], 0.01, 5.0),
    "shell_18x11": ([18.0, 11.0, 4.2], 0.2, 0.25),
}


@pytest.fixture(scope="module", params=sorted(SIZES))
def shipped(request):
    extents, size, bend = SIZES[request.param]
    return cad.build_surface(SURFACES / f"{request.param}.py", size=size), np.array(extents), size, bend


def away_from_edge(surface, distance):
    edge = surface.vertices[np.concatenate(surface.boundary)]
    return cKDTree(edge).query(surface.vertices)[0] > distance


def test_every_script_is_listed_here():
    assert {path.stem for path in SCRIPTS} == set(SIZES)


def test_shells_have_the_size_they_promise_and_one_edge(shipped):
    surface, extents, _, _ = shipped
    np.testing.assert_allclose(surface.size, extents, rtol=0.01)
    assert surface.holes == 0
    assert surface.mended == ()
    assert 5000 < len(surface.triangles) < 20000


def test_shells_bend_no_more_than_their_rods_can_follow(shipped):
    surface, _, size, bend = shipped
    inner = away_from_edge(surface, 1.5 * size)
    assert np.abs(curvature(surface)[inner]).max() < bend


def test_shells_have_no_dents(shipped):
    # Curvature that changes from vertex to vertex by a tenth of the largest would show as a dent.
    surface, _, size, bend = shipped
    bent = curvature(surface)
    inner = away_from_edge(surface, 2.5 * size)
    edges = np.vstack([surface.triangles[:, [i, (i + 1) % 3]] for i in range(3)])
    edges = edges[inner[edges].all(axis=1)]
    assert np.abs(bent[edges[:, 0]] - bent[edges[:, 1]]).max() < 0.1 * bend


@pytest.mark.parametrize(("name", "size"), [("vault", 0.01), ("shell_18x11", 0.2)])
def test_form_found_shells_stand_on_the_ground_all_round_at_a_slope_for_rods(name, size):
    surface = cad.build_surface(SURFACES / f"{name}.py", size=size)
    edge = surface.boundary[0]
    assert np.abs(surface.vertices[edge, 2]).max() == 0.0
    slope = np.degrees(np.arccos(surface.normals[edge, 2]))
    assert slope.min() > 45.0
    assert slope.max() < 65.0


def test_the_vaults_plan_is_lopsided():
    vertices = cad.build_surface(SURFACES / "vault.py", size=0.01).vertices
    middle = 0.5 * (vertices[:, :2].min(axis=0) + vertices[:, :2].max(axis=0))
    # Turned by half a turn about its middle, an ellipse would fall onto itself.
    edge = cKDTree(vertices[vertices[:, 2] == 0.0, :2])
    turned = 2 * middle - vertices[vertices[:, 2] == 0.0, :2]
    assert edge.query(turned)[0].max() > 0.01


def test_the_saddle_bends_both_ways_and_the_dome_one_way():
    for name, signs in [("saddle", [True, True]), ("dome", [False, True])]:
        surface = cad.build_surface(SURFACES / f"{name}.py", size=0.02)
        gauss = curvature(surface)[away_from_edge(surface, 0.04)].prod(axis=1)
        assert [bool((gauss < -0.5).any()), bool((gauss > 0.5).any())] == signs


def test_the_shipped_step_file_is_the_dome():
    surface = cad.import_surface(SURFACES / "dome_mm.step")
    np.testing.assert_allclose(surface.size, [0.9, 0.7, 0.2], rtol=1e-3)
    assert surface.area == pytest.approx(cad.build_surface(SURFACES / "dome.py", size=0.01).area, rel=1e-3)


def test_the_shipped_obj_file_is_a_hyperbolic_paraboloid_in_metres():
    surface = read_surface(SURFACES / "hypar.obj")
    np.testing.assert_allclose(surface.size, [5.0, 5.0, 3.0], rtol=1e-9)
    inner = away_from_edge(surface, 0.7)
    assert (curvature(surface)[inner].prod(axis=1) < 0.0).all()


def test_every_file_that_others_wrote_is_listed_with_its_source():
    listed = (SURFACES / "SOURCES.md").read_text(encoding="utf-8")
    for path in SURFACES.iterdir():
        if path.is_file() and path.name != "SOURCES.md":
            assert f"`{path.name}`" in listed
