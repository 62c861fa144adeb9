"""A run's maps, drawn by a process of its own while the stage `safety` loads drawn structures.

VTK doesn't let go of the interpreter while it draws, so that a thread would hold up the others. The child
reads the run's folder and tells what it has to tell as lines of JSON. It stands in a session of its own:
Ctrl-C goes to its parent alone, which ends it. Whatever becomes of it, nothing hangs on it: maps that it
didn't draw, or of another design than the one that turns out to be built, are drawn in their own stage.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from shellform.processes import end_with
from shellform.records.progress import Event, Kind, Report, unheard
from shellform.run.figures import draw_everything, draw_maps
from shellform.run.folder import Run, read_run
from shellform.structure.elements.threads import cores


@dataclass(frozen=True)
class DrawnMaps:
    """Maps that were drawn for a run whose design to build is `best`; whether all were (`complete`), which
    without OpenGL they aren't, and the `notes` on them."""

    best: str
    complete: bool
    notes: tuple[str, ...]


class MapsBeside:
    """The child while it draws, or None on a single core, which another process would only hold up."""

    def __init__(self, child: subprocess.Popen[bytes] | None) -> None:
        self._child = child

    def wait(self) -> DrawnMaps | None:
        """What it has drawn, after its end; None where it came to no end of its own."""
        if self._child is None:
            return None
        told, _ = self._child.communicate()
        if self._child.returncode:
            return None
        answer = json.loads(told)
        return DrawnMaps(answer["best"], answer["complete"], tuple(answer["notes"]))


@contextmanager
def maps_beside(folder: Path) -> Iterator[MapsBeside]:
    """Has the maps of the run in a folder drawn while the work within is done; what isn't by its end is given
    up."""
    if cores() < 2:
        yield MapsBeside(None)
        return
    package = str(Path(__file__).parents[2])
    path = os.pathsep.join([package, *filter(None, [os.environ.get("PYTHONPATH")])])
    with subprocess.Popen(
        [sys.executable, "-P", "-m", "shellform.run.pictures_beside", str(folder), str(os.getpid())],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "PYTHONPATH": path},
        start_new_session=True,
    ) as child:
        try:
            yield MapsBeside(child)
        finally:
            child.kill()


def draw_all_but(maps: DrawnMaps | None, run: Run, *, report: Report = unheard) -> bool:
    """All pictures of a run (figures.py) but the `maps` that are there already, if they are of the design
    that is to be built; whether all could be drawn."""
    if maps is None or maps.best != run.best:
        return draw_everything(run, report=report)
    for note in maps.notes:
        report(Event("figures", note, Kind.NOTE))
    return draw_everything(run, mapped=maps.complete, report=report)


def _serve(folder: str, parent: str) -> None:
    """The child's whole life."""
    end_with(int(parent))
    told = os.dup(1)
    with open(os.devnull, "wb") as nowhere:  # libraries write to standard output past Python
        os.dup2(nowhere.fileno(), 1)
    notes: list[str] = []

    def note(event: Event) -> None:
        if event.kind is Kind.NOTE:
            notes.append(event.text)

    run = read_run(folder)
    complete = draw_maps(run, report=note)
    with os.fdopen(told, "w", encoding="utf-8") as answer:
        json.dump({"best": run.best, "complete": complete, "notes": notes}, answer)


if __name__ == "__main__":
    _serve(*sys.argv[1:])
