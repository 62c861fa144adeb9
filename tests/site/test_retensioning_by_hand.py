"""Learning and adjusting on a grid whose nodes move in proportion to its cables' lengths, by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

import shellform as sf
from shellform.errors import InputError, NotConverged
from shellform.site import retensioning
from shellform.site.retensioning import Adjustment, Belief, Crew, Replay, adjust, first_belief, learn, replay

RATES = np.array(
    [
        [[1.0, 0.0, 0.0], [0.5, 2.0, 0.0], [0.0, 0.0, 0.0]],
        [[0.0, -1.0, 0.0], [0.0, 0.0, 0.0], [0.3, 0.7, 0.0]],
        [[0.0, 0.0, 0.0], [0.2, 0.0, 0.0], [0.0, 1.5, 0.0]],
    ]
)  # of three nodes by three present cables, of which the third is slack
PRESENT = np.array([True, False, True, True])
DESIGN = sf.Design([1.0, 9.0, 2.0, 3.0], PRESENT, 0.004)
PLACES = np.arange(9.0).reshape(3, 3)
STATE = SimpleNamespace(positions=PLACES)
SHELL = SimpleNamespace(node_count=3, network=lambda design: design)
LOAD = np.zeros((3, 6))


def at(lengths):
    """Where nodes are with these lengths of the present cables."""
    off = np.asarray(lengths) - DESIGN.rest_length[PRESENT]
    return SimpleNamespace(positions=PLACES + RATES @ off)


@pytest.fixture
def linear(monkeypatch):
    """The changes that were followed."""
    followed = []

    def follow(_shell, _assembly, design, _state, _load, change, *, step=0.0):
        followed.append((np.array(change), step))
        lengths = design.rest_length.copy()
        lengths[PRESENT] += change
        return sf.Design(lengths, PRESENT, design.radius), at(lengths[PRESENT]), 0

    monkeypatch.setattr(retensioning, "assemble", lambda network: network)
    monkeypatch.setattr(retensioning, "_followed", follow)
    monkeypatch.setattr(retensioning, "_rates", lambda *_: RATES)
    return followed


def belief(deviation=(0.01, 0.02, 0.03)):
    covariance = np.diag(np.square(deviation))
    covariance[0, 1] = covariance[1, 0] = 0.5 * deviation[0] * deviation[1]
    return Belief(DESIGN, covariance, STATE, LOAD)


def test_cables_are_believed_to_be_as_long_as_drawn_with_their_usual_error():
    found = first_belief(DESIGN, STATE, LOAD, length_error=0.002)
    np.testing.assert_allclose(found.covariance, 4e-6 * np.eye(3))
    for error in (0.9e-9, 1.1):
        with pytest.raises(InputError, match=r"--length-error.*such as 0\.0001"):
            first_belief(DESIGN, STATE, LOAD, length_error=error)
    for error in (1.5e-9, 1.0):
        assert first_belief(DESIGN, STATE, LOAD, length_error=error).covariance[0, 0] == error**2


def test_a_survey_teaches_what_the_formula_of_the_filter_says(linear):
    """Of nodes 2 and 0, and of node 1 nothing."""
    own, noise = belief(), 0.003
    survey = np.array([[6.01, 7.02, 7.97], [np.nan, 4.0, 5.0], [0.02, 1.03, 2.01]])
    learnt = learn(SHELL, own, np.array([2, 1, 0]), survey, noise=noise)
    rates = RATES[[2, 0]].reshape(6, 3)
    gain = own.covariance @ rates.T @ np.linalg.inv(rates @ own.covariance @ rates.T + noise**2 * np.eye(6))
    away = (survey[[0, 2]] - PLACES[[2, 0]]).ravel()
    wanted = DESIGN.rest_length[PRESENT] + gain @ away
    np.testing.assert_allclose(learnt.design.rest_length[PRESENT], wanted, rtol=1e-12)
    assert learnt.design.rest_length[1] == 9.0, "an absent cable stays as drawn"
    np.testing.assert_allclose(learnt.covariance, own.covariance - gain @ rates @ own.covariance, atol=1e-18)
    assert wanted[2] == 3.0, "a slack cable is as it was believed to be"
    assert learnt.covariance[2, 2] == pytest.approx(0.03**2)
    np.testing.assert_allclose(learnt.state.positions, at(wanted).positions)
    assert len(linear) == 1, "the second linearisation changes nothing"


def test_a_step_that_leads_to_no_likelier_estimate_is_halved_and_given_up_after_five(linear, monkeypatch):
    """With rates that are told a fifth as large as they are a step leads five times too far: a quarter of it
    helps."""
    monkeypatch.setattr(retensioning, "_LEARNING", 1)
    survey, wide = at([1.01, 2.0, 3.0]).positions, belief((1.0, 1.0, 1.0))
    monkeypatch.setattr(retensioning, "_rates", lambda *_: 0.2 * RATES)
    learnt = learn(SHELL, wide, np.arange(3), survey, noise=1e-5)
    assert [change[0] for change, _ in linear] == pytest.approx([0.05, 0.025, 0.0125], rel=1e-3)
    assert learnt.design.rest_length[0] == pytest.approx(1.0125, rel=1e-4)
    linear.clear()
    monkeypatch.setattr(retensioning, "_rates", lambda *_: -RATES)
    learnt = learn(SHELL, wide, np.arange(3), survey, noise=1e-5)
    assert len(linear) == 5
    assert learnt.design.rest_length.tolist() == DESIGN.rest_length.tolist(), "no likelier one was found"


def test_learning_ends_where_no_length_changes_by_a_fiftieth_of_the_largest_usual_error(linear, monkeypatch):
    """With rates that are told twice as large as they are every step goes half of the way that is left of
    0.12 m."""
    monkeypatch.setattr(retensioning, "_rates", lambda *_: 2.0 * RATES)
    survey = at([1.12, 2.0, 3.0]).positions
    learn(SHELL, belief((1.0, 0.5, 0.3)), np.arange(3), survey, noise=1e-6)
    assert [change[0] for change, _ in linear] == pytest.approx([0.06, 0.03, 0.015], rel=1e-3)


def test_what_a_survey_and_a_belief_are_missed_by_counts_over_their_deviations():
    """Two nodes off by 2 and 6 times the noise, and lengths by one deviation and by two."""
    missed = retensioning._Likelihood(
        np.array([1.0, 2.0]),
        np.diag([0.01, 0.04]),
        np.array([0.0, 1.0, 2.2, 6.0, 7.0, 7.4]),
        np.array([0, 2]),
        0.1,
    ).missed(np.array([1.1, 1.6]), STATE)
    assert missed == pytest.approx(4.0 + 36.0 + 1.0 + 4.0)


def test_turns_bring_nodes_to_the_goal_and_slack_cables_are_left_alone(linear):
    """The first cable is wanted 4 steps of 0.5 mm longer, the third one 3 shorter, and the goal is a tenth of
    a step off."""
    goal = at([1.0 + 4.1 * 0.5e-3, 2.0 - 3.1 * 0.5e-3, 3.0]).positions
    found = adjust(SHELL, belief(), goal, Crew(0.5e-3, 5e-3, 3), noise=1e-9)
    assert found.turns.tolist() == [4, 0, -3, 0]
    assert found.change == pytest.approx([0.002, 0.0, -0.0015, 0.0])
    assert linear[0][0] == pytest.approx([0.002, -0.0015, 0.0])
    assert linear[0][1] == 0.5e-3
    np.testing.assert_allclose(found.predicted, at([1.002, 1.9985, 3.0]).positions)
    assert found.misfit_before == pytest.approx(((PLACES - goal) ** 2).sum())
    assert found.misfit_predicted == pytest.approx(((found.predicted - goal) ** 2).sum())
    assert found.misfit_after == pytest.approx(found.misfit_predicted)
    assert found.misfit_predicted < 0.01 * found.misfit_before
    assert found.belief.design.rest_length == pytest.approx([1.002, 9.0, 1.9985, 3.0])
    assert found.halved == 0


def test_turning_weighs_by_the_noise_over_the_largest_change(linear, monkeypatch):
    asked = {}

    def turns(jacobian, away, crew, *, weight):
        asked.update(shape=jacobian.shape, weight=weight)
        return np.array([1, 0])

    monkeypatch.setattr(retensioning, "whole_turns", turns)
    found = adjust(SHELL, belief(), PLACES + 1.0, Crew(0.5e-3, 4e-3, 3), noise=1e-3)
    assert asked == {"shape": (9, 2), "weight": pytest.approx(1.0 / 16.0)}
    assert found.turns.tolist() == [1, 0, 0, 0]


def test_a_replay_plays_errors_surveys_and_turns_on_and_tells_what_is_left(linear, monkeypatch):
    """Errors of 2 and -1 mm; in the first round all but half a millimetre is taken back, then nothing is
    worth it."""
    beliefs, steps = [], [np.array([-0.0015, 0.0, 0.001, 0.0]), np.zeros(4)]

    def teach(_shell, belief, nodes, survey, *, noise):
        assert nodes.tolist() == [2, 0]
        beliefs.append((belief, survey))
        return belief

    def turn(_shell, belief, _goal, _crew, *, noise):
        change = steps[len(beliefs) - 1]
        turns = np.rint(change / 0.5e-3).astype(int)
        return Adjustment(turns, change, PLACES, belief, 0.0, 0.0, 0.0, 0)

    monkeypatch.setattr(retensioning, "learn", teach)
    monkeypatch.setattr(retensioning, "adjust", turn)
    errors = np.array([0.002, 7.0, -0.001, 0.0])

    def play(**how):
        beliefs.clear()
        return replay(
            SHELL, belief(), errors, PLACES, np.array([2, 0]), Crew(0.5e-3, 5e-3, 3), noise=0.0, rounds=3, seed=1, **how
        )  # fmt: skip

    played = play()
    before, after = at([1.002, 1.999, 3.0]).positions, at([1.0005, 2.0, 3.0]).positions
    np.testing.assert_allclose(beliefs[0][1], before[[2, 0]])
    np.testing.assert_allclose(beliefs[1][1], after[[2, 0]])
    wanted = [((place - PLACES) ** 2).sum() for place in (before, after)]
    np.testing.assert_allclose(played.misfits, wanted)
    assert played.removed == pytest.approx(1.0 - wanted[1] / wanted[0])
    assert [each.cables for each in played.adjustments] == [2]
    assert len(played.adjustments) == 1
    np.testing.assert_allclose(played.state.positions, after)
    np.testing.assert_allclose(beliefs[1][0].covariance, belief().covariance)

    slipped = play(slip=0.2)
    gained = beliefs[1][0].covariance - belief().covariance
    np.testing.assert_allclose(gained, np.diag([0.0003**2, 0.0002**2, 0.0]), atol=1e-18)
    chance = np.random.default_rng(1)
    chance.normal(size=(2, 3))
    moved = (1.0 + 0.2 * chance.normal(size=4)) * steps[0]
    there = at(np.array([1.002, 1.999, 3.0]) + moved[PRESENT]).positions
    assert slipped.misfits[1] == pytest.approx(((there - PLACES) ** 2).sum())


def test_surveys_of_a_replay_have_their_noise(linear, monkeypatch):
    surveys = []

    def teach(_shell, belief, _nodes, survey, *, noise):
        surveys.append(survey)
        return belief

    monkeypatch.setattr(retensioning, "learn", teach)
    nothing = Adjustment(np.zeros(4, dtype=int), np.zeros(4), PLACES, belief(), 0.0, 0.0, 0.0, 0)
    monkeypatch.setattr(retensioning, "adjust", lambda *_, **__: nothing)
    replay(
        SHELL, belief(), np.zeros(4), PLACES, np.array([1, 2]), Crew(0.5e-3, 5e-3, 3), noise=0.25, rounds=2, seed=6
    )  # fmt: skip
    chance = np.random.default_rng(6).normal(size=(2, 3))
    np.testing.assert_allclose(surveys, [PLACES[[1, 2]] + 0.25 * chance])


@pytest.mark.parametrize(
    ("change", "step", "bears", "kept", "halved"),
    [
        ([0.8, -0.4, 0.1], 0.0, 1.0, [0.8, -0.4, 0.1], 0),
        ([0.8, -0.4, 0.1], 0.0, 0.25, [0.2, -0.1, 0.025], 2),
        ([0.8, -0.4, 0.1], 0.0, 0.026, [0.025, -0.0125, 0.003125], 5),
        ([0.7, -0.3, 0.1], 0.1, 0.35, [0.3, -0.1, 0.0], 1),
        ([0.7, -0.3, 0.1], 0.1, 0.15, [0.1, 0.0, 0.0], 2),
        ([0.8, -3.0, 0.1], 0.0, 9.0, [0.4, -1.5, 0.05], 1),
    ],
)
def test_changes_are_halved_to_whole_steps_if_there_are_any_until_a_stable_state_follows(
    monkeypatch, change, step, bears, kept, halved
):
    """Those that leave no length of a cable aren't tried: the second is 2 m long, and absent ones don't
    count."""

    def solve(parts, start, _load, *, limit, on_branch):
        assert start is STATE or start == "foreseen"
        away = np.abs(parts[1] - DESIGN.rest_length[PRESENT]).max()
        assert away < 2.0
        return SimpleNamespace(stable=away <= bears, state="there")

    shell = SimpleNamespace(beams=lambda radius: None, cables=lambda design: design.rest_length[PRESENT])
    monkeypatch.setattr(retensioning, "find_equilibrium", solve)
    monkeypatch.setattr(retensioning, "by_rest_length", lambda *_: None)
    monkeypatch.setattr(retensioning, "respond", lambda *_: None)
    monkeypatch.setattr(retensioning, "predicted", lambda *_: "foreseen")

    def lost(*_, **__):
        raise NotConverged("lost", state=None)

    def follow():
        assembly = SimpleNamespace(with_parts=lambda parts: parts)
        return retensioning._followed(shell, assembly, DESIGN, STATE, LOAD, np.array(change), step=step)

    then, state, times = follow()
    assert state == "there"
    assert times == halved
    assert then.rest_length[PRESENT] - DESIGN.rest_length[PRESENT] == pytest.approx(kept)
    assert then.rest_length[1] == 9.0
    monkeypatch.setattr(retensioning, "find_equilibrium", lost)
    with pytest.raises(NotConverged, match="however small"):
        follow()


def test_a_replay_whose_true_grid_leaves_its_branch_says_at_which_of_both_changes(linear, monkeypatch):
    monkeypatch.setattr(retensioning, "learn", lambda _shell, belief, *_, **__: belief)
    step = Adjustment(np.ones(4, dtype=int), np.zeros(4), PLACES, belief(), 0.0, 0.0, 0.0, 0)
    monkeypatch.setattr(retensioning, "adjust", lambda *_, **__: step)
    for halved, said in (([1], "Plant smaller errors"), ([0, 1], "Allow smaller changes")):
        left = iter(halved)
        monkeypatch.setattr(
            retensioning, "_followed", lambda *_, left=left, **__: (DESIGN, STATE, next(left))
        )
        with pytest.raises(NotConverged) as told:
            replay(
                SHELL, belief(), np.zeros(4), PLACES, np.arange(3), Crew(0.5e-3, 5e-3, 3), noise=0.0, rounds=1, seed=1
            )  # fmt: skip
        assert said in told.value.remedy


def test_what_is_removed_is_the_share_of_the_first_misfit():
    assert Replay(np.array([8.0, 4.0, 2.0]), (), STATE).removed == 0.75
