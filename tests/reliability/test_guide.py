"""Cables counted for what they are worth, and the guide made of them."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from shellform.errors import NotConverged
from shellform.gridshell.tolerances import Tolerances, default_tolerances
from shellform.reliability import guide as guide_module
from shellform.reliability.expected_cables import ExpectedCables
from shellform.reliability.guide import PathStiffness, expected_stiffness, guide, stretch_deviation
from shellform.structure.answers.stability import modes
from shellform.structure.elements.cable import make_cables
from shellform.structure.elements.state import at_rest
from shellform.structure.network import assemble

PLACES = np.array([[0.0, 0.0, 0.0], [1.0, 0.2, 0.1], [0.3, 0.9, 0.2], [0.1, 0.3, 1.1]])
ENDS = [[0, 1], [1, 2], [2, 3], [0, 3]]


@pytest.fixture
def cables():
    """One taut by a hair, one slack by as much, one taut and one slack for sure."""
    length = np.linalg.norm(PLACES[[1, 2, 3, 3]] - PLACES[[0, 1, 2, 0]], axis=1)
    off = np.array([1e-4, -1e-4, 5e-3, -5e-3])
    return make_cables(ENDS, rest_length=length - off, stiffness=187.0)


def expected(cables):
    return ExpectedCables(cables, np.full(4, 2e-4))


def test_the_expected_tension_is_the_mean_of_the_sharp_one_over_the_errors(cables):
    state, rng = at_rest(PLACES), np.random.default_rng(0)
    found = expected(cables).tension(state)
    stretch = cables.lengths(state) - cables.rest_length
    z = rng.normal(size=(400_000, 1))
    mean = (cables.stiffness / cables.rest_length * np.maximum(stretch + 2e-4 * z, 0.0)).mean(axis=0)
    assert found == pytest.approx(mean, rel=5e-3, abs=1e-4)


def test_without_doubt_the_sharp_law_comes_out(cables):
    state = at_rest(PLACES)
    sharp, smooth = (
        cables.evaluate(state, tangent=True),
        ExpectedCables(cables, np.full(4, 1e-9)).evaluate(state, tangent=True),
    )
    assert smooth.energy == pytest.approx(sharp.energy, rel=1e-9, abs=1e-14)
    assert smooth.force == pytest.approx(sharp.force, rel=1e-9, abs=1e-12)
    assert smooth.tangent == pytest.approx(sharp.tangent, rel=1e-9, abs=1e-9)


def directions():
    rng = np.random.default_rng(1)
    return rng.normal(size=(4, 3)), rng.normal(size=(4, 6))


def shifted(h, way):
    return at_rest(PLACES + h * way)


def orders(value, derivative):
    """Orders of the remainder of the first-order Taylor expansion as the step is halved."""
    steps = 4e-5 * 0.5 ** np.arange(4)
    left = [np.linalg.norm(value(h) - value(0.0) - h * derivative) for h in steps]
    return np.log2(np.array(left[:-1]) / np.array(left[1:]))


def test_the_forces_are_the_gradient_of_the_energy(cables):
    way, _ = directions()
    part = expected(cables)
    force = part.evaluate(shifted(0.0, way), tangent=False).force
    slope = (force * way[np.array(ENDS)].reshape(4, 6)).sum()
    found = orders(lambda h: part.evaluate(shifted(h, way), tangent=False).energy.sum(), slope)
    assert found == pytest.approx(2.0, abs=0.15)


def test_the_tangent_is_the_derivative_of_the_forces(cables):
    way, _ = directions()
    part = expected(cables)
    packed = part.evaluate(shifted(0.0, way), tangent=True).tangent
    rows, columns = np.tril_indices(6)
    whole = np.zeros((4, 6, 6))
    whole[:, rows, columns] = packed
    whole[:, columns, rows] = packed
    slope = np.einsum("eij,ej->ei", whole, way[np.array(ENDS)].reshape(4, 6))
    found = orders(lambda h: part.evaluate(shifted(h, way), tangent=False).force, slope)
    assert found == pytest.approx(2.0, abs=0.15)


def test_a_shell_whose_cables_are_taut_by_a_hair_is_told_to_be_softer_than_the_sharp_law_says(nominal):
    state, assembly = nominal.states[-1], assemble(nominal.network)
    cables = nominal.network.cables
    hair = replace(cables, rest_length=cables.lengths(state) - 1e-7)
    there = assembly.with_parts((nominal.network.beams, hair))
    sharp = modes(there, state, 1).stiffness[0]
    doubtful = expected_stiffness(there, hair, state, np.full(len(cables.ends), 1e-4))
    assert 0.0 < doubtful < 0.8 * sharp


def test_the_guide_looks_at_the_whole_path(nominal, dome):
    found = guide(nominal, default_tolerances(dome))
    assert len(found.stiffness) == len(found.factors) == len(nominal.states)
    assert found.least == found.stiffness.min()
    assert (found.factors[0], found.factors[-1]) == (0.0, 1.0)


def test_up_to_a_share_of_the_load_the_guide_takes_the_least_on_the_way_and_at_its_end():
    falling = PathStiffness(np.array([0.0, 0.5, 1.0]), np.array([4.0, 3.0, 1.0]))
    assert falling.least_to(0.75) == pytest.approx(2.0)
    dipping = PathStiffness(np.array([0.0, 0.5, 1.0]), np.array([4.0, 1.0, 3.0]))
    assert dipping.least_to(0.75) == 1.0
    assert dipping.least_to(1.0) == dipping.least == 1.0


def test_a_stretch_is_off_by_its_ends_motion_less_the_cable_s_own_error_and_by_that_at_least(monkeypatch):
    """One cable along x, 0.5 m; in two structures its ends part by 3 and -1 mm, and it is made longer by 1
    and 3 mm."""
    cables = make_cables([[0, 1]], rest_length=np.array([0.5]), stiffness=187.0)
    state = at_rest(np.array([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0]]))
    network = SimpleNamespace(cables=cables)
    nominal = SimpleNamespace(
        network=network, unloaded=state, load=np.ones((2, 6)), members=None, present=None
    )
    moved = np.array([[[0.001, 7.0, 0.0], [0.004, 0.0, 9.0]], [[0.002, 0.0, 0.0], [0.001, 5.0, 0.0]]])
    seen = []

    def moved_from(_assembly, there, load, _present, some, shapes):
        seen.append((there is state, load.any(), some, shapes))
        return SimpleNamespace(translations=moved)

    monkeypatch.setattr(guide_module, "draw_errors", lambda _members, _tolerances, *drawn: drawn)
    monkeypatch.setattr(guide_module, "moved_from", moved_from)
    longer = {(4, 0): 0.001, (4, 1): 0.003}
    monkeypatch.setattr(
        guide_module,
        "built_cables",
        lambda _cables, _present, errors: SimpleNamespace(rest_length=0.5 + longer[errors]),
    )

    def deviation(own, drawn=2):
        return stretch_deviation(nominal, Tolerances(cable_length=own), None, seed=4, drawn=drawn).tolist()

    assert deviation(1e-4) == pytest.approx([np.sqrt((0.002**2 + 0.004**2) / 2)])
    assert deviation(5e-3) == [5e-3]
    assert seen[0] == (True, False, [(4, 0), (4, 1)], None)
    moved[:], longer[(4, 0)], longer[(4, 1)] = 0.0, 0.0, 0.0
    assert deviation(0.0) == [1e-6], "a millionth of a metre at least"

    def unstable(*_):
        raise NotConverged("is unstable")

    monkeypatch.setattr(guide_module, "moved_from", unstable)
    assert deviation(2e-4) == [2e-4]
    assert deviation(0.0) == [1e-6]
