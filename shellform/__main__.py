"""`python -m shellform`, and the command `shellform`: what has to be done before and after the program
itself."""

from __future__ import annotations

import os
import sys
from typing import TextIO

from shellform.errors import STOPPED


def main() -> None:
    """Runs the command line, which Ctrl-C ends with 130 from the first import on.

    Stopped, the process is left at once: libraries that were in the middle of something, above all VTK, may
    crash as they are taken down.
    """
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):  # a terminal that knows fewer letters gets a question mark
            stream.reconfigure(errors="replace")
    status: object = STOPPED
    try:
        from shellform.cli.program import main as run

        run()
    except SystemExit as end:
        status = end.code
        if status != STOPPED:
            raise
    except KeyboardInterrupt:
        print("shellform: stopped", file=sys.stderr)
    if status == STOPPED:
        _flush(sys.stdout)
        _flush(sys.stderr)
        os._exit(STOPPED)


def _flush(stream: TextIO) -> None:
    try:
        stream.flush()
    except (OSError, ValueError):  # whoever read it is gone
        return


if __name__ == "__main__":
    main()
