"""The page of runs: what it says of whole, unfinished and damaged runs, and what is refused."""

import json
import os
import re
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from shellform.errors import InputError
from shellform.records.summary import read_summary, write_summary
from shellform.run.folder import read_run
from shellform.run.pages import shown_run, write_report
from tests.run.small_run import finish


@pytest.fixture(scope="module")
def finished(begun, tmp_path_factory):
    return finish(Path(shutil.copytree(begun, tmp_path_factory.mktemp("finished") / "run")))


@pytest.fixture
def copy(finished, tmp_path):
    return Path(shutil.copytree(finished, tmp_path / "run"))


def text_of(file):
    return file.read_text(encoding="utf-8")


def test_the_page_stands_in_the_run_folder_and_answers_a_designer_s_questions(copy):
    file = write_report([copy])
    assert file == copy / "report.html"
    page = text_of(file)
    for words in (
        "How far off is the shell?",
        "How many cables?",
        "Which rods?",
        "Is it safe at 1.2 × the load?",
        "What to buy?",
    ):
        assert words in page
    summary = json.loads(text_of(copy / "summary.json"))
    row = summary["designs"]["optimised"]
    assert f"{row['cables']} of {summary['model']['cables']}" in page
    assert f"{1e3 * row['loads']['design']['deviation_max']:.2g} mm at most" in page
    assert "data:image/webp;base64," in page
    assert not re.search(r"src=\"(?!data:)", page), "everything is inside the page"
    assert not re.search(r"href=\"[a-z]+:(?<!data:)", page), "and links lead to the run's own files"


def test_a_run_that_is_not_optimised_says_so_and_has_no_histories(begun, tmp_path):
    page = text_of(write_report([begun], tmp_path / "page.html"))
    assert "is not optimised (yet)" in page
    assert "There are no pictures" in page
    assert "<h2>Histories</h2>" not in page
    assert re.search("initial design (is not examined|does not hold)", page)


def test_a_run_whose_search_failed_is_not_told_to_leave_until_out(begun, tmp_path):
    run = Path(shutil.copytree(begun, tmp_path / "run"))
    write_summary(run, replace(read_summary(run), failed={"optimise": "no window left"}))
    page = text_of(write_report([run]))
    assert "no window left" in page
    assert "--until" not in page
    assert "There are no pictures" not in page


def test_a_design_whose_stage_was_broken_off_is_named_and_left_out(copy):
    summary = json.loads(text_of(copy / "summary.json"))
    del summary["designs"]["optimised"], summary["optimisation"]
    (copy / "summary.json").write_text(json.dumps(summary), encoding="utf-8")
    shown = shown_run(read_run(copy))
    assert shown.best == "initial"
    assert "optimised" not in shown.designs
    assert any("“optimised” is not shown" in note for note in shown.notes)


def test_a_case_changed_after_its_designs_is_told(copy):
    assert not any("before the last change" in note for note in shown_run(read_run(copy)).notes)
    settings = text_of(copy / "case.toml")
    assert "polish = 80" in settings
    (copy / "case.toml").write_text(settings.replace("polish = 80", "polish = 5"), encoding="utf-8")
    assert any(
        "optimised designs were computed before the last change" in note
        for note in shown_run(read_run(copy)).notes
    )
    (copy / "case.toml").write_text(settings.replace("radius = 0.001", "radius = 0.0011"), encoding="utf-8")
    assert any(
        "shown was computed before the last change" in note for note in shown_run(read_run(copy)).notes
    )
    (copy / "case.toml").write_text(settings.replace("vault.py", "moved.py"), encoding="utf-8")
    assert not any("before the last change" in note for note in shown_run(read_run(copy)).notes), (
        "it can't be told without the surface"
    )


def test_a_damaged_picture_and_one_too_many_are_named_and_the_rest_is_shown(copy):
    (copy / "figures/net-skew.png").write_bytes(b"no picture")
    shown = shown_run(read_run(copy))
    assert [picture.name for picture in shown.pictures] == ["deviations", "optimised-design"]
    assert any("net-skew.png can't be read" in note for note in shown.notes)
    assert any("deviations.png is left out" in note for note in shown_run(read_run(copy), budget=10).notes)


