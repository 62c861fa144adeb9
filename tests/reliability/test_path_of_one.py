"""One structure's way under its load, with states that are told: snaps, marks, ends, and whether it
stands."""

from types import SimpleNamespace

import numpy as np
import pytest

from shellform.errors import NotConverged
from shellform.reliability import path_of_one
from shellform.reliability.path_of_one import (
    BIFURCATION,
    LIMIT_POINT,
    Loading,
    Snap,
)
from shellform.reliability.perfect import Perfect
from shellform.structure.elements.state import at_rest

SPAN = 2.0
PLACES = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [1.0, 0.5, 0.3]])


def away(distance):
    """A state of which one node is so far, m, from where the perfect structure's is, as 3 to 4 along two
    axes."""
    return at_rest(PLACES + np.array([[0.0] * 3, [0.0] * 3, [0.6 * distance, 0.0, -0.8 * distance]]))


def here(state):
    return SimpleNamespace(state=state)


class Nominal(SimpleNamespace):
    """A perfect structure that can be changed."""

    farthest, lies_beside = Perfect.farthest, Perfect.lies_beside


def loading_of(*, bears=True, **own):
    """A structure whose steps are told."""
    loading = object.__new__(Loading)
    loading.number, loading.spent, loading.snaps, loading.span = 7, 20, [], SPAN
    loading.load, loading.assembly = np.full((3, 6), 2.0), "assembly"
    loading.nominal = Nominal(
        unloaded="unloaded",
        bears=bears,
        states=(None, "on the way", away(0.0)),
        members=SimpleNamespace(span=SPAN),
    )
    for name, value in own.items():
        setattr(loading, name, value)
    return loading


@pytest.mark.parametrize(
    ("ended", "factor", "bears", "stands", "far"),
    [
        (0.0, 1.0, True, True, 0.0),
        (0.0999, 1.0, True, True, 0.0999),  # a twentieth of 2 m at the most
        (0.1001, 1.0, True, False, 0.1001),
        (0.0, 0.999, True, False, np.inf),
        (0.0, 1.0, False, False, np.inf),  # there is none to be near to
    ],
)
def test_a_structure_stands_that_bears_its_load_within_a_twentieth_of_the_span_of_the_perfect_one(
    ended, factor, bears, stands, far
):
    end = here(away(ended))
    asked = []

    def borne(most, step, smallest, *, marks):
        asked.append((most, step, smallest, marks))
        return end, factor

    loading = loading_of(bears=bears, borne=borne, snaps=[Snap(0.4, 0.01)])
    found = loading.outcome(0.5, 1 / 64, (0.8,))
    assert asked == [(1.0, 0.5, 1 / 64, (0.8,))]
    assert (found.number, found.factor, found.stands, found.factorisations) == (7, factor, stands, 20)
    assert found.far == pytest.approx(far)
    assert (found.state, found.snaps) == (end.state, (Snap(0.4, 0.01),))


def test_a_structure_without_an_unloaded_state_bears_nothing():
    found = loading_of(borne=lambda *_, **__: (None, 0.0)).outcome(1.0, 1 / 64)
    assert (found.factor, found.stands, found.far, found.state) == (0.0, False, np.inf, "unloaded")


def outcome(factor, *snaps):
    return path_of_one.DrawnOutcome(
        7, factor, True, 0.0, "end", 20, tuple(Snap(each, 0.01) for each in snaps)
    )


