"""`shellform new`: a commented case file for a surface, with a design that stands."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from shellform.cli.options import Quiet, Scripts, with_surface_options
from shellform.cli.terminal import Spinner, tell_labelled


@with_surface_options
def new(
    surface: Annotated[Path, typer.Argument(help="A surface file or shipped builder script.")],
    output: Annotated[Path, typer.Option(help="Case file to write, CASE.toml.")],
    surface_options: Mapping[str, Any],
    rod: Annotated[
        str | None, typer.Option(help='Catalogue, or catalogue and section: "gfrp_rods/8 mm".')
    ] = None,
    spacing: Annotated[float | None, typer.Option(help="Distance between rods, m.")] = None,
    thickness: Annotated[float | None, typer.Option(help="Of the concrete, m.")] = None,
    angle: Annotated[
        float | None,
        typer.Option(help="Of the u rods against the x axis, degrees; left out: with the least bending."),
    ] = None,
    layers: Annotated[
        int | None,
        typer.Option(
            help="2: rods of two laths or tubes, bent one by one, then locked by shear blocks; left out: where one falls."
        ),
    ] = None,
    edges: Annotated[
        str, typer.Option(help="wall: the outer edge stands on walls all round; auto: on what is found.")
    ] = "auto",
    way_out: Annotated[
        bool,
        typer.Option(
            "--way-out",
            help="Where no design stands on the surface as it is, go on with the nearest that can be built, walls all round, "
            "or a first layer of concrete, whichever is found first; with walls too where it strays too far as built, and less "
            "on them. The case says so.",
        ),
    ] = False,
    allow_scripts: Scripts = False,
    quiet: Quiet = False,
) -> None:
    """Design a shell that stands and write its commented case file."""
    from shellform.run.propose import propose_case
    from shellform.run.sizes import DesignWish
    from shellform.structure.ahead import compiling_ahead

    with Spinner(quiet=quiet) as report, compiling_ahead():
        told = propose_case(
            surface,
            output,
            surface_options,
            allow_scripts=allow_scripts,
            wish=DesignWish(rod, spacing, thickness, angle, layers, edges),
            way_out=way_out,
            report=report,
        )
    if not quiet:
        tell_labelled(told)
