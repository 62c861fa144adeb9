"""The command line (contracts/run-folder.md). Large libraries are loaded by the command that needs them."""

from __future__ import annotations

import json
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer

import shellform
from shellform.errors import InputError, NotConverged

app = typer.Typer(
    name="shellform",
    help="Design bending-active gridshells as falsework for concrete shells.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

_STOPPED = 130
_KEPT = "stopped; what was computed is kept, and the same command goes on from there"

Scripts = Annotated[bool, typer.Option("--allow-scripts", help="Run builder scripts from outside the shipped surfaces.")]
Unit = Annotated[str | None, typer.Option(help="Unit of files that carry none: m, cm, mm, in, ft.")]
Up = Annotated[str | None, typer.Option(help="Vertical axis of the file: z or y.")]
Layer = Annotated[str | None, typer.Option(help="Layer of the surface in the file.")]
Object = Annotated[str | None, typer.Option("--object", help="Name of the surface in the file.")]
Face = Annotated[str | None, typer.Option(help="Face of a solid: upper or lower.")]
Piece = Annotated[int | None, typer.Option(help="Number of a separate piece, 1 the largest.")]
Fill = Annotated[str | None, typer.Option(help="Openings to close: holes, edges or all.")]
Ground = Annotated[float | None, typer.Option(help="Height to which open edges are closed, m.")]
Size = Annotated[float | None, typer.Option(help="Mesh size on CAD surfaces, m.")]


def main() -> None:
    """Runs the command line: status 0 done, 2 input refused, 3 no result, 130 stopped."""
    with _ctrl_c() as stopped:
        try:
            status = app(standalone_mode=False)  # typer turns Ctrl-C into a returned status
            if status == _STOPPED:
                raise KeyboardInterrupt
            sys.exit(status if isinstance(status, int) else 0)
        except (KeyboardInterrupt, typer.Abort):
            _leave(_KEPT, _STOPPED)
        except typer.Exit as stop:
            sys.exit(stop.exit_code)
        except Exception as error:
            if stopped:
                _leave(_KEPT, _STOPPED)
            _fail(error)


@contextmanager
def _ctrl_c() -> Iterator[list[int]]:
    """A list that is empty until Ctrl-C is pressed: compiled loops, and processes that read for this one, turn the interruption into
    errors of their own."""
    stopped: list[int] = []

    def note(number: int, frame: object) -> None:
        stopped.append(number)
        raise KeyboardInterrupt

    usual = signal.getsignal(signal.SIGINT)
    if usual is not signal.default_int_handler:  # ignored, as in a job of a shell that runs in the background
        yield stopped
        return
    signal.signal(signal.SIGINT, note)
    try:
        yield stopped
    finally:
        signal.signal(signal.SIGINT, usual)


def _fail(error: Exception) -> None:
    """Says what was wrong, and leaves; an error that is no one's but ours is raised again."""
    if isinstance(error, InputError):
        _leave(f"refused: {error}", 2)
    if isinstance(error, NotConverged):
        _leave(f"no result: {error}", 3)
    if isinstance(error, MemoryError):
        _leave("no result: the memory is full. Choose a larger spacing or fewer elements.", 3)
    if getattr(error, "exit_code", None) is None:
        raise error
    said = getattr(error, "format_message", None)  # click's usage errors
    _leave(f"refused: {said() if said else error}", 2)


def _leave(message: str, status: int) -> None:
    print(f"shellform: {message}", file=sys.stderr)
    sys.exit(status)


def _version(asked: bool) -> None:
    if asked:
        from importlib.metadata import PackageNotFoundError, version

        print(f"shellform {shellform.__version__}")
        for name in ("numpy", "scipy", "numba", "cvxopt", "gmsh", "nlopt", "pyvista", "ezdxf", "dask"):
            try:
                print(f"{name} {version(name)}")
            except PackageNotFoundError:
                print(f"{name} is missing")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[bool, typer.Option("--version", callback=_version, is_eager=True, help="Show versions.")] = False,
) -> None:
    pass


