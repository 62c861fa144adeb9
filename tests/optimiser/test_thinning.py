"""What thinning does where limits are broken or designs fall: steps, repairs, judgements."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import shellform as sf
from shellform.optimiser import phases, thinning, trials
from shellform.optimiser.descent import descend
from shellform.optimiser.optimise import begin
from shellform.optimiser.phases import _made_to_stand, _repaired, _thin
from shellform.optimiser.proposal import Asked, _as_far_as_can_be
from shellform.optimiser.search_state import restiffened, stiffness_of, violation
from shellform.optimiser.thinning import Budget, farthest
from shellform.reliability.requirements import Demand, Required
from shellform.reliability.trial_structures import JudgedTrial
from tests.problems import misfit_and_force

ASKED = sf.Safety(sf.Tolerances(cable_length=1e-4), critical_factor=None, tried=1)


def searched(stout, rms, *, stiffness=0.5, evaluations=6, asked=None):
    """A search that is ready to thin from all cables, the rods' radius free and the root mean square distance
    under more load limited to `rms`, m."""
    problem = misfit_and_force(stout, 4.5, rms=rms, variables=[sf.FreeRadius(most=0.0015)])
    search, it = begin(
        problem,
        stout.design(),
        sf.SequentialConvex(),
        lambda softest: stiffness * softest,
        evaluations,
        asked=asked,
    )
    return search, phases._ready_to_thin(search, it)


def demanded(loads):
    one = Required(ASKED, loads, "wet", dict.fromkeys(loads, 0))
    return Demand(one, one)


def told(stands):
    return JudgedTrial({"wet": () if stands else (0,)}, True, stands, 0)


def test_a_step_that_is_asked_for_more_than_it_can_give_gives_all_that_it_can():
    task = SimpleNamespace(solver=sf.SequentialConvex(), aims=0)
    # u in [-1, 1] falls by the objective; the constraint 1 - u / 2 <= 0 can come down to a half, and the
    # guard of the other variable, 0.3 - v <= 0, to nothing
    asked = Asked(
        np.eye(2),
        np.array([1.0, 1.0]),
        np.array([[-0.5, 0.0], [0.0, -1.0]]),
        np.array([1.0, 0.3]),
        -np.ones(2),
        np.ones(2),
    )
    u = _as_far_as_can_be(task, 1, asked)
    np.testing.assert_allclose(u, [1.0, 0.3], atol=1e-6)


def test_a_start_that_breaks_a_limit_is_thinned_and_breaks_it_no_more_than_before(stout):
    search, it = searched(stout, 2e-4)  # the start is off by several times that
    before = violation(search, it.point)
    assert before > 0.0
    thinned = _thin(search, replace(it, thrifty=np.inf))
    assert thinned.point.design.present.sum() <= it.point.design.present.sum()
    assert thinned.accepted[-1].taut.sum() < it.accepted[0].taut.sum()
    assert violation(search, thinned.point) <= before


def test_a_design_that_falls_is_made_stiffer_until_it_stands(stout, monkeypatch):
    wet = stout.point_load(4.5, every=2)
    search, it = searched(stout, 0.005, asked=demanded({"wet": wet}))
    before = stiffness_of(search, it.point)
    answers = iter([False, True])
    monkeypatch.setattr(trials, "judge_trial", lambda *_, **__: told(next(answers)))
    found, after = _made_to_stand(search, it, it.point, Budget())
    assert found is not None
    assert stiffness_of(search, found) > 1.01 * before
    assert after.stiffness > it.stiffness


def test_no_less_stiffness_is_aimed_for_than_the_solver_s_share_of_the_start_s(stout):
    search, it = searched(stout, 0.005, asked=demanded({"wet": stout.point_load(4.5, every=2)}))
    least = search.solver.stiffness * search.softest
    assert 0.0 < least < it.stiffness
    assert phases._aiming_for(search, it, 0.0).stiffness == pytest.approx(least)
    assert phases._aiming_for(search, it, 2.0 * it.stiffness).stiffness == pytest.approx(2.0 * it.stiffness)


def descended(stout, stiffness):
    """A search whose rods are as thin as the stiffness asked for allows, as good as a descent gets them."""
    wet = stout.point_load(4.5, every=2)
    search, it = searched(stout, 0.005, stiffness=stiffness, evaluations=60, asked=demanded({"wet": wet}))
    it = descend(replace(search, evaluations=40), replace(it, guarded=False))
    return search, phases._ready_to_thin(search, it)


def test_a_step_towards_more_stiffness_may_cost_what_the_next_one_gets_back(stout):
    search, it = descended(stout, 0.5)
    before = stiffness_of(search, it.point)
    stiffer = restiffened(search, replace(it, thrifty=0.0), 1.5 * before)
    found, _ = _repaired(search, stiffer, stiffer.point)
    assert found.objective > it.point.objective
    assert stiffness_of(search, found) > 1.1 * before


def test_a_design_that_stands_only_at_a_cost_beyond_the_budget_is_not_taken(stout, monkeypatch):
    search, it = descended(stout, 0.5)
    for budget, taken in ((it.point.objective, False), (np.inf, True)):
        answers = iter([False, True])
        monkeypatch.setattr(trials, "judge_trial", lambda *_, own=answers, **__: told(next(own)))
        assert (_made_to_stand(search, it, it.point, Budget(budget))[0] is not None) == taken


@pytest.mark.parametrize(("share", "farther"), [(None, True), (0.5, False), (1.05, False)])
def test_no_cable_goes_that_takes_the_shape_farther_off_than_it_may_be_or_is_already(stout, share, farther):
    search, it = searched(stout, 0.005, evaluations=24)
    before = farthest(search, it.point)
    most = None if share is None else share * before
    search = replace(search, solver=replace(search.solver, deviation=most, repairs=0))
    thinned = _thin(search, replace(it, thrifty=np.inf))
    assert thinned.accepted[-1].taut.sum() < it.accepted[0].taut.sum()
    after = farthest(search, thinned.point)
    assert (after > 1.05 * before) == farther
    assert farther or after <= max(most, before)


def test_thinning_ends_after_as_many_single_cables_in_a_row_as_it_may_fail_with(stout, monkeypatch):
    search, it = searched(stout, 0.01)
    tried = []

    def off_the_branch(search, it, model, leaving):
        tried.append(len(leaving))

    monkeypatch.setattr(phases, "attempt_without", off_the_branch)
    ended = _thin(search, it)
    assert "no further cable can be taken away" in ended.status
    assert tried[-search.solver.failures :] == [1] * search.solver.failures
    assert all(count > 1 for count in tried[: -search.solver.failures])
    assert np.count_nonzero(ended.needed) == search.solver.failures


def test_where_nothing_stands_the_stiffness_asked_for_is_as_before(stout, monkeypatch):
    wet = stout.point_load(4.5, every=2)
    search, it = searched(stout, 0.005, asked=demanded({"wet": wet}))
    monkeypatch.setattr(trials, "judge_trial", lambda *_, **__: told(False))
    found, after = _made_to_stand(search, it, it.point, Budget())
    assert found is None
    assert after.stiffness == it.stiffness
    np.testing.assert_array_equal(after.point.constraints, it.point.constraints)


def test_a_design_that_stands_may_have_less_stiffness_than_was_aimed_for(stout, monkeypatch):
    wet = stout.point_load(4.5, every=2)
    search, it = searched(stout, 0.005, stiffness=5.0, asked=demanded({"wet": wet}))
    assert violation(search, it.point) > 0.0
    monkeypatch.setattr(trials, "judge_trial", lambda *_, **__: told(True))
    found, after = _made_to_stand(search, it, it.point, Budget())
    assert found is not None
    assert violation(search, found) <= 0.0
    # the smooth least of several modes, whose sharpness goes with the stiffness asked for
    assert after.stiffness == pytest.approx(stiffness_of(search, found), rel=1e-4)
    without = replace(search, asked=None)
    found, _ = _made_to_stand(without, replace(it, point=it.point), it.point, Budget())
    assert found is not None  # no worse than it


@pytest.mark.parametrize(("share", "go"), [(None, True), (0.4, False)])
def test_stiff_strands_that_can_be_spared_go_though_each_holds_most_of_the_stiffness_along_it(
    stout, share, go
):
    strands = replace(stout, cable=sf.Cable(stiffness=100.0 * 187.0))
    search, it = searched(strands, 0.005, evaluations=24)
    if share is not None:
        search = replace(search, solver=replace(search.solver, kept=share))
    assert (len(phases._leaving(search, it, search.models.at(it.point))) > 0) == go


@pytest.mark.parametrize(
    ("objective", "far", "covered"),
    [(0.5, 0.01, True), (0.5, 0.0101, False), (0.501, 0.01, False), (0.501, 0.0101, False)],
)
def test_a_budget_covers_what_costs_no_more_of_the_objective_and_of_the_shape(
    monkeypatch, objective, far, covered
):
    trial = SimpleNamespace(objective=objective)
    monkeypatch.setattr(thinning, "farthest", lambda search, trial: far)
    assert Budget(0.5, 0.01).covers(None, trial) == covered
    assert Budget(0.5).covers(None, trial) == (objective <= 0.5)
    assert Budget(deviation=0.01).covers(None, trial) == (far <= 0.01)


def test_cables_may_take_the_shape_as_far_off_as_it_may_be_or_is_already(monkeypatch):
    monkeypatch.setattr(
        thinning, "deviations", lambda shell, state: {"rest": np.array([0.002, 0.006, 0.001])}[state]
    )
    it = SimpleNamespace(point=SimpleNamespace(states={"wet": "rest", "wetter": "farther"}))
    for most, goes in ((None, np.inf), (0.01, 0.01), (0.004, 0.006)):
        assert (
            thinning.allowed(
                SimpleNamespace(
                    solver=sf.SequentialConvex(deviation=most),
                    base="wet",
                    problem=SimpleNamespace(shell=None),
                ),
                it,
            )
            == goes
        )
