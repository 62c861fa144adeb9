"""An optimisation that is broken off goes on from where it stood, to the same design."""

from dataclasses import fields, replace

import numpy as np
import pytest

import shellform as sf
from shellform.optimiser.optimise import begin
from shellform.optimiser.optimum import Step
from shellform.optimiser.resuming import resumed, tell
from shellform.optimiser.search_state import Accepted
from shellform.problem.evaluation import COUNTS
from shellform.structure.elements.state import extended, moved
from tests.problems import misfit_and_force


@pytest.fixture(scope="module")
def shell(dome):
    """A small one."""
    return dome


@pytest.fixture(scope="module")
def problem(shell):
    # the start doesn't bear 1.2 times the load: the search climbs first
    return misfit_and_force(shell, 5.4, most=9.0, rms=0.0015)


def told(history):
    return [
        (step.evaluation, step.objective, step.constraints, step.cables, step.stage, step.accepted)
        for step in history
    ]


def assert_resumed_alike(problem, start, kept, whole, **settings):
    again = sf.optimise(problem, start, resume=kept, **settings)
    np.testing.assert_array_equal(again.design.rest_length, whole.design.rest_length)
    np.testing.assert_array_equal(again.design.present, whole.design.present)
    assert told(again.history) == told(whole.history)
    assert (again.factorisations, again.evaluations, again.status) == (
        whole.factorisations,
        whole.evaluations,
        whole.status,
    )


def test_a_search_broken_off_in_any_phase_or_at_its_last_evaluation_ends_with_the_same_design_to_the_bit(
    shell, problem
):
    kept = []
    whole = sf.optimise(problem, shell.design(), evaluations=16, keep=kept.append)
    phases = [each.numbers["phase"] for each in kept]
    wary = next(k for k, each in enumerate(kept) if phases[k] == "descend" and each.arrays["excess"].any())
    for place in (phases.index("climb"), wary, len(kept) - 1):
        assert_resumed_alike(problem, shell.design(), kept[place], whole, evaluations=16)


def test_a_search_resumed_thinning_ends_with_the_same_design_and_history_to_the_bit(shell, problem):
    # One load without limits, and every step is too small an improvement: the search thins at once.
    least = sf.Problem(shell, problem.design_load, [sf.Share(1.0, sf.Misfit("wet"))])
    settings = {"solver": sf.SequentialConvex(window=1.0, settled=10.0), "evaluations": 7}
    kept = []
    whole = sf.optimise(least, shell.design(), keep=kept.append, **settings)
    thinning = [each for each in kept if each.numbers["phase"] == "thin"]
    assert len(thinning) > 1
    for place in (thinning[0], thinning[-1]):  # before the first batch, and with the memory of some
        assert_resumed_alike(least, shell.design(), place, whole, **settings)


def test_a_search_led_by_drawn_structures_and_resumed_ends_with_the_same_design_to_the_bit(shell):
    # More is asked of the perfect structure than stiffness leads to; the search descends no further than it
    # has to.
    problem = misfit_and_force(shell, 4.5, most=9.0, rms=None)
    settings = {
        "solver": sf.SequentialConvex(settled=10.0),
        "safety": sf.Safety(
            sf.Tolerances(supports=1e-4), critical_factor=1.9, drawn=2, tried=2, enlarged=1.0
        ),
        "evaluations": 12,
    }
    kept = []
    whole = sf.optimise(problem, shell.design(), keep=kept.append, **settings)
    phases = [each.numbers["phase"] for each in kept]
    for place in (phases.index("lead") + 1, len(kept) - 1):
        assert_resumed_alike(problem, shell.design(), kept[place], whole, **settings)


def test_a_search_resumed_with_states_of_twice_the_digits_has_all_of_them(shell, problem):
    kept = []
    search, it = begin(
        problem, shell.design(), sf.SequentialConvex(), lambda softest: softest, 1, keep=kept.append
    )
    step = np.full((shell.node_count, 6), 1e-17)
    states = {name: moved(extended(state), step) for name, state in it.point.states.items()}
    tell(search, replace(it, point=replace(it.point, states=states)))
    again = resumed(search, kept[-1])[1].point.states
    for name, state in states.items():
        assert state.tail.any()
        np.testing.assert_array_equal(again[name].tail, state.tail)


def test_a_checkpoint_holds_every_field_of_where_a_search_stands(shell, problem):
    kept = []
    search, it = begin(
        problem, shell.design(), sf.SequentialConvex(), lambda softest: softest, 1, keep=kept.append
    )
    count = len(shell.cable_ends)
    first, second = np.arange(count) % 2 == 0, np.arange(count) % 3 == 0
    thick = replace(it.point.design, radius=1.25 * it.point.design.radius, present=first)
    step = Step(7, 0.9, {"misfit": 0.8}, {"cable_force": -0.1}, 60, 0.75, True, 3.5, "descend")
    stood = replace(
        it,
        accepted=(Accepted(it.point.design, second, 0.125, 0.5), Accepted(thick, first, 0.25, 0.75)),
        history=(step,), stiffness=0.5 * search.softest, stage=0.75, window=0.375, margin=0.06, guarded=not it.guarded,
        tensioned=second, excess=it.excess + 2.0, climbing=not it.climbing, status="said", phase="thin", refused=True, idle=1,
        before=0.7, thrifty=0.3, batch=5, failures=2, needed=first, counted=90, paused=True, fallen=(3, 1), fell=True, stood=2, led_to=0.6, until=9, begun=4, samples=3,
    )  # fmt: skip
    fresh = {each.name: getattr(it, each.name) for each in fields(it)}
    for k, name in enumerate(COUNTS):
        setattr(search.evaluator, name, 10 + k)
    tell(search, stood)
    for name in COUNTS:
        setattr(search.evaluator, name, 0)
    again = resumed(search, kept[-1])[1]
    assert [getattr(search.evaluator, name) for name in COUNTS] == [10, 11, 12, 13, 14]
    for name in fresh.keys() - {"point", "accepted", "mind", "remembered", "rested"}:
        found, wanted = getattr(again, name), getattr(stood, name)
        assert not np.array_equal(wanted, fresh[name]), f"{name} would be right by chance"
        assert np.array_equal(found, wanted), name
    for found, wanted in zip(again.accepted, stood.accepted, strict=True):
        np.testing.assert_array_equal(found.design.rest_length, wanted.design.rest_length)
        np.testing.assert_array_equal(found.design.present, wanted.design.present)
        np.testing.assert_array_equal(found.taut, wanted.taut)
        assert (found.design.radius, found.violation) == (wanted.design.radius, wanted.violation)
