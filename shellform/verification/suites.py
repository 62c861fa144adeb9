"""Cases of other programs' suites and of the literature on nets: slack and self-stressed nets, catenaries,
the star dome of truss programs, and one of 100,000 elements.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.optimize import brentq

from shellform.arrays import Indices, Reals
from shellform.structure.elements.beam import make_beams
from shellform.structure.elements.cable import make_cables
from shellform.structure.elements.state import at_rest
from shellform.structure.network import Network, assemble
from shellform.structure.solve.equilibrium import find_equilibrium
from shellform.verification import exact
from shellform.verification.cables import hypar
from shellform.verification.compared import Comparison, rows
from shellform.verification.models import load_at, no_cables, pushed, ropes, solved, turning_points

TRUSS_DOME = ((0.1, 85.4985), (0.2, 132.2757), (0.3, 146.7707))
"""Crown's drop and load of the star dome (tests/literature/test_references.py)."""
TRUSS_DOME_LIMIT = 146.7788
"""Its limit load."""


def truss_dome() -> Network:
    """A star dome of 24 hinged bars, EA = 0.0155 · 3e7: crown 0, ring 1-6, feet 7-12."""
    ring = np.radians(60.0 * np.arange(6))
    x, y = 17.0472, 9.8425
    feet = [[x, y, 0.0], [0.0, 19.685, 0.0], [-x, y, 0.0], [-x, -y, 0.0], [0.0, -19.685, 0.0], [x, -y, 0.0]]
    points = np.vstack(
        [
            [[0.0, 0.0, 3.2346]],
            np.column_stack([9.8425 * np.cos(ring), 9.8425 * np.sin(ring), np.full(6, 2.4472)]),
            feet,
        ]
    )
    i = np.arange(6)
    after, before = (i + 1) % 6, (i - 1) % 6
    ends = np.vstack(
        [
            np.column_stack([0 * i, 1 + i]),
            np.column_stack([1 + i, 1 + after]),
            np.column_stack([1 + i, 7 + i]),
            np.column_stack([1 + i, 7 + before]),
        ]
    )
    beams = make_beams(points, ends, axial=0.0155 * 3e7, torsion=1e-5, bending_y=1e-5, bending_z=1e-5)
    fixed = np.zeros((13, 6), dtype=bool)
    fixed[7:, :3] = True
    return Network(points, beams, no_cables(), fixed, np.zeros((13, 6)))


def truss_domes() -> Iterator[Comparison]:
    """Hamel's star dome, a case of truss programs' suites: loads at three drops of the crown, and the limit.

    Bars hinged by a bending stiffness that adds less than 1e-7; the reference is a sector of Hooke's bars,
    recomputed. Feet are printed with four decimals, which leaves sectors unlike by 5e-6: 1e-5.
    """
    network = truss_dome()
    source = "Hooke's bars, recomputed; Hamel's dome"
    found = pushed(network, at_rest(network.nodes), (0, 2), [3.2346 - drop for drop, _ in TRUSS_DOME])
    numbers = [
        (f"load at {drop:g}", -force, wanted)
        for (drop, wanted), (_, force) in zip(TRUSS_DOME, found, strict=True)
    ]
    yield from rows("star dome of hinged bars", source, 1e-5, numbers)
    limit, _ = turning_points(network, load_at(network, 0, [0.0, 0.0, -1.0]), 0, 180.0)[0]
    yield Comparison("star dome of hinged bars", "limit load", limit, TRUSS_DOME_LIMIT, 1e-5, source)


JAYARAMAN = (-2.819, -18.458)
"""Printed displacement (x, z), ft, of the loaded node."""


def heavy_cable(elements: int, force: float) -> Reals:
    """Place (2,), ft, of the loaded point of Jayaraman and Knudsen's cable, `elements` in each part."""
    lengths, weight, axial = (412.8837, 613.0422), 3.16, 0.85 * 19e6
    rest = np.repeat(np.array(lengths) / elements, elements)
    ends = np.column_stack([np.arange(2 * elements), np.arange(2 * elements) + 1])
    s = np.linspace(0.0, 1.0, elements + 1)
    corner = np.array([400.0, 0.0, -100.0])
    points = np.vstack([s[:, None] * corner, (corner + s[:, None] * ([1000.0, 0.0, 0.0] - corner))[1:]])
    network = ropes(points, make_cables(ends, rest_length=rest, stiffness=axial), [0, 2 * elements])
    load = load_at(network, elements, [0.0, 0.0, -force])
    load[:, 2] -= weight * np.bincount(ends.ravel(), weights=np.repeat(0.5 * rest, 2))
    return np.asarray(solved(network, load).positions[elements, [0, 2]])


