"""A study ends with the same table whatever happens to it on the way, and computes nothing twice."""

import asyncio
import csv
import errno
import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
import zlib
from contextlib import nullcontext
from dataclasses import replace
from types import SimpleNamespace

import dask
import pytest
from dask.utils import parse_timedelta
from distributed.nanny import WorkerProcess

from shellform.case.case import load_case
from shellform.errors import InputError, NotConverged
from shellform.run import run
from shellform.run.folder import alone, read_run
from shellform.study.engine import Engine, Manned, NoWorkers, _gathered, _Threads, engine, sweep
from shellform.study.front import Front, signed
from shellform.study.jobs import Job, work
from shellform.study.live import _line
from shellform.study.outcome import Outcome, Row, Status, flat
from shellform.study.store import Log, read_table
from shellform.study.studies import run_study
from shellform.study.varied import LimitEntry
from tests.command import begin
from tests.stubs import ROOT, deadly, quick, slow, stuck, study_file

GRID = """
[vary]
net.spacing = [0.1, 0.11, 0.12, 0.3]
cable.stiffness = [100, 187.0, 400]
"""
# Real designs: how many structures stand is told of a few and asked of none.
TOLD = (
    "[set]\nsafety.required = false\nsafety.drawn = 4\nsafety.compared = 2\n"
    "optimise.unloaded = false\noptimise.evaluations = 1\n"
)
SEARCH = """
method = "search"
count = 20
population = 6
seed = 3
[vary]
net.spacing = { low = 0.1, high = 0.15 }
cable.stiffness = { low = 50, high = 500, scale = "log" }
net.elements = [2, 3]
[objective]
misfit = "min"
cables = "min"
[limit]
misfit = 0.001
"""


@pytest.fixture(scope="module")
def two():
    with engine(workers=2) as opened:
        yield opened


@pytest.fixture
def on_two(two, monkeypatch):
    """Studies use the engine that runs already."""
    monkeypatch.setattr("shellform.study.studies.engine", lambda **_: nullcontext(two))


def rows(folder):
    with open(folder / "table.csv", newline="") as file:
        return list(csv.DictReader(file))


def table(folder):
    return (folder / "table.parquet").read_bytes(), (folder / "table.csv").read_bytes()


def calls(folder):
    return {file.parent.name: int(file.read_text()) for file in (folder / "runs").glob("*/calls")}


def test_a_study_has_a_row_a_design_and_a_second_call_computes_nothing(tmp_path, on_two):
    file = study_file(tmp_path, 'keep = "all"' + GRID)
    found = run_study(file, tmp_path / "out", work=quick)
    assert (found.designs, found.failed, found.found) == (12, 3, 0)
    told = rows(tmp_path / "out")
    assert [int(row["number"]) for row in told] == list(range(12))
    assert [row["status"] for row in told] == 9 * ["done"] + 3 * ["no result"]
    assert told[11]["reason"] == "it can't be built in RUN"
    assert told[4]["cables"] == str(round(44 + 0.02 * 187))
    assert told[11]["cables"] == ""
    before = table(tmp_path / "out")
    again = run_study(file, tmp_path / "out", work=quick)
    assert (again.designs, again.failed, again.found) == (12, 3, 12)
    assert set(calls(tmp_path / "out").values()) == {1}
    assert table(tmp_path / "out") == before
    few = read_table(
        tmp_path / "out", ["number", "case.net.spacing", "cables"], [("cables", "<", 46), ("cables", ">", 42)]
    )
    assert few.to_pydict() == {"number": [1], "case.net.spacing": [0.1], "cables": [44]}
    with pytest.raises(InputError, match=r"is no column of the table.*'cabels'.*Did you mean 'cables'"):
        read_table(tmp_path / "out", ["cabels"])
    assert read_table(tmp_path / "out", "cables").num_columns == 1
    for wrong in (("cabels", "<", 46), ("cables", "<<", 46), ("cables", "<", "few"), ("cables", 46)):
        with pytest.raises(InputError, match=r"filters: can't be used.*Name a column"):
            read_table(tmp_path / "out", ["cables"], [wrong])
    with pytest.raises(InputError, match=r"filters: can't be used.*Name a column"):
        read_table(tmp_path / "out", ["cables"], ("cables", "<", 46))
    seconds = (tmp_path / "out/seconds.csv").read_text()
    assert seconds.count(",here,here,0.01\n") == 12
    assert "<h1>Study of dome.toml</h1>" in (tmp_path / "out/study.html").read_text(encoding="utf-8")