def test_at_rest_under_a_share_a_structure_goes_back_along_its_branch_or_from_nothing_where_it_has_snapped():
    ways = []

    def step(there, share, *, last):
        ways.append(("back", there, share, last))
        return here("back at rest")

    def borne(share, step, smallest):
        ways.append(("from nothing", share, step, smallest, list(loading.snaps)))
        return here("from nothing"), share

    loading = loading_of(at=lambda state: f"at {state}", step=step, borne=borne, snaps=["snapped"])
    loading.assembly = SimpleNamespace(parts=("its beams", "its cables"))
    assert loading.rested(outcome(1.0), 0.7, 0.5, 1 / 64).resting == "back at rest"
    assert loading.rested(outcome(1.0, 0.3), 0.7, 0.5, 1 / 64).resting == "back at rest", "it snaps before"
    assert ways == [("back", "at end", 0.7, True)] * 2
    ways.clear()
    found = loading.rested(outcome(1.0, 0.3, 0.7), 0.7, 0.5, 1 / 64)
    assert (found.resting, found.factorisations) == ("from nothing", 20)
    assert (found.beams, found.cables) == ("its beams", "its cables")
    assert ways == [("from nothing", 0.7, 0.5, 1 / 64, [])]
    ways.clear()
    loading.at = lambda state: here(state)
    assert loading.rested(outcome(0.7), 0.7, 0.5, 1 / 64).resting == "end", "where it is already"
    assert loading.rested(outcome(0.69), 0.7, 0.5, 1 / 64).resting is None
    assert ways == []
    loading.at = lambda state: None
    loading.borne = lambda share, *_: (here("too soon"), 0.6)
    assert loading.rested(outcome(1.0), 0.7, 0.5, 1 / 64).resting is None


def snapping(ends, rests, **own):
    """A structure whose branches end at these factors, and where it rests beyond each, None where it
    falls."""
    ends, rests, asked = list(ends), list(rests), []

    def followed(most, step, smallest, *, begin=None, marks=()):
        asked.append((begin, marks))
        return here(away(0.001 * len(asked))), ends.pop(0)

    def rested(there, goal):
        asked.append(goal)
        return rests.pop(0)

    return loading_of(followed=followed, _rested=rested, **own), asked


def test_a_structure_goes_on_from_where_it_has_come_to_rest_two_resolutions_beyond_its_snap():
    at_rest_there = here(away(0.011))
    loading, asked = snapping([0.5, 1.0], [at_rest_there])
    _, factor = loading.borne(1.0, 0.5, 1 / 64, marks=(0.8,))
    assert factor == 1.0
    assert loading.snaps == [Snap(0.5, pytest.approx(0.01))]
    goal = 0.5 + 2 / 64
    assert asked == [(None, (0.8,)), goal, ((goal, at_rest_there.state), (0.8,))]
    loading, asked = snapping([0.99, 1.0], [at_rest_there])
    loading.borne(1.0, 0.5, 1 / 64)
    assert asked[1] == 1.0, "and no farther than is asked for"


def test_a_structure_falls_where_it_comes_to_no_rest_or_has_snapped_three_times():
    loading, _ = snapping([0.5], [None])
    assert loading.borne(1.0, 0.5, 1 / 64)[1] == 0.5
    assert loading.snaps == []
    loading, _ = snapping([0.2, 0.3, 0.4, 0.6], [here(away(0.01))] * 4)
    assert loading.borne(1.0, 0.5, 1 / 64)[1] == 0.6
    assert len(loading.snaps) == 3
    loading, asked = snapping([1.0], [])
    assert loading.borne(1.0, 0.5, 1 / 64)[1] == 1.0
    assert len(asked) == 1
    unloaded = loading_of(followed=lambda *_, **__: (None, 0.0))
    assert unloaded.borne(1.0, 0.5, 1 / 64) == (None, 0.0)


def relaxing(monkeypatch, looks):
    """Relaxations that end as told: at rest so far off, or not yet."""
    looks, asked = list(looks), []

    def find(assembly, state, load, *, limit):
        asked.append((load[0, 0], limit))
        distance, done = looks.pop(0)
        if done:
            return SimpleNamespace(state=away(distance), factorisations=3)
        raise NotConverged("not yet", state=None if distance is None else away(distance), iterations=8)

    monkeypatch.setattr(path_of_one, "find_equilibrium", find)
    return asked


