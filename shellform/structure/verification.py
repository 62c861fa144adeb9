"""Published and exact cases that `shellform verify` and the tests run on the installed package."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from shellform.arrays import Reals
from shellform.structure.beam import make_beams
from shellform.structure.cable import make_cables
from shellform.structure.equilibrium import find_equilibrium
from shellform.structure.loading import apply_load
from shellform.structure.network import Network, assemble
from shellform.structure.state import State, at_rest, from_vectors, moved


@dataclass(frozen=True)
class Row:
    """One compared number; `tolerance` on the difference, relative to the reference where that isn't 0."""

    name: str
    value: float
    reference: float
    tolerance: float
    source: str

    @property
    def difference(self) -> float:
        """Value minus reference, over the reference where that isn't 0."""
        gap = self.value - self.reference
        return abs(gap / self.reference) if self.reference else abs(gap)

    @property
    def passed(self) -> bool:
        """Whether the difference is within the tolerance."""
        return bool(self.difference <= self.tolerance)


def verify() -> Iterator[Row]:
    """All cases, one row a compared number."""
    for case in CASES:
        yield from case()


def chain(points: Reals, stiffness: tuple[float, float, float, float], held: dict[int, list[bool]]) -> Network:
    """Beams from point to point (n, 3) with (EA, GJ, EI_y, EI_z); `held` freedoms by node."""
    count = len(points)
    ends = np.column_stack([np.arange(count - 1), np.arange(1, count)])
    ea, gj, ey, ez = stiffness
    fixed = np.zeros((count, 6), dtype=bool)
    for node, freedoms in held.items():
        fixed[node] = freedoms
    beams = make_beams(points, ends, axial=ea, torsion=gj, bending_y=ey, bending_z=ez)
    none = make_cables(np.zeros((0, 2)), rest_length=1.0, stiffness=1.0)
    return Network(points, beams, none, fixed, np.zeros((count, 6)))


def _line(elements: int, length: float = 1.0) -> Reals:
    return np.column_stack([np.linspace(0.0, length, elements + 1), np.zeros((elements + 1, 2))])


def _plane(network: Network) -> Network:
    """The same with all motion out of the x-z plane held."""
    fixed = network.fixed.copy()
    fixed[:, [1, 3, 5]] = True
    return Network(network.nodes, network.beams, network.cables, fixed, network.imposed)


def bend_45(elements: int, torsion: float, load: float) -> Reals:
    """Tip position (3,) of the 45° bend: R = 100, EA = 1e7, EI = 8.333e5, tip load in z (Bathe and Bolourchi 1979)."""
    angle = np.linspace(0.0, np.pi / 4.0, elements + 1)
    points = np.column_stack([100.0 * np.sin(angle), 100.0 * (1.0 - np.cos(angle)), np.zeros(elements + 1)])
    network = chain(points, (1e7, torsion, 8.333e5, 8.333e5), {0: [True] * 6})
    force = np.zeros((elements + 1, 6))
    force[-1, 2] = load
    return np.asarray(find_equilibrium(assemble(network), at_rest(points), force).state.positions[-1])


def elastica(elements: int, load: float) -> tuple[float, float]:
    """Tip displacements u and w over L of a cantilever under a dead tip load, PL²/EI = `load` (Mattiasson 1981)."""
    points = _line(elements)
    network = _plane(chain(points, (1e7, 1.0, 1.0, 1.0), {0: [True] * 6}))
    force = np.zeros((elements + 1, 6))
    force[-1, 2] = load
    tip = find_equilibrium(assemble(network), at_rest(points), force).state.positions[-1]
    return float(1.0 - tip[0]), float(tip[2])


def roll_up(elements: int) -> float:
    """Distance of the tip from the clamp after an end moment of 2 pi EI/L in one step, all freedoms in space free."""
    points = _line(elements)
    network = chain(points, (1e6, 1.0, 1.0, 1.0), {0: [True] * 6})
    force = np.zeros((elements + 1, 6))
    force[-1, 5] = 2.0 * np.pi
    return float(np.linalg.norm(find_equilibrium(assemble(network), at_rest(points), force).state.positions[-1]))


