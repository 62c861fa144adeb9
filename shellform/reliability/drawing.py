"""Structures as built, drawn by chance: from independent normal variables z to elements, supports and loads.

Each cause of error has variables of its own, numbered by what is made (a rod, a crossing, a candidate cable),
whatever the design: so two designs are drawn with the same errors, and a structure keeps its own while the
design changes. The variables of structure `number` under `seed` come from a counter-based generator (Philox,
Salmon et al. 2011) at a counter made of number and cause: the same bits whatever else is drawn, in whichever
order and on however many threads.

What errors do to the stress-free state. Marks: with errors e_0 .. e_q along a rod, the segment between two
marks is longer by e_{i+1} - e_i, its elements in proportion; the rod stays straight, so that no frame
changes. A tape that is off by a share lengthens all segments of a rod by it. A rod's own arc of rise b L has
the curvature k = 8 b / L; clamps are tightened on rods held straight in the flat grid, so that connectors
keep their frames and the axes at the ends of the rod's elements are turned: with the curvature k (a vector
across the axis, in the axes of the stress-free state) an element of length l has its ends turned by -k l / 2
and k l / 2 against its chord when nothing bends it, so that

    F_a' = R(k l / 2) F_a,   F_b' = R(-k l / 2) F_b.

A shape v (n, 6) of amplitude 1 imposed without stress: with the unloaded state of the perfect structure moved
along v, every element keeps its deformations,

    l0' = l0 + l' - l,   F_a' = Q_a'⁻¹ G Q_a F_a,

G the turn of its chord, so that its forces there are those of the perfect structure, turned with it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from shellform.arrays import Reals, Record, reals
from shellform.errors import require_count
from shellform.gridshell.tolerances import Tolerances
from shellform.reliability.members import Members
from shellform.structure.elements import rotation
from shellform.structure.elements.beam import Beams
from shellform.structure.elements.cable import Cables
from shellform.structure.elements.state import State, moved

PERFECT = -1  # the number of the structure without errors
SOFT_MODES = 3  # softest modes in which the shape is off
_LEAST = 0.2  # of an element's length is left to it by errors of marks
_LEAST_CABLE = 0.05  # of a cable's rest length


@dataclass(frozen=True, eq=False)
class Errors(Record):
    """What one structure is off by: `cable_length` (c,) m and `cable_stiffness` (c,) factors of all candidate
    cables, `supports` (n, 6) m, `beam_length` (m,) m, `beam_stiffness` (m,) factors, `beam_curvature` (m, 2)
    1/m about each beam's local y and z axes, `load` (n,) factors, `shape` (k,) m, the amplitudes of the
    softest modes."""

    cable_length: Reals
    cable_stiffness: Reals
    supports: Reals
    beam_length: Reals
    beam_stiffness: Reals
    beam_curvature: Reals
    load: Reals
    shape: Reals


@dataclass(frozen=True, eq=False)
class Imperfections(Record):
    """Shapes (k, n, 6), the largest translation of each 1, and the unloaded `state` on which they are
    imposed.
    """

    state: State
    shapes: Reals


def sizes(members: Members) -> dict[str, int]:
    """How many variables each cause has."""
    rods = len(members.rods)
    return {
        "cable_length": members.cables,
        "cable_stiffness": members.cables,
        "supports": len(members.held),
        "marks": sum(len(rod.marks) for rod in members.rods),
        "rod_stiffness": rods,
        "rod_bow": 2 * rods,
        "connectors": len(members.connectors),
        "load_each": members.zones,
        "load_all": 1,
        "load_uneven": 2,
        "shape": SOFT_MODES,
        "cable_stiffness_all": 1,
        "connectors_all": 1,
        "tape": rods,
    }


def variables(members: Members, seed: int, number: int) -> dict[str, Reals]:
    """The standard normal variables of structure `number`, by cause. Raises InputError for negative
    numbers.
    """
    for name, value in (("seed", seed), ("number", number)):
        require_count(value, least=0, most=2**63 - 1, where=name, give="a whole number, such as 1")
    return {
        name: np.random.Generator(
            np.random.Philox(key=np.array([seed, 0], np.uint64), counter=[0, 0, cause, number])
        ).standard_normal(count)
        for cause, (name, count) in enumerate(sizes(members).items())
    }


def errors_of(members: Members, tolerances: Tolerances, z: Mapping[str, Reals]) -> Errors:
    """The errors that standard normal variables stand for, linear in them but for stiffnesses, exp(s z)."""
    t = tolerances
    supports = np.zeros(6 * len(members.places))
    supports[members.held] = t.supports * z["supports"]
    length, stiffness = np.zeros(len(members.beam_length)), np.ones(len(members.beam_length))
    curvature = np.zeros((len(members.beam_length), 2))
    stiffness[members.connectors] = np.exp(
        t.connectors * z["connectors"] + t.connectors_all * z["connectors_all"]
    )
    made = members.rod_elements
    off = np.diff(t.marks * z["marks"][made.marks], axis=1)[:, 0]
    longer = np.maximum(off / made.segment_length + t.tape * z["tape"][made.segment_rod], _LEAST - 1.0)
    length[made.elements] = longer[made.segment] * members.beam_length[made.elements]
    stiff = np.exp(t.rod_stiffness * z["rod_stiffness"])
    stiffness[made.elements], stiffness[made.locks] = stiff[made.rod], stiff[made.locked]
    bow = (8.0 * t.rod_bow / made.rod_length)[:, None] * z["rod_bow"].reshape(-1, 2)
    # An element that runs against the rod has its local y axis turned round and goes the other way.
    curvature[made.elements] = bow[made.rod]
    curvature[made.elements, 1] *= made.sense
    return Errors(
        cable_length=t.cable_length * z["cable_length"],
        cable_stiffness=np.exp(
            t.cable_stiffness * z["cable_stiffness"] + t.cable_stiffness_all * z["cable_stiffness_all"]
        ),
        supports=supports.reshape(-1, 6),
        beam_length=length,
        beam_stiffness=stiffness,
        beam_curvature=curvature,
        load=_load_factors(members, t, z),
        shape=t.shape * members.span * z["shape"],
    )


def errors_by_cause(
    members: Members, tolerances: Tolerances, seed: int, numbers: Iterable[int]
) -> dict[str, list[Errors]]:
    """By cause that isn't left out, what structures with these numbers are off by where no other cause is."""
    z = [variables(members, seed, number) for number in numbers]
    return {
        name: [errors_of(members, tolerances.only(name), each) for each in z] for name in tolerances.causes
    }


