"""Limit points and what lies beyond: snap-through of toggles, arches, frames and domes, by displacement control."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from shellform.arrays import Indices, Reals
from shellform.structure.beam import make_beams
from shellform.structure.network import Network
from shellform.structure.state import at_rest
from shellform.structure.verification import exact
from shellform.structure.verification.beams import lee_frame
from shellform.structure.verification.case import Row, rows
from shellform.structure.verification.models import (
    CLAMP,
    PIN,
    chain,
    in_plane,
    no_cables,
    order,
    polyline,
    pushed,
)


def mises_truss() -> Iterator[Row]:
    """Two hinged bars, half span 1, rise 0.1, EA = 1e4, pushed down at the crown: the closed form of von Mises (1923).

    One element a bar and EI = 1e-6, which adds 3e-7 of the limit load: exact but for that, so 1e-6.
    """
    limit, height = exact.shallow_truss(1.0, 0.1, 1e4)
    points = polyline([[-1.0, 0.0, 0.0], [0.0, 0.0, 0.1], [1.0, 0.0, 0.0]], 1)
    network = in_plane(chain(points, (1e4, 1e-6, 1e-6, 1e-6), {0: PIN, 2: PIN}))
    places = [height, 0.05, -height]
    loads = [-force for _, force in pushed(network, at_rest(points), (1, 2), places)]
    half = 2e4 * 0.05 * (1.0 / np.hypot(1.0, 0.05) - 1.0 / np.hypot(1.0, 0.1))
    numbers = [("limit load", loads[0], limit), ("load at half height", loads[1], half), ("valley", loads[2], -limit)]
    yield from rows("von Mises' truss", "closed form", 1e-6, numbers)


TOGGLE = ((0.23213, 33.8718), (0.39162, 31.2800))
"""Crown's displacement and load at the limit and in the valley (tests/literature/test_references.py)."""


def toggle(elements: int, drop: float) -> float:
    """Crown load of Williams' toggle at a crown displacement, in and lb, by displacement control."""
    points = polyline([[-12.943, 0.0, 0.0], [0.0, 0.0, 0.386], [12.943, 0.0, 0.0]], elements)
    network = in_plane(chain(points, (1.885e6, 9.274e3, 9.274e3, 9.274e3), {0: CLAMP, 2 * elements: CLAMP}))
    return -pushed(network, at_rest(points), (elements, 2), 0.386 - drop)[0][1]


def toggles() -> Iterator[Row]:
    """Williams, Quart. J. Mech. Appl. Math. 17 (1964) 451: clamped shallow toggle; against the exact extensible elastica.

    48 elements a member: the linear local axial strain leaves bowing out, O(h²) = 4e-4 of the limit load.
    """
    numbers = [(name, toggle(48, drop), load) for name, (drop, load) in zip(("limit load", "valley"), TOGGLE, strict=True)]
    yield from rows("Williams' toggle", "extensible elastica, recomputed; Williams 1964", 1e-3, numbers)


LEE_LIMITS = {48.735: 1.85567, 58.217: -0.94144}
"""Load by displacement at the two limit points of Lee's frame (tests/literature/test_references.py)."""


def lee_limits() -> Iterator[Row]:
    """The limit points of Lee's frame (see beams.py), 70 elements a leg, by displacement control.

    The path snaps back at 61 down: past it, held at 62, the frame jumps to its last branch, and coming back from there finds the
    second limit. O(h²) leaves 5e-4 of the limits.
    """
    points = polyline([[0.0, 0.0, 0.0], [0.0, 0.0, 120.0], [120.0, 0.0, 120.0]], 70)
    pin = [True, True, True, False, False, False]
    network = in_plane(chain(points, (4320.0, 1440.0, 1440.0, 1440.0), {0: pin, 140: pin}))
    first, second = LEE_LIMITS
    down = np.concatenate([np.arange(2.0, first, 2.0), [first], np.arange(50.0, 62.1), [61.0, 60.0, 59.0, second]])
    path = pushed(network, at_rest(points), (84, 2), 120.0 - down)
    loads = [-force for _, force in path]
    found = {"first limit load": (loads[int(np.argmax(down >= first))], LEE_LIMITS[first])}
    found["second limit load"] = (loads[-1], LEE_LIMITS[second])
    numbers = [(name, *pair) for name, pair in found.items()]
    yield from rows("Lee's frame", "extensible elastica, recomputed; Lee et al. 1968", 1e-3, numbers)
    stays, snaps = (float(np.isfinite(lee_frame(20, load)[0])) for load in (1.84, 1.88))
    borne = [("borne at 1.84", stays, 1.0), ("borne at 1.88", snaps, 0.0)]
    yield from rows("Lee's frame, dead load", "its limit is 1.8557", 0.0, borne)


