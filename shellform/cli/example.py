"""`shellform example`: a case that comes with the package, ready to compute."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from shellform.cli.terminal import tell_labelled


def example(
    name: Annotated[str | None, typer.Argument(help="Which; left out: they are listed.")] = None,
    folder: Annotated[
        Path | None, typer.Argument(metavar="[DIR]", help="Where to; left out: a folder of that name, here.")
    ] = None,
) -> None:
    """Lay a case that comes with shellform, and its surface, into a folder."""
    from shellform.case.examples import EXAMPLES, lay_example

    if name is None:
        tell_labelled({each: example.about for each, example in EXAMPLES.items()})
        return
    place = folder or Path(name)
    for file in lay_example(name, place):
        print(file)
    print(f"Next:\n  cd {shlex.quote(str(place))}\n  {EXAMPLES[name].command}")
