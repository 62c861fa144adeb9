"""`shellform new`: a commented case file for a surface."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from shellform.cli.options import Scripts, with_surface_options
from shellform.cli.terminal import tell_labelled


@with_surface_options
def new(
    surface: Annotated[Path, typer.Argument(help="A surface file or shipped builder script.")],
    output: Annotated[Path, typer.Option(help="Case file to write, CASE.toml.")],
    surface_options: Mapping[str, Any],
    allow_scripts: Scripts = False,
) -> None:
    """Write a commented case file for a surface."""
    from shellform.run.propose import propose_case

    tell_labelled(propose_case(surface, output, surface_options, allow_scripts=allow_scripts))
