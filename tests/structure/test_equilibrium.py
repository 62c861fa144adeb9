"""When the ways to an equilibrium go on, count and give up, on stand-ins for what they solve."""

from types import SimpleNamespace

import numpy as np
import pytest

from shellform.errors import NotConverged
from shellform.structure.elements.state import at_rest
from shellform.structure.solve import equilibrium
from shellform.structure.solve.assembly import Assembly
from shellform.structure.solve.equilibrium import LostBranch, _minimum, _Relaxation, find_equilibrium, newton
from shellform.structure.solve.factorisation import NotPositiveDefinite
from shellform.structure.solve.residual import Drowned


class Line:
    """An assembly of one node of which x is free: residuals and steps are given, one after the other."""

    count, free, by_node = 1, np.array([0]), Assembly.by_node

    def __init__(self, steps):
        self.steps, self.matrix = iter(steps), self

    def evaluate(self, state):
        return SimpleNamespace(force=np.full((1, 6), 1.5), energy=0.5, turned=0.0, x=state.positions[0, 0])

    def factor_indefinite(self, values):
        return SimpleNamespace(solve=lambda right: right / 2.0 * next(self.steps))


@pytest.fixture
def measured(monkeypatch):
    """Newton's iteration with given residuals; what it was asked about each."""
    asked = []

    class Norm:
        def __init__(self, assembly):
            self.left = iter(residuals)

        def residual(self, balance, load):
            return next(self.left)

        def drowns(self, *_, **__):
            return False

        def balanced(self, residual, balance, state, load, tolerance, stagnant):
            asked.append((residual, stagnant))
            return residual <= tolerance

    residuals = []
    monkeypatch.setattr(equilibrium, "ResidualNorm", Norm)
    monkeypatch.setattr(equilibrium, "held", lambda *_: None)
    monkeypatch.setattr(equilibrium, "stability", lambda *_: (False, 3))
    turning = SimpleNamespace(solve=lambda factor, now, right: factor.solve(right))
    monkeypatch.setattr(equilibrium, "Turning", lambda *_: turning)

    def run(steps, given, **how):
        residuals[:] = given
        asked.clear()
        start = at_rest(np.zeros((1, 3)))
        return newton(Line(steps), start, np.full((1, 6), 3.5), tolerance=1e-3, **how)

    run.asked = asked
    return run


def test_newton_s_iteration_takes_whole_steps_until_it_is_balanced_and_may_end_unstable(measured):
    told = []
    found = measured([0.5, -0.125], [8.0, 0.5, 1e-4], progress=lambda *each: told.append(each))
    assert found.state.positions[0, 0] == 0.375
    assert (found.factorisations, found.residual, found.stable, found.negative) == (2, 1e-4, False, 3)
    assert told == [(0, 8.0), (1, 0.5), (2, 1e-4)]


def test_a_step_that_brings_less_than_nine_tenths_is_stagnant(measured):
    measured([1.0] * 5, [8.0, 0.9, 0.08, 0.05, 1e-4])
    assert measured.asked == [(8.0, False), (0.9, True), (0.08, False), (0.05, True), (1e-4, False)]


@pytest.mark.parametrize(
    ("steps", "residuals", "spent", "best"),
    [
        ([0.5, 0.25, 7.0, 7.0], [8.0, 2.0, 3.0, 9.0], 3, 0.5),  # the limit
        ([0.5, np.nan], [8.0, 2.0, 1.0], 1, 0.5),
        ([0.5, 1.1e6], [8.0, 2.0, 1.0], 1, 0.5),
        ([0.5, -1.1e6], [8.0, 2.0, 1.0], 1, 0.5),
        ([0.5, 0.25], [8.0, 2.0, np.inf], 2, 0.5),
    ],
)
def test_newton_s_iteration_gives_up_with_the_state_that_left_the_least(
    measured, steps, residuals, spent, best
):
    with pytest.raises(NotConverged, match=r"smallest residual 2\.0e\+00.*use the relaxation") as told:
        measured(steps, residuals, limit=3)
    assert (told.value.iterations, told.value.residual) == (spent, 2.0)
    assert told.value.state.positions[0, 0] == best


def test_a_step_of_almost_a_thousand_kilometres_is_still_taken(measured):
    assert measured([0.9e6], [8.0, 1e-4]).state.positions[0, 0] == 0.9e6


def test_a_load_that_rounding_hides_is_relaxed_with_twice_the_digits_where_there_are(monkeypatch):
    start = at_rest(np.zeros((1, 3)))
    asked = []

    def relaxed(assembly, state, *rest):
        asked.append((assembly, state.tail is not None, rest))
        if assembly == "plain":
            raise Drowned("hidden", state=there)
        return "found"

    monkeypatch.setattr(equilibrium, "_relaxed", relaxed)
    monkeypatch.setattr(equilibrium, "with_twice_the_digits", lambda _: precise)
    there, precise = at_rest(np.ones((1, 3))), "precise"
    options = {"tolerance": 1e-5, "limit": 7, "reach": 2.0, "on_branch": True, "symmetric": False}
    assert find_equilibrium("plain", start, "load", **options) == "found"
    assert [each[:2] for each in asked] == [("plain", False), ("precise", True)]
    assert asked[0][2] == asked[1][2] == ("load", 1e-5, 7, 2.0, True, False, None)
    precise = None
    with pytest.raises(Drowned):
        find_equilibrium("plain", start, "load")
    there, precise = None, "precise"
    with pytest.raises(Drowned):
        find_equilibrium("plain", start, "load")


