"""Paths of one spring whose load is known at every place: where they end, and which points they tell."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from shellform.errors import InputError, NotConverged
from shellform.structure.elements.state import at_rest
from shellform.structure.solve import path
from shellform.structure.solve.drive import forces
from shellform.structure.solve.equilibrium import Equilibrium
from shellform.structure.solve.path import follow
from shellform.structure.solve.walk import Lead, Missed, OnPath, Walk


class Curve:
    """Stands in for `Walk`: one coordinate x, at which the load factor is f(x) and so many pivots are
    negative."""

    def __init__(self, load, negative=lambda x: 0, *, most=np.inf, iterations=4):
        self.load, self.negatives, self.most, self.iterations = load, negative, most, iterations
        self.moving = np.array([True])
        self.sizes, self.spent = [], 7
        self.windows, self.looks = (), []

    def begun(self, goal, lead):
        self.led, self.direction = (
            None if lead is None else 0,
            1.0 if lead is not None or goal > 0.0 else -1.0,
        )
        return self

    def point(self, state, factor, iterations):
        here = self.at(state if isinstance(state, float) else 0.0)
        return replace(here, rate=abs(here.rate))

    def at(self, x, way=1.0):
        x = float(x)
        rate = (self.load(x + 1e-6) - self.load(x - 1e-6)) / 2e-6
        negative = self.negatives(x)
        found = Equilibrium(x, 0.0, 1e-9, 1, negative == 0, negative)
        return OnPath(x, self.load(x), found, np.array([1.0 / rate]), way * rate, self.iterations, 0.0, None)

    def step(self, here, size):
        self.sizes.append(size)
        if abs(size) > self.most:
            raise Missed
        way = float(np.sign(here.rate * here.tangent[0]))
        return self.at(here.state + way * abs(size), way)

    def between(self, before, after):
        return np.array([after - before])

    def displacement(self, state, lead):
        return state

    def at_factor(self, here, there, goal):
        low, high = here.state, there.state
        for _ in range(60):
            middle = 0.5 * (low + high)
            if (self.load(middle) - goal) * (self.load(low) - goal) > 0.0:
                low = middle
            else:
                high = middle
        found = self.at(high)
        return OnPath(high, goal, found.equilibrium, found.tangent, found.rate, 4, 0.0, None)

    def by_load(self, here, end):
        return None

    def view(self, here, before):
        """Its place, for windows that are told by that."""
        return here.state if here.equilibrium.stable else None

    def heeded(self, here, seen, there, *, critical=False):
        assert seen == here.state
        self.looks.append((here.state, there.state, critical))
        if any(here.state <= low and there.state >= high for low, high in self.windows):
            raise Missed
        return there.state

    located = Walk.located
    share = Walk.share
    gave_up = Walk.gave_up


def followed(monkeypatch, curve, **how):
    monkeypatch.setattr(path, "Walk", lambda *given: curve.begun(*given[-2:]))
    monkeypatch.setattr(path, "with_twice_the_digits", lambda _: None)
    monkeypatch.setattr(path, "ResidualNorm", lambda _: None)
    start = at_rest(np.zeros((1, 3)))
    return list(follow(None, start, forces(np.ones((1, 6))), **how))


def arch(x):
    """Rises to 1 at x = 1, falls to 0 at 2, and rises again."""
    return x * (x - 2.0) ** 2 * 27.0 / 32.0


TOP = 2.0 / 3.0


def test_a_path_ends_where_the_factor_first_comes_to_its_goal(monkeypatch):
    points = followed(monkeypatch, Curve(lambda x: 2.0 * x), goal=3.0, first=path.FIRST)
    assert points[0].factor == 0.0
    assert points[-1].factor == 3.0
    assert points[1].factor == pytest.approx(0.3), "a tenth of the goal at first"
    assert [each.event for each in points] == [""] * len(points)
    assert len(points) == 11


def test_a_limit_point_is_located_where_the_load_turns_round_and_a_bifurcation_where_it_goes_on(monkeypatch):
    curve = Curve(arch, lambda x: int(TOP < x < 2.0))
    points = followed(monkeypatch, curve, goal=2.0)
    events = [(each.event, each.equilibrium.state, each.factor) for each in points if each.event]
    assert [each[0] for each in events] == ["limit point", "limit point"]
    assert events[0][1] == pytest.approx(TOP, abs=1e-3)
    assert events[0][2] == pytest.approx(arch(TOP), rel=1e-6)
    assert events[1][1] == pytest.approx(2.0, abs=1e-2)
    straight = Curve(lambda x: 2.0 * x, lambda x: int(x > 0.71))
    (event,) = [each for each in followed(monkeypatch, straight, goal=3.0) if each.event]
    assert event.event == "bifurcation"
    assert event.equilibrium.state == pytest.approx(0.71, abs=1e-6)
    assert event.equilibrium.state > 0.71, "where it isn't stable any more"
    assert not [each for each in followed(monkeypatch, straight, goal=3.0, events=False) if each.event]


def test_an_event_is_located_to_a_ten_millionth_of_its_factor_and_no_nearer(monkeypatch):
    """Halves of a step of 0.15 m at 2/m: 0.3 / 2^n < 1e-7 · 1.42 from n = 22 on."""
    curve = Curve(lambda x: 2.0 * x, lambda x: int(x > 0.71))
    followed(monkeypatch, curve, goal=3.0)
    assert sum(size < 0.149 for size in curve.sizes) == 22


def test_a_step_that_ends_at_the_goal_itself_ends_the_path(monkeypatch):
    points = followed(monkeypatch, Curve(lambda x: 2.0 * x), goal=2.0, first=0.5)
    assert [each.factor for each in points] == [0.0, 1.0, 2.0]


def test_steps_grow_where_they_are_easy_and_shrink_where_they_are_not(monkeypatch):
    for iterations, ratio in ((4, 1.0), (1, 2.0), (2, np.sqrt(2.0)), (9, 2.0 / 3.0), (100, 0.5)):
        curve = Curve(lambda x: 2.0 * x, iterations=iterations)
        with pytest.raises(NotConverged, match="within 3 points"):
            followed(monkeypatch, curve, goal=1000.0, first=1e-4, most=3)
        assert np.array(curve.sizes[1:]) / curve.sizes[:-1] == pytest.approx([ratio] * 2)


def test_a_step_that_is_missed_is_cut_to_a_quarter_until_a_millionth_of_the_first(monkeypatch):
    curve = Curve(lambda x: 2.0 * x, most=0.01)
    points = followed(monkeypatch, curve, goal=0.5, first=0.2)
    assert curve.sizes[:4] == pytest.approx([0.05, 0.0125, 0.003125, 0.003125])
    assert points[-1].factor == 0.5
    never = Curve(lambda x: 2.0 * x, most=-1.0)
    with pytest.raises(NotConverged, match=r"could not be followed further \(load factor 0\)") as told:
        followed(monkeypatch, never, goal=0.5, first=0.2)
    assert len(never.sizes) == 10, "4^10 is more than a million"
    assert told.value.iterations == 7


class Kinked(Curve):
    """As `Curve`, with a place that steps don't get over, and beyond which the load leads to a `landing`."""

    def __init__(self, load, *, wall, landing=None):
        super().__init__(load)
        self.wall, self.landing, self.ends = wall, landing, []

    def step(self, here, size):
        found = super().step(here, size)
        if here.state < self.wall < found.state:
            raise Missed
        return found

    def by_load(self, here, end):
        self.ends.append((here, end))
        return None if self.landing is None else self.at(self.landing)


