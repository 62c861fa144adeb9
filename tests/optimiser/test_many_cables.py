"""Steps of designs with thousands of cables: each answer by a solve of its own, curvature of few shapes."""

from dataclasses import replace

import numpy as np
import pytest

import shellform as sf
from shellform.gridshell.grouping import patches
from shellform.optimiser import quadratic
from shellform.optimiser.guards import SolvedGuard, solved_guard, whole_guard
from shellform.optimiser.optimise import begin
from shellform.optimiser.phases import _leaving
from shellform.optimiser.proposal import _let_fall, propose
from shellform.optimiser.quadratic import LowRank, _low_rank, minimise_quadratic
from shellform.optimiser.solved_answers import SolvedAnswers
from shellform.optimiser.step_model import step_model
from shellform.optimiser.thinning import evenly, kept_stiffness
from shellform.optimiser.trials import task
from shellform.structure.answers.sensitivity import element_columns
from shellform.structure.elements import threads
from shellform.structure.elements.eased_cables import EasedCables


@pytest.fixture(scope="module")
def shell(dome):
    """A small one."""
    return dome


def asked(shell, *, radius=False):
    wet = shell.point_load(2.0, every=2)
    shares = [sf.Share(0.5 if radius else 0.7, sf.Misfit("wet")), sf.Share(0.3, sf.CableForce("wet"))]
    shares += [sf.Share(0.2, sf.RodRadius())] if radius else []
    least = 0.8 * shell.rod.radius
    return sf.Problem(
        shell,
        sf.LoadCase("wet", wet),
        shares,
        [sf.AtMost(20.0, sf.CableForces("wet")), sf.AtMost(0.005, sf.RmsMisfit("wetter"))],
        [sf.LoadCase("wetter", 1.2 * wet)],
        [sf.RestLengths(), sf.FreeRadius(least, shell.rod.radius)] if radius else [sf.RestLengths()],
    )


def searched(shell, *, radius=False, many=0):
    solver = sf.SequentialConvex(many=many)
    return begin(asked(shell, radius=radius), shell.design(), solver, lambda softest: 0.08 * softest, 20)


@pytest.mark.parametrize("radius", [False, True])
def test_answers_by_solves_are_those_of_dense_matrices(shell, radius):
    search, it = searched(shell, radius=radius)
    point = search.evaluator.linearised(it.point)
    whole = step_model(search.evaluator, point, whole=True)
    solved = search.models.at(it.point)
    assert isinstance(solved.answers, SolvedAnswers)
    rng = np.random.default_rng(5)
    change = rng.normal(size=len(whole.origin)) * np.append(np.ones(whole.tensions), whole.step)
    rows = rng.normal(size=(3, whole.answers.parameters_by_y.shape[0]))
    for one, other in [
        (whole.answers.lengthened(change), solved.answers.lengthened(change)),
        (whole.answers.moved(change), solved.answers.moved(change)),
        (whole.answers.parameters_changed(change), solved.answers.parameters_changed(change)),
        (whole.answers.by_parameters(rows), solved.answers.by_parameters(rows)),
        (whole.constraints_by_y, solved.constraints_by_y),
        (whole.quadratics[0].slope, solved.quadratics[0].slope),
    ]:
        np.testing.assert_allclose(other, one, rtol=0.0, atol=1e-8 * np.abs(one).max())
    slope = point.objective_by_variables
    one, other = whole.answers.by_variables(slope), solved.answers.by_variables(slope)
    np.testing.assert_allclose(other, one, rtol=0.0, atol=1e-8 * np.abs(one).max())


def test_the_few_shapes_hold_the_curvature_and_are_never_above_it(shell):
    search, it = searched(shell)
    point = search.evaluator.linearised(it.point)
    whole = step_model(search.evaluator, point, whole=True).quadratics[0].hessian
    few = search.models.at(it.point).quadratics[0].hessian
    assert few.columns.shape[1] < len(whole) or len(whole) < 256
    left = np.linalg.eigvalsh(whole - few.columns @ few.columns.T) / np.linalg.eigvalsh(whole)[-1]
    assert left[0] > -1e-8
    assert left[-1] < 1e-4


