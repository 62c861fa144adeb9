"""Beams that are without stress in a bent state: edge beams in their final curve, layers locked to each
other."""

import numpy as np
import pytest

from shellform.errors import InputError
from shellform.structure.answers.third_derivatives import bilinear, bilinear_by_dof
from shellform.structure.elements.beam import Beams, built_in, joined, make_beams
from shellform.structure.elements.cable import make_cables
from shellform.structure.elements.rotation import matrices, product
from shellform.structure.elements.state import State, at_rest, from_vectors, moved
from shellform.structure.model import Model, parse_model, read_model, write_model
from shellform.structure.network import Network, assemble, doubts
from shellform.structure.solve.assembly import Assembly
from shellform.structure.solve.equilibrium import find_equilibrium

EA, GJ, EI = 1e6, 50.0, 80.0
NO_CABLES = make_cables(np.zeros((0, 2), dtype=int), rest_length=[], stiffness=[])


def some_beams(seed=0):
    """Three beams with other axes at one end than at the other, and where they are without stress."""
    chance = np.random.default_rng(seed)
    place = np.array([[0.0, 0.0, 0.0], [1.0, 0.1, 0.2], [1.8, 0.6, 0.1], [2.4, 1.4, -0.2]])
    rest = from_vectors(place, 0.6 * chance.normal(size=(4, 3)))
    ends = [[0, 1], [1, 2], [2, 3]]
    made = built_in(
        rest, ends, axial=90.0, torsion=2.0, bending_y=3.0, bending_z=5.0, z_axis=[[0.1, 0.2, 1.0]] * 3,
        kind="edge"
    )  # fmt: skip
    return made, rest


def disturbed(state, size, seed=1):
    chance = np.random.default_rng(seed)
    return moved(state, size * chance.normal(size=(len(state.positions), 6)))


def full(packed, size=12):
    rows, columns = np.tril_indices(size)
    result = np.zeros((len(packed), size, size))
    result[:, rows, columns] = result[:, columns, rows] = packed
    return result


def test_a_beam_has_no_stress_in_the_state_that_it_is_built_into():
    beams, rest = some_beams()
    assert beams.built_in.all()
    np.testing.assert_allclose(beams.local_deformations(rest), 0.0, atol=1e-15)
    np.testing.assert_allclose(beams.evaluate(rest, tangent=False).force, 0.0, atol=1e-13)


def test_end_forces_are_the_gradient_of_the_energy_whatever_the_ends_axes():
    beams, rest = some_beams()
    state, h = disturbed(rest, 0.2), 1e-5
    direction = np.random.default_rng(5).normal(size=(4, 6))
    force = beams.evaluate(state, tangent=False).force
    energy = [
        beams.evaluate(moved(state, s * h * direction), tangent=False).energy.sum() for s in (1.0, -1.0)
    ]
    expected = float((force * direction.ravel()[beams.dofs()]).sum())
    assert (energy[0] - energy[1]) / (2 * h) == pytest.approx(expected, rel=1e-8)


def test_the_energy_s_expansion_to_second_order_leaves_a_rest_of_third_order():
    beams, rest = some_beams()
    state = disturbed(rest, 0.2)
    direction = np.random.default_rng(6).normal(size=(4, 6))
    own = direction.ravel()[beams.dofs()]
    result = beams.evaluate(state, tangent=True)
    first, second = (
        float((result.force * own).sum()),
        float(np.einsum("ei,eij,ej->", own, full(result.tangent), own)),
    )
    left = []
    for t in (2e-2, 1e-2):
        energy = beams.evaluate(moved(state, t * direction), tangent=False).energy.sum()
        left.append(abs(energy - result.energy.sum() - t * first - 0.5 * t * t * second))
    assert left[0] / left[1] == pytest.approx(8.0, rel=0.3)


def test_derivatives_of_local_forces_and_of_stiffness_hold_for_them_too():
    beams, rest = some_beams()
    state, h = disturbed(rest, 0.2), 1e-5
    chance = np.random.default_rng(7)
    direction = chance.normal(size=(4, 6))
    own = direction.ravel()[beams.dofs()]
    there = [moved(state, s * h * direction) for s in (1.0, -1.0)]
    slope = (beams.local_forces(there[0]) - beams.local_forces(there[1])) / (2 * h)
    rates = np.einsum("ekd,ed->ek", beams.local_forces_by_dof(state), own)
    np.testing.assert_allclose(rates, slope, atol=1e-7 * np.abs(slope).max())
    left, right = chance.normal(size=(2, 24, 3))
    assembly = Assembly(4, (beams,), np.zeros((4, 6), dtype=bool))
    values = [bilinear(beams, each, left, right) for each in there]
    found = bilinear_by_dof(assembly, state, left, right) @ direction.ravel()
    assert found == pytest.approx((values[0] - values[1]) / (2 * h), rel=1e-6)