def test_equal_designs_are_computed_once_and_new_ones_alone_are_added(tmp_path, on_two):
    text = (
        'keep = "all"\ndesigns = [{ net.spacing = 0.1 }, { net.spacing = 0.10 }, '
        "{ net.spacing = 1e-1, cable.stiffness = 187 }]\n"
    )
    run_study(study_file(tmp_path, text), tmp_path / "out", work=quick)
    told = rows(tmp_path / "out")
    assert len(told) == 3
    assert len({row["key"] for row in told}) == 1
    assert list(calls(tmp_path / "out").values()) == [1]
    more = text.replace("}]", "}, { net.spacing = 0.11 }]")
    assert run_study(study_file(tmp_path, more), tmp_path / "out", work=quick).found == 1
    assert sorted(calls(tmp_path / "out").values()) == [1, 1]
    # The surface's name and place don't matter, its bytes do.
    key = rows(tmp_path / "out")[0]["key"]
    (tmp_path / "dome.py").write_bytes((ROOT / "surfaces/dome.py").read_bytes())
    moved = text + f'[set]\nsurface.file = "{tmp_path / "dome.py"}"\n'
    run_study(study_file(tmp_path, moved), tmp_path / "out", work=quick, allow_scripts=True)
    assert rows(tmp_path / "out")[0]["key"] == key
    (tmp_path / "dome.py").write_bytes((ROOT / "surfaces/dome.py").read_bytes() + b"#\n")
    run_study(study_file(tmp_path, moved), tmp_path / "out", work=quick, allow_scripts=True)
    assert rows(tmp_path / "out")[0]["key"] != key


def test_designs_that_are_refused_have_a_row_with_the_reason(tmp_path, on_two):
    file = study_file(
        tmp_path,
        "[vary]\nnet.spacing = [0.1, 0.003]\nsurface.dimensions.height = [0.2, 0.1]\n"
        "rod.wall = [0.0005, 0.02]\n",
    )
    found = run_study(file, tmp_path / "out", work=quick)
    assert (found.designs, found.failed) == (8, 6)
    reasons = {row["reason"] for row in rows(tmp_path / "out")}
    assert any("must be well below net.spacing" in each for each in reasons)
    assert any("a tube's wall" in each for each in reasons)


@pytest.mark.parametrize(("keep", "left"), [("all", 12), ("none", 0), ("best", 3)])
def test_runs_are_kept_or_dropped_by_choice(tmp_path, on_two, keep, left):
    run_study(study_file(tmp_path, f'keep = "{keep}"' + GRID), tmp_path / "out", work=quick)
    kept = {folder.name for folder in (tmp_path / "out/runs").iterdir()}
    assert len(kept) == left
    every = rows(tmp_path / "out")
    done = [row for row in every if row["status"] == "done"]
    pairs = {row["key"]: (float(row["misfit"]), float(row["cables"])) for row in done}
    front = {
        key
        for key, one in pairs.items()
        if not any(a <= one[0] and b <= one[1] and (a, b) != one for a, b in pairs.values())
    }
    assert kept == {"all": {row["key"] for row in every}, "none": set(), "best": front}[keep]


def test_designs_of_the_case_as_it_was_before_a_change_take_no_place_on_the_front(tmp_path, on_two):
    """With a wider net each design is worse in cables; the better ones are those of the other case."""
    text = 'keep = "best"\n[vary]\ncable.stiffness = [100, 187]\n[set]\nnet.spacing = '
    kept = []
    for spacing in ("0.11", "0.13", "0.11"):
        run_study(
            study_file(tmp_path, text + spacing + '\n[objective]\ncables = "min"\n'),
            tmp_path / "out", work=quick,
        )  # fmt: skip
        kept.append({each.name for each in (tmp_path / "out/runs").iterdir()})
        best = min(rows(tmp_path / "out"), key=lambda row: int(row["cables"]))
        assert best["key"] in kept[-1]
        assert f'"runs/{best["key"]}/' in (tmp_path / "out/study.html").read_text(encoding="utf-8")
    assert [len(each) for each in kept] == [1, 2, 2], "nor do runs of the other case go"


def test_a_design_that_kills_its_workers_is_recorded_and_the_rest_goes_on(tmp_path, on_two):
    file = study_file(tmp_path, "[vary]\ncable.stiffness = [100, 333, 666, 187, 150, 120]\n")
    found = run_study(file, tmp_path / "out", work=deadly)
    assert (found.designs, found.failed) == (6, 1)
    told = rows(tmp_path / "out")
    assert [row["status"] for row in told] == ["done", "done", "crashed", "done", "done", "done"]
    assert "took 3 workers with it" in told[2]["reason"]
    # A crash may have been the machine's fault: the next call tries again.
    found = run_study(file, tmp_path / "out", work=quick)
    assert (found.failed, found.found) == (0, 5)
    clean = tmp_path / "clean"
    run_study(file, clean, work=quick)
    assert table(clean) == table(tmp_path / "out")


