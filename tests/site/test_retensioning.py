"""Re-tensioning from surveys of an erected grid whose cables aren't as long as drawn."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from shellform.errors import InputError, NotConverged
from shellform.site import retensioning
from shellform.site.retensioning import Adjustment, Crew, adjust, first_belief, learn, replay
from shellform.site.turns import whole_turns
from shellform.structure.elements.state import State
from shellform.structure.network import assemble
from shellform.structure.solve.equilibrium import find_equilibrium

NOISE, ERROR = 0.15e-3, 1e-3


@pytest.fixture(scope="module")
def belief(shell):
    """The unloaded initial design as drawn."""
    design, none = shell.design(), np.zeros((shell.node_count, 6))
    state = find_equilibrium(assemble(shell.network(design)), shell.target, none).state
    return first_belief(design, state, none, length_error=ERROR)


@pytest.fixture(scope="module")
def errors(shell):
    return ERROR * np.random.default_rng(1).normal(size=len(shell.cable_ends))


@pytest.fixture(scope="module")
def upper(shell):
    return shell.net.grid.crossing_nodes[:, 1]


def test_surveys_and_turns_within_what_a_crew_can_do_remove_70_percent_of_the_misfit_of_random_length_errors(
    shell, belief, errors, upper
):
    crew = Crew(step=0.25e-3, largest=1.5e-3, cables=60)
    marks = upper[np.linspace(0, len(upper) - 1, 42).astype(int)]
    played = replay(
        shell, belief, errors, belief.state.positions, marks, crew, noise=NOISE, rounds=3, seed=0, slip=0.05
    )
    assert played.removed > 0.7
    assert all(each.cables <= 60 for each in played.adjustments)
    for each in played.adjustments:
        assert np.abs(each.change).max() <= 1.5e-3 * (1.0 + 1e-9)
        np.testing.assert_allclose(each.change, 0.25e-3 * each.turns, atol=1e-15)
        # Each step lowers what is believed, and the true equilibrium bears the first-order shape out.
        assert each.misfit_after < 0.2 * each.misfit_before
        shift = np.abs(each.predicted - each.belief.state.positions).max()
        assert shift < 0.3 * np.abs(each.change).max()
    assert played.adjustments[0].schedule(shell).count("\n") == 1 + played.adjustments[0].cables


def test_one_survey_of_every_crossing_teaches_the_shape_beyond_the_noise_and_never_less_certainty(
    shell, belief, errors, upper
):
    design = replace(belief.design, rest_length=belief.design.rest_length + errors)
    true = find_equilibrium(assemble(shell.network(design)), belief.state, belief.load, on_branch=True).state
    survey = true.positions[upper] + NOISE * np.random.default_rng(2).normal(size=(len(upper), 3))
    survey[5] = np.nan
    learnt = learn(shell, belief, upper, survey, noise=NOISE)
    before, after = (
        np.linalg.norm(each.state.positions - true.positions, axis=1).mean() for each in (belief, learnt)
    )
    assert after < 0.3 * before
    assert after < NOISE
    gained = np.linalg.eigvalsh(belief.covariance - learnt.covariance)
    assert gained.min() > -1e-12 * gained.max()


def test_a_survey_teaches_in_as_many_rounds_as_its_estimate_moves(shell, belief, errors, upper, monkeypatch):
    """What is learnt is the likeliest estimate: the sum of squares of what the survey and the drawing are
    missed by, each over its deviation, is least. After one linearisation it isn't."""
    design = replace(belief.design, rest_length=belief.design.rest_length + 2.0 * errors)
    true = find_equilibrium(assemble(shell.network(design)), belief.state, belief.load, on_branch=True).state
    survey = true.positions[upper]

    def missed():
        learnt = learn(shell, belief, upper, survey, noise=NOISE)
        off = (learnt.state.positions[upper] - survey) / NOISE
        return (off**2).sum() + (((learnt.design.rest_length - belief.design.rest_length) / ERROR) ** 2).sum()

    whole = missed()
    monkeypatch.setattr(retensioning, "_LEARNING", 1)
    assert whole < 0.9 * missed(), (whole, missed())


@pytest.mark.parametrize(("step", "kept"), [(0.0, 0.5e-3), (0.3e-3, 0.3e-3)])
def test_changes_that_leave_the_branch_are_halved_until_they_do_not_to_whole_steps_where_there_are_some(
    shell, belief, monkeypatch, step, kept
):
    """The branch is taken to end a little above a half of a millimetre; of two steps of 0.3 mm one is a
    half."""
    design, assembly = belief.design, assemble(shell.network(belief.design))
    change = np.full(design.present.sum(), -1e-3)
    solved = find_equilibrium

    def ends_soon(there, start, load, **how):
        if np.abs(there.cables[0].rest_length - design.rest_length).max() > 0.55e-3:
            raise NotConverged("off the branch", state=start)
        return solved(there, start, load, **how)

    monkeypatch.setattr(retensioning, "find_equilibrium", ends_soon)
    then, state, halved = retensioning._followed(
        shell, assembly, design, belief.state, belief.load, change, step=step
    )
    assert halved == 1
    np.testing.assert_allclose(then.rest_length, design.rest_length - kept, rtol=1e-12)
    rest = solved(assemble(shell.network(then)), belief.state, belief.load, on_branch=True).state
    np.testing.assert_allclose(state.positions, rest.positions, atol=1e-7)


