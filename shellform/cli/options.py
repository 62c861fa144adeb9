"""Options that several commands share: how a surface file is read, quiet, JSON."""

from __future__ import annotations

import functools
import inspect
import os
from collections.abc import Callable, Mapping
from typing import Annotated, Any

import typer

Unit = Annotated[str | None, typer.Option(help="Unit of files that carry none: m, cm, mm, in, ft.")]
Up = Annotated[
    str | None, typer.Option(help="Vertical axis of the file: z, y or x; -z of a form that hangs.")
]
Size = Annotated[float | None, typer.Option(help="Mesh size on CAD surfaces, m.")]
Layer = Annotated[str | None, typer.Option(help="Layer of the surface in the file.")]
Object = Annotated[str | None, typer.Option("--object", help="Name of the surface in the file.")]
Face = Annotated[str | None, typer.Option(help="Face of a solid: upper or lower.")]
Piece = Annotated[int | None, typer.Option(help="Number of a separate piece, 1 the largest.")]
Fill = Annotated[str | None, typer.Option(help="Openings to close: holes, edges or all.")]
Narrower = Annotated[
    float | None,
    typer.Option(
        help="Holes narrower than this, m, are closed; new closes those narrower than its spacing, 0: none."
    ),
]
Ground = Annotated[float | None, typer.Option(help="Height to which open edges are closed, m.")]
Origin = Annotated[
    tuple[float, float, float] | None,
    typer.Option(help="X Y Z of a survey's coordinates, m, that all others count from."),
]
Above = Annotated[
    float | None,
    typer.Option(help="Level, m, up to which plinths or walls reach: what lies lower is cut off."),
]
_SURFACE = {
    "unit": Unit,
    "up": Up,
    "size": Size,
    "layer": Layer,
    "object": Object,
    "face": Face,
    "piece": Piece,
    "fill": Fill,
    "fill_narrower": Narrower,
    "ground": Ground,
    "origin": Origin,
    "above": Above,
}


def _hush(quiet: bool) -> bool:
    """Passes the wish on to compiled.py, here and in processes that this one starts."""
    if quiet:
        os.environ["SHELLFORM_QUIET"] = "1"
    return quiet


Scripts = Annotated[
    bool, typer.Option("--allow-scripts", help="Run builder scripts from outside the shipped surfaces.")
]
Quiet = Annotated[bool, typer.Option("--quiet", callback=_hush, help="Tell errors only.")]
Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON and nothing else.")]


def with_surface_options(command: Callable[..., None]) -> Callable[..., None]:
    """The command with the options of a case's table [surface] in the place of its parameter
    `surface_options`, which gets those that were given, by name.

    Typer reads a command's options from its signature; so that is where they are put in.
    """
    own = inspect.signature(command, eval_str=True)
    parameters: list[inspect.Parameter] = []
    for parameter in own.parameters.values():
        if parameter.name != "surface_options":
            parameters.append(parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY))
            continue
        parameters += [
            inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=annotation)
            for name, annotation in _SURFACE.items()
        ]

    @functools.wraps(command)
    def gathered(**values: Any) -> None:
        given: Mapping[str, Any] = {
            name: value for name in _SURFACE if (value := values.pop(name)) is not None
        }
        command(surface_options=given, **values)

    gathered.__signature__ = own.replace(parameters=parameters)  # type: ignore[attr-defined]
    gathered.__annotations__ = {each.name: each.annotation for each in parameters}
    return gathered
