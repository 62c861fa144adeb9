"""`design --sketch`: a first look at a design, in seconds.

Elements are coarse, evaluations few, nothing is polished, compared or drawn as built, and there is one
picture. So a sketch never holds: its verdict lacks examination. It stands in the run folder under keys of its
own (keys.py), and the full job takes nothing of its designs: their elements are others, and a search that
began among the cables that a sketch has left would never weigh the others again, so that the same case would
give one design after a sketch and another without. A sketch doesn't take a full job's place.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from shellform.case.case import Case
from shellform.errors import InputError
from shellform.records.progress import Event, Report
from shellform.records.summary import FILE as SUMMARY
from shellform.records.summary import Summary, read_summary
from shellform.run.figures import Wish, look_of, panel_of, pictures_possible, titled
from shellform.run.folder import Run
from shellform.run.pages import FILE as PAGE
from shellform.written import make_folder

STAGES_OF_SKETCH = ("surface", "net", "initial", "optimise", "figures")
PICTURE = "figures/sketch.png"
_ELEMENTS = 2  # a segment
_EVALUATIONS = 10  # of designs
_SIZE = (1200, 750)  # pixels


def sketched(case: Case) -> Case:
    """The case as it is sketched."""
    net = case.net.model_copy(update={"elements": min(case.net.elements, _ELEMENTS)})
    few = {"evaluations": min(case.optimise.evaluations, _EVALUATIONS), "polish": 0, "symmetric": False}
    optimise = case.optimise.model_copy(update={**few, "rounded": 0, "unloaded": False})
    cable = case.cable.model_copy(update={"without": False})
    safety = case.safety.model_copy(update={"required": False})  # the search draws no structures
    return case.model_copy(update={"net": net, "optimise": optimise, "cable": cable, "safety": safety})


def refuse_over_full(folder: Path, *, fresh: bool) -> None:
    """Raises InputError for a folder with designs of a full job, and for a damaged summary, of which nobody
    knows, but where it is to be made `fresh`."""
    try:
        summary = read_summary(folder) if (folder / SUMMARY).is_file() else Summary()
    except InputError:
        if not fresh:
            raise
        return
    if summary.designs and not summary.sketch:
        raise InputError(
            "holds a full run, which a sketch would replace",
            where=str(folder),
            remedy="Choose another --output for the sketch.",
        )


def draw_sketch(run: Run, *, report: Report) -> bool:
    """The one picture: the deviation of the last design under the design load. Without OpenGL none, a line
    that says why, and False."""
    from shellform.output.pictures import render

    if not pictures_possible(report):
        return False
    report(Event("figures", f"deviation of {run.best}"))
    panel = panel_of(run, run.best, "design")
    panel = replace(panel, title=f"sketch, {panel.title}")
    file = run.folder / PICTURE
    make_folder(file.parent)
    render.pictures([file], [titled(run, panel)], look_of(run, Wish(size=_SIZE), [panel]))
    return True


def drop_other(folder: Path, *, sketch: bool) -> None:
    """Deletes what would tell of another run than the one that begins: the picture of a sketch where a full
    job takes its place, the page of a run that ended early where a `sketch` does."""
    (folder / (PAGE if sketch else PICTURE)).unlink(missing_ok=True)
