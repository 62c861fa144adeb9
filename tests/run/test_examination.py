"""Designs examined as built: on a small dome, a few structures each."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shellform.case.build_safety import case_safety, case_tolerances, critical_factors_asked
from shellform.case.case import load_case
from shellform.errors import InputError, NotConverged
from shellform.gridshell.tolerances import SOURCES, default_tolerances
from shellform.records.drawn import DrawnPath, DrawnSnap, read_drawn, write_drawn
from shellform.records.progress import Kind
from shellform.records.summary import read_summary, write_summary
from shellform.reliability.adjusting import adjusted
from shellform.reliability.drawing import draw_errors
from shellform.reliability.perfect import perfect
from shellform.reliability.probability import counted
from shellform.reliability.safety import paths
from shellform.reliability.standing import Workshop, sample
from shellform.run import examination, optimising, sampling
from shellform.run.examination import _standing
from shellform.run.folder import read_run
from shellform.run.judged import run_checks
from shellform.run.run import run_case
from shellform.run.sampling import Examined
from shellform.run.shape_as_built import adjusted_shape
from tests.stubs import CASE

FEW = ["safety.drawn=12", "safety.compared=4", "safety.probability_design=0.9", "optimise.unloaded=false"]


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    place = tmp_path_factory.mktemp("examined") / "dome.toml"
    place.write_text(CASE, encoding="utf-8")
    return place


@pytest.fixture(scope="module")
def found(file, tmp_path_factory):
    """A run up to its optimised design, and what it said."""
    folder, told = tmp_path_factory.mktemp("found"), []
    with pytest.MonkeyPatch.context() as every:
        every.setattr(optimising, "_QUIET", 0.0)
        run_case(load_case(file, FEW), folder, until="optimise", report=lambda event: told.append(event.text))
    return folder, told


@pytest.fixture
def copy(found, tmp_path):
    return Path(shutil.copytree(found[0], tmp_path / "copy"))


@pytest.fixture(scope="module")
def whole(file, found, tmp_path_factory):
    """The same run up to the structures as built, and the events since then."""
    folder, events = Path(shutil.copytree(found[0], tmp_path_factory.mktemp("whole") / "run")), []
    run_case(load_case(file, FEW), folder, until="safety", report=events.append)
    return folder, events


def test_every_design_tells_its_critical_factor_on_both_meshes_and_how_many_structures_stand(whole):
    summary = read_summary(whole[0])
    assert set(summary.designs) == {"unbraced", "initial", "optimised"}
    for name, design in summary.designs.items():
        assert design.loads["none"].stands is None
        for load in ("design", "additional"):
            row = design.loads[load]
            assert 0.0 < row.critical_factor <= row.critical_sought
            assert row.critical_kind in ("limit point", "bifurcation", "none")
            error = 4.0 / 3.0 * (row.critical_factor - row.critical_factor_halved)
            assert row.critical_factor_error == pytest.approx(error)
            assert row.slack is not None
            if name != "unbraced":
                assert row.stands.drawn == (12 if name == summary.verdict.design else 4)
                assert row.stands.standing <= row.stands.drawn
                assert row.expected_stiffness > 0.0
                assert (row.stands.confidence, row.stands.seed) == (0.95, 0)
        main, more = design.loads["design"], design.loads["additional"]
        for each in (
            "factor",
            "factor_halved",
            "factor_error",
            "sought",
        ):  # one path, by the load that it counts
            found = [getattr(row, f"critical_{each}") * row.factor for row in (main, more)]
            assert found[1] == pytest.approx(found[0], rel=1e-9)
        ratio = design.loads["design"].critical_factor / design.loads["additional"].critical_factor
        assert ratio == pytest.approx(1.2)


def test_a_critical_factor_is_kept_where_every_load_s_is_at_least_what_is_asked(file, whole):
    asked = critical_factors_asked(load_case(file, FEW))
    assert asked
    kept = {}
    for name, design in read_summary(whole[0]).designs.items():
        kept[name] = all(
            min(row.critical_factor, row.critical_factor_halved) >= least * (1.0 - 1e-3)
            for row, least in ((design.loads[load], least) for load, least in asked.items())
        )
        assert design.critical_factor_kept is kept[name]
    assert set(kept.values()) == {True, False}, "else the test says nothing"


def test_what_is_told_is_what_a_sample_of_the_same_seed_finds(whole):
    run = read_run(whole[0])
    shell, design = run.shell_of("optimised"), run.designs["optimised"]
    tolerances = case_tolerances(run.case, shell)
    (largest,) = paths(run.loads)
    found = sample(shell, design, run.loads[largest], tolerances, count=12, seed=0).standing
    told = run.summary.designs["optimised"].loads[largest].stands
    assert (told.drawn, told.standing, told.at_least) == (found.drawn, found.standing, found.at_least)


def test_under_a_share_of_a_load_those_stand_that_bear_it_and_the_lowest_factor_is_of_that_share(file):
    case = load_case(file, ["safety.confidence=0.9", "safety.seed=5"])
    # of the last two, which bear the whole load, one ends far from where the perfect structure does
    path = DrawnPath((0.4, 0.5, 0.8, 0.9, 1.0, 1.0), (False, False, False, False, False, True))
    share, whole = (_standing(path, each, case) for each in (0.8, 1.0))
    assert (share.standing, share.drawn, share.lowest) == (4, 6, pytest.approx(0.5))
    assert (whole.standing, whole.lowest) == (1, 0.4)
    for told in (share, whole):
        assert told.at_least == counted(6, told.standing, seed=5, confidence=0.9).at_least
        assert (told.confidence, told.seed) == (0.9, 5)
    assert _standing(DrawnPath((1.0,), (True,)), 0.8, case).lowest == 1.0


def test_of_the_shape_as_built_the_median_the_worst_and_what_drives_it_are_told(whole):
    run = read_run(whole[0])
    for name, design in run.summary.designs.items():
        told = design.loads["design"].built_shape
        assert design.loads["additional"].built_shape is None, "concrete hardens under the design load"
        if name == "unbraced":
            assert told is None
            continue
        shell, tolerances = run.shell_of(name), case_tolerances(run.case, run.shell_of(name))
        count = design.loads["design"].stands.drawn if name == run.summary.verdict.design else 4
        (largest,) = paths(run.loads)
        share = paths(run.loads)[largest]["design"]
        workshop = Workshop(perfect(shell, run.designs[name], run.loads[largest]))
        made = workshop.load_numbers(tolerances, seed=0, numbers=range(4), resting=share)
        places = np.array([each.resting.positions for each in made])
        far = np.linalg.norm(places - shell.target.positions, axis=2)
        drawn = read_drawn(
            whole[0], name, Examined(name, shell, run.designs[name], run.loads, tolerances).key(0)
        )
        shapes = drawn.paths[largest].shapes
        assert [each.deviation_max for each in shapes[:4]] == pytest.approx(far.max(axis=1), abs=1e-8)
        assert [each.deviation_mean for each in shapes[:4]] == pytest.approx(far.mean(axis=1), abs=1e-8)
        assert len(shapes) == count
        assert told.structures == count, "of up to twenty structures all that were drawn"
        largest_of = [each.deviation_max for each in shapes]
        assert told.deviation_max == pytest.approx(np.median(largest_of), abs=1e-8)
        assert told.deviation_max_worst == pytest.approx(max(largest_of), abs=1e-8)
        assert told.deviation_mean == pytest.approx(
            np.median([each.deviation_mean for each in shapes]), abs=1e-8
        )
        assert told.deviation_max > design.loads["design"].deviation_max
        assert set(told.causes) == set(tolerances.causes)


def test_of_the_design_to_build_the_same_structures_are_told_adjusted_on_site(whole, monkeypatch, tmp_path):
    run = read_run(whole[0])
    best = run.summary.verdict.design
    for name, design in run.summary.designs.items():
        assert (design.loads["design"].adjusted_shape is None) == (name != best)
    shell, tolerances = run.shell_of(best), case_tolerances(run.case, run.shell_of(best))
    each = Examined(best, shell, run.designs[best], run.loads, tolerances)
    ((largest, own),) = paths(run.loads).items()
    workshop = Workshop(each.nominal(largest))
    far = []
    for number in range(12):
        errors = adjusted(workshop, draw_errors(workshop.nominal.members, tolerances, 0, number))
        rest = workshop.load(errors, number=number, resting=own["design"]).resting
        far.append(np.linalg.norm(rest.positions - shell.target.positions, axis=1).max())
    told = run.summary.designs[best].loads["design"].adjusted_shape
    assert told.structures == 12, "as many as were drawn"
    assert told.deviation_max_worst == pytest.approx(max(far), abs=1e-8)
    assert told.deviation_max == pytest.approx(np.median(far), abs=1e-8)
    assert told.causes == {}, "what drives it is told of those that weren't"
    shutil.copytree(whole[0] / "designs", tmp_path / "designs")
    kept = read_drawn(whole[0], best, each.key(0))
    write_drawn(tmp_path, best, replace(kept, adjusted=sampling._first(kept.adjusted, 10)))
    assert adjusted_shape(tmp_path, each, 12, 0) == told, "broken off after ten it goes on"
    monkeypatch.setattr(sampling, "Workshop", None)
    assert adjusted_shape(tmp_path, each, 12, 0) == told, "kept"


def test_a_limit_on_the_shape_as_built_is_judged_by_the_worst_structure(file, whole):
    run = read_run(whole[0])
    worst = run.summary.designs["optimised"].loads["design"].built_shape.deviation_max_worst
    for limit, holds in [(1.01 * worst, True), (0.99 * worst, False)]:
        asked = replace(run, case=load_case(file, [*FEW, f"limits.built_deviation={limit}"]))
        found = {check.name: check for check in run_checks(asked)}
        cell = found["Largest deviation as built under the design load"].cells["optimised"]
        assert cell.holds is holds


def test_of_those_that_stand_it_is_counted_which_have_snapped_below_the_load_and_how_far(file):
    case = load_case(file)
    snaps = (
        DrawnSnap(0, 0.3, 0.04),
        DrawnSnap(1, 0.7, 0.02),
        DrawnSnap(1, 0.9, 0.03),
        DrawnSnap(3, 0.95, 0.01),
    )
    path = DrawnPath((0.4, 1.0, 1.0, 1.0), (False, True, True, True), snaps)
    share, whole = (_standing(path, each, case) for each in (0.8, 1.0))
    assert (whole.standing, whole.snapped, whole.snap) == (3, 2, 0.03), "the one that fell counts as fallen"
    assert (share.standing, share.snapped) == (3, 1)


def test_sampling_tells_how_far_it_is_and_how_long_it_takes_at_most(whole):
    told = [each for each in whole[1] if each.stage == "safety" and each.kind is Kind.PROGRESS]
    parts = [each for each in told if each.fraction is not None]
    assert parts
    assert all(0.0 < each.fraction <= 1.0 and each.seconds_left >= 0.0 for each in parts)
    (raising,) = [each for each in whole[1] if each.text.endswith("design is raised")]
    assert raising.seconds_left == pytest.approx(parts[-1].seconds_left), "nothing else is left"
    assert raising.seconds_left > 0.0


def test_the_judgement_of_a_design_in_a_search_tells_how_far_it_is(found):
    told = [text for text in found[1] if text.startswith("a design as it would be built")]
    assert told
    assert all("structures loaded" in text for text in told)


def test_killed_inside_sampling_it_goes_on_and_ends_with_the_same_bytes(file, whole, copy):
    def stop(event):
        if event.stage == "safety" and "structure 4 of 4" in event.text:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_case(load_case(file, FEW), copy, until="safety", report=stop)
    assert json.loads((copy / "stages.json").read_text()).keys() >= {"optimise"}
    lines = []
    run_case(load_case(file, FEW), copy, until="safety", report=lambda event: lines.append(event.text))
    assert not [line for line in lines if "initial design as built" in line], "kept from before"
    one, other = (read_summary(each) for each in (copy, whole[0]))
    assert replace(one, seconds={}) == replace(other, seconds={})
    for name in ("initial", "optimised"):
        assert (copy / f"designs/{name}-drawn.json").read_bytes() == (
            whole[0] / f"designs/{name}-drawn.json"
        ).read_bytes()


def test_of_designs_that_are_the_same_one_is_examined(file, copy, whole, monkeypatch):
    """Where polishing found nothing better it took minutes more of a dome of 10,000 crossings."""
    for each in [*copy.glob("designs/optimised.*"), *copy.glob("states/optimised*")]:
        shutil.copy(each, each.with_name(each.name.replace("optimised", "polished")))
    summary = read_summary(copy)
    write_summary(copy, summary.with_design("polished", summary.designs["optimised"]))
    followed, drawn, on_site = [], [], []
    critical, load = examination._critical, Workshop.load_numbers

    def follow(case, each, record):
        followed.append(each.name)
        return critical(case, each, record)

    def count(self, *asked, numbers, **given):
        (on_site if given.get("adjust") else drawn).extend(numbers)
        return load(self, *asked, numbers=numbers, **given)

    monkeypatch.setattr(examination, "_critical", follow)
    monkeypatch.setattr(Workshop, "load_numbers", count)
    run_case(load_case(file, FEW), copy, until="safety")
    assert sorted(followed) == ["initial", "optimised", "unbraced"]
    assert drawn == [*range(4), *range(4), *range(4, 12)], "the first four of it are those of the other"
    assert on_site == [*range(12)], "of the one to build"
    assert read_summary(copy).designs["polished"].loads == read_summary(whole[0]).designs["optimised"].loads


def test_how_rarely_it_falls_is_told_where_asked_for_and_goes_on_where_it_was_broken_off(
    file, whole, tmp_path
):
    asked = [
        *FEW,
        "safety.rare=20",
        "tolerances.load_each=0.3",
        "tolerances.load_uneven=0.2",
        "safety.required=false",
    ]
    seen = []

    def stop(event):
        seen.append(event.text)
        if "how rarely" in event.text and "structure 20" in event.text:
            raise KeyboardInterrupt

    run_case(load_case(file, asked), tmp_path / "stopped", until="optimise")
    shutil.copytree(tmp_path / "stopped", tmp_path / "other")
    with pytest.raises(KeyboardInterrupt):
        run_case(load_case(file, asked), tmp_path / "stopped", until="safety", report=stop)
    resumed, undisturbed = (
        run_case(load_case(file, asked), tmp_path / name, until="safety") for name in ("stopped", "other")
    )
    assert read_summary(whole[0]).rare is None, "not asked for"
    assert resumed.rare == undisturbed.rare
    assert [each.load for each in resumed.rare] == ["design", "additional"]
    design, additional = resumed.rare
    assert 0.0 < design.probability <= additional.probability <= 1.0
    for each in resumed.rare:
        assert each.design == resumed.verdict.design
        assert each.structures >= 20
        assert (each.variation is None) == (each.shares == {})


def test_a_number_of_structures_that_subset_simulation_cannot_share_out_is_refused(file):
    for count in (10, 25):
        with pytest.raises(InputError, match="rare"):
            load_case(file, [f"safety.rare={count}"])


def test_other_tolerances_draw_other_structures_and_a_fallen_one_is_explained(file, whole, tmp_path):
    loose = [*FEW, "tolerances.load_each=0.4", "tolerances.load_uneven=0.3", "tolerances.load_all=0.3"]
    summary = run_case(load_case(file, [*loose, "safety.required=false"]), tmp_path, until="safety")
    assert summary.verdict.holds, "only told"
    found = summary.failure
    assert found.design == summary.verdict.design
    assert 0.0 < found.factor < 1.0
    assert found.driver == next(iter(found.without))
    assert found.without[found.driver] >= found.factor
    assert (tmp_path / "states/failure.npz").is_file()


def test_the_written_case_says_each_default_tolerance_with_its_source(whole):
    text = (whole[0] / "case.toml").read_text(encoding="utf-8")
    run = read_run(whole[0])
    own = default_tolerances(run.shell)
    for name, source in SOURCES.items():
        assert f"# {name} = {getattr(own, name):.6g}  # {source}" in text


def test_tolerances_of_the_case_take_the_place_of_the_defaults(file, whole):
    shell = read_run(whole[0]).shell
    found = case_tolerances(load_case(file, ["tolerances.marks=0.001", "tolerances.shape=0"]), shell)
    assert found == replace(default_tolerances(shell), marks=0.001, shape=0.0)
    safety = case_safety(load_case(file, ["safety.drawn=500", "safety.seed=7"]), shell)
    assert (safety.drawn, safety.seed) == (200, 7)
    assert case_safety(load_case(file, ["safety.required=false"]), shell) is None


@pytest.mark.parametrize(
    ("settings", "asked"),
    [
        ([], {"design": 1.25}),
        (["safety.critical_factor=1.5"], {"design": 1.5}),
        (["safety.critical_further={ additional = 1.1 }"], {"design": 1.25, "additional": 1.1}),
        (["safety.required=false", "safety.critical_further={ additional = 1.1 }"], {}),
        (["optimise.method=paper"], {}),
    ],
)
def test_critical_factors_are_asked_for_by_load_case(file, settings, asked):
    assert critical_factors_asked(load_case(file, settings)) == asked


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("tolerances.marks=-1", "tolerances.marks.*greater than or equal to 0"),
        ("tolerances.cable=1", "no known entry.*Did you mean"),
        ("safety.probability_design=1.0", "less than 1"),
        ("safety.drawn=1", "compared must not exceed drawn"),
    ],
)
def test_bad_entries_are_refused(file, setting, words):
    with pytest.raises(InputError, match=words):
        load_case(file, [setting])


def test_a_run_that_ends_before_optimising_is_judged_and_has_its_page(file, tmp_path):
    with pytest.raises(NotConverged):
        run_case(load_case(file, ["load.force=1e3"]), tmp_path)
    summary = read_summary(tmp_path)
    assert not summary.verdict.holds
    assert "ended without a result" in summary.verdict.failed[0]
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "does not hold" in page
    assert "deforms excessively" in page


def test_until_optimise_nothing_is_claimed_of_the_structure_as_built(found):
    summary = read_summary(found[0])
    assert not summary.verdict.holds
    assert "As built under the design load" in summary.verdict.not_examined
    assert summary.designs["optimised"].loads["design"].stands is None


def test_a_design_without_unloaded_equilibrium_is_told_as_not_found(file, copy, monkeypatch):
    def lost(*arguments, **settings):
        raise NotConverged("there is none")

    monkeypatch.setattr(examination, "mesh_error", lost)
    monkeypatch.setattr(examination, "drawn_of", lost)
    summary = run_case(load_case(file, FEW), copy, until="safety")
    row = summary.designs["optimised"].loads["design"]
    assert row.critical_kind == "not found: there is none"
    assert row.critical_factor is None
    assert "Critical factor of the design load" in summary.verdict.not_examined


def test_the_initial_design_is_drawn_in_full_where_no_fewer_are_to_stand_than_of_it(file, copy, monkeypatch):
    def drawn_of(folder, examined, load, *, count, **_):
        stand = tuple(not (load == "additional" and number in (2, 7)) for number in range(count))
        return DrawnPath(tuple(1.0 if each else 0.9 for each in stand), stand)

    monkeypatch.setattr(examination, "drawn_of", drawn_of)
    monkeypatch.setattr(examination, "_failure", lambda *_: None)
    run_case(load_case(file, FEW), copy, until="safety")
    told = read_summary(copy).designs
    row = told["initial"].loads["additional"].stands
    assert (row.standing, row.drawn) == (10, 12)
    assert told["optimised"].loads["additional"].stands.standing == 10
    checks = {each.name: each for each in run_checks(read_run(copy))}
    (asked,) = [each for name, each in checks.items() if name.startswith("As built under 1.2")]
    assert asked.limit == "at least 10 of 12", "and not 9, as three of the first four say"
