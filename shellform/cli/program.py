"""The program: one module a command, and the status with which it ends (documentation/how-to/failed.md).

Large libraries are loaded by the command that needs them.
"""

from __future__ import annotations

import contextlib
import os
import sys
from typing import Annotated

import typer

import shellform
from shellform.cli.analyse import analyse
from shellform.cli.calibrate import calibrate
from shellform.cli.check import check
from shellform.cli.design import design
from shellform.cli.docs import docs
from shellform.cli.erect import erect
from shellform.cli.example import example
from shellform.cli.interruption import ctrl_c, heed, pressed
from shellform.cli.net import net
from shellform.cli.new import new
from shellform.cli.render import render
from shellform.cli.report import report
from shellform.cli.study import study
from shellform.cli.survey import survey
from shellform.cli.terminal import refusal_words
from shellform.cli.verify import verify
from shellform.errors import STOPPED, InputError

# bytes of addresses: where fewer were free, libraries ended the program or never came back
_ROOM_TO_SOLVE, _ROOM_TO_DESIGN = 590_000_000, 1_200_000_000
_SOLVING, _READING = ("analyse", "verify"), ("docs", "example")
_UNREAD = 3  # whoever read the output was gone before it was told how the command ends
_RESUMED = ("design", "study")


app = typer.Typer(
    name="shellform",
    help="Design bending-active gridshells as falsework for concrete shells.",
    invoke_without_command=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
for _command in (
    example,
    check,
    new,
    net,
    design,
    analyse,
    render,
    study,
    report,
    calibrate,
    survey,
    erect,
    verify,
    docs,
):
    app.command()(_command)


def _version(asked: bool) -> None:
    if asked:
        from importlib.metadata import PackageNotFoundError, version

        print(f"shellform {shellform.__version__}")
        for name in ("numpy", "scipy", "numba", "cvxopt", "gmsh", "nlopt", "pyvista", "ezdxf", "dask"):
            try:
                print(f"{name} {version(name)}")
            except PackageNotFoundError:
                print(f"{name} is missing")
        raise typer.Exit


@app.callback()
def _options(
    context: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show versions.")
    ] = False,
) -> None:
    if context.invoked_subcommand is None:
        print(context.get_help(), file=sys.stderr)
        raise typer.Exit(2)
    if context.invoked_subcommand not in _READING:
        _require_room(_ROOM_TO_SOLVE if context.invoked_subcommand in _SOLVING else _ROOM_TO_DESIGN)


def _require_room(size: int) -> None:
    from shellform.structure.solve.addresses import has_room

    if not has_room(size):
        raise InputError(
            "leaves no room for the libraries that are loaded",
            where="the limit on memory (ulimit -v)",
            remedy="Allow 650 MB to analyse a model, 1.5 GB to design.",
        )


def main() -> None:
    """Runs the command line: status 0 done, 2 input refused, 3 no result or a design that doesn't hold, 130
    stopped.
    """
    with ctrl_c():
        try:
            status = app(standalone_mode=False)  # typer turns Ctrl-C into a returned status
            heed()
            if status == STOPPED:
                raise KeyboardInterrupt
            _hand_over()
            sys.exit(status if isinstance(status, int) else 0)
        except SystemExit as end:
            if isinstance(end.__context__, BrokenPipeError):  # as typer and rich leave then
                sys.exit(_UNREAD)
            raise
        except (KeyboardInterrupt, typer.Abort):
            _leave(_stopped(sys.argv[1:]), STOPPED)
        except typer.Exit as stop:
            sys.exit(stop.exit_code)
        except Exception as error:
            if pressed():  # compiled loops, and processes that read for this one, make errors of it
                _leave(_stopped(sys.argv[1:]), STOPPED)
            _fail(error)


def _stopped(arguments: list[str]) -> str:
    """What Ctrl-C leaves of the command that stands first among the arguments, and what to do."""
    command = next((each for each in arguments if not each.startswith("-")), "")
    if command in _RESUMED:
        return "stopped; what was computed is kept, and the same command goes on from there"
    return "stopped; what was not finished is lost, and the same command begins anew"


def _hand_over() -> None:
    """Writes what standard output still holds, while it can be told that it takes no more; Python would try
    once more as it ends, and make a status of its own of it."""
    try:
        print(end="", flush=True)
    except OSError as error:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if not isinstance(error, BrokenPipeError):  # whoever read it has had enough, and the command is done
            raise


def _fail(error: Exception) -> None:
    """Says what was wrong, and leaves; an error that is no one's but ours is raised again."""
    said = refusal_words(error)
    if said is None:
        raise error
    _leave(*said)


def _leave(message: str, status: int) -> None:
    with contextlib.suppress(OSError):  # either of them may be what takes no more
        _hand_over()
    with contextlib.suppress(OSError):
        print(f"shellform: {message}", file=sys.stderr)
    sys.exit(status)
