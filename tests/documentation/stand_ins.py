"""What a page's reader has and the tests haven't: finished runs, scans, a cluster."""

import shutil
import socket
import subprocess
import time
from pathlib import Path

import numpy as np

import shellform as sf
from shellform.case.examples import lay_example
from shellform.run.folder import read_run
from shellform.run.pages import write_report
from tests.run.small_run import begin, finish

ROOT = Path(__file__).parent.parent.parent
TUTORIAL = ROOT / "shellform/documentation/tutorials/study.md"


class StandIns:
    """Those of one page in a `place`; `end` stops what was begun."""

    def __init__(self, page, place):
        self.page, self.place, self.begun = page, place, []
        self.made, self.port = False, _free_port()

    def put(self, text, here):
        """Makes what the page's blocks ask for, once, and returns a block's text with its names for it."""
        if not self.made:
            _MADE[self.page](here)
            self.made = True
        for theirs, ours in {
            "RUN": "run",
            "tcp://first-machine:8786": f"tcp://127.0.0.1:{self.port}",
            "--port 8786": f"--host 127.0.0.1 --port {self.port} --no-dashboard",
            "--nworkers 8": "--nworkers 1 --no-dashboard",
            "/shared/results": "results",
        }.items():
            text = text.replace(theirs, ours)
        return text

    def begin(self, commands, here):
        """Starts each command and leaves it at work."""
        for command in commands:
            with (here / f"background{len(self.begun)}.log").open("w") as log:
                self.begun.append(
                    subprocess.Popen(["bash", "-c", f"exec {command}"], cwd=here, stdout=log, stderr=log)
                )
            time.sleep(3.0)

    def end(self):
        """Stops what was begun."""
        for each in reversed(self.begun):
            each.terminate()
        for each in self.begun:
            each.wait(60)


def _free_port():
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


def tutorial_s_study(here):
    """study.toml of the tutorial, cut to two designs, and its case."""
    from tests.documentation.test_pages import blocks, cut_short

    (study,) = [each.text for each in blocks(TUTORIAL) if each.title]
    (here / "study.toml").write_text(
        cut_short(study).replace("high = 0.95, count = 2", "high = 0.95, count = 1"), encoding="utf-8"
    )
    lay_example("paper", here)


def finished_runs(here):
    """runs/scale_model and runs/scale_model_radius."""
    finish(begin(ROOT, here / "runs/scale_model"))
    shutil.copytree(here / "runs/scale_model", here / "runs/scale_model_radius")
    write_report([here / "runs/scale_model_radius"])


def measured_run(here):
    """run, with scans of its markers without load and under sandbags, and surveys of its crossings."""
    folder = begin(ROOT, here / "run", "load.force=1.0", "net.elements=2")
    finish(folder)
    run, rng = read_run(folder), np.random.default_rng(4)
    nodes = run.shell.net.grid.crossing_nodes[:, 1]
    bags = [(k, -0.3) for k in range(0, len(nodes), 2)]
    _table(here / "markers.csv", "node", [(node,) for node in nodes])
    _table(here / "sandbags.csv", "crossing,fz", bags)
    load = np.zeros_like(run.loads["none"])
    load[nodes[::2], 2] = -0.3
    grid = run.shell.unbraced()
    for name, force in {"scan1": run.loads["none"], "scan2": load}.items():
        state = sf.follow(run.shell, grid, {"one": force}, stay=True)["one"].equilibrium.state
        seen = state.positions[nodes] + 1e-4 * rng.normal(size=(len(nodes), 3))
        _table(here / f"{name}.csv", "x,y,z", 1e3 * rng.permutation(seen))
    state = run.states["optimised"]["none"]
    for name in ("survey1", "survey2"):
        seen = state.positions[nodes] + 1e-4 * rng.normal(size=(len(nodes), 3))
        _table(here / f"{name}.csv", "crossing,x,y,z", [(k, *place) for k, place in enumerate(seen)])
    cables = range(int(run.designs["optimised"].present.sum()))
    _table(here / "groups.csv", "cable,group", [(k, 1 + k % 2) for k in cables])
    _table(here / "props.csv", "crossing", [(k,) for k in range(0, len(nodes), 2)])


def _table(path, head, rows):
    path.write_text("\n".join([head, *(",".join(map(str, row)) for row in rows)]) + "\n", encoding="utf-8")


_MADE = {
    "how-to/cluster.md": tutorial_s_study,
    "how-to/calibrate.md": measured_run,
    "how-to/site.md": measured_run,
    "how-to/pictures.md": finished_runs,
    "reference/run.md": finished_runs,
}
