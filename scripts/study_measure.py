"""What a study costs besides its designs: one command, a few numbers each.

    scripts/study_measure.py soak [--designs 200]     real small designs on two workers and on one, in turns:
    throughput, memory over time scripts/study_measure.py thousand [--designs 1000] [--unjudged] a whole study
    of a small dome, 1,500 degrees of freedom, 15 evaluations each,
                                                      judged as built or with nothing asked of them as built
    scripts/study_measure.py overhead                 the engine's time a design, with designs that take none
    scripts/study_measure.py table [--rows 100000]    a table of so many rows: written, opened, filtered
    scripts/study_measure.py many [--workers 1000]    so many workers in one process, with designs that sleep:
    what limits them

Ratios are taken between turns of the same run, since machines are shared: what disturbs one worker's turn
disturbs the next turn of two.
"""

from __future__ import annotations

import argparse
import asyncio
import random
import statistics
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

from shellform.case.case import load_case  # noqa: E402
from shellform.study.engine import Engine, engine, sweep  # noqa: E402
from shellform.study.jobs import Job, work  # noqa: E402
from shellform.study.outcome import Outcome, Status, flat  # noqa: E402


def timed(job: Job, before: Outcome | None = None) -> Outcome:
    """As `work`, with processor time and memory of the worker."""
    import os

    import psutil

    began = time.thread_time()
    outcome = work(job, before)
    here = {
        "cpu": time.thread_time() - began,
        "memory": psutil.Process(os.getpid()).memory_info().rss / 1024**2,
    }
    return replace(outcome, seconds={**outcome.seconds, **here})


def nothing(job: Job, before: Outcome | None = None) -> Outcome:
    """A design without work, with a row as large as a real one."""
    summary = {"designs": {f"d{k}": {f"v{j}": random.random() for j in range(30)} for k in range(5)}}
    return Outcome(job.key, Status.DONE, values=flat(summary))


async def asleep(job: Job, before: Outcome | None = None) -> Outcome:
    """As `nothing`, after about the seconds that the case names its spacing: a thread for each of a thousand
    workers would keep the machine busy with handing the interpreter around."""
    await asyncio.sleep(job.case.net.spacing * random.uniform(0.5, 1.5))
    return nothing(job)


def soak(count: int) -> None:
    """Throughput of two workers over one, processor time a design, and the workers' memory."""
    from tests.stubs import study_file

    place = Path(tempfile.mkdtemp(prefix="study_soak"))
    case = load_case(study_file(place, "").with_name("dome.toml"), ["optimise.evaluations=3"])

    def jobs(first: int, number: int) -> Iterator[Job]:
        for k in range(first, first + number):
            entry = case.cable.model_copy(update={"stiffness": 100.0 + k})
            yield Job(
                f"{k:032d}", case.model_copy(update={"cable": entry}), "optimise", str(place / f"runs/{k}")
            )

    def turn(on: Engine, first: int, number: int) -> tuple[float, list[Outcome]]:
        began = time.perf_counter()
        found = [outcome for batch in sweep(on, jobs(first, number), timed) for outcome in batch]
        return number / (time.perf_counter() - began), found

    with engine(workers=1) as one, engine(workers=2) as two:
        turn(one, 900_000, 2)
        turn(two, 900_010, 4)  # both have compiled and loaded what they need
        rates: dict[str, list[float]] = {"one": [], "two": []}
        all_found: dict[str, list[Outcome]] = {"one": [], "two": []}
        first = 0
        while len(all_found["two"]) < count:
            for name, on, number in (
                ("one", one, 8),
                ("two", two, 32),
            ):  # long turns: at the end of each a worker waits for the other
                rate, found = turn(on, first, number)
                first += number
                rates[name].append(rate)
                all_found[name] += found
        ratios = [b / a for a, b in zip(rates["one"], rates["two"], strict=True)]
        done = sum(outcome["status"] == "done" for outcome in all_found["two"])
        print(
            f"{len(all_found['two'])} designs on two workers, {done} done: {statistics.median(rates['two']):.2f} a second"
        )
        print(
            f"throughput of two workers over one, turn by turn: median {statistics.median(ratios):.2f} ({min(ratios):.2f} to {max(ratios):.2f})"
        )
        cpu = {
            name: statistics.median(o["seconds"]["cpu"] for o in found) for name, found in all_found.items()
        }
        print(
            f"processor time a design: {cpu['one']:.2f} s alone, {cpu['two']:.2f} s beside another: efficiency {cpu['one'] / cpu['two']:.2f}"
        )
        memory = [outcome["seconds"]["memory"] for outcome in all_found["two"]]
        quarter = len(memory) // 4
        early, late = statistics.median(memory[quarter : 2 * quarter]), statistics.median(memory[-quarter:])
        print(
            f"memory of a worker: {early:.0f} MB in the second quarter, {late:.0f} MB in the last, {max(memory):.0f} MB at most"
        )


