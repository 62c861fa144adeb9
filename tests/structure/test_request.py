"""What an analysis is asked for: bounds of each number, the case that is meant, and where moved supports
are."""

from types import SimpleNamespace

import numpy as np
import pytest

from shellform.errors import InputError
from shellform.structure.answers.request import (
    check_imposed_turns,
    check_request,
    chosen_load,
    with_supports_moved,
)
from shellform.structure.elements.state import from_vectors

SOUND = {
    "factor": -3.5,
    "increments": 4,
    "tolerance": 1e-9,
    "method": "path",
    "lead": (6, 2, -0.05),
    "limit": 30,
    "mode_count": 3,
    "critical_to": 3.0,
    "node_count": 7,
}


def test_sound_requests_pass_to_their_bounds():
    check_request(**SOUND)
    for other in (
        {"factor": 0.0},
        {"tolerance": 0.99},
        {"lead": None},
        {"lead": (0, 0, 2.0)},
        {"increments": 1_000_000},
        {"increments": 1, "limit": 1},
        {"mode_count": 0},
        {"critical_to": None},
        {"critical_to": -2.0},
        {"method": "newton", "lead": None},
    ):
        check_request(**SOUND | other)


@pytest.mark.parametrize(
    ("other", "where"),
    [
        ({"factor": np.inf}, "--factor"),
        ({"factor": np.nan}, "--factor"),
        ({"tolerance": 0.0}, "--tolerance"),
        ({"tolerance": 1.0}, "--tolerance"),
        ({"tolerance": 1.5}, "--tolerance"),
        ({"method": "Newton"}, "--method"),
        ({"lead": (7, 2, -0.05)}, "--lead"),
        ({"lead": (-1, 2, -0.05)}, "--lead"),
        ({"lead": (6, 3, -0.05)}, "--lead"),
        ({"lead": (6, 2, 0.0)}, "--lead"),
        ({"lead": (6, 2, np.inf)}, "--lead"),
        ({"lead": (6, 2, np.nan)}, "--lead"),
        ({"lead": (6, 2)}, "--lead"),
        ({"method": "relaxation"}, "--lead"),
        ({"critical_to": 0.0}, "--critical"),
        ({"critical_to": 1e-300}, "--critical"),
        ({"critical_to": -9e-31}, "--critical"),
        ({"critical_to": 1.1e30}, "--critical"),
        ({"factor": 1e-300}, "--factor"),
        ({"factor": -1e300}, "--factor"),
        ({"lead": (6, 2, 1e-300)}, "--lead"),
        ({"critical_to": np.nan}, "--critical"),
        ({"critical_to": np.inf}, "--critical"),
        ({"critical_to": "3"}, "--critical"),
        ({"factor": "2"}, "--factor"),
        ({"limit": 0}, "--limit"),
        ({"mode_count": -1}, "--modes"),
        ({"mode_count": 2.0}, "--modes"),
        ({"increments": 1_000_001}, "--increments"),
    ],
)
def test_numbers_beyond_their_bounds_are_refused_by_their_option(other, where):
    with pytest.raises(InputError) as told:
        check_request(**SOUND | other)
    assert where in str(told.value)


def test_the_remedy_for_a_lead_names_a_node_of_this_structure():
    with pytest.raises(InputError, match=r"3:z:-0.05, of nodes from 0 to 6"):
        check_request(**SOUND | {"lead": (99, 0, 1.0)})


def model(**loads):
    return SimpleNamespace(loads=loads, network=SimpleNamespace(nodes=np.zeros((2, 3))))


def test_the_load_is_the_case_named_or_the_only_one_and_none_is_no_load_unless_a_case_has_that_name():
    wind, snow = np.full((2, 6), 3.0), np.full((2, 6), -5.0)
    assert chosen_load(model(wind=wind), None) is wind
    assert chosen_load(model(wind=wind, snow=snow), "snow") is snow
    assert chosen_load(model(none=wind, snow=snow), "none") is wind
    for empty in (chosen_load(model(), None), chosen_load(model(wind=wind), "none")):
        assert (empty.shape, empty.any()) == ((2, 6), False)
    with pytest.raises(InputError, match=r"several load cases.*--load: wind, snow"):
        chosen_load(model(wind=wind, snow=snow), None)
    with pytest.raises(InputError, match=r"no such load case.*Known: wind, snow"):
        chosen_load(model(wind=wind, snow=snow), "rain")
    with pytest.raises(InputError, match=r"no such load case.*Known: none"):
        chosen_load(model(), "rain")


def held(fixed, imposed):
    return SimpleNamespace(
        nodes=np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]),
        fixed=np.array(fixed, dtype=bool),
        imposed=np.array(imposed, dtype=float),
    )


def test_supports_are_moved_along_what_they_hold_and_turned_where_they_hold_all_turns():
    network = held(
        [[1, 0, 1, 0, 1, 0], [0, 0, 0, 1, 1, 1]], [[0.1, 9.0, -0.3, 0, 0, 0], [9.0, 9.0, 9.0, 0.2, 0.3, -0.4]]
    )
    there = from_vectors([[10.0, 20.0, 30.0], [40.0, 50.0, 60.0]], [[0.5, 0.0, 0.1], [0.0, 0.6, 0.0]])
    found = with_supports_moved(network, there)
    assert found.positions == pytest.approx(np.array([[1.1, 20.0, 2.7], [40.0, 50.0, 60.0]]))
    assert found.rotations == pytest.approx(np.array([[0.5, 0.0, 0.1], [0.2, 0.3, -0.4]]))
    assert there.positions[0, 0] == 10.0, "the start itself stays"


def test_a_turn_can_be_imposed_where_all_turns_are_held_alone():
    check_imposed_turns(
        held([[0, 0, 0, 1, 1, 1], [1, 1, 1, 1, 0, 0]], [[0, 0, 0, 0.1, 0, 0.2], [0.5, 0, 0, 0, 0, 0]])
    )
    with pytest.raises(InputError, match="all three rotations") as told:
        check_imposed_turns(
            held([[1] * 6, [1, 1, 1, 1, 1, 0]], [[0, 0, 0, 0.1, 0, 0.2], [0, 0, 0, 0.1, 0, 0]])
        )
    assert told.value.where == "supports at node 1"
    check_imposed_turns(held([[1] * 6, [1, 1, 1, 0, 0, 0]], [[0, 0, 0, 0.1, 0, 0.2], [0, 0, 0, 0.1, 0, 0]]))
