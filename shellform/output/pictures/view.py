"""The parallel camera under which everything that is to be shown fits, on all panels of a page alike.

In the view's axes right and up, the box of all points is laid into the part of the panel below the title. The
best view looks down obliquely with the plan's long axis across the picture, from that of its four quarters in
which the nodes spread widest: a shell that leans one way is seen from the side to which it opens.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shellform.arrays import Reals, Record
from shellform.errors import InputError
from shellform.output.pictures.legend import title_height
from shellform.output.pictures.panel import Look, Panel, Scale, arrow_length

# Directions from the shell to the eye, and which way is up.
_FIXED = {
    "top": ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0)),
    "front": ((0.0, -1.0, 0.0), (0.0, 0.0, 1.0)),
    "side": ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
}
_OBLIQUE = (1.0, -1.6, 1.1)  # with the long axis along x
# difference of the plan's principal variances over their sum below which no axis is the long one
_ROUND = 0.05
_CLEARER = 1.02  # a later quarter must spread the nodes that much wider to be preferred
_MARGIN = 0.04  # of the panel, around everything
_MOST = 0.7  # of the panel, that titles may take


@dataclass(frozen=True, eq=False)
class Camera(Record):
    """`focus`, m, in the middle of the panel; unit vectors `away` to the eye, `up` and `right`; `height` and
    `width` of what is seen and `depth` from the focus to the farthest point, m."""

    focus: Reals
    away: Reals
    up: Reals
    right: Reals
    height: float
    width: float
    depth: float

    def seen(self, points: Reals) -> Reals:
        """Right, up and towards the eye (n, 3), m, from the focus."""
        return np.asarray((points - self.focus) @ np.column_stack([self.right, self.up, self.away]))


def fitted(panels: Sequence[Panel], look: Look, scale: Scale, size: tuple[int, int]) -> Camera:
    """The camera for panels of `size` pixels: all points, arrows included, lie below the titles."""
    tips = [panel.positions[panel.load_points] + [0.0, 0.0, arrow_length(scale)] for panel in panels]
    further = [] if look.frame is None else [np.asarray(look.frame)]
    further += [] if look.surface is None else [look.surface.vertices]
    points = np.vstack([*(panel.positions for panel in panels), *tips, *further])
    away, up = _directions(look.view, panels[0].positions if look.surface is None else look.surface.vertices)
    right = np.cross(up, away)
    seen = points @ np.column_stack([right, up, away])
    low, high = seen.min(axis=0), seen.max(axis=0)
    title = title_height(panels, scale, size[0]) / size[1]
    if title > _MOST:
        raise InputError(
            "is too small for its letters",
            where="size",
            value=size,
            remedy="Give smaller letters (--font-size) or a larger picture (--width-mm).",
        )
    across = max(high[0] - low[0], 1e-6 * scale.reach) / (1.0 - 2.0 * _MARGIN)
    upward = max(high[1] - low[1], 1e-6 * scale.reach) / (1.0 - title - 2.0 * _MARGIN)
    height = max(upward, across * size[1] / size[0])
    middle = 0.5 * (low + high) + np.array([0.0, 0.5 * title * height, 0.0])
    depth = float(high[2] - low[2]) + scale.reach
    focus = middle[0] * right + middle[1] * up + middle[2] * away
    return Camera(focus, away, up, right, height, height * size[0] / size[1], depth)


def _directions(view: str, points: Reals) -> tuple[Reals, Reals]:
    """Unit vectors to the eye and up."""
    if view in _FIXED:
        towards, above = _FIXED[view]
        return np.array(towards), np.array(above)
    plan = points[:, :2] - points[:, :2].mean(axis=0)
    (xx, xy), (_, yy) = plan.T @ plan
    uneven = np.hypot(xx - yy, 2.0 * xy)
    angle = 0.5 * np.arctan2(2.0 * xy, xx - yy) if uneven > _ROUND * (xx + yy) else 0.0
    best, widest = None, 0.0
    for turn, mirror in [(0.0, 1.0), (0.0, -1.0), (np.pi, 1.0), (np.pi, -1.0)]:
        c, s = np.cos(angle + turn), np.sin(angle + turn)
        x, y, z = _OBLIQUE[0] * mirror, _OBLIQUE[1], _OBLIQUE[2]
        away = np.array([c * x - s * y, s * x + c * y, z])
        away /= np.linalg.norm(away)
        up = np.array([0.0, 0.0, 1.0]) - away * away[2]
        up /= np.linalg.norm(up)
        flat = points @ np.column_stack([np.cross(up, away), up])
        spread = float(np.linalg.det(np.atleast_2d(np.cov(flat.T)))) if len(points) > 1 else 0.0
        if best is None or spread > _CLEARER * widest:
            best, widest = (away, up), spread
    assert best is not None
    return best
