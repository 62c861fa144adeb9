"""A run that ends early has a page that tells the cause first; where it has designs, they are shown and
judged."""

import re
from pathlib import Path

import pytest

from shellform.errors import InputError, NotConverged
from shellform.output.page.ended import facts
from shellform.records.summary import Summary, read_summary
from shellform.run import broken_off
from shellform.run.run import run_case
from tests.records import made
from tests.run.small_run import begin, finish, small_case

ROOT = Path(__file__).parent.parent.parent


def text_of(folder):
    return (folder / "report.html").read_text(encoding="utf-8")


def test_a_run_without_a_design_tells_cause_remedy_and_what_was_found(tmp_path, monkeypatch):
    from shellform.run import run

    monkeypatch.setattr(run, "with_way_out", lambda error, *_: error)  # which takes its time
    case = small_case(ROOT, "rod.radius=0.004", "title=<b>thick")
    with pytest.raises(InputError, match="they break") as refused:
        run_case(case, tmp_path / "run")
    page = text_of(tmp_path / "run")
    first = page.index("The run ended in the stage “initial”")
    cause = page.index("the net bends rods to")
    assert first < cause < page.index("Choose a thinner rod") < page.index("How far it came")
    assert "mm from the axis" in page
    assert "&lt;b&gt;thick" in page
    assert "14 rods" in page
    assert "default-src 'none'" in page
    for address in re.findall('<a href="([^"#]*)"', page):
        assert (tmp_path / "run" / address).is_file()
    assert read_summary(tmp_path / "run").failed == {"initial": str(refused.value)}
    run_case(small_case(ROOT), tmp_path / "run", until="initial")
    assert not read_summary(tmp_path / "run").failed, "and it goes on once the cause is gone"
    assert not (tmp_path / "run/report.html").exists(), "without the page that tells of it"


def test_the_page_of_an_early_end_goes_though_nothing_else_could_be_written_of_it(tmp_path):
    """As on a full disk: the summary that says what failed is not there."""
    run_case(small_case(ROOT), tmp_path / "run", until="surface")
    (tmp_path / "run/report.html").write_text("ended early", encoding="utf-8")
    run_case(small_case(ROOT), tmp_path / "run", until="net")
    assert not (tmp_path / "run/report.html").exists()


def test_a_finished_run_whose_changed_case_falls_shows_nothing_of_the_design_before(tmp_path):
    """It named the design before as one whose stage hadn't finished, and asked for a run without --until."""
    place = tmp_path / "run"
    finish(begin(ROOT, place))
    with pytest.raises(NotConverged, match="deforms excessively"):
        run_case(small_case(ROOT, "rod.radius=0.0003", "load.force=20.0"), place)
    page = text_of(place)
    assert "The initial design does not hold" in page
    assert not list(place.glob("designs/optimised*"))
    for stale in ("has not finished", "before the last change", "--until", "“optimised”"):
        assert stale not in page


def test_a_run_with_a_design_that_deforms_too_much_shows_it_and_says_so_first(tmp_path):
    case = small_case(ROOT, "rod.radius=0.0003", "load.force=20.0")
    with pytest.raises(NotConverged, match=r"deforms excessively.*thicker rods \(rod\.radius\)"):
        run_case(case, tmp_path / "run")
    page = text_of(tmp_path / "run")
    assert "The initial design does not hold" in page
    verdict = page.index("ended without a result: The initial design deforms excessively")
    assert verdict < page.index("How far off is the shell?")


def test_thicker_rods_of_a_catalogue_are_advised_by_the_entry_that_such_a_case_has(tmp_path):
    case = small_case(ROOT, 'rod={catalogue = "gfrp_rods", section = "1.5 mm"}', "load.force=200.0")
    with pytest.raises(NotConverged, match=r"deforms excessively.*thicker rods \(rod\.section\)"):
        run_case(case, tmp_path / "run", until="initial")


def test_cables_that_pull_the_grid_out_of_shape_without_any_load_are_advised_to_be_longer(tmp_path):
    case = small_case(ROOT, "cable.rest_ratio=0.2", "cable.stiffness=1000.0")
    with pytest.raises(NotConverged, match=r"deforms excessively.*cable\.rest_ratio nearer to 1 than 0\.2"):
        run_case(case, tmp_path / "run", until="initial")


def test_what_was_found_before_the_end_is_told_in_millimetres_and_degrees():
    design = made.design("additional", stable=False)
    told = dict(facts(Summary(surface=made.SURFACE, net=made.NET, designs={"initial": design})))
    assert told["surface"] == "vault.py, 900 × 550 × 210 mm, 0.56 m²"
    assert told["net from the surface"] == "0.1 mm at most"
    assert told["smallest angle between rods"] == "68.8°"
    assert told["largest curvature"] == "4.5 1/m, a radius of 222 mm"
    assert told["thickest round rod that bears it"] == "⌀ 2.86 mm"
    assert told["initial design, load design"] == "4 mm off at most, stands"
    assert told["initial design, load additional"] == "8 mm off at most, snapped through or unstable"


def test_a_page_that_can_not_be_written_is_told_with_the_cause(tmp_path, monkeypatch):
    from shellform.run import run

    def refused(*_):
        raise OSError("the disc is full")

    monkeypatch.setattr(run, "with_way_out", lambda error, *_: error)
    monkeypatch.setattr(broken_off, "ended_page", refused)
    with pytest.raises(InputError, match="they break") as found:
        run_case(small_case(ROOT, "rod.radius=0.004"), tmp_path / "run")
    assert found.value.__notes__ == ["Nor could its page be written: the disc is full"]
