"""What the search for a first design calls a failure, and how much less concrete it tries next. What a design
came to is stood in for, so that each case is the one that is meant."""

import itertools
from collections import namedtuple
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import shellform as sf
from shellform.run import first_design, first_net, first_trial, next_trial, unbuildable
from shellform.run.first_design import _Search
from shellform.run.first_net import Allowance, FirstNets
from shellform.run.first_trial import Followed
from shellform.run.next_trial import bears_most
from shellform.run.sizes import DesignWish, Placed
from shellform.run.unbuildable import Obstacle, Why
from tests.run.test_unbuildable import net_bent, rods

Choice = namedtuple("Choice", "section")
PARTS = SimpleNamespace(easier=lambda tried, most: None, stronger=lambda tried: None, choice=None)


def came_to(factor, stress, edge, pull):
    return Followed(
        factor, stress, edge, 0.0, 0.0, pull, np.array([1.0, 0.0, 0.0]), np.array([2.0, 0.0, 0.0])
    )


STANDS = "stands"


def thinned(failure, stands, possible=()):
    """What thinning the concrete comes to after a `failure`, where trials come to what `stands` says."""
    return next_trial.thinned(failure, failure, possible, 0.01, stands, lambda: False)[1]


def stand_in_sizes(monkeypatch, following, borne):
    """The section after another is `following`, and rods bear a share `borne` of the load."""
    monkeypatch.setattr(next_trial, "next_section", lambda *_: following)
    monkeypatch.setattr(next_trial, "load_borne", lambda *_: borne)


@pytest.mark.parametrize(
    ("found", "why", "stress"),
    [
        ((1.5, 0.94, 0.94, 0.99), None, None),
        ((1.49, 0.94, 0.94, 0.99), Why.STABILITY, 0.94),
        ((0.0, 0.99, 0.1, 0.1), Why.STABILITY, 0.99),
        ((0.0, 1.01, 0.1, 0.1), Why.STRENGTH, 1.01),  # broken before any load
        ((1.5, 0.96, 0.99, 0.1), Why.STRENGTH, 0.96),
        ((1.5, 0.1, 0.96, 0.1), Why.EDGES, 0.96),
        ((1.5, 0.1, 0.1, 1.01), Why.CABLES, 1.01),
    ],
)
def test_a_design_fails_by_load_then_by_its_rods_edge_beams_and_cables(found, why, stress):
    search = SimpleNamespace(_followed=lambda placed, parts, thickness: came_to(*found))
    _, tried, failure = _Search._solved(search, None, PARTS, 0.5, 0.05)
    assert tried.factor == found[0]
    if why is None:
        assert failure is None
        return
    assert (failure.why, failure.stress, failure.factor) == (why, stress, found[0])
    assert failure.where[0] == (2.0 if why is Why.STRENGTH else 1.0)


def test_rods_that_break_on_the_net_pulled_with_their_gap_are_a_failure_of_that_design_alone(monkeypatch):
    """A net may have a kink with one gap that it hasn't with another: the search goes on."""
    before, kinked = (
        SimpleNamespace(net=SimpleNamespace(**vars(net_bent(bent)), edges=())) for bent in (0.1, 4.5)
    )
    before.net.grid.gap = 0.05
    monkeypatch.setattr(first_design, "with_gap", lambda *_, **how: kinked)
    parts = SimpleNamespace(choice=rods(radius=0.016), joint=SimpleNamespace(gap=0.06))
    kept = []
    search = SimpleNamespace(
        surface=None, edges=None, _say=None, allowance=None, _solved=lambda *_: (parts, "stood", None),
        _keep=lambda failure: kept.append(failure) or failure,
    )  # fmt: skip
    found = _Search._with_parts(search, before, parts, 1.0, 0.013)
    assert kept == [found]
    assert (found.why, found.placed, found.choice) == (Why.CURVATURE, kinked, parts.choice)
    assert found.stress == pytest.approx(40e9 * 0.016 * np.hypot(4.5, 0.45) / 255e6)  # out of plane and in it


