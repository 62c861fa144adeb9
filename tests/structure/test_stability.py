"""Critical factors and softest modes of matrices whose answers are known, and of paths that are made up."""

from types import SimpleNamespace

import numpy as np
import pytest
import scipy.sparse as sp

from shellform.errors import InputError, NotConverged
from shellform.structure.answers import stability
from shellform.structure.answers.stability import critical_load, linearised_factor, modes
from shellform.structure.solve.factorisation import NotPositiveDefinite


class Diagonal:
    """An assembly whose tangent is diagonal, told by the state itself."""

    def __init__(self, free=None, count=1):
        self.matrix = self
        self.free, self.count = free, count
        self.indefinite = []

    def evaluate(self, state):
        return SimpleNamespace(tangent=np.array(state, dtype=float))

    def full(self, values):
        return sp.csc_array(sp.diags_array(values))

    def factor(self, values):
        if (values <= 0.0).any():
            raise NotPositiveDefinite
        return self._solver(values)

    def factor_indefinite(self, values):
        self.indefinite.append(values)
        found = self._solver(values)
        found.negative = int((values < 0.0).sum())
        return found

    def raised(self, values, places, by):
        raised = values.copy()
        raised[places] += by
        return raised

    @property
    def diagonal(self):
        return slice(None)

    def _solver(self, values):
        return SimpleNamespace(solve=lambda right: right / (values if right.ndim == 1 else values[:, None]))


@pytest.fixture(autouse=True)
def plain(monkeypatch):
    monkeypatch.setattr(stability, "held", lambda _, balance: balance.tangent)


@pytest.mark.parametrize("rest", [0, 3, 30])  # solved densely and by iteration
@pytest.mark.parametrize(("factors", "critical"), [((1.0, 2.0), 3.5), ((1.0, 3.0), 6.0), ((-2.0, 0.0), 3.0)])
def test_a_linearised_factor_is_where_the_softest_direction_loses_all_at_the_rate_so_far(
    rest, factors, critical
):
    before, after = [10.0, 8.0, 5.0], [6.0, 7.0, 5.5]  # lose 4 of 6 and 1 of 7, and gain
    stiff = [20.0 + k for k in range(rest)]
    found = linearised_factor(Diagonal(), before + stiff, after + stiff, factors)
    assert found == pytest.approx(critical, rel=1e-6)


def test_a_structure_that_stiffens_has_no_linearised_factor_and_one_that_is_unstable_none_either():
    assert linearised_factor(Diagonal(), [1.0, 2.0], [1.5, 2.5], (0.0, 1.0)) == np.inf
    with pytest.raises(NotPositiveDefinite):
        linearised_factor(Diagonal(), [1.0, 2.0], [1.5, -0.5], (0.0, 1.0))


@pytest.fixture
def body(monkeypatch):
    """Three nodes, of which six degrees of freedom are free, with their masses."""
    mass = np.array([1.0, 1.0, 1.0, 4.0, 0.25, 1.0])
    monkeypatch.setattr(stability, "ResidualNorm", lambda _: SimpleNamespace(mass_shape=mass))
    return Diagonal(free=np.array([0, 1, 8, 9, 15, 16]), count=3)


def test_the_softest_modes_are_the_lowest_per_mass_the_most_unstable_first(body):
    found = modes(body, [7.0, -3.0, 2.0, 40.0, 1.0, 100.0], 3)
    assert found.stiffness == pytest.approx([-3.0, 2.0, 4.0])
    assert len(body.indefinite) == 1
    shapes = np.abs(found.shapes)
    assert shapes.shape == (3, 3, 6)
    for mode, (node, axis, size) in enumerate([(0, 1, 1.0), (1, 2, 1.0), (2, 3, 2.0)]):
        assert shapes[mode, node, axis] == pytest.approx(size), "without translations as it is found"
        assert shapes[mode].sum() == pytest.approx(size)


def test_a_mode_s_largest_translation_is_1_and_its_turns_keep_their_share(body):
    coupled = np.diag([7.0, 3.0, 2.0, 40.0, 1.0, 100.0])
    coupled[0, 3] = coupled[3, 0] = -14.0
    body.full = lambda _: sp.csc_array(coupled)
    found = modes(body, np.ones(6), 1)
    mass = np.diag([1.0, 1.0, 1.0, 4.0, 0.25, 1.0])
    low = min(np.linalg.eigvals(np.linalg.solve(mass, coupled)).real)
    shape = found.shapes[0]
    assert found.stiffness[0] == pytest.approx(low)
    assert abs(shape[0, 0]) == pytest.approx(1.0)
    assert shape[1, 3] / shape[0, 0] == pytest.approx((7.0 - low) / 14.0)
    assert body.indefinite == []


@pytest.mark.parametrize("count", [0, 7, 8, 2.0])
def test_a_number_of_modes_that_there_aren_t_is_refused_with_one_that_there_is(body, count):
    with pytest.raises(InputError, match=r"must be (between 1 and 6|a whole number) .*Give 3, say"):
        modes(body, np.ones(6), count)
    modes(body, np.arange(1.0, 7.0), 6)
    body.free = body.free[:0]
    with pytest.raises(InputError, match="leave out some supports"):
        modes(body, np.ones(0), 1)