@app.command()
def check(
    file: Annotated[Path, typer.Argument(help="A surface or a case file.")],
    unit: Unit = None,
    up: Up = None,
    size: Size = None,
    layer: Layer = None,
    name: Object = None,
    face: Face = None,
    piece: Piece = None,
    fill: Fill = None,
    ground: Ground = None,
    allow_scripts: Scripts = False,
) -> None:
    """Read a surface or case and report what it is."""
    from shellform.study.check import check_file

    options = _given(unit=unit, up=up, size=size, layer=layer, object=name, face=face, piece=piece, fill=fill, ground=ground)
    for label, value in check_file(file, options, allow_scripts=allow_scripts).items():
        print(f"{label:>22}  {value}")


@app.command()
def new(
    surface: Annotated[Path, typer.Argument(help="A surface file or shipped builder script.")],
    output: Annotated[Path, typer.Option(help="Case file to write, CASE.toml.")],
    unit: Unit = None,
    up: Up = None,
    size: Size = None,
    layer: Layer = None,
    name: Object = None,
    face: Face = None,
    piece: Piece = None,
    fill: Fill = None,
    ground: Ground = None,
    allow_scripts: Scripts = False,
) -> None:
    """Write a commented case file for a surface."""
    from shellform.study.propose import propose_case

    options = _given(unit=unit, up=up, size=size, layer=layer, object=name, face=face, piece=piece, fill=fill, ground=ground)
    for label, value in propose_case(surface, output, options, allow_scripts=allow_scripts).items():
        print(f"{label:>22}  {value}")


@app.command()
def net(
    surface: Annotated[Path, typer.Argument(help="A surface file or shipped builder script.")],
    spacing: Annotated[float, typer.Option(help="Distance between rods, m.")],
    output: Annotated[Path, typer.Option(help="Run folder.")],
    unit: Unit = None,
    up: Up = None,
    size: Size = None,
    layer: Layer = None,
    name: Object = None,
    face: Face = None,
    piece: Piece = None,
    fill: Fill = None,
    ground: Ground = None,
    angle: Annotated[str, typer.Option(help="Of the u rods against the x axis, degrees, or auto: with least bending and shear.")] = "0",
    gap: Annotated[float | None, typer.Option(help="Between the rods' axes, m (default: spacing / 27.5).")] = None,
    allow_scripts: Scripts = False,
) -> None:
    """Draw the Chebyshev net alone."""
    from shellform.study.check import net_alone

    options = _given(unit=unit, up=up, size=size, layer=layer, object=name, face=face, piece=piece, fill=fill, ground=ground)
    report = _Progress()
    summary = net_alone(
        surface, output, options, spacing=spacing, angle=angle, gap=gap, allow_scripts=allow_scripts, report=report
    )
    report.close()
    for label, value in summary.items():
        print(f"{label:>22}  {value}")


def _given(**options: Any) -> dict[str, Any]:
    """The options that were given."""
    return {name: value for name, value in options.items() if value is not None}


@app.command()
def design(
    case: Annotated[Path, typer.Argument(help="Case file (TOML).")],
    output: Annotated[Path, typer.Option(help="Run folder.")],
    until: Annotated[str, typer.Option(help="Last stage: surface, net, initial, optimise, figures, documents or report.")] = "report",
    fresh: Annotated[bool, typer.Option("--fresh", help="Compute every stage anew.")] = False,
    settings: Annotated[list[str] | None, typer.Option("--set", help="KEY=VALUE in place of an entry.")] = None,
    allow_scripts: Scripts = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="Tell errors only; RUN/log.txt has the rest.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the summary as JSON and nothing else.")] = False,
) -> None:
    """Run the whole job; run again, it goes on where it stopped."""
    from shellform.study.case import load_case
    from shellform.study.run import run_case

    report = _Progress(quiet=quiet)
    summary = run_case(
        load_case(case, settings or ()), output, until=until, fresh=fresh, allow_scripts=allow_scripts, report=report
    )
    report.close()
    if as_json:
        print(json.dumps(summary, indent=1))
    elif not quiet:
        _tell(summary)
        print(f"Everything is in {output}" + (f"; look at {output / 'report.html'} first" if until == "report" else ""))


