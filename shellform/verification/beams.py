"""Rods bent far out of shape, in the plane and in space, on their stable branch."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from shellform.arrays import Reals
from shellform.structure.elements.state import at_rest
from shellform.structure.network import assemble
from shellform.structure.solve.drive import forces
from shellform.structure.solve.loading import apply_load
from shellform.structure.solve.path import follow
from shellform.verification import exact
from shellform.verification.compared import Comparison, rows
from shellform.verification.models import (
    CLAMP,
    PIN,
    chain,
    in_plane,
    line,
    load_at,
    order,
    polyline,
    solved,
)


def elastica(elements: int, load: float) -> tuple[float, float]:
    """Tip displacements u and w over L of a cantilever under a dead tip load, PL²/EI = `load` (Mattiasson
    1981).
    """
    network = in_plane(chain(line(elements), (1e7, 1.0, 1.0, 1.0), {0: CLAMP}))
    tip = solved(network, load_at(network, elements, [0.0, 0.0, load])).positions[-1]
    return float(1.0 - tip[0]), float(tip[2])


def cantilevers() -> Iterator[Comparison]:
    """Mattiasson, Int. J. Num. Meth. Eng. 17 (1981) 145: dead transverse tip load, against elliptic
    integrals.

    L = 1, EI = 1, EA = 1e7 for inextensible (moves the tip by 1e-6); 80 elements leave O(h²) = 3e-5.
    """
    for load in (1, 2, 5, 10):
        found, wanted = elastica(80, float(load)), exact.cantilever(load)
        name = f"cantilever, PL²/EI = {load}"
        yield from rows(
            name, "Mattiasson 1981, elliptic integrals", 5e-5, zip(("u/L", "w/L"), found, wanted, strict=True)
        )


def cantilever_order() -> Iterator[Comparison]:
    """The tip of the cantilever at PL²/EI = 10 on 10, 20 and 40 elements: straight two-node elements are
    O(h²).

    EA = 1e7 leaves 1e-6, 1/70 of the last error; the order of finite meshes is within 0.05 of its limit.
    """
    errors = [elastica(n, 10.0)[1] - exact.cantilever(10.0)[1] for n in (10, 20, 40)]
    yield Comparison("cantilever, 10, 20, 40 elements", "order of w", order(errors), 2.0, 0.05, "O(h²)")


def roll_up(elements: int, turns: float = 1.0) -> Reals:
    """The tip (3,) of a cantilever with an end moment of `turns` · 2π EI/L in one step, all degrees of
    freedom in space free.
    """
    network = chain(line(elements), (1e6, 1.0, 1.0, 1.0), {0: CLAMP})
    return np.asarray(
        solved(network, load_at(network, elements, [0, 0, 0, 0, 0, 2.0 * np.pi * turns])).positions[-1]
    )


def roll_ups() -> Iterator[Comparison]:
    """Closed form: an end moment M bends to a circle of radius EI/M. L = 1, EI = GJ = 1, EA = 1e6, 10
    elements, one step.

    The nodes lie on a circle whose chords are the elements: the full circle closes to rounding, the half
    circle is wider by (p/2)/sin(p/2), p = π/10 the turn of an element: O(h²), so that its order from 10 and
    20 elements is stated too.
    """
    source = "closed form"
    yield Comparison(
        "roll-up in one step", "tip from the clamp", float(np.linalg.norm(roll_up(10))), 0.0, 1e-6, source
    )
    half = [roll_up(n, 0.5) for n in (10, 20)]
    # π/20 over its sine is 1.0041, and half that error enters once the elements halve: 5e-3 covers the first
    # mesh.
    yield Comparison("half a roll-up", "height y/L", float(half[0][1]), 2.0 / np.pi, 5e-3, source)
    yield Comparison(
        "half a roll-up", "order of y", order([tip[1] - 2.0 / np.pi for tip in half]), 2.0, 0.02, "O(h²)"
    )


def bend_45(elements: int, torsion: float, load: float) -> Reals:
    """Tip position (3,) of the 45° bend: R = 100, EA = 1e7, EI = 8.333e5, tip load in z (Bathe and Bolourchi
    1979).
    """
    angle = np.linspace(0.0, np.pi / 4.0, elements + 1)
    points = np.column_stack([100.0 * np.sin(angle), 100.0 * (1.0 - np.cos(angle)), np.zeros(elements + 1)])
    network = chain(points, (1e7, torsion, 8.333e5, 8.333e5), {0: CLAMP})
    return np.asarray(solved(network, load_at(network, elements, [0.0, 0.0, load])).positions[-1])


BENDS = {
    (8.333e5, 300.0): (58.77966, 22.24495, 40.19026),
    (8.333e5, 600.0): (47.15144, 15.68497, 53.47239),
    (7.05e5, 300.0): (58.54110, 22.11544, 40.47311),
    (7.05e5, 600.0): (46.89782, 15.56052, 53.60236),
}
"""Tip of the 45° bend by (GJ, load), recomputed as a Kirchhoff rod (tests/literature/test_references.py)."""


def bends() -> Iterator[Comparison]:
    """Bathe and Bolourchi, Int. J. Num. Meth. Eng. 14 (1979) 961, print displacements of (-13.4, -23.5, 53.4)
    at P = 600.

    Two torsion constants circulate, the polar moment (GJ = EI = 8.333e5) and St Venant's (7.05e5): both, at
    both loads, against the exact rod. in, lb. 64 straight elements: O(h²) leaves 2e-3 of the 53.5 displaced.
    """
    for (torsion, load), tip in BENDS.items():
        name = f"45° bend, GJ = {torsion:g}, P = {load:g}"
        found = bend_45(64, torsion, load)
        yield from rows(
            name,
            "Kirchhoff rod, recomputed; Bathe and Bolourchi 1979",
            1e-4,
            zip("xyz", found, tip, strict=True),
        )


def bend_order() -> Iterator[Comparison]:
    """The 45° bend's height on 8, 16 and 32 elements, GJ = 8.333e5, P = 600; the last digit quoted is 1/500
    of the last error.
    """
    errors = [bend_45(n, 8.333e5, 600.0)[2] - BENDS[8.333e5, 600.0][2] for n in (8, 16, 32)]
    yield Comparison("45° bend, 8, 16, 32 elements", "order of z", order(errors), 2.0, 0.05, "O(h²)")


LEE = {0.5: (3.7915, 0.3096), 1.0: (10.7069, 1.9143), 1.5: (25.8410, 8.0096)}
"""Lee's frame, displacements down and along under the load
(tests/literature/test_references.py)."""


def lee_frame(elements: int, load: float) -> tuple[float, float]:
    """Displacements down and along under the load of Lee's frame, `elements` a leg, infinite beyond its
    stable branch.
    """
    points = polyline([[0.0, 0.0, 0.0], [0.0, 0.0, 120.0], [120.0, 0.0, 120.0]], elements)
    pin = [True, True, True, False, False, False]
    network = in_plane(chain(points, (4320.0, 1440.0, 1440.0, 1440.0), {0: pin, 2 * elements: pin}))
    at = elements + elements // 5
    force = load_at(network, at, [0.0, 0.0, -load])
    loaded = apply_load(assemble(network), at_rest(points), np.zeros_like(force), force, step=0.1, stay=True)
    if not loaded.on_branch:
        return float("inf"), float("inf")
    place = loaded.equilibrium.state.positions[at]
    return float(120.0 - place[2]), float(place[0] - 24.0)


def lee_frames() -> Iterator[Comparison]:
    """Lee, Manuel and Rossow, J. Eng. Mech. ASCE 94 (1968) 521: legs of 120, E = 720, A = 6, I = 2, load at
    24 from the corner.

    Against the exact extensible elastica (recomputed; its inextensible limit differs by 0.3 %, so EA counts).
    100 elements a leg: O(h²) leaves 1e-3 of the displacements; u at P = 0.5 is the small difference of large
    turns, 3e-4 of it.
    """
    for load, wanted in LEE.items():
        found = lee_frame(100, load)
        yield from rows(
            f"Lee's frame, P = {load:g}",
            "extensible elastica, recomputed; Lee et al. 1968",
            5e-4,
            zip(("down", "along"), found, wanted, strict=True),
        )


def diamond(load: float) -> tuple[float, float]:
    """Where the loaded hinge and the rigid corner of a square diamond frame end up, from its centre, sides 1.

    A quarter of it: `load` on the hinge at the top (compression positive), EI = 1, EA = 1e7, 60 elements. By
    symmetry the hinge stays on the vertical axis, and the rigid corner on the horizontal one without turning.
    """
    points = polyline([[np.sqrt(0.5), 0.0, 0.0], [0.0, 0.0, np.sqrt(0.5)]], 60)
    corner, hinge = [False, True, True, True, True, True], [True, True, False, True, False, True]
    network = in_plane(chain(points, (1e7, 1.0, 1.0, 1.0), {0: corner, 60: hinge}))
    place = solved(network, load_at(network, 60, [0.0, 0.0, -load])).positions
    return float(place[-1, 2]), float(place[0, 0])


def diamonds() -> Iterator[Comparison]:
    """Mattiasson, Int. J. Num. Meth. Eng. 17 (1981) 145: square frame, hinged where it is loaded, rigid at
    the other corners.

    Pulled and pushed, against elliptic integrals (evaluated here); at PL²/EI = 4 the pushed hinge has passed
    the other one. 60 elements a side leave O(h²) = 5e-5 of a side.
    """
    for load in (1.0, 2.0, 4.0):
        pushed = exact.inclined(load, 0.25 * np.pi)
        pulled = exact.inclined(load, 0.75 * np.pi)
        source = "Mattiasson 1981, elliptic integrals"
        names = ("hinge z/L", "corner x/L")
        yield from rows(
            f"diamond pushed, PL²/EI = {load:g}", source, 2e-4, zip(names, diamond(load), pushed, strict=True)
        )
        wanted = (-pulled[0], pulled[1])
        yield from rows(
            f"diamond pulled, PL²/EI = {load:g}",
            source,
            2e-4,
            zip(names, diamond(-load), wanted, strict=True),
        )


HELIX = (7.41252, 5.06259, 2.65499)
"""Tip of the roll-up with a force across its plane at 2 % of the load
(tests/literature/test_references.py)."""
ONE_TURN = (0.41042, 0.05383, -1.09651)
"""The same at 10 %."""


def helix(elements: int, share: float) -> Reals:
    """Tip (3,) of a cantilever (L = 10, EI = GJ = 100, EA = 1e4) under `share` of an end moment 200π and a
    force of 50 across.
    """
    network = chain(line(elements, 10.0), (1e4, 100.0, 100.0, 100.0), {0: CLAMP})
    load = load_at(network, elements, np.array([0.0, 0.0, 50.0, 0.0, 0.0, 200.0 * np.pi]))
    path = follow(
        assemble(network), at_rest(network.nodes), forces(load), goal=share, first=0.01 / share, events=False
    )
    *_, last = path
    return np.asarray(last.equilibrium.state.positions[-1])


def helices() -> Iterator[Comparison]:
    """Ibrahimbegovic, Comp. Meth. Appl. Mech. Eng. 149 (1997) 49: roll-up by an end moment with a force out
    of its plane.

    He draws ten turns of it, shear-flexible (GA = EA); here 2 % and 10 % of his load, one whole turn, as a
    rod without shear: recomputed. The moment keeps its axis in space, so that it has no potential; the path
    is followed. 50 and 100 elements leave O(h²), 2e-3 m of 10 m.
    """
    source = "Kirchhoff rod, recomputed; after Ibrahimbegovic 1997"
    yield from rows(
        "roll-up out of its plane, 2 %", source, 2e-4, zip("xyz", helix(50, 0.02), HELIX, strict=True)
    )
    yield from rows(
        "roll-up out of its plane, one turn", source, 3e-2, zip("xyz", helix(100, 0.1), ONE_TURN, strict=True)
    )


def quarter_ring() -> Iterator[Comparison]:
    """A quarter ring clamped at one end and loaded across its plane at the other, so little that it stays
    linear.

    Closed form by Castigliano's theorem: w = P R³ (π/4 / EI + (3π/4 - 2) / GJ). R = EI = 1, GJ = 0.7,
    P = 1e-6; 32 elements leave h² = 2e-4 a turn.
    """
    angle = np.linspace(0.0, 0.5 * np.pi, 33)
    points = np.column_stack([np.sin(angle), 1.0 - np.cos(angle), np.zeros(33)])
    network = chain(points, (1e6, 0.7, 1.0, 1.0), {0: CLAMP})
    height = solved(network, load_at(network, 32, [0.0, 0.0, 1e-6])).positions[-1, 2] / 1e-6
    wanted = 0.25 * np.pi + (0.75 * np.pi - 2.0) / 0.7
    yield Comparison(
        "quarter ring, load across its plane", "w EI/(P R³)", float(height), wanted, 5e-4, "Castigliano"
    )


def twisted_rod() -> Iterator[Comparison]:
    """A straight rod twisted by nearly three turns, by a moment about its axis, 10 elements: ML/GJ, exact.

    Stout in bending (EI = 100 GJ), for it would buckle at M = 1.43 · 2π EI/L.
    """
    network = chain(line(10), (1e6, 1.0, 100.0, 100.0), {0: CLAMP})
    state = solved(network, load_at(network, 10, [0, 0, 0, 17.0]))
    # Quaternions tell turns apart only element by element: the sum of the differences.
    w, x = state.quaternions[:, 0], state.quaternions[:, 1]
    twist = np.unwrap(2.0 * np.arctan2(x, w), period=2.0 * np.pi)[-1]
    yield Comparison("rod twisted by 2.7 turns", "twist, rad", float(twist), 17.0, 1e-8, "closed form")


def beam_columns() -> Iterator[Comparison]:
    """A pinned beam with a small load in the middle and a large axial force, in compression and in tension.

    Timoshenko and Gere 1961, chapter 1: the deflection PL³/48EI times 3 (tan u - u)/u³, or 3 (u - tanh u)/u³,
    with u = L/2 √(S/EI). S = ± 5 EI/L² (half of Euler's load), so little P that it stays linear; 40 elements:
    O(h²), of the margin to Euler's load too.
    """
    u = 0.5 * np.sqrt(5.0)
    wanted = {-5.0: 3.0 * (np.tan(u) - u) / u**3, 5.0: 3.0 * (u - np.tanh(u)) / u**3}
    for force, reference in wanted.items():
        # EA = 1e8: the axial force shortens the beam by 5e-8.
        network = in_plane(
            chain(line(40), (1e8, 1.0, 1.0, 1.0), {0: PIN, 40: [False, True, True, False, False, False]})
        )
        load = load_at(network, 40, [force, 0.0, 0.0]) + load_at(network, 20, [0.0, 0.0, -0.01])
        found = -48.0 * solved(network, load).positions[20, 2] / 0.01
        kind = "tension" if force > 0.0 else "compression"
        yield Comparison(
            f"beam in {kind}, S L²/EI = 5",
            "deflection over PL³/48EI",
            float(found),
            reference,
            1e-3,
            "Timoshenko and Gere 1961",
        )


def helical_spring() -> Iterator[Comparison]:
    """A helical spring of three open coils pulled along its axis: extension P R² L (cos² a/GJ + sin² a/EI)
    (Love 1927, spiral springs).

    Clamped at one end; at the other the axial force, with its moment about the rod's end, pulling and pushing
    by 2e-4 EI/R², so that terms of second order cancel. R = 1, pitch angle a = 20°, EI = 1, GJ = 0.8, EA =
    1e5; 240 chords: O(h²) of 4.5° a chord.
    """
    angle, count = np.radians(20.0), 240
    turn = np.linspace(0.0, 6.0 * np.pi, count + 1)
    points = np.column_stack([np.cos(turn), np.sin(turn), np.tan(angle) * turn])
    network = chain(points, (1e5, 0.8, 1.0, 1.0), {0: CLAMP})
    # On the axis the force would pass through (0, 0): seen from the rod's end at (1, 0), its moment is (-1,
    # 0, 0) x force.
    heights = []
    for size in (2e-4, -2e-4):
        state = solved(
            network, load_at(network, count, [0.0, 0.0, size, *np.cross([-1.0, 0.0, 0.0], [0.0, 0.0, size])])
        )
        heights.append(float((state.positions[-1] + np.cross(state.rotations[-1], [-1.0, 0.0, 0.0]))[2]))
    found = (heights[0] - heights[1]) / 4e-4
    length = 6.0 * np.pi / np.cos(angle)
    wanted = length * (np.cos(angle) ** 2 / 0.8 + np.sin(angle) ** 2)
    yield Comparison(
        "helical spring, 3 coils at 20°", "extension EI/(P R³)", float(found), wanted, 2e-3, "Love 1927"
    )
