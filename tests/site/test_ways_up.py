"""Which ways up are tried, and when no other is."""

from types import SimpleNamespace

import numpy as np
import pytest

from shellform.errors import NotConverged
from shellform.site import ways_up as module
from shellform.site.erection import SCAFFOLD, SUPPORTS, erect
from shellform.site.ways_up import ways_up


def test_where_rods_bear_the_usual_way_up_no_other_is_tried(dome):
    (way,) = ways_up(dome, dome.design())
    assert (way.by, way.every, way.bears) == (SUPPORTS, False, True)
    usual = erect(dome, dome.design())
    assert way.erection.utilisation == usual.utilisation < 1.0


@pytest.mark.parametrize(
    ("shares", "tried"),
    [
        ((1.0,), [True]),
        ((1.001, 1.0), [False, True]),
        ((1.001, 1.002, 0.9), [False, False, True]),
        ((1.001, 1.002, 1.1), [False, False, False]),
    ],
)
def test_where_rods_break_on_it_scaffolds_are_tried_under_every_crossing_and_under_every_second_one(
    dome, monkeypatch, shares, tried
):
    asked, left = [], list(shares)

    def raised(shell, design, **way):
        asked.append(way)
        return SimpleNamespace(utilisation=left.pop(0))

    monkeypatch.setattr(module, "erect", raised)
    found = ways_up(dome, dome.design())
    assert [each.bears for each in found] == tried
    assert asked[0] == {"by": SUPPORTS, "props": None}
    for way in asked[1:2]:
        assert way["by"] == SCAFFOLD
        np.testing.assert_array_equal(way["props"], dome.net.grid.crossing_nodes[:, 0])
    assert asked[2:] in ([], [{"by": SCAFFOLD, "props": None}])


def test_the_usual_way_up_is_not_tried_twice(dome, monkeypatch):
    monkeypatch.setattr(module, "usual_way_up", lambda shell: SCAFFOLD)
    monkeypatch.setattr(module, "erect", lambda shell, design, **way: SimpleNamespace(utilisation=2.0))
    assert [(way.by, way.every) for way in ways_up(dome, dome.design())] == [
        (SCAFFOLD, False), (SCAFFOLD, True)
    ]  # fmt: skip


def test_ways_on_which_no_stable_path_leads_up_say_why_and_bear_nothing(dome, monkeypatch):
    def lost(shell, design, **way):
        raise NotConverged(f"It snaps by {way['by']}", remedy="Choose another")

    monkeypatch.setattr(module, "erect", lost)
    found = ways_up(dome, dome.design())
    assert [way.lost for way in found] == [
        "It snaps by supports",
        "It snaps by scaffold",
        "It snaps by scaffold",
    ]
    assert not any(way.bears for way in found)