@app.command()
def analyse(
    model: Annotated[Path, typer.Argument(help="Model file (JSON).")],
    load: Annotated[str | None, typer.Option(help="Load case.")] = None,
    factor: Annotated[float, typer.Option(help="Load factor.")] = 1.0,
    increments: Annotated[int, typer.Option(help="Equal increments.")] = 1,
    tolerance: Annotated[float, typer.Option(help="Unbalanced over largest force.")] = 1e-8,
    output: Annotated[Path | None, typer.Option(help="Result file; left out: standard output.")] = None,
    method: Annotated[str, typer.Option(help="relaxation or newton.")] = "relaxation",
    path: Annotated[bool, typer.Option("--path", help="Follow the path through limit points by its length.")] = False,
    lead: Annotated[str | None, typer.Option(help="NODE:AXIS:METRES, a free displacement that leads the path (axis x, y or z).")] = None,
    limit: Annotated[int, typer.Option(help="Most factorisations of one relaxation.")] = 1000,
    modes: Annotated[int, typer.Option(help="How many of the softest modes.")] = 0,
    critical: Annotated[float | None, typer.Option(help="Seek the critical load factor up to this one.")] = None,
    sections: Annotated[Path | None, typer.Option(help="Sections by kind of beam (TOML), for stresses.")] = None,
    figures: Annotated[Path | None, typer.Option(help="Folder for pictures of the state and the modes.")] = None,
) -> None:
    """Solve a structural model."""
    from shellform.structure.analysis import analyse as solve
    from shellform.structure.analysis import result
    from shellform.structure.memory import limit_to_free_memory
    from shellform.structure.model import read_model
    from shellform.structure.results import read_sections

    report = _Progress()
    try:
        if figures is None:  # pictures ask the graphics driver for memory on terms of its own
            limit_to_free_memory()
        known = read_sections(sections) if sections is not None else None
        analysis = solve(
            read_model(model),
            load=load,
            factor=factor,
            increments=increments,
            tolerance=tolerance,
            method="path" if path or lead else method,
            lead=_lead(lead) if lead else None,
            limit=limit,
            mode_count=modes,
            critical_to=critical,
            progress=lambda reached, spent: report("analysis", f"load factor {reached:.4g}, {spent} factorisations"),
        )
        document = result(analysis, sections=known)
    finally:
        report.close()
    for warning in analysis.warnings:
        print(f"shellform: note: {warning}", file=sys.stderr)
    text = json.dumps(document, default=_no_number, allow_nan=False)
    if output is None:
        print(text)
    else:
        from shellform.written import write_text

        write_text(output, text)
    if figures is not None:
        from shellform.output.states import draw_analysis

        for file in draw_analysis(analysis, figures):
            print(file, file=sys.stderr)
    if not analysis.converged:
        raise NotConverged(analysis.message)


def _lead(text: str) -> tuple[int, int, float]:
    try:
        node, axis, metres = text.split(":")
        return int(node), "xyz".index(axis), float(metres)
    except ValueError as error:
        raise InputError("must read NODE:AXIS:METRES", where="--lead", value=text, remedy="For example 17:z:-0.05.") from error


