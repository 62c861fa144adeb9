"""Numbers of twice the digits, against exact fractions, and what is built from them."""

from dataclasses import replace
from fractions import Fraction

import mpmath
import numpy as np
import pytest
import scipy.sparse as sp

from shellform.reliability.branch import Branch
from shellform.structure.answers.analysis import analyse
from shellform.structure.elements import double_double
from shellform.structure.elements.beam import make_beams
from shellform.structure.elements.cable import make_cables
from shellform.structure.elements.state import at_rest, from_vectors, moved
from shellform.structure.elements.state import extended as with_tail
from shellform.structure.model import Model
from shellform.structure.network import assemble
from shellform.structure.solve import equilibrium
from shellform.structure.solve.drive import Drive
from shellform.structure.solve.equilibrium import find_equilibrium
from shellform.structure.solve.extended import (
    ExtendedSymmetric,
    _ExactChords,
    fit_for,
    with_twice_the_digits,
)
from shellform.structure.solve.factorisation import NotPositiveDefinite
from shellform.structure.solve.refined import RefinedFactor
from shellform.structure.solve.residual import ResidualNorm
from shellform.structure.solve.whole_steps import ON_THE_WAY
from shellform.verification.cables import hypar
from shellform.verification.models import CLAMP, chain, line, load_at
from tests.structure.test_solver import family, random_matrix

NODES = np.array([[0.0, 0.0, 0.0], [1.0, 0.2, 0.1]])


def exactly(number):
    return Fraction(number[0]) + Fraction(number[1])


@pytest.mark.parametrize(
    ("operation", "expected"),
    [
        (double_double.plus, lambda a, b: a + b),
        (double_double.minus, lambda a, b: a - b),
        (double_double.times, lambda a, b: a * b),
        (double_double.over, lambda a, b: a / b),
        (lambda a, b: double_double.root(double_double.times(b, b)), lambda a, b: abs(b)),
    ],
)
def test_thirty_digits_come_back(operation, expected):
    chance = np.random.default_rng(0)
    for _ in range(50):
        a, b = (double_double.two_sum(x, 1e-17 * y) for x, y in chance.normal(size=(2, 2)))
        wanted = expected(exactly(a), exactly(b))
        assert abs((exactly(operation(a, b)) - wanted) / wanted) < Fraction(1, 10**29)


def test_elements_are_those_of_double_precision_where_that_is_enough():
    chance = np.random.default_rng(1)
    state = from_vectors(NODES + 0.05 * chance.normal(size=(2, 3)), 0.3 * chance.normal(size=(2, 3)))
    for part in (
        make_beams(NODES, [[0, 1]], axial=50.0, torsion=2.0, bending_y=3.0, bending_z=5.0, z_axis=[[0.1, 0.2, 1.0]]),
        make_cables([[0, 1]], rest_length=0.9, stiffness=7.0),
        make_cables([[0, 1]], rest_length=1.9, stiffness=7.0),
    ):  # fmt: skip
        plain, precise = (
            part.evaluate(state, tangent=True),
            part.evaluate_extended(with_tail(state), tangent=True),
        )
        np.testing.assert_allclose(precise.force, plain.force, atol=1e-13)
        np.testing.assert_allclose(precise.tangent[:, :, 0], plain.tangent, atol=1e-13)
        np.testing.assert_allclose(precise.energy, plain.energy, rtol=1e-13)


def test_a_stiff_rod_turned_as_a_whole_feels_what_thirty_digits_leave():
    state, steps = with_tail(from_vectors(NODES, np.zeros((2, 3)))), np.zeros((2, 6))
    rod = make_beams(NODES, [[0, 1]], axial=1e16, torsion=1e16, bending_y=1e16, bending_z=1e16)
    before = rod.local_forces(state)
    for turn in ([0.3, -0.2, 0.1], [0.05, 0.1, 0.4]):
        steps[:, 3:] = turn
        there = moved(with_tail(from_vectors(np.zeros((1, 3)), np.zeros((1, 3)))), steps[:1])
        # The chord turns by the same rotation, column by column with all digits.
        chord = np.zeros((3, 2))
        double_double._triad(there.quaternions[0], there.tail[0], np.eye(3), axes := np.empty((3, 3, 2)))
        for i in range(3):
            total = (0.0, 0.0)
            for j in range(3):
                part = double_double.times(
                    (axes[j, i, 0], axes[j, i, 1]), (state.positions[1, j], state.tail[1, j])
                )
                total = double_double.plus(total, part)
            chord[i] = total
        state = moved(state, steps)
        positions, tail = state.positions.copy(), state.tail.copy()
        positions[1], tail[1, :3] = chord.T
        state = type(state)(positions, state.quaternions, tail)
    np.testing.assert_allclose(rod.local_forces(state), before, atol=1e-9)