def test_the_predicted_shape_is_right_to_first_order(shell, belief):
    change = np.zeros(len(shell.cable_ends))
    change[100:110] = 1e-4
    errors = []
    for size in (1.0, 0.5):
        goal = find_equilibrium(
            assemble(
                shell.network(replace(belief.design, rest_length=belief.design.rest_length + size * change))
            ),
            belief.state,
            belief.load,
            on_branch=True,
        ).state.positions
        step = adjust(shell, belief, goal, Crew(step=size * 1e-4, largest=size * 1e-4, cables=20), noise=1e-6)
        np.testing.assert_array_equal(np.flatnonzero(step.turns), np.arange(100, 110))
        errors.append(np.abs(step.predicted - step.belief.state.positions).max())
    assert 1.8 < np.log2(errors[0] / errors[1]) < 2.2


def test_whole_turns_come_near_the_best_of_all_combinations():
    rng = np.random.default_rng(4)
    crew = Crew(step=1.0, largest=2.0, cables=2)
    ratios = []
    for _ in range(30):
        jacobian, away = rng.normal(size=(8, 4)), 2.0 * rng.normal(size=8)
        best = min(
            (
                float(((away + jacobian @ k) ** 2).sum())
                for k in product(range(-2, 3), repeat=4)
                if np.count_nonzero(k) <= 2
            ),
        )
        found = whole_turns(jacobian, away, crew, weight=0.0)
        assert np.count_nonzero(found) <= 2
        assert np.abs(found).max() <= 2
        ratios.append(float(((away + jacobian @ found) ** 2).sum()) / best)
    assert min(ratios) > 1.0 - 1e-12
    assert np.mean(ratios) < 1.05
    assert np.mean(np.array(ratios) < 1.0 + 1e-9) > 0.7


def test_turns_are_listed_under_the_numbers_of_drawings_with_the_force_that_each_cable_ends_with(shell):
    present = np.arange(len(shell.cable_ends)) % 2 == 1
    design, none = replace(shell.design(), present=present), np.zeros((shell.node_count, 6))
    state = find_equilibrium(assemble(shell.network(design)), shell.target, none).state
    turns = np.zeros(len(present), dtype=np.int64)
    turns[[5, 101]] = [-3, 2]
    belief = first_belief(design, state, none, length_error=ERROR)
    step = Adjustment(turns, 0.25e-3 * turns, state.positions, belief, 0.0, 0.0, 0.0, 0)
    rows = [line.split(",") for line in step.schedule(shell).splitlines()]
    assert rows[0] == ["cable", "node a", "node b", "turns", "change [mm]", "tension after [N]"]
    cables = shell.cables(design)
    pull = cables.tension(state)
    for row, number, told in zip(rows[1:], (2, 50), (("-3", "-0.75"), ("+2", "+0.50")), strict=True):
        assert row == [*map(str, (number, *cables.ends[number])), *told, f"{pull[number]:.2f}"]


def test_nothing_is_turned_where_cables_are_as_good_as_exact(shell, belief, upper):
    sure = first_belief(belief.design, belief.state, belief.load, length_error=1e-5)
    none, crew = np.zeros(len(shell.cable_ends)), Crew(0.25e-3, 2e-3, 10)
    played = replay(shell, sure, none, belief.state.positions, upper, crew, noise=NOISE, rounds=3, seed=0)
    assert played.adjustments == ()
    assert len(played.misfits) == 1


def test_what_a_crew_or_a_survey_can_t_be_is_refused(shell, belief, errors, upper):
    with pytest.raises(InputError, match="must be positive"):
        Crew(step=0.0, largest=1.0, cables=1)
    with pytest.raises(InputError, match="more than the largest"):
        Crew(step=2.0, largest=1.0, cables=1)
    with pytest.raises(InputError, match="at least 1"):
        Crew(step=1.0, largest=1.0, cables=0)
    with pytest.raises(InputError, match="--length-error: must be positive"):
        first_belief(belief.design, belief.state, belief.load, length_error=0.0)
    with pytest.raises(InputError, match="no cables"):
        first_belief(shell.unbraced(), belief.state, belief.load, length_error=1e-3)
    with pytest.raises(InputError, match="a point for each node"):
        learn(shell, belief, upper, np.zeros((3, 3)), noise=NOISE)
    with pytest.raises(InputError, match="no node was seen"):
        learn(shell, belief, upper, np.full((len(upper), 3), np.nan), noise=NOISE)
    with pytest.raises(InputError, match="must be positive"):
        learn(shell, belief, upper, np.zeros((len(upper), 3)), noise=0.0)
    goal, crew = belief.state.positions, Crew(1e-3, 1e-3, 5)
    with pytest.raises(InputError, match="--noise: must be positive"):
        adjust(shell, belief, goal, crew, noise=-1e-4)
    with pytest.raises(InputError, match=r"--slip: must be between 0 and 1.*For 5 % write 0\.05"):
        replay(shell, belief, errors, goal, upper, crew, noise=NOISE, rounds=1, seed=0, slip=5)
    with pytest.raises(NotConverged, match=r"Plant smaller errors|however small"):
        replay(
            shell,
            belief,
            -60.0 * np.abs(errors),
            belief.state.positions,
            upper,
            Crew(1e-3, 1e-3, 5),
            noise=NOISE,
            rounds=1,
            seed=0,
        )
    squeezed = State(0.9 * belief.state.positions, belief.state.quaternions)
    with pytest.raises(NotConverged, match="isn't stable"):
        adjust(
            shell, replace(belief, state=squeezed), belief.state.positions, Crew(1e-3, 1e-3, 5), noise=NOISE
        )
