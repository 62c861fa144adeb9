"""Loads that increments don't get to: masts whose guys go slack or taut, and stand-ins for the path."""

from types import SimpleNamespace

import numpy as np
import pytest

from shellform.errors import NotConverged
from shellform.structure.answers.analysis import analyse
from shellform.structure.solve import settled
from shellform.structure.solve.equilibrium import Equilibrium
from shellform.structure.solve.loading import BranchPart
from shellform.structure.solve.settled import settle
from tests.structure.test_analysis import stayed_mast


@pytest.mark.parametrize("seed", [18, 28, 93, 164, 199, 281, 349, 369])
def test_a_mast_whose_guys_go_slack_or_taut_is_on_its_branch_by_relaxation_as_by_its_path(seed):
    """Of 420 such masts five were told off it, where no increment got over a kink."""
    model = stayed_mast(seed)
    found, expected = analyse(model), analyse(model, method="path")
    assert (found.on_branch, expected.on_branch) == (True, True)
    assert found.warnings == ()
    assert found.increments[0].waypoints[-1].factor == 1.0
    np.testing.assert_allclose(
        found.equilibrium.state.positions, expected.equilibrium.state.positions, rtol=0.0, atol=1e-7
    )


def told(state, *, stable=True, spent=1):
    return Equilibrium(state, 0.0, 0.0, spent, stable, 0 if stable else 1)


DRIVE = SimpleNamespace(load=np.full((1, 6), 4.0), imposed=np.zeros((1, 6)))
DRIVE.at = lambda factor: factor * DRIVE.load


@pytest.fixture
def part(monkeypatch):
    """Increments that end at half of the way from 1 to 3, and what is asked of the path from there."""
    asked = SimpleNamespace(rests=True, points=[], fails=False, paths=[])

    def follow_branch(assembly, start, drive, **named):
        named["report"](0.5, told("half"))
        return BranchPart(0.5, "half", told("half"), 40)

    def follow(assembly, start, drive, **named):
        asked.paths.append((start, drive.at(0.0)[0, 0], drive.at(1.0)[0, 0], named))
        yield SimpleNamespace(factor=0.0, equilibrium=told("half", spent=1))
        yield from asked.points
        if asked.fails:
            raise NotConverged("lost", iterations=9)

    monkeypatch.setattr(settled, "follow_branch", follow_branch)
    monkeypatch.setattr(settled, "follow", follow)
    monkeypatch.setattr(settled, "at_rest", lambda assembly, state, load: asked.rests)
    monkeypatch.setattr(BranchPart, "ended", lambda self, *_, **__: self)
    asked.seen = []
    asked.settled = lambda: settle(
        SimpleNamespace(free=np.arange(6)),
        "start",
        DRIVE,
        begin=1.0,
        end=3.0,
        tolerance=1e-7,
        report=lambda share, found: asked.seen.append((share, found.state, found.factorisations)),
    )
    return asked


def point(factor, *, stable=True, spent=1):
    return SimpleNamespace(factor=factor, equilibrium=told(f"at {factor}", stable=stable, spent=spent))


def test_where_the_path_comes_to_the_whole_load_the_branch_has_not_ended(part):
    part.points = [point(0.5, spent=6), point(1.0, spent=11)]
    found = part.settled()
    assert (found.share, found.state, found.factorisations) == (1.0, "at 1.0", 51)
    assert part.seen == [(0.5, "half", 1), (0.75, "at 0.5", 5), (1.0, "at 1.0", 5)]  # each one's own
    ((start, begin, end, named),) = part.paths
    assert (start, begin, end) == ("half", 8.0, 12.0)
    assert named == {"first": 1 / 32, "tolerance": 1e-7, "events": False, "heeding": True}


def test_where_the_path_meets_an_unstable_point_the_branch_has_ended(part):
    part.points = [point(0.5, spent=6), point(0.7, stable=False, spent=8), point(1.0, spent=11)]
    found = part.settled()
    assert (found.share, found.state, found.factorisations) == (0.5, "half", 48)
    assert part.seen == [(0.5, "half", 1)]


def test_where_the_path_can_not_be_followed_it_tells_nothing(part):
    part.points, part.fails = [point(0.5, spent=6)], True
    assert (part.settled().share, part.settled().factorisations) == (0.5, 49)


def test_from_a_state_that_is_not_at_rest_no_path_is_followed(part):
    part.rests = False
    assert (part.settled().share, part.paths) == (0.5, [])
