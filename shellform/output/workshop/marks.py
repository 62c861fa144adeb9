"""The marks that drawings are made of, before any file format: strokes, rings, words and dimensions on
layers, mm at real scale, y upwards.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from shellform.arrays import Reals

WIDE = 0.88  # width of a figure over its height, in the widest of the usual fonts

MM = 1e3  # in a metre
APART = 0.2  # of their height: between words
Point = tuple[float, float]
Box = tuple[float, float, float, float]  # x from, y from, x to, y to


@dataclass(frozen=True)
class Pen:
    """How a layer is drawn: `colour` #rrggbb, line `width`, mm on paper, and whether it is dashed."""

    colour: str
    width: float
    dashed: bool = False


PENS = {
    "RODS_U": Pen("#0072b2", 0.35),
    "RODS_V": Pen("#d55e00", 0.35),
    "SHEAR_BLOCKS": Pen("#000000", 0.7),
    "EDGE_BEAMS": Pen("#009e73", 0.7),
    "CROSSINGS": Pen("#000000", 0.18),
    "CROSSING_NUMBERS": Pen("#000000", 0.18),
    "ROD_NAMES": Pen("#000000", 0.25),
    "CUT_LENGTHS": Pen("#000000", 0.25),
    "FIRST_MARKS": Pen("#6a3d9a", 0.18),
    "SUPPORTS": Pen("#000000", 0.35),
    "SUPPORT_NUMBERS": Pen("#b00020", 0.18),
    "SPLICES": Pen("#b00020", 0.35),
    "CABLES": Pen("#007a5a", 0.35),
    "CABLE_NAMES": Pen("#00543e", 0.18),
    "LEADERS": Pen("#9a9a9a", 0.09, dashed=True),
    "BACKGROUND": Pen("#b8b8b8", 0.13),
    "DIMENSIONS": Pen("#404040", 0.13),
    "LEVELS": Pen("#404040", 0.13),
    "GROUND": Pen("#7a5c3a", 0.5),
}


@dataclass(frozen=True)
class Stroke:
    """A line through `points`."""

    layer: str
    points: tuple[Point, ...]


@dataclass(frozen=True)
class Ring:
    """A circle."""

    layer: str
    centre: Point
    radius: float


@dataclass(frozen=True)
class Words:
    """A line of `text`, capitals `height` mm high, turned by 0 or 90 degrees; `place` is where its `side`
    ("left", "middle", "right") and its `foot` ("bottom", "middle", "top") come together."""

    layer: str
    place: Point
    height: float
    text: str
    angle: float = 0.0
    side: str = "left"
    foot: str = "bottom"

    @property
    def box(self) -> Box:
        """Where it lies: x from, y from, x to, y to."""
        width = WIDE * self.height * len(self.text)
        x = {"left": 0.0, "middle": -0.5, "right": -1.0}[self.side] * width
        y = {"bottom": 0.0, "middle": -0.5, "top": -1.0}[self.foot] * self.height
        corners = (x, y, x + width, y + self.height)
        if self.angle:
            corners = (-corners[3], corners[0], -corners[1], corners[2])
        (a, b), (c, d, e, f) = self.place, corners
        return a + c, b + d, a + e, b + f


@dataclass(frozen=True)
class Span:
    """A dimension between `a` and `b`, which lie on a horizontal or a vertical line, with its line through
    `base`.
    """

    layer: str
    a: Point
    b: Point
    base: Point
    height: float
    text: str

    @property
    def upright(self) -> bool:
        """Whether it measures along y."""
        return abs(self.b[1] - self.a[1]) > abs(self.b[0] - self.a[0])


Mark = Stroke | Ring | Words | Span


@dataclass(frozen=True)
class Sheet:
    """A drawing: its `title`, `marks`, `notes`, the smallest `lettering` on it, mm, and a list beside it."""

    title: str
    marks: tuple[Mark, ...]
    lettering: float
    notes: tuple[str, ...] = ()
    heads: tuple[str, ...] = ()
    rows: tuple[tuple[str, ...], ...] = ()

    @property
    def extent(self) -> Box:
        """x from, y from, x to, y to of all marks."""
        boxes = np.array([box_of(mark) for mark in self.marks])
        low, high = boxes[:, :2].min(axis=0), boxes[:, 2:].max(axis=0)
        return float(low[0]), float(low[1]), float(high[0]), float(high[1])


def box_of(mark: Mark) -> Box:
    """Where a mark lies."""
    if isinstance(mark, Words):
        return mark.box
    if isinstance(mark, Ring):
        (x, y), r = mark.centre, mark.radius
        return x - r, y - r, x + r, y + r
    points = np.array(mark.points if isinstance(mark, Stroke) else (mark.a, mark.b, mark.base))
    reach = 1.5 * mark.height if isinstance(mark, Span) else 0.0
    low, high = points.min(axis=0) - reach, points.max(axis=0) + reach
    return float(low[0]), float(low[1]), float(high[0]), float(high[1])


def overlap(a: Box, b: Box | Reals, gap: float = 0.0) -> Any:
    """Whether two boxes lie on each other, or nearer than `gap`; where `b` are boxes (4, k), of each (k,)."""
    return (a[0] < b[2] + gap) & (b[0] < a[2] + gap) & (a[1] < b[3] + gap) & (b[1] < a[3] + gap)


def free(words: Words, taken: Reals | Sequence[Box]) -> bool:
    """Whether the words lie on none of the boxes (k, 4) that are there already, nor too near."""
    boxes = np.asarray(taken, dtype=float).reshape(-1, 4).T
    return not np.any(overlap(words.box, boxes, APART * words.height))


def square(place: Reals, half: float) -> Stroke:
    """A support's square about a place, with half its side."""
    x, y = point_of(place)
    corners = (
        (x - half, y - half),
        (x + half, y - half),
        (x + half, y + half),
        (x - half, y + half),
        (x - half, y - half),
    )
    return Stroke("SUPPORTS", corners)


def point_of(place: Reals) -> Point:
    """The first two coordinates."""
    return float(place[0]), float(place[1])
