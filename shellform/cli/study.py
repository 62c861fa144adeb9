"""`shellform study`: many designs."""

from __future__ import annotations

import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from shellform.cli.interruption import heed
from shellform.cli.options import Json, Quiet, Scripts
from shellform.errors import InputError, how_many

if TYPE_CHECKING:
    from shellform.study.studies import StudyProgress


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
    dashboard: Annotated[
        bool, typer.Option("--dashboard", help="Dask's, open to everybody on this machine.")
    ] = False,
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

        def show(progress: StudyProgress) -> None:
            heed()
            live(progress)

        found = run_study(
            file,
            output,
            workers=workers,
            scheduler=scheduler,
            dashboard=dashboard,
            allow_scripts=allow_scripts,
            show=show,
        )
    for name in () if quiet else found.empty:
        print(
            f"shellform: note: no design has a value for the column {name!r}: is its path in summary.json, "
            "down to one number? Times stand in seconds.csv.",
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
            f"{how_many(found.designs, 'design', 'designs')}, {found.found} found from before{failed}: {found.table}, {found.page}"
        )
