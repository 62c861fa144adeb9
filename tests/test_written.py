"""Files are written whole or not at all."""

import errno
import os

import numpy as np
import pytest

from shellform.arrays import read_arrays
from shellform.errors import InputError
from shellform.written import whole, write_arrays, write_text


def test_a_file_takes_its_place_when_it_is_whole(tmp_path):
    with whole(tmp_path / "new/a.txt", ".txt") as partial:
        partial.write_text("all of it")
        assert partial.suffix == ".txt"
        assert not (tmp_path / "new/a.txt").exists()
    assert (tmp_path / "new/a.txt").read_text() == "all of it"


def break_off(target, error):
    with whole(target) as partial:
        partial.write_text("half")
        raise error


def test_a_full_disk_is_said_and_leaves_what_was_there(tmp_path):
    target = tmp_path / "a.txt"
    target.write_text("before")
    with pytest.raises(InputError, match="No space left on device"):
        break_off(target, OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)))
    assert [path.name for path in tmp_path.iterdir()] == ["a.txt"]
    assert target.read_text() == "before"


def test_a_failure_of_any_kind_leaves_nothing_half_written(tmp_path):
    with pytest.raises(ZeroDivisionError):
        break_off(tmp_path / "a.txt", ZeroDivisionError())
    assert list(tmp_path.iterdir()) == []


def test_arrays_and_text_come_back_as_they_were_written(tmp_path):
    write_arrays(tmp_path / "new/a.npz", places=np.eye(3), name=np.array("ø"))
    back = read_arrays(tmp_path / "new/a.npz")
    assert (back["places"] == np.eye(3)).all()
    assert str(back["name"]) == "ø"
    with pytest.raises(InputError, match=r"a\.txt: has another ending"):
        write_arrays(tmp_path / "a.txt", places=np.eye(3))
    write_text(tmp_path / "a.csv", "ø 2 mm\n")
    assert (tmp_path / "a.csv").read_bytes() == "ø 2 mm\n".encode()
