"""What must hold for every model: invariances, statics, and that forces and tangent are the energy's
derivatives.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from shellform.arrays import Indices, Reals
from shellform.structure.answers.sensitivity import (
    adjoint,
    by_load,
    by_rest_length,
    by_stiffness,
    direct,
    respond,
    tension_rows,
)
from shellform.structure.elements import rotation
from shellform.structure.elements.beam import STIFFNESSES, Beams, make_beams
from shellform.structure.elements.cable import make_cables
from shellform.structure.elements.state import State, at_rest, from_vectors, moved
from shellform.structure.network import Network, assemble
from shellform.structure.solve.equilibrium import find_equilibrium
from shellform.verification.compared import Comparison, rows
from shellform.verification.models import CLAMP, load_at, order, pushed

_AXIS = np.array([1.0, -2.0, 0.5]) / np.linalg.norm([1.0, -2.0, 0.5])


def turned_forces(angle: float) -> float:
    """Largest relative change of a bent beam's local forces when everything turns by an angle about a skew
    axis.
    """
    beams, state = _bent_beam()
    increment = np.zeros((2, 6))
    increment[:, 3:] = angle * _AXIS
    turn = rotation.matrices(rotation.from_vectors(angle * _AXIS[None, :]))[0]
    first = beams.local_forces(state)
    second = beams.local_forces(State(state.positions @ turn.T, moved(state, increment).quaternions))
    return float(np.abs(second - first).max() / np.abs(first).max())


def turns() -> Iterator[Comparison]:
    """The internal forces of a beam bent at random don't change when everything turns: to rounding."""
    for angle in (0.1, 1.0, 3.0):
        yield Comparison(
            "objectivity",
            f"change of forces after a turn by {angle} rad",
            turned_forces(angle),
            0.0,
            1e-9,
            "invariance",
        )


def basket(
    scale: float = 1.0, turn: Reals | None = None, number: Indices | None = None
) -> tuple[Network, Reals]:
    """A small model in space with everything in it, and its load: two crossing arches, clamped, tied by three
    prestressed cables.

    Lengths times `scale` with stiffness and load to match, turned by `turn` (3, 3), node i renamed
    `number[i]`. The load bends it by 0.09, a twentieth of its span, so that all terms count.
    """
    s = np.linspace(-1.0, 1.0, 9)
    one = np.column_stack([s, 0.2 * s, 0.5 * (1.0 - s**2)])
    other = np.column_stack([0.3 * s[s != 0.0], s[s != 0.0], 0.5 * (1.0 - s[s != 0.0] ** 2)])
    points = np.vstack([one, other])  # they share the crown, node 4
    path = np.array([9, 10, 11, 12, 4, 13, 14, 15, 16])
    ends = np.vstack(
        [np.column_stack([np.arange(8), np.arange(1, 9)]), np.column_stack([path[:-1], path[1:]])]
    )
    ties = np.array([[2, 11], [6, 14], [2, 14]])
    turn = np.eye(3) if turn is None else turn
    number = np.arange(17) if number is None else number
    place = np.empty_like(points)
    place[number] = scale * points @ turn.T
    upright = np.tile(turn[:, 2], (len(ends), 1))
    weak = (30.0, 0.02 * scale**2, 0.01 * scale**2, 0.03 * scale**2)
    axial, torsion, bending_y, bending_z = weak
    beams = make_beams(
        place,
        number[ends],
        axial=axial,
        torsion=torsion,
        bending_y=bending_y,
        bending_z=bending_z,
        z_axis=upright,
    )
    length = np.linalg.norm(points[ties[:, 1]] - points[ties[:, 0]], axis=1)
    cables = make_cables(number[ties], rest_length=scale * length / 1.01, stiffness=3.0)
    fixed = np.zeros((17, 6), dtype=bool)
    fixed[number[[0, 8, 9, 16]]] = CLAMP
    load = np.zeros((17, 6))
    load[number[5], :3] = turn @ [0.06, 0.03, -0.18]
    load[number[12], :3] = turn @ [0.0, -0.06, -0.09]
    return Network(place, beams, cables, fixed, np.zeros((17, 6))), load


def _shape(network: Network, load: Reals) -> tuple[Reals, float]:
    found = find_equilibrium(assemble(network), at_rest(network.nodes), load, tolerance=1e-11)
    return found.state.positions, found.energy


