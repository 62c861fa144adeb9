"""From a case's entries to its surface, its edges and its net, without pulling any."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from shellform.case import build_net as module
from shellform.case.build_gridshell import RodLimits
from shellform.case.build_net import (
    counted_from,
    distant_origin,
    edge_records,
    edges_of,
    net_of,
    size_text,
    surface_of,
    with_rods,
)
from shellform.case.case import shipped_surfaces
from shellform.case.edge_entries import EdgesEntry
from shellform.case.entries import NetEntry, SurfaceEntry
from shellform.errors import InputError
from shellform.surface.shape.target import Surface
from tests.records.made import NET
from tests.surface.shells import cap, write_obj

FLAT = np.array([[0.0, 0.0, 0.0], [3.0, 0.0, 0.5], [3.0, 2.0, 0.0], [0.0, 2.0, 0.5]])


def plate(corner=(0.0, 0.0, 0.0)):
    return Surface(FLAT + np.array(corner), [[0, 1, 2], [0, 2, 3]], np.tile([0.0, 0.0, 1.0], (4, 1)))


def test_coordinates_count_from_the_origin_and_say_so():
    found = counted_from(plate((500.0, -20.0, 7.0)), (490.0, -30.0, 5.0))
    np.testing.assert_allclose(found.vertices, FLAT + np.array([10.0, 10.0, 2.0]))
    assert "count from (490, -30, 5) m of the file's" in found.mended[-1]


@pytest.mark.parametrize(
    ("entry", "corner", "above"),
    [
        ({}, 500.0, None),
        ({"origin": (490.0, 0.0, 0.0)}, 10.0, None),
        ({"origin": (490.0, 0.0, 0.0), "above": 0.2}, 10.0, 0.2),
    ],
)
def test_a_surface_is_counted_from_its_origin_before_it_is_cut_off_above_a_level(
    monkeypatch, entry, corner, above
):
    asked = []
    monkeypatch.setattr(module, "_read", lambda entry, *, allow_scripts: plate((500.0, 0.0, 0.0)))
    monkeypatch.setattr(module, "cut_off", lambda surface, level: asked.append(level) or surface)
    found = surface_of(SurfaceEntry(file="a.obj", **entry))
    assert found.vertices[0, 0] == corner
    assert asked == ([] if above is None else [above])


def test_a_ground_that_the_edge_does_not_touch_is_refused_in_the_coordinates_it_was_given_in(tmp_path):
    """A cap whose edge lies at 0 to 0.75 m, 1300 m up."""
    points, quads = cap()
    far = str(write_obj(tmp_path / "far.obj", points + np.array([0.0, 0.0, 1300.0]), quads))
    for origin, ground, edge in [(1300.0, -0.9, "0 to 0.75"), (1000.0, 299.1, "300 to 300.75")]:
        entry = SurfaceEntry(file=far, fill="edges", ground=ground, origin=(0.0, 0.0, origin))
        told = rf"^surface\.ground: .*fewer than two places.* at {edge} m \(found {ground}\)\. Give a height"
        with pytest.raises(InputError, match=told):
            surface_of(entry)


def test_dimensions_are_of_builder_scripts_alone():
    with pytest.raises(InputError, match="only builder scripts have dimensions"):
        surface_of(SurfaceEntry(file="a.obj", dimensions={"width": 2.0}))


@pytest.mark.parametrize(
    "entry",
    [
        {"unit": "mm"},
        {"up": "y"},
        {"layer": "roof"},
        {"fill": "holes"},
        {"fill_narrower": 0.5},
        {"ground": 0.0},
    ],
)
def test_a_builder_script_takes_no_entry_of_files(entry):
    vault = str(shipped_surfaces() / "vault.py")
    (name,) = entry
    with pytest.raises(InputError, match=f"a builder script takes no {name}"):
        surface_of(SurfaceEntry(file=vault, **entry))


def case(net=None, edges=None):
    return SimpleNamespace(
        net=NetEntry(spacing=0.5, **(net or {})),
        joint=SimpleNamespace(gap=0.02),
        edges=EdgesEntry.model_validate(edges or {}),
    )


@pytest.mark.parametrize(
    ("net", "edges", "ground"),
    [
        ({}, {}, None),
        ({"ground": 0.3}, {}, 0.3),
        ({"ground": 0.3}, {"ground": -0.2}, -0.2),
        ({"ground": 0.3}, {"ground": 0.0}, 0.0),
    ],
)
def test_the_ground_is_the_edges_own_or_the_net_s(net, edges, ground):
    assert edges_of(case(net, edges)).ground == ground


def test_edges_that_are_filled_are_found_by_themselves_and_stretches_lie_within_half_a_spacing():
    stretches = [
        {"kind": "wall", "curve": [(0.0, 0.0), (1.0, 2.0)]},
        {"kind": "pin", "box": ((0.0, 0.0, 0.0), (1.0, 2.0, 3.0)), "within": 0.4, "opening": True},
    ]
    found = edges_of(case({}, {"outer": "fill", "openings": "wall", "stretch": stretches}))
    assert (found.outer, found.openings) == ("auto", "wall")
    wall, pin = found.places
    assert (wall.within, wall.box, wall.opening) == (0.25, None, None)
    assert (pin.within, pin.curve, pin.opening) == (0.4, None, True)
    np.testing.assert_array_equal(wall.curve, [[0.0, 0.0], [1.0, 2.0]])


@pytest.mark.parametrize(("angle", "turned"), [(30.0, np.pi / 6), ("auto", "auto")])
def test_a_net_lies_at_its_angle_in_radians_with_the_joint_s_gap(monkeypatch, angle, turned):
    asked = []

    def oriented(surface, settings, *, angle, offset, progress):
        asked.append((angle, offset, settings.gap, settings.spacing, settings.elements, settings.outline))
        return "net", 0.4, (0.25, 0.0)

    monkeypatch.setattr(module, "oriented_net", oriented)
    monkeypatch.setattr(module, "stand", lambda net, surface, edges: (net, edges))
    outline = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)]
    own = case({"angle": angle, "offset": (0.5, 0.1), "elements": 3, "outline": outline})
    (net, edges), *placed = net_of(own, plate())
    assert (net, edges.outer, placed) == ("net", "auto", [0.4, (0.25, 0.0)])
    assert asked == [
        (turned if angle == "auto" else pytest.approx(turned), (0.5, 0.1), 0.02, 0.5, 3, outline)
    ]
    plain = case()
    assert net_of(plain, plate())[0][0] == "net"
    assert asked[-1][-1] is None
    with pytest.raises(InputError, match="rounding hides the load"):
        net_of(plain, plate((20_000.0, 0.0, 0.0)))


def test_records_of_edges_and_rods_keep_their_levels_and_amounts():
    stretch = SimpleNamespace(
        kind="beam",
        name="north",
        opening=True,
        length=4.5,
        points=np.array([[9.0, 9.0, 1.5], [0.0, 0.0, 0.25]]),
    )
    (record,) = edge_records(SimpleNamespace(stretches=[stretch]))
    assert list(vars(record).values()) == ["beam", "north", True, 4.5, (0.25, 1.5)]
    found = with_rods(NET, RodLimits(0.02, 0.6, 0.75))
    assert (found.rod_radius_max, found.curvature_limit, found.curvature_utilisation) == (0.02, 0.6, 0.75)
    assert replace(
        found, rod_radius_max=NET.rod_radius_max, curvature_limit=None, curvature_utilisation=None
    ) == (replace(NET, curvature_limit=None, curvature_utilisation=None))
    assert size_text((12.0, 0.5, 3.14159)).startswith("12 × 0.5 × 3.142 m")
    assert size_text((16.0, 16.0, 4.441e-15)).startswith("16 × 16 × 0 m"), "of what is flat"


@pytest.mark.parametrize(
    ("size", "corner", "origin"),
    [(10.0, (4312.5, -819.0, 41.0), (4310.0, -820.0, 40.0)), (0.1, (43.125, -8.19, 0.0), (43.1, -8.2, 0.0))],
)
def test_an_origin_near_a_surface_has_the_last_digit_that_counts_of_its_size(size, corner, origin):
    """Sides of 30 and of 0.3 m."""
    given = replace(plate(), vertices=size * FLAT + np.array(corner))
    assert distant_origin(given, 100.0) == pytest.approx(origin)


def test_beyond_a_hundred_of_its_sides_a_surface_is_distant():
    assert module.FAR == 100.0
    assert distant_origin(plate((297.0, 0.0, 0.0)), module.FAR) is None
    assert distant_origin(plate((297.1, 0.0, 0.0)), module.FAR) == pytest.approx((297.0, 0.0, 0.0))
