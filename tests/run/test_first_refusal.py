"""Where walls are tried as a way out, and with which height they are offered."""

from types import SimpleNamespace

import numpy as np
import pytest

from shellform.errors import InputError, NotConverged
from shellform.run import first_refusal
from shellform.run.sizes import DesignWish
from shellform.run.unbuildable import Falls, Tips, Unbuildable, Why

STANDS = object()  # a design


def bearing(thickness):
    """A design with so much concrete, m."""
    return SimpleNamespace(thickness=thickness)


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
        (Falls("falls", remedy="Rods bear --thickness 0.02.", design=bearing(0.02)), None, False),
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

    def search(surface, wish, say, allowance, *, finer=False):
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


@pytest.mark.parametrize(
    ("carried", "stands", "strays", "work", "found"),
    [
        (True, True, 0.11, 1000, True),
        (True, True, 0.29, 1000, False),  # there too
        (True, False, 0.0, 1000, False),
        (False, True, 0.11, 1000, False),  # its edge stands on the ground
        (True, True, 0.11, 0, False),
    ],
)
def test_walls_are_offered_to_what_strays_as_built_where_it_strays_less_on_them(
    monkeypatch, carried, stands, strays, work, found
):
    design = SimpleNamespace(strays=strays, thickness=0.05)
    offer = first_refusal.WayOut(STANDS, DesignWish(edges="wall"), "With walls")
    monkeypatch.setattr(first_refusal, "_on_edge_beams", lambda surface, wish: carried)
    monkeypatch.setattr(first_refusal, "_on_walls", lambda *_: offer if stands else None)
    monkeypatch.setattr(first_refusal, "with_strays", lambda design_, surface: design)
    monkeypatch.setattr(first_refusal, "strays", lambda design_, surface: design_.strays > 0.28)
    steady = first_refusal.steadier_on_walls(None, DesignWish(), print, first_refusal.Allowance(work))
    assert (steady is not None) is found
    if steady is not None:
        assert (steady.design, steady.wish.edges) == (design, "wall")


@pytest.mark.parametrize(
    ("stands", "asked", "work", "tried"),
    [
        (True, None, 1000, [0.009]),
        (False, None, 1000, [0.009]),
        (True, 0.03, 1000, []),  # another was asked for
        (True, None, 0, []),
    ],
)
def test_of_a_shell_that_falls_the_layer_that_stood_is_tried_from_the_start_before_it_is_offered(
    monkeypatch, tmp_path, stands, asked, work, tried
):
    """A pillow of 3 m that stands on the ground all round was told to bear 9 mm, and --way-out led to no
    case."""
    asked_for = []

    def search(surface, wish, say, allowance, *, finer=False):
        asked_for.append(wish.thickness)
        if not stands:
            raise NotConverged("falls")
        return STANDS

    monkeypatch.setattr(first_refusal, "standing_design", search)
    monkeypatch.setattr(first_refusal, "stretches_of", lambda surface: [])
    known = bearing(0.009) if work else None
    falls = Falls("falls", remedy="Rods bear --thickness 0.009.", design=known)
    whole = first_refusal.Allowance(work)
    found = first_refusal.with_ways_out(
        falls, None, DesignWish(thickness=asked), tmp_path / "a.toml", lambda text: None, whole
    )
    assert asked_for == tried
    if tried and stands:
        assert found.way_out.wish.thickness == 0.009
        assert found.offered.remedy == (
            "With --thickness 0.009 this goes on: pour that first, and the rest when it has hardened. "
            "--way-out goes on so at once."
        )
    elif tried:
        assert found.offered.remedy.startswith("Give the surface more rise"), "not what was tried in vain"
    else:
        assert found.offered is falls


def test_what_was_found_to_stand_with_less_concrete_is_the_way_out_where_the_work_is_done(
    tmp_path, monkeypatch
):
    """Of a shell of 7 m, forty structures of which took 75 s, no work was left to look for it again."""

    def search(surface, wish, say, allowance, *, finer=False):
        allowance.spend(takes["work"])
        allowance.leave(0.3)  # for thinner concrete
        raise NotConverged("falls")

    monkeypatch.setattr(first_refusal, "standing_design", search)
    monkeypatch.setattr(first_refusal, "stretches_of", lambda surface: [])
    known = bearing(0.013)
    falls = Falls("falls", remedy="Rods bear --thickness 0.013.", design=known)
    takes = {}
    for work, takes["work"], goes_on in ((0, 0, True), (1000, 900, True), (1000, 100, False)):
        found = first_refusal.with_ways_out(
            falls, None, DesignWish(), tmp_path / "a.toml", lambda text: None, first_refusal.Allowance(work)
        )
        assert (found.way_out is not None) is goes_on, "with work left it was looked for in vain"
        if goes_on:
            assert found.way_out.design is known
            assert found.way_out.wish.thickness == 0.013
            assert found.offered.remedy.startswith("With --thickness 0.013 this goes on")
