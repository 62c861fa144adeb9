"""Which elements of a structure belong to one rod, one connector, one support, and which load to one
crossing: what errors of making and building are drawn for.

From a gridshell they are known; in a model file, rods are the chains of beams of the kind "rod" that go on
straight in the stress-free state, marked where something else touches them.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from shellform.arrays import Indices, Reals, Record
from shellform.gridshell.gridshell import Gridshell
from shellform.gridshell.layers import LOCK
from shellform.net.grid import ROD
from shellform.plan_rectangle import along_sides, longest_side
from shellform.structure.elements.beam import Beams
from shellform.structure.model import Model

_ROW = 1e-9  # of the other: half a width less than that is that of nodes in a row, which have no other half
_STRAIGHT_ON = 0.99  # cosine of the angle between two elements of one rod


@dataclass(frozen=True, eq=False)
class Member(Record):
    """One rod.

    - `elements` (k,) among the beams, from end to end; `sense` (k,) ±1 of each along the rod.
    - `marks` (q,): ascending places 0..k among its nodes that are measured on it, the ends included.
    - `locks` (k or 0,): the beams that lock its two layers.
    """

    elements: Indices
    sense: Reals
    marks: Indices
    locks: Indices = field(default_factory=lambda: np.zeros(0, dtype=np.int64))


@dataclass(frozen=True, eq=False)
class RodElements(Record):
    """The elements of all rods, one rod after the other.

    - `elements` (e,) among the beams, with the `rod` of each and its `sense` along it; `locks` (l,) among the
      beams, with the rod of each, `locked`.
    - `segment` (e,): that of each element between two marks; `marks` (s, 2): those at both ends of each
      segment among all rods' marks; `segment_length` (s,), m, and the rod of each, `segment_rod` (s,);
      `rod_length` (r,), m.
    """

    elements: Indices
    rod: Indices
    sense: Reals
    locks: Indices
    locked: Indices
    segment: Indices
    marks: Indices
    segment_length: Reals
    segment_rod: Indices
    rod_length: Reals


@dataclass(frozen=True, eq=False)
class Members(Record):
    """What errors are drawn for.

    - `rods`; `connectors` (j,) among the beams; `cables`: how many candidates there are.
    - `held` (h,): degrees of freedom of the supports' translations.
    - `zone` (n,): the crossing, of `zones`, that each node's load is counted to.
    - `places` (n, 3), m, of the nodes in the target; `beam_length` (m,), m: nominal rest lengths.
    """

    rods: tuple[Member, ...]
    connectors: Indices
    cables: int
    held: Indices
    zone: Indices
    zones: int
    places: Reals
    beam_length: Reals

    @cached_property
    def span(self) -> float:
        """The longest side, m, of the box round the target, however it is turned in plan."""
        return longest_side(self.places)

    @cached_property
    def halves(self) -> Reals:
        """Shares (n, 2) of a load that make one half of the plan heavier by as much as the other is lighter,
        in two directions at right angles, those of the smallest rectangle round it: a plane each, whose mean
        size over the nodes is 1."""
        plan = along_sides(self.places)
        plan = plan - plan.mean(axis=0)
        size = np.abs(plan).mean(axis=0)
        return np.asarray(plan / np.where(size > _ROW * size.max(), size, np.inf))

    @cached_property
    def rod_elements(self) -> RodElements:
        """The rods' elements, of which thousands of structures are drawn."""
        rods, none = self.rods, np.zeros(0, dtype=np.int64)
        elements = np.concatenate([none, *(rod.elements for rod in rods)])
        locks = np.concatenate([none, *(rod.locks for rod in rods)])
        counts = np.concatenate([none, *(np.diff(rod.marks) for rod in rods)])  # of elements in segments
        nominal = self.beam_length[elements]
        number = np.arange(len(rods))
        segment_rod = np.repeat(number, [len(rod.marks) - 1 for rod in rods])
        first = np.arange(len(counts)) + segment_rod
        begins = np.cumsum(counts) - counts
        return RodElements(
            elements=elements,
            rod=np.repeat(number, [len(rod.elements) for rod in rods]),
            sense=np.concatenate([np.zeros(0), *(rod.sense for rod in rods)]),
            locks=locks,
            locked=np.repeat(number, [len(rod.locks) for rod in rods]),
            segment=np.repeat(np.arange(len(counts)), counts),
            marks=np.stack([first, first + 1], axis=1),
            segment_length=np.add.reduceat(nominal, begins) if len(counts) else np.zeros(0),
            segment_rod=segment_rod,
            rod_length=np.array([self.beam_length[rod.elements].sum() for rod in rods]),
        )


