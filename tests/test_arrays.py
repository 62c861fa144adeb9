"""What is checked at the door of the package."""

import collections.abc
import copy
import inspect
import os
import pickle
import pkgutil
import sys
import typing
from dataclasses import fields, is_dataclass
from functools import cache
from importlib import import_module

import numpy as np
import pytest
from scipy import sparse

import shellform
from shellform.arrays import Record, flags, indices, read_arrays, reals
from shellform.errors import Damaged, InputError
from shellform.structure.answers.increments import Reached


@pytest.mark.parametrize("wrong", [0.0, -1.0])
def test_one_number_that_isn_t_positive_among_others_is_refused(wrong):
    with pytest.raises(InputError, match=r"EA\(1,\) must be above zero"):
        reals("EA", [1.0, wrong, 2.0], (3,), positive=True)
    np.testing.assert_array_equal(reals("EA", [1.0, 3.0], (2,), positive=True), [1.0, 3.0])


@pytest.mark.parametrize("wrong", [-1, 3])
def test_one_index_out_of_range_among_others_is_refused(wrong):
    with pytest.raises(InputError, match=r"nodes\(1,\) is out of range"):
        indices("nodes", [0, wrong, 2], (3,), below=3)
    assert indices("nodes", [0, 1, 2], (3,), below=3).tolist() == [0, 1, 2]


@pytest.mark.parametrize("wrong", [np.ones((2, 2)), np.ones(3), np.ones((1, 2, 3)), 1.0])
def test_what_has_another_shape_is_refused(wrong):
    with pytest.raises(InputError, match="places has the wrong shape"):
        reals("places", wrong, (None, 3))


def test_one_number_stands_for_all_where_their_count_is_known_but_a_row_of_one_does_not():
    np.testing.assert_array_equal(reals("EA", 2.0, (3,)), [2.0, 2.0, 2.0])
    with pytest.raises(InputError, match="EA has the wrong shape"):
        reals("EA", [2.0], (3,))


def test_numbers_and_indices_that_are_none_are_refused_with_where_they_stand_and_what_is_wanted():
    with pytest.raises(InputError, match=r"places\(1, 2\) is not finite \(found nan\)"):
        reals("places", [[0.0, 1.0, 2.0], [3.0, 4.0, np.nan]], (None, 3))
    with pytest.raises(InputError, match=r"places\(0, 1\) is not finite \(found -inf\)"):
        reals("places", [[0.0, -np.inf, 2.0], [3.0, 4.0, np.nan]], (None, 3))
    with pytest.raises(InputError, match=r"EA must be numbers.*an array of shape \(any, 3\)"):
        reals("EA", "thick", (None, 3))
    with pytest.raises(
        InputError, match=r"nodes\(0, 1\) is out of range \(found 7\). Indices run from 0 to 6\."
    ):
        indices("nodes", [[0, 7], [-1, 2]], (None, 2), below=7)
    with pytest.raises(InputError, match=r"nodes must be whole numbers \(found '\[1\.0\]'\)"):
        indices("nodes", [1.0], (1,), below=7)
    with pytest.raises(InputError, match=r"fixed must be true or false"):
        flags("fixed", [1, 0], (2,))


def test_rows_of_different_lengths_are_refused_and_so_is_nothing_where_a_count_is_known():
    with pytest.raises(InputError, match=r"nodes has rows of different lengths.*shape \(any, 2\)"):
        indices("nodes", [[0, 1], [1]], (None, 2), below=3)
    with pytest.raises(InputError, match="fixed has rows of different lengths"):
        flags("fixed", [[True], [True, False]], (None, 2))
    with pytest.raises(InputError, match=r"nodes has the wrong shape \(found \(0,\)\)"):
        indices("nodes", [], (4,), below=3)
    assert indices("nodes", [], (None, 2), below=3).shape == (0, 2)
    with pytest.raises(InputError, match=r"nodes\(0,\) is out of range \(found 9223372036854775808\)"):
        indices("nodes", np.array([2**63], dtype=np.uint64), (1,), below=3)


def test_what_was_found_is_told_up_to_sixty_letters():
    for count, whole in ((57, True), (58, False), (90, False)):
        text = "y" * count
        with pytest.raises(InputError) as told:
            reals("EA", text, (1,))
        assert told.value.value == (repr(text) if whole else "'" + "y" * 56 + "...")


def test_nothing_given_is_an_array_of_no_rows_where_their_count_is_free():
    assert reals("places", [], (None, 3)).shape == (0, 3)
    assert indices("ends", [], (None, 2), below=0).shape == (0, 2)
    assert indices("ends", [], (None, 2), below=0).dtype == np.int64
    assert flags("fixed", np.zeros((0, 6), dtype=bool), (None, 6)).shape == (0, 6)
    for make in (lambda: reals("places", [], (2, 3)), lambda: flags("fixed", [True, False], (3,))):
        with pytest.raises(InputError, match="wrong shape"):
            make()


