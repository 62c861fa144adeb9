"""Rotations, factorisation, equilibrium and loading."""

import gc
import threading
import weakref
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from scripts.gridshell_models import gridshell
from shellform.errors import InputError, NotConverged
from shellform.structure.elements import rotation
from shellform.structure.elements.beam import make_beams
from shellform.structure.elements.cable import make_cables
from shellform.structure.elements.state import at_rest
from shellform.structure.network import Network, assemble
from shellform.structure.solve import factorisation
from shellform.structure.solve.equilibrium import LostBranch, find_equilibrium, newton
from shellform.structure.solve.factorisation import NotPositiveDefinite, Symmetric, installed
from shellform.structure.solve.loading import apply_load
from shellform.structure.solve.residual import held
from shellform.verification.models import CLAMP, chain, line, load_at, no_cables

small = st.floats(-3.0, 3.0)


@settings(deadline=None)  # the first call compiles
@given(st.tuples(small, small, small).filter(lambda v: 1e-9 < np.linalg.norm(v) < 3.1))
def test_rotation_vectors_come_back_from_quaternions_and_matrices(vector):
    quaternion = rotation.from_vectors(np.array([vector]))
    np.testing.assert_allclose(rotation.to_vectors(quaternion)[0], vector, atol=1e-12)
    matrix = rotation.matrices(quaternion)
    np.testing.assert_allclose(matrix[0] @ matrix[0].T, np.eye(3), atol=1e-14)
    np.testing.assert_allclose(rotation.to_vectors(rotation.from_matrices(matrix))[0], vector, atol=1e-7)


def test_no_rotation_is_exactly_none_and_tiny_ones_lose_no_digit():
    assert (rotation.to_vectors(rotation.from_vectors(np.zeros((1, 3)))) == 0.0).all()
    tiny = np.array([[1e-200, 3e-12, -2e-30]])
    np.testing.assert_allclose(rotation.to_vectors(rotation.from_vectors(tiny)), tiny, rtol=1e-15)


def family(matrix):
    lower = sp.csc_array(sp.tril(sp.csc_array(matrix)))
    lower.sort_indices()
    return factorisation.Symmetric(lower.indptr.astype(np.int64), lower.indices.astype(np.int64)), lower.data


def random_matrix(shift):
    a = np.random.default_rng(0).normal(size=(30, 30))
    return a + a.T + shift * np.eye(30)


@pytest.mark.parametrize("backend", factorisation.installed())
def test_many_right_hand_sides_have_the_same_bits_on_one_core_and_on_two(backend, monkeypatch, shell):
    """PARDISO solves them in blocks, of all on one thread and of half as many on each of two."""
    monkeypatch.setenv("SHELLFORM_SOLVER", backend)
    assembly = assemble(shell.network(shell.design()))
    right = np.random.default_rng(3).normal(size=(len(assembly.free), 290))
    found = []
    for threads in ("1", "2"):
        monkeypatch.setenv("OMP_NUM_THREADS", threads)
        matrix = assembly.beside().matrix
        values = assembly.evaluate(shell.target).tangent
        values = matrix.raised(values, matrix.diagonal, 1.0)
        found.append(matrix.factor(values).solve(right))
    np.testing.assert_array_equal(found[0], found[1])


@pytest.mark.parametrize("backend", factorisation.installed())
def test_every_solver_solves_and_counts_negative_eigenvalues(backend, monkeypatch):
    monkeypatch.setenv("SHELLFORM_SOLVER", backend)
    definite, indefinite = random_matrix(30.0), random_matrix(0.0)
    symmetric, values = family(definite)
    right = np.arange(60.0).reshape(30, 2)
    np.testing.assert_allclose(
        symmetric.factor(values).solve(right), np.linalg.solve(definite, right), atol=1e-10
    )
    symmetric, values = family(indefinite)
    with pytest.raises(factorisation.NotPositiveDefinite):
        symmetric.factor(values)
    factor = symmetric.factor_indefinite(values)
    np.testing.assert_allclose(factor.solve(right), np.linalg.solve(indefinite, right), atol=1e-9)
    assert (
        factor.negative
        == symmetric.negative_eigenvalues(values)
        == (np.linalg.eigvalsh(indefinite) < 0).sum()
    )