def test_a_path_whose_steps_don_t_get_over_a_kink_goes_on_by_a_quarter_of_the_first_step_s_load(monkeypatch):
    curve = Kinked(lambda x: 2.0 * x, wall=0.21, landing=0.24)
    points = followed(monkeypatch, curve, goal=1.0, first=0.1)
    ((here, end),) = curve.ends
    assert here.state == pytest.approx(0.21, abs=1e-6)
    assert end - here.factor == pytest.approx(0.25 * 0.1)
    assert next(each.factor for each in points if each.factor > 0.4201) == 0.48
    assert points[-1].factor == 1.0
    fewest = int(np.argmin(curve.sizes))
    assert curve.sizes[fewest + 1] == pytest.approx(0.25 * 0.05), "with steps as long as that"


def test_the_load_alone_leads_no_farther_than_to_the_goal(monkeypatch):
    curve = Kinked(lambda x: 2.0 * x, wall=0.499, landing=0.5)
    assert followed(monkeypatch, curve, goal=1.0, first=0.1)[-1].factor == 1.0
    assert [end for _, end in curve.ends] == [1.0]


def test_a_path_that_the_load_leads_nowhere_either_is_given_up_where_it_is(monkeypatch):
    with pytest.raises(NotConverged, match=r"could not be followed further \(load factor 0\.42\)"):
        followed(monkeypatch, Kinked(lambda x: 2.0 * x, wall=0.21), goal=1.0)
    led = Kinked(lambda x: 2.0 * x, wall=0.21, landing=0.3)
    with pytest.raises(NotConverged, match="could not be followed further"):
        followed(monkeypatch, led, lead=Lead(0, 2, 0.75))
    assert led.ends == [], "a displacement that leads does so alone"