@pytest.mark.parametrize(("size", "count"), [(13, 5), (14, 13), (14, 6), (40, 12)])
def test_as_many_modes_are_found_as_are_asked_for_though_they_are_almost_all(size, count):
    values = np.arange(1.0, size + 1.0)
    mass = sp.csc_array(sp.diags_array(np.ones(size)))
    found, _ = stability._nearest(
        sp.csc_array(sp.diags_array(values)), lambda right: right / values, mass, count
    )
    assert np.sort(found) == pytest.approx(values[:count])


@pytest.mark.parametrize("count", [1, 2, 3, 5])
@pytest.mark.parametrize("size", [6, 40])
def test_modes_of_an_unstable_state_are_the_lowest_however_far_from_nothing(monkeypatch, size, count):
    """Nearest to nothing lie 0.5 and -1; the lowest are -300, -20, -1 in this order."""
    values = np.array([0.5, -20.0, 3.0, -1.0, -300.0, *np.linspace(400.0, 900.0, size - 5)])
    mass = np.ones(size)
    mass[4] = 2.0
    monkeypatch.setattr(stability, "ResidualNorm", lambda _: SimpleNamespace(mass_shape=mass))
    body = Diagonal(free=6 * np.arange(size), count=size)
    found = modes(body, values, count)
    assert found.stiffness == pytest.approx([-150.0, -20.0, -1.0, 0.5, 3.0][:count])
    places = [np.flatnonzero(shape[:, 0].round(4)).tolist() for shape in found.shapes]
    assert places == [[4], [1], [3], [0], [2]][:count]


def test_a_tangent_that_no_shift_makes_positive_definite_has_no_modes(body, monkeypatch):
    def never(values):
        raise NotPositiveDefinite

    monkeypatch.setattr(body, "factor", never)
    with pytest.raises(NotConverged, match="no shift makes the tangent positive definite"):
        modes(body, [-7.0, -3.0, 2.0, 40.0, 1.0, 100.0], 1)


@pytest.mark.parametrize("size", [8, 40])
def test_eigenvalues_nearest_to_nothing_are_found_densely_and_by_iteration(size):
    values = np.array([5.0, -2.0, 0.5, 9.0, *np.linspace(20.0, 60.0, size - 4)])
    mass = np.array([1.0, 4.0, 1.0, 0.5, *[1.0] * (size - 4)])
    found, vectors = stability._nearest(
        sp.csc_array(sp.diags_array(values)),
        lambda right: right / values,
        sp.csc_array(sp.diags_array(mass)),
        3,
    )
    order = np.argsort(found)
    assert found[order] == pytest.approx([-0.5, 0.5, 5.0])
    assert np.abs(vectors[:, order]).argmax(axis=0).tolist() == [1, 2, 0]
    assert np.einsum("ik,i,ik->k", vectors, mass, vectors) == pytest.approx(np.ones(3))


def point(factor, *, stable=True, event=""):
    return SimpleNamespace(
        factor=factor, event=event, equilibrium=SimpleNamespace(stable=stable, state=f"at {factor}")
    )


@pytest.fixture
def along(monkeypatch):
    """A critical load on a path of given points; what was asked for on the way."""
    asked = {"linearised": []}
    monkeypatch.setattr(stability, "fit_for", lambda assembly, state: f"fit for {state}")

    def shapes(assembly, state, count):
        asked["modes"] = assembly, state, count
        return SimpleNamespace(shapes=["shape"])

    def linearised(assembly, before, after, factors):
        asked["linearised"].append((assembly, before, after, factors))
        return estimates.pop(0)

    estimates = [np.inf, 2.5, 9.0]
    monkeypatch.setattr(stability, "modes", shapes)
    monkeypatch.setattr(stability, "linearised_factor", linearised)

    def found(*points):
        def follow(*given, **named):
            asked["follow"] = given, named
            return iter(points)

        monkeypatch.setattr(stability, "follow", follow)
        return critical_load("assembly", "start", "drive", goal=4.0, tolerance=1e-5)

    return found, asked


def test_the_critical_load_is_the_first_event_of_the_path_with_its_softest_mode(along):
    found, asked = along
    critical = found(
        point(0.0), point(0.5), point(1.0), point(1.2), point(1.4, event="limit point"), point(3.0)
    )
    assert (critical.factor, critical.kind, critical.mode) == (1.4, "limit point", "shape")
    assert critical.equilibrium.state == "at 1.4"
    assert critical.linearised == 2.5, "the first estimate that there is"
    assert [each[1:] for each in asked["linearised"]] == [
        ("at 0.0", "at 0.5", (0.0, 0.5)),
        ("at 0.5", "at 1.0", (0.5, 1.0)),
    ]
    assert asked["modes"] == ("fit for at 1.4", "at 1.4", 1)
    assert asked["follow"] == (
        ("assembly", "start", "drive"),
        {"goal": 4.0, "first": 0.1, "tolerance": 1e-5, "heeding": True},
    )


def test_a_point_that_is_unstable_without_an_event_is_a_bifurcation_s_and_a_stable_path_has_no_critical_load(
    along,
):
    found, _ = along
    critical = found(point(0.0), point(0.5), point(1.0, stable=False))
    assert (critical.factor, critical.kind, critical.linearised) == (1.0, "bifurcation", np.inf)
    assert found(point(0.0), point(4.0)) is None
    with pytest.raises(InputError, match="the start isn't stable"):
        found(point(0.0, stable=False), point(0.5))
