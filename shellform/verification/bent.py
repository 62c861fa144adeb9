"""Active bending: straight rods that are held in bent shapes by supports, by a tie or by their own ends."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy.optimize import brentq
from scipy.special import jv

from shellform.arrays import Reals
from shellform.structure.elements import rotation
from shellform.structure.elements.cable import make_cables
from shellform.structure.elements.sections import Rectangle, isotropic, stiffness, stress
from shellform.structure.elements.state import State, from_vectors
from shellform.structure.network import Network, assemble
from shellform.structure.solve.equilibrium import find_equilibrium
from shellform.verification import exact
from shellform.verification.compared import Comparison, rows
from shellform.verification.models import CLAMP, PIN, chain, in_plane, line

_ELEMENTS = 80  # of a strip


def _arched(chord: float, waves: float) -> State:
    """A start near a buckled strip of length 1: half waves (1: pinned, 2: clamped) over the chord, as high as
    the length asks.
    """
    s = np.linspace(0.0, 1.0, _ELEMENTS + 1)
    # The mean of cos(a cos(pi s)) is J0(a): with that slope the start has nearly the chord, and isn't crushed
    # into loops.
    slope = brentq(lambda a: jv(0, a) - chord, 0.0, 3.8)
    angle = slope * (np.cos(np.pi * s) if waves == 1 else np.sin(2.0 * np.pi * s))
    middle = 0.5 * (angle[1:] + angle[:-1])
    x = np.concatenate([[0.0], np.cumsum(np.cos(middle))]) / _ELEMENTS
    z = np.concatenate([[0.0], np.cumsum(np.sin(middle))]) / _ELEMENTS
    place = np.column_stack([x * chord / x[-1], np.zeros(_ELEMENTS + 1), z])
    turn = np.zeros_like(place)
    turn[:, 1] = -angle
    return from_vectors(place, turn)


def strip(chord: float, *, clamped: bool) -> tuple[float, float]:
    """Thrust and height of a strip (length 1, EI 1) whose ends are held at the distance `chord`."""
    ends = CLAMP if clamped else PIN
    network = in_plane(chain(line(_ELEMENTS), (1e7, 1.0, 1.0, 1.0), {0: ends, _ELEMENTS: ends}))
    assembly = assemble(network)
    start = _arched(chord, 2 if clamped else 1)
    found = find_equilibrium(assembly, start, np.zeros((_ELEMENTS + 1, 6)))
    force = assembly.evaluate(found.state, tangent=False).force
    return float(force[0, 0]), float(found.state.positions[:, 2].max())


def strips() -> Iterator[Comparison]:
    """Timoshenko and Gere, Theory of Elastic Stability (1961), art. 2.7 tabulate the pinned elastica by its
    end slope alpha.

    It prints P/P_cr = 1.015, 1.063, 1.152, 1.293, 1.518, 1.884, 2.541, 4.029 for 20° to 160° (from 140° on
    the ends have passed each other). Here the ends are held at the exact distance; thrust and height against
    elliptic integrals, for clamped strips too. L = EI = 1, EA = 1e7, 80 elements: the thrust is O(h²) high by
    1e-4 to 4e-4 (pinned), four times that (clamped).
    """
    source = "Timoshenko and Gere 1961, elliptic integrals"
    for degrees in (20, 40, 60, 80, 100, 120, 140, 160):
        thrust, chord, height = exact.buckled(np.radians(degrees))
        found = strip(chord, clamped=False)
        numbers = [("thrust PL²/EI", found[0], thrust), ("height/L", found[1], height)]
        yield from rows(f"buckled strip, end slope {degrees}°", source, 5e-4, numbers)
    for degrees in (30, 60, 90):
        thrust, chord, height = exact.buckled_clamped(np.radians(degrees))
        found = strip(chord, clamped=True)
        numbers = [("thrust PL²/EI", found[0], thrust), ("height/L", found[1], height)]
        yield from rows(f"buckled clamped strip, slope {degrees}°", source, 2e-3, numbers)


def bow(rest: float, stiffness: float) -> tuple[float, float, float]:
    """Tension of the tie, chord and height of a rod (length 1, EI 1) tied from end to end by one shorter
    cable.
    """
    points = line(_ELEMENTS)
    network = in_plane(
        chain(points, (1e7, 1.0, 1.0, 1.0), {0: PIN, _ELEMENTS: [False, True, True, False, False, False]})
    )
    tie = make_cables([[0, _ELEMENTS]], rest_length=rest, stiffness=stiffness)
    tied = replace(network, cables=tie)
    found = find_equilibrium(assemble(tied), _arched(rest, 1), np.zeros((_ELEMENTS + 1, 6)))
    return (
        float(tie.tension(found.state)[0]),
        float(tie.lengths(found.state)[0]),
        float(found.state.positions[:, 2].max()),
    )


def bows() -> Iterator[Comparison]:
    """A bow: a pinned rod tied by one cable of rest length 0.8 of it, stiff (EA = 1e4) and soft (EA = 50
    EI/L²).

    Closed form: the elastica whose thrust is the cable's tension at its chord; 80 elements, O(h²) as for the
    strips.
    """
    for axial in (1e4, 50.0):
        names = ("tension TL²/EI", "chord/L", "height/L")
        numbers = zip(names, bow(0.8, axial), exact.bow(0.8, axial), strict=True)
        yield from rows(
            f"bow, EA L²/EI of its string {axial:g}", "elastica and Hooke, closed form", 5e-4, numbers
        )


def bow_in_space() -> Iterator[Comparison]:
    """The stiff-stringed bow free in space, of a strip twice as stiff the other way, let go bent about its
    stiff axis.

    The rod is free to spin about its chord: it turns over until it bends about its weak axis (EI = 1), with
    the plane bow's numbers.
    """
    tie = make_cables([[0, _ELEMENTS]], rest_length=0.8, stiffness=1e4)
    ends = {0: PIN, _ELEMENTS: [False, True, True, False, False, False]}
    network = replace(chain(line(_ELEMENTS), (1e7, 0.8, 2.0, 1.0), ends), cables=tie)
    flat = _arched(0.8, 1)
    # Tilted by half a radian, without which it would balance on its edge.
    tilt = rotation.from_vectors(np.array([[0.5, 0.0, 0.0]]))
    turn, back = (
        np.repeat(tilt, _ELEMENTS + 1, axis=0),
        np.repeat(tilt * [1.0, -1.0, -1.0, -1.0], _ELEMENTS + 1, axis=0),
    )
    start = State(
        flat.positions @ rotation.matrices(tilt)[0].T,
        rotation.product(turn, rotation.product(flat.quaternions, back)),
    )
    found = find_equilibrium(assemble(network), start, np.zeros((_ELEMENTS + 1, 6)))
    height = float(np.hypot(*found.state.positions[:, 1:].T).max())
    thrust, chord, wanted = exact.bow(0.8, 1e4)
    moments = np.abs(network.beams.local_forces(found.state)).max(axis=0)
    numbers = [
        ("tension TL²/EI", float(tie.tension(found.state)[0]), thrust),
        ("chord/L", float(tie.lengths(found.state)[0]), chord),
        ("height/L", height, wanted),
        ("moment about the weak axis ML/EI", float(moments[3]), thrust * wanted),
        ("stable", float(found.stable), 1.0),
    ]
    yield from rows("bow in space", "elastica and Hooke, closed form", 5e-4, numbers)


def ring_state(elements: int, twist: float) -> tuple[Network, State]:
    """A straight rod (length 1, EI = GJ = 1) and its state as a circle, clamped where it closes, its end
    twisted by `twist`, rad.

    In the circle all elements are chords and uniformly twisted: an equilibrium by symmetry.
    """
    network = chain(line(elements), (1e6, 1.0, 1.0, 1.0), {0: CLAMP, elements: CLAMP})
    turn = 2.0 * np.pi / elements
    # Tangents at the nodes, halfway between the chords; the first is along x.
    chords = turn * (np.arange(elements) + 0.5)
    steps = np.column_stack([np.cos(chords), np.sin(chords), np.zeros(elements)]) / elements
    place = np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])
    place[-1] = 0.0
    heading, spin = 0.5 * turn * np.arange(elements + 1), 0.5 * twist * np.linspace(0.0, 1.0, elements + 1)
    # The quaternion of a spin about x, then a turn about z.
    quaternion: Reals = np.column_stack(
        [
            np.cos(heading) * np.cos(spin),
            np.cos(heading) * np.sin(spin),
            np.sin(heading) * np.sin(spin),
            np.sin(heading) * np.cos(spin),
        ]
    )
    return network, State(place, quaternion)


def rings() -> Iterator[Comparison]:
    """A straight strip closed to a ring, relaxed from an oval: moment 2π EI/L and energy 2π² EI/L everywhere.

    Bent about its weak axis (EI 1 and 3), 40 elements, EA = 1e6. Chords in place of arcs leave nothing here,
    moment and energy follow from turns alone: only the residual of the equilibrium and the rod's stretch
    count.
    """
    network, circle = ring_state(40, 0.0)
    beams = replace(network.beams, bending_y=np.full(40, 3.0))
    strip = replace(network, beams=beams)
    oval = circle.positions * [1.3, 0.8, 1.0]
    found = find_equilibrium(assemble(strip), State(oval, circle.quaternions), np.zeros((41, 6)))
    moments = beams.local_forces(found.state)[:, [3, 6]]
    numbers = [
        ("largest moment ML/EI", float(np.abs(moments).max()), 2.0 * np.pi),
        ("smallest moment ML/EI", float(np.abs(moments).min()), 2.0 * np.pi),
        ("energy UL/EI", found.energy, 2.0 * np.pi**2),
    ]
    yield from rows("straight strip closed to a ring", "closed form", 1e-6, numbers)


def torsion_constants() -> Iterator[Comparison]:
    """St Venant's torsion constant of rectangles, J/(a b³), against the table of Timoshenko and Goodier,
    Theory of Elasticity.

    Four digits are printed there, so 5e-4.
    """
    table = {1.0: 0.1406, 1.5: 0.1958, 2.0: 0.2287, 3.0: 0.2633, 5.0: 0.2913, 10.0: 0.3123}
    material = isotropic(young=1.0)
    for ratio, reference in table.items():
        found = Rectangle(ratio, 1.0, material).constants[1] / ratio
        yield Comparison(
            "torsion of a rectangle",
            f"J/(ab³), a/b = {ratio:g}",
            found,
            reference,
            5e-4,
            "Timoshenko and Goodier",
        )


def laths() -> Iterator[Comparison]:
    """A lath of 3 x 20 mm, 3 m long, E = 10 GPa, sprung to a ring: stress E t/(2 R) of 31.4 MPa in every
    fibre that is furthest out.

    The ring of `rings` with a real section, 40 elements: turns alone decide, the axial stretch adds nothing.
    """
    lath = Rectangle(0.003, 0.020, isotropic(young=10e9, poisson=0.3))
    axial, torsion, bending_y, bending_z = stiffness(lath)
    _, circle = ring_state(40, 0.0)
    network = chain(line(40, 3.0), (axial, torsion, bending_y, bending_z), {0: CLAMP, 40: CLAMP})
    found = find_equilibrium(
        assemble(network),
        State(3.0 * circle.positions * [1.2, 0.85, 1.0], circle.quaternions),
        np.zeros((41, 6)),
    )
    forces = network.beams.local_forces(found.state)
    stresses = stress(lath, forces[:, 0], forces[:, 2], forces[:, 3])
    wanted = 10e9 * 0.0015 * 2.0 * np.pi / 3.0
    numbers = [
        ("largest stress, Pa", float(stresses.max()), wanted),
        ("smallest stress, Pa", float(stresses.min()), wanted),
    ]
    yield from rows("lath sprung to a ring", "closed form", 1e-6, numbers)