@pytest.mark.parametrize(
    ("why", "factor", "stood", "millimetres"),
    [
        (Why.STABILITY, 0.9, 0.0, 28),  # 0.95 of what it bears of 1.5 times 50 mm
        (Why.STABILITY, 1.45, 0.0, 40),  # at least a fifth less
        (Why.SCATTER, 1.6, 0.2, 40),  # structures as built fall: as if it bore nine tenths of what is needed
        (Why.SCATTER, 1.6, 0.19, 32),  # a third less where hardly any stood
        (Why.SCATTER, 0.6, 0.0, 19),
    ],
)
def test_concrete_is_thinned_by_what_the_design_falls_short_of(why, factor, stood, millimetres):
    tried = []

    def stands(placed, choice, spacing, thickness):
        tried.append(round(1e3 * thickness, 6))
        return STANDS

    choice = Choice(sf.Rod.round(young=40e9, radius=0.01).section)
    failure = Obstacle(why, 0.5, 0.05, factor, choice, SimpleNamespace(net=None), stood=stood)
    assert thinned(failure, stands) is STANDS
    assert tried == [millimetres]


@pytest.mark.parametrize(("stood", "tried"), [(0.5, [40.0]), (0.49, [])])
def test_once_the_work_is_done_concrete_is_thinned_on_only_where_most_structures_stood(stood, tried):
    asked = []

    def stands(placed, choice, spacing, thickness):
        asked.append(round(1e3 * thickness, 6))
        return STANDS

    choice = Choice(sf.Rod.round(young=40e9, radius=0.01).section)
    failure = Obstacle(Why.SCATTER, 0.5, 0.05, 1.6, choice, SimpleNamespace(net=None), stood=stood)
    next_trial.thinned(failure, failure, [], 0.015, stands, lambda: True)
    assert asked == tried


def test_concrete_is_thinned_for_the_rods_that_broke_where_less_stressed_ones_fall(monkeypatch):
    """At once after ones that fall, where thinning for these would end with next to none."""
    deep, thin = (Choice(sf.Rod.round(young=40e9, radius=radius).section) for radius in (0.02, 0.01))
    net = SimpleNamespace(net=None)
    breaks = Obstacle(Why.STRENGTH, 0.5, 0.05, 1.5, deep, net, stress=1.2)
    tried = []

    def stands(placed, choice, spacing, thickness):
        tried.append((choice, round(1e3 * thickness, 6)))
        if thickness == 0.05:
            return Obstacle(Why.STABILITY, 0.5, 0.05, 0.2, choice, net, stress=0.1)
        return STANDS

    stand_in_sizes(monkeypatch, 0, 0.75)
    assert thinned(breaks, stands, [thin, deep]) is STANDS
    assert tried == [(thin, 50.0), (deep, 37.0)]


def test_concrete_is_thinned_for_the_rods_that_bear_most_of_it_not_for_those_that_break_least(monkeypatch):
    strong, weak = (Choice(sf.Rod.round(young=40e9, radius=radius).section) for radius in (0.02, 0.01))
    net = SimpleNamespace(net=None)
    breaks_least = Obstacle(Why.STRENGTH, 0.5, 0.05, 1.5, strong, net, stress=1.1)
    falls = Obstacle(Why.STABILITY, 0.5, 0.05, 1.2, weak, net, stress=0.5)
    gives_way = Obstacle(Why.EDGES, 0.5, 0.05, 1.5, weak, net, stress=2.0)
    coarser = Obstacle(Why.STABILITY, 0.7, 0.05, 1.4, weak, net)
    left = {1.1: 0.3}
    monkeypatch.setattr(next_trial, "load_borne", lambda net, choice, stress, most: left[stress])
    assert bears_most([breaks_least, falls, gives_way, coarser], breaks_least) is falls, "0.8, 0.5 and 0.3"
    left[1.1] = 0.9
    assert bears_most([breaks_least, falls, gives_way, coarser], breaks_least) is breaks_least


@pytest.mark.parametrize(
    ("factor", "stress", "kept"), [(1.2, 0.5, "as before"), (1.5, 1.3, "as before"), (1.5, 1.0, "eased")]
)
def test_what_is_eased_is_kept_only_where_it_bears_the_load_and_spares_rods(factor, stress, kept):
    """Joints that turn and slacker cables stiffen the shell less."""
    eased = SimpleNamespace(**vars(PARTS))
    before = SimpleNamespace(**vars(PARTS) | {"easier": lambda tried, most: eased})
    found = {id(before): came_to(1.5, 1.2, 0.1, 0.1), id(eased): came_to(factor, stress, 0.1, 0.1)}
    search = SimpleNamespace(_followed=lambda placed, parts, thickness: found[id(parts)])
    parts, tried, failure = _Search._solved(search, None, before, 0.5, 0.05)
    assert parts is (before if kept == "as before" else eased)
    assert tried is found[id(parts)]
    assert failure.why is Why.STRENGTH


