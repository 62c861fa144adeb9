"""SIGKILL, Ctrl-C and SIGTERM to a study and SIGKILL to its workers at random moments, again and again, until
it has ended; and the same study undisturbed.

    scripts/study_faults.py [--kills 30] [--folder DIR] [--seed 1] [--until STAGE]

Passes when both tables, the lists of designs and what the run folders hold are the same to the byte (but for
seconds), no design has two rows, every file of the folders can be read, no traceback was told and Ctrl-C
ended with status 130. The designs are real ones: a dome of about 1,200 degrees of freedom, from surface to
optimised cables.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
_STOPPED = 130  # the status after Ctrl-C
_LONGEST = 120.0  # s from a signal to the end of what it stops
STUDY = """
case = "dome.toml"
method = "latin"
count = 24
keep = "all"
[vary]
net.spacing = [0.12, 0.125, 0.13]
cable.stiffness = { low = 100, high = 400 }
"""


def main() -> int:
    """Runs the trial; status 0 where it passes."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--kills", type=int, default=30)
    parser.add_argument("--folder", type=Path, default=None)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--until", default="optimise", help="last stage of each design")
    asked = parser.parse_args()
    sys.path.insert(0, str(ROOT))
    from tests.stubs import study_file

    place = asked.folder or Path(tempfile.mkdtemp(prefix="study_faults"))
    file = study_file(place, STUDY.replace('case = "dome.toml"', f'until = "{asked.until}"'))
    chance = random.Random(asked.seed)
    out, whole = place / "out", place / "whole"
    for each in (out, whole):
        shutil.rmtree(each, ignore_errors=True)
    if start(file, whole).wait() != 0:
        print(f"FAIL: the undisturbed study didn't end well, see {whole}.log")
        return 1
    longest = 3.0 * design_time(whole)
    kills, unlike = Counter[str](), 0
    job: subprocess.Popen[bytes] | None = None
    while kills.total() < asked.kills:
        if job is None or job.poll() is not None:
            if (
                job is not None and job.returncode == 0
            ):  # it has ended: its last rows are taken away, and it goes on
                forget(out, chance.randrange(2, 10))
            job = start(file, out)
        at_work(job, out)
        time.sleep(chance.uniform(0.0, longest))
        workers = children(job.pid)
        if workers and chance.random() < 0.6:
            os.kill(chance.choice(workers), signal.SIGKILL)
            kills["worker"] += 1
        elif job.poll() is None:
            how = chance.choice([signal.SIGKILL, signal.SIGINT, signal.SIGTERM])
            job.send_signal(how)
            try:
                ended = job.wait(_LONGEST)
            except subprocess.TimeoutExpired:
                job.kill()
                ended = job.wait()
            wanted = _STOPPED if how is signal.SIGINT else -how
            if ended not in (wanted, 0):  # 0: it had just ended
                unlike += 1
                print(f"FAIL: status {ended} after {how.name}", flush=True)
            kills[how.name] += 1
        rows = (out / "results.jsonl").read_bytes().count(b"\n") if (out / "results.jsonl").exists() else 0
        told = ", ".join(f"{count} {name}" for name, count in sorted(kills.items()))
        print(f"{kills.total()} kills ({told}); {rows} rows", flush=True)
    if job is not None and job.poll() is None:
        job.wait()
    if start(file, out).wait() != 0:
        print(f"FAIL: the study didn't end well, see {out}.log")
        return 1
    return 1 if judge(out, whole) + unlike else 0


def start(file: Path, folder: Path) -> subprocess.Popen[bytes]:
    """The study in a process of its own."""
    command = [
        sys.executable,
        "-m",
        "shellform",
        "study",
        str(file),
        "--output",
        str(folder),
        "--workers",
        "2",
    ]
    with open(folder.with_suffix(".log"), "ab") as log:
        return subprocess.Popen(
            command,
            cwd=ROOT,
            stdout=log,
            stderr=log,
            env={**os.environ, "PYTHONPATH": str(ROOT)},
            # A shell's background job ignores it.
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
        )


