"""The Chebyshev net: a trimmed flat grid and its place on the target surface."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from shellform.arrays import Indices, Reals, Record, indices, reals
from shellform.net.cover import Cover
from shellform.net.grid import Grid, crossing_points
from shellform.net.limits import NO_LIMITS, NetLimits
from shellform.net.notes import NetNote
from shellform.net.quality import Quality
from shellform.net.refusal import Attempt
from shellform.structure.elements.state import State


@dataclass(frozen=True, eq=False)
class EdgeLine(Record):
    """The axis of an edge beam: its `nodes` (k,) in order, `closed` to a ring or from foot to foot; `clamps`
    (c, 2): pairs of one of its nodes and the rod's end that is clamped to it; its `name`, if it has one."""

    nodes: Indices
    clamps: Indices
    closed: bool
    name: str = ""

    def __post_init__(self) -> None:
        most = int(np.iinfo(np.int64).max)
        object.__setattr__(self, "nodes", indices("edge.nodes", self.nodes, (None,), below=most))
        object.__setattr__(self, "clamps", indices("edge.clamps", self.clamps, (None, 2), below=most))

    @property
    def ends(self) -> Indices:
        """Node pairs (m, 2) of its elements."""
        following = np.roll(self.nodes, -1)
        pairs = np.column_stack([self.nodes, following])
        return pairs if self.closed else pairs[:-1]


@dataclass(frozen=True, eq=False)
class Stretch(Record):
    """A part of the edge of one `kind` (edges.py): its `name` in the case, if it has one; its `points` (k,
    3), m, in order; whether it goes round an `opening`, and whether it is the `whole` closed curve."""

    kind: str
    name: str
    points: Reals
    opening: bool
    whole: bool

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", reals("stretch.points", self.points, (None, 3)))

    @property
    def length(self) -> float:
        """m."""
        return float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).sum())


@dataclass(frozen=True, eq=False)
class Net(Record):
    """A grid of rods that lies on a surface.

    - `grid`: flat; `target`: its state on the surface, (n,) nodes.
    - `supports` (s,): the nodes that are held, which are the rods' ends, but for those on edge beams and free
      ones (edges.py), and the edge beams' feet.
    - `quality`: how good it is; `notes`: what was left out.
    - `attempts` at it, the last of which gave it; none where the first did.
    - `edges`: the edge beams; `stretches`: what the edge is, part after part (none: not asked).
    - `cover`: where it leaves the surface bare (None: not known of older ones).
    - `limits`: where it ends besides the surface's edge.
    """

    grid: Grid
    target: State
    supports: Indices
    quality: Quality
    notes: tuple[NetNote, ...] = ()
    attempts: tuple[Attempt, ...] = ()
    edges: tuple[EdgeLine, ...] = ()
    stretches: tuple[Stretch, ...] = ()
    cover: Cover | None = None
    limits: NetLimits = NO_LIMITS

    def __post_init__(self) -> None:
        count = self.node_count
        object.__setattr__(self, "supports", indices("supports", self.supports, (None,), below=count))

    def __repr__(self) -> str:
        return (
            f"Net({len(self.grid.rods)} rods, {len(self.grid.lattice)} crossings, {len(self.supports)} supports, "
            f"spacing {self.spacing:g} m)"
        )

    @property
    def node_count(self) -> int:
        """How many nodes there are, those of both layers of rods."""
        return self.grid.node_count

    @property
    def rod_ends(self) -> Indices:
        """The nodes (2 rods,) at the rods' ends, rod after rod, held or not."""
        return np.array([rod.nodes[[0, -1]] for rod in self.grid.rods]).ravel()

    @property
    def lines(self) -> Indices:
        """Node pairs (m, 2) of the elements of all rods, then of the edge beams: what is drawn."""
        return np.vstack([self.grid.rod_ends, self.edge_lines])

    @property
    def edge_lines(self) -> Indices:
        """Node pairs (m, 2) of the elements of the edge beams."""
        return np.vstack([np.zeros((0, 2), dtype=np.int64), *(line.ends for line in self.edges)])

    @property
    def curvature(self) -> Reals:
        """Resultant curvature (m, 2), 1/m, of each rod element at its two ends."""
        return np.asarray(np.linalg.norm(self.quality.curvature, axis=2))

    @property
    def spacing(self) -> float:
        """m."""
        return self.grid.spacing

    @property
    def bare_cells(self) -> float:
        """How many of its cells the surface beyond its rods would fill."""
        return self.quality.uncovered_area / self.grid.scale**2

    @property
    def crossings(self) -> Reals:
        """Target positions (c, 3), m, of the crossings: the middle between the nodes of the two rods."""
        return crossing_points(self.grid, self.target)

    def max_radius(self, *, young: float, strength: float) -> float:
        """Equation (1), m, for round rods with Young's modulus `young` and flexural strength `strength`, Pa.

        With M = EI kappa it reads r = strength / (young * curvature_max).
        """
        largest = self.quality.curvature_max
        return strength / (young * largest) if largest > 0.0 else math.inf
