"""A search handed out and taken up again: every number, array and state comes back."""

import json
from dataclasses import fields, replace
from types import SimpleNamespace

import numpy as np
import pytest

import shellform as sf
from shellform.gridshell.gridshell import Design
from shellform.optimiser import resuming
from shellform.optimiser.optimum import Checkpoint, Step
from shellform.optimiser.search_state import Accepted, Iterate, Search
from shellform.problem.evaluation import COUNTS
from shellform.reliability.resting import Resting
from shellform.reliability.scenarios import FactorsAsBuilt, Scenario
from shellform.structure.elements.state import State, at_rest, from_vectors

PLACES = np.array([[0.0, 0.0, 0.0], [1.0, 0.5, 0.25]])


def design_of(*rest, present=(True, False, True), radius=0.1):
    return Design(np.array(rest), np.array(present), radius)


def mind_of(least):
    case = sf.LoadCase("wet", np.zeros((2, 6)))
    return FactorsAsBuilt(case, tuple(Scenario(k, None, factor) for k, factor in least.items()), None, 1.0)


@pytest.fixture
def search(monkeypatch):
    """A search whose points are told, and what it kept in mind and hands out."""
    problem = SimpleNamespace(used=lambda: ["wet", "wetter"])
    evaluator = SimpleNamespace(
        problem=None,
        seed=lambda design, states, stage: SimpleNamespace(design=design, states=states, stage=stage),
        **{name: 10 * k + 1 for k, name in enumerate(COUNTS)},
    )
    told = SimpleNamespace(kept=[], minds=[], aimed=[])

    def kept_in_mind(search, design, least, most):
        told.minds.append((design, least, most))
        return mind_of(least)

    def aimed(inner, stiffness, mind):
        told.aimed.append((inner, stiffness, mind))
        return problem

    monkeypatch.setattr(resuming, "kept_in_mind", kept_in_mind)
    monkeypatch.setattr(resuming, "aimed", aimed)
    given = {each.name: None for each in fields(Search)}
    given |= {"evaluator": evaluator, "keep": told.kept.append, "inner": "inner", "began": 100.0}
    return Search(**given), told


def iterate(**changes):
    rest, tail = at_rest(PLACES), np.full((2, 7), 1e-20)
    states = {"wet": rest, "wetter": State(rest.positions + 0.5, rest.quaternions, tail)}
    point = SimpleNamespace(design=design_of(1.0, 2.0, 3.0), states=states)
    accepted = (
        Accepted(design_of(4.0, 5.0, 6.0, radius=0.2), np.array([True, False, False]), 0.03, 0.7),
        Accepted(
            design_of(7.0, 8.0, 9.0, present=(True, True, True), radius=0.3),
            np.array([True, True, False]),
            0.0,
            0.6,
        ),
    )
    numbers = {
        "stiffness": 0.7, "stage": 0.8, "window": 0.3, "margin": 0.1, "guarded": True, "climbing": True, "status": "so far",
        "phase": "agree", "refused": True, "before": 0.9, "thrifty": 0.5, "batch": 4, "failures": 2, "counted": 33,
        "paused": True, "fallen": (5, 2), "fell": True, "stood": 1, "led_to": 0.65, "until": 40, "begun": 2, "samples": 3,
    }  # fmt: skip
    arrays = {
        "tensioned": np.array([True, False]), "excess": np.array([0.5, 0.25]), "needed": np.array([False, True]),
    }  # fmt: skip
    history = (Step(1, 1.0, {}, {}, 3, 1.0, True, 2.0), Step(2, 0.9, {}, {}, 3, 1.0, True, 7.5))
    return Iterate(
        **{"point": point, "accepted": accepted, "history": history, **numbers, **arrays, **changes}
    )


def same(one, other):
    return (
        one.rest_length.tolist() == other.rest_length.tolist()
        and one.present.tolist() == other.present.tolist()
        and one.radius == other.radius
    )


@pytest.mark.parametrize("mind", [None, {8: 1.03, 3: 0.8}])
def test_where_a_search_stands_comes_back_with_all_that_it_knows(search, mind):
    search, told = search
    elsewhere = design_of(1.5, 2.5, 3.5, radius=0.4)
    turned = from_vectors(PLACES + 0.25, 0.1 * PLACES)
    rested = {"wetter": Resting(turned, {4: at_rest(PLACES), 100_002: at_rest(PLACES + 1.0)})}
    it = iterate(mind=mind and mind_of(mind), remembered=mind and elsewhere, rested=rested)
    resuming.tell(search, it)
    (checkpoint,) = told.kept
    numbers = json.loads(json.dumps(dict(checkpoint.numbers)))  # as a file gives them back
    for name in COUNTS:
        setattr(search.evaluator, name, 0)
    taken, found = resuming.resumed(search, Checkpoint(numbers, checkpoint.arrays, checkpoint.history))
    assert taken.began == 100.0 - 7.5, "seconds go on from those of the last step"
    assert {name: getattr(search.evaluator, name) for name in COUNTS} == {
        name: 10 * k + 1 for k, name in enumerate(COUNTS)
    }
    (load,) = found.rested
    assert (load, list(found.rested[load].drawn)) == ("wetter", [4, 100_002])
    for state, own in zip(
        (found.rested[load].perfect, *found.rested[load].drawn.values()),
        (turned, *rested[load].drawn.values()),
        strict=True,
    ):
        assert state.positions.tolist() == own.positions.tolist()
        assert state.quaternions.tolist() == own.quaternions.tolist()
    known = {each.name for each in fields(Iterate)} - {"point", "accepted", "mind", "remembered", "rested"}
    for name in known:
        assert np.array_equal(getattr(found, name), getattr(it, name)), name
    assert same(found.point.design, it.point.design)
    assert found.point.stage == 0.8
    for name, state in it.point.states.items():
        back = found.point.states[name]
        assert back.positions.tolist() == state.positions.tolist()
        assert back.quaternions.tolist() == state.quaternions.tolist()
        assert (back.tail is None) == (state.tail is None)
    assert found.point.states["wetter"].tail.tolist() == it.point.states["wetter"].tail.tolist()
    for one, other in zip(found.accepted, it.accepted, strict=True):
        assert same(one.design, other.design)
        assert (one.taut.tolist(), one.violation, one.objective) == (
            other.taut.tolist(),
            other.violation,
            other.objective,
        )
    ((inner, stiffness, own),) = told.aimed
    assert (inner, stiffness) == ("inner", 0.7)
    if mind is None:
        assert (found.mind, found.remembered, own, told.minds) == (None, None, None, [])
        return
    assert same(found.remembered, elsewhere)
    ((where, least, most),) = told.minds
    assert most == it.mind.most
    assert same(where, elsewhere)
    assert list(least.items()) == list(mind.items()), "in their order"
    assert found.mind == own


def test_a_search_that_nobody_keeps_hands_out_nothing(search):
    search, told = search
    resuming.tell(replace(search, keep=None), iterate())
    assert told.kept == []