def test_a_study_waits_for_a_worker_that_takes_long_to_begin(tmp_path, monkeypatch):
    """Not for Dask's 15 s only, after which it would end what begins a worker anew."""
    begins = WorkerProcess.start

    async def slow_to_begin(process):
        await asyncio.sleep(2.0)
        return await begins(process)

    with engine(workers=1) as one:
        assert parse_timedelta(dask.config.get("distributed.deploy.lost-worker-timeout")) > one.patience
        monkeypatch.setattr(WorkerProcess, "start", slow_to_begin)
        monkeypatch.setattr("shellform.study.studies.engine", lambda **_: nullcontext(one))
        told = []
        file = study_file(tmp_path, "[vary]\ncable.stiffness = [333, 187]\n")
        found = run_study(
            file, tmp_path / "out", work=deadly, show=lambda now: told.append(now.manned.without)
        )
    assert (found.designs, found.failed) == (2, 0)
    assert max(told) > 1.0
    assert told[-1] == 0.0


async def in_vain(process):
    raise OSError(errno.EAGAIN, "no process can be begun")


def test_a_study_without_workers_ends_with_what_it_has_and_goes_on_later(tmp_path, on_two, monkeypatch):
    file = study_file(tmp_path, "[vary]\ncable.stiffness = [100, 120, 150, 666, 187, 200]\n")
    told = []
    with monkeypatch.context() as changed, engine(workers=1) as one:
        changed.setattr(WorkerProcess, "start", in_vain)
        changed.setattr("shellform.study.studies.engine", lambda **_: nullcontext(replace(one, patience=2.0)))
        changed.setattr("shellform.study.live._SHORT", 0.5)
        with pytest.raises(NotConverged, match=r"no worker for \d s.*the same command again: it goes on"):
            run_study(file, tmp_path / "out", work=deadly, show=lambda now: told.append(_line(now)))
    kept = rows(tmp_path / "out")
    done = len(kept)
    assert 2 <= done <= 3  # the third's may be lost with the worker
    assert {row["status"] for row in kept} == {"done"}
    assert f"study: {done} of 6 designs, no worker for 1 s" in told[-2]
    assert run_study(file, tmp_path / "out", work=quick).found == done


def test_a_study_that_lost_some_of_its_workers_says_how_many_and_ends(tmp_path, monkeypatch):
    file = study_file(tmp_path, f"[vary]\ncable.stiffness = {list(range(100, 160))}\n")
    told = []
    with monkeypatch.context() as changed, engine(workers=2) as one:
        processes = list(one.client.run(os.getpid).values())
        changed.setattr(WorkerProcess, "start", in_vain)
        changed.setattr("shellform.study.studies.engine", lambda **_: nullcontext(one))
        changed.setattr("shellform.study.live._SHORT", 0.5)

        def show(now):
            if now.manned.most == 2 == len(processes):  # both have been seen, and hardly a design is done
                os.kill(processes.pop(), signal.SIGKILL)
            told.append(_line(now))

        found = run_study(file, tmp_path / "out", work=slow, show=show)
    assert (found.designs, found.failed) == (60, 0)
    assert [
        line for line in told if re.search(r", 1 of 2 workers gone for [1-9]\d* s", line)
    ]  # on a busy machine for more


def test_workers_that_come_back_are_no_longer_told_as_gone(monkeypatch):
    now, told, threads = [0.0], [], {"a": 1, "b": 2, "c": 1}
    monkeypatch.setattr("shellform.study.engine.time", SimpleNamespace(monotonic=lambda: now[0]))
    seen = _Threads(Engine(SimpleNamespace(nthreads=lambda: dict(threads)), "", 60.0), told.append)
    for clock, there in [(2.0, "abc"), (4.0, "ac"), (9.0, "a"), (12.0, "axy"), (14.0, ""), (16.0, "wxyz")]:
        threads = dict.fromkeys(there, 1)
        now[0] = clock
        seen.look()
    assert told == [
        Manned(3, 3, 0.0, 0.0),
        Manned(2, 3, 0.0, 0.0),
        Manned(1, 3, 5.0, 0.0),
        Manned(3, 3, 0.0, 0.0),
        Manned(0, 3, 0.0, 0.0),
        Manned(4, 4, 0.0, 0.0),
    ]


def test_workers_by_the_million_are_refused_before_they_take_the_memory(tmp_path):
    with pytest.raises(InputError, match=r"--workers: at most 8 for each of the \d+ cores \(found 1000000\)"):
        run_study(study_file(tmp_path, GRID), tmp_path / "out", workers=1_000_000, work=quick)


def test_a_study_whose_workers_cannot_be_begun_says_so(tmp_path, monkeypatch):
    monkeypatch.setattr(WorkerProcess, "start", in_vain)
    with pytest.raises(NotConverged, match=r"can't be begun.*ask for fewer \(--workers\)"):
        run_study(study_file(tmp_path, GRID), tmp_path / "out", workers=2, work=quick)


