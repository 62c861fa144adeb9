"""What increments may leap over, on stand-ins and a bar whose numbers are worked out by hand."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from shellform.errors import NotConverged
from shellform.structure.elements.state import at_rest
from shellform.structure.network import assemble
from shellform.structure.solve import leaps, loading
from shellform.structure.solve.drive import Drive
from shellform.structure.solve.equilibrium import Equilibrium
from shellform.structure.solve.loading import advance
from shellform.structure.solve.outlook import Outlook, View
from shellform.verification.models import CLAMP, chain, line, load_at

STILL = SimpleNamespace(at=lambda factor: factor, moves_supports=False)


@pytest.fixture
def heeded(monkeypatch):
    """Increments that all come to rest, each with so many factorisations (`cost`), `far` or not, and may leap
    or not (`leaps`); what was asked is kept: `looked` at and taken back (`back`), which leads back where
    `returns`."""
    asked = SimpleNamespace(cost=7, far=False, leaps=True, returns=True, looked=[], back=[])

    def find(assembly, start, load, *, tolerance, limit=None, on_branch=False):
        return Equilibrium(f"at {load:g}", 0.5, 1e-9, asked.cost, True, 0)

    def may_leap(watch, before, after, factor, change):
        asked.looked.append((before, after, factor, change))
        return asked.leaps

    def returns(assembly, before, after, drive, factor, change, limit):
        asked.back.append((before, after, factor, change, limit))
        return asked.returns

    monkeypatch.setattr(loading, "find_equilibrium", find)
    monkeypatch.setattr(leaps, "_far", lambda before, after: asked.far)
    monkeypatch.setattr(leaps.Watch, "_may_leap", may_leap)
    monkeypatch.setattr(leaps, "_returns", returns)
    monkeypatch.setattr(leaps.Watch, "passes_over", lambda *_: False)
    return asked


def test_an_increment_that_may_leap_is_halved_and_only_the_smallest_is_taken_back(heeded):
    found = advance(
        None, "start", STILL, begin=2.0, end=-2.0, step=0.25, smallest=1 / 16, limit=33, heeding=True
    )
    assert found.on_branch
    assert heeded.looked[:3] == [
        ("start", "at 1", 1.0, -1.0),
        ("start", "at 1.5", 1.5, -0.5),
        ("start", "at 1.75", 1.75, -0.25),
    ]
    assert heeded.back[0] == ("start", "at 1.75", 1.75, -0.25, 33)
    assert {change for *_, change, _ in heeded.back} == {-0.25}
    assert len(heeded.back) == 16


def test_where_the_smallest_increment_does_not_come_back_the_branch_has_ended(heeded):
    heeded.returns = False
    found = advance(None, "start", STILL, step=0.25, smallest=1 / 16, stay=True, heeding=True)
    assert (found.share, len(heeded.back)) == (0.0, 1)


@pytest.mark.parametrize(
    ("cost", "far", "heeding", "looks"),
    [(5, False, True, 0), (6, False, True, 4), (5, True, True, 4), (25, True, False, 0)],
)
def test_only_an_increment_that_is_hard_or_long_is_looked_at(heeded, cost, far, heeding, looks):
    heeded.cost, heeded.far, heeded.leaps = cost, far, False
    assert advance(None, "start", STILL, step=0.25, heeding=heeding).on_branch
    assert (len(heeded.looked), heeded.back) == (looks, [])


def test_a_node_goes_far_that_goes_a_fiftieth_of_the_extent():
    before = at_rest(np.array([[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [0.0, 10.0, 0.0]]))
    for way, far in ((0.19, False), (0.21, True)):
        after = at_rest(before.positions + np.outer([0.0, 1.0, 0.0], [0.0, 0.6 * way, 0.8 * way]))
        assert leaps._far(before, after) is far


def along(x):
    """Two nodes, of which one stands still and the other is at x."""
    return at_rest(np.array([[0.0, 0.0, 0.0], [x, 0.0, 0.0]]))


@pytest.fixture
def rests(monkeypatch):
    """Stands in for equilibria of the load `load(x)` at a place x: states at rest know their own, and no
    other."""
    found = SimpleNamespace(load=None, slope=None)

    def at_rest_under(assembly, state, load):
        return bool(abs(load - found.load(state.positions[1, 0])) < 1e-12)

    def motion(assembly, state, drive):
        slope = found.slope(state.positions[1, 0])
        return None if slope < 0.0 else (None, None, np.array([[0.0, 0.0, 0.0], [1.0 / slope, 0.0, 0.0]]))

    monkeypatch.setattr(leaps, "at_rest", at_rest_under)

    def seen(state, values, factor, onward, before):
        return View(state, values, onward, None, None)

    own = Outlook(None, 1.0, np.ones(1))
    monkeypatch.setattr(own, "view", seen)
    monkeypatch.setattr(leaps, "_motion", motion)
    monkeypatch.setattr(leaps, "fit_for", lambda assembly, state: assembly)
    monkeypatch.setattr(leaps, "_outlook", lambda assembly, state: own)
    return found


def watch():
    return leaps.Watch(None, STILL, 1.0, 44)


def may_leap(rests, low, high):
    before, after = rests.load(low), rests.load(high)
    return watch()._may_leap(along(low), along(high), after, after - before)


def test_an_increment_over_a_peak_and_a_valley_may_leap_and_one_before_or_beyond_them_does_not(rests):
    """x (1 - x) (1 - x / 2), von Mises' truss: its peak is at 0.42, its valley at 1.58."""
    rests.load = lambda x: x * (1.0 - x) * (1.0 - 0.5 * x)
    rests.slope = lambda x: 1.0 - 3.0 * x + 1.5 * x * x
    assert may_leap(rests, 0.0, 2.1)
    assert may_leap(rests, 0.3, 2.5)
    assert may_leap(rests, 2.5, 0.1), "back as well"
    assert not may_leap(rests, 0.0, 0.4)
    assert not may_leap(rests, 1.6, 4.0)
    assert not may_leap(rests, 0.0, 1.0), "with a tangent that isn't positive definite at its end"
    assert not may_leap(rests, 2.1, 2.1), "nothing moves"


