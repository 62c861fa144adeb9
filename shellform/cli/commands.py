"""The commands and their options (contracts/run-folder.md). Large libraries are loaded by the command that
needs them.
"""

from __future__ import annotations

import json
import os
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer

import shellform
from shellform.cli.terminal import Progress, tell_cases, tell_designs, tell_labelled, tell_lines
from shellform.errors import InputError, NotConverged

app = typer.Typer(
    name="shellform",
    help="Design bending-active gridshells as falsework for concrete shells.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


def _hush(quiet: bool) -> bool:
    """Passes the wish on to compiled.py, here and in processes that this one starts."""
    if quiet:
        os.environ["SHELLFORM_QUIET"] = "1"
    return quiet


Scripts = Annotated[
    bool, typer.Option("--allow-scripts", help="Run builder scripts from outside the shipped surfaces.")
]
Unit = Annotated[str | None, typer.Option(help="Unit of files that carry none: m, cm, mm, in, ft.")]
Up = Annotated[str | None, typer.Option(help="Vertical axis of the file: z or y.")]
Layer = Annotated[str | None, typer.Option(help="Layer of the surface in the file.")]
Object = Annotated[str | None, typer.Option("--object", help="Name of the surface in the file.")]
Face = Annotated[str | None, typer.Option(help="Face of a solid: upper or lower.")]
Piece = Annotated[int | None, typer.Option(help="Number of a separate piece, 1 the largest.")]
Fill = Annotated[str | None, typer.Option(help="Openings to close: holes, edges or all.")]
Ground = Annotated[float | None, typer.Option(help="Height to which open edges are closed, m.")]
Size = Annotated[float | None, typer.Option(help="Mesh size on CAD surfaces, m.")]
Quiet = Annotated[bool, typer.Option("--quiet", callback=_hush, help="Tell errors only.")]
Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON and nothing else.")]


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
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show versions.")
    ] = False,
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
    as_json: Json = False,
) -> None:
    """Read a surface or case and report what it is."""
    from shellform.run.first_look import check_file, told

    options = _given(
        unit=unit,
        up=up,
        size=size,
        layer=layer,
        object=name,
        face=face,
        piece=piece,
        fill=fill,
        ground=ground,
    )
    found = check_file(file, options, allow_scripts=allow_scripts)
    if as_json:
        print(json.dumps(found, indent=1))
    else:
        tell_labelled(told(found))


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
    from shellform.run.propose import propose_case

    options = _given(
        unit=unit,
        up=up,
        size=size,
        layer=layer,
        object=name,
        face=face,
        piece=piece,
        fill=fill,
        ground=ground,
    )
    tell_labelled(propose_case(surface, output, options, allow_scripts=allow_scripts))


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
    angle: Annotated[
        str,
        typer.Option(
            help="Of the u rods against the x axis, degrees, or auto: with least bending and shear."
        ),
    ] = "0",
    gap: Annotated[
        float | None, typer.Option(help="Between the rods' axes, m (default: spacing / 27.5).")
    ] = None,
    allow_scripts: Scripts = False,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Draw the Chebyshev net alone."""
    from shellform.case.build_net import told_size
    from shellform.run.first_look import net_alone

    options = _given(
        unit=unit,
        up=up,
        size=size,
        layer=layer,
        object=name,
        face=face,
        piece=piece,
        fill=fill,
        ground=ground,
    )
    report = Progress(quiet=quiet)
    summary = net_alone(
        surface,
        output,
        options,
        spacing=spacing,
        angle=angle,
        gap=gap,
        allow_scripts=allow_scripts,
        report=report,
    )
    report.close()
    if as_json:
        print(json.dumps(summary, indent=1))
    elif not quiet:
        tell_labelled({"size": told_size(summary["surface"]["size"]), **summary["net"]})


def _given(**options: Any) -> dict[str, Any]:
    """The options that were given."""
    return {name: value for name, value in options.items() if value is not None}


@app.command()
def design(
    case: Annotated[Path, typer.Argument(help="Case file (TOML).")],
    output: Annotated[Path, typer.Option(help="Run folder.")],
    until: Annotated[
        str, typer.Option(help="Last stage: surface, net, initial, optimise, figures, documents or report.")
    ] = "report",
    fresh: Annotated[bool, typer.Option("--fresh", help="Compute every stage anew.")] = False,
    settings: Annotated[
        list[str] | None, typer.Option("--set", help="KEY=VALUE in place of an entry.")
    ] = None,
    allow_scripts: Scripts = False,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Run the whole job; run again, it goes on where it stopped."""
    from shellform.case.case import load_case
    from shellform.run.run import run_case

    report = Progress(quiet=quiet)
    summary = run_case(
        load_case(case, settings or ()),
        output,
        until=until,
        fresh=fresh,
        allow_scripts=allow_scripts,
        report=report,
    )
    report.close()
    if as_json:
        print(json.dumps(summary, indent=1))
    elif not quiet:
        tell_designs(summary)
        print(
            f"Everything is in {output}"
            + (f"; look at {output / 'report.html'} first" if until == "report" else "")
        )


