"""What entries of a case rule out among themselves: both sides of each rule, and what each says of it."""

import datetime
from dataclasses import fields
from pathlib import Path
from types import SimpleNamespace

import pytest
from pydantic import ValidationError

from shellform.case.build_safety import critical_factors_asked, is_required
from shellform.case.case import dump_case, load_case, make_case
from shellform.case.edge_entries import EdgeBeamEntry, EdgesEntry, StretchEntry
from shellform.case.entries import (
    NetEntry,
    OptimiseEntry,
    OwnRodEntry,
    TitleBlockEntry,
)
from shellform.case.safety_entries import SafetyEntry
from shellform.errors import InputError
from shellform.gridshell.tolerances import Tolerances

SCALE_MODEL = Path(__file__).parent.parent.parent / "scripts/scale_model.toml"
DOME = SCALE_MODEL.parent / "dome.toml"
ROD = {"young": 40e9, "strength": 255e6}
LINE = [(0.0, 0.0), (1.0, 0.5)]
TUBE = "needs a radius larger than it"


def assert_refused(kind, said, /, **entries):
    with pytest.raises(ValidationError, match=said):
        kind.model_validate(entries)


@pytest.mark.parametrize(("kind", "also"), [(OwnRodEntry, ROD), (EdgeBeamEntry, {})])
def test_a_tube_s_wall_is_thinner_than_its_radius(kind, also):
    assert kind.model_validate({**also, "radius": 0.01, "wall": 0.0099}).wall == 0.0099
    assert kind.model_validate({**also, "radius": 0.01}).wall is None
    for entries in ({"radius": 0.01, "wall": 0.01}, {"radius": 0.01, "wall": 0.011}, {"wall": 0.001}):
        assert_refused(kind, TUBE, **also, **entries)


@pytest.mark.parametrize(("kind", "also"), [(OwnRodEntry, ROD), (EdgeBeamEntry, {})])
def test_a_lath_has_a_width_and_a_height_and_no_radius(kind, also):
    assert kind.model_validate({**also, "width": 0.02, "height": 0.01}).height == 0.01
    for entries in ({"width": 0.02}, {"height": 0.01}):
        assert_refused(kind, "a lath needs both", **also, **entries)
    assert_refused(kind, "either a radius|only one of", **also, width=0.02, height=0.01, radius=0.01)


def test_an_edge_beam_of_a_catalogue_has_a_section_and_none_of_its_own():
    assert EdgeBeamEntry(catalogue="gfrp_rods", section="40 mm").rods is None
    for entries in ({"catalogue": "gfrp_rods"}, {"section": "40 mm"}):
        assert_refused(EdgeBeamEntry, "both catalogue and section", **entries)
    assert_refused(
        EdgeBeamEntry, "only one of rods, catalogue", rods=7, catalogue="gfrp_rods", section="40 mm"
    )


@pytest.mark.parametrize(
    ("entries", "said"),
    [
        ({"guides": [LINE, LINE]}, None),
        ({"angle": "auto"}, None),
        ({"guides": [LINE]}, "two curves"),
        ({"guides": [LINE, LINE, LINE]}, "two curves"),
        ({"guides": [LINE, LINE[:1]]}, "two curves"),
        ({"guides": [LINE[:1], LINE[:1]]}, "two curves"),
        ({"guides": [LINE, LINE], "angle": "auto"}, "no angle to search for"),
    ],
)
def test_guides_are_two_curves_of_two_points_or_more_and_leave_no_angle_to_search_for(entries, said):
    if said is not None:
        assert_refused(NetEntry, said, spacing=0.5, **entries)
        return
    assert NetEntry(spacing=0.5, **entries).guides == entries.get("guides")


@pytest.mark.parametrize(
    ("setting", "said"),
    [
        ("net.angle=405", "net.angle: 405° is more than a whole turn.*for 405° give 45"),
        ("net.angle=-1000", "net.angle: .*give -280"),
        ("part.concrete.half=450", "part.concrete.half: .*give 90"),
        ("part.concrete.strip=[405, 0.0, 1.0]", r"part.concrete.strip.0: .*give 45"),
    ],
)
def test_angles_of_more_than_a_whole_turn_are_refused_in_degrees_where_the_case_is_read(setting, said):
    with pytest.raises(InputError, match=said):
        load_case(DOME, [setting])