@pytest.mark.parametrize(
    ("after", "kept", "why"),
    [
        ([(1.5, 0.9, 0.1, 0.8)], 1, None),
        ([(1.5, 1.1, 0.1, 1.6), (1.5, 1.0, 0.1, 1.2), (1.5, 0.94, 0.1, 0.99)], 3, None),
        ([(1.5, 1.1, 0.1, 1.6), (1.5, 1.1, 0.1, 1.2), (1.5, 0.9, 0.1, 0.9)], 1, Why.STRENGTH),  # spares none
        ([(1.4, 0.9, 0.1, 0.8)], 0, Why.STRENGTH),  # falls
        ([(1.5, 1.19 - 0.01 * k, 0.1, 2.0) for k in range(9)], 3, Why.STRENGTH),  # no more attempts
    ],
)
def test_strands_become_stronger_while_that_spares_rods_and_the_shell_bears_its_load(after, kept, why):
    ladder = [(1.5, 1.2, 0.1, 2.4), *after]
    parts = [SimpleNamespace(**vars(PARTS), number=k) for k in range(len(ladder))]
    for each, following in itertools.pairwise(parts):
        each.stronger = lambda tried, following=following: following if tried.stress > 0.95 else None
    search = SimpleNamespace(_followed=lambda placed, each, thickness: came_to(*ladder[each.number]))
    found, tried, failure = _Search._solved(search, None, parts[0], 0.5, 0.05)
    assert (found.number, tried.stress) == (kept, ladder[kept][1])
    assert (failure and failure.why) is why


def test_where_rods_would_break_without_any_concrete_less_deep_ones_are_tried_with_as_much(monkeypatch):
    """And thinned for by what they bear, where they fall."""
    deep, thin = (Choice(sf.Rod.round(young=40e9, radius=radius).section) for radius in (0.02, 0.015))
    net, tried = SimpleNamespace(net=None), []
    breaks = Obstacle(Why.STRENGTH, 0.5, 0.05, 1.5, deep, net, stress=1.05)
    outcome = iter([(Why.STRENGTH, 1.5, 1.03), (Why.STABILITY, 1.2, 0.6)])

    def stands(placed, choice, spacing, thickness):
        tried.append((choice, round(1e3 * thickness, 6)))
        why, factor, stress = next(outcome, (None, None, None))
        if why is None:
            return STANDS
        return Obstacle(why, 0.5, thickness, factor, choice, net, stress=stress)

    stand_in_sizes(monkeypatch, 1, 0.5)
    assert thinned(breaks, stands, [thin, deep]) is STANDS
    assert tried == [(deep, 25.0), (thin, 50.0), (thin, 38.0)]


def test_rods_that_were_tried_with_as_much_concrete_are_not_tried_again(monkeypatch):
    deep, thin = (Choice(sf.Rod.round(young=40e9, radius=radius).section) for radius in (0.02, 0.015))
    net, asked = SimpleNamespace(net=None), []
    breaks = Obstacle(Why.STRENGTH, 0.5, 0.05, 1.5, deep, net, stress=1.2)
    stand_in_sizes(monkeypatch, 0, 0.8)  # thinner ones would come next
    for tried, first in (((), (thin, 0.05)), ((thin,), (deep, 0.04))):
        stands = lambda placed, rods, spacing, thickness: asked.append((rods, thickness)) or STANDS  # noqa: E731
        next_trial.thinned(breaks, breaks, [thin, deep], 0.01, stands, lambda: False, tried)
        assert asked.pop() == first


