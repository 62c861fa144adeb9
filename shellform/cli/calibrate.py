"""`shellform calibrate`: connectors from scans."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from shellform.cli.options import Scripts
from shellform.cli.terminal import tell_lines


def calibrate(
    source: Annotated[
        Path, typer.Argument(metavar="RUN|CASE", help="Run folder, or a case file: its grid without cables.")
    ],
    scans: Annotated[
        list[str],
        typer.Argument(
            metavar="POINTS.csv=LOAD…",
            help="Points x, y, z in any order; LOAD: a load case, or a CSV file of node, fx, fy, fz in N.",
        ),
    ],
    design: Annotated[
        str | None,
        typer.Option(
            help="Of the run, as which the grid was built; left out: the one to build, without its cables."
        ),
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
