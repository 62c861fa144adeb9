"""Maps of a gridshell's quantities: that the numbers on a picture are those of the mechanics."""

import numpy as np
import pytest
from PIL import Image

import shellform as sf
from shellform import render
from shellform.errors import InputError
from shellform.output.pictures import maps
from shellform.output.pictures.panel import marked_nodes


@pytest.fixture(scope="module")
def braced(shell):
    design = shell.design(rest_ratio=0.99)
    load = shell.point_load(1.0, every=2)
    return design, load, sf.follow(shell, design, {"wet": load})["wet"].equilibrium.state


def test_each_map_shows_the_number_of_the_summary(shell, braced):
    design, load, state = braced
    panel = {name: maps.panel_of(shell, design, state, load=load, quantity=name) for name in maps.QUANTITIES}
    assert panel["deviation"].deviation.max() == pytest.approx(sf.deviations(shell, state).max())
    assert panel["utilisation"].deviation.max() == pytest.approx(
        shell.bending_utilisation(design, state).max()
    )
    # of round rods, stress E κ r
    strain = panel["curvature"].deviation.max() * design.radius * shell.rod.young / shell.rod.strength
    assert strain == pytest.approx(shell.bending_utilisation(design, state).max())
    assert panel["shear"].deviation.max() < 0.25 * np.pi
    assert panel["mode"].deviation.max() == pytest.approx(1.0)
    assert "softest mode" in panel["mode"].title
    supports = shell.net.supports
    np.testing.assert_allclose(panel["mode"].positions[supports], state.positions[supports])
    assert set(panel["deviation"].load_points) == set(np.flatnonzero(load[:, 2]))


def test_no_load_is_marked_nearer_to_another_than_its_arrow_is_long():
    across = np.linspace(0.0, 10.0, 101)
    positions = np.stack([*np.meshgrid(across, across), np.zeros((101, 101))], axis=-1).reshape(-1, 3)
    load = np.zeros((len(positions), 6))
    load[:, 2] = -1.0
    found = positions[marked_nodes(load, positions)]
    far = np.linalg.norm(found[:, None] - found, axis=-1) + 10.0 * np.eye(len(found))
    assert far.min() > 0.4
    every = np.linalg.norm(positions[:, None, :2] - found[:, :2], axis=-1).min(axis=1)
    assert every.max() <= 0.4 + 1e-12, "and none is far from one that is marked"
    load[5000, 2] = -100.0
    assert marked_nodes(load, positions).tolist() == [5000], "small ones beside it are not marked"
    assert len(marked_nodes(np.zeros_like(load), positions)) == 0


def test_the_curvature_without_load_and_cables_is_about_the_net_s(shell):
    state = sf.follow(shell, shell.unbraced(), {"none": np.zeros((shell.node_count, 6))})[
        "none"
    ].equilibrium.state
    panel = maps.panel_of(shell, None, state, quantity="curvature")
    assert panel.deviation.max() == pytest.approx(
        shell.net.quality.curvature_max, rel=0.08
    )  # the joints bend the rods: 6 %
    assert len(panel.cables) == 0


def test_the_user_s_function_writes_the_picture_and_returns_it(tmp_path, shell, braced):
    design, load, state = braced
    plain = render.deviation(tmp_path / "wet.png", shell, state, limit=0.010, size=(480, 300))
    assert plain.shape == (300, 480, 3)
    assert plain.dtype == np.uint8
    np.testing.assert_array_equal(np.asarray(Image.open(tmp_path / "wet.png")), plain)
    again = render.deviation(None, shell, state, limit=0.010, size=(480, 300))
    assert np.abs(plain.astype(int) - again).max() <= 1
    full = render.deviation(
        None, shell, state, design, load=load, title="wet", size=(480, 300), view="top", transparent=True
    )
    assert full.shape == (300, 480, 4)
    lines = render.deviation(tmp_path / "wet.svg", shell, state, size=(480, 300))
    assert lines.shape == (300, 480, 3)
    assert "<svg" in (tmp_path / "wet.svg").read_text(encoding="utf-8")


def test_other_quantities_and_states_of_other_shells_are_refused(shell, braced):
    _, _, state = braced
    with pytest.raises(InputError, match="Known: deviation, utilisation, curvature, shear, mode"):
        maps.panel_of(shell, None, state, quantity="colour")
    with pytest.raises(InputError, match="belongs to another shell"):
        maps.panel_of(shell, None, type(state)(state.positions[1:], state.quaternions[1:]))


def test_a_mode_which_has_no_sign_is_drawn_as_it_sinks():
    place = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.5], [4.0, 0.0, 0.0]])  # 4 m long
    down = np.array([[0.1, 0.0, 0.2], [0.0, 0.0, -1.0], [0.0, 0.0, 0.0]])
    expected = place + 0.05 * 4.0 * down
    assert np.array_equal(maps.sunk(place, down), expected)
    assert np.array_equal(maps.sunk(place, -down), expected)
