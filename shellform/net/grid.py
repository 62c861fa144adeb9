"""The flat grid: two layers of straight rods, pinned to each other where they cross.

Crossing (i, j) of the lattice lies at i spacings along u and j spacings along v from the origin; rods "u" run
along i and share j, rods "v" run along j and share i. The u rods lie half a gap below the plane of the grid,
the v rods half a gap above it, so that every crossing has two nodes, which a short connector joins (section
3).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from shellform.arrays import Indices, Reals, Record, frozen, indices, reals
from shellform.structure.elements.beam import Beams, make_beams
from shellform.structure.elements.state import State

ROD, CONNECTOR = "rod", "connector"  # kinds of beams


@dataclass(frozen=True, eq=False)
class GridRod(Record):
    """One straight rod: `direction` "u" or "v", lattice `index` it shares, `nodes` (k,) from end to end,
    their distances `arc` (k,), m, from the first end, and the numbers of the `crossings` (c,) along it with
    their places `at` (c,) among the nodes."""

    direction: str
    index: int
    nodes: Indices
    arc: Reals
    crossings: Indices
    at: Indices

    def __post_init__(self) -> None:
        for name in ("nodes", "arc", "crossings", "at"):
            object.__setattr__(self, name, frozen(np.asarray(getattr(self, name))))

    @property
    def length(self) -> float:
        """m."""
        return float(self.arc[-1])

    @property
    def marks(self) -> Reals:
        """Distances (c,), m, of the crossings from the first end."""
        return self.arc[self.at]


@dataclass(frozen=True, eq=False)
class Grid(Record):
    """`flat` (n, 3), m, all nodes in the stress-free state; `rods`; `lattice` (c, 2) places of the crossings
    and `crossing_nodes` (c, 2) their nodes on the u rod and on the v rod; `spacing` of crossings along u rods
    and `spacing_v` along v rods (0: the same), `gap`, m."""

    flat: Reals
    rods: tuple[GridRod, ...]
    lattice: Indices
    crossing_nodes: Indices
    spacing: float
    gap: float
    spacing_v: float = 0.0

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "spacing_v", self.spacing_v or self.spacing)
        put(self, "flat", reals("flat", self.flat, (None, 3)))
        put(self, "lattice", frozen(self.lattice))
        count = len(self.lattice)
        put(
            self,
            "crossing_nodes",
            indices("crossing_nodes", self.crossing_nodes, (count, 2), below=len(self.flat)),
        )

    def __repr__(self) -> str:
        return f"Grid({len(self.rods)} rods, {len(self.lattice)} crossings, spacing {self.spacing:g} m)"

    @property
    def node_count(self) -> int:
        """How many nodes there are, those of both layers."""
        return len(self.flat)

    @property
    def scale(self) -> float:
        """The mean spacing, m, by which lengths are measured."""
        return math.sqrt(self.spacing * self.spacing_v)

    def step(self, direction: str) -> float:
        """Distance of neighbouring crossings, m, on rods of that direction."""
        return self.spacing if direction == "u" else self.spacing_v

    @property
    def rod_ends(self) -> Indices:
        """Node pairs (m, 2) of all rod elements, rod after rod."""
        return np.vstack([np.column_stack([rod.nodes[:-1], rod.nodes[1:]]) for rod in self.rods])

    @property
    def rod_rest_lengths(self) -> Reals:
        """Rest lengths (m,), m, of all rod elements."""
        return np.concatenate([np.diff(rod.arc) for rod in self.rods])

    @property
    def layer(self) -> Reals:
        """Signed distance (n,), m, of each node from the middle between the layers: -gap/2 for u rods, gap/2
        for v rods, 0 for edge beams.
        """
        level = np.zeros(self.node_count)
        for rod in self.rods:
            level[rod.nodes] = -0.5 * self.gap if rod.direction == "u" else 0.5 * self.gap
        return level


def grid_beams(
    grid: Grid,
    rod: tuple[float, float, float, float],
    connector: tuple[float, float, float, float],
) -> Beams:
    """The rods' elements, then the connectors; `rod` and `connector` are (EA, GJ, EI_y, EI_z), N and N·m²."""
    ends, joints = grid.rod_ends, len(grid.lattice)
    kind = np.repeat([0, 1], [len(ends), joints])
    stiffness = np.array([rod, connector])[kind]
    rest = np.concatenate([grid.rod_rest_lengths, np.full(joints, grid.gap)])
    return make_beams(
        grid.flat,
        np.vstack([ends, grid.crossing_nodes]),
        axial=stiffness[:, 0],
        torsion=stiffness[:, 1],
        bending_y=stiffness[:, 2],
        bending_z=stiffness[:, 3],
        rest_length=rest,
        kind=kind,
        kinds=(ROD, CONNECTOR),
    )