ARCH = (113.731, 897.295)
"""Crown's displacement and load at the limit of the arch (tests/literature/test_references.py)."""


def arch(elements: int) -> float:
    """Crown load of the clamped-hinged arch at its limit's displacement."""
    angle = np.linspace(-1.0, 1.0, 2 * elements + 1) * np.radians(107.5)
    points = 100.0 * np.column_stack([np.sin(angle), np.zeros_like(angle), np.cos(angle)])
    network = in_plane(chain(points, (1e8, 1e6, 1e6, 1e6), {0: CLAMP, 2 * elements: PIN}))
    drops = np.append(np.arange(4.0, ARCH[0], 4.0), ARCH[0])
    return -pushed(network, at_rest(points), (elements, 2), 100.0 - drops)[-1][1]


def arches() -> Iterator[Row]:
    """DaDeppo and Schmidt, J. Appl. Mech. 42 (1975) 894: arch of 215°, clamped left, hinged right, dead crown load: 897.

    R = 100, EI = 1e6, EA = 1e8 as in Simo and Vu-Quoc 1986 (inextensible: 897.309). 60 chords a side: O(h²), and the order.
    """
    loads = [arch(n) for n in (30, 60)]
    source = "extensible elastica, recomputed; DaDeppo and Schmidt 1975"
    yield Row("clamped-hinged arch of 215°", "limit load", loads[1], ARCH[1], 3e-3, source)
    yield Row("clamped-hinged arch of 215°", "order of the limit load", order(np.array(loads) - ARCH[1]), 2.0, 0.1, "O(h²)")


DOME = ((0.768, 303.189), (3.028, -265.101))
"""Apex displacement and load at the star dome's limit and in its valley (tests/literature/test_references.py)."""


def star_dome() -> tuple[Reals, Indices]:
    """Nodes and bars of a dome of 24 bars like Hangai and Kawamata's (1972), cm: apex 0, ring 1-6, supports 7-12."""
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


def domes() -> Iterator[Row]:
    """Star dome of 24 hinged bars, EA = 3.03e5 · 3.17 N, loaded at its apex: limit load and valley by displacement control.

    cm, N; one element a bar, hinged by a bending stiffness that adds 3e-6 (EI = 0.1 N cm²). The reference is a truss of Hooke's bars
    followed by Newton's method; apart from the apex' height its tangent stays positive definite.
    """
    points, ends = star_dome()
    beams = make_beams(points, ends, axial=3.03e5 * 3.17, torsion=0.1, bending_y=0.1, bending_z=0.1)
    fixed = np.zeros((13, 6), dtype=bool)
    fixed[7:, :3] = True
    network = Network(points, beams, no_cables(), fixed, np.zeros((13, 6)))
    drops = np.array([0.4, DOME[0][0], 1.2, 1.6, 2.0, 2.4, 2.8, DOME[1][0]])
    loads = [-force for _, force in pushed(network, at_rest(points), (0, 2), 8.216 - drops)]
    numbers = [("limit load, N", loads[1], DOME[0][1]), ("valley, N", loads[-1], DOME[1][1])]
    yield from rows("star dome of 24 bars", "Hooke's bars, recomputed; after Hangai and Kawamata 1972", 1e-5, numbers)
