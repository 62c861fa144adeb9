"""The search for the factor at which a structure as built has only so much stiffness left, on branches of
which the stiffness is known: a root that ends at 1, as at a limit point, and one with a leap, as where a
cable goes slack.
"""

from types import SimpleNamespace

import numpy as np
import pytest

from shellform.errors import NotConverged
from shellform.reliability import borne

LEFT = 0.1


class Branch:
    """A branch whose stiffness is a root that comes to nothing at the factor 1, beyond which it isn't
    reached."""

    number = 7

    def __init__(self, taut=lambda factor: np.array([True])):
        self.taut, self.looked = taut, []

    def stiffness(self, factor):
        return np.sqrt(1.0 - factor)

    def at(self, factor):
        return borne._Point(
            SimpleNamespace(state=None), factor, self.stiffness(factor), np.zeros((6, 1)), self.taut(factor)
        )

    def moved(self, _loading, _point, goal):
        self.looked.append(goal)
        return self.at(goal) if goal < 1.0 else None


def found(monkeypatch, branch, begin, most=3.0, **how):
    monkeypatch.setattr(borne, "_followed", lambda *_: (SimpleNamespace(state=None), begin))
    monkeypatch.setattr(borne, "_point", lambda _loading, _here, factor: branch.at(factor))
    monkeypatch.setattr(borne, "_moved", branch.moved)
    monkeypatch.setattr(borne, "_softest", lambda _loading, point, _rates: point)
    monkeypatch.setattr(borne, "_derived", lambda _loading, point, end, _rates: (point.factor, end))
    return borne.borne(branch, left=LEFT, most=most, **how)


@pytest.mark.parametrize("begin", [0.985, 0.9899, 0.995, 0.9999999])
def test_the_end_is_where_so_much_stiffness_is_left_from_whichever_side_it_is_sought(monkeypatch, begin):
    branch = Branch()
    factor, _ = found(monkeypatch, branch, begin)
    assert branch.stiffness(factor) == pytest.approx(LEFT, rel=borne.EXACT)
    assert len(branch.looked) <= 12, "the square of a root's stiffness is linear in the load"


def test_a_branch_that_is_stiff_enough_as_far_as_was_asked_ends_there_and_depends_on_nothing(monkeypatch):
    monkeypatch.setattr(borne, "_cables", None)
    for begin, most in ((0.5, 0.5), (0.985, 0.98)):
        result = found(monkeypatch, Branch(lambda _: np.array([True, False, True])), begin, most)
        assert (result.factor, result.factor_by_rest_length.tolist()) == (most, [0.0, 0.0, 0.0])
    factor, _ = found(monkeypatch, Branch(), 0.995, most=0.995)
    assert factor == pytest.approx(0.99), "too soft there, though it is reached"


def test_the_precision_asked_for_is_of_the_stiffness_left(monkeypatch):
    branch = Branch()
    branch.stiffness = lambda factor: (1.0 - factor) ** 0.4
    factor, _ = found(monkeypatch, branch, 0.985, exact=0.05)
    rough = abs(branch.stiffness(factor) - LEFT) / LEFT
    assert 1e-6 < rough <= 0.05


def test_where_a_cable_goes_slack_between_the_stiffness_may_leap_and_the_interval_is_halved(monkeypatch):
    """From 0.8 on the cable is slack and the branch too soft: its stretch decides."""
    branch = Branch(lambda factor: np.array([factor < 0.8]))
    monkeypatch.setattr(branch, "stiffness", lambda factor: 1.0 if factor < 0.8 else 0.01)
    asked = []

    def slackening(_loading, low, above, left):
        asked.append((low.factor, above, left))
        return low, 0

    monkeypatch.setattr(borne, "_slackening", slackening)
    monkeypatch.setattr(borne, "_stretch", lambda _loading, _point, cable, _rates: ("stretch", cable))
    factor, end = found(monkeypatch, branch, 0.85)
    assert end == ("stretch", 0)
    (low, above, left) = asked[0]
    assert low < 0.8 <= above
    assert above - low <= 1e-3
    assert above - low > 1e-4, "no sooner, and no later"
    assert left == LEFT
    assert factor == low


