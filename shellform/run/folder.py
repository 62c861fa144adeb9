"""The run folder (documentation/reference/run.md): what the stages leave in it, and how it is read back.

Every file is written whole or not at all. `read_run` gives the nouns that pictures, drawings and the page are
made from. Whoever makes a run is `alone` in its folder, and no symbolic link in a folder is followed: it may
come from somebody else. Who only adds to it needs no lock (render, report, what is told on site): what they
read and what they write are whole files, and pictures may be drawn while the run goes on.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import shellform
from shellform.arrays import Reals, Record, read_arrays
from shellform.case.build_gridshell import gridshell, rounding_catalogue
from shellform.case.case import Case, load_case
from shellform.errors import InputError
from shellform.gridshell.catalogue import named
from shellform.gridshell.gridshell import Design, Gridshell, Rod
from shellform.net.net import Net
from shellform.net.saved import load_net
from shellform.records import stages
from shellform.records.checks import BUILT
from shellform.records.summary import Summary, read_summary, summary_version
from shellform.run.design_files import design_file, read_design, undamaged
from shellform.structure.elements.state import State
from shellform.surface.shape.target import Surface
from shellform.written import clear, make_folder, refusal, write_arrays

LOCK, BUILDABLE = "lock", "buildable"
DESIGNS = ("unbraced", "initial", "unloaded", *BUILT)
WRITTEN = (
    "case.toml", "summary.json", "stages.json", "history.csv", "surface.npz", "net.npz", "net.json", "designs", "states", "figures",
    "drawings", "schedules", "models", BUILDABLE, "optimise.npz", "report.html", "log.txt", "profile.json", "catalogues", LOCK,
)  # fmt: skip

# folders that files stand in
_PARTS = ("", "designs", "states", "figures", "drawings", "schedules", "models", BUILDABLE, "catalogues")


class NoRunFolder(InputError):
    """A folder that shellform design didn't make, or in which it was stopped before its first stage."""


@dataclass(frozen=True, eq=False)
class Run(Record):
    """A run read back: its `designs` by name, their `states` by design and load case, the `loads` (n, 6) by
    name, and the `summary`.
    """

    folder: Path
    case: Case
    surface: Surface
    shell: Gridshell
    loads: Mapping[str, Reals]
    designs: Mapping[str, Design]
    states: Mapping[str, Mapping[str, State]]
    summary: Summary

    def __repr__(self) -> str:
        return f"Run({str(self.folder)!r}, {self.shell!r}, designs {', '.join(self.designs)})"

    @property
    def net(self) -> Net:
        """The shell's net."""
        return self.shell.net

    @property
    def best(self) -> str:
        """The name of the design to build: the verdict's; without one, the last made of the polished, the
        rounded, the optimised and the initial one.
        """
        judged = self.summary.verdict
        if judged is not None and judged.design in self.designs:
            return judged.design
        return [name for name in DESIGNS if name in self.designs and name != "unloaded"][-1]

    def shell_of(self, name: str) -> Gridshell:
        """The shell with the rods of a design: those of a rounded one come from the catalogue."""
        record = self.summary.designs.get(name)
        section = None if record is None else record.section
        catalogue = rounding_catalogue(self.case)
        if section is None or catalogue is None:
            return self.shell
        return replace(self.shell, rod=Rod(named(catalogue, section)))


def figures_folder(run: Run, folder: Path | None) -> Path:
    """Where a run's pictures go: another `folder`, or figures/ of the run; made where it isn't there."""
    return make_folder(folder or run.folder / "figures")


