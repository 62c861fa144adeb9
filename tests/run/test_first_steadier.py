"""What becomes of a first design whose structures stray too far as built."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from shellform.run import first_steadier, first_trial
from shellform.run.first_edges import edge_choices
from shellform.run.first_steadier import steadier, strays, strays_told, with_strays
from shellform.run.first_trial import DRAWN, FirstDesign, FirstParts, Followed
from shellform.run.sizes import Placed, rope_for, wished
from shellform.run.unbuildable import Obstacle, Why

RODS, STIFF = wished("gfrp_rods/32 mm")[0], wished("gfrp_rods/40 mm")[0]
EDGES = edge_choices(RODS)
GRID = SimpleNamespace(lattice=range(7))
PLACED = Placed(SimpleNamespace(edges=("line",), grid=GRID), 45.0, (0.0, 0.0))
BARE = Placed(SimpleNamespace(edges=(), grid=GRID), 45.0, (0.0, 0.0))
CAME = Followed(1.5, 0.5, 0.3, 0.0, 0.0, 0.8, np.zeros(3), np.zeros(3))
FALLS = Obstacle(Why.SCATTER, 0.5, 0.05, 1.5)


def design(stray, edge=EDGES[0], placed=PLACED):
    """One whose structures stray by so many metres, where it is looked at."""
    parts = FirstParts(RODS, edge, 0.996, rope_for(1.0), swivels=False)
    return FirstDesign(0.5, "why", placed, parts, 0.05, CAME, DRAWN, DRAWN, 0.03, ("before",), stray)


class Trials:
    """Stands in for what is solved: how far structures of a design of some rods and edge beams stray; None
    where it falls. 0.28 m may be."""

    def __init__(self, monkeypatch, stray, rods=()):
        self.stray, self.rods = stray, list(rods)
        self.solved, self.times, self.spent, self.over = [], [], 0, False
        monkeypatch.setattr(first_steadier, "may_stray", lambda surface, thickness: 0.28)
        monkeypatch.setattr(
            first_steadier, "straying", lambda net, surface, parts, thickness: self.stray[self.key(parts)]
        )

    def with_parts(self, before, parts):
        self.solved.append(self.key(parts))
        return FALLS if self.stray[self.key(parts)] is None else replace(before, parts=parts, strays=None)

    def stiffer(self, before, times):
        self.times.append(times)
        return self.rods.pop(0) if self.rods else None

    def spend(self, crossings):
        self.spent += crossings

    @staticmethod
    def key(parts):
        return {RODS: "rods", STIFF: "stiff"}[parts.choice], edge_choices(parts.choice).index(parts.edge)

    def found(self, before, said=None):
        say = (lambda text: None) if said is None else said.append
        return steadier(before, None, self.stiffer, self.with_parts, self, say)


def test_a_shell_whose_structures_stray_no_farther_than_they_may_is_left_as_it_is(monkeypatch):
    trials = Trials(monkeypatch, {("rods", 0): 0.28})
    near = with_strays(design(None), None)
    assert near.strays == 0.28
    assert not strays(near, None)
    assert strays_told(near, None) == strays_told(design(None), None) == ""
    assert trials.found(near) is near
    assert trials.solved == []


def test_it_gets_the_lightest_edge_beams_with_which_its_structures_stray_no_farther_than_they_may(
    monkeypatch,
):
    trials, said = Trials(monkeypatch, {("rods", 1): 0.39, ("rods", 2): 0.27, ("rods", 3): 0.1}), []
    found = trials.found(design(0.49), said)
    assert (found.parts.edge, found.strays) == (EDGES[2], 0.27)
    assert said == [
        f"structures drawn as built stray by up to {mm} mm, where 280 mm may be" for mm in (490, 390)
    ]
    assert trials.spent == 14


@pytest.mark.parametrize("heavier", [0.42, None])
def test_where_heavier_edge_beams_help_little_or_fall_stiffer_rods_are_tried(monkeypatch, heavier):
    trials = Trials(monkeypatch, {("rods", 2): heavier, ("stiff", 1): 0.2}, [STIFF])
    found = trials.found(design(0.49, EDGES[1]))
    assert (found.parts.choice, found.parts.edge) == (STIFF, edge_choices(STIFF)[1])
    assert trials.times == [pytest.approx(0.49 / 0.28)]
    assert trials.solved == [("rods", 2), ("stiff", 1)]


def test_a_shell_without_edge_beams_gets_stiffer_rods_and_the_same_are_tried_once(monkeypatch):
    trials = Trials(monkeypatch, {("stiff", 0): 0.45}, [STIFF, STIFF])
    before = design(0.49, placed=BARE)
    assert trials.found(before) is before
    assert trials.solved == [("stiff", 0)]
    assert trials.times == [pytest.approx(0.49 / 0.28), pytest.approx((0.49 / 0.28) ** 0.5)]


def test_where_nothing_brings_it_so_far_what_strays_least_stays_and_none_is_tried_without_work(monkeypatch):
    trials = Trials(monkeypatch, {("rods", 1): 0.39, ("rods", 2): 0.38})
    assert trials.found(design(0.49)).parts.edge == EDGES[1]
    trials = Trials(monkeypatch, {})
    trials.over, before = True, design(0.49)
    assert trials.found(before) is before


def test_how_far_structures_stray_is_what_design_draws_of_the_initial_one(monkeypatch):
    """The worst of the twenty that stand, with errors as usual, under the design load."""

    class Bench:
        def __init__(self, nominal):
            assert nominal == (0.997, 10.0)

        def load_numbers(self, tolerances, *, seed, numbers):
            assert (tolerances, seed, numbers) == ("usual", 0, range(20))
            far = {3: 0.3, 5: np.inf}
            return [SimpleNamespace(stands=n != 5, far=far.get(n, 0.1)) for n in numbers]

    shell = SimpleNamespace(design=lambda rest_ratio: rest_ratio)
    monkeypatch.setattr(first_trial, "first_shell", lambda *_: (shell, 10.0))
    monkeypatch.setattr(first_trial, "perfect", lambda shell, design, load: (design, load))
    monkeypatch.setattr(first_trial, "default_tolerances", lambda shell: "usual")
    monkeypatch.setattr(first_trial, "Workshop", Bench)
    assert first_trial.straying(None, None, SimpleNamespace(rest_ratio=0.997), 0.05) == 0.3