def test_no_less_is_poured_than_three_tenths_of_a_layer_and_nothing_is_tried_once_the_work_is_spent():
    choice = Choice(sf.Rod.round(young=40e9, radius=0.01).section)
    failure = Obstacle(Why.STABILITY, 0.5, 0.05, 0.1, choice, SimpleNamespace(net=None))
    tried = []
    stands = lambda placed, rods, spacing, thickness: tried.append(thickness) or STANDS  # noqa: E731
    assert next_trial.thinned(failure, failure, (), 0.0151, stands, lambda: False) == (failure, None)
    assert next_trial.thinned(failure, failure, (), 0.01, stands, lambda: True) == (failure, None)
    assert tried == []
    assert next_trial.thinned(failure, failure, (), 0.01, stands, lambda: False) == (failure, STANDS)
    assert tried == [0.003]


@pytest.mark.parametrize(("falls", "standing", "drawn"), [(None, 40, 40), (7, 7, 8), (0, 1, 2)])
def test_structures_are_drawn_under_the_additional_load_with_larger_errors_until_one_falls(
    monkeypatch, falls, standing, drawn
):
    found = []

    class Bench:
        def __init__(self, nominal):
            assert nominal == (0.997, 12.0), "1.2 times the load"

        def load_numbers(self, tolerances, *, seed, numbers):
            assert tolerances == ("usual", 1.5)
            found.extend(numbers)
            return [SimpleNamespace(stands=number != falls, factorisations=11) for number in numbers]

    shell = SimpleNamespace(design=lambda rest_ratio: rest_ratio)
    monkeypatch.setattr(first_trial, "first_shell", lambda *_: (shell, 10.0))
    monkeypatch.setattr(first_trial, "perfect", lambda shell, design, load: (design, load))
    monkeypatch.setattr(first_trial, "default_tolerances", lambda shell: "usual")
    monkeypatch.setattr(first_trial, "enlarged", lambda usual, times: (usual, times))
    monkeypatch.setattr(first_trial, "Workshop", Bench)
    sample = first_trial.drawn_standing(None, None, SimpleNamespace(rest_ratio=0.997), 0.05)
    assert (sample.standing, sample.factorisations) == (standing, 11 * drawn)
    assert sample.falls is (falls is not None)
    assert found == list(range(drawn))


@pytest.mark.parametrize(("share", "factor"), [(1.0, 1.5), (0.5, 1.35)])
def test_rods_edge_beams_and_cables_are_judged_under_the_additional_load(monkeypatch, share, factor):
    """States stand for the load factors that they are reached under."""

    def loaded(assembly, state, borne, more, **_):
        before = float(np.max(borne))
        assert before == state, "it goes on from where it is"
        reached = share if more > 1.3 else 1.0
        end = SimpleNamespace(state=before + reached * (more - before))
        return SimpleNamespace(share=reached, equilibrium=end, on_branch=reached == 1.0)

    shell = SimpleNamespace(
        node_count=1,
        target=SimpleNamespace(positions=np.eye(3)),
        design=lambda rest_ratio: SimpleNamespace(radius=0.01),
        network=lambda design: None,
        beams=lambda radius: SimpleNamespace(local_forces=lambda state: state),
        utilisation=lambda design, state: np.array([0.1, 0.4 * state]),
        cables=lambda design: SimpleNamespace(tension=lambda state: np.array([100.0 * state])),
    )
    monkeypatch.setattr(first_trial, "first_shell", lambda *_: (shell, 1.0))
    monkeypatch.setattr(first_trial, "assemble", lambda network: None)
    monkeypatch.setattr(first_trial, "find_equilibrium", lambda *_, **__: SimpleNamespace(state=0.0))
    monkeypatch.setattr(first_trial, "apply_load", loaded)
    monkeypatch.setattr(first_trial, "edge_utilisation", lambda shell, beams, forces: 0.5 * forces)
    monkeypatch.setattr(first_trial, "deviations", lambda shell, state: np.array([1.3, state, 0.0]))
    net = SimpleNamespace(
        grid=SimpleNamespace(rod_ends=np.array([[0, 1], [1, 2]])), edge_lines=np.array([[1, 2]])
    )
    parts = SimpleNamespace(rest_ratio=0.997, rope=SimpleNamespace(force_max=200.0))
    found = first_trial.followed(net, None, parts, 0.05)
    assert found.factor == pytest.approx(factor)
    assert found.stress == pytest.approx(0.4 * 1.2)
    assert found.edge == pytest.approx(0.5 * 1.2)
    assert found.sag == pytest.approx(1.2), "of the edge alone, though node 0 is farther off"
    assert found.off == pytest.approx(1.3), "of all nodes"
    assert found.pull == pytest.approx(1.2 / 2.0)
    np.testing.assert_array_equal(found.where, [0.0, 1.0, 0.0])
    np.testing.assert_array_equal(found.most_stressed, [0.0, 0.5, 0.5])


