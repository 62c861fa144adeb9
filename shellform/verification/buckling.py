"""Loads at which the straight, the plane or the circular ceases to be stable."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from shellform.structure.elements import rotation
from shellform.structure.elements.beam import make_beams
from shellform.structure.elements.cable import make_cables
from shellform.structure.elements.state import State, at_rest, moved
from shellform.structure.network import Network, assemble
from shellform.structure.solve.equilibrium import LostBranch, find_equilibrium
from shellform.verification import exact
from shellform.verification.bent import ring_state
from shellform.verification.compared import Comparison, rows
from shellform.verification.models import (
    CLAMP,
    FORK,
    Stiffness,
    chain,
    critical,
    in_plane,
    line,
    load_at,
    order,
    polyline,
)

_BEYOND = 1.27  # of the reference, how far a load is followed in search of its critical value

# Held degrees of freedom of the ends in the x-z plane: (first end, last end), the last free to slide along x.
_COLUMNS = {
    "clamped-free": ([True] * 6, [False] * 6, 0.25 * np.pi**2),
    "pinned-pinned": (
        [True, True, True, True, False, True],
        [False, True, True, True, False, True],
        np.pi**2,
    ),
    "clamped-pinned": ([True] * 6, [False, True, True, True, False, True], exact.clamped_column()),
    "clamped-clamped": ([True] * 6, [False, True, True, True, True, True], 4.0 * np.pi**2),
}


def column(kind: str, elements: int) -> float:
    """PL²/EI at which a column of the kind buckles in the plane."""
    first, last, reference = _COLUMNS[kind]
    network = in_plane(chain(line(elements), (1e6, 1.0, 1.0, 1.0), {0: first, elements: last}))
    load = load_at(network, elements, [-1.0, 0.0, 0.0])
    return critical(network, load, _BEYOND * reference)


def columns() -> Iterator[Comparison]:
    """Euler's columns, L = EI = 1, EA = 1e6, 48 elements: a straight chain buckles O(h²) late, (kL)² h²/12 =
    1e-3 at most.
    """
    numbers = [(kind, column(kind, 48), _COLUMNS[kind][2]) for kind in _COLUMNS]
    yield from rows("Euler column, PL²/EI", "Euler 1744; Timoshenko and Gere 1961", 2e-3, numbers)
    errors = [column("clamped-clamped", n) - 4.0 * np.pi**2 for n in (12, 24)]
    yield Comparison(
        "clamped column, 12, 24 elements", "order of the buckling load", order(errors), 2.0, 0.05, "O(h²)"
    )


def braced() -> Iterator[Comparison]:
    """A pinned column held at its middle by two prestressed cables across it: rods and cables together.

    L = EI = 1, EA = 1e6, 48 elements (O(h²) late). Cables of length 1 and EA = 25: as long as both are taut
    they are a spring of 50 EI/L³. Slack ones (rest length 1.05) hold nothing at first: Euler's load.
    """
    source = "Timoshenko and Gere 1961, closed form"
    for name, ratio, spring in [("taut", 0.95, 50.0 / 0.95), ("slack", 1.05, 0.0)]:
        network = braced_column(48, ratio)
        reference = exact.braced_column(spring) if spring else np.pi**2
        found = critical(network, load_at(network, 48, [-1.0, 0.0, 0.0]), _BEYOND * reference)
        yield Comparison("column braced by two cables", f"{name}, PL²/EI", found, reference, 2e-3, source)


def braced_column(elements: int, rest_ratio: float) -> Network:
    """The column of `braced` along x, an even number of elements; its nodes come before the cables'
    anchors."""
    middle, end = elements // 2, elements
    points = np.vstack([line(elements), [[0.5, 0.0, 1.0], [0.5, 0.0, -1.0]]])
    fixed = np.zeros((elements + 3, 6), dtype=bool)
    fixed[:, [1, 3, 5]] = True
    fixed[0, :3] = fixed[end, 2] = fixed[end + 1 :, :3] = True
    ends = np.column_stack([np.arange(elements), np.arange(1, elements + 1)])
    beams = make_beams(points, ends, axial=1e6, torsion=1.0, bending_y=1.0, bending_z=1.0)
    cables = make_cables([[middle, end + 1], [middle, end + 2]], rest_length=rest_ratio, stiffness=25.0)
    return Network(points, beams, cables, fixed, np.zeros((elements + 3, 6)))


def lateral() -> Iterator[Comparison]:
    """Lateral-torsional buckling of strips on edge (Prandtl 1899, Michell 1899; Timoshenko and Gere 1961,
    chapter 6).

    Cantilever with a tip load, 4.0126 √(EI GJ)/L², and fork-ended beam with a load in the middle, 16.936:
    zeros of Bessel functions, without the deflection before buckling (EI strong is 1e5 EI weak, which leaves
    1e-5). 40 elements: O(h²) = 4e-4.
    """
    stiffness = (1e8, 0.8, 1e5, 1.0)
    root = np.sqrt(0.8)
    cantilever = chain(line(40), stiffness, {0: CLAMP})
    reference = 2.0 * exact.bessel_zero(-0.25, 1.5, 2.5)
    found = critical(cantilever, load_at(cantilever, 40, [0.0, 0.0, -1.0]), _BEYOND * reference * root) / root
    numbers = [("cantilever PL²/√(EI GJ)", found, reference)]
    beam = chain(line(40), stiffness, {0: FORK, 40: [False, True, True, True, False, False]})
    reference = 16.0 * exact.bessel_zero(-0.75, 0.5, 1.5)
    found = critical(beam, load_at(beam, 20, [0.0, 0.0, -1.0]), _BEYOND * reference * root) / root
    numbers.append(("fork-ended beam PL²/√(EI GJ)", found, reference))
    yield from rows("strip on edge", "Prandtl 1899, Michell 1899", 1e-3, numbers)


# Argyris' right-angle frame (mm, N): legs of 240, strip of 30 × 0.6 on edge, E = 71240, ν = 0.31.
_YOUNG, _SHEAR = 71240.0, 71240.0 / 2.62
# mm⁴: b³h/12 on edge and flat, b h³/3
_STRONG, _WEAK, _TORSION = 0.6 * 30.0**3 / 12.0, 30.0 * 0.6**3 / 12.0, 30.0 * 0.6**3 / 3.0
FRAME: Stiffness = (_YOUNG * 18.0, _SHEAR * _TORSION, _YOUNG * _STRONG, _YOUNG * _WEAK)
FRAME_TIP = (1.08752, -0.68043)
"""Critical tip loads of the clamped frame, recomputed (tests/literature/test_references.py)."""


def right_angle() -> Iterator[Comparison]:
    """Argyris et al., Comp. Meth. Appl. Mech. Eng. 17/18 (1979) 1: right-angle frames that buckle out of
    their plane.

    Hinged frame under equal end moments that open or close it: each leg twists and bends as in pure bending,
    so that M = ± π √(EI GJ)/L = 622.2 N mm. The same legs clamped at one end, with a load at the tip along
    the clamped leg: 1.088 there, 1.08752 when it pulls and 0.68043 when it pushes recomputed, linearised
    about the exact plane state. 40 elements a leg: O(h²).
    """
    half = 240.0 * np.sqrt(0.5)
    points = polyline([[-half, 0.0, 0.0], [0.0, 0.0, half], [half, 0.0, 0.0]], 40)
    network = chain(
        points, FRAME, {0: [True, True, True, True, False, True], 80: [False, True, True, True, False, True]}
    )
    reference = np.pi * np.sqrt(FRAME[1] * FRAME[3]) / 240.0
    for name, sign in [("closing", 1.0), ("opening", -1.0)]:
        load = load_at(network, 0, [0, 0, 0, 0, sign, 0]) + load_at(network, 80, [0, 0, 0, 0, -sign, 0])
        found = critical(network, load, _BEYOND * reference)
        yield Comparison(
            "right-angle frame, end moments",
            f"{name} M, N mm",
            found,
            reference,
            1e-3,
            "Argyris et al. 1979, closed form",
        )
    points = polyline([[0.0, 0.0, 0.0], [240.0, 0.0, 0.0], [240.0, 0.0, -240.0]], 40)
    network = chain(points, FRAME, {0: CLAMP})
    for reference in FRAME_TIP:
        found = critical(network, load_at(network, 80, [1.0, 0.0, 0.0]), _BEYOND * reference)
        source = "Kirchhoff rod, recomputed; Argyris et al. 1979"
        yield Comparison(
            "right-angle frame, tip load",
            f"{'pull' if reference > 0.0 else 'push'}, N",
            found,
            reference,
            1e-3,
            source,
        )


def ring_pressure() -> Iterator[Comparison]:
    """A ring under radial loads that keep their directions buckles at q = 4 EI/R³ (3 for hydrostatic
    pressure; Bodner 1958).

    R = EI = 1, EA = 1e6: a quarter with its symmetries, which its mode cos 2θ has too; 48 chords leave O(h²)
    = 4e-4.
    """
    count = 48
    angle = np.linspace(0.0, 0.5 * np.pi, count + 1)
    points = np.column_stack([np.cos(angle), np.zeros(count + 1), np.sin(angle)])
    ends = [False, True, True, True, True, True], [True, True, False, True, True, True]
    network = in_plane(chain(points, (1e6, 1.0, 1.0, 1.0), {0: ends[0], count: ends[1]}))
    load = np.zeros((count + 1, 6))
    load[:, :3] = -0.5 * np.pi / count * points
    load[[0, -1]] *= 0.5
    found = critical(network, load, _BEYOND * 4.0)
    yield Comparison("ring under dead pressure", "q R³/EI", found, 4.0, 1e-3, "Bodner 1958")


def critical_twist(network: Network, start: State, reference: float) -> float:
    """The twist of the last node against the first at which the branch from the untwisted equilibrium `start`
    ends.

    Followed in tenths of the reference, then bisected; each step first twists all nodes in proportion about
    the rod's axis.
    """
    assembly = assemble(network)
    count = len(network.nodes)
    none = np.zeros((count, 6))
    share = np.linspace(0.0, 1.0, count)[:, None]
    angle, state, step = 0.0, start, 0.1 * reference
    while step > 1e-6 * reference and angle < 2.0 * reference:
        turn = np.zeros((count, 6))
        turn[:, 3:] = share * step * rotation.matrices(state.quaternions)[:, :, 0]
        try:
            found = find_equilibrium(assembly, moved(state, turn), none, on_branch=True)
        except LostBranch:
            step *= 0.5
            continue
        if found.stable:
            angle, state = angle + step, found.state
        else:
            step *= 0.5
    return angle


def greenhill() -> Iterator[Comparison]:
    """A straight rod twisted between clamps, one free to slide, buckles at ML/EI = 8.9868: tan(x/2) = x/2
    (Greenhill 1883).

    L = EI = GJ = 1, 40 and 80 elements: O(h²).
    """
    reference = exact.clamped_twist()
    found = []
    for count in (40, 80):
        network = chain(
            line(count), (1e6, 1.0, 1.0, 1.0), {0: CLAMP, count: [False, True, True, True, True, True]}
        )
        found.append(critical_twist(network, at_rest(network.nodes), reference))
    case = "rod twisted between clamps"
    yield Comparison(case, "ML/EI", found[1], reference, 5e-3, "Greenhill 1883, closed form")
    yield Comparison(case, "order", order(np.array(found) - reference), 2.0, 0.1, "O(h²)")


def michell() -> Iterator[Comparison]:
    """A straight rod closed to a ring leaves its plane at a twist of 2π √3 EI/GJ (Michell 1889; Zajac 1962).

    L = EI = GJ = 1. The ring may turn about its tangent at the clamp without a force: the opposite node's
    height is held. 40 and 80 chords: O(h²).
    """
    reference = 2.0 * np.sqrt(3.0) * np.pi
    found = []
    for count in (40, 80):
        network, circle = ring_state(count, 0.0)
        fixed = network.fixed.copy()
        fixed[count // 2, 2] = True
        found.append(critical_twist(replace(network, fixed=fixed), circle, reference))
    yield Comparison("twisted ring", "twist GJ/EI", found[1], reference, 5e-3, "Michell 1889, Zajac 1962")
    yield Comparison("twisted ring", "order", order(np.array(found) - reference), 2.0, 0.1, "O(h²)")
