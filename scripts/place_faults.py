"""A design and a study in places that are against them: two at once on a folder, a disk that is full, folders
that can't be written, no home, a terminal that knows ASCII alone, and 600 MB of memory.

    scripts/place_faults.py [--folder DIR] [--only WORD …] [--set ENTRY=VALUE …]

Passes when nothing ends in a traceback or with another status than 0, 2, 3 and, once the place is as it
should be, the same command gives the same bytes as a run that was never disturbed (but for seconds). Disks
and folders are mounted in a name space of their own, which needs Linux and `unshare` of util-linux, and no
rights.
"""

from __future__ import annotations

import argparse
import os
import resource
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))
from scripts.design_faults import CASE, NAME, SETTINGS, differences  # noqa: E402
from tests.stubs import study_file  # noqa: E402

STUDY = """
until = "initial"
keep = "all"
[vary]
net.spacing = [0.12, 0.13]
cable.stiffness = [100, 400]
"""
SHARES = (0.02, 0.3, 0.7, 0.95)  # of what a run takes on the disk
MEMORY = 600_000_000  # bytes
_LONGEST = 1800.0  # s
_STATUSES = (0, 2, 3)
_UNLIKE = (
    "seconds.csv",
    "results.jsonl",
    "lock",
    "log.txt",
)  # of a study: times, and the order in which designs end
_TOLD = "TRACEBACK"


@dataclass(frozen=True)
class Job:
    """A command by `name` whose `words` follow `shellform`; the `whole` folder is what it gives
    undisturbed."""

    name: str
    words: tuple[str, ...]
    whole: Path

    def command(self, folder: Path | str) -> list[str]:
        """The command line for a folder."""
        return [sys.executable, "-m", "shellform", *self.words, "--output", str(folder)]