@pytest.mark.parametrize(
    ("why", "factor", "may"),
    [
        (Why.EDGES, 0.3, True),
        (Why.STABILITY, 1.21, True),
        (Why.STABILITY, 1.19, False),
        (Why.SCATTER, 1.5, True),
        (Why.STRENGTH, 1.5, False),
        (Why.CABLES, 1.5, True),
        (Why.NET, 0.0, False),
    ],
)
def test_stronger_edge_beams_are_tried_where_edges_give_way_or_the_shell_nearly_stands(why, factor, may):
    assert next_trial.edges_may_help(Obstacle(why, 0.5, 0.05, factor), 0.1) is may


GIVES_WAY = Obstacle(Why.EDGES, 0.5, 0.05, 1.5, stress=1.2)
BREAKS = Obstacle(Why.STRENGTH, 0.5, 0.05, 1.5, stress=1.2)
SAGS = replace(BREAKS, sag=0.11)
SCATTERS = Obstacle(Why.SCATTER, 0.5, 0.05, 1.5, stress=0.5)
PULLS = Obstacle(Why.CABLES, 0.5, 0.05, 1.5, stress=1.3)


@pytest.mark.parametrize(
    ("lightest", "lines", "layers", "found", "tried"),
    [
        (0, ("line",), (1, 2), [GIVES_WAY, GIVES_WAY], [0, 1]),  # two a stage
        (2, ("line",), (1, 2), [GIVES_WAY, GIVES_WAY], [2, 3]),
        (0, ("line",), (1,), [BREAKS], [0]),
        (0, ("line",), (1,), [SAGS, SAGS], [0, 1]),
        (0, ("line",), (1, 2), [SAGS], [0]),  # two layers come first
        (0, ("line",), (1, 2), [STANDS], [0]),
        (0, (), (1, 2), [GIVES_WAY], [0]),  # there are none
        (0, ("line",), (1, 2), [SCATTERS], [0]),  # two layers come first
        (0, ("line",), (1, 2), [PULLS], [0]),
        (0, ("line",), (1,), [PULLS, PULLS], [0, 1]),
        (0, ("line",), (1,), [SCATTERS], [0]),  # thinner concrete does more
    ],
)
def test_edge_beams_are_tried_from_the_lightest_of_their_stage_on(
    monkeypatch, lightest, lines, layers, found, tried
):
    asked = []

    def with_edges(placed, choice, edge, spacing, thickness):
        asked.append(edge)
        return found[len(asked) - 1]

    monkeypatch.setattr(first_design, "edge_choices", lambda choice: (0, 1, 2, 3))
    monkeypatch.setattr(first_design, "FirstDesign", str)
    monkeypatch.setattr(first_design, "may_sag", lambda surface, thickness: 2.0 * thickness)
    search = SimpleNamespace(
        surface=None, lightest=lightest, layers=layers, with_edges=with_edges, _thickness=0.06
    )
    placed = SimpleNamespace(net=SimpleNamespace(edges=lines))
    assert (
        _Search._stands(search, placed, Choice(sf.Rod.round(young=40e9, radius=0.01).section), 0.5, 0.05)
        is found[-1]
    )
    assert asked == tried


def test_edges_that_sag_beside_rods_that_break_get_heavier_beams_only_where_concrete_is_thinned(monkeypatch):
    """With all of it a round saddle of 24 m was led from tubes of 89 mm, which stand, to 140 mm, which
    break."""
    asked = []
    monkeypatch.setattr(first_design, "edge_choices", lambda choice: (0, 1))
    monkeypatch.setattr(first_design, "may_sag", lambda surface, thickness: 0.1)
    search = SimpleNamespace(
        surface=None,
        lightest=0,
        layers=(1,),
        with_edges=lambda *of: asked.append(of[2]) or SAGS,
        _thickness=0.05,
    )
    placed = SimpleNamespace(net=SimpleNamespace(edges=("line",)))
    for thickness, tried in ((0.05, [0]), (0.04, [0, 1])):
        asked.clear()
        _Search._stands(search, placed, Choice(sf.Rod.round(young=40e9, radius=0.01).section), 0.5, thickness)
        assert asked == tried


