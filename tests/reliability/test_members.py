"""Which beams of a model file are one rod, in which sense, and where it is marked; and the box round it."""

from types import SimpleNamespace

import numpy as np
import pytest

from shellform.plan_rectangle import longest_side
from shellform.reliability.members import members_of_model, zones_of
from shellform.structure.elements.beam import make_beams
from shellform.structure.elements.cable import make_cables
from shellform.structure.elements.state import at_rest
from shellform.structure.model import Model
from shellform.structure.network import Network

# A rod of four elements along x, bent by 30 degrees at its last node but one, and one across it that a
# connector joins.
PLACES = np.array(
    [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [2.0, 0.0, 0.0],
        [3.0, 0.0, 0.0],
        [3.0 + np.sqrt(0.75), 0.5, 0.0],
        [1.0, 0.0, 0.25],
        [1.0, 2.0, 0.25],
        [1.0, 3.5, 0.25],
    ]
)
ENDS = [[2, 1], [0, 1], [2, 3], [3, 4], [1, 5], [7, 6], [5, 6]]
KIND = [0, 0, 0, 0, 1, 0, 0]


def model_of(places=PLACES, ends=ENDS, kind=KIND, cables=((2, 6),), start=True, held=((0, (0, 1, 2)),)):
    beams = make_beams(
        places,
        ends,
        axial=1e5,
        torsion=1.0,
        bending_y=1.0,
        bending_z=2.0,
        kind=kind,
        kinds=("rod", "connector"),
    )
    strings = make_cables(np.array(cables).reshape(-1, 2), rest_length=1.0, stiffness=1.0)
    fixed = np.zeros((len(places), 6), dtype=bool)
    for node, dofs in held:
        fixed[node, list(dofs)] = True
    network = Network(places, beams, strings, fixed, np.zeros((len(places), 6)))
    state = at_rest(places * [1.0, 1.0, 2.0] + [0.0, 0.0, 5.0]) if start else None
    return Model(network, {"load": np.zeros((len(places), 6))}, state, (0,))


def rods_of(model):
    found = members_of_model(model).rods
    return [(rod.elements.tolist(), rod.sense.tolist(), rod.marks.tolist()) for rod in found]


def test_a_rod_goes_on_straight_through_elements_of_either_sense_and_ends_at_a_bend():
    """It begins on the side on which its beam with the lowest number does, is marked where a connector, a
    cable or a support touches it, and at its ends."""
    assert rods_of(model_of()) == [
        ([2, 0, 1], [-1.0, 1.0, -1.0], [0, 1, 2, 3]),
        ([3], [1.0], [0, 1]),
        ([5, 6], [1.0, -1.0], [0, 1, 2]),
    ]
    assert rods_of(model_of(cables=()))[0][-1] == [0, 2, 3]
    assert rods_of(model_of(cables=()))[2][-1] == [0, 2], "nothing touches it on its way"
    assert rods_of(model_of(cables=(), held=((2, (5,)),)))[0][-1] == [0, 1, 2, 3], (
        "a support that holds a turn"
    )


@pytest.mark.parametrize(("degrees", "one"), [(8.0, True), (8.2, False)])
def test_elements_are_of_one_rod_up_to_a_cosine_of_0_99_between_them(degrees, one):
    turn = np.deg2rad(degrees)
    places = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0 + np.cos(turn), 0.0, np.sin(turn)]])
    for ends in ([[0, 1], [1, 2]], [[0, 1], [2, 1]], [[1, 0], [1, 2]], [[1, 0], [2, 1]]):
        model = model_of(places, ends, [0, 0], cables=())
        assert len(members_of_model(model).rods) == (1 if one else 2)


def test_where_three_beams_meet_none_goes_on_and_a_ring_ends_where_it_began():
    places = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [1.0, 1.0, 0.0]])
    star = model_of(places, [[0, 1], [1, 2], [1, 3]], [0, 0, 0], cables=())
    assert [elements for elements, *_ in rods_of(star)] == [[0], [1], [2]]
    count = 60  # six degrees from one to the next
    angle = 2.0 * np.pi * np.arange(count) / count
    ring = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(count)])
    ends = [[k, (k + 1) % count] for k in range(count)]
    ((elements, sense, marks),) = rods_of(model_of(ring, ends, [0] * count, cables=(), held=()))
    assert sorted(elements) == list(range(count))
    assert (set(sense), marks) == ({1.0}, [0, count])


def test_a_model_s_supports_are_held_in_their_translations_and_each_node_is_a_zone():
    found = members_of_model(model_of(held=((0, (0, 2, 3)), (7, (1, 4, 5)))))
    assert found.held.tolist() == [0, 2, 6 * 7 + 1]
    assert (found.connectors.tolist(), found.cables, found.zones) == ([4], 1, 8)
    assert found.zone.tolist() == list(range(8))
    assert found.beam_length == pytest.approx([1.0, 1.0, 1.0, 1.0, 0.25, 1.5, 2.0])


def test_the_span_is_the_longest_side_of_the_box_round_the_start_or_without_one_round_the_nodes():
    found = members_of_model(model_of())
    assert found.places[:, 2].max() == pytest.approx(5.5)
    assert found.span == longest_side(found.places) == pytest.approx(4.149, abs=1e-3), (
        "along the slanting rod"
    )
    tall = model_of(PLACES * [1.0, 1.0, 20.0], start=False)
    assert members_of_model(tall).span == pytest.approx(5.0)


def test_a_node_s_load_is_counted_to_the_crossing_that_is_nearest_on_the_flat_grid():
    """The first crossing's rods lie on each other, the second's 1 apart in plan, its middle at 2.5."""
    flat = np.array(
        [
            [0.0, 0.0, 0.0],
            [0.0, 0.0, 1.0],
            [3.0, 1.0, 0.0],
            [2.0, 1.0, 1.0],
            [1.2, 0.5, 0.0],
            [1.4, 0.5, 9.0],
        ]
    )
    rods = [SimpleNamespace(nodes=np.array([0, 2, 4])), SimpleNamespace(nodes=np.array([5, 1, 3]))]
    grid = SimpleNamespace(flat=flat, rods=rods, crossing_nodes=np.array([[0, 1], [2, 3]]))
    target = SimpleNamespace(positions=np.zeros((6, 3)))
    shell = SimpleNamespace(net=SimpleNamespace(grid=grid), target=target)
    assert zones_of(shell).tolist() == [0, 0, 1, 1, 0, 1]
