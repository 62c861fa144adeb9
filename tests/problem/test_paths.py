"""A design's documented path under each load, with equilibria that are told."""

from types import SimpleNamespace

import numpy as np
import pytest

import shellform as sf
from shellform.problem import paths
from shellform.structure.elements.state import at_rest
from tests.gridshell.dishes import dish

NONE = np.zeros((2, 6))
DOWN = np.zeros((2, 6))
DOWN[1, 2] = -1.0


@pytest.mark.parametrize("stay", [True, False])
def test_each_load_is_followed_from_the_unloaded_state_and_nothing_is_that_state(monkeypatch, stay):
    followed = []

    class Assembly:
        def beside(self):
            return self

    def find(assembly, target, load):
        assert (target, load.any()) == ("target", False)
        return SimpleNamespace(state="unloaded", factorisations=9)

    def settle(assembly, state, drive, *, stay):
        followed.append((state, drive.at(0.0).any(), drive.at(1.0).sum(), stay))
        return f"under {drive.at(1.0).sum()}"

    monkeypatch.setattr(paths, "assemble", lambda network: Assembly())
    monkeypatch.setattr(paths, "find_equilibrium", find)
    monkeypatch.setattr(paths, "settle", settle)
    shell = SimpleNamespace(node_count=2, network=lambda design: design, target="target")
    found = paths.follow(shell, "design", {"none": NONE, "wet": DOWN, "wetter": 1.5 * DOWN}, stay=stay)
    assert list(found) == ["none", "wet", "wetter"]
    assert (found["none"].equilibrium.state, found["none"].share, found["none"].factorisations) == (
        "unloaded",
        1.0,
        9,
    )
    assert (found["wet"], found["wetter"]) == ("under -1.0", "under -1.5")
    assert sorted(followed, key=lambda each: -each[2]) == [
        ("unloaded", False, -1.0, stay),
        ("unloaded", False, -1.5, stay),
    ]


def test_cables_pull_beyond_a_millionth_of_their_length_and_absent_ones_never():
    """Of four candidates the second is absent; the others are longer by 2e-6, by 0.5e-6, and shorter."""
    cables = SimpleNamespace(
        lengths=lambda state: np.array([2.000004, 1.0000005, 0.9]), rest_length=np.array([2.0, 1.0, 1.0])
    )
    shell = SimpleNamespace(cables=lambda design: cables, cable_ends=[0] * 4)
    design = SimpleNamespace(present=np.array([True, False, True, True]))
    assert paths.in_tension(shell, design, None).tolist() == [True, False, False, False]


def test_deviations_are_distances_from_the_target():
    target = at_rest(np.array([[1.0, 2.0, 3.0], [0.0, 0.0, 0.0]]))
    state = at_rest(np.array([[1.0, 5.0, -1.0], [0.0, 0.0, -0.25]]))
    assert paths.deviations(SimpleNamespace(target=target), state).tolist() == [5.0, 0.25]


def test_a_load_beyond_the_end_of_its_branch_is_not_on_it_though_a_quarter_of_it_leaps_over():
    """A dish of 2 m that rises by 0.1 m buckles at 0.93 N a crossing; at 1.21 N each quarter came to rest on
    a stable state."""
    side = np.linspace(-1.0, 1.0, 13)
    x, y = (each.ravel() for each in np.meshgrid(side, side, indexing="ij"))
    number = np.arange(169).reshape(13, 13)
    a, b, c, d = (
        each.ravel() for each in (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:])
    )
    dish = sf.make_surface(
        np.column_stack([x, y, 0.1 * (1.0 - x**2) * (1.0 - y**2)]),
        np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])]),
    )
    net = sf.pull_net(dish, spacing=0.4, gap=0.01, angle=0.25 * np.pi, elements=2)
    joint = sf.Joint(axial=1e6, torsion=1.0, bending=1.0, gap=0.01)
    rod, cable = sf.Rod.round(young=40e9, radius=0.002), sf.Cable(stiffness=1e5)
    shell = sf.brace(net, rod, joint, cable, below=dish)
    loads = {"below": shell.point_load(0.9), "beyond": shell.point_load(1.21)}
    found = paths.follow(shell, shell.design(rest_ratio=0.999), loads, stay=True)
    assert found["below"].on_branch
    assert not found["beyond"].on_branch
    assert found["beyond"].share * 1.21 == pytest.approx(0.93, abs=0.02)


@pytest.mark.parametrize(
    ("made", "borne", "shares"),
    [
        ((0.04, 0.55, 0.002, 0.25 * np.pi, 0.995), 7.319, (1.1, 1.3, 2.0)),
        ((0.05, 0.4, 0.0015, 0.25 * np.pi, 0.995), 7.495, (1.1, 1.3, 2.0)),
        ((0.16, 0.4, 0.003, 0.25 * np.pi, 0.999), 10.133, (1.3,)),
    ],
)
def test_a_load_beyond_an_unstable_stretch_is_not_on_its_branch_though_the_shell_is_stable_again(
    made, borne, shares
):
    """Dishes that lose their stability under so many N a crossing, and have it again a little later: each was
    told on its branch under these shares of it."""
    shell, design = dish(*made)
    loads = {f"{share}": shell.point_load(share * borne) for share in (0.98, *shares)}
    told = {name: found.on_branch for name, found in paths.follow(shell, design, loads, stay=True).items()}
    assert told == {name: name == "0.98" for name in loads}


def test_a_load_short_of_the_end_of_its_branch_is_on_it_though_increments_get_no_further():
    """A dish that bears 3.781 N a crossing was told off its branch under 0.95 of that."""
    shell, design = dish(0.06, 0.55, 0.003, 0.25 * np.pi, 0.999)
    assert paths.follow(shell, design, {"wet": shell.point_load(0.95 * 3.781)})["wet"].on_branch