def test_the_factor_solves_counts_and_refuses_as_the_ordinary_ones_do():
    right = np.arange(60.0).reshape(30, 2)
    for shift in (30.0, 0.0):
        whole = random_matrix(shift)
        plain, values = family(whole)
        matrix, both = ExtendedSymmetric(plain), np.column_stack([values, 0.0 * values])
        factor = matrix.factor_indefinite(both)
        np.testing.assert_allclose(factor.solve(right), np.linalg.solve(whole, right), rtol=1e-11)
        assert factor.negative == (np.linalg.eigvalsh(whole) < 0.0).sum()
        assert matrix.newton(both, right[:, 0])[1] == (factor.negative == 0)
    with pytest.raises(NotPositiveDefinite):
        matrix.factor(both)


def test_a_solution_has_all_its_digits_where_only_the_leading_ones_are_factorised():
    rng = np.random.default_rng(3)
    whole = random_matrix(30.0)
    plain, values = family(whole)
    tail = 1e-17 * values * rng.standard_normal(len(values))
    both = np.column_stack([values, tail])
    factor = ExtendedSymmetric(plain).factor(both)
    assert isinstance(factor, RefinedFactor)
    right = rng.standard_normal((30, 2))
    lower = sp.csc_array((values, plain.indices, plain.indptr), shape=whole.shape).toarray()
    small = sp.csc_array((tail, plain.indices, plain.indptr), shape=whole.shape).toarray()
    with mpmath.workdps(60):
        exact = mpmath.matrix(np.tril(lower, -1).T + lower) + mpmath.matrix(np.tril(small, -1).T + small)
        for column in right.T:
            solution = [float(each) for each in mpmath.lu_solve(exact, mpmath.matrix(column))]
            np.testing.assert_allclose(factor.solve(column), solution, rtol=4e-16, atol=1e-18)
        np.testing.assert_allclose(factor.solve(right)[:, 1], solution, rtol=4e-16, atol=1e-18)


def test_a_matrix_that_only_its_last_digits_make_indefinite_is_not_told_to_be_definite():
    below = np.nextafter(1.0, 0.0)
    plain, values = family(np.array([[1.0, below], [below, 1.0]]))
    matrix = ExtendedSymmetric(plain)
    both = np.column_stack([values, [0.0, 1.0 - below + 1e-20, 0.0]])
    plain.factor(values)  # the leading digits are definite
    assert matrix.factor_indefinite(both).negative == 1
    with pytest.raises(NotPositiveDefinite):
        matrix.factor(both)


def test_a_large_net_under_a_small_load_is_factorised_by_its_leading_digits():
    network, shape, load = stressed_net()
    assembly = with_twice_the_digits(assemble(network))
    found = find_equilibrium(assembly, at_rest(shape), load)
    assert isinstance(assembly.matrix.factor(assembly.evaluate(found.state).tangent), RefinedFactor)


def test_a_nearly_singular_matrix_keeps_its_small_eigenvalue():
    stiff = 1e20  # beside which 1 is lost in double precision
    plain, values = family(np.array([[stiff, -stiff], [-stiff, stiff]]))
    matrix = ExtendedSymmetric(plain)
    both = matrix.raised(np.column_stack([values, 0.0 * values]), np.array([2]), np.array([1.0]))
    np.testing.assert_allclose(matrix.factor(both).solve(np.array([0.0, 1.0])), [1.0, 1.0], rtol=1e-9)


def stressed_net():
    """A saddle net under 50 N/m of its own, 7,000 times what loads it."""
    network, shape = hypar()
    load = np.zeros((len(shape), 6))
    load[~network.fixed[:, 2], 2] = -0.01
    return network, shape, load


def left_over(assembly, state, load):
    force = assembly.evaluate(state, tangent=False).force
    return np.abs((load - force).ravel()[assembly.free]).max() / np.abs(load).max()


@pytest.mark.parametrize("way", ["relaxation", "newton", "path", "dynamic"])
def test_what_a_stressed_net_leaves_over_is_at_most_1e_6_of_a_small_load(way):
    network, shape, load = stressed_net()
    found = analyse(Model(network, {"down": load}, at_rest(shape), ()), method=way)
    assert found.converged
    assembly = fit_for(assemble(network), found.equilibrium.state)
    assert left_over(assembly, found.equilibrium.state, load) <= 1e-6


