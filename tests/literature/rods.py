"""Exact rods for the references of `shellform verify`: the Kirchhoff rod with stretch, by initial value
problems.

With r the axis, D = (d1, d2, d3) the section's triad (columns, d1 along the axis), n and m the internal force
and moment in global axes, and s the length in the stress-free state,

    r' = (1 + n·d1/EA) d1,   D' = S(D u) D,   u = u0 + diag(1/GJ, 1/EIy, 1/EIz) D' m,   n' = 0,   m' = -r' x n

in each piece between loads. Unknown start values are found by Newton's method on the far end (shooting);
nothing here is shared with the package, so an error would have to be made twice. Runge-Kutta of fourth order,
200 steps a piece: halving them moves no digit that is quoted.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.optimize import brentq

STEPS = 200


@dataclass(frozen=True)
class Piece:
    """A stretch of rod: before it starts, the triad turns by `turn` rad about global y (a rigid corner,
    right-handed, seen in the undeformed state: a turn in the section's own x-z plane) and the dead `force`
    (3,) acts; `bend` is the stress-free curvature about d2."""

    length: float
    turn: float = 0.0
    force: tuple[float, float, float] = (0.0, 0.0, 0.0)
    bend: float = 0.0


@dataclass(frozen=True)
class End:
    """Where a piece ends: position, triad, internal force and moment there."""

    position: np.ndarray
    triad: np.ndarray
    force: np.ndarray
    moment: np.ndarray


def about_y(angle: float) -> np.ndarray:
    """The rotation matrix about the y axis."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def integrate(
    pieces: Sequence[Piece],
    stiffness: tuple[float, float, float, float],
    triad: np.ndarray,
    force: Sequence[float],
    moment: Sequence[float],
    position: Sequence[float] = (0.0, 0.0, 0.0),
) -> list[End]:
    """The ends of all pieces, from start values; stiffness (EA, GJ, EIy, EIz)."""
    here = End(
        np.array(position, dtype=float), triad, np.array(force, dtype=float), np.array(moment, dtype=float)
    )
    ends = []
    for piece in pieces:
        n = here.force - np.array(piece.force)
        y = np.concatenate([here.position, (here.triad @ about_y(piece.turn)).ravel(), here.moment])
        _march(y, n, np.array(stiffness), piece.bend, piece.length / STEPS)
        here = End(y[:3].copy(), y[3:12].reshape(3, 3).copy(), n, y[12:].copy())
        ends.append(here)
    return ends


@njit(cache=True)
def _march(y, n, stiffness, bend, h):
    """STEPS steps of the classical Runge-Kutta method of fourth order, in place."""
    k = np.zeros((4, 15))
    for _ in range(STEPS):
        for stage in range(4):
            z = y.copy()
            if stage > 0:
                z += (h if stage == 3 else 0.5 * h) * k[stage - 1]
            d = z[3:12].reshape(3, 3)
            m = z[12:]
            stretch = 1.0 + (n[0] * d[0, 0] + n[1] * d[1, 0] + n[2] * d[2, 0]) / stiffness[0]
            u = np.zeros(3)
            for i in range(3):
                for j in range(3):
                    u[i] += d[i, j] * (d[0, j] * m[0] + d[1, j] * m[1] + d[2, j] * m[2]) / stiffness[1 + j]
                u[i] += d[i, 1] * bend
            for i in range(3):
                p, q = (i + 1) % 3, (i + 2) % 3
                k[stage, i] = stretch * d[i, 0]
                for j in range(3):
                    k[stage, 3 + 3 * i + j] = u[p] * d[q, j] - u[q] * d[p, j]
                k[stage, 12 + i] = stretch * (n[p] * d[q, 0] - n[q] * d[p, 0])
        y += h / 6.0 * (k[0] + 2.0 * k[1] + 2.0 * k[2] + k[3])


def solve(
    residual: Callable[[np.ndarray], np.ndarray], start: Sequence[float], scale: Sequence[float]
) -> np.ndarray:
    """The root of the residual near `start` by Newton's method; `scale` is the size of a change that matters
    in each unknown.
    """
    x, scale = np.array(start, dtype=float), np.asarray(scale, dtype=float)
    for _ in range(30):
        now = np.asarray(residual(x))
        steps = np.diag(1e-4 * scale)
        slope = np.array([(np.asarray(residual(x + h)) - residual(x - h)) / (2.0 * h.sum()) for h in steps]).T
        step = np.linalg.solve(slope, now)
        largest = np.abs(step / scale).max()
        x -= step * min(1.0, 1.0 / largest)
        if largest < 1e-9:
            return x
    raise AssertionError("no root near the start")


def extremum(value: Callable[[float], float], low: float, high: float, step: float) -> float:
    """Where the smooth function's central difference vanishes between two arguments."""
    return float(brentq(lambda x: value(x + step) - value(x - step), low, high, xtol=1e-9))