def read_run(folder: str | Path) -> Run:
    """A run with at least one design, finished or not: what the summary tells of is there.

    Raises InputError for another folder, a damaged one, one without designs, one of a newer version, and one
    with symbolic links.
    """
    place = Path(folder)
    refuse_links(place)
    if not (place / "case.toml").is_file():
        raise NoRunFolder("is no run folder", where=str(place), remedy="Make one with shellform design.")
    summary = read_summary(place)
    ready = [name for name in DESIGNS if name in summary.designs]
    if not ready:
        raise InputError(
            "the run has no designs yet",
            where=str(place),
            remedy="Run shellform design on it again: it goes on.",
        )
    for name in ("surface.npz", "net.npz", *(design_file(each) for each in ready)):
        if not (place / name).is_file():
            raise InputError(
                "isn't there: the run is unfinished",
                where=str(place / name),
                remedy="Run shellform design on it again: it goes on.",
            )
    case = load_case(place / "case.toml")
    surface = load_surface(place / "surface.npz")
    with undamaged(place / "net.npz"):
        shell, loads = gridshell(case, load_net(place / "net.npz"), surface)
    read = {name: read_design(place, name, shell, list(loads)) for name in ready}
    return Run(
        folder=place,
        case=case,
        surface=surface,
        shell=shell,
        loads=loads,
        designs={name: design for name, (design, _) in read.items()},
        states={name: states for name, (_, states) in read.items()},
        summary=summary,
    )


@contextlib.contextmanager
def alone(place: Path, *, wait: bool = False) -> Iterator[None]:
    """Holds the lock of a folder, which is made and cleared of what killed writers left; the lock ends with
    its process, whatever becomes of that.

    Raises InputError where another process holds it (or waits until it doesn't), and where the folder can't
    be written.
    """
    make_folder(place)
    try:
        held = os.open(place / LOCK, os.O_CREAT | os.O_RDWR | getattr(os, "O_NOFOLLOW", 0), 0o666)
    except OSError as error:
        raise refusal(place / LOCK, error) from error
    try:
        _lock(held, place, wait)
        for part in _PARTS:
            clear(place / part)
        yield
    finally:
        os.close(held)


def _lock(held: int, place: Path, wait: bool) -> None:
    try:
        import fcntl
    except ImportError:  # no such locks on Windows
        return
    try:
        fcntl.flock(held, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
    except BlockingIOError as error:
        raise InputError(
            "another shellform is at work in it",
            where=str(place),
            remedy="Wait until it has ended, or choose another --output.",
        ) from error
    except OSError as error:
        raise refusal(place / LOCK, error) from error


def refuse_links(place: Path, names: Sequence[str] = WRITTEN) -> None:
    """Raises InputError where one of these `names` in a folder, left out those that a run writes, is a
    symbolic link, which could lead a reader or writer anywhere."""
    for name in names:
        if (place / name).is_symlink():
            raise InputError(
                "is a symbolic link, which isn't followed",
                where=str(place / name),
                remedy="Delete it, or put in its place what it leads to.",
            )


def refuse_overwriting(place: Path) -> None:
    """Raises InputError for a folder in which files that shellform didn't write would be overwritten, or
    those of a newer version, or where links would lead.
    """
    if not place.exists():
        return
    if not place.is_dir():
        raise InputError("is a file, not a folder", where=str(place), remedy="Choose another --output.")
    refuse_links(place)
    version = summary_version(place)
    if version:
        if _number(version) > _number(shellform.__version__):
            raise InputError(
                "holds a run of a newer shellform",
                where=str(place),
                value=version,
                remedy="Install that version, choose another --output, or let --fresh overwrite it.",
            )
        return
    there = [] if (place / stages.FILE).is_file() else _strangers(place)
    if there:
        raise NoRunFolder(
            f"is no run folder, and {', '.join(there)} in it would be overwritten",
            where=str(place),
            remedy="Choose another --output, or let --fresh overwrite it.",
        )


def _strangers(place: Path) -> list[str]:
    """What stands in a folder under the names that a run writes; a lock may stem from one that was
    refused."""
    return [name for name in WRITTEN if name != LOCK and (place / name).exists()]


def _number(version: str) -> tuple[int, ...]:
    return tuple(int(part) for part in version.split(".") if part.isdigit())


def save_surface(path: Path, surface: Surface) -> None:
    """Writes the surface so that `load_surface` gives the same."""
    write_arrays(path, vertices=surface.vertices, triangles=surface.triangles, normals=surface.normals)


def load_surface(path: Path, source: str = "") -> Surface:
    """A saved surface. Raises InputError where the file is missing or damaged."""
    data = read_arrays(path)
    with undamaged(path):
        return Surface(data["vertices"], data["triangles"], data["normals"], source)
