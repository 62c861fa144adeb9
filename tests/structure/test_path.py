"""Path following, modes and critical loads."""

from dataclasses import replace

import numpy as np
import pytest

from shellform.errors import InputError, NotConverged
from shellform.structure.answers.stability import critical_load, linearised_factor, modes
from shellform.structure.elements.rotation import identity
from shellform.structure.elements.state import State, at_rest
from shellform.structure.network import Network, assemble
from shellform.structure.solve import path
from shellform.structure.solve.drive import Drive, forces
from shellform.structure.solve.equilibrium import find_equilibrium, newton
from shellform.structure.solve.loading import advance
from shellform.structure.solve.path import follow
from shellform.structure.solve.walk import Lead
from shellform.verification import exact
from shellform.verification.models import CLAMP, chain, line, load_at, polyline

PIN = [True, True, True, False, False, False]


def plane(network):
    fixed = network.fixed.copy()
    fixed[:, [1, 3, 5]] = True
    return Network(network.nodes, network.beams, network.cables, fixed, network.imposed)


def lee(elements=20):
    up = np.linspace([0, 0, 0], [0, 0, 120.0], elements + 1)
    across = np.linspace([0, 0, 120.0], [120.0, 0, 120.0], elements + 1)[1:]
    points = np.vstack([up, across])
    network = plane(chain(points, (4320.0, 1440.0, 1440.0, 1440.0), {0: PIN, 2 * elements: PIN}))
    node = int(np.argmin(np.linalg.norm(points - [24.0, 0, 120.0], axis=1)))
    load = np.zeros((len(points), 6))
    load[node, 2] = -1.0
    return assemble(network), at_rest(points), load, node


def column(elements=20, length=1.0):
    points = np.column_stack([np.zeros((elements + 1, 2)), np.linspace(0, length, elements + 1)])
    roller = [True, True, False, False, False, True]
    network = chain(
        points, (1e6, 1.0, 1.0, 1.0), {0: [True, True, True, False, False, True], elements: roller}
    )
    load = np.zeros((elements + 1, 6))
    load[-1, 2] = -1.0
    return assemble(network), at_rest(points), load


def test_arc_length_passes_both_limit_points_of_lee_s_frame():
    assembly, start, load, _ = lee()
    points = list(follow(assembly, start, forces(load), goal=2.5))
    limits = [p for p in points if p.event == "limit point"]
    # Recomputed by shooting (tests/literature/rods.py): 1.85567; O(h²) with 20 elements a leg.
    assert limits[0].factor == pytest.approx(1.85567, rel=3e-3)
    assert limits[1].factor == pytest.approx(-0.9414, rel=8e-3)
    assert points[-1].factor == 2.5
    assert all(p.equilibrium.residual < 1e-7 for p in points)
    falling = [p.factor for p in points if p.rate < 0.0]
    assert min(falling) < -0.8
    assert max(falling) > 1.8


def test_a_led_displacement_gives_the_same_limit_as_the_arc_length():
    assembly, start, load, node = lee()
    by_arc = next(p for p in follow(assembly, start, forces(load), goal=2.5) if p.event)
    points = list(follow(assembly, start, forces(load), lead=Lead(node, 2, -55.0), first=0.02))
    by_lead = next(p for p in points if p.event == "limit point")
    assert by_lead.factor == pytest.approx(by_arc.factor, rel=1e-6)
    assert points[-1].equilibrium.state.positions[node, 2] == pytest.approx(
        start.positions[node, 2] - 55.0, abs=1e-6
    )


def test_imposed_displacements_drive_the_path_as_forces_do():
    # Williams-like toggle pushed down by its support-led crown; the reaction at the crown is the load that
    # leads it there.
    points = np.vstack([np.linspace([-1, 0, 0], [0, 0, 0.1], 9), np.linspace([0, 0, 0.1], [1, 0, 0], 9)[1:]])
    network = plane(chain(points, (1e4, 1.0, 0.2, 0.2), {0: PIN, 16: PIN}))
    load = np.zeros((17, 6))
    load[8, 2] = -1.0
    led = list(follow(assemble(network), at_rest(points), forces(load), lead=Lead(8, 2, -0.15), first=0.1))
    fixed = network.fixed.copy()
    fixed[8, 2] = True
    held = assemble(Network(points, network.beams, network.cables, fixed, network.imposed))
    imposed = np.zeros((17, 6))
    imposed[8, 2] = -0.15
    none = np.zeros((17, 6))
    driven = list(follow(held, at_rest(points), Drive(none, imposed, none), goal=1.0))[-1]
    reaction = -held.evaluate(driven.equilibrium.state).force[8, 2]
    assert reaction == pytest.approx(led[-1].factor, rel=1e-6)


