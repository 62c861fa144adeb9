"""[edges] and [joint] in a case."""

import numpy as np
import pytest

from shellform.case.build_gridshell import edge_beam
from shellform.case.build_net import edges_of
from shellform.case.case import dump_case, load_case
from shellform.case.edge_entries import EdgeBeamEntry
from shellform.errors import InputError
from shellform.gridshell.edge_beams import Bundle
from shellform.gridshell.gridshell import Rod
from shellform.structure.elements.sections import Rectangle, Round, Tube

CASE = """
[surface]
file = "shell.obj"
{surface}
[net]
spacing = 0.5
[rod]
young = 40e9
strength = 255e6
density = 2000.0
{rod}
[cable]
stiffness = 1e4
force_max = 1e3
[load]
force = 100.0
[optimise]
misfit_rms_additional = 0.1
{more}
"""


def case(tmp_path, more="", *, rod="radius = 0.01", surface=""):
    (tmp_path / "case.toml").write_text(CASE.format(more=more, rod=rod, surface=surface), encoding="utf-8")
    return load_case(tmp_path / "case.toml")


def test_a_joint_that_is_left_out_follows_the_rods(tmp_path):
    once = case(tmp_path)
    assert once.joint.gap == pytest.approx(0.02)
    assert once.joint.axial == pytest.approx(7.15e4 * 100)
    assert once.joint.bending == pytest.approx(7.85e-4 * 1e4)
    (tmp_path / "again.toml").write_text(dump_case(once), encoding="utf-8")
    assert load_case(tmp_path / "again.toml").joint == once.joint


def test_a_radius_that_is_set_takes_the_joint_along(tmp_path):
    case(tmp_path)
    thick = load_case(tmp_path / "case.toml", ["rod.radius=0.02"])
    assert thick.joint.gap == pytest.approx(0.04)


def test_what_is_given_of_a_joint_stays(tmp_path):
    found = case(tmp_path, "[joint]\ngap = 0.03\n")
    assert found.joint.gap == 0.03
    assert found.joint.bending == pytest.approx(7.85)


def test_a_joint_follows_rods_from_a_catalogue(tmp_path):
    text = CASE.format(more="", rod="", surface="").replace(
        "young = 40e9\nstrength = 255e6\ndensity = 2000.0", 'catalogue = "gfrp_rods"\nsection = "40 mm"'
    )
    (tmp_path / "case.toml").write_text(text, encoding="utf-8")
    assert load_case(tmp_path / "case.toml").joint.gap == pytest.approx(0.04)


def test_a_joint_cannot_follow_rods_without_a_size_and_the_remedies_work(tmp_path):
    with pytest.raises(InputError, match="can't follow the rods") as caught:
        case(tmp_path, rod="")
    assert "rod.radius" in caught.value.remedy
    assert case(tmp_path, rod="width = 0.02\nheight = 0.01").joint.gap == pytest.approx(0.01)
    joint = "[joint]\naxial = 1.0\ntorsion = 1.0\nbending = 1.0\ngap = 0.01\n"
    assert case(tmp_path, joint, rod="").joint.gap == 0.01


def test_edges_are_found_from_the_geometry_where_a_case_says_nothing(tmp_path):
    found = edges_of(case(tmp_path))
    assert (found.outer, found.openings, found.ground, found.places) == ("auto", "auto", None, ())
    assert "[edges]" in dump_case(case(tmp_path))


def test_stretches_of_a_case_become_places_with_half_a_spacing_round_curves(tmp_path):
    more = """
[edges]
openings = "free"
ground = -0.2
[[edges.stretch]]
kind = "wall"
name = "north"
height = [2.9, 3.1]
[[edges.stretch]]
kind = "abutment"
curve = [[0.0, 0.0], [1.0, 0.0]]
opening = false
"""
    found = edges_of(case(tmp_path, more))
    assert (found.openings, found.ground) == ("free", -0.2)
    assert [(each.kind, each.name) for each in found.places] == [("wall", "north"), ("abutment", "")]
    assert found.places[1].within == 0.25
    np.testing.assert_array_equal(found.places[1].curve, [[0.0, 0.0], [1.0, 0.0]])


@pytest.mark.parametrize(
    ("edges", "given", "fill"),
    [
        ('outer = "fill"', "", "edges"),
        ('openings = "fill"', "", "holes"),
        ('outer = "fill"\nopenings = "fill"', "", "all"),
        ('outer = "fill"', 'fill = "holes"', "all"),
        ("", 'fill = "holes"', "holes"),
        ("", "", None),
    ],
)
def test_edges_that_are_filled_are_filled_as_the_surface_is_read(tmp_path, edges, given, fill):
    assert case(tmp_path, "[edges]\n" + edges, surface=given).surface.fill == fill


def test_an_edge_beam_is_a_bundle_of_the_rods_or_what_its_entry_says():
    rod = Rod.round(young=40e9, radius=0.01, strength=255e6, density=2000.0)
    made = {
        name: edge_beam(EdgeBeamEntry.model_validate(entry), rod).section
        for name, entry in {
            "left out": {},
            "rods": {"rods": 7, "composite": 1.0},
            "round": {"radius": 0.05},
            "tube": {"radius": 0.05, "wall": 0.004, "young": 210e9, "density": 7850.0, "strength": 235e6},
            "lath": {"width": 0.1, "height": 0.2},
            "stock": {"catalogue": "gfrp_rods", "section": "40 mm"},
        }.items()
    }
    assert isinstance(made["left out"], Bundle)
    assert made["left out"].radius == pytest.approx(0.01)
    assert (made["left out"].count, made["left out"].composite) == (19, 0.5)
    assert made["rods"].count == 7
    assert isinstance(made["round"], Round)
    assert isinstance(made["tube"], Tube)
    assert made["tube"].material.shear == pytest.approx(210e9 / 2.6)
    assert isinstance(made["lath"], Rectangle)
    assert made["stock"].radius == pytest.approx(0.02)


@pytest.mark.parametrize(
    ("more", "match"),
    [
        ('[[edges.stretch]]\nkind = "wall"\n', "say where"),
        ('[[edges.stretch]]\nkind = "wall"\nheight = [3.0, 2.0]\n', "lower level first"),
        ('[[edges.stretch]]\nkind = "flying"\nheight = [2.0, 3.0]\n', "edges.stretch.0.kind"),
        ('[edges]\nouter = "flying"\n', "edges.outer"),
        ("[edges.beam]\nwidth = 0.1\n", "both width and height"),
        ("[edges.beam]\nrods = 7\nradius = 0.1\n", "one of rods, radius"),
        ("[edges.beam]\nwall = 0.1\n", "needs a radius"),
        ('[edges.beam]\nsection = "40 mm"\n', "both catalogue and section"),
        ('[edges.beam]\ncatalogue = "gfrp_rods"\nsection = "41.7 mm"\n', "is not in the catalogue"),
    ],
)
def test_wrong_edges_are_refused_by_entry(tmp_path, more, match):
    with pytest.raises(InputError, match=match):
        case(tmp_path, more)
