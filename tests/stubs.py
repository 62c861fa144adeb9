"""A small dome's case, and work that takes no time, for tests of the engine."""

import os
import signal
import time
from pathlib import Path
from types import SimpleNamespace

from shellform.study.jobs import Overtime, ended_where_it_hangs
from shellform.study.outcome import Outcome, Status, flat
from shellform.written import write_text

ROOT = Path(__file__).parent.parent
CASE = f"""
[surface]
file = "{ROOT / "surfaces/dome.py"}"
size = 0.03
[net]
spacing = 0.15
angle = 45
elements = 2
[rod]
young = 40e9
strength = 255e6
radius = 0.001
[joint]
axial = 7.15e4
torsion = 7.38e-4
bending = 7.85e-4
gap = 0.002
[cable]
stiffness = 187.0
force_max = 20.0
[load]
force = 2.0
[optimise]
misfit_rms_additional = 0.005
evaluations = 3
polish = 0
"""


class Known(SimpleNamespace):
    """What is known of a record; like one, it equals itself only."""

    __eq__ = object.__eq__
    __hash__ = object.__hash__


def study_file(folder, text):
    """A study of the small dome in a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "dome.toml").write_text(CASE, encoding="utf-8")
    file = folder / "study.toml"
    file.write_text('case = "dome.toml"\n' + text, encoding="utf-8")
    return file


def quick(job, before=None):
    """In place of the stages: numbers that follow from the case, and a count of its calls in the folder."""
    folder = Path(job.folder)
    folder.mkdir(parents=True, exist_ok=True)
    write_text(folder / "calls", str(int(read_json_number(folder / "calls")) + 1))
    case = job.case
    spacing, stiffness = case.net.spacing, case.cable.stiffness
    if spacing > 0.2:
        return outcome(job, "no result", f"it can't be built in {folder}".replace(str(folder), "RUN"))
    best = {
        "cables": round(40 * spacing / 0.1 + 0.02 * stiffness),
        "rod_radius": case.rod.radius,
        "loads": {"design": {"deviation_rms": 1e-4 / spacing + 1e-7 * stiffness, "rod_utilisation_max": 0.5}},
    }
    return outcome(job, "done", "", {"designs": {"initial": best}, "net": {"spacing": spacing, "notes": []}})


def slow(job, before=None):
    """As `quick`, in a twentieth of a second."""
    time.sleep(0.05)
    return quick(job, before)


def deadly(job, before=None):
    """As `quick`; one design kills its worker each time, another the first time."""
    first = Path(job.folder) / "first"
    if job.case.cable.stiffness == 666.0:
        os.kill(os.getpid(), signal.SIGKILL)
    if job.case.cable.stiffness == 333.0 and not first.exists():
        first.parent.mkdir(parents=True, exist_ok=True)
        first.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return quick(job, before)


def stuck(job, before=None):
    """As `quick`; one design hangs within a step."""
    if job.case.cable.stiffness != 666.0:
        return quick(job, before)
    try:
        with ended_where_it_hangs(Path(job.folder), 0.1):
            time.sleep(600.0)
    except Overtime as error:
        return Outcome(job.key, Status.OVERTIME, str(error))


def read_json_number(file):
    return file.read_text() if file.exists() else "0"


def outcome(job, status, reason, summary=None):
    seconds = {"here": 0.01, "total": time.time() % 1}
    return Outcome(job.key, Status(status), reason, flat(summary or {}), seconds, "here")
