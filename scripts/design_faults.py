"""SIGKILL, Ctrl-C and SIGTERM to a design at random moments of all its stages and phases, each resumed to the
end; and the same design undisturbed.

    scripts/design_faults.py [--kills 60] [--folder DIR] [--seed 1] [--set ENTRY=VALUE …]

Passes when every disturbed run ends like the undisturbed one, with the same bytes but for seconds, and with
no traceback, torn or further file, and when what Ctrl-C stops ends with status 130. The case is the vault
with wide cells, whose search is led by structures that fall before it thins.

Each run is a process forked from this one, which has loaded the program: what a kill leaves is the same, and
a run is begun again in no time. Moments are counted in processor time, which other work on the machine
doesn't change.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import re
import signal
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))
from shellform.errors import InputError  # noqa: E402
from shellform.run.checkpoint import FILE as CHECKPOINT  # noqa: E402
from shellform.written import is_partial  # noqa: E402

CASE = ROOT / "scripts/scale_model.toml"
SETTINGS = [
    "surface.size=0.03",
    "net.spacing=0.11",
    "net.elements=2",
    "load.force=4.5",
    "safety.critical_factor=1.9",
    "safety.drawn=4",
    "safety.compared=2",
    "optimise.evaluations=24",
    "optimise.polish=3",
]
NAME = "run"  # of each run's folder
_UNLIKE = ("log.txt", "lock")  # times of day, and how often it was begun
_TICK = 1.0 / os.sysconf("SC_CLK_TCK")
_LOOK = 0.02  # s between two looks
_SIGNALS = [signal.SIGKILL, signal.SIGKILL, signal.SIGINT, signal.SIGTERM]
_STOPPED = 130  # the status after Ctrl-C
_FALLS = 3  # the status of a design that was made and doesn't hold
_LONGEST = 120.0  # s from a signal to the end of what it stops


def main() -> int:
    """Runs the trial; status 0 where it passes."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--kills", type=int, default=60)
    parser.add_argument("--folder", type=Path, default=None)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--set", action="append", default=[], help="beside the settings of the small vault")
    asked = parser.parse_args()
    place = asked.folder or Path(tempfile.mkdtemp(prefix="design_faults"))
    place.mkdir(parents=True, exist_ok=True)
    settings, chance = [*SETTINGS, *asked.set], random.Random(asked.seed)
    # The page tells its folder's name, which is the same for all.
    whole, times = place / "whole" / NAME, Counter[str]()
    end = run(whole, settings, times=times)
    if end not in (0, _FALLS):
        print(whole.with_suffix(".log").read_text(encoding="utf-8"), file=sys.stderr)
        return 1
    print(
        "undisturbed, s of processor time: " + ", ".join(f"{k} {v:.1f}" for k, v in times.items()), flush=True
    )
    kills, ways, runs, failed = Counter[str](), Counter[str](), 0, 0
    while kills.total() < asked.kills:
        runs += 1
        out, places = place / f"out{runs}" / NAME, list(times)
        at, ended = 0, None
        while ended is None:
            at += chance.randrange(2)
            if at == len(places) or kills.total() == asked.kills:
                ended = run(out, settings)
                break
            moment = chance.uniform(0.0, 1.0) * times[places[at]]
            how = chance.choice(_SIGNALS)
            ended, reached = disturbed(out, settings, set(places[at:]), moment, how)
            if (ended == _STOPPED and how is signal.SIGINT) or ended == -how:
                ended = None
            if ended is None:
                kills[reached] += 1
                ways[how.name] += 1
                at = max(at, places.index(reached)) if reached in places else at
                print(f"{kills.total()} kills, the last by {how.name} in {reached}", flush=True)
        wrong = [] if ended == end else [f"status {ended} instead of {end}"]
        wrong += differences(out, whole)
        if "Traceback" in out.with_suffix(".log").read_text(encoding="utf-8"):
            wrong.append("a traceback")
        failed += bool(wrong)
        print(f"run {runs}: {'; '.join(wrong) or 'the same bytes'}", flush=True)
    print(", ".join(f"{count} in {name}" for name, count in sorted(kills.items())))
    told = ", ".join(f"{count} {name}" for name, count in sorted(ways.items()))
    print(
        f"{kills.total()} kills ({told}) of {runs} runs, {failed} of which ended otherwise: {'FAIL' if failed else 'pass'}"
    )
    return 1 if failed else 0


def run(folder: Path, settings: list[str], *, times: Counter[str] | None = None) -> int:
    """Runs the design to its end and returns its status; adds the processor time of each stage to `times`."""
    job, before = begin(folder, settings), 0.0
    while True:
        now = stage_of(folder)
        ended, status = os.waitpid(job, os.WNOHANG)
        if ended:
            return os.waitstatus_to_exitcode(status)
        spent = processor_time(job)
        if times is not None:
            times[now] += spent - before
        before = spent
        time.sleep(_LOOK)


