"""Finite rotations of the nodes as unit quaternions (equations 9 to 11).

A node's orientation is the quaternion q = (w, v) of its total rotation from the stress-free state, w =
cos(a/2), v = sin(a/2) times the axis. A rotation increment d (a rotation vector in global axes, rad) is
applied from the left, R <- R(d) R as in equation (9). Quaternions keep small angles to full relative
precision and zero exactly zero, need no special case at any angle, and are made unit again after every
product, so errors don't build up.
"""

from __future__ import annotations

import numpy as np

from shellform.arrays import Reals
from shellform.compiled import njit


def identity(count: int) -> Reals:
    """Quaternions (count, 4) of no rotation."""
    unit = np.zeros((count, 4))
    unit[:, 0] = 1.0
    return unit


def from_vectors(vectors: Reals) -> Reals:
    """Quaternions (k, 4) of rotation vectors (k, 3), rad. Equation (10) in quaternion form."""
    half = 0.5 * np.linalg.norm(vectors, axis=1)
    # np.sinc(x) is sin(pi x)/(pi x): exact at zero and smooth near it.
    return np.column_stack([np.cos(half), 0.5 * np.sinc(half / np.pi)[:, None] * vectors])


def to_vectors(quaternions: Reals) -> Reals:
    """Rotation vectors (k, 3), rad, of length at most pi, of unit quaternions (k, 4)."""
    upper = np.where(quaternions[:, :1] < 0.0, -quaternions, quaternions)
    sine = np.linalg.norm(upper[:, 1:], axis=1)
    angle = 2.0 * np.arctan2(sine, upper[:, 0])
    ratio = np.divide(angle, sine, out=np.full_like(sine, 2.0), where=sine > 0.0)
    return ratio[:, None] * upper[:, 1:]


def product(left: Reals, right: Reals) -> Reals:
    """Quaternions (k, 4) of the rotation `right` followed by `left`, made unit."""
    w, v = left[:, :1], left[:, 1:]
    u, s = right[:, :1], right[:, 1:]
    result = np.hstack([w * u - np.sum(v * s, axis=1, keepdims=True), w * s + u * v + np.cross(v, s)])
    return result / np.linalg.norm(result, axis=1, keepdims=True)


def between(first: Reals, second: Reals, share: Reals | float) -> Reals:
    """Unit quaternions (k, 4) between two, at a `share` of the way (k, 1) from the first to the second, the
    shorter way round."""
    near = np.where(np.sum(first * second, axis=1, keepdims=True) >= 0.0, second, -second)
    mixed = (1.0 - share) * first + share * near
    return np.asarray(mixed / np.linalg.norm(mixed, axis=1, keepdims=True))


@njit(cache=True, error_model="numpy")
def turned(vectors, quaternions):  # type: ignore[no-untyped-def]
    """The quaternions (k, 4) turned further by the rotation vectors (k, 3), rad: `product` of `from_vectors`
    and them in one pass.
    """
    result = np.empty_like(quaternions)
    for k in range(len(quaternions)):
        x, y, z = vectors[k, 0], vectors[k, 1], vectors[k, 2]
        half = 0.5 * np.sqrt(x * x + y * y + z * z)
        w = np.cos(half)
        ratio = 0.5 * np.sin(half) / half if half > 0.0 else 0.5
        x, y, z = ratio * x, ratio * y, ratio * z
        u, p, q, r = quaternions[k, 0], quaternions[k, 1], quaternions[k, 2], quaternions[k, 3]
        a = w * u - (x * p + y * q + z * r)
        b = w * p + u * x + (y * r - z * q)
        c = w * q + u * y + (z * p - x * r)
        d = w * r + u * z + (x * q - y * p)
        size = np.sqrt(a * a + b * b + c * c + d * d)
        result[k, 0], result[k, 1], result[k, 2], result[k, 3] = a / size, b / size, c / size, d / size
    return result


def matrices(quaternions: Reals) -> Reals:
    """Rotation matrices (k, 3, 3) of unit quaternions (k, 4)."""
    result = np.empty((len(quaternions), 3, 3))
    _matrices(np.ascontiguousarray(quaternions), result)
    return result


def from_matrices(rotations: Reals) -> Reals:
    """Unit quaternions (k, 4), w >= 0, of rotation matrices (k, 3, 3) (Shepperd's choice of the largest
    pivot).
    """
    trace = np.trace(rotations, axis1=1, axis2=2)
    diagonal = np.einsum("kii->ki", rotations)
    pivots = np.column_stack([trace, diagonal])
    largest = np.argmax(pivots, axis=1)
    result = np.empty((len(rotations), 4))
    for k, (r, p) in enumerate(zip(rotations, largest, strict=True)):
        if p == 0:
            result[k] = (1.0 + trace[k], r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1])
        else:
            i = p - 1
            j, m = (i + 1) % 3, (i + 2) % 3
            result[k, 0] = r[m, j] - r[j, m]
            result[k, 1 + i] = 1.0 + 2.0 * r[i, i] - trace[k]
            result[k, 1 + j] = r[j, i] + r[i, j]
            result[k, 1 + m] = r[m, i] + r[i, m]
    result *= np.where(result[:, :1] < 0.0, -1.0, 1.0)
    return result / np.linalg.norm(result, axis=1, keepdims=True)


@njit(cache=True)
def matrix(q, out):  # type: ignore[no-untyped-def]
    """Writes the rotation matrix of the unit quaternion q (4,) into out (3, 3)."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    out[0, 0] = 1.0 - 2.0 * (y * y + z * z)
    out[0, 1] = 2.0 * (x * y - w * z)
    out[0, 2] = 2.0 * (x * z + w * y)
    out[1, 0] = 2.0 * (x * y + w * z)
    out[1, 1] = 1.0 - 2.0 * (x * x + z * z)
    out[1, 2] = 2.0 * (y * z - w * x)
    out[2, 0] = 2.0 * (x * z - w * y)
    out[2, 1] = 2.0 * (y * z + w * x)
    out[2, 2] = 1.0 - 2.0 * (x * x + y * y)


@njit(cache=True)
def _matrices(quaternions, result):  # type: ignore[no-untyped-def]
    for k in range(len(quaternions)):
        matrix(quaternions[k], result[k])