@pytest.mark.parametrize(
    ("looks", "rests", "spent"),
    [
        ([(0.0199, True)], True, 23),  # a hundredth of 2 m at the most
        ([(0.0201, True)], False, 23),
        ([(0.01, False), (0.015, False), (0.012, True)], True, 39),
        ([(0.01, False), (0.0201, False), (0.01, True)], False, 36),  # it has gone too far on the way
        ([(None, False), (0.01, True)], False, 28),
        ([(0.01, False)] * 8 + [(0.01, True)], False, 84),  # and longer isn't looked
    ],
)
def test_a_snap_is_local_where_no_node_goes_farther_than_a_hundredth_of_the_span(
    monkeypatch, looks, rests, spent
):
    asked, settled = relaxing(monkeypatch, looks), []

    def newton(state, load, *, limit, tolerance):
        settled.append((load[0, 0], limit, tolerance))
        return "at rest"

    loading = loading_of(newton=newton)
    found = loading._rested(here(away(0.0)), 0.6)
    assert (found == "at rest") == rests
    assert loading.spent == spent
    assert set(asked) == {(1.2, 8)}
    assert settled == ([(1.2, 2, path_of_one.ON_THE_WAY)] if rests else [])


@pytest.mark.parametrize(
    ("ends", "marks", "asked"),
    [
        # next to a mark it counts on which side of it a structure falls: within two resolutions beyond the
        # end
        ([0.79, 0.795], (0.8,), [(1.0, 0.5, 1 / 64), (0.8, pytest.approx(0.01), 1 / 512)]),
        ([0.768], (0.8,), [(1.0, 0.5, 1 / 64)]),
        ([0.8], (0.8,), [(1.0, 0.5, 1 / 64)]),
        ([0.9], (0.8,), [(1.0, 0.5, 1 / 64)]),
        (
            [0.79, 0.8, 0.805],
            (0.81, 0.8),
            [(1.0, 0.5, 1 / 64), (0.8, pytest.approx(0.01), 1 / 512), (0.81, pytest.approx(0.01), 1 / 512)],
        ),
        ([0.99], (1.01,), [(1.0, 0.5, 1 / 64)]),  # beyond what is asked for
        ([0.99, 1.0], (1.0,), [(1.0, 0.5, 1 / 64), (1.0, pytest.approx(0.01), 1 / 512)]),
    ],
)
def test_the_end_of_a_branch_is_known_more_closely_next_to_marks(ends, marks, asked):
    ends, heard, first = list(ends), [], ends[-1]

    def along(there, factor, most, step, smallest, *, heeding):
        heard.append((most, step, smallest))
        assert heeding is asked_heeding
        return there, told.pop(0)

    loading = loading_of(along=along, at=lambda state: f"at {state}", _unloaded=lambda: "unloaded")
    for asked_heeding in (False, True):
        told = list(ends)
        heard.clear()
        found = loading.followed(1.0, 0.5, 1 / 64, marks=marks, heeding=asked_heeding)
        assert found == ("unloaded", first)
        assert heard == asked


def test_a_path_begins_at_a_known_state_or_at_the_unloaded_one_which_there_may_not_be():
    loading = loading_of(
        along=lambda there, factor, *_, **__: (there, factor),
        at=lambda state: f"at {state}",
        _unloaded=lambda: None,
    )
    assert loading.followed(1.0, 0.5, 1 / 64, begin=(0.3, "known")) == ("at known", 0.3)
    assert loading.followed(1.0, 0.5, 1 / 64) == (None, 0.0)
    loading.at = lambda state: None
    assert loading.followed(1.0, 0.5, 1 / 64, begin=(0.3, "known")) == (None, 0.3)