def members_of(shell: Gridshell) -> Members:
    """Those of a gridshell, all candidate cables counted, whatever design."""
    grid, beams = shell.net.grid, shell.beams(shell.rod.radius)
    locked = np.flatnonzero(beams.of_kind(LOCK))
    rods, first = [], 0
    for rod in grid.rods:
        count = len(rod.nodes) - 1
        marks = np.unique(np.concatenate([[0], rod.at, [count]])).astype(np.int64)
        own = slice(first, first + count)
        rods.append(Member(first + np.arange(count), np.ones(count), marks, locked[own]))
        first += count
    connectors = first + np.arange(len(grid.lattice))
    held = (6 * shell.net.supports[:, None] + np.arange(3)).ravel()
    return Members(
        rods=tuple(rods),
        connectors=connectors,
        cables=len(shell.cable_ends),
        held=held,
        zone=zones_of(shell),
        zones=len(grid.crossing_nodes),
        places=shell.target.positions,
        beam_length=beams.rest_length,  # edge beams come last, and are made without error
    )


def zones_of(shell: Gridshell) -> Indices:
    """The crossing (n,) that each node's load is counted to: the nearest in the flat grid; of an edge beam's
    nodes, which have no place in it, the nearest in the target."""
    grid, places = shell.net.grid, shell.target.positions
    middle = grid.flat[grid.crossing_nodes].mean(axis=1)[:, :2]
    found = cKDTree(middle).query(grid.flat[:, :2])[1]
    on_rods = np.concatenate([rod.nodes for rod in grid.rods])
    beside = np.setdiff1d(np.arange(len(places)), on_rods)
    if len(beside):
        found[beside] = cKDTree(places[grid.crossing_nodes].mean(axis=1)).query(places[beside])[1]
    return np.asarray(found, dtype=np.int64)


def members_of_model(model: Model) -> Members:
    """Those of a model file: its cables, its supports' translations, a zone for each node."""
    network = model.network
    beams, count = network.beams, len(network.nodes)
    rod = beams.of_kind(ROD)
    other = ~(rod | beams.of_kind(LOCK))
    touched = np.asarray(network.fixed.any(axis=1))
    for ends in (beams.ends[other], network.cables.ends):
        touched[ends.ravel()] = True
    rods = tuple(
        Member(elements, sense, _marked(beams, elements, sense, touched))
        for elements, sense in _chains(beams, np.flatnonzero(rod), count)
    )
    held = np.flatnonzero((network.fixed & (np.arange(6) < 3)).ravel())
    places = network.nodes if model.start is None else model.start.positions
    return Members(
        rods=rods,
        connectors=np.flatnonzero(other),
        cables=len(network.cables.ends),
        held=held,
        zone=np.arange(count),
        zones=count,
        places=places,
        beam_length=beams.rest_length,
    )


def _chains(beams: Beams, chosen: Indices, count: int) -> list[tuple[Indices, Reals]]:
    """The chains of the chosen beams, each from the end with the lowest beam's number on, and each beam's
    sense.
    """
    at: list[list[int]] = [[] for _ in range(count)]
    for element in chosen.tolist():
        for node in beams.ends[element]:
            at[node].append(element)
    axis = beams.frames[:, 0, :, 0]

    def onward(element: int, node: int) -> int | None:
        """The one beam that goes on straight from the element over its end `node`."""
        if len(at[node]) != 2:
            return None
        other = at[node][0] if at[node][1] == element else at[node][1]
        turned = (beams.ends[other, 0] == node) != (beams.ends[element, 1] == node)
        along = float(axis[element] @ axis[other]) * (-1.0 if turned else 1.0)
        return other if along > _STRAIGHT_ON else None

    done: set[int] = set()
    found = []
    for element in chosen.tolist():
        if element in done:
            continue
        begin, node = element, int(beams.ends[element, 0])
        seen = {begin}
        while (before := onward(begin, node)) is not None and before not in seen:
            seen.add(before)
            begin, node = before, int(beams.ends[before].sum()) - node
        chain, sense = [begin], [1.0 if beams.ends[begin, 0] == node else -1.0]
        node = int(beams.ends[begin].sum()) - node
        while (after := onward(chain[-1], node)) is not None and after != begin:
            chain.append(after)
            sense.append(1.0 if beams.ends[after, 0] == node else -1.0)
            node = int(beams.ends[after].sum()) - node
        done |= set(chain)
        found.append((np.array(chain, dtype=np.int64), np.array(sense)))
    return found


def _marked(beams: Beams, elements: Indices, sense: Reals, touched: np.ndarray) -> Indices:
    first = beams.ends[elements, np.where(sense > 0.0, 0, 1)]
    last = beams.ends[elements[-1], 1 if sense[-1] > 0.0 else 0]
    there = touched[np.append(first, last)]
    there[[0, -1]] = True
    return np.flatnonzero(there)
