"""A gridshell's beams, cables and supports as the solver gets them, for two rods and a connector by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

import shellform as sf
from shellform.errors import InputError
from shellform.gridshell import candidates, layers
from shellform.gridshell import gridshell as module
from shellform.gridshell.gridshell import Gridshell, TooCurved, brace
from shellform.gridshell.layers import LOCK
from shellform.net.grid import CONNECTOR, ROD
from shellform.structure.elements.beam import make_beams
from shellform.structure.elements.state import at_rest
from tests.stubs import Known

FLAT = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.5, 0.0], [3.0, 4.0, 0.0]])
TARGET = FLAT + np.array([[0.1, 0.2, 0.3], [0.0, 0.0, 0.9], [0.0, 0.0, 0.8], [-0.4, -0.5, 0.6]])


def beams(ends, stiffness, kinds, kind=None):
    axial, torsion, about_y, about_z = stiffness
    return make_beams(
        FLAT, ends, axial=axial, torsion=torsion, bending_y=about_y, bending_z=about_z, kind=kind, kinds=kinds
    )


def grid_beams(_grid, rod, joint):
    """Two elements of rods with a connector between them."""
    each = [(a, b, a) for a, b in zip(rod, joint, strict=True)]
    return beams([[0, 1], [1, 2], [2, 3]], each, (ROD, CONNECTOR), [0, 1, 0])


@pytest.fixture
def shell(monkeypatch):
    """Of rods of 4 mm radius with locks of 7 N·m² along the first."""
    monkeypatch.setattr(module, "grid_beams", grid_beams)
    made = object.__new__(Gridshell)
    rod = sf.Rod.round(young=40e9, radius=0.004, strength=200e6)
    for name, value in {
        "net": SimpleNamespace(
            grid=SimpleNamespace(flat=FLAT), supports=np.array([3, 0]), target=at_rest(TARGET), node_count=4
        ),
        "rod": rod,
        "joint": sf.Joint(axial=5.0, torsion=6.0, bending=8.0, gap=0.01),
        "cable": sf.Cable(stiffness=300.0),
        "cable_ends": np.array([[0, 2], [1, 3], [0, 3]]),
        "cable_lengths": np.array([2.0, 3.0, 5.0]),
        "_locks": beams([[0, 1]], (1.0, 2.0, 7.0, 3.0), (LOCK,)),
        "_edges": None,
        "_made": {},
    }.items():
        object.__setattr__(made, name, value)
    return made


def test_a_design_begins_with_every_cable_a_hundredth_shorter_than_in_the_target_or_as_asked(shell):
    design = shell.design()
    assert design.rest_length == pytest.approx([1.98, 2.97, 4.95])
    assert design.present.all()
    assert design.radius == 0.004
    assert shell.design(rest_ratio=0.9).rest_length == pytest.approx([1.8, 2.7, 4.5])
    assert not shell.unbraced().present.any()
    for ratio in (0.0, 1.0, 1.5):
        with pytest.raises(InputError, match=r"cable\.rest_ratio.*such as 0\.99\.$"):
            shell.design(rest_ratio=ratio)


def test_rods_and_locks_grow_with_the_radius_and_connectors_do_not(shell):
    """EA with its square, all others with its fourth power; by 1.5 times."""
    thin, thick = shell.beams(0.004), shell.beams(0.006)
    for name, power in (("axial", 2), ("torsion", 4), ("bending_y", 4), ("bending_z", 4)):
        ratio = getattr(thick, name) / getattr(thin, name)
        lock = 1.5**4 if name == "bending_y" else 1.0
        assert ratio == pytest.approx([1.5**power, 1.0, 1.5**power, lock])
    assert thin.axial[[0, 1]] == pytest.approx([40e9 * np.pi * 0.004**2, 5.0])
    assert thin.bending_y[3] == 7.0


def test_beams_by_radius_are_the_derivative_of_beams(shell):
    step = 1e-7
    rate, plus, minus = shell.beams_by_radius(0.005), shell.beams(0.005 + step), shell.beams(0.005 - step)
    for name in ("axial", "torsion", "bending_y"):
        slope = (getattr(plus, name) - getattr(minus, name)) / (2.0 * step)
        assert getattr(rate, name) == pytest.approx(slope, rel=1e-6)


def test_beams_of_eight_radii_are_made_once(shell):
    made = {radius: shell.beams(radius) for radius in 0.001 * np.arange(1, 9)}
    assert all(shell.beams(radius) is each for radius, each in made.items())
    shell.beams(0.009)
    assert len(shell._made) <= 8, "others are forgotten"


def test_supports_are_pinned_and_moved_to_their_places_on_the_target(shell):
    design = sf.Design([1.9, 2.8, 4.7], np.array([True, False, True]), 0.004)
    network = shell.network(design)
    assert network.fixed.any(axis=1).tolist() == [True, False, False, True]
    assert network.fixed[0].tolist() == [True] * 3 + [False] * 3
    wanted = np.zeros((4, 6))
    wanted[0, :3], wanted[3, :3] = [0.1, 0.2, 0.3], [-0.4, -0.5, 0.6]
    assert network.imposed == pytest.approx(wanted)
    cables = shell.cables(design)
    assert cables.ends.tolist() == [[0, 2], [0, 3]]
    assert cables.rest_length.tolist() == [1.9, 4.7]
    assert cables.stiffness.tolist() == [300.0, 300.0]


def test_rods_are_used_by_the_larger_stress_of_both_ends_over_their_strength(shell, monkeypatch):
    """Of rods of the design's radius."""
    seen = []

    def stress(section, _beams, _forces):
        seen.append(section.radius)
        return np.array([[40e6, 100e6], [60e6, 20e6]])

    monkeypatch.setattr(layers, "rod_stress", stress)
    monkeypatch.setattr(module, "rod_bending_stress", stress)
    design, state = sf.Design([1.9, 2.8, 4.7], np.ones(3, dtype=bool), 0.005), at_rest(FLAT)
    assert shell.utilisation(design, state) == pytest.approx([0.5, 0.3])
    assert shell.bending_utilisation(design, state) == pytest.approx(np.array([[0.2, 0.5], [0.3, 0.1]]))
    assert seen == pytest.approx([0.005, 0.005])


