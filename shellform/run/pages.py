"""The page of runs: reads the run folders, says what is missing in them, and writes report.html whole or not
at all.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from platform import python_version

import shellform
from shellform.case.build_gridshell import rounding_catalogue
from shellform.errors import InputError
from shellform.gridshell.catalogue import label, rounded_up
from shellform.output.page.embed import KINDS, embed
from shellform.output.page.report import GENERATOR, html
from shellform.output.page.shown_run import ShownRun
from shellform.records.history import read_history
from shellform.records.profile import read_profile
from shellform.records.progress import Event, Report, unheard
from shellform.records.stages import SHOWING, read_stages
from shellform.records.verdict import verdict
from shellform.run.design_files import design_file
from shellform.run.folder import DESIGNS, LOCK, Run, read_run
from shellform.run.judged import broken_off, run_checks
from shellform.run.keys import stage_keys
from shellform.run.scales import colour_limit
from shellform.written import is_partial, write_named, write_text

FILE = "report.html"
_BUDGET = 5_000_000  # bytes of pictures, before they become text, which adds a third: a page stays below 8 MB
_PACKAGES = ("numpy", "scipy", "numba", "cvxopt", "mkl", "gmsh", "nlopt", "pyvista")
_DRAWN = ("objective", "constraints")
_HEAD = 2000  # characters in which a page of ours names its maker


def write_report(
    folders: Sequence[str | Path],
    file: str | Path | None = None,
    *,
    report: Report = unheard,
) -> Path:
    """Writes the page of one run, or of several side by side, and returns its file: `file`, or report.html in
    the one run's folder or, for several, in the present one. Raises InputError for what is no run, and for a
    file that is there and is no page of shellform's."""
    if not folders:
        raise InputError("there is no run to report", where="report", remedy="Name one or more run folders.")
    runs = []
    for folder in folders:
        report(Event("report", f"reading {folder}"))
        runs.append(read_run(folder))
    if file is not None:
        return _written(runs, Path(file), write_named)
    return write_page(runs, (runs[0].folder if len(runs) == 1 else Path()) / FILE)


def write_page(runs: Sequence[Run], file: Path) -> Path:
    """As `write_report`, of runs that are read already."""
    return _written(runs, file, write_text)


def _written(runs: Sequence[Run], file: Path, write: Callable[[Path, str], None]) -> Path:
    _refuse_foreign(file)
    text = html([shown_run(run, _BUDGET // len(runs), page=file) for run in runs], versions())
    write(file, text)
    return file


def shown_run(run: Run, budget: int = _BUDGET, *, page: Path | None = None) -> ShownRun:
    """A run as the `page` (in its folder) takes it, with at most `budget` bytes of pictures; 0: none is
    read."""
    pictures, left = embed(_pictures(run) if budget else [], budget=budget)
    found = run_checks(run)
    return ShownRun(
        title=run.case.title or run.folder.resolve().name,
        place=run.folder.name or str(run.folder),
        shells={name: run.shell_of(name) for name in run.designs},
        surface=run.surface,
        loads=run.loads,
        designs=run.designs,
        states=run.states,
        best=run.best,
        summary=run.summary,
        checks=found,
        verdict=broken_off(verdict(found, run.best), run.summary.failed),
        history=read_history(run.folder),
        settings=(run.folder / "case.toml").read_text(encoding="utf-8-sig"),
        pictures=pictures,
        limit=colour_limit(run),
        notes=[*_notes(run, bool(pictures)), *left],
        files=sorted(
            file.relative_to(run.folder).as_posix()
            for file in run.folder.rglob("*")
            if file.is_file() and file.name != LOCK and not is_partial(file)
        ),
        home="" if page is None else _home(run.folder, page),
        next_size=_next_size(run),
        profile=read_profile(run.folder).of(read_stages(run.folder)),
    )


def _home(folder: Path, page: Path) -> str:
    """The folder's address, relative to the page; "" where the page stands in it."""
    try:
        home = Path(os.path.relpath(folder.resolve(), page.resolve().parent)).as_posix()
    except ValueError:  # another drive
        home = folder.resolve().as_posix()
    return "" if home == "." else f"{home}/"


def _next_size(run: Run) -> str:
    """The size of the case's catalogue that the rods of the design to build would be rounded to."""
    catalogue = rounding_catalogue(run.case)
    if catalogue is None:
        return ""
    try:
        shell, _ = rounded_up(run.shell_of(run.best), run.designs[run.best], catalogue)
    except InputError:  # none is stiff enough
        return ""
    return label(shell.rod.section)


def _notes(run: Run, has_pictures: bool) -> list[str]:
    """What is missing on the page, or to be known."""
    done = _done(run)
    broken_off = [
        name for name in DESIGNS if name not in run.designs and (run.folder / design_file(name)).is_file()
    ]
    notes = [
        f"The design “{name}” is not shown: its stage has not finished. Run shellform design again."
        for name in broken_off
    ]
    failed = run.summary.failed
    if "initial" not in done and "initial" not in failed:
        notes.append(
            "What is shown was computed before the last change of the case, of its surface, or of shellform: "
            "run shellform design again."
        )
    elif "optimise" not in done and run.summary.optimisation is not None:
        notes.append(
            "The optimised designs were computed before the last change of the case: run shellform design again."
        )
    if run.summary.optimisation is None and all(stage in SHOWING for stage in failed):
        notes.append(
            "The run is not optimised (yet): run shellform design without --until, and the optimised design is added."
        )
    if not has_pictures and not failed:
        notes.append(
            "There are no pictures: the stage “figures” has not run, or found no OpenGL. shellform render makes them."
        )
    for stage, why in failed.items():
        notes.append(f"The stage “{stage}” failed: {why}")
    return notes


def versions() -> dict[str, str]:
    """What the page was made by."""
    found = {"shellform": shellform.__version__, "Python": python_version()}
    for name in _PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "missing"
    return found


def _done(run: Run) -> set[str]:
    """The stages whose results are those of the case as it stands; where its surface is elsewhere, all that
    were finished.
    """
    kept = read_stages(run.folder)
    file = Path(run.case.surface.file)
    keys = stage_keys(run.case, sketch=run.summary.sketch) if file.is_file() else kept.keys
    return {stage for stage in kept.keys if kept.has(stage, keys.get(stage, ""))}


def _pictures(run: Run) -> list[Path]:
    """All pictures but the histories, which the page draws itself: the sheet first, then the designs' by
    load, then the others."""
    names = [f"{design}-{load}" for design in reversed(DESIGNS) for load in run.loads]
    first = {name: place for place, name in enumerate(["deviations", *names])}
    found = [
        file
        for file in sorted((run.folder / "figures").glob("*"))
        if file.suffix.lower() in KINDS and file.is_file()
    ]
    # Films come as GIF as well, many times as large.
    films = {file.stem for file in found if file.suffix == ".mp4"}
    wanted = [
        file
        for file in found
        if file.stem not in _DRAWN and not (file.suffix == ".gif" and file.stem in films)
    ]
    return sorted(wanted, key=lambda file: first.get(file.stem, len(first)))


def _refuse_foreign(file: Path) -> None:
    """Another program's file is not written over."""
    if not file.exists():
        return
    try:
        own = file.is_file() and _names_us(file)  # to read from a pipe is to wait for its writer
    except (OSError, UnicodeDecodeError):
        own = False
    if not own:
        raise InputError(
            "is there already and is no page of shellform's",
            where=str(file),
            remedy="Choose another --output.",
        )


def _names_us(file: Path) -> bool:
    with file.open(encoding="utf-8") as text:
        return GENERATOR in text.read(_HEAD)
