"""What must hold of every network: objectivity, forces as gradient and tangent as derivative, and exact model
files.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shellform.structure.elements import rotation
from shellform.structure.elements.beam import make_beams
from shellform.structure.elements.cable import make_cables
from shellform.structure.elements.state import State, from_vectors, moved
from shellform.structure.model import Model, read_model, write_model
from shellform.structure.network import Network
from shellform.structure.solve.assembly import Assembly

few = settings(max_examples=15, deadline=None)
seeds = st.integers(0, 2**32 - 1)
sizes = st.floats(0.0, 1.0)
vectors = st.tuples(*[st.floats(-2.0, 2.0)] * 3).map(np.array)


@st.composite
def networks(draw):
    """Beams along a chain and across it, cables taut and slack, bent and turned: beams, cables, all degrees
    of freedom free, a state.
    """
    chance, count, bend = np.random.default_rng(draw(seeds)), draw(st.integers(3, 9)), draw(sizes)
    nodes = np.column_stack([np.arange(count), np.zeros((count, 2))]) + 0.3 * chance.uniform(
        -1.0, 1.0, (count, 3)
    )
    ends = [[k, k + 1] for k in range(count - 1)] + [[k, k + 2] for k in range(0, count - 2, 2)]
    stiffness = {
        name: chance.uniform(0.5, 20.0, len(ends)) for name in ("axial", "torsion", "bending_y", "bending_z")
    }
    beams = make_beams(nodes, ends, z_axis=[[0.1, 0.2, 1.0]] * len(ends), **stiffness)
    state = from_vectors(
        nodes + 0.1 * bend * chance.normal(size=nodes.shape), 0.4 * bend * chance.normal(size=nodes.shape)
    )
    tied = np.array([[0, count - 1], [0, 2], [1, count - 1]])
    lengths = np.linalg.norm(np.diff(state.positions[tied], axis=1)[:, 0], axis=1)
    # Well taut or well slack: at the corner between them there is no derivative.
    rest = lengths * np.where(
        chance.random(3) < 0.5, chance.uniform(0.6, 0.95, 3), chance.uniform(1.05, 1.4, 3)
    )
    cables = make_cables(tied, rest_length=rest, stiffness=chance.uniform(1.0, 50.0, 3))
    return nodes, beams, cables, state


def assembly(network):
    nodes, beams, cables, _ = network
    return Assembly(len(nodes), [beams, cables], np.zeros((len(nodes), 6), dtype=bool))


def derivative(value, h=1e-5):
    """Of `value(t)` at 0 to the fourth order: where chords are turned half round, forces bend within any
    step."""
    return (8.0 * (value(h) - value(-h)) - (value(2 * h) - value(-2 * h))) / (12.0 * h)


@few
@given(networks(), vectors, vectors)
def test_a_rigid_body_motion_leaves_energy_and_local_forces_and_turns_the_nodal_ones(network, spin, shift):
    _, beams, cables, state = network
    turn = rotation.matrices(rotation.from_vectors(spin[None]))[0]
    spins = np.hstack([np.zeros_like(state.positions), np.tile(spin, (len(state.positions), 1))])
    other = State(state.positions @ turn.T + shift, moved(state, spins).quaternions)
    before, after = (
        assembly(network).evaluate(state, tangent=False),
        assembly(network).evaluate(other, tangent=False),
    )
    scale = max(before.largest, 1.0)
    assert after.energy == pytest.approx(before.energy, rel=1e-10, abs=1e-12)
    np.testing.assert_allclose(beams.local_forces(other), beams.local_forces(state), atol=1e-11 * scale)
    np.testing.assert_allclose(cables.tension(other), cables.tension(state), atol=1e-11 * scale)
    turned = np.hstack([before.force[:, :3] @ turn.T, before.force[:, 3:] @ turn.T])
    np.testing.assert_allclose(after.force, turned, atol=1e-11 * scale)


@few
@given(networks())
def test_internal_forces_are_in_balance_as_a_whole(network):
    state = network[-1]
    found = assembly(network).evaluate(state, tangent=False)
    force, moment = found.force[:, :3], found.force[:, 3:]
    np.testing.assert_allclose(force.sum(axis=0), 0.0, atol=1e-11 * max(found.largest, 1.0))
    about = moment + np.cross(state.positions, force)
    np.testing.assert_allclose(about.sum(axis=0), 0.0, atol=1e-10 * max(found.largest, 1.0))


@few
@given(networks(), seeds)
def test_nodal_forces_are_the_gradient_of_the_energy_of_the_network(network, seed):
    state, whole = network[-1], assembly(network)
    motion = np.random.default_rng(seed).uniform(-1.0, 1.0, (len(state.positions), 6))
    found = derivative(lambda t: whole.evaluate(moved(state, t * motion), tangent=False).energy)
    balance = whole.evaluate(state, tangent=False)
    assert found == pytest.approx((balance.force * motion).sum(), abs=1e-6 * max(balance.largest, 1.0))


@few
@given(networks(), seeds)
def test_the_tangent_of_the_network_is_symmetric_and_the_derivative_of_its_forces(network, seed):
    state, whole = network[-1], assembly(network)
    one, two = np.random.default_rng(seed).uniform(-1.0, 1.0, (2, len(state.positions), 6))
    along = whole.force_along(state, one)
    assert (two * along).sum() == pytest.approx(
        (one * whole.force_along(state, two)).sum(), rel=1e-10, abs=1e-9
    )
    # Spins don't commute: the module's docstring of beams.
    expected = along.copy()
    expected[:, 3:] -= 0.5 * np.cross(whole.evaluate(state, tangent=False).force[:, 3:], one[:, 3:])
    found = derivative(lambda t: whole.evaluate(moved(state, t * one), tangent=False).force)
    np.testing.assert_allclose(found, expected, atol=1e-6 * max(np.abs(expected).max(), 1.0))


@few
@given(networks(), seeds, st.text(max_size=20))
def test_model_files_give_back_every_number(tmp_path_factory, network, seed, name):
    nodes, beams, cables, state = network
    chance = np.random.default_rng(seed)
    fixed = np.zeros((len(nodes), 6), dtype=bool)
    imposed = np.zeros((len(nodes), 6))
    fixed[0], imposed[0] = True, chance.normal(size=6) * 10.0 ** chance.integers(-300, 29, 6)
    load = chance.normal(size=(len(nodes), 6)) * 10.0 ** chance.integers(-300, 29, (len(nodes), 6))
    model = Model(Network(nodes, beams, cables, fixed, imposed), {name: load}, state, (0,))
    file = tmp_path_factory.mktemp("model") / "model.json"
    write_model(file, model)
    again = read_model(file)
    for part, names in (
        ("beams", ("ends", "axial", "torsion", "bending_y", "bending_z", "rest_length")),
        ("cables", ("ends", "stiffness", "rest_length")),
    ):
        for each in names:
            np.testing.assert_array_equal(
                getattr(getattr(again.network, part), each), getattr(getattr(model.network, part), each), each
            )
    for each in ("nodes", "fixed", "imposed"):
        np.testing.assert_array_equal(getattr(again.network, each), getattr(model.network, each), each)
    np.testing.assert_array_equal(again.loads[name], load)
    np.testing.assert_array_equal(again.start.positions, state.positions)
    np.testing.assert_allclose(
        again.network.beams.frames, beams.frames, atol=1e-15
    )  # made orthonormal as they are read
    np.testing.assert_allclose(again.start.rotations, state.rotations, atol=1e-14)
    assert again.supported == (0,)
