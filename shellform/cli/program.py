"""The program: runs a command (commands.py) and ends with its status (contracts/run-folder.md)."""

from __future__ import annotations

import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import typer

from shellform.cli.commands import app
from shellform.errors import InputError, NotConverged

_STOPPED = 130
_KEPT = "stopped; what was computed is kept, and the same command goes on from there"


def main() -> None:
    """Runs the command line: status 0 done, 2 input refused, 3 no result, 130 stopped."""
    with _ctrl_c() as stopped:
        try:
            status = app(standalone_mode=False)  # typer turns Ctrl-C into a returned status
            if status == _STOPPED:
                raise KeyboardInterrupt
            sys.exit(status if isinstance(status, int) else 0)
        except (KeyboardInterrupt, typer.Abort):
            _leave(_KEPT, _STOPPED)
        except typer.Exit as stop:
            sys.exit(stop.exit_code)
        except Exception as error:
            if stopped:
                _leave(_KEPT, _STOPPED)
            _fail(error)


@contextmanager
def _ctrl_c() -> Iterator[list[int]]:
    """A list that is empty until Ctrl-C is pressed: compiled loops, and processes that read for this one,
    turn the interruption into errors of their own."""
    stopped: list[int] = []

    def note(number: int, frame: object) -> None:
        stopped.append(number)
        raise KeyboardInterrupt

    usual = signal.getsignal(signal.SIGINT)
    if usual is not signal.default_int_handler:  # ignored, as in a job of a shell that runs in the background
        yield stopped
        return
    signal.signal(signal.SIGINT, note)
    try:
        yield stopped
    finally:
        signal.signal(signal.SIGINT, usual)


def _fail(error: Exception) -> None:
    """Says what was wrong, and leaves; an error that is no one's but ours is raised again."""
    if isinstance(error, InputError):
        _leave(f"refused: {error}", 2)
    if isinstance(error, NotConverged):
        _leave(f"no result: {error}", 3)
    if isinstance(error, MemoryError):
        _leave("no result: the memory is full. Choose a larger spacing or fewer elements.", 3)
    if getattr(error, "exit_code", None) is None:
        raise error
    said = getattr(error, "format_message", None)  # click's usage errors
    _leave(f"refused: {said() if said else error}", 2)


def _leave(message: str, status: int) -> None:
    print(f"shellform: {message}", file=sys.stderr)
    sys.exit(status)