def design_time(folder: Path) -> float:
    """Median seconds of a design's own stages: the first ones compile kernels, for a minute where none are
    kept from before.
    """
    lines = (folder / "results.jsonl").read_bytes().splitlines()
    return statistics.median(json.loads(line[9:])["seconds"]["here"] for line in lines)


def at_work(job: subprocess.Popen[bytes], folder: Path) -> None:
    """Waits until the study has begun a stage, so that not only its start is disturbed."""
    began = time.time() - 0.5
    while job.poll() is None and time.time() < began + 120.0:
        if any(file.stat().st_mtime > began for file in folder.glob("*/*/case.toml")):
            return
        time.sleep(0.1)


def children(process: int) -> list[int]:
    """The worker processes of a study."""
    found = []
    for each in Path("/proc").iterdir():
        try:
            parent = (
                int((each / "stat").read_text().rsplit(")", 1)[1].split()[1]) if each.name.isdigit() else -1
            )
            if parent == process and b"spawn_main" in (each / "cmdline").read_bytes():
                found.append(int(each.name))
        except OSError:  # it has ended meanwhile
            continue
    return found


def forget(folder: Path, rows: int) -> None:
    """Takes away the last rows, and tears the one before, as a kill would have left it; and what these
    designs had computed.
    """
    log = folder / "results.jsonl"
    lines = log.read_bytes().splitlines(keepends=True)
    for line in lines[-rows:]:
        shutil.rmtree(folder / "runs" / json.loads(line[9:])["key"], ignore_errors=True)
    log.write_bytes(b"".join(lines[:-rows]) + lines[-rows][:100])


def judge(out: Path, whole: Path) -> int:
    """Tells how the disturbed study differs from the undisturbed one, and how often."""
    from scripts.design_faults import differences
    from shellform.run.folder import read_run
    from shellform.study.store import Log, read_table

    failed = 0
    for name in ("table.parquet", "table.csv", "designs.jsonl"):
        same = (out / name).read_bytes() == (whole / name).read_bytes()
        failed += not same
        print(f"{name}: {'the same bytes' if same else 'FAIL: other bytes'}")
    one, two = read_table(out), read_table(whole)
    for column in one.column_names if not one.equals(two) else []:
        if not one[column].equals(two[column]):
            print(f"  differs: {column}")
    lines = (out / "results.jsonl").read_bytes().splitlines()
    keys = [json.loads(line[9:])["key"] for line in lines if json.loads(line[9:])["status"] != "crashed"]
    failed += len(keys) != len(set(keys)) or len(keys) != one.num_rows
    print(f"{one.num_rows} designs, {len(keys)} rows in the log, {len(set(keys))} keys")
    with Log(out / "results.jsonl") as log:
        failed += len(log) != one.num_rows
    damaged = 0
    for file in out.rglob("*"):
        try:
            if file.suffix == ".npz" and ".part" not in file.name:
                with np.load(file) as data:
                    assert all(data[name] is not None for name in data.files)
            elif file.suffix == ".json":
                json.loads(file.read_text(encoding="utf-8"))
        except Exception as error:  # whatever is wrong with it
            damaged += 1
            print(f"damaged: {file}: {error}")
    runs = [
        read_run(folder) for folder in (out / "runs").iterdir() if (folder / "designs/initial.npz").exists()
    ]
    print(f"{len(runs)} runs read back, {damaged} damaged files")
    failed += damaged
    if "Traceback" in out.with_suffix(".log").read_text(encoding="utf-8"):
        failed += 1
        print("a traceback")
    for folder in sorted((whole / "runs").iterdir()):
        unlike = differences(out / "runs" / folder.name, folder)
        failed += bool(unlike)
        if unlike:
            print(f"{folder.name}: {'; '.join(unlike)}")
    print("FAIL" if failed else "pass")
    return failed


if __name__ == "__main__":
    sys.exit(main())