OPTIMISE = {"misfit_rms_additional": 0.01}


@pytest.mark.parametrize(
    ("entries", "said"),
    [
        ({"misfit": 0.4, "cable_force": 0.3, "rod_radius": 0.2, "built_misfit": 0.1}, None),
        ({"misfit": 0.7 + 0.5e-9}, None),  # what sums of decimals are off by
        ({"misfit": 0.7 + 3e-9}, "add up to 1"),
        ({"misfit": 0.7 - 3e-9}, "add up to 1"),
        ({"misfit": 0.5, "cable_force": 0.3}, "not 0.8"),
        ({"symmetric": True}, None),
        ({"symmetric": True, "polish": 0}, "give polish some evaluations"),
        ({"polish": 0}, None),
        ({"method": "paper"}, None),
        ({"method": "paper", "symmetric": True}, "need method convex"),
        ({"method": "paper", "cables_max": 50}, "need method convex"),
        ({"cables_max": 50}, None),
        ({"catalogue": "gfrp_rods", "misfit": 0.5, "rod_radius": 0.2}, None),
        ({"misfit": 0.5, "rod_radius": 0.2}, None),
        ({"catalogue": "gfrp_rods"}, "give rod_radius a share"),
    ],
)
def test_what_the_search_is_asked_for_goes_together(entries, said):
    if said is not None:
        assert_refused(OptimiseEntry, said, **OPTIMISE, **entries)
        return
    found = OptimiseEntry.model_validate({**OPTIMISE, **entries})
    assert {name: getattr(found, name) for name in entries} == entries


@pytest.mark.parametrize(
    ("given", "date"),
    [("2026-05-31", "2026-05-31"), (datetime.date(2026, 5, 3), "2026-05-03"), ("", ""), ("2026-02-30", None)],
)
def test_a_drawing_s_date_is_a_day_there_is_or_left_out(given, date):
    if date is None:
        assert_refused(TitleBlockEntry, "day", date=given)
        return
    assert TitleBlockEntry(date=given).date == date


@pytest.mark.parametrize(
    ("entries", "said"),
    [
        ({"compared": 200, "drawn": 200}, None),
        ({"compared": 201, "drawn": 200}, "compared must not exceed drawn"),
        ({"critical_factor": 0.0}, None),
        ({"critical_factor": 1.0}, None),
        ({"critical_factor": 0.999}, "at least 1"),
        ({"critical_factor": 1e-6}, "at least 1"),
        ({"rare": 0}, None),
        ({"rare": 20}, None),
        ({"rare": 10}, "at least 20"),
        ({"rare": 25}, "multiple of 10"),
    ],
)
def test_what_is_asked_of_drawn_structures_can_be_told_from_them(entries, said):
    if said is not None:
        assert_refused(SafetyEntry, said, **entries)
        return
    found = SafetyEntry.model_validate(entries)
    assert {name: getattr(found, name) for name in entries} == entries


@pytest.mark.parametrize(
    ("entries", "said"),
    [
        ({"height": (1.0, 1.5)}, None),
        ({"height": (1.5, 1.5)}, "lower level first"),
        ({"height": (1.5, 1.0)}, "lower level first"),
        ({"opening": False}, None),
        ({"curve": LINE}, None),
        ({"box": ((0.0, 0.0, 0.0), (1.0, 2.0, 3.0))}, None),
        ({"within": 0.2}, "say where"),
    ],
)
def test_a_stretch_of_an_edge_says_where_it_is(entries, said):
    if said is not None:
        assert_refused(StretchEntry, said, kind="wall", **entries)
        return
    assert EdgesEntry(stretch=[{"kind": "wall", **entries}]).stretch[0].kind == "wall"


