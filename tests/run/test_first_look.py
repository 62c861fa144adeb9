"""A first look at a surface tells what the net then comes to."""

import numpy as np
import pytest

import shellform as sf
from shellform.case.build_net import net_settings, surface_record
from shellform.case.entries import NetEntry
from shellform.net.chebyshev import net_at
from shellform.run.first_look import FirstLook, expected, labelled, largest_radius
from shellform.surface.shape.target import largest_curvature, make_surface


@pytest.mark.parametrize(
    "entries", [{"elements": 2, "spacing_v": 0.1}, {"elements": 1}, {"spacing": 0.1, "spacing_v": 0.06}]
)
def test_crossings_and_freedoms_to_expect_are_those_of_the_spacings_and_elements_that_the_case_has(
    vault, entries
):
    entry = NetEntry(**{"spacing": 0.06, **entries})
    told = expected(vault, entry)
    net = net_at(vault, net_settings(entry, 0.0024), angle=0.0, offset=(0.0, 0.0))
    assert told.crossings == pytest.approx(len(net.grid.lattice), rel=0.15)
    assert told.freedoms == pytest.approx(6 * net.node_count, rel=0.15)


def test_the_largest_rod_radius_is_no_promise_since_rods_on_a_sphere_are_bent_in_it_too():
    x, y = (each.ravel() for each in np.meshgrid(*2 * [np.linspace(-3.0, 3.0, 25)]))
    at = np.arange(25 * 24).reshape(24, 25)[:, :-1].ravel()
    faces = np.vstack([np.column_stack([at, at + 1, at + 26]), np.column_stack([at, at + 26, at + 25])])
    cap = make_surface(np.column_stack([x, y, np.sqrt(36.0 - x**2 - y**2)]), faces)
    bent = largest_curvature(cap)
    told = largest_radius(40e9, 255e6, bent)
    net = sf.pull_net(cap, spacing=1.0, gap=0.03, elements=2)
    assert net.max_radius(young=40e9, strength=255e6) < told == pytest.approx(6.0 * 255e6 / 40e9, rel=0.01)
    look = FirstLook(surface_record(cap, "cap.obj"), "OBJ", "m", bent, told)
    assert labelled(look)["largest rod radius"].startswith(f"about {told:.3g} m")
