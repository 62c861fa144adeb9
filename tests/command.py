"""The command line as a user calls it: within this process, which saves the second in which Python and the
libraries are loaded, or, where it is about a process, in one of its own.
"""

import contextlib
import io
import os
import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from unittest import mock

from shellform.cli import program

ROOT = Path(__file__).parent.parent


@dataclass(frozen=True)
class Ended:
    """What a command left, by the names of subprocess.CompletedProcess."""

    returncode: int
    stdout: str
    stderr: str


def shellform(*arguments):
    """Runs a command in the repository's folder; an error that is no refusal comes through as it is."""
    out, err = io.StringIO(), io.StringIO()
    status = 0
    with (
        mock.patch.object(sys, "argv", ["shellform", *map(str, arguments)]),
        mock.patch.dict(os.environ),
        contextlib.chdir(ROOT),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        try:
            program.main()
        except SystemExit as end:
            status = int(end.code or 0)
    return Ended(status, out.getvalue(), err.getvalue())


def shellform_process(*arguments, env=None, before=None, timeout=300):
    """As `shellform`, in a fresh process; `before` is called in it, `env` is added to its environment."""
    return subprocess.run(
        [sys.executable, "-m", "shellform", *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=timeout,
        cwd=ROOT,
        env={**os.environ, **(env or {})},
        preexec_fn=before,
        check=False,
    )


def begin(*arguments, **settings):
    """A command's process, to be stopped on its way: Ctrl-C reaches it even where this one doesn't hear
    it."""
    return subprocess.Popen(
        [sys.executable, "-m", "shellform", *map(str, arguments)],
        stderr=subprocess.PIPE,
        text=True,
        cwd=ROOT,
        preexec_fn=_heed_ctrl_c,
        **settings,
    )


def _heed_ctrl_c():
    signal.signal(signal.SIGINT, signal.default_int_handler)