@pytest.mark.parametrize(
    ("required", "method", "asked"),
    [(True, "convex", True), (True, "paper", False), (False, "convex", False), (False, "paper", False)],
)
def test_safety_is_required_unless_it_is_only_told_or_the_method_is_the_paper_s(required, method, asked):
    def case(factor):
        safety = SafetyEntry(required=required, critical_factor=factor, critical_further={"half": 1.1})
        return SimpleNamespace(safety=safety, optimise=SimpleNamespace(method=method))

    assert is_required(case(1.3)) is asked
    assert critical_factors_asked(case(1.3)) == ({"design": 1.3, "half": 1.1} if asked else {})
    assert critical_factors_asked(case(0.0)) == ({"half": 1.1} if asked else {})


CASE = {
    "surface": {"file": "shell.obj"},
    "net": {"spacing": 0.5},
    "rod": {**ROD, "radius": 0.01},
    "cable": {"stiffness": 1e4, "force_max": 1e3},
    "load": {"force": 100.0},
    "optimise": OPTIMISE,
}
CASES = [
    {"name": "design", "factors": {"wet": 1.0}},
    {"name": "additional", "factors": {"wet": 1.2}},
]
WET = {"wet": {"kind": "concrete", "thickness": 0.05}}


def made(tmp_path, **tables):
    return make_case({**CASE, **tables}, tmp_path / "case.toml")


@pytest.mark.parametrize(
    ("loads", "said"),
    [
        ([*CASES, {"name": "wind", "factors": {"wet": 0.2}}], None),
        ([*CASES, {"name": "pour", "stages": ["wet"]}], None),
        ([*CASES, {"name": "criticals", "factors": {"wet": 0.2}}], None),
        ([*CASES, {"name": "wind"}, {"name": "wind"}], "'wind' is taken"),
        ([*CASES, {"name": "none", "factors": {"wet": 0.2}}], "'none' is taken"),
        ([*CASES, {"name": "critical half"}], "'critical half' is taken"),
        ([CASES[0]], "one .*'additional'"),
        ([*CASES, CASES[0]], "one .*'design'"),
        ([{"name": "design", "stages": ["wet"]}, CASES[1]], "'design' is one case"),
        ([*CASES, {"name": "pour", "stages": ["dry"]}], "'dry' that isn't there; known are wet"),
    ],
)
def test_load_cases_have_names_of_their_own_and_parts_that_there_are(tmp_path, loads, said):
    if said is not None:
        with pytest.raises(InputError, match=said):
            made(tmp_path, load=loads, part=WET)
        return
    assert [each.name for each in made(tmp_path, load=loads, part=WET).load] == [
        each["name"] for each in loads
    ]


def test_where_a_case_has_no_parts_it_is_told_how_to_add_them(tmp_path):
    with pytest.raises(InputError, match=r"known are none: add tables \[part\.NAME\]"):
        made(tmp_path, load=CASES)


def test_a_joint_s_gap_is_less_than_half_a_spacing(tmp_path):
    joint = {"axial": 1.0, "torsion": 1.0, "bending": 1.0}
    assert made(tmp_path, joint={**joint, "gap": 0.249}).joint.gap == 0.249
    for gap in (0.25, 0.3):
        with pytest.raises(InputError, match="well below net"):
            made(tmp_path, joint={**joint, "gap": gap})


@pytest.mark.parametrize(
    ("name", "is_one"),
    [
        (255 * "a", True),
        (256 * "a", False),
        (128 * "ä", False),  # of two bytes each
        (f"{200 * 'a'}/{200 * 'b'}", True),
        (f"a/{256 * 'b'}", False),
        ("a\0b", False),
    ],
)
def test_a_surface_s_file_has_a_name_that_a_file_can_have(tmp_path, name, is_one):
    if is_one:
        assert made(tmp_path, surface={"file": name}).surface.file == str(tmp_path.resolve() / name)
        return
    with pytest.raises(InputError, match="is no file's name"):
        made(tmp_path, surface={"file": name})


