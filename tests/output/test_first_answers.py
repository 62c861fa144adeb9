"""The verdicts on the page's first lines, on records that are made up: both sides of each rule, and the
numbers with their units."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from shellform.gridshell.catalogue import label
from shellform.gridshell.edge_beams import Bundle, EdgeBeam
from shellform.gridshell.layers import TwoLayers
from shellform.output.page import first_answers
from shellform.output.page.first_answers import answers
from shellform.output.page.measures import entry_measure, summary_measure
from shellform.output.page.profile_table import profile_table
from shellform.records.check import SLACK, Cell
from shellform.records.profile import Profile, StageProfile, WorkRecord
from shellform.records.raising import WayUpRecord
from shellform.records.summary import DocumentsRecord, LoadRecord, StandingRecord
from shellform.records.words import standing_words
from shellform.structure.elements.sections import Material, Rectangle

MORE = LoadRecord(1.5, 0.0123, 0.0045, 0.0061, True, 0.625)
STANDS = StandingRecord(100, 97, 0.9234, 0.95, 0)
AS_BUILT = Cell(standing_words(STANDS), holds=True)


def safe(more=MORE, as_built=AS_BUILT, *, stands=STANDS, strength_known=True, **changed):
    more = replace(more, stands=stands, **changed)
    return first_answers._is_safe(None, more, as_built, strength_known)


def test_a_shell_that_stands_as_built_is_safe_and_the_detail_tells_how_far_off_it_is_and_how_stressed():
    told = safe()
    assert (told.question, told.good) == ("Is it safe at 1.5 × the load?", True)
    assert told.words == "97 of 100 structures as built stand"
    assert told.detail == (
        "At least 92 % with 95 % confidence. As planned 12 mm off at most, 4.5 mm in the mean, rods at 62 % of their "
        "strength. At which load it collapses isn't known."
    )


UP = WayUpRecord("scaffold", True, 0.9, "raising", 1234.0, 22.1, 13.0, 75)


@pytest.mark.parametrize(
    ("changed", "words", "good"),
    [
        ({}, "By a scaffold under every crossing", True),
        ({"every": False}, "By a scaffold under every second crossing", True),
        ({"by": "supports"}, "By supports that move in", True),
        ({"utilisation": 0.0}, "By a scaffold under every crossing", None),  # of an unknown strength
        ({"utilisation": 0.951}, "By a scaffold under every crossing", None),
        ({"utilisation": 1.0 + 0.99 * SLACK}, "By a scaffold under every crossing", None),
        ({"utilisation": 1.0 + 1.01 * SLACK}, "Rods break on the way up", False),
        ({"utilisation": None, "lost": "It snaps"}, "No way was found", None),
    ],
)
def test_how_a_shell_is_raised_is_told_with_what_it_takes(changed, words, good):
    told = first_answers._is_raised((replace(UP, **changed),))
    assert (told.words, told.good, told.open) == (words, good, good is None)


def test_what_supports_and_a_scaffold_bear_as_it_is_raised_is_told_in_newtons():
    told = first_answers._is_raised((UP,))
    assert told.detail.endswith(
        "of their strength by a scaffold under every crossing. On it supports bear up to 1.23 kN, each prop pushes with up "
        "to 22.1 N, up to 75 crossings are held down with up to 13 N"
    )
    alone = first_answers._is_raised((replace(UP, held_down=0),))
    assert alone.detail.endswith("each prop pushes with up to 22.1 N")
    moved = first_answers._is_raised((WayUpRecord("supports", False, 0.9, "moving supports", 140.0),))
    assert moved.detail.endswith("supports bear up to 140 N")


def test_no_factor_is_told_of_an_additional_load_that_is_no_multiple_of_the_design_load():
    assert safe(multiple=False).question == "Is it safe under the additional load?"
    assert safe(factor=1.0, multiple=True).question == "Is it safe at 1 × the load?"


@pytest.mark.parametrize(
    ("changed", "words", "good"),
    [
        ({"stable": False}, "No, it is unstable", False),
        ({"stable": False, "on_branch": False, "rod_utilisation_max": 9.0}, "No, it is unstable", False),
        ({"on_branch": False, "rod_utilisation_max": 9.0}, "No, it snaps through", False),
        ({"rod_utilisation_max": 1.0 + 1.01 * SLACK}, "No, rods break", False),
        ({"rod_utilisation_max": 1.0 + 0.99 * SLACK}, "97 of 100 structures as built stand", True),
        ({"rod_utilisation_max": 9.0, "strength_known": False}, "97 of 100 structures as built stand", True),
        ({"rod_utilisation_max": float("inf")}, "97 of 100 structures as built stand", True),
        ({"as_built": None}, "Not examined as built", None),
        ({"stands": None}, "Not examined as built", None),
        ({"as_built": replace(AS_BUILT, holds=False)}, "97 of 100 structures as built stand", False),
        ({"as_built": replace(AS_BUILT, holds=None)}, "97 of 100 structures as built stand", None),
        ({"as_built": replace(AS_BUILT, caution="3 snap")}, "97 of 100 structures as built stand", None),
    ],
)  # fmt: skip
def test_what_stands_worst_with_the_perfect_shell_is_told_first_and_then_the_drawn_ones(changed, words, good):
    told = safe(**changed)
    assert (told.words, told.good, told.open) == (words, good, good is None)


def test_what_asks_for_care_although_the_shell_stands_is_told_with_how_sure_that_is():
    told = safe(as_built=replace(AS_BUILT, caution="3 snap"))
    assert "with 95 % confidence. That some snap so far asks for care. As planned" in told.detail
    assert safe(as_built=replace(AS_BUILT, holds=False, caution="3 snap")).good is False


@pytest.mark.parametrize(("standing", "sure"), [(95, True), (94, False), (40, False), (100, True)])
def test_fewer_than_95_of_a_hundred_are_not_surely_safe_though_no_more_are_asked_for(standing, sure):
    told = safe(stands=replace(STANDS, standing=standing))
    assert told.good is (True if sure else None)
    assert told.words == f"{'' if sure else 'Not surely: '}{standing} of 100 structures as built stand"
    assert ("No more are asked for." in told.detail) != sure
    fallen = safe(as_built=replace(AS_BUILT, holds=False), stands=replace(STANDS, standing=standing))
    assert fallen.good is False
    assert "Not surely" not in fallen.words


@pytest.mark.parametrize("known", [True, False])
def test_no_share_of_an_unknown_strength_is_told(known):
    assert ("of their strength" in safe(strength_known=known).detail) == known
    assert "of their strength" not in safe(rod_utilisation_max=float("inf")).detail


@pytest.mark.parametrize(("stress", "share", "words"), [(None, 62, ""), (0.6, 62, ""), (0.66, 66, ""), (1.004, 100, "No, rods break")])  # fmt: skip
def test_rods_are_told_to_be_stressed_as_much_as_they_are_with_axial_force_where_that_is_known(
    stress, share, words
):
    told = safe(stress_utilisation_max=stress)
    assert f"rods at {share} % of their strength" in told.detail
    assert told.words == (words or "97 of 100 structures as built stand")


@pytest.mark.parametrize(
    ("factor", "kind", "error", "words"),
    [
        (None, "limit", None, "At which load it collapses isn't known."),
        (2.5, None, None, "At which load it collapses isn't known."),
        (3.456, "none", None, "Stable up to 3.46 × the design load, the most that was tried."),
    ],
)
def test_the_load_of_collapse_is_told_as_far_as_it_is_known(factor, kind, error, words):
    row = replace(MORE, critical_factor=factor, critical_kind=kind, critical_factor_error=error)
    assert first_answers._collapse(row) == words
    assert first_answers._collapse(None) == "At which load it collapses isn't known."


def test_a_path_that_ends_with_rod_elements_halved_alone_is_not_told_as_stable_without_a_word():
    row = replace(MORE, critical_factor=3.0, critical_kind="none", critical_factor_halved=1.4258)
    assert first_answers._collapse(row).endswith("was tried, but 1.426 × with rod elements halved.")
    snaps = replace(row, critical_snap_halved=0.0017)
    assert first_answers._collapse(snaps).endswith("or a cell snaps by 1.7 mm and it bears on.")


def test_the_error_of_a_collapse_load_is_told_without_its_sign():
    row = replace(MORE, critical_factor=2.5, critical_kind="limit point", critical_factor_error=-0.0312)
    assert first_answers._collapse(row).endswith(", by the mesh off by 0.031.")
    assert "off by" not in first_answers._collapse(replace(row, critical_factor_error=None))


@pytest.mark.parametrize(
    ("stable", "on_branch", "good"), [(True, True, None), (False, True, False), (True, False, False)]
)
def test_how_far_off_is_told_in_millimetres_and_is_bad_where_the_shell_does_not_stand(
    stable, on_branch, good
):
    main = replace(MORE, stable=stable, on_branch=on_branch)
    told = first_answers._how_far(main, None, ["A note", "Another"])
    assert (told.words, told.good) == ("12 mm at most", good)
    assert told.detail == "4.5 mm in the mean, under the design load, as planned. A note. Another"
    shape = SimpleNamespace(
        deviation_max=0.034, deviation_mean=0.0151, deviation_max_worst=0.0789, structures=31, causes={}
    )
    told = first_answers._how_far(
        replace(main, built_shape=shape), replace(MORE, deviation_max=0.195), ["A note"]
    )
    assert (told.words, told.good) == ("12 mm as planned, 34 mm as built", good)
    assert "4.5 mm and 15 mm in the mean" in told.detail
    assert told.detail.endswith(
        "of 31 drawn structures; the worst is 79 mm off. Braced and not yet loaded it is 195 mm off at most. A note"
    )
    then = SimpleNamespace(deviation_max=0.021, deviation_max_worst=0.0491, structures=19)
    told = first_answers._how_far(replace(main, built_shape=shape, adjusted_shape=then), None, [])
    assert told.detail.endswith(
        "the worst is 79 mm off. With supports fixed last, where rods' ends lie on a scaffold, and cables tightened to "
        "their force before any load 21 mm, 49 mm in the worst of 19"
    )


def test_what_rods_bear_is_told_as_built_and_adjusted_on_site():
    def shape(*stress):
        return SimpleNamespace(stress=stress or None)

    told = " as planned, 152 as built, where they are stressed most (322 in the worst structure)"
    assert first_answers._as_built(shape(1.52, 3.22), None) == told
    assert first_answers._as_built(shape(1.52, 3.22), shape()) == told
    assert (
        first_answers._as_built(shape(1.52, 3.22), shape(0.6, 0.999)) == f"{told}, 60 adjusted on site (100)"
    )
    assert first_answers._as_built(None, None) == first_answers._as_built(shape(), shape(0.6, 0.9)) == ""


def test_slack_cables_are_named_up_to_eight_and_the_others_counted():
    names = tuple(f"C{k}" for k in range(11))
    main = replace(MORE, slack=names[:8])
    assert first_answers._slack(main, replace(MORE, slack=names)) == (
        "; slack before any load: C0, C1, C2, C3, C4, C5, C6, C7 and 3 more"
        "; slack under it: C0, C1, C2, C3, C4, C5, C6, C7"
    )
    none = replace(MORE, slack=())
    assert first_answers._slack(replace(MORE, slack=()), none) == "; none slack before the load"
    assert first_answers._slack(replace(MORE, slack=("C3",)), none) == "; slack under it: C3"
    assert first_answers._slack(MORE, None) == ""
    assert first_answers._slack(None, None) == ""


@pytest.mark.parametrize(
    ("used", "beams", "told"), [(0.425, ("e",), True), (0.425, (), False), (None, ("e",), False)]
)
def test_the_edge_s_lengths_are_added_up_by_kind(used, beams, told):
    kinds = [("ground", 2.5), ("beam", 4.0), ("ground", 1.25), ("free", 0.5)]
    net = SimpleNamespace(
        stretches=[SimpleNamespace(kind=kind, length=length) for kind, length in kinds],
        edges=beams,
        supports=range(14),
    )
    answer = first_answers._stands_on(net, replace(MORE, edge_utilisation_max=used), {})
    assert answer.words == "3.75 m on the ground, 4 m on edge beams, 0.5 m free"
    assert answer.detail == "14 supports" + (
        "; edge beams, drawn dark, at 42 % of their strength" if told else ""
    )


def test_what_supports_have_to_take_is_told_of_the_worst_load():
    net = SimpleNamespace(stretches=[SimpleNamespace(kind="ground", length=2.0)], edges=(), supports=range(3))
    loads = {
        "none": replace(MORE, uplift_max=350.0, thrust_max=40.0),
        "design": replace(MORE, uplift_max=20.0, thrust_max=125.0),
        "older": replace(MORE, uplift_max=None, thrust_max=None),
    }
    told = first_answers._stands_on(net, None, loads).detail
    assert (
        told
        == "3 supports, held down with up to 350 N and pushed sideways by up to 125 N each, erected or loaded"
    )
    loads["none"] = replace(MORE, uplift_max=1.44e6, thrust_max=23400.0)
    assert (
        "held down with up to 1\u202f440 kN and pushed sideways by up to 23.4 kN each"
        in first_answers._stands_on(net, None, loads).detail
    )
    del loads["none"], loads["design"]
    assert first_answers._stands_on(net, None, loads).detail == "3 supports"


def shell_of(section, strength):
    rods = tuple(SimpleNamespace(length=length) for length in (2.5, 4.0, 3.25))
    net = SimpleNamespace(
        grid=SimpleNamespace(rods=rods, lattice=np.zeros((5, 2))),
        supports=np.arange(4),
        stretches=(),
        edges=(),
        notes=(),
    )
    cables = SimpleNamespace(
        ends=np.zeros((3, 2)),
        rest_length=np.array([1.0, 1.5, 2.25]),
        tension=lambda state: state * np.array([0.0, 7.5, 30.0]),
    )
    return SimpleNamespace(
        net=net,
        edge=None,
        cables=lambda design: cables,
        cable_ends=np.zeros((8, 2)),
        rod=SimpleNamespace(
            strength=strength,
            resized=lambda radius: SimpleNamespace(section=section) if radius == 0.02 else None,
        ),
    )


@pytest.mark.parametrize("density", [460.0, 0.0])
@pytest.mark.parametrize(("layers", "spliced"), [(1, ()), (2, (0, 2))])
def test_what_to_buy_is_told_in_bars_metres_and_kilograms_of_both_laths(
    monkeypatch, density, layers, spliced
):
    """9.75 m of rods of 50 × 35 mm: 0.805 kg/m a lath."""
    lath = Rectangle(0.050, 0.035, Material(12e9, 0.75e9, density, 24e6))
    shell = shell_of(TwoLayers(lath) if layers == 2 else lath, 24e6)
    summary = SimpleNamespace(
        designs={
            "best": SimpleNamespace(
                loads={
                    "design": replace(MORE, stress_utilisation_max=0.7),
                    "none": replace(MORE, slack=(), cable_force_max=61.0),
                },
                ways_up=None,
            )
        },
        documents=DocumentsRecord("best", 6.0, 2, 2, 0.1, spliced, (), cut_lengths=2),
    )
    monkeypatch.setattr(first_answers, "shape_notes", lambda *_: [])
    far, many, which, buy = answers(
        shell,
        "best",
        SimpleNamespace(radius=0.02),
        {"design": 2.0},
        summary,
        next_size="60 × 40 mm",
    )
    assert far.words == "12 mm at most"
    assert many.words == "3 of 8"
    assert (
        many.detail
        == "60 N at most in one, 75 N in all, under the design load; 61 N at most before any load; "
        "none slack before the load"
    )
    assert which.detail.startswith("3 rods of up to 4\u202f000 mm; at 70 % of their strength")
    assert ("lath by lath" in which.detail) == (layers == 2)
    assert which.detail.endswith("; the next size sold is 60 × 40 mm")
    length, mass = ("9.75 m of rod", "7.85 kg") if layers == 1 else ("19.5 m of laths, two a rod", "15.7 kg")
    assert buy.words == length + (f" ({mass})" if density else "")
    assert buy.detail == (
        f"3 rods from 2 bars of 6 m{', 2 of them spliced' if spliced else ''}, 5 connectors, 4 supports, 3 cables of 4.75 m in all, "
        "cut to 2 different lengths"
    )


@pytest.mark.parametrize(("density", "told"), [(7850.0, " (58.9 kg)"), (0.0, "")])
def test_edge_beams_are_bought_too(density, told):
    """Two of 2 and of 1 m, of 50 × 50 mm: 19.6 kg/m."""
    shell = shell_of(Rectangle(0.05, 0.035, Material(12e9, 0.75e9)), 24e6)
    place = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 1.0, 0.0]])
    shell.net.edges = tuple(SimpleNamespace(ends=np.array(ends)) for ends in ([(0, 1), (1, 2)], [(2, 3)]))
    shell.net.target = SimpleNamespace(positions=place)
    steel = Rectangle(0.05, 0.05, Material(210e9, 81e9, density))
    shell.edge = EdgeBeam(steel)
    none = SimpleNamespace(designs={}, documents=None)
    *_, buy = answers(shell, "best", SimpleNamespace(radius=0.02), {}, none)
    assert buy.detail.endswith(f"4.75 m in all, 2 edge beams of 3 m in all{told}, {label(steel)}")


def test_the_rods_of_edge_beams_that_are_bundles_are_bought_besides():
    """19 rods of 2 and of 1 m: more than the grid's own 9.75 m."""
    shell = shell_of(Rectangle(0.05, 0.035, Material(12e9, 0.75e9)), 24e6)
    place = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 1.0, 0.0]])
    shell.net.edges = tuple(SimpleNamespace(ends=np.array(ends)) for ends in ([(0, 1), (1, 2)], [(2, 3)]))
    shell.net.target = SimpleNamespace(positions=place)
    shell.edge = EdgeBeam(Bundle(0.0225, 19, 0.5, Material(40e9, 4.5e9)))
    other = DocumentsRecord("another", 6.0, 2, 2, 0.1, (), ())
    none = SimpleNamespace(designs={}, documents=other)
    *_, buy = answers(shell, "best", SimpleNamespace(radius=0.02), {}, none)
    assert buy.detail.endswith("2 edge beams of 3 m in all, bundles of 19 rods ⌀ 45 mm: 57 m of rods besides")
    assert buy.detail.startswith("3 rods, 5 connectors"), "of another design's bars nothing"