@pytest.mark.parametrize("backend", factorisation.installed())
def test_every_solver_takes_a_matrix_without_rows(backend, monkeypatch):
    monkeypatch.setenv("SHELLFORM_SOLVER", backend)
    symmetric, values = family(np.zeros((0, 0)))
    assert symmetric.factor(values).solve(np.zeros(0)).shape == (0,)
    assert symmetric.negative_eigenvalues(values) == 0


def overtaken(monkeypatch, first, second):
    """What `first` returns where a second thread runs `second` between the setting of CHOLMOD's option and
    its use, unless a lock keeps it out.
    """
    real, inside, done = factorisation.cholmod, threading.Event(), threading.Event()
    other = threading.Thread(target=second)

    def symbolic(matrix):
        if threading.current_thread() is other:
            inside.set()  # the second has set the option to its own liking, and keeps it so
            done.wait(10.0)
        else:
            other.start()
            inside.wait(0.5)  # as long as a thread that is kept out is waited for
        return real.symbolic(matrix)

    stand_in = SimpleNamespace(**{**vars(real), "symbolic": symbolic})
    monkeypatch.setattr(factorisation, "cholmod", stand_in)
    try:
        return first()
    finally:
        done.set()
        other.join(10.0)


@pytest.mark.parametrize("backend", factorisation.installed())
@pytest.mark.parametrize("rods", [8, 16, 22])  # 3,456, 13,056 and 24,288 degrees of freedom
def test_one_entry_that_spoils_definiteness_is_seen_at_every_size(backend, rods, monkeypatch):
    """PARDISO's ways with blocks depend on the size, and one of them, faster than the others, tells
    nothing."""
    monkeypatch.setenv("SHELLFORM_SOLVER", backend)
    model = gridshell(rods)
    assembly = assemble(model.network)
    matrix = assembly.beside().matrix
    sound = held(assembly, assembly.evaluate(at_rest(model.network.nodes)))
    for place in np.random.default_rng(rods).choice(matrix.diagonal, 8 if backend == "superlu" else 40):
        spoilt = sound.copy()
        spoilt[place] *= -0.01
        with pytest.raises(NotPositiveDefinite):
            matrix.factor(spoilt)
    right = np.sin(np.arange(matrix.size))
    np.testing.assert_allclose(matrix.full(sound) @ matrix.factor(sound).solve(right), right, atol=1e-5)


@pytest.mark.parametrize("name", ["cholmod", "superlu"])
def test_mkl_stays_unloaded_where_another_solver_is_asked_for(name, monkeypatch):
    """Loaded, its functions take the place of those that cvxopt brings for its quadratic programs."""
    if name not in factorisation.installed():
        pytest.skip(f"{name} isn't installed")
    loaded = []
    monkeypatch.setattr(factorisation.pardiso, "library", lambda: loaded.append(name))
    monkeypatch.setenv("SHELLFORM_SOLVER", name)
    assert factorisation.backend() == name
    assert not loaded
    monkeypatch.delenv("SHELLFORM_SOLVER")
    factorisation.backend()
    assert loaded


@pytest.mark.skipif("cholmod" not in factorisation.installed(), reason="CHOLMOD isn't installed")
def test_an_indefinite_matrix_is_refused_though_another_thread_asks_for_pivots_meanwhile(monkeypatch):
    monkeypatch.setenv("SHELLFORM_SOLVER", "cholmod")
    (one, values), (two, others) = family(random_matrix(0.0)), family(random_matrix(30.0))
    with pytest.raises(factorisation.NotPositiveDefinite):
        overtaken(monkeypatch, lambda: one.factor(values), lambda: two.negative_eigenvalues(others))


@pytest.mark.skipif("cholmod" not in factorisation.installed(), reason="CHOLMOD isn't installed")
def test_pivots_are_counted_and_thin_factors_solve_though_another_thread_wants_blocks_meanwhile(monkeypatch):
    monkeypatch.setenv("SHELLFORM_SOLVER", "cholmod")
    whole = random_matrix(30.0)
    (one, values), (two, others) = family(whole), family(random_matrix(40.0))
    with monkeypatch.context() as patch:
        factor = overtaken(patch, lambda: one.factor_thin(values), lambda: two.factor(others))
    right = np.arange(30.0)
    np.testing.assert_allclose(factor.solve(right), np.linalg.solve(whole, right), atol=1e-10)
    one, values = family(random_matrix(0.0))
    _, untouched = overtaken(monkeypatch, lambda: one.newton(values, right), lambda: two.factor(others))
    assert not untouched


