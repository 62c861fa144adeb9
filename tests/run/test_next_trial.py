"""Which section, and how much concrete, comes after a failure: by hand-computed shares."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import shellform as sf
from shellform.run import next_trial
from shellform.run.first_edges import edge_choices
from shellform.run.first_trial import FirstParts, Followed
from shellform.run.sizes import RodChoice, Rope
from shellform.run.unbuildable import Obstacle, Why

THIN, MIDDLE, THICK = (
    RodChoice("some", sf.Rod.round(young=40e9, radius=radius, strength=255e6, density=2000.0).section)
    for radius in (0.008, 0.01, 0.02)
)
SOME = [THIN, MIDDLE, THICK]


def failed(why, factor=1.6, stress=0.5, choice=MIDDLE, thickness=0.05):
    return Obstacle(why, 0.5, thickness, factor, choice, SimpleNamespace(net="net"), stress=stress)


@pytest.mark.parametrize(
    ("why", "factor", "times"),
    [
        (Why.STRENGTH, 1.6, 0.0),
        (Why.STABILITY, 1.5, 1.3),
        (Why.STABILITY, 0.75, 2.2**1.3),
        (Why.STABILITY, 0.01, 16.5**1.3),
        (Why.SCATTER, 1.6, 1.3),  # as if it bore nine tenths of what is needed: 1.22 to the 1.3 is less
        (Why.EDGES, 1.2, 1.375**1.3),
    ],
)
def test_after_a_shell_that_falls_comes_a_section_stiffer_by_more_than_what_it_lacks(
    monkeypatch, why, factor, times
):
    asked = []
    monkeypatch.setattr(next_trial, "next_choice", lambda *how: asked.append(how) or 2)
    assert next_trial.next_section("net", SOME, 1, failed(why, factor, 0.7)) == 2
    assert asked == [("net", SOME, 1, 0.7, pytest.approx(times), 0.95)]


def test_where_only_deeper_sections_are_left_rods_give_way_to_less_deep_ones_for_the_stress_that_they_may_have():
    """Of 1.4 times their strength 0.92 of 0.95 are left by rods of 0.62 of the depth, of 1.05 by such of
    0.83."""
    assert (
        next_trial.thinner_rods(SOME, THICK, next_trial.to_bear(failed(Why.STRENGTH, stress=1.4))) is MIDDLE
    )
    assert (
        next_trial.thinner_rods(SOME, MIDDLE, next_trial.to_bear(failed(Why.STRENGTH, stress=1.05))) is THIN
    )
    assert (
        next_trial.thinner_rods(SOME, MIDDLE, next_trial.to_bear(failed(Why.STRENGTH, stress=1.15))) is MIDDLE
    ), "none is so thin"
    other = RodChoice("another", THICK.section)
    assert next_trial.thinner_rods(SOME, other, next_trial.to_bear(failed(Why.STRENGTH, stress=1.4))) is other


@pytest.mark.parametrize(("found", "then"), [(2, THICK), (1, None)])
def test_for_the_shape_s_sake_come_rods_so_many_times_as_stiff_or_none(monkeypatch, found, then):
    asked = []
    monkeypatch.setattr(next_trial, "next_choice", lambda *how: asked.append(how) or found)
    assert next_trial.stiffer_rods("net", [THICK, THIN, MIDDLE], MIDDLE, 0.7, 4.2) is then
    assert asked == [("net", SOME, 1, 0.7, 4.2, 0.95)], "by rising stiffness"
    other = RodChoice("another", MIDDLE.section)
    assert next_trial.stiffer_rods("net", SOME, other, 0.7, 4.2) is None


@pytest.mark.parametrize(
    ("last", "found", "then"),
    [
        (Why.STABILITY, 2, 2),
        (Why.STABILITY, 1, 1),  # tried before: the end
        (Why.STRENGTH, 2, 2),
        (Why.STRENGTH, 1, 0),  # less deep than the one that is stressed least
    ],
)
def test_what_was_tried_before_gives_way_to_less_deep_rods_where_rods_break(monkeypatch, last, found, then):
    monkeypatch.setattr(next_trial, "next_section", lambda *_: found)
    tried = {0: failed(Why.STRENGTH, stress=2.0), 1: failed(last, stress=1.05)}
    if then == 0:
        tried = {
            2: failed(Why.STRENGTH, stress=1.6),
            1: failed(Why.STRENGTH, stress=1.05),
            0: failed(last, stress=9.0),
        }
    assert next_trial.after("net", SOME, tried) == then


ROW = [
    RodChoice("some", sf.Rod.round(young=40e9, radius=radius, strength=255e6, density=2000.0).section)
    for radius in (0.005, 0.006, 0.007, 0.008, 0.009, 0.010, 0.0125)
]


@pytest.mark.parametrize(
    ("tried", "found", "then"),
    [
        # the one that broke was stressed to 1.16 of its strength: 0.75 of its depth is left
        ({2: (Why.STABILITY, 0.73), 6: (Why.STRENGTH, 1.16)}, 6, 4),
        ({2: (Why.SCATTER, 0.73), 6: (Why.STRENGTH, 1.16)}, 0, 4),  # thinner than the one that fell
        # stressed to 1.6, and what is so much less deep fell: half the way from the one that fell
        ({4: (Why.STABILITY, 0.73), 6: (Why.STRENGTH, 1.6)}, 6, 5),
        ({2: (Why.STABILITY, 0.73), 6: (Why.STRENGTH, 1.6)}, 6, 4),
        # what a fall asks for broke before
        ({6: (Why.STRENGTH, 1.16), 4: (Why.STABILITY, 0.9)}, 6, 5),
        ({6: (Why.STRENGTH, 1.16), 5: (Why.STABILITY, 0.9)}, 6, 5),  # nothing is between them: the end
        ({5: (Why.STABILITY, 0.9), 6: (Why.STRENGTH, 1.16)}, 6, 6),
    ],
)
def test_between_sections_that_fell_and_those_that_broke_others_are_tried(monkeypatch, tried, found, then):
    monkeypatch.setattr(next_trial, "next_section", lambda *_: found)
    failures = {k: failed(why, stress=stress) for k, (why, stress) in tried.items()}
    assert next_trial.after("net", ROW, failures) == then
    assert next_trial.narrowed(ROW, failures) == (then not in tried)


@pytest.mark.parametrize(
    ("last", "why", "spare", "then"),
    [
        (True, Why.STABILITY, 2, 2),
        (True, Why.STABILITY, 0, 0),  # tried before: the end
        (False, Why.STABILITY, 2, 1),  # two layers come
        (True, Why.STRENGTH, 2, 1),
        (True, Why.SCATTER, 2, 1),
    ],
)
def test_after_a_shell_that_lies_on_the_ground_come_stiffer_rods_whatever_it_is_stressed_to(
    monkeypatch, last, why, spare, then
):
    """Two layers of 22 mm fell at 0.90 of a load, at 3.6 times their strength: no others were tried."""
    asked = []
    monkeypatch.setattr(next_trial, "next_spare", lambda *how: asked.append(how) or spare)
    monkeypatch.setattr(next_trial, "next_section", lambda *_: 1)
    tried = {0: failed(Why.STABILITY, 0.3), 1: failed(why, 0.75, 3.6)}
    assert next_trial.after("net", SOME, tried, bent=0.65 if last else 0.0) == then
    assert asked == ([("net", SOME, 1, pytest.approx(2.2**1.3), 0.65)] if then != 1 else [])
    monkeypatch.setattr(next_trial, "next_section", lambda *_: 2)
    assert next_trial.after("net", SOME, tried, bent=0.65 if last else 0.0) == 2, "one is likely to bear it"


@pytest.mark.parametrize(
    ("bore", "stress", "then"),
    [
        (0.5, 1.16, 4),  # less deep by what its stress asks for
        (0.28, 1.16, 4),  # 2.73 times as stiff may bear half of what is needed
        (0.27, 1.16, 5),  # 4.16 times
        (0.18, 1.16, 6),  # none between them does: the end
        (0.0, 1.01, 6),
    ],
)
def test_between_them_no_section_is_tried_that_is_sure_to_fall_too(monkeypatch, bore, stress, then):
    """On a hall of 36 m with open arches two layers of 22 mm fell without any load and of 30 mm broke, and
    those of 25 and 28 mm were tried."""
    monkeypatch.setattr(next_trial, "next_section", lambda *_: 6)
    fell, broke = failed(Why.STABILITY, bore), failed(Why.STRENGTH, 1.5, stress)
    tried = {2: fell, 6: broke}
    assert next_trial.after("net", ROW, tried) == then
    assert next_trial.narrowed(ROW, tried) == (then != 6)


@pytest.mark.parametrize("tried", [{2: Why.STABILITY}, {6: Why.STRENGTH}, {2: Why.EDGES, 6: Why.STRENGTH}])
def test_sections_are_narrowed_down_only_between_one_that_fell_and_one_that_broke(tried):
    assert not next_trial.narrowed(ROW, {k: failed(why) for k, why in tried.items()})


@pytest.mark.parametrize(
    ("why", "factor", "borne", "share"),
    [
        (Why.STABILITY, 0.6, None, 0.38),  # 0.95 of 0.6 over 1.5
        (Why.STABILITY, 1.4, None, 0.8),
        (Why.SCATTER, 1.6, None, 0.65),  # none of its structures stood
        (Why.STRENGTH, 1.6, 0.7, 0.7),
        (Why.STRENGTH, 1.6, 0.3, 0.5),
        (Why.STRENGTH, 1.6, 0.95, 0.9),
    ],
)
def test_so_much_less_concrete_is_poured_as_a_trial_says_but_no_less_than_half(
    monkeypatch, why, factor, borne, share
):
    asked = []
    monkeypatch.setattr(next_trial, "load_borne", lambda *how: asked.append(how) or borne)
    assert next_trial._borne(failed(why, factor, 1.2), MIDDLE) == pytest.approx(share)
    assert asked == ([] if borne is None else [("net", MIDDLE, 1.2, 0.92)])


def test_of_the_failures_with_as_much_concrete_and_spacing_the_one_that_bears_most_is_thinned(monkeypatch):
    monkeypatch.setattr(next_trial, "load_borne", lambda net, choice, stress, most: 2.0 - stress)
    nearest = failed(Why.STRENGTH, 1.6, 1.5)
    falls = failed(Why.STABILITY, 0.9)
    gives_way = failed(Why.EDGES, 1.5, 1.6)
    assert next_trial.bears_most([nearest, falls, gives_way], nearest) is gives_way, "0.5, 0.6 and 0.625"
    assert next_trial.bears_most([nearest, falls], nearest) is falls
    early = failed(Why.STRENGTH, 0.3, 1.1)
    assert next_trial.bears_most([early], nearest) is nearest, "it stands up to a fifth of its load only"
    other = failed(Why.STABILITY, 1.4, thickness=0.04)
    none = Obstacle(Why.NET, 0.5, 0.05, 1.4)
    unplaced = Obstacle(Why.STABILITY, 0.5, 0.05, 1.4, MIDDLE)
    assert next_trial.bears_most([other, none, unplaced], nearest) is nearest


@pytest.mark.parametrize(
    ("factor", "tried", "sag", "may"),
    [
        (1.21, Why.STABILITY, 0.0, True),
        (1.19, Why.STABILITY, 0.2, False),
        (1.0, Why.EDGES, 0.0, True),
        (1.6, Why.CABLES, 0.0, True),
        (1.5, Why.STRENGTH, 0.1, False),
        (1.5, Why.STRENGTH, 0.11, True),
        (1.49, Why.STRENGTH, 0.11, False),
    ],
)
def test_stronger_edge_beams_may_help_from_four_fifths_of_what_is_needed_on_and_where_they_sag_beside_rods_that_break(
    factor, tried, sag, may
):
    assert next_trial.edges_may_help(replace(failed(tried, factor), sag=sag), 0.1) is may


def parts(ratio=0.996, swivels=False, diameter=0.006):
    return FirstParts(MIDDLE, edge_choices(MIDDLE)[0], ratio, Rope(diameter), swivels)


def came_to(factor=1.5, stress=0.5, edge=0.5, pull=0.5):
    return Followed(factor, stress, edge, 0.0874, 0.0874, pull, np.zeros(3), np.zeros(3))


@pytest.mark.parametrize(
    ("pull", "ratio", "diameter"),
    [
        (1.25, 0.9983, 0.006),
        (1.3, 0.9986, 0.006),
        (0.86, 0.9961, 0.006),
        (9.0, 0.999, 0.006),
        (0.8, 0.996, 0.008),
    ],
)
def test_cables_are_eased_to_85_percent_of_their_limit_by_less_prestrain_or_thicker_strands(
    pull, ratio, diameter
):
    """A strand under its limit is strained by 0.00575."""
    eased = parts().eased(pull)
    assert (eased.rest_ratio, eased.rope.diameter) == (pytest.approx(ratio, abs=1e-9), diameter)
    assert parts(0.999, diameter=0.016).eased(2.0) is None, "there is no thicker one"


@pytest.mark.parametrize(
    ("came", "ratio", "swivels"),
    [
        (came_to(stress=0.96), 0.998, True),
        (came_to(stress=0.95), None, None),
        (came_to(factor=1.49, stress=2.0), None, None),
        (came_to(pull=0.95), 0.9966, False),
        (came_to(pull=0.9), None, None),
        (came_to(edge=0.95, pull=0.95), 0.9966, False),
        (came_to(edge=0.96, pull=0.95), None, None),
    ],
)
def test_what_is_tried_after_a_design_that_bears_its_load_spares_rods_first_and_then_cables(
    came, ratio, swivels
):
    found = parts().easier(came, 0.9)
    if ratio is None:
        assert found is None
        return
    assert (found.rest_ratio, found.swivels) == (pytest.approx(ratio, abs=1e-9), swivels)
    assert came.sag_told == "87 mm"


def test_prestrain_is_halved_no_further_than_the_least():
    assert parts(0.9985).easier(came_to(stress=1.2), 0.9).rest_ratio == 0.999
    assert parts(0.9995).easier(came_to(stress=1.2), 0.9).rest_ratio == 0.9995, "it has less already"
    assert parts(0.999, swivels=True).easier(came_to(stress=1.2), 0.9) is None
