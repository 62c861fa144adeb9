"""`shellform survey`: the next turns of the turnbuckles."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from shellform.cli.terminal import tell_lines
from shellform.errors import InputError


def survey(
    run: Annotated[Path, typer.Argument(help="Run folder.")],
    measured: Annotated[
        Path | None,
        typer.Argument(
            metavar="SURVEY.csv",
            help="node or crossing, x, y, z in the model's axes, counted from the case's origin or the survey's; "
            "or x, y, z in any axes and order.",
        ),
    ] = None,
    design: Annotated[
        str | None, typer.Option(help="As which the grid was built; left out: the one to build.")
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
        Path | None,
        typer.Option(help="belief-1.npz of the round before (belief-2.npz, …), once its turns were made."),
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
    from shellform.structure.solve.memory import limited_to_free_memory

    if (measured is None) == (replay is None):
        raise InputError(
            "needs either a survey or --replay",
            where="survey",
            remedy="Name a CSV file of the survey, or give --replay 4, say, without one.",
        )
    options = onsite.Survey(
        design=design,
        load=load,
        unit=unit,
        noise=noise,
        length_error=length_error,
        step=step,
        largest=largest,
        cables=cables,
        after=after,
    )
    with limited_to_free_memory():  # it holds how every node answers to every cable
        if replay is not None:
            tell_lines(
                onsite.replay(
                    run, options, rounds=replay, seed=seed, slip=slip, markers=markers, output=output
                )
            )
        elif measured is not None:
            tell_lines(onsite.survey(run, measured, options, output))
