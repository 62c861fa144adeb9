"""For which rods a first design's concrete is thinned, and what is said where too little is left."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

import shellform as sf
from shellform.run import first_thinner
from shellform.run.first_net import Allowance
from shellform.run.sizes import DesignWish
from shellform.run.unbuildable import Obstacle, Why

CHOICE = SimpleNamespace(section=sf.Rod.round(young=40e9, radius=0.01).section)
FALLS = Obstacle(Why.STABILITY, 0.75, 0.05, 0.97, CHOICE, SimpleNamespace(net=None), stress=6.0)
BREAKS = replace(FALLS, why=Why.STRENGTH, factor=1.5, stress=1.37)
WORSE = replace(BREAKS, stress=1.5)


class Said(Exception):
    """What the refusal was made of."""


@pytest.fixture
def thinner(monkeypatch):
    """Concrete thinned, in mm, for what falls and for what breaks; what is left of the work is kept."""
    told = SimpleNamespace(comes_to={}, asked=[], tried=[], allowance=Allowance(9000).part(2 / 3))

    def thinned(failure, nearest, possible, least, stands, over, tried):
        told.tried = tried
        told.asked.append((failure, told.allowance.left, over()))
        told.allowance.spend(1000)
        found = told.comes_to.get(failure.why)
        return failure, None if found is None else SimpleNamespace(thickness=1e-3 * found)

    def refused(surface, failure, wish, *, design=None):
        return Said(failure.why, failure.thickness, design and design.thickness)

    monkeypatch.setattr(first_thinner, "thinned", thinned)
    monkeypatch.setattr(first_thinner, "refused", refused)
    monkeypatch.setattr(first_thinner, "choices", lambda *_: [])
    monkeypatch.setattr(first_thinner, "bears_most", lambda failures, nearest: nearest)

    def design(failures, nearest=FALLS, wish=None):
        return first_thinner.with_thinner_concrete(
            None, wish or DesignWish(), failures, nearest, None, told.allowance
        )

    told.design = design
    return told


def test_concrete_is_thinned_for_the_rods_that_bear_most_where_they_bear_a_layer(thinner):
    thinner.comes_to = {Why.STABILITY: 20.0, Why.STRENGTH: 25.0}
    assert thinner.design([FALLS, BREAKS]).thickness == 0.020
    assert [each for each, *_ in thinner.asked] == [FALLS]


def test_where_too_little_is_left_it_is_thinned_for_those_that_stand_with_the_least_stress(thinner):
    thinner.comes_to = {Why.STABILITY: 10.0, Why.STRENGTH: 25.0}
    elsewhere = replace(BREAKS, spacing=1.0, stress=1.0)
    falls_too = replace(BREAKS, factor=1.4, stress=1.1)
    assert thinner.design([WORSE, elsewhere, falls_too, FALLS, BREAKS]).thickness == 0.025
    assert [each for each, *_ in thinner.asked] == [FALLS, BREAKS]


def test_what_was_tried_with_as_much_concrete_is_said_so_that_it_is_not_tried_again(thinner):
    """A round saddle's tubes of 140 mm, which had broken, were tried again with all its concrete."""
    thinner.comes_to = {Why.STABILITY: 20.0}
    others = [SimpleNamespace(section=CHOICE.section) for _ in range(3)]
    elsewhere, thinned = (
        replace(BREAKS, spacing=1.0, choice=others[0]),
        replace(BREAKS, thickness=0.03, choice=others[1]),
    )
    thinner.design([FALLS, elsewhere, thinned, replace(BREAKS, choice=others[2])])
    assert thinner.tried == [CHOICE, others[2]]


@pytest.mark.parametrize(
    ("comes_to", "said"),
    [
        ({}, (Why.STABILITY, 0.05, None)),
        ({Why.STABILITY: 10.0}, (Why.STABILITY, 0.05, 0.010)),
        ({Why.STABILITY: 10.0, Why.STRENGTH: 12.0}, (Why.STRENGTH, 0.05, 0.012)),
    ],
)
def test_less_than_a_layer_is_refused_with_the_most_that_stands(thinner, comes_to, said):
    thinner.comes_to = comes_to
    with pytest.raises(Said) as refusal:
        thinner.design([FALLS, BREAKS])
    assert refusal.value.args == said
    assert len(thinner.asked) == 2


def test_less_than_a_layer_will_do_where_it_is_the_last_way_out(thinner):
    thinner.comes_to, thinner.allowance.thin_layers = {Why.STABILITY: 10.0}, True
    assert thinner.design([FALLS]).thickness == 0.010
    with pytest.raises(Said):
        thinner.design([FALLS], wish=DesignWish(thickness=0.05))


def test_where_nothing_stands_with_all_concrete_it_is_thinned_once(thinner):
    with pytest.raises(Said):
        thinner.design([FALLS])
    assert len(thinner.asked) == 1


def test_a_thickness_that_was_asked_for_is_refused_with_what_stands(thinner):
    thinner.comes_to = {Why.STABILITY: 20.0}
    with pytest.raises(Said) as refusal:
        thinner.design([FALLS], wish=DesignWish(thickness=0.05))
    assert refusal.value.args == (Why.STABILITY, 0.05, 0.020)


@pytest.mark.parametrize("why", [Why.CURVATURE, Why.SPACING])
def test_no_concrete_is_thinned_for_what_its_net_bends_too_much(thinner, why):
    with pytest.raises(Said):
        thinner.design([FALLS], replace(FALLS, why=why))
    thinner.allowance.thins = False
    with pytest.raises(Said):
        thinner.design([FALLS])
    assert thinner.asked == []


def test_thinner_concrete_is_tried_where_sections_have_taken_all_the_work(thinner):
    thinner.allowance.spend(7000)
    thinner.comes_to = {Why.STABILITY: 20.0}
    thinner.design([FALLS])
    thinner.design([FALLS])
    assert thinner.asked[0] == (FALLS, 1800, False), "three tenths of 6000, while 2000 of the whole are left"
    thinner.allowance.spend(1000)
    thinner.design([FALLS])
    assert thinner.asked[-1] == (FALLS, 1800, True), "the whole is spent"