def test_a_film_is_shown_once(copy):
    for ending in ("gif", "mp4"):
        (copy / f"figures/pour-optimised-design.{ending}").write_bytes(b"film")
    films = [picture for picture in shown_run(read_run(copy)).pictures if picture.name.startswith("pour")]
    assert [film.film for film in films] == [True]
    (copy / "figures/pour-initial-design.gif").write_bytes(b"GIF89a")
    shown = shown_run(read_run(copy))
    told = [*(picture.name for picture in shown.pictures), *shown.notes]
    assert any("pour-initial-design" in each for each in told), "a film that comes as GIF alone"


def test_what_is_no_run_or_has_no_design_is_refused(copy, tmp_path):
    with pytest.raises(InputError, match="no run to report"):
        write_report([])
    with pytest.raises(InputError, match="no run folder"):
        write_report([copy, tmp_path])
    newer = json.loads(text_of(copy / "summary.json")) | {"version": 99}
    (copy / "summary.json").write_text(json.dumps(newer), encoding="utf-8")
    with pytest.raises(InputError, match="newer shellform"):
        write_report([copy])
    (copy / "summary.json").write_text(
        json.dumps({"format": "shellform-summary", "version": 1}), encoding="utf-8"
    )
    with pytest.raises(InputError, match=r"tells of no design|no designs yet"):
        write_report([copy])
    for file in (copy / "designs").iterdir():
        file.unlink()
    with pytest.raises(InputError, match="no designs yet"):
        write_report([copy])


def test_designs_of_other_loads_are_refused(copy):
    settings = text_of(copy / "case.toml")
    loads = '\n[[load]]\nname = "{}"\nfactors = {{ point = 1.0 }}\n'
    cases = "".join(loads.format(name) for name in ("design", "additional", "wind"))
    before, _, after = settings.partition("[load]")
    after = after[after.index("[optimise]") :]
    (copy / "case.toml").write_text(
        f'{before}{cases}\n[part.point]\nkind = "points"\nforce = 6.9\n{after}'.replace("[part]\n", ""),
        encoding="utf-8",
    )
    with pytest.raises(InputError, match=r"other loads|another state of the case"):
        write_report([copy])


def test_a_damaged_history_is_refused(copy):
    (copy / "history.csv").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match=r"history.csv.*damaged"):
        write_report([copy])


def test_another_program_s_file_is_not_written_over_and_a_page_is(copy, tmp_path):
    other = tmp_path / "letter.html"
    other.write_text("<p>Dear Sir</p>", encoding="utf-8")
    with pytest.raises(InputError, match="no page of shellform"):
        write_report([copy], other)
    picture = tmp_path / "picture.html"
    picture.write_bytes(b"\x89PNG\xff")
    with pytest.raises(InputError, match="no page of shellform"):
        write_report([copy], picture)
    for _ in range(2):
        assert write_report([copy]) == copy / "report.html"
    with pytest.raises(InputError, match="can't be written"):
        write_report([copy], other / "below" / "page.html")


def test_a_page_goes_where_a_link_that_is_named_leads_and_takes_no_pipe_s_place(copy, tmp_path):
    named = tmp_path / "latest.html"
    named.symlink_to(tmp_path / "page.html")
    assert write_report([copy], named) == named
    assert named.is_symlink()
    assert (tmp_path / "page.html").is_file()
    os.mkfifo(tmp_path / "pipe.html")
    with pytest.raises(InputError, match="no page of shellform"):  # without waiting for what comes out of it
        write_report([copy], tmp_path / "pipe.html")


def test_several_runs_stand_side_by_side_with_the_settings_that_differ(begun, finished, tmp_path):
    page = text_of(write_report([finished, begun], tmp_path / "page.html"))
    assert "2 runs side by side" in page
    assert "The runs have the same settings" in page
    changed = Path(shutil.copytree(finished, tmp_path / "changed"))
    settings = text_of(changed / "case.toml").replace("force_max = 20.0", "force_max = 0.5")
    (changed / "case.toml").write_text(settings, encoding="utf-8")
    page = text_of(write_report([finished, changed], tmp_path / "page.html"))
    assert "Settings that differ (1)" in page
    assert "<code>cable.force_max</code></th><td><code>20.0</code></td><td><code>0.5</code></td>" in page
    assert "check fails" in page or "checks fail" in page
