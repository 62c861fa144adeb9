"""How the stiffness of co-rotational beams changes as their ends move, contracted element by element: third
derivatives of the energy.

The derivative of the compiled tangent (beam_kernels.py) by a degree of freedom is the imaginary part of that
tangent at a place, or a turn, that is off by i h, over h: exact to the last digit, since nothing is
subtracted (Squire and Trapp 1998). Moved as a whole an element keeps its stiffness: what the first end's
place changes is what the second's does, with the other sign, so that nine evaluations an element serve for
twelve.
"""

from __future__ import annotations

import numpy as np

from shellform.compiled import njit
from shellform.structure.elements.beam_kernels import evaluate

_STEP = 1e-30  # of the complex shift: its square vanishes beside 1
_AT_ONCE = 32  # elements, whose arrays stay in the processor's cache

# Its products and sums aren't contracted: the loop that calls it would have a copy contracted otherwise, and
# which one is run would depend on what this process has compiled and what it has from the cache.
_evaluate = njit(error_model="numpy")(evaluate.py_func)


@njit(cache=True, error_model="numpy", nogil=True)
def contracted(start, stop, positions, quaternions, ends, frames, rest_length, stiffness, weights, result):  # type: ignore[no-untyped-def]
    """Fills the derivatives `result` (m, 12) of the sum of an element's packed tangent times its `weights`
    (m, 78), by the places and the spins of both ends, for the beams from `start` to `stop`.
    """
    place, turn = np.empty((2 * _AT_ONCE, 3), np.complex128), np.empty((2 * _AT_ONCE, 4), np.complex128)
    pairs = np.arange(2 * _AT_ONCE).reshape(-1, 2)
    energy, force = np.empty(_AT_ONCE, np.complex128), np.empty((_AT_ONCE, 12), np.complex128)
    blocks, none = np.empty((_AT_ONCE, 78), np.complex128), np.empty((0, 7), np.complex128)
    angle = np.empty(_AT_ONCE)
    given = np.empty((0, 7))  # deformations are those of the places and turns
    for first in range(start, stop, _AT_ONCE):
        last = min(first + _AT_ONCE, stop)
        count = last - first
        for e in range(count):
            for end in range(2):
                node = ends[first + e, end]
                place[2 * e + end] = positions[node]
                turn[2 * e + end] = quaternions[node]
        for dof in range(3, 12):
            end, axis = divmod(dof, 6)
            for e in range(count):
                _shift(place[2 * e + end], turn[2 * e + end], axis, 1j * _STEP)
            _evaluate(
                0, count, place, turn, pairs, frames[first:last], rest_length[first:last],
                stiffness[first:last], given, 1.0, energy, force, blocks, none, none, angle,
            )  # fmt: skip
            for e in range(count):
                total = 0.0
                for k in range(78):
                    total += blocks[e, k].imag * weights[first + e, k]
                result[first + e, dof] = total / _STEP
                node = ends[first + e, end]
                place[2 * e + end] = positions[node]
                turn[2 * e + end] = quaternions[node]
        for e in range(first, last):
            for k in range(3):
                result[e, k] = -result[e, 6 + k]


@njit(cache=True)
def _shift(place, turn, axis, step):  # type: ignore[no-untyped-def]
    """Moves a node by the step along one axis, or turns it about one, in place."""
    if axis < 3:
        place[axis] += step
        return
    w, x, y, z = turn[0], turn[1], turn[2], turn[3]
    half = 0.5 * step
    if axis == 3:
        turn[0], turn[1], turn[2], turn[3] = w - half * x, x + half * w, y - half * z, z + half * y
    elif axis == 4:
        turn[0], turn[1], turn[2], turn[3] = w - half * y, x + half * z, y + half * w, z - half * x
    else:
        turn[0], turn[1], turn[2], turn[3] = w - half * z, x - half * y, y + half * x, z + half * w
