"""How an analysis comes to its load and what it says of it, on stand-ins for the ways that lead there."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from shellform.errors import NotConverged
from shellform.structure.answers import analysis, halved
from shellform.structure.answers.halved import Refined, critical_error, too_coarse
from shellform.structure.elements.state import at_rest
from shellform.structure.model import Model
from shellform.structure.network import assemble
from shellform.structure.solve.drive import Drive, forces
from shellform.structure.solve.equilibrium import Equilibrium
from shellform.structure.solve.residual import Drowned
from shellform.verification.models import CLAMP, chain, line, load_at


def equilibrium(x, *, spent=5, stable=True):
    state = at_rest(np.add(line(2), [0.0, 0.0, x]))
    return Equilibrium(state, 0.5, 1e-9, spent, stable, 0 if stable else 2)


def walking(
    load=(0.0, 0.0, -4.0, 0.0, 0.0, 0.0), *, imposed=0.0, factor=3.0, limit=1000, start=None, told=None
):
    network = chain(line(2), (1e4, 1.0, 0.2, 0.2), {0: CLAMP})
    moved = np.zeros((3, 6))
    moved[0, 0], moved[2, 1] = imposed, 99.0  # the last isn't held
    network = replace(network, imposed=moved)
    force = load_at(network, 2, list(load))
    model = Model(network, {"down": force}, start, (0,))
    return analysis._Analysis(model, assemble(network), force, factor, 1e-7, limit, told)


@pytest.mark.parametrize("method", ["newton", "dynamic"])
def test_increments_of_newton_s_and_of_dynamic_relaxation_are_equal_and_supports_move_by_each(
    monkeypatch, method
):
    asked, told = [], []

    def solve(_assembly, start, load, *, tolerance, progress):
        progress(4, 0.1)
        asked.append((start.positions[0, 0], start.positions[2, 1], load[2, 2], tolerance))
        return equilibrium(0.125 * len(asked))

    monkeypatch.setattr(analysis, method, solve)
    walk = walking(imposed=0.5, told=lambda *each: told.append(each))
    walk.increments(2, method)
    assert asked == [(0.75, 0.0, -6.0, 1e-7), (0.75, 0.0, -12.0, 1e-7)]
    assert [(each.reached.factor, each.reached.factorisations, each.waypoints) for each in walk.behind] == [
        (1.5, 5, ()),
        (3.0, 5, ()),
    ]
    assert walk.behind[1].document()["displacements"] == {"2": [0.0, 0.0, 0.25]}
    assert (walk.reached, walk.spent, walk.on_branch) == (3.0, 10, None)
    assert told == [(1.5, 4), (1.5, 5), (3.0, 9), (3.0, 10)]


def test_a_relaxation_that_leaves_the_branch_says_at_which_factor(monkeypatch):
    asked, shares = [], [1.0, 0.25, 0.5]

    def settle(_assembly, _state, _drive, *, begin, end, tolerance, limit, report):
        asked.append((begin, end, tolerance, limit))
        report(0.5, equilibrium(0.0, spent=3))
        share = shares.pop(0)
        return SimpleNamespace(
            on_branch=share == 1.0, share=share, equilibrium=equilibrium(0.0), factorisations=8
        )

    monkeypatch.setattr(analysis, "settle", settle)
    told = []
    walk = walking(limit=321, factor=6.0, told=lambda *each: told.append(each))
    walk.increments(3, "relaxation")
    assert asked == [(0.0, 2.0, 1e-7, 321), (2.0, 4.0, 1e-7, 321), (4.0, 6.0, 1e-7, 321)]
    assert (walk.on_branch, walk.left_at) == (False, 2.5)
    assert "ends near load factor 2.5:" in walk.warnings()[0]
    assert [each.document()["steps"] for each in walk.behind] == [
        [{"factor": factor, "iterations": 3, "stable": True}] for factor in (1.0, 3.0, 5.0)
    ]
    assert told == [(1.0, 3), (2.0, 8), (3.0, 11), (4.0, 16), (5.0, 19), (6.0, 24)]


MOMENT = (0.0, 0.0, 0.0, 2.0, 0.0, 5.0)


def test_under_moments_that_turn_nodes_the_relaxation_is_given_up_sooner_and_the_path_followed(monkeypatch):
    limits, drives = [], []

    def settle(_assembly, _state, _drive, *, limit, **_):
        limits.append(limit)
        raise NotConverged("stalled", iterations=50)

    def point(factor, x, spent, *, stable=True, event=""):
        return SimpleNamespace(
            factor=factor, equilibrium=equilibrium(x, spent=spent, stable=stable), event=event
        )

    def follow(_assembly, _state, drive, *, tolerance, heeding):
        assert heeding
        drives.append((drive.at(0.0)[2, 5], drive.at(1.0)[2, 5], drive.imposed[0, 0], tolerance))
        return iter([point(0.0, 0, 1), point(0.5, 0.1, 4), point(1.0, 0.2, 9, stable=len(drives) == 1)])

    monkeypatch.setattr(analysis, "settle", settle)
    monkeypatch.setattr(analysis, "follow", follow)
    told = []
    walk = walking(MOMENT, imposed=0.25, factor=4.0, told=lambda *each: told.append(each))
    walk.increments(2, "relaxation")
    assert limits == [200, 200]
    assert drives == [(0.0, 10.0, 0.5, 1e-7), (10.0, 20.0, 0.5, 1e-7)]
    assert walk.spent == 2 * 59
    assert (walk.followed_from, walk.left_at, walk.on_branch) == (0.0, 4.0, False)
    assert [(each.factor, each.factorisations) for each in walk.behind[1].waypoints] == [(3.0, 4), (4.0, 5)]
    assert told == [(1.0, 54), (2.0, 59), (2.0, 59), (3.0, 113), (4.0, 118), (4.0, 118)]
    assert [("semi-tangential" in each, "from load factor 0 on" in each) for each in walk.warnings()[1:]] == [
        (True, False),
        (False, True),
    ]
    few = walking(MOMENT, limit=30)
    few.increments(1, "relaxation")
    assert limits[-1] == 30


def test_where_no_moment_turns_nodes_or_rounding_hides_the_load_no_path_is_followed(monkeypatch):
    for error, load in ((NotConverged("stalled"), (0, 0, -4.0, 0, 0, 0)), (Drowned("drowned"), MOMENT)):

        def settle(*_, raised=error, **__):
            raise raised

        monkeypatch.setattr(analysis, "settle", settle)
        with pytest.raises(NotConverged, match=error.what):
            walking(load).increments(1, "relaxation")


@pytest.mark.parametrize(("parts", "first"), [(1, 0.1), (2, 0.5), (8, 0.125)])
def test_a_path_tells_its_points_what_each_took_and_where_the_branch_was_left_first(
    monkeypatch, parts, first
):
    given = {}

    def follow(*_, **named):
        given.update(named)
        for factor, event, stable, spent in (
            (0.0, "", True, 1),
            (0.7, "", True, 4),
            (1.2, "limit point", True, 9),
            (0.0, "", False, 11),
            (3.0, "", False, 15),
        ):
            found = equilibrium(factor, spent=spent, stable=stable)
            yield SimpleNamespace(factor=factor, equilibrium=found, rate=2.0, event=event)

    monkeypatch.setattr(analysis, "follow", follow)
    walk = walking()
    walk.path((2, 2, -0.5), parts)
    assert given == {"goal": 3.0, "lead": (2, 2, -0.5), "first": first, "tolerance": 1e-7, "heeding": True}
    assert [(each.reached.factor, each.reached.factorisations, each.event) for each in walk.behind] == [
        (0.7, 4, ""),
        (1.2, 5, "limit point"),
        (0.0, 2, ""),
        (3.0, 4, ""),
    ]
    assert [each.reached.negative for each in walk.behind] == [0, 0, 2, 2]
    assert (walk.spent, walk.reached, walk.left_at, walk.on_branch) == (15, 3.0, 1.2, False)


def test_from_a_given_start_supports_are_where_they_are_wanted_and_only_loads_grow(monkeypatch):
    asked = []

    def find(_assembly, state, load, *, tolerance, limit, progress):
        asked.append((state.positions[0, 0], load.any(), tolerance, limit, progress))
        return equilibrium(0.0, spent=6)

    monkeypatch.setattr(analysis, "find_equilibrium", find)
    walk = walking(imposed=0.5, start=at_rest(line(2) + 0.1), limit=77)
    walk.begin()
    assert asked == [(0.5, False, 1e-7, 77, None)]
    assert (walk.spent, walk.reached) == (6, 0.0)
    assert not walk.drive.imposed.any()
    fresh = walking(imposed=0.5)
    fresh.begin()
    assert len(asked) == 1
    assert (fresh.drive.imposed[0, 0], fresh.drive.imposed[2, 1]) == (0.5, 0.0)


def test_a_failure_leaves_its_last_state_with_what_was_spent():
    walk = walking()
    walk.keep(NotConverged("lost", state=at_rest(line(2)), residual=0.25, iterations=12))
    assert (walk.spent, walk.found.residual, walk.found.stable, walk.found.negative) == (12, 0.25, True, 0)
    walk.keep(NotConverged("lost", iterations=3))
    assert (walk.spent, walk.found.residual) == (15, 0.25)


def test_an_error_of_a_mesh_is_four_thirds_of_what_halves_change():
    high = Refined(12.0, 11.4)
    assert (high.extrapolated, high.error) == (pytest.approx(11.2), pytest.approx(0.8))
    low = Refined(10.0, 10.3)
    assert (low.extrapolated, low.error) == (pytest.approx(10.4), pytest.approx(-0.4))


@pytest.mark.parametrize(
    ("fine", "said"),
    [
        (20.0 - 0.074, None),
        (20.0 - 0.076, "critical factor 20 is about 0.5 % too high, by the same with beams halved (extrapolated 19.8987)"),
        (20.0 + 0.3, "critical factor 20 is about 2.0 % too low, by the same with beams halved (extrapolated 20.4)"),
        (20.0 + 0.074, None),
    ],
)  # fmt: skip
def test_a_mesh_is_told_to_be_coarse_from_half_a_per_cent_on_to_either_side(fine, said):
    told = too_coarse(Refined(20.0, fine))
    assert (told == []) == (said is None)
    assert said is None or said in told[0]
    assert too_coarse(None) == []


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_factor_that_halved_beams_leave_far_behind_is_told_with_theirs_and_not_extrapolated(side):
    """Of two pinned bars in one beam each 29.6 was told to be 133 % too high (extrapolated -9.9)."""
    (told,) = too_coarse(Refined(29.6 * side, 0.1 * side))
    assert told.startswith(f"With beams halved the critical factor is {0.1 * side} instead of {29.6 * side}:")
    assert "extrapolated" not in told
    assert "extrapolated 14" in too_coarse(Refined(20.0 * side, 15.5 * side))[0].replace("-", "")


def test_the_finer_mesh_is_followed_half_as_far_again_from_its_own_start(monkeypatch):
    asked = []

    def critical(_assembly, state, drive, *, goal, first, tolerance):
        asked.append(
            (len(state.positions), drive.at(2.0)[2, 2], len(drive.load), goal, first * goal, tolerance)
        )
        return found

    monkeypatch.setattr(halved, "critical_load", critical)
    walk = walking()
    found = SimpleNamespace(factor=7.25)
    told = critical_error(walk.model, walk.drive, 8.0, goal=10.0, tolerance=1e-6)
    assert (told.coarse, told.fine) == (8.0, 7.25)
    assert asked == [(5, -8.0, 5, 15.0, pytest.approx(1.0), 1e-6)]
    found = None
    assert critical_error(walk.model, walk.drive, 8.0, goal=10.0, tolerance=1e-6) is None

    def lost(*_, **__):
        raise NotConverged("lost")

    monkeypatch.setattr(halved, "critical_load", lost)
    assert critical_error(walk.model, walk.drive, 8.0, goal=10.0, tolerance=1e-6) is None


def test_a_finer_mesh_of_a_bent_start_begins_at_its_equilibrium_without_the_load(monkeypatch):
    walk = walking(start=at_rest(line(2)))
    given = []

    def find(_assembly, state, load, *, tolerance):
        given.append((len(state.positions), load[2, 2], tolerance))
        return SimpleNamespace(state="settled")

    monkeypatch.setattr(halved, "find_equilibrium", find)
    monkeypatch.setattr(
        halved,
        "critical_load",
        lambda _, state, *__, **___: given.append(state) or SimpleNamespace(factor=3.0),
    )
    base = np.zeros((3, 6))
    base[2, 2] = -1.5
    drive = forces(walk.load, base=base)
    assert isinstance(drive, Drive)
    assert critical_error(walk.model, drive, 4.0, goal=10.0, tolerance=1e-6).fine == 3.0
    assert given == [(5, -1.5, 1e-6), "settled"]