def thousand(count: int, *, judged: bool) -> None:
    """A study by its command's function, from the study file to the page."""
    from shellform.study.store import read_table
    from shellform.study.studies import run_study
    from tests.stubs import study_file

    place = Path(tempfile.mkdtemp(prefix="study_thousand"))
    text = f"""
method = "latin"
count = {count}
keep = "best"
{"" if judged else 'until = "optimise"'}
[set]
{"" if judged else "safety.required = false"}
net.spacing = 0.102
optimise.evaluations = 15
optimise.unloaded = false
cable.without = false
[vary]
cable.stiffness = {{ low = 100, high = 400, scale = "log" }}
load.force = {{ low = 1.6, high = 2.2 }}
optimise.misfit = {{ low = 0.3, high = 0.9 }}
[function]
optimise.cable_force = "1 - optimise.misfit"
"""
    file = study_file(place, text)
    began = time.perf_counter()
    found = run_study(file, place / "out", workers=2)
    spent = time.perf_counter() - began
    rows = read_table(place / "out", ["model.freedoms"]).to_pydict()
    dofs = max(each for each in rows["model.freedoms"] if each)
    print(
        f"{found.designs} designs of {dofs:g} degrees of freedom in {spent / 60:.1f} minutes, {found.failed} without a result: {place / 'out'}"
    )


def overhead() -> None:
    """Milliseconds a design that does nothing, through the engine alone and through a whole study."""
    from shellform.study.studies import run_study
    from tests.stubs import study_file

    place = Path(tempfile.mkdtemp(prefix="study_overhead"))
    file = study_file(
        place, 'keep = "none"\n[vary]\ncable.stiffness = { low = 100, high = 400, count = 1000 }\n'
    )
    case = load_case(file.with_name("dome.toml"))
    with engine(workers=2) as two:
        began, used = time.perf_counter(), time.process_time()
        count = sum(
            len(batch)
            for batch in sweep(two, (Job(f"{k:032d}", case, "net", "") for k in range(1000)), nothing)
        )
        spent, used = time.perf_counter() - began, time.process_time() - used
        print(
            f"engine alone: {1e3 * spent / count:.1f} ms a design, {1e3 * used / count:.1f} ms of processor time"
        )
    for what in (
        "whole study of 1,000 designs, with starting and ending the workers and the page",
        "again, on the same folder",
    ):
        began, used = time.perf_counter(), time.process_time()
        run_study(file, place / "out", workers=2, work=nothing)
        print(
            f"{what}: {time.perf_counter() - began:.1f} s, {time.process_time() - used:.1f} s of processor time"
        )