def test_an_outcome_that_was_lost_with_the_last_worker_is_not_waited_for_for_ever(monkeypatch):
    with monkeypatch.context() as changed, engine(workers=1) as one:
        changed.setattr(WorkerProcess, "start", in_vain)
        future = one.client.submit(os.getpid)
        os.kill(future.result(), signal.SIGKILL)
        while one.client.nthreads():
            time.sleep(0.02)
        lost = one.client.submit(os.getcwd)
        told = []
        threads = _Threads(replace(one, patience=2.0), told.append)
        with pytest.raises(NoWorkers, match="no worker for"):
            _gathered(threads, [(None, lost)], pytest.fail)
    without = [each.without for each in told]
    assert without[0] == 0.0
    assert without == sorted(without)


def test_a_design_that_hangs_is_ended_with_its_worker_and_the_rest_goes_on(tmp_path, on_two):
    file = study_file(tmp_path, "[vary]\ncable.stiffness = [100, 666, 187]\n")
    found = run_study(file, tmp_path / "out", work=stuck)
    assert (found.designs, found.failed) == (3, 1)
    told = rows(tmp_path / "out")
    assert [row["status"] for row in told] == ["done", "overtime", "done"]
    assert "took longer than 0.1 s, and its worker had to be ended" in told[1]["reason"]
    found = run_study(file, tmp_path / "out", work=quick)  # the next call tries again
    assert (found.failed, found.found) == (0, 2)


def test_a_design_that_takes_too_long_is_stopped_at_its_next_step(tmp_path):
    case = load_case(study_file(tmp_path, "").with_name("dome.toml"))
    told = work(Job("k", case, "net", str(tmp_path / "r"), longest=1e-9))
    assert told.status is Status.OVERTIME
    assert "took longer than 1e-09 s: was at surface, reading" in told.reason


def study_process(file, folder, work):
    code = (
        "import sys\nfrom tests import stubs\nfrom shellform.study.studies import run_study\n"
        f"if __name__ == '__main__':\n    run_study({str(file)!r}, {str(folder)!r}, workers=2, "
        f"work=stubs.{work})\n"
    )
    script = folder.parent / "go.py"
    script.write_text(code)
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.Popen(
        [sys.executable, str(script)], env=environment, start_new_session=True, stderr=subprocess.DEVNULL
    )


def wait_for_rows(folder, count):
    log, began = folder / "results.jsonl", time.monotonic()
    while not log.exists() or log.read_bytes().count(b"\n") < count:
        assert time.monotonic() - began < 600
        time.sleep(0.02)


def test_a_study_killed_in_the_middle_goes_on_and_ends_with_the_same_bytes(tmp_path, on_two):
    many = 'keep = "all"\n[vary]\ncable.stiffness = { low = 100, high = 400, count = 40 }\n'
    file = study_file(tmp_path, many)
    out = tmp_path / "out"
    job = study_process(file, out, "slow")
    wait_for_rows(out, 12)
    job.kill()
    job.wait()
    killed = (out / "results.jsonl").read_bytes().count(b"\n")
    assert killed < 40
    run_study(file, out, work=slow)
    keys = [line.split(b'"')[3] for line in (out / "results.jsonl").read_bytes().splitlines()]
    assert len(keys) == len(set(keys)) == 40
    # Four were handed out at the kill, at the most; nothing else was done twice.
    assert sum(calls(out).values()) <= 44
    run_study(file, tmp_path / "whole", work=quick)
    assert table(tmp_path / "whole") == table(out)


def test_ctrl_c_stops_a_study_with_130_and_keeps_its_table(tmp_path):
    file = study_file(
        tmp_path, "until = 'net'\n[vary]\nnet.spacing = { low = 0.11, high = 0.13, count = 200 }\n"
    )
    job = begin("study", file, "--output", tmp_path / "out", "--workers", 2, start_new_session=True)
    wait_for_rows(tmp_path / "out", 3)
    os.killpg(job.pid, signal.SIGINT)
    _, said = job.communicate(timeout=60)
    assert job.returncode == 130
    assert "the same command goes on from there" in said
    assert "Traceback" not in said
    assert 3 <= len(rows(tmp_path / "out")) < 200


def test_the_log_cuts_off_what_a_kill_left_and_refuses_damage_before_it(tmp_path):
    file = tmp_path / "results.jsonl"
    row = Outcome("a", Status.DONE, values={"x": 1})
    with Log(file) as log:
        log.add([row, Outcome("b", Status.DONE, values={"x": 2.5, "y": "ü"})])
    whole = file.read_bytes()
    for cut in range(len(whole)):
        file.write_bytes(whole[:cut])
        with Log(file) as log:
            assert len(log) == whole[:cut].count(b"\n")
            log.add([replace(row, key="c")])
        with Log(file) as log:
            assert "c" in log
            assert log.get("c").values == {"x": 1}
    file.write_bytes(whole)
    with Log(file) as log:
        assert log.kinds == {"x": 2, "y": 3}
    file.write_bytes(whole.replace(b'"x":1', b'"x":7'))
    with pytest.raises(InputError, match=r"is damaged.*Choose another"):
        Log(file)


