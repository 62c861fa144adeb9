"""Closed forms that the cases are compared with.

The elastica: with theta the slope of an inextensible rod under an end force P, EI theta'' + P sin theta = 0,
solved by Legendre's integrals of modulus k = sin(alpha/2), alpha the slope at the inflection (Love 1927, art.
262-263; Timoshenko and Gere 1961, art. 2.7). The elastic catenary: Irvine, Cable Structures (1981), section
1.3.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq, root
from scipy.special import ellipe, ellipk, ellipkinc, elliprd, elliprf, jv

from shellform.arrays import Reals


def inclined(load: float, angle: float) -> tuple[float, float]:
    """Tip of a cantilever of length 1 under a dead tip force, PL²/EI = `load`, as its distances from the
    clamp against the force and across it; `angle`, rad, is the clamped tangent's from the direction against
    the force.

    A pendulum that swings from `angle` to its amplitude alpha within the length.
    """
    size = np.sqrt(load)

    def phase(k: float) -> float:
        return float(np.arcsin(min(np.sin(0.5 * angle) / k, 1.0)))

    def gap(k: float) -> float:
        return float(ellipk(k * k) - ellipkinc(phase(k), k * k) - size)

    k = brentq(gap, np.sin(0.5 * angle) * (1.0 + 1e-15), 1.0 - 1e-12, xtol=1e-15)
    bent = ellipe(k * k) - float(second_kind(phase(k), k * k))
    return float(2.0 * bent / size - 1.0), float(2.0 * k * np.cos(phase(k)) / size)


def second_kind(phase: float | Reals, m: float) -> Reals:
    """Legendre's incomplete integral of the second kind E(phase | m), |phase| <= π/2, by Carlson's R_F and
    R_D (DLMF 19.25.9).

    SciPy's own ellipeinc is off by up to 0.1 at single points, such as E(1.3425595440263027 |
    0.256899060094085) (its issue 19498).
    """
    sine = np.sin(phase)
    square = np.cos(phase) ** 2
    rest = 1.0 - m * sine**2
    return np.asarray(sine * elliprf(square, rest, 1.0) - m / 3.0 * sine**3 * elliprd(square, rest, 1.0))


def cantilever(load: float) -> tuple[float, float]:
    """Tip displacements u (along) and w (across), over L, of a cantilever under a dead transverse tip load,
    PL²/EI = `load`.
    """
    against, across = inclined(load, 0.5 * np.pi)
    return 1.0 - across, -against


def buckled(alpha: float) -> tuple[float, float, float]:
    """A pinned strip of length 1 and EI 1 with end slope `alpha`, rad: thrust, distance of the ends,
    height.
    """
    k = np.sin(0.5 * alpha)
    whole = ellipk(k * k)
    return float(4.0 * whole**2), float(2.0 * ellipe(k * k) / whole - 1.0), float(k / whole)


def buckled_clamped(alpha: float) -> tuple[float, float, float]:
    """The like of `buckled` with clamped ends, `alpha` the slope at its inflections: four quarters of a
    pinned strip's half.
    """
    thrust, chord, _ = buckled(alpha)
    k = np.sin(0.5 * alpha)
    return 4.0 * thrust, chord, float(k / ellipk(k * k))


def bow(cable: float, stiffness: float) -> tuple[float, float, float]:
    """A pinned rod of length 1 and EI 1 tied by a cable of rest length `cable` < 1, EA `stiffness`: thrust,
    chord, height.
    """

    def gap(alpha: float) -> float:
        thrust, chord, _ = buckled(alpha)
        return thrust - stiffness * (chord / cable - 1.0)

    return buckled(brentq(gap, 1e-6, 0.75 * np.pi, xtol=1e-14))


def catenary(
    span: float, drop: float, length: float, weight: float, axial: float, at: float = 0.0, force: float = 0.0
) -> tuple[float, float, float, float]:
    """An elastic cable of stress-free `length` and `weight` a stress-free length between (0, 0) and (span,
    -drop).

    `force` hangs at the stress-free distance `at` from the first end. Returns the horizontal tension, the
    vertical pull at the first end, and the place (x, height) of the loaded point.
    """

    def stretch(h: float, v: float, s: float) -> tuple[float, float]:
        """The far end of a stretch of length s whose first end is pulled by h and v (upwards)."""
        end = v - weight * s
        x = h * s / axial + h / weight * (np.arcsinh(v / h) - np.arcsinh(end / h))
        down = s / axial * (v - 0.5 * weight * s) + h / weight * (
            np.hypot(1.0, v / h) - np.hypot(1.0, end / h)
        )
        return float(x), float(down)

    def both(h: float, v: float) -> tuple[float, float, float, float]:
        first = stretch(h, v, at)
        second = stretch(h, v - weight * at - force, length - at)
        return first[0] + second[0], first[1] + second[1], *first

    def gap(unknown: np.ndarray) -> np.ndarray:
        x, down, _, _ = both(total * np.exp(unknown[0]), total * unknown[1])
        return np.array([x - span, down - drop]) / span

    total = weight * length + force
    # The logarithm keeps the horizontal tension positive.
    found = root(gap, [-1.0, 0.5], tol=1e-13)
    h, v = total * np.exp(found.x[0]), total * found.x[1]
    _, _, x, down = both(h, v)
    return float(h), float(v), x, -down


def two_links(half: float, axial: float, pretension: float, load: float) -> float:
    """Sag of the middle of two straight cables of length `half` each, stretched to `pretension`, under a load
    across them.
    """
    rest = half / (1.0 + pretension / axial)

    def gap(sag: float) -> float:
        return 2.0 * axial * (1.0 / rest - 1.0 / np.hypot(half, sag)) * sag - load

    return float(brentq(gap, 0.0, half, xtol=1e-15))


def bessel_zero(kind: float, low: float, high: float) -> float:
    """The zero between `low` and `high` of the Bessel function of the first kind of the order `kind`."""
    return float(brentq(lambda x: jv(kind, x), low, high, xtol=1e-14))


def clamped_column() -> float:
    """PL²/EI of a column clamped at one end and pinned at the other: tan x = x, squared; 20.19."""
    return _tangent() ** 2


def braced_column(spring: float) -> float:
    """PL²/EI of a pinned column with a spring of `spring` EI/L³ at its middle, softer than 16 π² (Timoshenko
    and Gere 1961).
    """

    def gap(u: float) -> float:
        # The symmetric mode, u = L/2 √(P/EI): spring = 4 P/(L (1 - tan u/u)).
        return 16.0 * u**2 * (u * np.cos(u)) - spring * (u * np.cos(u) - np.sin(u))

    return 4.0 * float(brentq(gap, 0.5 * np.pi, np.pi, xtol=1e-14)) ** 2


def clamped_twist() -> float:
    """ML/EI at which a straight rod with clamped ends buckles under torsion: tan(x/2) = x/2, 8.987 (Greenhill
    1883 is the like for pinned ends, 2π)."""
    return 2.0 * _tangent()


def _tangent() -> float:
    return float(brentq(lambda x: np.sin(x) - x * np.cos(x), 4.0, 4.6, xtol=1e-14))


def shallow_truss(half: float, rise: float, axial: float) -> tuple[float, float]:
    """The limit load of two hinged bars (von Mises 1923) and the crown's height there.

    With engineering strain on the stress-free length, P(z) = 2 EA z (1/l - 1/l0); its maximum is at l = (l0
    b²)^(1/3).
    """
    rest = np.hypot(half, rise)
    length = np.cbrt(rest * half**2)
    height = np.sqrt(length**2 - half**2)
    return float(2.0 * axial * height * (1.0 / length - 1.0 / rest)), float(height)


def column(alpha: float) -> tuple[float, float, float]:
    """A cantilever column of length 1 and EI 1 whose tip has the slope `alpha`, rad: thrust, tip along and
    across."""
    k = np.sin(0.5 * alpha)
    quarter = ellipk(k * k)
    return float(quarter**2), float(2.0 * ellipe(k * k) / quarter - 1.0), float(2.0 * k / quarter)


def helix(moment: Reals) -> Reals:
    """Tip (3,) of a rod of length 1 and EI 1 clamped along x under a dead end `moment` (3,)."""
    rate = np.linalg.norm(moment)
    axis, tangent = moment / rate, np.array([1.0, 0.0, 0.0])
    along = (tangent @ axis) * axis
    turned = np.sin(rate) * (tangent - along) + (1.0 - np.cos(rate)) * np.cross(axis, tangent)
    return np.asarray(along + turned / rate)


def twist_under_thrust(thrust: float) -> float:
    """ML/EI at which a rod between clamps, one free to slide, buckles under torsion and the `thrust` PL²/EI
    (tension negative): the least M > 0 at which w = A + Bx + C exp(iax) + D exp(ibx) can vanish with its
    slope at both ends.

    With a, b = (M ± √(M² + 4P))/2 the determinant of these four conditions is i (a - b) exp(iM/2) times a
    real number.
    """
    if thrust == 0.0:  # b = 0: the functions are no longer four
        return clamped_twist()

    def gap(torque: float) -> float:
        apart = np.sqrt(complex(torque**2 + 4.0 * thrust))
        a, b = 0.5 * (torque + apart), 0.5 * (torque - apart)
        ea, eb = np.exp(1j * a), np.exp(1j * b)
        rows = [[1, 0, 1, 1], [0, 1, 1j * a, 1j * b], [1, 1, ea, eb], [0, 1, 1j * a * ea, 1j * b * eb]]
        value = np.linalg.det(np.array(rows)) * np.exp(-0.5j * torque) / (1j * apart)
        return float(value.real)

    torques = np.linspace(max(1.0, 1.001 * np.sqrt(max(0.0, -4.0 * thrust))), 16.0, 400)
    signs = np.sign([gap(torque) for torque in torques])
    first = int(np.argmax(signs[1:] != signs[:-1]))
    return float(brentq(gap, torques[first], torques[first + 1], xtol=1e-13))