def table(rows: int) -> None:
    """Seconds to write, open and filter a table."""
    import json

    from shellform.study.store import Log, read_table, write_table

    place = Path(tempfile.mkdtemp(prefix="study_table"))
    chance = random.Random(1)
    names = [f"designs.d{k}.v{j}" for k in range(5) for j in range(30)]
    began = time.perf_counter()
    with Log(place / "results.jsonl") as log, open(place / "designs.jsonl", "w") as designs:
        for first in range(0, rows, 1000):
            keys = [f"{k:032d}" for k in range(first, min(first + 1000, rows))]
            log.add(
                [
                    {
                        "key": k,
                        "status": "done",
                        "reason": "",
                        "values": {n: chance.random() for n in names},
                        "seconds": {},
                        "worker": "",
                    }
                    for k in keys
                ]
            )
            designs.writelines(
                json.dumps({"key": k, "own": {"net.spacing": chance.random()}}) + "\n" for k in keys
            )
        designs.flush()
        print(f"{rows} rows of {len(names)} columns logged in {time.perf_counter() - began:.1f} s")
        began = time.perf_counter()
        write_table(place, log, {"a": names[0], "b": names[1]})
        print(
            f"table written in {time.perf_counter() - began:.1f} s, {(place / 'table.parquet').stat().st_size / 1024**2:.0f} MB"
        )
    began = time.perf_counter()
    with Log(place / "results.jsonl"):
        print(f"log opened in {time.perf_counter() - began:.1f} s")
    began = time.perf_counter()
    whole = read_table(place)
    print(
        f"table opened in {time.perf_counter() - began:.2f} s: {whole.num_rows} rows, {whole.num_columns} columns"
    )
    began = time.perf_counter()
    some = read_table(place, ["number", "a", "b", "case.net.spacing"], [("a", "<", 0.1), ("b", ">", 0.5)])
    print(f"filtered in {time.perf_counter() - began:.2f} s: {some.num_rows} rows")


def many(workers: int, seconds: float) -> None:
    """Designs a second that the scheduler, the study's loop and the store can take from so many workers.

    What each worker does for itself several times a second, to look at its memory and its clock, would be
    done by this process for all.
    """
    import dask
    import distributed  # noqa: F401 (it adds its own settings, before ours)

    from shellform.study.store import Log
    from tests.stubs import study_file

    place = Path(tempfile.mkdtemp(prefix="study_many"))
    case = load_case(study_file(place, "").with_name("dome.toml"))
    entry = case.net.model_copy(update={"spacing": seconds})
    case = case.model_copy(update={"net": entry})
    own = {"distributed.admin.system-monitor.interval": "1h", "distributed.admin.tick.interval": "10s"}
    with (
        dask.config.set(own),
        engine(workers=workers, processes=False) as on,
        Log(place / "results.jsonl") as log,
    ):
        count, began, used, store = 0, time.perf_counter(), time.process_time(), 0.0
        total = max(300, 6 * workers)
        came: list[float] = []
        for batch in sweep(on, (Job(f"{k:032d}", case, "net", "") for k in range(total)), asleep):
            before = time.perf_counter()
            log.add(batch)
            store += time.perf_counter() - before
            count += len(batch)
            came += [time.perf_counter()] * len(batch)
        spent, used = time.perf_counter() - began, time.process_time() - used
    middle = came[count // 4 : 3 * count // 4]  # all workers have begun, and none has run out of designs
    print(
        f"{workers} workers, designs of {seconds:g} s: {len(middle) / (middle[-1] - middle[0]):.0f} designs a second in the middle half, of "
        f"{workers / seconds:.0f} possible; {count} in {spent:.1f} s; store {1e3 * store / count:.2f} ms a design, "
        f"processor time of engine and workers {1e3 * used / count:.2f} ms"
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs one of them."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("what", choices=["soak", "thousand", "overhead", "table", "many"])
    parser.add_argument("--designs", type=int, default=None)
    parser.add_argument("--unjudged", action="store_true")
    parser.add_argument("--rows", type=int, default=100_000)
    parser.add_argument("--workers", type=int, default=1000)
    parser.add_argument("--seconds", type=float, default=1.0)
    asked = parser.parse_args(arguments)
    if asked.what == "soak":
        soak(asked.designs or 200)
    elif asked.what == "thousand":
        thousand(asked.designs or 1000, judged=not asked.unjudged)
    elif asked.what == "overhead":
        overhead()
    elif asked.what == "table":
        table(asked.rows)
    else:
        many(asked.workers, asked.seconds)


if __name__ == "__main__":
    main()