@app.command()
def render(
    run: Annotated[Path, typer.Argument(help="Run folder.")],
    load: Annotated[str | None, typer.Option(help="none, design, additional or another of the case's.")] = None,
    design: Annotated[str | None, typer.Option(help="unbraced, initial, unloaded, optimised, rounded or polished.")] = None,
    quantity: Annotated[
        str | None, typer.Option(help="deviation, utilisation, curvature, shear, spring, mode (the softest) or history.")
    ] = None,
    limit: Annotated[float | None, typer.Option(help="End of the colour scale, in SI units; shear in rad.")] = None,
    view: Annotated[str, typer.Option(help="best, top, front or side.")] = "best",
    size: Annotated[str | None, typer.Option(help="WIDTHxHEIGHT in pixels.")] = None,
    rods: Annotated[float, typer.Option(help="Rods so many times as thick as they are; 0: as thick as can be seen.")] = 0.0,
    kind: Annotated[str | None, typer.Option("--format", help="png, svg or pdf; of films gif or mp4 (default: both).")] = None,
    transparent: Annotated[bool, typer.Option("--transparent", help="No background.")] = False,
    film: Annotated[str | None, typer.Option(help="pour: the load coming on; erection: the grid rising from the ground.")] = None,
) -> None:
    """Draw maps of a run, or a film."""
    from shellform.study.folder import read_run
    from shellform.study.pictures import draw_designs, wish

    asked = wish(
        design=design, load=load, quantity=quantity, limit=limit, view=view, size=size, thickness=rods, transparent=transparent,
        kind=kind, film=film,
    )  # fmt: skip
    if film is None:
        files = draw_designs(read_run(run), asked)
    else:
        from shellform.study.films import draw_film

        report = _Progress()
        files = draw_film(read_run(run), film, asked, report=report)
        report.close()
    for file in files:
        print(file)


@app.command()
def study(
    file: Annotated[Path, typer.Argument(metavar="STUDY.toml", help="Study file.")],
    output: Annotated[Path, typer.Option(help="Folder of the study; a second call on it goes on where it stopped.")],
    workers: Annotated[int | None, typer.Option(min=1, help="Processes on this machine; left out: one a core.")] = None,
    scheduler: Annotated[str | None, typer.Option(help="Address of a Dask scheduler, whose workers see the folder too.")] = None,
    allow_scripts: Scripts = False,
) -> None:
    """Compute many designs: what varies, its table and its page."""
    from shellform.study.live import Live
    from shellform.study.studies import run_study

    if workers is not None and scheduler is not None:
        raise InputError("the cluster has its own workers", where="--workers", remedy="Leave out --workers or --scheduler.")
    with Live() as live:
        found = run_study(file, output, workers=workers, scheduler=scheduler, allow_scripts=allow_scripts, show=live)
    failed = f", {found.failed} of them without a result (see status and reason)" if found.failed else ""
    for name in found.empty:
        print(f"shellform: note: no design has a value for the column {name!r}: is its path in summary.json?", file=sys.stderr)
    print(f"{found.designs} designs, {found.found} found from before{failed}: {found.table}, {found.page}")


@app.command()
def report(
    runs: Annotated[list[Path], typer.Argument(help="Run folders; several stand side by side.")],
    output: Annotated[Path | None, typer.Option(help="File; left out: report.html in the run folder, or here for several runs.")] = None,
) -> None:
    """Write the page of runs: report.html, one file that needs no network."""
    from shellform.study.page import write_report

    print(write_report(runs, output))


