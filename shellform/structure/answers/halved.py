"""A model with each beam cut in two, and what numbers are off because beams are straight.

With q4 and q8 found on the two meshes and an error of order h² (elements/beam.py), Richardson's estimate of
the value at h = 0 and of the error of each is

    q0 = q8 + (q8 - q4) / 3,   q4 - q0 = 4 (q4 - q8) / 3,   q8 - q0 = (q4 - q8) / 3.

Where beams stand for a curve, halves of the chords would keep the polygon. The curvature at a node where two
beams of one kind meet, k = (t' - t) / l with their directions and mean length, belongs to a beam as far as
both its ends have it (the smaller of the two where they point to one side, else none; at a chain's end its
neighbour's), so that a corner among straight beams stays one. The new node lies off the chord by -k l²/8,
where the circle has its middle.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from shellform.arrays import Flags, Indices, Reals
from shellform.errors import NotConverged
from shellform.structure.answers.request import with_supports_moved
from shellform.structure.answers.stability import critical_load
from shellform.structure.elements import rotation
from shellform.structure.elements.beam import Beams
from shellform.structure.elements.state import State, at_rest
from shellform.structure.model import Model
from shellform.structure.network import Network, assemble
from shellform.structure.solve.drive import Drive
from shellform.structure.solve.equilibrium import find_equilibrium
from shellform.structure.solve.settled import prestressed

_COARSE = 0.005  # of a critical factor, the error above which it is told
_ANOTHER = 0.5  # of a critical factor, below which that with beams halved is no matter of order h²
_CORNER = np.radians(30.0)  # between two beams that don't stand for a curve


@dataclass(frozen=True)
class Refined:
    """One number found on a mesh, `coarse`, and on the one with beams halved, `fine`."""

    coarse: float
    fine: float

    @property
    def extrapolated(self) -> float:
        """Richardson's estimate at h = 0."""
        return self.fine + (self.fine - self.coarse) / 3.0

    @property
    def error(self) -> float:
        """Of the coarse mesh: its number less the estimate, negative where it is too low."""
        return self.coarse - self.extrapolated


def critical_error(
    model: Model, drive: Drive, factor: float, *, goal: float, tolerance: float
) -> Refined | None:
    """The critical `factor` of the model under the drive, found up to `goal`, beside that of the finer one;
    None where no beam can be halved or the finer model has no critical factor up to 1.5 times the goal.
    """
    finer = halved(model)
    more = len(finer.network.nodes) - len(model.network.nodes)
    if not more:
        return None
    none = np.zeros((more, 6))
    wider = Drive(*(np.vstack([part, none]) for part in (drive.load, drive.imposed, drive.base)))
    assembly = assemble(finer.network)
    try:
        state = at_rest(finer.network.nodes)
        if finer.start is None:
            rest, _ = prestressed(assembly, state, wider.at(0.0), tolerance=tolerance)
            state = state if rest is None else rest.state
        else:
            begun = with_supports_moved(finer.network, finer.start)
            state = find_equilibrium(assembly, begun, wider.at(0.0), tolerance=tolerance).state
        found = critical_load(assembly, state, wider, goal=1.5 * goal, first=0.1 / 1.5, tolerance=tolerance)
    except NotConverged:
        return None
    return None if found is None else Refined(factor, found.factor)


def too_coarse(mesh: Refined | None) -> list[str]:
    """What has to be said of a critical factor that the size of the elements decides, in a sentence."""
    if mesh is None or abs(mesh.error) <= _COARSE * abs(mesh.coarse):
        return []
    if mesh.fine / mesh.coarse < _ANOTHER:
        return [
            f"With beams halved the critical factor is {mesh.fine:.6g} instead of {mesh.coarse:.6g}: it gives way otherwise there, as "
            "where beams buckle between their nodes: divide the rods into more elements."
        ]
    share = 100.0 * abs(mesh.error / mesh.coarse)
    side = "high" if mesh.error * mesh.coarse > 0.0 else "low"
    return [
        f"The critical factor {mesh.coarse:.6g} is about {share:.1f} % too {side}, by the same with "
        f"beams halved (extrapolated {mesh.extrapolated:.6g}): divide the rods into more elements."
    ]


def halved(model: Model) -> Model:
    """The model with each beam that is straight and unstressed between its nodes cut in two; its nodes come
    first, in their order. New nodes are held as all others are.
    """
    network, beams = model.network, model.network.beams
    cut = np.flatnonzero(~beams.built_in)
    count, (a, b) = len(network.nodes), beams.ends[cut].T
    offset = np.zeros((len(cut), 3)) if model.start is not None else _bulge(network.nodes, beams)[cut]
    nodes = np.vstack([network.nodes, 0.5 * (network.nodes[a] + network.nodes[b]) + offset])
    finer = cut_in_two(beams, cut, count + np.arange(len(cut)))
    halves = np.append(cut, np.arange(len(beams.ends), len(finer.ends)))
    chord = nodes[finer.ends[halves, 1]] - nodes[finer.ends[halves, 0]]
    length = np.linalg.norm(chord, axis=1)
    before = np.linalg.norm(network.nodes[b] - network.nodes[a], axis=1)
    rest, frames = finer.rest_length.copy(), finer.frames.copy()
    rest[halves] *= length / (0.5 * np.tile(before, 2))
    frames[halves] = _turned_to(frames[halves], chord / length[:, None])
    start = None if model.start is None else with_middles(model.start, beams, cut)
    return with_nodes(model, nodes, replace(finer, rest_length=rest, frames=frames), start)


