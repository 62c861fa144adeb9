"""`shellform analyse`: any structural model solved."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated

import typer

from shellform.cli.terminal import Spinner
from shellform.errors import InputError, NotConverged


def analyse(
    model: Annotated[Path, typer.Argument(help="Model file (JSON).")],
    load: Annotated[str | None, typer.Option(help="Load case.")] = None,
    factor: Annotated[float, typer.Option(help="Load factor.")] = 1.0,
    increments: Annotated[int, typer.Option(help="Equal increments.")] = 1,
    tolerance: Annotated[float, typer.Option(help="Unbalanced over largest force.")] = 1e-8,
    output: Annotated[Path | None, typer.Option(help="Result file; left out: standard output.")] = None,
    method: Annotated[
        str,
        typer.Option(
            help="relaxation (Newton's with a vanishing mass), dynamic (with velocity and time step), newton, or path (as --path)."
        ),
    ] = "relaxation",
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
    from shellform.records.progress import Event
    from shellform.structure.answers.analysis import analyse as solve
    from shellform.structure.answers.result_document import result
    from shellform.structure.answers.results import read_sections
    from shellform.structure.model import read_model
    from shellform.structure.solve.memory import limited_to_free_memory
    from shellform.written import refuse_overwriting, refuse_unwritable, write_named

    if output is not None:
        refuse_overwriting([output], (model, sections))
        refuse_unwritable(output)
    with Spinner() as report:
        known = read_sections(sections) if sections is not None else None
        with limited_to_free_memory():
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
                    Event("analysis", f"load factor {reached:.4g}, {spent} factorisations")
                ),
            )
        document = result(analysis, sections=known)
    for warning in document["warnings"]:
        print(f"shellform: note: {warning}", file=sys.stderr)
    text = json.dumps(document, allow_nan=False)
    if output is None:
        print(text)
    else:
        write_named(output, text)
    if figures is not None:
        from shellform.output.pictures.model_states import draw_analysis

        for file in draw_analysis(analysis, figures):
            print(file, file=sys.stderr)
    if analysis.message:
        raise NotConverged(analysis.message)


def _lead(text: str) -> tuple[int, int, float]:
    try:
        node, axis, metres = text.split(":")
        return int(node), ["x", "y", "z"].index(axis), float(metres)
    except ValueError as error:
        raise InputError(
            "must read NODE:AXIS:METRES", where="--lead", value=text, remedy="For example 17:z:-0.05."
        ) from error
