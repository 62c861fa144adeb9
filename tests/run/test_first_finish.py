from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from shellform.run import first_finish
from shellform.run.first_edges import edge_choices
from shellform.run.first_finish import came_to, far_told, nearer, straighter, too_far, with_room
from shellform.run.first_trial import DRAWN, FirstDesign, FirstParts, FirstSample, Followed
from shellform.run.sizes import Placed, Rope, rope_for, thicker, wished
from shellform.run.unbuildable import Obstacle, Why

RODS = wished("gfrp_rods/32 mm")[0]
EDGES = edge_choices(RODS)
GRID = SimpleNamespace(lattice=range(7))
PLACED = Placed(SimpleNamespace(edges=("line",), grid=GRID), 45.0, (0.0, 0.0))
STIFF, STIFFER = wished("gfrp_rods/40 mm")[0], wished("gfrp_rods/50 mm")[0]


def design(sag=0.0, edge=EDGES[0], rope=None, off=0.0):
    """One that stands on these edge beams, which sag by so many metres; its shell lies so many `off`."""
    parts = FirstParts(RODS, edge, 0.996, rope or rope_for(1.0), swivels=False)
    return FirstDesign(0.5, "why", PLACED, parts, 0.05, came(off, sag), DRAWN, DRAWN, 0.03, ("before",))


def came(off, sag=0.0, factor=1.5):
    """What a design came to that lies so many metres `off`."""
    return Followed(factor, 0.5, 0.3, sag, off, 0.8, np.zeros(3), np.zeros(3))


FALLS = Obstacle(Why.SCATTER, 0.5, 0.05, 1.5)


@pytest.mark.parametrize(
    ("sags", "off", "kept"),
    [
        ([0.051, 0.0], 0.025, 1),  # more than twice what the shape may be off
        ([0.049, 0.0], 0.025, 0),
        ([0.3, 0.2, 0.1, 0.0], 0.025, 3),  # and on
        ([0.3, 0.2, 0.1, 0.06], 0.025, 3),  # as far as there are any
        ([0.3, 0.2, 0.17, 0.0], 0.025, 1),  # the third spares too little
        ([0.3, None, 0.0], 0.025, 0),  # the second falls
        ([0.09, 0.0], 0.05, 0),  # a wide shell
    ],
)
def test_edge_beams_are_made_heavier_while_edges_sag_far_and_that_helps(monkeypatch, sags, off, kept):
    monkeypatch.setattr(first_finish, "may_sag", lambda surface, thickness: 2.0 * off)
    found = [FALLS if sag is None else design(sag, edge) for sag, edge in zip(sags, EDGES, strict=False)]

    def with_edges(placed, choice, edge, spacing, thickness):
        assert (placed, choice, spacing, thickness) == (PLACED, RODS, 0.5, 0.05)
        return found[EDGES.index(edge)]

    allowed = SimpleNamespace(over=False)
    assert straighter(found[0], None, with_edges, allowed) is found[kept]
    over = SimpleNamespace(over=True)
    assert straighter(found[0], None, with_edges, over) is found[0], "no work is left for it"


def test_heavier_edge_beams_are_those_after_the_ones_with_which_a_design_stands(monkeypatch):
    monkeypatch.setattr(first_finish, "may_sag", lambda surface, thickness: 0.02)
    asked = []
    straighter(
        design(0.3, EDGES[2]),
        None,
        lambda placed, choice, edge, *_: asked.append(edge),
        SimpleNamespace(over=False),
    )
    assert asked == [EDGES[3]]


