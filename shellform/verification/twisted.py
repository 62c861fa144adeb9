"""Rods under dead end moments in space, torques, and thrusts far beyond buckling."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.optimize import brentq

from shellform.arrays import Reals
from shellform.structure.answers.stability import critical_load
from shellform.structure.elements.state import at_rest
from shellform.structure.network import assemble
from shellform.structure.solve.drive import forces
from shellform.structure.solve.path import follow
from shellform.verification import exact
from shellform.verification.compared import Comparison, rows
from shellform.verification.models import CLAMP, chain, in_plane, line, load_at, order, solved

_SLIDING = [False, True, True, False, True, True]  # along the axis, and about it


def end_moment(elements: int, moment: tuple[float, float, float]) -> Reals:
    """Positions (n, 3) of a clamped rod of L = EI = 1, GJ = 0.8 under a dead end moment, along its path."""
    network = chain(line(elements), (1e6, 0.8, 1.0, 1.0), {0: CLAMP})
    load = load_at(network, elements, [0.0, 0.0, 0.0, *moment])
    *_, last = follow(assemble(network), at_rest(network.nodes), forces(load), events=False)
    return last.equilibrium.state.positions


def dead_moment() -> Iterator[Comparison]:
    """A clamped rod under the dead end moment (2, 0, 5): a helix about the moment, since the moment is the
    same all along it and the tangent turns about it at the rate |m|/EI (Kirchhoff; Love 1927, art. 270).

    40 elements leave O(h²), 2e-3 of the tip's place; and the order.
    """
    moment = (2.0, 0.0, 5.0)
    tips = [end_moment(count, moment)[-1] for count in (20, 40)]
    wanted = exact.helix(np.array(moment))
    source = "Kirchhoff's helix, closed form"
    for axis, found, reference in zip("xyz", tips[1], wanted, strict=True):
        yield Comparison(
            "dead end moment in space", f"tip {axis}, over L", found - reference, 0.0, 2e-3, source
        )
    errors = [float(np.linalg.norm(tip - wanted)) for tip in tips]
    yield Comparison("dead end moment in space", "order", order(errors), 2.0, 0.1, "O(h²)")


def spirals() -> Iterator[Comparison]:
    """A cantilever rolled up ten times in space by the moment 20π EI/L: each tenth of it is a circle.

    100 elements: the tip comes back to the clamp, exact by symmetry; the first half turn's end is 0.1 L/π off
    it, the polygon's of ten sides by 1.6 %.
    """
    positions = end_moment(100, (0.0, 0.0, 20.0 * np.pi))
    source = "closed form"
    tip, fifth = (float(np.linalg.norm(positions[node])) for node in (-1, 5))
    yield Comparison("spiral of ten turns", "tip, over L", tip, 0.0, 1e-6, source)
    # A polygon of ten sides of 0.01 has this diameter.
    across = 0.01 / np.sin(np.pi / 10.0)
    yield Comparison("spiral of ten turns", "across, of the polygon", fifth, across, 1e-6, source)


def semi_tangential() -> Iterator[Comparison]:
    """Torques on shafts whose ends may turn: semi-tangential, since a torque about a fixed axis has no
    potential (Ziegler, Principles of structural stability, 1968, section 4).

    Clamped and free at the other end ML/EI = π, hinged at both tan(x/2) = -x/6; 20 and 40 elements,
    extrapolated as O(h²): 1e-3.
    """
    hinge = [False, True, True, False, False, False]
    half = float(brentq(lambda x: np.tan(x) + x / 3.0, 2.0, 3.0, xtol=1e-14))
    ends = [
        ("cantilever shaft", {0: CLAMP}, [False] * 6, np.pi),
        ("hinged shaft", {0: [True] * 4 + [False] * 2}, hinge, 2.0 * half),
    ]
    for case, first, last, wanted in ends:
        found = []
        for count in (20, 40):
            network = chain(line(count), (1e6, 1.0, 1.0, 1.0), first | {count: last})
            load = load_at(network, count, [0.0, 0.0, 0.0, 1.0, 0.0, 0.0])
            limit = critical_load(assemble(network), at_rest(network.nodes), forces(load), goal=12.0)
            found.append(np.nan if limit is None else limit.factor)
        value = found[1] + (found[1] - found[0]) / 3.0
        yield Comparison(f"{case}, semi-tangential torque", "ML/EI", value, wanted, 1e-3, "Ziegler 1968")


def hockling() -> Iterator[Comparison]:
    """The hockling shaft (Nour-Omid and Rankin, Comp. Meth. Appl. Mech. Eng. 93 (1991) 353): clamped, its
    other end free to slide and spun by a torque, under tension, none and thrust; the torque at which it
    leaves its axis.

    Exact: EI w_xxxx - iM w_xxx + P w_xx = 0 between clamps (Greenhill 1883). 20 and 40 elements,
    extrapolated: 2e-3.
    """
    for thrust in (-10.0, 0.0, 10.0):
        found = []
        for count in (20, 40):
            network = chain(line(count), (1e7, 1.0, 1.0, 1.0), {0: CLAMP, count: _SLIDING})
            base = load_at(network, count, [-thrust, 0.0, 0.0])
            start = solved(network, base)
            torque = load_at(network, count, [0.0, 0.0, 0.0, 1.0, 0.0, 0.0])
            limit = critical_load(assemble(network), start, forces(torque, base=base), goal=16.0)
            found.append(np.nan if limit is None else limit.factor)
        value = found[1] + (found[1] - found[0]) / 3.0
        wanted = exact.twist_under_thrust(thrust)
        yield Comparison(
            "hockling shaft",
            f"ML/EI at PL²/EI = {thrust:g}",
            value,
            wanted,
            2e-3,
            "Greenhill 1883, recomputed",
        )


THRUSTS = (
    (20.0, 1.015, 0.970, 0.220), (40.0, 1.063, 0.881, 0.422), (60.0, 1.152, 0.741, 0.593),
    (80.0, 1.293, 0.560, 0.719), (100.0, 1.518, 0.349, 0.792), (120.0, 1.884, 0.123, 0.803),
    (140.0, 2.541, -0.107, 0.750), (160.0, 4.029, -0.340, 0.625), (176.0, 9.116, -0.577, 0.421),
)  # fmt: skip
"""Tip's slope, degrees, thrust over Euler's, and the tip's place along and across, over L (Timoshenko and
Gere)."""


def elastica_at_nine_thrusts() -> Iterator[Comparison]:
    """Timoshenko and Gere, Theory of elastic stability (1961), art. 2.7, table 2-4: a cantilever column at
    nine thrusts beyond Euler's, its tip as the elliptic integrals and as the table have it.

    80 elements: O(h²) leaves 2e-4 of the place, next to Euler's thrust, where the height answers to it, 1e-3;
    the table prints three decimals.
    """
    count = 80
    network = in_plane(chain(line(count), (1e7, 1.0, 1.0, 1.0), {0: CLAMP}))
    state = at_rest(network.nodes)
    for degrees, printed, _, across in THRUSTS:
        thrust, along, aside = exact.column(np.radians(degrees))
        load = load_at(network, count, [-thrust, 0.0, 0.0])
        if degrees == THRUSTS[0][0]:  # pushed aside, then let go: to one of its two shapes
            state = solved(network, load + load_at(network, count, [0.0, 0.0, 0.05 * thrust]))
        state = solved(network, load, state)
        tip = state.positions[-1]
        allowed = 2e-3 if degrees < 30.0 else 1e-3
        case = f"column at {printed:g} of Euler's thrust"
        numbers = [("tip along, miss", tip[0] - along, 0.0), ("tip across", abs(tip[2]), aside)]
        yield from rows(case, "elliptic integrals; Timoshenko and Gere 1961", allowed, numbers)
        yield Comparison(
            case,
            "tip across, printed",
            abs(tip[2]),
            across,
            allowed + 1e-3 / across,
            "Timoshenko and Gere 1961",
        )
