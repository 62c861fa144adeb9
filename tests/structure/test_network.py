"""What a network is refused or doubted for: drifting parts, and stiffnesses, lengths and spins that are
rarely meant."""

import re
from dataclasses import replace

import numpy as np
import pytest

from shellform.errors import InputError
from shellform.quantities import number
from shellform.structure.elements.beam import built_in, joined, make_beams
from shellform.structure.elements.cable import make_cables
from shellform.structure.elements.state import at_rest
from shellform.structure.network import Network, check_restrained, doubts, swinging

ALL = [True] * 6
STIFF = (3.0e6, 1.0, 2.0, 3.0)  # EA, GJ, EI_y, EI_z


def network(nodes, rods=(), cables=(), held=(), *, stiffness=STIFF, rest=None, tie=(0.5, 187.0)):
    place = np.asarray(nodes, dtype=float)
    values = np.broadcast_to(np.asarray(stiffness, dtype=float), (len(rods), 4))
    ends = np.array(rods, dtype=int).reshape(-1, 2)
    beams = make_beams(
        place, ends, axial=values[:, 0], torsion=values[:, 1], bending_y=values[:, 2], bending_z=values[:, 3],
        rest_length=rest,
    )  # fmt: skip
    ties = make_cables(np.array(cables, dtype=int).reshape(-1, 2), rest_length=tie[0], stiffness=tie[1])
    fixed = np.zeros((len(place), 6), dtype=bool)
    for node, how in dict(held).items():
        fixed[node] = how
    return Network(place, beams, ties, fixed, np.zeros((len(place), 6)))


def along(*places):
    """Nodes on a rod of no global direction, away from the origin."""
    return np.array([3.0, -2.0, 1.0]) + np.outer(places, [1.0, 2.0, 0.0])


def test_an_element_to_a_node_that_isn_t_there_is_named_with_both_its_ends():
    sound = network(along(0, 1, 2), [[0, 1], [1, 2]], [[0, 1], [0, 2]])
    for name in ("beams", "cables"):
        part = getattr(sound, name)
        with pytest.raises(InputError, match="out of range") as told:
            replace(sound, **{name: replace(part, ends=np.array([[0, 2], [0, 3]]))})
        assert (told.value.where, told.value.value) == (f"{name}[1]", [0, 3])


def test_a_node_that_nothing_touches_is_named_unless_it_is_held_along_all_axes():
    nodes = [*along(0, 1), [7.0, 7.0, 7.0]]
    for how in ([True, True, False, True, True, True], [False] * 6):
        with pytest.raises(InputError, match="no element touches") as told:
            check_restrained(network(nodes, [[0, 1]], held={0: ALL, 2: how}))
        assert told.value.where == "nodes[2]"
    check_restrained(network(nodes, [[0, 1]], held={0: ALL, 2: [True] * 3 + [False] * 3}))


def test_a_part_that_could_drift_off_is_told_with_its_size_its_first_node_and_the_axis():
    nodes = [*along(0, 1), *(along(0, 1, 2) + 9.0)]
    rods, cables = [[0, 1], [3, 2]], [[3, 4]]
    with pytest.raises(InputError, match="part of 3 nodes around this node along y") as told:
        check_restrained(
            network(nodes, rods, cables, {0: ALL, 3: [True, False, True, True, True, True], 1: ALL})
        )
    assert told.value.where == "nodes[2]"
    with pytest.raises(InputError, match="part of 2 nodes around this node along x") as told:
        check_restrained(network(nodes, rods, cables, {1: [False] + [True] * 5, 3: ALL}))
    assert told.value.where == "nodes[0]"
    check_restrained(network(nodes, rods, cables, {0: ALL, 3: [True] * 3 + [False] * 3}))


def test_elements_that_join_the_same_two_nodes_in_either_direction_are_counted_and_the_first_pair_named():
    nodes = [[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 1]]
    twice = network(nodes, [[0, 1], [1, 2], [2, 1], [2, 3], [0, 1]], [[0, 2], [2, 0]], held={0: ALL})
    told = [each for each in doubts(twice) if "all count" in each]
    assert told == [
        "2 beams join two nodes that another one joins, beams[2] beside beams[1] the first; all count.",
        "1 cable joins two nodes that another one joins, cables[1] beside cables[0] the first; all count.",
    ]
    once = network(nodes, [[0, 1], [1, 2], [2, 3]], [[0, 1], [1, 2]], held={0: ALL})
    assert not [each for each in doubts(once) if "all count" in each], "a cable beside a rod is usual"


def test_what_locks_two_layers_is_not_told_to_stand_beside_their_rods():
    """Of each design in two layers analyse told that all of its rods' elements stood beside others."""
    nodes = [[0, 0, 0], [1, 0, 0], [2, 0, 0], [2, 1, 0]]
    bent = network(nodes, [[0, 1], [1, 2], [2, 3]], held={0: ALL})
    stiffness = {"torsion": 0.0, "bending_y": 5.0, "bending_z": 0.0, "z_axis": [[0.0, 0.0, 1.0]] * 2}
    state, ends = at_rest(bent.nodes), np.array([[0, 1], [1, 2]])

    def beside(axial):
        more = built_in(state, ends, axial=axial, kind="lock", **stiffness)
        told = doubts(replace(bent, beams=joined(bent.beams, more)))
        return [each for each in told if "all count" in each]

    assert beside(0.0) == []
    assert beside(1.0) == [
        "2 beams join two nodes that another one joins, beams[3] beside beams[0] the first; all count."
    ]


