"""From a case's entries to rods, bounds and loads, on nets and shells of which only numbers are known."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from shellform.case import build_gridshell as module
from shellform.case.build_gridshell import load_cases, rod_bounds, rod_limits, rod_of
from shellform.case.edge_entries import EdgeBeamEntry
from shellform.case.entries import (
    ConcreteEntry,
    JointsWeightEntry,
    LoadCaseEntry,
    LoadEntry,
    OwnRodEntry,
    PointsEntry,
    RodsWeightEntry,
    SheetEntry,
    StockRodEntry,
)
from shellform.errors import InputError
from shellform.gridshell.gridshell import Rod, max_radius
from shellform.gridshell.loads import CONCRETE
from shellform.structure.elements.sections import Rectangle

ROD = {"young": 40e9, "strength": 240e6}


def net(most=0.02, curvature=0.3):
    return SimpleNamespace(
        max_radius=lambda *, young, strength: most * strength / 240e6 * 40e9 / young,
        quality=SimpleNamespace(curvature_max=curvature, curvature=np.array([[[curvature, 0.0]] * 2])),
        edges=(),
    )


def test_rods_without_a_size_are_the_largest_that_the_net_allows_and_a_straight_net_allows_any():
    assert rod_of(OwnRodEntry(**ROD), net()).radius == 0.02
    assert rod_of(OwnRodEntry(**ROD, radius=0.007), net()).radius == 0.007
    with pytest.raises(InputError, match="the net is straight"):
        rod_of(OwnRodEntry(**ROD), net(math.inf))


@pytest.mark.parametrize(
    ("sizes", "limit", "share"),
    [
        ({"radius": 0.01}, 0.6, 0.5),  # σ / (E c) = 0.006 / 0.01
        ({"width": 0.08, "height": 0.02}, 0.6, 0.5),  # bent across the surface: by the height
        ({}, 0.3, 1.0),  # the largest that the net allows
    ],
)
def test_what_a_net_allows_of_rods_is_the_curvature_at_which_their_outermost_fibre_breaks(
    sizes, limit, share
):
    found = rod_limits(OwnRodEntry(**ROD, **sizes), net())
    assert found.radius_max == 0.02
    assert found.curvature_limit == pytest.approx(limit)
    assert found.curvature_utilisation == pytest.approx(share)
    assert rod_limits(OwnRodEntry(**ROD), net(math.inf, 0.0)).curvature_utilisation == 0.0
    straight = rod_limits(OwnRodEntry(**ROD, radius=0.01), net(math.inf, 0.0))
    assert (straight.curvature_limit, straight.curvature_utilisation) == (pytest.approx(0.6), 0.0)


def test_a_lath_s_curvature_is_told_beyond_what_it_bears_just_where_it_is_refused():
    bent = net()
    bent.quality.curvature = np.array([[[0.24, -0.18], [-0.2, 0.05]]])  # 0.3 1/m together
    for height, used in [(0.02, 0.7), (0.06, 1.5)]:  # (0.24 h / 2 + 0.18 b / 2) E / f
        entry = OwnRodEntry(**ROD, width=0.02, height=height)
        found, rod = rod_limits(entry, bent), rod_of(entry, bent)
        assert found.curvature_utilisation == pytest.approx(used)
        assert found.curvature_utilisation == pytest.approx(rod.radius / max_radius(bent, rod))
        assert found.curvature_limit == pytest.approx(0.3 / used)


def test_rods_of_a_catalogue_are_told_as_they_are_chosen_of_it():
    bent = net(
        242e6 / (40e9 * 0.3)
    )  # 20.125 mm of what the catalogue's rods are made of, ⌀ 40 mm is the next below
    assert rod_of(StockRodEntry(catalogue="gfrp_rods"), bent).radius == 0.02
    found = rod_limits(StockRodEntry(catalogue="gfrp_rods"), bent)
    assert found.curvature_utilisation == pytest.approx(40e9 * 0.02 * 0.3 / (0.35 * 690e6))
    sharp = net(0.001, 6.0)  # laths of 10 × 5 mm, bent across, are bent to the least, and break
    found = rod_limits(StockRodEntry(catalogue="timber_laths"), sharp)
    assert found.curvature_utilisation == pytest.approx(12e9 * 0.0025 * 6.0 / 24e6)


@pytest.mark.parametrize(
    ("lowest", "largest", "bounds"),
    [(None, 0.02, (0.004, 0.02)), (0.005, 0.02, (0.005, 0.02)), (None, 0.006, (0.004, 0.008))],
)
def test_a_free_radius_lies_between_half_the_start_s_and_what_the_net_allows(
    monkeypatch, lowest, largest, bounds
):
    monkeypatch.setattr(module, "max_radius", lambda net, rod: largest)
    rod = Rod.round(young=40e9, radius=0.008, strength=240e6)
    case = SimpleNamespace(
        optimise=SimpleNamespace(radius_min=lowest, catalogue=None), rod=OwnRodEntry(**ROD, radius=0.008)
    )
    assert rod_bounds(case, SimpleNamespace(net=None, rod=rod)) == pytest.approx(bounds)


def test_edge_beams_are_of_the_rods_material_or_their_own():
    rod = Rod.round(young=40e9, radius=0.01, strength=240e6, density=2000.0)
    same = module.edge_beam(EdgeBeamEntry(radius=0.03), rod).section.material
    assert same == rod.section.material
    other = EdgeBeamEntry(radius=0.03, young=70e9, poisson=0.25, strength=160e6, density=2700.0)
    material = module.edge_beam(other, rod).section.material
    assert (material.young, material.strength, material.density) == (70e9, 160e6, 2700.0)
    assert material.shear == pytest.approx(28e9)
    lath = Rod(Rectangle(0.04, 0.01, rod.section.material))
    bundle = module.edge_beam(EdgeBeamEntry(rods=7), lath).section
    assert (bundle.count, bundle.radius) == (7, pytest.approx(math.sqrt(4e-4 / math.pi)))


def one(force):
    load = np.zeros((3, 6))
    load[:2, 2] = -force, -2.0 * force
    return load


@pytest.fixture
def parts(monkeypatch):
    """What each kind of part weighs: its own amount, N, on the first node, twice that on the second, none on
    the third."""
    found = []

    def concrete(net, surface, *, thickness, density, region):
        found.append(region)
        return one(thickness * density)

    def points(net, force, *, every, openings, inside):
        return one(force / every)

    monkeypatch.setattr(module.loads, "concrete", concrete)
    monkeypatch.setattr(module.loads, "points", points)
    monkeypatch.setattr(module.loads, "sheet", lambda net, surface, mass, region: one(10.0 * mass))
    monkeypatch.setattr(module.loads, "joints", lambda net, mass: one(3.0 * mass))
    monkeypatch.setattr(module.loads, "rods", lambda net, section: one(5.0))
    monkeypatch.setattr(module, "weight", lambda net, edge: one(2.0))
    return found


def test_concrete_of_a_case_is_as_dense_as_that_of_python_where_neither_says_so():
    """The entries of a case load nothing of the package, so that they are read at once."""
    assert ConcreteEntry(kind="concrete", thickness=0.05).density == CONCRETE


WET = ConcreteEntry(
    kind="concrete", thickness=0.05, density=2000.0, half=90.0, strip=(180.0, -1.0, 2.0), ring=(0.5, 3.0)
)
PARTS = {
    "wet": WET,
    "tip": PointsEntry(kind="points", force=8.0, every=2),
    "cloth": SheetEntry(kind="membrane", mass=0.7),
    "joints": JointsWeightEntry(kind="joints", mass=0.5),
    "rods": RodsWeightEntry(kind="rods"),
}


def loads_of(entries, *, edge=None):
    case = SimpleNamespace(load=[LoadCaseEntry(**each) for each in entries], part=PARTS)
    shell = SimpleNamespace(net=None, rod=SimpleNamespace(section=None), edge=edge)
    return {name: float(-load[0, 2]) for name, load in load_cases(case, shell, None).items()}


DESIGN = {"name": "design", "factors": {"wet": 1.0, "rods": 1.0}}
MORE = {"name": "additional", "factors": {"wet": 1.2}}


def test_load_cases_are_sums_of_their_parts_in_the_order_in_which_they_are_followed(parts):
    found = loads_of(
        [
            {"name": "mixed", "factors": {"tip": 2.0, "cloth": 3.0, "joints": -1.0}},
            {"name": "pour", "factors": {"rods": 1.0}, "stages": ["cloth", "wet"]},
            MORE,
            DESIGN,
        ]
    )
    assert found == pytest.approx(
        {
            "none": 0.0, "design": 105.0, "additional": 120.0, "mixed": 8.0 + 21.0 - 1.5, "pour 1": 12.0,
            "pour 2": 112.0,
        }
    )  # fmt: skip
    assert list(found)[:3] == ["none", "design", "additional"]
    (region,) = parts
    assert (region.openings, region.inside, region.ring) == ([], [], (0.5, 3.0))
    assert region.half == pytest.approx(math.pi / 2)
    assert region.strip == (pytest.approx(math.pi), -1.0, 2.0)


@pytest.mark.parametrize(("edge", "weighs"), [(None, 105.0), ("beam", 107.0)])
def test_rods_weigh_with_their_edge_beams_where_there_are_any(parts, edge, weighs):
    assert loads_of([DESIGN, MORE], edge=edge)["design"] == weighs


def test_cases_of_one_name_and_a_design_load_that_weighs_nothing_are_refused(parts):
    with pytest.raises(InputError, match="a stage has the name of another case"):
        loads_of(
            [DESIGN, MORE, {"name": "pour", "stages": ["wet"]}, {"name": "pour 1", "factors": {"wet": 1.0}}]
        )
    with pytest.raises(InputError, match=r"'design'.*weighs nothing"):
        loads_of([{"name": "design", "factors": {"wet": 0.0}}, MORE])


def test_a_table_of_loads_is_a_design_load_and_so_many_times_it():
    asked = []

    def point_load(force, *, every, openings):
        asked.append((force, every, openings))
        return one(force)

    case = SimpleNamespace(load=LoadEntry(force=6.0, every=2, additional=1.5))
    found = load_cases(case, SimpleNamespace(point_load=point_load), None)
    assert asked == [(6.0, 2, [])]
    assert {name: load[1, 2] for name, load in found.items()} == {
        "none": 0.0,
        "design": -12.0,
        "additional": -18.0,
    }
