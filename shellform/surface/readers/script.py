"""Builder scripts: Python files with a function `build(gmsh, *, name=default, ...)`, and perhaps `form` (see
cad.py).
"""

from __future__ import annotations

import difflib
import importlib.util
import inspect
import math
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

from shellform.errors import InputError, require_file


def load_script(path: Path) -> ModuleType:
    """The script, run as a module. Raises InputError where it is no Python script or fails."""
    require_file(path)
    spec = importlib.util.spec_from_file_location(f"surface_{path.stem}", path)
    if spec is None or spec.loader is None:
        raise InputError("isn't a Python script", where=str(path), remedy="Builder scripts end in .py.")
    module = importlib.util.module_from_spec(spec)
    try:
        # not by its loader, which keeps what it compiles beside the script and takes it up by time and size
        exec(compile(path.read_bytes(), str(path), "exec", dont_inherit=True), module.__dict__)
    except (Exception, SystemExit) as error:  # whatever somebody's script raises
        raise InputError(
            f"the script fails: {type(error).__name__}: {error}",
            where=str(path),
            remedy="Mend the script: build(gmsh, *, length=0.90, ...) draws the surface with gmsh.",
        ) from error
    return module


def builder(module: ModuleType, path: Path) -> Callable[..., Any]:
    """The script's function `build`. Raises InputError where it has none."""
    found = getattr(module, "build", None)
    if not callable(found):
        raise InputError(
            "has no function build(gmsh, *, ...)", where=str(path), remedy="See surfaces/dome.py."
        )
    return found  # type: ignore[no-any-return]


def named_dimensions(build: Callable[..., Any], given: dict[str, float], path: Path) -> dict[str, float]:
    """The dimensions, m, that `build` takes by keyword, those `given` in place of its defaults. Raises
    InputError for a name that it doesn't take, and for a value or a default that is no positive number."""
    parameters = inspect.signature(build).parameters.values()
    known = {p.name: p.default for p in parameters if p.kind is inspect.Parameter.KEYWORD_ONLY}
    for name, value in known.items():
        if not _is_length(value):
            raise InputError(
                f"its dimension {name!r} has no positive default",
                where=str(path),
                remedy=f"Write {name}=0.90, say, m.",
            )
    for name, value in given.items():
        if name not in known:
            near = difflib.get_close_matches(name, known, n=1)
            hint = f"Did you mean {near[0]!r}? " if near else ""
            raise InputError(
                f"{path.name} has no dimension {name!r}",
                where="surface.dimensions",
                remedy=f"{hint}Known: {', '.join(known)}.",
            )
        if not _is_length(value):
            raise InputError(
                "must be a positive number",
                where=f"surface.dimensions.{name}",
                value=value,
                remedy=f"Give metres, such as {known[name]:g}, or leave it out.",
            )
    return {name: float(value) for name, value in {**known, **given}.items()}


def _is_length(value: object) -> bool:
    return (
        isinstance(value, int | float)
        and not isinstance(value, bool)
        and math.isfinite(value)
        and value > 0.0
    )