def test_a_goal_between_two_points_is_met_exactly_and_a_point_short_path_says_so():
    assembly, start, load, _ = lee()
    assert list(follow(assembly, start, forces(load), goal=0.37))[-1].factor == 0.37
    with pytest.raises(NotConverged, match="more points"):
        list(follow(assembly, start, forces(load), goal=2.5, most=5))
    with pytest.raises(InputError, match="nothing moves"):
        list(follow(assembly, start, forces(0.0 * load)))
    with pytest.raises(InputError, match="must not be zero"):
        list(follow(assembly, start, forces(load), goal=0.0))
    with pytest.raises(InputError, match="can lead"):
        list(follow(assembly, start, forces(load), lead=Lead(0, 0, 1.0)))


def test_a_goal_that_lies_too_far_off_to_turn_to_is_met_by_smaller_steps(monkeypatch):
    assembly, start, load, _ = lee()
    whole, missed = path.Walk.at_factor, []

    def at_factor(walk, here, there, goal):
        if not missed:
            missed.append(there.factor)
            raise path.Missed
        return whole(walk, here, there, goal)

    monkeypatch.setattr(path.Walk, "at_factor", at_factor)
    assert list(follow(assembly, start, forces(load), goal=1.0))[-1].factor == 1.0
    assert missed[0] > 1.0


def test_euler_s_column_loses_stability_at_its_load_both_linearised_and_on_the_path():
    assembly, start, load = column()
    found = critical_load(assembly, start, forces(load), goal=12.0)
    assert found.kind == "bifurcation"
    assert found.factor == pytest.approx(np.pi**2, rel=3e-3)  # straight elements, O(h²)
    assert found.linearised == pytest.approx(found.factor, rel=1e-3)
    height = start.positions[:, 2]
    shape = np.linalg.norm(found.mode[:, :2], axis=1)
    np.testing.assert_allclose(shape / shape.max(), np.sin(np.pi * height), atol=2e-3)
    assert critical_load(assembly, start, forces(load), goal=5.0) is None


def test_a_linearised_factor_counts_from_zero_whichever_two_factors_it_is_taken_from():
    assembly, start, load = column()
    states = [find_equilibrium(assembly, start, share * load).state for share in (2.0, 4.0)]
    found = linearised_factor(assembly, *states, (2.0, 4.0))
    assert found == pytest.approx(np.pi**2, rel=3e-3)


def test_a_critical_load_needs_a_stable_start():
    assembly, start, load = column()
    beyond = newton(assembly, start, 11.0 * load)
    assert not beyond.stable
    with pytest.raises(InputError, match="isn't stable"):
        critical_load(assembly, beyond.state, forces(load, base=11.0 * load), goal=1.0)


def test_modes_are_the_eigenvectors_of_the_dense_tangent():
    assembly, start, _ = column(12)
    found = modes(assembly, start, 4)
    tangent = assembly.matrix.full(assembly.evaluate(start).tangent).toarray()
    arm = np.where(assembly.free % 6 < 3, 1.0, 1.0 / 12.0)
    scaled = tangent / np.outer(arm, arm)
    exact = np.linalg.eigvalsh(scaled)[:4]
    np.testing.assert_allclose(found.stiffness, exact, rtol=1e-6)
    assert np.abs(found.shapes[:, :, :3]).max(axis=(1, 2)) == pytest.approx(np.ones(4))
    with pytest.raises(InputError, match="between 1 and"):
        modes(assembly, start, 10_000)


def test_modes_of_an_unstable_state_have_a_negative_stiffness():
    assembly, start, load = column()
    beyond = newton(assembly, start, 11.0 * load).state
    assert (modes(assembly, beyond, 3).stiffness < 0.0).sum() >= 1


