"""What becomes of a first design whose rods bear more than their strength on the way up."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from shellform.records.raising import SCAFFOLD, WayUpRecord
from shellform.run import first_raised
from shellform.run.first_edges import edge_choices
from shellform.run.first_raised import breaks, raisable
from shellform.run.first_trial import DRAWN, FirstDesign, FirstParts, Followed
from shellform.run.sizes import Placed, rope_for, wished
from shellform.run.unbuildable import Obstacle, Why

RODS = [wished(f"gfrp_rods/{size} mm")[0] for size in (45, 40, 35, 32, 30)]
PLACED = Placed(SimpleNamespace(edges=("line",), grid=SimpleNamespace(lattice=range(7))), 45.0, (0.0, 0.0))
CAME = Followed(1.5, 0.5, 0.3, 0.0, 0.0, 0.8, np.zeros(3), np.zeros(3))
FALLS = Obstacle(Why.SCATTER, 0.5, 0.05, 1.5)
LOST = WayUpRecord("supports", False, lost="it folds")


def design(choice=RODS[0], stage=1):
    parts = FirstParts(choice, edge_choices(choice)[stage], 0.996, rope_for(1.0), swivels=False)
    return FirstDesign(0.5, "why", PLACED, parts, 0.05, CAME, DRAWN, DRAWN, 0.03, ("before",), 0.1)


class Trials:
    """Stands in for what is solved: what share of their strength rods bear on the way up, by their place
    among `RODS`; None where the design falls with them."""

    def __init__(self, monkeypatch, borne):
        self.borne, self.shares, self.solved, self.spent, self.over = borne, [], [], 0, False
        monkeypatch.setattr(
            first_raised, "first_shell", lambda net, surface, parts, thickness: (self.shell(parts), None)
        )
        monkeypatch.setattr(
            first_raised, "raised", lambda shell, made: (LOST, WayUpRecord(SCAFFOLD, True, made))
        )
        monkeypatch.setattr(first_raised, "with_strays", lambda found, surface: replace(found, strays=0.2))

    def shell(self, parts):
        return SimpleNamespace(design=lambda rest_ratio: self.borne[RODS.index(parts.choice)])

    def thinner(self, before, share):
        self.shares.append(share)
        return RODS[min(RODS.index(before.parts.choice) + 1, len(self.borne) - 1)]

    def with_parts(self, before, parts):
        self.solved.append(RODS.index(parts.choice))
        assert parts.edge == edge_choices(parts.choice)[1], "edge beams as much stiffer than the lightest"
        return FALLS if self.borne[self.solved[-1]] is None else replace(before, parts=parts, ways_up=())

    def spend(self, crossings, times):
        self.spent += times * crossings

    def found(self):
        said = []
        return raisable(design(), None, self.thinner, self.with_parts, self, said.append), said


@pytest.mark.parametrize("borne", [0.7, 1.0, None])
def test_a_design_whose_rods_bear_their_way_up_is_left_as_it_is_with_what_they_bear(monkeypatch, borne):
    """So is one without any stable way up, which thinner rods don't give."""
    trials = Trials(monkeypatch, [borne, 0.5])
    found, said = trials.found()
    assert found.parts == design().parts
    assert found.ways_up == (LOST, WayUpRecord(SCAFFOLD, True, borne))
    assert found.strays == 0.1
    assert (said, trials.solved) == ([], [])
    assert trials.spent == 8 * 7
    assert not breaks(found)


def test_it_gets_the_first_thinner_rods_that_bear_it_and_its_straying_is_looked_at_anew(monkeypatch):
    trials = Trials(monkeypatch, [1.25, 1.05, 0.97])
    found, said = trials.found()
    assert found.parts.choice == RODS[2]
    assert found.ways_up[-1].utilisation == 0.97
    assert found.strays == 0.2
    assert trials.shares == [pytest.approx(1.0 / 1.25), pytest.approx(1.0 / 1.05)]
    assert [each.split(" of their strength")[0] for each in said] == [
        f"On the way up rods bear up to {share} %" for share in (125, 105)
    ]
    assert trials.spent == 3 * 8 * 7


@pytest.mark.parametrize(
    ("borne", "solved"),
    [
        ([1.05], []),  # no thinner ones
        ([1.05, None, 0.9], [1]),  # thinner ones fall
        ([1.3, 1.2, 1.1, 1.05, 0.9], [1, 2, 3]),  # none of those tried bear it
    ],
)
def test_where_no_thinner_rods_do_it_stays_as_it_is_and_says_so(monkeypatch, borne, solved):
    trials = Trials(monkeypatch, borne)
    found, said = trials.found()
    assert found.parts == design().parts
    assert breaks(found)
    assert trials.solved == solved
    assert said


def test_nothing_more_is_tried_once_the_work_is_done(monkeypatch):
    trials = Trials(monkeypatch, [1.05, 0.9])
    trials.over = True
    assert trials.found()[0].parts == design().parts
    assert trials.solved == []