@pytest.mark.parametrize(
    ("far", "stray", "finished"),
    [
        (True, False, ["nearer", "with room"]),
        (False, False, ["with room"]),
        (False, True, ["with room", "steadier"]),
    ],
)
def test_what_lies_far_off_is_stiffened_before_its_strands_and_what_strays_after_them(
    monkeypatch, far, stray, finished
):
    done = []
    found = first_trial.FirstDesign(0.5, "why", None, None, 0.05, None, 40, 40, 0.03, ("before",))

    def nearer(design, surface, stiffer, other, allowance, say):
        done.append("nearer")
        say("what was tried since")
        return design

    def steadier(design, surface, stiffer, other, allowance, say):
        done.append("steadier")
        say("what was tried since")
        return design

    monkeypatch.setattr(first_design, "straighter", lambda design, *_: design)
    monkeypatch.setattr(first_design, "raisable", lambda design, *_: done.append("raised") or design)
    monkeypatch.setattr(first_design, "with_strays", lambda design, surface: design)
    monkeypatch.setattr(first_design, "strays", lambda *_: stray)
    monkeypatch.setattr(first_design, "steadier", steadier)
    monkeypatch.setattr(first_design, "too_far", lambda *_: far)
    monkeypatch.setattr(first_design, "nearer", nearer)
    monkeypatch.setattr(first_design, "with_room", lambda design, *_: done.append("with room") or design)
    told = first_design.finished_design(found, None, DesignWish(), lambda text: None, Allowance()).told
    assert done == [*finished, "raised"]
    assert told == (("before", "what was tried since") if far or stray else ("before",))


@pytest.mark.parametrize(
    ("best", "vain"),
    [
        (Obstacle(Why.STABILITY, 0.5, 0.05, 0.5), False),  # 0.89 with the finer spacing, of 1.5
        (Obstacle(Why.STABILITY, 0.5, 0.05, 0.4), True),  # 0.71: less than half of what is needed
        (Obstacle(Why.STRENGTH, 0.5, 0.05, 0.4), False),
        (Obstacle(Why.STRENGTH, 0.5, 0.05, 0.0), True),  # broken at once
        (Obstacle(Why.SCATTER, 0.5, 0.05, 1.5), False),
        (Obstacle(Why.STABILITY, 0.7, 0.05, 1.4), True),  # a coarser net came nearer
    ],
)
def test_a_finer_spacing_is_in_vain_where_it_can_not_bear_half_of_what_is_needed(best, vain):
    allowance = SimpleNamespace(over=False, thorough=True)
    search = SimpleNamespace(best=best, allowance=allowance, surface=SimpleNamespace(area=100.0))
    assert _Search._vain(search, 0.5, 0.375) is vain
    for changed in (
        {"allowance": SimpleNamespace(over=True, thorough=True)},
        {"allowance": SimpleNamespace(over=False, thorough=False)},
        {"surface": SimpleNamespace(area=1101 * 0.375**2)},
    ):
        assert _Search._vain(SimpleNamespace(**{**vars(search), **changed}), 0.5, 0.375) is True


def test_for_the_sake_of_curvature_no_spacing_is_tried_of_more_than_six_hundred_crossings():
    allowance, area = SimpleNamespace(over=False, thorough=True), 700 * 0.375**2
    for why, vain in ((Why.NET, True), (Why.SCATTER, False)):
        search = SimpleNamespace(
            best=Obstacle(why, 0.5, 0.05, 1.0), allowance=allowance, surface=SimpleNamespace(area=area)
        )
        assert _Search._vain(search, 0.5, 0.375) is vain


def test_of_two_failures_that_came_as_near_the_later_is_kept():
    search = SimpleNamespace(failures=[], best=None, allowance=SimpleNamespace(bore=0.4))
    first, nearer, as_near, farther = (Obstacle(Why.STABILITY, 0.5, 0.05, f) for f in (0.5, 0.8, 0.8, 0.6))
    for failure, best in ((first, first), (nearer, nearer), (as_near, as_near), (farther, as_near)):
        assert _Search._keep(search, failure) is failure
        assert search.best is best
    assert search.failures == [first, nearer, as_near, farther]
    assert search.allowance.bore == pytest.approx(0.8 / 1.5), "the most of its load that it bore"