@app.command()
def analyse(
    model: Annotated[Path, typer.Argument(help="Model file (JSON).")],
    load: Annotated[str | None, typer.Option(help="Load case.")] = None,
    factor: Annotated[float, typer.Option(help="Load factor.")] = 1.0,
    increments: Annotated[int, typer.Option(help="Equal increments.")] = 1,
    tolerance: Annotated[float, typer.Option(help="Unbalanced over largest force.")] = 1e-8,
    output: Annotated[Path | None, typer.Option(help="Result file; left out: standard output.")] = None,
    method: Annotated[str, typer.Option(help="relaxation or newton.")] = "relaxation",
    path: Annotated[
        bool, typer.Option("--path", help="Follow the path through limit points by its length.")
    ] = False,
    lead: Annotated[
        str | None,
        typer.Option(help="NODE:AXIS:METRES, a free displacement that leads the path (axis x, y or z)."),
    ] = None,
    limit: Annotated[int, typer.Option(help="Most factorisations of one relaxation.")] = 1000,
    modes: Annotated[int, typer.Option(help="How many of the softest modes.")] = 0,
    critical: Annotated[
        float | None, typer.Option(help="Seek the critical load factor up to this one.")
    ] = None,
    sections: Annotated[
        Path | None, typer.Option(help="Sections by kind of beam (TOML), for stresses.")
    ] = None,
    figures: Annotated[
        Path | None, typer.Option(help="Folder for pictures of the state and the modes.")
    ] = None,
) -> None:
    """Solve a structural model."""
    from shellform.structure.answers.analysis import analyse as solve
    from shellform.structure.answers.result_document import result
    from shellform.structure.answers.results import read_sections
    from shellform.structure.model import read_model
    from shellform.structure.solve.memory import limit_to_free_memory

    report = Progress()
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
            progress=lambda reached, spent: report(
                "analysis", f"load factor {reached:.4g}, {spent} factorisations"
            ),
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
        from shellform.output.pictures.model_states import draw_analysis

        for file in draw_analysis(analysis, figures):
            print(file, file=sys.stderr)
    if not analysis.converged:
        raise NotConverged(analysis.message)


def _lead(text: str) -> tuple[int, int, float]:
    try:
        node, axis, metres = text.split(":")
        return int(node), "xyz".index(axis), float(metres)
    except ValueError as error:
        raise InputError(
            "must read NODE:AXIS:METRES", where="--lead", value=text, remedy="For example 17:z:-0.05."
        ) from error


