"""What must hold for every model: invariances, statics, and that forces and tangent are the energy's derivatives."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from shellform.structure.beam import make_beams
from shellform.structure.state import State, from_vectors, moved
from shellform.structure.verification.case import Row


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


def turns() -> Iterator[Row]:
    """The internal forces of a beam bent at random don't change when everything turns: to rounding."""
    for angle in (0.1, 1.0, 3.0):
        yield Row("objectivity", f"change of forces after a turn by {angle} rad", turned_forces(angle), 0.0, 1e-9, "invariance")
