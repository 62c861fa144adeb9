"""Scripts that open a run in other programs: Blender's Python, and a Python component of Grasshopper.

They stand alone: the standard library reads what the run folder promises (summary.json, net.json, the arrays
of states/NAME-LOAD.vtp), the program's own library draws it. So they go on working where shellform isn't
installed. The texts stand in `readers_of_runs/`: what both share, and the beginning and the end of each.
"""

from __future__ import annotations

from importlib import resources
from pathlib import Path

from shellform.written import write_text

PROGRAMS = ("blender", "grasshopper")


def write_readers(folder: str | Path) -> list[Path]:
    """Writes blender.py and grasshopper.py; returns the files. Raises InputError where they can't be
    written."""
    files = [Path(folder) / f"{program}.py" for program in PROGRAMS]
    for file, program in zip(files, PROGRAMS, strict=True):
        write_text(file, reader(program), ".py")
    return files


def reader(program: str) -> str:
    """The script for one of `PROGRAMS`."""
    return "".join(_part(name) for name in (program, "run", f"{program}_end"))


def _part(name: str) -> str:
    place = resources.files("shellform.output.exchange").joinpath("readers_of_runs", f"{name}.py.txt")
    return place.read_text(encoding="utf-8")
