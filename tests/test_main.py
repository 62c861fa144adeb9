"""What is done around the command line: letters that a terminal doesn't know, statuses, and Ctrl-C."""

import io
import os
import sys

import pytest

from shellform import __main__ as program
from shellform.cli import program as commands


class Left(BaseException):
    """In place of a process that is left."""


@pytest.fixture
def ended(monkeypatch):
    def leave(status):
        raise Left(status)

    monkeypatch.setattr(os, "_exit", leave)
    flushed = []
    monkeypatch.setattr(program, "_flush", flushed.append)

    def run(what):
        def command():
            if what is not None:
                raise what

        monkeypatch.setattr(commands, "main", command)
        flushed.clear()
        try:
            program.main()
        except Left as left:
            assert flushed == [sys.stdout, sys.stderr], "what was printed is written before"
            return "left", left.args[0]
        except SystemExit as end:
            assert flushed == []
            return "ended", end.code
        return "left" if flushed else "returned"

    return run


def test_a_command_s_status_is_that_of_the_process(ended):
    assert ended(SystemExit(3)) == ("ended", 3)
    assert ended(SystemExit(0)) == ("ended", 0)
    assert ended(SystemExit("words")) == ("ended", "words")


def test_ctrl_c_ends_the_process_at_once_with_130_wherever_it_was_heard(ended, capsys):
    assert ended(KeyboardInterrupt()) == ("left", 130)
    assert capsys.readouterr().err == "shellform: stopped\n"
    assert ended(SystemExit(130)) == ("left", 130)
    assert capsys.readouterr().err == "", "the command has said so itself"


def test_letters_that_a_terminal_does_not_know_become_question_marks(ended, monkeypatch):
    narrow = io.TextIOWrapper(io.BytesIO(), encoding="ascii")
    monkeypatch.setattr(sys, "stdout", narrow)
    monkeypatch.setattr(sys, "stderr", object())
    ended(SystemExit(0))
    print("ø 12 mm", end="")
    narrow.flush()
    assert narrow.buffer.getvalue() == b"? 12 mm"


def test_nobody_is_left_to_read_what_is_flushed():
    class Gone:
        def flush(self):
            raise BrokenPipeError

    program._flush(Gone())
    closed = io.StringIO()
    closed.close()
    program._flush(closed)