def test_nodes_in_one_place_are_counted_and_the_first_pair_named():
    nodes = [[0, 0, 0], [1, 0, 0], [1, 2, 0], [1, 0, 0], [0, 2, 1]]
    beside = network(nodes, [[0, 1], [1, 2], [0, 3], [0, 4]], held={0: ALL})
    (told,) = [each for each in doubts(beside) if "where another one does" in each]
    assert told.startswith("1 node lies where another one does, nodes[1] and nodes[3] the first")


@pytest.mark.parametrize(
    ("stiffness", "tie", "stiff", "soft", "most", "ratio"),
    [  # rods of 2 m: EA/l = EA/2, 12 EI/l³ = 1.5 EI; the cable's is EA/l0
        ([STIFF, (1.0, 1.0, 2.0, 1e-7)], (0.5, 187.0), "beams[0]", "beams[1]", 1.5e6, 1e13),
        ([(3e6, 1, 1e-7, 2.0), STIFF], (0.5, 187.0), "beams[0]", "beams[0]", 1.5e6, 1e13),
        ([STIFF, (1e-7, 1, 2.0, 2.0)], (0.5, 187.0), "beams[0]", "beams[1]", 1.5e6, 3e13),
        ([(4.0, 1, 6e6, 2.0), STIFF], (0.25, 1e-7), "beams[0]", "cables[0]", 9e6, 2.25e13),
        ([(4.0, 1, 2.0, 2.0), (4.0, 1, 2.0, 4.0)], (0.25, 1e13), "cables[0]", "beams[0]", 4e13, 2e13),
        ([(1e-7, 1, 2.0, 2.0), (4.0, 1, 2.0, 4e5)], (0.25, 30.0), "beams[1]", "beams[0]", 6e5, 1.2e13),
    ],
)
def test_stiffnesses_too_far_apart_are_told_with_both_elements_and_their_ratio(
    stiffness, tie, stiff, soft, most, ratio
):
    nodes = [[0, 0, 0], [2, 0, 0], [2, 2, 0]]
    (told,) = doubts(network(nodes, [[0, 1], [1, 2]], [[0, 2]], stiffness=stiffness, tie=tie))
    assert told.startswith(f"{stiff} ({number(most, 2)} N/m) is {number(ratio, 2)} times as stiff as {soft};")


def test_a_million_of_millions_between_stiffnesses_is_too_much_and_what_adds_nothing_isn_t_counted():
    nodes = [[0, 0, 0], [2, 0, 0], [2, 2, 0]]

    def built(ratio):
        return network(
            nodes, [[0, 1], [1, 2]], stiffness=[(3e6, 1, 2, 2), (3e6, 1, 2, 1e6 / ratio)], tie=(0.5, 187.0)
        )

    assert doubts(built(0.95e12)) == []
    assert "times as stiff" in doubts(built(1.05e12))[0]
    far = built(1.05e12)
    none = replace(far, beams=replace(far.beams, bending_y=np.array([0.0, 2.0])))
    assert doubts(none) == doubts(far)
    near = built(0.95e12)
    assert doubts(replace(near, beams=replace(near.beams, bending_y=np.array([0.0, 2.0])))) == []
    assert doubts(network(nodes[:1])) == []


def test_displacements_of_what_is_not_fixed_are_told_to_count_for_nothing():
    both = network([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]], [[0, 1]])
    fixed, imposed = np.zeros((2, 6), dtype=bool), np.zeros((2, 6))
    fixed[1, :2], imposed[1, :2] = True, 0.01
    held = replace(both, fixed=fixed, imposed=imposed)
    assert not [each for each in doubts(held) if "imposed" in each]
    (told,) = [each for each in doubts(replace(held, fixed=fixed & (np.arange(6) < 1))) if "imposed" in each]
    assert "nodes[1] the first" in told


@pytest.mark.parametrize(
    ("rest", "told"),
    [
        ([2.9, 3.0], None),
        ([3.0, 6.1], "beams[1] the first (6.1 m over 3 m)"),
        ([3.0, 5.9], None),
        ([1.45, 1.55], "beams[0] the first (1.45 m over 3 m)"),
        ([1.55, 3.0], None),
    ],
)
def test_a_rest_length_of_more_than_twice_or_less_than_half_the_distance_is_told(rest, told):
    nodes = [[0, 0, 5], [3, 0, 5], [3, 3, 5]]
    found = [each for each in doubts(network(nodes, [[0, 1], [1, 2]], rest=rest)) if "rest lengths" in each]
    if told is None:
        assert found == []
    else:
        assert found[0].startswith("1 beams have")
        assert told in found[0]