def test_a_round_rod_of_a_material_that_is_not_told_contracts_by_three_tenths():
    assert sf.Rod.round(young=26e9, radius=0.001).shear == pytest.approx(10e9)


CURVATURE = np.zeros((2, 2, 2))
CURVATURE[1, 0] = [0.3, -0.4]  # of a round rod 0.5 / m together
NET = Known(
    quality=SimpleNamespace(curvature=CURVATURE, curvature_max=0.5),
    grid=SimpleNamespace(gap=0.05, spacing=1.0, spacing_v=1.0),
)


def test_rods_are_refused_beyond_the_radius_that_equation_1_leaves_them(monkeypatch):
    """200 MPa over 40 GPa and 0.5 / m are 10 mm; of 12 mm they can be bent to 12 mm / 10 mm / (0.5 / m) = 2.4
    m."""

    class Braced(Exception):
        pass

    def cells(_grid):
        raise Braced

    monkeypatch.setattr(candidates, "cells", cells)
    joint = sf.Joint(axial=5.0, torsion=6.0, bending=8.0, gap=0.05)

    def tried(radius, gap=0.05):
        rod = sf.Rod.round(young=40e9, radius=radius, strength=200e6)
        assert module.max_radius(NET, rod) == pytest.approx(0.01)
        other = sf.Joint(axial=5.0, torsion=6.0, bending=8.0, gap=gap)
        brace(NET, rod, other, sf.Cable(stiffness=1.0), below=None)

    assert joint.stiffness == (5.0, 6.0, 8.0, 8.0)
    with pytest.raises(TooCurved, match="more than 10 mm") as told:
        tried(0.012)
    assert told.value.radius == pytest.approx(2.4)
    for radius in (0.009, 0.01):
        with pytest.raises(Braced):
            tried(radius)
    for gap in (0.0501, 0.0499):
        with pytest.raises(InputError, match=r"joint\.gap: differs from the net's gap of 0\.05 m"):
            tried(0.009, gap)


def test_no_cable_is_laid_that_rises_above_the_surface_at_a_quarter_a_half_or_three_quarters_of_its_length(
    monkeypatch,
):
    """Along x by one metre each, by y which of them it is; what is below is above where told."""
    lattice = np.arange(4)
    place = np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [4.0, 0.0, 0.0], [5.0, 1.0, 0.0]])
    grid = SimpleNamespace(
        gap=0.05, spacing=1.0, spacing_v=1.0, crossing_nodes=np.column_stack([lattice, lattice])
    )
    net = Known(
        quality=SimpleNamespace(curvature=0.0 * CURVATURE, curvature_max=0.0),
        grid=grid,
        target=SimpleNamespace(positions=place),
        node_count=4,
    )
    monkeypatch.setattr(
        candidates, "cells", lambda _grid: np.array([[0, 1, 2, 3]])
    )  # cables 0-2 and 1-3 of 4 m
    monkeypatch.setattr(candidates, "edge_diagonals", lambda _grid: np.array([[0, 3]]))
    monkeypatch.setattr(module, "Gridshell", lambda *given: given)

    def laid(high, **how):
        def foot(points):
            away = np.array([np.abs(points - np.array(spot)).max(axis=1) < 1e-9 for spot in high])
            return SimpleNamespace(distance=np.where(away.any(axis=0), 0.01, -0.02))

        monkeypatch.setattr(candidates, "Locator", lambda _surface: SimpleNamespace(foot=foot))
        rod = sf.Rod.round(young=40e9, radius=0.004)
        joint = sf.Joint(axial=5.0, torsion=6.0, bending=8.0, gap=0.05)
        return brace(net, rod, joint, sf.Cable(stiffness=1.0), below=Known(), **how)[4].tolist()

    assert laid([[9.0, 9.0, 9.0]]) == [[0, 2], [1, 3]]
    assert laid([[9.0, 9.0, 9.0]], edge_cells=True) == [[0, 2], [1, 3], [0, 3]]
    for x in (1.0, 2.0, 3.0):
        assert laid([[x, 0.0, 0.0]]) == [[1, 3]]
        assert laid([[1.0 + x, 1.0, 0.0]]) == [[0, 2]]
    assert laid([[2.5, 0.5, 0.0]], edge_cells=True) == [[0, 2], [1, 3]]


def test_a_design_of_another_gridshell_is_refused(shell):
    count = len(shell.cable_ends) + 1
    other = sf.Design(np.ones(count), [True] * count, 0.001)
    with pytest.raises(
        InputError, match=r"design\.present: is of another gridshell: this one has \d+ candid"
    ):
        shell.network(other)
