"""How a net covers its surface: where this lies farther from every rod than formwork on rods reaches.

The surface is sampled a quarter of the spacing apart. Within a cell nothing lies farther from its rods than
half a spacing; samples farther than three quarters from any are bare, and those beside one another make a
patch: a corner into which no rod with joints reaches, say. Concrete there lies on nothing of the grid.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from shellform.arrays import Flags, Reals
from shellform.net.grid import Grid
from shellform.net.refusal import NoNet, Reason
from shellform.quantities import coordinates, number
from shellform.structure.elements.state import State
from shellform.structure.network import connected
from shellform.surface.shape.target import Surface
from shellform.surface.shape.tree import Tree
from shellform.surface.shape.triangles import triangle_areas

BARE = 0.75  # of the spacing: farther from every rod the surface is bare
UNCOVERED = 0.02  # of the surface: more of it is refused
NOTABLE = 0.25  # of a cell: less that is bare is not worth a word
_SAMPLE, _MOST_PARTS = 0.25, 32  # of the spacing, between samples; parts of a triangle's side
_BESIDE = 1.2  # times the farthest that samples beside one another lie apart
_TOUCHING = 1.8  # sides between two boxes that share a face, an edge or a corner, at the most
_NAMED = 4  # patches that are told one by one


@dataclass(frozen=True)
class BarePatch:
    """A part of the surface beyond the rods: its `area`, m²; the `place`, m, in it that is farthest from any
    rod, and how far that is `away`, m."""

    area: float
    place: tuple[float, float, float]
    away: float


@dataclass(frozen=True)
class Cover:
    """What a net covers of a surface of so much `area`, m²: all but its `patches`, the largest first."""

    area: float
    patches: tuple[BarePatch, ...]

    @property
    def bare(self) -> float:
        """The area of all patches, m²."""
        return sum(each.area for each in self.patches)

    @property
    def share(self) -> float:
        """Of the surface that is bare."""
        return self.bare / self.area if self.area > 0.0 else 0.0


def cover(surface: Surface, grid: Grid, state: State, built: Callable[[Reals], Flags] | None = None) -> Cover:
    """How the grid in its state covers the surface, or what is `built` of it: of points (k, 3), m, on it
    whether they are (k,)."""
    ends = state.positions[grid.rod_ends]
    rods = Tree(np.stack([ends[:, 0], ends[:, 1], ends[:, 1]], axis=1))
    corner = surface.vertices[surface.triangles]
    area = triangle_areas(surface.vertices, surface.triangles)
    longest = float(np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2).max())
    parts = int(np.clip(np.ceil(longest / (_SAMPLE * grid.scale)), 1, _MOST_PARTS))
    weights = _samples(parts)
    whole = 0.0
    places, lies, pieces = [], [], []
    for weight in weights:  # one sample of every triangle at a time keeps memory small
        points, piece = np.tensordot(weight, corner, axes=(0, 1)), area / len(weights)
        if built is not None:
            kept = built(points)
            points, piece = points[kept], piece[kept]
        whole += float(piece.sum())
        away = rods.nearest(points)[2]
        bare = away > BARE * grid.scale
        places.append(points[bare])
        lies.append(away[bare])
        pieces.append(piece[bare])
    apart = _BESIDE * max(longest / parts, _SAMPLE * grid.scale)
    return Cover(whole, _patches(np.concatenate(places), np.concatenate(lies), np.concatenate(pieces), apart))


def _samples(parts: int) -> Reals:
    """Barycentric coordinates (k, 3) of the middles of a triangle's parts, as many as fit beside one another
    along its sides."""
    i, j = (each.ravel() for each in np.meshgrid(np.arange(parts), np.arange(parts)))
    up, down = i + j < parts, i + j < parts - 1
    shares = np.vstack([np.column_stack([i, j])[up] + 1.0 / 3.0, np.column_stack([i, j])[down] + 2.0 / 3.0])
    return np.column_stack([1.0 - shares.sum(axis=1) / parts, shares / parts])


def _patches(places: Reals, away: Reals, area: Reals, apart: float) -> tuple[BarePatch, ...]:
    """The bare samples at `places` (k, 3) put together where they lie in boxes of the side `apart`, m, that
    touch: of a fine mesh far too many lie beside one another to be looked at pair by pair."""
    if not len(places):
        return ()
    boxes, box = np.unique(np.floor(places / apart), axis=0, return_inverse=True)
    _, label = connected(len(boxes), cKDTree(boxes).query_pairs(_TOUCHING, output_type="ndarray"))
    patch = label[box.ravel()]
    areas = np.bincount(patch, area)
    by_patch = np.lexsort((away, patch))
    farthest = by_patch[np.append(np.flatnonzero(np.diff(patch[by_patch])), len(patch) - 1)]
    found = [
        BarePatch(float(areas[k]), (x, y, z), float(away[farthest[k]]))
        for k, (x, y, z) in enumerate(places[farthest].tolist())
    ]
    return tuple(sorted(found, key=lambda each: (-each.area, each.place)))


def patches_told(patches: tuple[BarePatch, ...]) -> str:
    """Where they are, in words: "1.4 m² at (0.4, 1.9, 6.9) m, up to 1.3 m from any rod"."""
    told = [
        f"{number(each.area, 2)} m² at {coordinates(each.place)} m, up to {number(each.away, 2)} m from any rod"
        for each in patches[:_NAMED]
    ]
    more = len(patches) - _NAMED
    return "; ".join([*told, *([f"and {more} more"] if more > 0 else [])])


def refuse_bare(found: Cover, most: float, spacing: float) -> None:
    """Raises NoNet where more than the share `most` of the surface lies beyond the rods."""
    if found.share <= most:
        return
    raise NoNet(
        Reason.BARE,
        f"{100.0 * found.share:.3g} % of the surface lie farther than {BARE:g} spacings from any rod, where "
        f"{100.0 * most:.3g} % may: {patches_told(found.patches)}",
        where="net.spacing",
        value=spacing,
        remedy="Choose another angle or offset, or a smaller spacing; or raise net.uncovered_max, for formwork that stands on "
        "props of its own there.",
    )