def test_nothing_is_told_of_a_design_that_was_not_examined_and_no_share_of_an_unknown_strength():
    lath = Rectangle(0.050, 0.035, Material(12e9, 0.75e9, 460.0, 24e6))
    none = SimpleNamespace(designs={}, documents=None)
    design = SimpleNamespace(radius=0.02)
    many, which, buy = answers(shell_of(lath, 24e6), "best", design, {}, none)
    assert many.detail.startswith("0 N at most in one, 0 N in all")
    assert "strength" not in which.detail
    assert "different lengths" not in buy.detail
    label = which.words
    row = SimpleNamespace(
        designs={"best": SimpleNamespace(loads={"additional": MORE}, ways_up=None)}, documents=None
    )
    many, which, safety, _ = answers(shell_of(lath, float("inf")), "best", design, {}, row, next_size=label)
    assert "next size" not in which.detail
    assert safety.question == "Is it safe at 1.5 × the load?"
    assert "of their strength" not in safety.detail


def test_quantities_have_units_of_handy_size():
    for measure, value, shown, unit in (
        (summary_measure("designs.best.loads.design.deviation_max"), 0.0123, 12.3, "mm"),
        (summary_measure("designs.best.loads.design.connector_turn_max"), np.pi / 6.0, 30.0, "°"),
        (summary_measure("designs.best.loads.design.rod_utilisation_max"), 0.625, 62.5, "%"),
        (summary_measure("designs.best.loads.design.cable_force_max"), 12.5, 12.5, "N"),
        (summary_measure("designs.best.cables"), 84, 84, ""),
        (summary_measure("x.unheard_of"), 7.5, 7.5, ""),
        (entry_measure("net.spacing"), 0.055, 55.0, "mm"),
        (entry_measure("net.angle"), 45.0, 45.0, "°"),
        (entry_measure("rod.young"), 40e9, 40.0, "GPa"),
        (entry_measure("rod.strength"), 255e6, 255.0, "MPa"),
        (entry_measure("cable.stiffness"), 187.0, 187.0, "N"),
        (entry_measure("load.additional"), 1.5, 1.5, ""),
    ):
        assert (measure.factor * value, measure.unit) == (pytest.approx(shown), unit)