@pytest.mark.parametrize(
    "line",
    [
        b'{"key":"a","status":"done","reason":"","values":[1],"seconds":{},"worker":""}',
        b'{"key":"a","status":"done","reason":"","values":{"x":null},"seconds":{},"worker":""}',
        b'{"key":"a","status":"well","reason":"","values":{},"seconds":{},"worker":""}',
        b'{"key":7,"status":"done","reason":"","values":{},"seconds":{"net":"long"},"worker":""}',
        b"[]",
        b"7",
        b"{",
    ],
)
def test_a_whole_line_that_is_no_result_is_refused(tmp_path, line):
    (tmp_path / "results.jsonl").write_bytes(b"%08x %s\n" % (zlib.crc32(line), line))
    with pytest.raises(InputError, match=r"is no line of a study's results.*Choose another"):
        Log(tmp_path / "results.jsonl")


def test_no_cell_of_a_table_is_a_formula(tmp_path, on_two):
    text = (
        "[vary]\nnet.spacing = [0.1, 0.3]\n[column]\n"
        '"=cmd|\' /c calc\'!A0" = "designs.best.cables"\n"@sum" = "net.spacing"\n'
    )
    run_study(study_file(tmp_path, text), tmp_path / "out", work=quick)
    with open(tmp_path / "out/table.csv", newline="") as file:
        cells = [cell for row in csv.reader(file) for cell in row]
    assert "'=cmd|' /c calc'!A0" in cells
    assert not [cell for cell in cells if cell.startswith(("=", "+", "-", "@"))]


def test_a_full_disk_leaves_no_part_of_a_row(tmp_path, monkeypatch):
    row = Outcome("a", Status.DONE)
    with Log(tmp_path / "results.jsonl") as log:
        log.add([row])
        size = (tmp_path / "results.jsonl").stat().st_size

        def full(number):
            raise OSError(errno.ENOSPC, "No space left on device")

        monkeypatch.setattr(os, "fsync", full)
        with pytest.raises(OSError, match="No space"):
            log.add([replace(row, key="b")])
        assert "b" not in log
    assert (tmp_path / "results.jsonl").stat().st_size == size


def test_a_study_stops_where_the_disk_is_full_and_goes_on_once_there_is_room(tmp_path, on_two, monkeypatch):
    file = study_file(tmp_path, GRID)
    fsync = os.fsync

    def full(number):
        if len(os.listdir(tmp_path / "out/runs")) > 3:
            raise OSError(errno.ENOSPC, "No space left on device")
        fsync(number)

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(NotConverged, match=r"no room on the disk.*same command"):
        run_study(file, tmp_path / "out", work=quick)
    monkeypatch.setattr(os, "fsync", fsync)
    assert run_study(file, tmp_path / "out", work=quick).designs == 12
    run_study(file, tmp_path / "whole", work=quick)
    assert table(tmp_path / "whole") == table(tmp_path / "out")


def test_two_studies_do_not_work_in_one_folder(tmp_path, on_two):
    file = study_file(tmp_path, GRID)
    with (
        alone(tmp_path / "out"),
        pytest.raises(InputError, match="another shellform is at work in it"),
    ):
        run_study(file, tmp_path / "out", work=quick)


def test_links_in_a_study_s_folder_are_not_followed(tmp_path, on_two):
    (tmp_path / "mine.txt").write_text("mine")
    (tmp_path / "out").mkdir()
    (tmp_path / "out/designs.jsonl").symlink_to(tmp_path / "mine.txt")
    with pytest.raises(InputError, match=r"designs\.jsonl: is a symbolic link"):
        run_study(study_file(tmp_path, GRID), tmp_path / "out", work=quick)
    assert (tmp_path / "mine.txt").read_text() == "mine"


@pytest.mark.parametrize("name", ["study.toml", "table.csv", "stages/mine.txt", "runs/mine/plan.pdf"])
def test_files_that_no_study_wrote_are_not_overwritten(tmp_path, on_two, name):
    own = tmp_path / "out" / name
    own.parent.mkdir(parents=True)
    own.write_text("mine", encoding="utf-8")
    file = study_file(tmp_path, GRID + "[limit]\nmisfit = 0.0\n")
    with pytest.raises(
        InputError, match=rf"is no study's folder, and {name.split('/')[0]} in it would be overwritten"
    ):
        run_study(file, tmp_path / "out", work=quick)
    assert [each for each in (tmp_path / "out").rglob("*") if each.is_file()] == [own]
    assert own.read_text(encoding="utf-8") == "mine"


