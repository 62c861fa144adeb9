"""A design's documented path under each load, with equilibria that are told."""

from types import SimpleNamespace

import numpy as np
import pytest

from shellform.problem import paths
from shellform.structure.elements.state import at_rest

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

    def apply_load(assembly, state, before, after, *, stay):
        followed.append((state, before.any(), after.sum(), stay))
        return f"under {after.sum()}"

    monkeypatch.setattr(paths, "assemble", lambda network: Assembly())
    monkeypatch.setattr(paths, "find_equilibrium", find)
    monkeypatch.setattr(paths, "apply_load", apply_load)
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
