"""The search for the angle and the offset of a net, on costs that are given instead of nets."""

import math
from contextlib import contextmanager
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from shellform.errors import InputError
from shellform.net import orientation
from shellform.net.chebyshev import NetSettings
from shellform.net.orientation import TriedNet, best_orientation, cost, oriented_net
from shellform.net.refusal import NoNet, Reason

SETTINGS = NetSettings(spacing=0.1, gap=0.005)


def test_the_cost_is_the_mean_energy_of_a_segment_and_its_joint():
    """(κ s)² / 2, and a tenth of the square of what a right angle lacks, halved."""
    curvature = np.array([[0.2, 0.4], [0.0, 0.6]])
    net = SimpleNamespace(
        curvature=curvature,
        grid=SimpleNamespace(scale=0.5),
        quality=SimpleNamespace(shear_angle=0.5 * np.pi - np.array([0.1, 0.3])),
    )
    assert cost(net) == pytest.approx(0.5 * 0.14 * 0.25 + 0.5 * 0.1 * 0.05)


def searched(monkeypatch, price, settings=None, offset=None):
    """The best trial and the jobs that were asked for, stage by stage; a job costs what `price` says."""
    stages = []

    @contextmanager
    def runner(_surface, _settings, _workers):
        def run(jobs):
            stages.append(jobs)
            return [
                TriedNet(angle, offset, price(angle, offset, method, tail), "none")
                for angle, offset, method, tail in jobs
            ]

        yield run

    monkeypatch.setattr(orientation, "_runner", runner)
    monkeypatch.setattr(orientation, "require_settings", lambda *_: None)
    best, tried = best_orientation(None, settings or SETTINGS, offset=offset)
    return best, tried, stages


def test_the_best_of_twelve_compass_nets_are_pulled_and_the_best_turned_by_half_a_step_and_shifted(
    monkeypatch,
):
    """Compass nets cost least at 30° and pulled ones at 20°, with half a spacing of v less."""

    def price(angle, offset, method, tail):
        assert tail == 0
        degrees = math.degrees(angle)
        if method == "compass":
            return abs(degrees - 30.0) + 1.0
        return abs(degrees - 20.0) + 1.0 - offset[1] + 0.1 * offset[0]

    best, tried, stages = searched(monkeypatch, price)
    degrees = [[math.degrees(job[0]) for job in stage] for stage in stages]
    assert degrees[0] == pytest.approx(7.5 * np.arange(12))
    assert sorted(degrees[1]) == pytest.approx([15.0, 22.5, 30.0, 37.5])
    assert degrees[2] == pytest.approx([18.75, 26.25])
    assert degrees[3] == pytest.approx([18.75] * 3)
    assert [job[1] for job in stages[3]] == [(0.5, 0.0), (0.0, 0.5), (0.5, 0.5)]
    assert [stage[0][2] for stage in stages] == ["compass", "pull", "pull", "pull"]
    assert math.degrees(best.angle) == pytest.approx(18.75)
    assert best.offset == (0.0, 0.5)
    assert best.cost == pytest.approx(1.75)
    assert len(tried) == 9


@pytest.mark.parametrize(("spacing_v", "last"), [(None, 82.5), (0.1, 82.5), (0.2, 165.0)])
def test_angles_go_round_a_quarter_turn_and_round_a_half_where_u_and_v_differ(monkeypatch, spacing_v, last):
    settings = replace(SETTINGS, spacing_v=spacing_v)
    _, _, stages = searched(monkeypatch, lambda angle, *_: angle, settings)
    assert math.degrees(stages[0][-1][0]) == pytest.approx(last)
    step = last / 11.0
    assert [math.degrees(job[0]) for job in stages[2]] == pytest.approx([-0.5 * step, 0.5 * step])


def test_where_no_compass_net_covers_the_surface_longer_rods_are_tried_and_where_no_pull_succeeds_the_best_compass_net_is_begun_at(
    monkeypatch,
):
    best, tried, stages = searched(
        monkeypatch,
        lambda angle, _o, method, tail: angle + 1.0 if (method, tail) == ("compass", 2) else math.inf,
    )
    assert [stage[0][3] for stage in stages] == [0, 2, 2, 2, 2]
    assert (best.angle, best.cost) == (0.0, 1.0)
    assert all(math.isinf(trial.cost) for trial in tried)
    with pytest.raises(InputError, match="no angle gives a net: none"):
        searched(monkeypatch, lambda *_: math.inf)


def test_a_pulled_net_that_no_turn_and_no_shift_betters_is_the_best(monkeypatch):
    best, _, _ = searched(
        monkeypatch, lambda angle, offset, *_: abs(angle - math.radians(45.0)) + sum(offset)
    )
    assert math.degrees(best.angle) == pytest.approx(45.0)
    assert best.offset == (0.0, 0.0)


def test_with_an_offset_that_is_given_the_angle_alone_is_sought(monkeypatch):
    best, _, stages = searched(monkeypatch, lambda angle, *_: abs(angle - 0.3), offset=(0.3, 0.2))
    assert {job[1] for stage in stages for job in stage} == {(0.3, 0.2)} == {best.offset}
    assert [len(stage) for stage in stages] == [12, 4, 2, 0]


def test_an_angle_that_is_left_open_is_that_of_the_search_and_one_given_is_kept(monkeypatch):
    asked = []

    def climbed(_surface, _settings, *, angle, offset, **_how):
        asked.append((angle, offset))
        return "net", SimpleNamespace(angle=angle + 1.0, offset=offset)

    monkeypatch.setattr(orientation, "climbed_net", climbed)
    sought = []

    def best(_surface, _settings, *, offset, **_how):
        sought.append(offset)
        return TriedNet(0.3, offset or (0.5, 0.0), 1.0), []

    monkeypatch.setattr(orientation, "best_orientation", best)
    assert oriented_net(None, SETTINGS, angle="auto") == ("net", 1.3, (0.5, 0.0))
    assert oriented_net(None, SETTINGS, angle="auto", offset=(0.0, 0.2)) == ("net", 1.3, (0.0, 0.2))
    assert sought == [None, (0.0, 0.2)]
    asked.pop()
    assert oriented_net(None, SETTINGS, angle=0.7, offset=(0.0, 0.5)) == ("net", 1.7, (0.0, 0.5))
    assert asked == [(0.3, (0.5, 0.0)), (0.7, (0.0, 0.5))]


@pytest.mark.parametrize(("elements", "made"), [(4, 2), (8, 2), (1, 1)])
def test_trials_have_two_elements_a_segment_at_most_and_cost_infinitely_where_there_is_no_net(
    monkeypatch, elements, made
):
    asked = []

    def pull(_surface, settings, *, angle, offset):
        asked.append((settings.elements, angle, settings.method, settings.tuning.tail))
        return "net"

    monkeypatch.setattr(orientation, "net_at", pull)
    monkeypatch.setattr(orientation, "cost", lambda net: 0.1234567890123456)
    settings = replace(SETTINGS, elements=elements)
    found = orientation._try(None, settings, (0.4, (0.5, 0.0), "compass", 2))
    assert found == TriedNet(0.4, (0.5, 0.0), 0.123456789012)
    assert asked == [(made, 0.4, "compass", 2)]

    def fail(_surface, _settings, **_where):
        raise NoNet(Reason.FOLDED, "it folds", where="net", remedy="Try another angle.")

    monkeypatch.setattr(orientation, "net_at", fail)
    assert orientation._try(None, settings, (0.4, (0.5, 0.0), "pull", 0)) == TriedNet(
        0.4, (0.5, 0.0), math.inf, "it folds", "Choose a smaller spacing."
    )
