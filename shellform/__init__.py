"""Designing bending-active gridshells as falsework for concrete shells.

    import shellform as sf
    from shellform import cad, mma, render

Everything is loaded when it is first used: `import shellform` itself loads no large library.
"""

from __future__ import annotations

import importlib
import sys
from functools import partial
from typing import Any

__version__ = "0.2.0"

_HOMES = {
    "shellform.errors": ("InputError", "NotConverged", "ShellformError"),
    "shellform.surface.target": ("Surface", "make_surface"),
    "shellform.surface.reading": ("read_surface",),
    "shellform.net.chebyshev": ("pull_net",),
    "shellform.net.net": ("Net",),
    "shellform.design.gridshell": ("Rod", "Joint", "Cable", "Design", "Gridshell", "brace"),
    "shellform.design.loads": ("Region",),
    "shellform.design.catalogue": ("Catalogue", "read_catalogue", "rounded_up", "neighbours"),
    "shellform.design.problem": ("Problem", "follow", "deviations"),
    "shellform.design.terms": ("Share", "AtMost", "Misfit", "RmsMisfit", "CableForce", "CableForces", "RodRadius"),
    "shellform.design.checks": ("RodUtilisation", "ConnectorTurn", "LargestCableForce", "Slackness", "Softness", "Uplift"),
    "shellform.design.robust": ("RobustMisfit",),
    "shellform.design.scatter": ("Scatter",),
}
_ROOMS = {
    "cad": "shellform.surface.cad",
    "meshes": "shellform.surface.meshes",
    "funicular": "shellform.surface.funicular",
    "mma": "shellform.design.mma",
    "calibration": "shellform.design.calibration",
    "comparison": "shellform.design.comparison",
    "site": "shellform.design.site",
    "erection": "shellform.design.erection",
    "robust": "shellform.design.robust",
    "render": "shellform.output.render",
    "plots": "shellform.output.plots",
    "nesting": "shellform.output.nesting",
    "schedules": "shellform.output.schedules",
    "drawings": "shellform.output.drawings",
    "exports": "shellform.output.exports",
    "model": "shellform.structure.model",
    "analysis": "shellform.structure.analysis",
    "study": "shellform.study",
}
_NAMES = {name: home for home, names in _HOMES.items() for name in names}


def __getattr__(name: str) -> Any:
    if name in _NAMES:
        return getattr(importlib.import_module(_NAMES[name]), name)
    if name in _ROOMS:
        return importlib.import_module(_ROOMS[name])
    raise AttributeError(f"module 'shellform' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*globals(), *_NAMES, *_ROOMS])


_PICTURES = {
    ("shellform.net.net", "Net"): "net_png",
    ("shellform.design.gridshell", "Gridshell"): "gridshell_png",
    ("shellform.design.optimum", "Optimum"): "optimum_png",
}


def load_ipython_extension(ipython: Any) -> None:
    """Nets, gridshells and optima show their picture where they are displayed (`%load_ext shellform`; done by itself where IPython runs)."""
    formatter = ipython.display_formatter.formatters["image/png"]
    for (home, name), function in _PICTURES.items():
        formatter.for_type_by_name(home, name, partial(_drawn, function))


def _drawn(function: str, thing: Any) -> bytes:
    picture: bytes = getattr(importlib.import_module("shellform.notebook"), function)(thing)
    return picture


if "IPython" in sys.modules and (_running := sys.modules["IPython"].get_ipython()) is not None:
    load_ipython_extension(_running)