def test_between_two_states_of_a_root_the_next_is_at_its_end_and_beside_a_slack_cable_halfway():
    root = Branch()
    low, high = root.at(0.5), root.at(0.995)
    assert borne._between(low, 0.995, high, LEFT) == pytest.approx(0.99)
    assert borne._between(low, 0.9, None, LEFT) == pytest.approx(0.7)
    slack = Branch(lambda factor: np.array([factor < 0.9]))
    assert borne._between(slack.at(0.5), 0.995, slack.at(0.995), LEFT) == pytest.approx(0.7475)
    tightens = Branch(lambda factor: np.array([factor > 0.9]))
    assert borne._between(tightens.at(0.5), 0.995, tightens.at(0.995), LEFT) == pytest.approx(0.99)


def test_a_soft_state_goes_back_in_growing_steps_until_it_is_stiff_and_in_shrinking_ones_where_it_gets_nowhere(
    monkeypatch,
):
    branch = Branch()
    monkeypatch.setattr(borne, "_moved", branch.moved)
    assert borne._stiff(branch, branch.at(0.9999), LEFT).factor == pytest.approx(0.9999 - 1 / 64)
    steep = Branch()
    steep.stiffness = lambda factor: 1.0 if factor < 0.9 else 0.05
    monkeypatch.setattr(borne, "_moved", steep.moved)
    assert borne._stiff(steep, steep.at(0.99), LEFT).factor == pytest.approx(0.99 - 7 / 64)
    assert np.diff([0.99, *steep.looked]) == pytest.approx([-1 / 64, -2 / 64, -4 / 64])

    far = Branch()

    def near_only(loading, point, goal):
        far.looked.append(goal)
        return far.at(goal) if point.factor - goal < 0.004 else None

    monkeypatch.setattr(borne, "_moved", near_only)
    assert borne._stiff(far, far.at(0.992), LEFT).stiffness >= LEFT
    assert min(0.992 - np.array(far.looked)) == pytest.approx(1 / 256), (
        "steps are halved until one is reached"
    )


def test_a_branch_on_which_no_state_is_stiff_enough_is_given_up_by_name(monkeypatch):
    soft = Branch()
    soft.stiffness = lambda factor: 0.01
    monkeypatch.setattr(borne, "_moved", soft.moved)
    with pytest.raises(NotConverged, match="structure 7 as built bears was not found") as told:
        borne._stiff(soft, soft.at(0.3), LEFT)
    assert "scenarios" in told.value.remedy
    assert soft.looked[-1] == 0.0
    monkeypatch.setattr(borne, "_moved", lambda *_: None)
    with pytest.raises(NotConverged, match="not found"):
        borne._stiff(soft, soft.at(0.3), LEFT)


def test_without_an_unloaded_state_there_is_no_factor(monkeypatch):
    monkeypatch.setattr(borne, "_followed", lambda *_: (None, 0.0))
    loading = SimpleNamespace(number=7, nominal=SimpleNamespace(unloaded="state"))
    with pytest.raises(NotConverged, match="Structure 7 as built has no unloaded equilibrium") as told:
        borne.borne(loading, left=LEFT, most=1.0)
    assert told.value.state == "state"


def test_a_path_begins_at_the_state_of_a_design_nearby_or_where_that_is_none_of_this_one_s_from_nothing():
    calls = []

    class Loading:
        load = np.ones((2, 6))
        settles = True

        def newton(self, state, load, *, limit, tolerance):
            calls.append(("newton", state, load[0, 0], limit, tolerance))
            return "begun" if self.settles else None

        def along(self, begin, factor, most, step, resolution):
            calls.append(("along", begin, factor, most, step, resolution))
            return "near", factor

        def followed(self, most, step, resolution):
            calls.append(("followed", most, step, resolution))
            return "nothing", 0.5

    loading = Loading()
    assert borne._followed(loading, 2.0, (0.75, "there")) == ("near", 0.75)
    assert calls == [
        ("newton", "there", 0.75, 8, borne.ON_THE_WAY),
        ("along", "begun", 0.75, 2.0, 1 / 16, 1 / 64),
    ]
    for near, settles in (((0.75, "there"), False), ((2.0, "there"), True), (None, True)):
        calls.clear()
        loading.settles = settles
        assert borne._followed(loading, 2.0, near) == ("nothing", 0.5)
        assert calls[-1] == ("followed", 2.0, 1 / 8, 1 / 64)
        assert (calls[0][0] == "newton") == (near is not None and not settles)