def invariances() -> Iterator[Comparison]:
    """Two tied arches in space under a skew load, solved again turned, moved, renumbered and in millimetres:
    the same shape.

    To the residual of 1e-11, over a span of 2; far away (at 1e4) to the last bit of the coordinates times the
    conditioning.
    """
    network, load = basket()
    place, energy = _shape(network, load)
    turn = rotation.matrices(rotation.from_vectors(2.0 * _AXIS[None, :]))[0]
    turned = _shape(*basket(turn=turn))[0] @ turn
    yield Comparison(
        "tied arches",
        "change when turned by 2 rad",
        float(np.abs(turned - place).max()),
        0.0,
        1e-8,
        "invariance",
    )
    shift = np.array([1e4, -2e4, 5e3])
    far = _shape(replace(network, nodes=network.nodes + shift), load)[0] - shift
    yield Comparison(
        "tied arches", "change when moved by 2e4 m", float(np.abs(far - place).max()), 0.0, 1e-6, "invariance"
    )
    number = np.random.default_rng(1).permutation(17)
    renamed = _shape(*basket(number=number))[0][number]
    yield Comparison(
        "tied arches", "change when renumbered", float(np.abs(renamed - place).max()), 0.0, 1e-8, "invariance"
    )
    large, work = _shape(*basket(scale=1000.0))
    yield Comparison(
        "tied arches",
        "change in millimetres",
        float(np.abs(large / 1000.0 - place).max()),
        0.0,
        1e-8,
        "invariance",
    )
    yield Comparison("tied arches", "energy in N mm", work / 1000.0, energy, 1e-8, "invariance")


def statics() -> Iterator[Comparison]:
    """Loads and reactions of the tied arches balance, forces and moments about the origin, in the bent
    shape.
    """
    network, load = basket()
    assembly = assemble(network)
    found = find_equilibrium(assembly, at_rest(network.nodes), load, tolerance=1e-11)
    force = assembly.evaluate(found.state, tangent=False).force
    outer = np.where(network.fixed, force, load)
    sum_of_forces = outer[:, :3].sum(axis=0)
    moment = (np.cross(found.state.positions, outer[:, :3]) + outer[:, 3:]).sum(axis=0)
    scale = np.abs(load).sum()
    numbers = [
        ("sum of forces over the load", float(np.abs(sum_of_forces).max() / scale), 0.0),
        ("sum of moments over the load", float(np.abs(moment).max() / scale), 0.0),
    ]
    yield from rows("tied arches, reactions", "statics", 1e-8, numbers)


def work() -> Iterator[Comparison]:
    """The work done on a crown that is pushed down by 0.3 is the energy stored: Gauss' rule over the holding
    force.

    Eight points integrate the smooth force to 1e-8 of it; stable all the way under displacement control.
    """
    network, _ = basket()
    start = find_equilibrium(assemble(network), at_rest(network.nodes), np.zeros((17, 6)), tolerance=1e-11)
    top = float(start.state.positions[4, 2])
    nodes, weights = np.polynomial.legendre.leggauss(8)
    places = top - 0.15 * (nodes + 1.0)
    path = pushed(network, start.state, (4, 2), [*places, top - 0.3])
    done = -0.15 * sum(w * force for w, (_, force) in zip(weights, path[:-1], strict=True))
    stored = assemble(network).evaluate(path[-1][0], tangent=False).energy - start.energy
    yield Comparison(
        "tied arches, crown pushed down", "energy stored by work done", stored / done, 1.0, 1e-6, "energy"
    )


def betti() -> Iterator[Comparison]:
    """Betti: about a loaded state, node 5 moves under a small extra force at node 12 as node 12 does under
    one at node 5.

    Central differences of re-solved equilibria, 1e-4 of the stiffness: second order in the force, 1e-6.
    """
    network, load = basket()
    assembly = assemble(network)
    base = find_equilibrium(assembly, at_rest(network.nodes), load, tolerance=1e-11).state

    def answer(at: tuple[int, int], to: tuple[int, int]) -> float:
        extra = load_at(network, at[0], np.eye(6)[at[1]] * 1e-5)
        sides = [
            find_equilibrium(assembly, base, load + sign * extra, tolerance=1e-12).state
            for sign in (1.0, -1.0)
        ]
        return float(sides[0].positions[to] - sides[1].positions[to])

    ratio = answer((5, 2), (12, 0)) / answer((12, 0), (5, 2))
    yield Comparison(
        "tied arches, two small forces", "ratio of displacements", ratio, 1.0, 1e-5, "Betti 1872"
    )


def _bent_beam() -> tuple[Beams, State]:
    points = np.array([[0.0, 0.0, 0.0], [1.0, 0.2, 0.1]])
    beams = make_beams(points, [[0, 1]], axial=50.0, torsion=2.0, bending_y=3.0, bending_z=5.0)
    return beams, from_vectors(
        points + np.array([[0.0, 0.0, 0.0], [0.05, -0.1, 0.08]]), [[0.3, -0.2, 0.1], [-0.1, 0.25, 0.4]]
    )


