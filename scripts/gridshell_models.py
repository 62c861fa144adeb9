"""Gridshell models of any size, for the benchmarks: the same ones for shellform and for its peers.

Two layers of rods over a translation surface of two equal arcs, z = a(x) + a(y), are an exact Chebyshev net
of equal spacing, so that no net has to be pulled. Rods, connectors and cables have the paper's scale-model
properties (table 1); the stress-free state is the curved one; rod ends are pinned; cables lie on both
diagonals of every cell, on the lower layer, and every crossing carries a dead load.
"""

from __future__ import annotations

import numpy as np

from shellform.structure.elements.beam import make_beams
from shellform.structure.elements.cable import make_cables
from shellform.structure.model import Model
from shellform.structure.network import Network

SPACING, GAP = 0.055, 0.002  # m
ROD = (
    40e9 * np.pi * 1e-6,
    40e9 / 2.4 * np.pi / 2 * 1e-12,
    40e9 * np.pi / 4 * 1e-12,
)  # EA N, GJ and EI N·m², radius 1 mm
JOINT = (7.15e4, 7.38e-4, 7.85e-4)  # EA N, GJ and EI N·m²
CABLE = 187.0  # EA, N
LOAD = -0.4  # N on each crossing


def gridshell(rods: int, elements: int = 4, *, cable_rest: float = 1.0, loaded: float = LOAD) -> Model:
    """A gridshell of `rods` rods in each direction, `elements` beams between two crossings.

    `cable_rest`: rest length of the cables over their length; `loaded`: force on each crossing along z, N.
    The load case is called "design". The shell has the proportions of the scale model whatever its size: rise
    over span is 1 : 4 along each axis.
    """
    place = _arc(rods + 1, elements)
    stations = elements * (rods + 1) + 1
    crossing = elements * np.arange(1, rods + 1)
    number = np.full((2, stations, stations), -1)
    nodes, ends, z_axes, properties, kinds = [], [], [], [], []
    count = 0
    for layer in range(2):  # the lower one runs along x
        for line in crossing:
            own = np.arange(count, count + stations)
            along = np.column_stack(
                [place[:, 0], np.full(stations, place[line, 0]), place[:, 1] + place[line, 1]]
            )
            nodes.append((along if layer == 0 else along[:, [1, 0, 2]]) + [0.0, 0.0, GAP * layer])
            if layer == 0:
                number[0, :, line] = own
            else:
                number[1, line, :] = own
            ends.append(np.column_stack([own[:-1], own[1:]]))
            count += stations
    rod_ends = np.vstack(ends)
    joint_ends = np.column_stack(
        [number[0][np.ix_(crossing, crossing)].ravel(), number[1][np.ix_(crossing, crossing)].ravel()]
    )
    points = np.vstack(nodes)
    every = np.vstack([rod_ends, joint_ends])
    is_joint = np.arange(len(every)) >= len(rod_ends)
    stiffness = np.where(is_joint[:, None], JOINT, ROD)
    z_axes = np.where(is_joint[:, None], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0])
    kinds = is_joint.astype(np.int64)
    properties = stiffness.T
    beams = make_beams(
        points, every, axial=properties[0], torsion=properties[1], bending_y=properties[2], bending_z=properties[2],
        z_axis=z_axes, kind=kinds, kinds=("rod", "connector"),
    )  # fmt: skip
    corner = number[0][np.ix_(crossing, crossing)]
    diagonals = np.vstack([
        np.column_stack([corner[:-1, :-1].ravel(), corner[1:, 1:].ravel()]),
        np.column_stack([corner[:-1, 1:].ravel(), corner[1:, :-1].ravel()]),
    ])  # fmt: skip
    length = np.linalg.norm(points[diagonals[:, 1]] - points[diagonals[:, 0]], axis=1)
    cables = make_cables(diagonals, rest_length=cable_rest * length, stiffness=np.full(len(diagonals), CABLE))
    supports = np.concatenate(
        [number[0, [0, -1]][:, crossing].ravel(), number[1, :, [0, -1]][:, crossing].ravel()]
    )
    fixed = np.zeros((count, 6), dtype=bool)
    fixed[supports, :3] = True
    load = np.zeros((count, 6))
    load[joint_ends[:, 1], 2] = loaded
    network = Network(points, beams, cables, fixed, np.zeros((count, 6)))
    return Model(network, {"design": load}, None, tuple(sorted(supports.tolist())))


def _arc(segments: int, elements: int) -> np.ndarray:
    """Points (n, 2), m, on a circular arc, each segment of chord SPACING and its elements equal chords; rise
    : span is 1 : 4.
    """
    opening = 2.0 * 2.0 * np.arctan(0.5)  # of an arc whose rise is a quarter of its span
    steps = segments * elements
    radius = SPACING / (2.0 * np.sin(0.5 * opening / segments))
    angle = opening * (np.arange(steps + 1) / steps - 0.5)
    return radius * np.column_stack([np.sin(angle), np.cos(angle) - np.cos(0.5 * opening)])