@pytest.mark.parametrize(
    ("onward", "kind"),
    [
        # of masses 1, 4 and 1 the softest mode (1, 1, 0) weighs 5
        ([1.0, 1.0, 0.0], LIMIT_POINT),
        ([-3.0, -3.0, 0.0], LIMIT_POINT),
        ([0.0, 0.0, 2.0], BIFURCATION),
        ([4.0, -1.0, 0.0], BIFURCATION),
        # cosines: 5 / sqrt(5 (5 + c²)), a half at c² = 15
        ([1.0, 1.0, 3.8], LIMIT_POINT),
        ([1.0, 1.0, 3.95], BIFURCATION),
        # 1 / sqrt(5) is less than a half, 4 / sqrt(5 4) more
        ([1.0, 0.0, 0.0], BIFURCATION),
        ([0.0, 1.0, 0.0], LIMIT_POINT),
    ],
)
def test_a_branch_ends_at_a_limit_point_where_its_tangent_turns_into_the_softest_mode(
    monkeypatch, onward, kind
):
    """Within sixty degrees by the masses that motions are weighed with."""
    shape = np.zeros((3, 6))
    shape[1, :3] = [1.0, 1.0, 0.0]
    shape[0, 0] = 99.0  # at a support
    free = np.array([6, 7, 8])
    factor = SimpleNamespace(solve=lambda load: np.array(onward))
    loading = loading_of(
        assembly=SimpleNamespace(free=free, factor=lambda state: factor),
        measure=SimpleNamespace(mass_shape=np.array([1.0, 4.0, 1.0])),
    )
    monkeypatch.setattr(path_of_one, "modes", lambda *_: SimpleNamespace(shapes=[shape]))
    assert loading.kind(here("end")) == kind


@pytest.mark.parametrize(("distance", "near"), [(0.0199, True), (0.0201, False)])
def test_an_equilibrium_is_beside_within_a_hundredth_of_the_span_of_where_its_tangent_leads(distance, near):
    asked = []

    def newton(begin, load, **how):
        asked.append((load[0, 0], how))
        return here(away(distance))

    def taken_along(start, load, factor):
        assert start is loading.nominal.states[-1]
        assert (load[0, 0], factor) == (2.0, "factor")
        return away(0.0), "foreseen"

    loading = loading_of(
        bench=SimpleNamespace(loaded="factor"),
        _taken_along=taken_along,
        newton=newton,
    )
    assert (loading.beside() is not None) == near
    how = {"limit": 10, "tolerance": path_of_one.ON_THE_WAY, "foreseen": "foreseen", "damped": False}
    assert asked == [(2.0, how)]
    loading.newton = lambda *_, **__: None
    assert loading.beside() is None
    loading.bench.loaded = None
    assert loading.beside() is None


def test_an_unloaded_state_that_newton_s_steps_do_not_find_is_relaxed_from_there_or_from_the_target(
    monkeypatch,
):
    start, along = at_rest(PLACES), away(0.0)
    supports = np.zeros((3, 6))
    supports[0, 0] = 0.01
    direct, astray = (here(away(0.01 * SPAN * share)) for share in (0.99, 1.01))
    found = [direct]
    asked, settled = [], []

    def newton(state, load, *, limit, tolerance, foreseen=None, damped=False):
        settled.append((load.any(), limit, foreseen, damped))
        return found.pop(0)

    def find(assembly, near, load, *, limit, symmetric):
        assert not symmetric, "errors leave nothing so"
        asked.append(("taken along" if near is along else near.positions[0, 0], load.any(), limit))
        if lost:
            lost.pop()
            raise NotConverged("lost", iterations=40)
        return SimpleNamespace(state="relaxed", factorisations=5)

    monkeypatch.setattr(path_of_one, "find_equilibrium", find)
    loading = loading_of(
        bench=SimpleNamespace(unloaded="factor"),
        errors=SimpleNamespace(supports=supports),
        _taken_along=lambda state, load, factor: (along, "foreseen"),
        newton=newton,
    )
    loading.nominal.start = start
    lost = []
    assert loading._unloaded() is direct
    assert (asked, settled) == ([], [(False, 25, "foreseen", True)])
    found[:] = [astray, "relaxed at last"]
    assert loading._unloaded() == "relaxed at last"
    assert asked == [("taken along", False, 150)]
    assert (settled[-1], loading.spent) == ((False, 2, None, False), 25)
    found[:], lost[:] = [None, "from the target"], ["once"]
    assert loading._unloaded() == "from the target"
    assert asked[-1] == (pytest.approx(0.01), False, 150), "with its supports where they are"
    assert loading.spent == 25 + 40 + 5
    found[:], lost[:] = [None], ["once", "twice"]
    assert loading._unloaded() is None
    assert loading.spent == 70 + 80