def gradients() -> Iterator[Comparison]:
    """Taylor's test of a beam bent at random by half a radian: what the energy's expansions to the first and
    second order leave.

    Along a random direction d, U(t d) - U - t f·d is O(t²), and with - t² d·K d/2 it is O(t³): forces are the
    gradient of the energy and the tangent is its Hessian, exactly. t from 8e-3 to 4e-3; rounding is 1e-6 of
    the smaller remainder.
    """
    beams, state = _bent_beam()
    result = beams.evaluate(state, tangent=True)
    assert result.tangent is not None
    hessian = np.zeros((12, 12))
    hessian[np.tril_indices(12)] = result.tangent[0]
    hessian += np.tril(hessian, -1).T
    direction = np.random.default_rng(3).normal(size=(2, 6))
    d = direction.ravel()
    first, second = [], []
    for t in (8e-3, 4e-3):
        energy = beams.evaluate(moved(state, t * direction), tangent=False).energy[0] - result.energy[0]
        first.append(energy - t * result.force[0] @ d)
        second.append(first[-1] - 0.5 * t * t * d @ hessian @ d)
    numbers = [
        ("order left by the forces", order(first), 2.0),
        ("order left by the tangent", order(second), 3.0),
    ]
    yield from rows("beam, Taylor's test", "Taylor", 0.05, numbers)
    # Richardson's combination of two central differences: fourth order, so that rounding is what is left.
    h = 4e-4
    sides = {
        s: beams.evaluate(moved(state, s * h * direction), tangent=False).energy[0] for s in (-2, -1, 1, 2)
    }
    slope = (8.0 * (sides[1] - sides[-1]) - (sides[2] - sides[-2])) / (12.0 * h)
    yield Comparison(
        "beam, Taylor's test",
        "energy's slope over f·d",
        float(slope / (result.force[0] @ d)),
        1.0,
        1e-9,
        "Taylor",
    )


def assembled() -> Iterator[Comparison]:
    """Taylor's test of the tied arches' whole tangent, cables and all, away from equilibrium: a remainder of
    O(t³).

    t from 4e-3 to 2e-3 along random motions of the free nodes; the cables stay taut.
    """
    network, load = basket()
    assembly = assemble(network)
    state = find_equilibrium(assembly, at_rest(network.nodes), load).state
    step = np.zeros(17 * 6)
    step[assembly.free] = np.random.default_rng(5).normal(size=len(assembly.free))
    direction = 0.1 * step.reshape(17, 6)
    state = moved(state, 0.2 * direction)
    here = assembly.evaluate(state)
    assert here.tangent is not None
    matrix, d = assembly.matrix, 0.1 * step[assembly.free]
    # The lower triangle twice, its diagonal once.
    weight = np.where(matrix.indices == matrix.columns, 1.0, 2.0)
    curvature = float((weight * here.tangent * d[matrix.indices] * d[matrix.columns]).sum())
    slope = float((here.force * direction).sum())
    rests = []
    for t in (4e-3, 2e-3):
        energy = assembly.evaluate(moved(state, t * direction), tangent=False).energy - here.energy
        rests.append(energy - t * slope - 0.5 * t * t * curvature)
    yield Comparison(
        "tied arches, Taylor's test", "order left by the tangent", order(rests), 3.0, 0.05, "Taylor"
    )


def sensitivities() -> Iterator[Comparison]:
    """Adjoint and direct sensitivities of the loaded tied arches against re-solved equilibria.

    How the height of node 5 and the tension of the first cable change with the three rest lengths, with the
    stiffness of all rods and with the load. Differences of fourth order over relative changes of 1e-4 leave
    1e-8; the largest miss over the measure's largest rate.
    """
    network, load = basket()
    names = ("rest lengths", "stiffness of the rods", "load factor")

    def varied(change: Reals) -> tuple[Network, Reals]:
        cables = replace(network.cables, rest_length=network.cables.rest_length + change[:3])
        stiffness = {name: getattr(network.beams, name) * (1.0 + change[3]) for name in STIFFNESSES}
        return replace(network, cables=cables, beams=replace(network.beams, **stiffness)), load * (
            1.0 + change[4]
        )

    base = find_equilibrium(assemble(network), at_rest(network.nodes), load, tolerance=1e-12).state

    def measured(change: Reals) -> Reals:
        other, force = varied(change)
        state = find_equilibrium(assemble(other), base, force, tolerance=1e-12).state
        return np.array([state.positions[5, 2], other.cables.tension(state)[0]])

    assembly = assemble(network)
    response = respond(
        assembly,
        base,
        by_rest_length(assembly, base, network.cables),
        by_stiffness(assembly, base, network.beams),
        by_load(assembly, load),
    )
    by_state = np.zeros((2, len(assembly.free)))
    by_state[0, np.searchsorted(assembly.free, 6 * 5 + 2)] = 1.0
    by_state[1] = tension_rows(assembly, base, network.cables)[[0]].toarray()[0]
    partial = np.zeros((2, 5))
    partial[1, 0] = network.cables.tension_by_rest_length(base)[0]
    wanted = np.empty((2, 5))
    h = 1e-4
    for k, unit in enumerate(h * np.eye(5)):
        near, far = (measured(s * unit) - measured(-s * unit) for s in (1.0, 2.0))
        wanted[:, k] = (8.0 * near - far) / (12.0 * h)
    scale = np.abs(wanted).max(axis=1, keepdims=True)
    for way, found in [("adjoint", adjoint(response, by_state)), ("direct", direct(response, by_state))]:
        miss = np.abs(found + partial - wanted) / scale
        for name, columns in zip(names, (slice(0, 3), slice(3, 4), slice(4, 5)), strict=True):
            yield Comparison(
                "tied arches, sensitivities",
                f"{way}, by {name}",
                float(miss[:, columns].max()),
                0.0,
                1e-6,
                "re-solved",
            )
