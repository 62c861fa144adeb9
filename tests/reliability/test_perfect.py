"""The perfect structure's path: which states are kept, how far it is known, and what a model file must
hold."""

from types import SimpleNamespace

import numpy as np
import pytest

from shellform.errors import InputError
from shellform.reliability import perfect as module
from shellform.reliability.perfect import perfect, perfect_of
from shellform.structure.elements.state import at_rest

PLACES = np.array([[0.0, 0.0, 0.0], [1.0, 0.5, 0.25], [2.0, 0.0, 0.0]])


@pytest.fixture
def path(monkeypatch):
    """A path whose states and end are told; `None` stands for an unloaded state that isn't stable."""
    told = SimpleNamespace(factors=[0.5, 1.0], reached=1.0, stable=True, seen=[])

    class Branch:
        def __init__(self, assembly, load, span):
            told.seen.append(("branch", assembly, load.sum(), span))

        def at(self, state):
            return "here" if told.stable else None

        def along(self, here, begin, most, step, smallest, report, *, heeding):
            assert heeding, "of what a step may pass over"
            told.seen.append(("along", here, begin, most, step, smallest))
            for factor in told.factors:
                report(factor, f"at {factor}")
            return None, told.reached

    def modes(assembly, state, count):
        told.seen.append(("modes", state, count))
        return SimpleNamespace(shapes=np.full((count, 3, 6), 0.5))

    def find(assembly, target, load):
        told.seen.append(("unloaded", target, load.any()))
        return SimpleNamespace(state="unloaded")

    monkeypatch.setattr(module, "assemble", lambda network: f"assembly of {network}")
    monkeypatch.setattr(module, "find_equilibrium", find)
    monkeypatch.setattr(module, "Branch", Branch)
    monkeypatch.setattr(module, "modes", modes)
    monkeypatch.setattr(module, "members_of", lambda shell: SimpleNamespace(span=2.0))
    return told


SHELL = SimpleNamespace(network=lambda design: f"network of {design.name}", target="target")
DESIGN = SimpleNamespace(name="design", present=np.array([True, False]))
LOAD = np.full((3, 6), -1.0)


def test_states_are_kept_by_eighths_of_the_load_from_the_unloaded_one_on(path):
    found = perfect(SHELL, DESIGN, LOAD)
    assert found.factors.tolist() == [0.0, 0.5, 1.0]
    assert found.states == ("unloaded", "at 0.5", "at 1.0")
    assert (found.unloaded, found.bears, found.start) == ("unloaded", True, "target")
    assert path.seen == [
        ("unloaded", "target", False),
        ("branch", "assembly of network of design", -18.0, 2.0),
        ("along", "here", 0.0, 1.0, 0.125, module.SMALLEST),
        ("modes", "at 1.0", 3),
    ], "shapes follow the softest modes at the end of the path"
    assert found.imperfections.state == "unloaded"
    assert found.imperfections.shapes.shape == (3, 3, 6)


def test_a_structure_that_falls_on_the_way_does_not_bear_its_load(path):
    path.factors, path.reached = [0.5], 0.875
    found = perfect(SHELL, DESIGN, LOAD, shapes=0, step=0.5)
    assert (found.bears, found.states[-1]) == (False, "at 0.5")
    assert path.seen[-1][4] == 0.5
    assert found.imperfections.shapes.shape == (0, 3, 6)


@pytest.mark.parametrize(("step", "stable"), [(0.0, True), (0.5, False)])
def test_a_path_is_not_followed_where_it_is_not_asked_for_or_has_no_stable_begin(path, step, stable):
    path.stable = stable
    found = perfect(SHELL, DESIGN, LOAD, shapes=0, step=step)
    assert (found.factors.tolist(), found.bears) == ([0.0], False)
    assert "along" not in [name for name, *_ in path.seen]


@pytest.mark.parametrize(
    ("most", "known"),
    [(1.5, (1.0, "at 1.0")), (1.0, (1.0, "at 1.0")), (0.99, (0.5, "at 0.5")), (0.3, (0.0, "unloaded"))],
)
def test_a_path_is_known_to_the_last_kept_state_up_to_a_factor(path, most, known):
    assert perfect(SHELL, DESIGN, LOAD).known_to(most) == known


def model_of(**changes):
    fixed = np.zeros((3, 6), dtype=bool)
    fixed[0, :2] = True
    imposed = np.zeros((3, 6))
    imposed[0, :3] = [0.125, 0.25, 0.5]
    network = SimpleNamespace(
        cables=SimpleNamespace(ends=[0] * 4), fixed=fixed, nodes=PLACES - 1.0, imposed=imposed
    )
    given = {
        "network": network,
        "loads": {"wet": LOAD, "wind": 2.0 * LOAD},
        "start": at_rest(PLACES),
        **changes,
    }
    return SimpleNamespace(**given)


def test_a_model_s_path_begins_at_its_start_with_its_supports_where_they_are_held(path, monkeypatch):
    monkeypatch.setattr(module, "members_of_model", lambda model: SimpleNamespace(span=3.0))
    found = perfect_of(model_of(), "wind", shapes=1, step=0.25)
    assert path.seen[1][2:] == (-36.0, 3.0)
    assert found.present.tolist() == [True] * 4
    assert found.start.positions.tolist() == [[-0.875, -0.75, 0.0], *PLACES[1:].tolist()], (
        "in two of three directions"
    )
    assert path.seen[-1][1:] == ("at 1.0", 1)


@pytest.mark.parametrize(
    ("load", "changes", "said", "remedy"),
    [
        ("dry", {}, "no such load case", "Known: wet, wind."),
        ("wet", {"start": None}, "has no start", "Give the bent state"),
    ],
)
def test_a_model_without_the_load_or_a_start_is_refused(path, monkeypatch, load, changes, said, remedy):
    monkeypatch.setattr(module, "members_of_model", lambda model: None)
    with pytest.raises(InputError, match=said) as told:
        perfect_of(model_of(**changes), load)
    assert remedy in told.value.remedy
