"""`shellform report`: the page of runs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


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
