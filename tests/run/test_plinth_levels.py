"""Up to which level plinths reach, and where they help, by numbers of stand-ins."""

from types import SimpleNamespace

import numpy as np
import pytest

from shellform.errors import InputError
from shellform.run import plinths
from shellform.surface.shape import target


@pytest.fixture
def feet(monkeypatch):
    def found(radius, rest, *, side=8.0, lowest=0.333, spacing=0.5, can_be_cut=True, slopes=False):
        """The plinths of a surface that is bent to a radius, and cut off to the `rest`."""
        surface = SimpleNamespace(longer_side=side, vertices=np.array([[0.0, 5.0, lowest], [9.0, -7.0, 8.0]]))

        def cut_off(own, above):
            if not can_be_cut:
                raise InputError("nothing is left", where="surface")
            return ("rest", above)

        monkeypatch.setattr(plinths, "sharpest_bend", lambda own: (0, radius if own is surface else rest))
        monkeypatch.setattr(plinths, "first_spacing", lambda own: (spacing, "so"))
        monkeypatch.setattr(plinths, "cut_off", cut_off)
        monkeypatch.setattr(plinths, "ground_under", lambda own: SimpleNamespace(slopes=slopes))
        return plinths.plinths_for(surface)

    return found


def test_plinths_reach_up_to_a_level_of_two_digits_below_a_fiftieth_of_the_extent(feet):
    made = feet(0.9, 2.0)
    assert (made.surface, made.above) == (("rest", 0.49), 0.49)
    assert (made.height, made.radius) == (pytest.approx(0.157), 0.9)
    assert made.told.startswith(
        "rods end on plinths of up to 0.157 m: lower down the surface is bent to a radius of 0.9 m"
    )
    large = feet(0.9, 2.0, side=60.0, lowest=-0.26)
    assert (large.above, large.height) == (0.9, pytest.approx(1.16))


def test_plinths_are_for_feet_bent_to_two_spacings_that_are_the_reason(feet):
    assert feet(1.0, 1.41) is not None
    assert feet(0.8, 1.13) is not None
    assert feet(0.8, 1.11) is None
    assert feet(1.01, 9.0) is None, "rods follow that"
    assert feet(1.0, 1.39) is None, "it is bent as sharply elsewhere"
    assert feet(1.0, 9.0, can_be_cut=False) is None
    assert feet(1.0, 1.41, slopes=True) is None, "no level cuts off feet on a slope alike"


def test_a_surface_is_bent_most_inside_its_edge(monkeypatch):
    surface = SimpleNamespace(boundary=[np.array([0]), np.array([2])])
    bent = np.array([[9.0, 1.0], [0.1, -0.8], [3.0, 0.0], [0.5, 0.2]])
    monkeypatch.setattr(target, "curvature", lambda own: bent.copy())
    assert target.sharpest_bend(surface) == (1, pytest.approx(1.25))