@pytest.mark.parametrize("moved_supports", [True, False])
def test_errors_take_the_perfect_structure_along_by_its_own_tangent_and_its_supports(moved_supports):
    """K is 4 N/m: 2 N are borne by 0.5 N, less 1 N by what the supports pull, where they have moved."""
    offset = np.zeros((3, 6))
    offset[0, 1] = 0.25 if moved_supports else 0.0
    free = np.array([12, 13, 14])
    force, pulled = np.full((3, 6), 0.5), np.zeros((3, 6))
    pulled[2, :3] = [1.0, 0.0, -1.0]
    corrected = []

    def along(start, given):
        assert given is offset
        return pulled

    loading = loading_of(
        errors=SimpleNamespace(supports=offset),
        assembly=SimpleNamespace(
            evaluate=lambda state, tangent: SimpleNamespace(force=force, turned=0.1),
            free=free,
            chords=SimpleNamespace(corrected=lambda state, change: corrected.append(change) or change),
        ),
        bench=SimpleNamespace(assembly=SimpleNamespace(force_along=along)),
        _as_perfect=lambda start, turned, change: ("foreseen", turned, change),
    )
    start, factor = at_rest(PLACES), SimpleNamespace(solve=lambda right: right / 4.0)
    begin, (_, turned, change) = loading._taken_along(start, loading.load, factor)
    less = np.array([1.0, 0.0, -1.0]) if moved_supports else np.zeros(3)
    expected = offset.copy()
    expected[2, :3] = (2.0 - 0.5 - less) / 4.0
    assert change == pytest.approx(expected)
    assert corrected[0] is change
    assert turned == 0.1
    assert begin.positions == pytest.approx(PLACES + expected[:, :3])
    begin, _ = loading._taken_along(start, loading.load, None)
    assert begin.positions == pytest.approx(PLACES + offset[:, :3]), "without a tangent the supports alone"


def test_elements_of_a_built_structure_take_on_the_forces_that_the_perfect_one_s_would():
    """One is longer by a half and as stiff, the other as long and four times as stiff."""
    states = {True: np.array([[3.0, 5.0], [7.0, 2.0]]), False: np.array([[1.0, 2.0], [3.0, 6.0]])}
    lost = []

    def foreseen(start, turned, change):
        return None if change.any() in lost else (states[bool(change.any())],)

    loading = loading_of(
        foreseen=foreseen,
        assembly=SimpleNamespace(parts=[SimpleNamespace(rest_length=np.array([3.0, 2.0]))]),
        errors=SimpleNamespace(beam_stiffness=np.array([1.0, 4.0])),
    )
    loading.nominal.network = SimpleNamespace(beams=SimpleNamespace(rest_length=np.array([2.0, 2.0])))
    (found,) = loading._as_perfect("start", 0.1, np.ones((3, 6)))
    assert found == pytest.approx(
        np.array([[1.0 + 1.5 * 2.0, 2.0 + 1.5 * 3.0], [3.0 + 4.0 / 4, 6.0 - 4.0 / 4]])
    )
    for way in (True, False):
        lost[:] = [way]
        assert loading._as_perfect("start", 0.1, np.ones((3, 6))) is None
