"""The ground under shells, level or sloping, as their outer edges show it."""

from dataclasses import replace

import numpy as np
import pytest

import shellform as sf
from shellform.net.edges import Edges, stand, stretches_of
from shellform.net.ground import ground_under
from shellform.net.notes import NoteKind
from shellform.surface.shape.target import make_surface
from tests.net.edge_shells import barrel, oculus, opened, sail, undulating, waisted

SHELLS = [barrel, oculus, opened, sail, undulating, waisted]


def sloped(surface, along_x, along_y):
    """The surface on ground that slopes: each point higher by so much a metre of its x and y."""
    place = surface.vertices + np.outer(surface.vertices[:, :2] @ [along_x, along_y], [0.0, 0.0, 1.0])
    return make_surface(place, surface.triangles)


def lengths(stretches):
    """m, of each kind of edge."""
    kinds = {each.kind for each in stretches}
    return {kind: sum(each.length for each in stretches if each.kind == kind) for kind in kinds}


@pytest.mark.parametrize("slope", [(0.1, 0.0), (0.0, -0.15), (0.1, 0.05), (0.0, 0.4)])
@pytest.mark.parametrize("shell", SHELLS)
def test_a_shell_on_a_slope_stands_on_what_it_stands_on_where_the_ground_is_level(shell, slope):
    level, surface = shell(), sloped(shell(), *slope)
    assert not ground_under(level).slopes
    np.testing.assert_allclose(ground_under(surface).slope, slope, atol=1e-9)
    assert lengths(stretches_of(surface)) == pytest.approx(lengths(stretches_of(level)), rel=0.1)


def test_how_a_slope_falls_is_told_in_metres_a_metre_and_from_x_with_the_net_s_notes():
    surface = sloped(barrel(), 0.0, 0.15)
    net = stand(sf.pull_net(surface, spacing=0.055, gap=0.002, angle=np.deg2rad(45.0), elements=2), surface)
    (note,) = [each.text for each in net.notes if each.kind is NoteKind.GROUND]
    assert "slopes by 0.15 m a metre, down at 270° from x" in note
    place = net.target.positions[net.supports]
    np.testing.assert_allclose(place[:, 2] - 0.15 * place[:, 1], 0.0, atol=0.01)
    assert np.ptp(place[:, 1]) > 0.7  # on both sides


def test_a_level_that_is_given_makes_the_ground_level():
    surface = sloped(barrel(), 0.0, 0.15)
    lowest = float(surface.vertices[:, 2].min())
    assert not ground_under(surface, lowest).slopes
    held = [each for each in stretches_of(surface, Edges(ground=lowest)) if each.kind == "ground"]
    assert max(each.points[:, 1].max() for each in held) < 0.0


def lean_to():
    """A roof that rises from its lower side, on the ground, to the upper one, which nothing carries."""
    flat = waisted(waist=0.0, flare=0.0)
    y = flat.vertices[:, 1] + 4.0
    z = 0.25 * y + 0.5 * np.sin(0.25 * np.pi * y / 2.0) ** 2
    return make_surface(
        np.column_stack([flat.vertices[:, :2], z - 0.1 * y * (8.0 - y) / 8.0]), flat.triangles
    )


def saddle():
    """A saddle on two low corners of a square, its edges straight, which may lean either way."""
    flat = opened(size=5.0, rise=0.0)
    x, y = flat.vertices[:, 0], flat.vertices[:, 1]
    return replace(flat, vertices=np.column_stack([x, y, 0.5 + 0.08 * x * y]))


@pytest.mark.parametrize("shell", [lean_to, saddle])
def test_what_is_high_since_nothing_carries_it_is_not_taken_for_ground(shell):
    assert not ground_under(shell()).slopes


def test_ground_steeper_than_one_in_two_is_a_wall():
    assert not ground_under(sloped(barrel(), 0.0, 0.6)).slopes
