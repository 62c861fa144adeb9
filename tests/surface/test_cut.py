"""A surface cut off at a level."""

import numpy as np
import pytest

from shellform.errors import InputError
from shellform.surface.shape.cut import cut_off
from tests.surface.test_fairing import sheet


def cone(x, y):
    return 5.0 - np.hypot(x, y)


def test_what_is_left_ends_on_the_level_and_lies_on_the_surface_as_it_was():
    surface = sheet(lambda x, y: 4.0 - 0.2 * (x * x + y * y))
    cut = cut_off(surface, 1.0)
    assert cut.vertices[:, 2].min() == pytest.approx(1.0)
    (rim,) = cut.boundary
    np.testing.assert_allclose(np.hypot(*cut.vertices[rim, :2].T), np.sqrt(15.0), atol=0.03)
    x, y, z = cut.vertices.T
    np.testing.assert_allclose(z, 4.0 - 0.2 * (x * x + y * y), atol=0.012)  # triangles' sag
    assert cut.area < surface.area
    assert any("cut off" in each for each in cut.mended)


def test_triangles_are_divided_to_the_area_above_the_level():
    surface = sheet(lambda x, y: 0.5 * x)
    cut = cut_off(surface, 0.35)
    assert cut.area == pytest.approx(surface.area * (4.0 - 0.7) / 8.0, rel=1e-9)
    corner = cut.vertices[cut.triangles]
    sides = np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2)
    area = 0.5 * np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)
    assert (area / sides.max(axis=1) ** 2).min() > 0.02, "no slivers"


def test_a_surface_above_the_level_stays_as_it_is():
    surface = sheet(cone)
    assert cut_off(surface, float(surface.vertices[:, 2].min())) is surface


@pytest.mark.parametrize(
    ("above", "said"), [(np.nan, "height"), (6.0, "higher than all"), (1.5, "pieces of like size")]
)
def test_levels_that_leave_no_shell_are_refused(above, said):
    with pytest.raises(InputError, match=said):
        cut_off(sheet(lambda x, y: np.abs(x)), above)


def test_of_uneven_pieces_the_largest_stays():
    surface = sheet(lambda x, y: np.where(x < 2.0, 2.0 - np.abs(x + 1.0) / 2.0, 0.4 + 0.9 * (x - 2.0)))
    cut = cut_off(surface, 1.0)
    assert cut.vertices[:, 0].max() < 2.0
