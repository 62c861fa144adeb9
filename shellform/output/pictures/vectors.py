"""Pages as lines (SVG, PDF), for papers: small, sharp at any size, and made without OpenGL.

The camera's projection is the pixel pictures' own. What is farther away is drawn first, element by element;
arrows stand between the elements at their depth, in bands. A surface is shown by its edges and its contour,
where it turns away from the eye.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shellform.arrays import Reals
from shellform.output.pictures import plots
from shellform.output.pictures.legend import LOAD, SLACK, SUPPORT, SURFACE, cable_colours, rod_colours
from shellform.output.pictures.panel import (
    EDGE_BEAM,
    Panel,
    Skin,
    arrow_length,
    cable_thickness,
    drawn_radius,
)
from shellform.output.pictures.sheets import Canvas, Drawing
from shellform.output.pictures.view import Camera
from shellform.surface.shape.triangles import area_vectors, directed_edges

_BANDS = 12  # of depth, between which arrows stand
_OUTLINE = 1.2  # pixels


def write(path: str | Path, page: Canvas) -> None:
    """Writes the page; the ending of `path` chooses .svg or .pdf."""
    plots.save(_drawn(page), path)


def rasterised(page: Canvas) -> NDArray[np.uint8]:
    """The page of lines as an array (height, width, 3), or 4 without a background."""
    image = plots.pixels(_drawn(page))
    return image if page.look.transparent else image[..., :3]


def _drawn(page: Canvas) -> Any:
    axes = plots.blank(page.size, transparent=page.look.transparent, dots=page.look.dots)
    for each in page.drawings:
        corner = (float(each.corner[0]), float(page.size[1] - each.corner[1] - each.size[1]))
        if each.panel is not None:
            _add(axes, each, each.panel, page, np.array(corner))
        for word in each.words:
            plots.letter(axes, word, corner)
        for ramp in each.ramps:
            plots.strip(axes, ramp, corner)
    return axes


def _add(axes: Any, drawing: Drawing, panel: Panel, page: Canvas, corner: Reals) -> None:
    scale, camera, look = page.scale, page.camera, page.look
    pixel = camera.height / drawing.size[1]
    middle = corner + 0.5 * np.array(drawing.size)

    def flat(points: Reals) -> tuple[Reals, Reals]:
        """Pixels on the page (n, 2), and how near to the eye (n,), m."""
        seen = camera.seen(points)
        return seen[:, :2] / pixel + middle, seen[:, 2]

    if look.surface is not None:
        outline = flat(look.surface.vertices)[0][_outline(look.surface, camera)]
        plots.strokes(
            axes, outline, np.full(len(outline), _OUTLINE), np.tile(_rgb(SURFACE), (len(outline), 1))
        )
    radius = drawn_radius(panel, look, camera.width) / pixel
    place, near = flat(panel.positions)
    _supports(axes, place[panel.supports], max(radius, 0.0024 * drawing.size[0]))

    share = np.clip(panel.cable_forces / (scale.force or 1.0), 0.0, 1.0)
    ties = np.where((share > 0.0)[:, None], cable_colours(share) / 255.0, _rgb(SLACK))
    rods = rod_colours(panel.deviation[panel.beams].mean(axis=1) / scale.limit) / 255.0
    edges = len(panel.edges)
    pairs = np.vstack([panel.beams, panel.cables, panel.edges])
    thick = [np.ones(len(rods)), cable_thickness(share), np.full(edges, EDGE_BEAM)]
    widths = 2.0 * radius * np.concatenate(thick)
    colours = np.vstack([rods, ties, np.tile(_rgb(SUPPORT), (edges, 1))])
    depth = near[pairs].mean(axis=1)
    tips, tips_near = flat(panel.positions[panel.load_points] + [0.0, 0.0, arrow_length(scale)])
    feet = place[panel.load_points]
    order = np.argsort(depth, kind="stable")
    shown = np.zeros(len(tips), dtype=bool)
    for band in np.array_split(order, _BANDS):
        if not len(band):
            continue
        plots.strokes(axes, place[pairs[band]], widths[band], colours[band])
        here = ~shown & (tips_near <= depth[band[-1]])
        _arrows(axes, tips[here], feet[here], radius)
        shown |= here
    _arrows(axes, tips[~shown], feet[~shown], radius)


def _arrows(axes: Any, tails: Reals, heads: Reals, radius: float) -> None:
    """Arrows from the tails to the heads (k, 2), pixels; from above they are dots."""
    if not len(tails):
        return
    along = heads - tails
    length = np.linalg.norm(along, axis=1, keepdims=True)
    dots = (length < 6.0 * radius).ravel()
    way = along / np.maximum(length, 1e-9)
    across = way[:, ::-1] * [-1.0, 1.0]
    tip = heads - radius * way
    neck = tip - 0.35 * length * way
    wide = 0.11 * length * across
    colour = np.tile(_rgb(LOAD), (len(tails), 1))
    plots.strokes(
        axes,
        np.stack([tails, neck], axis=1)[~dots],
        np.maximum(0.06 * length.ravel(), 0.8)[~dots],
        colour[~dots],
    )
    plots.areas(axes, np.stack([tip, neck + wide, neck - wide], axis=1)[~dots], LOAD)
    plots.strokes(
        axes, np.stack([heads, heads], axis=1)[dots], np.full(int(dots.sum()), 2.4 * radius), colour[dots]
    )


def _supports(axes: Any, place: Reals, radius: float) -> None:
    corners = radius * np.array([[0.0, 0.0], [2.5, -5.0], [-2.5, -5.0]])
    plots.areas(axes, place[:, None] + corners, SUPPORT)


def _outline(skin: Skin, camera: Camera) -> NDArray[np.int64]:
    """The edges (e, 2) at which the surface ends, and those between a face that looks to the eye and one that
    looks away.
    """
    facing = area_vectors(skin.vertices, skin.triangles) @ camera.away > 0.0
    edges = np.sort(directed_edges(skin.triangles), axis=1)
    found, where, count = np.unique(edges, axis=0, return_inverse=True, return_counts=True)
    fronts = np.bincount(where.ravel(), weights=np.tile(facing, 3), minlength=len(found))
    return found[(count == 1) | ((fronts > 0) & (fronts < count))]


def _rgb(colour: str) -> Reals:
    return np.array([int(colour[k : k + 2], 16) / 255.0 for k in (1, 3, 5)])
