"""Co-rotational beams: one energy, its exact gradient, its exact Hessian."""

import numpy as np
import pytest

from shellform.errors import InputError
from shellform.structure.answers.third_derivatives import bilinear, bilinear_by_dof
from shellform.structure.elements.beam import make_beams
from shellform.structure.elements.state import at_rest, from_vectors, moved
from shellform.structure.solve.assembly import Assembly
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


def turned_far(angle, seed):
    """Both ends turned by the angle about axes of their own, the second by two thirds of it."""
    axes = np.random.default_rng(seed).normal(size=(2, 3))
    axes *= (angle / np.linalg.norm(axes, axis=1) * [1.0, 0.66])[:, None]
    return from_vectors(NODES, axes)


STATES = [bent(seed=seed) for seed in range(4)] + [
    turned_far(angle, seed) for angle in (0.8, 1.0, 1.25, 1.6, 2.2, 2.9) for seed in (0, 1)
]


@pytest.mark.parametrize("state", STATES)
def test_end_forces_are_the_gradient_of_the_energy(state):
    h = 1e-5
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


@pytest.mark.parametrize("state", STATES)
def test_the_tangent_is_the_derivative_of_the_end_forces(state):
    h = 1e-5
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


@pytest.mark.parametrize("state", STATES)
def test_derivatives_of_the_local_forces_hold_at_any_angle(state):
    h = 1e-5
    columns = [
        (beam().local_forces(moved(state, unit(k, h))) - beam().local_forces(moved(state, unit(k, -h))))[0]
        / (2 * h)
        for k in range(12)
    ]
    rates = beam().local_forces_by_dof(state)[0]
    np.testing.assert_allclose(np.array(columns).T, rates, atol=1e-6 * np.abs(rates).max())


@pytest.mark.parametrize("state", STATES)
def test_third_derivatives_of_the_energy_hold_at_any_angle(state):
    chance, h = np.random.default_rng(4), 1e-4
    left, right = chance.normal(size=(2, 12, 1))
    way = chance.normal(size=(2, 6))
    whole = Assembly(2, (beam(),), np.zeros((2, 6), dtype=bool))
    found = bilinear_by_dof(whole, state, left, right) @ way.ravel()

    def value(t):
        return bilinear(beam(), moved(state, t * way), left, right)

    expected = (8 * (value(h) - value(-h)) - (value(2 * h) - value(-2 * h))) / (12 * h)
    assert found == pytest.approx(expected, rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize(
    "angles", [(3.0, 0.0), (0.0, -3.1), (1.6, 1.6), (2.9, 1.2), (-2.0, -2.5), (3.0, -3.0)]
)
def test_local_rotations_about_one_axis_are_exact_up_to_180_degrees(axis, angles):
    straight = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    plain = make_beams(straight, [[0, 1]], axial=1.0, torsion=1.0, bending_y=2.0, bending_z=3.0)
    vectors = np.zeros((2, 3))
    vectors[:, axis] = angles
    found = plain.local_deformations(from_vectors(straight, vectors))[0, 1:].reshape(2, 3)
    if axis == 0:  # twist counts between the ends; the element's own roll is half way
        twist = angles[0] - angles[1]
        if abs(twist) < np.pi:  # beyond, the roll half way is told no more
            assert found[0, 0] - found[1, 0] == pytest.approx(twist, abs=1e-9)
    else:
        expected = np.zeros((2, 3))
        expected[:, axis] = np.array(angles) * (-1.0 if axis == 1 else 1.0)
        np.testing.assert_allclose(found, expected, atol=1e-12)


def test_a_reversed_element_stores_energy():
    plain = make_beams([[0, 0, 0], [1, 0, 0]], [[0, 1]], axial=1.0, torsion=1.0, bending_y=2.0, bending_z=2.0)
    reversed_ = at_rest(np.array([[0.0, 0.0, 0.0], [-1.0, 1e-9, 0.0]]))
    found = plain.evaluate(reversed_, tangent=False)
    assert found.turned == pytest.approx(np.pi)
    assert found.energy[0] == pytest.approx(
        6.0 * 2.0 * np.pi**2
    )  # both ends turned by 180 degrees: 6 EI t²/l


def test_beams_without_length_or_with_bad_stiffness_or_axis_are_refused():
    with pytest.raises(InputError, match="coincide"):
        make_beams([[0, 0, 0], [0, 0, 0]], [[0, 1]], axial=1, torsion=1, bending_y=1, bending_z=1)
    with pytest.raises(InputError, match="above zero"):
        make_beams(NODES, [[0, 1]], axial=-1, torsion=1, bending_y=1, bending_z=1)
    with pytest.raises(InputError, match="along the beam"):
        make_beams(NODES, [[0, 1]], axial=1, torsion=1, bending_y=1, bending_z=1, z_axis=NODES[1:])
    with pytest.raises(InputError, match="out of range"):
        make_beams(NODES, [[0, 2]], axial=1, torsion=1, bending_y=1, bending_z=1)


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
def test_a_z_axis_is_along_the_beam_within_a_billionth_whatever_its_length(size):
    nodes = np.array([[1.0, 2.0, 3.0], [1.0, 4.0, 3.0]])

    def made(off):
        return make_beams(
            nodes,
            [[0, 1]],
            axial=1,
            torsion=1,
            bending_y=1,
            bending_z=1,
            z_axis=size * np.array([[0, 1.0, off]]),
        )

    with pytest.raises(InputError, match="zero or along the beam"):
        made(0.8e-9)
    frame = made(1.2e-9).frames[0, 0]
    np.testing.assert_allclose(frame, [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-6)


def test_the_one_beam_whose_nodes_coincide_is_named_with_them():
    nodes = [[1.0, 2.0, 3.0], [1.0, 4.0, 3.0], [1.0, 4.0, 3.0]]
    with pytest.raises(InputError, match="two nodes of the beam coincide") as told:
        make_beams(nodes, [[0, 1], [2, 1]], axial=1, torsion=1, bending_y=1, bending_z=1)
    assert (told.value.where, told.value.value) == ("beams[1]", [2, 1])


def test_without_a_z_axis_it_is_the_global_one_and_in_upright_beams_global_x():
    nodes = [[0, 0, 0], [0, 0, 2.0], [1.6e-6, 0, 0], [0, 2.4e-6, 0], [1.0, 0, 0.5]]
    ends = [[0, 1], [1, 2], [1, 3], [0, 4]]
    frames = make_beams(nodes, ends, axial=1, torsion=1, bending_y=1, bending_z=1).frames[:, 0]
    for k, z in ((0, [1, 0, 0]), (1, [1, 0, 0]), (2, [0, 1, 0])):
        np.testing.assert_allclose(frames[k, :, 2], z, atol=1e-5)
    np.testing.assert_allclose(frames[3, :, 2], np.array([-0.5, 0.0, 1.0]) / np.sqrt(1.25), atol=1e-12)


def test_the_one_beam_whose_z_axis_lies_along_it_is_named():
    nodes = [[1.0, 2.0, 3.0], [1.0, 4.0, 3.0], [1.0, 4.0, 6.0]]
    with pytest.raises(InputError, match="z_axis is zero or along the beam") as told:
        make_beams(
            nodes,
            [[0, 1], [1, 2]],
            axial=1,
            torsion=1,
            bending_y=1,
            bending_z=1,
            z_axis=[[0, 0, 1], [0, 0, -2]],
        )
    assert (told.value.where, told.value.value) == ("beams[1]", [0.0, 0.0, -2.0])