def disturbed(
    folder: Path, settings: list[str], places: set[str], moment: float, how: signal.Signals
) -> tuple[int, str]:
    """Runs the design until it has been in one of the stages for so many seconds of processor time, and sends
    it the signal: how it ended (a signal as a negative number), and the stage."""
    job, since = begin(folder, settings), None
    while True:
        now = stage_of(folder)
        ended, status = os.waitpid(job, os.WNOHANG)
        if ended:
            return os.waitstatus_to_exitcode(status), now
        spent = processor_time(job)
        if since is None and now in places:
            since = spent
        if since is not None and spent - since >= moment:
            os.kill(job, how)
            return ended_within(job, _LONGEST), stage_of(folder)
        time.sleep(_LOOK)


def ended_within(job: int, longest: float) -> int:
    """How a process ends; killed where that takes longer, which is told as status 1."""
    for _ in range(round(longest / _LOOK)):
        ended, status = os.waitpid(job, os.WNOHANG)
        if ended:
            return os.waitstatus_to_exitcode(status)
        time.sleep(_LOOK)
    os.kill(job, signal.SIGKILL)
    os.waitpid(job, 0)
    return 1


def begin(folder: Path, settings: list[str]) -> int:
    """The command in a process of its own, whose output goes beside the folder; the process."""
    import shellform.__main__
    import shellform.cli.design
    import shellform.output.page.report
    import shellform.run.documents
    import shellform.run.figures
    import shellform.run.optimising

    sys.stdout.flush()
    folder.parent.mkdir(parents=True, exist_ok=True)
    job = os.fork()
    if job:
        return job
    told = os.open(folder.with_suffix(".log"), os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    os.dup2(told, 1)
    os.dup2(told, 2)
    signal.signal(signal.SIGINT, signal.default_int_handler)  # which a shell's background job ignores
    sys.argv = ["shellform", "design", str(CASE), "--output", str(folder)]
    sys.argv += [word for each in settings for word in ("--set", each)]
    status: object = 1
    try:
        shellform.__main__.main()
        status = 0
    except SystemExit as end:
        status = end.code
    except BaseException:
        sys.excepthook(*sys.exc_info())
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status if isinstance(status, int) else 0 if status is None else 1)


def processor_time(job: int) -> float:
    """Of a process, s."""
    words = Path(f"/proc/{job}/stat").read_text().rsplit(")", 1)[1].split()
    return _TICK * (int(words[11]) + int(words[12]))


def stage_of(folder: Path) -> str:
    """The stage that is under way in a folder; of the optimiser's, its phase too."""
    from shellform.arrays import read_arrays
    from shellform.records.stages import STAGES, read_stages

    done = read_stages(folder).keys
    stage = next((each for each in STAGES if each not in done), STAGES[-1])
    if stage != "optimise":
        return stage
    try:
        told = json.loads(str(read_arrays(folder / CHECKPOINT)["told"]))
    except InputError:  # none yet, or none any more
        begun = (folder / "history.csv").exists()
        return "optimise, after the search" if begun else "optimise, before the search"
    if (folder / "history.csv").exists():
        return "optimise, after the search"
    return f"optimise, phase {told['numbers']['phase']}"


def differences(out: Path, whole: Path) -> list[str]:
    """What a folder has otherwise than another, but for seconds."""
    found = []
    one, two = (
        {file.relative_to(each) for file in each.rglob("*") if file.is_file()} for each in (out, whole)
    )
    found += [f"only undisturbed: {name}" for name in sorted(two - one)]
    found += [f"{'torn' if is_partial(name) else 'only disturbed'}: {name}" for name in sorted(one - two)]
    found += [
        f"other bytes: {name}"
        for name in sorted(one & two)
        if str(name) not in _UNLIKE and timeless(out / name) != timeless(whole / name)
    ]
    return found


def timeless(file: Path) -> bytes:
    """A file's bytes without what was measured on the clock."""
    data = file.read_bytes()
    if file.name == "summary.json":
        told = json.loads(data)
        del told["seconds"]
        return json.dumps(told).encode()
    if file.name == "history.csv":
        return b"\n".join(line.rsplit(b",", 1)[0] for line in data.splitlines())
    if file.name == "report.html":
        data = re.sub(rb"<h3>Time</h3>.*?</table>", b"", data, flags=re.DOTALL)
        return re.sub(rb'"seconds": ?(\{[^}]*\}|\[[^]]*\]|[-+.\de]+)', b"", data)
    return data


if __name__ == "__main__":
    sys.exit(main())