def doubtful(monkeypatch, way):
    """A path whose steps turn out as `way` says by their size, beside a kink: "leaps", "back", "missed" or
    nothing."""
    curve = Curve(lambda x: 2.0 * x)
    ahead = curve.step

    def step(here, size):
        found = ahead(here, size)
        if way(size) == "missed":
            raise Missed
        return curve.at(here.state - 0.5 * size) if way(size) == "back" else found

    curve.step, curve.assembly = step, None
    monkeypatch.setattr(path, "kinked", lambda *_: True)
    monkeypatch.setattr(
        path, "turns_between", lambda before, after, mean: way(curve.sizes[-1]) == "leaps" and mean > 0.0
    )
    return curve


def test_of_the_doubted_steps_over_a_kink_the_shortest_is_taken_once_a_shorter_one_is_missed(monkeypatch):
    """Steps of 0.05 and 0.0125 are doubted, one of a sixteenth of that leads back, and none shorter leads
    on."""
    ways = {0.05: "leaps", 0.0125: "leaps", 0.003125: "back"}

    def way(size):
        return next((how for known, how in ways.items() if abs(size - known) < 1e-9), "missed")

    curve = doubtful(monkeypatch, way)
    with pytest.raises(NotConverged, match="within 5 points"):
        followed(monkeypatch, curve, goal=1.0, first=0.1, most=5)
    assert curve.sizes[:4] == pytest.approx([0.05, 0.0125, 0.003125, 0.00078125])
    assert curve.sizes[4] == pytest.approx(0.0125), "from 0.0125 on"


def test_a_doubted_step_is_taken_where_a_shorter_one_would_be_the_last(monkeypatch):
    curve = doubtful(monkeypatch, lambda size: "leaps")
    sizes = [
        0.05 * 0.25**k for k in range(10)
    ]  # of which a quarter of the last is less than a millionth of the first
    with pytest.raises(NotConverged, match=f"within 10 points .load factor {2.0 * sizes[-1]:.6g}"):
        followed(monkeypatch, curve, goal=1.0, first=0.1, most=10)
    assert curve.sizes == pytest.approx(sizes)


def test_a_step_back_over_a_kink_is_missed(monkeypatch):
    """With as many negative eigenvalues the load goes on as before; found beyond a kink, a point of less load
    lies behind."""
    curve = Curve(lambda x: 2.0 * x if x > -0.01 else 9.0 * x)
    ahead = curve.step
    back = []

    def step(here, size):
        found = ahead(here, size)
        if size > 0.02:
            back.append(size)
            return curve.at(here.state - size)
        return found

    curve.step = step
    points = followed(monkeypatch, curve, goal=1.0, first=0.1)
    factors = [each.factor for each in points]
    assert back
    assert factors == sorted(factors)


def test_a_led_path_ends_at_its_displacement_with_a_last_step_that_goes_no_farther(monkeypatch):
    curve = Curve(lambda x: 2.0 * x, iterations=1)
    points = followed(monkeypatch, curve, lead=Lead(0, 2, 0.75))
    assert curve.sizes == pytest.approx([0.075, 0.15, 0.3, 0.225])
    assert points[-1].equilibrium.state == pytest.approx(0.75)
    back = Curve(lambda x: -2.0 * x)
    with pytest.raises(NotConverged):
        followed(monkeypatch, back, lead=Lead(0, 2, -0.75), most=2)
    assert back.sizes[0] == pytest.approx(-0.075)
    with pytest.raises(InputError, match="must not be zero"):
        followed(monkeypatch, Curve(lambda x: 2.0 * x), lead=Lead(0, 2, 0.0))


def test_the_goal_of_a_path_of_pulls_against_the_load_is_less_than_nothing(monkeypatch):
    points = followed(monkeypatch, Curve(lambda x: -2.0 * x), goal=-0.5)
    assert points[-1].factor == -0.5
    assert points[1].factor == pytest.approx(-0.05)


def test_only_a_free_displacement_leads_and_counts_from_the_start():
    walk = SimpleNamespace(assembly=SimpleNamespace(free=np.array([1, 8, 14])))
    assert (Walk.number(walk, Lead(1, 2, -0.5)), Walk.number(walk, Lead(2, 2, 1.0))) == (1, 2)
    with pytest.raises(InputError, match="only a free displacement can lead") as told:
        Walk.number(walk, Lead(1, 1, -0.5))
    assert told.value.value == (1, 1)
    walk.start = at_rest(np.array([[0.0, 0.0, 0.0], [1.0, 2.0, 3.0]]))
    there = at_rest(np.array([[0.0, 0.0, 0.0], [1.0, 2.0, 2.25]]))
    assert Walk.displacement(walk, there, Lead(1, 2, -0.5)) == -0.75


