"""Increments of a load on stand-ins of the equilibria: how wide they are, what they cost, and how supports
move."""

from types import SimpleNamespace

import numpy as np
import pytest

from shellform.errors import NotConverged
from shellform.structure.elements.state import State, at_rest
from shellform.structure.solve import drive as drives
from shellform.structure.solve import loading
from shellform.structure.solve.drive import Drive, forces
from shellform.structure.solve.equilibrium import Equilibrium
from shellform.structure.solve.factorisation import NotPositiveDefinite
from shellform.structure.solve.loading import advance, apply_load
from shellform.structure.solve.outlook import turns_between


@pytest.fixture
def tried(monkeypatch):
    """The factors tried with what was asked; a factor is stable unless `tried.refuse(factor, times)` says
    otherwise."""

    class Tried(list):
        def refuse(self, factor):
            return False

    found = Tried()

    def find(assembly, start, load, *, tolerance, limit=None, on_branch=False):
        found.append(SimpleNamespace(factor=load, limit=limit, on_branch=on_branch, tolerance=tolerance))
        if on_branch and found.refuse(load):
            raise NotConverged("lost", iterations=100)
        return Equilibrium(f"at {load:g}", 0.5, 1e-9, 7, True, 0)

    monkeypatch.setattr(loading, "find_equilibrium", find)
    return found


STILL = SimpleNamespace(at=lambda factor: factor, moves_supports=False)


def test_increments_are_a_quarter_of_the_way_from_begin_to_end_each_with_25_factorisations(tried):
    told = []
    found = advance(
        None,
        "start",
        STILL,
        begin=2.0,
        end=-1.0,
        step=loading.STEP,
        tolerance=1e-5,
        report=lambda *each: told.append(each),
    )
    assert [each.factor for each in tried] == [1.25, 0.5, -0.25, -1.0]
    assert {(each.limit, each.on_branch, each.tolerance) for each in tried} == {(25, True, 1e-5)}
    assert [(share, each.state) for share, each in told] == [
        (0.25, "at 1.25"),
        (0.5, "at 0.5"),
        (0.75, "at -0.25"),
        (1.0, "at -1"),
    ]
    assert (found.share, found.on_branch, found.factorisations) == (1.0, True, 28)
    assert (found.equilibrium.state, found.equilibrium.factorisations) == ("at -1", 28)


@pytest.mark.parametrize(("step", "count"), [(0.1, 10), (0.3, 3), (1.0, 1), (4.0, 1), (0.5, 2)])
def test_increments_are_equal_and_the_last_one_ends_at_the_whole(tried, step, count):
    advance(None, "start", STILL, step=step)
    assert [each.factor for each in tried] == pytest.approx([(k + 1) / count for k in range(count)])
    assert tried[-1].factor == 1.0


def test_supports_are_carried_on_by_each_increment_s_change_of_the_factor(tried, monkeypatch):
    changes = []

    def carried(_assembly, state, _drive, change):
        changes.append(change)
        return state, 3

    monkeypatch.setattr(loading, "carried", carried)
    found = advance(None, "start", STILL, begin=1.0, end=4.0, step=0.5)
    assert changes == [1.5, 1.5]
    assert found.factorisations == 2 * (3 + 7)


def test_an_increment_is_halved_where_it_fails_and_doubled_after_two_up_to_the_first_width(tried):
    failed = [0.5, 0.375]
    tried.refuse = lambda factor: factor in failed and not failed.remove(factor)
    found = advance(None, "start", STILL)
    assert [each.factor for each in tried] == [0.25, 0.5, 0.375, 0.3125, 0.375, 0.5, 0.625, 0.875, 1.0]
    assert found.factorisations == 7 * 7 + 2 * 100


