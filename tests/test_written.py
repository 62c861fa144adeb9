"""Files are written whole or not at all."""

import errno
import os
import socket
import stat
import subprocess
import sys
import threading

import numpy as np
import pytest

from shellform.arrays import read_arrays
from shellform.errors import InputError
from shellform.written import (
    clear,
    is_partial,
    make_folder,
    refuse_unwritable,
    whole,
    write_arrays,
    write_named,
    write_text,
)


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


def test_names_that_python_could_not_read_are_written_as_they_were_given_or_refused(tmp_path):
    """As they come from the command line where LC_ALL is C, and from anywhere where they are no UTF-8."""
    write_text(tmp_path / "a.txt", "of Schüssel")
    assert (tmp_path / "a.txt").read_bytes() == "of Schüssel".encode()
    write_text(tmp_path / "a.txt", "of Sch\udcc3\udcbcssel")
    assert (tmp_path / "a.txt").read_bytes() == "of Schüssel".encode()
    with pytest.raises(InputError, match=r"a.txt: has letters that are no UTF-8.*udcff.*Rename the file"):
        write_text(tmp_path / "a.txt", "the shell\udcff stands")
    assert (tmp_path / "a.txt").read_bytes() == "of Schüssel".encode()
    with pytest.raises(InputError, match="the folder: has letters that are no UTF-8"):
        make_folder(tmp_path / "run\udcff")
    assert [file.name for file in tmp_path.iterdir()] == ["a.txt"]


def test_a_full_disk_is_said_and_leaves_what_was_there(tmp_path):
    target = tmp_path / "a.txt"
    target.write_text("before")
    with pytest.raises(InputError, match=r"No space left on device.*Free some space"):
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
    with pytest.raises(InputError, match=r"^\.: is a folder.*name of a file"):
        write_text(".", "nowhere")
    write_text(tmp_path / "a.csv", "ø 2 mm\n")
    assert (tmp_path / "a.csv").read_bytes() == "ø 2 mm\n".encode()


WRITER = """
import sys
from shellform.written import whole
with whole(sys.argv[1]) as partial:
    partial.write_text("half")
    print("begun", flush=True)
    sys.stdin.readline()
    partial.write_text("all of it")
"""


def writer(target):
    job = subprocess.Popen(
        [sys.executable, "-c", WRITER, target], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert job.stdout.readline() == "begun\n"
    return job


def test_what_another_process_is_writing_is_not_cleared_away(tmp_path):
    job = writer(tmp_path / "a.txt")
    clear(tmp_path)
    job.communicate("go on\n")
    assert job.returncode == 0
    assert [path.name for path in tmp_path.iterdir()] == ["a.txt"]
    assert (tmp_path / "a.txt").read_text() == "all of it"


def test_what_a_killed_process_was_writing_is_cleared_away(tmp_path):
    job = writer(tmp_path / "a.txt")
    job.kill()
    job.communicate()
    assert [is_partial(path) for path in tmp_path.iterdir()] == [True]
    clear(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_link_under_a_partial_name_is_not_followed_when_it_is_cleared(tmp_path):
    (tmp_path / "mine.txt").write_text("mine")
    (tmp_path / "a.part-0123.txt").symlink_to(tmp_path / "mine.txt")
    clear(tmp_path)
    assert (tmp_path / "mine.txt").read_text() == "mine"


def pipe(file):
    os.mkfifo(file)
    return file


def link(file, leads):
    file.symlink_to(leads)
    return file


def test_a_device_or_pipe_is_written_into_where_it_is_named_and_never_becomes_a_file(tmp_path):
    there = pipe(tmp_path / "pipe"), link(tmp_path / "link", tmp_path / "pipe")
    for place in there:
        read = []
        reader = threading.Thread(
            target=lambda read=read: read.append((tmp_path / "pipe").read_text()), daemon=True
        )
        reader.start()
        write_named(place, "all of it")
        reader.join(10)
        assert read == ["all of it"]
        with pytest.raises(InputError, match=r"is a device, a pipe or a socket.*Choose another name"):
            write_text(place, "all of it")
    assert sorted(each.name for each in tmp_path.iterdir()) == ["link", "pipe"]
    assert stat.S_ISFIFO((tmp_path / "pipe").stat().st_mode)
    assert (tmp_path / "link").is_symlink()


def test_a_reader_that_ends_too_early_is_told(tmp_path):
    place = pipe(tmp_path / "pipe")

    def read_a_little():
        with place.open("rb") as opened:
            opened.read(1)

    reader = threading.Thread(target=read_a_little, daemon=True)
    reader.start()
    with pytest.raises(InputError, match=r"Broken pipe.*let it read to the end"):
        write_named(place, 1_000_000 * "a")
    reader.join(10)


def test_what_cannot_be_written_into_is_told_and_stays(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # a socket's path has at most 107 letters
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind("socket")
        with pytest.raises(InputError, match=r"^socket: can't be written: .*Give the name of a file"):
            write_named("socket", "words")
    assert stat.S_ISSOCK(os.stat("socket").st_mode)


def test_where_nothing_could_be_written_is_told_before_anything_is_computed(tmp_path):
    (tmp_path / "file").write_text("mine")
    for place, told in (("file/in.json", "can't be written: Not a directory"), (".", "is a folder, no file")):
        with pytest.raises(InputError, match=told):
            refuse_unwritable(tmp_path / place)
    for place in (pipe(tmp_path / "pipe"), tmp_path / "file", tmp_path / "new.json", tmp_path / "new/a.json"):
        refuse_unwritable(place)
    assert (tmp_path / "file").read_text() == "mine"
    assert sorted(each.name for each in tmp_path.iterdir()) == ["file", "pipe"]


def test_a_link_is_followed_where_it_is_named_and_else_replaced(tmp_path):
    (tmp_path / "mine.txt").write_text("mine")
    named = link(tmp_path / "named.txt", tmp_path / "mine.txt")
    open_ended = link(tmp_path / "open.txt", "new.txt")
    found = link(tmp_path / "found.txt", tmp_path / "mine.txt")
    write_text(found, "ours")
    assert (tmp_path / "mine.txt").read_text() == "mine"
    assert not found.is_symlink()
    write_named(named, "results")
    write_named(open_ended, "more")
    assert (tmp_path / "mine.txt").read_text() == "results"
    assert (tmp_path / "new.txt").read_text() == "more"
    assert named.is_symlink()
    assert open_ended.is_symlink()


NAMED = "import sys; from shellform.written import write_named; write_named(sys.argv[1], 'ours')"


@pytest.mark.skipif(not os.path.exists("/proc/self/fd/1"), reason="standard output has no name here")
def test_standard_output_by_its_name_is_written_after_what_a_file_holds(tmp_path):
    output = link(tmp_path / "output", "/proc/self/fd/1")  # as /dev/stdout is
    (tmp_path / "all.txt").write_text("before, ")
    with (tmp_path / "all.txt").open("a") as out:
        subprocess.run([sys.executable, "-c", NAMED, output], stdout=out, check=True)
    assert (tmp_path / "all.txt").read_text() == "before, ours"
    piped = subprocess.run([sys.executable, "-c", NAMED, output], capture_output=True, check=True)
    assert piped.stdout == b"ours"