def toggle(elements: int, drop: float) -> float:
    """Crown load of Williams' toggle at a crown displacement, by displacement control."""
    half, rise = 12.943, 0.386
    left = np.linspace([-half, 0.0, 0.0], [0.0, 0.0, rise], elements + 1)
    right = np.linspace([0.0, 0.0, rise], [half, 0.0, 0.0], elements + 1)[1:]
    points = np.vstack([left, right])
    crown = elements
    network = _plane(chain(points, (1.885e6, 1.0, 9.274e3, 9.274e3), {0: [True] * 6, 2 * elements: [True] * 6}))
    fixed = network.fixed.copy()
    fixed[crown, 2] = True
    held = Network(points, network.beams, network.cables, fixed, network.imposed)
    start = points.copy()
    start[crown, 2] -= drop
    assembly = assemble(held)
    none = np.zeros((len(points), 6))
    found = find_equilibrium(assembly, at_rest(start), none)
    return float(-assembly.evaluate(found.state).force[crown, 2])


def lee_frame(elements: int, load: float) -> float:
    """Vertical displacement under the load of Lee's frame, on the branch from no load (Lee et al. 1968)."""
    per = elements
    up = np.linspace([0.0, 0.0, 0.0], [0.0, 0.0, 120.0], per + 1)
    across = np.linspace([0.0, 0.0, 120.0], [120.0, 0.0, 120.0], per + 1)[1:]
    points = np.vstack([up, across])
    pin = [True, True, True, False, False, False]
    network = _plane(chain(points, (720.0 * 6.0, 1440.0, 1440.0, 1440.0), {0: pin, 2 * per: pin}))
    at = int(np.argmin(np.linalg.norm(points - [24.0, 0.0, 120.0], axis=1)))
    force = np.zeros((len(points), 6))
    force[at, 2] = -load
    loaded = apply_load(assemble(network), at_rest(points), np.zeros_like(force), force, step=0.1, stay=True)
    return float(120.0 - loaded.equilibrium.state.positions[at, 2]) if loaded.on_branch else float("inf")


def euler_load(elements: int) -> float:
    """Buckling load of a pinned strip, from the change of the tangent's inertia, by bisection; exact: pi² EI/L²."""
    points = _line(elements)
    pin = [True, True, True, True, False, True]
    network = _plane(chain(points, (1e6, 1.0, 1.0, 1.0), {0: pin, elements: [False, True, True, True, False, True]}))
    assembly = assemble(network)
    low, high = 5.0, 15.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        force = np.zeros((elements + 1, 6))
        force[-1, 0] = -middle
        stable = find_equilibrium(assembly, at_rest(points), force).stable
        low, high = (middle, high) if stable else (low, middle)
    return 0.5 * (low + high)


def slack_pair() -> tuple[float, float]:
    """Tensions of two collinear cables with a load between them along the line."""
    points = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]])
    beams = make_beams(points, np.zeros((0, 2), dtype=int), axial=1.0, torsion=1.0, bending_y=1.0, bending_z=1.0)
    cables = make_cables([[0, 1], [1, 2]], rest_length=1.0, stiffness=187.0)
    fixed = np.zeros((3, 6), dtype=bool)
    fixed[[0, 2], :3] = True
    fixed[1, 1:3] = True
    network = Network(points, beams, cables, fixed, np.zeros((3, 6)))
    force = np.zeros((3, 6))
    force[1, 0] = 1.0
    state = find_equilibrium(assemble(network), at_rest(points), force).state
    first, second = cables.tension(state)
    return float(first), float(second)