@pytest.mark.parametrize("guarded", [False, True])
def test_a_step_by_solves_is_the_step_by_dense_matrices(shell, guarded):
    predicted = []
    for many in (0, 10**6):
        search, it = searched(shell, many=many)
        it = replace(it, guarded=guarded)
        predicted.append(propose(task(search, it, search.models.at(it.point)))[1])
    assert predicted[0] == pytest.approx(predicted[1], rel=1e-3)


def test_a_search_by_solves_ends_with_a_design_as_good(shell):
    """Before cables are taken away; after that fewer may be left for a little more of the objective."""
    for thin in (False, True):
        found = [
            sf.optimise(
                asked(shell),
                shell.design(),
                solver=sf.SequentialConvex(many=many, thin=thin),
                evaluations=20,
            )
            for many in (0, 10**6)
        ]
        for each in found:
            assert max(each.constraints.values()) <= sf.FEASIBLE
        fewer = found[0].design.present.sum() < found[1].design.present.sum()
        assert found[0].objective < (1.05 if fewer and thin else 1.02) * found[1].objective


def test_a_search_by_solves_needs_no_constraint(shell):
    """The design without loads has none."""
    problem = sf.Problem(
        shell,
        sf.LoadCase("none", 0.0 * shell.point_load(2.0)),
        [sf.Share(0.7, sf.Misfit("none")), sf.Share(0.3, sf.CableForce("none"))],
        [],
        [],
        [sf.RestLengths()],
    )
    found = [
        sf.optimise(problem, shell.design(), solver=sf.SequentialConvex(many=many), evaluations=10)
        for many in (0, 10**6)
    ]
    assert found[0].objective < 1.02 * found[1].objective < 0.9


def test_eased_cables_have_the_stiffness_that_their_tensions_alone_give(shell):
    search, it = searched(shell)
    assembly, state = search.evaluator.assembly(it.point.design), it.point.states["wet"]
    cables = shell.cables(it.point.design)
    eased = assembly.with_parts([*assembly.beams, EasedCables(cables)])
    chord = state.positions[cables.ends[:, 1]] - state.positions[cables.ends[:, 0]]
    unit = chord / np.linalg.norm(chord, axis=1)[:, None]
    pull = element_columns(assembly, cables.dofs(), np.hstack([-unit, unit])).toarray()
    stiffness = np.where(cables.tension(state) > 0.0, cables.stiffness / cables.rest_length, 0.0)
    whole = assembly.matrix.full(assembly.evaluate(state).tangent).toarray()
    found = assembly.matrix.full(eased.evaluate(state).tangent).toarray()
    wanted = whole - (pull * stiffness) @ pull.T
    np.testing.assert_allclose(found, wanted, rtol=0.0, atol=1e-12 * np.abs(whole).max())
    one, other = cables.evaluate(state, tangent=False), EasedCables(cables).evaluate(state, tangent=False)
    np.testing.assert_array_equal(one.force, other.force)


@pytest.mark.parametrize("radius", [False, True])
def test_a_guard_by_solves_is_that_of_dense_matrices(shell, radius):
    search, it = searched(shell, radius=radius)
    design, state = it.point.design, it.point.states["wetter"]
    cables, rates = shell.cables(design), [shell.beams_by_radius(design.radius)] if radius else []
    reach = float(np.median(cables.tension(state)))
    assembly = search.evaluator.assembly(design)
    whole = whole_guard(assembly, state, cables, reach, *rates)
    solved = solved_guard(assembly, state, cables, reach, *rates)
    search.evaluator.linearised(it.point)  # factorises in the assembly, which the guard has to outlive
    np.testing.assert_array_equal(solved.tension, whole.tension)
    some = np.array([3, 0, len(whole.tension) - 1])
    np.testing.assert_allclose(solved.by_design(some), whole.by_design(some), rtol=1e-9, atol=1e-9)
    change = 1e-5 * np.random.default_rng(8).normal(size=len(cables.ends) + radius)
    np.testing.assert_allclose(solved.changed(change), whole.changed(change), rtol=1e-8)


def guarded_widely(shell):
    """What a step is asked for whose window lets cables fall that aren't guarded."""
    search, it = searched(shell)
    return task(search, replace(it, guarded=True, window=0.7 * search.tension), search.models.at(it.point))


