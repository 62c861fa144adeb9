"""Which of several nets is taken, and what trying them costs, with nets that are stood in for."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from shellform.net.refusal import Attempt, Change, Reason, Stalled
from shellform.run import first_net
from shellform.run.first_net import Allowance, bare_told, bends_to, larger, least_bent_net
from shellform.run.sizes import MOST_CROSSINGS, Placed

SURFACE = SimpleNamespace(area=100.0)


def net(curvature, cost=1.0, arching=1.0, bare=0.0):
    """A net whose rods are bent out of the surface by `arching` and -`arching`, 1/m, and leave so many cells
    of it bare."""
    return SimpleNamespace(
        bare_cells=bare,
        quality=SimpleNamespace(curvature_max=curvature), grid=None, target=None, cost=cost, edges=(),
        curvature=np.array([[arching, 9.0], [-arching, 0.0]]),
    )  # fmt: skip


class Pulls:
    """Nets by angle, in degrees, and by whether they are shifted; what isn't there stalls."""

    def __init__(self, **nets):
        self.nets, self.asked = nets, []

    def __call__(self, surface, settings, *, angle, offset):
        name = f"a{math.degrees(angle):.0f}" + ("s" if offset == (0.5, 0.5) else "")
        self.asked.append((name, settings.tuning.limit))
        if name not in self.nets:
            raise Stalled("stalls", residual=0.1, iterations=60)
        return self.nets[name]


@pytest.fixture
def pulled(monkeypatch):
    def found(allowance, angles, shifted=False, **nets):
        pulls, said, told = Pulls(**nets), [], []
        monkeypatch.setattr(first_net, "net_at", pulls)
        monkeypatch.setattr(first_net, "refuse_nearness", lambda *_: None)
        monkeypatch.setattr(first_net, "cost", lambda own: own.cost)
        nets = least_bent_net(
            SURFACE, 0.5, 0.02, angles, said.append, allowance, shifted=shifted, tell=told.append
        )
        return nets.best, list(nets.angles), pulls.asked, (said, told)

    return found


def test_the_least_bent_net_is_taken_of_those_alike_the_cheapest_and_angles_nearly_as_good_are_told(pulled):
    allowance = Allowance(5000)
    nets = {"a45": net(1.0, 9.0), "a0": net(1.049, 3.0), "a23": net(1.06, 1.0), "a67": net(1.2, 0.5)}
    placed, near, asked, (said, told) = pulled(allowance, (45.0, 0.0, 23.0, 67.0), **nets)
    assert vars(placed) == vars(Placed(nets["a0"], 0.0, (0.0, 0.0)))
    assert near == [45.0, 0.0], "two of the three within a tenth of the one that is taken"
    assert [name for name, _ in asked] == ["a45", "a0", "a23", "a67"]
    assert {limit for _, limit in asked} == {110}
    assert allowance.left == 5000 - 4 * 400
    assert said == []
    assert told[0] == "net at 45°, 0.5 m: rods bend to a radius of 1 m"


def test_of_nets_alike_one_that_leaves_less_than_a_cell_bare_is_taken_before_a_cheaper_one(pulled):
    bare = {"a45": net(1.0, 9.0, bare=0.9), "a0": net(1.04, 3.0, bare=1.0), "a23": net(1.2, 1.0)}
    assert pulled(Allowance(5000), (45.0, 0.0, 23.0), **bare)[0].angle == 45.0
    bare["a45"].bare_cells = 1.1
    assert pulled(Allowance(5000), (45.0, 0.0, 23.0), **bare)[0].angle == 0.0, "the cheaper of two alike"


def test_what_lies_beyond_the_rods_is_told_with_the_net_from_a_quarter_of_a_cell_on():
    made = SimpleNamespace(bare_cells=0.25, quality=SimpleNamespace(uncovered_area=0.123))
    assert bare_told(made) == ", 0.12 m² of the surface lie beyond them"
    made.bare_cells = 0.24
    assert bare_told(made) == ""


