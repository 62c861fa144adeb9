"""Designing bending-active gridshells as falsework for concrete shells.

    import shellform as sf
    from shellform import cad, mma, render

Everything is loaded when it is first used: `import shellform` itself loads no large library.
"""

from __future__ import annotations

import importlib
from typing import Any

__version__ = "0.1.0"

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