def test_the_branch_is_followed_to_a_64th_of_the_whole_and_no_nearer(tried):
    tried.refuse = lambda factor: factor > 0.3
    found = advance(None, "start", STILL, stay=True, smallest=loading.SMALLEST)
    assert found.share == 19 / 64
    assert not found.on_branch
    assert min(np.abs(np.diff([each.factor for each in tried]))[:-1]) >= 1 / 64
    last = tried[-1]
    assert (last.factor, last.on_branch) == (19 / 64, False)
    assert found.equilibrium.state == f"at {19 / 64:g}"
    tried.refuse = lambda factor: factor > 3.1
    away = advance(None, "start", STILL, begin=3.0, end=5.0, stay=True)
    assert (away.share, tried[-1].factor) == (3 / 64, 3.0 + 6 / 64)
    tried.refuse = lambda factor: factor > 0.3
    coarse = advance(None, "start", STILL, stay=True, smallest=1 / 8)
    assert coarse.share == 0.25


def test_what_lies_beyond_the_branch_is_relaxed_at_once_within_its_own_limit(tried):
    tried.refuse = lambda factor: factor > 1.1
    told = []
    found = advance(
        None, "start", STILL, begin=1.0, end=3.0, limit=444, report=lambda *each: told.append(each)
    )
    assert found.share == 3 / 64
    assert (tried[-1].factor, tried[-1].limit, tried[-1].on_branch) == (3.0, 444, False)
    assert told[-1][0] == 1.0
    refused = sum(each.factor > 1.1 for each in tried[:-1])
    assert found.factorisations == 7 * (len(tried) - refused) + 100 * refused


def test_a_load_is_applied_as_the_change_on_top_of_the_one_before(monkeypatch):
    given = {}
    monkeypatch.setattr(loading, "advance", lambda *each, **named: given.update(named, each=each) or "found")
    before, after = np.full((2, 6), 3.0), np.full((2, 6), 5.5)
    assert apply_load("assembly", "start", before, after, step=0.5, stay=True) == "found"
    drive = given["each"][2]
    assert (drive.at(0.0) == 3.0).all()
    assert (drive.at(1.0) == 5.5).all()
    assert (drive.at(2.0) == 8.0).all()
    assert not drive.moves_supports
    assert (given["step"], given["smallest"], given["stay"], given["tolerance"]) == (0.5, 1 / 64, True, 1e-8)
    assert (forces(after).at(2.0) == 11.0).all()


def moving():
    """Two nodes, the second of which is moved along x by 0.4 m."""
    imposed = np.zeros((2, 6))
    imposed[1, 0] = 0.4
    return Drive(np.zeros((2, 6)), imposed, np.zeros((2, 6))), at_rest(np.array([[0.0, 0, 0], [1.0, 0, 0]]))


def test_beyond_the_branch_supports_move_by_halves_of_what_is_left_until_nothing_folds(monkeypatch):
    drive, start = moving()
    monkeypatch.setattr(drives, "_folded", lambda _, before, after: after.positions[1, 0] > 1.2)
    there, share = drives.moved_on(None, start, drive, 0.2, 1.0, 3.0)
    assert share == pytest.approx(0.4)  # of 0.8 · 2 · 0.4 m all, half and a quarter
    assert there.positions[1, 0] == pytest.approx(1.16)
    monkeypatch.setattr(drives, "_folded", lambda *_: False)
    there, share = drives.moved_on(None, start, drive, 0.2, 1.0, 3.0)
    assert (share, there.positions[1, 0]) == (1.0, pytest.approx(1.64))
    asked = []
    monkeypatch.setattr(drives, "_folded", lambda *_: asked.append(1) or True)
    with pytest.raises(NotConverged, match=r"fold an element.*more increments"):
        drives.moved_on(None, start, drive, 0.2, 1.0, 3.0)
    assert len(asked) == 20, "0.8 / 2^20 is below a millionth"
    still = forces(np.zeros((2, 6)))
    assert drives.moved_on(None, start, still, 0.2, 1.0, 3.0) == (start, 1.0)


def test_the_rest_is_applied_in_as_many_stops_as_moving_supports_need(tried, monkeypatch):
    tried.refuse = lambda factor: True
    shares = iter([0.5, 0.75, 1.0])
    monkeypatch.setattr(loading, "moved_on", lambda _, state, *__: (state, next(shares)))
    found = advance(None, "start", STILL, begin=1.0, end=5.0, limit=99)
    assert [each.factor for each in tried if not each.on_branch] == [3.0, 4.0, 5.0]
    assert (found.share, found.equilibrium.state) == (0.0, "at 5")
    assert found.factorisations == 3 * 7 + 100 * 5