@pytest.mark.parametrize("count", [1, 2, 5])
def test_modes_of_an_unstable_state_are_the_lowest_of_the_dense_tangent(count):
    """A column of 20 elements under thirty times its critical load: its lowest mode lies far below the ones
    near nothing."""
    assembly, start, load = column(20)
    beyond = newton(assembly, start, 300.0 * load).state
    tangent = assembly.matrix.full(assembly.evaluate(beyond).tangent).toarray()
    arm = np.where(assembly.free % 6 < 3, 1.0, 1.0 / 20.0)
    exact, shapes = np.linalg.eigh(tangent / np.outer(arm, arm))
    assert (exact < 0.0).sum() > 5
    assert np.abs(exact).min() < 0.5 * abs(exact[0])
    found = modes(assembly, beyond, count)
    np.testing.assert_allclose(found.stiffness, exact[:count], rtol=1e-6)
    lowest = (shapes[:, 0] / arm, found.shapes[0].ravel()[assembly.free])
    cosine = lowest[0] @ lowest[1] / np.linalg.norm(lowest[0]) / np.linalg.norm(lowest[1])
    assert abs(cosine) == pytest.approx(1.0, abs=1e-6) or exact[1] - exact[0] < 1e-3 * abs(exact[0])


def test_a_stiffening_structure_has_no_linearised_critical_factor():
    # A taut straight strip pulled along its axis gets stiffer.
    assembly, start, load = column()
    pulled = find_equilibrium(assembly, start, -1.0 * load).state
    assert linearised_factor(assembly, start, pulled, (0.0, 1.0)) == np.inf


def test_newton_and_relaxation_find_the_same_equilibrium_and_newton_gives_up_with_its_best_state():
    assembly, start, load, _ = lee()
    relaxed, plain = find_equilibrium(assembly, start, load), newton(assembly, start, load)
    np.testing.assert_allclose(relaxed.state.positions, plain.state.positions, atol=1e-6)
    with pytest.raises(NotConverged, match="relaxation") as caught:
        newton(assembly, start, 50.0 * load, limit=6)
    assert caught.value.state.positions.shape == start.positions.shape


def test_increments_are_halved_near_the_end_of_the_branch_and_grow_again():
    assembly, start, load, _ = lee()
    steps = []
    advance(
        assembly,
        start,
        forces(load),
        end=2.4,
        report=lambda share, found: steps.append((share, found.stable)),
    )
    widths = np.diff([0.0] + [share for share, _ in steps])
    assert widths.max() == pytest.approx(0.25)
    assert widths[:-1].min() < 0.1
    assert steps[-1] == (1.0, True)


def test_moving_supports_take_the_free_nodes_along():
    # A straight strip whose end is pushed in by a fifth of its length and lifted: it buckles, step by step.
    points = np.column_stack([np.linspace(0, 1, 21), np.zeros((21, 2))])
    network = plane(chain(points, (1e5, 1.0, 1.0, 1.0), {0: PIN, 20: PIN}))
    imposed = np.zeros((21, 6))
    imposed[20, [0, 2]] = [-0.2, 0.05]
    none = np.zeros((21, 6))
    found = advance(assemble(network), at_rest(points), Drive(none, imposed, none))
    assert found.equilibrium.stable
    np.testing.assert_allclose(found.equilibrium.state.positions[20], [0.8, 0.0, 0.05], atol=1e-12)
    assert np.abs(found.equilibrium.state.positions[:, 2]).max() > 0.2


def pushed_strip(elements):
    """A pinned strip and what pushes its end in to 0.6 of its length, with a force that says to which
    side."""
    network = plane(chain(line(elements), (1e4, 1.0, 1.0, 1.0), {0: PIN, elements: PIN}))
    imposed, aside = np.zeros((2, elements + 1, 6))
    imposed[elements, 0] = -0.4
    aside[elements // 2, 2] = 1e-3
    return replace(network, imposed=imposed), Drive(np.zeros_like(aside), imposed, aside)


def test_a_strip_pushed_to_0_6_of_its_length_in_five_increments_folds_no_element():
    network, drive = pushed_strip(20)
    assembly, state = assemble(network), at_rest(network.nodes)
    for k in range(5):
        found = advance(assembly, state, drive, begin=0.2 * k, end=0.2 * (k + 1)).equilibrium
        state = found.state
    chords = np.diff(state.positions, axis=0)
    assert found.stable
    assert np.abs(state.positions[:, 2]).max() == pytest.approx(0.3488, abs=5e-5)
    assert (np.einsum("ij,ij->i", chords[1:], chords[:-1]) > 0.0).all()


def test_a_straight_strip_pushed_past_a_node_keeps_its_elements_in_order():
    network, drive = pushed_strip(20)
    found = advance(assemble(network), at_rest(network.nodes), replace(drive, base=0.0 * drive.base))
    assert (np.diff(found.equilibrium.state.positions[:, 0]) > 0.0).all()


def test_an_element_that_the_supports_reverse_is_named_and_not_accepted():
    network = chain(line(2), (1e4, 1.0, 1.0, 1.0), {0: CLAMP, 1: CLAMP, 2: CLAMP})
    folded = State(np.array([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.0, 0.0, 1e-9]]), identity(3))
    with pytest.raises(NotConverged, match=r"beams\[1\] is turned.*180 degrees.*more elements"):
        find_equilibrium(assemble(network), folded, np.zeros((3, 6)))


