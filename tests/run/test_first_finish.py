from types import SimpleNamespace

import numpy as np
import pytest

from shellform.run import first_finish
from shellform.run.first_edges import edge_choices
from shellform.run.first_finish import came_to, straighter, with_room
from shellform.run.first_trial import DRAWN, FirstDesign, FirstParts, Followed
from shellform.run.sizes import Placed, Rope, rope_for, thicker, wished
from shellform.run.unbuildable import Obstacle, Why

RODS = wished("gfrp_rods/32 mm")[0]
EDGES = edge_choices(RODS)
PLACED = Placed(SimpleNamespace(edges=("line",)), 45.0, (0.0, 0.0))


def design(sag=0.0, edge=EDGES[0], rope=None):
    """One that stands on these edge beams, which sag by so many metres."""
    parts = FirstParts(RODS, edge, 0.996, rope or rope_for(1.0), swivels=False)
    tried = Followed(1.5, 0.5, 0.3, sag, 0.8, np.zeros(3), np.zeros(3))
    return FirstDesign(0.5, "why", PLACED, parts, 0.05, tried, DRAWN, DRAWN, 0.03, ("before",))


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
    monkeypatch.setattr(first_finish, "may_come_off", lambda surface, thickness: off)
    found = [FALLS if sag is None else design(sag, edge) for sag, edge in zip(sags, EDGES, strict=False)]

    def with_edges(placed, choice, edge, spacing, thickness):
        assert (placed, choice, spacing, thickness) == (PLACED, RODS, 0.5, 0.05)
        return found[EDGES.index(edge)]

    allowed = SimpleNamespace(over=False)
    assert straighter(found[0], None, with_edges, allowed) is found[kept]
    over = SimpleNamespace(over=True)
    assert straighter(found[0], None, with_edges, over) is found[0], "no work is left for it"


def test_heavier_edge_beams_are_those_after_the_ones_with_which_a_design_stands(monkeypatch):
    monkeypatch.setattr(first_finish, "may_come_off", lambda surface, thickness: 0.01)
    asked = []
    straighter(
        design(0.3, EDGES[2]),
        None,
        lambda placed, choice, edge, *_: asked.append(edge),
        SimpleNamespace(over=False),
    )
    assert asked == [EDGES[3]]


@pytest.mark.parametrize(
    ("factor", "standing", "kept"), [(1.5, DRAWN, True), (1.5, DRAWN - 1, False), (1.4, DRAWN, False)]
)
def test_a_design_gets_thicker_strands_where_it_stands_with_them_too(monkeypatch, factor, standing, kept):
    tried = Followed(factor, 0.4, 0.2, 0.034, 0.5, np.zeros(3), np.zeros(3))
    monkeypatch.setattr(first_finish, "followed", lambda net, surface, parts, thickness: tried)
    monkeypatch.setattr(first_finish, "drawn_standing", lambda net, surface, parts, thickness: standing)
    said, before = [], design(0.05)
    found = with_room(before, None, said.append)
    assert found.told == ("before", *said)
    assert said[0].startswith("strands of 10 mm instead of 6, for the search: stands up to 1.")
    assert "edges 34 mm off" in said[0]
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
    tried = Followed(1.5, 0.5, 0.3, 0.3686, 0.8, np.zeros(3), np.zeros(3))
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
    tried = Followed(factor, 0.5, 0.3, 0.0, pull, np.zeros(3), np.zeros(3))
    placed = Placed(SimpleNamespace(edges=()), 45.0, (0.0, 0.0))
    assert (
        came_to(placed, tried) == f"stands up to {factor:.2f} × its load, rods at 50% of their strength{told}"
    )