def test_a_net_without_load_is_measured_by_its_own_forces():
    network, shape, load = stressed_net()
    measure = ResidualNorm(assemble(network))
    balance = assemble(network).evaluate(at_rest(shape))
    assert measure.most(balance, 0.0 * load, 1e-8) == 1e-5
    assert measure.most(balance, load, 1e-8) == pytest.approx(1e-6 * 0.01 / balance.largest)


def test_a_branch_never_takes_for_none_more_than_states_on_the_way_may_leave():
    rod = chain(line(20), (1e6, 0.8, 1.0, 1.0), {0: CLAMP})
    half = np.where(np.arange(20) < 10, 1.0, 1e10)  # as stiff again
    names = ("axial", "torsion", "bending_y", "bending_z")
    beams = replace(rod.beams, **{name: half * getattr(rod.beams, name) for name in names})
    load = load_at(rod, 20, [0.0, 0.0, -2.0])
    branch = Branch(assemble(replace(rod, beams=beams)), load, 1.0)
    found = branch.newton(at_rest(rod.nodes), load, limit=50, tolerance=1e-8)
    assert found is None or branch.measure.residual(found.balance, load) <= ON_THE_WAY


def test_where_rounding_may_hide_the_load_only_the_relaxation_finds_out_whether_it_does(monkeypatch):
    rod = chain(line(20), (1e6, 0.8, 1.0, 1.0), {0: CLAMP})
    load = load_at(rod, 20, [0.0, 0.0, -0.01])
    assembly, start = assemble(rod), at_rest(rod.nodes)
    measure, balance = ResidualNorm(assembly), assembly.evaluate(start)
    assert 2.0 < measure.rounding(balance, start, load) / measure.most(balance, load, 1e-8) < 10.0
    taken = []

    def counted(given):
        taken.append(given)
        return with_twice_the_digits(given)

    monkeypatch.setattr(equilibrium, "with_twice_the_digits", counted)
    relaxed = equilibrium.find_equilibrium(assembly, start, load)
    assert not taken
    plain = equilibrium.newton(assembly, start, load)  # which couldn't tell a step that stagnates
    assert len(taken) == 1
    np.testing.assert_allclose(relaxed.state.positions, plain.state.positions, atol=1e-9)


def test_twice_the_digits_are_the_same_after_steps_in_double_precision():
    rod = chain(line(20), (1e6, 0.8, 1.0, 1.0), {0: CLAMP})
    half = np.where(np.arange(20) < 10, 1.0, 1e10)
    names = ("axial", "torsion", "bending_y", "bending_z")
    beams = replace(rod.beams, **{name: half * getattr(rod.beams, name) for name in names})
    load = load_at(rod, 20, [0.0, 0.0, -2.0])
    fresh, used = (assemble(replace(rod, beams=beams)) for _ in range(2))
    start = at_rest(rod.nodes)
    used.chords.corrected(
        start, np.zeros((21, 6))
    )  # whose correction of steps leaves stiff elements their last bit
    first, second = (equilibrium.find_equilibrium(each, start, load) for each in (fresh, used))
    np.testing.assert_array_equal(second.state.positions, first.state.positions)
    assert second.factorisations == first.factorisations


def test_loads_that_cancel_to_their_last_digit_are_none():
    weight = np.zeros((2, 6))
    weight[:, 2] = [-0.1, -0.3]
    assert (Drive(-weight * (1.0 + 2e-16), 0.0 * weight, weight).at(1.0) == 0.0).all()
    assert (Drive(-weight * (1.0 + 1e-12), 0.0 * weight, weight).at(1.0)[:, 2] != 0.0).all()


@pytest.mark.parametrize("angle", [1e-4, 9e-3, 0.02, 0.7, 2.5])
def test_a_chord_s_correction_leads_it_along_the_arc_that_its_step_turns_it_by(angle):
    """A step of s along the chord and of l t across it is meant as a turn by t and a stretch by s."""
    along, stretch, turned = np.array([0.6, 0.0, 0.8]), 0.3, np.array([0.0, 1.0, 0.0])
    length = 2.0
    chord, change = length * along, stretch * along + length * angle * turned
    end = (length + stretch) * (np.cos(angle) * along + np.sin(angle) * turned)
    gap = _ExactChords._gap(chord[None], change[None])[0]
    assert chord + change + gap == pytest.approx(end, abs=1e-14)
