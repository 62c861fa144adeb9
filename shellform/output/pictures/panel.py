"""What a picture shows, as plain arrays: a gridshell in one state with one quantity on its rods, and how it
is looked at.

Nothing here knows a drawing library: `scene.py` draws panels as pixels, `vectors.py` as lines.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from shellform.arrays import Indices, Reals, Record, indices, reals
from shellform.errors import InputError, require_known, require_number

LIMIT = 0.010  # m, end of the colour scale in figures 12 to 14
EDGE_BEAM = 1.8  # times as thick as rods edge beams are drawn
VIEWS = ("best", "top", "front", "side")
SMALLEST = (160, 120)  # pixels; below it the title leaves no room for the shell
LARGEST = 8000  # pixels a side: drawn at twice that, near which drivers end
FORMATS = (".png", ".svg", ".pdf")
# of the largest load on a node: smaller ones, such as of the rods' own weight, would hide the shell behind
# arrows
_MARKED = 0.2
_ARROW = 0.04  # its length over the largest extent
_THIN = 0.0024  # half the width at which a rod is drawn at least, over the width of the picture


def marked_nodes(load: Reals, positions: Reals) -> Indices:
    """The nodes at which a `load` (n, 6), N, is marked, at `positions` (n, 3), m: none is nearer to another
    than an arrow is long, or the arrows of thousands of crossings hide the shell."""
    weight = np.linalg.norm(load[:, :3], axis=1)
    found = np.flatnonzero(weight > _MARKED * weight.max(initial=0.0))
    if not len(found):
        return found
    near = cKDTree(positions[found]).query_ball_point(positions[found], _ARROW * _reach(positions))
    free = np.ones(len(found), dtype=bool)
    for each, beside in enumerate(near):
        if free[each]:
            free[beside] = False
            free[each] = True
    return found[free]


def scale_end(largest: float) -> float:
    """The end of a scale that is filled by values up to the `largest`: 1, 2 or 5 times a power of ten."""
    power = 10.0 ** math.floor(math.log10(max(largest, 1e-9)))
    ends = (round(step * power, 12) for step in (1.0, 2.0, 5.0, 10.0))
    return next(end for end in ends if largest <= end * (1.0 + 1e-9))


@dataclass(frozen=True, eq=False)
class Panel(Record):
    """One picture: a gridshell in one state.

    `positions` (n, 3), m; rod elements `beams` (m, 2); `deviation` (n,), m, of each node from its target;
    `cables` (c, 2) with their `cable_forces` (c,), N, slack at or below zero; nodes of `supports` (s,) and of
    loads, `load_points` (k,); `rod_radius`, m; elements `edges` (e, 2) of edge beams. `quantity` says what
    `deviation` measures where it is something else, in a `unit` of a name and so much in SI. Raises
    InputError for wrong shapes and indices.
    """

    title: str
    positions: Reals
    beams: Indices
    deviation: Reals
    cables: Indices
    cable_forces: Reals
    supports: Indices
    load_points: Indices
    rod_radius: float
    quantity: str = "deviation from the target"
    unit: tuple[str, float] = ("mm", 1e-3)
    edges: Indices = field(default_factory=lambda: np.zeros((0, 2), dtype=np.int64))

    def __post_init__(self) -> None:
        put = functools.partial(object.__setattr__, self)
        put("positions", reals("positions", self.positions, (None, 3)))
        count = len(self.positions)
        if count == 0:
            raise InputError(
                "positions has no nodes",
                where=f"panel {self.title!r}",
                remedy="Give a state's positions, a row of x, y, z a node, m.",
            )
        put("deviation", reals("deviation", self.deviation, (count,)))
        if self.deviation.min() < 0.0:
            raise InputError(
                "deviation is a distance and can't be negative",
                where=f"panel {self.title!r}",
                value=float(self.deviation.min()),
                remedy="Give its absolute value.",
            )
        for name, width in [("beams", 2), ("cables", 2), ("edges", 2), ("supports", 0), ("load_points", 0)]:
            shape = (None, width) if width else (None,)
            put(name, indices(name, getattr(self, name), shape, below=count))
        put("cable_forces", reals("cable_forces", self.cable_forces, (len(self.cables),)))
        put("rod_radius", float(reals("rod_radius", self.rod_radius, (), positive=True)))


@dataclass(frozen=True, eq=False)
class Skin(Record):
    """A surface that is shown translucent: `vertices` (v, 3), m, and `triangles` (t, 3)."""

    vertices: Reals
    triangles: Indices

    def __post_init__(self) -> None:
        points = reals("surface vertices", self.vertices, (None, 3))
        object.__setattr__(self, "vertices", points)
        object.__setattr__(
            self, "triangles", indices("surface triangles", self.triangles, (None, 3), below=len(points))
        )


@dataclass(frozen=True, eq=False)
class Look:
    """How panels are looked at.

    `limit` ends the colour scale (m, or what the panels' quantity is measured in); `force`, N, that of the
    cables (0: the largest drawn). `size` (width, height) of one picture in pixels; `view` one of VIEWS;
    `thickness` of the rods, times their own (0: their own, but at least as thick as can be seen). `surface`
    is drawn translucent. `frame` (p, 3), m, are further points that must be in view: give the nodes of all
    states where single pictures are to be compared. `transparent`: no background. On paper `dots` pixels are
    an inch, and `letters` points high (0: as fits the picture). Raises InputError for what can't be drawn.
    """

    limit: float = LIMIT
    size: tuple[int, int] = (1600, 1000)
    view: str = "best"
    thickness: float = 0.0
    force: float = 0.0
    surface: Skin | None = None
    frame: ArrayLike | None = None
    transparent: bool = False
    dots: float = 160.0
    letters: float = 0.0

    def __post_init__(self) -> None:
        require_known(self.view, VIEWS, where="view", what="is no view")
        require_number(
            self.limit, above=0.0, where="figures.limit", give="metres at the scale's end, such as 0.010"
        )
        require_number(self.dots, above=0.0, where="dots", give="pixels an inch, such as 160")
        for name, unit in [
            ("thickness", "times the rods' own, such as 2"),
            ("force", "newtons at the cables' scale's end, such as 20"),
            ("letters", "points, such as 8"),
        ]:
            require_number(getattr(self, name), least=0.0, where=name, give=f"{unit}, or 0 to have it chosen")
        if self.size[0] < SMALLEST[0] or self.size[1] < SMALLEST[1]:
            raise InputError(
                "is too small", where="size", value=self.size, remedy=f"Give {SMALLEST} pixels or more."
            )
        if max(self.size) > LARGEST:
            raise InputError(
                "is too large", where="size", value=self.size, remedy=f"Give at most {LARGEST} pixels a side."
            )
        if self.frame is not None:
            object.__setattr__(self, "frame", reals("frame", self.frame, (None, 3)))

    @property
    def pixels(self) -> int:
        """The height of the letters that are asked for; 0 where they fit the picture."""
        return round(self.letters * self.dots / 72.0)


@dataclass(frozen=True)
class Paper:
    """A picture in print: its `width`, m, pixels an inch `dots`, and height of the letters, points."""

    width: float
    dots: float = 300.0
    letters: float = 9.0  # the smallest capitals are then 2 mm high

    def size(self, shape: tuple[int, int]) -> tuple[int, int]:
        """Pixels of a picture with the proportions of `shape`."""
        across = round(self.width / 0.0254 * self.dots)
        return across, round(across * shape[1] / shape[0])

    def look(self, look: Look) -> Look:
        """The look as it is printed, in its proportions. Raises InputError for a width of too few or too many
        pixels."""
        across, upward = self.size(look.size)
        larger = across < SMALLEST[0] or upward < SMALLEST[1]
        if larger or max(across, upward) > LARGEST:
            raise InputError(
                f"{1e3 * self.width:g} mm at {self.dots:g} dots an inch make {across} × {upward} pixels, and pictures "
                f"have {SMALLEST[0]} × {SMALLEST[1]} or more and at most {LARGEST} a side",
                where="width",
                remedy=f"Give a {'larger' if larger else 'smaller'} one, or {'more' if larger else 'fewer'} dots an inch.",
            )
        return replace(look, size=(across, upward), dots=self.dots, letters=self.letters)


@dataclass(frozen=True)
class Scale:
    """What all panels of a picture share: metres, newtons and letters."""

    limit: float  # in SI units
    beyond: bool  # whether a value is larger
    force: float  # N; 0 where no cable is taut
    slack: bool  # whether any cable is
    reach: float  # m, the largest extent, which loads are drawn by
    letters: int  # pixels
    given: bool  # whether they are to be that high, however long the words
    quantity: str  # what the colours measure
    unit: tuple[str, float]


def scale_of(panels: Sequence[Panel], look: Look, size: tuple[int, int]) -> Scale:
    """The scale of panels that are drawn `size` pixels large each."""
    reach = max(_reach(panel.positions) for panel in panels)
    force = look.force or max(float(panel.cable_forces.max(initial=0.0)) for panel in panels)
    slack = any((panel.cable_forces <= 0.0).any() for panel in panels)
    usual = max(11, round(0.034 * min(size[1], 0.7 * size[0])))
    beyond = any(panel.deviation.max() > look.limit * (1.0 + 1e-9) for panel in panels)
    return Scale(
        limit=look.limit,
        beyond=beyond,
        force=max(force, 0.0),
        slack=slack,
        reach=reach,
        letters=look.pixels or usual,
        given=look.pixels > 0,
        quantity=panels[0].quantity,
        unit=panels[0].unit,
    )


def drawn_radius(panel: Panel, look: Look, width: float) -> float:
    """Half the thickness, m, at which a panel's rods are drawn in a picture `width` m wide."""
    return look.thickness * panel.rod_radius if look.thickness else max(panel.rod_radius, _THIN * width)


def cable_thickness(share: Reals) -> Reals:
    """A cable's thickness over a rod's, from its force over the scale's."""
    return np.asarray(0.2 + 0.5 * np.sqrt(share))


def arrow_length(scale: Scale) -> float:
    """m, of the arrows that mark loads."""
    return _ARROW * scale.reach


def long_enough(positions: Reals, pairs: Indices) -> Indices:
    """Those of the pairs (p, 2) that have a length, as numbers: VTK refuses a whole line for one element
    without.
    """
    length = np.linalg.norm(positions[pairs[:, 1]] - positions[pairs[:, 0]], axis=1)
    return np.flatnonzero(length > 1e-9 * _reach(positions))


def _reach(positions: Reals) -> float:
    """m, the largest extent."""
    return max(float(np.ptp(positions, axis=0).max()), 1e-9)