@app.command()
def render(
    run: Annotated[Path, typer.Argument(help="Run folder.")],
    load: Annotated[
        str | None, typer.Option(help="none, design, additional or another of the case's.")
    ] = None,
    design: Annotated[
        str | None, typer.Option(help="unbraced, initial, unloaded, optimised, rounded or polished.")
    ] = None,
    quantity: Annotated[
        str | None,
        typer.Option(help="deviation, utilisation, curvature, shear, spring, mode (the softest) or history."),
    ] = None,
    limit: Annotated[
        float | None, typer.Option(help="End of the colour scale, in SI units; shear in rad.")
    ] = None,
    view: Annotated[str, typer.Option(help="best, top, front or side.")] = "best",
    size: Annotated[str | None, typer.Option(help="WIDTHxHEIGHT in pixels.")] = None,
    rods: Annotated[
        float, typer.Option(help="Rods so many times as thick as they are; 0: as thick as can be seen.")
    ] = 0.0,
    kind: Annotated[
        str | None, typer.Option("--format", help="png, svg or pdf; of films gif or mp4 (default: both).")
    ] = None,
    transparent: Annotated[bool, typer.Option("--transparent", help="No background.")] = False,
    film: Annotated[
        str | None, typer.Option(help="pour: the load coming on; erection: the grid rising from the ground.")
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Draw maps of a run, or a film."""
    from shellform.run.figures import draw_designs, wish
    from shellform.run.folder import read_run

    asked = wish(
        design=design, load=load, quantity=quantity, limit=limit, view=view, size=size, thickness=rods, transparent=transparent,
        kind=kind, film=film,
    )  # fmt: skip
    if film is None:
        files = draw_designs(read_run(run), asked)
    else:
        from shellform.run.films import draw_film

        report = Progress(quiet=quiet)
        files = draw_film(read_run(run), film, asked, report=report)
        report.close()
    for file in () if quiet else files:
        print(file)


@app.command()
def study(
    file: Annotated[Path, typer.Argument(metavar="STUDY.toml", help="Study file.")],
    output: Annotated[
        Path, typer.Option(help="Folder of the study; a second call on it goes on where it stopped.")
    ],
    workers: Annotated[
        int | None, typer.Option(min=1, help="Processes on this machine; left out: one a core.")
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(help="Address of a Dask scheduler, whose workers see the folder too.")
    ] = None,
    allow_scripts: Scripts = False,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Compute many designs: what varies, its table and its page."""
    from shellform.study.live import Live
    from shellform.study.studies import run_study

    if workers is not None and scheduler is not None:
        raise InputError(
            "the cluster has its own workers", where="--workers", remedy="Leave out --workers or --scheduler."
        )
    with Live(quiet=quiet) as live:
        found = run_study(
            file, output, workers=workers, scheduler=scheduler, allow_scripts=allow_scripts, show=live
        )
    for name in () if quiet else found.empty:
        print(
            f"shellform: note: no design has a value for the column {name!r}: is its path in summary.json?",
            file=sys.stderr,
        )
    if as_json:
        print(
            json.dumps(
                {
                    name: str(value) if isinstance(value, Path) else value
                    for name, value in asdict(found).items()
                },
                indent=1,
            )
        )
    elif not quiet:
        failed = f", {found.failed} of them without a result (see status and reason)" if found.failed else ""
        print(
            f"{found.designs} designs, {found.found} found from before{failed}: {found.table}, {found.page}"
        )


@app.command()
def report(
    runs: Annotated[list[Path], typer.Argument(help="Run folders; several stand side by side.")],
    output: Annotated[
        Path | None,
        typer.Option(help="File; left out: report.html in the run folder, or here for several runs."),
    ] = None,
) -> None:
    """Write the page of runs: report.html, one file that needs no network."""
    from shellform.run.pages import write_report

    print(write_report(runs, output))


@app.command()
def calibrate(
    source: Annotated[
        Path, typer.Argument(metavar="RUN|CASE", help="Run folder, or a case file: its grid unbraced.")
    ],
    scans: Annotated[
        list[str],
        typer.Argument(
            metavar="POINTS.csv=LOAD…",
            help="Points x, y, z in any order; LOAD: a load case, or a CSV file of node, fx, fy, fz in N.",
        ),
    ],
    design: Annotated[
        str | None, typer.Option(help="Of the run, as which the grid was built; left out: unbraced.")
    ] = None,
    markers: Annotated[
        Path | None, typer.Option(help="CSV file with a column node or crossing; left out: every crossing.")
    ] = None,
    unit: Annotated[str, typer.Option(help="Of the points: m, cm, mm, in, ft.")] = "m",
    noise: Annotated[
        float, typer.Option(help="Of a measured coordinate, m (one standard deviation).")
    ] = 0.15e-3,
    free: Annotated[
        list[str] | None, typer.Option(help="axial, torsion or bending; left out: all that the scans tell.")
    ] = None,
    placed: Annotated[bool, typer.Option("--placed", help="The points are in the model's axes.")] = False,
    offsets: Annotated[
        bool, typer.Option("--offsets", help="Markers sit away from their nodes, the same in all scans.")
    ] = False,
    output: Annotated[
        Path | None, typer.Option(help="Folder for results; left out: RUN/schedules, or here.")
    ] = None,
    allow_scripts: Scripts = False,
) -> None:
    """Find the connectors' stiffness from scans of the grid under known loads."""
    from shellform.run import onsite

    tell_lines(
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
        Path | None,
        typer.Argument(
            metavar="SURVEY.csv",
            help="node or crossing, x, y, z in the model's axes; or x, y, z in any axes and order.",
        ),
    ] = None,
    design: Annotated[
        str | None, typer.Option(help="As which the grid was built; left out: the run's last.")
    ] = None,
    load: Annotated[str, typer.Option(help="Load case that the grid bears.")] = "none",
    unit: Annotated[str, typer.Option(help="Of the survey: m, cm, mm, in, ft.")] = "m",
    noise: Annotated[
        float, typer.Option(help="Of a measured coordinate, m (one standard deviation).")
    ] = 0.15e-3,
    length_error: Annotated[float, typer.Option(help="Usual error of a cable's rest length, m.")] = 1e-3,
    step: Annotated[float, typer.Option(help="Rest length of one turn of a turnbuckle, m.")] = 0.25e-3,
    largest: Annotated[float, typer.Option(help="Largest change of a cable in one round, m.")] = 1.5e-3,
    cables: Annotated[int, typer.Option(help="Most cables that are turned in one round.")] = 60,
    after: Annotated[
        Path | None, typer.Option(help="belief.npz of the round before, once its turns were made.")
    ] = None,
    replay: Annotated[
        int | None,
        typer.Option(metavar="ROUNDS", help="No survey: play that many rounds with random errors and noise."),
    ] = None,
    markers: Annotated[
        Path | None,
        typer.Option(help="For --replay: CSV file with a column node or crossing; left out: every crossing."),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="For --replay.")] = 0,
    slip: Annotated[float, typer.Option(help="For --replay: error of a turn, as a share of it.")] = 0.05,
    output: Annotated[Path | None, typer.Option(help="Folder for results; left out: RUN/schedules.")] = None,
) -> None:
    """Tell the crew which turnbuckles to turn, from a survey of the erected grid."""
    from shellform.run import onsite

    if (measured is None) == (replay is None):
        raise InputError("needs either a survey or --replay", where="survey")
    options = onsite.Survey(design, load, unit, noise, length_error, step, largest, cables, after)
    if replay is not None:
        tell_lines(
            onsite.replay(run, options, rounds=replay, seed=seed, slip=slip, markers=markers, output=output)
        )
    elif measured is not None:
        tell_lines(onsite.survey(run, measured, options, output))


