"""Finds a Python that runs the peers, or makes one: their wheels are made for some Pythons only."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

PACKAGES = {
    "opensees": (["openseespy"], "import openseespy.opensees"),
    "kratos": (
        ["KratosMultiphysics", "KratosStructuralMechanicsApplication", "KratosLinearSolversApplication"],
        "import KratosMultiphysics.StructuralMechanicsApplication, KratosMultiphysics.LinearSolversApplication",
    ),
}


def find(asked: str | None) -> tuple[str | None, dict[str, str]]:
    """A Python for the peers, and for each peer that doesn't run on it one sentence that says why.

    `asked`, the environment variable SHELLFORM_PEERS_PYTHON, or a virtual environment of the user's cache,
    made with any Python 3.12 that is found.
    """
    python = asked or os.environ.get("SHELLFORM_PEERS_PYTHON")
    if python is None:
        python, reason = _made()
        if python is None:
            return None, dict.fromkeys(PACKAGES, reason)
    missing = {}
    for name, (_, statement) in PACKAGES.items():
        try:
            done = subprocess.run([python, "-c", statement], capture_output=True, text=True, timeout=300)
        except OSError as error:
            return None, dict.fromkeys(PACKAGES, f"{python} doesn't start: {error}.")
        if done.returncode:
            last = (done.stderr.strip().splitlines() or ["no message"])[-1]
            missing[name] = f"{name} doesn't import in {python}: {last}"
    return python, missing


def versions(python: str) -> str:
    """The peers that a Python has, with their versions."""
    names = [packages[0] for packages, _ in PACKAGES.values()]
    listing = "import importlib.metadata as m, sys; [print(d.name, d.version) for d in m.distributions() if d.name in sys.argv[1:]]"
    done = subprocess.run([python, "-c", listing, *names], capture_output=True, text=True, check=True)
    return ", ".join(sorted(set(done.stdout.splitlines())))


def _made() -> tuple[str | None, str]:
    home = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "shellform-peers"
    python = home / "bin" / "python"
    if (home / "complete").is_file():
        return str(python), ""
    base = _python()
    if base is None:
        return (
            None,
            "The peers' wheels need Python 3.12, and there is none here; give one with --peers-python.",
        )
    print(f"Installing the peers into {home} with {base}, once ...", file=sys.stderr)
    done = subprocess.run([base, "-m", "venv", str(home)], capture_output=True, text=True)
    if done.returncode:
        return (
            None,
            f"No virtual environment could be made with {base}: {done.stderr.strip() or done.stdout.strip()}",
        )
    for packages, _ in PACKAGES.values():  # each by itself: one may install where the other doesn't
        done = subprocess.run(
            [str(python), "-m", "pip", "install", "-q", *packages], capture_output=True, text=True
        )
        if done.returncode:
            last = (done.stderr.strip().splitlines() or ["no message"])[-1]
            print(f"{packages[0]} doesn't install with {base}: {last}", file=sys.stderr)
    (home / "complete").touch()
    return str(python), ""


def _python() -> str | None:
    """A Python 3.12: the running one, one on the path, or one of pyenv's."""
    if sys.version_info[:2] == (3, 12):
        return sys.executable
    pyenv = sorted((Path.home() / ".pyenv" / "versions").glob("3.12*/bin/python"))
    for candidate in [shutil.which("python3.12"), *map(str, pyenv)]:
        if candidate and subprocess.run([candidate, "--version"], capture_output=True).returncode == 0:
            return candidate
    return None