def test_a_first_step_beyond_a_peak_and_a_valley_is_cut_until_it_meets_the_peak(monkeypatch):
    """From x = 0 to 3, where the curve has come back to its first slope."""
    curve = Curve(arch, lambda x: int(TOP < x < 2.0))
    points = followed(monkeypatch, curve, goal=20.0, first=0.5)
    assert curve.sizes[0] > 2.0
    assert [each.event for each in points if each.event] == ["limit point", "limit point"]


def test_a_first_step_after_which_a_path_is_four_times_as_stiff_is_cut(monkeypatch):
    curve = Curve(lambda x: x + x**3)
    followed(monkeypatch, curve, goal=10.0, first=0.5)
    assert curve.sizes[:3] == pytest.approx([5.0, 1.25, 0.3125])
    curve = Curve(lambda x: x + x**3)
    followed(monkeypatch, curve, goal=10.0, first=0.099)
    assert curve.sizes[:2] == pytest.approx([0.99, 0.99])


def test_an_event_is_a_limit_point_where_the_load_turns_round_right_there_and_not_somewhere_in_the_step(
    monkeypatch,
):
    curve = Curve(arch, lambda x: int(x > 0.5))
    events = [each for each in followed(monkeypatch, curve, goal=2.0, first=0.76) if each.event]
    assert curve.sizes[0] * 2.0 > TOP > 0.5 > curve.sizes[0]
    assert [each.event for each in events] == ["bifurcation"]


def test_the_rate_of_a_path_s_first_point_has_the_sign_of_its_direction(monkeypatch):
    for first in (0.1, -0.1):
        points = followed(monkeypatch, Curve(lambda x: 2.0 * x), lead=Lead(0, 2, 10.0 * first))
        assert points[0].rate == pytest.approx(np.copysign(2.0, first))
    pulled = followed(monkeypatch, Curve(lambda x: 2.0 * x, iterations=1), goal=-0.3, first=1.0)
    assert pulled[0].rate == pytest.approx(-2.0)


def test_a_heeded_path_cuts_steps_that_may_pass_over_something_until_it_is_met(monkeypatch):
    """Unstable from 0.61 to 0.63, between two steps of 0.15, and foretold from either side."""
    for heeding, events in ((False, []), (True, ["bifurcation", "bifurcation"])):
        curve = Curve(lambda x: 2.0 * x, lambda x: int(0.61 < x < 0.63))
        curve.windows = ((0.61, 0.63),)
        points = followed(monkeypatch, curve, goal=3.0, heeding=heeding)
        found = [each for each in points if each.event]
        assert [each.event for each in found] == events
        assert points[-1].factor == 3.0
    assert found[0].factor == pytest.approx(1.22, rel=1e-6)


def test_up_to_an_event_a_heeded_path_is_looked_at_as_well(monkeypatch):
    """Unstable from 0.61 to 0.63 and from 0.7 on: the step ends beyond both, and where bisection meets the
    second one, the first lies before it."""
    curve = Curve(lambda x: 2.0 * x, lambda x: int(0.61 < x < 0.63 or x > 0.7))
    curve.windows = ((0.61, 0.63),)
    told = [
        next(
            each.factor
            for each in followed(monkeypatch, curve, goal=3.0, first=0.4, heeding=heeding)
            if each.event
        )
        for heeding in (False, True)
    ]
    assert told == pytest.approx([1.4, 1.22], rel=1e-6)
    begin, end, _ = next(look for look in curve.looks if look[2])
    assert begin == pytest.approx(0.6)
    assert end == pytest.approx(0.7, abs=1e-4)


def test_where_no_step_leads_to_an_event_a_heeded_one_is_cut_to_a_512th_of_the_load(monkeypatch):
    curve = Curve(lambda x: 2.0 * x, lambda x: int(x > 0.71), iterations=1)
    curve.located = lambda here, size, there: None
    for heeding, told in ((False, 2.1), (True, 1.42)):
        points = followed(monkeypatch, curve, goal=3.0, heeding=heeding)
        first = next(each.factor for each in points if not each.equilibrium.stable)
        assert first == pytest.approx(told, rel=1 / 512)


def test_a_change_of_the_load_is_a_share_of_the_larger_of_both_and_of_the_first_step_s():
    walk = SimpleNamespace(first=0.5)
    points = [SimpleNamespace(factor=each) for each in (0.0, 0.1, -2.0, -1.5)]
    assert Walk.share(walk, points[0], points[1]) == pytest.approx(0.2)
    assert Walk.share(walk, points[2], points[3]) == pytest.approx(0.25)
    assert Walk.share(walk, points[3], points[2]) == pytest.approx(0.25)
