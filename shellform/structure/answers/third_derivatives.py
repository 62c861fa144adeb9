"""Third derivatives of the elements' energies, exact, for the derivatives of stiffness: how tr(K M) changes
with the state at fixed M.

K being the Hessian of the energy U along spins, v'Kv is the second derivative of U(t) where an element moves
by t v (nodes shifted, triads turned by exp(t S(v))). With M = sum of w v v' (its eigenvectors) the trace is
the sum of w v'Kv. U(t) is carried as a polynomial up to t² in arithmetic that cuts off the rest, exact to
rounding; the derivative by each degree of freedom of the state follows from an imaginary step of that degree
of freedom, whose square is below the last digit: no differences are taken. The energies are those of beam.py
(18) with its triads, and of cable.py.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from shellform.arrays import Reals
from shellform.structure.elements import rotation
from shellform.structure.elements.beam import Beams
from shellform.structure.elements.cable import Cables
from shellform.structure.elements.state import State

_STEP = 1e-30  # imaginary
_CHUNK = 256  # elements at a time, each with 144 polynomials

Array = np.ndarray[Any, Any]


@dataclass(frozen=True)
class _Poly:
    """a + b t + c t², with arrays that broadcast."""

    a: Array
    b: Array
    c: Array

    def __add__(self, other: _Poly) -> _Poly:
        return _Poly(self.a + other.a, self.b + other.b, self.c + other.c)

    def __sub__(self, other: _Poly) -> _Poly:
        return _Poly(self.a - other.a, self.b - other.b, self.c - other.c)

    def __mul__(self, other: _Poly) -> _Poly:
        return _Poly(
            self.a * other.a,
            self.a * other.b + self.b * other.a,
            self.a * other.c + self.b * other.b + self.c * other.a,
        )

    def of(self, value: Array, first: Array, second: Array) -> _Poly:
        """A function of this polynomial with its value and derivatives at a."""
        return _Poly(value, first * self.b, first * self.c + 0.5 * second * self.b * self.b)

    def root(self) -> _Poly:
        root = np.sqrt(self.a)
        return self.of(root, 0.5 / root, -0.25 / (root * self.a))

    def inverse(self) -> _Poly:
        inverse = 1.0 / self.a
        return self.of(inverse, -(inverse**2), 2.0 * inverse**3)

    def arcsine(self) -> _Poly:
        rest = 1.0 - self.a * self.a
        first = 1.0 / np.sqrt(rest)
        return self.of(np.arcsin(self.a), first, self.a * first / rest)


_Vector = list[_Poly]


def beam_rates(beams: Beams, state: State, weights: Reals) -> Reals:
    """Derivatives (m, 12) of tr(K M) by each beam's own degrees of freedom, for symmetric M `weights` (m, 12,
    12).
    """
    result = np.empty((len(beams.ends), 12))
    for first in range(0, len(result), _CHUNK):
        part = slice(first, first + _CHUNK)
        result[part] = _beam_chunk(beams, state, weights[part], np.arange(len(result))[part])
    return result


def cable_rates(cables: Cables, state: State, weights: Reals) -> Reals:
    """Derivatives (c, 6) of tr(K M) by each cable's own degrees of freedom, for symmetric M `weights` (c, 6,
    6); 0 for slack ones.
    """
    values, vectors = np.linalg.eigh(weights)
    shift = vectors.transpose(0, 2, 1)[:, :, None, :]
    place = state.positions[cables.ends].reshape(-1, 6)
    a, b = _moving(place[:, :3], shift[..., :3], 0, 6), _moving(place[:, 3:], shift[..., 3:], 3, 6)
    away = [q - p for p, q in zip(a, b, strict=True)]
    stretch = _dot(away, away).root() - _constant(cables.rest_length)
    taut = cables.lengths(state) > cables.rest_length
    scale = np.where(taut, cables.stiffness / cables.rest_length, 0.0)
    energy = stretch * stretch
    return _contracted(0.5 * scale, energy, values)


def _beam_chunk(beams: Beams, state: State, weights: Reals, chosen: Array) -> Array:
    values, vectors = np.linalg.eigh(weights)
    motion = vectors.transpose(0, 2, 1)[:, :, None, :]  # element, direction, step, degree of freedom
    ends = beams.ends[chosen]
    frames = beams.frames[chosen]
    x = state.positions[ends]
    triads = [rotation.matrices(state.quaternions[ends[:, end]]) @ frames for end in range(2)]
    a, b = _moving(x[:, 0], motion[..., :3], 0, 12), _moving(x[:, 1], motion[..., 6:9], 6, 12)
    A, B = _turning(triads[0], motion[..., 3:6], 3), _turning(triads[1], motion[..., 9:12], 9)
    d = [q - p for p, q in zip(a, b, strict=True)]
    length = _dot(d, d).root()
    ex = _scaled(d, length.inverse())
    v = [p + q for p, q in zip(A[1], B[1], strict=True)]
    z = _cross(ex, v)
    ez = _scaled(z, _dot(z, z).root().inverse())
    ey = _cross(ez, ex)
    half = 0.5
    theta = []
    for T in (A, B):
        for one, other in (
            (_dot(ez, T[1]), _dot(ey, T[2])),
            (_dot(ez, T[0]), _dot(ex, T[2])),
            (_dot(ey, T[0]), _dot(ex, T[1])),
        ):
            twice = one - other
            theta.append(_Poly(half * twice.a, half * twice.b, half * twice.c).arcsine())
    l0 = beams.rest_length[chosen]
    stretch = length - _constant(l0)
    twist = theta[0] - theta[3]
    total = _contracted(0.5 * beams.axial[chosen] / l0, stretch * stretch, values)
    total += _contracted(0.5 * beams.torsion[chosen] / l0, twist * twist, values)
    for k, bending in ((1, beams.bending_y), (2, beams.bending_z)):
        one, other = theta[k], theta[k + 3]
        total += _contracted(2.0 * bending[chosen] / l0, one * one + one * other + other * other, values)
    return total


def _contracted(scale: Reals, energy: _Poly, values: Reals) -> Array:
    """Sum over the directions of weight times second derivative, its rate by each step, (m, k)."""
    rates = 2.0 * np.imag(energy.c) / _STEP
    return np.asarray(scale[:, None] * np.einsum("er,erc->ec", values, rates))


def _moving(place: Reals, shift: Array, at: int, size: int) -> _Vector:
    """Coordinates of a node (m, 3) that moves along `shift` (m, r, 1, 3), each also with the imaginary steps
    of its three degrees of freedom from `at` on.
    """
    result = []
    for axis in range(3):
        step = np.zeros(size, dtype=complex)
        step[at + axis] = 1j * _STEP
        start = place[:, None, None, axis] + step
        result.append(_Poly(start, shift[..., axis], np.zeros(1)))
    return result


def _turning(triad: Reals, spin: Array, at: int) -> list[_Vector]:
    """The three axes, each a vector, of the triads (m, 3, 3) that turn by `spin` (m, r, 1, 3): exp(t S(v))
    exp(i S(step)) up to t².
    """
    axes = []
    w = [spin[..., k] for k in range(3)]
    for column in range(3):
        own = triad[:, None, None, :, column]
        start = [np.broadcast_to(own[..., k], (len(triad), 1, 12)).astype(complex) for k in range(3)]
        for axis in range(3):
            # An imaginary spin about one axis turns the two others into each other.
            i, j = (axis + 1) % 3, (axis + 2) % 3
            start[i][..., at + axis] -= 1j * _STEP * own[..., 0, j]
            start[j][..., at + axis] += 1j * _STEP * own[..., 0, i]
        first = _product(w, start)
        second = _product(w, first)
        axes.append([_Poly(p, q, 0.5 * r) for p, q, r in zip(start, first, second, strict=True)])
    return axes


def _product(u: list[Array], v: list[Array]) -> list[Array]:
    return [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]


def _constant(value: Reals) -> _Poly:
    return _Poly(value[:, None, None], np.zeros(1), np.zeros(1))


def _dot(u: _Vector, v: _Vector) -> _Poly:
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


def _cross(u: _Vector, v: _Vector) -> _Vector:
    return [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]


def _scaled(u: _Vector, s: _Poly) -> _Vector:
    return [each * s for each in u]