@pytest.mark.parametrize(
    ("edges", "given", "fill"),
    [
        ({}, None, None),
        ({}, "all", "all"),
        ({}, "edges", "edges"),
        ({}, "holes", "holes"),
        ({"outer": "fill"}, "holes", "all"),
        ({"outer": "fill"}, "edges", "edges"),
        ({"openings": "fill"}, "edges", "all"),
        ({"openings": "fill"}, "holes", "holes"),
        ({"openings": "fill", "outer": "ground"}, None, "holes"),
        ({"openings": "free", "outer": "fill"}, None, "edges"),
    ],
)
def test_what_is_filled_is_said_of_the_surface_or_of_its_edges(tmp_path, edges, given, fill):
    found = made(tmp_path, edges=edges, surface={"file": "shell.obj"} | ({"fill": given} if given else {}))
    assert found.surface.fill == fill


def test_tolerances_that_follow_the_shell_s_size_stand_as_comments_in_the_run_s_case(tmp_path):
    case = made(tmp_path, tolerances={"supports": 0.003})
    given = {each.name: 0.001 * (1 + k) for k, each in enumerate(fields(Tolerances))}
    text = dump_case(case, Tolerances(**given))
    lines = text[text.index("[tolerances]") :].splitlines()
    names = [name for name in given if name != "supports"]
    assert [line.split("  # ")[0] for line in lines[1 : 1 + len(names)]] == [
        f"# {name} = {given[name]:.6g}" for name in names
    ]
    assert lines[1 + len(names)] == "supports = 0.003"
    (tmp_path / "case.toml").write_text(text, encoding="utf-8")
    assert load_case(tmp_path / "case.toml") == case
    assert dump_case(case) == "".join(
        line for line in text.splitlines(keepends=True) if not line.startswith("# ")
    )


def test_a_catalogue_is_looked_up_beside_the_case_and_its_sections_at_once(tmp_path):
    with pytest.raises(InputError, match=r"bamboo"):
        made(tmp_path, edges={"beam": {"catalogue": "bamboo", "section": "40 mm"}})
    with pytest.raises(InputError, match=r"bamboo"):
        made(tmp_path, optimise={**OPTIMISE, "misfit": 0.5, "rod_radius": 0.2, "catalogue": "bamboo"})
    free = made(tmp_path, optimise={**OPTIMISE, "misfit": 0.5, "rod_radius": 0.2, "catalogue": "gfrp_rods"})
    assert free.optimise.catalogue == "gfrp_rods"


def test_every_wrong_entry_of_a_case_is_told_at_once_with_its_remedies_once_each(tmp_path):
    wrong = {
        "net": {"spacing": -0.5, "offset": [0.1, "far"], "angle": "steep"},
        "robust": {"limits": 0.003},
        "cable": {"stiffness": 1e4, "force_max": 1e3, "rest_rato": 0.9, "xyzzy": 1.0},
        "title_block": {"date": "31 May"},
        "tolerances": {"supports": -1.0},
        "load": [{"name": "design", "factors": {"wet": "much"}}],
    }
    with pytest.raises(InputError) as told:
        made(tmp_path, **wrong)
    what, remedy = told.value.what, told.value.remedy
    assert "net.spacing: input should be greater than 0 (found -0.5)" in what
    assert "net.angle" in what
    assert "(found 'steep')" in what
    assert "net.offset.1: input should be a valid number" in what
    assert "Did you mean 'robust.limit'?" in remedy
    assert "cable.rest_rato is no known entry" in what
    assert "tolerances.supports: input should be greater than or equal to 0 (found -1.0)" in what
    assert "load.0.factors.wet: input should be a valid number" in what
    assert "Give net.spacing (between rods, m)." in remedy
    assert "Did you mean 'cable.rest_ratio'?" in remedy
    assert "Leave it out, or write one of stiffness, rest_ratio, force_max" in remedy
    assert "Give tolerances.supports (m, each coordinate: " in remedy


