"""Which rods stand where the given ones don't."""

from dataclasses import replace

import numpy as np
import pytest

from shellform.case.build_rod import given_section, rod_sizes
from shellform.case.entries import OwnRodEntry, StockRodEntry
from shellform.gridshell.catalogue import Catalogue, label, read_catalogue
from shellform.gridshell.gridshell import Rod, max_radius
from shellform.gridshell.tolerances import Tolerances
from shellform.records.as_built import AsBuilt
from shellform.records.remedies import RodsOf, rounded_up
from shellform.reliability.standing import sample
from shellform.run import thicker
from shellform.run.thicker import rods_that_stand
from shellform.structure.elements.sections import Round

AS_BUILT = Tolerances(cable_length=1e-4, supports=1e-4, marks=2e-4, load_each=0.1, load_all=0.05)
ASKED = AsBuilt(0.99, None, 200)
DRAWN = 12  # structures of each size of rods, instead of forty


@pytest.fixture(scope="module", autouse=True)
def few_drawn():
    with pytest.MonkeyPatch.context() as changed:
        changed.setattr(thicker, "DRAWN", DRAWN)
        yield


@pytest.fixture(scope="module")
def load(dome):
    """One and a half times what half of the drawn structures bear."""
    return dome.point_load(9.0, every=2)


@pytest.fixture(scope="module")
def found(dome, load):
    return rods_that_stand(dome, dome.design(), {"design": load}, AS_BUILT, ASKED, seed=3)


def standing(shell, radius, load):
    design = replace(shell.design(), radius=radius)
    return sample(shell, design, load, AS_BUILT, count=DRAWN, seed=3).standing.standing


def test_the_rods_that_are_named_stand_and_the_given_ones_do_not(dome, load, found):
    assert dome.rod.radius < found.radius <= max_radius(dome.net, dome.rod)
    assert found.standing == standing(dome, found.radius, load) == DRAWN
    assert standing(dome, dome.rod.radius, load) < DRAWN


def test_no_rods_are_named_beyond_what_the_net_allows(dome, load):
    weak = replace(dome, rod=type(dome.rod).round(young=40e9, radius=dome.rod.radius, strength=1e6))
    assert max_radius(weak.net, weak.rod) < weak.rod.radius
    assert rods_that_stand(weak, weak.design(), {"design": load}, AS_BUILT, ASKED, seed=3) is None


def test_a_load_that_no_rods_bear_names_none(dome):
    heavy = dome.point_load(1e4, every=2)
    assert rods_that_stand(dome, dome.design(), {"design": heavy}, AS_BUILT, ASKED, seed=3) is None


def test_the_remedy_names_rods_that_were_seen_to_stand_instead_of_a_rule(found):
    rule = RodsOf(0.001, 0.002, 0.1).stronger(1.2)
    seen = RodsOf(0.001, 0.002, 0.1, found).stronger(1.2)
    assert "at least 1.1 mm" in rule
    assert f"rod.radius = {found.radius:g}" in seen
    assert f"{DRAWN} of {DRAWN}" in seen
    assert np.isfinite(found.radius)


def test_of_rods_from_a_catalogue_the_section_that_stands_is_named(dome, load, found):
    catalogue = read_catalogue("gfrp_rods")
    other = Catalogue(
        "two",
        catalogue.material,
        (Round(0.00105, dome.rod.section.material), Round(0.003, dome.rod.section.material)),
    )
    assert (
        rods_that_stand(dome, dome.design(), {"design": load}, AS_BUILT, ASKED, seed=3, catalogue=other)
        is None
    )
    enough = Round(rounded_up(found.radius), dome.rod.section.material)
    three = replace(other, sections=(*other.sections[:1], enough, *other.sections[1:]))
    named = rods_that_stand(dome, dome.design(), {"design": load}, AS_BUILT, ASKED, seed=3, catalogue=three)
    assert (named.radius, named.section) == (enough.radius, label(enough))
    said = RodsOf(0.001, 0.002, 0.1, named).stronger(1.2)
    assert f'rod.section = "{label(enough)}"' in said


def test_remedies_name_the_entries_that_the_case_has():
    stock = StockRodEntry(catalogue="gfrp_rods", section="45 mm")
    rod = Rod(given_section(stock))
    sizes = rod_sizes(stock, rod)
    rods = RodsOf(rod.radius, 0.05, 1.0, sizes=sizes)
    assert 'rod.section = "⌀ 50 mm"' in rods.stronger(1.2)
    assert "the catalogue has none" in rods.stronger(50.0)
    assert 'rod.section = "⌀ 40 mm"' in rods.thinner(0.9)
    assert "take another (rod.catalogue)" in rods.thinner(1e-3)
    lath = OwnRodEntry(young=10e9, strength=30e6, width=0.05, height=0.025)
    sizes = rod_sizes(lath, Rod(given_section(lath)))
    assert "rod.width = 0.055, rod.height = 0.028" in RodsOf(0.025, 0.05, 1.0, sizes=sizes).stronger(1.2)
    tube = OwnRodEntry(young=10e9, strength=30e6, radius=0.02, wall=0.002)
    sizes = rod_sizes(tube, Rod(given_section(tube)))
    assert "rod.radius = 0.018, rod.wall = 0.0018" in RodsOf(0.02, 0.05, 1.0, sizes=sizes).thinner(0.9)


def test_under_a_further_load_as_many_have_to_stand_as_are_asked_for_under_it(dome):
    """Under 1.2 × the load half of the structures, with thinner rods than where all have to."""
    load = dome.point_load(7.8, every=2)
    loads = {"design": load / 1.2, "additional": load}
    half = rods_that_stand(dome, dome.design(), loads, AS_BUILT, replace(ASKED, other=0.5), seed=3)
    every = rods_that_stand(dome, dome.design(), loads, AS_BUILT, ASKED, seed=3)
    assert half.radius < every.radius
    assert DRAWN / 2 <= half.standing == standing(dome, half.radius, load) < every.standing == DRAWN
    assert standing(dome, half.radius, load / 1.2) == DRAWN
