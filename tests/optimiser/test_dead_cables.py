"""Cables without tension in the model that a search steps by, and what is read off them."""

from dataclasses import replace

import numpy as np
import pytest

import shellform as sf
from shellform.optimiser.optimise import begin
from shellform.optimiser.phases import _leaving, _without_slack
from shellform.optimiser.proposal import propose
from shellform.optimiser.thinning import kept_stiffness
from shellform.optimiser.trials import task
from shellform.problem.paths import in_tension, without_slack
from shellform.structure.elements.state import State
from tests.problems import misfit_and_force


@pytest.fixture(scope="module")
def dead(dome):
    """A search of the dome, and its iterate in a design whose every seventh cable is as long as may be."""
    problem = misfit_and_force(dome, 2.0, rms=None)
    search, it = begin(problem, dome.design(), sf.SequentialConvex(), lambda softest: 0.0, 10)
    rest = it.point.design.rest_length.copy()
    rest[::7] *= 1.1
    design = replace(it.point.design, rest_length=rest)
    point = search.evaluator.evaluate(design, it.point.states, 1.0)
    return search, replace(it, point=point), dome.point_load(2.0, every=2)


def test_dead_cables_stay_at_their_longest_and_taut_ones_as_they_are(dome, dead):
    search, it, _ = dead
    model = search.models.at(it.point)
    slack = dome.cables(it.point.design).tension(it.point.states["wet"]) <= 0.0
    np.testing.assert_array_equal(slack, np.arange(len(slack)) % 7 == 0)
    np.testing.assert_array_equal(model.origin[slack], 0.0)
    np.testing.assert_allclose(model.longest, 1.1 * dome.design().rest_length)
    np.testing.assert_allclose(model.design(model.origin).rest_length, it.point.design.rest_length)
    # the most that a cable may pull is what it would at its shortest
    length = dome.cables(it.point.design).lengths(it.point.states["wet"])
    np.testing.assert_allclose(model.upper, 187.0 * (length / 0.01 - 1.0))
    np.testing.assert_array_equal(model.lower, 0.0)
    # a tension below a millionth of the stiffness is none, one above it is
    y = model.origin.copy()
    taut = np.flatnonzero(~slack)[:2]
    y[taut] = np.array([0.9e-6, 1.1e-6]) * dome.cable.stiffness
    rest = model.design(y).rest_length[taut]
    assert rest[0] == model.longest[taut[0]]
    assert rest[1] < model.longest[taut[1]] - 1e-4


def test_rest_lengths_keep_their_bounds_where_the_linear_model_leads_beyond(dead):
    search, it, _ = dead
    model = search.models.at(it.point)
    pulled = np.arange(len(model.origin)) % 2 == 0
    y = np.where(pulled, 1e3, 1.0)  # N: lengths change by decimetres
    assert (model._rest_lengths(y) < 0.0).any()
    rest = model.design(y).rest_length[it.point.design.present]
    assert rest.min() == 0.01
    assert (rest <= model.longest).all()


def test_the_model_tells_what_a_dead_cable_s_first_tension_does_to_second_order(dome, dead):
    search, it, wet = dead
    model = search.models.at(it.point)
    chance = np.random.default_rng(4)
    change = np.where(model.origin > 0.3, 0.04 * chance.normal(size=len(model.origin)), 0.0)
    change[np.flatnonzero(model.origin == 0.0)[:4]] = [0.1, 0.05, 0.12, 0.08]
    errors = []
    for size in (1.0, 0.5):
        y = model.origin + size * change
        design = model.design(y)
        found = search.evaluator._settled(search.evaluator.assembly(design), model.predicted(y), wet).state
        errors.append(np.abs(dome.cables(design).tension(found) - y).max())
    assert errors[1] < 0.1 * np.abs(change).max()
    assert 1.7 < np.log2(errors[0] / errors[1]) < 2.3


def test_a_cable_counts_as_taut_beyond_a_millionth_of_its_length_and_absent_ones_never(dome):
    design, state = dome.design(), dome.target
    lengths = dome.cables(design).lengths(state)
    rest = lengths.copy()
    rest[0] /= 1.0 + 0.9e-6
    rest[1] /= 1.0 + 1.1e-6
    rest[2] *= 1.01
    rest[3:] /= 1.01
    present = np.ones(len(rest), dtype=bool)
    present[5] = False
    design = replace(design, rest_length=rest, present=present)
    taut = in_tension(dome, design, state)
    np.testing.assert_array_equal(taut[:7], [False, True, False, True, True, False, True])
    assert taut[7:].all()
    np.testing.assert_array_equal(without_slack(dome, design, state).present, taut)


def test_cables_that_are_slack_under_every_load_leave_the_search_once_they_are_a_fifth(dome, dead):
    search, it, _ = dead
    count = int(it.point.design.present.sum())
    marked = replace(it, tensioned=np.arange(count) % 2 == 0, needed=np.arange(count) % 3 == 0)
    assert _without_slack(search, marked) is marked, "a seventh is few"
    few = replace(search, solver=sf.SequentialConvex(idle=0.1))
    wide = it.point.states["wet"]
    wide = State(1.2 * wide.positions, wide.quaternions)  # pulls every cable
    other = replace(marked, point=replace(it.point, states={**it.point.states, "wetter": wide}))
    assert _without_slack(few, other) is other, "each pulls under one load or the other"
    found = _without_slack(few, marked)
    left = np.arange(count) % 7 != 0
    np.testing.assert_array_equal(found.point.design.present[it.point.design.present], left)
    np.testing.assert_array_equal(found.tensioned, marked.tensioned[left])
    np.testing.assert_array_equal(found.needed, marked.needed[left])
    assert len(found.accepted) == len(marked.accepted)
    assert found.accepted[-1].design is found.point.design


def test_thinning_takes_away_cables_that_pull_and_none_that_is_needed(dome, dead):
    search, it, _ = dead
    pull = dome.cables(it.point.design).tension(it.point.states["wet"])
    needed = np.arange(len(pull)) % 2 == 0
    leaving = _leaving(search, replace(it, needed=needed, batch=12), search.models.at(it.point))
    assert len(leaving) == 12
    assert (pull[leaving] > 0.0).all()
    assert not needed[leaving].any()


def test_no_cable_that_goes_first_pulls_more_and_holds_the_shell_more_than_another(dome, dead):
    search, it, _ = dead
    state, ties = it.point.states["wet"], dome.cables(it.point.design)
    pull, model = ties.tension(state), search.models.at(it.point)
    loss = 1.0 - np.diag(kept_stiffness(model.assembly, state, ties))  # of stiffness along it, without it
    none = np.zeros(len(pull), dtype=bool)
    first = _leaving(search, replace(it, needed=none, batch=1), model)[0]
    assert not ((pull > 0.0) & (pull < pull[first]) & (loss < loss[first])).any()
    assert loss[first] < np.median(loss[pull > 0.0])


def test_a_step_leaves_cables_that_must_pull_the_least_they_may_and_empties_others(dead):
    search, it, _ = dead
    model = search.models.at(it.point)
    taut = model.origin > 0.3
    must = taut & (np.arange(len(taut)) % 2 == 0)
    asked = task(search, replace(it, tensioned=must, window=2.0 * search.tension), model)
    least = 0.05 * float(np.median(model.origin[taut]))
    y, _ = propose(replace(asked, least=least))
    assert (y[must] >= least * (1.0 - 1e-6)).all()
    assert (y[must] <= least * (1.0 + 1e-3)).any(), "some would go lower"
    assert (y[taut & ~must] < 0.1 * least).any()
