"""What the commands for the site take of a run folder or a case file: the grid that was built, its loads by
name, and scans under them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from shellform.arrays import Reals, Record
from shellform.case.build_gridshell import gridshell
from shellform.case.build_net import net_of, surface_of
from shellform.case.case import load_case
from shellform.errors import InputError, require_known
from shellform.gridshell.gridshell import Design, Gridshell
from shellform.run.folder import Run, read_run
from shellform.site import measurements
from shellform.site.scan_points import read_points
from shellform.site.scans import Scan
from shellform.written import make_folder


@dataclass(frozen=True, eq=False)
class Scanned(Record):
    """The grid that was scanned: its `shell` and `design`, the `loads` (n, 6), N, that it may bear, the
    `origin` (3,), m, in a survey's coordinates from which its own count (None: the survey's), and the
    `folder` where results go."""

    shell: Gridshell
    design: Design
    loads: Mapping[str, Reals]
    origin: tuple[float, float, float] | None
    folder: Path


def scanned(source: Path, design: str | None, output: Path | None, *, allow_scripts: bool) -> Scanned:
    """The grid built as the `design` of a run folder; where none is named, with the best design's rods and
    without cables, as in a case file. Results go to `output`, those of a run else to its schedules.
    Raises InputError for an unknown design, and as the readers of both."""
    if source.suffix.lower() != ".toml":
        run = read_run(source)
        name = design_named(run, design)
        return Scanned(
            run.shell_of(name),
            run.designs[name].unbraced() if design is None else run.designs[name],
            run.loads,
            run.case.surface.origin,
            make_folder(output or run.folder / "schedules"),
        )
    if design not in (None, "unbraced"):
        raise InputError(
            "a case has no designs yet: the grid is taken unbraced",
            where="--design",
            value=design,
            remedy="Give a run folder.",
        )
    case = load_case(source)
    surface = surface_of(case.surface, allow_scripts=allow_scripts)
    net, _, _ = net_of(case, surface)
    shell, loads = gridshell(case, net, surface)
    folder = make_folder(output or Path.cwd())
    return Scanned(shell, shell.unbraced(), loads, case.surface.origin, folder)


def scan_under(text: str, grid: Scanned, unit: str, frame: int | None) -> Scan:
    """A scan from "POINTS.csv=LOAD", in the `unit`, its axes the model's own (`frame` None) or to be fitted;
    without a load the grid stood alone. Raises InputError as the readers of both."""
    points, _, load = text.partition("=")
    return Scan(read_points(points, unit=unit), load_named(load or "none", grid.shell, grid.loads), frame)


def named_files(scans: Sequence[str]) -> list[Path]:
    """What "POINTS.csv=LOAD" of each scan names, load cases too, which are no files."""
    return [Path(each) for scan in scans for each in scan.partition("=")[::2] if each]


def load_named(name: str, shell: Gridshell, loads: Mapping[str, Reals]) -> Reals:
    """A load (n, 6), N and N·m: a load case by its name, or from a CSV file. Raises InputError for what is
    neither."""
    if name in loads:
        return loads[name]
    if Path(name).is_file():
        return measurements.read_loads(name, shell)
    raise InputError(
        "is neither a load case nor a file",
        where="load",
        value=name,
        remedy=f"Load cases: {', '.join(loads)}.",
    )


def design_named(run: Run, name: str | None) -> str:
    """The `name` of a design of the run, or where none is given the best one's. Raises InputError for an
    unknown one."""
    chosen = name or run.best
    require_known(chosen, run.designs, where="--design", what="isn't there")
    return chosen