@pytest.mark.parametrize(
    ("halved", "over", "folded"), [(False, False, False), (True, False, True), (False, True, True)]
)
def test_an_element_folds_where_it_is_halved_or_turned_over(monkeypatch, halved, over, folded):
    turned = {"before": 0.3, "after": 0.7}
    assembly = SimpleNamespace(
        evaluate=lambda state, tangent: SimpleNamespace(turned=turned[state]),
        chords=SimpleNamespace(halved=lambda *states: halved and states == ("before", "after")),
    )
    asked = []
    monkeypatch.setattr(drives, "overturned", lambda *each: asked.append(each[1:]) or over)
    assert drives._folded(assembly, "before", "after") == folded
    assert asked in ([], [("before", 0.3, "after", 0.7)])


class Springs:
    """The first node's x is free, held by 8 N/m, and feels 2 N/m of the second's."""

    free = np.array([0])

    def __init__(self, *, definite=True):
        self.matrix = SimpleNamespace(factor=self._factor)
        self.chords = SimpleNamespace(corrected=lambda state, step: step)
        self.definite = definite

    def force_along(self, state, motion):
        found = np.zeros((2, 6))
        found[0, 0] = -2.0 * motion[1, 0]
        return found

    def evaluate(self, state):
        return "balance"

    def _factor(self, values):
        assert values == "held"
        if not self.definite:
            raise NotPositiveDefinite
        return SimpleNamespace(solve=lambda pull: pull / 8.0)


def test_supports_take_the_free_nodes_along_by_the_tangent_where_that_folds_nothing(monkeypatch):
    drive, start = moving()
    monkeypatch.setattr(drives, "fit_for", lambda assembly, _: assembly)
    monkeypatch.setattr(drives, "held", lambda *_: "held")
    monkeypatch.setattr(drives, "_folded", lambda *_: False)
    there, cost = drives.carried(Springs(), start, drive, 0.5)
    assert isinstance(there, State)
    assert there.positions[:, 0].tolist() == [pytest.approx(0.05), pytest.approx(1.2)]
    assert cost == 1
    there, cost = drives.carried(Springs(definite=False), start, drive, 0.5)
    assert there.positions[:, 0].tolist() == [0.0, pytest.approx(1.2)]
    assert drives.carried(None, start, forces(np.zeros((2, 6))), 0.5) == (start, 0)
    monkeypatch.setattr(drives, "_folded", lambda *_: True)
    with pytest.raises(NotConverged, match="Move them by less") as told:
        drives.carried(Springs(), start, drive, 0.5)
    assert (told.value.state, told.value.iterations) == (start, 1)


@pytest.mark.parametrize(
    ("before", "after", "mean", "turns"),
    [
        (1.0, 1.0, 1.0, False),
        (1.0, 3.0, 1.0, False),  # x³ + a little: as steep as it gets without turning
        (3.9, 1.0, 1.0, False),
        (4.1, 1.0, 1.0, True),
        (1.0, 4.1, 1.0, True),
        (1.0, 1.0, -0.1, True),
        (-1.0, -1.0, 0.1, True),
        (1.0, -1.0, 0.0, False),
        (1.0, 4.0, 1.0, False),  # stands still at one place
        (10.0, 1.0, 5.0, False),  # its slope falls below nothing beyond its end only …
        (1.0, 10.0, 5.0, False),  # … and before its begin
        (2.0, 23.5 * 2.0, 6.0 * 2.0, True),  # von Mises' x (1 - x) (1 - x/2) from 0 to 5
    ],
)
def test_a_cubic_turns_round_between_its_ends_where_its_slope_has_both_signs(before, after, mean, turns):
    assert turns_between(before, after, mean) is turns
    along = np.linspace(0.0, 1.0, 2001)
    slope = before + along * (6.0 * mean - 4.0 * before - 2.0 * after)
    slope = slope + 3.0 * along**2 * (before + after - 2.0 * mean)
    if before * after > 0.0:
        assert bool((slope * before < 0.0).any()) is turns