@pytest.mark.parametrize(("arching", "told"), [(0.41, True), (0.39, False)])
def test_on_a_saddle_the_net_across_its_straight_lines_is_told_and_tried_at_finer_spacings_too(
    pulled, arching, told
):
    """The rods that are bent least lie along them: at half a right angle others are bent more than twice as
    much, whether the best is shifted or not."""
    nets = {"a45": net(1.0, arching=0.2), "a0": net(3.0, arching=arching), "a23": net(2.0, arching=9.0)}
    for more in ({}, {"a45s": net(0.9, arching=0.1)}):
        placed, near, *_ = pulled(Allowance(5000), (45.0, 23.0, 0.0), bool(more), **nets, **more)
        found = least_bent_net(
            SURFACE, 0.5, 0.02, (45.0, 23.0, 0.0), print, Allowance(5000), shifted=bool(more), tell=print
        )
        assert placed.angle == 45.0
        assert near == ([45.0, 0.0] if told else [45.0])
        assert (found.across and found.across.net) == (nets["a0"] if told else None)


@pytest.mark.parametrize(
    ("curvature", "cost", "moved"), [(0.9, 5.0, True), (1.1, 0.1, False), (1.02, 0.1, True)]
)
def test_the_best_net_is_tried_half_a_spacing_off_too(pulled, curvature, cost, moved):
    placed, _, asked, _ = pulled(
        Allowance(5000), (45.0, 0.0), True, a45=net(2.0), a0=net(1.0), a0s=net(curvature, cost)
    )
    assert asked[-1][0] == "a0s"
    assert placed.offset == ((0.5, 0.5) if moved else (0.0, 0.0))
    still, *_ = pulled(Allowance(5000), (0.0,), True, a0=net(1.0))
    assert still.offset == (0.0, 0.0), "the other stalls"


def test_a_part_leaves_a_share_of_its_work_to_what_comes_last_for_which_the_whole_pays():
    whole = Allowance(9000)
    part = whole.part(2 / 3)
    part.spend(6500)
    assert part.over
    part.leave(0.3)
    assert (part.left, whole.left, part.over) == (1800, 2500, False)
    part.leave(0.1)
    assert part.left == 1800, "more is left"


def test_a_pull_that_fails_costs_what_it_took_and_none_counts_once_the_work_is_done(pulled):
    """Four nets of a blob of 55 m that ended before any factorisation took four fifths of the work that
    rounding it was worth."""
    allowance = Allowance(1000)
    placed, *_, (said, _) = pulled(allowance, (45.0, 0.0, 23.0), a0=net(1.0), a23=net(0.5))
    assert placed.angle == 0.0, "the next bends its rods less"
    assert allowance.left == 1000 - 400 * 60 / 40 - 400, "sixty factorisations, forty to a crossing"
    assert said[0].startswith("net at 45°, 0.5 m: ")
    brief = Allowance(1000, thorough=False)
    assert {limit for _, limit in pulled(brief, (0.0,), a0=net(1.0))[2]} == {70}
    over = Allowance(0)
    assert pulled(over, (0.0, 45.0), a0=net(1.0), a45=net(0.5))[0].angle == 0.0, "the first in any case"


def test_angles_pulled_side_by_side_come_to_what_they_do_one_by_one(pulled, monkeypatch):
    nets = {"a45": net(1.0), "a23": net(0.5), "a67": net(0.4)}
    found = []
    for number in ("1", "4"):
        monkeypatch.setenv("OMP_NUM_THREADS", number)
        allowance = Allowance(1400)
        placed, near, _, heard = pulled(allowance, (45.0, 0.0, 23.0, 67.0), **nets)
        found.append((placed.angle, near, heard, allowance.left))
    assert found[0] == found[1]
    assert found[0][0] == 23.0, "the work was done before the last"


