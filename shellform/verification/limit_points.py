"""Limit points and what lies beyond: snap-through of toggles, arches, frames and domes, by arc length and
displacement control.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from shellform.arrays import Indices, Reals
from shellform.structure.answers.stability import critical_load
from shellform.structure.elements.beam import make_beams
from shellform.structure.elements.state import at_rest
from shellform.structure.network import Network, assemble
from shellform.structure.solve.drive import forces
from shellform.verification import exact
from shellform.verification.beams import lee_frame
from shellform.verification.compared import Comparison, rows
from shellform.verification.models import (
    CLAMP,
    PIN,
    chain,
    in_plane,
    load_at,
    no_cables,
    order,
    polyline,
    pushed,
    turning_points,
)


def mises_truss() -> Iterator[Comparison]:
    """Two hinged bars, half span 1, rise 0.1, EA = 1e4, pushed down at the crown: the closed form of von
    Mises (1923).

    One element a bar and EI = 1e-6, which adds 3e-7 of the limit load: exact but for that, so 1e-6.
    """
    limit, height = exact.shallow_truss(1.0, 0.1, 1e4)
    points = polyline([[-1.0, 0.0, 0.0], [0.0, 0.0, 0.1], [1.0, 0.0, 0.0]], 1)
    network = in_plane(chain(points, (1e4, 1e-6, 1e-6, 1e-6), {0: PIN, 2: PIN}))
    places = [height, 0.05, -height]
    loads = [-force for _, force in pushed(network, at_rest(points), (1, 2), places)]
    half = 2e4 * 0.05 * (1.0 / np.hypot(1.0, 0.05) - 1.0 / np.hypot(1.0, 0.1))
    numbers = [
        ("limit load", loads[0], limit),
        ("load at half height", loads[1], half),
        ("valley", loads[2], -limit),
    ]
    yield from rows("von Mises' truss", "closed form", 1e-6, numbers)


TOGGLE = ((33.8718, 0.23213), (31.2800, 0.39162))
"""Load and crown's drop at the limit and in the valley (tests/literature/test_references.py)."""


def toggle(elements: int) -> list[tuple[float, float]]:
    """Load and crown's drop at the turning points of Williams' toggle, in and lb, `elements` a member."""
    points = polyline([[-12.943, 0.0, 0.0], [0.0, 0.0, 0.386], [12.943, 0.0, 0.0]], elements)
    network = in_plane(chain(points, (1.885e6, 9.274e3, 9.274e3, 9.274e3), {0: CLAMP, 2 * elements: CLAMP}))
    return turning_points(network, load_at(network, elements, [0.0, 0.0, -1.0]), elements, 60.0)


def toggles() -> Iterator[Comparison]:
    """Williams, Quart. J. Mech. Appl. Math. 17 (1964) 451: clamped shallow toggle; against the exact
    extensible elastica.

    48 elements a member: the linear local axial strain leaves bowing out, O(h²) = 4e-4 of load and drop.
    """
    source = "extensible elastica, recomputed; Williams 1964"
    yield from turns("Williams' toggle", source, 1e-3, toggle(48), TOGGLE)


LEE_LIMITS = ((1.85567, 48.735), (-0.94144, 58.217))
"""Load and drop at the two limit points of Lee's frame (tests/literature/test_references.py)."""


def lee_limits() -> Iterator[Comparison]:
    """The limit points of Lee's frame (see beams.py), 70 elements a leg, by arc length: between them the path
    snaps back at 61.

    O(h²) leaves 5e-4 of the limits. And by load control: 1.84 is borne, 1.88 isn't.
    """
    points = polyline([[0.0, 0.0, 0.0], [0.0, 0.0, 120.0], [120.0, 0.0, 120.0]], 70)
    network = in_plane(chain(points, (4320.0, 1440.0, 1440.0, 1440.0), {0: PIN, 140: PIN}))
    found = turning_points(network, load_at(network, 84, [0.0, 0.0, -1.0]), 84, 2.5)
    yield from turns(
        "Lee's frame", "extensible elastica, recomputed; Lee et al. 1968", 1e-3, found, LEE_LIMITS
    )
    stays, snaps = (float(np.isfinite(lee_frame(20, load)[0])) for load in (1.84, 1.88))
    borne = [("borne at 1.84", stays, 1.0), ("borne at 1.88", snaps, 0.0)]
    yield from rows("Lee's frame, dead load", "its limit is 1.8557", 0.0, borne)


