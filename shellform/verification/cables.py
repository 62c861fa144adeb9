"""Cables: slack, hanging and prestressed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from shellform.arrays import Reals
from shellform.structure.elements.cable import make_cables
from shellform.structure.elements.state import at_rest
from shellform.structure.network import Network
from shellform.verification import exact
from shellform.verification.compared import Comparison, rows
from shellform.verification.models import line, load_at, order, polyline, ropes, solved


def slack_pair() -> tuple[float, float]:
    """Tensions of two collinear cables with a load between them along the line."""
    points = line(2, 2.0)
    cables = make_cables([[0, 1], [1, 2]], rest_length=1.0, stiffness=187.0)
    network = ropes(points, cables, [0, 2])
    fixed = network.fixed.copy()
    fixed[1, 1:3] = True
    held = replace(network, fixed=fixed)
    first, second = cables.tension(solved(held, load_at(held, 1, [1.0, 0.0, 0.0])))
    return float(first), float(second)


def slack() -> Iterator[Comparison]:
    """Statics: of two collinear unstressed cables loaded in the middle one carries all, the other exactly
    nothing.
    """
    first, second = slack_pair()
    yield Comparison("collinear pair", "tension of the loaded cable", first, 1.0, 1e-8, "statics")
    yield Comparison("collinear pair", "tension of the slack cable", second, 0.0, 0.0, "statics")


def tripod() -> Iterator[Comparison]:
    """A node hung between three anchors and pushed sideways away from two of them: the third cable goes
    slack.

    N, m, EA = 100, prestrain 2 %: what is left is a symmetric V with Hooke's law, solved here for its depth
    to rounding.
    """
    anchors = np.array([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    points = np.vstack([anchors, [[0.0, 0.4, 0.0]]])
    rest = np.linalg.norm(anchors - points[3], axis=1) / 1.02
    cables = make_cables([[0, 3], [1, 3], [2, 3]], rest_length=rest, stiffness=100.0)
    network = ropes(points, cables, [0, 1, 2])
    state = solved(network, load_at(network, 3, [0.0, 20.0, 0.0]))
    tension = cables.tension(state)
    # Above the two anchors by y, each pulls down with EA (1/l0 - 1/l) y.
    wanted = exact.two_links(1.0, 100.0, 100.0 * (1.0 / rest[0] - 1.0), 20.0)
    numbers = [
        ("place y", float(state.positions[3, 1]), wanted),
        ("tension of the slack cable", float(tension[2]), 0.0),
    ]
    yield from rows("three cables, one slack", "Hooke, closed form", 1e-8, numbers)


def two_links() -> Iterator[Comparison]:
    """Two links in a line, prestressed, loaded across: Kwan, Computers and Structures 67 (1998) explains nets
    by it.

    Half span 1, EA = 1e4, loads of 0.01 to 100 % of EA; with and without prestress, where the line has no
    stiffness at first. The exact law P = 2 EA (1/l0 - 1/l) w is solved here to rounding.
    """
    for pretension, load in [(0.0, 1.0), (0.0, 1000.0), (20.0, 1.0), (20.0, 1000.0)]:
        rest = 1.0 / (1.0 + pretension / 1e4)
        network = ropes(line(2, 2.0), make_cables([[0, 1], [1, 2]], rest_length=rest, stiffness=1e4), [0, 2])
        sag = -solved(network, load_at(network, 1, [0.0, 0.0, -load])).positions[1, 2]
        wanted = exact.two_links(1.0, 1e4, pretension, load)
        quantity = f"sag, prestress {pretension:g}, load {load:g}"
        yield Comparison("two links", quantity, float(sag), wanted, 1e-7, "closed form; Kwan 1998")


def hanging(elements: int, force: float) -> tuple[float, float, float]:
    """Horizontal tension and place (x, z) of the loaded point of a heavy cable with a load at 3/5 of its
    length.
    """
    length, weight, axial = 1.2, 1.0, 60.0
    s = np.linspace(0.0, 1.0, elements + 1)
    # A taut V as long as 1.3.
    points = np.column_stack([s, np.zeros_like(s), -0.83 * np.minimum(s, 1.0 - s)])
    cables = make_cables(
        np.column_stack([np.arange(elements), np.arange(elements) + 1]),
        rest_length=length / elements,
        stiffness=axial,
    )
    network = ropes(points, cables, [0, elements])
    load = load_at(network, 3 * elements // 5, [0.0, 0.0, -force])
    load[:, 2] -= weight * length / elements
    state = solved(network, load)
    first = state.positions[1] - state.positions[0]
    tension = float(cables.tension(state)[0] * first[0] / np.linalg.norm(first))
    x, _, z = state.positions[3 * elements // 5]
    return tension, float(x), float(z)


def catenaries() -> Iterator[Comparison]:
    """The elastic catenary (Irvine 1981, section 1.3), alone and with a load at 3/5 as in Jayaraman and
    Knudsen 1981.

    Span 1, stress-free length 1.2, weight 1 a length, EA = 60; 80 cables, weight lumped at the nodes: O(h²),
    and the order.
    """
    for force in (0.0, 2.0):
        tension, _, x, z = exact.catenary(1.0, 0.0, 1.2, 1.0, 60.0, 0.72, force)
        numbers = zip(
            ("horizontal tension", "x at 3/5", "z at 3/5"), hanging(80, force), (tension, x, z), strict=True
        )
        yield from rows(f"heavy cable, load {force:g}", "elastic catenary, Irvine 1981", 5e-4, numbers)
    errors = [hanging(n, 2.0)[0] - exact.catenary(1.0, 0.0, 1.2, 1.0, 60.0, 0.72, 2.0)[0] for n in (20, 40)]
    yield Comparison("heavy cable, 20, 40 cables", "order of the tension", order(errors), 2.0, 0.1, "O(h²)")


def force_densities() -> Iterator[Comparison]:
    """A line of n = 8 cables of equal force density q under node loads p: z = p i (n - i)/(2q) (Schek 1974),
    exact at the nodes.

    Each cable's rest length is such that it has the tension q l there; from a taut V, to the solver's
    residual.
    """
    n, q, p, axial = 8, 3.0, 1.0, 500.0
    i = np.arange(n + 1)
    depth = p * i * (n - i) / (2.0 * q)
    shape = np.column_stack([i, np.zeros(n + 1), -depth])
    length = np.linalg.norm(np.diff(shape, axis=0), axis=1)
    cables = make_cables(
        np.column_stack([i[:-1], i[1:]]), rest_length=length / (1.0 + q * length / axial), stiffness=axial
    )
    network = ropes(np.column_stack([i, np.zeros(n + 1), -1.5 * np.minimum(i, n - i)]), cables, [0, n])
    load = np.zeros((n + 1, 6))
    load[:, 2] = -p
    found = solved(network, load).positions
    miss = float(np.abs(found[:, 2] + depth).max())
    yield Comparison(
        "line of equal force density", "largest miss of z", miss, 0.0, 1e-7, "Schek 1974, closed form"
    )


SIDE = 6  # cells of a saddle net along each of its edges


def hypar(side: int = SIDE) -> tuple[Network, Reals]:
    """A saddle net over a square of `side` × `side` meshes of 1 m, z = (x² - y²)/(2 side), cables of force
    density 50 N/m, EA = 5e4 N.

    z is discretely harmonic, so that equal force densities balance at every node: an exact form. Returns it
    and its shape.
    """
    number = np.arange((side + 1) ** 2).reshape(side + 1, side + 1)
    x, y = np.meshgrid(np.arange(side + 1) - 0.5 * side, np.arange(side + 1) - 0.5 * side, indexing="ij")
    shape = np.column_stack([x.ravel(), y.ravel(), (x**2 - y**2).ravel() / (2.0 * side)])
    inside = slice(1, -1)
    along = np.stack([number[:-1, inside], number[1:, inside]], axis=-1).reshape(-1, 2)
    across = np.stack([number[inside, :-1], number[inside, 1:]], axis=-1).reshape(-1, 2)
    ends = np.vstack([along, across])
    length = np.linalg.norm(shape[ends[:, 1]] - shape[ends[:, 0]], axis=1)
    cables = make_cables(ends, rest_length=length / (1.0 + 50.0 * length / 5e4), stiffness=5e4)
    edge = np.ones_like(number, dtype=bool)
    edge[inside, inside] = False
    return ropes(shape, cables, number[edge]), shape


def nets() -> Iterator[Comparison]:
    """A prestressed saddle net: found back from half as deep again, then loaded with 200 N a node on one
    half; four cables go slack.

    The shape is exact (force densities, Schek 1974), to the residual; the loaded net is recomputed by
    minimising its energy with SciPy, to the digits quoted.
    """
    network, shape = hypar()
    deep = np.where(network.fixed[:, :3], shape, shape * [1.0, 1.0, 1.5])
    found = solved(network, start=at_rest(deep))
    miss = float(np.abs(found.positions - shape).max())
    yield Comparison("saddle net", "miss of its shape, m", miss, 0.0, 1e-7, "force densities, closed form")
    loaded = solved(network, hypar_load(shape), found)
    tension = network.cables.tension(loaded)
    centre, sunk = (loaded.positions[node, 2] - shape[node, 2] for node in HYPAR_NODES)
    numbers = zip(
        ("centre, m", "under the load, m", "largest tension, N", "slack cables"),
        (centre, sunk, tension.max(), (tension == 0.0).sum()),
        HYPAR,
        strict=True,
    )
    yield from rows("saddle net, half loaded", "energy minimised by SciPy, recomputed", 1e-6, numbers)


HYPAR_NODES = (24, 17)  # whose heights are compared
HYPAR = (0.00980161, -0.17225218, 672.82097, 4.0)
"""Displacements, largest tension and number of slack cables of the loaded net
(tests/literature/test_references.py)."""


def hypar_load(shape: Reals) -> Reals:
    """200 N down at each node with x < 0."""
    load = np.zeros((len(shape), 6))
    load[shape[:, 0] < 0.0, 2] = -200.0
    return load


def two_catenaries(elements: int) -> tuple[float, float]:
    """x and z of a node that slides in a plane between two heavy cables, `elements` in each."""
    ends = np.array([[0.0, 0.0, 90.0], [15.0, 0.0, 40.0], [30.0, 60.0, 30.0]])
    points = polyline(ends, elements)
    count = 2 * elements
    # 50 long each, warmed by 100 at 6.5e-6 a degree.
    length = 50.0 * (1.0 + 6.5e-4) / elements
    pairs = np.column_stack([np.arange(count), np.arange(1, count + 1)])
    network = ropes(points, make_cables(pairs, rest_length=length, stiffness=3e7), [0, count])
    fixed = network.fixed.copy()
    fixed[elements, 1] = True
    load = np.zeros((count + 1, 6))
    load[:, 2] = -length
    place = solved(replace(network, fixed=fixed), load).positions[elements]
    return float(place[0]), float(place[2])


def opensees() -> Iterator[Comparison]:
    """Two catenary cables with a node that slides in the plane y = 0 between them: the example of OpenSees'
    CatenaryCable.

    Its manual (Ibañez and Abell, after Salehi Ahmad Abad et al., Finite Elem. Anal. Des. 73 (2013) 11) prints
    displacements of 8.58693 and 2.82578 from (15, 40), all of whose digits are met. Cables of 50 and EA =
    3e7, weight 1 a length, 20 straight ones for each; they are stretched by 5 %, so that their sag hardly
    counts.
    """
    x, z = two_catenaries(20)
    numbers = [("x of the sliding node", x, 15.0 + 8.58693), ("z of the sliding node", z, 40.0 + 2.82578)]
    yield from rows("two catenaries", "OpenSees manual, CatenaryCable", 1e-6, numbers)
