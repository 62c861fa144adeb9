"""Steps keep limits on cable forces under loads beside the design load."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import shellform as sf
from shellform.optimiser import proposal
from shellform.optimiser.further_forces import further_forces
from shellform.optimiser.optimise import begin
from shellform.optimiser.proposal import propose
from shellform.optimiser.solver import SequentialConvex
from shellform.optimiser.trials import attempt, task
from shellform.problem.engineering import LargestCableForce
from tests.problems import misfit_and_force

ROOM = 1.1  # times what pulls most at the start


@pytest.fixture(scope="module")
def started(dome):
    problem = misfit_and_force(dome, 2.0, most=200.0)
    _, it = begin(problem, dome.design(), SequentialConvex(), lambda softest: 0.0, 10)
    ties = dome.cables(it.point.design)
    most = ROOM * float(ties.tension(it.point.states["wetter"]).max())
    limits = [*problem.constraints, sf.AtMost(most, LargestCableForce("wetter", most))]
    solver = SequentialConvex(window=20.0)
    return begin(replace(problem, constraints=limits), dome.design(), solver, lambda softest: 0.0, 10)


def test_what_cables_pull_more_is_the_stiffness_times_the_strain_between_the_loads(started, dome):
    search, it = started
    model = search.models.at(it.point)
    (limit,) = further_forces(model)
    design = it.point.design
    (base, further) = (
        187.0
        * (dome.cables(design).lengths(it.point.states[load]) / design.rest_length[design.present] - 1.0)
        for load in ("wet", "wetter")
    )
    np.testing.assert_allclose(limit.more, further - base, atol=1e-9)
    assert limit.more.max() > 0.0
    measured = it.point.measurements[-1].value[0]
    assert limit.term.of(base + limit.more) == pytest.approx(measured, rel=1e-9)
    assert limit.beyond(base) == pytest.approx(measured - 0.997 * limit.most, abs=1e-9)
    np.testing.assert_allclose(limit.upper(0.5) + limit.more, limit.most - 0.5)


def test_where_tensions_are_not_varied_there_is_nothing_to_bound(started):
    search, it = started
    assert further_forces(replace(search.models.at(it.point), tensions=0)) == []


def test_a_wide_step_keeps_the_limit_under_another_load_whatever_cables_come_to_it(started, monkeypatch):
    search, it = started
    model = search.models.at(it.point)
    (limit,) = further_forces(model)
    count = model.tensions
    y, _ = propose(task(search, it, model))
    assert limit.beyond(y[:count]) < 1e-3 * limit.most
    trial, _ = attempt(search, it, model, y)
    monkeypatch.setattr(proposal, "further_forces", lambda _: [])
    unbounded, _ = propose(task(search, it, model))
    assert limit.beyond(unbounded[:count]) > 0.02 * limit.most
    without, _ = attempt(search, it, model, unbounded)
    before, after = (each.constraints[-1] for each in (without, trial))
    assert before > 0.02
    assert after < 0.2 * before


def test_cables_that_went_do_not_come_back_in_a_step_that_revives_none(started):
    search, it = started
    model = search.models.at(it.point)
    pulling = np.arange(model.tensions) % 3 > 0
    asked = task(search, replace(it, tensioned=pulling), model)
    assert asked.reviving
    y, _ = propose(asked)
    assert (y[: model.tensions][~pulling] > 0.0).any()
    gone, _ = propose(replace(asked, reviving=False, window=1e3 * search.tension))
    np.testing.assert_array_equal(gone[: model.tensions][~pulling], 0.0)
    assert (gone[: model.tensions][pulling] > 0.0).all()


def test_cables_keep_what_they_have_where_rising_to_their_least_tension_costs_more_than_it_is_worth(started):
    search, it = started
    model = search.models.at(it.point)
    count = model.tensions
    asked = replace(task(search, it, model), tensioned=np.ones(count, dtype=bool))
    low = model.origin[:count].min()
    y, change = propose(replace(asked, least=1.1 * low))
    assert change < 0.0
    assert y[:count].min() > 1.09 * low, "what is cheap is done"
    weak = replace(asked, least=20.0 * float(model.origin[:count].max()))
    lifted, dear = proposal._optimum(weak)
    assert (lifted[:count] > model.origin[:count]).all()
    assert dear > proposal._LIFTED
    y, change = propose(weak)
    assert change <= 0.0
    assert (y[:count] >= model.origin[:count] - 1e-9 * search.tension).all()


def test_a_step_in_which_no_cable_has_to_rise_is_solved_for_once_whatever_it_costs(started, monkeypatch):
    search, it = started
    asked = task(search, it, search.models.at(it.point))
    pulling = np.ones(asked.model.tensions, dtype=bool)
    solved = []
    monkeypatch.setattr(proposal, "_optimum", lambda given: solved.append(given.lifting) or ("y", 1.0))
    assert propose(replace(asked, tensioned=pulling, least=0.0)) == ("y", 1.0)
    assert solved == [True]
    propose(replace(asked, tensioned=pulling, least=1e6))
    assert solved == [True, True, False]
    guard = replace(asked, tensioned=~pulling, least=2.0, guards=[SimpleNamespace(tension=np.array([1.0]))])
    propose(guard)
    assert solved == [True, True, False, True, False]
