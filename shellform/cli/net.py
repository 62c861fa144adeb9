"""`shellform net`: the Chebyshev net alone."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from shellform.cli.options import Json, Quiet, Scripts, with_surface_options
from shellform.cli.terminal import Spinner, tell_labelled


@with_surface_options
def net(
    surface: Annotated[Path, typer.Argument(help="A surface file or shipped builder script.")],
    spacing: Annotated[float, typer.Option(help="Distance between rods, m.")],
    output: Annotated[Path, typer.Option(help="Run folder.")],
    surface_options: Mapping[str, Any],
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
    from shellform.records.summary import document
    from shellform.run.first_look import labelled_net, net_alone

    with Spinner(quiet=quiet) as report:
        summary = net_alone(
            surface,
            output,
            surface_options,
            spacing=spacing,
            angle=angle,
            gap=gap,
            allow_scripts=allow_scripts,
            report=report,
        )
    if as_json:
        print(json.dumps(document(summary), indent=1))
    elif not quiet:
        tell_labelled(labelled_net(summary) | {"everything is in": str(output)})