@pytest.mark.parametrize(
    ("why", "factor", "is_told"),
    [(Why.STRENGTH, 1.5, True), (Why.STRENGTH, 0.0, False), (Why.CURVATURE, 0.0, False)],
)
def test_how_much_of_the_strength_is_allowed_is_told_of_rods_that_the_load_breaks(
    monkeypatch, why, factor, is_told
):
    """99 % alone would be no reason."""
    monkeypatch.setattr(unbuildable, "_crease", lambda *_: None)
    monkeypatch.setattr(unbuildable, "_rounding", lambda *_: 4.0)
    choice = SimpleNamespace(label="a rod", catalogue="a catalogue")
    placed = SimpleNamespace(net=SimpleNamespace(quality=SimpleNamespace(curvature_max=0.1)))
    failure = Obstacle(why, 0.5, 0.05, factor, choice, placed, stress=0.99)
    told = unbuildable.refused(None, failure, SimpleNamespace(rod=None)).what
    assert "to 99% of its strength, at a spacing of 0.5 m" in told
    assert told.endswith(" and with 50 mm of concrete, where 95% is allowed") is is_told


@pytest.mark.parametrize(
    ("why", "words"),
    [
        (Why.STABILITY, "The shell doesn't stand: it isn't stable enough. The stiffest"),
        (Why.SCATTER, "The shell doesn't stand: it isn't stable enough as built. The stiffest"),
        (Why.EDGES, "The shell doesn't stand: its edge beams aren't strong enough. The stiffest"),
        (Why.CABLES, "The shell doesn't stand: its cables aren't strong enough. The stiffest"),
    ],
)
def test_a_shell_that_falls_is_refused_in_sentences(monkeypatch, why, words):
    monkeypatch.setattr(unbuildable, "_crease", lambda *_: None)
    choice = SimpleNamespace(label="a rod", catalogue="a catalogue", section=None)
    failure = Obstacle(why, 0.5, 0.05, 0.9, choice, None, stress=0.6)
    assert str(unbuildable.refused(None, failure, SimpleNamespace(rod=None))).startswith(words)


def test_a_surface_that_no_net_covers_is_refused_in_sentences(monkeypatch):
    monkeypatch.setattr(unbuildable, "sharpest_bend", lambda _: (1, 0.3))
    monkeypatch.setattr(unbuildable, "_rounding", lambda *_: 4.0)
    surface = SimpleNamespace(vertices=np.array([[0.0, 0.0, 0.0], [1.0, 2.0, 0.5]]))
    failure = Obstacle(Why.NET, 0.5, 0.05, error=sf.InputError("it folds there"))
    assert str(unbuildable.refused(surface, failure, SimpleNamespace(rod=None))) == (
        "net.spacing: no net of 0.5 m covers the surface, which is curved most at (1, 2, 0.5) m, to a radius of 0.3 m: "
        "it folds there. Round the surface there to 4 m or more."
    )
    choice = SimpleNamespace(label="a rod", catalogue="a catalogue")
    monkeypatch.setattr(unbuildable, "least_spacing", lambda _: 0.8)
    thick = Obstacle(Why.SPACING, 0.5, 0.05, choice=choice)
    assert str(unbuildable.refused(None, thick, SimpleNamespace(rod=None))).startswith(
        "--spacing: rods of a rod are too thick for a spacing of 0.5 m. Give --spacing 0.8 or more"
    )


def test_a_search_tells_the_crossings_of_the_net_that_it_proposes(monkeypatch):
    """Rods that run beside an edge are left out where the net is stood up: 257 crossings of 259."""
    pulled, stood = (
        SimpleNamespace(grid=SimpleNamespace(lattice=range(count)), edges=(), bare_cells=0.0)
        for count in (259, 257)
    )
    said = nets_of(monkeypatch, FirstNets(Placed(pulled, 30.0, (0.0, 0.0)), ()), [(pulled, stood)])[1]
    assert said == ["net at 30° and 0.5 m: 257 crossings, rods bend to a radius of 257 m"]