@app.command()
def calibrate(
    source: Annotated[Path, typer.Argument(metavar="RUN|CASE", help="Run folder, or a case file: its grid unbraced.")],
    scans: Annotated[
        list[str], typer.Argument(metavar="POINTS.csv=LOAD…", help="Points x, y, z in any order; LOAD: a load case, or a CSV file of node, fx, fy, fz in N.")
    ],
    design: Annotated[str | None, typer.Option(help="Of the run, as which the grid was built; left out: unbraced.")] = None,
    markers: Annotated[Path | None, typer.Option(help="CSV file with a column node or crossing; left out: every crossing.")] = None,
    unit: Annotated[str, typer.Option(help="Of the points: m, cm, mm, in, ft.")] = "m",
    noise: Annotated[float, typer.Option(help="Of a measured coordinate, m (one standard deviation).")] = 0.15e-3,
    free: Annotated[list[str] | None, typer.Option(help="axial, torsion or bending; left out: all that the scans tell.")] = None,
    placed: Annotated[bool, typer.Option("--placed", help="The points are in the model's axes.")] = False,
    offsets: Annotated[bool, typer.Option("--offsets", help="Markers sit away from their nodes, the same in all scans.")] = False,
    output: Annotated[Path | None, typer.Option(help="Folder for results; left out: RUN/schedules, or here.")] = None,
    allow_scripts: Scripts = False,
) -> None:
    """Find the connectors' stiffness from scans of the grid under known loads."""
    from shellform.study import onsite

    _say(
        onsite.calibrate(
            source,
            scans,
            design=design,
            markers=markers,
            unit=unit,
            noise=noise,
            placed=placed,
            offsets=offsets,
            output=output,
            allow_scripts=allow_scripts,
            free=free or (),
        )
    )


