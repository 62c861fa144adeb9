"""Where walls are tried as a way out, and with which height they are offered."""

from types import SimpleNamespace

import numpy as np
import pytest

from shellform.errors import InputError, NotConverged
from shellform.run import first_refusal
from shellform.run.sizes import DesignWish
from shellform.run.unbuildable import Tips, Unbuildable, Why

STANDS = object()  # a design


def refusal(why):
    return Unbuildable("no", why=why, where="rod", remedy="Round it.", spacing=0.5, radius=2.0)


@pytest.mark.parametrize(
    ("error", "help_"),
    [
        (refusal(Why.STRENGTH), True),
        (refusal(Why.CURVATURE), False),
        (refusal(Why.NET), False),
        (Tips("tips", where="edges"), True),
        (NotConverged("falls"), True),
        (InputError("is flat", where="surface"), False),
    ],
)
def test_walls_may_help_what_tips_falls_or_breaks_where_beams_carry_its_outer_edge(monkeypatch, error, help_):
    def stretch(kind, opening):
        return SimpleNamespace(kind=kind, opening=opening)

    edges = [stretch("ground", False), stretch("beam", False), stretch("beam", True)]
    monkeypatch.setattr(first_refusal, "stretches_of", lambda surface: edges)
    assert first_refusal._walls_may_help(error, None, DesignWish()) is help_
    assert not first_refusal._walls_may_help(error, None, DesignWish(edges="wall")), "they stand already"
    edges.pop(1)
    assert not first_refusal._walls_may_help(error, None, DesignWish()), "round an opening they don't"


@pytest.mark.parametrize(
    ("error", "rod", "instead"),
    [
        (refusal(Why.NET), None, True),
        (refusal(Why.STRENGTH), None, True),
        (refusal(Why.STRENGTH), "gfrp_rods", False),  # to leave the rods out is another way
        (Tips("tips", where="edges", remedy="Bring it down."), None, False),
        (NotConverged("falls", remedy="Give it a rise."), None, False),
    ],
)
def test_a_way_out_stands_instead_of_a_radius_that_nobody_tried_and_beside_other_remedies(
    error, rod, instead
):
    """A groin vault said "Or: Round the surface there to 1.5 m or more", of which 1.85 and 3.14 m had been
    tried in vain before 5.34."""
    way_out = first_refusal.WayOut(STANDS, DesignWish(rod=rod), "The nearest is there", None)
    told = first_refusal.Refused(error, way_out).offered
    other = "" if instead else f" Or: {error.remedy}"
    assert told.remedy == f"The nearest is there. --way-out goes on so at once.{other}"
    assert first_refusal.Refused(error).offered is error


@pytest.mark.parametrize("stands", [True, False])
def test_walls_are_offered_with_their_height_where_a_design_stands_on_them(monkeypatch, stands):
    tried, said = [], []

    def search(surface, wish, say, allowance):
        tried.append(wish.edges)
        if not stands:
            raise NotConverged("falls")
        return STANDS

    monkeypatch.setattr(first_refusal, "standing_design", search)
    points = np.array([[0.0, 0.0, 1.5], [1.0, 0.0, 0.25], [0.0, 1.0, 9.0]])
    surface = SimpleNamespace(vertices=points, boundary=[np.array([0, 1])])
    found = first_refusal._on_walls(surface, DesignWish(), said.append, first_refusal.Allowance(10))
    assert tried == ["wall"]
    if not stands:
        assert found is None
        assert said == ["on walls: falls"]
        return
    assert found.design is STANDS
    assert found.wish.edges == "wall"
    assert "up to 1.25 m above the lowest of its edge" in found.told
    over = first_refusal._on_walls(surface, DesignWish(), said.append, first_refusal.Allowance(0))
    assert over is None
    assert "left untried" in said[-1]