def test_a_factor_that_was_replaced_refuses_to_solve():
    symmetric, values = family(random_matrix(30.0))
    first = symmetric.factor(values)
    symmetric.factor(2.0 * values)
    with pytest.raises(RuntimeError, match="replaced"):
        first.solve(np.ones(30))


def test_a_solver_that_is_not_installed_is_refused_by_name(monkeypatch):
    monkeypatch.setenv("SHELLFORM_SOLVER", "abacus")
    with pytest.raises(InputError, match=r"SHELLFORM_SOLVER.*abacus"):
        family(random_matrix(30.0))


def shallow_toggle():
    points = np.vstack([np.linspace([-1, 0, 0], [0, 0, 0.1], 9), np.linspace([0, 0, 0.1], [1, 0, 0], 9)[1:]])
    pin = [True, True, True, True, False, True]
    network = chain(points, (1e4, 1.0, 0.2, 0.2), {0: pin, 16: pin})
    load = np.zeros((17, 6))
    load[8, 2] = -1.0
    return assemble(network), at_rest(points), load


def limit_factor(assembly, start, load):
    """The share of the load, up to twice it, that is borne on the stable branch."""
    return 2.0 * apply_load(assembly, start, 0 * load, 2.0 * load, step=0.0625, stay=True).share


def test_relaxation_follows_a_snap_through_to_a_stable_state():
    assembly, start, load = shallow_toggle()
    borne = limit_factor(assembly, start, load)
    assert 0.1 < borne < 2.0
    beyond = apply_load(assembly, start, 0 * load, 1.5 * borne * load)
    assert not beyond.on_branch
    assert beyond.equilibrium.stable
    assert beyond.equilibrium.residual < 1e-7
    assert beyond.equilibrium.state.positions[8, 2] < -0.05


def test_a_start_on_the_branch_is_given_up_when_definiteness_is_lost():
    assembly, start, load = shallow_toggle()
    borne = limit_factor(assembly, start, load)
    near = apply_load(assembly, start, 0 * load, 0.97 * borne * load).equilibrium.state
    with pytest.raises(LostBranch, match="smaller step"):
        find_equilibrium(assembly, near, 1.1 * borne * load, on_branch=True)


def test_running_out_of_factorisations_keeps_the_last_state():
    assembly, start, load = shallow_toggle()
    with pytest.raises(NotConverged, match="increments") as caught:
        find_equilibrium(assembly, start, 5.0 * load, limit=3)
    assert caught.value.state.positions.shape == (17, 3)


def test_a_loose_straight_rope_under_load_is_solved():
    points = np.column_stack([np.linspace(0, 1, 5), np.zeros((5, 2))])
    beams = make_beams(points, np.zeros((0, 2), dtype=int), axial=1, torsion=1, bending_y=1, bending_z=1)
    cables = make_cables([[k, k + 1] for k in range(4)], rest_length=0.26, stiffness=100.0)
    fixed = np.zeros((5, 6), dtype=bool)
    fixed[[0, 4], :3] = True
    load = np.zeros((5, 6))
    load[1:4, 2] = -1.0
    found = find_equilibrium(
        assemble(Network(points, beams, cables, fixed, np.zeros((5, 6)))), at_rest(points), load
    )
    assert found.residual < 1e-8
    assert found.state.positions[2, 2] < -0.05


def test_a_pinned_rod_may_spin_about_its_axis_and_still_counts_as_stable():
    points = np.column_stack([np.linspace(0, 1, 5), np.zeros((5, 2))])
    pin = [True, True, True, False, False, False]
    found = find_equilibrium(
        assemble(chain(points, (1e3, 1.0, 1.0, 1.0), {0: pin, 4: pin})), at_rest(points), np.zeros((5, 6))
    )
    assert found.stable