def test_a_known_entry_that_another_entry_rules_out_is_not_called_unknown(tmp_path):
    sized = {"young": 40e9, "strength": 255e6, "radius": 0.001}
    cases = [
        ({"rod": {**sized, "catalogue": "gfrp_rods"}}, "rod.young doesn't go with rod.catalogue"),
        ({"rod": {**sized, "section": "8 mm"}}, "rod.section doesn't go with rod.young"),
        (
            {"part": {"wet": {"kind": "points", "force": 6.9, "thickness": 0.05}}},
            "part.wet.thickness doesn't go with part.wet.kind = 'points'",
        ),
    ]
    for tables, said in cases:
        with pytest.raises(InputError) as told:
            made(tmp_path, **tables)
        assert said in told.value.what
        assert "no known entry" not in told.value.what
        assert told.value.remedy.startswith("Leave out one or the other.")
    with pytest.raises(InputError, match=r"rod.xyzzy is no known entry.* Leave it out, or"):
        made(tmp_path, rod={"catalogue": "gfrp_rods", "xyzzy": 1.0})


def test_a_date_that_is_none_is_refused_with_how_to_write_one(tmp_path):
    with pytest.raises(
        InputError, match=r"title_block.date: '31.5.2026' is no day; write it like 2026-05-31"
    ):
        made(tmp_path, title_block={"date": "31.5.2026"})


@pytest.mark.parametrize(
    ("setting", "remedy"),
    [
        ("limits.utilisation=97", "For 97 % write 0.97."),
        ("limits.utilisation=120", "For 120 % write 1.2."),
        ("load.additional=120", "For 120 % write 1.2."),
        ("cable.rest_ratio=99", "For 99 % write 0.99."),
        ("optimise.rest_length_max=110", "For 110 % write 1.1."),
        ("optimise.misfit=70", "For 70 % write 0.7."),
        ("optimise.stiffness_min=8", "For 8 % write 0.08."),
        ("optimise.allowance=8", "For 8 % write 0.08."),
        ("safety.probability_design=99", "For 99 % write 0.99."),
        ("safety.probability_design='99'", "For 99 % write 0.99."),
        ("safety.confidence=95", "For 95 % write 0.95."),
        ("safety.critical_factor=125", "For 125 % write 1.25."),
        ("safety.critical_further={ additional = 110 }", "For 110 % write 1.1."),
        ("tolerances.rod_stiffness=3", "For 3 % write 0.03."),
    ],
)
def test_shares_and_factors_in_per_cent_are_refused_with_the_number_to_write(setting, remedy):
    entry, _, _ = setting.partition("=")
    with pytest.raises(InputError, match=entry) as refused:
        load_case(SCALE_MODEL, [setting])
    assert refused.value.remedy.endswith(remedy)


@pytest.mark.parametrize(
    "setting",
    [
        "safety.probability_design=1",
        "tolerances.load_each=0.6",
        "load.additional=0.5",
        "cable.rest_ratio=1.5",  # 0.015 would be a cable of 1.5 % of its length
        "cable.rest_ratio=1",
        "cable.rest_ratio=0",
        "net.elements=1000",  # counts have none
    ],
)
def test_no_per_cents_are_read_into_a_share_that_is_only_too_large(setting):
    with pytest.raises(InputError) as refused:
        load_case(SCALE_MODEL, [setting])
    assert "% write" not in refused.value.remedy


def test_a_factor_or_share_of_the_strength_that_may_be_meant_is_taken():
    case = load_case(SCALE_MODEL, ["limits.utilisation=2", "safety.critical_factor=20", "load.additional=3"])
    assert (case.limits.utilisation, case.safety.critical_factor, case.load.additional) == (2.0, 20.0, 3.0)


def test_a_limit_on_the_connectors_turn_in_degrees_is_refused_with_the_radians():
    assert load_case(SCALE_MODEL, ["limits.connector_turn=1.57"]).limits.connector_turn == 1.57
    for degrees, radians in ((23, "0.401"), (90, "1.57")):
        with pytest.raises(InputError, match=rf"limits.connector_turn.*write {radians}\.$"):
            load_case(SCALE_MODEL, [f"limits.connector_turn={degrees}"])