def main() -> int:
    """Runs the trials; status 0 where all pass."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--folder", type=Path, default=None)
    parser.add_argument("--only", nargs="*", default=[], help="words that are in the names of trials")
    parser.add_argument("--set", action="append", default=[], help="beside the settings of the small vault")
    asked = parser.parse_args()
    place = (asked.folder or Path(tempfile.mkdtemp(prefix="place_faults"))).resolve()
    settings = [word for each in [*SETTINGS, *asked.set] for word in ("--set", each)]
    study = study_file(place / "case", STUDY)
    jobs = [
        Job("design", ("design", str(CASE), *settings), place / "whole" / "design" / NAME),
        Job("study", ("study", str(study), "--workers", "2"), place / "whole" / "study" / NAME),
    ]
    failed = tried = 0
    for job in jobs:
        trials = {f"{job.name}, {name}": trial for name, trial in TRIALS.items()}
        wanted = {
            name: trial
            for name, trial in trials.items()
            if not asked.only or any(word in name for word in asked.only)
        }
        if wanted and not job.whole.exists():
            status = ended(job, job.whole, place / "whole" / f"{job.name}.log")
            if status not in _STATUSES:
                print(f"FAIL: {job.name} doesn't end well undisturbed: {status}")
                return 1
        for name, trial in wanted.items():
            folder = place / name.replace(", ", "-").replace(" ", "_") / NAME
            shutil.rmtree(folder.parent, ignore_errors=True)
            folder.parent.mkdir(parents=True)
            wrong = trial(job, folder)
            tried, failed = tried + 1, failed + bool(wrong)
            print(f"{name}: {'; '.join(wrong) or 'pass'}", flush=True)
    print(f"{tried} trials, {failed} failed: {'FAIL' if failed else 'pass'}")
    return 1 if failed else 0


def ended(
    job: Job,
    folder: Path,
    log: Path,
    *,
    without: tuple[str, ...] = (),
    given: Mapping[str, str] | None = None,
    limit: Callable[[], None] | None = None,
) -> int | str:
    """The status with which the job ends on a folder, or what was wrong with it; its words are added to
    `log`."""
    return _ended(job.command(folder), log, _environment(without, given or {}), limit)


def _environment(without: tuple[str, ...], given: Mapping[str, str]) -> dict[str, str]:
    kept = {name: value for name, value in os.environ.items() if name not in without}
    return {**kept, "PYTHONPATH": str(ROOT), **given}


def _ended(
    command: list[str], log: Path, environment: Mapping[str, str], limit: Callable[[], None] | None = None
) -> int | str:
    log.parent.mkdir(parents=True, exist_ok=True)
    before = log.stat().st_size if log.exists() else 0
    with open(log, "ab") as told:
        try:
            status: int | str = subprocess.run(
                command,
                stdout=told,
                stderr=told,
                env=environment,
                timeout=_LONGEST,
                check=False,
                preexec_fn=limit,
            ).returncode
        except subprocess.TimeoutExpired:
            return f"no end after {_LONGEST:g} s"
    said = log.read_bytes()[before:].decode(errors="replace")
    return _TOLD if "Traceback" in said else status


def unlike(job: Job, folder: Path) -> list[str]:
    """How a folder differs from the undisturbed one."""
    found = differences(folder, job.whole)
    return [
        each for each in found if job.name == "design" or Path(each.partition(": ")[2]).name not in _UNLIKE
    ]


def two_at_once(job: Job, folder: Path) -> list[str]:
    """The second is refused, the first goes on."""
    log, other = folder.with_suffix(".log"), folder.with_suffix(".other.log")
    with open(log, "ab") as told:
        first = subprocess.Popen(job.command(folder), stdout=told, stderr=told, env=_environment((), {}))
    statuses: list[int | str] = []
    while first.poll() is None:
        statuses.append(ended(job, folder, other))
    wrong = [] if first.returncode in _STATUSES else [f"the first ended with {first.returncode}"]
    wrong += ["the first told a traceback"] if b"Traceback" in log.read_bytes() else []
    wrong += [f"the second ended with {each}" for each in statuses if each not in _STATUSES]
    wrong += [] if 2 in (*statuses, first.returncode) else ["none was refused"]
    return wrong + unlike(job, folder)


def full_disk(job: Job, folder: Path) -> list[str]:
    """The same command goes on once there is room."""
    size = sum(file.stat().st_size for file in job.whole.rglob("*") if file.is_file())
    wrong = []
    for share in SHARES:
        disk, log = folder.parent / f"disk{share:g}", folder.parent / f"{share:g}.log"
        disk.mkdir()
        kept = folder.parent / f"kept{share:g}" / NAME
        kept.parent.mkdir()
        run = shlex.join(job.command(disk / NAME))
        script = (
            f"mount -t tmpfs -o size={max(16384, int(share * size))} none {disk} || exit 99\n{run}\necho $? > {kept.parent}/first\n"
            f"mount -o remount,size={10 * size + 10**7} {disk} || exit 99\n{run}\nend=$?\ncp -a {disk}/{NAME} {kept}\nexit $end\n"
        )
        status = _ended(_within(script), log, _environment((), {}))
        first = (kept.parent / "first").read_text().strip() if (kept.parent / "first").exists() else "none"
        if status not in _STATUSES or first not in ("2", "3"):
            wrong.append(f"with room for {share:.0%} it ended with {first}, then {status}")
        else:
            wrong += [f"with room for {share:.0%}: {each}" for each in unlike(job, kept)]
    return wrong


def read_only(job: Job, folder: Path) -> list[str]:
    """A new folder and one that holds all are refused in a sentence, or found to be done."""
    wrong = []
    for what in ("nothing", "all"):
        disk, log = folder.parent / what, folder.parent / f"{what}.log"
        disk.mkdir()
        if what == "all":
            shutil.copytree(job.whole, disk / NAME)
        script = (
            f"mount --bind {disk} {disk} || exit 99\nmount -o remount,ro,bind {disk} || exit 99\n"
            + shlex.join(job.command(disk / NAME))
        )
        status = _ended(_within(script), log, _environment((), {}))
        wrong += (
            [] if status in (2, 3) or (what == "all" and status == 0) else [f"with {what} there: {status}"]
        )
    return wrong


def _within(script: str) -> list[str]:
    """The shell script in a name space of its own, where it may mount."""
    return ["unshare", "--user", "--map-root-user", "--mount", "sh", "-c", script]


def no_home(job: Job, folder: Path) -> list[str]:
    """Neither a home, nor a place to keep compiled loops or pictures' settings in."""
    names = (
        "HOME",
        "XDG_CACHE_HOME",
        "XDG_CONFIG_HOME",
        "NUMBA_CACHE_DIR",
        "MPLCONFIGDIR",
        "USER",
        "LOGNAME",
    )
    status = ended(job, folder, folder.with_suffix(".log"), without=names)
    nowhere = folder.parent / "nowhere" / NAME
    other = ended(job, nowhere, folder.parent / "nowhere.log", without=names, given={"HOME": "/none/such"})
    wrong = [f"ended with {each}" for each in (status, other) if each not in _STATUSES]
    return wrong + unlike(job, folder) + unlike(job, nowhere)


def ascii_terminal(job: Job, folder: Path) -> list[str]:
    """Without UTF-8 anywhere."""
    given = {"LC_ALL": "C", "LANG": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    status = ended(job, folder, folder.with_suffix(".log"), without=("PYTHONIOENCODING",), given=given)
    return ([] if status in _STATUSES else [f"ended with {status}"]) + unlike(job, folder)


def little_memory(job: Job, folder: Path) -> list[str]:
    """600 MB of addresses, then of data: refused in a sentence or done; without the limit, the same bytes."""
    wrong = []
    for kind in (resource.RLIMIT_AS, resource.RLIMIT_DATA):

        def limit(kind: int = kind) -> None:
            resource.setrlimit(kind, (MEMORY, MEMORY))

        status = ended(job, folder, folder.with_suffix(".log"), limit=limit)
        wrong += [] if status in _STATUSES else [f"ended with {status}"]
    status = ended(job, folder, folder.with_suffix(".log"))
    wrong += [] if status in _STATUSES else [f"ended with {status} afterwards"]
    return wrong + unlike(job, folder)


TRIALS: dict[str, Callable[[Job, Path], list[str]]] = {
    "two at once": two_at_once,
    "full disk": full_disk,
    "read only": read_only,
    "no home": no_home,
    "ASCII": ascii_terminal,
    "600 MB": little_memory,
}


if __name__ == "__main__":
    sys.exit(main())
