"""`shellform check`: what a surface or a case is, in seconds."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from shellform.cli.options import Json, Scripts, with_surface_options
from shellform.cli.terminal import Spinner, tell_labelled
from shellform.records.progress import Event


@with_surface_options
def check(
    file: Annotated[Path, typer.Argument(help="A surface or a case file.")],
    surface_options: Mapping[str, Any],
    allow_scripts: Scripts = False,
    as_json: Json = False,
) -> None:
    """Read a surface or case and report what it is."""
    from shellform.run.first_look import check_file, labelled

    with Spinner() as report:
        report(Event("check", f"reading {file.name}"))
        found = check_file(file, surface_options, allow_scripts=allow_scripts)
    if as_json:
        print(json.dumps(found.document(), indent=1))
    else:
        tell_labelled(labelled(found))