def test_another_study_in_the_folder_of_one_overwrites_its_copy_and_no_file_that_somebody_wrote(
    tmp_path, on_two
):
    out = tmp_path / "out"
    run_study(study_file(tmp_path, GRID), out, work=quick)
    assert (
        (out / "study.toml")
        .read_text(encoding="utf-8")
        .startswith("# Copied by shellform study from study.toml\n")
    )
    run_study(study_file(tmp_path, GRID + "\n# other\n"), out, work=quick)
    assert (out / "study.toml").read_text(encoding="utf-8").endswith("# other\n")
    (out / "study.toml").write_text("# mine\n" + GRID, encoding="utf-8")
    with pytest.raises(InputError, match=r"study\.toml: is no copy of a study.*another --output"):
        run_study(study_file(tmp_path, GRID), out, work=quick)
    assert (out / "study.toml").read_text(encoding="utf-8").startswith("# mine")


def test_a_study_s_folder_may_hold_its_study_file_and_other_files_and_what_is_left_of_it(tmp_path, on_two):
    file = study_file(tmp_path, GRID)
    (tmp_path / "notes.txt").write_text("mine", encoding="utf-8")
    run_study(file, tmp_path, work=quick)
    (tmp_path / "results.jsonl").unlink()
    assert run_study(file, tmp_path, work=quick).found == 0
    (tmp_path / "designs.jsonl").unlink()
    assert run_study(file, tmp_path, work=quick).found == 12
    assert (tmp_path / "notes.txt").read_text(encoding="utf-8") == "mine"


def test_lists_and_dates_of_designs_stand_in_the_table_as_text(tmp_path, on_two):
    text = """
        [[designs]]
        title_block.date = 2026-05-31
        net.offset = [0.1, 0.25]
        [[designs]]
        title_block.date = 2026-05-31
        net.spacing = -1.0
        [[designs]]
        net.spacing = 0.1
    """
    assert run_study(study_file(tmp_path, text), tmp_path / "out", work=quick).failed == 1
    told = rows(tmp_path / "out")
    assert [row["status"] for row in told] == ["done", "refused", "done"]
    assert [row["case.title_block.date"] for row in told] == ["2026-05-31", "2026-05-31", ""]
    assert [row["case.net.offset"] for row in told] == ["[0.1, 0.25]", "", ""]
    assert read_table(tmp_path / "out")["case.net.offset"].to_pylist() == ["[0.1, 0.25]", None, None]


def test_columns_that_no_summary_has_are_named(tmp_path, on_two):
    text = (
        "[vary]\nnet.spacing = [0.10, 0.12]\n[column]\n"
        'cables = "designs.best.cables"\nmisspelt = "designs.best.cablez"\n'
    )
    found = run_study(study_file(tmp_path, text), tmp_path / "out", work=quick)
    assert found.empty == ("misspelt",)
    assert found.page.is_file()


def test_a_study_without_any_result_says_so(tmp_path, on_two):
    with pytest.raises(NotConverged, match=r"None of 1 designs.*it can't be built"):
        run_study(study_file(tmp_path, "[vary]\nnet.spacing = [0.3]\n"), tmp_path / "out", work=quick)


def test_a_search_is_the_same_from_its_seed_however_often_it_was_stopped(tmp_path, on_two):
    run_study(study_file(tmp_path, SEARCH), tmp_path / "whole", work=quick)
    whole = rows(tmp_path / "whole")
    assert len(whole) == 20
    first, last = whole[:6], whole[-6:]
    assert min(float(row["misfit"]) for row in last) < 0.001
    assert len({row["case.net.spacing"] for row in first}) == 6
    # What a search stopped after eight designs has left: the log alone.
    (tmp_path / "out").mkdir()
    lines = (tmp_path / "whole/results.jsonl").read_bytes().splitlines(keepends=True)
    (tmp_path / "out/results.jsonl").write_bytes(b"".join(lines[:8]) + lines[9][:40])
    found = run_study(study_file(tmp_path, SEARCH), tmp_path / "out", work=quick)
    assert found.found == 8
    assert table(tmp_path / "out") == table(tmp_path / "whole")
    run_study(study_file(tmp_path, SEARCH.replace("seed = 3", "seed = 4")), tmp_path / "other", work=quick)
    assert rows(tmp_path / "other")[0]["case.net.spacing"] != whole[0]["case.net.spacing"]