def test_a_state_that_is_not_at_rest_before_tells_nothing_nor_does_one_of_other_digits(rests):
    rests.load = lambda x: x * (1.0 - x) * (1.0 - 0.5 * x)
    rests.slope = lambda x: 1.0 - 3.0 * x + 1.5 * x * x
    low, high, last = along(0.0), along(2.1), rests.load(2.1)
    assert watch()._may_leap(low, high, last, last)
    assert not watch()._may_leap(low, high, last, 0.9 * last)
    assert not watch()._may_leap(low, replace(high, tail=np.zeros((2, 7))), last, last)


@pytest.mark.parametrize(("off", "comes_back"), [(0.0, True), (0.039, True), (0.041, False), (0.4, False)])
def test_a_state_comes_back_to_within_a_tenth_of_its_way(monkeypatch, off, comes_back):
    """From 1.4 back to 1.0 as the load falls from 3 to 2.5."""
    asked = []

    def carried(assembly, state, drive, change):
        asked.append((state.positions[1, 0], change))
        return "carried", 1

    def find(assembly, start, load, *, limit):
        asked.append((start, load, limit))
        return SimpleNamespace(state=along(1.0 - off))

    monkeypatch.setattr(leaps, "carried", carried)
    monkeypatch.setattr(leaps, "find_equilibrium", find)
    assert leaps._returns(None, along(1.0), along(1.4), STILL, 3.0, 0.5, 44) is comes_back
    assert asked == [(1.4, -0.5), ("carried", 2.5, 44)]


@pytest.mark.parametrize("lost", ["carried", "find_equilibrium"])
def test_a_state_that_nothing_is_found_behind_does_not_come_back(monkeypatch, lost):
    def fails(*_, **__):
        raise NotConverged("lost")

    monkeypatch.setattr(leaps, "carried", lambda *_: ("carried", 1))
    monkeypatch.setattr(leaps, "find_equilibrium", lambda *_, **__: SimpleNamespace(state=along(1.0)))
    assert leaps._returns(None, along(1.0), along(1.4), STILL, 3.0, 0.5, 44)
    monkeypatch.setattr(leaps, lost, fails)
    assert not leaps._returns(None, along(1.0), along(1.4), STILL, 3.0, 0.5, 44)


def test_nodes_move_with_their_supports_and_by_the_load():
    """A bar of 1 m and EA = 100 N, clamped at one end: pulled by 5 N its tip goes 0.05 m, and 0.2 m with the
    clamp."""
    network = chain(line(1), (100.0, 1.0, 1.0, 1.0), {0: CLAMP})
    assembly, none = assemble(network), np.zeros((2, 6))
    pull, imposed = load_at(network, 1, [5.0, 0.0, 0.0]), np.zeros((2, 6))
    imposed[0, 0] = 0.2
    start = at_rest(network.nodes)
    for drive, clamp, tip in (
        (Drive(pull, none, none), 0.0, 0.05),
        (Drive(none, imposed, none), 0.2, 0.2),
        (Drive(pull, imposed, none), 0.2, 0.25),
        (Drive(-2.0 * pull, imposed, none), 0.2, 0.1),
    ):
        _, _, motion = leaps._motion(assembly, start, drive)
        motion = motion[:, :3]
        np.testing.assert_allclose(motion, [[clamp, 0.0, 0.0], [tip, 0.0, 0.0]], atol=1e-12)