def cut_in_two(beams: Beams, cut: Indices, middles: Indices) -> Beams:
    """The beams with those numbered `cut` (k,) half as long, up to the nodes `middles` (k,), and behind all
    of them their second halves."""
    ends, again = beams.ends.copy(), beams.ends[cut]
    ends[cut, 1] = again[:, 0] = middles
    finer = beams.chosen(np.append(np.arange(len(ends)), cut))
    rest = finer.rest_length.copy()
    rest[cut] *= 0.5
    rest[len(ends) :] *= 0.5
    return replace(finer, ends=np.vstack([ends, again]), rest_length=rest)


def with_nodes(model: Model, nodes: Reals, beams: Beams, start: State | None) -> Model:
    """The model with all these `nodes` (n + k, 3), its own first, between other `beams` and from another
    `start`; new ones bear no load and are held only as all others are."""
    own, none = model.network, np.zeros((len(nodes) - len(model.network.nodes), 6))
    held = np.broadcast_to(own.fixed.all(axis=0) & ~own.imposed.any(axis=0), none.shape)
    network = Network(nodes, beams, own.cables, np.vstack([own.fixed, held]), np.vstack([own.imposed, none]))
    loads = {name: np.vstack([load, none]) for name, load in model.loads.items()}
    return Model(network, loads, start, model.supported)


def with_middles(state: State, beams: Beams, cut: Indices) -> State:
    """The state with the middles of the beams `cut` on the cubic through their ends: along it, and turned
    about it halfway."""
    a, b = beams.ends[cut].T
    one, other = state.positions[a], state.positions[b]
    length = np.linalg.norm(other - one, axis=1)[:, None]
    axis = beams.frames[cut][:, 0, :, 0]
    along = [
        np.einsum("eij,ej->ei", rotation.matrices(state.quaternions[node]), axis) * length for node in (a, b)
    ]
    middle = 0.5 * (one + other) + 0.125 * (along[0] - along[1])
    tangent = 1.5 * (other - one) - 0.25 * (along[0] + along[1])
    half = rotation.between(state.quaternions[a], state.quaternions[b], 0.5)
    half = _turned_along(half, axis, tangent)
    return State(np.vstack([state.positions, middle]), np.vstack([state.quaternions, half]))


def _turned_along(quaternions: Reals, axis: Reals, direction: Reals) -> Reals:
    """The quaternions (k, 4) turned on by the least rotation that brings what was `axis` (k, 3) into the
    `direction` (k, 3) of any length."""
    now = np.einsum("eij,ej->ei", rotation.matrices(quaternions), axis)
    wanted = direction / np.linalg.norm(direction, axis=1, keepdims=True)
    return rotation.product(_least_turn(now, wanted), quaternions)


def _least_turn(now: Reals, wanted: Reals) -> Reals:
    """Quaternions (k, 4) of the least rotations that bring the unit vectors `now` (k, 3) onto those
    `wanted`."""
    cosine = (now * wanted).sum(axis=1, keepdims=True)
    least = np.hstack([1.0 + cosine, np.cross(now, wanted)])
    return np.asarray(least / np.linalg.norm(least, axis=1, keepdims=True))


def _bulge(nodes: Reals, beams: Beams) -> Reals:
    """How far off its chord the middle of each beam lies (m, 3) where beams stand for a curve."""
    a, b = beams.ends.T
    chord = nodes[b] - nodes[a]
    length = np.linalg.norm(chord, axis=1)
    at_node, joins = _curvature(nodes, beams, chord / length[:, None], length)
    one, other = at_node[a], at_node[b]
    same_side = (one * other).sum(axis=1) > 0.0
    smaller = np.where((np.linalg.norm(one, axis=1) < np.linalg.norm(other, axis=1))[:, None], one, other)
    inner = joins[a] & joins[b]
    own = np.where((inner & same_side)[:, None], smaller, 0.0)
    # A chain's last beam bends as its neighbour does.
    by_node = np.zeros_like(nodes)
    for side in (a, b):
        np.add.at(by_node, side[inner], own[inner])
    for here, there in ((a, b), (b, a)):
        last = joins[here] & ~joins[there]
        own[last] = by_node[here[last]]
    across = own - (own * chord).sum(axis=1)[:, None] * chord / length[:, None] ** 2
    return np.asarray(-0.125 * length[:, None] ** 2 * across)


def _curvature(nodes: Reals, beams: Beams, direction: Reals, length: Reals) -> tuple[Reals, Flags]:
    """The curvature (n, 3), 1/m, at each node, towards the curve's centre, and whether two beams of a kind go
    on through it (n,).
    """
    count, m = len(nodes), len(beams.ends)
    meeting = np.bincount(beams.ends.ravel(), minlength=count)
    outward = np.zeros((count, 3))
    np.add.at(outward, beams.ends[:, 0], direction)
    np.add.at(outward, beams.ends[:, 1], -direction)
    mean = np.bincount(beams.ends.ravel(), weights=np.repeat(0.5 * length, 2), minlength=count)
    least, most = np.full(count, m), np.full(count, -1)
    np.minimum.at(least, beams.ends.ravel(), np.repeat(beams.kind, 2))
    np.maximum.at(most, beams.ends.ravel(), np.repeat(beams.kind, 2))
    # Two unit vectors away from a node add up to twice the sine of half the turn there.
    smooth = np.linalg.norm(outward, axis=1) < 2.0 * np.sin(0.5 * _CORNER)
    joins = (meeting == 2) & (least == most) & smooth
    curvature = np.zeros((count, 3))
    curvature[joins] = outward[joins] / mean[joins, None]
    return curvature, joins


def _turned_to(frames: Reals, axis: Reals) -> Reals:
    """Frames (k, 2, 3, 3) turned by the least rotation that brings their x axes onto `axis` (k, 3)."""
    turn = rotation.matrices(_least_turn(frames[:, 0, :, 0], axis))
    return np.asarray(turn[:, None] @ frames)