@app.command()
def survey(
    run: Annotated[Path, typer.Argument(help="Run folder.")],
    measured: Annotated[
        Path | None, typer.Argument(metavar="SURVEY.csv", help="node or crossing, x, y, z in the model's axes; or x, y, z in any axes and order.")
    ] = None,
    design: Annotated[str | None, typer.Option(help="As which the grid was built; left out: the run's last.")] = None,
    load: Annotated[str, typer.Option(help="Load case that the grid bears.")] = "none",
    unit: Annotated[str, typer.Option(help="Of the survey: m, cm, mm, in, ft.")] = "m",
    noise: Annotated[float, typer.Option(help="Of a measured coordinate, m (one standard deviation).")] = 0.15e-3,
    length_error: Annotated[float, typer.Option(help="Usual error of a cable's rest length, m.")] = 1e-3,
    step: Annotated[float, typer.Option(help="Rest length of one turn of a turnbuckle, m.")] = 0.25e-3,
    largest: Annotated[float, typer.Option(help="Largest change of a cable in one round, m.")] = 1.5e-3,
    cables: Annotated[int, typer.Option(help="Most cables that are turned in one round.")] = 60,
    after: Annotated[Path | None, typer.Option(help="belief.npz of the round before, once its turns were made.")] = None,
    replay: Annotated[int | None, typer.Option(metavar="ROUNDS", help="No survey: play that many rounds with random errors and noise.")] = None,
    markers: Annotated[Path | None, typer.Option(help="For --replay: CSV file with a column node or crossing; left out: every crossing.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="For --replay.")] = 0,
    slip: Annotated[float, typer.Option(help="For --replay: error of a turn, as a share of it.")] = 0.05,
    output: Annotated[Path | None, typer.Option(help="Folder for results; left out: RUN/schedules.")] = None,
) -> None:
    """Tell the crew which turnbuckles to turn, from a survey of the erected grid."""
    from shellform.study import onsite

    if (measured is None) == (replay is None):
        raise InputError("needs either a survey or --replay", where="survey")
    options = onsite.Survey(design, load, unit, noise, length_error, step, largest, cables, after)
    if replay is not None:
        _say(onsite.replay(run, options, rounds=replay, seed=seed, slip=slip, markers=markers, output=output))
    elif measured is not None:
        _say(onsite.survey(run, measured, options, output))


@app.command()
def erect(
    run: Annotated[Path, typer.Argument(help="Run folder.")],
    design: Annotated[str | None, typer.Option(help="Left out: the run's last.")] = None,
    load: Annotated[str | None, typer.Option(help="In the end: a load case, or a CSV file of node, fx, fy, fz in N.")] = None,
    weight: Annotated[str | None, typer.Option(help="All the time, given likewise.")] = None,
    lift: Annotated[str | None, typer.Option(help="While the supports move, given likewise.")] = None,
    groups: Annotated[Path | None, typer.Option(help="Cables tightened together: CSV file of cable, group.")] = None,
    way: Annotated[Path | None, typer.Option(help="Places of the supports on the way: CSV file of stop, node, x, y, z.")] = None,
    step: Annotated[float, typer.Option(help="Share of a stage.")] = 0.1,
    output: Annotated[Path | None, typer.Option(help="Folder for results; left out: RUN/schedules.")] = None,
) -> None:
    """Follow the grid from flat to erected, tightened and loaded."""
    from shellform.study import onsite

    _say(
        onsite.erect(
            run, design=design, load=load, weight=weight, lift=lift, groups=groups, way=way, step=step, output=output
        )
    )


def _say(told: Any) -> None:
    """The lines of a command's result, then its files."""
    for line in [*told.lines, *told.files]:
        print(line)


@app.command()
def verify() -> None:
    """Run the published cases and gradient checks."""
    from shellform.structure.verification import verify as rows

    failed, cases, number = 0, set(), 0
    head = f"{'case':40} {'quantity':38} {'value':>12} {'reference':>12} {'difference':>10} {'allowed':>8}"
    print(f"{head}       source")
    for row in rows():
        failed += not row.passed
        cases.add(row.case)
        number += 1
        numbers = f"{row.value:12.7g} {row.reference:12.7g} {row.difference:10.1e} {row.tolerance:8.0e}"
        mark = "pass" if row.passed else "FAIL"
        print(f"{row.case:40} {row.quantity:38} {numbers} {mark}  {row.source}", flush=True)
    if failed:
        raise NotConverged(f"{failed} of {number} numbers do not hold")
    print(f"all {number} numbers of {len(cases)} cases hold")


class _Progress:
    """A spinner with the present step on a terminal; what is finished stays as a line, there and elsewhere. Nothing if `quiet`."""

    def __init__(self, *, quiet: bool = False) -> None:
        from rich.console import Console

        self.console = Console(stderr=True, highlight=False, markup=False, soft_wrap=True, quiet=quiet)
        self.status = self.console.status("starting")
        self.status.start()

    def __call__(self, stage: str, text: str) -> None:
        if text.startswith(("done", "kept", "loading", "no pictures", "note", "size", "going on")):
            self.console.print(f"{stage}: {text}")
        self.status.update(f"{stage}: {text}")

    def close(self) -> None:
        """Ends the spinner."""
        self.status.stop()


def _tell(summary: dict[str, Any]) -> None:
    """What a designer asks first."""
    for name, design in summary.get("designs", {}).items():
        row = design["loads"]
        cells = [
            f"{each}: {1e3 * row[each]['deviation_max']:6.1f} mm max, {1e3 * row[each]['deviation_mean']:5.1f} mean"
            + ("" if row[each]["on_branch"] else " (snapped)")
            for each in row
        ]
        print(f"{name:>10}  {design['cables']:4d} cables  " + "   ".join(cells))
    if "optimisation" in summary:
        told = summary["optimisation"]
        print(f"objective {told['objective_start']:.3g} -> {told['objective_end']:.3g}: {told['status']}")
        over = [f"{name} by {value:.1%}" for name, value in told["constraints"].items() if value > 1e-3]
        if over:
            print(f"limits that are not kept: {', '.join(over)}")
    for name, design in summary.get("designs", {}).items():
        if not design.get("critical_factor_kept", True):
            print(f"the {name} design loses stability before the critical factor asked for (critical_factor in summary.json)")
    for each in summary.get("sections", []):
        found = f"objective {each['objective']:.3g}, {each['cables']} cables" if each["objective"] is not None else "no design"
        print(f"{each['section']:>10}  {found}{'' if each['feasible'] else ': ' + each['why_not']}")
    for sentence in summary.get("robust", {}).get("sentences", []):
        print(sentence)


def _no_number(value: object) -> Any:
    raise TypeError(f"can't be written as JSON: {type(value).__name__}")
