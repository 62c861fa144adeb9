"""`shellform erect`: from the flat grid to the loaded shell."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from shellform.cli.terminal import tell_lines


def erect(
    run: Annotated[Path, typer.Argument(help="Run folder.")],
    design: Annotated[str | None, typer.Option(help="Left out: the one to build.")] = None,
    by: Annotated[
        str | None,
        typer.Option(
            help="supports (that move in) or scaffold (that rises under the crossings); left out: scaffold where "
            "there are edge beams or rods in two layers, else supports."
        ),
    ] = None,
    props: Annotated[
        str | None,
        typer.Option(
            help='What the scaffold props: "every" crossing, or a CSV file of node or crossing; left out: every '
            "second crossing, but where it is steep."
        ),
    ] = None,
    tighten_first: Annotated[
        bool, typer.Option("--tighten-first", help="Cables before the scaffold is lowered.")
    ] = False,
    load: Annotated[
        str | None, typer.Option(help="In the end: a load case, or a CSV file of node, fx, fy, fz in N.")
    ] = None,
    weight: Annotated[str | None, typer.Option(help="All the time, given likewise.")] = None,
    lift: Annotated[str | None, typer.Option(help="While the supports move, given likewise.")] = None,
    groups: Annotated[
        Path | None, typer.Option(help="Cables tightened together: CSV file of cable, group.")
    ] = None,
    way: Annotated[
        Path | None,
        typer.Option(help="Places of supports that move in, on their way: CSV file of stop, node, x, y, z."),
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
            by=by,
            props=props,
            tighten_first=tighten_first,
            load=load,
            weight=weight,
            lift=lift,
            groups=groups,
            way=way,
            step=step,
            output=output,
        )
    )
