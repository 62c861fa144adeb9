"""A toothed edge becomes the smooth line it was cut along, and no other edge changes."""

import re

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.sparse.linalg import spsolve

import shellform as sf
from shellform.net.refusal import NoNet, Reason
from shellform.surface.readers import teeth
from shellform.surface.readers.draft import Draft
from shellform.surface.readers.reading import surface_of
from shellform.surface.shape.target import curvature, make_surface
from tests.surface.shells import split

BEND = 0.04  # 1/m, of the paraboloids below at their top


def sheet(size, step, turn=0.0):
    """Plan (v, 2) and quadrilaterals (q, 4) of a square grid, turned by degrees."""
    count = round(size / step) + 1
    ticks = (np.arange(count) - 0.5 * (count - 1)) * step
    x, y = (each.ravel() for each in np.meshgrid(ticks, ticks, indexing="ij"))
    corner = np.array([count * i + j for i in range(count - 1) for j in range(count - 1)])
    angle = np.deg2rad(turn)
    plan = np.column_stack([np.cos(angle) * x - np.sin(angle) * y, np.sin(angle) * x + np.cos(angle) * y])
    return plan, np.column_stack([corner, corner + count, corner + count + 1, corner + 1])


def raised(plan):
    return np.column_stack([plan, -0.5 * BEND * np.sum(plan**2, axis=1)])


def used(points, faces):
    kept, number = np.unique(faces, return_inverse=True)
    return points[kept], number.reshape(faces.shape)


def cut(size, step, inside, turn=0.0, triangles=False):
    """A paraboloid of the whole quadrilaterals, or triangles, whose middle lies inside."""
    plan, faces = sheet(size, step, turn)
    faces = split(faces) if triangles else faces
    faces = faces[inside(plan[faces].mean(axis=1))]
    return used(raised(plan), faces if triangles else split(faces))


def disc(radius):
    return lambda plan: np.hypot(*plan.T) < radius


def edge(surface, number=0):
    return surface.vertices[surface.boundary[number]]


def moved(surface):
    """How far its edge was moved, m, as it is told."""
    (told,) = (note for note in surface.mended if "smoothed" in note)
    return float(re.search(r"by ([\d.]+) m at most", told)[1])


@pytest.mark.parametrize("triangles", [False, True])
@pytest.mark.parametrize(("radius", "step"), [(3.0, 0.15), (6.0, 0.4), (15.0, 0.5), (12.0, 1.0)])
def test_a_disc_cut_out_of_a_grid_gets_its_round_edge_back(radius, step, triangles):
    points, faces = cut(2.0 * radius + 4.0 * step, step, disc(radius), triangles=triangles)
    surface = surface_of(Draft(points, faces), "disc")
    assert np.abs(np.hypot(*edge(surface)[:, :2].T) - radius).max() < 0.35 * step
    assert 0.3 * step < moved(surface) < np.sqrt(2.0) * step
    assert surface.area == pytest.approx(make_surface(points, faces).area, rel=1.5 * step / radius)


def test_a_smoothed_edge_lies_on_the_surface_and_is_bent_as_that_is():
    surface = surface_of(Draft(*cut(14.0, 0.4, disc(6.0))), "disc")
    assert np.abs(surface.vertices - raised(surface.vertices[:, :2]))[:, 2].max() < 1e-3
    assert np.abs(curvature(surface)).max() == pytest.approx(BEND, rel=0.02)


def bubble(radius, step, rise):
    """A soap film under pressure, held on the ground along the whole cells in a disc: points and faces."""
    plan, faces = sheet(2.0 * radius + 4.0 * step, step)
    plan, faces = used(plan, faces[disc(radius)(plan[faces].mean(axis=1))])
    sides = np.sort(np.vstack([faces[:, [k, (k + 1) % 4]] for k in range(4)]), axis=1)
    sides, times = np.unique(sides, axis=0, return_counts=True)
    free = np.setdiff1d(np.arange(len(plan)), sides[times == 1])
    ties = sp.coo_array((np.ones(len(sides)), sides.T), shape=2 * (len(plan),)).tocsr()
    ties = ties + ties.T
    pull = (sp.diags_array(ties.sum(axis=1)) - ties).tocsc()
    height = np.zeros(len(plan))
    height[free] = spsolve(pull[free][:, free], np.ones(len(free)))
    return np.column_stack([plan, rise * height / height.max()]), split(faces)