@app.command()
def erect(
    run: Annotated[Path, typer.Argument(help="Run folder.")],
    design: Annotated[str | None, typer.Option(help="Left out: the run's last.")] = None,
    load: Annotated[
        str | None, typer.Option(help="In the end: a load case, or a CSV file of node, fx, fy, fz in N.")
    ] = None,
    weight: Annotated[str | None, typer.Option(help="All the time, given likewise.")] = None,
    lift: Annotated[str | None, typer.Option(help="While the supports move, given likewise.")] = None,
    groups: Annotated[
        Path | None, typer.Option(help="Cables tightened together: CSV file of cable, group.")
    ] = None,
    way: Annotated[
        Path | None, typer.Option(help="Places of the supports on the way: CSV file of stop, node, x, y, z.")
    ] = None,
    step: Annotated[float, typer.Option(help="Share of a stage.")] = 0.1,
    output: Annotated[Path | None, typer.Option(help="Folder for results; left out: RUN/schedules.")] = None,
) -> None:
    """Follow the grid from flat to erected, tightened and loaded."""
    from shellform.run import onsite

    tell_lines(
        onsite.erect(
            run,
            design=design,
            load=load,
            weight=weight,
            lift=lift,
            groups=groups,
            way=way,
            step=step,
            output=output,
        )
    )


@app.command()
def verify() -> None:
    """Run the published cases and gradient checks."""
    from shellform.verification import verify as rows

    tell_cases(rows())


def _no_number(value: object) -> Any:
    raise TypeError(f"can't be written as JSON: {type(value).__name__}")
