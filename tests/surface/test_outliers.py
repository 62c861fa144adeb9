"""Stray points of a scan are put back onto the surface around them, and nothing that is meant moves."""

import re

import numpy as np
import pytest

from shellform.surface.readers.draft import Draft
from shellform.surface.readers.reading import surface_of
from tests.surface.shells import split
from tests.surface.test_teeth import sheet

NOISE = 0.005  # m


def scanned(height, size=11.0, step=0.25, noise=NOISE):
    """Points and triangles of a square plan with this height over it, and noise."""
    plan, faces = sheet(size, step)
    up = height(*plan.T) + np.random.default_rng(3).normal(0.0, noise, len(plan))
    return np.column_stack([plan, up]), split(faces)


def vault(x, y):
    return 2.6 - 0.08 * x**2 - 0.04 * y**2


def inner_and_edge(points):
    """Some vertices inside, on the edge and at a corner."""
    count = round(np.sqrt(len(points)))
    return np.array([5 * count + 7, 20 * count + 21, 33 * count + 12, 9, 14 * count, 0])


def told(surface):
    """How many vertices were put back, and by how much at most, m."""
    found = [note for note in surface.mended if "stray" in note]
    return (
        (int(found[0].split()[0]), float(re.search(r"by ([\d.]+) m at most", found[0])[1])) if found else None
    )


@pytest.mark.parametrize("off", [-5.0, -0.8, 0.15, 1.3])
@pytest.mark.parametrize("turn", [np.eye(3), np.array([[0.8, 0.0, -0.6], [0.0, 1.0, 0.0], [0.6, 0.0, 0.8]])])
def test_stray_points_are_put_onto_the_surface_around_them_and_that_is_told(off, turn):
    points, faces = scanned(vault)
    stray = points.copy()
    stray[inner_and_edge(points), 2] += off
    surface = surface_of(Draft(stray @ turn.T, faces), "scan")
    assert told(surface) == (6, pytest.approx(abs(off), rel=0.15))
    x, y, z = (surface.vertices @ turn).T
    assert np.abs(z - vault(x, y)).max() < 8.0 * NOISE
    assert len(surface.triangles) == len(faces)


def test_the_lowest_point_of_a_scan_whose_edge_has_a_stray_one_is_that_of_its_edge():
    points, faces = scanned(vault)
    low = points[:, 2].min()
    points[11, 2] -= 0.8
    assert surface_of(Draft(points, faces), "scan").vertices[:, 2].min() == pytest.approx(low, abs=0.05)


def test_two_stray_points_beside_each_other_are_put_back():
    points, faces = scanned(vault)
    points[[700, 701], 2] += (0.9, 1.1)
    assert told(surface_of(Draft(points, faces), "scan"))[0] == 2


@pytest.mark.parametrize("noise", [0.0, NOISE])
@pytest.mark.parametrize(
    "height",
    [
        vault,
        lambda x, y: -0.7 * np.hypot(x, y),  # the tip of a cone
        lambda x, y: -0.5 * (np.abs(x) + np.abs(y)),  # and of a pyramid, with its ridges
        lambda x, y: 0.6 * np.log(np.hypot(x, y) + 0.1),  # a mast's
        lambda x, y: -0.5 * np.abs(x - y),  # a crease
        lambda x, y: 0.5 * (x > 3.0) * (np.abs(y) / 5.5) ** 6,  # a step of its edge
        lambda x, y: 0.5 * (np.abs(y) > 5.4) * (x > 2.0),  # a parapet
        lambda x, y: 0.4 * np.exp(-(x**2 + y**2) / 0.5),  # a dent
    ],
)
def test_what_is_meant_stays_where_it_is(height, noise):
    points, faces = scanned(height, noise=noise)
    surface = surface_of(Draft(points, faces), "shell")
    assert told(surface) is None
    assert np.array_equal(surface.vertices, points)


def test_a_surface_that_is_rough_all_over_stays_as_it_is():
    points, faces = scanned(vault)
    off = np.random.default_rng(5).choice(len(points), len(points) // 20, replace=False)
    points[off, 2] += 0.5
    assert told(surface_of(Draft(points, faces), "rough")) is None