@pytest.mark.parametrize("tilt", [0.0, 25.0])
def test_an_edge_whose_teeth_lie_in_a_plane_stays_in_it(tilt):
    """A bubble over whole cells, held on the ground, had an edge up to 0.1 m above it and below it, which
    rounding then kept: a star in plan had no net."""
    points, faces = bubble(6.0, 0.5, 2.5)
    c, s = np.cos(np.deg2rad(tilt)), np.sin(np.deg2rad(tilt))
    turn = np.array([[1.0, 0.0, 0.0], [0.0, c, s], [0.0, -s, c]])
    surface = surface_of(Draft(points @ turn, faces), "bubble")
    rim = edge(surface) @ turn.T
    assert np.abs(rim[:, 2]).max() < 1e-9
    assert np.abs(np.hypot(*rim[:, :2].T) - np.hypot(*rim[:, :2].T).mean()).max() < 0.3 * 0.5
    before = make_surface(points, faces)
    assert np.abs(curvature(surface)).max() < 1.2 * np.abs(curvature(before)).max()
    turned = np.abs(teeth._turn(rim, 1))
    assert np.rad2deg(turned.max()) < 20.0, "no tooth is left"


def test_vertices_off_the_edge_stay_where_they_are():
    points, faces = cut(14.0, 0.4, disc(6.0))
    surface = surface_of(Draft(points, faces), "disc")
    inner = np.ones(len(surface.vertices), dtype=bool)
    inner[surface.boundary[0]] = False
    kept = {tuple(point) for point in points.tolist()}
    assert all(tuple(point) in kept for point in surface.vertices[inner].tolist())


@pytest.mark.parametrize("turn", [5.0, 20.0, 45.0])
def test_corners_that_are_meant_stay_corners(turn):
    half = np.array([8.0, 5.0])
    points, faces = cut(26.0, 0.5, lambda plan: (np.abs(plan) < half).all(axis=1), turn)
    surface = surface_of(Draft(points, faces), "oblong")
    plan = edge(surface)[:, :2]
    off = (np.abs(plan) - half).max(axis=1)
    assert np.abs(off).max() < 0.35 * 0.5
    for signs in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
        assert np.linalg.norm(plan - half * signs, axis=1).min() < 0.5 * 0.5


def test_a_corner_is_sought_where_the_curve_comes_to_least_as_solving_for_each_tells():
    random = np.random.default_rng(4)
    turn = 2.0 * np.pi * np.arange(60) / 60
    radius = 5.0 + np.abs(np.sin(2.0 * turn)) + random.uniform(-0.2, 0.2, 60)
    corners = radius[:, None] * np.column_stack([np.cos(turn), np.sin(turn), 0.1 * np.sin(turn)])
    weight, stiffness, kept = np.where(turn < 1.0, 1e8, 1.0), 40.0, np.array([15])
    bends = 2.0 * np.eye(60) - np.roll(np.eye(60), 1, axis=0) - np.roll(np.eye(60), -1, axis=0)

    def comes_to(corner):
        rows = np.delete(bends, [*kept, corner], axis=0)
        placed = np.linalg.solve(np.diag(weight) + stiffness * rows.T @ rows, weight[:, None] * corners)
        return np.sum(weight[:, None] * (placed - corners) ** 2) + stiffness * np.sum((rows @ placed) ** 2)

    for first in (20, 32, 50):
        tried = np.arange(first, first + 8)
        assert teeth._loosest(corners, weight, stiffness, kept, tried) == min(tried, key=comes_to)


@pytest.mark.parametrize("turn", [0.0, 17.0, 45.0])
def test_the_narrow_ends_of_an_oval_get_no_corners(turn):
    inside = lambda plan: np.hypot(plan[:, 0] / 6.0, plan[:, 1] / 3.5) < 1.0  # noqa: E731
    surface = surface_of(Draft(*cut(14.0, 0.6, inside, turn)), "oval")
    plan = edge(surface)[:, :2]
    steps = np.roll(plan, -1, axis=0) - plan
    steps /= np.linalg.norm(steps, axis=1, keepdims=True)
    assert np.sum(steps * np.roll(steps, 1, axis=0), axis=1).min() > np.cos(np.deg2rad(45.0))
    assert np.hypot(plan[:, 0] / 6.0, plan[:, 1] / 3.5) == pytest.approx(1.0, abs=0.1)


def test_edges_of_openings_are_smoothed_too():
    ring = lambda plan: (np.hypot(*plan.T) < 6.0) & (np.hypot(*plan.T) > 1.6)  # noqa: E731
    surface = surface_of(Draft(*cut(14.0, 0.35, ring)), "ring")
    assert any("2 edges were toothed and were smoothed" in note for note in surface.mended)
    assert np.hypot(*edge(surface, 1)[:, :2].T) == pytest.approx(1.6, abs=0.1)


def test_of_a_ragged_scan_spikes_are_taken_off_first():
    random = np.random.default_rng(2)
    plan, faces = sheet(14.0, 0.3)
    plan = plan + random.normal(0.0, 0.06, plan.shape)
    faces = split(faces)
    away = np.hypot(*plan[faces].mean(axis=1).T)
    points, faces = used(raised(plan), faces[away < 6.0 + random.uniform(-0.15, 0.15, len(faces))])
    surface = surface_of(Draft(points, faces), "scan", piece=1)
    assert moved(surface) < 3.0 * 0.3
    assert np.abs(np.hypot(*edge(surface)[:, :2].T) - 6.0).max() < 0.3


