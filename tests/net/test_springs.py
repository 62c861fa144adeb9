"""Sliding springs: forces and stiffness of two nodes pulled to spheres, held against their energy."""

import numpy as np
import pytest

from shellform.errors import InputError
from shellform.net.springs import SlidingSprings
from shellform.structure.elements.state import at_rest

PLACES = np.array([[0.5, 0.2, 0.1], [1.2, -0.3, 0.8], [9.0, 9.0, 9.0], [-0.4, 0.9, 0.3]])


def sphere(points):
    """Of radius 1 about the origin."""
    size = np.linalg.norm(points, axis=1)
    normal = points / size[:, None]
    hessian = (np.eye(3) - normal[:, :, None] * normal[:, None]) / size[:, None, None]
    return size - 1.0, normal, hessian[:, *np.tril_indices(3)]


SPRINGS = SlidingSprings(np.array([3, 1]), np.array([20.0, 50.0]), np.array([0.05, -0.02]), sphere)


def test_springs_pull_their_own_nodes_by_density_times_the_height_over_their_level():
    state = at_rest(PLACES)
    size = np.linalg.norm(PLACES[[3, 1]], axis=1)
    assert SPRINGS.dofs().tolist() == [[18, 19, 20], [6, 7, 8]]
    assert SPRINGS.stretch(state) == pytest.approx(size - [1.05, 0.98])
    found = SPRINGS.evaluate(state, tangent=False)
    assert found.tangent is None
    assert found.energy == pytest.approx([10.0 * (size[0] - 1.05) ** 2, 25.0 * (size[1] - 0.98) ** 2])
    wanted = np.array([20.0, 50.0])[:, None] * (size - [1.05, 0.98])[:, None] * PLACES[[3, 1]] / size[:, None]
    assert found.force == pytest.approx(wanted)


def test_forces_are_the_slope_of_the_energy_and_the_stiffness_is_that_of_the_forces():
    step, into = 1e-6, np.full((2, 6), 7.0)
    found = SPRINGS.evaluate(at_rest(PLACES), tangent=True, into=into)
    assert found.tangent is into
    for k in range(3):
        plus, minus = (
            SPRINGS.evaluate(at_rest(PLACES + s * step * np.eye(3)[k]), tangent=True) for s in (1.0, -1.0)
        )
        assert found.force[:, k] == pytest.approx((plus.energy - minus.energy) / (2 * step), rel=1e-6)
        column = [
            np.flatnonzero((i == max(k, m)) & (j == min(k, m)))[0]
            for m in range(3)
            for i, j in [np.tril_indices(3)]
        ]
        slope = (plus.force - minus.force) / (2 * step)
        assert found.tangent[:, column] == pytest.approx(slope, rel=1e-6, abs=1e-6)


def test_springs_without_density_are_refused():
    with pytest.raises(InputError, match=r"springs\.density"):
        SlidingSprings(np.array([3, 1]), np.array([20.0, 0.0]), np.zeros(2), sphere)
