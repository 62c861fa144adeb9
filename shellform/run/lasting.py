"""Whether what a stage left in the run folder is still there: what somebody has deleted is made again. And
what shows a design that is made anew is taken away: nobody is to build by drawings of another one.

Files that a stage leaves only now and then aren't asked for: models that some designs have none of, maps of
what wasn't found.
"""

from __future__ import annotations

from pathlib import Path

from shellform.records import history
from shellform.records.stages import STAGES, StagesDone
from shellform.records.summary import Summary
from shellform.run.design_files import design_file
from shellform.run.pages import FILE as PAGE
from shellform.run.sketch import PICTURE

_BEFORE = ("unbraced", "initial")  # designs of the stage "initial"
_SHEETS = ("grid", "cables", "supports", "elevations", "rods")
_TABLES = ("rods", "bars", "splices", "marks", "cables", "supports", "survey")
_NET_MAPS = ("net-distance", "net-curvature", "net-skew", "net-springs")
_MAPS = ("deviations", "objective", "constraints")
_NOW_AND_THEN = ("edge_beams", "shear_blocks")  # tables
_SCHEDULES = (
    *(f"schedules/{name}.csv" for name in _TABLES),
    "schedules/notes.txt",
    "schedules/schedules.xlsx",
)
_DOCUMENTS = (
    *(f"drawings/{name}{ending}" for name in _SHEETS for ending in (".dxf", ".pdf")),
    *_SCHEDULES,
    *(
        f"models/{name}"
        for name in ("gridshell.vtu", "gridshell.3dm", "gridshell.glb", "blender.py", "grasshopper.py")
    ),
)


def lasting(folder: Path, done: StagesDone, summary: Summary) -> StagesDone:
    """The stages that are done, up to the first of which a file is missing."""
    for stage in done.keys:
        if not all((folder / name).is_file() for name in _files(stage, summary)):
            return done.before(stage)
    return done


def take_away(folder: Path, stage: str) -> None:
    """Takes away what shows what a `stage` and those after it will find anew, the page first, but for
    pictures of designs, which go with these. What was told on site stays."""
    at, gone = STAGES.index(stage), [folder / PAGE]
    if at <= STAGES.index("net"):
        gone += folder.glob("figures/net-*")
    if at <= STAGES.index("optimise"):
        gone += [folder / f"figures/{name}.png" for name in _MAPS]
    if at <= STAGES.index("safety"):
        gone.append(folder / "figures/failure.png")
    if at <= STAGES.index("documents"):
        gone += [*folder.glob("drawings/*"), *folder.glob("models/*")]
        gone += [folder / name for name in _SCHEDULES]
        gone += [folder / f"schedules/{name}.csv" for name in _NOW_AND_THEN]
    for file in gone:
        if file.is_file():
            file.unlink()


def _files(stage: str, summary: Summary) -> tuple[str, ...]:
    """What a stage leaves in any case."""
    own = [name for name in summary.designs if (name in _BEFORE) == (stage == "initial")]
    designs = tuple(file for name in own for file in _of_design(name, summary))
    drawn = [name for name, row in summary.designs.items() if any(each.stands for each in row.loads.values())]
    named = {
        "surface": ("surface.npz",),
        "net": ("net.npz", "net.json"),
        "initial": designs,
        "optimise": (history.FILE, *designs),
        "safety": tuple(f"designs/{name}-drawn.json" for name in drawn),
        "figures": (PICTURE,) if summary.sketch else _pictures(summary),
        "documents": _DOCUMENTS,
        "report": (PAGE,),
    }
    return named[stage]


def _of_design(name: str, summary: Summary) -> tuple[str, ...]:
    """A design, its model and its states."""
    states = (f"states/{name}-{load}.vtp" for load in summary.designs[name].loads)
    return (design_file(name), f"designs/{name}.json", *states)


def _pictures(summary: Summary) -> tuple[str, ...]:
    maps = [f"{name}-{load}" for name, design in summary.designs.items() for load in design.loads]
    return tuple(f"figures/{name}.png" for name in (*_NET_MAPS, *_MAPS, *maps))
