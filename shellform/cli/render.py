"""`shellform render`: maps and films of a run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from shellform.cli.options import Quiet
from shellform.cli.terminal import Spinner


def render(
    run: Annotated[Path, typer.Argument(help="Run folder.")],
    load: Annotated[
        str | None, typer.Option(help="none, design, additional or another of the case's.")
    ] = None,
    design: Annotated[
        str | None,
        typer.Option(
            help="best (the one to build), unbraced, initial, unloaded, optimised, rounded or polished."
        ),
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
    by: Annotated[
        str | None,
        typer.Option(help="Of the erection: supports or scaffold, as shellform erect takes it."),
    ] = None,
    tighten_first: Annotated[
        bool, typer.Option("--tighten-first", help="Of the erection: cables before the scaffold is lowered.")
    ] = False,
    width_mm: Annotated[
        float | None, typer.Option("--width-mm", help="Width in print, mm; letters and lines follow it.")
    ] = None,
    dpi: Annotated[float | None, typer.Option(help="Pixels an inch in print (default: 300).")] = None,
    font_size: Annotated[
        float | None, typer.Option(help="Height of the letters in print, points (default: 9).")
    ] = None,
    force_limit: Annotated[
        float | None, typer.Option(help="End of the cables' colour scale, N; left out: the largest force.")
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(help="Folder for the pictures; left out: RUN/figures, whose pictures the page shows."),
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Draw maps of a run, or a film; with --output beside those that its page shows, not in their place."""
    from shellform.run.figures import draw_designs, wish
    from shellform.run.folder import read_run

    found = read_run(run)
    asked = wish(
        design=found.best if design == "best" else design,
        load=load, quantity=quantity, limit=limit, view=view, size=size, thickness=rods,
        transparent=transparent,
        kind=kind, film=film, by=by, tighten_first=tighten_first,
        force_limit=force_limit, width_mm=width_mm, dpi=dpi, font_size=font_size, folder=output,
    )  # fmt: skip
    if film is None:
        files = draw_designs(found, asked)
    else:
        from shellform.run.films import draw_film

        with Spinner(quiet=quiet) as report:
            files = draw_film(found, film, asked, report=report)
    for file in () if quiet else files:
        print(file)
