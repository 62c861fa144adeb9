"""The page of runs: reads the run folders, says what is missing in them, and writes report.html whole or not
at all.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from platform import python_version

import shellform
from shellform.errors import InputError
from shellform.output.page.embed import KINDS, embed
from shellform.output.page.report import GENERATOR, Entry, html
from shellform.output.page.verdict import Bounds
from shellform.run.folder import DESIGNS, Report, Run, read_json, read_run
from shellform.run.run import stage_keys
from shellform.written import write_text

FILE = "report.html"
_BUDGET = 9_000_000  # bytes of pictures in a page, before they become text, which adds a third
_PACKAGES = ("numpy", "scipy", "numba", "cvxopt", "mkl", "gmsh", "nlopt", "pyvista")
_DRAWN = ("objective", "constraints")
_HEAD = 2000  # characters in which a page of ours names its maker


def write_report(
    folders: Sequence[str | Path],
    file: str | Path | None = None,
    *,
    report: Report = lambda stage, text: None,
) -> Path:
    """Writes the page of one run, or of several side by side, and returns its file: `file`, or report.html in
    the one run's folder or, for several, in the present one. Raises InputError for what is no run, and for a
    file that is there and is no page of shellform's."""
    if not folders:
        raise InputError("there is no run to report", where="report", remedy="Name one or more run folders.")
    runs = []
    for folder in folders:
        report("report", f"reading {folder}")
        runs.append(read_run(folder))
    return write_page(
        runs, Path(file) if file is not None else (runs[0].folder if len(runs) == 1 else Path()) / FILE
    )


def write_page(runs: Sequence[Run], file: Path) -> Path:
    """As `write_report`, of runs that are read already."""
    _refuse_foreign(file)
    text = html([entry(run, _BUDGET // len(runs)) for run in runs], versions())
    write_text(file, text)
    return file


def entry(run: Run, budget: int = _BUDGET) -> Entry:
    """A run as the page takes it, with at most `budget` bytes of pictures."""
    told = run.summary.get("designs", {})
    known = [name for name in run.designs if name in told]  # in the order in which they were made
    if not known:
        raise InputError(
            "the run's summary tells of no design",
            where=str(run.folder),
            remedy="Run shellform design on it again.",
        )
    done = _done(run)
    pictures, left = embed(_pictures(run), budget=budget)
    broken_off = [
        name for name in DESIGNS if name not in told and (run.folder / f"designs/{name}.npz").is_file()
    ]
    notes = [
        f"The design “{name}” is not shown: its stage has not finished. Run shellform design again."
        for name in broken_off
    ]
    if "initial" not in done:
        notes.append(
            "What is shown was computed before the last change of the case, of its surface, or of shellform: "
            "run shellform design again."
        )
    elif "optimise" not in done and "optimisation" in run.summary:
        notes.append(
            "The optimised designs were computed before the last change of the case: run shellform design again."
        )
    if "optimisation" not in run.summary:
        notes.append(
            "The run is not optimised (yet): run shellform design without --until, and the optimised design is added."
        )
    if not pictures:
        notes.append(
            "There are no pictures: the stage “figures” has not run, or found no OpenGL. shellform render makes them."
        )
    for stage, why in run.summary.get("failed", {}).items():
        notes.append(f"The stage “{stage}” failed: {why}")
    limits = run.case.limits
    return Entry(
        run.case.title or run.folder.resolve().name,
        run.folder.name or str(run.folder),
        {name: run.shell_of(name) for name in known},
        run.surface,
        run.loads,
        {name: run.designs[name] for name in known},
        {name: run.states[name] for name in known},
        run.best if run.best in known else known[-1],
        run.summary,
        _history(run.folder / "history.csv"),
        (run.folder / "case.toml").read_text(encoding="utf-8"),
        pictures,
        run.case.figures.limit,
        Bounds(
            run.case.cable.force_max,
            run.case.optimise.misfit_rms_additional,
            limits.utilisation,
            limits.connector_turn,
            limits.uplift,
            limits.critical_factor,
        ),
        [*notes, *left],
        sorted(
            file.relative_to(run.folder).as_posix()
            for file in run.folder.rglob("*")
            if file.is_file() and ".part" not in file.name
        ),
    )


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
    kept = read_json(run.folder / "stages.json")
    file = Path(run.case.surface.file)
    keys = stage_keys(run.case) if file.is_file() else kept
    return {stage for stage, key in kept.items() if keys.get(stage) == key}


def _history(file: Path) -> list[dict[str, str]]:
    if not file.is_file():
        return []
    try:
        with file.open(encoding="utf-8", newline="") as rows:
            return list(csv.DictReader(rows))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"is damaged: {error}", where=str(file), remedy="Run again with --fresh.") from error


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
    films = {
        file.stem for file in found if file.suffix == ".mp4"
    }  # which come as GIF as well, many times as large
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
        with file.open(encoding="utf-8") as text:
            own = GENERATOR in text.read(_HEAD)
    except (OSError, UnicodeDecodeError):
        own = False
    if not own:
        raise InputError(
            "is there already and is no page of shellform's",
            where=str(file),
            remedy="Choose another --output.",
        )