def test_a_step_lets_none_of_the_guarded_cables_fall_and_solves_for_few_of_them(shell, monkeypatch):
    asked = guarded_widely(shell)
    solved = []
    by_design = SolvedGuard.by_design
    monkeypatch.setattr(
        SolvedGuard, "by_design", lambda held, some: solved.extend(some) or by_design(held, some)
    )
    y, _ = propose(asked)
    change = asked.model.answers.parameters_changed(y - asked.model.origin)
    without, _ = propose(replace(asked, guards=[]))
    free = asked.model.answers.parameters_changed(without - asked.model.origin)
    (held,) = asked.guards
    low = held.tension < asked.least
    assert (held.tension + held.changed(free))[~low].min() < 0.9 * asked.least  # or there is nothing to guard
    assert (held.tension + held.changed(change))[~low].min() > 0.99 * asked.least
    assert 0 < len(solved) < len(held.tension)
    assert len(set(solved)) == len(solved)


def test_no_more_cables_are_guarded_than_asked_for_those_that_fall_farthest(shell):
    asked = guarded_widely(shell)
    (held,) = asked.guards
    without, _ = propose(replace(asked, guards=[]))
    change = asked.model.answers.parameters_changed(without - asked.model.origin)
    every = _let_fall(asked, held, np.zeros(0, dtype=int), change)
    assert len(every) > 2
    two = replace(asked, solver=replace(asked.solver, guards=2))
    np.testing.assert_array_equal(_let_fall(two, held, np.zeros(0, dtype=int), change), every[:2])
    np.testing.assert_array_equal(_let_fall(two, held, every[:1], change), every[1:2])
    assert not len(_let_fall(two, held, every[:2], change))


def test_what_cables_keep_of_the_stiffness_is_the_same_of_some(shell):
    search, it = searched(shell)
    assembly = search.evaluator.assembly(it.point.design)
    cables, state = shell.cables(it.point.design), it.point.states["wetter"]
    some = np.array([1, 4, 9])
    whole = kept_stiffness(assembly, state, cables)
    np.testing.assert_allclose(
        kept_stiffness(assembly, state, cables, some), whole[np.ix_(some, some)], rtol=1e-9
    )


def test_of_thousands_of_cables_each_patch_gives_of_those_that_pull_least_in_it(shell):
    search, it = searched(shell)
    it = replace(it, batch=6, needed=np.zeros(len(it.tensioned), dtype=bool))
    search = replace(search, solver=replace(search.solver, candidates=6, kept=0.0))
    model = search.models.at(it.point)
    leaving = _leaving(search, it, model)
    pull = model.origin[: model.tensions]
    patch = patches(shell)[it.point.design.present]
    assert len(leaving) == 6
    order = evenly(pull, pull, patch)
    assert sorted(leaving) == sorted(order[pull[order] > 0.0][:6])


def test_patches_are_of_one_diagonal_in_four_by_four_cells(shell):
    patch = patches(shell)
    way = np.diff(shell.net.grid.flat[shell.cable_ends], axis=1)[:, 0]
    middle = shell.target.positions[shell.cable_ends].mean(axis=1)
    for number in np.unique(patch):
        own = patch == number
        assert own.sum() <= 16
        along = way[own] / np.linalg.norm(way[own], axis=1)[:, None]
        assert np.abs(along @ along.T).min() > 0.7, "the other diagonal lies across"
        assert np.ptp(middle[own], axis=0).max() < 4.0 * np.sqrt(2.0) * shell.net.spacing
    assert np.bincount(patch).max() > 4


def test_of_cables_used_alike_patches_give_alike_and_more_where_they_are_used_less():
    patch, alike = np.repeat([3, 8, 1], 4), np.full(12, 1.0 / 12.0)
    order = evenly(alike, alike, patch)
    for turn in range(4):
        assert sorted(patch[order[3 * turn : 3 * turn + 3]]) == [1, 3, 8]
    less = np.where(patch == 8, 0.02, 0.1)
    assert patch[evenly(less, less, patch)[:4]].tolist() == [8] * 4
    none = np.zeros(0)
    assert evenly(none, none, np.zeros(0, dtype=int)).tolist() == [], "where all are needed"