class Trials:
    """Stands in for what is solved: how far a design of some edge beams and rods lies off on the same net
    (`looks`), and as it is then solved and drawn (`drawn`, else as it looked); None where it falls. Keeps
    what was asked."""

    def __init__(self, monkeypatch, looks, drawn=(), rods=(None, None)):
        self.looks, self.drawn, self.rods = looks, {**looks, **dict(drawn)}, list(rods)
        self.looked, self.solved, self.times, self.spent = [], [], [], 0
        monkeypatch.setattr(first_finish, "may_come_off", lambda surface, thickness: 0.02)
        monkeypatch.setattr(first_finish, "followed", self.followed)

    def followed(self, net, surface, parts, thickness):
        key = self.key(parts)
        self.looked.append(key)
        return came(0.0, factor=1.4) if self.looks[key] is None else came(self.looks[key])

    def with_parts(self, design, parts):
        key = self.key(parts)
        self.solved.append(key)
        if self.drawn[key] is None:
            return FALLS
        return replace(design, parts=parts, tried=came(self.drawn[key]))

    def stiffer(self, design, times):
        self.times.append(times)
        return self.rods.pop(0) if self.rods else None

    def spend(self, crossings):
        self.spent += crossings

    over = False

    @staticmethod
    def key(parts):
        """Of the rods which, and of their edge beams the how manieth."""
        rods = {RODS: "rods", STIFF: "stiff", STIFFER: "stiffer"}[parts.choice]
        return rods, edge_choices(parts.choice).index(parts.edge)

    def found(self, before, said=None):
        say = (lambda text: None) if said is None else said.append
        return nearer(before, None, self.stiffer, self.with_parts, self, say)


def test_a_shell_near_enough_to_its_shape_is_left_as_it_is_and_none_is_told(monkeypatch):
    trials, near = Trials(monkeypatch, {}), design(off=0.0799)
    assert not too_far(near, None)
    assert far_told(near, None) == ""
    assert trials.found(near) is near
    assert trials.looked == trials.solved == []


def test_a_shell_far_off_its_shape_gets_the_lightest_edge_beams_with_which_it_is_near_enough(monkeypatch):
    trials = Trials(monkeypatch, {("rods", 1): 0.2, ("rods", 2): 0.079, ("rods", 3): 0.0})
    said: list[str] = []
    far = design(off=0.295)
    assert far_told(far, None).startswith("the initial design lies 300 mm off under 1.2 × the load, 15 times")
    found = trials.found(far, said)
    assert (found.parts.edge, found.tried.off) == (EDGES[2], 0.079)
    assert trials.looked == [("rods", 1), ("rods", 2)]
    assert trials.solved == [("rods", 2)], "only what is taken is drawn"
    assert trials.spent == 14
    assert ["300 mm off" in each for each in said] == [True]


@pytest.mark.parametrize(
    ("looks", "edge"),
    [
        ({1: 0.2, 2: 0.15, 3: 0.1}, 3),  # as far as there are any
        ({1: 0.2, 2: 0.18}, 1),  # the third spares too little
        ({1: 0.2, 2: None}, 1),  # it falls
        ({1: 0.27}, 0),
    ],
)
def test_where_no_edge_beams_bring_a_shell_near_enough_those_stay_that_bring_it_nearest(
    monkeypatch, looks, edge
):
    trials = Trials(monkeypatch, {**{("rods", k): off for k, off in looks.items()}, ("rods", edge + 1): 0.3})
    assert trials.found(design(off=0.295)).parts.edge == EDGES[edge]


def test_where_edge_beams_do_not_help_stiffer_rods_are_tried_with_such_as_much_stiffer_and_then_half_the_way(
    monkeypatch,
):
    trials = Trials(
        monkeypatch,
        {("rods", 2): 0.3, ("stiffer", 1): 0.05, ("stiff", 1): 0.06},
        {("stiffer", 1): None},  # its net can't be pulled with their gap
        [STIFFER, STIFF],
    )
    found = trials.found(design(edge=EDGES[1], off=0.32))
    assert trials.times == [pytest.approx(4.0), pytest.approx(2.0)]
    assert trials.solved == [("stiffer", 1), ("stiff", 1)]
    assert (found.parts.choice, found.parts.edge) == (STIFF, edge_choices(STIFF)[1])