def test_an_array_is_a_copy_that_nobody_can_write_to():
    given = np.arange(6.0).reshape(2, 3)
    kept = reals("places", given, (None, 3))
    given[0, 0] = 9.0
    assert kept[0, 0] == 0.0
    for each in (kept, indices("a", [1], (1,), below=2), flags("b", [True], (1,))):
        with pytest.raises(ValueError, match="read-only"):
            each[...] = 1
    assert flags("fixed", True, (2, 3)).tolist() == [[True] * 3] * 2


def test_a_file_of_arrays_that_is_missing_broken_or_lacks_one_says_to_run_again(tmp_path):
    file = tmp_path / "a.npz"
    with pytest.raises(InputError, match=r"a\.npz: isn't there.*shellform design .* --fresh"):
        read_arrays(file)
    np.savez(file, places=np.eye(3))
    with pytest.raises(Damaged, match=r"a\.npz: is damaged: lengths is missing"):
        read_arrays(file)["lengths"]
    file.write_bytes(file.read_bytes()[:100])
    with pytest.raises(Damaged, match=r"a\.npz: is damaged: .*shellform design .* --fresh"):
        read_arrays(file)
    np.savez(file, places=np.array([{}], dtype=object))
    with pytest.raises(Damaged, match="is damaged"):
        read_arrays(file)


def test_a_broken_file_of_arrays_is_not_left_open(tmp_path):
    file = tmp_path / "a.npz"
    np.savez(file, places=np.eye(3))
    file.write_bytes(file.read_bytes()[:100])
    before = os.listdir("/dev/fd")
    with pytest.raises(Damaged) as told:
        read_arrays(file)
    assert os.listdir("/dev/fd") == before, "while somebody still looks at what was said"
    assert told.value.where == str(file)


@cache
def dataclasses() -> list[type]:
    """Every dataclass of the package, public or not."""
    modules = [import_module(each.name) for each in pkgutil.walk_packages(shellform.__path__, "shellform.")]
    classes = [each for module in modules for each in vars(module).values() if inspect.isclass(each)]
    return [each for each in dict.fromkeys(classes) if is_dataclass(each)]


@cache
def held(made: type) -> list[object]:
    """What the fields of a dataclass hold, classes that are imported for type checkers only included."""
    known = {name for each in made.__mro__ for name in vars(sys.modules[each.__module__])}
    unknown = {each.__name__: each for each in dataclasses() if each.__name__ not in known}
    hints = typing.get_type_hints(made, localns={"ClassVar": typing.ClassVar, **unknown})
    return [hints[each.name] for each in fields(made)]


def holds(hint: object, *, within: bool, seen: tuple[object, ...] = ()) -> bool:
    """Whether a value of this type holds arrays: itself, in a tuple or a mapping, or `within` a record."""
    kind = typing.get_origin(hint) or hint
    parts = typing.get_args(hint)
    if kind is collections.abc.Callable or kind in seen:
        return False
    if inspect.isclass(kind) and issubclass(kind, np.ndarray | sparse.sparray if within else np.ndarray):
        return True
    if is_dataclass(kind):
        parts, seen = (held(kind) if within else []), (*seen, kind)
    return any(holds(part, within=within, seen=seen) for part in parts)


def test_every_dataclass_that_holds_arrays_equals_itself_only_and_keeps_them_read_only_in_copies():
    compared, writable, seen = [], [], set()
    for made in dataclasses():
        if any(holds(each, within=True) for each in held(made)):
            seen.add(made.__name__)
            if made.__eq__ is not object.__eq__ or made.__hash__ is not object.__hash__:
                compared.append(f"{made.__module__}.{made.__name__}")
        own = made.__dataclass_params__.frozen and any(holds(each, within=False) for each in held(made))
        if own and not issubclass(made, Record):
            writable.append(f"{made.__module__}.{made.__name__}")
    assert {"Design", "Gridshell", "Net", "Optimum", "Measurement", "Run"} <= seen
    assert not compared, "pass eq=False to @dataclass: " + ", ".join(compared)
    assert not writable, "derive from arrays.Record: " + ", ".join(writable)


def test_a_record_of_arrays_is_found_among_others_by_which_it_is(dome):
    design, other = dome.design(rest_ratio=0.98), dome.design(rest_ratio=0.98)
    assert design in [other, design]
    assert design != other
    assert {design: "one", other: "another"}[design] == "one"
    assert len({dome, dome.net, dome.net.grid, dome}) == 3


@pytest.mark.parametrize("again", [lambda each: pickle.loads(pickle.dumps(each)), copy.deepcopy, copy.copy])
def test_the_arrays_of_a_copied_or_unpickled_record_stay_read_only(dome, again):
    shell, design = again(dome), again(dome.design())
    rod = shell.net.grid.rods[0]
    moved = again(Reached(1.0, 3, {5: reals("moved", [0.0, 0.0, -0.1], (3,))}, True, 0)).displacements[5]
    for array in (shell.cable_ends, shell.target.positions, rod.nodes, design.rest_length, moved):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0
    np.testing.assert_array_equal(rod.arc, dome.net.grid.rods[0].arc)
    assert shell.rod == dome.rod