def test_beams_turned_as_a_whole_feel_nothing():
    beams, rest = some_beams()
    state = disturbed(rest, 0.2)
    turn = from_vectors(np.zeros((1, 3)), [[0.4, -1.1, 0.7]])
    rotation = matrices(turn.quaternions)[0]
    turned = State(
        state.positions @ rotation.T + [1.0, 2.0, 3.0], product(np.repeat(turn.quaternions, 4, axis=0),
        state.quaternions)
    )  # fmt: skip
    np.testing.assert_allclose(beams.local_forces(turned), beams.local_forces(state), atol=1e-12)
    expected = beams.evaluate(state, tangent=False).force.reshape(-1, 4, 3) @ rotation.T
    np.testing.assert_allclose(
        beams.evaluate(turned, tangent=False).force.reshape(-1, 4, 3), expected, atol=1e-12
    )


def test_equal_axes_at_both_ends_give_the_beams_of_before_bit_by_bit():
    nodes = np.array([[0.0, 0.0, 0.0], [1.0, 0.2, 0.1]])
    straight = make_beams(
        nodes, [[0, 1]], axial=9.0, torsion=2.0, bending_y=3.0, bending_z=5.0, z_axis=[[0.0, 0.0, 1.0]]
    )
    again = built_in(
        at_rest(nodes), [[0, 1]], axial=9.0, torsion=2.0, bending_y=3.0, bending_z=5.0,
        z_axis=[[0.0, 0.0, 1.0]], kind="rod"
    )  # fmt: skip
    assert not again.built_in.any()
    state = disturbed(at_rest(nodes), 0.1)
    for name in ("energy", "force", "tangent"):
        np.testing.assert_array_equal(
            getattr(straight.evaluate(state, tangent=True), name),
            getattr(again.evaluate(state, tangent=True), name)
        )  # fmt: skip


def curve(place, *, closed, axial=EA, inertia=EI):
    """A network in the x-z plane of a beam built along places (n, 3), and its stress-free state."""
    count = len(place)
    ends = np.column_stack([np.arange(count), np.roll(np.arange(count), -1)])[
        : count if closed else count - 1
    ]
    state = at_rest(place)
    beams = built_in(
        state, ends, axial=axial, torsion=GJ, bending_y=inertia, bending_z=inertia,
        z_axis=np.tile([0.0, 1.0, 0.0], (len(ends), 1)),
        kind="edge",
    )  # fmt: skip
    fixed = np.zeros((count, 6), dtype=bool)
    fixed[:, [1, 3, 5]] = True  # nothing leaves the plane
    return Network(place, beams, NO_CABLES, fixed, np.zeros((count, 6))), state


def ring(count, radius=1.5):
    angle = 2.0 * np.pi * np.arange(count) / count
    return radius * np.column_stack([np.cos(angle), 0.0 * angle, np.sin(angle)])


def test_a_curved_ring_pressed_together_at_two_points_gives_way_as_timoshenko_says():
    """Strength of Materials II, art. 79: δ = (π/4 - 2/π) P R³ / EI along the load, (2/π - 1/2) P R³ / EI
    across it, of an inextensible ring; elements are straight, O(h²), and EA is 1e4 EI / R²: 0.2 %."""
    count, radius, push = 96, 1.5, 0.02
    network, state = curve(ring(count), closed=True)
    quarter = count // 4
    fixed = np.array(network.fixed)
    fixed[[quarter, 3 * quarter], 0] = True
    fixed[[0, 2 * quarter], 2] = True
    network = Network(network.nodes, network.beams, network.cables, fixed, network.imposed)
    load = np.zeros((count, 6))
    load[quarter, 2], load[3 * quarter, 2] = -push, push
    found = find_equilibrium(assemble(network), state, load).state.positions - state.positions
    unit = push * radius**3 / EI
    along = found[3 * quarter, 2] - found[quarter, 2]
    across = found[0, 0] - found[2 * quarter, 0]
    assert along == pytest.approx((np.pi / 4 - 2 / np.pi) * unit, rel=4e-3)
    assert across == pytest.approx((2 / np.pi - 0.5) * unit, rel=4e-3)