def lattice_grid(
    lattice: Indices, *, spacing: tuple[float, float], gap: float, elements: int, tail: int = 0
) -> Grid:
    """The grid with crossings at the places `lattice` (c, 2), `spacing` m apart along u and v, `elements`
    elements a segment; rods go on past their first and last crossing by `tail` segments.

    Neighbouring places of one row are joined; a place without neighbour in both directions is left out.
    """
    places = {(int(i), int(j)) for i, j in lattice}
    while alone := {p for p in places if not (_joined(places, p, 0) and _joined(places, p, 1))}:
        places -= alone
    ordered = sorted(places)
    number = {place: k for k, place in enumerate(ordered)}
    flat: list[list[float]] = []
    crossing_nodes = np.full((len(ordered), 2), -1)
    rods = []
    for layer, direction in enumerate("uv"):
        for run in _runs(ordered, layer):
            share = run[0][1 - layer]
            steps = np.arange((len(run) - 1 + 2 * tail) * elements + 1)
            along = run[0][layer] - tail + steps / elements
            nodes = len(flat) + np.arange(len(along))
            at = (np.arange(len(run)) + tail) * elements
            crossings = np.array([number[place] for place in run])
            crossing_nodes[crossings, layer] = nodes[at]
            place = np.full((len(along), 3), (layer - 0.5) * gap)
            place[:, layer], place[:, 1 - layer] = along * spacing[layer], share * spacing[1 - layer]
            flat += place.tolist()
            rods.append(GridRod(direction, share, nodes, (along - along[0]) * spacing[layer], crossings, at))
    return Grid(np.array(flat), tuple(rods), np.array(ordered), crossing_nodes, spacing[0], gap, spacing[1])


def _joined(places: set[tuple[int, int]], place: tuple[int, int], axis: int) -> bool:
    i, j = place
    return (
        ((i + 1, j) in places or (i - 1, j) in places)
        if axis == 0
        else ((i, j + 1) in places or (i, j - 1) in places)
    )


def _runs(places: list[tuple[int, int]], axis: int) -> list[list[tuple[int, int]]]:
    """The places grouped into runs of neighbours along the axis."""
    runs: list[list[tuple[int, int]]] = []
    for place in sorted(places, key=lambda p: (p[1 - axis], p[axis])):
        last = runs[-1][-1] if runs else None
        if last is not None and last[1 - axis] == place[1 - axis] and last[axis] + 1 == place[axis]:
            runs[-1].append(place)
        else:
            runs.append([place])
    return runs


def crossing_points(grid: Grid, state: State) -> Reals:
    """Positions (c, 3), m, of the crossings: the middle between the nodes of the two rods."""
    return np.asarray(state.positions[grid.crossing_nodes].mean(axis=1))


def neighbours(grid: Grid) -> tuple[Indices, Reals]:
    """Pairs (p, 2) of crossings one spacing apart on a rod, and that spacing (p,), m."""
    pairs, steps = [], []
    for rod in grid.rods:
        one = np.diff(rod.marks) < 1.5 * grid.step(rod.direction)
        pairs.append(np.column_stack([rod.crossings[:-1], rod.crossings[1:]])[one])
        steps.append(np.diff(rod.marks)[one])
    return np.vstack(pairs), np.concatenate(steps)


def cells(grid: Grid) -> Indices:
    """Crossings (q, 4) round each complete cell of the lattice: (i, j), (i+1, j), (i+1, j+1), (i, j+1)."""
    number = {(int(i), int(j)): k for k, (i, j) in enumerate(grid.lattice)}
    corners = ((0, 0), (1, 0), (1, 1), (0, 1))
    return np.array(
        [
            [number[(i + a, j + b)] for a, b in corners]
            for i, j in number
            if all((i + a, j + b) in number for a, b in corners)
        ],
        dtype=np.int64,
    ).reshape(-1, 4)


def edge_diagonals(grid: Grid) -> Indices:
    """Crossings (q, 2) at the ends of the one diagonal that a cell of three crossings has; its fourth corner
    lies beyond the edge."""
    number = {(int(i), int(j)): k for k, (i, j) in enumerate(grid.lattice)}
    corners = ((0, 0), (1, 0), (1, 1), (0, 1))
    places = sorted({(i - a, j - b) for i, j in number for a, b in corners})
    found = []
    for i, j in places:
        here = [number.get((i + a, j + b)) for a, b in corners]
        if here.count(None) == 1:
            gone = here.index(None)
            found.append([here[(gone + 1) % 4], here[(gone + 3) % 4]])
    return np.array(found, dtype=np.int64).reshape(-1, 2)


def rod_names(grid: Grid) -> list[str]:
    """What drawings, schedules and the page call its rods: U or V and the rod's number, as U5 or V16."""
    return [f"{rod.direction.upper()}{k}" for k, rod in enumerate(grid.rods)]