def shallow_truss():
    """Von Mises' truss of two bars, half span 1 m, rise 0.1 m and EA = 1 kN, its limit load, N, and its
    load."""
    points = polyline([[-1.0, 0.0, 0.0], [0.0, 0.0, 0.1], [1.0, 0.0, 0.0]], 1)
    network = plane(chain(points, (1e3, 1e-7, 1e-7, 1e-7), {0: PIN, 2: PIN}))
    return network, exact.shallow_truss(1.0, 0.1, 1e3)[0], load_at(network, 1, [0.0, 0.0, -1.0])


@pytest.mark.parametrize("sought", [1.3, 3.0, 10.0, 30.0, 100.0, 1e3, 1e4])
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_limit_load_is_found_however_far_and_in_whichever_direction_it_is_sought(sought, way):
    """The closed form of von Mises (1923), 1e-6 for the bending stiffness of the hinges. A first step of a
    tenth of a hundred times that load leapt over both limit points, and there was no critical factor."""
    network, limit, load = shallow_truss()
    start = at_rest(network.nodes)
    found = critical_load(assemble(network), start, forces(way * load), goal=way * sought * limit)
    assert found.kind == "limit point"
    assert found.factor == pytest.approx(way * limit, rel=1e-6)


@pytest.mark.parametrize("sought", [2.0, 100.0, 1e3, 1e4])
def test_a_toggle_whose_load_falls_by_a_twelfth_only_is_not_leapt_over(sought):
    """Williams' toggle, whose valley is at 31.3 below its limit of 33.87; 12 straight elements a member leave
    0.6 %."""
    points = polyline([[-12.943, 0.0, 0.0], [0.0, 0.0, 0.386], [12.943, 0.0, 0.0]], 12)
    network = plane(chain(points, (1.885e6, 9.274e3, 9.274e3, 9.274e3), {0: CLAMP, 24: CLAMP}))
    load = forces(load_at(network, 12, [0.0, 0.0, -1.0]))
    found = critical_load(assemble(network), at_rest(points), load, goal=33.87 * sought)
    assert found.kind == "limit point"
    assert found.factor == pytest.approx(33.87, rel=8e-3)


def test_a_pulled_column_s_critical_factor_and_estimate_are_those_of_the_pushed_one_below_nothing():
    """The estimate was 5e9 where what was sought lay below nothing."""
    assembly, start, load = column()
    pushed = critical_load(assembly, start, forces(load), goal=12.0)
    pulled = critical_load(assembly, start, forces(-load), goal=-12.0)
    assert pulled.kind == pushed.kind == "bifurcation"
    assert pulled.factor == pytest.approx(-pushed.factor, rel=1e-9)
    assert pulled.linearised == pytest.approx(-pushed.linearised, rel=1e-6)


@pytest.mark.parametrize("goal", [50.0, 1e3, 1e5])
def test_an_arch_that_sways_before_its_load_turns_round_has_a_bifurcation_however_far_is_sought(goal):
    """A step over both called the first one a limit point."""
    angle = np.linspace(-0.35, 0.35, 17)
    points = np.column_stack([np.sin(angle), 0.0 * angle, np.cos(angle)])
    network = plane(chain(points, (1e5, 1.0, 1.0, 1.0), {0: PIN, 16: PIN}))
    load = forces(load_at(network, 8, [0.0, 0.0, -1.0]))
    found = critical_load(assemble(network), at_rest(points), load, goal=goal)
    assert found.kind == "bifurcation"
    assert found.factor == pytest.approx(33.4287, rel=1e-5)
    lowered = points[8] - found.equilibrium.state.positions[8]
    assert lowered[2] > 0.0
    assert np.abs(found.mode[8, 2]) < 1e-3, "the crown stays level in the mode: it sways"