def test_the_table_of_what_stages_took_has_sums_and_the_largest_peak_last():
    profile = Profile(
        stages={
            "net": StageProfile("net", 2.5, 1.25, 0.5, {"other": WorkRecord(0, 0.0, 0.0), "solve": WorkRecord(3, 1.0, 0.75)}, 120e6),
            "initial": StageProfile("initial", 1.0, 0.75, 0.25, {}, 90e6),
            "safety": StageProfile("safety", 10.0, 8.5, 0.25, {"search": WorkRecord(1500, 6.0, 5.5), "solve": WorkRecord(2, 1.0, 0.5), "other": WorkRecord(1, 3.0, 2.5)}),
        }
    )  # fmt: skip
    table = profile_table(profile)
    assert table.heads[4:] == ("search", "other", "solve"), "what took most of the processor first"
    rows = {name: [cell.replace("\u00a0", " ") for cell in cells] for name, cells in table.rows}
    assert rows == {
        "net": ["2.50", "1.25", "0.50", "120", "–", "–", "0.75 (3)"],
        "safety": ["10.00", "8.50", "0.25", "–", "5.50 (1,500)", "2.50", "0.50 (2)"],
        "initial": ["1.00", "0.75", "0.25", "90", "–", "–", "–"],
        "total": ["13.50", "10.50", "1.00", "120", "5.50 (1,500)", "2.50", "1.25 (5)"],
    }
    assert profile_table(Profile()).rows == ()