def draw_errors(members: Members, tolerances: Tolerances, seed: int, number: int) -> Errors:
    """The errors of a structure under the seed; of number PERFECT none."""
    if number == PERFECT:
        return errors_of(members, Tolerances(), variables(members, seed, 0))
    return errors_of(members, tolerances, variables(members, seed, number))


def built_beams(nominal: Beams, errors: Errors, imperfections: Imperfections | None = None) -> Beams:
    """The beams with the errors."""
    factor = errors.beam_stiffness
    built = replace(
        nominal,
        axial=nominal.axial * factor,
        torsion=nominal.torsion * factor,
        bending_y=nominal.bending_y * factor,
        bending_z=nominal.bending_z * factor,
        rest_length=nominal.rest_length + errors.beam_length,
    )
    if errors.beam_curvature.any():
        curvature = np.einsum("eij,ej->ei", nominal.frames[:, 0, :, 1:], errors.beam_curvature)
        half = 0.5 * built.rest_length[:, None] * curvature
        built = _turned_ends(built, rotation.from_vectors(half), rotation.from_vectors(-half))
    return built if imperfections is None or not errors.shape.any() else _shaped(built, errors, imperfections)


def built_cables(
    nominal: Cables, present: np.ndarray, errors: Errors, imperfections: Imperfections | None = None
) -> Cables:
    """The cables with the errors of those among the candidates that are `present` (c,) flags."""
    rest = nominal.rest_length + errors.cable_length[present]
    if imperfections is not None and errors.shape.any():
        rest = rest + nominal.lengths(_off(errors, imperfections)) - nominal.lengths(imperfections.state)
    return replace(
        nominal,
        rest_length=np.maximum(rest, _LEAST_CABLE * nominal.rest_length),
        stiffness=nominal.stiffness * errors.cable_stiffness[present],
    )


def built_load(load: Reals, errors: Errors) -> Reals:
    """The dead load (n, 6) with the errors."""
    return np.asarray(load * errors.load[:, None])


def _load_factors(members: Members, t: Tolerances, z: Mapping[str, Reals]) -> Reals:
    """Factors (n,): each crossing's own, the whole, and one half against the other."""
    each = 1.0 + t.load_each * z["load_each"][members.zone]
    uneven = 1.0 + t.load_uneven * members.halves @ z["load_uneven"]
    return np.asarray(each * uneven * (1.0 + t.load_all * float(z["load_all"][0])))


def _off(errors: Errors, imperfections: Imperfections) -> State:
    step = np.einsum("k,knj->nj", errors.shape, imperfections.shapes)
    return moved(imperfections.state, step)


def _turned_ends(beams: Beams, first: Reals, second: Reals) -> Beams:
    """The beams with the axes at their ends turned by quaternions (m, 4)."""
    turns = np.stack([rotation.matrices(first), rotation.matrices(second)], axis=1)
    return replace(beams, frames=turns @ beams.frames)


def _shaped(beams: Beams, errors: Errors, imperfections: Imperfections) -> Beams:
    before, after = imperfections.state, _off(errors, imperfections)
    a, b = beams.ends.T
    chord, moved_chord = (state.positions[b] - state.positions[a] for state in (before, after))
    length, other = np.linalg.norm(chord, axis=1), np.linalg.norm(moved_chord, axis=1)
    # The turn of the chord, and along it the mean of what the ends spin.
    step = np.einsum("k,knj->nj", errors.shape, imperfections.shapes)
    unit = moved_chord / other[:, None]
    spun = np.einsum("ei,ei->e", unit, 0.5 * (step[a, 3:] + step[b, 3:]))
    turn = rotation.turned(
        np.ascontiguousarray(spun[:, None] * unit), _between(chord / length[:, None], unit)
    )
    ends = []
    for node in (a, b):
        back = after.quaternions[node] * np.array([1.0, -1.0, -1.0, -1.0])
        ends.append(rotation.product(back, rotation.product(turn, before.quaternions[node])))
    longer = reals("rest_length", beams.rest_length + other - length, (None,))
    return _turned_ends(replace(beams, rest_length=longer), *ends)


def _between(unit: Reals, other: Reals) -> Reals:
    """Quaternions (m, 4) of the smallest turn from unit vectors (m, 3) to others less than pi away."""
    found = np.column_stack([1.0 + np.einsum("ei,ei->e", unit, other), np.cross(unit, other)])
    return np.asarray(found / np.linalg.norm(found, axis=1, keepdims=True))