def test_what_nothing_restrains_is_refused_by_name():
    points = np.column_stack([np.linspace(0, 1, 3), np.zeros((3, 2))])
    with pytest.raises(InputError, match=r"nothing restrains.*along x"):
        assemble(chain(points, (1, 1, 1, 1), {}))
    lonely = np.vstack([points, [[5.0, 0.0, 0.0]]])
    network = chain(points, (1, 1, 1, 1), {0: [True] * 6})
    fixed = np.vstack([network.fixed, np.zeros((1, 6), dtype=bool)])
    with pytest.raises(InputError, match=r"nodes\[3\].*no element"):
        assemble(Network(lonely, network.beams, network.cables, fixed, np.zeros((4, 6))))


@pytest.mark.parametrize("library", [True, False])
def test_a_thin_factor_solves_as_the_whole_matrix_does_and_refuses_what_is_not_definite(library, monkeypatch):
    if not library:
        monkeypatch.delenv("SHELLFORM_SOLVER", raising=False)  # which may ask for it
        monkeypatch.setattr(factorisation, "cholmod", None)
    count = 40
    rng = np.random.default_rng(1)
    chain = sp.diags_array(
        [np.full(count, 2.1), -np.ones(count - 1)], offsets=[0, -1], shape=(count, count)
    ).tolil()
    chain[30, 3] = -0.05
    lower = sp.csc_array(chain)
    lower.sort_indices()
    symmetric = factorisation.Symmetric(lower.indptr.astype(np.int64), lower.indices.astype(np.int64))
    factor = symmetric.factor_thin(lower.data)
    right = rng.normal(size=(count, 3))
    symmetric.factor_thin(2.0 * lower.data)  # the first one still serves
    assert np.allclose(symmetric.full(lower.data) @ factor.solve(right), right, atol=1e-12)
    assert np.allclose(factor.solve(right[:, 0]), factor.solve(right)[:, 0], atol=1e-14)
    with pytest.raises(factorisation.NotPositiveDefinite):
        symmetric.factor_thin(np.where(lower.data > 1.0, 0.5, lower.data))


@pytest.mark.skipif("mkl" not in factorisation.installed(), reason="only PARDISO condenses")
def test_what_is_solved_on_kept_freedoms_is_the_whole_solution_there_and_needs_a_definite_matrix(monkeypatch):
    monkeypatch.setenv("SHELLFORM_SOLVER", "mkl")
    symmetric, values = family(random_matrix(30.0))
    kept = np.array([2, 5, 11])
    right = np.zeros((symmetric.size, 2))
    right[kept] = [[1.0, 0.0], [0.0, 2.0], [-1.0, 1.0]]
    whole = symmetric.factor(values)
    found = symmetric.solve_kept(values, kept, right[kept])
    assert np.allclose(found, whole.solve(right)[kept], rtol=1e-10)  # the factor still serves
    for broken in (
        -values,
        np.where(np.arange(len(values)) == symmetric.diagonal[5], -1e6, values),
    ):  # among the others, and on the kept
        with pytest.raises(factorisation.NotPositiveDefinite):
            symmetric.solve_kept(broken, kept, right[kept])


