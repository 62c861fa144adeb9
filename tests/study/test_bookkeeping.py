"""What a study hands out, shares, keeps and counts, with designs that are made up."""

from collections import Counter
from io import StringIO
from types import SimpleNamespace

import pytest

from shellform.errors import NotConverged
from shellform.study import studies
from shellform.study.engine import Manned
from shellform.study.front import Front
from shellform.study.outcome import ListedDesign, Outcome, Row, Status
from shellform.study.store import Log
from shellform.study.studies import StudyProgress


def studying(folder, log=None, **entries):
    entry = SimpleNamespace(
        **{"until": "optimise", "keep": "best", "longest": 60.0, "column": {"n": "net.n"}, **entries}
    )
    return studies._Studying(
        SimpleNamespace(study=entry),
        folder,
        log,
        Front({"n": 1.0}, {}),
        StudyProgress(total=9),
        lambda progress: None,
        allow_scripts=True,
    )


def of(key, n=None, status=Status.DONE, reason=""):
    return Outcome(key, status, reason, {} if n is None else {"net.n": n})


@pytest.fixture
def designs(monkeypatch):
    """Entries of four letters: the surface, the net, the first equilibria and the whole; "x…" is refused."""

    def identify(_, own):
        name = own["name"]
        if name.startswith("x"):
            return studies._Design(name, own, None, {}, f"{name} is wrong")
        stages = ("surface", "net", "initial", "optimise")
        return studies._Design(
            name, own, f"case {name}", {stage: name[: k + 1] for k, stage in enumerate(stages)}
        )

    monkeypatch.setattr(studies, "_identify", identify)
    return lambda *names: lambda: [{"name": name} for name in names]


def test_designs_share_the_last_stages_that_not_all_who_share_them_have_in_common_further_on(
    tmp_path, designs
):
    """All five have surface A; three of them net B, and two of these first equilibria C, too."""
    with Log(tmp_path / "log") as log:
        study = studying(tmp_path, log)
        batch, listed = designs("ABCa", "ABCb", "ABDa", "AEFa", "xxxx", "AGHa", "ABCa"), StringIO()
        keys, shared, fresh = studies._list(study, batch, listed)
        assert keys == ["ABCa", "ABCb", "ABDa", "AEFa", "xxxx", "AGHa", "ABCa"]
        assert (fresh, listed.getvalue().count("\n")) == (5, 7)
        assert shared == Counter({"A": 5, "AB": 3, "ABC": 2, "ABD": 1, "AE": 1, "AEF": 1, "AG": 1, "AGH": 1})
        assert (log.get("xxxx").status, log.get("xxxx").reason) == (Status.REFUSED, "xxxx is wrong")
        jobs = list(studies._jobs(study, batch, shared))
    assert [(job.key, job.case, job.until, job.longest) for job in jobs] == [
        (name, f"case {name}", "optimise", 60.0) for name in ("ABCa", "ABCb", "ABDa", "AEFa", "AGHa")
    ]
    assert [[each.key for each in job.before] for job in jobs] == [
        ["A", "AB", "ABC"], ["A", "AB", "ABC"], ["A", "AB"], ["A"], ["A"],
    ]  # fmt: skip
    last = jobs[1].before[-1]
    assert [each.key for each in last.before] == ["A", "AB"]
    assert (last.case, last.until, last.folder) == ("case ABCa", "initial", str(tmp_path / "stages" / "ABC"))
    assert jobs[2].folder == str(tmp_path / "runs" / "ABDa")
    assert all(job.allow_scripts for job in (*jobs, last))


def test_a_stage_that_all_share_together_with_the_next_has_no_folder_of_its_own(tmp_path, designs):
    """Three with the same net, of which all have the surface and two the first equilibria; one beside
    them."""
    with Log(tmp_path / "log") as log:
        study = studying(tmp_path, log)
        batch = designs("ABCa", "ABCb", "ABDa", "EFGa")
        _, shared, _ = studies._list(study, batch, StringIO())
        jobs = list(studies._jobs(study, batch, shared))
    assert [[each.key for each in job.before] for job in jobs] == [["AB", "ABC"], ["AB", "ABC"], ["AB"], []]


def test_what_is_in_the_log_is_not_handed_out_again_and_counted_where_it_was_there_before(tmp_path, designs):
    with Log(tmp_path / "log") as log:
        log.add([of("ABCa"), of("ABDa", status=Status.CRASHED)])
    with Log(tmp_path / "log") as log:
        log.add([of("AEFa")])
        study = studying(tmp_path, log)
        batch = designs("ABCa", "ABCb", "ABDa", "AEFa", "ABCa")
        _, shared, fresh = studies._list(study, batch, StringIO())
        assert (fresh, study.progress.found) == (2, 1)
        jobs = list(studies._jobs(study, batch, shared))
    assert [job.key for job in jobs] == ["ABCb", "ABDa"]
    assert jobs[0].before[0].case == "case ABCa", "the first of all that share it, with a result or without"


