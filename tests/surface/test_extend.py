"""The surface past its edge and over its openings."""

import numpy as np
import pytest
from scipy.spatial import Delaunay

from shellform.surface.shape.extension import extended
from shellform.surface.shape.locate import Locator
from shellform.surface.shape.target import make_surface


def plate(inside, height, step=0.08):
    """The surface z = height(x, y) over the grid points for which `inside` holds, with triangles between
    them.
    """
    line = np.arange(-2.0, 2.0 + step / 2, step)
    x, y = (each.ravel() for each in np.meshgrid(line, line))
    keep = inside(x, y)
    plan = np.column_stack([x, y])[keep]
    faces = Delaunay(plan).simplices
    middle = plan[faces].mean(axis=1)
    longest = np.linalg.norm(plan[faces] - plan[np.roll(faces, 1, axis=1)], axis=2).max(axis=1)
    faces = faces[inside(*middle.T) & (longest < 1.5 * step)]
    return make_surface(np.column_stack([plan, height(*plan.T)]), faces)


def upright(whole, first):
    """Twice the plan areas of the triangles from the first on."""
    corner = whole.vertices[whole.triangles[first:], :2]
    return np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])


@pytest.mark.parametrize("waist", [0.3, 0.8])
@pytest.mark.filterwarnings("ignore:Arrays of 2-dimensional vectors:DeprecationWarning")
def test_the_strip_past_an_edge_that_turns_inwards_does_not_fold(waist):
    surface = plate(
        lambda x, y: np.abs(y) < 1.8 - waist * (1.0 + np.cos(2.0 * x)), lambda x, y: 0.3 * np.cos(x)
    )
    whole, closed = extended(surface, 0.6)
    assert closed == len(surface.triangles)
    assert upright(whole, closed).min() > 0.0
    np.testing.assert_array_equal(whole.vertices[: len(surface.vertices)], surface.vertices)


@pytest.mark.filterwarnings("ignore:Arrays of 2-dimensional vectors:DeprecationWarning")
def test_an_opening_is_closed_smoothly():
    def height(x, y):
        return 0.05 * x * x - 0.1 * y * y + 0.02 * x * y

    surface = plate(lambda x, y: np.hypot(x - 0.2, y) > 0.5, height)
    whole, closed = extended(surface, 0.3)
    assert closed > len(surface.triangles)
    assert upright(whole, len(surface.triangles)).min() > 0.0
    finder = Locator(surface, reach=0.3)
    turn = np.linspace(0.0, 2 * np.pi, 50)
    over = np.column_stack([0.2 + 0.3 * np.cos(turn), 0.3 * np.sin(turn), np.zeros(50)])
    over[:, 2] = height(over[:, 0], over[:, 1])
    foot = finder.foot(over)
    assert np.abs(foot.distance).max() < 5e-3  # a quarter of the opening's own depth of curvature
    assert foot.past.all()
    np.testing.assert_allclose(finder.past_edge(foot), 0.2, atol=0.08)  # the edge is ragged by a step
    assert (finder.past_outline(foot) < -1.0).all()


def test_past_the_outline_and_past_the_edge_are_the_same_without_openings():
    surface = plate(lambda x, y: np.hypot(x, y) < 1.0, lambda x, y: 0.1 * x * x)
    for reach in (0.0, 0.5):
        finder = Locator(surface, reach=reach)
        foot = finder.foot(np.random.default_rng(0).uniform(-1.4, 1.4, (200, 3)))
        np.testing.assert_allclose(finder.past_edge(foot), finder.past_outline(foot), atol=1e-14)
        assert 0.2 < foot.past.mean() < 0.8


@pytest.mark.filterwarnings("ignore:Arrays of 2-dimensional vectors:DeprecationWarning")
def test_lines_that_would_cross_whatever_their_directions_end_before_they_do():
    slot = plate(lambda x, y: (np.abs(x) > 0.13) | (y < -0.5), lambda x, y: 0.0 * x)
    whole, closed = extended(slot, 1.0)
    assert np.isfinite(whole.vertices).all()
    foot = Locator(slot, reach=1.0).foot(np.array([[0.0, 1.0, 0.1], [0.0, -1.0, 0.1]]))
    assert foot.past.tolist() == [True, False]
    np.testing.assert_allclose(foot.distance, 0.1, atol=1e-6)
    assert upright(whole, closed).min() > 0.0
