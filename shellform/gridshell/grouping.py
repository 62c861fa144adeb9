"""Cables alike: those that a symmetry of the net maps onto each other, neighbours along one diagonal, and the
fewest lengths to cut cables to.

A symmetry is a mirror or a half turn of the plan about the middle of the joints under which every candidate
cable lies on another one; mirrors are sought along x and y and along the smallest rectangle round the
joints. Cables that symmetries join are a group, of which every member gets the same rest
length (`sf.polish` with `groups`).

Turnbuckles take up what lengths differ within a group. With a range of adjustment w, cables can be cut to the
length L where all their rest lengths lie in [L, L + w]; walking up the sorted rest lengths and starting anew
wherever the range is used up gives the fewest different lengths that there can be.
"""

from __future__ import annotations

from itertools import product

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from shellform.arrays import Flags, Indices, Reals
from shellform.errors import InputError, require_number
from shellform.gridshell.gridshell import Gridshell
from shellform.plan_rectangle import axes_in_plan, turn_of_plan

_SYMMETRIES = ((-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0))  # signs of x and y in two mirrors and the half turn
_TOLERANCE = 0.02  # of the spacing, within which the image of each cable's end has to lie on another's
_PATCH = 4  # cells of a patch along each direction of rods


def symmetric_groups(shell: Gridshell) -> Indices:
    """A group number (c,) for every candidate cable. Raises InputError where the net has no symmetry that
    joins any.
    """
    if not len(shell.cable_ends):
        raise InputError(
            "there are no cables to group",
            where="optimise.symmetric",
            value=True,
            remedy="Leave symmetric out.",
        )
    places, ends = _ends(shell)
    tree, reach = cKDTree(places), _TOLERANCE * shell.net.spacing
    count, joined = len(ends), list[Indices]()
    number = {(a, b): k for k, (a, b) in enumerate(np.sort(ends, axis=1).tolist())}
    for turn, sign in product({0.0, turn_of_plan(shell.net.crossings)}, _SYMMETRIES):
        image = _image(places, shell.net.crossings, axes_in_plan(turn), np.array(sign))
        away, there = tree.query(image)
        if (away > reach).any():
            continue
        which = [number.get((a, b), -1) for a, b in np.sort(there[ends], axis=1).tolist()]
        if min(which) >= 0:
            joined.append(np.column_stack([np.arange(count), which]))
    if not joined:
        raise InputError(
            f"has no mirror or half turn that maps all cables onto each other within {1e3 * reach:.2g} mm",
            where="optimise.symmetric",
            value=True,
            remedy="Turn the net (net.angle) or shift it (net.offset) along the surface's symmetry, or leave "
            "symmetric out.",
        )
    pairs = np.vstack(joined)
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def _image(places: Reals, joints: Reals, axes: Reals, sign: Reals) -> Reals:
    """Where `places` (k, 3) come to by changing signs along `axes`, columns (2, 2), about the middle of the
    `joints`."""
    plan = joints[:, :2] @ axes
    middle = np.ptp(plan, axis=0) / 2.0 + plan.min(axis=0)
    image = places.copy()
    image[:, :2] = (middle + sign * (places[:, :2] @ axes - middle)) @ axes.T
    return image


def _ends(shell: Gridshell) -> tuple[Reals, Indices]:
    """The places (k, 3), m, at which cables end, and the two of each cable (c, 2): of a crossing the middle
    between its rods, for a mirror changes which of them lies above."""
    place = shell.target.positions.copy()
    place[shell.net.grid.crossing_nodes] = shell.net.crossings[:, None]
    own = np.arange(len(place))
    own[shell.net.grid.crossing_nodes] = shell.net.grid.crossing_nodes[:, :1]
    used, ends = np.unique(own[shell.cable_ends], return_inverse=True)
    return place[used], ends.reshape(-1, 2)


def patches(shell: Gridshell) -> Indices:
    """A number (c,) for every candidate cable, the same for those along one diagonal of the cells of a patch,
    some sixteen cables."""
    grid = shell.net.grid
    place = np.zeros((shell.node_count, 2), dtype=np.int64)
    place[grid.crossing_nodes] = grid.lattice[:, None]
    first, second = place[shell.cable_ends[:, 0]], place[shell.cable_ends[:, 1]]
    rising = (second - first).prod(axis=1) > 0
    patch = np.column_stack([np.minimum(first, second) // _PATCH, rising])
    return np.asarray(np.unique(patch, axis=0, return_inverse=True)[1].ravel(), dtype=np.int64)


def averaged(values: Reals, groups: Indices, present: Flags) -> Reals:
    """`values` (c,) with those of the present cables replaced by the means of their `groups` (c,)."""
    numbers = groups[present]
    sums = np.bincount(numbers, values[present], minlength=groups.max() + 1)
    counts = np.bincount(numbers, minlength=groups.max() + 1)
    result = values.copy()
    result[present] = (sums / np.maximum(counts, 1))[numbers]
    return result


def cut_lengths(rest_lengths: Reals, adjustment: float) -> Reals:
    """For each of the rest lengths (k,), m, the length (k,), m, to cut its cable to with the turnbuckle
    closed; as few different ones as an `adjustment`, m, of the turnbuckles allows, each at most that much
    shorter than the rest length."""
    require_number(
        adjustment, least=0.0, where="cable.adjustment", give="metres, such as 0.01, or 0 for none"
    )
    order = np.argsort(rest_lengths, kind="stable")
    result = np.empty_like(rest_lengths)
    shortest = -np.inf
    for k in order:
        if rest_lengths[k] > shortest + adjustment:
            shortest = float(rest_lengths[k])
        result[k] = shortest
    return result