def test_a_relaxation_ends_at_its_limit_with_what_it_has_come_to(monkeypatch):
    class Walk:
        factorisations, residual, state, now, symmetric = 0, 0.25, "here", SimpleNamespace(energy=1.0), True

        def __init__(self, *_):
            pass

        def drowns(self):
            return False

        def balanced(self):
            return self.factorisations == ends

        def step(self, on_branch):
            self.factorisations += 1

    monkeypatch.setattr(equilibrium, "_Relaxation", Walk)
    monkeypatch.setattr(equilibrium, "check_turned", lambda *_: None)
    monkeypatch.setattr(equilibrium, "stability", lambda *_: (True, 0))
    ends = 4
    assert find_equilibrium(None, None, None, limit=4).factorisations == 4
    with pytest.raises(
        NotConverged, match=r"after 3 factorisations \(residual 2\.5e-01\).*more increments"
    ) as told:
        find_equilibrium(None, None, None, limit=3)
    assert (told.value.state, told.value.residual, told.value.iterations) == ("here", 0.25, 3)


def mass(**values):
    """A relaxation at rest of two translations and a rotation of stiffness 6, 2 and 100."""
    walk = object.__new__(_Relaxation)
    diagonal = np.array([6.0, -2.0, 100.0])
    walk.assembly = SimpleNamespace(
        free=np.array([0, 1, 3]), matrix=SimpleNamespace(leading=lambda values: values, diagonal=slice(None))
    )
    walk.now = SimpleNamespace(tangent=diagonal)
    walk.load = np.array([[0.0, -8.0]])
    walk.mass, walk.residual, walk.state, walk.factorisations, walk.tolerance = 0.0, 0.5, "here", 7, 1e-8
    walk.measure = SimpleNamespace(most=lambda *_: 1e-6)
    walk._noise = lambda: 1e-3
    vars(walk).update(values)
    return walk


def test_mass_begins_at_a_ten_millionth_of_the_mean_stiffness_and_grows_tenfold():
    walk = mass()
    walk._raise_mass()
    assert walk.mass == pytest.approx(4e-7)
    walk._raise_mass()
    assert walk.mass == pytest.approx(4e-6)
    walk = mass(now=SimpleNamespace(tangent=np.zeros(3)))
    walk._raise_mass()
    assert walk.mass == 8.0, "without any stiffness the largest load"
    walk = mass(now=SimpleNamespace(tangent=np.zeros(3)), load=np.array([[0.0, -0.25]]))
    walk._raise_mass()
    assert walk.mass == 1.0


def test_a_good_step_lowers_the_mass_to_a_fifth_and_at_last_to_nothing():
    walk = mass(mass=5.0)
    walk._lower_mass()
    assert walk.mass == 1.0
    for before, after in ((1.7e-8, 0.0), (1.9e-8, 3.8e-9)):
        walk = mass(mass=before)
        walk._lower_mass()
        assert walk.mass == pytest.approx(after, abs=0.0)


def test_a_relaxation_whose_mass_leads_nowhere_has_stalled_or_its_load_is_drowned():
    for largest in (0.9e7, 0.99e7):
        walk = mass(mass=largest)
        walk._raise_mass()
        assert walk.mass == 10.0 * largest
    with pytest.raises(NotConverged, match=r"stalled \(residual 5\.0e-01\)") as told:
        mass(mass=1.01e7)._raise_mass()
    assert not isinstance(told.value, Drowned)
    assert (told.value.state, told.value.iterations) == ("here", 7)
    stiff = SimpleNamespace(stiffest=lambda: np.array([5.0]))
    for residual, noise, hidden in ((0.009, 1e-3, True), (0.011, 1e-3, False), (0.009, 0.9e-6, False)):
        walk = mass(mass=1.01e7, residual=residual, _noise=lambda noise=noise: noise)
        walk.assembly.beams, walk.assembly.cables = [stiff], []
        with pytest.raises(NotConverged) as told:
            walk._raise_mass()
        assert isinstance(told.value, Drowned) == hidden
    with pytest.raises(NotConverged, match="stalled"):
        mass(mass=1.0, now=SimpleNamespace(tangent=np.array([np.nan, 1.0, 1.0])))._raise_mass()


def test_on_the_branch_a_tangent_that_is_not_definite_ends_it_and_elsewhere_mass_is_added():
    walk, tried = mass(mass_shape=np.array([1.0, 1.0, 0.25])), []

    def factor(values):
        tried.append(np.asarray(values).tolist())
        if len(tried) % 3:
            raise NotPositiveDefinite
        return "factor"

    walk.assembly.matrix.factor = factor
    walk.assembly.matrix.raised = lambda values, places, by: values + by
    with pytest.raises(LostBranch, match="smaller step") as told:
        walk._factor(np.zeros(3), True)
    assert (told.value.state, told.value.iterations, walk.factorisations) == ("here", 8, 8)
    tried.clear()
    assert walk._factor(np.zeros(3), False) == "factor"
    assert tried == [[0.0, 0.0, 0.0], pytest.approx([4e-7, 4e-7, 1e-7]), pytest.approx([4e-6, 4e-6, 1e-6])]
    assert walk.factorisations == 11


def test_the_parabola_s_minimum_is_a_share_of_the_step_that_was_tried():
    # p(s) = s² - 2 a s whose step was cut to `share` of one that promises `downhill` along the whole
    assert _minimum(0.25 - 0.2, 0.4, 0.5) == pytest.approx(0.4)  # at 0.2 of the whole
    assert _minimum(-0.2, 0.4, 0.5) == 0.5
