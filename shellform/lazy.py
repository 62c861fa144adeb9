"""Public names that are loaded when they are first used.

The stub beside a package, `__init__.pyi`, is the one list of its public names: type checkers and editors read
it as it stands, and the package itself reads it when the first name is asked for. So the two can't drift, and
importing the package loads nothing (the idea of Scientific Python's SPEC 1).
"""

from __future__ import annotations

import ast
import importlib
import pkgutil
import sys
from collections.abc import Callable
from functools import cache


@cache
def homes(package: str) -> dict[str, tuple[str, str]]:
    """Where each public name of the `package` comes from: (module, name there), read from its stub.

    A stub holds `from module import name as name`, the form that exports, and `name = other` for another
    name.
    """
    found: dict[str, tuple[str, str]] = {}
    for node in ast.parse(pkgutil.get_data(package, "__init__.pyi") or b"").body:
        if isinstance(node, ast.ImportFrom):
            found |= {each.asname or each.name: (node.module or "", each.name) for each in node.names}
        elif isinstance(node, ast.Assign) and isinstance(node.value, ast.Name):
            found |= {each.id: found[node.value.id] for each in node.targets if isinstance(each, ast.Name)}
    return {name: home for name, home in found.items() if not name.startswith("_")}


def public(package: str) -> tuple[Callable[[str], object], Callable[[], list[str]]]:
    """The functions `__getattr__` and `__dir__` of a `package` whose `__init__` defines nothing else."""

    def get(name: str) -> object:
        if name.startswith("_") or name not in homes(package):
            raise AttributeError(f"module {package!r} has no attribute {name!r}", name=name)
        module, original = homes(package)[name]
        if module == package:  # a room of the package itself
            return importlib.import_module(f"{package}.{original}")
        return getattr(__import__(module, fromlist=[original]), original)

    def names() -> list[str]:
        own = [name for name in vars(sys.modules[package]) if name.startswith("__")]
        return sorted({*own, *homes(package)})

    return get, names