@pytest.mark.parametrize(
    ("allowance", "climbs"),
    [(Allowance(50_000), True), (Allowance(50_000, thorough=False), False), (Allowance(1200), False)],
)
def test_where_no_angle_gives_a_net_the_ladder_is_climbed_from_the_first_with_the_work_that_is_left(
    monkeypatch, pulled, allowance, climbs
):
    """Of 450 · 300 / 400 = 338 factorisations two pulls of 60 are spent, of which the first counts for the
    ladder."""
    climbed, asked = net(1.0), []
    climbed.attempts = [
        Attempt(Change.NOTHING, 0.0, (0.0, 0.0), Reason.STALLED, took) for took in (60, 80, 20)
    ]

    def climb(surface, settings, *, angle, most, failed, near, progress):
        asked.append((settings.spacing, math.degrees(angle), most, near))
        return climbed, SimpleNamespace(angle=math.radians(40.0), offset=(0.25, 0.0))

    monkeypatch.setattr(first_net, "climbed_net", climb)
    if not climbs:
        with pytest.raises(Stalled):
            pulled(allowance, (45.0, 0.0))
        assert asked == []
        return
    placed, near, *_ = pulled(allowance, (45.0, 0.0))
    assert (placed.net, placed.angle, placed.offset, near) == (climbed, pytest.approx(40.0), (0.25, 0.0), [])
    assert asked == [(0.5, pytest.approx(45.0), 338 - 120 + 60, False)]
    assert allowance.left == 50_000 - 2 * 600 - 400 - 800, (
        "what gave the net counts as one pull, the first has been"
    )


@pytest.mark.parametrize(("climbs", "worth"), [(True, 338), (False, 0)])
def test_a_net_is_pulled_anew_with_another_gap_and_stands_on_its_edges(monkeypatch, climbs, worth):
    """Where no factorisation that fails is worth anything, the ladder ends with its first rung."""
    asked, allowance = [], Allowance(5000)
    taken = [Attempt(Change.NOTHING, 0.0, (0.0, 0.0), Reason.STALLED, took) for took in (80, 20)]
    made = SimpleNamespace(attempts=taken if climbs else [])

    def climb(surface, settings, *, angle, offset, most, near, progress):
        asked.append((settings.gap, round(math.degrees(angle), 9), offset, most, near))
        return made, SimpleNamespace(angle=math.radians(22.5), offset=(0.5, 0.0))

    monkeypatch.setattr(first_net, "climbed_net", climb)
    monkeypatch.setattr(first_net, "stand", lambda own, surface, edges: (own, edges))
    placed = first_net.with_gap(
        SURFACE, Placed(None, 30.0, (0.5, 0.5)), 0.5, 0.07, "edges", print, allowance, climbs=climbs
    )
    assert asked == [(0.07, 30.0, (0.5, 0.5), worth, False)]
    assert (placed.net, placed.angle, placed.offset) == ((made, "edges"), pytest.approx(22.5), (0.5, 0.0))
    assert allowance.left == 5000 - 400 - (800 if climbs else 0)


def test_what_fails_to_be_pulled_anew_is_spent_too(monkeypatch):
    def climb(*_, **__):
        raise Stalled("stalls", residual=0.1, iterations=60)

    monkeypatch.setattr(first_net, "climbed_net", climb)
    allowance = Allowance(5000)
    with pytest.raises(Stalled):
        first_net.with_gap(
            SURFACE, Placed(None, 30.0, (0.5, 0.5)), 0.5, 0.07, "edges", print, allowance, climbs=True
        )
    assert allowance.left == 5000 - 600


def test_what_structures_drawn_cost_is_spent_by_their_factorisations():
    allowance = Allowance(5000)
    allowance.spend_on(SimpleNamespace(grid=SimpleNamespace(lattice=range(250))), 440)
    assert allowance.left == 5000 - 1100


@pytest.mark.parametrize(
    ("spacing", "times"), [(None, 1.0), (1.0, 1.0), (0.25, 1600 / MOST_CROSSINGS), (0.01, 20.0)]
)
def test_more_crossings_than_usual_are_worth_so_many_times_more_work_up_to_twenty(spacing, times):
    assert larger(SURFACE, spacing) == pytest.approx(times)
    assert bends_to(net(0.25)) == 4.0
