"""Co-rotational beams: one energy, its exact gradient, its exact Hessian."""

import numpy as np
import pytest

from shellform.errors import InputError
from shellform.structure.elements.beam import make_beams
from shellform.structure.elements.state import at_rest, from_vectors, moved
from shellform.verification import turned_forces

NODES = np.array([[0.0, 0.0, 0.0], [1.0, 0.2, 0.1]])


def beam():
    return make_beams(
        NODES, [[0, 1]], axial=50.0, torsion=2.0, bending_y=3.0, bending_z=5.0, z_axis=[[0.1, 0.2, 1.0]]
    )


def bent(size=0.4, seed=0):
    rng = np.random.default_rng(seed)
    return from_vectors(NODES + 0.1 * rng.normal(size=(2, 3)), size * rng.normal(size=(2, 3)))


def unit(k, size):
    step = np.zeros((2, 6))
    step.flat[k] = size
    return step


def skew(m):
    return np.array([[0, -m[2], m[1]], [m[2], 0, -m[0]], [-m[1], m[0], 0]])


@pytest.mark.parametrize("seed", range(4))
def test_end_forces_are_the_gradient_of_the_energy(seed):
    state, h = bent(seed=seed), 1e-5
    force = beam().evaluate(state, tangent=False).force[0]
    energy = [
        (
            beam().evaluate(moved(state, unit(k, h)), tangent=False).energy[0]
            - beam().evaluate(moved(state, unit(k, -h)), tangent=False).energy[0]
        )
        / (2 * h)
        for k in range(12)
    ]
    np.testing.assert_allclose(energy, force, atol=1e-7 * np.abs(force).max())


@pytest.mark.parametrize("seed", range(4))
def test_the_tangent_is_the_derivative_of_the_end_forces(seed):
    state, h = bent(seed=seed), 1e-5
    result = beam().evaluate(state, tangent=True)
    tangent = np.zeros((12, 12))
    tangent[np.tril_indices(12)] = result.tangent[0]
    tangent += np.tril(tangent, -1).T
    for block in (slice(3, 6), slice(9, 12)):  # spins don't commute: the module's docstring
        tangent[block, block] -= 0.5 * skew(result.force[0, block])
    columns = [
        (
            beam().evaluate(moved(state, unit(k, h)), tangent=False).force[0]
            - beam().evaluate(moved(state, unit(k, -h)), tangent=False).force[0]
        )
        / (2 * h)
        for k in range(12)
    ]
    np.testing.assert_allclose(np.array(columns).T, tangent, atol=1e-7 * np.abs(tangent).max())


def test_the_energy_s_second_order_expansion_has_a_third_order_remainder():
    state = bent()
    direction = np.random.default_rng(3).normal(size=(2, 6))
    result = beam().evaluate(state, tangent=True)
    hessian = np.zeros((12, 12))
    hessian[np.tril_indices(12)] = result.tangent[0]
    hessian += np.tril(hessian, -1).T
    d = direction.ravel()
    rests = []
    for t in (2e-2, 1e-2):
        energy = beam().evaluate(moved(state, t * direction), tangent=False).energy[0]
        rests.append(energy - result.energy[0] - t * result.force[0] @ d - 0.5 * t * t * d @ hessian @ d)
    assert 2.7 < np.log2(abs(rests[0] / rests[1])) < 3.3


def test_no_rotation_gives_no_force_to_rounding():
    force = beam().evaluate(at_rest(NODES), tangent=False).force
    assert np.abs(force).max() < 1e-14


@pytest.mark.parametrize("angle", [0.1, 1.0, 3.0])
def test_turning_everything_leaves_the_internal_forces_unchanged(angle):
    assert turned_forces(angle) < 1e-9


def test_a_turn_about_the_local_y_axis_counts_negative_as_in_equation_12():
    straight = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    plain = make_beams(straight, [[0, 1]], axial=1.0, torsion=1.0, bending_y=1.0, bending_z=1.0)
    turned = from_vectors(straight, [[0.0, 0.1, 0.0], [0.0, 0.0, 0.0]])
    assert plain.local_deformations(turned)[0, 2] == pytest.approx(-0.1, abs=1e-12)
    turned = from_vectors(straight, [[0.0, 0.0, 0.1], [0.0, 0.0, 0.0]])
    assert plain.local_deformations(turned)[0, 3] == pytest.approx(0.1, abs=1e-12)


def test_beams_without_length_or_with_bad_stiffness_or_axis_are_refused():
    with pytest.raises(InputError, match="coincide"):
        make_beams([[0, 0, 0], [0, 0, 0]], [[0, 1]], axial=1, torsion=1, bending_y=1, bending_z=1)
    with pytest.raises(InputError, match="above zero"):
        make_beams(NODES, [[0, 1]], axial=-1, torsion=1, bending_y=1, bending_z=1)
    with pytest.raises(InputError, match="along the beam"):
        make_beams(NODES, [[0, 1]], axial=1, torsion=1, bending_y=1, bending_z=1, z_axis=NODES[1:])
    with pytest.raises(InputError, match="out of range"):
        make_beams(NODES, [[0, 2]], axial=1, torsion=1, bending_y=1, bending_z=1)