def half_stiff(ratio, elements=20):
    """A cantilever whose outer half is stiffer by a ratio, and a load of 2 across its tip."""
    points = line(elements)
    stiffness = np.where(np.arange(elements) < elements // 2, 1.0, ratio)
    ends = np.column_stack([np.arange(elements), np.arange(1, elements + 1)])
    beams = make_beams(
        points, ends, axial=1e6 * stiffness, torsion=stiffness, bending_y=stiffness, bending_z=stiffness
    )
    fixed = np.zeros((elements + 1, 6), dtype=bool)
    fixed[0] = CLAMP
    network = Network(points, beams, no_cables(), fixed, np.zeros((elements + 1, 6)))
    return network, load_at(network, elements, [0.0, 0.0, -2.0])


@pytest.mark.parametrize("find", [find_equilibrium, newton])
@pytest.mark.parametrize("ratio", [1e8, 1e12])
def test_a_part_far_stiffer_than_the_rest_moves_as_a_rigid_body(ratio, find):
    network, load = half_stiff(ratio)
    found = find(assemble(network), at_rest(network.nodes), load)
    # Between 1e6 and 1e8 it moves by 2e-7 only.
    assert found.state.positions[-1, 2] == pytest.approx(-0.46325, abs=1e-5)
    assert found.stable
    assert found.residual < 1e-8
    assert np.abs(network.beams.local_forces(found.state)[:, 0]).max() < 2.0


def test_a_rod_of_a_micrometre_between_two_of_a_metre_is_a_rigid_corner():
    def tip(short):
        corner = np.array([1.0, 0.0, 0.0])
        begin = corner + np.array([1.0, 0.0, -1.0]) * short * np.sqrt(0.5)
        points = np.vstack([np.linspace(0.0 * corner, corner, 5), np.linspace(begin, begin - [0, 0, 1.0], 5)])
        network = chain(points, (1e6, 1.0, 1.0, 1.0), {0: CLAMP})
        found = find_equilibrium(assemble(network), at_rest(points), load_at(network, 9, [1.0, 0.0, 0.0]))
        assert found.residual < 1e-8
        return found.state.positions[-1] - points[-1]

    np.testing.assert_allclose(tip(1e-6), tip(1e-3), atol=1e-3)
    assert tip(1e-6)[0] > 0.6


def test_what_rounding_hides_is_refused_and_the_elements_are_named():
    network, load = half_stiff(1.0)
    beams = replace(network.beams, axial=np.where(np.arange(20) == 7, 1e30, network.beams.axial))
    stiff = replace(network, beams=beams)
    turned = at_rest(network.nodes @ rotation.matrices(rotation.from_vectors(np.array([[0.1, 0.2, 0.3]])))[0])
    with pytest.raises(NotConverged, match=r"Rounding hides the load.*beams\[7\].*softer") as caught:
        find_equilibrium(assemble(stiff), turned, 1e-6 * load)
    assert caught.value.state is not None


@pytest.mark.parametrize("backend", factorisation.installed())
def test_the_factor_at_hand_serves_for_the_same_values_until_others_were_factorised(backend, monkeypatch):
    monkeypatch.setenv("SHELLFORM_SOLVER", backend)
    matrix, values = family(random_matrix(20.0))
    right = np.arange(30.0)
    factor = matrix.factor(values)
    assert matrix.factor(values.copy()) is factor
    np.testing.assert_allclose(random_matrix(20.0) @ factor.solve(right), right, atol=1e-9)
    twice = matrix.factor(2.0 * values)
    assert twice is not factor
    again = matrix.factor(values)
    assert again is not factor
    np.testing.assert_allclose(random_matrix(20.0) @ again.solve(right), right, atol=1e-9)
    matrix.factor_indefinite(values)
    np.testing.assert_allclose(random_matrix(20.0) @ matrix.factor(values).solve(right), right, atol=1e-9)
    with pytest.raises(factorisation.NotPositiveDefinite):
        matrix.factor(-values)
    np.testing.assert_allclose(random_matrix(20.0) @ matrix.factor(values).solve(right), right, atol=1e-9)


@pytest.mark.parametrize("name", installed())
def test_a_family_that_nobody_needs_is_let_go_of_at_once_with_its_factor(name, monkeypatch):
    """A circle of references would keep factors, half a gigabyte each of a large shell, until garbage is
    searched for."""
    monkeypatch.setenv("SHELLFORM_SOLVER", name)
    gc.disable()
    try:
        family = Symmetric(np.array([0, 2, 3]), np.array([0, 1, 1]))
        factor = family.factor(np.array([2.0, 1.0, 2.0]))
        gone = weakref.ref(family), weakref.ref(factor)
        del family, factor
        assert [each() for each in gone] == [None, None]
    finally:
        gc.enable()


def test_a_factor_serves_on_without_its_family():
    factor = Symmetric(np.array([0, 2, 3]), np.array([0, 1, 1])).factor(np.array([2.0, 1.0, 2.0]))
    np.testing.assert_allclose(factor.solve(np.array([3.0, 3.0])), 1.0)


@pytest.mark.parametrize(
    ("count", "size", "blocks"),
    [
        (300, 50_000, [slice(0, 256), slice(256, 300)]),
        (200, 131_072, [slice(0, 128), slice(128, 200)]),
        (65, 10_000_000, [slice(0, 64), slice(64, 65)]),
        (0, 50_000, []),
    ],
)
def test_the_longer_right_hand_sides_are_the_fewer_are_solved_for_at_once(count, size, blocks):
    assert list(factorisation.column_blocks(count, size)) == blocks
