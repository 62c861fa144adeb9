"""What the examination as built draws, counts and tells of each load, with designs and structures that are
stood in for."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from shellform.errors import NotConverged
from shellform.gridshell.tolerances import Tolerances
from shellform.records.built_shape import BuiltShapeRecord
from shellform.records.drawn import DrawnPath, DrawnShape, DrawnSnap
from shellform.records.progress import Kind
from shellform.records.summary import StandingRecord
from shellform.reliability.path_of_one import SOUGHT
from shellform.run import examination, shape_as_built
from shellform.run.sampling import Clock, Examined
from tests.records.made import design, load, summary

DESIGN = np.array([[0.0, 0.0, -10.0], [0.0, 0.0, -20.0]])
LOADS = {
    "none": 0.0 * DESIGN,
    "design": DESIGN,
    "additional": 1.25 * DESIGN,
    "wind": 0.1 * DESIGN[:, [2, 0, 1]],
}
SAFETY = SimpleNamespace(
    seed=7, confidence=0.9, drawn=40, compared=4, probability_additional=0.95, rare=0, required=True
)
CASE = SimpleNamespace(safety=SAFETY)


class Desk:
    """A workspace that keeps what is said."""

    def __init__(self, folder, **safety):
        self.folder, self.said = folder, []
        self.case = SimpleNamespace(safety=SimpleNamespace(**{**vars(SAFETY), **safety}))

    def say(self, stage, text, kind=Kind.PROGRESS):
        self.said.append((text, kind))

    def report(self, event):
        self.said.append((event.text, event.seconds_left))

    def path(self, name):
        return self.folder / name


OFF = Tolerances(supports=1e-4)


def examined(name="initial", loads=LOADS, strength=200.0):
    shell = SimpleNamespace(rod=SimpleNamespace(strength=strength))
    return Examined(name, shell, f"{name} itself", loads, OFF)


def told(names=("initial", "optimised")):
    rows = {name: load(name) for name in ("none", "design", "additional")}
    rows["wind"] = load("additional", factor=0.1)
    given = summary(names)
    for name in names:
        given = given.with_design(name, design(loads=rows))
    return given


@pytest.fixture(autouse=True)
def unwritten(monkeypatch):
    monkeypatch.setattr(examination, "write_summary", lambda *_: None)


def mesh_error(kind="limit point"):
    number = lambda coarse, fine, error: SimpleNamespace(coarse=coarse, fine=fine, error=error)  # noqa: E731
    return SimpleNamespace(
        critical=number(1.6, 1.5, 0.13),
        deviation_max=number(0.0, 0.0, 0.004),
        deviation_mean=number(0.0, 0.0, 0.002),
        stress=number(0.0, 0.0, 50.0),
        kinds=(kind, "bifurcation"),
        snap=None if kind == "limit point" else SimpleNamespace(factor=1.5, far=0.0017),
    )


@pytest.mark.parametrize(
    ("asked", "sought"),
    [
        ({}, SOUGHT),
        ({"design": 2.0 * SOUGHT}, 3.0 * SOUGHT),
        ({"additional": 2.0 * SOUGHT}, 3.75 * SOUGHT),  # of a load 1.25 times as large as the one followed
        ({"wind": 9.0 * SOUGHT}, SOUGHT),
    ],
)
def test_what_one_path_tells_of_its_loads_is_counted_by_each_of_them(monkeypatch, asked, sought):
    followed = []

    def halved(shell, own, force, *, sought):
        followed.append((own, force[0, 2], sought))
        return mesh_error()

    monkeypatch.setattr(examination, "mesh_error", halved)
    rows = told().designs["initial"].loads
    found = examination._with_ends(rows, examined(), "design", {"additional": 1.0, "design": 0.8}, asked)
    assert followed == [("initial itself", -10.0, pytest.approx(sought))]
    assert found["design"] == replace(
        rows["design"],
        critical_sought=pytest.approx(sought),
        critical_factor=1.6,
        critical_factor_halved=1.5,
        critical_factor_error=0.13,
        critical_kind="limit point",
        deviation_max_error=0.004,
        deviation_mean_error=0.002,
        rod_utilisation_error=0.25,
    )
    assert found["additional"] == replace(
        rows["additional"],
        critical_sought=pytest.approx(0.8 * sought),
        critical_factor=pytest.approx(1.28),
        critical_factor_halved=pytest.approx(1.2),
        critical_factor_error=pytest.approx(0.104),
        critical_kind="limit point",
    )
    monkeypatch.setattr(examination, "mesh_error", lambda *_, **__: mesh_error("none"))
    snapping = examination._with_ends(rows, examined(), "design", {"additional": 1.0, "design": 0.8}, {})
    assert [snapping[name].critical_snap_halved for name in ("design", "additional")] == [0.0017, 0.0017]
    endless = examination._with_ends(rows, examined(strength=np.inf), "design", {"design": 1.0}, {})
    assert endless["design"].rod_utilisation_error is None, "of rods whose strength isn't known"


def test_a_path_that_is_lost_is_told_of_every_load_on_it(monkeypatch):
    def lost(*_, **__):
        raise NotConverged("no way")

    monkeypatch.setattr(examination, "mesh_error", lost)
    rows = told().designs["initial"].loads
    found = examination._with_ends(rows, examined(), "design", {"additional": 1.0, "design": 0.8}, {})
    assert found == {
        name: replace(rows[name], critical_kind="not found: no way") for name in ("additional", "design")
    }


@pytest.mark.parametrize(
    ("asked", "kept"),
    [
        ({}, None),
        ({"design": 1.3}, True),
        ({"design": 1.3013}, True),  # to a thousandth
        ({"design": 1.3014}, False),
        ({"design": 1.2, "wind": 2.2}, False),
        ({"wind": 2.0, "storm": 9.0}, True),  # of loads that the design has
        ({"none": 1.0}, False),  # for which nothing was found
        ({"wind": 2.05}, False),  # kept by the coarser mesh alone
    ],
)
def test_critical_factors_are_kept_where_every_one_that_is_asked_for_is_with_rod_elements_halved_too(
    monkeypatch, asked, kept
):
    seen = []

    def with_ends(rows, each, followed, shares, wanted):
        seen.append((followed, sorted(shares)))
        coarse, fine = (1.4, 1.3) if followed == "design" else (2.1, 2.0)
        return {
            name: replace(rows[name], critical_factor=coarse, critical_factor_halved=fine) for name in shares
        }

    monkeypatch.setattr(examination, "critical_factors_asked", lambda case: asked)
    monkeypatch.setattr(examination, "_with_ends", with_ends)
    record = examination._critical(CASE, examined(), told().designs["initial"])
    assert seen == [("design", ["additional", "design"]), ("wind", ["wind"])], "by the design load, if it can"
    assert record.critical_factor_kept is kept
    assert record.loads["wind"].critical_factor == 2.1
    assert record.loads["none"].critical_factor is None


PATH = DrawnPath(
    (0.4, 0.79, 0.81, 1.0, 1.0),
    (False, False, False, True, False),
    (DrawnSnap(0, 0.2, 0.09), DrawnSnap(3, 0.5, 0.03), DrawnSnap(3, 0.7, 0.05), DrawnSnap(2, 0.8, 0.07)),
)


@pytest.mark.parametrize(
    ("share", "standing", "lowest", "snapped", "snap"), [(1.0, 1, 0.4, 1, 0.05), (0.8, 3, 0.5, 1, 0.05)]
)
def test_structures_fall_below_a_share_of_the_load_or_before_its_end_and_of_the_others_snaps_are_counted(
    share, standing, lowest, snapped, snap
):
    found = examination._standing(PATH, share, CASE)
    assert (found.drawn, found.standing, found.confidence, found.seed) == (5, standing, 0.9, 7)
    assert found.lowest == pytest.approx(lowest)
    assert (found.snapped, found.snap) == (snapped, snap)
    assert found.at_least < standing / 5


def test_where_all_stand_the_lowest_factor_is_the_load_and_nothing_has_snapped():
    found = examination._standing(DrawnPath((1.0, 1.0), (True, True)), 0.8, CASE)
    assert (found.standing, found.lowest, found.snapped, found.snap) == (2, 1.0, 0, 0.0)
    twice = DrawnPath((1.0,), (True,), (DrawnSnap(0, 0.5, 0.001), DrawnSnap(0, 0.95, 0.009)))
    found = examination._standing(twice, 0.8, CASE)
    assert (found.snapped, found.snap) == (1, 0.001), "what snaps beyond the share isn't of it"
    at_it = DrawnPath((0.8 * (1.0 - 1e-12),), (False,), (DrawnSnap(0, 0.8, 0.1),))
    found = examination._standing(at_it, 0.8, CASE)
    assert (found.standing, found.snapped) == (1, 0), "what ends at the share bears it"


def standing(drawn, seed=7):
    return StandingRecord(drawn, drawn, 0.9, 0.9, seed)


@pytest.mark.parametrize(
    ("before", "anew"),
    [
        (None, True),
        (standing(11), True),
        (standing(12), False),
        (standing(13), False),
        (standing(12, 6), True),
        (standing(20), False),
        (standing(20, 6), True),
    ],
)
def test_structures_are_drawn_where_fewer_were_before_or_under_another_seed(
    monkeypatch, tmp_path, before, anew
):
    asked, guided = [], []
    shape = BuiltShapeRecord(3, 0.05, 0.06, 0.01)

    def drawn(workspace, each, name, count, clock):
        asked.append((name, count))
        return None if name == "wind" else PATH

    def guide(each, largest, shares, seed):
        guided.append((largest, seed))
        return {"additional": 12.5}

    monkeypatch.setattr(examination, "_drawn", drawn)
    monkeypatch.setattr(examination, "_guided", guide)
    monkeypatch.setattr(examination, "built_shape", lambda path, each, seed: shape)
    given = told()
    rows = dict(given.designs["initial"].loads)
    rows["additional"] = replace(rows["additional"], stands=before, expected_stiffness=3.0)
    rows["design"] = replace(rows["design"], expected_stiffness=4.0)
    given = given.with_design("initial", replace(given.designs["initial"], loads=rows))
    found = examination._stand(Desk(tmp_path), examined(), 12, given, Clock(0)).designs["initial"].loads
    assert asked == ([("additional", 12)] if anew else []) + [("wind", 12)]
    assert found["wind"].stands is None, "which could not be drawn"
    if not anew:
        assert (found["additional"].stands, found["design"].stands) == (before, None)
        return
    assert (found["additional"].stands.standing, found["design"].stands.standing) == (1, 3)
    first = before is None
    assert guided == ([("additional", 7)] if first else [])
    assert (found["additional"].expected_stiffness, found["design"].expected_stiffness) == (
        (12.5, 4.0) if first else (3.0, 4.0)
    )
    few = first or before.drawn < 20
    assert found["design"].built_shape == (shape if few else None), (
        "the first twenty's, whatever is drawn later"
    )
    assert found["additional"].built_shape is None


def test_the_guide_is_told_of_loads_to_which_the_perfect_path_leads(monkeypatch):
    found = SimpleNamespace(factors=[0.0, 0.5, 0.9], least_to=lambda share: 100.0 * share)
    asked = []
    monkeypatch.setattr(
        examination, "perfect", lambda shell, own, force, **how: asked.append((force[0, 2], how))
    )
    monkeypatch.setattr(examination, "guide", lambda nominal, tolerances, *, seed: found)
    shares = {"additional": 1.0, "design": 0.8, "near": 0.9, "half": 0.5}
    assert examination._guided(examined(), "additional", shares, 7) == {
        "design": 80.0,
        "near": 90.0,
        "half": 50.0,
    }
    assert asked == [(-12.5, {"shapes": 0, "step": 0.25})]


def test_of_the_shapes_as_built_medians_and_the_worst_are_told(monkeypatch):
    monkeypatch.setattr(Examined, "nominal", lambda self, load: f"nominal under {load}")

    def moved(nominal, tolerances, *, seed):
        assert nominal == "nominal under design"
        return {"marks": 0.001 * seed}

    monkeypatch.setattr(shape_as_built, "moved_by_cause", moved)
    shapes = tuple(
        DrawnShape(number, most, mean)
        for number, most, mean in ((0, 0.05, 0.02), (1, 0.09, 0.01), (2, 0.04, 0.03), (4, 0.06, 0.015))
    )
    path = replace(PATH, shapes=shapes)
    assert shape_as_built.built_shape(path, examined(), 7) == BuiltShapeRecord(
        4, pytest.approx(0.055), 0.09, pytest.approx(0.0175), {"marks": 0.007}
    )
    assert shape_as_built.built_shape(PATH, examined(), 7) is None
    strained = tuple(
        replace(each, stress_utilisation_max=share, cable_force_max=50.0 * share)
        for each, share in zip(shapes, (1.1, 0.8, 1.6, 1.2), strict=True)
    )
    found = shape_as_built.built_shape(replace(path, shapes=strained), examined(), 7)
    assert (found.stress_utilisation_max, found.stress_utilisation_max_worst) == (pytest.approx(1.15), 1.6)
    assert (found.cable_force_max, found.cable_force_max_worst) == (pytest.approx(57.5), pytest.approx(80.0))
    mixed = shape_as_built.built_shape(replace(path, shapes=(shapes[0], *strained[1:])), examined(), 7)
    assert mixed.stress_utilisation_max is None, "some were looked at by a version that didn't tell it"


@pytest.mark.parametrize(
    ("design_stands", "further", "in_full"),
    [((4, 4), (4, 3), True), ((4, 2), (4, 4), False), ((4, 4), (4, 4), False), ((4, 4), None, False)],
)
def test_the_initial_design_is_drawn_in_full_where_it_falls_under_a_further_load(
    monkeypatch, tmp_path, design_stands, further, in_full
):
    def record(pair):
        return None if pair is None else StandingRecord(*pair, 0.5, 0.9, 7)

    asked = []
    monkeypatch.setattr(
        examination, "_stand", lambda desk, each, count, given, clock: asked.append(count) or "full"
    )
    given = told()
    rows = dict(given.designs["initial"].loads)
    rows["design"] = replace(rows["design"], stands=record(design_stands))
    rows["additional"] = replace(rows["additional"], stands=record(further))
    given = given.with_design("initial", replace(given.designs["initial"], loads=rows))
    clock = Clock(100)
    found = examination._bar(Desk(tmp_path), examined(), given, clock)
    assert asked == ([40] if in_full else [])
    assert found == ("full" if in_full else given)
    assert clock.planned == (100 + 2 * 36 if in_full else 100), "on two paths 36 more each"


def test_structures_that_can_not_be_drawn_are_told_and_others_with_the_time_that_is_left(
    monkeypatch, tmp_path
):
    desk, clock, initial = Desk(tmp_path), Clock(40), examined()
    clock.took(10, 100.0)

    def drawn(folder, each, load, *, count, seed, clock, tell):
        assert (each, load, count, seed) == (initial, "wind", 12, 7)
        tell(3)
        return PATH

    monkeypatch.setattr(examination, "drawn_of", drawn)
    assert examination._drawn(desk, initial, "wind", 12, clock) is PATH
    text, left = desk.said[-1]
    assert "structure 3 of 12 under the load “wind”, about 5 min left" in text
    assert left == pytest.approx(300.0)

    def lost(*_, **__):
        raise NotConverged("there is none")

    monkeypatch.setattr(examination, "drawn_of", lost)
    assert examination._drawn(desk, examined(), "wind", 12, clock) is None
    assert desk.said[-1] == ("the initial design was not drawn: there is none", Kind.NOTE)


@pytest.mark.parametrize(
    ("factors", "number", "factor", "name"),
    [
        ((1.0, 0.9, 0.85, 1.0, 0.88), 4, 0.88, "additional"),  # of three the middle one
        ((1.0, 0.6, 0.9, 0.4, 1.0), 1, 0.75, "design"),  # of 0.4 and 0.6 over 0.8
        ((0.0, 1.0, 1.0, 1.0, 1.0), None, None, None),  # which never stood
        ((1.0, 1.0, 1.0, 1.0, 1.0 - 1e-12), None, None, None),
    ],
)
def test_how_it_fails_is_explained_of_the_median_one_under_the_smallest_load_under_which_any_does(
    monkeypatch, tmp_path, factors, number, factor, name
):
    desk = Desk(tmp_path)
    (tmp_path / "states").mkdir()
    desk.path(examination.FAILURE).write_bytes(b"of a run before")
    loads = {each: LOADS[each] for each in ("none", "additional", "design")}
    monkeypatch.setattr(examination, "_drawn", lambda *_: DrawnPath(factors, (False,) * 5))
    monkeypatch.setattr(examination, "perfect", lambda shell, own, force: force[0, 2])
    monkeypatch.setattr(examination, "Workshop", lambda nominal: nominal)

    def explained(workshop, tolerances, *, seed, number):
        assert (workshop, tolerances, seed) == (-12.5, OFF, 7)
        state = SimpleNamespace(positions=np.zeros(3), quaternions=np.ones(4))
        return SimpleNamespace(
            state=state, mode=np.ones(2), factor=factors[number], kind="limit point", driver="marks",
            without={"marks": 1.0, "shape": 0.6}, cables=(3, 12),
        )  # fmt: skip

    monkeypatch.setattr(examination, "explained", explained)
    found = examination._failure(desk, examined(loads=loads), 12)
    if number is None:
        assert found is None
        assert not desk.path(examination.FAILURE).exists()
        return
    share = 0.8 if name == "design" else 1.0
    assert (found.design, found.load, found.number, found.kind) == ("initial", name, number, "limit point")
    assert found.factor == pytest.approx(factor)
    assert found.without == {"marks": pytest.approx(1.0 / share), "shape": pytest.approx(0.6 / share)}
    assert found.cables == ("C3", "C12")
    assert desk.path(examination.FAILURE).is_file()


def test_a_structure_without_errors_falls_for_no_cause(monkeypatch, tmp_path):
    monkeypatch.setattr(examination, "_drawn", lambda *_: DrawnPath((0.5,), (False,)))
    perfect = replace(examined(), tolerances=Tolerances())
    assert examination._failure(Desk(tmp_path), perfect, 12) is None


def test_of_a_design_that_was_not_drawn_no_failure_is_explained(monkeypatch, tmp_path):
    monkeypatch.setattr(examination, "_drawn", lambda *_: None)
    assert examination._failure(Desk(tmp_path), examined(), 12) is None


def test_how_rarely_it_falls_is_told_of_every_load_that_weighs(monkeypatch, tmp_path):
    desk = Desk(tmp_path, rare=20)

    def rare(folder, each, load, *, count, seed, tell):
        tell(30)
        return (each.name, load, count, seed)

    monkeypatch.setattr(examination, "rare_of", rare)
    assert examination._rare(desk, examined()) == tuple(
        ("initial", name, 20, 7) for name in ("design", "additional", "wind")
    )
    assert desk.said[0][0] == "how rarely the initial design falls under the load “design”: structure 30"

    def lost(*_, **__):
        raise NotConverged("there is none")

    monkeypatch.setattr(examination, "rare_of", lost)
    assert examination._rare(desk, examined()) is None
    assert desk.said[-1][1] is Kind.NOTE


@pytest.mark.parametrize(
    ("names", "failing", "open_ones", "further", "drawn", "best"),
    [
        # the last that holds is drawn in full, and none before it
        (("unbraced", "initial", "optimised", "polished"), (), (), 0.95, ["polished"], "polished"),
        # one that fails isn't drawn, one that stays open leaves another to try
        (("unbraced", "initial", "optimised", "polished"), ("polished",), (), 0.95, ["optimised"], "optimised"),
        (
            ("unbraced", "initial", "optimised", "polished"), (), ("polished",), 0.95,
            ["polished", "optimised", "polished"], "polished",
        ),
        # one that is seen to fail once it is drawn doesn't end it either
        (("initial", "optimised", "polished"), ("polished!",), (), 0.95, ["polished", "optimised", "polished"], "polished"),
        # no fewer are to stand than of the initial design, which then is drawn too
        (("initial", "optimised"), (), (), None, ["bar", "optimised"], "optimised"),
        (("unbraced", "initial"), (), (), 0.95, ["initial"], "initial"),
    ],
)  # fmt: skip
def test_designs_are_drawn_in_full_from_the_last_on_until_one_holds(
    monkeypatch, tmp_path, names, failing, open_ones, further, drawn, best
):
    asked, clocks, compared, raised = [], [], [], []

    given = told(names)
    run = examination.Run(tmp_path, CASE, None, None, LOADS, dict.fromkeys(names), {}, given)

    def stand(desk, each, count, so_far, clock):
        clocks.append(clock.planned)
        if count == 40 and (not asked or asked[-1] != each.name):
            asked.append(each.name)
        if count == 4:
            compared.append(each.name)
        return so_far

    def fails(found, name):
        return name in failing or (f"{name}!" in failing and name in asked)

    monkeypatch.setattr(examination, "read_run", lambda folder: run)
    monkeypatch.setattr(examination, "_of_run", lambda run, name: examined(name))
    monkeypatch.setattr(Examined, "key", lambda self, seed: self.name)
    monkeypatch.setattr(examination, "side_by_side", lambda call, every: [call(each) for each in every])
    monkeypatch.setattr(
        examination, "_critical", lambda case, each, record: replace(record, critical_factor_kept=True)
    )
    monkeypatch.setattr(examination, "_stand", stand)
    monkeypatch.setattr(
        examination, "_bar", lambda desk, initial, so_far, clock: asked.append("bar") or so_far
    )
    monkeypatch.setattr(examination, "run_checks", lambda run: "checks")
    monkeypatch.setattr(examination, "failed", fails)
    monkeypatch.setattr(examination, "open_checks", lambda found, name: name in open_ones)
    monkeypatch.setattr(examination, "to_build", lambda found, every: best)
    monkeypatch.setattr(examination, "_failure", lambda desk, each, count: (each.name, count))
    monkeypatch.setattr(
        examination, "_raised", lambda desk, each, so_far, clock: raised.append(each.name) or so_far
    )
    monkeypatch.setattr(examination, "falls", lambda designs, name, safety: name == "optimised")
    monkeypatch.setattr(examination, "asked_as_built", lambda case: "asked")
    monkeypatch.setattr(examination, "_thicker", lambda desk, run: "thicker")
    monkeypatch.setattr(examination, "_rare", lambda desk, each: ("rare", each.name))
    monkeypatch.setattr(examination, "judged", lambda run: "verdict")
    desk = Desk(tmp_path, probability_additional=further)
    found = examination.examine(desk)
    assert asked == drawn
    assert compared == [name for name in names if name != "unbraced"]
    assert clocks[0] == 2 * (4 * len(compared) + 36), "of each design four on two paths, and 36 more of one"
    assert found.failure == (best, 40)
    assert raised == [best]
    assert found.rare is None
    assert found.thicker == ("thicker" if best == "optimised" else None)
    assert found.verdict == "verdict"
    assert all(each.critical_factor_kept for each in found.designs.values())
    desk = Desk(tmp_path, probability_additional=further, rare=20)
    assert examination.examine(desk).rare == ("rare", best)
    monkeypatch.setattr(examination, "to_build", lambda found, every: "unbraced")
    unbraced = examination.examine(desk)
    assert (unbraced.failure, unbraced.rare, unbraced.thicker) == (None, None, None)


def test_the_time_that_is_left_counts_how_the_design_is_raised_until_it_is(monkeypatch, tmp_path):
    monkeypatch.setattr(examination, "raised", lambda shell, design: ("by",))
    clock, desk = Clock(10, afterwards=5), Desk(tmp_path)
    clock.took(10, 20.0)
    given = examination._raised(desk, examined(), told(), clock)
    assert given.designs["initial"].ways_up == ("by",)
    assert desk.said == [("how the initial design is raised", 10.0)]
    assert clock.left() == 0.0
    assert examination._raised(desk, examined(), given, clock) is given, "once"


def test_of_a_design_that_falls_behind_once_it_is_drawn_in_full_neither_verdict_nor_failure_is_told(
    monkeypatch, tmp_path
):
    """Another one then is the one to build, and is drawn in full, too."""
    asked = []
    run = examination.Run(
        tmp_path, CASE, None, None, LOADS, dict.fromkeys(("initial", "optimised", "polished")), {}, told()
    )

    def stand(desk, each, count, so_far, clock):
        if count == 40:
            asked.append(each.name)
        return so_far

    monkeypatch.setattr(examination, "read_run", lambda folder: run)
    monkeypatch.setattr(examination, "_of_run", lambda run, name: examined(name))
    monkeypatch.setattr(Examined, "key", lambda self, seed: self.name)
    monkeypatch.setattr(examination, "side_by_side", lambda call, every: [call(each) for each in every])
    monkeypatch.setattr(examination, "_critical", lambda case, each, record: record)
    monkeypatch.setattr(examination, "_stand", stand)
    monkeypatch.setattr(examination, "run_checks", lambda run: "checks")
    monkeypatch.setattr(examination, "failed", lambda found, name: True)
    monkeypatch.setattr(
        examination, "to_build", lambda found, every: "optimised" if "polished" in asked else "polished"
    )
    monkeypatch.setattr(examination, "_failure", lambda desk, each, count: (each.name, count))
    monkeypatch.setattr(examination, "raised", lambda shell, design: ("by",))
    monkeypatch.setattr(examination, "falls", lambda designs, name, safety: False)
    monkeypatch.setattr(examination, "asked_as_built", lambda case: "asked")
    monkeypatch.setattr(examination, "judged", lambda run: "verdict")
    given = run.summary
    for name in ("polished",):
        given = given.with_design(name, given.designs["initial"])
    run = replace(run, summary=given)
    found = examination.examine(Desk(tmp_path, probability_additional=0.95))
    assert asked == ["polished", "optimised"]
    assert found.failure == ("optimised", 40)
    assert {name: each.ways_up for name, each in found.designs.items()} == {
        "initial": None, "optimised": ("by",), "polished": ("by",)
    }, "the one that seemed to be the one to build, too"  # fmt: skip