def test_where_the_tangent_is_not_positive_definite_nothing_is_told_of_a_motion():
    """Pushed together to half its length it bears 50 N, where it buckles under 2.5."""
    network = chain(line(1), (100.0, 1.0, 1.0, 1.0), {0: CLAMP})
    pull, none = load_at(network, 1, [5.0, 0.0, 0.0]), np.zeros((2, 6))
    half = at_rest(np.array([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0]]))
    assert leaps._motion(assemble(network), half, Drive(pull, none, none)) is None


def test_a_state_is_at_rest_with_next_to_nothing_of_its_load_left_over():
    network = chain(line(1), (100.0, 1.0, 1.0, 1.0), {0: CLAMP})
    assembly, pull = assemble(network), load_at(network, 1, [5.0, 0.0, 0.0])
    for stretched, rests in ((0.05, True), (0.05 * (1.0 + 1e-6), True), (0.0501, False), (0.0, False)):
        state = at_rest(np.array([[0.0, 0.0, 0.0], [1.0 + stretched, 0.0, 0.0]]))
        assert leaps.at_rest(assembly, state, pull) is rests


@pytest.mark.parametrize(
    ("before", "after", "kinked"),
    [
        ((1.1, 0.9), (1.2, 0.8), False),
        ((1.1, 0.9), (0.9, 0.8), True),
        ((1.1, 0.9), (1.2, 1.1), True),
        ((1.1, 0.9), (0.9, 1.1), True),
        ((1.1, 1.0), (1.2, 0.8), False),  # as long as it is at rest, the second one doesn't pull yet
    ],
)
def test_a_cable_that_goes_slack_or_taut_makes_a_kink(before, after, kinked):
    cables = SimpleNamespace(lengths=np.array, rest_length=np.ones(2))
    assert leaps.kinked(SimpleNamespace(cables=(cables,)), before, after) is kinked


FREE = SimpleNamespace(free=[0])


class Foreseen:
    """Increments that all come to rest, seen from places as they are told; what passes over the `window` does
    so."""

    def __init__(self, monkeypatch, window, *, resting=lambda load: True):
        self.window, self.looks, self.tried = window, [], []

        def find(assembly, start, load, *, tolerance, limit=None, on_branch=False):
            self.tried.append(load)
            return Equilibrium(
                SimpleNamespace(positions=np.zeros((2, 3)), tail=None, at=load), 0, 0, 2, True, 0
            )

        def motion(assembly, state, drive):
            return "values", "factor", "motion"

        monkeypatch.setattr(loading, "find_equilibrium", find)
        monkeypatch.setattr(leaps, "at_rest", lambda assembly, state, load: resting(load))
        monkeypatch.setattr(leaps, "_motion", motion)
        monkeypatch.setattr(leaps, "fit_for", lambda assembly, state: assembly)
        monkeypatch.setattr(leaps, "_outlook", lambda assembly, state: self)
        self.start = SimpleNamespace(positions=np.zeros((2, 3)), tail=None, at=0.0)

    def view(self, state, values, factor, onward, before):
        assert (values, factor, onward) == ("values", "factor", "motion")
        return SimpleNamespace(state=state, at=state.at, before=None if before is None else before.at)

    def passes_over(self, before, after, width, share):
        assert after.at - before.at == pytest.approx(width)
        self.looks.append((before.at, after.at, share, after.before))
        return before.at <= self.window and after.at >= self.window


def test_an_increment_that_may_pass_over_something_is_halved_to_a_512th_of_the_load(monkeypatch):
    seen = Foreseen(monkeypatch, 0.9)
    found = advance(FREE, seen.start, STILL, end=2.0, step=0.25, heeding=True)
    assert found.on_branch
    assert seen.looks[:3] == [(0.0, 0.5, 0.25, 0.0), (0.5, 1.0, 0.25, 0.5), (0.5, 0.75, 0.125, 0.5)]
    shares = [share for *_, share, _ in seen.looks]
    assert min(shares) == 1 / 256
    assert min(np.diff(seen.tried)[np.diff(seen.tried) > 0.0]) == 2.0 / 512
    begins = len({round(begin, 9) for begin, *_ in seen.looks})
    assert found.factorisations == 2 * len(seen.tried) + len(seen.looks) + 2, "the start, and one unseen"
    assert begins > 4


def test_a_start_that_is_not_at_rest_foretells_nothing(monkeypatch):
    seen = Foreseen(monkeypatch, 0.1, resting=lambda load: load > 0.0)
    assert advance(FREE, seen.start, STILL, step=0.25, heeding=True).on_branch
    assert [look[0] for look in seen.looks] == [0.25, 0.5, 0.75]
    assert [look[3] for look in seen.looks] == [0.25, 0.5, 0.75]


def test_states_of_other_digits_foretell_nothing_of_each_other(monkeypatch):
    seen = Foreseen(monkeypatch, 0.1)
    seen.start.tail = "tail"
    assert advance(FREE, seen.start, STILL, step=0.25, heeding=True).on_branch
    assert [look[0] for look in seen.looks] == [0.25, 0.5, 0.75]
