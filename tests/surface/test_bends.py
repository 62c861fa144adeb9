"""How surfaces are curved for the most part, of which only numbers are known; and that it is found once."""

import numpy as np
import pytest

from shellform.surface.shape import bends, target
from tests.stubs import Known
from tests.surface.test_surfaces import cap

FOUR = [
    [0.0, -0.1],
    [0.4, 0.2],
    [-0.2, 0.1],
    [0.3, -0.1],
]  # by rising curvature: the first, third, fourth, second


@pytest.mark.parametrize(
    ("areas", "shown", "usual"),
    [
        ((60.0, 2.0, 36.0, 2.0), 0.2, 0.2),
        ((60.0, 2.0, 34.0, 4.0), 0.3, 0.2),
        ((74.0, 6.0, 10.0, 10.0), 0.4, 0.2),
        ((7.6, 0.2, 1.0, 1.2), 0.3, 0.1),
        ((10.0, 10.0, 10.0, 10.0), 0.4, 0.3),
    ],
)
def test_a_twentieth_of_the_area_is_left_out_of_the_curvature_shown_and_a_quarter_of_the_usual(
    monkeypatch, areas, shown, usual
):
    monkeypatch.setattr(bends, "curvature", lambda _: np.array(FOUR))
    monkeypatch.setattr(bends, "vertex_areas", lambda *_: np.array(areas))
    own = Known(vertices=None, triangles=None)
    assert bends.curvature_shown(own) == shown
    assert bends.curvature_usual(own) == usual


def test_what_a_surface_is_like_is_found_once_and_can_t_be_written_over(monkeypatch):
    jets, found = target.jets, []
    monkeypatch.setattr(target, "jets", lambda *mesh: found.append(mesh) or jets(*mesh))
    own, other = cap(0.2), cap(0.2)
    found.clear()
    for each in (own, other, own):
        bends.curvature_shown(each), bends.curvature_usual(each), bends.curvature_mean_square(each)
    assert len(found) == 2
    for kept in (target.curvature(own), *own.boundary):
        with pytest.raises(ValueError, match="read-only"):
            kept[0] = 0
