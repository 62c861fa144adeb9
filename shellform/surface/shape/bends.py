"""How a surface is curved for the most part: shares of its area, and a mean. What was asked of the last few
surfaces is kept, since a first design asks it for every rod of a catalogue.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from shellform.surface.shape.target import Surface, curvature
from shellform.surface.shape.triangles import vertex_areas

_SHOWN = 0.95  # of the surface's area keeps the curvature by which cells are sized
_USUALLY = 0.75  # of its area: what is curved more may be creases, which bear nothing
_KEPT = 4  # surfaces: one that is rounded step by step is asked beside its last shapes


def curvature_shown(surface: Surface) -> float:
    """The larger principal curvature, 1/m, that all but a twentieth of the surface keeps."""
    return _kept_by(surface, _SHOWN)


def curvature_usual(surface: Surface) -> float:
    """The larger principal curvature, 1/m, that three quarters of the surface keep: how it would be curved
    without its creases."""
    return _kept_by(surface, _USUALLY)


@lru_cache(maxsize=_KEPT)
def curvature_mean_square(surface: Surface) -> float:
    """The mean over the surface, 1/m², of the squares of both principal curvatures."""
    weight = vertex_areas(surface.vertices, surface.triangles)
    return float(np.average((curvature(surface) ** 2).mean(axis=1), weights=weight))


@lru_cache(maxsize=2 * _KEPT)
def _kept_by(surface: Surface, share: float) -> float:
    """The larger principal curvature, 1/m, that a share of the area keeps."""
    bent, weight = np.abs(curvature(surface)).max(axis=1), vertex_areas(surface.vertices, surface.triangles)
    order = np.argsort(bent)
    return float(bent[order][np.searchsorted(np.cumsum(weight[order]), share * weight.sum())])