def turned_forces(angle: float) -> float:
    """Largest relative change of a bent beam's local forces when everything turns by an angle about a skew axis."""
    points = np.array([[0.0, 0.0, 0.0], [1.0, 0.2, 0.1]])
    beams = make_beams(points, [[0, 1]], axial=50.0, torsion=2.0, bending_y=3.0, bending_z=5.0)
    axis = np.array([1.0, -2.0, 0.5]) / np.linalg.norm([1.0, -2.0, 0.5])
    state = from_vectors(points + np.array([[0.0, 0.0, 0.0], [0.05, -0.1, 0.08]]), [[0.3, -0.2, 0.1], [-0.1, 0.25, 0.4]])
    spin = np.zeros((2, 6))
    spin[:, 3:] = angle * axis
    turned = moved(state, spin)
    cross = np.cross(axis, state.positions)
    along = (state.positions @ axis)[:, None] * axis
    place = along + np.cos(angle) * (state.positions - along) + np.sin(angle) * cross
    first = beams.local_forces(state)
    second = beams.local_forces(State(place, turned.quaternions))
    return float(np.abs(second - first).max() / np.abs(first).max())


def _bends() -> Iterator[Row]:
    source = "Bathe and Bolourchi 1979; Kirchhoff rod by ODE"
    for torsion, load, tip in [
        (8.333e5, 600.0, (47.1522, 15.6854, 53.4718)),
        (8.333e5, 300.0, (58.7802, 22.2453, 40.1894)),
        (7.05e5, 600.0, (46.8985, 15.5609, 53.6018)),
    ]:
        found = bend_45(64, torsion, load)
        for axis, value, reference in zip("xyz", found, tip, strict=True):
            # 64 straight elements: O(h²) leaves 2e-3 of the 53.5 displaced.
            yield Row(f"45° bend GJ={torsion:g} P={load:g} {axis}", float(value), reference, 1e-4, source)


def _elasticas() -> Iterator[Row]:
    exact = {1: (0.05643324, 0.30172077), 2: (0.16064172, 0.49345748), 5: (0.38762837, 0.71379152), 10: (0.55499780, 0.81060902)}
    for load, (u, w) in exact.items():
        found = elastica(80, float(load))
        for name, value, reference in zip("uw", found, (u, w), strict=True):
            yield Row(f"elastica PL²/EI={load} {name}/L", value, reference, 5e-4, "Mattiasson 1981")


def _roll_up() -> Iterator[Row]:
    yield Row("roll-up in one step, tip at the clamp", roll_up(10), 0.0, 1e-4, "closed form")


def _toggles() -> Iterator[Row]:
    source = "Williams 1964; extensible elastica"
    yield Row("Williams' toggle, limit load", toggle(32, 0.2310), 33.873, 2e-3, source)
    yield Row("Williams' toggle, valley", toggle(32, 0.3919), 31.279, 2e-3, source)


def _lee() -> Iterator[Row]:
    for load, drop in [(0.5, 3.80), (1.0, 10.72), (1.5, 25.85)]:
        yield Row(f"Lee's frame, v at P={load}", lee_frame(100, load), drop, 3e-3, "Lee et al. 1968; elastica")
    yield Row("Lee's frame stays below its limit (1.84)", float(np.isfinite(lee_frame(20, 1.84))), 1.0, 0.0, "limit 1.8569")
    yield Row("Lee's frame snaps above it (1.88)", float(np.isinf(lee_frame(20, 1.88))), 1.0, 0.0, "limit 1.8569")


def _others() -> Iterator[Row]:
    yield Row("Euler load of a pinned strip", euler_load(32), np.pi**2, 1e-3, "closed form")
    first, second = slack_pair()
    yield Row("loaded cable of a collinear pair", first, 1.0, 1e-8, "statics")
    yield Row("slack cable of the pair", second, 0.0, 0.0, "statics")
    for angle in (0.1, 1.0, 3.0):
        yield Row(f"forces after a turn by {angle} rad", turned_forces(angle), 0.0, 1e-9, "invariance")


CASES: tuple[Callable[[], Iterator[Row]], ...] = (_bends, _elasticas, _roll_up, _toggles, _lee, _others)
