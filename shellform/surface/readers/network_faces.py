"""The faces between the lines of a network, as form-finding programs write shells that they hold as nodes and
edges.

Seen from above, the lines cut the plane into faces: from each line's end the next one is followed clockwise,
until the walk closes. Walks round faces turn counter-clockwise; the one round the whole turns the other way.
Lines that end in nothing bound no face.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from shellform.arrays import Indices, Reals
from shellform.errors import InputError


def faces_in_plan(points: Reals, lines: Indices, where: str) -> list[list[int]]:
    """The faces, each with its corners counter-clockwise from above, of a network of `points` (n, 3) and
    `lines` (m, 2) between them; `where` names it in errors. Raises InputError where lines cross, touch or lie
    on each other in plan, so that there are none to tell."""
    lines = _bounding(np.unique(np.sort(lines[lines[:, 0] != lines[:, 1]], axis=1), axis=0), len(points))
    if not len(lines):
        return []
    starts, ends = np.concatenate([lines, lines[:, ::-1]]).T
    along = points[ends, :2] - points[starts, :2]
    order = np.lexsort((np.arctan2(along[:, 1], along[:, 0]), starts))
    before = np.empty(len(order), dtype=np.int64)  # the line that starts at the same node, next clockwise
    first = np.searchsorted(starts[order], starts[order], side="left")
    last = np.searchsorted(starts[order], starts[order], side="right") - 1
    place = np.arange(len(order))
    before[order] = order[np.where(place == first, last, place - 1)]
    back = (np.arange(len(starts)) + len(lines)) % len(starts)
    following = before[back]

    graph = sp.coo_array((np.ones(len(starts)), (starts, ends)), shape=(len(points), len(points)))
    _, piece = connected_components(graph)
    seen, faces, round_whole = np.zeros(len(starts), dtype=bool), [], 0
    for begin in range(len(starts)):
        walk, line = [], begin
        while not seen[line]:
            seen[line] = True
            walk.append(int(starts[line]))
            line = following[line]
        if not walk:
            continue
        x, y = (points[walk] - points[walk[0]])[:, :2].T
        if float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) <= 0.0:
            round_whole += 1
        elif len(set(walk)) == len(walk):
            faces.append(walk)
        else:
            raise _unclear(where)
    if round_whole != len(np.unique(piece[starts])):
        raise _unclear(where)
    return faces


def _bounding(lines: Indices, count: int) -> Indices:
    """The lines without those that end in nothing, whose neighbours may then do so too."""
    while len(lines):
        met = np.bincount(lines.ravel(), minlength=count)
        kept = (met[lines] > 1).all(axis=1)
        if kept.all():
            break
        lines = lines[kept]
    return lines


def _unclear(where: str) -> InputError:
    return InputError(
        "is a network whose lines cross or touch in plan, so that its faces can't be told",
        where=where,
        remedy="Save a mesh of the shell: compas.datastructures.Mesh.",
    )