def jayaraman() -> Iterator[Comparison]:
    """Jayaraman and Knudsen, Computers and Structures 14 (1981) 165: 8000 lb on a heavy cable of 1000 ft, EA
    = 0.85 · 19e6 lb, 3.16 lb/ft, unstressed 412.8837 and 613.0422 ft on both sides; what the loaded point
    moves by.

    40 straight cables a side, weight lumped: O(h²), 1e-4 of the elastic catenary; what is printed has four
    digits.
    """
    moved = heavy_cable(40, 8000.0) - heavy_cable(40, 0.0)
    length, at = 412.8837 + 613.0422, 412.8837
    places = [
        exact.catenary(1000.0, 0.0, length, 3.16, 0.85 * 19e6, at, force)[2:] for force in (0.0, 8000.0)
    ]
    wanted = np.subtract(places[1], places[0])
    case = "Jayaraman and Knudsen's cable"
    names = ("x, ft", "z, ft")
    yield from rows(case, "elastic catenary, Irvine 1981", 5e-4, zip(names, moved, wanted, strict=True))
    printed = zip((f"{name}, printed" for name in names), moved, JAYARAMAN, strict=True)
    yield from rows(case, "Jayaraman and Knudsen 1981", 1e-3, printed)


def inclined_catenaries() -> Iterator[Comparison]:
    """The elastic catenary between supports at unlike heights (Irvine 1981, section 1.3), taut and loose.

    Span 1, drop 0.4, weight 1 a length, EA = 60; 80 cables, weight lumped: O(h²), 5e-4.
    """
    count = 80
    for length in (1.1, 1.5):
        s = np.linspace(0.0, 1.0, count + 1)
        sag = 1.2 * (length - 1.0) ** 0.5 * 4.0 * s * (1.0 - s)
        points = np.column_stack([s, np.zeros_like(s), -0.4 * s - sag])
        ends = np.column_stack([np.arange(count), np.arange(count) + 1])
        cables = make_cables(ends, rest_length=length / count, stiffness=60.0)
        network = ropes(points, cables, [0, count])
        load = np.zeros((count + 1, 6))
        load[:, 2] = -length / count
        load[[0, -1]] *= 0.5
        state = solved(network, load)
        first = state.positions[1] - state.positions[0]
        pull = float(cables.tension(state)[0] * first[0] / np.linalg.norm(first))
        x, z = state.positions[count // 2, [0, 2]]
        wanted = exact.catenary(1.0, 0.4, length, 1.0, 60.0, 0.5 * length, 0.0)
        numbers = zip(
            ("horizontal tension", "x of the middle", "z of the middle"), (pull, x, z),
            (wanted[0], wanted[2], wanted[3]), strict=True,
        )  # fmt: skip
        yield from rows(f"inclined heavy cable of {length:g}", "elastic catenary, Irvine 1981", 5e-4, numbers)


def crossing_cables() -> Iterator[Comparison]:
    """A sagging and a hogging cable that cross: the least of cable nets (Krishna, Cable-suspended roofs,
    1978, ch. 3).

    Half spans 1, rises 0.2, EA = 1e4, 20 N of prestress in each, loads down before and after the hogging
    cable goes slack. Closed form, solved here for the drop: to the solver's residual.
    """
    length = np.hypot(1.0, 0.2)
    rest = length / (1.0 + 20.0 / 1e4)
    corners = [[-1.0, 0.0, 0.2], [1.0, 0.0, 0.2], [0.0, -1.0, -0.2], [0.0, 1.0, -0.2], [0.0, 0.0, 0.0]]
    ends = [[0, 4], [1, 4], [2, 4], [3, 4]]
    network = ropes(np.array(corners), make_cables(ends, rest_length=rest, stiffness=1e4), [0, 1, 2, 3])
    for load in (5.0, 200.0):

        def gap(drop: float, load: float = load) -> float:
            pulls = [
                2e4 * max(np.hypot(1.0, height) / rest - 1.0, 0.0) * height / np.hypot(1.0, height)
                for height in (0.2 + drop, 0.2 - drop)
            ]
            return float(pulls[0] - pulls[1] - load)

        drop = float(brentq(gap, 0.0, 0.2, xtol=1e-15))
        state = solved(network, load_at(network, 4, [0.0, 0.0, -load]))
        tension = network.cables.tension(state)
        taut = 1e4 * max(np.hypot(1.0, 0.2 - drop) / rest - 1.0, 0.0)
        numbers = [("drop", -state.positions[4, 2], drop), ("hogging cable's tension", tension[2], taut)]
        yield from rows(f"crossing cables, load {load:g}", "Hooke, closed form; Krishna 1978", 1e-6, numbers)


def spokes() -> Iterator[Comparison]:
    """A flat net of seven prestressed spokes loaded across its plane at the hub: P = 7 EA (1/l0 - 1/l) w, and
    without load its self-stress alone.

    EA = 1e4, prestress 2; the small load's sag is all from prestress, the large one's from stretching (Kwan
    1998).
    """
    angle = 2.0 * np.pi * np.arange(7) / 7.0
    points = np.vstack([np.column_stack([np.cos(angle), np.sin(angle), np.zeros(7)]), np.zeros((1, 3))])
    ends = np.column_stack([np.arange(7), np.full(7, 7)])
    network = ropes(points, make_cables(ends, rest_length=1.0 / 1.0002, stiffness=1e4), np.arange(7))
    still = network.cables.tension(solved(network))
    yield from rows(
        "flat net of seven spokes", "closed form", 1e-10, [("tension without load", still.max(), 2.0)]
    )
    for load in (0.01, 100.0):
        sag = -solved(network, load_at(network, 7, [0.0, 0.0, -load])).positions[7, 2]
        wanted = exact.two_links(1.0, 1e4, 2.0, load * 2.0 / 7.0)
        yield Comparison(
            "flat net of seven spokes", f"sag, load {load:g}", sag, wanted, 1e-7, "closed form; Kwan 1998"
        )


def self_stressed_simplex() -> Iterator[Comparison]:
    """The triangular prism of three struts and nine cables (Snelson's simplex): its twist of 30° beyond a
    prism's and its one state of self-stress (Connelly and Back 1998; Pellegrino 1993).

    Started 6° off and 5 % off in height, without load or fixed place but what holds it in space, it comes
    back; forces over lengths are 1 : √3 of triangles' to verticals' cables. Struts hinged, EI = 1e-7; to the
    residual: 1e-6.
    """

    def prism(twist: float, height: float) -> Reals:
        angle = np.radians(120.0 * np.arange(3) - 150.0)
        lower = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(3)])
        upper = np.column_stack([np.cos(angle + twist), np.sin(angle + twist), np.full(3, height)])
        return np.vstack([lower, upper])

    k = np.arange(3)
    shape = prism(np.radians(-30.0), 1.2)
    triangles = np.vstack([np.column_stack([k, (k + 1) % 3]), np.column_stack([3 + k, 3 + (k + 1) % 3])])
    verticals, struts = np.column_stack([k, 3 + k]), np.column_stack([k, 3 + (k - 1) % 3])
    ends = np.vstack([triangles, verticals])

    def lengths(pairs: Indices) -> Reals:
        return np.asarray(np.linalg.norm(shape[pairs[:, 1]] - shape[pairs[:, 0]], axis=1))

    density = np.concatenate([np.full(6, 10.0), np.full(3, 10.0 * np.sqrt(3.0))])
    axial = 1e4
    cables = make_cables(
        ends, rest_length=lengths(ends) / (1.0 + density * lengths(ends) / axial), stiffness=axial
    )
    stretch = 10.0 * np.sqrt(3.0) * lengths(struts) / axial
    begin = prism(np.radians(-24.0), 1.26)
    beams = make_beams(
        begin, struts, axial=axial, torsion=1e-7, bending_y=1e-7, bending_z=1e-7,
        rest_length=lengths(struts) / (1.0 - stretch),
    )  # fmt: skip
    fixed = np.zeros((6, 6), dtype=bool)
    fixed[0, :3], fixed[1, 1:3], fixed[2, 2] = True, True, True  # node 1 lies along x from node 0
    network = Network(begin, beams, cables, fixed, np.zeros((6, 6)))
    state = find_equilibrium(assemble(network), at_rest(begin), np.zeros((6, 6))).state
    tension = cables.tension(state)
    apart = np.linalg.norm(state.positions[ends[:, 1]] - state.positions[ends[:, 0]], axis=1)
    height = state.positions[3:, 2].mean() - state.positions[:3, 2].mean()
    numbers = [
        ("height", height, 1.2),
        ("triangle's force density", (tension / apart)[0], 10.0),
        ("vertical's over triangle's", (tension / apart)[6] / (tension / apart)[0], np.sqrt(3.0)),
    ]
    yield from rows("simplex of three struts", "Connelly and Back 1998, closed form", 1e-6, numbers)


LARGE = 225  # meshes a side: 100,800 cables


def large_net() -> Iterator[Comparison]:
    """A saddle net of 100,800 cables whose shape is exact (force densities, Schek 1974; see cables.py), found
    back from a tenth deeper. To the residual over the net's stiffness: 1e-6 of its 225 m.
    """
    network, shape = hypar(LARGE)
    deep = np.where(network.fixed[:, :3], shape, shape * [1.0, 1.0, 1.1])
    found = solved(network, start=at_rest(deep))
    miss = float(np.abs(found.positions - shape).max())
    tension = network.cables.tension(found)
    length = network.cables.lengths(found)
    source = "force densities, closed form"
    yield Comparison("saddle net of 100,800 cables", "miss of its shape, m", miss, 0.0, 2.25e-4, source)
    worst = float(np.abs(tension / length / 50.0 - 1.0).max())
    yield Comparison("saddle net of 100,800 cables", "miss of its force densities", worst, 0.0, 1e-5, source)