@pytest.mark.parametrize("width", [0.25, 0.5])
def test_what_hangs_on_by_a_neck_of_a_face_or_two_is_not_lost(width):
    def inside(plan):
        return (np.hypot(np.abs(plan[:, 0]) - 4.0, plan[:, 1]) < 3.0) | (
            (np.abs(plan[:, 1]) < 0.5 * width) & (np.abs(plan[:, 0]) < 4.0)
        )

    points, faces = cut(16.0, 0.2, inside)
    surface = surface_of(Draft(points, faces), "two discs")
    assert surface.area == pytest.approx(make_surface(points, faces).area, rel=0.03)
    assert any("its edge is toothed and was left so" in note for note in surface.mended)


def test_far_from_the_origin_the_edge_is_the_same():
    points, faces = cut(14.0, 0.4, disc(6.0))
    far = np.array([5e5, 4e6, 300.0])
    near = surface_of(Draft(points, faces), "near")
    there = surface_of(Draft(points + far, faces), "far")
    off = np.abs(there.vertices - far - near.vertices).max(axis=1)
    assert np.quantile(off, 0.99) < 1e-8
    assert off.max() < 1e-4, "of vertices that are equally near, rounding says by which an edge is continued"


def test_normals_that_are_given_are_kept_but_at_the_smoothed_edge():
    points, faces = cut(14.0, 0.4, disc(6.0))
    tilted = np.tile([0.6, 0.0, 0.8], (len(points), 1))
    surface = surface_of(Draft(points, faces, tilted), "disc")
    rim = np.zeros(len(surface.vertices), dtype=bool)
    rim[surface.boundary[0]] = True
    assert np.allclose(surface.normals[~rim], [0.6, 0.0, 0.8])
    assert (surface.normals[rim, 2] > 0.95).mean() > 0.9


def fan(corners, top=2.0):
    """Triangles from a raised middle to the corners (n, 2) of a plan."""
    count = len(corners)
    points = np.vstack([np.column_stack([corners, np.zeros(count)]), [[0.0, 0.0, top]]])
    return points, np.array([[count, k, (k + 1) % count] for k in range(count)])


def star(tips, parts=1):
    """The plan of a star, its sides in so many parts."""
    turn = np.pi / tips * np.arange(2 * tips)
    radius = np.where(np.arange(2 * tips) % 2 == 0, 6.0, 4.5)
    corners = radius[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
    share = np.arange(parts)[None, :, None] / parts
    return ((1.0 - share) * corners[:, None] + share * np.roll(corners, -1, axis=0)[:, None]).reshape(-1, 2)


def battlements():
    plan, quads = sheet(12.0, 0.25)
    middle = plan[quads].mean(axis=1)
    tooth = (middle[:, 1] > 5.0) & (np.floor(middle[:, 0]) % 2 == 0)
    return used(raised(plan), split(quads[~tooth]))


@pytest.mark.parametrize(
    ("points", "faces"),
    [fan(star(6)), fan(star(12)), fan(star(16, 4)), battlements(), cut(12.0, 0.5, disc(99.0))],
    ids=["coarse star", "star", "star of many sides", "battlements", "whole"],
)
def test_an_edge_whose_corners_are_meant_is_left(points, faces):
    surface = surface_of(Draft(points, faces), "meant")
    assert not any("smoothed" in note for note in surface.mended)
    assert np.array_equal(surface.vertices, points)


def test_an_edge_that_is_left_toothed_is_told():
    left = surface_of(Draft(*fan(star(12))), "star")
    assert any("its edge is toothed and was left so" in note for note in left.mended)
    for points, faces in (fan(star(6)), battlements(), cut(14.0, 0.4, disc(6.0))):
        assert not any("left so" in note for note in surface_of(Draft(points, faces), "other").mended)


def test_rods_end_along_a_smoothed_edge_and_where_teeth_leave_no_net_it_is_said():
    points, faces = cut(14.0, 0.4, disc(6.0), triangles=True)
    settings = {"spacing": 0.8, "gap": 0.03, "elements": 2, "angle": np.pi / 4}
    net = sf.pull_net(surface_of(Draft(points, faces), "disc"), **settings)
    ends = net.target.positions[net.supports]
    assert np.hypot(*ends[:, :2].T) == pytest.approx(6.0, abs=0.15)
    assert net.quality.distance_max < 0.01
    with pytest.raises(NoNet, match=r"isn't smooth enough.*an edge that turns to and fro") as caught:
        sf.pull_net(make_surface(points, faces), **settings)
    assert caught.value.reason is Reason.BROKEN