@pytest.mark.parametrize(("keep", "left"), [("best", "ce"), ("none", "e"), ("all", "abcde")])
def test_runs_that_are_not_kept_go_as_soon_as_that_is_known(tmp_path, keep, left):
    """b is worse than a, c better than both, d has no result; e is still at work, and beats c in the end."""
    runs = tmp_path / "out" / "runs"
    for key in "abcde":
        (runs / key).mkdir(parents=True)
    with Log(tmp_path / "log") as log:
        study = studying(tmp_path / "out", log, keep=keep)
        studies._enter(study, [of("a", 3), of("b", 4), of("d", status=Status.NO_RESULT)])
        studies._enter(study, [of("c", 2)])
        assert "".join(sorted(each.name for each in runs.iterdir())) == left
        assert (len(log), study.progress.done, study.progress.failed) == (4, 4, 1)
        studies._enter(study, [of("e", 1)])
    lasting = {"best": "e", "none": "", "all": "abcde"}[keep]
    assert "".join(sorted(each.name for each in runs.iterdir())) == lasting


def test_the_latest_twelve_rows_are_shown(tmp_path):
    with Log(tmp_path / "log") as log:
        study = studying(tmp_path, log, keep="all")
        studies._enter(study, [of(f"k{k}", 20 - k) for k in range(15)])
        assert [row.key for row in study.progress.rows] == [f"k{k}" for k in range(3, 15)]
        studies._enter(study, [of("last", status=Status.REFUSED)])
        assert study.progress.rows[-1] == Row("last", Status.REFUSED, "", {"n": None})
        assert len(study.progress.rows) == 12


def test_a_worker_without_room_stops_the_study_before_anything_of_its_batch_is_entered(tmp_path):
    with Log(tmp_path / "log") as log:
        study = studying(tmp_path, log)
        with pytest.raises(NotConverged, match="A worker found no room: full") as told:
            studies._enter(study, [of("a", 1), of("b", status=Status.NO_ROOM, reason="full")])
        assert "Make room" in told.value.remedy
        assert len(log) == 0


def test_the_table_is_brought_up_to_date_after_two_seconds_and_fifty_times_what_that_takes(
    monkeypatch, tmp_path
):
    """The first writing takes 0.2 s, those that follow 0.01 s."""
    clock = SimpleNamespace(now=50.0)
    written = []

    def write_table(*_):
        written.append(round(clock.now - 50.0, 6))
        clock.now += 0.2 if len(written) == 1 else 0.01

    def sweep(opened, jobs, work, *, manned):
        for at in (1.9, 2.0, 2.1, 5.0, 12.0, 12.4, 14.0, 14.5):
            clock.now = 50.0 + at
            yield [of(f"k{at}", 1)]

    monkeypatch.setattr(studies, "time", SimpleNamespace(perf_counter=lambda: clock.now))
    monkeypatch.setattr(studies, "write_table", write_table)
    monkeypatch.setattr(studies, "sweep", sweep)
    with Log(tmp_path / "log") as log:
        studies._compute(studying(tmp_path, log), None, iter(()), None)
    assert written == [2.1, 12.4, 14.5]


def test_missing_workers_are_shown_while_they_are_missing_and_once_as_they_are_back(monkeypatch, tmp_path):
    shown = []

    def sweep(opened, jobs, work, *, manned):
        for now in (Manned(2, 2), Manned(1, 2, 3.0), Manned(2, 2), Manned(2, 2), Manned(0, 2, 4.0, 2.5)):
            manned(now)
            shown.append("")
        yield [of("a", 1)]

    monkeypatch.setattr(studies, "sweep", sweep)
    with Log(tmp_path / "log") as log:
        study = studying(tmp_path, log)
        object.__setattr__(study, "show", lambda progress: shown.append(progress.manned))
        studies._compute(study, None, iter(()), None)
    assert shown == [
        "", Manned(1, 2, 3.0), "", Manned(2, 2), "", "", Manned(0, 2, 4.0, 2.5), "", Manned(0, 2, 4.0, 0.0),
    ]  # fmt: skip


def test_the_end_counts_designs_without_a_result_and_names_columns_that_are_empty_in_all(
    monkeypatch, tmp_path
):
    """Of six listed designs two are the same and from before, one is refused and one was never entered."""
    listed = [ListedDesign(key, {}) for key in "abcade"]
    monkeypatch.setattr(studies, "designs_of", lambda _: listed)
    monkeypatch.setattr(studies, "write_table", lambda *_: None)
    monkeypatch.setattr(studies, "write_study_page", lambda *_: "page")
    (tmp_path / "stages").mkdir()
    columns = {"n": "net.n", "m": "net.m", "o": "net.o"}
    with Log(tmp_path / "log") as log:
        log.add([of("a", 2)])
    with Log(tmp_path / "log") as log:
        log.add([of("b", status=Status.REFUSED, reason="wrong"), Outcome("c", Status.DONE, "", {"net.m": 1})])
        log.add([of("d")])
        found = studies._finish(studying(tmp_path, log, column=columns))
        assert (found.designs, found.failed, found.found, found.empty) == (6, 2, 1, ("o",))
        assert (found.table, found.page) == (tmp_path / "table.parquet", "page")
        assert (tmp_path / "stages").is_dir()
        studies._finish(studying(tmp_path, log, column=columns, keep="none"))
        assert not (tmp_path / "stages").exists()
        listed[:] = [ListedDesign(key, {}) for key in "eb"]
        with pytest.raises(
            NotConverged, match=r"None of 2 designs has a result. The first was refused: wrong"
        ):
            studies._finish(studying(tmp_path, log, column=columns))
