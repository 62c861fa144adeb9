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
    "shellform.surface.shape.target": ("Surface", "make_surface"),
    "shellform.surface.readers.reading": ("read_surface",),
    "shellform.net.chebyshev": ("pull_net",),
    "shellform.net.net": ("Net",),
    "shellform.gridshell.gridshell": ("Rod", "Joint", "Cable", "Design", "Gridshell", "brace"),
    "shellform.gridshell.loads": ("Region",),
    "shellform.gridshell.catalogue": ("Catalogue", "read_catalogue", "rounded_up", "neighbours"),
    "shellform.problem.problem": ("Problem", "follow", "deviations"),
    "shellform.problem.terms": (
        "Share",
        "AtMost",
        "Misfit",
        "RmsMisfit",
        "CableForce",
        "CableForces",
        "RodRadius",
    ),
    "shellform.problem.engineering": (
        "RodUtilisation",
        "ConnectorTurn",
        "LargestCableForce",
        "Slackness",
        "Softness",
        "Uplift",
    ),
    "shellform.problem.robust": ("RobustMisfit",),
    "shellform.gridshell.scatter": ("Scatter",),
}
_ROOMS = {
    "cad": "shellform.surface.cad",
    "meshes": "shellform.surface.readers.meshes",
    "funicular": "shellform.surface.funicular",
    "mma": "shellform.optimiser.solver",
    "calibration": "shellform.site.calibration",
    "comparison": "shellform.optimiser.comparison",
    "retensioning": "shellform.site.retensioning",
    "erection": "shellform.site.erection",
    "robust": "shellform.problem.robust",
    "render": "shellform.output.pictures.render",
    "plots": "shellform.output.pictures.plots",
    "nesting": "shellform.output.workshop.nesting",
    "schedules": "shellform.output.workshop.schedules",
    "drawings": "shellform.output.workshop.drawings",
    "exports": "shellform.output.exchange.exports",
    "model": "shellform.structure.model",
    "analysis": "shellform.structure.answers.analysis",
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
    ("shellform.gridshell.gridshell", "Gridshell"): "gridshell_png",
    ("shellform.optimiser.optimum", "Optimum"): "optimum_png",
}


def load_ipython_extension(ipython: Any) -> None:
    """Nets, gridshells and optima show their picture where they are displayed (`%load_ext shellform`; done by
    itself where IPython runs).
    """
    formatter = ipython.display_formatter.formatters["image/png"]
    for (home, name), function in _PICTURES.items():
        formatter.for_type_by_name(home, name, partial(_drawn, function))


def _drawn(function: str, thing: Any) -> bytes:
    picture: bytes = getattr(importlib.import_module("shellform.output.notebook"), function)(thing)
    return picture


if "IPython" in sys.modules and (_running := sys.modules["IPython"].get_ipython()) is not None:
    load_ipython_extension(_running)