def turns(
    case: str,
    source: str,
    tolerance: float,
    found: Sequence[tuple[float, float]],
    wanted: Sequence[tuple[float, float]],
) -> Iterator[Comparison]:
    """Rows that compare turning points, load and drop; a wrong number of them is a row that fails."""
    yield Comparison(case, "turning points", len(found), len(wanted), 0.0, source)
    for number, (here, there) in enumerate(zip(found, wanted, strict=False), 1):
        yield from rows(
            case, source, tolerance, zip((f"load {number}", f"drop {number}"), here, there, strict=True)
        )


ARCH = (897.295, 113.731)
"""Load and crown's drop at the limit of the arch (tests/literature/test_references.py)."""


def arch(elements: int) -> tuple[float, float]:
    """Load and crown's drop at the limit of the clamped-hinged arch, `elements` a side."""
    angle = np.linspace(-1.0, 1.0, 2 * elements + 1) * np.radians(107.5)
    points = 100.0 * np.column_stack([np.sin(angle), np.zeros_like(angle), np.cos(angle)])
    network = in_plane(chain(points, (1e8, 1e6, 1e6, 1e6), {0: CLAMP, 2 * elements: PIN}))
    limit = critical_load(
        assemble(network), at_rest(points), forces(load_at(network, elements, [0.0, 0.0, -1.0])), goal=1100.0
    )
    if limit is None:
        return float("nan"), float("nan")
    return limit.factor, 100.0 - float(limit.equilibrium.state.positions[elements, 2])


def arches() -> Iterator[Comparison]:
    """DaDeppo and Schmidt, J. Appl. Mech. 42 (1975) 894: arch of 215°, clamped left, hinged right, dead crown
    load: 897.

    R = 100, EI = 1e6, EA = 1e8 as in Simo and Vu-Quoc 1986 (inextensible: 897.309). 60 chords a side: O(h²),
    and the order.
    """
    found = [arch(n) for n in (30, 60)]
    source = "extensible elastica, recomputed; DaDeppo and Schmidt 1975"
    case = "clamped-hinged arch of 215°"
    yield from rows(case, source, 1e-3, zip(("limit load", "drop there"), found[1], ARCH, strict=True))
    yield Comparison(
        case, "order of the limit load", order([load - ARCH[0] for load, _ in found]), 2.0, 0.1, "O(h²)"
    )


DOME = ((303.189, 0.76844), (-265.101, 3.02777))
"""Load and apex' drop at the star dome's limit and in its valley (tests/literature/test_references.py)."""


def star_dome() -> tuple[Reals, Indices]:
    """Nodes and bars of a dome of 24 bars like Hangai and Kawamata's (1972), cm: apex 0, ring 1-6, supports
    7-12.
    """
    ring, outer = np.radians(60.0 * np.arange(6)), np.radians(60.0 * np.arange(6) + 30.0)
    points = np.vstack(
        [
            [[0.0, 0.0, 8.216]],
            np.column_stack([25.0 * np.cos(ring), 25.0 * np.sin(ring), np.full(6, 6.216)]),
            np.column_stack([50.0 * np.cos(outer), 50.0 * np.sin(outer), np.zeros(6)]),
        ]
    )
    i = np.arange(6)
    after = (i + 1) % 6
    spokes, rim = np.column_stack([0 * i, 1 + i]), np.column_stack([1 + i, 1 + after])
    legs = np.vstack([np.column_stack([1 + i, 7 + i]), np.column_stack([1 + after, 7 + i])])
    return points, np.vstack([spokes, rim, legs])


def domes() -> Iterator[Comparison]:
    """Star dome of 24 hinged bars, EA = 3.03e5 · 3.17 N, loaded at its apex: limit load and valley by arc
    length.

    cm, N; one element a bar, hinged by a bending stiffness that adds 3e-6 (EI = 0.1 N cm²). The reference is
    a truss of Hooke's bars followed by Newton's method. Loads agree to 3e-6; the drop at a flat maximum is
    only as good as the root of that.
    """
    points, ends = star_dome()
    beams = make_beams(points, ends, axial=3.03e5 * 3.17, torsion=0.1, bending_y=0.1, bending_z=0.1)
    fixed = np.zeros((13, 6), dtype=bool)
    fixed[7:, :3] = True
    network = Network(points, beams, no_cables(), fixed, np.zeros((13, 6)))
    found = turning_points(network, load_at(network, 0, [0.0, 0.0, -1.0]), 0, 600.0)
    yield from turns(
        "star dome of 24 bars", "Hooke's bars, recomputed; after Hangai and Kawamata 1972", 5e-4, found, DOME
    )