def test_a_problem_with_curvature_of_few_columns_is_solved_as_the_dense_one():
    rng = np.random.default_rng(2)
    columns = LowRank(rng.normal(size=(40, 6)))
    slope, rows, values = rng.normal(size=40), rng.normal(size=(7, 40)), -rng.uniform(0.1, 1.0, 7)
    box = -np.ones(40), np.ones(40)
    one = minimise_quadratic(columns, slope, rows, values, *box)
    other = minimise_quadratic(columns.columns @ columns.columns.T, slope, rows, values, *box)

    def objective(u):
        return slope @ u + 0.5 * u @ (columns @ u)

    assert objective(one) == pytest.approx(objective(other), rel=1e-6)
    assert (values + rows @ one).max() < 1e-6
    wider = columns.widened(2)
    np.testing.assert_array_equal((wider @ np.ones(42))[-2:], 0.0)


@pytest.mark.parametrize("few", [True, False])
def test_variables_with_one_value_between_their_bounds_leave_the_others_as_they_would_be(few):
    rng = np.random.default_rng(6)
    columns, slope = LowRank(rng.normal(size=(30, 6))), rng.normal(size=30)
    rows, values = rng.normal(size=(3, 30)), -rng.uniform(0.5, 1.0, 3)
    low, high = -np.ones(30), np.ones(30)
    low[::3] = high[::3] = 0.25
    hessian = columns if few else columns.columns @ columns.columns.T
    found = minimise_quadratic(hessian, slope, rows, values, low, high)
    near = minimise_quadratic(hessian, slope, rows, values, low - 1e-7 * (low == high), high)
    np.testing.assert_array_equal(found[::3], 0.25)
    np.testing.assert_allclose(found, near, atol=1e-5)
    assert minimise_quadratic(hessian, slope, rows, np.full(3, 1e3), low, high) is None
    none = np.full(30, 1e-3)
    np.testing.assert_array_equal(minimise_quadratic(hessian, slope, rows, values, none, none), none)
    assert minimise_quadratic(hessian, slope, rows, np.full(3, 1e3), none, none) is None


def test_curvature_of_few_columns_under_constraints_that_contradict_each_other_has_no_solution():
    rows = np.array([[1.0, 0.0], [-1.0, 0.0]])
    few = LowRank(np.ones((2, 1)))
    assert minimise_quadratic(few, np.zeros(2), rows, np.full(2, 0.5), -np.ones(2), np.ones(2)) is None


def test_condensed_systems_are_solved_in_full_where_bounds_hardly_weigh():
    rng = np.random.default_rng(4)
    columns = rng.normal(size=(400, 100)) * np.logspace(3, -3, 100)
    rows, bounds, weights = rng.normal(size=(8, 400)), np.full(400, 1e-12), np.logspace(-6, 6, 8)
    product, condensed = _low_rank(LowRank(columns), rows)
    right = columns @ (columns.T @ rng.normal(size=400))
    found = condensed(bounds, weights)(right)
    left = right - (product(found) + bounds * found + rows.T @ (weights * (rows @ found)))
    assert np.abs(left).max() < 1e-12 * np.abs(right).max()  # 3e-6 by the formula alone


def test_thousands_of_variables_are_solved_for_in_parts_alike_on_any_number_of_cores(monkeypatch):
    rng = np.random.default_rng(5)
    columns, slope = LowRank(rng.normal(size=(900, 5)) / 30.0), rng.normal(size=900)
    rows, values = rng.normal(size=(4, 900)) / 30.0, -rng.uniform(0.1, 1.0, 4)
    asked = columns, slope, rows, values, -np.ones(900), np.ones(900)
    whole = minimise_quadratic(*asked)
    monkeypatch.setattr(quadratic, "_PART", 256)
    monkeypatch.setattr(threads, "cores", lambda: 1)
    one = minimise_quadratic(*asked)
    monkeypatch.setattr(threads, "cores", lambda: 3)
    np.testing.assert_array_equal(minimise_quadratic(*asked), one)
    np.testing.assert_allclose(one, whole, atol=1e-6)


def test_a_problem_in_parts_that_overflows_warns_of_nothing(monkeypatch, recwarn):
    monkeypatch.setattr(quadratic, "_PART", 1)
    monkeypatch.setattr(threads, "cores", lambda: 2)
    few, huge = LowRank(np.ones((2, 1))), np.full(2, 1e300)
    assert minimise_quadratic(few, huge, np.array([[1e300, 1e300]]), np.ones(1), -huge, huge) is None
    assert not recwarn.list