def test_the_front_holds_what_nothing_beats_and_keeps_limits():
    front = Front(signed({"a": "min", "b": "max"}), {"a": LimitEntry(most=5.0)})
    for key, a, b, off in [
        ("one", 1, 1, []),
        ("worse", 2, 1, ["worse"]),
        ("other", 2, 2, []),
        ("best", 1, 3, ["one", "other"]),
        ("same", 1, 3, []),
        ("at its limit", 5, 4, []),
        ("beyond", 5.0001, 9, ["beyond"]),
        ("word", "5", 9, ["word"]),
        ("none", None, 9, ["none"]),
        ("nan", float("nan"), 9, ["nan"]),
    ]:
        assert front.add(Row(key, Status.DONE, "", {"a": a, "b": b})) == off
    assert front.add(Row("failed", Status.NO_RESULT, "", {"a": 0, "b": 9})) == ["failed"]
    assert set(front.found) == {"best", "same", "at its limit"}


def test_a_search_counts_what_is_beyond_a_limit_on_either_side_or_not_known():
    most, both = LimitEntry(most=2.0), LimitEntry(least=0.9, most=2.0)
    values = (2.0, 1.5, 3.0, None, "limit point")
    assert [most.beyond(value) for value in values] == [0.0, -0.5, 1.0, 1.0, 1.0]
    assert [both.beyond(value) for value in (0.9, 0.5, 1.0, 2.5)] == pytest.approx([0.0, 0.4, -0.1, 0.5])
    assert [LimitEntry(least=1.0).beyond(value) for value in (True, False)] == [0.0, 1.0], "of a yes or no"


def test_summaries_become_columns():
    tree = {
        "a": {"b": 1, "c": [1.0, 2.0]},
        "d": ["x", "y"],
        "e": None,
        "f": [[1]],
        "g": True,
        "h": list(range(9)),
        "i": [1.0, "x"],
    }
    assert flat(tree) == {"a.b": 1, "a.c.0": 1.0, "a.c.1": 2.0, "d": "x; y", "g": True}


def test_the_dashboard_which_answers_everybody_on_the_machine_has_to_be_asked_for(two):
    assert two.dashboard == ""
    port = two.client.scheduler_info()["services"]["dashboard"]  # of the server that Dask always has
    for page in ("", "/status", "/info/main/workers.html", "/health"):
        with pytest.raises(urllib.error.HTTPError, match="404"):
            urllib.request.urlopen(f"http://127.0.0.1:{port}{page}", timeout=30)
    with engine(workers=1, processes=False, dashboard=True) as asked:
        assert asked.dashboard.endswith("/status")


def test_a_scheduler_that_does_not_answer_is_refused_at_once_and_asked_no_more():
    with socket.create_server(("127.0.0.1", 0)) as silent:
        for address in ("nonsense", "http://127.0.0.1:9", f"tcp://127.0.0.1:{silent.getsockname()[1]}"):
            with (
                pytest.raises(InputError, match=r"--scheduler: doesn't answer.*tcp://"),
                engine(scheduler=address),
            ):
                pass


def test_the_scheduler_and_its_workers_listen_on_loopback_alone(two):
    addresses = [two.client.scheduler.address, *two.client.scheduler_info()["workers"]]
    assert all(address.startswith("tls://127.0.0.1:") for address in addresses)
    plain = addresses[0].replace("tls", "tcp")
    with pytest.raises(InputError, match="--scheduler"), engine(scheduler=plain):
        pass  # without the cluster's certificate
    with pytest.raises(InputError, match="--scheduler"), engine(scheduler="tcp://127.0.0.1:9"):
        pass


def test_workers_have_one_thread_each(two):
    def threads():
        from shellform.structure.elements.threads import cores

        return cores(), {os.environ[f"{name}_NUM_THREADS"] for name in ("OMP", "MKL", "OPENBLAS", "NUMBA")}

    assert set(map(str, two.client.run(threads).values())) == {"(1, {'1'})"}


def test_real_designs_share_their_stages_and_end_with_the_bytes_of_single_runs(tmp_path, two, on_two):
    file = study_file(
        tmp_path, f'keep = "all"\n{TOLD}[vary]\nnet.spacing = [0.15, 0.16]\noptimise.misfit = [0.7, 0.4]\n'
        '[function]\n'
        'optimise.cable_force = "1 - optimise.misfit"\n'
    )  # fmt: skip
    run_study(file, tmp_path / "out")
    told = rows(tmp_path / "out")
    assert [row["status"] for row in told] == 4 * ["done"], [row["reason"] for row in told]
    # The surface is shared by all, the first equilibria by two each; nets go with these.
    assert len(list((tmp_path / "out/stages").iterdir())) == 3
    alone = study_file(
        tmp_path / "alone",
        f"designs = [{{ optimise.misfit = 0.4, optimise.cable_force = 0.6, net.spacing = 0.16 }}]\n{TOLD}",
    )
    run_study(alone, tmp_path / "alone/out")
    mine, theirs = rows(tmp_path / "out")[3], rows(tmp_path / "alone/out")[0]
    assert {name: mine[name] for name in ("key", "misfit", "cables")} == {
        name: theirs[name] for name in ("key", "misfit", "cables")
    }
    # The page links to a page of each of the best.
    linked = set(re.findall(r'href="(runs/[^"]+)"', (tmp_path / "out/study.html").read_text()))
    assert linked
    assert all("Optimised" in (tmp_path / "out" / page).read_text() for page in linked)
    kept = read_run(tmp_path / "out/runs" / mine["key"])
    assert kept.summary.designs["optimised"].cables == int(mine["cables"])
    # A folder that a machine left damaged when it was switched off is done anew.
    damaged = tmp_path / "out/runs" / mine["key"]
    (damaged / "net.npz").write_bytes(b"")
    stages = json.loads((damaged / "stages.json").read_text())
    (damaged / "stages.json").write_text(
        json.dumps({name: stages[name] for name in ("surface", "net", "initial")})
    )
    outcome = work(Job(mine["key"], kept.case, "optimise", str(damaged)))
    assert outcome.status is Status.DONE, outcome.reason
    assert outcome.values["designs.optimised.cables"] == int(mine["cables"])