def test_rods_that_look_no_nearer_are_not_solved_and_none_is_tried_without_work_left(monkeypatch):
    trials = Trials(monkeypatch, {("rods", 1): 0.3, ("stiff", 0): 0.27}, rods=[STIFF, STIFF])
    far = design(off=0.295)
    assert trials.found(far) is far
    assert trials.looked == [("rods", 1), ("stiff", 0)]
    trials = Trials(monkeypatch, {})
    trials.over = True
    assert trials.found(far) is far
    assert trials.looked == []


def test_a_shell_without_edge_beams_gets_stiffer_rods(monkeypatch):
    trials = Trials(monkeypatch, {("stiff", 0): 0.06}, rods=[STIFF])
    bare = Placed(SimpleNamespace(edges=(), grid=GRID), 45.0, (0.0, 0.0))
    assert trials.found(replace(design(off=0.295), placed=bare)).parts.choice is STIFF


@pytest.mark.parametrize(
    ("factor", "standing", "kept"), [(1.5, DRAWN, True), (1.5, DRAWN - 1, False), (1.4, DRAWN, False)]
)
def test_a_design_gets_thicker_strands_where_it_stands_with_them_too(monkeypatch, factor, standing, kept):
    tried = Followed(factor, 0.4, 0.2, 0.034, 0.034, 0.5, np.zeros(3), np.zeros(3))
    monkeypatch.setattr(first_finish, "followed", lambda net, surface, parts, thickness: tried)
    monkeypatch.setattr(first_finish, "drawn_standing", lambda *_: FirstSample(standing, 440))
    said, before = [], design(0.05)
    found = with_room(before, None, said.append)
    (told,) = said
    assert told.startswith("strands of 10 mm instead of 6, for the search: stands up to 1.")
    assert "edges 34 mm off" in told
    assert (found.parts.rope.diameter, found.tried) == ((0.010, tried) if kept else (0.006, before.tried))


def test_a_design_with_the_thickest_strand_in_stock_keeps_it():
    thickest = design(rope=Rope(0.016))
    assert with_room(thickest, None, pytest.fail) is thickest


@pytest.mark.parametrize(
    ("diameter", "times", "found"),
    [(0.003, 1.9, 0.005), (0.008, 1.9, 0.012), (0.008, 1.0, 0.010), (0.014, 1.9, 0.016), (0.016, 1.0, None)],
)
def test_a_thicker_strand_has_so_many_times_the_section_or_is_the_last_in_stock(diameter, times, found):
    assert thicker(Rope(diameter), times) == (None if found is None else Rope(found))


@pytest.mark.parametrize(("lines", "told"), [((), ""), (("line",), ", edges 370 mm off")])
def test_what_a_design_came_to_tells_of_edges_where_it_has_any(lines, told):
    tried = Followed(1.5, 0.5, 0.3, 0.3686, 0.3686, 0.8, np.zeros(3), np.zeros(3))
    placed = Placed(SimpleNamespace(edges=lines), 45.0, (0.0, 0.0))
    assert came_to(placed, tried) == "stands up to 1.50 × its load, rods at 50% of their strength" + told


@pytest.mark.parametrize(
    ("factor", "pull", "told"),
    [
        (1.5, 1.01, ", cables at 101% of theirs"),
        (1.5, 1.0, ""),
        (1.49, 1.8, ""),
        (1.6, 1.8, ", cables at 180% of theirs"),
    ],
)
def test_of_cables_is_told_where_they_are_pulled_beyond_their_limit_by_a_design_that_stands(
    factor, pull, told
):
    tried = Followed(factor, 0.5, 0.3, 0.0, 0.0, pull, np.zeros(3), np.zeros(3))
    placed = Placed(SimpleNamespace(edges=()), 45.0, (0.0, 0.0))
    assert (
        came_to(placed, tried) == f"stands up to {factor:.2f} × its load, rods at 50% of their strength{told}"
    )