def spins(structure):
    """How many rods are told to be free to spin, and where the first is."""
    told = " ".join(doubts(structure))
    found = re.search(r"(\d+) straight rods are free to spin .* nodes\[(\d+)\]", told)
    return None if found is None else tuple(map(int, found.groups()))


def test_straight_rods_that_nothing_keeps_from_spinning_are_counted_and_the_first_is_named():
    """Of three rods the second is crooked; all lie askew, away from the origin."""
    crooked = along(0, 1, 2, 3) + 9.0
    crooked[3, 0] += 0.01
    other = np.array([-4.0, 6.0, 2.0]) + np.outer([0, 1, 2], [-1.0, 0.5, 2.0])
    nodes = [*crooked, *along(0, 1, 3, 4), *other]
    rods = [[0, 1], [1, 2], [2, 3], [4, 5], [5, 6], [6, 7], [8, 9], [10, 9]]
    assert spins(network(nodes, rods, [[0, 4]])) == (2, 4)
    reversed_rods = [[b, a] for a, b in rods[::-1]]
    assert spins(network(nodes, reversed_rods)) == (2, 7)
    assert spins(network(nodes, rods[:3])) is None
    assert spins(network(nodes, [], [[0, 4], [4, 8]])) is None


@pytest.mark.parametrize(
    ("held", "free"),
    [
        ([True, True, True, False, False, True], True),  # about z, square to the rod
        ([True, True, True, True, False, False], False),
        ([True, True, True, False, True, False], False),
    ],
)
def test_a_held_turn_stops_the_spin_where_it_has_a_part_along_the_rod(held, free):
    nodes = along(0, 1, 3)
    assert spins(network(nodes, [[0, 1], [1, 2]], held={2: held})) == ((1, 0) if free else None)


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
def test_a_rod_is_straight_where_its_nodes_lie_off_its_axis_by_a_billionth_of_its_length(size):
    for off, straight in ((0.8e-9, True), (1.2e-9, False)):
        nodes = size * np.array([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [1.0, off, 0.0]])
        assert (spins(network(nodes, [[0, 1], [1, 2]])) is not None) == straight


GATE = ([[3.0, 0, 5], [4.0, 0, 5], [4.0, 1, 5], [3.0, 1, 5]], [[0, 1], [1, 2], [2, 3]])
HINGE, PART = [True, True, True, False, False, False], [False] * 6


@pytest.mark.parametrize(
    ("held", "cables", "swings"),
    [
        ({0: HINGE, 3: HINGE}, [], True),  # about the line through both
        ({0: HINGE}, [], True),
        ({0: HINGE, 2: HINGE, 3: HINGE}, [], False),
        ({0: HINGE, 3: HINGE, 1: [False, False, True, False, False, False]}, [], False),
        ({0: HINGE, 3: HINGE, 1: [True, False, False, False, False, False]}, [], True),  # in its plane only
        ({0: HINGE, 3: HINGE}, [[1, 4]], False),  # a cable may hold it
        ({0: [True, True, True, True, True, True]}, [], False),
        ({0: [True, True, True, False, True, False], 3: HINGE}, [], False),  # the hinges' line is y
        ({0: [True, True, True, True, False, True], 3: HINGE}, [], True),
    ],
)
def test_a_part_that_turns_about_its_supports_as_a_whole_is_told_to_swing(held, cables, swings):
    nodes, beams = GATE
    far = [[9.0, 9.0, 9.0]] if cables else []
    built = network([*nodes, *far], beams, cables)
    fixed = np.array([held.get(k, PART) for k in range(len(built.nodes))])
    found = swinging(replace(built, fixed=fixed))
    assert found.tolist() == ([0] if swings else [])


def test_a_straight_rod_between_hinges_spins_but_does_not_swing_and_one_on_a_hinge_does():
    points, rods = along(0, 1, 2, 3), [[0, 1], [1, 2], [2, 3]]
    for held, swings in (({0: HINGE, 3: HINGE}, []), ({1: HINGE}, [0])):
        fixed = np.array([held.get(k, PART) for k in range(4)])
        assert swinging(replace(network(points, rods), fixed=fixed)).tolist() == swings


def test_nodes_in_millimetres_are_told_beside_stiffness_in_newtons_and_metres():
    """Rods of 1 mm in radius over half a metre, and over five hundred; a hall in metres isn't doubted."""
    rods, stiffness = [[0, 1], [1, 2]], [125.7e3, 0.024, 0.031, 0.031]
    small, large = (
        network([[0, 0, 0], [0.25 * times, 0, 0], [0.5 * times, 0.1, 0]], rods, stiffness=stiffness)
        for times in (1.0, 1000.0)
    )
    assert not any("millimetres" in each for each in doubts(small))
    (told,) = [each for each in doubts(large) if "millimetres" in each]
    assert "over 500 m" in told
    assert "write metres, 0.5 in place of 500" in told
    hall = network([[0, 0, 0], [1, 0, 0], [200, 0, 0]], rods, stiffness=[1e9, 1e6, 2e6, 2e6])
    assert not any("millimetres" in each for each in doubts(hall))