def test_a_curved_ring_under_radial_dead_load_shrinks_and_buckles_as_known():
    """Shrinks by q R² / EA; buckles at 4 EI / R³ where the load keeps its direction (Boresi, J. Appl. Mech.
    22 (1955) 95; 3 EI / R³ is for water pressure, 4.5 where it stays aimed at the centre)."""
    count, radius = 96, 1.5
    network, state = curve(ring(count), closed=True)
    fixed = np.array(network.fixed)
    fixed[[count // 4, 3 * count // 4], 0] = True
    fixed[[0, count // 2], 2] = True
    network = Network(network.nodes, network.beams, network.cables, fixed, network.imposed)
    assembly = assemble(network)
    known = 4.0 * EI / radius**3
    share = radius * 2.0 * np.sin(np.pi / count)
    stable = []
    for pressure in (0.5 * known, 0.98 * known, 1.02 * known):
        load = np.zeros((count, 6))
        load[:, :3] = -pressure * share * state.positions / radius
        found = find_equilibrium(assembly, state, load)
        shrunk = radius - np.linalg.norm(found.state.positions, axis=1)
        if pressure < known:
            assert shrunk.mean() == pytest.approx(pressure * radius**2 / EA, rel=5e-3)
        stable.append(found.stable)
    assert stable == [True, True, False]


def test_the_thrust_of_a_two_hinged_semicircular_arch_is_its_load_over_pi():
    """Timoshenko and Young, Theory of Structures, art. 9.3: H = P / π under a load at the crown,
    inextensible."""
    count, radius, push = 129, 2.0, 0.5
    angle = np.pi * np.arange(count) / (count - 1)
    place = radius * np.column_stack([np.cos(angle), 0.0 * angle, np.sin(angle)])
    network, state = curve(place, closed=False)
    fixed = np.array(network.fixed)
    fixed[[0, -1], :3] = True
    network = Network(network.nodes, network.beams, network.cables, fixed, network.imposed)
    load = np.zeros((count, 6))
    load[count // 2, 2] = -push
    assembly = assemble(network)
    found = find_equilibrium(assembly, state, load).state
    reaction = assembly.evaluate(found, tangent=False).force[0]
    assert -reaction[0] == pytest.approx(push / np.pi, rel=5e-3)
    assert reaction[2] == pytest.approx(push / 2, rel=1e-6)


def test_laths_locked_in_a_curve_spring_back_as_two_springs_in_parallel_do():
    """Bent by κ and locked by blocks that add the stiffness B to theirs, b: let go, b κ' + B (κ' - κ) = 0.
    The blocks' rest length is the chord, the laths' the arc: 3e-6."""
    count, bent, own, added = 33, 0.8, 3.0, 24.0
    along = np.linspace(0.0, 1.0, count)
    flat = np.column_stack([along, 0.0 * along, 0.0 * along])
    ends = np.column_stack([np.arange(count - 1), np.arange(1, count)])
    laths = make_beams(flat, ends, axial=1e5, torsion=1.0, bending_y=own, bending_z=own)
    curved = np.column_stack([np.sin(bent * along) / bent, 0.0 * along, (np.cos(bent * along) - 1.0) / bent])
    state = from_vectors(curved, np.column_stack([0.0 * along, bent * along, 0.0 * along]))
    blocks = built_in(
        state, ends, axial=0.0, torsion=0.0, bending_y=added, bending_z=0.0,
        z_axis=np.tile([0.0, 0.0, 1.0], (count - 1, 1)),
        kind="lock",
    )  # fmt: skip
    fixed = np.zeros((count, 6), dtype=bool)
    fixed[0] = True
    network = Network(flat, joined(laths, blocks), NO_CABLES, fixed, np.zeros((count, 6)))
    found = find_equilibrium(assemble(network), state, np.zeros((count, 6))).state
    turned = found.rotations[-1, 1]
    assert turned == pytest.approx(bent * added / (own + added), rel=1e-5)


def test_a_model_with_built_in_beams_comes_back_from_its_file(tmp_path):
    beams, rest = some_beams()
    straight = make_beams(rest.positions, [[0, 2]], axial=5.0, torsion=2.0, bending_y=3.0, bending_z=5.0)
    network = Network(
        rest.positions, joined(straight, beams), NO_CABLES, np.ones((4, 6), dtype=bool), np.zeros((4, 6))
    )
    write_model(tmp_path / "m.json", Model(network, {}, rest, (0, 1, 2, 3)))
    again = read_model(tmp_path / "m.json").network.beams
    assert again.kinds == ("rod", "edge")
    for name in ("ends", "axial", "rest_length", "frames", "kind"):
        np.testing.assert_allclose(getattr(again, name), getattr(network.beams, name), atol=1e-15)


def bar(**more):
    return {
        "format": "shellform-model",
        "version": 1,
        "nodes": [[0, 0, 0], [1, 0, 0]],
        "beams": [{"nodes": [0, 1], "EA": 1.0, "GJ": 1.0, "EIy": 1.0, "EIz": 1.0, "rest_length": 1.0} | more],
        "supports": [{"node": 0, "fixed": [True] * 6}],
    }


UPRIGHT = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
TILTED = [[0.6, 0, -0.8], [0, 1, 0], [0.8, 0, 0.6]]


def test_axes_that_are_none_are_refused_with_the_element():
    for axes, more, match in (
        ([UPRIGHT, [[1, 0, 0], [0, 1, 0], [0, 0, -1]]], {}, "right-handed"),
        ([UPRIGHT, [[1, 0, 0], [0.1, 1, 0], [0, 0, 1]]], {}, "square to one another"),
        ([UPRIGHT, TILTED], {"z_axis": [0, 0, 1]}, "has no z_axis"),
        ([UPRIGHT, TILTED], {"rest_length": None}, "is needed beside axes"),
        ([UPRIGHT, TILTED], {"EA": 0, "GJ": 0, "EIy": 0, "EIz": 0}, "positive"),
    ):
        with pytest.raises(InputError, match=match) as caught:
            parse_model(bar(axes=axes, **more))
        assert "beams[0]" in caught.value.where


def test_axes_that_are_square_but_for_their_last_digits_are_made_square_and_those_that_are_stay():
    written = np.round(matrices(from_vectors(np.zeros((1, 3)), [[0.4, -1.1, 0.7]]).quaternions)[0].T, 8)
    once = parse_model(bar(axes=[UPRIGHT, written.tolist()])).network.beams.frames[0]
    assert np.abs(written @ written.T - np.eye(3)).max() > 1e-9
    np.testing.assert_allclose(once[1].T @ once[1], np.eye(3), atol=1e-15)
    np.testing.assert_allclose(once[1].T, written, atol=1e-8)
    exact = bar(axes=[UPRIGHT, once[1].T.tolist()])
    exact["nodes"].append([2, 0, 0])
    exact["beams"].append({**exact["beams"][0], "nodes": [1, 2], "axes": [UPRIGHT, written.tolist()]})
    again = parse_model(exact).network.beams.frames
    np.testing.assert_array_equal(again[0, 1], once[1])
    np.testing.assert_array_equal(again[1, 1], once[1])
    exact["beams"][1]["axes"][0] = [[1, 0, 0], [2e-6, 1, 0], [0, 0, 1]]
    with pytest.raises(InputError, match="unit vectors") as caught:
        parse_model(exact)
    assert caught.value.where == "beams[1].axes"
    exact["beams"][1]["axes"][0] = [[1, 0, 0], [0.5e-6, 1, 0], [0, 0, 1]]
    parse_model(exact)


def test_only_beams_with_axes_may_add_no_stiffness_of_a_kind():
    assert parse_model(bar(axes=[UPRIGHT, TILTED], EA=0)).network.beams.axial[0] == 0.0
    with pytest.raises(InputError, match="positive"):
        parse_model(bar(EA=0))


def test_built_in_beams_are_not_told_to_misfit():
    model = parse_model(bar(axes=[UPRIGHT, TILTED], rest_length=5.0))
    assert not any("rest lengths" in each for each in doubts(model.network))


def test_kinds_of_one_name_are_one_when_beams_are_joined():
    beams, _ = some_beams()
    twice = joined(beams, beams)
    assert isinstance(twice, Beams)
    assert twice.kinds == ("edge",)
    assert len(twice.ends) == 6