def test_what_designs_share_has_the_first_one_s_case_however_often_the_study_was_begun(tmp_path, on_two):
    file = study_file(
        tmp_path, 'until = "initial"\nkeep = "all"\n[vary]\ncable.stiffness = [100, 400, 200]\n'
    )
    folder = tmp_path / "out"
    run_study(file, folder)
    shared = {each.parent.name: each.read_text() for each in (folder / "stages").glob("*/case.toml")}
    assert shared
    assert all("stiffness = 100.0" in case for case in shared.values())
    results = (folder / "results.jsonl").read_text().splitlines(keepends=True)
    first = next(line for line in results if rows(folder)[0]["key"] in line)
    (folder / "results.jsonl").write_text(first)  # as a full disk left it, with what is shared half done
    shutil.rmtree(folder / "stages")
    run_study(file, folder)
    assert {each.parent.name: each.read_text() for each in (folder / "stages").glob("*/case.toml")} == shared


def test_work_turns_whatever_happens_into_a_row(tmp_path, monkeypatch):
    case = load_case(study_file(tmp_path, "").with_name("dome.toml"))

    def raising(error):
        def fail(*arguments, **settings):
            raise error

        return fail

    for error, status, words in [
        (InputError("is wrong", where=f"{tmp_path / 'r'}/net"), "refused", "RUN/net: is wrong"),
        (NotConverged("no way"), "no result", "no way"),
        (MemoryError(), "no result", "the memory is full"),
        (ZeroDivisionError("by zero"), "error", "ZeroDivisionError: by zero (test_studies.py"),
        (OSError(errno.ENOSPC, "No space left"), "no room", "No space left"),
        (OSError(errno.EACCES, "Denied"), "error", "Denied"),
    ]:
        monkeypatch.setattr(run, "run_case", raising(error))
        told = work(Job("k", case, "net", str(tmp_path / "r")))
        assert told.status == status
        assert words in told.reason


def test_outcomes_come_as_they_are_ready_and_jobs_are_drawn_as_they_are_needed(tmp_path, two):
    case = load_case(study_file(tmp_path, "").with_name("dome.toml"))
    drawn = []

    def jobs():
        for k in range(40):
            drawn.append(k)
            yield Job(f"{k:032d}", case, "net", str(tmp_path / f"{k}"))

    came, most = 0, 0
    for batch in sweep(two, jobs(), quick):
        most = max(most, len(drawn) - came)
        came += len(batch)
    assert came == 40
    assert most <= 8


def test_workers_can_be_threads_of_one_process_to_try_out_the_engine(tmp_path):
    case = load_case(study_file(tmp_path, "").with_name("dome.toml"))
    with engine(workers=3, processes=False) as threads:
        found = [
            each
            for batch in sweep(
                threads, (Job(f"{k:032d}", case, "net", str(tmp_path / f"{k}")) for k in range(9)), quick
            )
            for each in batch
        ]
    assert sorted(each.key for each in found) == [f"{k:032d}" for k in range(9)]


def test_the_probability_of_standing_is_a_column_an_objective_and_a_limit_of_a_study(tmp_path):
    file = study_file(
        tmp_path,
        f"{TOLD}net.spacing = 0.16\n"
        "[vary]\nrod.radius = [0.0009, 0.001]\n"
        '[column]\nat_least = "designs.best.loads.design.stands.at_least"\ncables = "designs.best.cables"\n'
        '[objective]\nat_least = "max"\ncables = "min"\n[limit]\ncables = 1000\n',
    )
    found = run_study(file, tmp_path / "out", workers=1)
    assert found.failed == 0
    with (tmp_path / "out/table.csv").open(encoding="utf-8") as text:
        told = list(csv.DictReader(text))
    assert len(told) == 2
    assert all(0.0 <= float(row["at_least"]) < 1.0 for row in told)