@pytest.mark.parametrize(("edges", "order"), [((), [75.0, 30.0]), (("a beam",), [30.0])])
def test_on_a_saddle_the_net_across_comes_first_unless_its_arches_push_against_edge_beams(
    monkeypatch, edges, order
):
    pulled, stood = (
        [SimpleNamespace(grid=SimpleNamespace(lattice=range(9)), edges=own, bare_cells=0.0) for _ in range(2)]
        for own in ((), edges)
    )
    best, across = (Placed(net, angle, (0.0, 0.0)) for net, angle in zip(pulled, (30.0, 75.0), strict=True))
    found, said = nets_of(
        monkeypatch, FirstNets(best, (30.0, 75.0), across), list(zip(pulled, stood, strict=True))
    )
    assert [each.angle for each in found] == order
    assert [each.net for each in found] == stood[: len(order)][::-1]
    assert len(said) == len(order)


def nets_of(monkeypatch, found, stood):
    """The nets in the order in which they are tried, and what is said of them, where these are `found` and
    `stood` has what each is once it has stood up."""
    monkeypatch.setattr(first_design, "least_bent_net", lambda *_, **__: found)
    monkeypatch.setattr(first_design, "stand", lambda net, *_: next(up for flat, up in stood if flat is net))
    monkeypatch.setattr(first_design, "refuse_tipping", lambda _: None)
    monkeypatch.setattr(first_net, "bends_to", lambda net: float(len(net.grid.lattice)))
    said = []
    search = SimpleNamespace(
        surface=None, wish=SimpleNamespace(angle=30.0), allowance=SimpleNamespace(), edges=None,
        angles=(), say=said.append, _say=said.append,
    )  # fmt: skip
    search._stood = lambda *given: _Search._stood(search, *given)
    return _Search._nets(search, 0.5, 0.02), said


def test_every_net_is_tried_with_single_rods_before_two_layers(monkeypatch):
    nets = [SimpleNamespace(angle=angle, net=SimpleNamespace(edges=())) for angle in (75.0, 30.0)]
    tried = []
    monkeypatch.setattr(first_design, "choices", lambda net, spacing, rod, layers: [layers])
    search = SimpleNamespace(
        _nets=lambda *_: nets, layers=(1, 2), wish=SimpleNamespace(rod=None), best="what came nearest",
        _first_that_stands=lambda placed, possible, *_: tried.append((possible[0], placed.angle)),
    )  # fmt: skip
    assert _Search._on_net(search, 0.5, 0.05) is None
    assert tried == [(1, 75.0), (1, 30.0), (2, 75.0), (2, 30.0)]


@pytest.mark.parametrize(
    ("narrowed", "layers", "trials"), [(True, (1, 2), 4), (True, (1,), 6), (False, (1,), 4)]
)
def test_sections_are_narrowed_down_only_where_no_more_layers_come(monkeypatch, narrowed, layers, trials):
    """Two layers of thinner rods leave fewer cables than single rods that hardly stand."""
    row = [Choice(sf.Rod.round(young=40e9, radius=radius).section) for radius in np.linspace(0.01, 0.02, 9)]
    search = _Search("dome", DesignWish(layers=None), lambda text: None, Allowance(1.0))
    search.layers, tried = layers, []
    monkeypatch.setattr(search, "_stands", lambda placed, choice, *_: tried.append(choice) or "falls")
    monkeypatch.setattr(first_design, "hopeless", lambda *_: False)
    monkeypatch.setattr(first_design, "first_choice", lambda *_: 0)
    shares = []
    monkeypatch.setattr(
        first_design, "after", lambda net, possible, tried, bent: shares.append(bent) or len(tried)
    )
    monkeypatch.setattr(first_design, "narrowed", lambda *_: narrowed)
    assert search._first_that_stands(SimpleNamespace(net=None), row, 0.5, 0.05) is None
    assert tried == row[:trials]
    assert set(shares) == {0.65 if layers == (1,) else 0.0}
    search.allowance.thin_layers = True
    assert search._first_that_stands(SimpleNamespace(net=None), row, 0.5, 0.05) is None
    assert shares[-1] == (0.9 if layers == (1,) else 0.0), "thorough trials take what is bent harder, last"
