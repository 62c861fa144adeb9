"""A run's maps, drawn by a process of its own while the stage `safety` loads drawn structures.

VTK doesn't let go of the interpreter while it draws, so that a thread would hold up the others. The child
reads the run's folder and answers in JSON. It stands in a session of its own:
Ctrl-C goes to its parent alone, which ends it. Whatever becomes of it, nothing hangs on it: maps that it
didn't draw, or of another design than the one that turns out to be built, are drawn in their own stage.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from shellform.processes import answering, command_of, end_with, surroundings
from shellform.records.progress import Event, Kind, Report, unheard
from shellform.run.figures import draw_everything, draw_maps
from shellform.run.folder import Run, read_run
from shellform.structure.elements.threads import cores, dense_on_one


@dataclass(frozen=True)
class DrawnMaps:
    """Maps that were drawn for a run whose design to build is `best`; whether all were (`complete`), which
    without OpenGL they aren't, and the `notes` on them."""

    best: str
    complete: bool
    notes: tuple[str, ...]


@contextmanager
def maps_beside(folder: Path) -> Iterator[Callable[[], DrawnMaps | None]]:
    """Has the maps of the run in a folder drawn while the work within is done, and yields what waits for
    them: None where they came to no end of their own, and on a single core, which another process would only
    hold up. What isn't drawn by the end of the work is given up."""
    if cores() < 2:
        yield lambda: None
        return
    with subprocess.Popen(
        [*command_of("shellform.run.pictures_beside"), str(folder), str(os.getpid())],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env=surroundings(),
        start_new_session=True,
    ) as child:
        try:
            yield partial(_drawn_by, child)
        finally:
            child.kill()


def _drawn_by(child: subprocess.Popen[bytes]) -> DrawnMaps | None:
    told, _ = child.communicate()
    if child.returncode:
        return None
    answer = json.loads(told)
    return DrawnMaps(answer["best"], answer["complete"], tuple(answer["notes"]))


def draw_all_but(maps: DrawnMaps | None, run: Run, *, report: Report = unheard) -> bool:
    """All pictures of a run (figures.py) but the `maps` that are there already, if they are of the design
    that is to be built; whether all could be drawn."""
    if maps is None or maps.best != run.best:
        return draw_everything(run, report=report)
    for note in maps.notes:
        report(Event("figures", note, Kind.NOTE))
    return draw_everything(run, mapped=maps.complete, report=report)


@dense_on_one()
def _serve(folder: str, parent: str) -> None:
    """The child's whole life."""
    end_with(int(parent))
    told = answering()
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
